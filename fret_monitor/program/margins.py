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
The margins of a group's requirements as equations (docs/margins.md).

The margin of a formula is a number with the comparison that decides it; `Operand.negated` is the
margin of the negation. A part of a formula without comparisons of numbers is one Boolean leaf,
which the group's other equations compute: its margin is infinite.

Windows are reduced to three cells, as those of verdicts are:
    O[a,b] p   = O[0,b-a] (p, a steps ago)
    p S[a,b] q = O[a,b] q & H[0,a-1] p & (p S q, a steps ago)
H and T are reduced to the duals of these. The equations hold for truth values, p and q independent
of each other and without a negation. So they hold for margins: where a margin is compared with
any number, `&` and `|` of the results are those of the least and the greatest.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Protocol

from fret_monitor.logic.formula import (
    Binary, BinaryOperator, Choice, Constant, Feedback, Formula, Historically, Once, operands,
    Previous, Since, Triggered, Unary, variables, WeakYesterday, Window, Yesterday,
)
from fret_monitor.logic.specification import Signal
from fret_monitor.model.values import ValueType
from fret_monitor.program.monitor_program import (
    Certain, Distance, FALSE, Greater, Lesser, MarginAgo, MarginEquation, MarginFeedback,
    MarginOperation, Margins, MarginSince, MarginWithin, Operand, Room, TRUE,
)

_BOOL = ValueType.BOOL
_TEMPORAL = (Once, Historically, Since, Triggered, Yesterday, WeakYesterday, Previous)
_Sources = dict[object, int] | None


class Rates(Protocol):
    """How often formulas can change at most, in a group that steps at ticks."""

    def inputs(self, node: Formula) -> tuple[int, ...]:
        """Return the inputs that a formula reads."""

    def sources(self, roots: Sequence[Formula], ticks: int) -> _Sources:
        """Return where changes come from, and how many there are at most; None if unknown."""


