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
What the tests of a requirement have to show, as formulas.

An obligation is met by a trace at whose last step its goal is true. Most goals compare the
requirement with a variant: a trace on which the two have different verdicts shows that what
distinguishes them matters. The goal of a condition is about two traces that differ in the truth
of one proposition at one step, and in the verdict at the end (MC/DC: modified condition/decision
coverage); the values of the second trace are inputs with a prime.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from enum import Enum

from fret_monitor.language.sentence import ConditionKind, TimingKind
from fret_monitor.logic.finality import is_final
from fret_monitor.logic.formula import (
    ALWAYS, Binary, BinaryOperator, Feedback, Formula, Historically, Once, postorder, rebuilt,
    Since, Triggered, TRUE, Unary, UnaryOperator, variables, WeakYesterday, Window, Yesterday,
)
from fret_monitor.logic.printing import to_smv, Values
from fret_monitor.logic.propositions import is_pointwise, propositions, triggers
from fret_monitor.logic.specification import Property
from fret_monitor.testgen.variants import (
    IMMEDIATELY, LONGER, NEVER, OTHERWISE, SHORTER, STOPPED, TRIGGERED, Variants,
)
from fret_monitor.traces.subject import renamed_formulas

PRIME = "'"  # after the name of an input: its value in the second trace
_MAX_TRIGGERS = 4
_WIDTH = 60
_MAX_COUNTED = 40  # propositions, operators, and ends of windows, that get obligations

Equations = tuple[tuple[Feedback, Formula], ...]


class Kind(Enum):
    """What an obligation is about; the value is the heading of its column."""

    VERDICT = 'verdict'
    TIMING = 'timing'
    BOUND = 'bounds'
    OPERATOR = 'operators'
    COMPARISON = 'comparisons'
    CONDITION = 'conditions'


@dataclass(frozen=True)
class Obligation:
    """
    Something to show: `goal` is true at the last step of a trace that shows it.

    `feedback` has the equations of all feedback in the goal. `proposition` is that of a
    COMPARISON or CONDITION, `mutant` the comparison in place of it. The goal of a CONDITION also
    reads inputs with a prime.
    """

    kind: Kind
    what: str
    goal: Formula
    feedback: Equations
    proposition: Formula | None = None
    mutant: Formula | None = None

    @property
    def is_pair(self) -> bool:
        """Whether it takes two traces to show it."""
        return self.kind is Kind.CONDITION


def obligations(item: Property, variants: Variants | None, delta: int, step: int,
                values: Values, is_timed: bool) -> list[Obligation]:
    """
    Return the obligations of a requirement.

    `delta` is by how many steps (under `timed`, nanoseconds) bounds differ. Bounds below `step`
    are not made shorter, so that there are as many obligations for each delta up to it.
    """
    return list(_Obligations(item, variants, delta, step, values, is_timed).all())


def both(left: Formula, right: Formula) -> Formula:
    """Return the conjunction."""
    return Binary(BinaryOperator.AND, left, right)


def negated(formula: Formula) -> Formula:
    """Return the negation."""
    return Unary(UnaryOperator.NOT, formula)


def _differ(left: Formula, right: Formula) -> Formula:
    return Binary(BinaryOperator.XOR, left, right)


