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

"""Message definitions are read as by rosidl, and field paths lead to the right fields."""

import math
from pathlib import Path
import sys
from typing import Any

from fret_monitor.messages.field_path import resolve_field
from fret_monitor.messages.installed import complete_definition, find_message, fingerprint
from fret_monitor.messages.layout import ArrayKind, FieldType, MessageLayout
from fret_monitor.model.diagnostics import CompileError, Diagnostic, Source, Text
from fret_monitor.model.packages import search_path
from fret_monitor.model.paths import FieldPath, LookUp, Sector, Slice
from hypothesis import given, strategies
import pytest
from stages import parse_message

STATE = """\
# What the vehicle does
uint8 IDLE=0
uint8 LANDING = 1   # with blanks
string NAME= a # b

Header header
time when
duration how_long
Wheel[4] wheels
pkg_b/Battery battery
pkg_b/msg/Battery[<=2] spares
float32[] ranges
float64[<=5] limits
int16[3] corners [1, 2, 3]
string name "nobody # here"
string<=10 short
string<=8[<=3] tags
wstring wide
bool on true
byte raw
char letter
\tuint64\tcount   42
"""


@pytest.fixture
def prefix(tmp_path: Path) -> Path:
    """Install two packages with messages."""
    for name, text in {
        'pkg_a/msg/State': STATE,
        'pkg_a/msg/Wheel': 'float32 speed\nbool locked\n',
        'pkg_a/msg/One': 'pkg_b/Battery battery\n',
        'pkg_a/msg/Lost': 'pkg_c/Nothing nothing\nint8 x\n',
        'pkg_a/msg/Loop': 'Loop again\nint8 x\n',
        'pkg_a/msg/Broken': 'float32 x\nfloat32\n',
        'pkg_a/msg/Empty': '# nothing\n',
        'pkg_b/msg/Battery': 'float64 charge\nCell[] cells\n',
        'pkg_a/msg/Joint': 'string name\nstd_msgs/Header head\nfloat32 angle\nTurn turn\n'
                           'string[] words\n',
        'pkg_a/msg/Body': 'string[] tags\nJoint[] joints\n',
        'pkg_a/msg/Turn': 'float64 w\nfloat64 x\nfloat64 y\nfloat64 z\n',
        'pkg_a/msg/Scan':
            'float32 angle_min\nfloat64 angle_increment\nint8[] x\nWheel[] wheels\n',
        'pkg_b/msg/Cell': 'float32 voltage\n',
        'pkg_b/srv/Switch': '# turn it\nbool on\n--- \nbool success\nstring message\n',
        'pkg_b/srv/Half': 'bool on\n',
        'pkg_b/action/Count':
            'int32 LAST=9\nint32 order\n---\nCell[] cells\n---\nint32[] so_far\n',
        'pkg_b/action/Half': '---\n',
        'std_msgs/msg/Header': 'string frame_id\n',
    }.items():
        path = tmp_path / 'share' / f'{name}.{name.split("/")[1]}'
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    (tmp_path / 'share' / 'pkg_b' / 'msg' / 'Special.idl').write_text('')
    return tmp_path


def _text(value: str) -> Text:
    return Text.whole(Source('bundle.yaml', value))


def _leads_to(layout: MessageLayout, path: str | None) -> tuple[FieldPath, str]:
    found = resolve_field(layout, None if path is None else _text(path), _text('pkg_a/msg/X'))
    return found.path, found.type_name


def _refused(layout: MessageLayout, path: str | None) -> Diagnostic:
    with pytest.raises(CompileError) as caught:
        _leads_to(layout, path)
    (error,) = caught.value.diagnostics
    assert error.span is not None
    return error


def test_fields_are_read_in_their_order_with_their_types() -> None:
    layout = parse_message(STATE, 'pkg_a')
    assert [(item.name, str(item.type), item.default) for item in layout.fields] == [
        ('header', 'std_msgs/msg/Header', None),
        ('when', 'builtin_interfaces/msg/Time', None),
        ('how_long', 'builtin_interfaces/msg/Duration', None),
        ('wheels', 'pkg_a/msg/Wheel[4]', None),
        ('battery', 'pkg_b/msg/Battery', None),
        ('spares', 'pkg_b/msg/Battery[<=2]', None),
        ('ranges', 'float32[]', None),
        ('limits', 'float64[<=5]', None),
        ('corners', 'int16[3]', '[1, 2, 3]'),
        ('name', 'string', '"nobody'),
        ('short', 'string<=10', None),
        ('tags', 'string<=8[<=3]', None),
        ('wide', 'wstring', None),
        ('on', 'bool', 'true'),
        ('raw', 'byte', None),
        ('letter', 'char', None),
        ('count', 'uint64', '42'),
    ]
    assert [(item.name, item.value) for item in layout.constants] == [
        ('IDLE', '0'), ('LANDING', '1'), ('NAME', 'a')]
    assert layout.fields[11].type == FieldType('string', ArrayKind.BOUNDED, 3, 8)


