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
The formula of a FRETish sentence, composed from its scope, condition and timing as in FRET.

The scope defines the intervals in which the sentence applies (`_Interval`). The condition defines
the trigger, the steps from which the timing counts. The timing defines the base formula, which
must hold at the steps of an interval. For most timings the base must hold at every step of every
interval: `H (inside -> base)`. For `eventually` and `finally` it must hold at the last step of
every past interval, and at the current step if an interval is open; a false verdict then means
"not yet".

An `only` scope applies outside of its mode, and requires there the negation of the sentence. So
`only in m shall the sw eventually satisfy r` requires that r never holds outside of m, and with
`always`, that r is false there at some step.

Sources: D. Giannakopoulou et al., 'Formal Requirements Elicitation with FRET' (REFSQ 2020) and
'Automated Formalization of Structured Natural Language Requirements' (IST 137, 2021). Intervals
are [left, right) there; formulas are equivalent to FRET's, and mostly shorter.
"""

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

from fret_monitor.elaboration.durations import STEPS, TimeScale
from fret_monitor.elaboration.elaborator import Elaborator
from fret_monitor.elaboration.scope import Scope
from fret_monitor.elaboration.terms import Broken, expect_bool, joined_bounds, TypedTerm
from fret_monitor.language.expression import Expression, Name
from fret_monitor.language.fretish_words import WORDS
from fret_monitor.language.sentence import (
    ConditionKind, ScopeKind, ScopePhrase, Sentence, TimingKind,
)
from fret_monitor.logic.formula import (
    ALWAYS, Binary, BinaryOperator, FALSE, Formula, FTP, Historically, NotRefuted, Once, Since,
    Trial, TRUE, Unary, UnaryOperator, WeakYesterday, Window, Yesterday,
)
from fret_monitor.model.diagnostics import CompileError, Problems
from fret_monitor.model.probability import Probability, USUAL_CONFIDENCE


def sentence_term(sentence: Sentence, scope: Scope, problems: Problems, scale: TimeScale = STEPS,
                  confidence: Fraction = USUAL_CONFIDENCE) -> TypedTerm:
    """
    Return the term of a sentence; report mistakes to the problems.

    `scale` says what durations and counts mean; the default counts steps, as in FRET. With a
    probability, `confidence` is how sure the verdict has to be.
    """
    return _Formalisation(sentence, scope, problems, scale, confidence).term()


def probability_of(sentence: Sentence, confidence: Fraction) -> Probability | None:
    """Return what a sentence with a probability asks for; None of one without."""
    phrase = sentence.probability
    return None if phrase is None else Probability(phrase.relation, phrase.bound, confidence)


def is_not_yet(sentence: Sentence) -> bool:
    """
    Whether a false verdict means "not yet": it can still become true.

    This holds for `eventually`, `finally` and no timing; with an `only` scope, for `always`,
    `never` and `finally`. All other sentences stay false, and those with a probability.
    """
    timing, _ = _meant(sentence)
    return sentence.probability is None and timing in (TimingKind.EVENTUALLY, TimingKind.FINALLY)


# The dual of each timing: an `only` scope requires the dual, of the negated response.
_NEGATED = {
    TimingKind.EVENTUALLY: TimingKind.ALWAYS,
    TimingKind.ALWAYS: TimingKind.EVENTUALLY,
    TimingKind.UNTIL: TimingKind.BEFORE,
    TimingKind.BEFORE: TimingKind.UNTIL,
    TimingKind.WITHIN: TimingKind.FOR,
    TimingKind.FOR: TimingKind.WITHIN,
}


def has_deadline(sentence: Sentence) -> bool:
    """Whether a response has to come within a time: `within`; with an `only` scope, `for`."""
    timing, _ = _meant(sentence)
    return sentence.probability is None and timing is TimingKind.WITHIN


def required_so_far(formula: Formula) -> Formula:
    """Return what the formula of a sentence with `eventually` requires of the present interval."""
    match formula:
        case Binary(BinaryOperator.AND, _, now):
            return now
        case _:
            return formula


def _meant(sentence: Sentence) -> tuple[TimingKind, bool]:
    """Return the timing required in the intervals, and whether the response is negated."""
    timing = sentence.timing_kind
    is_negated = False
    if timing is TimingKind.NONE:
        timing = TimingKind.EVENTUALLY
    if timing is TimingKind.NEVER:
        timing, is_negated = TimingKind.ALWAYS, True
    if sentence.scope_kind.is_only:
        timing, is_negated = _NEGATED.get(timing, timing), not is_negated
    return timing, is_negated


_SCOPE_WORDS = {
    ScopeKind.IN: 'while', ScopeKind.NOT_IN: 'except while', ScopeKind.ONLY_IN: 'only while',
    ScopeKind.BEFORE: 'before', ScopeKind.AFTER: 'after',
    ScopeKind.ONLY_BEFORE: 'only before', ScopeKind.ONLY_AFTER: 'only after',
}


def _check_trials(sentence: Sentence, timing: TimingKind, has_end: bool, scale: TimeScale,
                  problems: Problems) -> None:
    """Report a sentence with a probability whose trials are not decided, or never end to begin."""
    phrase = sentence.probability
    assert phrase is not None
    place = sentence.timing.span if sentence.timing else phrase.span
    if not has_end and timing in (TimingKind.ALWAYS, TimingKind.EVENTUALLY, TimingKind.FINALLY):
        reason = 'a trial would be decided at the end of the run' \
            if timing is TimingKind.FINALLY else 'a trial would be decided ' + (
                'only by failing' if timing is TimingKind.ALWAYS else 'only by succeeding')
        problems.error(
            'the trials of this probability have no end', place, f'{reason}: its scope has no end',
            'give it a time: within 2 seconds, for 2 seconds; or a scope that ends: in m mode')
    if scale.is_timed and sentence.condition is not None and \
            sentence.condition_kind is ConditionKind.HOLDING:
        problems.error(
            'under policy timed, whenever would begin a trial each nanosecond',
            sentence.condition.span, 'each step at which this holds is a trigger',
            'write upon or when: a trial begins where it becomes true; or policy: periodic')


class _Formalisation:
    """The formalisation of one sentence."""

    def __init__(self, sentence: Sentence, scope: Scope, problems: Problems,
                 scale: TimeScale, confidence: Fraction) -> None:
        self._sentence = sentence
        self._probability = probability_of(sentence, confidence)
        self._problems = problems
        self._scale = scale
        self._bounds: frozenset[int] = frozenset()
        # No left end: FRET does not limit how far the scope's own expression looks back.
        mode: Formula | None = TRUE
        if sentence.scope is not None:
            outside = Elaborator(scope, problems, left=None, scale=scale)
            mode = None if self._is_value(sentence.scope, scope) else self._truth(
                outside, sentence.scope.mode, 'a scope')
        self._mode = mode
        self._interval = _interval(sentence.scope_kind, mode or TRUE)
        self._elaborator = Elaborator(scope, problems, left=self._interval.left, scale=scale)

    def term(self) -> TypedTerm:
        """Return the formula; elaborates every part, so that all mistakes are reported."""
        sentence = self._sentence
        condition, stop, steps = self._condition(), self._stop(), self._steps()
        response = self._truth(self._elaborator, sentence.response, "'satisfy'")
        if self._mode is None or condition is None or stop is None or steps is None or (
                response is None):
            return TypedTerm(Broken(), sentence.span)
        base = _Timed(self._interval, condition, sentence.condition_kind, stop, steps)
        timing, is_negated = _meant(sentence)
        due = _not(response) if is_negated else response
        if self._probability is not None:
            _check_trials(sentence, timing, self._interval.right is not None, self._scale,
                          self._problems)
            formula = _tested(base.trial(timing, due, sentence.scope_kind.is_only),
                              self._probability)
        else:
            formula = base.formula(timing, due, sentence.scope_kind.is_only)
        return TypedTerm(formula, sentence.span, bounds=joined_bounds(self._bounds, (steps,)))

    def _is_value(self, phrase: ScopePhrase, scope: Scope) -> bool:
        """Report a mode that is the name of a value; return whether it is."""
        mode = phrase.mode
        if not isinstance(mode, Name) or scope.find(mode.text) or mode.text not in scope.owners:
            return False
        owner = scope.owners[mode.text][0]
        name = f'"{owner}"' if owner.lower() in WORDS else owner
        compared = f'{_SCOPE_WORDS[phrase.kind]} {name} = {mode.text}'
        self._problems.error(
            f"'{mode.text}' is a value of '{owner}', not a mode", mode.span,
            'expected true or false',
            f'write {compared}; or give the mode a name: definitions: '
            f'{{{mode.text.lower()}_mode: {owner} = {mode.text}}}')
        return True

    def _truth(self, elaborator: Elaborator, expression: Expression, operator: str,
               ) -> Formula | None:
        """Return the formula of a part that must be Boolean, or None if it has a mistake."""
        term = elaborator.term(expression)
        if term.is_broken:
            return None
        self._bounds = joined_bounds(self._bounds, term.bounds)
        try:
            return expect_bool(term, operator)
        except CompileError as error:
            self._problems.extend(error.diagnostics)
            return None

    def _condition(self) -> Formula | None:
        phrase = self._sentence.condition
        if phrase is None:
            return TRUE
        word = phrase.qualifiers[0].word
        return self._truth(self._elaborator, phrase.expression, f"'{word}'")

    def _stop(self) -> Formula | None:
        timing = self._sentence.timing
        if timing is None or timing.stop is None:
            return TRUE
        return self._truth(self._elaborator, timing.stop, f"'{timing.kind.value}'")

    def _steps(self) -> int | None:
        timing = self._sentence.timing
        if timing is None or timing.duration is None:
            return 0
        try:
            return self._scale.timing(timing.duration)
        except CompileError as error:
            self._problems.extend(error.diagnostics)
            return None


# Scopes

@dataclass(frozen=True, eq=False)
class _Interval:
    """
    Intervals of steps [left, right), from a step where `left` holds to the next `right`.

    `inside` holds at the steps of an interval. `right` is None if intervals last to the end of the
    trace.
    """

    left: Formula
    right: Formula | None
    inside: Formula


def _interval(kind: ScopeKind, mode: Formula) -> _Interval:
    out = _not(mode)
    enters, leaves = _and(mode, WeakYesterday(out)), _and(out, Yesterday(mode))
    first_entry = _and(mode, WeakYesterday(Historically(ALWAYS, out)))
    first_leave = _and(leaves, Yesterday(Historically(ALWAYS, _not(leaves))))
    match kind:
        case ScopeKind.GLOBAL:
            return _Interval(FTP, None, TRUE)
        case ScopeKind.IN:
            return _Interval(enters, leaves, mode)
        case ScopeKind.NOT_IN | ScopeKind.ONLY_IN:
            return _Interval(_and(out, WeakYesterday(mode)), _and(mode, Yesterday(out)), out)
        case ScopeKind.BEFORE:
            return _Interval(FTP, first_entry, Historically(ALWAYS, out))
        case ScopeKind.AFTER:
            return _Interval(first_leave, None, Once(ALWAYS, leaves))
        case ScopeKind.ONLY_BEFORE:
            return _Interval(first_entry, None, Once(ALWAYS, mode))
        case ScopeKind.ONLY_AFTER:
            return _Interval(FTP, first_leave, Historically(ALWAYS, _not(leaves)))


# Timings

@dataclass(frozen=True, eq=False)
class _Timed:
    """The parameters of a timing; `stop` is TRUE if there is none."""

    interval: _Interval
    condition: Formula
    condition_kind: ConditionKind
    stop: Formula
    steps: int

    def formula(self, timing: TimingKind, response: Formula, is_only: bool) -> Formula:
        """Return the formula of the sentence; `response` is already negated if required."""
        if timing in (TimingKind.EVENTUALLY, TimingKind.FINALLY):
            return self._at_the_end(self._unless_idle(
                response if timing is TimingKind.FINALLY else self._once(response)))
        invariant: Callable[[Formula], Formula] = {
            TimingKind.IMMEDIATELY: self._immediately,
            TimingKind.NEXT: self._next,
            TimingKind.ALWAYS: self._unless_idle,
            TimingKind.UNTIL: self._until,
            TimingKind.BEFORE: self._before,
            TimingKind.WITHIN: lambda response: self._within(response, self.steps),
            TimingKind.FOR: self._for,
            TimingKind.AFTER: self._not_after if is_only else self._after,
        }[timing]
        base = invariant(response)
        inside = self.interval.inside
        return Historically(ALWAYS, base if inside is TRUE else _implies(inside, base))

    def trial(self, timing: TimingKind, response: Formula, is_only: bool) -> Trial:
        """
        Return the trial that each trigger begins; parameters as of `formula`.

        FRET has in words what the response to a trigger is, for each of its templates; where the
        interval ends earlier, it need not come, but for `eventually` and `finally`.
        """
        never, denied, last = FALSE, _not(response), self.steps
        rules: dict[TimingKind, tuple[int | None, Formula, Formula, Formula]] = {
            TimingKind.IMMEDIATELY: (0, never, never, TRUE),
            TimingKind.NEXT: (1, never, never, TRUE),
            TimingKind.ALWAYS: (None, never, denied, TRUE),
            TimingKind.EVENTUALLY: (None, response, never, FALSE),
            TimingKind.FINALLY: (None, never, never, Yesterday(response)),
            TimingKind.UNTIL: (None, self.stop, _and(_not(self.stop), denied), TRUE),
            TimingKind.BEFORE: (None, _and(_not(self.stop), response), self.stop, TRUE),
            TimingKind.WITHIN: (last, response, never, TRUE),
            TimingKind.FOR: (last, never, denied, TRUE),
            TimingKind.AFTER: (last + 1, denied, never, TRUE) if is_only
            else (last + 1, never, response, TRUE),
        }
        due, good, bad, good_at_end = rules[timing]
        inside = self.interval.inside
        begins = self._trigger if inside is TRUE else _and(self._trigger, inside)
        return Trial(due, begins, good, bad, TRUE if due is None else response,
                     FALSE if self.interval.right is None else _not(inside), good_at_end)

    def _at_the_end(self, base: Formula) -> Formula:
        """Require a base at the last step of past intervals, and now if an interval is open."""
        interval = self.interval
        now = base if interval.inside is TRUE else _implies(interval.inside, base)
        if interval.right is None:
            return now
        # Z, not Y: an interval that ends at the first step is empty.
        past = Historically(ALWAYS, _implies(interval.right, WeakYesterday(base)))
        return _and(past, now)

    # Events since the start of the interval

    @property
    def _has_condition(self) -> bool:
        return self.condition_kind is not ConditionKind.NONE

    @property
    def _trigger(self) -> Formula:
        """Where the timing starts: at the condition's rising edge, while it holds, or at left."""
        match self.condition_kind:
            case ConditionKind.NONE:
                return self.interval.left
            case ConditionKind.HOLDING:
                return self.condition
            case ConditionKind.REGULAR:
                was_off = _not(self.condition)
                if self.interval.left is FTP:
                    return _and(self.condition, WeakYesterday(was_off))
                return _and(self.condition, _or(Yesterday(was_off), self.interval.left))

    def _unless_idle(self, demand: Formula) -> Formula:
        """Require something only after the condition has held in this interval."""
        if not self._has_condition:
            return demand
        return _or(_since(_not(self.condition), self.interval.left), demand)

    def _once(self, event: Formula) -> Formula:
        """Whether an event has occurred since the last trigger."""
        if self._trigger is FTP:
            return Once(ALWAYS, event)
        return _not(_since(_not(event), self._trigger))

    # Bases that must hold at every step

    def _immediately(self, response: Formula) -> Formula:
        return _implies(self._trigger, response)

    def _next(self, response: Formula) -> Formula:
        due = _or(response, self.interval.left) if self._has_condition else response
        return _implies(Yesterday(self._trigger), due)

    def _until(self, response: Formula) -> Formula:
        return self._unless_idle(_implies(_since(_not(self.stop), self._trigger), response))

    def _before(self, response: Formula) -> Formula:
        earlier: Formula = Yesterday(self._once(response))
        if self._has_condition:
            earlier = _and(_not(self._trigger), earlier)
        if self.interval.left is not FTP:
            earlier = _and(_not(self.interval.left), earlier)
        return _implies(self.stop, self._unless_idle(earlier))

    def _within(self, response: Formula, steps: int) -> Formula:
        recent, left = Window(0, steps - 1), self.interval.left
        if not self._has_condition:
            return _implies(_since(_not(response), left), Once(recent, left))
        missed = Once(Window(steps, steps), _and(self._trigger, _not(response)))
        return _implies(missed, Once(recent, _or(left, response)))

    def _for(self, response: Formula) -> Formula:
        lasting = Once(Window(0, self.steps), self._trigger)
        return _implies(lasting, self._unless_idle(response))

    def _after(self, response: Formula) -> Formula:
        return _and(self._for(_not(response)), self._within(response, self.steps + 1))

    def _not_after(self, denial: Formula) -> Formula:
        """Require `denial` n + 1 steps after the trigger, unless the response came earlier."""
        recent = Window(0, self.steps)
        due = Once(Window(self.steps + 1, self.steps + 1), self._trigger)
        came_before = Yesterday(Once(recent, _not(denial)))
        return _implies(due, _or(_or(Once(recent, self.interval.left), denial), came_before))


def _tested(trial: Trial, asked: Probability) -> Formula:
    """Return the test of a trial's outcomes; failures are events, or successes of `<`."""
    outcome: Formula = Unary(UnaryOperator.NEG, trial) if asked.counts_successes else trial
    return NotRefuted(outcome, asked.allowed, asked.rest, asked.limit)


# Connectives

def _since(held: Formula, start: Formula) -> Formula:
    """Whether `held` holds at every step from the last start on; FRET's `held SI start`."""
    if start is FTP:
        return Historically(ALWAYS, held)
    return Since(ALWAYS, held, _and(held, start))


def _not(formula: Formula) -> Formula:
    if isinstance(formula, Unary) and formula.operator is UnaryOperator.NOT:
        return formula.argument
    return Unary(UnaryOperator.NOT, formula)


def _and(left: Formula, right: Formula) -> Formula:
    return Binary(BinaryOperator.AND, left, right)


def _or(left: Formula, right: Formula) -> Formula:
    return Binary(BinaryOperator.OR, left, right)


def _implies(left: Formula, right: Formula) -> Formula:
    return Binary(BinaryOperator.IMPLIES, left, right)