class _Obligations:

    def __init__(self, item: Property, variants: Variants | None, delta: int, step: int,
                 values: Values, is_timed: bool) -> None:
        self._item = item
        self._variants = variants
        self._delta, self._step = delta, step
        self._values = values
        self._is_timed = is_timed

    def all(self) -> Iterator[Obligation]:
        yield from self._verdicts()
        if self._variants is not None:
            yield from self._timing(self._variants)
        yield from self._bounds()
        yield from self._operators()
        known = propositions(self._item)
        for number, node in enumerate(known[:_MAX_COUNTED]):
            yield from self._comparison(node)
            yield self._condition(node, known, number)

    def _shown(self, node: Formula) -> str:
        return to_smv(node, _WIDTH, self._values, is_timed=self._is_timed)

    def _made(self, kind: Kind, what: str, goal: Formula, feedback: Equations = (),
              proposition: Formula | None = None, mutant: Formula | None = None) -> Obligation:
        equations = {**dict(self._item.feedback), **dict(feedback)}
        return Obligation(kind, what, goal, tuple(equations.items()), proposition, mutant)

    def _trigger(self) -> Formula | None:
        """Return whether the condition of the sentence has been true within its scope."""
        found = self._variants.formulas.get(TRIGGERED) if self._variants else None
        return None if found is None else negated(found)

    def _verdicts(self) -> Iterator[Obligation]:
        yield from self._reached()
        formula = self._item.formula
        if isinstance(formula, Historically) and formula.window.is_unbounded:
            yield self._made(Kind.VERDICT, 'violated, and still so when nothing is wrong any more',
                             both(negated(formula), formula.argument))
        elif not is_final(formula):
            yield self._made(Kind.VERDICT, 'satisfied again after a violation',
                             both(formula, Yesterday(negated(formula))))

    def _reached(self) -> Iterator[Obligation]:
        formula = self._item.formula
        trigger = self._trigger()
        feedback = self._variants.feedback if self._variants else ()
        if trigger is not None:
            yield self._made(Kind.VERDICT, 'triggered and satisfied', both(trigger, formula),
                             feedback)
            yield self._made(Kind.VERDICT, 'triggered and violated',
                             both(trigger, negated(formula)), feedback)
            return
        found = triggers(formula, _MAX_TRIGGERS) if self._item.sentence is None else []
        for node in found:
            yield self._made(Kind.VERDICT, f'satisfied after {self._shown(node)}',
                             both(Once(ALWAYS, node), formula))
        if not found:
            yield self._made(Kind.VERDICT, 'satisfied', formula)
        yield self._made(Kind.VERDICT, 'violated', negated(formula))

    def _timing(self, variants: Variants) -> Iterator[Obligation]:
        formula, trigger = self._item.formula, self._trigger() or TRUE
        forms = variants.formulas
        for what, goal in _moments(variants, formula, trigger):
            yield self._made(Kind.TIMING, what, goal, variants.feedback)
        if OTHERWISE in forms:
            is_holding = variants.sentence.condition_kind is ConditionKind.HOLDING
            yield self._made(
                Kind.TIMING, 'the condition counts while it holds' if is_holding
                else 'the condition counts only when it becomes true',
                _differ(formula, forms[OTHERWISE]), variants.feedback)
        if STOPPED in forms:
            stopped = negated(forms[STOPPED])
            yield self._made(Kind.TIMING, 'satisfied, and the stop condition came',
                             both(stopped, formula), variants.feedback)
            if variants.sentence.timing_kind is TimingKind.UNTIL:
                yield self._made(Kind.TIMING, 'violated before the stop condition',
                                 both(forms[STOPPED], negated(formula)), variants.feedback)

    # -- bounds --------------------------------------------------------------------------------

    def _bounds(self) -> Iterator[Obligation]:
        """Yield for each end of a window what a shorter and a longer one would change."""
        count = 0
        for node in self._windows():
            for is_low in (True, False):
                for sign, how in ((-1, 'shorter'), (1, 'longer')):
                    window = self._moved(node.window, is_low, sign)
                    if window is None or count >= _MAX_COUNTED:
                        continue
                    count += 1
                    formula, feedback = self._with(
                        node, lambda new, window=window: _windowed(new, window))
                    yield self._made(
                        Kind.BOUND, f'{"lower" if is_low else "upper"} bound of '
                        f'{self._shown(node)}: one {how} differs',
                        _differ(self._item.formula, formula), feedback)

    def _windows(self) -> list[Once | Historically | Since | Triggered]:
        """Return the nodes with windows, but those of the timing of a sentence."""
        longer = self._variants.formulas.get(LONGER) if self._variants else None
        kept = None if longer is None else set(postorder([longer]))
        return [node for node in postorder(self._item.roots)
                if isinstance(node, Once | Historically | Since | Triggered)
                and (kept is None or node in kept) and not node.window.is_empty
                and not self._is_start(node)]

    def _is_start(self, node: Once | Historically | Since | Triggered) -> bool:
        """Whether a node speaks of the first step alone, so that FRETish made it."""
        return self._item.sentence is not None and not variables(node)

    def _moved(self, window: Window, is_low: bool, sign: int) -> Window | None:
        low, high = window.low, window.high
        end = low if is_low else high
        if end is None or (is_low and end == 0) or (sign < 0 and end < self._step):
            return None
        moved = end + sign * self._delta
        low, high = (moved, high) if is_low else (low, moved)
        return None if high is not None and high < low else Window(low, high)

    # -- operators -----------------------------------------------------------------------------

    def _operators(self) -> Iterator[Obligation]:
        """Yield for each operator what another one in its place would change."""
        nodes = [node for node in postorder(self._item.roots) if self._is_written(node)]
        for node in [each for each in nodes if _swapped(each) is not None][:_MAX_COUNTED]:
            formula, feedback = self._with(node, lambda new: _swapped(new) or new)
            yield self._made(
                Kind.OPERATOR, f'{self._shown(node)}: {_swap_in_words(node)} differs',
                _differ(self._item.formula, formula), feedback)

    def _is_written(self, node: Formula) -> bool:
        """Whether a node may be the user's own: those over time of a sentence are FRETish's."""
        return bool(variables(node)) and (self._item.sentence is None or is_pointwise(node))

    # -- propositions --------------------------------------------------------------------------

    def _comparison(self, node: Formula) -> Iterator[Obligation]:
        if not isinstance(node, Binary) or self._is_named(node):
            return
        for operator in _NEIGHBOURS[node.operator]:
            formula, feedback = self._with(
                node, lambda new, operator=operator: Binary(operator, new.left, new.right))
            yield self._made(
                Kind.COMPARISON, f'{self._shown(node)}: {operator.value} in place of '
                f'{node.operator.value} differs', _differ(self._item.formula, formula), feedback,
                node, Binary(operator, node.left, node.right))

    def _is_named(self, node: Formula) -> bool:
        """Whether a comparison reads a string, which has no order."""
        return any(isinstance(value, str) for each in variables(node)
                   for _, value in self._values.get(each.name, ()))

    def _condition(self, node: Formula, known: Iterable[Formula], number: int) -> Obligation:
        item = self._item
        names = {name: name + PRIME for name in item.inputs}
        names.update((each.name, each.name + PRIME) for each, _ in item.feedback)
        other = renamed_formulas(item.roots, names)
        goal = _differ(item.formula, other[item.formula])
        for each in known:
            if each is not node:
                same = Binary(BinaryOperator.IFF, each, other[each])
                goal = both(goal, Historically(ALWAYS, same))
        is_searched = not self._is_timed or self._delta > 1
        if is_pointwise(node) and is_searched:  # for one step; in time, for one of the grid
            here = _differ(node, other[node])
            before = WeakYesterday(Historically(ALWAYS, negated(here)))
            goal = both(goal, Historically(ALWAYS, Binary(BinaryOperator.IMPLIES, here, before)))
        feedback = tuple((Feedback(names[each.name], each.type), other[equation])
                         for each, equation in item.feedback)
        return self._made(Kind.CONDITION, f'{self._shown(node)} alone changes the verdict', goal,
                          feedback, node)

    def _with(self, node: Formula,
              change: Callable[..., Formula]) -> tuple[Formula, Equations]:
        """Return the formula with one node changed, and its equations with new names."""
        found: dict[Formula, Formula] = {}
        tag = '"'
        for each in postorder(self._item.roots):
            if isinstance(each, Feedback):
                found[each] = Feedback(each.name + tag, each.type)
            else:
                new = rebuilt(each, found)
                found[each] = change(new) if each is node else new
        return found[self._item.formula], tuple(
            (Feedback(each.name + tag, each.type), found[equation])
            for each, equation in self._item.feedback)