def test_installed_messages_are_read_as_rosidl_reads_them() -> None:
    parser = pytest.importorskip('rosidl_adapter.parser')
    paths = sorted(path for prefix in search_path() for path in prefix.glob('share/*/msg/*.msg'))
    for path in paths:
        package = path.parent.parent.name
        expected = parser.parse_message_file(package, str(path))
        layout = parse_message(path.read_text(), package)
        assert [(item.name, item.type) for item in layout.fields] == [
            (item.name, _as_rosidl_says(item.type)) for item in expected.fields], path
        assert [item.name for item in layout.constants] == [
            item.name for item in expected.constants], path
    assert not paths or len(paths) > 10


def _as_rosidl_says(kind: object) -> FieldType:
    def part(name: str) -> object:
        return getattr(kind, name)

    base = str(part('type'))
    if part('pkg_name') is not None:
        base = f"{part('pkg_name')}/msg/{base}"
    size, limit = part('array_size'), part('string_upper_bound')
    assert size is None or isinstance(size, int)
    assert limit is None or isinstance(limit, int)
    if not part('is_array'):
        return FieldType(base, text_limit=limit)
    if size is None:
        return FieldType(base, ArrayKind.UNBOUNDED, None, limit)
    return FieldType(base, ArrayKind.BOUNDED if part('is_upper_bound') else ArrayKind.FIXED,
                     size, limit)


@pytest.mark.parametrize('line', [
    'float32', 'float32 a-b', 'float32 2a', 'float32[x] a', 'float32[<=] a', 'float32[-1] a',
    'float32<=3 a', 'float32[2][3] a', '../x a', 'a/b/c/D d', 'Wheel<=2 a', '= 3', 'uint8 =3',
    'lower/lower a', 'float32[0] a', 'float32[<=0] a',
])
def test_a_line_that_is_no_field_is_refused_with_its_place(line: str) -> None:
    with pytest.raises(CompileError, match='pkg_a/msg/Message:2:1: error: this line is not a'):
        parse_message(f'# first\n{line}\n', 'pkg_a')


def test_two_fields_of_one_name_are_refused() -> None:
    with pytest.raises(CompileError, match="two fields 'a'"):
        parse_message('int8 a\nint8 b\nint16 a\n', 'pkg_a')


@given(strategies.text(alphabet='aF3[]<>=/# \n\t"é\x00', max_size=40))
def test_any_text_is_read_or_refused(text: str) -> None:
    try:
        parse_message(text, 'pkg_a')
    except CompileError as error:
        assert error.diagnostics[0].span is not None


@pytest.mark.parametrize(('path', 'expected'), [
    ('count', (('count',), 'uint64')),
    ('battery.charge', (('battery', 'charge'), 'float64')),
    ('wheels[3].speed', (('wheels', 3, 'speed'), 'float32')),
    ('spares[1].cells[99].voltage', (('spares', 1, 'cells', 99, 'voltage'), 'float32')),
    ('ranges[0]', (('ranges', 0), 'float32')),
    ('corners[02]', (('corners', 2), 'int16')),
    ('header.frame_id', (('header', 'frame_id'), 'string')),
    ('raw', (('raw',), 'uint8')),
    ('letter', (('letter',), 'uint8')),
    ('wide', (('wide',), 'wstring')),
    ('on', (('on',), 'bool')),
    ('min(ranges[30:90])', (('ranges', Slice(30, 90)), 'float32')),
    ('mean(ranges[ -10 : ])', (('ranges', Slice(-10, None)), 'float64')),
    ('len(wheels[:-1])', (('wheels', Slice(None, -1)), 'uint32')),
    ('max(limits[-5:5])', (('limits', Slice(-5, 5)), 'float64')),
    ('sum(corners[:])', (('corners', Slice(None, None)), 'int64')),
    ('limits[tags = ""]', (('limits', LookUp(('tags',), '', is_parallel=True)), 'float64')),
])
def test_a_field_path_leads_to_a_scalar(
        prefix: Path, path: str, expected: tuple[FieldPath, str]) -> None:
    assert _leads_to(find_message('pkg_a/msg/State', [prefix]), path) == expected


