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
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
import json
import os
from pathlib import Path
import sys
from typing import TYPE_CHECKING

from fret_monitor.bag.required import require_rosbags
from fret_monitor.cli.columns import columns
from fret_monitor.cli.constants import add_constants
from fret_monitor.cli.terminal import print_diagnostics, progress
from fret_monitor.model.bundle_files import BUNDLE_HELP, existing_bundle
from fret_monitor.model.diagnostics import (
    CompileError, counted, Problems, refuse, require_packages, Text,
)
from fret_monitor.model.output import open_output, refuse_existing, refuse_overwriting
from fret_monitor.model.policies import Stamp
from fret_monitor.native.errors import NativeError

if TYPE_CHECKING:
    from fret_monitor.bag.check import RecordingResult, Selection
    from fret_monitor.bag.fleet import Outcome
    from fret_monitor.bag.results_file import ResultsFile
    from fret_monitor.runtime.probability import Figures

_OUTPUTS = ('junit', 'csv', 'mcap', 'report', 'results')
_PAGES = ('.html', '.htm')
_RANKED = {'closest': 'Closest to a violation', 'slack': 'Least slack'}
_MOMENT = 'seconds since the start, seconds since 1970, or such as end-3'


def add_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument('bundle', metavar='BUNDLE', help=BUNDLE_HELP)
    parser.add_argument('bags', metavar='BAG', nargs='+', type=Path,
                        help='a folder of rosbag2, or a file .mcap, .db3, .bag, or .csv as for '
                        'simulate')
    add_constants(parser)
    add_reading(parser)
    gaps = parser.add_argument_group('what is missing')
    gaps.add_argument('--partial', action='store_true',
                      help='judge what can be read; exit with 0 though messages are missing')
    _add_output(parser)
    parser.set_defaults(run=run)


def add_reading(parser: ArgumentParser) -> None:
    """Add the options that say how recordings are read, as `selection_of` takes them."""
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
    time.add_argument('--missing-topics', choices=['error', 'ok'], default='error',
                      help='whether a topic that was not recorded is an error (default)')
    parser.add_argument('--jobs', metavar='N', type=_jobs, default=1,
                        help='processes; 0: one a processor')


def _add_output(parser: ArgumentParser) -> None:
    output = parser.add_argument_group('output')
    output.add_argument('--fail-on-violation', action='store_true',
                        help='exit with 1 if any requirement was violated')
    output.add_argument('--margins', action='store_true',
                        help='also find out how close each requirement came to the other '
                        'verdict, when, and by which comparison, and how much time was left '
                        'until deadlines')
    output.add_argument('--triggers', action='store_true',
                        help='also find out whether the trigger of each requirement came, for '
                        '`check --trace`')
    output.add_argument('--json', action='store_true', help='print a line of JSON a recording')
    output.add_argument('--junit', metavar='FILE.xml', type=Path, help='write a report for CI')
    output.add_argument('--csv', metavar='FILE.csv', type=Path,
                        help='write the changes of verdicts, of one recording')
    output.add_argument('--mcap', metavar='FILE.mcap', type=Path,
                        help='write violations and verdicts as a recording, of one recording')
    output.add_argument('--report', metavar='FILE.html', type=Path,
                        help='write a page that shows what happened; of several recordings: a '
                        'folder for an index and a page each')
    output.add_argument('--fill', metavar=('TABLE', 'NEW'), nargs=2, type=Path,
                        help='write the table (CSV, XLSX) or ReqIF from which requirements were '
                        'imported as a new file, with their verdicts')
    output.add_argument('--columns', metavar='ROLE=HEAD', type=columns, default={},
                        help='the columns of TABLE, as for `import`')
    output.add_argument('--force', action='store_true', help='overwrite NEW of --fill')
    output.add_argument('--dask', metavar='ADDRESS',
                        help='check recordings on a Dask cluster; local: --jobs workers here')
    output.add_argument('--results', metavar='FILE.jsonl', type=Path,
                        help='append a line of JSON a recording; those in it already are skipped')


def run(options: Namespace) -> int:
    """Check recordings; return 1 if something could not be seen, or at a wanted violation."""
    from fret_monitor.bag.results_file import failed_line, problem_texts, recording_key
    lines: dict[str, str] = {}
    try:
        return _run(options, lines)
    except (CompileError, NativeError) as error:
        for path in options.bags:
            if options.json and recording_key(path) not in lines:
                print(failed_line(path, problem_texts(error)), flush=True)
        raise


