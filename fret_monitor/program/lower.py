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
Translate a specification into a monitor program.

Requirements that read the same inputs form a step group. Within a group, terms that are equal up
to Boolean negation and the order of the operands of `& | xor <-> =` share one equation. Each
Boolean term is looked up by a key without a negation at its top: `H p` is looked up as the
negation of `O !p`, `p | q` as that of `!p & !q`. The equation keeps the operator that occurred
first, so that the C resembles the formula. A negated comparison is never inverted: for NaN,
`!(x > 5)` is true and `x <= 5` is false.

Windows are reduced to a few cells (n = b - a):
    O[a,b] p   = O[0,n] (p, a steps ago)
    p S[a,b] q = p S[0,n] ((q, a steps ago) & H[0,a-1] p)
H and T are reduced to the duals of these.

FRET's patterns around the first time point (FTP) are simplified:
    p & (q | r)                for (p & q) | (p & r)       (its triggers)
    Z p                        for Y p | FTP
    O[0,b] p with another initial count   for O[0,b] (FTP | p)
    H[0,b] p with another initial count   for H[0,b] p & H[0,m] !FTP, m <= b   (its persisted)

`rewriting.py` has removed the queues of FRET's deadlines before.

Groups that step at ticks (the policy `timed`) have other cells for windows that begin before now:
queues of intervals, since the ticks between two steps are too many for a bit each.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import ceil
from typing import assert_never, TypeAlias

from fret_monitor.logic.formula import (
    Aggregate, Ago, Binary, BinaryOperator, Choice, Constant, Conversion, Feedback, Formula, Held,
    Historically, MessageSlope, NotRefuted, Once, Over, postorder, Previous, Since,
    Slope, TimeOver, Trial, Triggered, Unary, UnaryOperator, Variable, variables, WeakYesterday,
    Window, Yesterday,
)
from fret_monitor.logic.formula import operands as operands_of
from fret_monitor.logic.specification import Signal, Specification
from fret_monitor.model.policies import InputSource, Policy, Report
from fret_monitor.model.times import NANOSECONDS
from fret_monitor.model.values import ValueType
from fret_monitor.program.margins import MarginBuilder
from fret_monitor.program.monitor_program import (
    AlwaysSoFar, AlwaysWithin, ApplyBinary, ApplyUnary, Choose, Convert, Delay, Equation,
    FALSE, FeedbackEquation, FeedbackRead, FirstStep, Greatest, Hold, Literal, MonitorProgram,
    OnceBefore, OnceEver, OnceWithin, Operand, operands, Operation, OutcomesTest, Overflowed,
    Power, PreviousNumber, Pure, Read, Room, room_of, Rounded, SinceBefore, SinceBetween,
    SinceEver, SinceWithin, SlopeBetween, StepGroup, Tally, TimeAtLeast, Total, TrialOutcome,
    TriggeredEver, TRUE, ValueAgo,
)
from fret_monitor.program.prune import prune
from fret_monitor.program.rewriting import slope_by_times, without_queues

_BOOL = ValueType.BOOL
_FACTORING_DEPTH = 8  # `b | c` may have a common factor again
_LAST = Window(1, 1)
_SHORT_QUEUE = 16  # ticks that a queue covers without a rate
_Windowed: TypeAlias = Once | Historically | Since | Triggered
_TURNED = {BinaryOperator.GT: BinaryOperator.LT, BinaryOperator.GE: BinaryOperator.LE}


def lower(specification: Specification) -> MonitorProgram:
    """Return the program; the groups are in the order of their first requirements."""
    index = {signal.name: i for i, signal in enumerate(specification.signals)}
    groups: dict[tuple[int, ...], list[int]] = {}
    for number, item in enumerate(specification.properties):
        signals = tuple(sorted(index[name] for name in item.inputs))
        groups.setdefault(signals, []).append(number)
    return MonitorProgram(
        specification.name,
        specification.component,
        specification.policy,
        None if specification.period is None else float(specification.period),
        specification.signals,
        specification.properties,
        tuple(_lower_group(signals, numbers, specification, index)
              for signals, numbers in groups.items()),
        specification.definitions,
        specification.stamp,
        specification.reorder,
    )


