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
Checks many recordings, in several processes; a run that stopped goes on where it was.

A recording that cannot be checked is one line of the results; it never ends the run.
"""

from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import as_completed, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace
from functools import partial
import hashlib
from importlib import import_module
import json
from pathlib import Path
import re
from typing import Any, TYPE_CHECKING

from fret_monitor import __version__
from fret_monitor.bag.check import (
    Aside, check_recording, OCCURRENCES, RecordingResult, Selection,
)
from fret_monitor.bag.cluster import cluster_client
from fret_monitor.bag.recording import files_of
from fret_monitor.bag.results import json_line
from fret_monitor.bag.results_file import failed_line, problem_texts, recording_key
from fret_monitor.bag.slack import slack_asides
from fret_monitor.bag.triggers import trigger_asides
from fret_monitor.bag.workers import workers
from fret_monitor.messages.installed import find_message, fingerprint
from fret_monitor.model.diagnostics import CompileError, Problems
from fret_monitor.model.progress import no_progress, Progress
from fret_monitor.native.errors import NativeError
from fret_monitor.start import manifest_of

if TYPE_CHECKING:
    from fret_monitor.elaboration.signals import FindMessage

_Check = Callable[..., 'Outcome']
_BLOCK = 1 << 20
_UNSAFE = re.compile('[^A-Za-z0-9._-]+')


@dataclass(frozen=True)
class Outcome:
    """What became of one recording: its line of JSON, and a result or an error."""

    path: Path
    line: str
    result: RecordingResult | None
    error: str = ''


def check_one(bundle: Path, path: Path, selection: Selection, *, settings: str = '',
              reports: Path | None = None, progress: Progress = no_progress) -> Outcome:
    """
    Check a recording; what is wrong with it becomes part of the outcome.

    With `reports`, a folder, its report is written there (`page_name`). With `settings`, the line
    contains them and the SHA-256 of the recording, which is null if the recording changed
    meanwhile, and that of the report.
    """
    check: Callable[[], RecordingResult]
    page = None
    if reports is None:
        check = partial(check_recording, bundle, path, selection, progress=progress, asides=asked)
    else:
        from fret_monitor.bag.report import check_and_report
        page = reports / page_name(path)
        check = partial(check_and_report, bundle, path, selection, page, progress=progress,
                        asides=asked)
    return outcome_of(path, check, settings, page)


def asked(bundle: Path, selection: Selection, find: 'FindMessage') -> Iterator[Aside]:
    """Yield what finds out the slack, and whether triggers came, if a selection asks."""
    if selection.margins:
        yield from slack_asides(bundle, selection, find)
    if selection.triggers:
        yield from trigger_asides(bundle, selection, find)


def outcome_of(path: Path, check: Callable[[], RecordingResult], settings: str = '',
               page: Path | None = None) -> Outcome:
    """Call a function that checks a recording and writes its page; see `check_one`."""
    before = digest(path) if settings else None
    result = None
    error = ''
    try:
        result = check()
        line = json_line(result)
    except (CompileError, NativeError, OSError) as problem:
        error = str(problem) if isinstance(problem, CompileError) else f'error: {path}: {problem}'
        line = failed_line(path, problem_texts(problem))
    except Exception as problem:  # noqa: B902  # a recording must not end the run of the others
        return _failed(path, f'{type(problem).__name__}: {problem}')
    if settings:
        notes = {'sha256': before if digest(path) == before else None, 'settings': settings}
        if page is not None:
            notes['report'] = next(iter(_page_digests(page)), None)
        line = json.dumps({**json.loads(line), **notes}, ensure_ascii=False)
    return Outcome(path, line, result, error)


def _failed(path: Path, error: str) -> Outcome:
    return Outcome(path, failed_line(path, [error]), None, f'error: {path}: {error}')


def settings_of(bundle: Path, selection: Selection) -> str:
    """Return a hash of what, beside a recording, decides about its results."""
    try:
        read = [manifest_of(bundle, constants=selection.constants, margins=selection.margins,
                            variant=OCCURRENCES).bundle_hash]
    except CompileError:  # perhaps its messages are only in the recordings
        read = _written(bundle)
    constants = sorted((name, text.value) for name, text in selection.constants.items())
    parts = [__version__, *read, repr(constants), repr(replace(selection, constants={}))]
    return hashlib.sha256('\0'.join(parts).encode('utf-8', 'surrogatepass')).hexdigest()


def _written(bundle: Path) -> list[str]:
    """Return the texts of a bundle's files, and its message types as far as they are installed."""
    from fret_monitor.bundle.reader import survey_bundle
    survey = survey_bundle(bundle, Problems())
    if survey is None:
        return []  # no recording can be checked
    types = sorted({item.type.value for item in survey.inputs if item.type is not None})
    return [*(source.text for source in survey.sources),
            *(f'{name} {_installed(name)}' for name in types)]


