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

"""States of lifecycle nodes and parameters in recordings: as topics with the same changes."""

from pathlib import Path
from random import Random
from typing import Any

from bag.recordings import START, TYPES
from fret_monitor.bag.check import check_recording, RecordingResult, Selection
from fret_monitor.cli.main import main
import numpy
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer

MS = 10**6
EVENTS = 'rcl_interfaces/msg/ParameterEvent'
TRANSITION = 'lifecycle_msgs/msg/TransitionEvent'
REQUIREMENTS = """
requirements:
  - {id: ACTIVE, ptltl: state = ACTIVE | Y state = INACTIVE}
  - {id: SPEED, ptltl: speed < 1.5 -> mode = SLOW}
  - {id: BOTH, ptltl: on -> count > 2}
  - {id: SEEN, ptltl: "!came"}
"""
ASKED = """
format: 1
inputs:
  state: {lifecycle: controller}
  speed: {parameter: {node: controller, name: limits.speed}, type: float64}
  mode: {parameter: {node: /robot/controller, name: mode}, type: string, values: {SLOW: slow}}
  on: {parameter: {node: /other, name: mode}, type: bool}
  count: {parameter: {node: controller, name: count}, type: int64}
  came: {parameter: {node: controller, name: count}, type: int64, field: received()}
evaluation: {policy: POLICY}
"""
PLAIN = """
format: 1
inputs:
  state: {topic: /state, type: std_msgs/msg/Int32, values: {INACTIVE: 2, ACTIVE: 3}}
  speed: {topic: /speed, type: std_msgs/msg/Float64}
  mode: {topic: /mode, type: std_msgs/msg/String, values: {SLOW: slow}}
  on: {topic: /on, type: std_msgs/msg/Bool}
  count: {topic: /count, type: std_msgs/msg/Int64}
  came: {topic: /count, type: std_msgs/msg/Int64, field: received()}
evaluation: {policy: POLICY}
"""
VALUES = {'bool': 1, 'int64': 2, 'float64': 3, 'string': 4}
NUMBERS: dict[str, tuple[str, str, str, list[Any]]] = {
    'speed': ('/robot/controller', 'limits.speed', 'float64', [0.5, 1.0, 2.5]),
    'mode': ('/robot/controller', 'mode', 'string', ['slow', 'fast', '']),
    'on': ('/other', 'mode', 'bool', [True, False]),
    'count': ('/robot/controller', 'count', 'int64', [0, 2, 3, 2**40])}


def value_of(kind: str, value: Any) -> Any:
    make = TYPES.types['rcl_interfaces/msg/ParameterValue']
    empty = [numpy.array([], dtype=item) for item in ('uint8', 'bool', 'int64', 'float64')]
    return make(VALUES.get(kind, 0), value if kind == 'bool' else False,
                value if kind == 'int64' else 7, value if kind == 'float64' else 7.0,
                value if kind == 'string' else 'seven', *empty, [])


def parameter(name: str, kind: str, value: Any) -> Any:
    return TYPES.types['rcl_interfaces/msg/Parameter'](name, value_of(kind, value))


def event(node: str, *changed: Any, new: tuple[Any, ...] = (), gone: tuple[Any, ...] = (),
          is_little: bool = True) -> bytes:
    make = TYPES.types[EVENTS]
    time = TYPES.types['builtin_interfaces/msg/Time'](1, 2)
    return bytes(TYPES.serialize_cdr(
        make(time, node, [*new], [*changed], [*gone]), EVENTS, little_endian=is_little))


def transition(before: int, after: int) -> bytes:
    state, step = (TYPES.types[f'lifecycle_msgs/msg/{name}'] for name in ('State', 'Transition'))
    return bytes(TYPES.serialize_cdr(TYPES.types[TRANSITION](
        5, step(97, 'transition_success'), state(before, 'before'), state(after, 'after')),
        TRANSITION))


Records = list[tuple[int, str, str, bytes]]  # time, topic, type, message


def write(path: Path, records: Records) -> Path:
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {(name, kind): writer.add_connection(name, kind, typestore=TYPES)
                       for name, kind in dict.fromkeys((item[1], item[2]) for item in records)}
        for time, name, kind, data in records:
            writer.write(connections[name, kind], START + time, data)
    return path


