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

"""A trace in a CSV file is one more recording: `bag` gives the verdicts of `simulate`."""

from dataclasses import replace
import json
from pathlib import Path
from random import Random
from xml.etree import ElementTree

from bag.outline import Outline
from bag.recordings import Kept, write
from bundles import write_bundle
from fret_monitor.bag.check import check_recording, RecordingResult, run, Selection
from fret_monitor.bag.moments import Moment
from fret_monitor.bag.trace import Trace
from fret_monitor.build import build_specification
from fret_monitor.cli.main import main
from fret_monitor.logic.formula import Historically
from fret_monitor.model.diagnostics import CompileError
from fret_monitor.model.policies import Policy, Report
from fret_monitor.traces import csv_trace
from fret_monitor.traces.csv_trace import seconds_text
from fret_monitor.traces.simulate import simulate
import pytest
from strategies import INPUTS, random_inputs, random_property, random_trace, some, specification_of
from traces.timed_traces import timed, write_trace

SECOND = 10**9
PUMP = """format: 1
evaluation: {policy: POLICY}
inputs:
  level: {topic: level, type: std_msgs/msg/Float64, timeout: 0.001, stale: violate}
  flow: {type: float64}
requirements:
  - {id: LOW, ptltl: "level < 5"}
  - {id: ANSWER, fretish: "when flow > 1 the pump shall within WITHIN satisfy level > 1"}
"""
ROWS = """time,level,note,flow
100,0,a,0
101,0,b,2
102.5,0,c,2
104,6,d,0
105,0,e,0
106,0,f,2
"""


def bundle(folder: Path, policy: str) -> Path:
    file = folder / f'{policy}.yaml'
    within = '2 seconds' if policy == 'timed' else '2 ticks'
    file.write_text(PUMP.replace('POLICY', policy).replace('WITHIN', within), encoding='utf-8')
    return file


def trace(folder: Path, text: str = ROWS) -> Path:
    file = folder / 'trace.csv'
    file.write_text(text, encoding='utf-8', errors='surrogateescape')
    return file


def check(folder: Path, policy: str, text: str = ROWS, **options: object) -> RecordingResult:
    selection = replace(Selection(), **options)  # type: ignore[arg-type]
    return check_recording(bundle(folder, policy), trace(folder, text), selection)


@pytest.mark.parametrize('policy', some([*Policy], 2))
def test_random_requirements_have_the_verdicts_of_simulate(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, policy: Policy) -> None:
    rng = Random(policy.value)
    is_timed = policy is Policy.TIMED
    specification = specification_of(
        [replace(random_property(rng, f'R-{number}', random_inputs(rng), reach=70,
                                 loops=0 if is_timed else number % 2),
                 report=Report.OCCURRENCE) for number in range(30)], INPUTS, policy)
    specification = timed(specification) if is_timed else specification
    specification = replace(specification, signals=tuple(
        replace(item, initial=item.type.is_number and 1) for item in specification.signals))
    monitor = build_specification(specification).monitor
    ticks = [0]
    for _ in range(200):
        ticks.append(ticks[-1] + rng.choice([1, 1, 2, 3, 9, 30, 100]))
    columns = random_trace(rng, INPUTS, len(ticks))
    begin = rng.choice([0, -3, 5_000_000_000])
    write_trace(ticks, columns, tmp_path / 'trace.csv', begin)
    monkeypatch.setattr(csv_trace, '_BLOCK_ROWS', 64)
    summary = simulate(monitor, tmp_path / 'trace.csv', tmp_path / 'verdicts.csv')
    kept = Kept()
    result = run(monitor, Trace(tmp_path / 'trace.csv'), Selection(), changes=[kept])
    assert (result.errors, result.warnings, result.amount) == ((), (), '201 rows')
    assert (result.begin, result.end) == (begin, begin + ticks[-1])
    ids = [item.id for item in result.findings]
    firsts = {name: seconds_text(step) if is_timed else seconds_text(begin + ticks[step])
              for name, step in summary.first.items()}
    assert {item.id: seconds_text(item.first) for item in result.findings
            if item.first is not None} == firsts
    assert len(firsts) > 10
    for item in result.findings:
        assert item.violations == (None if is_timed else summary.violations[item.id])
    # Of H p, what changes is p: not in the table of `simulate`.
    changing = [number for number, item in enumerate(specification.properties)
                if not isinstance(item.formula, Historically)]
    expected = changes_of(tmp_path / 'verdicts.csv', ids, None if is_timed else [
        begin + tick for tick in ticks], changing)
    assert sorted(item for item in kept.found if item[1] in changing) == expected


