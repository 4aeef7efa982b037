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

"""`bag BUNDLE BAG...`: the compiled monitors over recordings."""

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from importlib.util import find_spec
import os
from pathlib import Path
import sys
from typing import TextIO, TYPE_CHECKING

from fret_monitor.cli.constants import add_constants
from fret_monitor.cli.terminal import progress
from fret_monitor.model.bundle_files import BUNDLE_HELP, existing_bundle
from fret_monitor.model.diagnostics import pip_install, refuse
from fret_monitor.model.output import open_output, refuse_overwriting
from fret_monitor.model.policies import Stamp

if TYPE_CHECKING:
    from fret_monitor.bag.check import Selection
    from fret_monitor.bag.fleet import Outcome

_PAGES = ('.html', '.htm')
_MOMENT = 'seconds since the start, seconds since 1970, or such as end-3'


def add_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument('bundle', metavar='BUNDLE', help=BUNDLE_HELP)
    parser.add_argument('bags', metavar='BAG', nargs='+', type=Path,
                        help='a folder of rosbag2, or a file .mcap, .db3 or .bag')
    add_constants(parser)
    names = parser.add_argument_group('names')
    names.add_argument('--namespace', metavar='NS', default='/',
                       help='where relative topics of the bundle were recorded; default /')
    names.add_argument('--remap', metavar='OLD:=NEW', action='append', type=_remap, default=[],
                       help='a topic of the bundle, and its name in the recording')
    time = parser.add_argument_group('time')
    time.add_argument('--from', metavar='T', dest='begin', type=_moment,
                      help=f'judge from here on: {_MOMENT}; values before still count')
    time.add_argument('--to', metavar='T', dest='end', type=_moment, help='judge up to here')
    time.add_argument('--until', metavar='T', type=_moment,
                      help='let the time go on after the last message, such as end+10')
    time.add_argument('--stamp', choices=[item.value for item in Stamp],
                      help='under policy: timed, override which time of a message counts')
    gaps = parser.add_argument_group('what is missing')
    gaps.add_argument('--partial', action='store_true',
                      help='judge what can be read; exit with 0 though messages are missing')
    gaps.add_argument('--missing-topics', choices=['error', 'ok'], default='error',
                      help='whether a topic that was not recorded is an error (default)')
    output = parser.add_argument_group('output')
    output.add_argument('--fail-on-violation', action='store_true',
                        help='exit with 1 if any requirement was violated')
    output.add_argument('--json', action='store_true', help='print a line of JSON a recording')
    output.add_argument('--junit', metavar='FILE.xml', type=Path, help='write a report for CI')
    output.add_argument('--csv', metavar='FILE.csv', type=Path,
                        help='write the changes of verdicts, of one recording')
    output.add_argument('--mcap', metavar='FILE.mcap', type=Path,
                        help='write violations and verdicts as a recording, of one recording')
    output.add_argument('--report', metavar='FILE.html', type=Path,
                        help='write a page that shows what happened; of several recordings: a '
                        'folder for an index and a page each')
    output.add_argument('--jobs', metavar='N', type=_jobs, default=1,
                        help='processes; 0: one a processor')
    output.add_argument('--dask', metavar='ADDRESS',
                        help='check recordings on a cluster, or `local`: --jobs workers here')
    output.add_argument('--results', metavar='FILE.jsonl', type=Path,
                        help='append a line of JSON a recording; those in it already are skipped')
    parser.set_defaults(run=run)


def run(options: Namespace) -> int:
    """Check recordings; return 1 if something could not be seen, or at a wanted violation."""
    if find_spec('rosbags') is None:
        refuse('`bag` needs the extra `bag`', help=pip_install('rosbags'))
    from fret_monitor.bag.recording import files_of
    bundle = existing_bundle(options.bundle)
    read = [bundle, *(file for path in options.bags for file in files_of(path))]
    for path in (options.junit, options.csv, options.mcap, options.report, options.results):
        if path is not None:
            refuse_overwriting(path, read)
    is_page = options.report is not None and options.report.suffix in _PAGES
    for name, path in (('--csv', options.csv), ('--mcap', options.mcap),
                       (f'--report {options.report}', options.report if is_page else None)):
        if path is not None and len(options.bags) != 1:
            refuse(f'{name} is of one recording, here are {len(options.bags)}',
                   help='call the command once for each' if path is not options.report else
                   'name a folder, for an index and a page each')
    return _check(options, bundle, _selection(options))


def _selection(options: Namespace) -> 'Selection':
    from fret_monitor.bag.check import Selection
    return Selection(
        options.namespace, dict(options.remap), options.begin, options.end, options.until,
        options.partial, options.missing_topics == 'ok',
        None if options.stamp is None else Stamp(options.stamp), dict(options.constants))


def _check(options: Namespace, bundle: Path, selection: 'Selection') -> int:
    from fret_monitor.bag.results import junit, table
    failed: list[tuple[str, str]] = []
    results = []
    lines: dict[str, str] = {}
    status = 0
    folder = _report_folder(options)
    for outcome in _counted(_outcomes(options, bundle, selection, folder), len(options.bags)):
        lines[_key(outcome.path)] = outcome.line
        if outcome.result is None:
            failed.append((str(outcome.path), outcome.error))
            print(outcome.error, file=sys.stderr)
        else:
            results.append(outcome.result)
            for error in outcome.result.errors:
                kind = 'warning' if selection.is_partial else 'error'
                print(f'{kind}: {outcome.path}: {error}', file=sys.stderr)
            if outcome.result.errors and not selection.is_partial:
                status = 1
            if options.fail_on_violation and outcome.result.is_violated:
                status = 1
        if options.json:
            print(outcome.line, flush=True)
        elif outcome.result is not None:
            print(table(outcome.result), flush=True)
    if options.junit is not None:
        with open_output(options.junit) as file:
            file.write(junit(results, failed, str(bundle)))
    if folder is not None:
        _write_index(options, bundle, lines, folder)
    return 1 if failed else status