def random_records(seed: int) -> tuple[Records, Records]:
    """Return events, and the same changes as messages of plain topics."""
    rng = Random(seed)
    events: Records = []
    plain: Records = []
    last: dict[str, Any] = {}
    state = 1

    def plainly(time: int, name: str, kind: str, value: Any) -> None:
        if last.get(name) != value or name not in last:
            last[name] = value
            plain.append((time, f'/{name}', kind, bytes(
                TYPES.serialize_cdr(TYPES.types[kind](value), kind))))

    for number in range(200):
        time = number * 10 * MS + 1
        if rng.random() < 0.3:
            after = rng.choice([1, 2, 3, 10, 11, 13, 14])
            events.append((time, '/robot/controller/transition_event', TRANSITION,
                           transition(state, after)))
            state = after
            if after < 5:
                plainly(time, 'state', 'std_msgs/msg/Int32', after)
            continue
        node = rng.choice(['/robot/controller', '/other', '/robot', '/robot/controller2'])
        chosen = [name for name in NUMBERS if NUMBERS[name][0] == node and rng.random() < 0.6]
        items = []
        for name in chosen:
            _, parameter_name, kind, values = NUMBERS[name]
            value = rng.choice(values)
            items.append(parameter(parameter_name, kind, value))
            plainly(time, name, f'std_msgs/msg/{kind.capitalize()}', value)
        cut = rng.randrange(len(items) + 1)
        events.append((time, '/parameter_events', EVENTS, event(
            node, parameter('limits', 'float64', 0.0), *items[:cut], new=tuple(items[cut:]),
            gone=(parameter('gone', 'bool', False),), is_little=rng.random() < 0.8)))
    last_state = 1 if last.get('state') != 1 else 2
    events.append((3 * 10**9, '/robot/controller/transition_event', TRANSITION,
                   transition(state, last_state)))
    plainly(3 * 10**9, 'state', 'std_msgs/msg/Int32', last_state)
    return events, plain


def checked(folder: Path, text: str, records: Records, **options: Any) -> RecordingResult:
    folder.mkdir()
    bundle = folder / 'bundle.yaml'
    bundle.write_text(text, encoding='utf-8')
    return check_recording(bundle, write(folder / 'recording', records),
                           Selection(namespace='/robot', **options))


@pytest.mark.parametrize('policy', ['every_message', 'all_inputs', 'timed'])
@pytest.mark.parametrize('seed', range(2))
def test_states_and_parameters_are_judged_as_topics_with_their_changes(
        tmp_path: Path, policy: str, seed: int) -> None:
    events, plain = random_records(seed)
    found, wanted = (
        checked(tmp_path / name, (text + REQUIREMENTS).replace('POLICY', policy), records)
        for name, text, records in (('asked', ASKED, events), ('plain', PLAIN, plain)))
    assert found.errors == wanted.errors == ()
    assert [(item.violations, item.spans) for item in found.findings] == [
        (item.violations, item.spans) for item in wanted.findings]
    assert sum(item.occurrences for item in wanted.findings) > 10


def test_what_is_missing_or_of_another_type_is_reported(tmp_path: Path) -> None:
    speed = parameter('limits.speed', 'string', 'fast')
    found = checked(tmp_path / 'one', ASKED.replace('POLICY', 'timed') + REQUIREMENTS, [
        (1, '/parameter_events', EVENTS, event('/robot/controller', speed)),
        (2, '/parameter_events', EVENTS, event('/robot/controller', gone=(
            parameter('count', 'int64', 1),))),
        (3, '/parameter_events', EVENTS, event('/other', parameter('mode', 'bool', True))),
    ], may_miss=True)
    assert found.errors == (
        'no message of parameter limits.speed of controller has a value of speed',
        'parameter limits.speed of controller: its type is string, and not float64; its input '
        'has no value yet')
    assert found.warnings == (
        '/robot/controller/transition_event was not recorded',
        'parameter count of controller: the node has no such parameter; its input has no '
        'value yet')


def test_a_message_that_is_cut_off_is_counted(tmp_path: Path) -> None:
    records, _ = random_records(1)
    whole = [event('/robot/controller', parameter('count', 'int64', 1)), transition(1, 2)]
    kinds = [('/parameter_events', EVENTS), ('/robot/controller/transition_event', TRANSITION)]
    records += [(4 * 10**9, *kind, data[:-3]) for kind, data in zip(kinds, whole)]
    found = checked(tmp_path / 'one', ASKED.replace('POLICY', 'timed') + REQUIREMENTS, records)
    assert found.errors[2:] == (
        '1 message of controller/transition_event cannot be decoded as '
        'lifecycle_msgs/msg/TransitionEvent',
        '1 message of /parameter_events cannot be decoded as rcl_interfaces/msg/ParameterEvent')


@pytest.mark.parametrize('source', [
    'node: /controller', 'publishers: scan', 'subscribers: /robot/scan'])
def test_what_only_a_graph_has_is_refused_beside_what_a_recording_has(
        tmp_path: Path, source: str, capsys: pytest.CaptureFixture[str]) -> None:
    text = ASKED.replace('POLICY', 'timed').replace('\nevaluation', f'\n  seen: {{{source}}}'
                                                    '\nevaluation')
    bundle = tmp_path / 'bundle.yaml'
    bundle.write_text(text + REQUIREMENTS + '  - {id: GRAPH, ptltl: "seen = seen"}\n',
                      encoding='utf-8')
    recording = write(tmp_path / 'recording', random_records(0)[0])
    assert main(['bag', '--namespace', '/robot', str(bundle), str(recording)]) == 1
    refused = 'is not in a recording, which has no graph of ROS: read a topic instead'
    assert refused in capsys.readouterr().err
    assert main(['bag', '--namespace', '/robot', str(bundle), str(recording),
                 '--remap', 'scan:=/front/scan']) == 1
    err = capsys.readouterr().err
    assert (refused in err) == ('scan' in source), err
    assert ("the bundle has no topic 'scan'" in err) == ('scan' not in source)