_OP = BinaryOperator
_NEIGHBOURS = {
    _OP.LT: (_OP.LE,), _OP.LE: (_OP.LT,), _OP.GT: (_OP.GE,), _OP.GE: (_OP.GT,),
    _OP.EQ: (_OP.GE, _OP.LE), _OP.NE: (_OP.GT, _OP.LT),
}
_WEAK = frozenset({TimingKind.WITHIN, TimingKind.EVENTUALLY, TimingKind.NONE, TimingKind.BEFORE})
_STRONG = frozenset({TimingKind.ALWAYS, TimingKind.NEVER, TimingKind.FOR, TimingKind.UNTIL})
_DUAL = {TimingKind.WITHIN: TimingKind.FOR, TimingKind.FOR: TimingKind.WITHIN}


def _moments(variants: Variants, formula: Formula,
             trigger: Formula) -> Iterator[tuple[str, Formula]]:
    """Yield the moments of responses and of violations that a timing distinguishes."""
    sentence, forms = variants.sentence, variants.formulas
    kind = sentence.timing_kind
    is_only = sentence.scope_kind.is_only
    wrong = negated(formula)
    if is_only:
        kind = _DUAL.get(kind, kind)
    if IMMEDIATELY in forms:
        first = forms[IMMEDIATELY]
        if kind in _WEAK:
            yield 'satisfied at the first moment', both(trigger, both(first, formula))
            yield 'satisfied later', both(negated(first), formula)
        elif kind in _STRONG:
            yield 'violated at the first moment', both(negated(first), wrong)
            yield 'violated later', both(first, wrong)
    shorter, longer = forms.get(SHORTER), forms.get(LONGER)
    if kind in (TimingKind.WITHIN, TimingKind.AFTER) and longer is not None:
        # One later than the verdict that differs: the response has come then.
        if shorter is not None:
            yield 'satisfied at the last moment', both(formula, Yesterday(negated(shorter)))
        yield 'violated: one too late', both(wrong, both(Yesterday(wrong), longer))
    if kind in (TimingKind.FOR, TimingKind.AFTER) and longer is not None:
        yield 'satisfied: not one longer', both(formula, negated(longer))
        if shorter is not None:
            yield 'violated at the last moment', both(wrong, shorter)
    if NEVER in forms and kind in (TimingKind.WITHIN, TimingKind.AFTER):
        yield 'violated without any response', both(trigger, both(wrong, forms[NEVER]))


