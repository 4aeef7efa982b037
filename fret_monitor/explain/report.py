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
Explanations of requirements: fields, meaning in English, formula and example traces.

`explain` returns an `Explanation` of one requirement of a bundle or of each. `shown` formats it
as text, `svg.to_svg` draws its timelines.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
import textwrap

from fret_monitor.build import Reading
from fret_monitor.bundle.bundle import Language
from fret_monitor.elaboration.durations import TimeScale
from fret_monitor.elaboration.signals import FindMessage
from fret_monitor.explain import future, sentence as fretish
from fret_monitor.explain.diagram import diagram_of
from fret_monitor.explain.goals import goals, on_one_line, sentences_of
from fret_monitor.explain.in_time import confirmed, verdicts_in_time
from fret_monitor.explain.timeline import drawn, Timeline, timeline, value_lines
from fret_monitor.explain.words import in_words
from fret_monitor.language.expression import Expression
from fret_monitor.language.mltl import parse_mltl
from fret_monitor.language.sentence import Sentence
from fret_monitor.logic.evaluate import evaluate_all
from fret_monitor.logic.formula import Constant, Formula, postorder, Unary, Variable
from fret_monitor.logic.printing import to_smv, Values
from fret_monitor.logic.propositions import propositions
from fret_monitor.logic.specification import Property, Specification
from fret_monitor.model.diagnostics import counted, Diagnostic, did_you_mean, Problems
from fret_monitor.model.progress import no_progress, Progress
from fret_monitor.model.times import known_text, time_text
from fret_monitor.traces.sampled import grid_of, sampled, sampled_formulas
from fret_monitor.traces.search import Budget, Examples, find_examples, Recovery
from fret_monitor.traces.subject import Subject, subjects
from fret_monitor.traces.trace import length, rows_of, Trace

_WIDTH = 99
_FORMULA = 2000
_WORDS = 1200
_MAX_BANDS = 12
_LONGEST_SHOWN = 5_000


@dataclass(frozen=True)
class Explanation:
    """
    The explanation of one requirement.

    `fields` and `meaning` are (name, text) pairs; `fields` is empty unless the property is a
    FRETish sentence. `timelines` are drawings of the examples that were found.
    """

    id: str
    title: str
    text: str
    fields: tuple[tuple[str, str], ...]
    meaning: tuple[tuple[str, str], ...]
    outlook: str
    formula: str
    remarks: tuple[str, ...]
    timelines: tuple[Timeline, ...]


@dataclass(frozen=True)
class Meaning:
    """
    What a requirement means, without examples: `fields`, `meaning` as of an `Explanation`.

    `denial` is the formula that is violated whenever the condition of a FRETish sentence triggers;
    None if there is none.
    """

    fields: tuple[tuple[str, str], ...]
    meaning: tuple[tuple[str, str], ...]
    formula: str
    denial: Formula | None


@dataclass(frozen=True)
class _ReportContext:
    """The data that all requirements of a bundle share."""

    sentences: dict[str, Sentence]
    futures: dict[str, Expression]
    goals: dict[str, list[Formula]]
    values: Values
    names: dict[Formula, str]
    scale: TimeScale
    grids: dict[str, int]

    @property
    def is_timed(self) -> bool:
        return self.scale.is_timed

    def period(self, id: str) -> Fraction | None:
        """Return the seconds of a step in drawings of a requirement."""
        return Fraction(self.grids[id], 10 ** 9) if self.is_timed else self.scale.period


