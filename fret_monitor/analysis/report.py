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

"""An analysis as text and as JSON, and its runs as drawings and CSV."""

from collections.abc import Iterator
import textwrap

from fret_monitor.analysis.answers import Analysis, Answer, Example, Question
from fret_monitor.analysis.component import output_names
from fret_monitor.analysis.replay import Replay
from fret_monitor.explain.timeline import drawn, timeline, value_lines
from fret_monitor.logic import formula as f
from fret_monitor.logic.evaluate import evaluate_all
from fret_monitor.logic.formula import Formula
from fret_monitor.logic.printing import to_smv
from fret_monitor.logic.propositions import is_pointwise, propositions
from fret_monitor.logic.specification import Specification
from fret_monitor.model.diagnostics import counted, Diagnostic, Level
from fret_monitor.traces.csv_trace import seconds_text, trace_text
from fret_monitor.traces.trace import joined, Run

_WIDTH = 99
_MAX_BANDS = 12
_FEW = 12  # requirements that are all named, and drawn
_WORDS = {True: 'yes', False: 'no', None: 'unknown'}
_HEADINGS = {
    Question.CONSISTENCY: 'consistent',
    Question.RT_CONSISTENCY: 'real-time consistent',
    Question.REALIZABILITY: 'realizable',
    Question.VACUITY: 'vacuous',
    Question.REDUNDANCY: 'redundant',
    Question.REACHABILITY: 'unreached states',
}


def as_dict(found: Analysis) -> dict[str, object]:
    """Return an analysis as a JSON object; null for what is unknown or was not asked."""
    def listed(question: Question, holds: bool | None = True) -> list[str] | None:
        return list(found.listed(question, holds)) if question in found.asked else None

    return {
        'consistent': found.together(Question.CONSISTENCY),
        'rt_consistent': found.together(Question.RT_CONSISTENCY),
        'vacuous': listed(Question.VACUITY),
        'redundant': listed(Question.REDUNDANCY),
        'vacuous_unknown': listed(Question.VACUITY, None),
        'redundant_unknown': listed(Question.REDUNDANCY, None),
        'unreached': listed(Question.REACHABILITY),
        'unreached_unknown': listed(Question.REACHABILITY, None),
        'components': [_component(item) for item in found.of(Question.REALIZABILITY)]
        if Question.REALIZABILITY in found.asked else None,
        'answers': [_answer(item) for item in found.answers],
        'partial': found.is_partial,
        'seconds': round(found.seconds, 3),
    }


def _component(item: Answer) -> dict[str, object]:
    return {'outputs': list(item.outputs), 'requirements': list(item.requirements),
            'realizable': item.holds, 'conflicts': [list(each) for each in item.conflicts]}


def _answer(item: Answer) -> dict[str, object]:
    return {'question': item.question.value, 'requirements': list(item.requirements),
            'answer': item.holds, 'method': item.method, 'reason': item.reason,
            'conflicts': [list(each) for each in item.conflicts],
            'all_conflicts': item.are_all,
            'violated': list(item.example.violated) if item.example else None,
            'notes': list(item.notes)}


def examples(found: Analysis) -> Iterator[tuple[str, Answer, Example]]:
    """Yield the runs, each with a name for its file and its answer."""
    for question in Question:
        answers = found.of(question)
        for number, item in enumerate(answers, 1):
            if item.example is not None:
                name = question.value if len(answers) == 1 else f'{question.value}_{number}'
                yield name, item, item.example


def to_csv(example: Example, specification: Specification) -> str:
    """Return a run in the format of `simulate`; under `timed` with the column `time`."""
    text = trace_text(specification.signals, example.rows)
    if example.grid is None:
        return text
    first, *lines = text.splitlines()
    times = (seconds_text(number * example.grid) for number in range(len(lines)))
    return '\n'.join([f'time,{first}', *(f'{time},{line}' for time, line in zip(times, lines))]
                     ) + '\n'


def shown(found: Analysis, specification: Specification, replay: Replay) -> Iterator[str]:
    """Yield the lines of an analysis; `replay` runs the bundle."""
    for question, heading in _HEADINGS.items():
        if question not in found.asked:
            continue
        answers = found.of(question)
        if question.is_list:
            yield from _of_requirements(heading, answers)
            continue
        yield f'{heading:<22}{_WORDS[found.together(question)]}'
        for item in answers:
            yield from _of_part(item)
            if item.example is not None:
                yield from _drawing(item, item.example, specification, replay)
    if found.is_partial:
        yield 'The analysis was stopped early: what is unknown above may have an answer.'


def warnings(found: Analysis, specification: Specification) -> Iterator[Diagnostic]:
    """Yield a warning at a requirement for each answer that shows a fault."""
    places = {item.id: item.id_place for item in specification.properties}
    for item in found.answers:
        is_list = item.question.is_list
        if item.holds is not is_list:
            continue
        ids = item.conflicts[0] if item.conflicts else item.requirements
        what = f'{ids[0]} is' if len(ids) == 1 else f'{", ".join(ids[:4])} are'
        negated = '' if is_list else 'not '
        title = f'{ids[0]} has states that no run reaches' \
            if item.question is Question.REACHABILITY else \
            f'{what} {negated}{_HEADINGS[item.question]}'
        yield Diagnostic(title, places[ids[0]],
                         item.method, '`fret-monitor analyze` shows more', Level.WARNING)


