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

"""Extractors read the same values from a message as Python, and no input makes them crash."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from itertools import islice
import math
from pathlib import Path
from random import Random
import shutil
import struct
import subprocess
from typing import Any

from codegen.messages import (
    message_class, message_object, random_tree, same, serialize, signal_of, taken, text, Topic,
    Tree, trees, weight, written_paths,
)
from differential.compiled import (
    c_module, clang, compile_c, CSRC, gcc, SANITIZERS, unoptimised, WARNINGS, write_module,
)
from fret_monitor.build import build_specification
from fret_monitor.logic.formula import TRUE
from fret_monitor.logic.specification import Specification
from fret_monitor.messages.field_path import resolve_field
from fret_monitor.messages.installed import find_message
from fret_monitor.messages.layout import MessageLayout
from fret_monitor.model.diagnostics import CompileError
from fret_monitor.model.packages import search_path
from fret_monitor.model.policies import Policy
from fret_monitor.native.monitor import Monitor
from fret_monitor.runtime.fields import FieldReading, read_fields, ReadOutcome
from hypothesis import given, HealthCheck, settings, strategies as st
import pytest
from stages import parse_message
from strategies import EXAMPLES, IS_THOROUGH, property_of, some

HERE = Path(__file__).resolve().parent
MOST_INPUTS = 40  # for each type: compiling thousands takes long
HEAVY = 400  # a message with more values than this takes too long to draw

# All scalar types, at every offset, with arrays and strings between them.
SCALARS = ('bool', 'byte', 'char', 'int8', 'uint8', 'int16', 'uint16', 'int32', 'uint32', 'int64',
           'uint64', 'float32', 'float64', 'string', 'wstring')
WRITTEN = {
    'lay_msgs/msg/Scalars': [f'{kind} {kind}_{i}' for i in range(2) for kind in SCALARS],
    'lay_msgs/msg/Upside': [f'{kind} {kind}_{i}' for i in range(2) for kind in SCALARS[::-1]],
    'lay_msgs/msg/Arrays': [f'{kind}{size} {kind}_{i}' for kind in SCALARS
                            for i, size in enumerate(('[]', '[3]', '[<=4]'))],
    'lay_msgs/msg/Odd': ['uint8 a', 'float64 b', 'uint8 c'],
    'lay_msgs/msg/Steps': ['uint8 a', 'uint16 b', 'uint32 c', 'uint8[3] d', 'float64 e', 'bool f'],
    'lay_msgs/msg/Nothing': [],
    'lay_msgs/msg/Named': ['Odd odd', 'string name', 'Nothing nothing'],
    'lay_msgs/msg/Boxes': [
        'Odd[] odds', 'bool between', 'Odd[3] three', 'Steps[<=4] steps', 'Steps[2] pair',
        'Nothing[] nothings', 'Nothing[2] two', 'Named[] named', 'Named[2] both', 'string[] words',
        'string[2] few', 'wstring[] wides', 'uint8 last'],
    # What follows an array whose elements have padding between them.
    **{f'lay_msgs/msg/Behind{i}': [f'{kind} before', 'uint8 behind'] for i, kind in enumerate((
        'Odd', 'Odd[]', 'Odd[3]', 'Steps[]', 'Steps[2]', 'Nothing[]', 'Nothing[2]', 'Named[]',
        'wstring[2]', 'string[]', 'float64[]', 'float64[<=3]'))},
    'lay_msgs/msg/BehindSome': ['uint32 a', 'uint8 b', 'uint16 c', 'uint8 d', 'uint8 behind'],
    # Arrays before and after what gives directions and names to their elements.
    'lay_msgs/msg/Scan': ['float32[] before', 'float32 angle_min', 'int16[<=4] between',
                          'float64 angle_increment', 'bool[3] after'],
    'lay_msgs/msg/Robot': ['float64[] position', 'Named[<=4] parts', 'string[] name',
                           'Named[] limbs', 'Quadruple[3] turns', 'uint8[] effort', 'string last'],
    'lay_msgs/msg/Quadruple': ['float64 x', 'float64 y', 'float64 z', 'float64 w'],
    'lay_msgs/msg/Deep': ['bool first', 'Boxes boxes', 'Boxes[<=2] more', 'int64 last'],
}


@pytest.fixture(scope='session')
def prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Install a package of messages."""
    folder = tmp_path_factory.mktemp('installed')
    for name, fields in WRITTEN.items():
        path = folder / 'share' / f'{name}.msg'
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text('\n'.join(fields) + '\n')
    return folder