def explain(reading: Reading, ids: Collection[str] = (), progress: Progress = no_progress
            ) -> tuple[list[Explanation], tuple[Diagnostic, ...]]:
    """
    Explain the requirements of a bundle with these ids; without any, all of them.

    `progress` is called before each with the part of them that is done.

    Returns
    -------
    tuple[list[Explanation], tuple[Diagnostic, ...]]
        the explanations in the bundle's order, and the warnings about them.

    Raises
    ------
    CompileError
        if the bundle has no requirement of one of the ids.
    NativeError
        if there is no C compiler, or it fails.
    """
    specification = reading.specification
    chosen = _chosen(specification, ids)
    context = _context(reading, {item.id for item in chosen})
    stepped = chosen
    if context.is_timed:
        stepped, context = _on_grid(chosen, context)
    budget = Budget()
    found = []
    for number, (item, subject) in enumerate(zip(
            chosen, subjects(specification, stepped, context.goals), strict=True)):
        progress(number / len(chosen), item.id)
        found.append(_explanation(item, subject, find_examples(subject, budget), context))
    return found, tuple(warning for warning in reading.warnings
                        if not ids or _concerns(warning, chosen))


def meanings(reading: Reading, find_message: FindMessage | None = None,
             ids: Collection[str] = ()) -> dict[str, Meaning]:
    """Return what requirements mean, by id; arguments as of `build.read` and `explain`."""
    chosen = _chosen(reading.specification, ids)
    context = _context(reading, {item.id for item in chosen}, find_message)
    return {item.id: Meaning(*_meaning(item, context), _formula(item, context),
                             _denial(item, context)) for item in chosen}


def _denial(item: Property, context: _ReportContext) -> Formula | None:
    found = context.goals.get(item.id, [])
    sentence = item.sentence
    if not found or sentence is None or not (sentence.scope or sentence.condition):
        return None
    return found[0].argument if isinstance(found[0], Unary) else None


def _on_grid(chosen: Sequence[Property],
             context: _ReportContext) -> tuple[list[Property], _ReportContext]:
    """Return timed requirements with steps on a grid, of which examples can be found."""
    grids = {item.id: grid_of(item) for item in chosen}
    goals = {}
    for name, found in context.goals.items():
        on_grid = sampled_formulas(found, grids[name])
        goals[name] = [on_grid[goal] for goal in found]
    return [sampled(item, grids[item.id]) for item in chosen], \
        replace(context, grids=grids, goals=goals)


def _concerns(warning: Diagnostic, chosen: Sequence[Property]) -> bool:
    """Whether a warning has its place in one of these requirements, or has no place."""
    span = warning.span
    places = [item.place for item in chosen if item.place]
    return span is None or any(place.source is span.source and place.start <= span.start
                               and span.end <= place.end for place in places)


def _chosen(specification: Specification, ids: Collection[str]) -> Sequence[Property]:
    known = [item.id for item in specification.properties]
    problems = Problems()
    for name in ids:
        if name not in known:
            problems.error(
                f"the bundle has no requirement '{name}'",
                help=did_you_mean(name, known) or 'it has ' + ', '.join(known[:_MAX_BANDS]))
    problems.raise_errors()
    return [item for item in specification.properties if not ids or item.id in ids]


def _context(reading: Reading, chosen: set[str],
             find_message: FindMessage | None = None) -> _ReportContext:
    specification = reading.specification
    bundle = reading.bundle
    sentences = {} if bundle is None else sentences_of(bundle, chosen)
    futures = {} if bundle is None else {
        item.id.value: parse_mltl(on_one_line(item.text)) for item in bundle.requirements
        if item.language is Language.MLTL and item.id.value in chosen}
    return _ReportContext(
        sentences, futures, goals(bundle, sentences, find_message) if bundle else {},
        {signal.name: signal.values for signal in specification.signals if signal.values},
        {formula: name for name, formula in specification.definitions
         if not isinstance(formula, Variable | Constant)},
        TimeScale(specification.policy, specification.period, specification.unit),
        {})


def _explanation(item: Property, subject: Subject, examples: Examples,
                 context: _ReportContext) -> Explanation:
    if context.is_timed:
        examples = confirmed(item, subject, examples, context.grids[item.id])
    fields, meaning = _meaning(item, context)
    return Explanation(
        item.id, item.title, _cut(item.text), fields, meaning, _outlook(examples, context),
        _formula(item, context), tuple(_remarks(subject, examples, context)),
        tuple(_timelines(item, subject, examples, context)))


