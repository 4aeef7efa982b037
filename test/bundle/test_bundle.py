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

"""A bundle is read as it is written, and all its mistakes are reported in one run."""

from fractions import Fraction
import os
from pathlib import Path
import time

from fret_monitor.bundle.bundle import Bundle, Language
from fret_monitor.bundle.reader import parse_bundle, survey_bundle
from fret_monitor.bundle.source_file import MAX_BYTES
from fret_monitor.model.diagnostics import CompileError, Diagnostic, Problems, Source
from fret_monitor.model.policies import InputRole, Policy, Report, Severity, Stale, Stamp
import golden
from hypothesis import example, given, settings, strategies
import pytest
from stages import read_bundle
import yaml

RUNNING_EXAMPLE = """\
format: 1
component: ROS_component
title: The motor calms down
constants:
  cc_t: 15.0
  ws_t: 8
inputs:
  current_consumption:
    topic: motor/current            # a comment
    type: std_msgs/msg/Float32
    field: data
  wind_speed:
    topic: windspeed
    type: std_msgs/msg/Float32
definitions:
  overload: current_consumption > cc_t & wind_speed > ws_t
  calm: {cocospec: 'not overload'}
evaluation:
  policy: every_message
  # period: 0.1
report: onset
requirements:
  - id: ROS-001
    fretish: >-
      if persisted(10, overload) ROS_component
      shall within 10 seconds satisfy current_consumption <= cc_t
    severity: warn
  - id: 010
    ptltl: "H (overload -> (O[0,20] (current_consumption <= cc_t)))"
    title: a text
      of two lines
    report: every_step
  - id: on
    cocospec: |
      H((wind_speed > 30.0) =>
        OT(5, 0, current_consumption <= cc_t))
"""
SMALL = 'format: 1\ninputs:\n  p: {type: bool}\nrequirements:\n  - {id: R1, ptltl: H p}\n'


def _parse(text: str, directory: Path = Path('.')) -> Bundle:
    return parse_bundle(Source('bundle.yaml', text), directory)


def _errors(text: str) -> tuple[Diagnostic, ...]:
    with pytest.raises(CompileError) as caught:
        _parse(text)
    return caught.value.diagnostics


def _with(part: str) -> str:
    return SMALL.replace('requirements:', f'{part}\nrequirements:')