@pytest.mark.parametrize(('path', 'expected'), [
    ('joints[name = elbow].angle', (
        ('joints', LookUp(('name',), 'elbow'), 'angle'), 'float32')),
    ('joints[ head.frame_id="a \\"b\\" \\\\]" ].angle', (
        ('joints', LookUp(('head', 'frame_id'), 'a "b" \\]'), 'angle'), 'float32')),
    ('norm(joints[tags = /x/y-1.2:3].turn)', (
        ('joints', LookUp(('tags',), '/x/y-1.2:3', is_parallel=True), 'turn'), 'float64')),
    ('yaw(joints[0].turn)', (('joints', 0, 'turn'), 'float64')),
])
def test_elements_are_looked_up_by_a_name_in_them_or_beside_them(
        prefix: Path, path: str, expected: tuple[FieldPath, str]) -> None:
    assert _leads_to(find_message('pkg_a/msg/Body', [prefix]), path) == expected


@pytest.mark.parametrize(('path', 'title', 'column', 'help'), [
    ('joints[nam = x].angle', "the elements of 'joints' have no names 'nam'", 8,
     "did you mean 'name'?"),
    ('joints[angle = x].angle', "the elements of 'joints' have no names 'angle'", 8,
     'write joints[tags = x] or joints[name = x] or joints[head.frame_id = x]'),
    ('joints[words = x].angle', "the elements of 'joints' have no names 'words'", 8,
     'write joints[tags = x] or joints[name = x] or joints[head.frame_id = x]'),
    ('yaw(tags)', "'yaw' does not apply to the array 'tags' (string[])", 1,
     'field: len(tags)'),
    ('yaw()', "'yaw' needs a field", 1, 'field: "yaw(joints[0].turn)"'),
])
def test_a_look_up_by_what_is_no_name_is_refused(
        prefix: Path, path: str, title: str, column: int, help: str) -> None:
    error = _refused(find_message('pkg_a/msg/Body', [prefix]), path)
    assert title in error.title
    assert error.span is not None
    assert (error.span.column, error.help) == (column, help)


def test_a_sector_needs_the_directions_of_numbers(prefix: Path) -> None:
    layout = find_message('pkg_a/msg/Scan', [prefix])
    for text, first, width in (
            ('-30 deg : 30 deg', -30, 60), ('150deg:-150deg', 150, 60),
            ('350 deg : 370 deg', -10, 20),
            ('-180 deg : 180 deg', -180, 360), ('0 deg : 360 deg', 0, 360),
            ('.5 rad : -0.5 rad', math.degrees(0.5), 360 - math.degrees(1))):
        ((_, sector), kind) = _leads_to(layout, f'min(x[{text}])')
        assert isinstance(sector, Sector)
        assert (str(sector), kind) == (text, 'int8')
        assert math.degrees(sector.first) % 360 == pytest.approx(first % 360)
        assert math.degrees(sector.width) == pytest.approx(width)
    error = _refused(layout, 'len(wheels[0 deg : 9 deg])')
    assert (error.title, error.label) == (
        "'wheels' is an array (pkg_a/msg/Wheel[])", 'sectors are of arrays of numbers')


def test_the_types_on_the_way_are_given(prefix: Path) -> None:
    found = resolve_field(find_message('pkg_a/State', [prefix]), _text('wheels[1].speed'),
                          _text('pkg_a/msg/State'))
    assert [str(item) for item in found.types] == ['pkg_a/msg/Wheel[4]', 'float32']