@cache
def installed(share: int = 3) -> tuple[str, ...]:
    """Return one of `share` of the installed message types, as `some`, that rclpy supports."""
    paths = [path for prefix in search_path()
             for pattern in ('msg/*.msg', 'srv/*.srv', 'action/*.action')
             for path in sorted(prefix.glob(f'share/*/{pattern}'))]
    endings = {'msg': [''], 'srv': ['_Event', '_Request', '_Response'],
               'action': ['_FeedbackMessage', '_SendGoal_Event', '_GetResult_Event']}
    names = [f'{path.parent.parent.name}/{path.parent.name}/{path.stem}{ending}'
             for path in paths for ending in endings[path.parent.name]]
    return tuple(filter(is_known, some([*dict.fromkeys(names)], share)))


def is_known(name: str) -> bool:
    """Whether rclpy supports a type, and it has fields, and not too many values to draw."""
    try:
        return bool(message_class(name)()) and 0 < weight(find_message(name)) < HEAVY
    except (ImportError, AttributeError, CompileError):
        return False


def topic_of(layout: MessageLayout, number: int, most: int | None = None) -> Topic:
    """Return a topic with inputs of all kinds, or with a selection of them."""
    if most is None:
        chosen = list(readable(layout, written_paths(layout)))
    else:
        # With the last field there is something to skip before it.
        paths = list(written_paths(layout, most_elements=2))
        last = next(readable(layout, reversed(paths)))
        others = Random(f'{layout.name} {number}').sample(paths, min(len(paths), 20 * most))
        chosen = [*islice(readable(layout, (path for path in others if path != last)), most - 1),
                  last]
    return Topic(layout, tuple(signal_of(layout, f't{number}_{place}', f'topic{number}', path)
                               for place, path in enumerate(chosen)))


def readable(layout: MessageLayout, paths: Iterable[str]) -> Iterator[str]:
    """Yield those of the paths that end at a value, and whose reduction there is."""
    for path in paths:
        try:
            resolve_field(layout, text(path), text(layout.name))
        except CompileError:
            continue
        yield path


def specification_for(topics: Sequence[Topic]) -> Specification:
    """Return a specification with inputs and one trivial requirement."""
    signals = tuple(signal for topic in topics for signal in topic.signals)
    return Specification('readers', '', signals, (property_of('R', TRUE),),
                         Policy.EVERY_MESSAGE, None)


def build_topics(topics: Sequence[Topic]) -> Monitor:
    return build_specification(specification_for(topics)).monitor


@pytest.fixture(scope='session')
def ours(prefix: Path) -> tuple[list[Topic], Monitor]:
    """Build extractors of many and of few fields of the messages defined here."""
    chosen = [(name, most) for most in ((3 if IS_THOROUGH else 1) * MOST_INPUTS, 3, 1)
              for name in WRITTEN if WRITTEN[name]]
    topics = [topic_of(find_message(name, [prefix]), number, most)
              for number, (name, most) in enumerate(chosen)]
    with unoptimised():
        return topics, build_topics(topics)


