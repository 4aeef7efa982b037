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
The questions of a page and their answers, in a process of its own (`process.py`).

    python -m fret_monitor.studio.questions FOLDER

Offsets are in UTF-16 units, as those of JavaScript. A value over the steps of a trace is a list
of `[first step, value]`, one for each change.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import replace
import json
from pathlib import Path
import resource
import sys
import tempfile
from typing import Any, TypeAlias

from fret_monitor.bag.required import require_rosbags
from fret_monitor.build import Reading
from fret_monitor.bundle.source_file import ReadFile
from fret_monitor.editing import (
    blank_form, code_of, complete, EditedBundle, fixes, formatted, hover, picture, PositionMap,
    read_edited, RequirementMemory, sentence_form, with_edits, with_requirement, with_sentence,
)
from fret_monitor.logic.expansion import expanded
from fret_monitor.logic.formula import Binary, BinaryOperator, Conversion, postorder, Variable
from fret_monitor.logic.scopes import one_instance
from fret_monitor.logic.specification import Property, Signal, Specification
from fret_monitor.model.diagnostics import CompileError, Diagnostic, Level, Source, Span
from fret_monitor.model.policies import InputSource, Policy
from fret_monitor.model.values import ValueType
from fret_monitor.native import evaluator_library
from fret_monitor.native.errors import NativeError
from fret_monitor.studio.drawn_trace import (
    CompiledPart, DrawnTrace, parts_of, TracePart, windows_of,
)
from fret_monitor.studio.folder import Folder
from fret_monitor.studio.plan import plan
from fret_monitor.studio.values import column, nanoseconds, Refused, runs, seconds, shown, start
from fret_monitor.traces.boundary import constants

Question: TypeAlias = Mapping[str, Any]
Answer: TypeAlias = Any

MOST_STEPS = 100_000
_LONGEST = 100 * 365 * 86_400 * 10**9  # ns
_MOST_PARTS = 64  # that are kept beside those of the present text
_MEMORY = 3_000_000_000
_MOST_LEVELS = 8  # numbers with which an input is compared, that are drawn
_FIXED = 5  # diagnostics for which fixes are looked for: each way is tried
_MOST_KEYS = 4  # listed ones, of which a trace has inputs
_KEYS = ('a', 'b')  # of a variable whose keys are not listed
_KINDS = {'satisfying': 'satisfies', 'violating': 'violates', 'recovering': 'recovers in'}