@pytest.mark.parametrize(('path', 'title', 'column', 'help'), [
    ('cuont', "pkg_a/msg/State has no field 'cuont'", 1, "did you mean 'count'?"),
    ('battery.chrg', "pkg_b/msg/Battery has no field 'chrg'", 9, "did you mean 'charge'?"),
    ('charge', "pkg_a/msg/State has no field 'charge'", 1, 'field: battery.charge'),
    ('battery.voltage', "pkg_b/msg/Battery has no field 'voltage'", 9,
     'field: "battery.cells[0].voltage"'),
    ('ranges', "'ranges' is an array (float32[])", 1,
     'field: "ranges[0]"   # or len(ranges), min(ranges), max(ranges), sum(ranges), mean(ranges), '
     'norm(ranges)'),
    ('wheels.speed', "'wheels' is an array (pkg_a/msg/Wheel[4])", 1,
     'field: "wheels[0].speed"'),
    ('wheels[4].speed', "'wheels' is an array (pkg_a/msg/Wheel[4]): it has no element 4", 7, ''),
    ('limits[5]', "'limits' is an array (float64[<=5]): it has no element 5", 7, ''),
    ('count[0]', "'count' is a uint64, not an array", 6, ''),
    ('count.x', "'count' is a uint64, which has no fields", 6, ''),
    ('battery', "'battery' is a message (pkg_b/msg/Battery)", 1,
     'field: battery.charge   # or battery.cells[0].voltage'),
    ('wheels[0]', "'wheels[0]' is a message (pkg_a/msg/Wheel)", 1,
     'field: "wheels[0].speed"   # or wheels[0].locked'),
    ('ranges[99999999999999]', 'it has no element 99999999999999', 7, ''),
    ('ranges[-1]', 'an index is a number from 0', 1,
     'the first element is [0], the last one of N is [N-1]'),
    ('ranges[1:3]', "'ranges[1:3]' is a part of an array (float32[])", 1,
     'field: "len(ranges[1:3])"   # or min(ranges[1:3]), max(ranges[1:3]), sum(ranges[1:3]), '
     'mean(ranges[1:3]), norm(ranges[1:3])'),
    ('wheels[1:3].speed', 'a part of an array has no fields', 7, 'field: "wheels[0].speed"'),
    ('min(ranges[420:300])', 'the slice is reversed', 11, 'write [300:420]'),
    ('min(ranges[-2:-5])', 'the slice is reversed', 11, 'write [-5:-2]'),
    ('min(ranges[7:7])', 'the slice is empty', 11, ''),
    ('min(ranges[:0])', 'the slice is empty', 11, ''),
    ('min(ranges[-5:0])', 'the slice is empty', 11, ''),
    ('min(limits[5:])', 'the slice is empty', 11, ''),
    ('min(limits[4:-1])', 'the slice is empty', 11, ''),
    ('min(corners[-2:1])', 'the slice is empty', 12, ''),
    ('min(corners[1:4])', "'corners' is an array (int16[3]): it has no part [1:4]", 12, ''),
    ('min(limits[-6:])', "'limits' is an array (float64[<=5]): it has no part [-6:]", 11, ''),
    ('min(ranges[0:90:2])', 'a slice has no step', 12, 'write [0:90]'),
    ('min(count[0:9])', "'count' is a uint64, not an array", 10, ''),
    ('min(ranges[-30 deg : 30 deg])', "the directions of 'ranges' are not known", 11,
     'without angle_min and angle_increment, take elements by index, as in ranges[0:10]'),
    ('min(ranges[-30 : 30 deg])', 'a sector is two angles, each with its unit, deg or rad', 12,
     'such as [-30 deg : 30 deg]'),
    ('min(ranges[-30 degrees : 30 deg])', 'a sector is two angles, each with its unit', 12,
     'write deg for degrees'),
    ('min(ranges[10 deg : 370.5 deg])', 'the sector is larger than a full turn', 12,
     'a whole turn is [-180 deg : 180 deg]'),
    ('min(ranges[1 rad : 1.0 rad])', 'the sector is empty', 12,
     'a whole turn is [-180 deg : 180 deg]'),
    ('limits[name = x]', "the elements of 'limits' have no names 'name'", 8,
     'write limits[tags = x]'),
    ('limits[wide = x]', "the elements of 'limits' have no names 'wide'", 8,
     'write limits[tags = x]'),
    ('limits[tags = left wheel]', "'left wheel' must be in quotes", 15,
     'field: \'limits[tags = "left wheel"]\''),
    ('limits[tags == x]', "a look-up has one '='", 13, 'field: "limits[tags = x]"'),
    ('limits[tags = ]', 'a name is missing after the =', 15,
     'field: "limits[tags = NAME]", with the name for NAME'),
])
def test_a_path_that_leads_nowhere_is_refused_with_what_there_is(
        prefix: Path, path: str, title: str, column: int, help: str) -> None:
    error = _refused(find_message('pkg_a/msg/State', [prefix]), path)
    assert title in error.title
    assert error.span is not None
    assert error.span.column == column
    assert error.help == help


