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
What `check --trace` shows: where a requirement comes from, what it reads, and what exercised it.

Tests are those of `tests`; recordings are those of files that `bag` has written, lines of JSON
(`--results`, `--json`) or JUnit.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
import json
from pathlib import Path
from typing import Any, NoReturn

from fret_monitor.bag.results_file import recording_key
from fret_monitor.bundle.source_file import read_source
from fret_monitor.importing.json_text import mapping
from fret_monitor.importing.xml_text import parsed_xml
from fret_monitor.model.diagnostics import counted, Problems, refuse, Source, Span
from fret_monitor.model.names import shown

_MAX_BYTES = 256 * 2 ** 20
_INDEX = 'tests.json'
_MOST_NAMED = 3
_SHOWN_DIGITS = 8


@dataclass(frozen=True)
class Seen:
    """
    What a recording says of a requirement.

    `meaning` is that of the requirement that was judged, as of `meanings_of`; '' in other files.
    `verdict` is None if it was not judged; `triggered` is None if that was not asked.
    """

    recording: str
    meaning: str
    verdict: bool | None
    triggered: bool | None

    @property
    def is_exercised(self) -> bool | None:
        """Whether its trigger came; None if that is not known."""
        if self.verdict is None or self.triggered is False:
            return False
        return True if self.triggered or not self.verdict else None


@dataclass(frozen=True)
class _JudgedRecording:
    """What a file says of a recording; `digest` is the hash of its content, '' if unknown."""

    name: str
    digest: str
    found: Mapping[str, Seen]


@dataclass(frozen=True)
class Evidence:
    """
    The traces of tests and what recordings say, by the ids of requirements.

    Of a recording of which several results are given, the last one counts.
    """

    tests: Mapping[str, Sequence[str]]
    recordings: Mapping[str, Sequence[Seen]]
    n_recordings: int
    has_tests: bool

    def seen(self, id_: str, meaning: str) -> tuple[Seen, ...]:
        """Return what recordings say of a requirement with this meaning."""
        found = {recording_key(item.recording): item for item in self.recordings.get(id_, ())
                 if item.meaning == meaning}
        return tuple(found.values())

    def outdated(self, id_: str, meaning: str) -> tuple[str, ...]:
        """Return the recordings of which only results of another requirement are there."""
        known = {recording_key(item.recording) for item in self.seen(id_, meaning)}
        return tuple(dict.fromkeys(item.recording for item in self.recordings.get(id_, ())
                                   if recording_key(item.recording) not in known))


@dataclass(frozen=True)
class Link:
    """
    A requirement: its id in its source, what it reads, and what exercised it.

    `outdated` are the recordings that were judged for another requirement of this id.
    """

    id: str
    source: str
    inputs: Sequence[str]
    topics: Sequence[str]
    tests: Sequence[str]
    seen: Sequence[Seen]
    outdated: Sequence[str] = ()

    @property
    def is_triggered(self) -> bool | None:
        """Whether a recording exercised it; None if that is not known."""
        found = {item.is_exercised for item in self.seen}
        return True if True in found else None if None in found else False

    @property
    def verdict(self) -> bool | None:
        """The verdict over all recordings; None if it was not judged."""
        found = {item.verdict for item in self.seen}
        return False if False in found else True if True in found else None


def evidence(paths: Iterable[Path], problems: Problems) -> Evidence:
    """
    Read folders of `tests`, and files with results of `bag`.

    Raises
    ------
    CompileError
        if one is neither, or cannot be read.
    """
    tests: dict[str, list[str]] = {}
    seen: dict[str, list[Seen]] = {}
    bags: dict[str, None] = {}
    verdicts: dict[tuple[str, str, str], bool | None] = {}
    judged: list[tuple[Path, _JudgedRecording]] = []
    has_tests = False
    for path in paths:
        source = read_source(path / _INDEX if path.is_dir() else path, _MAX_BYTES)
        if (cases := _traces(source)) is not None:
            has_tests = True
            for name, requirement in cases:
                tests.setdefault(requirement, []).append(name)
            continue
        judged += [(path, item) for item in _with_last_digests(_results(source, path, problems))]
    for path, recording in zip((path for path, _ in judged),
                               _told_apart([item for _, item in judged]), strict=True):
        bags[recording_key(recording.name)] = None
        other = []
        for id_, item in recording.found.items():
            seen.setdefault(id_, []).append(item)
            key = id_, recording_key(item.recording), item.meaning
            if {verdicts.get(key), item.verdict} == {True, False}:
                other.append(id_)
            verdicts[key] = item.verdict
        if other:
            problems.warning(
                f'{path}: {shown(recording.name)} has other verdicts than before: '
                f'{_named(other)}', None, '', 'the last ones count; of two recordings with one '
                'name, give `bag` longer paths, such as tue/run.csv')
    return Evidence(tests, seen, len(bags), has_tests)


def _with_last_digests(found: Iterable[_JudgedRecording]) -> list[_JudgedRecording]:
    """Return the results of a file, where the last content of a name counts, as in `bag`."""
    items = [*found]
    last = {recording_key(item.name): item.digest for item in items}
    return [replace(item, digest=last[recording_key(item.name)]) for item in items]


def _told_apart(found: Sequence[_JudgedRecording]) -> Iterator[_JudgedRecording]:
    """Yield results whose names have a part of the hash, where files differ under one name."""
    digests: dict[str, set[str]] = {}
    for item in found:
        digests.setdefault(recording_key(item.name), set()).update({item.digest} - {''})
    for item in found:
        if item.digest and len(digests[recording_key(item.name)]) > 1:
            name = f'{item.name} ({item.digest[:_SHOWN_DIGITS]})'
            item = _JudgedRecording(name, item.digest, {
                id_: replace(one, recording=name) for id_, one in item.found.items()})
        yield item