def lower_together(specification: Specification) -> StepGroup:
    """Return one group of all requirements, whatever inputs they read."""
    index = {signal.name: i for i, signal in enumerate(specification.signals)}
    return _lower_group(tuple(index.values()), list(range(len(specification.properties))),
                        specification, index)


def _lower_group(signals: tuple[int, ...], numbers: list[int], specification: Specification,
                 index: dict[str, int]) -> StepGroup:
    properties = [specification.properties[number] for number in numbers]
    feedback = {node: equation for item in properties for node, equation in item.feedback}
    simpler = without_queues([root for item in properties for root in item.roots])
    is_timed = specification.policy is Policy.TIMED
    builder = _GroupBuilder(index, {node: i for i, node in enumerate(feedback)},
                            _Rates(specification.signals, index, feedback) if is_timed else None)
    first_equations = []
    for item in properties:
        first_equations.append(len(builder.equations))
        builder.define([simpler[root] for root in item.roots])
    roots = [simpler[item.formula] for item in properties]
    builder.fed = [builder.operand[simpler[equation]] for equation in feedback.values()]
    verdicts = [builder.operand[root] for root in roots]
    occurrences = [
        (place, builder.operand[root.argument]) for place, root in enumerate(roots)
        if properties[place].report is Report.OCCURRENCE and isinstance(root, Historically)
        and root.window.is_unbounded]
    outputs = [(number, builder.operand[simpler[item.output]])
               for number, item in zip(numbers, properties) if item.output is not None]
    margins = MarginBuilder(
        lambda node: builder.value_of(node, without_queues([node])[node]),
        specification.signals, feedback, builder.rates,
    ).build(
        zip(numbers, (item.formula for item in properties), strict=True),
        [(numbers[place], formula.argument) for place, _ in occurrences
         if isinstance(formula := properties[place].formula, Historically)],
    ) if specification.has_margins else None
    tests = [(number, builder.operand[root]) for number, item, root in zip(
        numbers, properties, roots) if item.probability and isinstance(root, NotRefuted)]
    if is_timed:
        verdicts = [builder.unless_lost(verdict) for verdict in verdicts]
        occurrences = [(place, builder.unless_lost(now)) for place, now in occurrences]
    return prune(StepGroup(
        signals,
        tuple(numbers),
        tuple(builder.equations),
        tuple(first_equations),
        tuple(verdicts),
        tuple(FeedbackEquation(node.name, node.type, builder.operand[simpler[equation]])
              for node, equation in feedback.items()),
        tuple((numbers[place], now) for place, now in occurrences),
        is_timed,
        tuple(outputs),
        margins,
        tuple(tests),
    ))