@pytest.mark.parametrize('path', ['', '.', 'a.', '.a', 'a..b', 'a[', 'a[]', 'a[x]', 'a b',
                                  'a[1][2]', 'ä', 'a[1]b', 'a/b', 'count\n'])
def test_a_text_that_is_no_path_is_refused(prefix: Path, path: str) -> None:
    error = _refused(find_message('pkg_a/msg/State', [prefix]), path)
    assert 'is not a field path' in error.title


def test_the_field_may_be_left_out_where_there_is_one(prefix: Path) -> None:
    assert _leads_to(find_message('pkg_b/msg/Cell', [prefix]), None) == (('voltage',), 'float32')
    many = _refused(find_message('pkg_a/msg/Wheel', [prefix]), None)
    assert (many.title, many.help) == (
        'pkg_a/msg/Wheel has 2 fields', 'field: speed   # or locked')
    inner = _refused(find_message('pkg_a/msg/One', [prefix]), None)
    assert inner.help == 'field: battery.charge   # or battery.cells[0].voltage'
    none = _refused(find_message('pkg_a/msg/Empty', [prefix]), None)
    assert none.title == 'pkg_a/msg/Empty has no fields'


def test_a_constant_is_not_a_field(prefix: Path) -> None:
    assert _refused(find_message('pkg_a/msg/State', [prefix]),
                    'LANDING').label == 'a constant is not part of the message'


def test_a_message_is_looked_up_when_it_is_asked_for(prefix: Path) -> None:
    layout = find_message('pkg_a/msg/Lost', [prefix])
    assert _leads_to(layout, 'x') == (('x',), 'int8')
    error = _refused(layout, 'nothing.y')
    assert error.title == "no messages of a package 'pkg_c' were found"
    assert error.span is not None
    assert (error.span.start, error.span.end) == (0, 7)


def test_a_message_within_itself_ends(prefix: Path) -> None:
    layout = find_message('pkg_a/msg/Loop', [prefix])
    assert _leads_to(layout, 'again.again.x') == (('again', 'again', 'x'), 'int8')
    assert _refused(layout, 'again').help.startswith('field: again.x   # or again.again.x')


@pytest.mark.parametrize(('name', 'title', 'help'), [
    ('pkg_a/msg/Stat', "the package 'pkg_a' has no message 'Stat'", "did you mean 'State'?"),
    ('pkg_b/msg/Zzz', "the package 'pkg_b' has no message 'Zzz'", 'one of Battery, Cell'),
    ('pkgg_a/msg/State', "no messages of a package 'pkgg_a' were found", "did you mean 'pkg_a'"),
    ('no_such/msg/X', "no messages of a package 'no_such' were found",
     'source the workspace that has it'),
    ('../pkg_a/msg/State', 'is not the name of a message type', 'std_msgs/msg/Float32'),
    ('pkg_a/srv/State', 'is not the name of a message type', 'std_msgs/msg/Float32'),
    ('pkg_a/msg/State_Event', 'is not the name of a message type', 'std_msgs/msg/Float32'),
    ('pkg_b/srv/Swich_Event', "the package 'pkg_b' has no service 'Swich'", "mean 'Switch'?"),
    ('pkg_b/srv/Switch_Evnt', "'Switch_Evnt' is not a message of 'Switch'",
     "mean 'Switch_Event' or"),
    ('pkg_a/action/Go_Goal', "no actions of a package 'pkg_a' were found",
     'source the workspace that has it'),
    ('pkg_a', 'is not the name of a message type', 'std_msgs/msg/Float32'),
])
def test_a_type_that_is_not_installed_is_refused_with_what_is(
        prefix: Path, name: str, title: str, help: str) -> None:
    place = _text(name).span
    with pytest.raises(CompileError) as caught:
        find_message(name, [prefix], place)
    (error,) = caught.value.diagnostics
    assert title in error.title
    assert help in error.help
    assert error.span is place


def _shape(prefix: Path, name: str) -> str:
    layout = find_message(name, [prefix])
    assert layout.name == name
    return ', '.join(f'{item.type} {item.name}' for item in layout.fields)