def _run(options: Namespace, lines: dict[str, str]) -> int:
    if options.jobs > 1 and len(options.bags) > 1 and options.dask is None:
        from fret_monitor.bag.workers import workers
        workers()  # they start while this process imports the same
    require_rosbags('`bag`')
    from fret_monitor.bag.recording import files_of
    bundle = existing_bundle(options.bundle)
    if any(getattr(options, name) is not None for name in _OUTPUTS):
        _check_outputs(options, [*_files_of_bundle(bundle),
                                 *(file for path in options.bags for file in files_of(path))])
    is_page = options.report is not None and options.report.suffix in _PAGES
    if options.fill is not None:
        table, new = options.fill
        refuse_overwriting(new, [table, *_files_of_bundle(bundle)])
        refuse_existing(new, force=options.force)
        if new.suffix.lower() != table.suffix.lower():
            refuse(f"'{new}' is not written as '{table}' is", help='give it the same ending')
        from fret_monitor.importing.filled import check_fillable
        check_fillable(table)
    for name, path in (('--csv', options.csv), ('--mcap', options.mcap),
                       (f'--report {options.report}', options.report if is_page else None)):
        if path is not None and len(options.bags) != 1:
            refuse(f'{name} is of one recording, here are {len(options.bags)}',
                   help='call the command once for each' if path is not options.report else
                   'name a folder, for an index and a page each')
    selection = replace(selection_of(options, options.constants, options.partial),
                        margins=options.margins, triggers=options.triggers)
    return _check(options, bundle, selection, lines)


def _files_of_bundle(bundle: Path) -> list[Path]:
    from fret_monitor.bundle.reader import survey_bundle
    survey = survey_bundle(bundle, Problems())
    return [bundle, *(Path(source.name) for source in survey.sources[1:])] if survey else [bundle]


def _check_outputs(options: Namespace, read: Sequence[Path]) -> None:
    """Refuse to write over a file that is read, or two results to one file."""
    options_of: dict[str, str] = {}
    for name in _OUTPUTS:
        path = getattr(options, name)
        if path is None:
            continue
        refuse_overwriting(path, read)
        if path.exists() and not path.is_file():
            continue
        other = options_of.setdefault(os.path.realpath(path), f'--{name}')
        if other != f'--{name}':
            refuse(f"{other} and --{name} both write '{path}'", help='name two files')


def selection_of(options: Namespace, constants: Sequence[tuple[str, Text]],
                 is_partial: bool = False) -> 'Selection':
    """Return how recordings are read, from the options of `add_reading`."""
    from fret_monitor.bag.check import Selection
    return Selection(
        options.namespace, dict(options.remap), options.begin, options.end, options.until,
        is_partial, options.missing_topics == 'ok',
        None if options.stamp is None else Stamp(options.stamp), dict(constants))


def _check(options: Namespace, bundle: Path, selection: 'Selection', lines: dict[str, str]) -> int:
    """Check recordings, and add the line of each to `lines`."""
    from fret_monitor.bag.results_file import recording_key, ResultsFile
    status, errors = 0, set[str]()
    folder = _report_folder(options)
    results = None if options.results is None else ResultsFile(options.results)
    texts: Mapping[str, str] = {}
    found_so_far = _counted(
        _outcomes(options, bundle, selection, folder, results), len(options.bags))
    for outcome in _in_order(found_so_far, options.bags):
        lines[recording_key(outcome.path)] = outcome.line
        if outcome.result is not None:
            texts = {item.id: item.text for item in outcome.result.manifest.numbered}
        _print(outcome, selection, errors, is_json=options.json)
        content = json.loads(outcome.line)
        is_violated = any(item['verdict'] is False for item in content['requirements'].values())
        if outcome.error or (content['errors'] and not selection.is_partial) \
                or (is_violated and options.fail_on_violation):
            status = 1
    found = [lines[key] for key in map(recording_key, options.bags) if key in lines]
    from fret_monitor.bag.pooled import pooled, pooled_rows, required_of
    figures = pooled(found)
    if figures:
        _print_pooled(found, figures, is_json=options.json)
    if options.fail_on_violation and any(
            item.verdict == 'refuted' for item in figures.values()):
        status = 1
    from fret_monitor.bag.closest import closest_json, closest_table, rankings
    ranked = rankings(found) if options.margins and len(found) > 1 else []
    if ranked:
        print((closest_json if options.json else closest_table)(ranked, len(found)), flush=True)
    if options.junit is not None or options.fill is not None:
        texts = texts or _texts_of(bundle, selection, found)
    if options.junit is not None:
        _write_junit(options, bundle, selection, found, texts, figures)
    if options.fill is not None:
        _fill(options, bundle, found, texts)
    if folder is not None:
        from fret_monitor.bag.index import index_page
        with open_output(folder / 'index.html') as file:
            file.write(index_page(
                f'{bundle.stem}: {len(found)} recordings', found, folder, {
                    **({'Probabilities over all recordings': pooled_rows(
                        figures, required_of(found))} if figures else {}),
                    **{_RANKED[item.key]: item.rows for item in ranked}}))
    if results is not None and results.error:
        refuse(results.error, help='the recordings printed since then will be checked again')
    return status


