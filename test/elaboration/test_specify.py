# Copyright 2026 The fret_monitor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""Whole bundles become specifications, or all their mistakes are reported together."""

from fractions import Fraction
from pathlib import Path
import struct
import time

from fret_monitor.bundle.bundle import InstanceVariable
from fret_monitor.bundle.reader import parse_bundle, survey_bundle
from fret_monitor.elaboration.elaborate import specify
from fret_monitor.elaboration.instances import described_variable
from fret_monitor.elaboration.scope import Declaration, Role, Scope
from fret_monitor.elaboration.terms import TypedTerm
from fret_monitor.logic.formula import (
    ALWAYS, Binary, BinaryOperator, Constant, FALSE, Formula, Historically, Once, postorder,
    Variable, Window,
)
from fret_monitor.logic.printing import to_smv
from fret_monitor.logic.specification import Specification
from fret_monitor.messages.layout import MessageLayout
from fret_monitor.model.diagnostics import CompileError, Problems, Source, Span, Text
from fret_monitor.model.policies import Policy, Report, Severity
from fret_monitor.model.values import ValueType
import golden
import pytest
from stages import parse_message, scope_of

DEFINITIONS = {
    'std_msgs/msg/Bool': 'bool data',
    'std_msgs/msg/Float32': 'float32 data',
    'std_msgs/msg/Int8': 'int8 data',
    'std_msgs/msg/Int32': 'int32 data',
    'std_msgs/msg/Int64': 'int64 data',
    'std_msgs/msg/String': 'string data',
    'std_msgs/msg/UInt8': 'uint8 data',
    'geometry_msgs/msg/Pose': 'Point position\nQuaternion orientation',
    'geometry_msgs/msg/Point': 'float64 x\nfloat64 y\nfloat64 z',
    'geometry_msgs/msg/Quaternion': 'float64 x\nfloat64 y\nfloat64 z\nfloat64 w',
    'demo_msgs/msg/Order':
        'bool[2] flags\nint8[<=1] small\nuint8[] bytes\nfloat32[] reals\nstring<=4 name\n'
        'string[] names\ngeometry_msgs/Point[] points\nint16 number\nDuty duty',
    'demo_msgs/msg/Duty': '',
    'demo_msgs/msg/Scan': 'byte[4] bits\nfloat32[] ranges\nstring name',
    'demo_msgs/msg/Laser': 'Header header\nfloat32 least\nfloat32[] ranges\nfloat32[] strengths',
    'demo_msgs/msg/Path': 'Header header\ngeometry_msgs/Pose[] poses',
    'demo_msgs/msg/Placed': 'Header header\ngeometry_msgs/Pose pose',
    'demo_msgs/msg/Area': 'geometry_msgs/Point[] points',
    'demo_msgs/msg/Sweep':
        'float32 angle_min\nfloat32 angle_increment\nfloat32 range_max\nfloat32[] ranges',
    'demo_msgs/msg/Status': 'byte level\nstring name\nstring message',
    'demo_msgs/msg/Statuses': 'Status[] status',
    'demo_msgs/msg/Joints': 'Header header\nstring[] name\nfloat64[] position',
    'demo_msgs/msg/Battery':
        'uint8 POWER_ON = 1\nuint8 POWER_OFF = 0x0\nuint8 POWER_STATE_LOST=7\n'
        'uint8 HEALTH_GOOD=1\nuint8 FLAT=1\nuint8 HEALTH_DEAD=2\nint16 LEFT=-3\n'
        'float32 MOST=9\nstring NEW="new"\nstring OLD = old\nstring USED="old"\n'
        'uint8 power\nuint8 power_state\nbyte health\nint16[] side\nstring age\n'
        'float32 charge',
    'demo_msgs/msg/Lost': 'gone_msgs/Gone gone\nint8 x',
    'demo_msgs/msg/Loop': 'Loop[] again\nint8 x',
    'demo_msgs/srv/Switch': 'bool on\n---\nbool success',
    'demo_msgs/srv/Other': 'bool on\n---\nbool success',
    'demo_msgs/action/Count': 'int32 order\n---\nint32 total\n---\nint32[] so_far',
    'builtin_interfaces/msg/Time': 'int32 sec\nuint32 nanosec',
    'service_msgs/msg/ServiceEventInfo': 'uint8 event_type\nbuiltin_interfaces/Time stamp',
    'std_msgs/msg/Header': 'builtin_interfaces/Time stamp\nstring frame_id',
    'unique_identifier_msgs/msg/UUID': 'uint8[16] uuid',
}