class Questions:
    """Answers questions about the bundles of a folder."""

    def __init__(self, folder: Path) -> None:
        """Store the folder."""
        self._folder = Folder(folder)
        self._last: tuple[tuple[str, str], EditedBundle] | None = None
        self._memory = RequirementMemory()
        self._is_ready = False  # what all bundles share is compiled
        self._compiled: dict[TracePart, CompiledPart] = {}
        self._divided: dict[tuple[str, str, bool], tuple[TracePart, ...]] = {}
        self._answers: dict[str, Callable[[Question], Answer]] = {
            'check': self._check, 'hover': self._hover, 'complete': self._complete,
            'fixes': self._fixes, 'format': self._format, 'picture': self._picture,
            'plan': self._plan, 'form': self._form, 'reword': self._reword,
            'draft': self._draft,
            'explain': self._explain, 'simulate': self._simulate, 'example': self._example,
            'why': self._why, 'recording': self._recording, 'taken': self._taken,
            'prepare': self._prepare}

    def answer(self, question: Question) -> dict[str, Any]:
        """Return {'answer': ...} or {'error': text}."""
        try:
            return {'answer': self._answers[question['do']](question)}
        except Refused as error:
            return {'error': str(error)}
        except CompileError as error:
            return {'error': '\n'.join(item.in_one_line for item in error.diagnostics[:3])}
        except NativeError as error:
            return {'error': str(error)}
        except MemoryError:
            return {'error': 'it takes more memory than this page may use'}
        except (KeyError, TypeError, ValueError) as error:
            return {'error': f'the question cannot be answered: {error!r}'}

    def _edited(self, question: Question) -> EditedBundle:
        key = (question['name'], question['text'])
        if self._last is None or self._last[0] != key:
            path = self._folder.path(key[0])
            self._last = key, read_edited(path, key[1], read_file=self._folder.read_source,
                                          memory=self._memory)
        return self._last[1]

    def _whole(self, question: Question) -> Reading:
        found = self._edited(question).reading
        if found is None:
            raise Refused('the bundle has errors')
        return found

    def _reading(self, question: Question) -> Reading:
        """Return the bundle of a question, with one instance of each variable."""
        found = self._whole(question)
        return replace(found, specification=one_instance(found.specification))

    def _traced(self, question: Question) -> Reading:
        """Return the bundle of a question as a trace has it, with some instances."""
        found = self._whole(question)
        return replace(found, specification=_with_instances(found.specification))

    # What is asked while somebody types.

    def _check(self, question: Question) -> Answer:
        edited = self._edited(question)
        places = Utf16(edited.source.text)
        return {
            'diagnostics': [_diagnostic(edited, item, places) for item in edited.diagnostics],
            'bundle': None if edited.reading is None else self._overview(edited.reading, places)}

    def _overview(self, reading: Reading, places: 'Utf16') -> Answer:
        specification = _with_instances(reading.specification)
        levels = _levels(specification)
        return {
            'policy': specification.policy.value,
            'isTimed': specification.policy is Policy.TIMED,
            'period': None if specification.period is None else float(specification.period),
            'inputs': [_input(signal, levels[signal.name]) for signal in specification.signals
                       if signal.source is not InputSource.TIME],
            'judged': [item.id for item in specification.properties],
            'windows': [*windows_of(specification)],
            'requirements': [_requirement(item, places)
                             for item in reading.specification.properties]}

    def _hover(self, question: Question) -> Answer:
        edited = self._edited(question)
        places = Utf16(edited.source.text)
        found = hover(edited, places.offset(question['offset']))
        return found and {**places.range(found.place), 'markdown': found.markdown}

    def _complete(self, question: Question) -> Answer:
        edited = self._edited(question)
        places = Utf16(edited.source.text)
        return [{'label': item.label, 'detail': item.detail, 'kind': item.kind.value,
                 'text': item.text, **places.range(item.place)}
                for item in complete(edited, places.offset(question['offset']))]

    def _fixes(self, question: Question) -> Answer:
        edited = self._edited(question)
        places = Utf16(edited.source.text)
        return [[{'title': fix.title, 'text': fix.edit.text, **places.range(fix.edit.place)}
                 for fix in fixes(edited, item, self._memory)]
                for item in edited.diagnostics[:_FIXED]]

    def _format(self, question: Question) -> Answer:
        return formatted(question['text'])

    def _picture(self, question: Question) -> Answer:
        edited = self._edited(question)
        places = Utf16(edited.source.text)
        found = picture(edited)
        return {'links': found.links, 'nodes': [
            {'kind': item.kind.value, 'name': item.name, 'detail': item.detail,
             'level': item.level.value if item.level else None,
             'from': places.units(item.places[0].start)
             if item.places and item.places[0].source.name == edited.source.name else None}
            for item in found.nodes]}

    def _form(self, question: Question) -> Answer:
        """Return the fields of a requirement; of a new one without an id."""
        fields = blank_form() if question['id'] is None else \
            sentence_form(self._edited(question), question['id'])
        return [item._asdict() for item in fields]

    def _reword(self, question: Question) -> Answer:
        """Return the edit that writes the fields of a form into the text."""
        edited = self._edited(question)
        edit = with_sentence(edited, question['id'], question['fields'])
        return {'text': edit.text, **Utf16(edited.source.text).range(edit.place)}

    def _draft(self, question: Question) -> Answer:
        """Return the edit that adds a requirement, the text with it, and what is wrong with it."""
        edited = self._edited(question)
        edit = with_requirement(edited, question['id'], question['fields'])
        whole = with_edits(edited.source.text, [edit])
        after = self._edited({**question, 'text': whole})
        known = {(item.title, item.label) for item in edited.diagnostics}
        return {'text': edit.text, **Utf16(edited.source.text).range(edit.place), 'whole': whole,
                'problems': ['; '.join(filter(None, (
                    ': '.join(filter(None, (item.title, item.label))), item.help)))
                             for item in after.diagnostics
                             if (item.title, item.label) not in known]}

    def _plan(self, question: Question) -> Answer:
        found = self._edited(question).reading
        if found is None:
            raise Refused('the bundle has errors')
        return plan(found.specification)

    # What compiles.

    def _prepare(self, question: Question) -> Answer:
        """
        Compile something that the next question needs; return whether there is more.

        First what all bundles share: after an installation, it takes long.
        """
        if not self._is_ready:
            evaluator_library()
            self._is_ready = True
        parts = self._parts(question) if question.get('text') else ()
        missing = [part for part in parts if part not in self._compiled]
        if missing:
            self._compiled[missing[0]] = CompiledPart(missing[0])
        return len(missing) > 1

    def _explain(self, question: Question) -> Answer:
        from fret_monitor.explain.report import as_dict, explain
        found, _ = explain(self._reading(question), [question['id']])
        return as_dict(found[0])

    def _parts(self, question: Question) -> tuple[TracePart, ...]:
        key = question['name'], question['text'], bool(question.get('margins'))
        if key not in self._divided:
            self._divided = {key: parts_of(replace(
                self._traced(question).specification, has_margins=key[2]))}
        return self._divided[key]

    def _simulate(self, question: Question) -> Answer:
        specification = self._traced(question).specification
        trace = DrawnTrace(question['values'], _steps(question), _period(question, specification))
        while self._prepare(question):
            pass
        parts = self._parts(question)
        found = [self._compiled[part].lanes(trace) for part in parts]
        for unused in [part for part in self._compiled if part not in parts][:-_MOST_PARTS]:
            del self._compiled[unused]
        csv = None
        if question.get('csv'):
            with self._trace(question, specification) as path:
                csv = path.read_text(encoding='utf-8')
        return {'csv': csv, **{
            kind: {name: lane for lanes in found for name, lane in getattr(lanes, kind).items()}
            for kind in ('verdicts', 'margins', 'windows')}}

    @contextmanager
    def _trace(self, question: Question, specification: Specification) -> Iterator[Path]:
        """Yield a file with the trace of a question, in a folder of its own."""
        from fret_monitor.traces.csv_trace import trace_text
        steps = _steps(question)
        columns = [column(signal, question['values'].get(signal.name, []), steps)
                   for signal in specification.signals]
        rows: Iterable[tuple[Any, ...]] = zip(*columns, strict=True) if columns else (
            () for _ in range(steps))
        period = _period(question, specification)
        times = [seconds(step * period) for step in range(steps)] if period else None
        with tempfile.TemporaryDirectory() as name:
            path = Path(name, 'trace.csv')
            path.write_text(trace_text(specification.signals, rows, times), encoding='utf-8')
            yield path

    def _why(self, question: Question) -> Answer:
        """Say what has led to the violation of a requirement at a step."""
        _require_bags()
        from fret_monitor.studio.recordings import why
        reading = self._traced(question)
        specification = reading.specification
        _wanted(specification, [question['id']])
        step = nanoseconds(question.get('period')) if specification.policy is Policy.TIMED \
            else round((specification.period or 1) * 10**9)
        with self._trace(question, specification) as trace:
            return why(reading, trace, question['id'], int(question['step'] * step), step)

    # What reads a recording.

    def _recording(self, question: Question) -> Answer:
        _require_bags()
        from fret_monitor.studio.recordings import report, stretch_of
        stretch = None if question.get('from') is None else stretch_of(
            question['from'], question['to'])
        return report(*self._files(question), stretch)

    def _taken(self, question: Question) -> Answer:
        _require_bags()
        from fret_monitor.studio.recordings import stretch_of, taken
        return taken(*self._files(question), stretch_of(question['from'], question['to']))

    def _files(self, question: Question) -> tuple[Path, Path, ReadFile]:
        """Return the bundle, the recording, and a function that reads the bundle's files."""
        bundle, text = self._folder.path(question['name']), question['text']
        return bundle, self._folder.recording(question['recording']), lambda path: (
            Source(str(path), text) if path == bundle else self._folder.read_source(path))

    def _example(self, question: Question) -> Answer:
        """Find a trace on which a requirement is so, or two have different verdicts."""
        specification = self._traced(question).specification
        wanted = _wanted(specification, question['ids'])
        kind = question['kind'] if len(question['ids']) == 1 else 'violating'
        return _example(specification, wanted, kind, question['ids'])


