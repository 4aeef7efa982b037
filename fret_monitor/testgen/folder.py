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
The folder with the tests of a bundle: traces and verdicts as CSV, for FRET, and for pytest.

Each trace is replayed through the compiled monitor before the folder appears; its verdicts are
those of the reference semantics.
"""

from collections.abc import Iterator, Sequence
import json
import math
import os
from pathlib import Path
import re

from fret_monitor.build import Reading
from fret_monitor.logic.specification import Property, Specification
from fret_monitor.logic.timed import History
from fret_monitor.model.folders import check_replaceable, replaced_folder
from fret_monitor.model.names import fret_name
from fret_monitor.model.policies import Policy
from fret_monitor.native.cache import evaluator_library
from fret_monitor.native.monitor import Monitor
from fret_monitor.testgen.obligations import Kind
from fret_monitor.testgen.played import announced, obstacle
from fret_monitor.testgen.recorded import history, Recorded
from fret_monitor.testgen.suite import Case, CoverageAnswer, Covered, Suite
from fret_monitor.traces.csv_trace import seconds_text, TIME, trace_text
from fret_monitor.traces.simulate import simulate
from fret_monitor.traces.trace import Row, Value

FORMAT = 1
INDEX_FILE = 'tests.json'
FRET_FILE = 'fret_traces.json'
_SHORTEST_FRET = 4  # steps; FRET's simulator needs them


class ReplayDiffers(Exception):
    """The compiled monitor and the reference semantics differ on a trace: a bug."""


def check_output(directory: Path) -> None:
    """
    Refuse a folder that holds anything else than earlier tests.

    Raises
    ------
    CompileError
        as `check_replaceable`.
    """
    check_replaceable(directory, _former(directory), 'tests')


def _former(directory: Path) -> set[Path] | None:
    """Return the paths that an earlier run wrote; None if there was none."""
    try:
        found = json.loads((directory / INDEX_FILE).read_text(encoding='utf-8'))
        return {Path(name) for name in found['files']}
    except (OSError, ValueError, TypeError, KeyError):
        return None


def write_suite(suite: Suite, monitor: Monitor, reading: Reading, directory: Path) -> int:
    """
    Write the folder, as a whole or not at all; return the number of files.

    The test for pytest is only written if the inputs can be published (`played.obstacle`).

    Raises
    ------
    CompileError
        if the folder cannot be written.
    ReplayDiffers
        if the compiled monitor gives other verdicts than the reference.
    """
    check_output(directory)
    reference = _Reference(suite.specification)
    library = evaluator_library()
    with replaced_folder(directory) as folder:
        names = []
        for case in suite.cases:
            name = trace_name(case)
            names += [name, verdicts_name(case)]
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            trace = text_of(case.trace, suite.specification)
            (folder / name).write_text(trace, encoding='utf-8', newline='')
            expected = reference.verdicts(case.trace)
            _replay(monitor, library, folder, case, expected)
        if suite.specification.policy is not Policy.TIMED:
            names.append(FRET_FILE)
            _write_json(folder / FRET_FILE, _fret(suite))
        is_played = not obstacle(suite.specification)
        if is_played:
            names.append(pytest_file(reading))
            (folder / names[-1]).write_text(_pytest(reading, directory), encoding='utf-8')
        names.append(INDEX_FILE)
        _write_json(folder / INDEX_FILE, {
            'format': FORMAT, 'bundle_hash': reading.bundle_hash,
            'traces': [_case(case, suite.specification, is_played) for case in suite.cases],
            **as_dict(suite), 'files': sorted(names)})
    return len(names)


def pytest_file(reading: Reading) -> str:
    """
    Return the name of the test for pytest.

    It has the bundle's name: pytest refuses two files of one name in different folders.
    """
    stem = re.sub(r'\W', '_', reading.paths[0].stem, flags=re.ASCII)
    return f'test_{stem}_traces.py'


def trace_name(case: Case) -> str:
    """Return the path of a trace in the folder."""
    return f'traces/{case.requirement.handler}/{case.number}.csv'


def verdicts_name(case: Case) -> str:
    """Return the path of the verdicts of a trace."""
    return f'traces/{case.requirement.handler}/{case.number}.verdicts.csv'


def _write_json(path: Path, content: object) -> None:
    path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + '\n', encoding='utf-8')


def _replay(monitor: Monitor, library: Path, folder: Path, case: Case, expected: str) -> None:
    """Run the compiled monitor over a trace; keep its verdicts if they are as expected."""
    path = folder / verdicts_name(case)
    simulate(monitor, folder / trace_name(case), path, library=library)
    found = path.read_bytes().decode()
    if found != expected:
        raise ReplayDiffers(f'{trace_name(case)}: expected\n{expected}\nfound\n{found}')


def text_of(trace: Recorded, specification: Specification) -> str:
    """Return a trace as CSV for `simulate`."""
    if specification.policy is Policy.TIMED:
        ticks, rows = _with_end(trace)
        return trace_text(specification.signals, rows, [seconds_text(tick) for tick in ticks])
    return trace_text(specification.signals, trace.at_each_tick())


def _with_end(trace: Recorded) -> tuple[list[int], list[Row]]:
    """Return the rows of a timed trace, the last of them at its end."""
    ticks, rows = list(trace.ticks), list(trace.rows)
    if trace.end > ticks[-1]:
        ticks.append(trace.end)
        rows.append(rows[-1])
    return ticks, rows


class _Reference:
    """Verdicts of all requirements by the reference; one that sees the same again is not asked."""

    def __init__(self, specification: Specification) -> None:
        self._specification = specification
        self._known: dict[tuple[str, str], History] = {}

    def verdicts(self, trace: Recorded) -> str:
        """Return the verdicts of a trace as CSV, in the form in which `simulate` writes them."""
        properties = self._specification.properties
        is_timed = self._specification.policy is Policy.TIMED
        histories = [self.history(item, trace) for item in properties]
        ticks = sorted({*_with_end(trace)[0], *(start for found in histories
                                                for start, _ in found)}) \
            if is_timed else range(trace.end + 1)
        lines = [[TIME if is_timed else 'step', *(item.id for item in properties)]]
        columns = [_at(found, ticks) for found in histories]
        for place, tick in enumerate(ticks):
            label = seconds_text(tick) if is_timed else str(tick)
            lines.append([label, *(str(int(column[place])) for column in columns)])
        return ''.join(map(_line, lines))

    def history(self, item: Property, trace: Recorded) -> History:
        """Return the verdict of a requirement at each tick."""
        names = [signal.name for signal in self._specification.signals]
        places = [place for place, name in enumerate(names) if name in item.inputs]
        rows = tuple(tuple(row[place] for place in places) for row in trace.rows)
        own = Recorded(trace.ticks, rows, trace.end).columns(0, len(places))
        key = item.id, repr(own)
        if key not in self._known:
            self._known[key] = history(item.formula, item.feedback,
                                       [names[place] for place in places], own)
        return self._known[key]


def _line(cells: Sequence[str]) -> str:
    return ','.join(f'"{cell.replace(chr(34), chr(34) * 2)}"' if set(cell) & set(',"\r\n')
                    else cell for cell in cells) + '\n'


def _at(found: History, ticks: Sequence[int]) -> list[bool]:
    """Return the values of a history at ascending ticks."""
    values, place = [], 0
    for tick in ticks:
        while place + 1 < len(found) and found[place + 1][0] <= tick:
            place += 1
        values.append(bool(found[place][1]))
    return values


def _pytest(reading: Reading, directory: Path) -> str:
    """Return the text of the test that plays the traces."""
    bundle = os.path.relpath(os.path.realpath(reading.paths[0]), os.path.realpath(directory))
    return _PYTEST.format(bundle=bundle, constants=dict(reading.constants))


_PYTEST = '''\
"""
Play the traces of this folder over ROS topics; written by `fret-monitor tests` (docs/tests.md).