@pytest.fixture(autouse=True)
def messages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Install message definitions, and no others."""
    for name, text in DEFINITIONS.items():
        package, kind, message = name.split('/')
        folder = tmp_path / 'share' / package / kind
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f'{message}.{kind}').write_text(text, encoding='utf-8')
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path))
    monkeypatch.setattr('sys.prefix', str(tmp_path))


def specified(text: str) -> Specification:
    """Return the specification of a bundle, given without its first line."""
    return specify(parse_bundle(Source('bundle.yaml', 'format: 1\n' + text), Path()))[0]


@pytest.mark.parametrize('path', golden.cases('types'), ids=lambda path: path.stem)
def test_the_messages_about_a_bundle_are_its_golden_file(
        path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(path.parent)
    problems = Problems()
    bundle = survey_bundle(Path(path.name), problems)
    assert bundle is not None
    try:
        _, told = specify(bundle, None, problems)
    except CompileError as error:
        told = error.diagnostics
    golden.check(path, ''.join(item.render() + '\n' for item in told))


def test_the_running_example_is_the_formula_that_it_means() -> None:
    result = specified("""
component: ROS_component
constants: {cc_t: 15.0, ws_t: 8.0}
inputs:
  current_consumption: {topic: motor/current, type: std_msgs/msg/Float32, field: data}
  wind_speed: {topic: windspeed, type: std_msgs/msg/Float32}
definitions:
  overload: current_consumption > cc_t & wind_speed > ws_t
evaluation: {policy: periodic, rate: 10}
report: onset
requirements:
  - id: ROS-002
    title: no overload
    severity: warn
    ptltl: >-
      H (overload ->
      (O[0,20] (current_consumption <= cc_t)))
""")
    current = Variable('current_consumption', ValueType.FLOAT32)
    wind = Variable('wind_speed', ValueType.FLOAT32)

    def compare(operator: str, left: Formula, value: float) -> Binary:
        return Binary(BinaryOperator(operator), left, Constant(value, ValueType.FLOAT32))

    overload = Binary(BinaryOperator.AND, compare('>', current, 15.0), compare('>', wind, 8.0))
    (found,) = result.properties
    assert found.formula is Historically(ALWAYS, Binary(
        BinaryOperator.IMPLIES, overload, Once(Window(0, 20), compare('<=', current, 15.0))))
    assert (found.id, found.handler) == ('ROS-002', 'handlerpropROS_002')
    assert found.text == 'H (overload -> (O[0,20] (current_consumption <= cc_t)))'
    assert (found.title, found.report, found.severity) == (
        'no overload', Report.ONSET, Severity.WARN)
    assert found.place is not None
    assert found.place.line == 17
    assert result.definitions == (('overload', overload),)
    assert (result.component, result.policy, result.period) == (
        'ROS_component', Policy.PERIODIC, Fraction(1, 10))
    assert [(item.name, item.topic, item.message_type, item.path) for item in result.signals] == [
        ('current_consumption', 'motor/current', 'std_msgs/msg/Float32', ('data',)),
        ('wind_speed', 'windspeed', 'std_msgs/msg/Float32', ('data',))]


def test_an_input_has_the_type_of_its_field() -> None:
    result = specified("""