def changes_of(file: Path, ids: list[str], times: list[int] | None,
               numbers: list[int]) -> list[tuple[int, int, bool]]:
    """Return when verdicts of requirements change in a table of `simulate`."""
    heading, *rows = (line.split(',') for line in file.read_text(encoding='utf-8').splitlines())
    assert heading[1:] == ids
    last = ['1'] * len(ids)
    found = []
    for place, *verdicts in rows:
        time = csv_trace.parse_seconds(place) if times is None else times[int(place)]
        found += [(time, number, verdicts[number] == '1') for number in numbers
                  if verdicts[number] != last[number]]
        last = verdicts
    return found


def test_the_rows_of_a_timed_trace_have_deadlines_between_and_after_them(tmp_path: Path) -> None:
    low, answer = check(tmp_path, 'timed').findings
    assert (low.verdict, low.first, low.longest) == (False, 104 * SECOND, SECOND)
    assert (answer.verdict, answer.occurrences) == (False, 1)
    assert (answer.spans[0][0] - 103 * SECOND) in (0, 1)
    _, answer = check(tmp_path, 'timed', until=Moment.parse('end+3')).findings
    assert answer.occurrences == 2
    low, answer = check(tmp_path, 'timed', begin=Moment.parse('4.5')).findings
    assert (low.verdict, answer.verdict, answer.is_open) == (False, None, True)
    found = check(tmp_path, 'timed', begin=Moment.parse('5'), end=Moment.parse('5.5')).findings
    assert [item.verdict for item in found] == [True, True]
    # A trace has no time before its first row.
    for begin in ('0', 'start', 'start-5'):
        assert check(tmp_path, 'timed', begin=Moment.parse(begin)).begin == 100 * SECOND


