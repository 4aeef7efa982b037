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
Warnings about FRETish sentences that are valid, but may not mean what the user intends.

The cases: a duration in units of time that counts messages, a duration in units of time beside
numbers of steps, and a requirement that reports a violation at every step until it is satisfied.
"""

from collections.abc import Iterator

from fret_monitor.elaboration.durations import approximate, SECONDS
from fret_monitor.elaboration.fretish import is_not_yet
from fret_monitor.elaboration.functions import COUNTING
from fret_monitor.language.expression import Call, Duration, postorder
from fret_monitor.language.sentence import Sentence, TimingKind
from fret_monitor.logic.specification import Specification
from fret_monitor.model.diagnostics import Diagnostic, Level, Span
from fret_monitor.model.policies import Policy, Report

_COUNTED = {
    Policy.EVERY_MESSAGE: ('messages', 'on any mapped topic'),
    Policy.RELEVANT_MESSAGE: ('messages', 'on topics that it reads'),
    Policy.ALL_INPUTS: ('rounds', 'of all inputs'),
}


def doubtful_sentences(specification: Specification) -> Iterator[Diagnostic]:
    """Yield the warnings about the sentences of a bundle."""
    for item in specification.properties:
        if item.sentence is not None:
            yield from _advise(item.sentence, item.report, specification)


def _advise(sentence: Sentence, report: Report,
            specification: Specification) -> Iterator[Diagnostic]:
    yield from sentence.remarks
    duration = sentence.timing.duration if sentence.timing else None
    if duration is not None and duration.unit in SECONDS:
        yield from _about_time(sentence, duration, specification)
    if specification.policy is Policy.TIMED:
        yield from _instants(sentence)
    if report is Report.EVERY_STEP and is_not_yet(sentence):
        demand = sentence.timing or sentence.response
        is_timed = specification.policy is Policy.TIMED
        yield _warning(
            f'this is announced at every {"evaluation" if is_timed else "step"} until it is '
            'fulfilled', demand.span, 'false means "not yet" here',
            'write report: onset to announce it once, or give a deadline, as in within 10 '
            + ('seconds' if is_timed else 'ticks'))


def advise_alone(sentence: Sentence, is_timed: bool = False) -> Iterator[Diagnostic]:
    """Yield the warnings about a sentence without a bundle, and so without a period."""
    yield from sentence.remarks
    if is_timed:
        yield from _instants(sentence)
        return
    duration = sentence.timing.duration if sentence.timing else None
    if duration is not None and duration.unit in SECONDS:
        yield _warning(
            f"'{_amount(duration)}' counts {_amount(duration, 'steps')}",
            duration.span, 'a sentence alone has no period',
            f"write {_amount(duration, 'ticks')}; or, for time, give --policy timed")


def _about_time(sentence: Sentence, duration: Duration,
                specification: Specification) -> Iterator[Diagnostic]:
    written = _amount(duration)
    count = next(_counts(sentence), None)
    policy, period = specification.policy, specification.period
    if policy in _COUNTED:
        noun, which = _COUNTED[policy]
        beside = ', and other counts have no unit' if count else ''
        yield _warning(
            f"'{written}' counts {_amount(duration, noun)} {which}", duration.span,
            f'the policy is {policy.value}{beside}', f"write {_amount(duration, 'ticks')}; or, "
            'for time, policy: timed under evaluation')
    elif count is not None and policy is Policy.PERIODIC:
        length = f' of {approximate(period)} s' if period else ''
        yield _warning(
            f"a count without a unit is used with '{written}'", count, f'counts steps{length}',
            'write both in ticks, or read the bounds that check prints')


def _instants(sentence: Sentence) -> Iterator[Diagnostic]:
    """Yield the warnings about answers that are asked for at exactly one nanosecond."""
    timing = sentence.timing
    if timing is not None and timing.kind is TimingKind.AFTER and timing.duration is not None:
        written = _amount(timing.duration)
        yield _warning(
            f"'after {written}' asks for the answer at exactly one nanosecond", timing.span,
            f'just after {written}, and not before',
            f'write within {written} for an answer until then')
    elif timing is not None and timing.kind is TimingKind.NEXT:
        yield _warning(
            "'at the next timepoint' is one nanosecond later", timing.span,
            'the policy is timed', 'write a time, as in within 100 milliseconds')


def _amount(duration: Duration, nouns: str = '') -> str:
    """Return the number of a duration with its unit, or with another noun in the plural."""
    noun = nouns or duration.unit.value
    return f"{duration.number} {noun.removesuffix('s') if duration.number == '1' else noun}"


def _warning(title: str, span: Span, label: str, help_: str) -> Diagnostic:
    return Diagnostic(title, span, label, help_, Level.WARNING)


def _counts(sentence: Sentence) -> Iterator[Span]:
    """Yield the places of the numbers of steps in `persisted(10, p)` and similar calls."""
    for root in sentence.expressions:
        for node in postorder(root):
            if isinstance(node, Call) and node.function in COUNTING and node.arguments:
                yield node.arguments[0].span