def assumption_warnings(specification: Specification) -> Iterator[Diagnostic]:
    """Yield a warning at each assumption that reads outputs of the same step."""
    outputs = output_names(specification)
    for item in specification.properties:
        names = sorted(_read_now(item.formula) & outputs) if item.is_assumption else []
        if names:
            yield Diagnostic(
                f'the assumption {item.id} reads {", ".join(names)} of the same step, '
                'which the system sets', item.id_place, 'the system may not break it',
                'an assumption is about what the environment sets: '
                f'inputs, and earlier outputs (Y {names[0]})', Level.WARNING)


def _read_now(root: Formula) -> set[str]:
    """Return the names of the inputs whose value of the same step matters to a formula."""
    found: dict[Formula, set[str]] = {}
    for node in f.postorder([root]):
        match node:
            case f.Variable(name):
                found[node] = {name}
            case f.Yesterday() | f.WeakYesterday():
                found[node] = set()
            case f.Previous(initial):
                found[node] = found[initial]
            case f.Once(window) | f.Historically(window) if window.low > 0:
                found[node] = set()
            case f.Since(window, left) | f.Triggered(window, left) if window.low > 0:
                found[node] = found[left]
            case _:
                found[node] = set().union(*(found[item] for item in f.operands(node)))
    return found[root]


def _of_requirements(heading: str, answers: list[Answer]) -> Iterator[str]:
    names = [item.requirements[0] for item in answers if item.holds]
    unknown = [item for item in answers if item.holds is None]
    yield from _wrapped(f'{heading:<22}', ', '.join(names) if names else
                        'unknown' if unknown and len(unknown) == len(answers) else 'none')
    for item in answers:
        if item.holds:
            yield from _wrapped(f'  {item.requirements[0]}: ', item.method)
        for note in item.notes:
            yield from _wrapped(f'  {item.requirements[0]}: ', note)
    reasons: dict[str, list[str]] = {}
    for item in unknown:
        reasons.setdefault(item.reason, []).append(item.requirements[0])
    for reason, ids in reasons.items():
        yield from _wrapped('  unknown: ', f'{", ".join(ids)} ({reason})')


def _of_part(item: Answer) -> Iterator[str]:
    what = ', '.join(item.outputs) + ': ' if item.outputs else ''
    ids = ', '.join(item.requirements) if len(item.requirements) <= _FEW else \
        counted(len(item.requirements), 'requirement')
    yield from _wrapped(f'  {_WORDS[item.holds]:<9}',
                        f'{what}{ids} ({item.method or item.reason})')
    for conflict in item.conflicts:
        yield from _wrapped('    conflict: ', ', '.join(conflict))
    if item.conflicts and not item.are_all:
        yield '    there may be more conflicts'


def _wrapped(start: str, text: str) -> list[str]:
    return textwrap.wrap(text, _WIDTH, initial_indent=start, subsequent_indent=' ' * len(start),
                         break_long_words=False, break_on_hyphens=False) or [start.rstrip()]


def _near(ids: set[str], item: Answer, specification: Specification) -> set[str]:
    """Return all requirements of an answer; of many, those that share inputs with some."""
    if len(item.requirements) <= _FEW:
        return set(item.requirements)
    read = {name for each in specification.properties if each.id in ids for name in each.inputs}
    return {each.id for each in specification.properties
            if each.id in item.requirements and read.intersection(each.inputs)}


def _drawing(item: Answer, example: Example, specification: Specification,
             replay: Replay) -> Iterator[str]:
    concerned = set(example.violated) | {name for each in item.conflicts for name in each}
    if item.question is Question.RT_CONSISTENCY:  # what leads to the dead end
        concerned = _near(concerned, item, specification)
    chosen = [each for each in specification.properties
              if each.id in (concerned or item.requirements)]
    read = {name for each in chosen for name in each.inputs}
    signals = [each for each in specification.signals if each.name in read]
    places = [number for number, each in enumerate(specification.signals) if each.name in read]
    shown_nodes = list(dict.fromkeys(
        node for each in chosen for node in propositions(each) if is_pointwise(node)))[:_MAX_BANDS]
    columns = {signal.name: [row[place] for row in example.rows]
               for signal, place in zip(signals, places, strict=True)}
    truths = evaluate_all(shown_nodes, columns) if shown_nodes else []
    names = {signal.name: signal.values for signal in signals if signal.values}
    judged = [number for number, each in enumerate(specification.properties) if each in chosen]
    *_, last = replay(example.rows, example.grid or 1)
    verdicts = [True] * (len(example.rows) - 1) + [all(last[number] for number in judged)]
    trace = joined(Run(tuple(row[place] for place in places), 1) for row in example.rows)
    picture = timeline(
        '', [to_smv(node, _WIDTH, names) for node in shown_nodes],
        [[bool(value) for value in column] for column in truths], verdicts, None,
        tuple(value_lines(signals, trace, example.grid)))
    violated = ', '.join(example.violated)
    end = 'the environment can keep one from being fulfilled' \
        if item.question is Question.REALIZABILITY else 'not all can be fulfilled'
    yield '    ' + (f'a run at whose end {violated} '
                    f'{"is" if len(example.violated) == 1 else "are"} violated'
                    if violated else f'a run after which {end}')
    yield from (f'      {line}' for line in drawn(picture))