def _print_pooled(lines: Sequence[str], found: 'Mapping[str, Figures]', *,
                  is_json: bool) -> None:
    """Print the probabilities over all recordings."""
    from fret_monitor.bag.pooled import pooled_json, pooled_table, required_of
    print(pooled_json(found, len(lines)) if is_json else
          pooled_table(found, required_of(lines), len(lines)), flush=True)


def _texts_of(bundle: Path, selection: 'Selection', found: Sequence[str]) -> Mapping[str, str]:
    """Return the texts of requirements by id, where all recordings were checked before."""
    from fret_monitor.bag.check import requirement_texts
    judged = [item['bag'] for item in map(json.loads, found) if item['requirements']]
    return requirement_texts(bundle, Path(judged[0]), selection) if judged else {}


def _fill(options: Namespace, bundle: Path, found: Sequence[str],
          texts: Mapping[str, str]) -> None:
    """Write the table of the requirements with their verdicts in the recordings."""
    from fret_monitor.bag.results import HEADS, verdicts_of
    from fret_monitor.importing.filled import filled
    table, new = options.fill
    verdicts = verdicts_of(found)
    if not verdicts:
        refuse(f"'{new}' is not written: no recording was judged")
    problems = Problems()
    data = filled(table, HEADS, verdicts, texts, options.columns, problems)
    print_diagnostics(problems.warnings)
    with open_output(new, [table, bundle]) as file:
        file.buffer.write(data)


def _write_junit(options: Namespace, bundle: Path, selection: 'Selection', found: Sequence[str],
                 texts: Mapping[str, str], figures: 'Mapping[str, Figures]') -> None:
    from fret_monitor.bag.results import junit
    with open_output(options.junit) as file:
        file.write(junit(found, texts, bundle.stem, is_partial=selection.is_partial,
                         pooled=figures))


def _print(outcome: 'Outcome', selection: 'Selection', errors: set[str], *,
           is_json: bool) -> None:
    """Print an outcome; one of the `errors` that were printed before is not printed again."""
    from fret_monitor.bag.results import table
    if outcome.error in errors:
        print(f'error: {outcome.path}: the same as before', file=sys.stderr)
    elif outcome.error:
        errors.add(outcome.error)
        print(outcome.error, file=sys.stderr)
    if outcome.result is not None:
        kind = 'warning' if selection.is_partial else 'error'
        for error in outcome.result.errors:
            print(f'{kind}: {outcome.path}: {error}', file=sys.stderr)
        for warning in outcome.result.warnings:
            print(f'warning: {outcome.path}: {warning}', file=sys.stderr)
    if is_json:
        print(outcome.line, flush=True)
    elif outcome.result is not None:
        print(table(outcome.result), flush=True)
    elif not outcome.error:
        found = json.loads(outcome.line)['requirements'].items()
        violated = [name for name, item in found if item['verdict'] is False]
        print(f'{outcome.path}: checked before, '
              + (f'violated: {", ".join(violated)}' if violated else 'no violation'), flush=True)


def _counted(outcomes: Iterator['Outcome'], total: int) -> Iterator['Outcome']:
    """Yield outcomes, and show how many there are so far."""
    if total == 1:
        yield from outcomes
        return
    with progress('bag', is_printing=True) as report:
        for number, outcome in enumerate(outcomes, 1):
            yield outcome
            report(number / total, str(outcome.path))


def _in_order(outcomes: Iterable['Outcome'], paths: Iterable[Path]) -> Iterator['Outcome']:
    """Yield outcomes in the order of the paths; one that comes early is kept until its turn."""
    from fret_monitor.bag.results_file import recording_key
    early: dict[str, list[Outcome]] = {}
    left = deque(map(recording_key, paths))
    for outcome in outcomes:
        early.setdefault(recording_key(outcome.path), []).append(outcome)
        while left and early.get(left[0]):
            yield early[left.popleft()].pop(0)