inputs:
  z: {topic: pose, type: geometry_msgs/msg/Pose, field: position.z}
  bits: {topic: scan, type: demo_msgs/msg/Scan, field: "bits[3]", initial: 255}
  near: {topic: scan, type: demo_msgs/msg/Scan, field: "ranges[12]", initial: 0.1}
  name: {topic: scan, type: demo_msgs/msg/Scan, field: name,
         values: {A: "a", B: "it's b", C: "0"}, initial: B}
  text: {type: string, values: {NO: "no"}, initial: "no"}
  flag: {type: bool, initial: true}
  mode: {type: int8, values: {OFF: -1, ON: 1}, initial: OFF}
requirements:
  - {id: R, ptltl: "TRUE"}
""")
    kinds = {item.name: item.type.value for item in result.signals}
    assert kinds == {'z': 'float64', 'bits': 'uint8', 'near': 'float32', 'name': 'int32',
                     'text': 'int32', 'flag': 'bool', 'mode': 'int8'}
    paths = {item.name: item.path for item in result.signals if item.path}
    assert paths == {'z': ('position', 'z'), 'bits': ('bits', 3), 'near': ('ranges', 12),
                     'name': ('name',)}
    initial = {item.name: item.initial for item in result.signals}
    assert initial == {'z': None, 'bits': 255, 'near': 0.10000000149011612, 'name': 1, 'text': 0,
                       'flag': True, 'mode': -1}
    assert result.signals[3].values == (('A', 'a'), ('B', "it's b"), ('C', '0'))
    assert result.signals[6].values == (('OFF', -1), ('ON', 1))


def test_what_is_taken_of_a_field_decides_the_type() -> None:
    result = specified("""
inputs:
  stamp: {topic: laser, type: demo_msgs/msg/Laser, field: header.stamp}
  near: {topic: laser, type: demo_msgs/msg/Laser, field: min(ranges), initial: 0.1}
  far: {topic: laser, type: demo_msgs/msg/Laser, field: ' max ( ranges ) '}
  all: {topic: laser, type: demo_msgs/msg/Laser, field: sum(ranges)}
  beams: {topic: laser, type: demo_msgs/msg/Laser, field: len(ranges), values: {NONE: 0}}
  frame: {topic: laser, type: demo_msgs/msg/Laser, field: len(header.frame_id)}
  lit: {topic: scan, type: demo_msgs/msg/Scan, field: sum(bits)}
  bit: {topic: scan, type: demo_msgs/msg/Scan, field: min(bits)}
  away: {topic: path, type: demo_msgs/msg/Path, field: "norm(poses[2].position)"}
  mean: {topic: count, type: demo_msgs/action/Count_FeedbackMessage, field: mean(feedback.so_far)}
  total: {topic: count, type: demo_msgs/action/Count_FeedbackMessage, field: sum(feedback.so_far)}
  called: {topic: call, type: demo_msgs/srv/Switch_Event, field: "request[0].on"}
requirements:
  - {id: R, ptltl: "near < far & beams != NONE & called"}
""")
    found = {item.name: (item.reduction, item.type.value) for item in result.signals}
    assert found == {
        'stamp': ('seconds', 'float64'), 'near': ('min', 'float32'), 'far': ('max', 'float32'),
        'all': ('sum', 'float64'), 'beams': ('len', 'uint32'), 'frame': ('len', 'uint32'),
        'lit': ('sum', 'uint64'), 'bit': ('min', 'uint8'), 'away': ('norm', 'float64'),
        'mean': ('mean', 'float64'), 'total': ('sum', 'int64'), 'called': ('', 'bool')}
    paths = {item.name: item.path for item in result.signals}
    assert paths['away'] == ('poses', 2, 'position')
    assert paths['stamp'] == ('header', 'stamp')
    assert result.signals[1].initial == 0.10000000149011612


def test_the_constants_of_a_message_name_the_values_of_its_fields() -> None:
    result = specified("""