def _installed(message_type: str) -> str:
    try:
        return fingerprint(find_message(message_type))
    except CompileError:
        return ''


def page_name(path: Path) -> str:
    """Return the name of the file with the report of a recording; no two have the same."""
    name = _UNSAFE.sub('_', path.resolve().name)[:80].strip('.')
    whole = str(path.absolute()).encode('utf-8', 'surrogateescape')
    return f'{name}-{hashlib.sha256(whole).hexdigest()[:8]}.html'


def digest(path: Path) -> str | None:
    """Return the SHA-256 of a recording's files, in the order of their names; None: unreadable."""
    found = hashlib.sha256()
    try:
        for file in files_of(path):
            with file.open('rb') as content:
                while block := content.read(_BLOCK):
                    found.update(block)
    except OSError:
        return None
    return found.hexdigest()


def check_all(bundle: Path, paths: Sequence[Path], selection: Selection, *, jobs: int,
              settings: str = '', reports: Path | None = None) -> Iterator[Outcome]:
    """Check recordings in `jobs` processes; yield the outcomes as they come."""
    check = partial(check_one, settings=settings, reports=reports)
    if jobs == 1:
        for path in paths:
            yield check(bundle, path, selection)
        return
    left = list(paths)
    while left:
        left = yield from _check_in_pool(check, bundle, left, selection, jobs)


def _check_in_pool(check: _Check, bundle: Path, paths: Sequence[Path], selection: Selection,
                   jobs: int) -> Generator[Outcome, None, list[Path]]:
    """Yield outcomes; return the recordings that are left if a process died."""
    with ProcessPoolExecutor(jobs, mp_context=workers()) as pool:
        waiting: dict[Future[Outcome], Path] = {}
        queue = iter(paths)
        _fill(pool, waiting, queue, partial(check, bundle, selection=selection), 2 * jobs)
        while waiting:
            done = next(as_completed(waiting))
            path = waiting.pop(done)
            try:
                yield done.result()
            except BrokenProcessPool:
                died = [path, *waiting.values()]
                return (yield from _one_by_one(check, bundle, died, selection, [*queue]))
            _fill(pool, waiting, queue, partial(check, bundle, selection=selection), 2 * jobs)
    return []


def _fill(pool: ProcessPoolExecutor, waiting: dict[Future[Outcome], Path], queue: Iterator[Path],
          check: Callable[[Path], Outcome], most: int) -> None:
    while len(waiting) < most and (path := next(queue, None)) is not None:
        waiting[pool.submit(check, path)] = path


def _one_by_one(check: _Check, bundle: Path, paths: Iterable[Path], selection: Selection,
                rest: list[Path]) -> Generator[Outcome, None, list[Path]]:
    """Check each recording in a process of its own, as one of them ended its process."""
    for path in paths:
        with ProcessPoolExecutor(1, mp_context=workers()) as pool:
            try:
                yield pool.submit(check, bundle, path, selection).result()
            except BrokenProcessPool:
                yield _failed(path, 'the process that checked it died')
    return rest


def check_on_cluster(bundle: Path, paths: Sequence[Path], selection: Selection, *, address: str,
                     jobs: int, settings: str = '',
                     reports: Path | None = None) -> Iterator[Outcome]:
    """
    Check recordings on a cluster of Dask (`cluster_client`); yield the outcomes as they come.

    The workers read the bundle and the recordings by the same paths.
    """
    dask: Any = import_module('distributed')
    paths = [path.absolute() for path in paths]
    check = partial(check_one, settings=settings,
                    reports=None if reports is None else reports.absolute())
    with cluster_client(address, jobs) as client:
        waiting = {client.submit(check, bundle.absolute(), path, selection, pure=False): path
                   for path in paths}
        for done in dask.as_completed(list(waiting)):
            problem = done.exception()
            if problem is None:
                yield done.result()
            else:  # its worker died, again and again, or lacks what is needed
                yield _failed(waiting[done], f'{type(problem).__name__}: {problem}')


def reusable(lines: Mapping[str, str], path: Path, settings: str,
             page: Path | None = None) -> str | None:
    """
    Return the line of a recording that need not be checked again; None if it must be.

    With `page`, the file with its report must be there as it was written.
    """
    line = lines.get(recording_key(path))
    if line is None:
        return None
    content = json.loads(line)
    is_same = content.get('settings') == settings and not content.get('errors') \
        and all('meaning' in item for item in content['requirements'].values()) \
        and content.get('sha256') is not None and content['sha256'] == digest(path) \
        and (page is None or content.get('report') in _page_digests(page))
    return line if is_same else None


def _page_digests(page: Path) -> list[str]:
    """Return the SHA-256 of a file in a list, which is empty if it cannot be read."""
    try:
        return [hashlib.sha256(page.read_bytes()).hexdigest()]
    except OSError:
        return []