Without a node, all inputs of the bundle are published, and the monitor has to announce what the
verdicts say. NODE_UNDER_TEST is the command that starts a node: then the inputs that it does not
set (`role: output`) are published, and it must not violate any requirement.
"""

import json
import os
from pathlib import Path
import shlex

from fret_monitor.testing import play_trace
import pytest

HERE = Path(__file__).parent
BUNDLE = (HERE / {bundle!r}).resolve()
CONSTANTS = {constants!r}
NODE = shlex.split(os.environ.get('NODE_UNDER_TEST', ''))
TRACES = json.loads((HERE / 'tests.json').read_text())['traces']


@pytest.mark.parametrize('trace', TRACES, ids=lambda trace: trace['name'])
def test_trace(trace):
    announced = [] if NODE else trace['announced']
    if announced is None:
        pytest.skip('it cannot be played: see docs/tests.md')
    play_trace(BUNDLE, HERE / trace['trace'], announced, node=NODE or None, constants=CONSTANTS)
'''


# -- for programs ------------------------------------------------------------------------------

def as_dict(suite: Suite) -> dict[str, object]:
    """Return the coverage of the obligations as a JSON object."""
    return {'partial': suite.is_partial, 'obligations': [
        {'requirement': each.requirement, 'kind': each.kind.value, 'what': each.what,
         'answer': each.answer.value, 'detail': each.detail,
         'traces': [f'{each.requirement}/{number}' for number in each.cases],
         'at': [_instant(tick, suite.specification) for tick in each.ticks]}
        for each in suite.covered]}


def _instant(tick: int, specification: Specification) -> int | str:
    return seconds_text(tick) if specification.policy is Policy.TIMED else tick


def _case(case: Case, specification: Specification, is_played: bool) -> dict[str, object]:
    return {'name': f'{case.requirement.id}/{case.number}', 'trace': trace_name(case),
            'verdicts': verdicts_name(case), 'requirement': case.requirement.id,
            'shows': list(case.shows),
            'announced': announced(specification, case.trace) if is_played else None}


def lines(suite: Suite) -> Iterator[str]:
    """Yield the lines of the table: obligations covered of those that can be, by requirement."""
    heading = ['requirement', *(kind.value for kind in Kind), 'traces']
    table = [heading]
    for item in suite.specification.properties:
        own = [each for each in suite.covered if each.requirement == item.id]
        count = sum(case.requirement is item for case in suite.cases)
        table.append([item.id, *(_share(own, kind) for kind in Kind), str(count)])
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    for row in table:
        cells = [row[0].ljust(widths[0]), *(cell.rjust(width) for cell, width
                                            in zip(row[1:], widths[1:], strict=True))]
        yield '  '.join(cells)
    for answer, heading_line in ((CoverageAnswer.UNREACHABLE, 'no trace of any length:'),
                                 (CoverageAnswer.UNKNOWN, 'unknown:')):
        found = [each for each in suite.covered if each.answer is answer]
        if found:
            yield f'\n{heading_line}'
            yield from (f'  {each.requirement}: {each.what} ({each.detail})' for each in found)


def _share(covered: Sequence[Covered], kind: Kind) -> str:
    """Return how many obligations are covered, of those that are not proved unreachable."""
    own = [each for each in covered if each.kind is kind
           and each.answer is not CoverageAnswer.UNREACHABLE]
    count = sum(each.answer is CoverageAnswer.COVERED for each in own)
    return f'{count}/{len(own)}' if own else '-'


# -- for FRET ----------------------------------------------------------------------------------

def _fret(suite: Suite) -> list[dict[str, object]]:
    """Return the traces as FRET's simulator saves them, but for those with values JSON lacks."""
    return [_fret_trace(case, suite) for case in suite.cases
            if all(math.isfinite(value) for row in case.own.rows for value in row)]


