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


"""Compiled C gives bounded future the verdicts of its definition, in `simulate` and in `bag`."""

from collections.abc import Iterator
import csv
from pathlib import Path
from random import Random

from bag.recordings import START, TYPES
from bundles import write_bundle
from fret_monitor.cli.main import main
import mltl
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer

POINT = 'geometry_msgs/msg/Point'
NAMES = ('p', 'q', 'r')
STEPS = 60
BUNDLE = """
format: 1
evaluation: {policy: POLICY}
inputs:
  x: {topic: point, type: geometry_msgs/msg/Point, field: x, max_rate: 1000000000}
  y: {topic: point, type: geometry_msgs/msg/Point, field: y, max_rate: 1000000000}
  z: {topic: point, type: geometry_msgs/msg/Point, field: z, max_rate: 1000000000}
definitions: {p: x > 0, q: y > 0, r: z > 0}
requirements:
"""
POLICIES = pytest.mark.parametrize(('policy', 'unit'), [('every_message', ''), ('timed', 'ns')])


def trees(seed: int) -> list[mltl.Tree]:
    rng = Random(seed)
    return [mltl.random_tree(rng, rng.randrange(1, 5), NAMES, 5) for _ in range(25)]


def bundle(folder: Path, made: list[mltl.Tree], policy: str, unit: str) -> Path:
    """Write a bundle of formulas, each of which reads all inputs: they start together."""
    lines = ''.join(f'  - {{id: R{number}, report: onset, mltl: "({mltl.text(tree, unit)}) && '
                    '(p || !p) && (q || !q) && (r || !r)"}\n' for number, tree in enumerate(made))
    return write_bundle(folder, BUNDLE.replace('POLICY', policy) + lines)


def recording(folder: Path, columns: dict[str, list[bool]], spacing: int) -> Path:
    """Write a recording with a message a step."""
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection('point', POINT, typestore=TYPES)
        for t, row in enumerate(zip(*columns.values(), strict=True)):
            message = TYPES.types[POINT](*(2.0 * value - 1 for value in row))
            writer.write(connection, START + t * spacing, TYPES.serialize_cdr(message, POINT))
    return folder


def at_each_step(rows: Iterator[dict[str, str]], spacing: int) -> list[list[bool]]:
    """Return the verdicts at each step from rows that say when one changes."""
    found: list[list[bool]] = []
    for row in rows:
        whole, _, part = row.pop('time').partition('.')
        step = (int(whole) * 10 ** 9 + int(part) - START) // spacing
        verdicts = [text != '0' for text in row.values()]
        found += found[-1:] * (step + 1 - len(found)) if found else [verdicts]
        found[step] = verdicts
    return found + found[-1:] * (STEPS - len(found))


@POLICIES
def test_bag_gives_the_verdicts_of_the_definition(policy: str, unit: str, tmp_path: Path) -> None:
    made = trees(1)
    columns = mltl.random_columns(Random(2), NAMES, STEPS)
    spacing = 1 if unit else 1_000_000
    main(['bag', str(bundle(tmp_path, made, policy, unit)),
          str(recording(tmp_path / 'run', columns, spacing)),
          '--csv', str(tmp_path / 'changes.csv')])
    with (tmp_path / 'changes.csv').open(newline='') as file:
        found = at_each_step(csv.DictReader(file), spacing)
    for number, tree in enumerate(made):
        assert [row[number] for row in found] == mltl.verdicts(tree, columns), mltl.text(tree)


@POLICIES
def test_simulate_gives_the_verdicts_of_the_definition(policy: str, unit: str, tmp_path: Path,
                                                       capsys: pytest.CaptureFixture[str]) -> None:
    made = trees(3)
    columns = mltl.random_columns(Random(4), NAMES, STEPS)
    trace = tmp_path / 'trace.csv'
    rows = [f'0.{t:09d},' * (unit != '') + ','.join(str(2 * value - 1) for value in row)
            for t, row in enumerate(zip(*columns.values(), strict=True))]
    trace.write_text('\n'.join(['time,' * (unit != '') + 'x,y,z', *rows, '']))
    assert main(['simulate', str(bundle(tmp_path, made, policy, unit)),
                 '--trace', str(trace)]) == 0
    output, notes = capsys.readouterr()
    found = list(csv.DictReader(output.splitlines()))
    for number, tree in enumerate(made):
        assert [row[f'R{number}'] == '1' for row in found] == mltl.verdicts(tree, columns), \
            mltl.text(tree)
        assert (f'R{number}: known ' in notes) is (mltl.horizon(tree) > 0)


def test_simulate_names_the_step_that_is_meant(tmp_path: Path,
                                               capsys: pytest.CaptureFixture[str]) -> None:
    path = write_bundle(tmp_path, 'format: 1\ninputs: {p: {type: bool}}\n'
                        'requirements: [{id: A, mltl: "F[0,2] p"}]\n')
    trace = tmp_path / 'trace.csv'
    trace.write_text('p\n1\n0\n0\n0\n1\n')
    main(['simulate', str(path), '--trace', str(trace), '--verdicts', str(tmp_path / 'v.csv')])
    assert 'A: violated first about step 1, at 1 step' in capsys.readouterr().out
    main(['simulate', str(path), '--trace', str(trace), '--json'])
    assert '"first_step": 3, "about_step": 1' in capsys.readouterr().out.replace('\n', ' ') \
        .replace('  ', '').replace(',"', ', "')