def _meaning(item: Property, context: _ReportContext) -> tuple[
        tuple[tuple[str, str], ...], tuple[tuple[str, str], ...]]:
    """Return the fields of a FRETish sentence, and what a requirement means."""
    definitions = _definitions(item, context)
    if item.id in context.sentences:
        parts = context.sentences[item.id]
        return tuple(fretish.fields(parts)), (
            *fretish.meaning(parts, context.scale, item.probability), *definitions)
    if item.horizon:
        return (), (
            ('in words', future.in_words(context.futures[item.id], context.scale)),
            ('known', known_text(item.horizon, is_timed=context.is_timed)), *definitions)
    words = in_words(item.formula, _WORDS, context.values, context.names, context.is_timed)
    return (), (('in words', words), *definitions)


def _formula(item: Property, context: _ReportContext) -> str:
    return to_smv(item.formula, _FORMULA, context.values, is_timed=context.is_timed)


def _cut(text: str) -> str:
    return text if len(text) <= _WORDS else text[:_WORDS].rstrip() + ' ...'


def _definitions(item: Property, context: _ReportContext) -> Iterator[tuple[str, str]]:
    """Yield the meaning of each definition that occurs in the formula."""
    inside = set(postorder(item.roots))
    for formula, name in context.names.items():
        if formula in inside and formula is not item.formula:
            inner = {node: other for node, other in context.names.items() if other != name}
            yield name, in_words(formula, _WORDS, context.values, inner, context.is_timed)


def _outlook(examples: Examples, context: _ReportContext) -> str:
    explored = _explored(examples, context)
    match examples.recovery:
        case Recovery.FINAL_BY_FORM:
            return 'final: once false it stays false, whatever follows (by its form)'
        case Recovery.FINAL_BY_STATES:
            return ('final: once false it stays false, whatever follows '
                    f'({explored})')
        case Recovery.POSSIBLE:
            return 'can recover: a false verdict can become true again, as shown below'
        case Recovery.NEVER_FALSE:
            return f'never false ({explored})'
        case Recovery.NONE_FOUND:
            return (f'no recovery found in {_looked(examples)}; this does not prove that none '
                    'exists')


def _explored(examples: Examples, context: _ReportContext) -> str:
    where = ' on the grid' if context.is_timed else ''
    return f'all states explored{where}: {examples.states:,}'


def _remarks(subject: Subject, examples: Examples, context: _ReportContext) -> Iterator[str]:
    for trace, kind in ((examples.satisfying, 'satisfies'), (examples.violating, 'violates')):
        if trace is None and examples.is_proved:
            yield f'No trace {kind} it ({_explored(examples, context)}).'
        elif trace is None:
            yield f'No trace that {kind} it was found in {_looked(examples)}; there may be one.'
    for trace, verb in ((examples.satisfying, 'satisfy it'), (examples.violating, 'violate it'),
                        (examples.recovering, 'let it recover')):
        if trace and _has_nan(trace):
            yield (f'Only a trace with NaN was found to {verb}: a float may be that, and all '
                   'comparisons with it but != are false.')
    if examples.satisfying and not _is_triggered(subject, examples.satisfying):
        yield ('No trace was found in which its condition comes true and the verdict is true: '
               'the satisfying example is trivial.')


def _looked(examples: Examples) -> str:
    return f'{counted(examples.traces, "trace")} and {counted(examples.states, "state")}'


def _has_nan(trace: Trace) -> bool:
    return any(value != value for run in trace for value in run.row)


def _is_triggered(subject: Subject, trace: Trace) -> bool:
    bits, = subject.trials.run([trace])
    return not subject.triggers or bool(bits[-1] & 2)