@pytest.mark.skipif(not yaml.__with_libyaml__, reason='places differ by a blank without libyaml')
@pytest.mark.parametrize('path', golden.cases('bundle'), ids=lambda path: path.stem)
def test_mistakes_of_a_bundle_are_reported(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Compare with golden texts; FRET_MONITOR_UPDATE_GOLDEN=1 writes them (see golden.py)."""
    monkeypatch.chdir(path.parent)
    with pytest.raises(CompileError) as caught:
        read_bundle(Path(path.name))
    golden.check(path, f'{caught.value}\n')


def test_a_bundle_is_read_as_written() -> None:
    bundle = _parse(RUNNING_EXAMPLE)
    assert bundle.name == 'bundle'
    assert bundle.component is not None
    assert bundle.component.value == 'ROS_component'
    assert [(item.name.value, item.value.value) for item in bundle.constants] == [
        ('cc_t', '15.0'), ('ws_t', '8')]
    assert [(str(item.name), str(item.topic), str(item.type)) for item in bundle.inputs] == [
        ('current_consumption', 'motor/current', 'std_msgs/msg/Float32'),
        ('wind_speed', 'windspeed', 'std_msgs/msg/Float32')]
    assert [str(item.field) for item in bundle.inputs] == ['data', 'None']
    assert [(str(item.name), item.language, str(item.text)) for item in bundle.definitions] == [
        ('overload', Language.PTLTL, 'current_consumption > cc_t & wind_speed > ws_t'),
        ('calm', Language.COCOSPEC, 'not overload')]
    assert (bundle.policy, bundle.period) == (Policy.EVERY_MESSAGE, None)


def test_requirements_take_what_the_bundle_says_and_may_differ() -> None:
    first, second, third = _parse(RUNNING_EXAMPLE).requirements
    assert (first.severity, second.severity) == (Severity.WARN, Severity.ERROR)
    assert (first.report, second.report) == (Report.ONSET, Report.EVERY_STEP)
    assert first.text.value.startswith('if persisted(10, overload) ROS_component shall within')
    assert second.title == 'a text of two lines'
    assert third.text.value == (
        'H((wind_speed > 30.0) =>\n  OT(5, 0, current_consumption <= cc_t))\n')


def test_an_id_is_always_its_text() -> None:
    bundle = _parse(RUNNING_EXAMPLE)
    assert [item.id.value for item in bundle.requirements] == ['ROS-001', '010', 'on']
    assert [item.handler for item in bundle.requirements] == [
        'handlerpropROS_001', 'handlerprop010', 'handlerpropon']


def test_a_word_in_a_folded_formula_has_its_place() -> None:
    text = _parse(RUNNING_EXAMPLE).requirements[0].text
    at = text.value.index('seconds')
    span = text.at(at, at + 7)
    lines = RUNNING_EXAMPLE.splitlines()
    assert lines[span.line - 1][span.column - 1:].startswith('seconds satisfy')


@pytest.mark.parametrize(('part', 'period'), [
    ('period: 0.1', Fraction(1, 10)), ('rate: 3', Fraction(1, 3)),
    ('rate: 1e3', Fraction(1, 1000)),
    ('period: 1.0000000001', Fraction(10000000001, 10000000000)),
])
def test_a_period_is_exact(part: str, period: Fraction) -> None:
    bundle = _parse(_with(f'evaluation: {{policy: periodic, {part}}}'))
    assert (bundle.policy, bundle.period) == (Policy.PERIODIC, period)


def test_the_policy_timed_has_its_keys() -> None:
    bundle = _parse(_with(
        'evaluation: {policy: timed, unit: 1, stamp: received, reorder: 0.05}'))
    assert (bundle.policy, bundle.period, bundle.unit, bundle.stamp, bundle.reorder) == (
        Policy.TIMED, None, Fraction(1), Stamp.RECEIVED, 50_000_000)
    bundle = _parse(_with('evaluation: {policy: timed, unit: 0.1, stamp: header}'))
    assert (bundle.unit, bundle.stamp, bundle.reorder) == (
        Fraction(1, 10), Stamp.HEADER, 100_000_000)
    bundle = _parse(_with('evaluation: {policy: timed}'))
    assert (bundle.unit, bundle.stamp, bundle.reorder) == (None, Stamp.RECEIVED, 0)


def test_the_report_is_that_of_the_policy_unless_it_is_given() -> None:
    reports = [item.report for item in _parse(RUNNING_EXAMPLE).requirements]
    assert reports == [Report.ONSET, Report.EVERY_STEP, Report.ONSET]
    given = RUNNING_EXAMPLE.replace('report: every_step', 'report: occurrence')
    assert [item.report for item in _parse(given).requirements] == [
        Report.ONSET, Report.OCCURRENCE, Report.ONSET]
    assert [item.report for item in _parse(SMALL).requirements] == [None]


def test_a_greatest_rate_is_exact_and_agrees_on_a_topic() -> None:
    text = SMALL.replace('p: {type: bool}', """
  p: {topic: p, type: pkg/msg/P, field: a, max_rate: 0.1}
  q: {topic: p, type: pkg/msg/P, field: b, max_rate: RATE}""")
    assert [item.max_rate for item in _parse(text.replace('RATE', '1e-1')).inputs] == [
        Fraction(1, 10)] * 2
    (error,) = _errors(text.replace('RATE', '5'))
    assert error.title == "inputs on one topic must agree in 'max_rate'"
    assert 'has 0.1' in error.label and 'has 5' in error.label


def test_the_details_of_an_input_are_read() -> None:
    bundle = _parse(SMALL.replace('p: {type: bool}', """
  p: {type: bool, initial: true}
  state:
    topic: ~/state
    type: pkg_a/msg/State
    values: {IDLE: 0, LANDING: -1}
    initial: IDLE
    qos: {reliability: best_effort, depth: 5}
    timeout: 0.5
    stale: violate
  mode: {topic: /mode, type: std_msgs/msg/String, values: {ON: on, ONE: "1", NONE: ""}}"""))
    _, state, mode = bundle.inputs
    assert [(str(item.name), str(item.value), item.is_string) for item in state.values] == [
        ('IDLE', '0', False), ('LANDING', '-1', False)]
    assert [(str(item.name), str(item.value), item.is_string) for item in mode.values] == [
        ('ON', 'on', True), ('ONE', '1', True), ('NONE', '', True)]
    assert [(str(key), str(value)) for key, value in state.qos] == [
        ('reliability', 'best_effort'), ('depth', '5')]
    assert (state.timeout, state.stale, str(state.initial)) == (
        Fraction(1, 2), Stale.VIOLATE, 'IDLE')


def test_topics_are_read_as_inputs_that_share_the_keys_of_their_topic() -> None:
    bundle = _parse(SMALL.replace('p: {type: bool}', """
  p: {topic: flag, type: std_msgs/msg/Bool}
topics:
  ~/state:
    type: pkg_a/msg/State
    qos: {depth: 5}
    timeout: 0.5
    stale: violate
    startup: 3
    max_rate: 20
    fields:
      state: {field: state, values: {IDLE: 0, LANDING: -1}, initial: IDLE}
      '"hello there"': norm(twist)
      only: {}"""))
    _, *fields = bundle.inputs
    assert [(item.name.value, str(item.field), str(item.initial)) for item in fields] == [
        ('state', 'state', 'IDLE'), ('hello there', 'norm(twist)', 'None'),
        ('only', 'None', 'None')]
    for item in fields:
        assert item.topic and item.type and (item.topic.value, item.type.value) == (
            '~/state', 'pkg_a/msg/State')
        assert [(str(key), str(value)) for key, value in item.qos] == [('depth', '5')]
        assert (item.timeout, item.stale, item.startup, item.max_rate) == (
            Fraction(1, 2), Stale.VIOLATE, Fraction(3), Fraction(20))


def test_a_startup_shorter_than_the_timeout_is_a_warning(tmp_path: Path) -> None:
    path = tmp_path / 'bundle.yaml'
    for seconds, count in (('0.4', 1), ('0.5', 0), ('20', 0)):
        path.write_text(SMALL.replace(
            'p: {type: bool}', f'p: {{type: bool, timeout: 0.5, startup: {seconds}}}'))
        problems = Problems()
        bundle = survey_bundle(path, problems)
        assert bundle and bundle.inputs[0].startup == Fraction(seconds)
        assert not problems.errors
        assert [item.title for item in problems.warnings] == [
            "'startup' is shorter than 'timeout'"] * count


def test_keys_without_contents_hold_nothing() -> None:
    bundle = _parse(_with('constants:\ndefinitions:\nevaluation:\ntitle:\nsignals: []'))
    assert (bundle.constants, bundle.definitions, bundle.title) == ((), (), '')


def test_signals_files_add_inputs_and_constants(tmp_path: Path) -> None:
    (tmp_path / 'shared').mkdir()
    (tmp_path / 'shared' / 'a.yaml').write_text('constants: {limit: 2}\n')
    (tmp_path / 'b.yaml').write_text(
        'format: 1\ninputs:\n  speed: {type: float64}\n'
        'topics:\n  flag: {type: std_msgs/msg/Bool, fields: {on: data}}\n')
    path = tmp_path / 'main.yaml'
    path.write_text(_with('signals: [shared/a.yaml, b.yaml]'))
    bundle = read_bundle(path)
    assert [item.name.value for item in bundle.inputs] == ['p', 'speed', 'on']
    assert [item.name.value for item in bundle.constants] == ['limit']
    assert [Path(item.name) for item in bundle.sources] == [
        path, tmp_path / 'shared' / 'a.yaml', tmp_path / 'b.yaml']
    assert bundle.inputs[1].name.span.source is bundle.sources[2]


def test_one_signals_file_needs_no_list(tmp_path: Path) -> None:
    (tmp_path / 'a.yaml').write_text('constants: {limit: 2}\n')
    assert _parse(_with('signals: a.yaml'), tmp_path).constants[0].value.value == '2'


@pytest.mark.parametrize('text', [SMALL.replace('\n', '\r\n'), '\ufeff' + SMALL])
def test_windows_text_files_are_read(tmp_path: Path, text: str) -> None:
    path = tmp_path / 'bundle.yaml'
    path.write_bytes(text.encode())
    formula = read_bundle(path).requirements[0].text
    assert formula.value == 'H p'
    assert (formula.span.line, formula.span.column) == (5, 21)


def test_what_is_no_text_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / 'latin.yaml').write_bytes(b'format: 1\ntitle: gr\xfcn\n')
    (tmp_path / 'utf16.yaml').write_bytes('format: 1\n'.encode('utf-16'))
    (tmp_path / 'cut.yaml').write_bytes(b'format: 1\ntitle: \xe2\x82')
    (tmp_path / 'huge.yaml').write_bytes(b'#' * (MAX_BYTES + 1))
    (tmp_path / 'closed.yaml').symlink_to(tmp_path / 'closed.yaml')
    expected = {
        'latin.yaml': 'latin.yaml:2:10: error: the file is not in UTF-8',
        'utf16.yaml': 'it is in UTF-16',
        'cut.yaml': 'cut.yaml:2:8: error: the file is not in UTF-8',
        'huge.yaml': 'is larger than 16 MiB',
        'closed.yaml': 'cannot be read: Too many levels of symbolic links',
        'none.yaml': 'there is no file',
        '.': 'is a directory, not a file',
        'a\0b': 'is not the name of a file',
    }
    for name, message in expected.items():
        with pytest.raises(CompileError, match=message):
            read_bundle(tmp_path / name)


@pytest.mark.timeout(60)
@pytest.mark.parametrize(('name', 'message'), [
    ('pipe', "'pipe' is not a regular file"), ('/dev/zero', "'/dev/zero' is not a regular file"),
    ('n' * 300, 'cannot be read: File name too long'), ('loop/x', 'symbolic links'),
])
def test_a_start_does_not_wait_for_signals_that_are_no_file(
    tmp_path: Path, name: str, message: str, monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    os.mkfifo('pipe')
    os.symlink('loop', 'loop')
    Path('bundle.yaml').write_text(f'format: 1\nsignals: {name}\nrequirements: []\n')
    with pytest.raises(CompileError, match=message):
        read_bundle(Path('bundle.yaml'))


def test_a_formula_that_yaml_would_cut_is_refused_with_the_line_to_write() -> None:
    (error,) = _errors(SMALL.replace('{id: R1, ptltl: H p}', 'id: R1\n    ptltl: !p -> p'))
    assert error.help == 'ptltl: "!p -> p"'
    assert error.span is not None
    assert (error.span.line, error.span.column) == (6, 12)


@pytest.mark.parametrize('formula', [
    '!p & q', 'H p # q', 'p: q', '{p} & q', '[p] & q', '*p & q', '& p', '| p', '> 5', '%p', '@p',
    '`p', '- p', '? p', '"p" & q', "'p' & q", '!(p & q)', 'p &\n      q: r', '!', 'p:',
])
def test_the_line_to_paste_makes_the_formula_whole(formula: str) -> None:
    text = 'format: 1\nrequirements:\n  - id: R1\n    ptltl: '
    (error,) = _errors(text + formula + '\n')
    line = error.help if '\n' not in formula else 'ptltl: "p & q: r"'
    (requirement,) = _parse(f'{text[:-7]}{line}\n').requirements
    written = ' '.join(formula.split())
    assert requirement.text.value == written.partition(' #')[0]


@pytest.mark.parametrize('formula', [
    'p & !q', 'H (p -> q)', '(O[0,20] (p <= 15.0))', 'p#q', 'a != b | c', "p & x = 'y'", '-x > 3',
    'not p', 'H\n      (p\n      -> q)',
])
def test_a_formula_that_yaml_keeps_needs_no_quotes(formula: str) -> None:
    (item,) = _parse('format: 1\nrequirements:\n  - id: R1\n    ptltl: ' + formula).requirements
    assert item.text.value == ' '.join(formula.split())


def test_an_error_in_one_place_does_not_hide_the_next() -> None:
    errors = _errors("""\
format: 1
titel: x
inputs:
  p: {type: bol}
  q: !p
  r: [
  s: {type: bool, qos: {depth: 0}}
requirements:
  - {id: R1, ptltl: O[0,2] p}
  - {id: R2}
""")
    assert [item.span.line if item.span else 0 for item in errors] == [2, 4, 5, 6, 7, 9, 10]


def test_a_survey_returns_what_can_be_used(tmp_path: Path) -> None:
    path = tmp_path / 'bundle.yaml'
    path.write_text("""\
format: 1
constants: {limit: many}
inputs:
  p: {type: bool}
  q: {typ: bool}
definitions:
  d: {}
requirements:
  - {id: R1, ptltl: H p}
  - {id: R2, ptltl: }
""")
    problems = Problems()
    bundle = survey_bundle(path, problems)
    assert bundle is not None
    assert [(item.name.value, set(item.damaged)) for item in bundle.inputs] == [
        ('p', set()), ('q', {'type'})]
    assert [item.id.value for item in bundle.requirements] == ['R1']
    assert bundle.unreadable == {'limit', 'q', 'd'}
    assert len(problems.errors) == 4


def test_topics_are_held_to_the_rules_of_ros() -> None:
    validate = pytest.importorskip('rclpy.validate_topic_name').validate_topic_name
    from fret_monitor.model.names import topic_fault
    from rclpy.exceptions import InvalidTopicNameException
    for name in ('a', '/a', '~/a', '~', 'a/b_c', '_a', '{node}/a', 'a{ns}', '', '/', 'a/', '1a',
                 'a/1', 'a b', 'ä', 'a-b', 'a~', 'a/~', '{', 'a}', '{1}', '/a/b/', 'a.b'):
        try:
            validate(name)
            is_valid = True
        except InvalidTopicNameException:
            is_valid = False
        assert (topic_fault(name) is None) == is_valid, name


def test_a_topic_may_be_as_long_as_ros_allows() -> None:
    validate = pytest.importorskip('rclpy.validate_full_topic_name').validate_full_topic_name
    from fret_monitor.model.names import handler_fault
    from rclpy.exceptions import InvalidTopicNameException
    for length in range(220, 240):
        handler = 'handlerprop' + 'x' * (length - 11)
        try:
            validate(f'/copilot/{handler}')
            is_valid = True
        except InvalidTopicNameException:
            is_valid = False
        assert (handler_fault(handler) is None) == is_valid, length


@given(strategies.lists(strategies.tuples(
    strategies.integers(0, len(RUNNING_EXAMPLE)), strategies.integers(0, 3),
    strategies.sampled_from(['', ' ', '\n', '\t', ':', '#', '!', '&', '*', '[', ']', '{', '}', '|',
                             '>', '-', '"', "'", '%', '@', '\\', 'é', '\r', '\u2028', '---\n',
                             '<<: ', '\x00', '\ufeff', '\ud800'])), max_size=4))
@settings(max_examples=3 * settings().max_examples)
@example([(0, 0, '\ufeff'), (5, 0, '\ufeff')])
def test_a_damaged_bundle_is_read_or_refused_and_nothing_else(
        damage: list[tuple[int, int, str]]) -> None:
    text = RUNNING_EXAMPLE
    for place, length, new in damage:
        text = text[:place] + new + text[place + length:]
    try:
        _parse(text)
    except CompileError as error:
        assert all(item.span is not None for item in error.diagnostics)
        assert '\x1b' not in str(error)


@pytest.mark.parametrize('text', [
    'format: 1\na: ' + '[' * 10 ** 6, 'format: 1\na: ' + '{a: ' * 10 ** 5, '"' + 'x' * 10 ** 6,
    'format: 1\nrequirements:\n' + '- a\n' * 5000, 'a: !p &\n' * 5000, 'x ' * 10 ** 5,
    'format: 1\nconstants: {a: 1e999999999, b: ' + '9' * 10 ** 6 + '}\n',
])
def test_a_senseless_text_is_refused_in_little_time(text: str) -> None:
    began = time.process_time()
    assert _errors(text)
    assert time.process_time() - began < 10


def test_a_thousand_requirements_are_read_in_a_second() -> None:
    inputs = ''.join(f'  i{n}: {{topic: t{n}, type: std_msgs/msg/Float32}}\n' for n in range(1000))
    requirements = ''.join(
        f'  - id: R-{n}\n    title: >-\n      long\n      title\n'
        f'    ptltl: "H (i{n} > 3 -> (O[0,20] (i{n} <= 15.0)))"\n' for n in range(1000))
    began = time.process_time()
    bundle = _parse(f'format: 1\ninputs:\n{inputs}requirements:\n{requirements}')
    assert len(bundle.requirements) == 1000
    assert time.process_time() - began < 3  # 0.2 s where nothing else runs


def test_outputs_and_assumptions_are_marked() -> None:
    bundle = _parse("""format: 1
inputs:
  a: {type: bool}
  b: {type: bool, role: output}
requirements:
  - {id: A, ptltl: H a, assume: true}
  - {id: B, ptltl: H b, assume: false}
  - {id: C, ptltl: H b}
""")
    assert [item.role for item in bundle.inputs] == [None, InputRole.OUTPUT]
    assert [item.is_assumption for item in bundle.requirements] == [True, False, False]
    with pytest.raises(CompileError, match="'yes'"):
        _parse('format: 1\nrequirements:\n  - {id: A, ptltl: "TRUE", assume: yes}\n')