def _traces(source: Source) -> list[tuple[str, str]] | None:
    """Return the traces of the index of a folder of `tests`; None if it is none."""
    try:
        found = mapping(json.loads(source.text))['traces']
        return [(str(item['trace']), str(item['requirement'])) for item in found]  # type: ignore[attr-defined]
    except (ValueError, KeyError, TypeError, RecursionError):
        return None


def _results(source: Source, path: Path,
             problems: Problems) -> Iterator[_JudgedRecording]:
    if source.text.lstrip().startswith('<'):
        yield from _junit(source, path)
        return
    is_any = False
    for start, line in _lines(source.text):
        try:
            content = json.loads(line)
            if 'bags' in content:  # what `bag` says of all recordings
                continue
            found = {str(id_): Seen(str(content['bag']), str(item.get('meaning', '')),
                                    item['verdict'], item.get('triggered'))
                     for id_, item in content['requirements'].items()}
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
            problems.warning(f'{path}: this line has no results of a recording',
                             Span(source, start, start + len(line)), 'left out')
            continue
        is_any = True
        yield _JudgedRecording(str(content['bag']), str(content.get('sha256') or ''), found)
    if not is_any:
        _refuse_without_results(path)


def _refuse_without_results(path: Path) -> NoReturn:
    refuse(f'{shown(str(path))} has no results', help='give what `bag --results FILE` or `bag '
           '--junit FILE` has written, or the folder of `tests`')


def _lines(text: str) -> Iterator[tuple[int, str]]:
    start = 0
    for line in text.split('\n'):
        if line.strip():
            yield start, line
        start += len(line) + 1


def _junit(source: Source, path: Path) -> Iterator[_JudgedRecording]:
    suites = [*parsed_xml(source.text, path).iter('testsuite')]
    if not any(item.get('name') == 'meaning' for suite in suites
               for item in suite.iter('property')):
        _refuse_without_results(path)
    for suite in suites:
        bag = suite.get('name', '')
        found: dict[str, Seen] = {}
        for case in suite.iter('testcase'):
            kinds = {child.tag for child in case}
            said = {item.get('name'): item.get('value', '') for item in case.iter('property')}
            verdict = None if 'skipped' in kinds else 'failure' not in kinds
            if 'error' not in kinds:
                found[case.get('name', '')] = Seen(
                    bag, said.get('meaning', ''), verdict,
                    said['triggered'] == 'true' if 'triggered' in said else None)
        yield _JudgedRecording(bag, '', found)


def table(links: Sequence[Link], found: Evidence) -> Iterator[tuple[str, ...]]:
    """Yield the heads and a row for each requirement, without columns of what was not given."""
    yield ('id', 'source', 'inputs', 'topics', *(('tests',) if found.has_tests else ()),
           *(('recordings', 'verdict') if found.n_recordings else ()))
    for item in links:
        yield (item.id, item.source, _named(item.inputs), _named(item.topics),
               *((str(len(item.tests)),) if found.has_tests else ()),
               *((_exercised(item), _verdict(item)) if found.n_recordings else ()))


def _named(names: Sequence[str]) -> str:
    more = f' and {len(names) - _MOST_NAMED} more' if len(names) > _MOST_NAMED else ''
    return ', '.join(names[:_MOST_NAMED]) + more or '-'


def _exercised(item: Link) -> str:
    """Return the recordings that exercised a requirement; with `?` where that is not known."""
    return _named([seen.recording + ('?' if seen.is_exercised is None else '')
                   for seen in item.seen if seen.is_exercised is not False])


def _verdict(item: Link) -> str:
    if item.verdict is None:
        return 'not judged'
    if not item.verdict:
        return 'violated'
    return 'never triggered' if item.is_triggered is False else 'satisfied'


def gaps(links: Sequence[Link], found: Evidence) -> Iterator[str]:
    """Yield lines that name the requirements that nothing exercised, or of which it is unknown."""
    judged = [item for item in links if item.verdict is not None]
    never = [item.id for item in judged if item.is_triggered is False]
    unknown = [item.id for item in judged if item.is_triggered is None]
    open_ = [item.id for item in links if item.verdict is None]
    untested = [item.id for item in links if not item.tests]
    recordings = counted(found.n_recordings, 'recording')
    if found.n_recordings and open_:
        yield f'not judged in {recordings}: {", ".join(open_)}'
    if never:
        yield f'never triggered in {recordings}: {", ".join(never)}'
    if unknown:
        yield f'triggered or not? `bag --triggers` finds out: {", ".join(unknown)}'
    for item in links:
        if item.outdated:
            yield (f'{item.id}: results of another text or formula are left out: '
                   f'{_named(item.outdated)}')
    if found.has_tests and untested:
        yield f'without a test: {", ".join(untested)}'


def as_dict(item: Link) -> dict[str, Any]:
    """Return a requirement for `--json` (docs/command_line.md)."""
    return {'id': item.id, 'source': item.source, 'inputs': [*item.inputs],
            'topics': [*item.topics], 'tests': [*item.tests], 'triggered': item.is_triggered,
            'recordings': [{'bag': seen.recording, 'verdict': seen.verdict,
                            'triggered': seen.is_exercised} for seen in item.seen],
            'outdated': [*item.outdated]}