def _timelines(item: Property, subject: Subject, examples: Examples,
               context: _ReportContext) -> Iterator[Timeline]:
    for trace, kind in ((examples.satisfying, 'satisfies'), (examples.violating, 'violates'),
                        (examples.recovering, 'is false and recovers')):
        if trace is None:
            continue
        extent = _extent(trace, subject.item.id, context)
        title = f'A trace that {kind}: {subject.item.id}, {extent}'
        yield _drawing(item, subject, trace, title, context)


def _extent(trace: Trace, id: str, context: _ReportContext) -> str:
    if not context.is_timed:
        return counted(length(trace), 'step')
    spacing = context.grids[id]
    return f'{time_text(length(trace) * spacing)}, drawn every {time_text(spacing)}'


def _drawing(item: Property, subject: Subject, trace: Trace, title: str,
             context: _ReportContext) -> Timeline:
    bits, = subject.trials.run([trace])
    verdicts = [bool(word & 1) for word in bits]
    shown = subject.propositions[:_MAX_BANDS] if length(trace) <= _LONGEST_SHOWN else ()
    if context.is_timed and shown:
        verdicts = verdicts_in_time(item, subject, trace, context.grids[item.id])
    labels = [to_smv(node, _WIDTH, context.values, context.names, is_timed=context.is_timed)
              for node in _as_written(item, shown)]
    rows = rows_of(trace)
    columns = {signal.name: [row[number] for row in rows]
               for number, signal in enumerate(subject.signals)}
    truths = evaluate_all(shown, columns, subject.item.feedback) if shown else []
    found = timeline(title, labels, [[bool(value) for value in column] for column in truths],
                     verdicts, context.period(subject.item.id),
                     tuple(value_lines(subject.signals, trace,
                                       context.grids.get(subject.item.id),
                                       {node.name for node in shown
                                        if isinstance(node, Variable)})),
                     is_grid=context.grids.get(subject.item.id) is not None)
    diagram = diagram_of(item.formula,
                         lambda node: to_smv(node, _WIDTH, context.values))
    return found if diagram is None else replace(
        found, diagram=diagram.at(columns[diagram.variable][-1]))


def _as_written(item: Property, shown: Sequence[Formula]) -> Sequence[Formula]:
    """Return propositions as the requirement has them, which are perhaps shown on a grid."""
    written = propositions(item)
    return written[:len(shown)] if len(written) >= len(shown) else shown


def as_dict(found: Explanation) -> dict[str, object]:
    """Return an explanation as a JSON object."""
    return {
        'id': found.id, 'title': found.title, 'text': found.text, 'fields': dict(found.fields),
        'meaning': dict(found.meaning), 'if_false': found.outlook, 'formula': found.formula,
        'notes': found.remarks, 'examples': [_timeline_as_dict(line) for line in found.timelines]}


def _timeline_as_dict(line: Timeline) -> dict[str, object]:
    return {
        'title': line.title, 'steps': line.steps,
        'seconds_per_step': None if line.period is None else float(line.period),
        'rows': [{'label': band.label, 'truth': band.truth} for band in line.bands],
        'verdict': line.verdict.truth, 'values': line.values}


def shown(found: Explanation) -> Iterator[str]:
    """Yield the lines of an explanation."""
    yield f'{found.id}: {found.title}' if found.title else found.id
    yield from _entry('property', found.text)
    for name, text in found.fields:
        yield from _entry(f'  {name}', text)
    for name, text in found.meaning:
        yield from _entry(name, text)
    yield from _entry('if false', found.outlook)
    yield from _entry('formula', found.formula)
    for remark in found.remarks:
        yield from _entry('note', remark)
    for line in found.timelines:
        yield ''
        yield f'  {line.title}'
        yield from (f'    {text}' for text in drawn(line))


def _entry(name: str, text: str) -> list[str]:
    return textwrap.wrap(text, _WIDTH, initial_indent=f'  {name:<12} ',
                         subsequent_indent=' ' * 15, break_long_words=False,
                         break_on_hyphens=False) or [f'  {name}']