def _with_instances(specification: Specification) -> Specification:
    """Return a bundle with a few keys written in place of each variable, for a trace."""
    if not specification.instance_variables:
        return specification
    found = expanded(specification, {
        item.name: item.keys[:_MOST_KEYS] or _KEYS for item in specification.instance_variables})
    return replace(
        found, actions=(), gates=(),
        signals=tuple(replace(item, where=None, layout=None) for item in found.signals),
        properties=tuple(replace(item, on_violation=(), on_end=()) for item in found.properties))


def _require_bags() -> None:
    require_rosbags('this part of the page')


def _example(specification: Specification, wanted: Property, kind: str,
             ids: Sequence[str]) -> Answer:
    from fret_monitor.traces.sampled import grid_of, sampled
    from fret_monitor.traces.search import Budget, find_examples
    from fret_monitor.traces.subject import subjects
    from fret_monitor.traces.trace import rows_of
    is_timed = specification.policy is Policy.TIMED
    grid = grid_of(wanted) if is_timed else None
    stepped = wanted if grid is None else sampled(wanted, grid)
    subject, = subjects(specification, [stepped])
    found = find_examples(subject, Budget())
    trace = getattr(found, kind)
    if trace is None:
        what = f'{_KINDS[kind]} {ids[0]}' if len(ids) == 1 else \
            f'tells {ids[0]} and {ids[1]} apart'
        if found.is_proved and not is_timed:
            raise Refused(f'no trace {what}: all {found.states:,} states were explored')
        raise Refused(f'no trace that {what} was found; there may be one')
    rows = rows_of(trace)
    values = {signal.name: runs(shown(row[number], signal) for row in rows)
              for number, signal in enumerate(subject.signals)}
    return {'steps': len(rows), 'values': values,
            'period': None if grid is None else grid / 1e9}


