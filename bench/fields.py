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

"""
Measure reading parts of arrays and named elements, beside one plain field of the same message.

C calls the generated extractors in turn (`bench/fields.c`). A ratio is that of two times in one
round, the median of the rounds.

    python -m bench.fields
"""

from pathlib import Path
from statistics import median
import struct
import subprocess
import sys
import tempfile

from fret_monitor.cli.main import main as fret_monitor
from fret_monitor.native.compiler import find_compiler
from fret_monitor.native.folder import open_folder

from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState, LaserScan

SCAN, JOINTS = 'sensor_msgs/msg/LaserScan', 'sensor_msgs/msg/JointState'
FIELDS = (
    (SCAN, 'ranges[180]'), (SCAN, 'min(ranges[300:420])'), (SCAN, 'min(ranges)'),
    (SCAN, 'min(ranges[-30 deg : 29.5 deg])'), (SCAN, 'min(ranges[150 deg : -150.5 deg])'),
    (JOINTS, 'position[29]'), (JOINTS, 'position[name = joint_00]'),
    (JOINTS, 'position[name = joint_29]'))
HERE = Path(__file__).resolve().parent


def main() -> int:
    """Print the table."""
    with tempfile.TemporaryDirectory() as name:
        rounds = measured(Path(name))
    print('| field | a message | ratio to the plain field |')
    print('|---|---|---|')
    for place, (kind, field) in enumerate(FIELDS):
        plain = [item for item, _ in FIELDS].index(kind)
        ratio = median(times[place] / times[plain] for times in rounds)
        print(f'| `{field}` | {median(times[place] for times in rounds):.1f} ns | {ratio:.2f} |')
    return 0


def measured(folder: Path) -> list[list[float]]:
    """Return the nanoseconds of each field, in each round."""
    lines = [f"  x{place}: {{topic: t{place}, type: {kind}, field: '{field}'}}\n"
             for place, (kind, field) in enumerate(FIELDS)]
    asked = ' & '.join(f'x{place} >= 0' for place in range(len(FIELDS)))
    bundle, built = folder / 'fields.yaml', folder / 'built'
    bundle.write_text(f'format: 1\ninputs:\n{"".join(lines)}'
                      f'requirements:\n  - {{id: R, ptltl: {asked}}}\n', encoding='utf-8')
    assert fret_monitor(['compile', str(bundle), '--output', str(built)]) == 0
    readers = open_folder(built).manifest.readers
    scan = LaserScan(angle_min=-3.14159274, angle_increment=0.00872664619,
                     ranges=[1.0 + place % 7 for place in range(720)])
    joints = JointState(name=[f'joint_{place:02}' for place in range(30)],
                        position=[float(place) for place in range(30)])
    messages = {SCAN: serialize_message(scan), JOINTS: serialize_message(joints)}
    (folder / 'messages').write_bytes(b''.join(
        struct.pack('I', len(messages[kind])) + messages[kind] for kind, _ in FIELDS))
    program = folder / 'fields'
    subprocess.run([*find_compiler().command, '-std=c99', '-O3', '-ffp-contract=off',
                    f'-DSYMBOL={readers}', f'-I{HERE.parent / "csrc" / "generated"}', f'-I{built}',
                    HERE / 'fields.c', *built.rglob('*_fields.c'), '-lm', '-o', program],
                   check=True)
    done = subprocess.run([program, folder / 'messages'], check=True, capture_output=True,
                          text=True)
    return [[float(word) for word in line.split()] for line in done.stdout.splitlines()]


if __name__ == '__main__':
    sys.exit(main())