@pytest.mark.parametrize(('name', 'expected'), [
    ('pkg_b/srv/Switch_Request', 'bool on'),
    ('pkg_b/srv/Switch_Response', 'bool success, string message'),
    ('pkg_b/srv/Switch_Event',
     'service_msgs/msg/ServiceEventInfo info, pkg_b/srv/Switch_Request[<=1] request, '
     'pkg_b/srv/Switch_Response[<=1] response'),
    ('pkg_b/action/Count_Goal', 'int32 order'),
    ('pkg_b/action/Count_Result', 'pkg_b/msg/Cell[] cells'),
    ('pkg_b/action/Count_Feedback', 'int32[] so_far'),
    ('pkg_b/action/Count_FeedbackMessage',
     'unique_identifier_msgs/msg/UUID goal_id, pkg_b/action/Count_Feedback feedback'),
    ('pkg_b/action/Count_SendGoal_Event',
     'service_msgs/msg/ServiceEventInfo info, '
     'pkg_b/action/Count_SendGoal_Request[<=1] request, '
     'pkg_b/action/Count_SendGoal_Response[<=1] response'),
    ('pkg_b/action/Count_GetResult_Response', 'int8 status, pkg_b/action/Count_Result result'),
])
def test_services_and_actions_have_the_messages_that_rosidl_gives_them(
        prefix: Path, name: str, expected: str) -> None:
    assert _shape(prefix, name) == expected


@pytest.mark.parametrize('name', ['pkg_b/srv/Half_Event', 'pkg_b/action/Half_FeedbackMessage'])
def test_a_service_or_action_that_lacks_a_part_is_refused(prefix: Path, name: str) -> None:
    with pytest.raises(CompileError, match=r'Half\.(srv|action):1:1: error: .* must have'):
        find_message(name, [prefix])


def test_the_fields_of_services_and_actions_are_those_of_rclpy() -> None:
    pytest.importorskip('rclpy')
    definition = pytest.importorskip('rosidl_parser.definition')
    parser = pytest.importorskip('rosidl_parser.parser')
    paths = sorted((path, prefix) for prefix in search_path()
                   for kind in ('srv', 'action') for path in prefix.glob(f'share/*/{kind}/*.idl'))
    for path, prefix in paths:
        share = prefix / 'share'
        file = parser.parse_idl_file(
            definition.IdlLocator(str(share), str(path.relative_to(share))))
        found = [*file.content.get_elements_of_type(definition.Service),
                 *file.content.get_elements_of_type(definition.Action)]
        for message in (message for item in found for message in _messages_of(item)):
            name = '/'.join(message.structure.namespaced_type.namespaced_name())
            expected = [member.name for member in message.structure.members]
            names = [item.name for item in find_message(name).fields]
            assert (names or ['structure_needs_at_least_one_member']) == expected, name
    assert not paths or len(paths) > 10


def _messages_of(item: Any) -> list[Any]:
    """Return the messages of a service or an action, as rosidl has them."""
    if hasattr(item, 'event_message'):
        return [item.request_message, item.response_message, item.event_message]
    return [item.goal, item.result, item.feedback, item.feedback_message,
            *_messages_of(item.send_goal_service), *_messages_of(item.get_result_service)]


def test_a_fingerprint_is_that_of_all_that_is_serialized(prefix: Path) -> None:
    def shape() -> str:
        return fingerprint(find_message('pkg_a/msg/State', [prefix]))

    before = shape()
    cell = prefix / 'share' / 'pkg_b' / 'msg' / 'Cell.msg'
    cell.write_text('# a remark\nint8 CONSTANT=3\nfloat32 voltage 7.5\n')
    assert shape() == before
    cell.write_text('float32 volts\n')
    renamed = shape()
    cell.write_text('float64 voltage\n')
    widened = shape()
    cell.unlink()
    assert len({before, renamed, widened, shape()}) == 4


def test_a_type_in_idl_alone_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / 'share' / 'pkg_d' / 'msg'
    folder.mkdir(parents=True)
    (folder / 'Special.idl').write_text('')
    with pytest.raises(CompileError, match='is defined in IDL'):
        find_message('pkg_d/msg/Special', [tmp_path])


