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
A first bundle from recordings: their topics and fields of numbers, with what was seen of them.

The fields are mapped in a bundle that is not kept, and its extractors read the recordings, so that
what is offered is what a monitor reads.
"""

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
import math
from pathlib import Path
import re
from tempfile import TemporaryDirectory

from fret_monitor.bag.check import AnyBatch, compiled, read_bundle, run, Selection
from fret_monitor.bag.recording import Batch, Recording
from fret_monitor.importing.draft import free_name
from fret_monitor.language.fretish import parse_fretish
from fret_monitor.messages.installed import find_message, nested_layout
from fret_monitor.messages.layout import ArrayKind, MessageLayout
from fret_monitor.model.diagnostics import (
    CompileError, counted, Problems, Source, Text,
)
from fret_monitor.model.names import name_fault
from fret_monitor.model.progress import no_progress, Progress
from fret_monitor.model.values import ValueType
from fret_monitor.runtime.engine import Engine
from fret_monitor.runtime.thinning import Thinning, TimeWindow, WindowPart

MOST_FIELDS = 200
"""Fields of a topic that are offered."""

_PARTS = 32
_EXACT = 2 ** 53
_LEAST_TIMEOUT = 0.001  # s, of an input
_OMITTED = ('std_msgs/msg/Header', 'builtin_interfaces/msg/Time',
            'builtin_interfaces/msg/Duration')
_TEXTS = ('string', 'wstring')
_SCALARS = {**{kind.value: kind for kind in ValueType}, 'byte': ValueType.UINT8,
            'char': ValueType.UINT8}


@dataclass
class SeenField:
    """A field; `least` and `most` are of the numbers seen, NaN if none was; `has_nan`: NaN was."""

    path: str
    type: ValueType
    name: str = ''
    least: float = math.nan
    most: float = math.nan
    has_nan: bool = False

    def note(self, parts: Iterable[WindowPart]) -> None:
        """Note the least and greatest values of parts of a recording."""
        parts = [*parts]
        self.has_nan |= any(part.has_nan for part in parts)
        found = [value for part in parts for value in (part.least, part.most)
                 if not math.isnan(value)]
        found += [value for value in (self.least, self.most) if not math.isnan(value)]
        if found:
            self.least, self.most = min(found) + 0.0, max(found) + 0.0  # no '-0'


@dataclass
class SeenTopic:
    """
    A topic: its fields of numbers, its messages, and what has passed between them (ns).

    `is_installed`: its message definition is here, and not only in a recording. One that is left
    out has no fields; if a warning says why, no type either.
    """

    name: str
    type: str
    fields: list[SeenField]
    arrays: list[str]
    messages: int = 0
    intervals: int = 0
    lasted: int = 0
    longest_gap: int = 0
    is_installed: bool = True

    def note(self, times: Sequence[int]) -> None:
        """Note the times of the messages of a recording."""
        gaps = [later - earlier for earlier, later in pairwise(times)]
        self.messages += len(times)
        self.intervals += len(gaps)
        self.lasted += sum(gaps)
        self.longest_gap = max(self.longest_gap, *gaps, 0)

    @property
    def has_numbers(self) -> bool:
        return bool(self.fields or self.arrays)

    @property
    def timeout(self) -> float:
        """Twice the longest gap, in seconds with two digits, but what an input may have."""
        return max(float(f'{2e-9 * self.longest_gap:.2g}'), _LEAST_TIMEOUT) \
            if self.longest_gap else 0.0


def recorded_topics(paths: Sequence[Path], problems: Problems,
                    wanted: Collection[str] = ()) -> list[SeenTopic]:
    """
    Return the topics of recordings, by name.

    Left out with a warning are those without numbers, those of several types, and those of
    messages without a definition that can be read. If some are `wanted`, others have no warning.

    Raises
    ------
    CompileError
        if a recording cannot be read.
    """
    found: dict[str, SeenTopic] = {}
    types: dict[str, set[str]] = {}
    for path in paths:
        with Recording(path) as recording:
            for name, kinds in recording.types.items():
                types.setdefault(name, set()).update(kinds)
                if name not in found and len(kinds) == 1:
                    (kind,) = kinds
                    own = problems if not wanted or name in wanted else Problems()
                    found[name] = _recorded_topic(name, kind, recording, own)
    for name, kinds in sorted(types.items()):
        if len(kinds) > 1:
            own = problems if not wanted or name in wanted else Problems()
            found[name] = left_out(name, f'it was recorded as {" and ".join(sorted(kinds))}', own)
    topics = [topic for _, topic in sorted(found.items())]
    warn_without_numbers(topics, problems, wanted)
    return topics


def left_out(name: str, reason: str, problems: Problems) -> SeenTopic:
    """Return a topic that is left out, with a warning."""
    problems.warning(f'{name} is left out: {reason}')
    return SeenTopic(name, '', [], [])


def warn_without_numbers(
        topics: Iterable[SeenTopic], problems: Problems, wanted: Collection[str]) -> None:
    """Warn of topics that have no numbers; if some are `wanted`, only of those."""
    without = [topic.name for topic in topics if topic.type and not topic.has_numbers
               and (not wanted or topic.name in wanted)]
    if without:
        problems.warning(f'left out, as they have no numbers: {", ".join(without)}')


def _recorded_topic(name: str, kind: str, recording: Recording, problems: Problems) -> SeenTopic:
    """Return a topic with its fields; it is left out if its messages are unknown."""
    try:
        topic = SeenTopic(name, kind, *fields_of(recording.find_message(kind)))
    except CompileError as error:
        return left_out(name, error.diagnostics[0].title, problems)
    try:
        find_message(kind)
    except CompileError:
        topic.is_installed = False
    return topic


def fields_of(layout: MessageLayout) -> tuple[list[SeenField], list[str]]:
    """Return the fields of numbers of a message, outside of headers, and those that are arrays."""
    found: list[SeenField] = []
    arrays: list[str] = []
    waiting: list[tuple[str, MessageLayout]] = [('', layout)]
    while waiting:
        prefix, message = waiting.pop()
        nested = []
        for item in message.fields:
            path = f'{prefix}{item.name}'
            if item.type.array is not ArrayKind.NONE:
                if item.type.base not in _TEXTS:
                    arrays.append(path)
            elif item.type.base in _SCALARS:
                found.append(SeenField(path, _SCALARS[item.type.base]))
            elif item.type.is_message and item.type.base not in _OMITTED:
                nested.append((f'{path}.', nested_layout(message, item.type)))
        waiting.extend(reversed(nested))
    return found[:MOST_FIELDS], arrays


def survey(paths: Sequence[Path], topics: Sequence[SeenTopic],
           progress: Progress = no_progress) -> None:
    """
    Note the values and times of some topics in recordings; give names to their fields.

    Raises
    ------
    CompileError
        if a recording cannot be read.
    NativeError
        if there is no C compiler, or it fails.
    """
    _name_fields(topics)
    for path in paths:
        with Recording(path) as recording, TemporaryDirectory() as folder:
            seen = [topic for topic in topics if _can_read(topic, recording)]
            for topic in topics:
                if topic not in seen:
                    topic.messages += recording.recorded[topic.name]
            if seen:
                probe = Path(folder) / 'probe.yaml'
                probe.write_text(_probe(seen), encoding='utf-8')
                _survey_one(probe, recording, seen, progress)


def _can_read(topic: SeenTopic, recording: Recording) -> bool:
    """Whether a recording has a topic with fields of numbers, and its message definition."""
    if not topic.fields or topic.name not in recording.types:
        return False
    try:
        recording.find_message(topic.type)
    except CompileError:
        return False
    return True


def _probe(topics: Sequence[SeenTopic]) -> str:
    """Return a bundle that reads all fields."""
    first = topics[0].fields[0].name
    return '\n'.join([
        'format: 1', 'inputs:',
        *(f'  {item.name}: {{topic: {topic.name}, type: {topic.type}, field: {item.path}}}'
          for topic in topics for item in topic.fields),
        'requirements:', f'  - {{id: R, ptltl: "{first} = {first}"}}', ''])


def _survey_one(probe: Path, recording: Recording, topics: Sequence[SeenTopic],
                progress: Progress) -> None:
    selection = Selection(may_miss=True)
    monitor = compiled(read_bundle(probe, selection, recording.find_message)).monitor
    fields = [item for topic in topics for item in topic.fields]
    end = max(recording.end, recording.start + 1)
    thinning = Thinning(monitor, [TimeWindow(index, recording.start, end, _PARTS)
                                  for index in range(len(fields))])
    times: dict[str, list[int]] = {topic.name: [] for topic in monitor.manifest.topics}
    names = [*times]

    def watch(engine: Engine, batch: AnyBatch) -> None:
        batch.add_to(thinning, engine)
        assert isinstance(batch, Batch)
        for number, time in zip(batch.topics, batch.times, strict=True):
            times[names[number]].append(time)

    run(monitor, recording, selection, watch=watch, progress=progress)
    for index, item in enumerate(fields):
        item.note(thinning.parts(index))
    for topic in topics:
        topic.note(times[topic.name])


def _name_fields(topics: Sequence[SeenTopic]) -> None:
    """Name the fields after their topics and paths, each differently."""
    taken: set[str] = set()
    for topic in topics:
        for item in topic.fields:
            names = [*_names(topic.name, item.path)]
            names.append(f'{names[0]}_value')
            fitting = [name for name in names if name not in taken and _is_name(name)]
            item.name = fitting[0] if fitting else free_name(names[-1], taken)
            taken.add(item.name)


def _is_name(text: str) -> bool:
    """Whether an input may have a name, and a sentence may name it."""
    try:
        parse_fretish(Text.whole(Source('', f'the system shall always satisfy {text} > 0')))
    except CompileError:
        return False
    return name_fault(text) is None


def _names(topic: str, path: str) -> Iterator[str]:
    """Yield names of a field, the shortest first."""
    words, rest = topic.strip('/').split('/'), [] if path == 'data' else path.split('.')
    for begin in range(len(words) - 1, -1, -1):
        yield re.sub(r'\W', '_', '_'.join([*words[begin:], *rest]), flags=re.ASCII)


def bundle_text(topics: Sequence[SeenTopic], source: str) -> str:
    """Return the text of the first bundle; `source` says where the topics come from."""
    return '\n'.join([
        f'# Made by `fret-monitor new` from {" ".join(source.split())}.',
        '# Behind each input is what was seen of it. Delete what you do not need.',
        *_not_installed(topics),
        'format: 1', 'evaluation: {policy: timed}   # durations are times', '',
        'inputs:', *(line for topic in topics for line in _topic(topic)),
        *_examples([item for topic in topics for item in topic.fields]), ''])


def _not_installed(topics: Sequence[SeenTopic]) -> Iterator[str]:
    types = dict.fromkeys(topic.type for topic in topics if not topic.is_installed)
    if types:
        yield (f'# Only in the recording, not installed here: {", ".join(types)}. `bag` takes '
               'them from there; `check` and `monitor` need them.')


def _topic(topic: SeenTopic) -> Iterator[str]:
    yield f'  # {topic.name}: {_pace(topic)}'
    timeout = f', timeout: {topic.timeout:g}' if topic.timeout else ''
    for item in topic.fields:
        yield (f'  {item.name}: {{topic: {topic.name}, type: {topic.type}, field: {item.path}'
               f'{timeout}}}   # {_range(item)}')
    for path in topic.arrays:
        yield f'  # an array: field: "{path}[0]", or a function of it, "min({path})"'


def _pace(topic: SeenTopic) -> str:
    if not topic.lasted:
        return counted(topic.messages, 'message')
    return (f'{counted(topic.messages, "message")}, {topic.intervals * 1e9 / topic.lasted:.3g} a '
            f'second, longest gap {topic.longest_gap / 1e9:.3g} s')


def _range(item: SeenField) -> str:
    if math.isnan(item.least):
        return 'always NaN' if item.has_nan else 'no value was seen'
    if item.type is ValueType.BOOL:
        return ' and '.join(dict.fromkeys('true' if value else 'false'
                                          for value in (item.least, item.most)))
    least, most = f'{item.least:.6g}', f'{item.most:.6g}'
    nan = ' and NaN' if item.has_nan else ''
    # Integers beyond 2^53 were read as the next float64.
    is_exact = not item.type.is_integer or max(abs(item.least), abs(item.most)) < _EXACT
    if least != most:
        return f'{least} to {most}{nan}'
    is_one = is_exact and not nan and item.least == item.most
    return f'always {least}' if is_one else f'{"" if is_exact else "about "}{least}{nan}'


def _examples(fields: Sequence[SeenField]) -> Iterator[str]:
    """Yield two requirements in comments: they pass `check` when the marks are removed."""
    if not fields:
        return
    item = max(fields, key=lambda one: (
        one.type is not ValueType.BOOL, _is_finite(one), not one.has_nan, one.most > one.least))
    most, high = _limits(item)
    limit = 'beyond what was seen' if _is_finite(item) else 'above 100'
    yield from (
        '', '# Remove the marks `# ` of the next lines, and write what your robot shall do.',
        '# requirements:',
        f'#   - id: EXAMPLE-1   # never {limit}',
        f'#     fretish: the system shall always satisfy {most}',
        '#   - id: EXAMPLE-2   # back within two seconds',
        f'#     fretish: when {high} the system shall within 2 seconds satisfy !({high})')


def _is_finite(item: SeenField) -> bool:
    return math.isfinite(item.most - item.least)


def _limits(item: SeenField) -> tuple[str, str]:
    """Return that a value is at most what was seen, and that it is in the upper half of that."""
    name = item.name
    if item.type is ValueType.BOOL:
        return f'{name} | !{name}', name
    if not _is_finite(item):
        return f'{name} <= 100', f'{name} > 50'
    middle = item.least / 2 + item.most / 2
    if item.type.is_integer:
        return f'{name} <= {_not_less(item)}', f'{name} > {math.floor(middle)}'
    most = f'!({name} > {item.most!r})' if item.has_nan else f'{name} <= {item.most!r}'
    return most, f'{name} > {float(f"{middle:.3g}")!r}'


def _not_less(item: SeenField) -> int:
    """Return a whole number that is at least what was seen, which was read as a float64."""
    if abs(item.most) < _EXACT:
        return math.ceil(item.most)
    greatest = (2 ** 64 if item.type is ValueType.UINT64 else 2 ** 63) - 1
    return min(math.ceil(math.nextafter(item.most, math.inf)), greatest)
