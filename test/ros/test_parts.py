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

"""The parts of a bundle with gates: what each is compiled of, and which node opens it."""

from pathlib import Path

from fret_monitor.build import generate_monitor, read, write
from fret_monitor.model.diagnostics import CompileError
from fret_monitor.model.manifest import Manifest
from fret_monitor.model.parts import NodePart, UNGATED
from fret_monitor.ros.settings.opened import open_gates, open_monitors
from fret_monitor.ros.settings.parameters import Origin, Refusal, Settings
from fret_monitor.start import manifest_of, start
import pytest

BUNDLE = """
format: 1
inputs:
  speed: {topic: raw, type: std_msgs/msg/Float32}
  front: {topic: scan, type: std_msgs/msg/Float32, timeout: 0.5}
  on: {topic: /arm/_service_event, type: std_srvs/srv/SetBool_Event, field: "request[0].data"}
evaluation: {policy: relevant_message}
actions:
  stop: {lock: {topic: e_stop}}
  call: {call: {service: s, type: std_srvs/srv/Trigger}}
requirements:
  - {id: SLOW, ptltl: speed < 1}
  - {id: ARMED, ptltl: "on -> front > 1", on_violation: [call]}
  - {id: REST, ptltl: front > 0, on_violation: [stop, call], on_end: [call]}
gates:
  drive: {from: raw, to: out, type: std_msgs/msg/Float32, keep: [SLOW],
          otherwise: {substitute: {data: 0.5}, rate: 20}}
  arm: {service: /arm, to: /arm_raw, type: std_srvs/srv/SetBool, keep: [ARMED],
        otherwise: {respond: {message: withheld}}, latch: true, open_after: 0.5}
"""
DRIVE, ARM = NodePart('drive'), NodePart('arm')


@pytest.fixture(scope='module')
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp('parts') / 'robot.yaml'
    path.write_text(BUNDLE, encoding='utf-8')
    return path


def manifest(path: Path, part: NodePart | None) -> Manifest:
    return generate_monitor(read(path, part=part)).manifest


def names(found: Manifest) -> tuple[list[str], list[str], list[str]]:
    """Return the requirements, inputs and actions of a manifest."""
    return ([item.id for item in found.requirements], [item.name for item in found.inputs],
            [item.name for item in found.actions])


def test_a_part_has_its_requirements_with_their_inputs_and_actions(path: Path) -> None:
    whole, rest = manifest(path, None), manifest(path, UNGATED)
    drive, arm = manifest(path, DRIVE), manifest(path, ARM)
    assert names(whole) == (['SLOW', 'ARMED', 'REST'], ['speed', 'front', 'on'], ['stop', 'call'])
    assert names(drive) == (['SLOW'], ['speed'], [])
    assert names(arm) == (['ARMED'], ['front', 'on'], ['call'])
    # All inputs: a gate changes nothing for these requirements.
    assert names(rest) == (['REST'], ['speed', 'front', 'on'], ['stop', 'call'])
    assert (rest.requirements[0].on_violation, rest.requirements[0].on_end) == ((0, 1), (1,))
    assert rest.kept == (('drive', ('SLOW',)), ('arm', ('ARMED',)))
    assert (whole.gate, rest.gate, drive.kept) == (None, None, ())
    assert len({item.bundle_hash for item in (whole, rest, drive, arm)}) == 1
    assert len({item.symbol for item in (whole, drive, arm)}) == 3
    for item in (whole, rest, drive, arm):
        assert Manifest.from_json(item.to_json()) == item


def test_the_settings_of_a_gate_are_in_its_manifest(path: Path) -> None:
    drive, arm = manifest(path, DRIVE).gate, manifest(path, ARM).gate
    assert drive is not None
    assert arm is not None
    assert (drive.source, drive.target, drive.topic, drive.period) == ('raw', 'out', 0, 50_000_000)
    assert drive.substitute == b'\0\1\0\0\0\0\0\x3f'
    assert (arm.is_service, arm.topic, arm.latches, arm.open_after) == (True, 1, True, 5 * 10 ** 8)
    assert arm.substitute == b'\0\1\0\0\0\0\0\0\x09\0\0\0withheld\0'


def test_each_part_is_recalled_from_the_cache_as_it_was_built(path: Path) -> None:
    for part in (DRIVE, UNGATED, None):
        built = start(path, part=part)
        assert start(path, part=part).library == built.library
        assert manifest_of(path, part=part) == built.manifest
    text = path.read_text(encoding='utf-8')
    path.write_text(text.replace('0.5}, rate', '0.25}, rate'), encoding='utf-8')
    gate = start(path, part=DRIVE).manifest.gate
    path.write_text(text, encoding='utf-8')
    assert gate is not None
    assert gate.substitute.endswith(b'\x80\x3e')


def test_unknown_gates_and_empty_parts_are_refused(path: Path, tmp_path: Path) -> None:
    with pytest.raises(CompileError, match=r"has no gate 'driv'(.|\n)*did you mean 'drive'"):
        read(path, part=NodePart('driv'))
    kept = tmp_path / 'kept.yaml'
    kept.write_text(BUNDLE.replace('  - {id: REST', '#').replace('keep: [SLOW]', 'keep: SLOW'),
                    encoding='utf-8')
    with pytest.raises(CompileError, match=r"gates keep all requirements of 'kept' \(drive, arm\)"
                                           '(.|\n)*ros2 run fret_monitor gate'):
        read(kept, part=UNGATED)


def test_each_node_opens_its_parts_and_refuses_the_others(path: Path, tmp_path: Path) -> None:
    settings = Settings((Origin(path, None),))
    opened, = open_monitors(settings)
    assert names(opened.monitor.manifest)[0] == ['REST']
    assert opened.warnings == (
        "not monitored here: the gate 'drive' judges SLOW; the gate 'arm' judges ARMED. Run it: "
        f'ros2 run fret_monitor gate --ros-args -p spec:={path}',)
    gates = open_gates(settings)
    assert [item.monitor.manifest.name for item in gates] == ['robot_drive', 'robot_arm']
    assert len(open_gates(settings, ['arm'])) == 1
    with pytest.raises(Refusal, match="no bundle has the gate 'drve': did you mean 'drive'"):
        open_gates(settings, ['drve'])
    with pytest.raises(Refusal, match="'nope': the gates are 'drive', 'arm'"):
        open_gates(settings, ['nope'])

    for part, folder in ((DRIVE, tmp_path / 'drive'), (UNGATED, tmp_path / 'rest')):
        write(generate_monitor(read(path, part=part)), folder)
    drive, rest = (Settings((Origin(None, tmp_path / name),)) for name in ('drive', 'rest'))
    assert len(open_gates(drive)) == len(open_monitors(rest)) == 1
    with pytest.raises(Refusal, match="is compiled for the gate 'drive': ros2 run fret_monitor g"):
        open_monitors(drive)
    with pytest.raises(Refusal, match='is compiled for the monitor: ros2 run fret_monitor moni'):
        open_gates(rest)
