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

"""`analyze BUNDLE`: whether the requirements are consistent, realizable, vacuous, redundant."""

from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
import re
import signal
from threading import current_thread, main_thread
from types import FrameType
from typing import TYPE_CHECKING

from fret_monitor.build import read, read_one_instance, Reading, without_probabilities
from fret_monitor.cli.constants import add_constants
from fret_monitor.cli.document import add_json_option, print_document
from fret_monitor.cli.limits import seconds
from fret_monitor.cli.terminal import print_diagnostics, progress
from fret_monitor.logic.scopes import one_instance
from fret_monitor.model.bundle_files import BUNDLE_HELP, existing_bundle
from fret_monitor.model.diagnostics import Diagnostic, Level, refuse, require_packages
from fret_monitor.model.folders import refusing
from fret_monitor.model.output import open_output, refuse_overwriting
from fret_monitor.model.policies import InputRole

if TYPE_CHECKING:
    from fret_monitor.analysis.answers import Analysis, Question
    from fret_monitor.analysis.replay import Replay
    from fret_monitor.traces.deadline import Deadline

_QUICK_S = 2.0
NEEDED = {'dd': 'dd', 'z3': 'z3-solver'}
_QUESTIONS = ('consistency', 'rt-consistency', 'vacuity', 'redundancy', 'realizability',
              'reachability')
_RUN = re.compile(rf'({"|".join(_QUESTIONS)})(_\d+)?\.csv')


def add_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument('bundle', metavar='BUNDLE', help=BUNDLE_HELP)
    add_constants(parser)
    parser.add_argument('--only', metavar='WHAT', action='append', choices=_QUESTIONS,
                        help=f'one question, may be repeated: {", ".join(_QUESTIONS)}')
    parser.add_argument('-o', '--output', metavar='DIR', type=Path,
                        help='write the runs that show a no to this folder, for `simulate`')
    add_json_option(parser)
    parser.add_argument('--timeout', metavar='SECONDS', type=seconds, default=300.0,
                        help='time limit; answers that it cuts off are unknown; default 300')
    parser.set_defaults(run=run)


def run(options: Namespace) -> int:
    """Analyse a bundle; return 1 unless all is consistent, realizable, and needed."""
    require_packages('`analyze`', NEEDED)
    # Imported here: loading the solver is slow, and the other verbs do not need it.
    from fret_monitor.analysis.replay import CompiledReplay
    from fret_monitor.analysis.report import as_dict, shown
    from fret_monitor.traces.deadline import Deadline
    # A run that is written has no column for a key.
    read_it = read_one_instance if options.output is None else read
    reading, left_out = without_probabilities(
        read_it(existing_bundle(options.bundle), constants=dict(options.constants)), 'analyze')
    asked, more = _asked(reading, options.only)
    warnings = (*left_out, *more)
    if not options.json:
        print_diagnostics(warnings)
    if options.output is not None:
        _make_folder(options.output, reading)
    replay = CompiledReplay(reading)
    deadline = Deadline(options.timeout)
    with _interruptible(deadline):
        found = _analysis(reading, replay, asked, deadline)
        if options.output is not None:
            _write_runs(options.output, found, reading)
        if options.json:
            print_document(as_dict(found), warnings)
        else:
            print('\n'.join(shown(found, reading.specification, replay)))
    return 0 if _is_fine(found) else 1


def quick_warnings(reading: Reading) -> list[Diagnostic]:
    """Return warnings about what is found in two seconds, for `check --analyze`."""
    require_packages('`analyze`', NEEDED)
    from fret_monitor.analysis.replay import CompiledReplay
    from fret_monitor.analysis.report import warnings
    from fret_monitor.traces.deadline import Deadline
    reading = replace(reading, specification=one_instance(reading.specification))
    if all(item.probability for item in reading.specification.properties):
        return []
    reading, _ = without_probabilities(reading, 'analyze')
    asked, _ = _asked(reading, None)
    found = _analysis(reading, CompiledReplay(reading), asked, Deadline(_QUICK_S))
    return list(warnings(found, reading.specification))


def _asked(reading: Reading, only: list[str] | None
           ) -> tuple[list['Question'], tuple[Diagnostic, ...]]:
    """Return the questions; realizability needs outputs, reachability a state diagram."""
    from fret_monitor.analysis.answers import Question
    from fret_monitor.analysis.reachability import asked_diagram
    from fret_monitor.analysis.report import assumption_warnings
    asked = [item for item in Question if only is None or item.value in only]
    if Question.REACHABILITY in asked and not any(
            asked_diagram(item) for item in reading.specification.properties):
        if only is not None:
            refuse('no requirement is that a state follows a diagram, so that reachability has '
                   'no answer', help='`fret-monitor import` makes one of a Mermaid or DOT file')
        asked.remove(Question.REACHABILITY)
    has_outputs = any(item.role is InputRole.OUTPUT for item in reading.specification.signals)
    if Question.REALIZABILITY not in asked:
        return asked, ()
    if has_outputs:
        return asked, tuple(assumption_warnings(reading.specification))
    title = 'no input is an output of the system, so that realizability has no answer'
    advice = 'write role: output at each input that the system sets'
    if only is not None:
        refuse(title, help=advice)
    return [item for item in asked if item is not Question.REALIZABILITY], (
        Diagnostic(title, None, '', advice, Level.WARNING),)


def _analysis(reading: Reading, replay: 'Replay', asked: list['Question'],
              deadline: 'Deadline') -> 'Analysis':
    from fret_monitor.analysis.checks import analyze
    from fret_monitor.explain.report import meanings
    denials = {name: found.denial for name, found in meanings(reading).items()
               if found.denial is not None}
    with progress('analyze') as report:
        return analyze(reading.specification, replay, asked, denials=denials, deadline=deadline,
                       progress=report)


@contextmanager
def _interruptible(deadline: 'Deadline') -> Iterator[None]:
    """End the analysis at the first SIGINT, with what is known; a second one ends the process."""
    if current_thread() is not main_thread():
        yield
        return

    def interrupt(number: int, frame: FrameType | None) -> None:
        deadline.is_interrupted = True
        signal.signal(signal.SIGINT, before)

    before = signal.signal(signal.SIGINT, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _make_folder(folder: Path, reading: Reading) -> None:
    with refusing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for path in _former_runs(folder):
            refuse_overwriting(path, reading.paths)


def _former_runs(folder: Path) -> list[Path]:
    return [path for path in folder.iterdir() if _RUN.fullmatch(path.name)]


def _write_runs(folder: Path, found: 'Analysis', reading: Reading) -> None:
    from fret_monitor.analysis.report import examples, to_csv
    for path in _former_runs(folder):
        path.unlink()
    for name, _, example in examples(found):
        with open_output(folder / f'{name}.csv', reading.paths) as file:
            file.write(to_csv(example, reading.specification))


def _is_fine(found: 'Analysis') -> bool:
    return all(item.holds is (not item.question.is_list) for item in found.answers)
