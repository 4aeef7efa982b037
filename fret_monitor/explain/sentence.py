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
The fields of a FRETish sentence, and its meaning in plain English.

The English text is composed from scope, condition and timing, like the formula (docs/fretish.md).
An `only` scope applies outside of its mode, and requires the negation of the timing there.
"""

from collections.abc import Iterator
from fractions import Fraction

from fret_monitor.elaboration.durations import SECONDS, TimeScale
from fret_monitor.language.expression import Duration, Expression, Unit
from fret_monitor.language.sentence import (
    ConditionKind, ConditionPhrase, ScopeKind, Sentence, TimingKind,
)
from fret_monitor.model.probability import Probability
from fret_monitor.model.times import time_text

_JOINTS = {'&': 'and', '|': 'or'}

_SCOPES = {
    ScopeKind.GLOBAL: 'at all steps',
    ScopeKind.IN: 'while {m} holds; each such stretch of steps counts by itself',
    ScopeKind.NOT_IN: 'while {m} does not hold; each such stretch of steps counts by itself',
    ScopeKind.BEFORE: 'from the first step to the one before {m} first holds; '
                      'not at all if it holds at once',
    ScopeKind.AFTER: 'from the first step after {m} has held and ended, for good',
    ScopeKind.ONLY_IN: 'while {m} does not hold, and there the response is denied; '
                       'each such stretch of steps counts by itself',
    ScopeKind.ONLY_BEFORE: 'from the step at which {m} first holds, for good, '
                           'and there the response is denied',
    ScopeKind.ONLY_AFTER: 'from the first step until {m} has held and ended, '
                          'and there the response is denied',
}

_TIMINGS = {
    TimingKind.NONE: ('at {t} or a later step, {r} holds',
                      'at {t} and all later steps, {r} does not hold'),
    TimingKind.IMMEDIATELY: ('at {t}, {r} holds', 'at {t}, {r} does not hold'),
    TimingKind.NEXT: ('at the step after {t}, {r} holds',
                      'at the step after {t}, {r} does not hold'),
    TimingKind.FINALLY: ('at the last step, {r} holds', 'at the last step, {r} does not hold'),
    TimingKind.ALWAYS: ('at {t} and all later steps, {r} holds',
                        'at {t} or a later step, {r} does not hold'),
    TimingKind.NEVER: ('at {t} and all later steps, {r} does not hold',
                       'at {t} or a later step, {r} holds'),
    TimingKind.UNTIL: ('at {t} and all later steps before {s} holds, {r} holds',
                       'once {s} holds, {r} has not held at {t} or a later step before that'),
    TimingKind.BEFORE: ('once {s} holds, {r} has held at {t} or a later step before that',
                        'at {t} and all later steps before {s} holds, {r} does not hold'),
    TimingKind.WITHIN: ('at {t} or at most {n} later, {r} holds',
                        'at {t} and up to {n} later, {r} does not hold'),
    TimingKind.FOR: ('at {t} and up to {n} later, {r} holds',
                     'at {t} or at most {n} later, {r} does not hold'),
    TimingKind.AFTER: ('at {t} and up to {n} later, {r} does not hold, and one step later it does',
                       'at {t} or at most {n} later {r} holds, or one step later it does not'),
}
_TIMINGS[TimingKind.EVENTUALLY] = _TIMINGS[TimingKind.NONE]


def fields(sentence: Sentence) -> Iterator[tuple[str, str]]:
    """Yield the name and text of each field of a sentence; `-` for an omitted field."""
    yield 'scope', sentence.scope.span.written if sentence.scope else '-'
    yield 'condition', sentence.condition.span.written if sentence.condition else '-'
    yield 'component', sentence.component.name
    if sentence.probability:
        yield 'with', sentence.probability.span.written.partition(' ')[2]
    yield 'timing', sentence.timing.span.written if sentence.timing else '-'
    yield 'response', _of(sentence.response)


def meaning(sentence: Sentence, scale: TimeScale,
            asked: Probability | None = None) -> Iterator[tuple[str, str]]:
    """Yield scope, trigger and requirement in English, and how a probability is tested."""
    yield 'in force', _scope(sentence, scale)
    yield 'trigger', _trigger(sentence, scale)
    yield 'required', _required(sentence, scale)
    if asked is not None:
        yield 'tested', _tested(sentence, asked)


def _tested(sentence: Sentence, asked: Probability) -> str:
    """Return how often a trigger may fail, and how sure the verdict is."""
    events = 1 - asked.bound if not asked.counts_successes else asked.bound
    share = f'at most {events.numerator:,} of {events.denominator:,}'
    what = 'have its response' if asked.counts_successes else 'be without its response'
    triggers = f'of the triggers, {share} may {what}' if sentence.condition or sentence.scope \
        else f'each run is one trial; of the runs, {share} may {what}'
    return (f'{triggers}; tested at {asked.confidence_text}: refuted or assured whenever the '
            'trials so far show it, and then for good. A trigger that comes while another one '
            'waits for its response is no trial')


def _of_scale(template: str, scale: TimeScale) -> str:
    """Return a text about steps, or about instants under the policy timed."""
    if not scale.is_timed:
        return template
    return template.replace('one step later', 'one nanosecond later').replace(
        'stretch of steps', 'stretch of time').replace('at all steps', 'at all times').replace(
        'step', 'instant')


def _scope(sentence: Sentence, scale: TimeScale) -> str:
    mode = _of(sentence.scope.mode) if sentence.scope else ''
    return _of_scale(_SCOPES[sentence.scope_kind], scale).format(m=mode)


def _trigger(sentence: Sentence, scale: TimeScale) -> str:
    step = _of_scale('step', scale)
    start = f'the first {step} in force' if sentence.scope else f'the first {step}'
    if sentence.condition is None:
        return start
    condition = _condition(sentence.condition)
    if sentence.condition_kind is ConditionKind.HOLDING:
        return f'every {step} at which {condition} holds'
    return f'every {step} at which {condition} comes to hold, or does at {start}'


def _condition(phrase: ConditionPhrase) -> str:
    """Join the qualifiers from left to right, as FRET does."""
    text, joint = '', ''
    for link in phrase.qualifiers:
        part = _of(link.expression)
        part = f'not ({part})' if link.is_negated else part
        if not text:
            text = part
            continue
        text = f'({text})' if joint not in ('', link.joint) else text
        text, joint = f'{text} {_JOINTS[link.joint]} {part}', link.joint
    return text


def _required(sentence: Sentence, scale: TimeScale) -> str:
    kind, timing = sentence.timing_kind, sentence.timing
    template = _of_scale(_TIMINGS[kind][sentence.scope_kind.is_only], scale)
    first = _of_scale('the first step', scale) + (' in force' if sentence.scope else '')
    text = template.format(
        t='the trigger' if sentence.condition else first,
        r=_of(sentence.response),
        s=_of(timing.stop) if timing and timing.stop else '',
        n=_length(timing.duration, scale) if timing and timing.duration else '')
    return f'{text}, as far as it is in force' if sentence.scope else text


def _length(duration: Duration, scale: TimeScale) -> str:
    number, period = Fraction(duration.number), scale.period
    if scale.is_timed:
        return time_text(int(number * SECONDS[duration.unit] * 10 ** 9))
    if period is None or duration.unit is Unit.TICK:
        return _count(number)
    seconds = number * SECONDS[duration.unit]
    return f'{_count(seconds / period)} ({float(seconds):g} s)'


def _count(number: Fraction) -> str:
    shown = f'{number.numerator:,}' if number.denominator == 1 else f'{float(number):g}'
    return f'{shown} step{"" if number == 1 else "s"}'


def _of(expression: Expression) -> str:
    return expression.span.written