constants: {FLAT: 2}
definitions: {POWER_OFF: health = HEALTH_DEAD, dead: POWER_OFF}
inputs:
  power: {topic: b, type: demo_msgs/msg/Battery, field: power}
  health: {topic: b, type: demo_msgs/msg/Battery, field: health, initial: HEALTH_DEAD,
           values: {HEALTH_GOOD: 4, FINE: 2}}
  side: {topic: b, type: demo_msgs/msg/Battery, field: "side[0]"}
  age: {topic: b, type: demo_msgs/msg/Battery, field: age, initial: old}
  charge: {topic: b, type: demo_msgs/msg/Battery, field: charge}
  stated: {topic: b, type: demo_msgs/msg/Battery, field: age, values: {NEW: "brand-new"}}
requirements:
  - {id: A, ptltl: "power = POWER_ON | POWER_ON < power | power = HEALTH_DEAD"}
  - {id: B, ptltl: "health = HEALTH_GOOD | health = HEALTH_DEAD | health = FINE"}
  - {id: C, cocospec: "side = LEFT or LEFT = (0 -> pre side)"}
  - {id: D, fretish: the x shall always satisfy age != USED & age = NEW & stated = NEW}
  - {id: E, ptltl: "power = FLAT & dead"}
""")
    values = {item.name: dict(item.values) for item in result.signals}
    assert values == {
        'power': {'POWER_ON': 1, 'POWER_OFF': 0}, 'side': {'LEFT': -3}, 'charge': {},
        'health': {'HEALTH_GOOD': 4, 'FINE': 2, 'HEALTH_DEAD': 2},
        'age': {'NEW': 'new', 'OLD': 'old', 'USED': 'old'}, 'stated': {'NEW': 'brand-new'}}
    assert {item.name: item.initial for item in result.signals if item.initial is not None} == {
        'health': 2, 'age': 1}
    named = {item.name: item.values for item in result.signals}
    assert [to_smv(item.formula, None, named) for item in result.properties] == [
        'power = POWER_ON | POWER_ON < power | power = 2',
        'health = HEALTH_GOOD | health = FINE | health = FINE',
        'side = LEFT | LEFT = preInt(0, side)',
        'H (age != OLD & age = NEW & stated = NEW)',
        'power = 2 & health = FINE']  # what the bundle declares hides the constant


def test_a_constant_of_another_field_is_warned_of() -> None:
    _, warnings = specify(parse_bundle(Source('bundle.yaml', """format: 1
inputs:
  power: {topic: b, type: demo_msgs/msg/Battery, field: power}
  health: {topic: b, type: demo_msgs/msg/Battery, field: health, values: {POWER_ON: 3}}
requirements:
  - {id: A, ptltl: "power = POWER_ON & power = FLAT & health = POWER_ON"}
  - {id: B, ptltl: "power = POWER_STATE_LOST"}
"""), Path()))
    assert [(item.title, item.label, item.span.line) for item in warnings if item.span] == [
        ("'POWER_STATE_LOST' is a value of 'power_state' by its name", "and not of 'power'", 7)]


def test_a_constant_of_the_bundle_that_hides_one_of_the_message_is_warned_of() -> None:
    _, warnings = specify(parse_bundle(Source('bundle.yaml', """format: 1
constants: {POWER_ON: 7, POWER_OFF: 0}
inputs:
  power: {topic: b, type: demo_msgs/msg/Battery, field: power}
requirements:
  - {id: A, ptltl: "power = POWER_ON | power = POWER_OFF"}