def _report_folder(options: Namespace) -> Path | None:
    """Return the folder for reports, which is made; None if there is to be one page, or none."""
    folder: Path | None = options.report
    if folder is None or folder.suffix in _PAGES:
        return None
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        refuse(f"cannot make the folder '{folder}': {error.strerror or error}")
    _refuse_other_index(folder / 'index.html')
    return folder


def _refuse_other_index(path: Path) -> None:
    from fret_monitor.bag.page import GENERATOR
    if path.is_file() and GENERATOR not in path.read_text(encoding='utf-8', errors='replace'):
        refuse(f"'{path}' is not an index that this command wrote",
               help='move it away, or name a new folder')


def _outcomes(options: Namespace, bundle: Path, selection: 'Selection', folder: Path | None,
              results: 'ResultsFile | None') -> Iterator['Outcome']:
    from fret_monitor.bag.fleet import Outcome, page_name, reusable, settings_of
    from fret_monitor.bag.results_file import finished_lines
    if results is None:
        yield from _checked(options, bundle, options.bags, selection, folder, '')
        return
    settings = settings_of(bundle, selection)
    known = {} if _has_files(options, folder) else finished_lines(options.results)
    left = []
    for path in options.bags:
        page = None if folder is None else folder / page_name(path)
        line = reusable(known, path, settings, page)
        if line is None:
            left.append(path)
        else:
            yield Outcome(path, line, None)
    for outcome in _checked(options, bundle, left, selection, folder, settings):
        results.add(outcome.line)
        yield outcome


def _has_files(options: Namespace, folder: Path | None) -> bool:
    """Return whether files are to be written that only a check of the recording can give."""
    return options.csv is not None or options.mcap is not None or (
        options.report is not None and folder is None)


def _checked(options: Namespace, bundle: Path, paths: Sequence[Path], selection: 'Selection',
             folder: Path | None, settings: str) -> Iterator['Outcome']:
    """Check recordings, in the way that the options say."""
    from fret_monitor.bag.fleet import (
        check_all, check_on_cluster, check_one, outcome_of, page_name,
    )
    if _has_files(options, folder) and paths:
        page = None if folder is None else folder / page_name(paths[0])
        yield outcome_of(
            paths[0], lambda: _with_changes(options, bundle, selection, page or options.report),
            settings, page)
    elif options.dask is not None:
        require_packages('--dask', {'distributed': 'distributed'})
        yield from check_on_cluster(bundle, paths, selection, address=options.dask,
                                    jobs=options.jobs, settings=settings, reports=folder)
    elif len(paths) == 1:
        with progress('bag') as report:
            outcome = check_one(bundle, paths[0], selection, settings=settings, reports=folder,
                                progress=report)
        yield outcome
    else:
        yield from check_all(bundle, paths, selection, jobs=options.jobs, settings=settings,
                             reports=folder)


def _with_changes(options: Namespace, bundle: Path, selection: 'Selection',
                  page: Path | None) -> 'RecordingResult':
    """Check a recording, and write what happens in it to `page` and as the options say."""
    from fret_monitor.bag.check import Changes, check_recording
    from fret_monitor.bag.fleet import asked
    from fret_monitor.bag.report import check_and_report
    from fret_monitor.bag.results import ChangesCsv
    from fret_monitor.bag.violations import open_violations
    changes: list[Changes] = []
    mcap = None
    with ExitStack() as stack:
        if options.csv is not None:
            changes.append(ChangesCsv(stack.enter_context(open_output(options.csv))))
        if options.mcap is not None:
            mcap = stack.enter_context(open_violations(options.mcap, options.namespace))
            changes.append(mcap)
        path = options.bags[0]
        report = stack.enter_context(progress('bag'))
        if page is None:
            result = check_recording(
                bundle, path, selection, changes=changes, progress=report, asides=asked)
        else:
            result = check_and_report(
                bundle, path, selection, page, changes=changes, progress=report, asides=asked)
        if mcap is None or not mcap.without_details:
            return result
        return replace(result, warnings=(*result.warnings, (
            f'{counted(mcap.without_details, "change")} of verdicts are not in copilot/violations '
            f'of {options.mcap}: too many at one time')))


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