class MarginBuilder:
    """Builds the margins of one group."""

    def __init__(self, operand_of: Callable[[Formula], Operand], signals: Iterable[Signal],
                 feedback: Mapping[Feedback, Formula], rates: Rates | None) -> None:
        """`operand_of` adds the equations of a formula to the group, and returns its value."""
        self._operand_of = operand_of
        self._signals = {signal.name: signal for signal in signals}
        self._feedback = feedback
        self._rates = rates
        self._leaves: dict[Operand, int] = {}
        self._equations: list[MarginEquation] = []
        self._found: dict[MarginOperation, Operand] = {}
        self._operand: dict[Formula, Operand] = {}
        self._compares: dict[Formula, bool] = {}
        self._fed: dict[Feedback, int] = {}
        self._owner = 0

    def build(self, roots: Iterable[tuple[int, Formula]],
              occurrences: Iterable[tuple[int, Formula]]) -> Margins:
        """Return the margins of requirements (their numbers) with these formulas."""
        found = [self._define(formula, owner) for owner, formula in roots]
        found_occurrences = [(owner, self._define(formula, owner))
                             for owner, formula in occurrences]
        fed: list[Operand] = []
        while len(fed) < len(self._fed):  # an equation may read the next one
            node = list(self._fed)[len(fed)]
            fed.append(self._define(self._feedback[node], self._owner))
        return self._pruned(found, found_occurrences, fed)

    def _pruned(self, roots: Sequence[Operand], occurrences: Sequence[tuple[int, Operand]],
                fed: Sequence[Operand]) -> Margins:
        """Return the margins without equations that nothing depends on."""
        live = sorted(self._live([*roots, *(item for _, item in occurrences), *fed]))
        number = {old: new for new, old in enumerate(live)}
        equations = [self._equations[old] for old in live]
        leaves = [operand for leaf, operand in enumerate(self._leaves)
                  if any(leaf in _leaves(item.operation) for item in equations)]
        leaf_number = {self._leaves[operand]: new for new, operand in enumerate(leaves)}

        def renumbered(operand: Operand) -> Operand:
            return operand if operand.is_constant else replace(
                operand, value=number[operand.value])

        def changed(operation: MarginOperation) -> MarginOperation:
            match operation:
                case Certain():
                    return Certain(leaf_number[operation.leaf])
                case Distance():
                    return replace(operation, left=leaf_number[operation.left],
                                   right=leaf_number[operation.right])
                case _:
                    kept: dict[str, Any] = {
                        name: renumbered(item) for name, item in vars(operation).items()
                        if isinstance(item, Operand)}
                    return replace(operation, **kept)

        return Margins(
            tuple(leaves),
            tuple(replace(item, operation=changed(item.operation)) for item in equations),
            tuple(map(renumbered, roots)),
            tuple((owner, renumbered(item)) for owner, item in occurrences),
            tuple(map(renumbered, fed)))

    def _live(self, roots: Iterable[Operand]) -> set[int]:
        seen: set[int] = set()
        stack = [item.value for item in roots]
        while stack:
            value = stack.pop()
            if value >= 0 and value not in seen:
                seen.add(value)
                stack.extend(item.value for item in vars(self._equations[value].operation).values()
                             if isinstance(item, Operand))
        return seen

    def _define(self, root: Formula, owner: int) -> Operand:
        self._owner = owner
        self._note_comparisons(root)
        for node in _skeleton([root], self._parts):
            if node not in self._operand:
                self._operand[node] = self._margin(node)
        return self._operand[root]

    # -- which parts compare numbers ------------------------------------------------------------

    def _note_comparisons(self, root: Formula) -> None:
        """Find out which nodes have finite margins."""
        for node in _skeleton([root], _parts):
            if node not in self._compares:
                self._compares[node] = self._is_comparison(node) or (
                    isinstance(node, Feedback) and self._is_fed_comparisons(node)) or any(
                    self._compares[part] for part in _parts(node))

    def _is_fed_comparisons(self, node: Feedback) -> bool:
        seen: set[Feedback] = {node}
        stack = [node]
        while stack:
            for item in _skeleton([self._feedback[stack.pop()]], _parts):
                if self._is_comparison(item):
                    return True
                if isinstance(item, Feedback) and item not in seen:
                    seen.add(item)
                    stack.append(item)
        return False

    def _is_comparison(self, node: Formula) -> bool:
        return isinstance(node, Binary) and node.operator.is_relation \
            and node.left.type is not _BOOL and not any(
                self._signals[item.name].values for item in variables(node))

    def _parts(self, node: Formula) -> tuple[Formula, ...]:
        return _parts(node) if self._compares[node] else ()

    # -- margins --------------------------------------------------------------------------------

    def _margin(self, node: Formula) -> Operand:
        if not self._compares[node]:
            return self._certain(node)
        if isinstance(node, Feedback):
            return self._emit(MarginFeedback(self._fed.setdefault(node, len(self._fed))))
        parts = [self._operand[part] for part in _parts(node)]
        match node:
            case Binary() if not parts:
                return self._distance(node)
            case Binary():
                return self._connective(node.operator, *parts)
            case Unary():
                return ~parts[0]
            case Choice():
                condition, yes, no = parts
                return self._or(self._and(condition, yes), self._and(~condition, no))
            case Previous():
                started = self._certain(WeakYesterday(Constant(False, _BOOL)))
                return self._or(self._and(started, parts[0]), self._ago(1, parts[1], node))
            case Yesterday():
                return self._ago(1, parts[0], node)
            case WeakYesterday():
                return ~self._ago(1, ~parts[0], node)
            case Once():
                return self._once(node.window, parts[0], node)
            case Historically():
                return ~self._once(node.window, ~parts[0], node)
            case Since():
                return self._since(node.window, parts[0], parts[1], node)
            case Triggered():
                left, right = parts
                return ~self._since(node.window, ~left, ~right, node)
            case _:
                raise TypeError(f'{type(node).__name__} has no margin')

    def _emit(self, operation: MarginOperation, formula: Formula | None = None) -> Operand:
        if operation not in self._found:
            self._found[operation] = self._add(operation, formula)
        return self._found[operation]

    def _add(self, operation: MarginOperation, formula: Formula | None) -> Operand:
        self._equations.append(MarginEquation(operation, self._owner, formula))
        return Operand(len(self._equations) - 1)

    def _leaf(self, formula: Formula) -> int:
        return self._leaves.setdefault(self._operand_of(formula), len(self._leaves))

    def _certain(self, node: Formula) -> Operand:
        operand = self._operand_of(node)
        if operand.is_constant:
            return operand
        bare = Operand(operand.value)
        leaf = self._leaves.setdefault(bare, len(self._leaves))
        found = self._emit(Certain(leaf), node)
        return ~found if operand.negated else found

    def _distance(self, node: Binary) -> Operand:
        # Not shared by distance: `x < y` and `y >= x` are named, each where it is written.
        scales = [self._signals[item.name].scale for item in variables(node)]
        left, right, operator = self._leaf(node.left), self._leaf(node.right), node.operator
        if operator in (BinaryOperator.GT, BinaryOperator.GE):
            left, right, operator = right, left, BinaryOperator.LE
        if operator is BinaryOperator.LT:
            operator = BinaryOperator.LE
        return self._add(Distance(operator, left, right, max(scales, default=1.0)), node)

    def _connective(self, operator: BinaryOperator, left: Operand, right: Operand) -> Operand:
        match operator:
            case BinaryOperator.AND:
                return self._and(left, right)
            case BinaryOperator.OR:
                return self._or(left, right)
            case BinaryOperator.IMPLIES:
                return self._or(~left, right)
            case BinaryOperator.XOR | BinaryOperator.NE:
                return self._or(self._and(left, ~right), self._and(~left, right))
            case _:
                return ~self._or(self._and(left, ~right), self._and(~left, right))

    def _and(self, left: Operand, right: Operand) -> Operand:
        if FALSE in (left, right):
            return FALSE
        if left in (TRUE, right):
            return right
        return left if right == TRUE else self._emit(Lesser(left, right))

    def _or(self, left: Operand, right: Operand) -> Operand:
        if TRUE in (left, right):
            return TRUE
        if left in (FALSE, right):
            return right
        return left if right == FALSE else self._emit(Greater(left, right))

    # -- over time ------------------------------------------------------------------------------

    def _ago(self, steps: int, argument: Operand, node: Formula) -> Operand:
        if steps == 0 or argument == FALSE:
            return argument
        if argument == TRUE:  # from step `steps` on
            return self._certain(Once(Window(steps, None), Constant(True, _BOOL)))
        return self._emit(MarginAgo(
            steps, argument, self._room(node, steps) if steps > 1 else None))

    def _once(self, window: Window, argument: Operand, node: Formula) -> Operand:
        if window.is_empty:
            return FALSE
        before = self._ago(window.low, argument, node)
        if window.high is None:
            return self._ever(TRUE, before)
        bound = window.high - window.low
        return before if bound == 0 or before.is_constant else self._emit(
            MarginWithin(bound, before, self._room(node, bound)))

    def _since(self, window: Window, left: Operand, right: Operand, node: Formula) -> Operand:
        if window.is_empty:
            return FALSE
        found = self._ago(window.low, self._ever(left, right), node)
        if window.low:
            found = self._and(found, ~self._once(Window(0, window.low - 1), ~left, node))
        if window.high is not None:
            found = self._and(found, self._once(window, right, node))
        return found

    def _ever(self, left: Operand, right: Operand) -> Operand:
        if right.is_constant or left == FALSE:
            return right
        return self._emit(MarginSince(left, right))

    # -- room under `timed` ---------------------------------------------------------------------

    def _room(self, node: Formula, ticks: int) -> Room | None:
        """Return room for the changes of the operands of a node in so many ticks."""
        if self._rates is None:
            return None
        together = self._changes(node, ticks)
        by_rate = None if together is None else sum(together.values()) + 3
        longest = ticks + 2
        may_overflow = by_rate is None or by_rate < longest
        return Room(self._rates.inputs(node), by_rate if may_overflow else longest, may_overflow)

    def _changes(self, root: Formula, ticks: int) -> _Sources:
        """Return where changes of the operands' margins come from, and how many there are."""
        assert self._rates is not None
        found: dict[Formula, _Sources] = {}
        for node in _skeleton([root], self._parts):
            parts = self._parts(node)
            found[node] = _united([found[part] for part in parts]) if parts \
                else self._rates.sources([node], ticks)
            total = found[node]
            if isinstance(node, _TEMPORAL) and parts and total is not None:
                # Each change comes in, and leaves a window later.
                found[node] = {node: 2 * sum(total.values()) + 4}
        return found[root]