def test_rows_without_times_are_a_second_or_a_period_apart(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = 'level,flow\n0,0\n7,0\n7,0\n0,0\n'
    low, _ = check(tmp_path, 'every_message', text).findings
    assert (low.violations, low.first, low.longest) == (2, SECOND, 2 * SECOND)
    low, _ = check(tmp_path, 'periodic, rate: 50', text).findings
    assert (low.violations, low.first) == (2, SECOND // 50)
    assert main(['bag', str(bundle(tmp_path, 'every_message')), str(trace(tmp_path, text))]) == 0
    out, err = capsys.readouterr()
    assert out.startswith(f'{tmp_path}/trace.csv: 4 rows, 3 s\n')
    assert err == f"warning: {tmp_path}/trace.csv: no column 'time': a row counts as 1 s\n"


def test_every_output_takes_a_trace(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, path = bundle(tmp_path, 'timed'), trace(tmp_path)
    outputs = {name: tmp_path / f'out.{name}' for name in ('csv', 'junit', 'mcap', 'report')}
    arguments = [text for name, out in outputs.items() for text in (
        f'--{name}', str(out.with_suffix('.html') if name == 'report' else out))]
    assert main(['bag', str(file), str(path), '--json', '--fail-on-violation', *arguments]) == 1
    line = json.loads(capsys.readouterr().out)
    assert (line['bag'], line['recorded'], line['read'], line['errors']) == (str(path), 6, 6, [])
    assert line['requirements']['LOW'] == {
        'meaning': line['requirements']['LOW']['meaning'],
        'verdict': False, 'violations': None, 'occurrences': 1, 'first': '104.000000000'}
    assert outputs['csv'].read_text(encoding='utf-8').splitlines()[:2] == [
        'time,LOW,ANSWER', '100.000000000,1,1']
    assert ElementTree.parse(outputs['junit']).getroot()[0].get('failures') == '2'
    verdicts = check_recording(seen(tmp_path), outputs['mcap'], Selection())
    assert verdicts.findings[0].violations == 1
    page = (tmp_path / 'out.html').read_text(encoding='utf-8')
    found = Outline(page)
    assert found.of('dd')[2:6] == ['100', '106', '6 s', '6 rows']
    level, flow = found.data['inputs']
    assert [item[1:] for item in level['v']] == [[0], [6], [0]]
    assert [item[1:] for item in flow['v']] == [[0], [2], [0], [2]]
    assert 'foxglove.dev' not in page
    assert '104' in found.of('code')


def seen(folder: Path) -> Path:
    """Return a bundle for what `--mcap` writes."""
    return write_bundle(folder, """format: 1
inputs: {ok: {topic: /copilot/verdict/LOW, type: std_msgs/msg/Bool, field: data}}
requirements: [{id: SEEN, ptltl: "ok"}]
""", 'seen.yaml')


def test_traces_and_bags_are_checked_together_and_results_go_on(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = write_bundle(tmp_path, """format: 1
inputs: {level: {topic: level, type: std_msgs/msg/Float64}}
requirements: [{id: LOW, ptltl: "level < 5"}]
""", 'low.yaml')
    paths = [trace(tmp_path), write(tmp_path / 'bag', [('/level', 0, 6.0)])]
    arguments = ['bag', str(file), *map(str, paths), '--results', str(tmp_path / 'r.jsonl'),
                 '--jobs', '2', '--report', str(tmp_path / 'pages')]
    assert main(arguments) == 0
    assert len(list((tmp_path / 'pages').iterdir())) == 3
    capsys.readouterr()
    assert main(arguments) == 0
    assert capsys.readouterr().out == ''.join(
        f'{path}: checked before, violated: LOW\n' for path in paths)


@pytest.mark.parametrize(('policy', 'text', 'message', 'help'), [
    ('timed', 'level,flow\n1,2\n', "1:1: error: the trace has no column 'time'",
     'under policy: timed each row has a time'),
    ('timed', 'level,flow,Time\n1,2,3\n', "1:1: error: the trace has no column 'time'",
     "rename the column 'Time'"),
    ('every_message', 'levle,flow\n1,2\n', "1:1: error: the trace has no column for 'level'",
     "the column 'levle' is close to 'level'"),
    ('every_message', '', "1:1: error: the trace has no column for 'level', 'flow'", ''),
])
def test_a_heading_that_does_not_fit_is_refused_with_its_place(
        tmp_path: Path, policy: str, text: str, message: str, help: str) -> None:
    with pytest.raises(CompileError) as error:
        check(tmp_path, policy, text)
    assert str(error.value).startswith(f'{tmp_path}/trace.csv:{message}')
    assert help in str(error.value)


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CompileError, match=r"there is no file '.*gone\.csv'"):
        check_recording(bundle(tmp_path, 'timed'), tmp_path / 'gone.csv', Selection())


@pytest.mark.parametrize(('row', 'place', 'message'), [
    ('103,x,g,0', '5:5', "'x' is no value of 'level'"),
    ('103,1,g', '5:1', '3 cells in a row of a trace with 4 columns'),
    ('101,1,g,0', '5:1', 'a time before that of the row before'),
    ('1e3,1,g,0', '5:1', "'1e3' is no time"),
    ('103,"1,g,0', '5:1', 'not CSV: unexpected end of data'),
    ('103,1,g\udcff', '5:8', 'not text in UTF-8'),
])
def test_rows_before_a_damaged_one_are_judged(
        tmp_path: Path, capsys: pytest.CaptureFixture[str], row: str, place: str,
        message: str) -> None:
    lines = ROWS.splitlines()
    text = '\n'.join([*lines[:4], row, *lines[4:]]) + '\n'
    arguments = ['bag', str(bundle(tmp_path, 'timed')), str(trace(tmp_path, text)), '--json']
    assert main(arguments) == 1
    out, err = capsys.readouterr()
    line = json.loads(out)
    assert line['read'] == 3
    assert f'trace.csv:{place}: {message}' in line['errors'][0]
    assert 'message' not in ''.join(line['errors'])
    assert all('\n' not in error for error in line['errors'])
    assert 'the recording cannot be read to its end: ' in err
    assert main([*arguments, '--partial']) == 0
    found = json.loads(capsys.readouterr().out)['requirements']
    assert found['LOW']['occurrences'] == 0
    assert main([*arguments, '--partial', '--report', str(tmp_path / 'page.html')]) == 0