def _wanted(specification: Specification, ids: Sequence[str]) -> Property:
    known = {item.id: item for item in specification.properties}
    missing = [name for name in ids if name not in known]
    if missing or not 1 <= len(ids) <= 2:
        raise Refused(f"the bundle has no requirement '{missing[0]}'" if missing
                      else 'choose one requirement or two')
    first, *others = (known[name] for name in ids)
    if not others:
        return first
    second, = others
    equal = Binary(BinaryOperator.IFF, first.formula, second.formula)
    return replace(first, formula=equal, sentence=None, text='',
                   feedback=tuple(dict((*first.feedback, *second.feedback)).items()))


class Utf16:
    """Converts offsets of a text to those of JavaScript, and back."""

    def __init__(self, text: str) -> None:
        """Store the text."""
        self._map = PositionMap(text)
        self._text = text
        self._is_plain = text.isascii() or max(text) <= '\uffff'

    def units(self, offset: int) -> int:
        """Return the units of UTF-16 before an offset."""
        return offset if self._is_plain else len(self._text[:offset].encode('utf-16-le')) // 2

    def offset(self, units: int) -> int:
        """Return the offset of a number of units."""
        if self._is_plain:
            return min(units, len(self._text))
        data = self._text.encode('utf-16-le')[:2 * units]
        return len(data.decode('utf-16-le', 'ignore'))

    def range(self, place: Span) -> dict[str, int]:
        """Return a place as `from` and `to`."""
        return {'from': self.units(place.start), 'to': self.units(place.end)}


def _diagnostic(edited: EditedBundle, found: Diagnostic, places: Utf16) -> Answer:
    span = found.span
    is_here = span is not None and span.source.name == edited.source.name
    return {
        'title': found.title, 'label': found.label, 'help': found.help, 'code': code_of(found),
        'severity': 'error' if found.level is Level.ERROR else 'warning',
        'line': span.line if span and is_here else None,
        'file': None if span is None or is_here else f'{Path(span.source.name).name}:{span.line}',
        **(places.range(span) if span and is_here else {'from': 0, 'to': 0})}


def _levels(specification: Specification) -> Mapping[str, list[float]]:
    """Return the numbers with which each input is compared."""
    found: dict[str, set[float]] = {signal.name: set() for signal in specification.signals}
    for node in postorder(root for item in specification.properties for root in item.roots):
        if isinstance(node, Binary) and node.operator.is_relation:
            for side, other in ((node.left, node.right), (node.right, node.left)):
                side = side.argument if isinstance(side, Conversion) else side
                if isinstance(side, Variable):
                    found[side.name] |= constants([other])
    return {name: sorted(levels)[:_MOST_LEVELS] for name, levels in found.items()}


def _input(signal: Signal, levels: list[float]) -> Answer:
    return {
        'name': signal.name, 'type': signal.type.value,
        'isBool': signal.type is ValueType.BOOL,
        'isFloat': signal.type.is_float,
        'levels': [] if signal.values or signal.type is ValueType.BOOL else levels,
        'names': [name for name, _ in signal.values],
        'numbers': [index if isinstance(number, str) else number
                    for index, (_, number) in enumerate(signal.values)],
        'topic': signal.topic or '', 'message': signal.message_type or '',
        'initial': shown(start(signal), signal) if signal.initial is not None
        or signal.source is InputSource.RECEIVED else None}


def _requirement(item: Property, places: Utf16) -> Answer:
    place = item.id_place or item.place
    return {'id': item.id, 'title': item.title, 'text': item.text,
            'inputs': sorted(item.inputs),
            **(places.range(place) if place else {'from': 0, 'to': 0})}


def _period(question: Question, specification: Specification) -> int:
    """Return the time (ns) between two rows, 0: they have none."""
    if specification.policy is not Policy.TIMED:
        return 0
    period = nanoseconds(question.get('period'))
    if period * _steps(question) > _LONGEST:
        raise Refused('a trace lasts at most 100 years: take fewer steps, or less time between '
                      'two rows')
    return period


def _steps(question: Question) -> int:
    steps = int(question['steps'])
    if not 1 <= steps <= MOST_STEPS:
        raise Refused(f'a trace has 1 to {MOST_STEPS:,} steps')
    return steps


def main() -> int:
    """Answer the questions on standard input until it ends."""
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, resource.RLIM_INFINITY))
    questions = Questions(Path(sys.argv[1]))
    out = sys.stdout
    with redirect_stdout(sys.stderr):  # nothing else may get between the answers
        for line in sys.stdin:
            print(json.dumps(questions.answer(json.loads(line))), file=out, flush=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