def _parts(node: Formula) -> tuple[Formula, ...]:
    """Return the operands of a BOOL node whose margins its own is made of."""
    if isinstance(node, Binary) and node.left.type is not _BOOL:
        return ()
    return tuple(operands(node)) if isinstance(
        node, (Binary, Unary, Choice, *_TEMPORAL)) else ()


def _leaves(operation: MarginOperation) -> tuple[int, ...]:
    match operation:
        case Certain():
            return (operation.leaf,)
        case Distance():
            return operation.left, operation.right
        case _:
            return ()


def _united(parts: Sequence[_Sources]) -> _Sources:
    found: dict[object, int] = {}
    for part in parts:
        if part is None:
            return None
        found.update(part)
    return found


def _skeleton(roots: Iterable[Formula],
              parts: Callable[[Formula], tuple[Formula, ...]]) -> list[Formula]:
    """Return the nodes that have margins, each after its parts."""
    found: dict[Formula, None] = {}
    seen: set[Formula] = set()
    stack = [(root, False) for root in roots]
    while stack:
        node, is_ready = stack.pop()
        if is_ready:
            found[node] = None
        elif node not in seen:
            seen.add(node)
            stack.append((node, True))
            stack.extend((part, False) for part in reversed(parts(node)))
    return list(found)