@pytest.fixture(scope='session')
def theirs() -> tuple[list[Topic], Monitor]:
    """Build extractors of the installed messages."""
    pytest.importorskip('rclpy')
    topics = [topic_of(find_message(name), number, min(EXAMPLES // 5, MOST_INPUTS // 2))
              for number, name in enumerate(installed())]
    with unoptimised():
        return topics, build_topics(topics)


def assert_same(topic: Topic, found: tuple[FieldReading, ...] | None, message: Any) -> None:
    assert_equal(topic, found, [taken(message, signal) for signal in topic.signals])


def assert_equal(topic: Topic, found: tuple[FieldReading, ...] | None,
                 expected: Sequence[FieldReading]) -> None:
    assert found is not None
    for signal, reading, right in zip(topic.signals, found, expected, strict=True):
        assert same(reading, right), (signal.path, signal.reduction, reading, right)


# -- valid messages -------------------------------------------------------------------------------


@settings(max_examples=4 * EXAMPLES, suppress_health_check=list(HealthCheck), deadline=None)
@given(data=st.data())
def test_extractors_read_what_was_serialized_in_either_byte_order(
        ours: tuple[list[Topic], Monitor], data: st.DataObject) -> None:
    topics, monitor = ours
    number = data.draw(st.integers(0, len(topics) - 1))
    tree = data.draw(trees(topics[number].layout))
    expected = [taken(tree, signal) for signal in topics[number].signals]
    for big in (False, True):
        message = serialize(topics[number].layout, tree, big=big)
        assert_equal(topics[number], read_fields(monitor, number, message), expected)


@pytest.mark.parametrize('name', installed())
def test_extractors_read_the_same_values_as_python(
        theirs: tuple[list[Topic], Monitor], name: str) -> None:
    from rclpy.serialization import deserialize_message, serialize_message
    topics, monitor = theirs
    number = installed().index(name)
    topic = topics[number]

    @settings(max_examples=EXAMPLES // 5, suppress_health_check=list(HealthCheck), deadline=None,
              database=None)
    @given(seed=st.integers(0, 2 ** 64 - 1))
    def compare(seed: int) -> None:
        tree = random_tree(topic.layout, Random(seed))
        made = message_object(topic.layout, tree)
        sent = serialize_message(made)
        found = read_fields(monitor, number, sent)
        expected = [taken(made, signal) for signal in topic.signals]
        assert_equal(topic, found, expected)
        assert_same(topic, found, deserialize_message(sent, message_class(name)))
        # The serializer of the other tests gives the same bytes as rclpy, but for padding, whose
        # content is random in rclpy.
        for big in (False, True):
            own = serialize(topic.layout, tree, big=big)
            assert len(own) <= len(sent)
            assert_same(topic, found, deserialize_message(own, message_class(name)))
            assert_equal(topic, read_fields(monitor, number, own), expected)

    compare()


def test_enough_types_are_installed() -> None:
    pytest.importorskip('rclpy')
    names = set(installed(1))
    assert {'std_msgs/msg/Bool', 'std_msgs/msg/Float64MultiArray', 'nav_msgs/msg/Odometry',
            'sensor_msgs/msg/PointCloud2', 'diagnostic_msgs/msg/DiagnosticArray',
            'geometry_msgs/msg/TwistWithCovarianceStamped', 'action_msgs/msg/GoalStatusArray',
            'std_srvs/srv/SetBool_Event'} <= names
    assert len(names) > 120


@cache
def monitor_of(layout: MessageLayout, field: str) -> Monitor:
    with unoptimised():
        return build_topics([Topic(layout, (signal_of(layout, 'x', 'x', field),))])


def read_one(layout: MessageLayout, field: str, message: bytes) -> FieldReading | None:
    """Read one field of a message."""
    found = read_fields(monitor_of(layout, field), 0, message)
    return found[0] if found else None


def message_of(*numbers: int, size: int = 4, big: bool = False) -> bytes:
    """Return a message of unsigned numbers of one size."""
    code = {1: 'B', 4: 'I', 8: 'Q'}[size]
    order = '>' if big else '<'
    return bytes([0, 0 if big else 1, 0, 0]) + struct.pack(f'{order}{len(numbers)}{code}',
                                                           *numbers)


def test_any_byte_but_0_is_true() -> None:
    layout = parse_message('bool x\nbool[] y', 'a')
    for byte in range(256):
        assert read_one(layout, 'x', message_of(byte, size=1)) == FieldReading(
            ReadOutcome.READ, byte != 0)
    message = message_of(1, 0, 0, 0, 3, 0, 0, 0, 0, 7, 255, size=1)
    assert read_one(layout, 'any(y)', message) == FieldReading(ReadOutcome.READ, True)
    assert read_one(layout, 'all(y)', message) == FieldReading(ReadOutcome.READ, False)
    assert read_one(layout, 'y[2]', message) == FieldReading(ReadOutcome.READ, True)


def test_received_is_true_of_every_message_and_age_reads_the_stamp() -> None:
    layout = parse_message('uint32 n\nstring[] names\nuint64 z', 'a')
    message = message_of(5, 2 ** 32 - 1)
    assert read_one(layout, 'received()', message) == FieldReading(ReadOutcome.READ, True)
    assert read_one(layout, 'received()', b'') is None
    stamped = parse_message('builtin_interfaces/Time stamp\nstring name', 'a')
    assert read_one(stamped, 'age(stamp)', message_of(3, 500_000_000)) == FieldReading(
        ReadOutcome.READ, 3.5)


def test_sums_of_integers_wrap() -> None:
    top = 2 ** 63 - 1
    message = message_of(3, top, top, 5, size=8)
    assert read_one(parse_message('uint64 n\nint64[3] x', 'a'), 'sum(x)', message) == \
        FieldReading(ReadOutcome.READ, (2 * top + 5) % 2 ** 64)
    assert read_one(parse_message('uint64 n\nint64[2] x', 'a'), 'sum(x)', message) == \
        FieldReading(ReadOutcome.READ, -2)
    assert read_one(parse_message('uint64 n\nuint64[3] x', 'a'), 'sum(x)', message) == \
        FieldReading(ReadOutcome.READ, 3)


def test_nan_is_skipped_unless_all_elements_are_nan() -> None:
    layout = parse_message('float32[] x', 'a')
    nan = struct.pack('<f', float('nan'))

    def both(*values: bytes) -> list[FieldReading | None]:
        message = message_of(len(values)) + b''.join(values)
        return [read_one(layout, f'{function}(x)', message) for function in ('min', 'max')]

    one, two = struct.pack('<f', 1.0), struct.pack('<f', 2.0)
    for values in ((nan, one, two), (one, nan, two), (two, one, nan), (nan, nan, two, nan, one)):
        assert both(*values) == [
            FieldReading(ReadOutcome.READ, 1.0), FieldReading(ReadOutcome.READ, 2.0)]
    assert all(found and same(found, FieldReading(ReadOutcome.READ, float('nan')))
               for found in both(nan, nan))
    assert both() == [FieldReading(ReadOutcome.EMPTY, None)] * 2


def test_an_empty_array_has_a_sum_but_no_mean() -> None:
    layout = parse_message('float64[] x\nbool[] y', 'a')
    message = message_of(0, 0)
    functions = ('len(x)', 'sum(x)', 'norm(x)', 'min(x)', 'max(x)', 'mean(x)', 'any(y)', 'all(y)')
    topic = Topic(layout, tuple(signal_of(layout, f'x{place}', 'x', function)
                                for place, function in enumerate(functions)))
    with unoptimised():
        read = read_fields(build_topics([topic]), 0, message)
    assert read is not None
    found = dict(zip(functions, read, strict=True))
    empty = FieldReading(ReadOutcome.EMPTY, None)
    assert found == {
        'len(x)': FieldReading(ReadOutcome.READ, 0), 'sum(x)': FieldReading(ReadOutcome.READ, 0.0),
        'norm(x)': FieldReading(ReadOutcome.READ, 0.0), 'min(x)': empty, 'max(x)': empty,
        'mean(x)': empty, 'any(y)': FieldReading(ReadOutcome.READ, False),
        'all(y)': FieldReading(ReadOutcome.READ, True)}


# -- parts of arrays ------------------------------------------------------------------------------


SCAN = 'float32[] intensities\nfloat32 angle_min\nfloat32 angle_increment\nfloat32[] ranges'
SECTORS = ('0 deg : 90 deg', '-30 deg : 30 deg', '150 deg : -150 deg', '-180 deg : 180 deg',
           '135 deg : -135 deg', '0.5 rad : 0.51 rad', '10 deg : 9.5 deg', '-90 deg : -0.1 rad')


@pytest.fixture(scope='module')
def scan() -> tuple[Topic, Monitor]:
    """Build extractors of sectors, of arrays before and after the angles."""
    layout = parse_message(SCAN, 'a')
    fields = [f'{function}({array}[{sector}])' for sector in SECTORS
              for array in ('ranges', 'intensities') for function in ('len', 'mean')]
    topic = Topic(layout, tuple(signal_of(layout, f'x{place}', 'scan', field)
                                for place, field in enumerate(fields)))
    return topic, build_topics([topic])


def sectors(scan: tuple[Topic, Monitor], least: float, increment: float,
            count: int) -> dict[str, float | None]:
    """Return how many elements of a scan are in each sector; check them against the reference."""
    topic, monitor = scan
    least, increment = struct.unpack('2f', struct.pack('2f', least, increment))
    numbers = [float(number) for number in range(count)]
    tree = Tree(angle_min=least, angle_increment=increment, ranges=numbers,
                intensities=numbers[::-1])
    for big in (False, True):
        found = read_fields(monitor, 0, serialize(topic.layout, tree, big=big))
        assert_same(topic, found, tree)
    assert found is not None
    return {sector: found[4 * place].value for place, sector in enumerate(SECTORS)}


def test_the_elements_at_both_ends_are_in_a_sector(scan: tuple[Topic, Monitor]) -> None:
    whole = sectors(scan, -math.pi, math.tau / 720, 720)
    assert list(whole.values()) == [181, 121, 121, 720, 181, 1, 720, 169]
    from_0 = sectors(scan, 0, math.tau / 360, 360)
    assert list(from_0.values()) == [91, 61, 61, 360, 91, 1, 360, 85]
    behind = sectors(scan, math.radians(-135), math.radians(0.25), 1081)
    assert list(behind.values()) == [361, 241, None, 1081, 2, 2, 1080, 338]
    turned = sectors(scan, math.radians(135), math.radians(-0.25), 1081)
    assert list(turned.values()) == [361, 241, None, 1081, 2, 2, 1080, 338]
    # The first and the last element have the same direction.
    assert sectors(scan, -math.pi, math.radians(1), 361)['135 deg : -135 deg'] == 92


def test_angles_that_are_none_of_a_scan_have_no_sectors(scan: tuple[Topic, Monitor]) -> None:
    nan, infinity = math.nan, math.inf
    for least, increment, count in (
            (0, 0, 5), (0, -0.0, 5), (nan, 0.1, 5), (0, nan, 5), (infinity, 0.1, 5),
            (0, infinity, 1), (0, -infinity, 5), (0, 7, 1), (12.6, 0.1, 9), (0, 1e-10, 9),
            (0, 1e-45, 9), (0, 0.1, 128), (0, 0.1, 0), (0, math.tau / 4, 10)):
        assert set(sectors(scan, least, increment, count).values()) == {None}
    assert sectors(scan, 0, 0.1, 126)['-180 deg : 180 deg'] == 126  # of almost two turns


@settings(max_examples=2 * EXAMPLES, suppress_health_check=list(HealthCheck), deadline=None)
@given(st.floats(-13, 13, width=32), st.floats(0.015625, 7, width=32), st.booleans(),
       st.integers(0, 200))
def test_a_sector_is_what_the_angle_of_each_element_says(
        scan: tuple[Topic, Monitor], least: float, size: float, turned: bool,
        count: int) -> None:
    sectors(scan, least, -size if turned else size, count)


def test_an_element_is_looked_up_by_its_first_name(prefix: Path) -> None:
    layout = find_message('lay_msgs/msg/Robot', [prefix])
    parts = [Tree(odd=Tree(a=n, b=n / 2, c=0), name=name, nothing=Tree())
             for n, name in enumerate(('hand', 'idle', 'idle', ''))]
    turn = Tree(x=0.0, y=0.0, z=1.0, w=1.0)
    robot = Tree(position=[0.5, 1.5, 2.5], parts=parts, name=['hip', 'hand', 'idle', 'hip', 'leg'],
                 limbs=parts[1:], turns=[turn] * 3, effort=[1], last='idle')
    topic = Topic(layout, tuple(signal_of(layout, f'x{place}', 'x', field) for place, field in (
        enumerate(('position[name = hip]', 'position[name = leg]', 'position[name = knee]',
                   'parts[name = idle].odd.a', 'parts[name = ""].odd.b', 'parts[name = leg].odd.a',
                   'parts[0].odd.a', 'limbs[name = hand].odd.a', 'effort[name = hand]',
                   'yaw(turns[name = idle])', 'name[name = idle]', 'last')))))
    monitor = build_topics([topic])
    for big in (False, True):
        found = read_fields(monitor, 0, serialize(layout, robot, big=big))
        assert_same(topic, found, robot)
    assert found is not None
    assert [reading.value for reading in found] == [
        0.5, None, None, 1, 1.5, None, 0, None, None, math.pi / 2, 1, 1]
    assert [reading.outcome.name for reading in found if reading.value is None] == [
        'OUTSIDE', 'ABSENT', 'ABSENT', 'ABSENT', 'OUTSIDE']


def test_a_search_stops_at_a_length_beyond_the_message(prefix: Path) -> None:
    layout = find_message('lay_msgs/msg/Robot', [prefix])
    for field in ('position[name = x]', 'parts[name = x].odd.a', 'limbs[name = x].odd.a'):
        for length in (2 ** 32 - 1, 2 ** 30, 9):
            for numbers in ((length,), (0, length), (0, 0, length), (0, 0, 0, length)):
                message = message_of(*numbers, *[0] * 20)
                found = read_one(layout, field, message)
                assert found is None or found.value is None


def test_the_angles_of_a_quaternion_are_turns_about_z_then_y_then_x(prefix: Path) -> None:
    layout = find_message('lay_msgs/msg/Robot', [prefix])
    topic = Topic(layout, tuple(signal_of(layout, name, 'x', f'{name}(turns[0])')
                                for name in ('yaw', 'pitch', 'roll')))
    monitor = build_topics([topic])

    def read(*numbers: float) -> list[float]:
        turns = [Tree(**dict(zip('xyzw', numbers)))] * 3
        robot = Tree(position=[], parts=[], name=[], limbs=[], turns=turns, effort=[], last='')
        found = read_fields(monitor, 0, serialize(layout, robot))
        assert found is not None
        return [float(reading.value) for reading in found if reading.value is not None]

    for angles in ((0, 0, 0), (40, 20, 10), (-170, -80, 175), (90, 0, 0), (10, 90, 0),
                   (-100, -90, 0)):
        (cz, cy, cx), (sz, sy, sx) = (
            [function(math.radians(angle) / 2) for angle in angles]
            for function in (math.cos, math.sin))
        numbers = (sx * cy * cz - cx * sy * sz, cx * sy * cz + sx * cy * sz,
                   cx * cy * sz - sx * sy * cz, cx * cy * cz + sx * sy * sz)
        for length in (1, -1, 1e-3):
            turned = read(*(length * number for number in numbers))
            assert [math.degrees(angle) for angle in turned] == pytest.approx(angles, abs=1e-6)
    assert all(map(math.isnan, read(0, 0, 0, 0)))


@pytest.mark.parametrize('header', [
    b'', b'\0', b'\0\1\0', b'\1\0\0\0', b'\0\2\0\0', b'\0\3\0\0', b'\0\6\0\0', b'\0\7\0\0',
    b'\0\x0a\0\0', b'\x80\1\0\0', b'\0\x81\0\0'])
def test_another_encoding_cannot_be_decoded(header: bytes) -> None:
    layout = parse_message('uint8 x', 'a')
    assert read_one(layout, 'x', header + b'\7\0\0\0' * (len(header) == 4)) is None
    assert read_one(layout, 'x', b'\0\1\xff\xff\7') == FieldReading(ReadOutcome.READ, 7)


def test_a_sequence_above_its_bound_cannot_be_decoded() -> None:
    layout = parse_message('uint32[<=2] x\nstring[<=1] y', 'a')
    assert read_one(layout, 'len(x)', message_of(2, 7, 8)) == FieldReading(ReadOutcome.READ, 2)
    assert read_one(layout, 'len(x)', message_of(3, 7, 8, 9)) is None
    assert read_one(layout, 'len(y)', message_of(0, 2, 0, 0)) is None


def test_a_string_without_its_zero_is_read_as_it_is() -> None:
    layout = parse_message('string x', 'a')
    for data in (b'idle\0', b'idle'):
        message = message_of(len(data)) + data
        assert read_one(layout, 'x', message) == FieldReading(ReadOutcome.READ, 1)
    assert read_one(layout, 'x', message_of(0)) == FieldReading(ReadOutcome.READ, 0)
    assert read_one(layout, 'x', message_of(6) + b'idle\0\0') == FieldReading(
        ReadOutcome.UNNAMED, None, 5)


def test_a_wide_string_is_known_by_all_its_units() -> None:
    layout = parse_message('uint8 before\nwstring x', 'a')
    for big in (False, True):
        for word, expected in (('idle', FieldReading(ReadOutcome.READ, 1)),
                               ('idol', FieldReading(ReadOutcome.UNNAMED, None, 4))):
            units = map(ord, word)
            assert read_one(layout, 'x', message_of(0, 4, *units, big=big)) == expected


def test_bytes_after_the_last_field_are_not_read() -> None:
    layout = parse_message('uint32 x\nstring[] y\nuint32 z', 'a')
    whole = message_of(5, 2 ** 32 - 1)
    assert read_one(layout, 'x', whole) == FieldReading(ReadOutcome.READ, 5)
    assert read_one(layout, 'z', whole) is None
    assert read_one(layout, 'y[0]', message_of(5, 9, 1) + b'\0') == \
        FieldReading(ReadOutcome.READ, 0)
    assert read_one(layout, 'len(y)', message_of(5, 9, 1) + b'\0') is None


# -- malformed messages ---------------------------------------------------------------------------


@settings(max_examples=40, suppress_health_check=list(HealthCheck), deadline=None)
@given(data=st.data())
def test_a_truncated_message_is_rejected_or_gives_the_same_values(
        ours: tuple[list[Topic], Monitor], data: st.DataObject) -> None:
    topics, monitor = ours
    number = data.draw(st.integers(0, len(topics) - 1))
    tree = data.draw(trees(topics[number].layout))
    whole = serialize(topics[number].layout, tree, big=data.draw(st.booleans()))
    for size in range(len(whole)):
        found = read_fields(monitor, number, whole[:size])
        if found is not None:
            assert_same(topics[number], found, tree)


@pytest.mark.parametrize('definition', [
    'string[] x\nuint8 y', 'wstring[] x\nuint8 y', 'float64[] x\nuint8 y', 'Named[] x\nuint8 y',
    'Odd[] x\nuint8 y', 'Nothing[] x\nuint8 y', 'Steps[] x\nuint8 y', 'string x\nuint8 y',
    'wstring x\nuint8 y'])
def test_a_length_beyond_the_message_is_rejected_at_once(prefix: Path, definition: str) -> None:
    layout = replace(parse_message(definition, 'lay_msgs'), search_path=(prefix,))
    for length in (2 ** 32 - 1, 2 ** 32 - 8, 2 ** 31, 2 ** 31 - 1, 2 ** 30, 2 ** 29, 2 ** 28,
                   10 ** 9, 0x15555556, 0x20000000, 0x1C71C71D):
        for big in (False, True):
            assert read_one(layout, 'y', message_of(length, *[0] * 30, big=big)) is None


def corpus(topics: Sequence[Topic], rng: Random) -> list[tuple[int, bytes]]:
    """Return damaged messages of all kinds, each with the number of its topic."""
    found = []
    for number, topic in enumerate(topics):
        for _ in range(min(EXAMPLES // 8, 12)):
            tree = random_tree(topic.layout, rng)
            for big in (False, True):
                message = serialize(topic.layout, tree, big=big)
                found += [(number, message), (rng.randrange(len(topics)), message)]
                found += [(number, damaged(message, rng)) for _ in range(25)]
    noise = [b'\0' + rng.randbytes(rng.choice((0, 3, 4, 9, 30, 200, 2000))) for _ in range(2000)]
    return found + [(rng.randrange(len(topics)), message) for message in noise]


def damaged(message: bytes, rng: Random) -> bytes:
    """Truncate a message, flip some of its bits, or write a wrong length into it."""
    data = bytearray(message)
    match rng.randrange(4):
        case 0:
            return bytes(data[:rng.randrange(len(data) + 1)])
        case 1:
            for _ in range(rng.randrange(1, 4)):
                data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        case 2:
            place = rng.randrange(1 + (len(data) - 1) // 4) * 4
            length = rng.choice((2 ** 32 - 1, 2 ** 31, 2 ** 30, 2 ** 29 + 1, len(data), 3))
            data[place:place + 4] = struct.pack(rng.choice('<>') + 'I', length)
        case _:
            begin = rng.randrange(len(data))
            data[begin:] = rng.randbytes(rng.randrange(60))
    return bytes(data)


@pytest.fixture(scope='session')
def attack(ours: tuple[list[Topic], Monitor],
           tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Write the extractors of our messages and a corpus for them; return folder and file."""
    topics = [replace(topic, signals=topic.signals[:MOST_INPUTS // 4]) for topic in ours[0]]
    folder = tmp_path_factory.mktemp('attack')
    write_module(c_module(specification_for(topics)), folder)
    file = folder / 'corpus'
    file.write_bytes(b''.join(struct.pack('<II', number, len(message)) + message
                              for number, message in corpus(topics, Random(7))))
    return folder, file


def run_attack(attack: tuple[Path, Path], *command: str) -> str:
    """Compile the extractors, read the corpus with them, and return what that prints."""
    folder, file = attack
    program = folder / 'fuzz'
    compile_c([*command, '-std=c99', '-ffp-contract=off', *WARNINGS, f'-I{CSRC}',
               folder / 'readers_fields.c', HERE / 'extractor_fuzz.c', '-lm', '-o', program])
    done = subprocess.run([program, file], capture_output=True, text=True, check=False,
                          timeout=120)
    assert done.returncode == 0, done.stderr[-4000:]
    assert done.stderr == ''
    return done.stdout


def sanitized() -> list[tuple[str, ...]]:
    """Return the compilers that support sanitizers here."""
    found: list[tuple[str, ...]] = []
    probe = 'int main(void) {return 0;}\n'
    for compiler, flags in ((gcc(), SANITIZERS), (clang(), (
            '-fsanitize=undefined', '-fno-sanitize-recover=all', '-g', '-O1'))):
        if compiler and subprocess.run(
                [*compiler, *flags, '-x', 'c', '-', '-o', '/dev/null'], input=probe, text=True,
                capture_output=True, check=False).returncode == 0:
            found.append((*compiler, *flags))
    return found


def test_no_bytes_cause_undefined_behaviour_in_an_extractor_and_no_compiler_warns(
        attack: tuple[Path, Path]) -> None:
    commands = sanitized()  # with warnings as errors, as the plain one
    if not commands:
        pytest.skip('needs a compiler with sanitizers')
    plain = gcc() or clang()
    assert plain is not None
    expected = run_attack(attack, *plain, '-O3')
    decoded, total = map(int, expected.split()[:2])
    assert 0.1 < decoded / total < 0.9
    for command in commands:
        assert run_attack(attack, *command) == expected


def test_the_sanitizers_detect_a_read_one_byte_too_far(
        attack: tuple[Path, Path], tmp_path: Path) -> None:
    commands = [command for command in sanitized() if SANITIZERS[0] in command]
    if not commands:
        pytest.skip('needs gcc with the address sanitizer')
    folder, file = attack
    for name in ('fret_cdr.h', 'fret_cells.h', 'fret_fields.h', 'fret_monitor.h',
                 'fret_reductions.h'):
        shutil.copyfile(CSRC / name, tmp_path / name)
    header = (tmp_path / 'fret_cdr.h').read_text()
    right = 'size > left - padding'
    assert right in header
    (tmp_path / 'fret_cdr.h').write_text(header.replace(right, 'size > left - padding + 1u'))
    compile_c([*commands[0], '-O0', '-std=c99', f'-I{tmp_path}', folder / 'readers_fields.c',
               HERE / 'extractor_fuzz.c', '-lm', '-o', tmp_path / 'fuzz'])
    done = subprocess.run([tmp_path / 'fuzz', file], capture_output=True, text=True, check=False,
                          timeout=120)
    assert 'heap-buffer-overflow' in done.stderr


def test_the_same_messages_give_the_same_bytes(prefix: Path) -> None:
    def sources() -> tuple[tuple[str, str], ...]:
        layout = find_message('lay_msgs/msg/Deep', [prefix])
        return c_module(specification_for([topic_of(layout, 0, MOST_INPUTS)])).sources

    assert sources() == sources()