"""), Path()))
    assert [(item.title, item.label, item.help, item.span.line)
            for item in warnings if item.span] == [
        ("'POWER_ON' is a constant and a value of 'power'", 'here it is a constant: 7',
         'give it another name; the value of the message is 1', 6)]


@pytest.mark.parametrize('names', [('first', 'x.y'), ('x.y', 'first')])
def test_definitions_come_in_any_order_also_as_fret_spells_their_names(
        names: tuple[str, str]) -> None:
    texts = {'first': 'x_DOT_y & p', 'x.y': 'p | q'}
    definitions = ', '.join(f'{name}: {texts[name]}' for name in names)
    result = specified(f"""
inputs: {{p: {{type: bool}}, q: {{type: bool}}}}
definitions: {{{definitions}}}
requirements:
  - {{id: R, ptltl: first}}
""")
    assert to_smv(result.properties[0].formula) == '(p | q) & p'


def test_a_cycle_of_definitions_is_found_in_either_spelling() -> None:
    with pytest.raises(CompileError, match="the definition 'first' uses itself"):
        specified("""
inputs: {p: {type: bool}}
definitions: {first: x_DOT_y, x.y: p | first}
requirements:
  - {id: R, ptltl: first}
""")


def test_a_definition_is_found_as_fret_spells_it_after_a_name_was_not() -> None:
    with pytest.raises(CompileError) as caught:
        specified("""
inputs: {p: {type: bool}}
definitions: {wrong: nope, x.y: p}
requirements:
  - {id: R, ptltl: x_DOT_y}
""")
    assert [item.title for item in caught.value.diagnostics] == ["'nope' is not declared"]


def test_an_equation_is_found_as_fret_spells_it_after_a_name_was_not() -> None:
    inner = Scope(outer=scope_of([Variable('a.b', ValueType.BOOL)]))
    assert inner.find('c_DOT_d') is None
    inner.declare('c.d', Declaration(Role.EQUATION, TypedTerm(FALSE, Span(Source('', ''), 0, 0))))
    assert inner.find('c_DOT_d') is inner.find('c.d') is not None
    assert inner.find('a_DOT_b') is inner.find('a.b') is not None


def test_a_value_beside_a_name_as_fret_spells_it_is_no_use_of_a_definition() -> None:
    # Otherwise LANDING would use itself, through the name of the value.
    result = specified("""
inputs: {x.state: {type: int8, values: {IDLE: 0, LANDING: 1}}}
definitions: {LANDING: x_DOT_state = LANDING}
requirements:
  - {id: R, ptltl: LANDING}
""")
    assert to_smv(result.properties[0].formula) == 'x.state = 1'


def test_the_quality_of_service_is_kept() -> None:
    result = specified("""
inputs:
  p: {topic: p, type: std_msgs/msg/Bool, qos: {reliability: best_effort, depth: 7}}
requirements:
  - {id: R, ptltl: p}
""")
    assert result.signals[0].qos == (('reliability', 'best_effort'), ('depth', 7))


def test_a_mistake_in_the_type_of_a_topic_is_reported_once() -> None:
    with pytest.raises(CompileError, match="has no message 'Nope'") as caught:
        specified("""
topics:
  flag: {type: std_msgs/msg/Nope, fields: {a: x, b: y}}
requirements:
  - {id: R, ptltl: a -> b}
""")
    assert len(caught.value.diagnostics) == 1


def test_a_startup_is_ten_seconds_or_the_timeout_if_that_is_longer() -> None:
    result = specified("""
inputs:
  none: {topic: a, type: std_msgs/msg/Bool}
  usual: {topic: b, type: std_msgs/msg/Bool, timeout: 0.5}
  slow: {topic: c, type: std_msgs/msg/Bool, timeout: 30}
  own: {topic: d, type: std_msgs/msg/Bool, timeout: 30, startup: 2}
requirements:
  - {id: R, ptltl: none}
""")
    assert [item.startup for item in result.signals] == [None, 10.0, 30.0, 2.0]


def test_a_number_of_a_message_has_the_range_of_its_type() -> None:
    def payload(number: str) -> bytes:
        result = specified(f"""