class _Rates:
    """How often the inputs of a bundle can change at most."""

    def __init__(self, signals: tuple[Signal, ...], index: dict[str, int],
                 feedback: dict[Feedback, Formula]) -> None:
        self._signals = signals
        self._index = index
        self._feedback = feedback

    def inputs(self, node: Formula) -> tuple[int, ...]:
        """Return the inputs that a formula reads."""
        return tuple(sorted(self._index[item.name] for item in variables(node)))

    def intervals(self, roots: Sequence[Formula], ticks: int) -> int | None:
        """Return how many intervals some formulas begin in so many ticks; None if unknown."""
        changes = self.changes(roots, ticks)
        return None if changes is None else changes // 2 + 2

    def changes(self, roots: Sequence[Formula], ticks: int) -> int | None:
        """Return how often some formulas change in so many ticks; None if unknown."""
        together = self.sources(roots, ticks)
        return None if together is None else sum(together.values())

    def sources(self, roots: Sequence[Formula], ticks: int) -> dict[object, int] | None:
        """Return where changes come from, and how many there are at most; None if unknown."""
        found: dict[Formula, dict[object, int] | None] = {}
        for item in postorder(roots):
            found[item] = self._changes(item, ticks, [found[part] for part in operands_of(item)])
        return _united([found[item] for item in roots])

    def _of_feedback(self, node: Feedback, ticks: int) -> dict[object, int] | None:
        """Return the changes of a number that counts the steps at which something holds."""
        match self._feedback[node]:
            case Binary(BinaryOperator.ADD, before, Choice(holds, Constant(), Constant())) \
                    if before is node:
                together = self.sources([holds], ticks)
                return None if together is None else {node: sum(together.values())}
            case _:
                return None

    def _changes(self, node: Formula, ticks: int,
                 parts: list[dict[object, int] | None]) -> dict[object, int] | None:
        """
        Return where the changes of a formula come from, and how many at most in so many ticks.

        Messages of a topic are one source for all that reads it. What a window or a step back
        delays comes at other times than its operand changes: a source of its own.
        """
        together = _united(parts)
        if isinstance(node, Variable):
            return self._messages(self._signals[self._index[node.name]], ticks)
        if isinstance(node, Feedback):
            return self._of_feedback(node, ticks)
        if together is None:
            return None
        total = sum(together.values())
        match node:
            case Yesterday() | WeakYesterday() | Previous() | Once() | Historically() | Ago():
                return {node: total + 2}
            case Since() | Triggered() | Over() | Slope() | MessageSlope() | TimeOver() | Trial():
                return {node: 2 * total + 4}
            case _:
                return together

    def _messages(self, signal: Signal, ticks: int) -> dict[object, int] | None:
        if signal.max_rate is None:
            return None
        # Any second may have them all at its end, and the next at its beginning.
        most = ceil(signal.max_rate * (ticks // NANOSECONDS['s'] + 1))
        topic = signal.topic or signal.name
        if signal.source is InputSource.RECEIVED:
            return {topic: most, ('end', topic): most}
        return {topic: most}


def _united(parts: list[dict[object, int] | None]) -> dict[object, int] | None:
    found: dict[object, int] = {}
    for part in parts:
        if part is None:
            return None
        found.update(part)
    return found


class _GroupBuilder:
    """Builds the equations of one group; `operand` maps each formula to its value."""

    def __init__(self, index: dict[str, int], feedback: dict[Feedback, int],
                 rates: _Rates | None) -> None:
        self.equations: list[Equation] = []
        self.operand: dict[Formula, Operand] = {}
        self.fed: list[Operand] = []  # the values of feedback equations
        self._found: dict[tuple[object, ...], Operand] = {}
        self._index = index
        self.rates = rates
        self._feedback = feedback
        # Operands that are known to equal a conjunction, `t >= m`, or `O[0,b] p`.
        self._conjuncts: dict[Operand, tuple[Operand, Operand]] = {}
        self._elapsed: dict[Operand, int] = {}
        self._windows: dict[Operand, OnceWithin] = {}
        self._factoring = 0

    def define(self, roots: Sequence[Formula]) -> None:
        """Add the equations of all terms of the roots."""
        for node in postorder(roots):
            if node not in self.operand:
                self.operand[node] = self._term(node)
                self._name(self.operand[node], node)

    def value_of(self, node: Formula, simpler: Formula) -> Operand:
        """Return the value of a formula; add the equations of the equivalent `simpler` one."""
        if node not in self.operand:
            self.define([simpler])
            self.operand[node] = self.operand[simpler]
        return self.operand[node]

    def _name(self, operand: Operand, node: Formula) -> None:
        """Record in an equation the first formula whose value it is."""
        if not operand.is_constant and not operand.negated:
            equation = self.equations[operand.value]
            if equation.formula is None:
                self.equations[operand.value] = replace(equation, formula=node)

    def _emit(self, operation: Operation, type: ValueType = _BOOL) -> Operand:
        self.equations.append(Equation(operation, type, None))
        return Operand(len(self.equations) - 1)

    def _share(self, key: tuple[object, ...], negated: bool, operation: Operation) -> Operand:
        """
        Return the operand of a Boolean term; add its equation if there is none.

        `operation` computes the term. The term is the one that `key` identifies, or its negation
        if `negated`.
        """
        if key not in self._found:
            operand = self._emit(operation)
            self._found[key] = ~operand if negated else operand
        found = self._found[key]
        return ~found if negated else found

    def _number(self, key: tuple[object, ...], operation: Operation, type: ValueType) -> Operand:
        if key not in self._found:
            self._found[key] = self._emit(operation, type)
        return self._found[key]

    def _term(self, node: Formula) -> Operand:
        match node:
            case Constant():
                return self._constant(node)
            case Variable():
                return self._number(('read', node.name), Read(self._index[node.name]), node.type)
            case Conversion():
                argument = self.operand[node.argument]
                return self._number(('convert', node.type, argument),
                                    Convert(node.argument.type, argument), node.type)
            case Unary():
                return self._unary(node.operator, self.operand[node.argument], node.type)
            case Binary():
                return self._binary(node)
            case Choice():
                return self._choice(self.operand[node.condition], self.operand[node.yes],
                                    self.operand[node.no], node.type)
            case Previous():
                return self._previous(node)
            case Feedback():
                return self._number(('feedback', node), FeedbackRead(self._feedback[node]),
                                    node.type)
            case Yesterday():
                return self._delay(1, self.operand[node.argument])
            case WeakYesterday():
                return ~self._delay(1, ~self.operand[node.argument])
            case Once():
                return self._once(node, self.operand[node.argument], False)
            case Historically():
                return ~self._once(node, ~self.operand[node.argument], True)
            case Since():
                return self._since(node, self.operand[node.left], self.operand[node.right], False)
            case Triggered():
                return ~self._since(node, ~self.operand[node.left], ~self.operand[node.right],
                                    True)
            case Over():
                return self._over(node)
            case Ago():
                return self._value_ago(node)
            case Held():
                return self._held(node)
            case Slope():
                return self._windowed(SlopeBetween(
                    self.operand[node.argument], self.operand[node.at], node.step), node.type)
            case MessageSlope():
                meaning = slope_by_times(node)
                self.define([meaning])
                return self.operand[meaning]
            case TimeOver():
                return self._time_over(node)
            case Trial():
                parts = [self.operand[item] for item in operands_of(node)]
                return self._windowed(TrialOutcome(node.due, *parts), node.type)
            case NotRefuted():
                outcome = self.operand[node.argument]
                return self._share(('tested', node), False, OutcomesTest(
                    outcome, node.allowed, node.rest, node.limit))
            case _:
                assert_never(node)

    def _constant(self, node: Constant) -> Operand:
        if isinstance(node.value, bool):
            return TRUE if node.value else FALSE
        return self._number(('literal', node), Literal(node.value), node.type)

    def _unary(self, operator: UnaryOperator, argument: Operand, type: ValueType) -> Operand:
        if operator is UnaryOperator.NOT:
            return ~argument
        return self._number((operator, argument), ApplyUnary(operator, argument), type)

    def _binary(self, node: Binary) -> Operand:
        left, right = self.operand[node.left], self.operand[node.right]
        types = (node.left.type, node.right.type)
        operator = node.operator
        if operator.is_boolean or types == (_BOOL, _BOOL):
            return self._connective(operator, left, right)
        if operator.is_relation:
            return self._relation(operator, left, right, types)
        if operator is BinaryOperator.POW and types[1] is ValueType.INT64:
            assert isinstance(node.right, Constant)
            exponent = int(node.right.value)
            return self._number(('power', left, exponent), Power(left, exponent), node.type)
        operation = ApplyBinary(operator, left, right, types)
        return self._number((operator, left, right), operation, node.type)

    # -- Boolean terms ----------------------------------------------------------------------

    def _connective(self, operator: BinaryOperator, left: Operand, right: Operand) -> Operand:
        match operator:
            case BinaryOperator.AND:
                return self._and(operator, left, right, False)
            case BinaryOperator.OR:
                return ~self._and(operator, ~left, ~right, True)
            case BinaryOperator.IMPLIES:
                return ~self._and(operator, left, ~right, True)
            case BinaryOperator.XOR | BinaryOperator.NE:
                return self._xor(left, right, False)
            case BinaryOperator.IFF | BinaryOperator.EQ:
                return ~self._xor(left, right, True)
            case _:
                raise ValueError(f'{operator} is no connective')

    def _and(self, operator: BinaryOperator, left: Operand, right: Operand,
             negated: bool) -> Operand:
        """Return `left & right`; `negated` if the formula contains its negation."""
        known = _known_conjunction(left, right)
        if known is None:
            known = self._simpler(left, right)
        if known is not None:
            return known
        written = {BinaryOperator.AND: (left, right), BinaryOperator.OR: (~left, ~right),
                   BinaryOperator.IMPLIES: (left, ~right)}[operator]
        operation = ApplyBinary(operator, *written, (_BOOL, _BOOL))
        operand = self._either(('and', *sorted((left, right))), negated, operation)
        self._conjuncts[operand] = (left, right)
        return operand

    def _simpler(self, left: Operand, right: Operand) -> Operand | None:
        """Return `left & right` if it can be simplified, else None."""
        for one, other in ((left, right), (right, left)):
            found = self._after_start(one, other)
            if found is not None:
                return found
        return self._factored(left, right)

    def _factored(self, left: Operand, right: Operand) -> Operand | None:
        """Return `!(a & (b | c))` if `left & right` is `!(a & b) & !(a & c)`, else None."""
        if self._factoring == _FACTORING_DEPTH:
            return None
        self._factoring += 1
        try:
            return self._common_factor(left, right)
        finally:
            self._factoring -= 1

    def _common_factor(self, left: Operand, right: Operand) -> Operand | None:
        for one in self._conjuncts.get(~left, ()):
            for other in self._conjuncts.get(~right, ()):
                if one == other:
                    rest = (_other(self._conjuncts[~left], one),
                            _other(self._conjuncts[~right], one))
                    either = self._connective(BinaryOperator.OR, *rest)
                    return ~self._connective(BinaryOperator.AND, one, either)
        return None

    def _after_start(self, term: Operand, late: Operand) -> Operand | None:
        """Return `term & late` if `late` is `t >= m` and an initial count can express it."""
        steps = self._elapsed.get(late)
        window = self._windows.get(~term)
        if steps is not None and window is not None and steps <= window.bound + 1:
            is_dual = isinstance(self.equations[term.value].operation, AlwaysWithin)
            return ~self._window(replace(window, head=max(window.head, steps)), is_dual)
        if steps == 1 and not term.is_constant:
            return self._not_at_first(term)
        return None

    def _not_at_first(self, term: Operand) -> Operand | None:
        """Return `term & !FTP` if the term is a value of one step ago, or its negation."""
        cell = self.equations[term.value].operation
        if not isinstance(cell, Delay) or cell.steps != 1:
            return None
        argument = ~cell.argument if term.negated else cell.argument
        return self._delay(1, argument)

    def _xor(self, left: Operand, right: Operand, negated: bool) -> Operand:
        """Return `left xor right`; `negated` if the formula contains its negation."""
        for one, other in ((left, right), (right, left)):
            if one.is_constant:
                return other if one.negated else ~other
        if left.value == right.value:
            return FALSE if left == right else TRUE
        flip = left.negated != right.negated
        bare = (Operand(left.value), Operand(right.value))
        # The equation uses the values without negation; the operator accounts for negations.
        operator = BinaryOperator.IFF if negated != flip else BinaryOperator.XOR
        operand = self._share(('xor', *sorted(bare)), negated != flip,
                              ApplyBinary(operator, *bare, (_BOOL, _BOOL)))
        operand = ~operand if negated != flip else operand
        return ~operand if flip else operand

    def _relation(self, operator: BinaryOperator, left: Operand, right: Operand,
                  types: tuple[ValueType, ValueType]) -> Operand:
        operation = ApplyBinary(operator, left, right, types)
        known = self._known_comparison(operator, left, right, types)
        if known:
            return known
        match operator:
            case BinaryOperator.LT | BinaryOperator.LE:
                return self._share((operator, left, right), False, operation)
            case BinaryOperator.GT:
                return self._share((BinaryOperator.LT, right, left), False, operation)
            case BinaryOperator.GE:
                return self._share((BinaryOperator.LE, right, left), False, operation)
            case _:
                key = ('equal', *sorted((left, right)))
                return self._share(key, operator is BinaryOperator.NE, operation)

    def _known_comparison(self, operator: BinaryOperator, left: Operand, right: Operand,
                          types: tuple[ValueType, ValueType]) -> Operand | None:
        if left == right:
            return _self_comparison(operator, types[0])
        if types[0] is types[1]:
            return self._limit_comparison(operator, left, right)
        return None

    def _limit_comparison(self, operator: BinaryOperator, left: Operand,
                          right: Operand) -> Operand | None:
        """Return a comparison with the least or greatest integer (C compilers warn of it)."""
        if operator in (BinaryOperator.GT, BinaryOperator.GE):
            operator, left, right = _TURNED[operator], right, left
        if operator is BinaryOperator.LT and (self._is_limit(left, 1) or self._is_limit(right, 0)):
            return FALSE
        if operator is BinaryOperator.LE and (self._is_limit(left, 0) or self._is_limit(right, 1)):
            return TRUE
        return None

    def _is_limit(self, operand: Operand, end: int) -> bool:
        equation = self.equations[operand.value]
        return isinstance(equation.operation, Literal) and equation.type.is_integer \
            and equation.operation.value == equation.type.limits[end]

    def _choice(self, condition: Operand, yes: Operand, no: Operand, type: ValueType) -> Operand:
        if condition.negated:
            condition, yes, no = ~condition, no, yes
        if yes.value == condition.value:
            yes = TRUE if yes == condition else FALSE
        if no.value == condition.value:
            no = FALSE if no == condition else TRUE
        if condition.is_constant or yes == no:
            return yes
        if type is _BOOL and (yes.is_constant or no.is_constant):
            return self._choice_as_connective(condition, yes, no)
        operation = Choose(condition, yes, no)
        key = ('choose', condition, yes, no)
        return self._number(key, operation, type)

    def _choice_as_connective(self, condition: Operand, yes: Operand, no: Operand) -> Operand:
        if yes == TRUE:
            return self._connective(BinaryOperator.OR, condition, no)
        if yes == FALSE:
            return self._connective(BinaryOperator.AND, ~condition, no)
        if no == TRUE:
            return self._connective(BinaryOperator.IMPLIES, condition, yes)
        return self._connective(BinaryOperator.AND, condition, yes)

    # -- terms with state -------------------------------------------------------------------

    def _first_step(self) -> Operand:
        operand = self._share(('first',), False, FirstStep())
        self._elapsed[~operand] = 1
        return operand

    def _from_step(self, steps: int) -> Operand:
        """Return `t >= steps`."""
        if steps == 0:
            return TRUE
        if steps == 1:
            return ~self._first_step()
        operand = self._before(steps, TRUE)
        self._elapsed[operand] = steps
        return operand

    def _previous(self, node: Previous) -> Operand:
        initial, argument = self.operand[node.initial], self.operand[node.argument]
        if node.type is _BOOL:
            return self._previous_truth(initial, argument)
        if isinstance(node.initial, Constant):
            operation = PreviousNumber(node.initial.value, argument)
            return self._number(('previous', node.initial, argument), operation, node.type)
        zero = 0.0 if node.type.is_float else 0
        before = self._number(('previous', zero, argument), PreviousNumber(zero, argument),
                              node.type)
        return self._choice(self._first_step(), initial, before, node.type)

    def _previous_truth(self, initial: Operand, argument: Operand) -> Operand:
        if initial == TRUE:
            return ~self._delay(1, ~argument)
        yesterday = self._delay(1, argument)
        if initial == FALSE:
            return yesterday
        return self._choice(self._first_step(), initial, yesterday, _BOOL)

    def _delay(self, steps: int, argument: Operand) -> Operand:
        """Return the argument `steps` steps ago; false in the first `steps` steps."""
        if argument == FALSE:
            return FALSE
        if argument == TRUE:
            return self._from_step(steps)
        # A negated argument is delayed without its negation, and the result is negated.
        operation = Delay(steps, argument.negated, Operand(argument.value))
        operand = self._number(('delay', steps, argument.negated, argument.value), operation,
                               _BOOL)
        return ~operand if argument.negated else operand

    def _before(self, steps: int, argument: Operand) -> Operand:
        return self._share(('before', steps, argument), False, OnceBefore(steps, argument))

    def _once(self, node: _Windowed, argument: Operand, dual: bool) -> Operand:
        """
        Return `O[w] argument`, w the window of `node`.

        With `dual`, the formula contains its negation, written as H of the negated argument.
        """
        window = node.window
        if window.is_empty or argument == FALSE:
            return FALSE
        if argument == TRUE:
            return self._from_step(window.low)
        if window.high is None:
            return self._before(window.low, argument) if window.low \
                else self._once_ever(argument, dual)
        if window.low and self.rates and window != _LAST:
            return self._between(node, TRUE, argument)
        return self._once_within(window.high - window.low,
                                 self._ago(window.low, argument), dual)

    def _between(self, node: _Windowed, left: Operand, right: Operand) -> Operand:
        """Return `left S[w] right`, w the window of `node`, in a group that steps at ticks."""
        low, high = node.window.low, node.window.high
        assert self.rates is not None and high is not None
        # Intervals of `right` whose results do not touch begin at least this many ticks apart.
        longest = high // (high - low + 2) + 1
        room = self._room(node, self.rates.intervals(operands_of(node), high), longest,
                          low == high and high > _SHORT_QUEUE)
        return self._share(('between', low, high, left, right), False,
                           SinceBetween(low, high, left, right, room))

    def _room(self, node: Formula, by_rate: int | None, longest: int, needs_rate: bool) -> Room:
        """Return room for the entries that the rate allows, and at most for the `longest`."""
        assert self.rates is not None
        may_overflow = needs_rate if by_rate is None else by_rate < longest
        return Room(self.rates.inputs(node), by_rate if may_overflow else longest, may_overflow)

    def unless_lost(self, verdict: Operand) -> Operand:
        """
        Return a verdict, false while a queue that it depends on has lost what it needs.

        Where another cell may remember what the queue said, it stays false.
        """
        seen: set[tuple[int, bool]] = set()
        stack = [(verdict.value, False)]
        while stack:
            value, is_remembered = stack.pop()
            if value < 0 or (value, is_remembered) in seen:
                continue
            seen.add((value, is_remembered))
            operation = self.equations[value].operation
            room = room_of(operation)
            if room is not None and room.may_overflow:
                lost = self._share(('overflowed', value), False, Overflowed(Operand(value)))
                if is_remembered:
                    lost = self._once_ever(lost, False)
                verdict = self._connective(BinaryOperator.AND, verdict, ~lost)
            is_cell = not isinstance(operation, Pure | Rounded)
            stack.extend((item.value, is_remembered or is_cell) for item in operands(operation))
            if isinstance(operation, FeedbackRead):
                stack.append((self.fed[operation.index].value, True))
        return verdict

    def _ago(self, steps: int, argument: Operand) -> Operand:
        return self._delay(steps, argument) if steps else argument

    def _once_ever(self, argument: Operand, dual: bool) -> Operand:
        operation = AlwaysSoFar(~argument) if dual else OnceEver(argument)
        return self._either(('once', argument), dual, operation)

    def _once_within(self, bound: int, argument: Operand, dual: bool) -> Operand:
        if bound == 0 or argument.is_constant:
            return argument
        if self._elapsed.get(~argument) == 1:
            return ~self._from_step(bound + 1)
        rest = self._beside_first_step(argument)
        if rest is None:
            return self._window(OnceWithin(bound, argument), dual)
        return self._connective(BinaryOperator.OR, self._window(OnceWithin(bound, rest), dual),
                                ~self._from_step(bound + 1))

    def _beside_first_step(self, argument: Operand) -> Operand | None:
        """Return p if the argument is `FTP | p`, else None."""
        for item in self._conjuncts.get(~argument, ()):
            if self._elapsed.get(item) == 1:
                return ~_other(self._conjuncts[~argument], item)
        return None

    def _window(self, cell: OnceWithin, dual: bool) -> Operand:
        """Return the value of a cell; with `dual` the formula contains its negation, with H."""
        operation = AlwaysWithin(cell.bound, ~cell.argument, cell.head) if dual else cell
        operand = self._either(('within', cell), dual, operation)
        self._windows[operand] = cell
        return operand

    def _either(self, key: tuple[object, ...], dual: bool, operation: Operation) -> Operand:
        """Return the term of `key`; `operation` computes it, or its negation if `dual`."""
        operand = self._share(key, dual, operation)
        return ~operand if dual else operand

    def _since(self, node: _Windowed, left: Operand, right: Operand, dual: bool) -> Operand:
        """Return `left S[w] right`, w the window of `node`; `dual` as for `_once`, with T."""
        window = node.window
        if window.is_empty or right == FALSE:
            return FALSE
        if left == TRUE or window.high == 0:
            return self._once(node, right, dual)
        if left == FALSE or (right == TRUE and window.low == 0):
            return right if window.low == 0 else FALSE
        if window.high is None:
            return self._since_before(window.low, left, right, dual)
        if window.low and self.rates:
            return self._between(node, left, right)
        started = self._ago(window.low, right)
        if window.low:
            held = ~self._once_within(window.low - 1, ~left, True)
            started = self._and(BinaryOperator.AND, started, held, False)
        return self._since_within(window.high - window.low, left, started)

    def _since_before(self, bound: int, left: Operand, right: Operand, dual: bool) -> Operand:
        if bound:
            operation: Operation = SinceBefore(bound, left, right)
            return self._share(('since', bound, left, right), False, operation)
        operation = TriggeredEver(~left, ~right) if dual else SinceEver(left, right)
        return self._either(('since', left, right), dual, operation)

    def _since_within(self, bound: int, left: Operand, right: Operand) -> Operand:
        if bound == 0 or right.is_constant:
            return right
        return self._share(('since within', bound, left, right), False,
                           SinceWithin(bound, left, right))

    # -- numbers over time ------------------------------------------------------------------

    def _over(self, node: Over) -> Operand:
        argument, at = self.operand[node.argument], self.operand[node.at]
        match node.aggregate:
            case Aggregate.GREATEST | Aggregate.LEAST:
                is_least = node.aggregate is Aggregate.LEAST
                return argument if node.past == 0 else self._windowed(
                    Greatest(node.past, argument, is_least, self._room_of_changes(node)),
                    node.type)
            case Aggregate.COUNT if self.rates is None:
                leaving = self._delay(node.past + 1, argument)
                return self._windowed(Tally(argument, leaving), node.type)
            case Aggregate.COUNT:
                one = self._constant(Constant(1, ValueType.INT64))
                return self._total(node, one, self._and(BinaryOperator.AND, at, argument, False))
            case Aggregate.SUM if node.type.is_integer:
                return self._total(node, argument, at)
            case Aggregate.SUM | Aggregate.MEAN:
                return self._windowed(Rounded(self._total(node, argument, at),
                                              node.aggregate is Aggregate.MEAN), node.type)
            case _:
                assert_never(node.aggregate)

    def _total(self, node: Over, argument: Operand, at: Operand) -> Operand:
        room = None
        if self.rates is not None:
            by_rate = self.rates.intervals([node.at], node.past)
            room = self._room(node.at, by_rate, node.past + 2, node.past > _SHORT_QUEUE)
        return self._windowed(Total(node.past, argument, at, room), node.type)

    def _room_of_changes(self, node: Over | Ago) -> Room | None:
        """Return room for the changes of a number, in a group that steps at ticks."""
        if self.rates is None:
            return None
        by_rate = self.rates.changes([node.argument], node.past)
        return self._room(node, None if by_rate is None else by_rate + 2, node.past + 2,
                          node.past > _SHORT_QUEUE)

    def _windowed(self, cell: Operation, type: ValueType) -> Operand:
        return self._number((cell, type), cell, type)

    def _value_ago(self, node: Ago) -> Operand:
        argument = self.operand[node.argument]
        return argument if node.past == 0 else self._windowed(
            ValueAgo(node.past, argument, self._room_of_changes(node)), node.type)

    def _held(self, node: Held) -> Operand:
        condition = self._connective(BinaryOperator.OR, self.operand[node.condition],
                                     self._first_step())
        argument = self.operand[node.argument]
        return argument if condition == TRUE else self._windowed(
            Hold(condition, argument), node.type)

    def _time_over(self, node: TimeOver) -> Operand:
        argument = self.operand[node.argument]
        if not 0 < node.least <= node.past or argument == FALSE:
            return TRUE if node.least <= 0 else FALSE
        if self.rates is None:
            tally = self._windowed(Tally(argument, self._delay(node.past, argument)),
                                   ValueType.INT64)
            least = self._constant(Constant(node.least, ValueType.INT64))
            return self._relation(BinaryOperator.LE, least, tally,
                                  (ValueType.INT64, ValueType.INT64))
        room = self._room(node, self.rates.intervals([node.argument], node.past),
                          node.past // 2 + 2, node.past > _SHORT_QUEUE)
        return self._share(('time over', node), False,
                           TimeAtLeast(node.past, node.least, argument, room))


def _known_conjunction(left: Operand, right: Operand) -> Operand | None:
    if FALSE in (left, right) or left == ~right:
        return FALSE
    if left in (TRUE, right):
        return right
    return left if right == TRUE else None


def _other(pair: tuple[Operand, Operand], one: Operand) -> Operand:
    return pair[1] if pair[0] == one else pair[0]


def _self_comparison(operator: BinaryOperator, type: ValueType) -> Operand | None:
    """Return a value compared with itself; None if the result depends on NaN."""
    if operator in (BinaryOperator.LT, BinaryOperator.GT):
        return FALSE
    if type.is_float:
        return None
    return FALSE if operator is BinaryOperator.NE else TRUE