def test_without_any_messages_the_error_says_to_source_ros(tmp_path: Path) -> None:
    with pytest.raises(CompileError, match='source ROS'):
        find_message('std_msgs/msg/Float32', [tmp_path])


def test_a_broken_definition_is_reported_with_its_place(prefix: Path) -> None:
    with pytest.raises(CompileError, match=r'Broken\.msg:2:1: error: this line is not a field'):
        find_message('pkg_a/msg/Broken', [prefix])


@pytest.mark.parametrize('sourced, wheels, distribution, command', [
    (True, False, '', 'sudo apt install ros-jazzy-nav-msgs'),
    (True, False, 'kilted', 'sudo apt install ros-kilted-nav-msgs'),
    (False, False, '', f'{sys.executable} -m pip install ros-jazzy-nav-msgs'),
    (True, True, '', f'{sys.executable} -m pip install ros-jazzy-nav-msgs')])
def test_a_package_that_is_not_installed_is_installed_as_ros_itself_was(
        prefix: Path, monkeypatch: pytest.MonkeyPatch, sourced: bool, wheels: bool,
        distribution: str, command: str) -> None:
    monkeypatch.setattr('sys.prefix', str(prefix))
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(prefix) if sourced else '')
    monkeypatch.setenv('ROS_DISTRO', distribution)
    if wheels:
        (prefix / 'share' / 'rclpy').mkdir()
    (prefix / 'share' / 'pkg_b').rename(prefix / 'share' / 'nav_msg')
    with pytest.raises(CompileError) as found:
        find_message('nav_msgs/msg/Odometry')
    assert [item.help for item in found.value.diagnostics] == [
        f'install it ({command}), or source the workspace that has it']


@pytest.mark.parametrize(('package', 'is_proposed'), [
    ('trajectory_msgs', True), ('px4_msgs', False), ('nav2_msgs', False)])
def test_pip_is_proposed_only_for_packages_that_have_wheels(
        prefix: Path, monkeypatch: pytest.MonkeyPatch, package: str, is_proposed: bool) -> None:
    monkeypatch.setenv('AMENT_PREFIX_PATH', '')
    monkeypatch.setenv('ROS_DISTRO', '')
    with pytest.raises(CompileError) as found:
        find_message(f'{package}/msg/X', [prefix])
    (error,) = found.value.diagnostics
    assert ('pip install' in error.help) is is_proposed
    assert 'source the workspace that has it' in error.help


def test_the_first_prefix_that_has_a_message_wins(
        prefix: Path, tmp_path_factory: pytest.TempPathFactory,
        monkeypatch: pytest.MonkeyPatch) -> None:
    overlay = tmp_path_factory.mktemp('overlay')
    folder = overlay / 'share' / 'pkg_b' / 'msg'
    folder.mkdir(parents=True)
    (folder / 'Cell.msg').write_text('int8 other\n')
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'{overlay}:{prefix}')
    assert search_path() == (overlay, prefix, Path(sys.prefix))
    assert find_message('pkg_b/msg/Cell').fields[0].name == 'other'
    assert _leads_to(find_message('pkg_a/msg/State'), 'battery.cells[0].other')[1] == 'int8'


def test_a_rewritten_definition_is_read_again(prefix: Path) -> None:
    path = prefix / 'share' / 'pkg_b' / 'msg' / 'Cell.msg'
    assert find_message('pkg_b/msg/Cell', [prefix]).fields[0].name == 'voltage'
    path.write_text('int8 other\nint8 more\n')
    assert find_message('pkg_b/msg/Cell', [prefix]).fields[0].name == 'other'


def test_a_complete_definition_is_what_recordings_have(tmp_path: Path) -> None:
    types = pytest.importorskip('rosbags.typesys')
    folder = tmp_path / 'share' / 'pkg_b' / 'msg'
    folder.mkdir(parents=True)
    (folder / 'Outer.msg').write_text('Inner[] a\nInner b\nint8 A=3')
    (folder / 'Inner.msg').write_text('float32 x\n')
    text = complete_definition(find_message('pkg_b/msg/Outer', [tmp_path]))
    line = '=' * 80
    assert text == f'Inner[] a\nInner b\nint8 A=3\n{line}\nMSG: pkg_b/Inner\nfloat32 x\n'
    found = types.get_types_from_msg(text, 'pkg_b/msg/Outer')
    assert set(found) == {'pkg_b/msg/Outer', 'pkg_b/msg/Inner'}
