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
Variants of FRETish sentences: the same scope and condition with another timing.

Where a sentence and a variant of it disagree, the timing decides. So a trace that satisfies
`within 10 ticks` and violates `within 9 ticks` has its response at the last moment.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from fret_monitor.bundle.bundle import Bundle, Language, Requirement
from fret_monitor.elaboration.durations import TimeScale
from fret_monitor.elaboration.elaborate import specify
from fret_monitor.elaboration.signals import FindMessage
from fret_monitor.explain.goals import written
from fret_monitor.language.fretish import parse_fretish
from fret_monitor.language.sentence import ConditionKind, Sentence, TimingKind
from fret_monitor.logic.formula import Feedback, Formula
from fret_monitor.model.diagnostics import CompileError, Problems, Source, Text
from fret_monitor.traces.csv_trace import seconds_text

TRIGGERED, STOPPED = 'triggered', 'stopped'  # violated once the condition, or the stop, occurs
IMMEDIATELY, NEVER, SHORTER, LONGER = 'immediately', 'never', 'shorter', 'longer'
OTHERWISE = 'otherwise'  # `whenever` in place of `upon`, and the other way round

_WITHOUT_FIRST = frozenset({TimingKind.IMMEDIATELY, TimingKind.AFTER, TimingKind.FINALLY,
                            TimingKind.NEXT})


@dataclass(frozen=True)
class Variants:
    """The formulas of the variants of a sentence, by name, and the equations of their feedback."""

    sentence: Sentence
    formulas: Mapping[str, Formula]
    feedback: tuple[tuple[Feedback, Formula], ...]


def variants(bundle: Bundle, delta: Mapping[str, int],
             find_message: FindMessage | None = None) -> dict[str, Variants]:
    """
    Return the variants of the FRETish requirements, by id.

    `delta` is, by id, by how many steps (under `timed`, nanoseconds) a duration differs.
    """
    scale = TimeScale(bundle.policy, bundle.period, bundle.unit)
    sentences = {
        item.id.value: parse_fretish(Text.whole(
            Source('<sentence>', ' '.join(item.text.value.split()))))
        for item in bundle.requirements
        if item.language is Language.FRETISH and item.id.value in delta}
    wanted = [(item, name, text) for item in bundle.requirements if item.id.value in sentences
              for name, text in _texts(sentences[item.id.value], scale, delta[item.id.value])]
    found: dict[str, Variants] = {
        name: Variants(sentence, {}, ()) for name, sentence in sentences.items()}
    for (item, name, _), made in zip(wanted, _specified(bundle, wanted, find_message),
                                     strict=True):
        if made is not None:
            known = found[item.id.value]
            found[item.id.value] = Variants(
                known.sentence, {**known.formulas, name: made[0]},
                tuple({**dict(known.feedback), **dict(made[1])}.items()))
    return found


_Made = tuple[Formula, tuple[tuple[Feedback, Formula], ...]] | None


def _specified(bundle: Bundle, wanted: Sequence[tuple[Requirement, str, str]],
               find_message: FindMessage | None) -> list[_Made]:
    """Return the formula of each text; None where there is none, as for a duration too long."""
    requirements = tuple(replace(item, text=Text.whole(Source('<variant>', text)))
                         for item, _, text in wanted)
    try:
        meant, _ = specify(replace(bundle, requirements=requirements), find_message,
                           problems=Problems())
    except CompileError:
        if len(wanted) <= 1:
            return [None] * len(wanted)
        half = len(wanted) // 2
        return [*_specified(bundle, wanted[:half], find_message),
                *_specified(bundle, wanted[half:], find_message)]
    return [(item.formula, item.feedback) for item in meant.properties]


def _texts(sentence: Sentence, scale: TimeScale, delta: int) -> Iterator[tuple[str, str]]:
    """Yield the name and the text of each variant."""
    is_only = sentence.scope_kind.is_only
    start = ' '.join(written(part.span) for part in (sentence.scope, sentence.condition) if part)
    shall = f'{start} {sentence.component.name} shall'
    response = f'satisfy ({written(sentence.response.span)})'
    timing = sentence.timing
    condition = sentence.condition
    if condition is not None and len(condition.qualifiers) == 1:
        scope = written(sentence.scope.span) if sentence.scope else ''
        word = 'upon' if condition.kind is ConditionKind.HOLDING else 'whenever'
        link, = condition.qualifiers
        negation = '!' if link.is_negated else ''
        yield OTHERWISE, (
            f'{scope} {word} {negation}({written(link.expression.span)}) '
            f'{sentence.component.name} shall {written(timing.span) if timing else ""} {response}')
    if start:
        yield TRIGGERED, f'{shall} immediately satisfy {"TRUE" if is_only else "FALSE"}'
    if timing is not None and timing.stop is not None:
        yield STOPPED, (f'{shall} {"eventually" if is_only else "never"} '
                        f'satisfy ({written(timing.stop.span)})')
    if not is_only and sentence.timing_kind not in _WITHOUT_FIRST:
        is_never = sentence.timing_kind is TimingKind.NEVER
        yield IMMEDIATELY, (f'{shall} immediately satisfy '
                            f'{"!" if is_never else ""}({written(sentence.response.span)})')
    if timing is None or timing.duration is None:
        return
    if not is_only:
        yield NEVER, f'{shall} never {response}'
    count = scale.timing(timing.duration)
    if count > delta:
        yield SHORTER, f'{shall} {timing.kind.value} {_long(count - delta, scale)} {response}'
    yield LONGER, f'{shall} {timing.kind.value} {_long(count + delta, scale)} {response}'


def _long(count: int, scale: TimeScale) -> str:
    """Return a duration as text."""
    return f'{seconds_text(count)} seconds' if scale.is_timed else f'{count} ticks'