inputs:
  b: {{topic: a, type: std_msgs/msg/Bool}}
actions:
  send: {{publish: {{topic: c, type: std_msgs/msg/Float32, message: {{data: {number}}}}}}}
requirements:
  - {{id: R, ptltl: b, on_violation: [send]}}
""")
        return result.actions[0].payload[4:]

    assert payload('-3.4e38') == struct.pack('<f', -3.4e38)
    assert payload('1e-60') == struct.pack('<f', 0.0)
    with pytest.raises(CompileError) as caught:
        payload('3.5e38')
    assert caught.value.diagnostics[0].help == 'a number between -3.4e38 and 3.4e38'


def test_the_elements_of_a_list_of_a_message_are_published() -> None:
    text = """format: 1
inputs:
  go: {topic: a, type: my_msgs/msg/Go, field: go}
actions:
  send: {publish: {topic: c, type: my_msgs/msg/Go, message: {steps: [1, -2]}}}
requirements:
  - {id: R, ptltl: go, on_violation: [send]}
"""
    result, _ = specify(parse_bundle(Source('bundle.yaml', text), Path()),
                        lambda name: parse_message('bool go\nint32[] steps', 'my_msgs', 'Go'))
    assert result.actions[0].payload[8:] == struct.pack('<Iii', 2, 1, -2)


def test_messages_come_from_where_the_caller_says() -> None:
    asked = []

    def find(name: str) -> MessageLayout:
        asked.append(name)
        return parse_message('int16 level', 'my_msgs', 'Level')

    text = """format: 1
inputs:
  level: {topic: level, type: my_msgs/msg/Level}
requirements:
  - {id: R, ptltl: level > 3}
"""
    result, _ = specify(parse_bundle(Source('bundle.yaml', text), Path()), find)
    assert asked == ['my_msgs/msg/Level']
    assert result.signals[0].type is ValueType.INT16


def test_definitions_stand_in_any_order_and_mean_the_same_everywhere() -> None:
    result = specified("""
constants: {limit: 5}
inputs:
  p: {type: bool}
  x: {type: float32}
  n: {type: int32}
definitions:
  late: early & H early
  early: O[0,3] p
  twice: 2 * limit + 0.5
  level: x
  state: {cocospec: "p and YtoPre(p)"}
requirements:
  - {id: A, ptltl: late}
  - {id: B, ptltl: "(O[0,3] p) & H (O[0,3] p)"}
  - {id: C, ptltl: level > twice}
  - {id: D, ptltl: x > 10.5}
  - {id: E, ptltl: n > twice}
  - {id: F, ptltl: n > 10.5}
  - {id: G, ptltl: state}
  - {id: H1, ptltl: p & Y p}
""")
    formulas = [item.formula for item in result.properties]
    for one, other in zip(formulas[::2], formulas[1::2]):
        assert one is other


def test_a_definition_may_have_the_name_of_a_value() -> None:
    result = specified("""
inputs:
  state: {type: uint8, values: {IDLE: 0, LANDING: 1}}
definitions:
  LANDING: alias = LANDING
  alias: state
requirements:
  - {id: A, ptltl: LANDING}
  - {id: B, ptltl: state = 1}
""")
    assert result.properties[0].formula is result.properties[1].formula


def test_equations_of_several_requirements_do_not_mix() -> None:
    result = specified("""
inputs:
  p: {type: bool}
definitions:
  count: {cocospec: "n = 0 -> pre n + (if p then 1 else 0); result = n;"}
requirements:
  - {id: A, cocospec: "n = 0 -> pre n + 1; ok = n < 3;"}
  - {id: B, cocospec: "n = 0 -> pre n + 2; ok = n < 3 and count < 5;"}
  - {id: C, ptltl: "count < 3"}