def mapped(item: Obligation, change: Callable[[Iterable[Formula]], Mapping[Formula, Formula]]
           ) -> Obligation:
    """Return an obligation with its formulas changed, such as to those on a grid of time."""
    found = change([item.goal, *(equation for _, equation in item.feedback)])
    return replace(item, goal=found[item.goal], feedback=tuple(
        (node, found[equation]) for node, equation in item.feedback))


_SWAPPED = {_OP.IMPLIES: _OP.IFF, _OP.IFF: _OP.IMPLIES, _OP.AND: _OP.OR, _OP.OR: _OP.AND,
            _OP.XOR: _OP.OR}


def _swapped(node: Formula) -> Formula | None:
    """Return what a person may have meant by another operator; None if there is none."""
    match node:
        case Since(window, left, right):
            return Triggered(window, left, right)
        case Triggered(window, left, right):
            return Since(window, left, right)
        case Once(window, argument) if not _is_present(window):
            return Historically(window, argument)
        case Historically(window, argument) if not _is_present(window):
            return Once(window, argument)
        case Binary(operator, left, right) if operator in _SWAPPED:
            return Binary(_SWAPPED[operator], left, right)
        case Unary(UnaryOperator.NOT, argument):
            return argument
        case _:
            return None


def _swap_in_words(node: Formula) -> str:
    match node:
        case Since() | Triggered() | Once() | Historically():
            name = _NAMES[type(node)]
            return f'{_NAMES[type(_swapped(node))]} in place of {name}'
        case Binary(operator):
            return f'{_SWAPPED[operator].value} in place of {operator.value}'
        case _:
            return 'without !'


_NAMES: dict[type, str] = {Since: 'S', Triggered: 'T', Once: 'O', Historically: 'H'}


def _is_present(window: Window) -> bool:
    return (window.low, window.high) == (0, 0)


def _windowed(node: Formula, window: Window) -> Formula:
    match node:
        case Once() | Historically():
            return type(node)(window, node.argument)
        case Since() | Triggered():
            return type(node)(window, node.left, node.right)
        case _:
            raise TypeError(node)
