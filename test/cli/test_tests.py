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

"""`tests BUNDLE --output DIR`: the folder, what `simulate` makes of it, and what is refused."""

import json
from pathlib import Path
import subprocess
import sys

from cli.command import Here
from fret_monitor.testgen import folder
from fret_monitor.testgen.folder import ReplayDiffers
import pytest

VALVE = """\
format: 1
component: valve
inputs:
  open: {type: bool}
  pressure: {type: float64}
  state: {type: string, topic: state, values: {calm: c, alarm: x}}
requirements:
  - {id: "V,1", fretish: "upon pressure > 3.0 valve shall within 2 ticks satisfy open"}
  - {id: V2, ptltl: "state = calm | Y open | FTP"}
"""


def contents(directory: Path) -> dict[str, bytes]:
    return {str(path.relative_to(directory)): path.read_bytes()
            for path in directory.rglob('*') if path.is_file()}


def test_simulate_gives_the_expected_verdicts_on_each_trace(here: Here) -> None:
    bundle, output = here.file('valve.yaml', VALVE), here.folder / 'tests'
    done = here.run('tests', bundle, '--output', output)
    assert (done.status, done.err) == (0, '')
    assert done.out.splitlines()[:3] == [
        'requirement  verdict  timing  bounds  operators  comparisons  conditions  traces',
        'V,1              3/3     6/6       -        2/2          1/1         2/2       7',
        'V2               3/3       -       -        2/2            -         2/2       3']
    index = json.loads((output / 'tests.json').read_text())
    assert len(index['traces']) == 10
    for trace in index['traces']:
        found = here.run('simulate', bundle, '--trace', output / trace['trace'])
        assert found.out == (output / trace['verdicts']).read_text()
    assert sorted(index['files']) == sorted(contents(output))
    before = contents(output)
    assert here.run('tests', bundle, '--output', output).status == 0
    assert contents(output) == before


def test_folders_of_several_bundles_are_collected_in_one_run(here: Here) -> None:
    bundle = VALVE.replace('{type: bool}', '{topic: o, type: std_msgs/msg/Bool}') \
        .replace('{type: float64}', '{topic: p, type: std_msgs/msg/Float64}') \
        .replace('{type: string,', '{type: std_msgs/msg/String,')
    for name in ('valve', 'other valve'):
        done = here.run('tests', here.file(f'{name}.yaml', bundle), '--output',
                        here.folder / f'{name} tests')
        assert (done.status, done.err) == (0, '')
    collected = subprocess.run(
        [sys.executable, '-m', 'pytest', '--collect-only', '-q', '-p', 'no:cacheprovider',
         here.folder], capture_output=True, text=True, check=False, cwd=here.folder)
    assert collected.returncode == 0, collected.stdout
    assert {line.partition('::')[0] for line in collected.stdout.splitlines() if '::' in line} == {
        'valve tests/test_valve_traces.py', 'other valve tests/test_other_valve_traces.py'}


def test_the_document_has_each_obligation_with_its_traces(here: Here) -> None:
    bundle, output = here.file('valve.yaml', VALVE), here.folder / 'tests'
    done = here.run('tests', bundle, '--output', output, '--json')
    found = json.loads(done.out)
    assert set(found) == {'output', 'files', 'partial', 'obligations', 'diagnostics'}
    late = next(each for each in found['obligations']
                if each['what'] == 'violated: one too late')
    assert late['kind'] == 'timing' and late['answer'] == 'covered' and late['detail'] == ''
    name, = late['traces']
    step, = late['at']
    index = json.loads((output / 'tests.json').read_text())
    trace = next(each for each in index['traces'] if each['name'] == name)
    assert 'violated: one too late' in trace['shows']
    rows = (output / trace['verdicts']).read_text().splitlines()
    assert rows[0] == 'step,"V,1",V2' and rows[step + 1].split(',')[1] == '0'


def test_fret_reads_its_traces(here: Here) -> None:
    # As fret-electron/app/components/LTLSimDialog.js and LTLSimController.js write them.
    output = here.folder / 'tests'
    here.run('tests', here.file('valve.yaml', VALVE), '--output', output)
    traces = json.loads((output / 'fret_traces.json').read_text())
    for trace in traces:
        inner = trace['theTrace']
        assert set(inner) == {'traceLength', 'keys', 'type', 'canChange', 'minval', 'maxval',
                              'values'}
        width = len(inner['keys'])
        assert len(inner['values']) == width * inner['traceLength'] >= 4 * width
        for place in range(width):
            column = inner['values'][place::width]
            assert inner['minval'][place] <= min(column) <= max(column) <= inner['maxval'][place]
    assert {trace['traceLinkedRequirementIDs'][0] for trace in traces} == {'V,1', 'V2'}
    assert traces[0]['theTrace']['keys'] == ['open', 'pressure']
    assert traces[0]['theTrace']['type'] == ['category', 'number']


def test_a_folder_with_other_files_is_not_replaced(here: Here) -> None:
    bundle, output = here.file('valve.yaml', VALVE), here.folder / 'tests'
    output.mkdir()
    (output / 'mine.txt').write_text('kept')
    done = here.run('tests', bundle, '--output', output)
    assert done.status == 1 and 'holds other files' in done.err
    assert contents(output) == {'mine.txt': b'kept'}


def test_nothing_is_written_when_it_is_interrupted_or_a_replay_differs(
        here: Here, monkeypatch: pytest.MonkeyPatch) -> None:
    bundle, output = here.file('valve.yaml', VALVE), here.folder / 'tests'

    def interrupt(*arguments: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as context:
        context.setattr(folder, '_replay', interrupt)
        assert here.run('tests', bundle, '--output', output).status == 130
    assert not output.exists()

    def invert(self: object, trace: object) -> str:
        return 'step\n'

    monkeypatch.setattr(folder._Reference, 'verdicts', invert)
    with pytest.raises(ReplayDiffers, match=r'traces/handlerpropV_1/1\.csv'):
        here.run('tests', bundle, '--output', output)
    assert [path.name for path in here.folder.iterdir()] == ['valve.yaml']


def test_partial_answers_are_marked(here: Here) -> None:
    bundle, output = here.file('valve.yaml', VALVE), here.folder / 'tests'
    done = here.run('tests', bundle, '--output', output, '--timeout', '0.001', '--json')
    found = json.loads(done.out)
    assert found['partial'] and found['diagnostics'][0]['help'] == (
        '--timeout SECONDS gives it more time')
    assert {each['detail'] for each in found['obligations']} == {'out of time'}
    assert here.run('tests', bundle, '--output', output, '--timeout', '0').status == 2