def _fret_trace(case: Case, suite: Suite) -> dict[str, object]:
    signals = [signal for signal in suite.specification.signals
               if signal.name in case.requirement.inputs]
    rows = case.own.at_each_tick()
    steps = len(rows)
    rows += [rows[-1]] * (_SHORTEST_FRET - steps)
    columns = [[_fret_value(row[place]) for row in rows] for place in range(len(signals))]
    kinds = ['number' if signal.type.is_number else 'category' for signal in signals]
    least = [min(0, *column) for column in columns]
    most = [max(1, *column) for column in columns]
    padded = f' (steps from {steps} repeat the last)' if steps < _SHORTEST_FRET else ''
    return {
        'traceID': f'{case.requirement.id}/{case.number}',
        'traceDescription': '; '.join(case.shows) + padded,
        'traceLinkedRequirementIDs': [_linked(case.requirement.id)],
        'linkedProject': suite.specification.name, 'updatedFlag': '',
        'theTrace': {
            'traceLength': len(rows), 'keys': [fret_name(signal.name) for signal in signals],
            'type': kinds, 'canChange': [True] * len(signals), 'minval': least, 'maxval': most,
            'values': [value for step in zip(*columns, strict=True) for value in step]},
        'saveToReqID': '*', 'saveToComponent': '*',
        'saveToProject': suite.specification.name}


def _fret_value(value: Value) -> int | float:
    return int(value) if isinstance(value, bool) else value


def _linked(id: str) -> str:
    """Return the name of a requirement in links, as FRET's simulator writes it."""
    return ''.join('_' if char in ' -.+' else char for char in id)