""")
    first, second, third = (item.feedback for item in result.properties)
    assert [cell.name for cell, _ in first] == ['A.n']
    assert [cell.name for cell, _ in second] == ['B.n', 'count.n']
    assert third == second[1:]
    for item in result.properties:
        known = dict(item.feedback)
        for formula in (item.formula, *known.values()):
            cells = [node for node in postorder([formula]) if type(node).__name__ == 'Feedback']
            assert all(cell in known for cell in cells)


def test_feedback_behind_feedback_is_handed_out() -> None:
    result = specified("""
inputs:
  p: {type: bool}
requirements:
  - {id: A, cocospec: "a = p -> pre b; b = not p -> pre c; c = p -> pre a; ok = a;"}
""")
    assert {cell.name for cell, _ in result.properties[0].feedback} == {'A.a', 'A.b', 'A.c'}


def test_feedback_of_similar_names_is_distinct() -> None:
    result = specified("""
inputs:
  p: {type: bool}
definitions:
  A: {cocospec: "n = 0 -> pre n + 1; result = n;"}
requirements:
  - {id: A, cocospec: "n = 0 -> pre n + 2; ok = n < 3 and A > 1;"}
""")
    cells = [cell for cell, _ in result.properties[0].feedback]
    assert len(cells) == 2
    assert len({cell.name for cell in cells}) == 2


def test_a_long_chain_of_definitions_costs_no_recursion() -> None:
    chain = '\n'.join(f'  d{k}: "!d{k + 1}"' for k in range(3000))
    begin = time.process_time()
    result = specified(f"""
inputs:
  p: {{type: bool}}
definitions:
{chain}
  d3000: p
requirements:
  - {{id: A, ptltl: d0}}
""")
    assert len(postorder([result.properties[0].formula])) == 3001
    assert time.process_time() - begin < 60


def test_a_thousand_requirements_are_read_in_seconds() -> None:
    requirements = '\n'.join(
        f'  - {{id: R{k}, ptltl: "H ((x > {k}) -> O[0,{k}] (x <= limit & x < {k}.5))"}}'
        for k in range(1000))
    begin = time.process_time()
    result = specified(f"""
constants: {{limit: 5}}
inputs:
  x: {{type: float32}}
requirements:
{requirements}
""")
    assert len(result.properties) == 1000
    assert time.process_time() - begin < 60


def test_a_string_in_place_of_its_name_is_answered_with_the_name() -> None:
    with pytest.raises(CompileError) as caught:
        specified("""\
inputs:
  state: {topic: s, type: std_msgs/msg/String, values: {DRIVING: driving, IDLE: idle}}
requirements:
  - {id: A, ptltl: 'state = "driving"'}
""")
    assert [item.help for item in caught.value.diagnostics] == ['write its name: DRIVING']


def test_a_requirement_knows_the_constants_that_its_text_names() -> None:
    specification = specified("""\
component: robot
constants: {unused: 1, far: 9.0, STOP: 3, n: 4, v.max: 0.5, t: 2}
inputs:
  x: {type: float64}
  mode: {type: int32, values: {STOP: 0, GO: 1}}
definitions:
  slow: x <= v.max
  near: slow & x < far
requirements:
  - {id: A, fretish: "while near robot shall within 3 ticks satisfy x > t"}
  - {id: B, ptltl: "O[0, n] (x = 0.0)"}
  - {id: C, ptltl: "mode = STOP | v_DOT_max < x"}
  - {id: D, cocospec: "x < 1.0 and pre slow"}
""")
    assert [(item.id, item.constants) for item in specification.properties] == [
        ('A', ('far', 'v.max', 't')), ('B', ('n',)), ('C', ('v.max',)), ('D', ('v.max',))]


def test_an_instance_ends_only_after_a_time_that_is_given() -> None:
    name = Text.whole(Source('bundle.yaml', 'robot'))
    assert [described_variable(InstanceVariable(name, most=2, forget=forget)).forget
            for forget in (None, Fraction(1, 2))] == [0, 500_000_000]