def _counted(outcomes: Iterator['Outcome'], total: int) -> Iterator['Outcome']:
    """Yield outcomes, and show how many there are so far."""
    if total == 1:
        yield from outcomes
        return
    with progress('bag', is_printing=True) as report:
        for number, outcome in enumerate(outcomes, 1):
            yield outcome
            report(number / total, str(outcome.path))


def _report_folder(options: Namespace) -> Path | None:
    """Return the folder for reports, which is made; None if there is to be one page, or none."""
    folder: Path | None = options.report
    if folder is None or folder.suffix in _PAGES:
        return None
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        refuse(f"cannot make the folder '{folder}': {error.strerror or error}")
    return folder


def _write_index(options: Namespace, bundle: Path, lines: dict[str, str], folder: Path) -> None:
    from fret_monitor.bag.fleet import finished_lines
    from fret_monitor.bag.index import index_page
    if options.results is not None:
        known = finished_lines(options.results)
        lines = {**{_key(path): line for path, line in known.items()}, **lines}
    found = [lines[key] for key in map(_key, options.bags) if key in lines]
    with open_output(folder / 'index.html') as file:
        file.write(index_page(f'{bundle.stem}: {len(found)} recordings', found, folder))


def _key(path: Path | str) -> str:
    return str(Path(path).absolute())


def _outcomes(options: Namespace, bundle: Path, selection: 'Selection',
              folder: Path | None) -> Iterator['Outcome']:
    from fret_monitor.bag.fleet import check_one, finished
    if options.csv is not None or options.mcap is not None or (
            options.report is not None and folder is None):
        yield _with_changes(options, bundle, selection, folder)
        return
    paths: Sequence[Path] = options.bags
    if options.results is None:
        if len(paths) == 1 and options.dask is None:
            with progress('bag') as report:
                outcome = check_one(
                    bundle, paths[0], selection, reports=folder, progress=report)
            yield outcome
        else:
            yield from _check_all(options, bundle, paths, selection, folder)
        return
    known = finished(options.results)
    with options.results.open('a', encoding='utf-8') as file:
        _end_line(options.results, file)
        left = [path for path in paths if str(path) not in known]
        for outcome in _check_all(options, bundle, left, selection, folder, with_hash=True):
            file.write(outcome.line + '\n')
            file.flush()
            yield outcome


def _check_all(options: Namespace, bundle: Path, paths: Sequence[Path], selection: 'Selection',
               folder: Path | None, *, with_hash: bool = False) -> Iterator['Outcome']:
    from fret_monitor.bag.fleet import check_all, check_on_cluster
    if options.dask is None:
        return check_all(bundle, paths, selection, jobs=options.jobs, with_hash=with_hash,
                         reports=folder)
    if find_spec('distributed') is None:
        refuse('--dask needs the extra `dask`', help=pip_install('distributed'))
    return check_on_cluster(bundle, paths, selection, address=options.dask, jobs=options.jobs,
                            with_hash=with_hash, reports=folder)


def _end_line(path: Path, file: TextIO) -> None:
    """End the last line, which a run that was stopped may have left unfinished."""
    content = path.read_bytes()
    if content and not content.endswith(b'\n'):
        file.write('\n')


def _with_changes(options: Namespace, bundle: Path, selection: 'Selection',
                  folder: Path | None) -> 'Outcome':
    from fret_monitor.bag.check import Changes, check_recording
    from fret_monitor.bag.fleet import Outcome, page_name
    from fret_monitor.bag.report import check_and_report
    from fret_monitor.bag.results import ChangesCsv, json_line
    from fret_monitor.bag.violations import open_violations
    changes: list[Changes] = []
    with ExitStack() as stack:
        if options.csv is not None:
            changes.append(ChangesCsv(stack.enter_context(open_output(options.csv))))
        if options.mcap is not None:
            changes.append(stack.enter_context(
                open_violations(options.mcap, options.namespace)))
        path = options.bags[0]
        page = options.report if folder is None else folder / page_name(path)
        with progress('bag') as report:
            if page is None:
                result = check_recording(
                    bundle, path, selection, changes=changes, progress=report)
            else:
                result = check_and_report(
                    bundle, path, selection, page, changes=changes, progress=report)
    return Outcome(path, json_line(result), result)


def _remap(text: str) -> tuple[str, str]:
    old, sign, new = text.partition(':=')
    if not (old and sign and new):
        raise ArgumentTypeError(f"'{text}' is not OLD:=NEW")
    return old, new


def _moment(text: str) -> object:
    from fret_monitor.bag.moments import Moment
    try:
        return Moment.parse(text)
    except ValueError as error:
        raise ArgumentTypeError(f"'{text}' is no moment: {error}") from None


def _jobs(text: str) -> int:
    if not text.isdecimal() or int(text) > 4096:
        raise ArgumentTypeError(f"'{text}' is not a number of processes")
    return int(text) or len(os.sched_getaffinity(0))
