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
Which truth values comparisons can have together, and who chooses them.

Comparisons that share inputs form a block. A *letter* of a block is a combination of truth values
that some values of its inputs give, with such values. Where a comparison relates inputs of the
environment to outputs of the system, the environment's part is a *class*: the values of its
inputs that leave the system the same letters to choose from.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fret_monitor.model.graph import sharing
from fret_monitor.smt import terms as t
from fret_monitor.smt.boolean import BooleanSystem, variables
from fret_monitor.smt.concrete import function_of, NoValue
from fret_monitor.smt.linear import NotLinear
from fret_monitor.smt.reals import has_product, is_rounded, RealTranslation, value_of
from fret_monitor.smt.solver import new_solver, Translation, value_in
from fret_monitor.smt.terms import Term
from fret_monitor.traces.deadline import Deadline
import z3

_MOST_LETTERS = 1024
_QUERY_S = 5.0
ROUNDED = 'a sum or product in a comparison is rounded'
BEFORE = 'a comparison relates inputs to their values at earlier steps'

Values = Mapping[Term, Any]
"""Values of inputs, as terms have them: words are unsigned."""


@dataclass(frozen=True)
class Letter:
    """
    Truth values of the terms of a block, in their order, and values that give them.

    With `is_certain`, the values give the environment's terms these truth values, rounding
    included.
    """

    truths: tuple[bool, ...]
    witness: Values
    is_certain: bool = True


@dataclass(frozen=True)
class EnvironmentClass:
    """
    Values of the environment's inputs that leave the system the same choices.

    `truths` are those of the terms that depend on the environment alone, in their order; `choices`
    are indices of letters.
    """

    truths: tuple[bool, ...]
    witness: Values
    choices: tuple[int, ...]


@dataclass(frozen=True)
class Block:
    """
    Terms over shared inputs: Boolean inputs and comparisons.

    `terms` are those of the environment, then the others; `given` are terms over numbers of the
    step before, whose truth values bits of the state have. `classes` is None where each
    combination of truth values of the environment's terms leaves every letter that has it, which
    is so if no term mixes both sides. `doubts` say why a yes may not be final, and `gaps` why a no
    may not be: because the system could have further choices.
    """

    environment: tuple[Term, ...]
    others: tuple[Term, ...]
    given: tuple[Term, ...]
    letters: tuple[Letter, ...]
    classes: tuple[EnvironmentClass, ...] | None
    doubts: tuple[str, ...]
    gaps: tuple[str, ...] = ()
    is_free: bool = False

    @property
    def terms(self) -> tuple[Term, ...]:
        """All terms, in the order of the truth values of a letter."""
        return (*self.environment, *self.others, *self.given)


def blocks(system: BooleanSystem, outputs: Iterable[Term], domains: Mapping[Term, int | None],
           deadline: Deadline) -> list[Block]:
    """
    Return the blocks of a system.

    `outputs` are the inputs that the system under analysis sets; `domains` are as
    those of a `Component`.
    """
    chosen = set(outputs)
    inputs = set(system.inputs)
    before = {item.now for item in system.numbers}
    terms = [*system.inputs, *system.atoms]
    tracked = {atom: bit for bit, atom in system.tracked.items() if variables(atom) <= before}
    found = []
    for group in sharing(list(dict.fromkeys([*terms, *tracked])), variables):
        given = [item for item in group if item in tracked]
        own = [item for item in group if item not in tracked]
        if not own:
            continue
        environment = [item for item in own if not variables(item) & (chosen | before)]
        others = [item for item in own if item not in environment]
        if all(item in inputs for item in own):
            found.append(Block(tuple(environment), tuple(others), (), (), None, (), is_free=True))
            continue
        found.append(_Enumeration(environment, others, given, chosen, before, domains,
                                  deadline).block())
    return found


class _Enumeration:
    """Enumerates the letters of one block."""

    def __init__(self, environment: Sequence[Term], others: Sequence[Term],
                 given: Sequence[Term], chosen: set[Term], before: set[Term],
                 domains: Mapping[Term, int | None], deadline: Deadline) -> None:
        self._environment, self._others, self._given = environment, others, given
        self._terms = [*environment, *others, *given]
        self._inputs = sorted({name for item in self._terms for name in variables(item)},
                              key=lambda each: each.number)
        self._chosen, self._before, self._domains = chosen, before, domains
        self._deadline = deadline
        self._doubts: dict[str, None] = {}
        self._gaps: dict[str, None] = {}
        self._is_real = True
        self._is_rounded = any(map(is_rounded, self._terms))

    def block(self) -> Block:
        translation: RealTranslation | Translation = RealTranslation(is_wide=True)
        try:
            shown = [translation(item) for item in self._terms]
        except NotLinear:
            self._is_real = False
            self._doubt_calls()
            translation = Translation(False)
            shown = [translation(item) for item in self._terms]
        variables_shown = dict(translation.variables)
        ranges = [*getattr(translation, 'ranges', []),
                  *self._ranges(variables_shown, self._is_real)]
        letters = self._letters(shown, variables_shown, ranges)
        return Block(
            tuple(self._environment), tuple(self._others), tuple(self._given), tuple(letters),
            self._classes(shown, variables_shown, ranges, letters), tuple(self._doubts),
            tuple(self._gaps))

    def _doubt_calls(self) -> None:
        """Note functions whose values the solver does not know: a letter may have none."""
        names = _calls(self._terms)
        if names:  # the environment cannot choose each of its letters, so that a no is in doubt
            found = self._gaps if _calls(self._environment) else self._doubts
            found[f'the solver does not know the values of {", ".join(names)}'] = None

    def _ranges(self, shown: Mapping[Term, Any], is_real: bool) -> Iterator[Any]:
        for item, found in shown.items():
            if item in self._domains:
                count = self._domains[item]
                yield found >= 0 if count is None else z3.And(found >= 0, found < count)
            if not is_real and item.sort[0] == 'real':
                yield z3.Not(z3.Or(z3.fpIsNaN(found), z3.fpIsInf(found)))

    def _letters(self, shown: Sequence[Any], names: Mapping[Term, Any],
                 ranges: Sequence[Any]) -> list[Letter]:
        truths = [z3.Bool(f'letter.{place}') for place in range(len(shown))]
        solver = new_solver(self._deadline.at_most(_QUERY_S))
        solver.add(*ranges)
        solver.add(*(truth == item for truth, item in zip(truths, shown)))
        evaluate = self._evaluation()
        found: list[Letter] = []
        while True:
            self._deadline.check()
            answer = solver.check()
            if answer == z3.unsat:
                return found
            if answer == z3.unknown:
                self._gaps['the solver does not decide which comparisons hold together'] = None
                return found
            if len(found) == _MOST_LETTERS:
                self._gaps[f'more than {_MOST_LETTERS} combinations of comparisons'] = None
                return found
            model = solver.model()
            letter = tuple(z3.is_true(model.eval(item, model_completion=True)) for item in truths)
            witness = _witness(model, names, self._is_real)
            solver.add(z3.Or(*(truth != value for truth, value in zip(truths, letter))))
            if evaluate is not None and tuple(map(bool, evaluate(
                    *(witness[item] for item in self._inputs)))) != letter:
                exact = None
                if not self._is_rounded:
                    exact = self._exact(letter)
                    if exact is None:
                        continue
                else:
                    exact = self._unrounded(letter) if self._is_real else None
                    if exact is None or tuple(map(bool, evaluate(
                            *(exact[item] for item in self._inputs)))) != letter:
                        self._doubts[ROUNDED] = None
                witness = exact or witness
            found.append(Letter(letter, witness, self._is_certain(letter, witness)))

    def _is_certain(self, truths: Sequence[bool], values: Values) -> bool:
        """Whether the environment's terms have truth values for some values of inputs."""
        if not self._is_rounded:
            return True
        names = sorted({name for item in self._environment for name in variables(item)},
                       key=lambda each: each.number)
        found = function_of(self._environment, names)(*(values[name] for name in names))
        return tuple(map(bool, found)) == tuple(truths[:len(self._environment)])

    def _evaluation(self) -> Any:
        try:
            return function_of(self._terms, self._inputs)
        except NoValue:
            return None

    def _unrounded(self, letter: Sequence[bool]) -> Values | None:
        """Return numbers that give a letter if nothing is rounded, if there are any."""
        translation = RealTranslation()
        solver = new_solver(_QUERY_S)
        for item, value in zip(self._terms, letter):
            solver.add(translation(item) if value else z3.Not(translation(item)))
        solver.add(*translation.ranges, *self._ranges(translation.variables, True))
        if solver.check() != z3.sat:
            return None
        return _witness(solver.model(), translation.variables, True)

    def _exact(self, letter: Sequence[bool]) -> Values | None:
        """Return values of floats that give a letter which real numbers have, if there are any."""
        translation = Translation(False)
        solver = new_solver(self._deadline.at_most(_QUERY_S))
        for item, value in zip(self._terms, letter):
            solver.add(translation(item) if value else z3.Not(translation(item)))
        solver.add(*self._ranges(translation.variables, False))
        answer = solver.check()
        if answer == z3.unknown:
            self._gaps['the solver does not decide which comparisons hold together'] = None
        if answer != z3.sat:
            return None
        return _witness(solver.model(), translation.variables, False)

    def _classes(self, shown: Sequence[Any], names: Mapping[Term, Any], ranges: Sequence[Any],
                 letters: Sequence[Letter]) -> tuple[EnvironmentClass, ...] | None:
        count = len(self._environment)
        own = {item: found for item, found in names.items()
               if item not in self._chosen and item not in self._before}
        mixed = [item for item in self._others if variables(item) & set(own)]
        if not mixed:
            return None
        relates = any(variables(item) & self._chosen for item in mixed)
        what = 'a comparison relates inputs to outputs' if relates else BEFORE
        if not self._is_real or self._given or any(
                has_product(item) or variables(item) & self._before for item in self._others):
            self._doubts[what] = None
            return None
        kept = set(map(str, own.values()))
        everything = {str(item): item for part in (*shown, *ranges) for item in _constants(part)}
        eliminated = [item for name, item in everything.items() if name not in kept]
        rests = sorted({letter.truths[count:] for letter in letters})
        possible = {rest: self._possible(rest, shown[count:], eliminated, ranges)
                    for rest in rests}
        if self._is_rounded:
            self._doubts[ROUNDED] = None
        if any(item is None for item in possible.values()):
            self._doubts[what] = None
            return None
        return self._enumerated(own, ranges, shown[:count], possible, letters)

    def _possible(self, rest: Sequence[bool], shown: Sequence[Any], eliminated: Sequence[Any],
                  ranges: Sequence[Any]) -> Any:
        """Return the condition on the environment's inputs under which the system has a choice."""
        self._deadline.check()
        body = z3.And(*ranges, *(item if value else z3.Not(item)
                                 for item, value in zip(shown, rest)))
        goal = z3.Goal()
        goal.add(z3.Exists(list(eliminated), body))
        tactic = z3.TryFor(z3.Then('qe', 'simplify'), int(self._deadline.at_most(_QUERY_S) * 1000))
        try:
            result = tactic(goal)
        except z3.Z3Exception:
            return None
        found = result.as_expr()
        return None if _has_quantifier(found) else found

    def _enumerated(self, own: Mapping[Term, Any], ranges: Sequence[Any], shown: Sequence[Any],
                    possible: Mapping[tuple[bool, ...], Any], letters: Sequence[Letter],
                    ) -> tuple[EnvironmentClass, ...] | None:
        count = len(shown)
        solver = new_solver(self._deadline.at_most(_QUERY_S))
        conditions = [*shown, *possible.values()]
        truths = [z3.Bool(f'class.{place}') for place in range(len(conditions))]
        names = set(map(str, own.values()))
        solver.add(*(item for item in ranges if {str(each) for each in _constants(item)} <= names))
        solver.add(*(truth == item for truth, item in zip(truths, conditions)))
        places = {letter.truths: place for place, letter in enumerate(letters)}
        found: list[EnvironmentClass] = []
        while solver.check() == z3.sat:
            self._deadline.check()
            model = solver.model()
            values = tuple(z3.is_true(model.eval(item, model_completion=True)) for item in truths)
            solver.add(z3.Or(*(truth != value for truth, value in zip(truths, values))))
            choices = [places.get((*values[:count], *rest))
                       for rest, value in zip(possible, values[count:]) if value]
            witness = _witness(model, own, True)
            if not self._is_certain(values, witness):
                continue
            found.append(EnvironmentClass(
                values[:count], witness,
                tuple(place for place in choices if place is not None)))
            if len(found) > _MOST_LETTERS:
                break
        if solver.check() != z3.unsat:
            self._doubts['a comparison relates inputs to outputs'] = None
            return None
        return tuple(found)


def _calls(terms: Sequence[Term]) -> list[str]:
    """Return the names of the library functions that terms call."""
    return sorted({each.op for each in t.postorder(terms) if each.op in t.LIBRARY})


def _witness(model: Any, names: Mapping[Term, Any], is_real: bool) -> Values:
    if is_real:
        return {item: value_of(model.eval(found, model_completion=True), item.sort)
                for item, found in names.items()}
    return {item: value_in(model, found, item.sort) for item, found in names.items()}


def _has_quantifier(found: Any) -> bool:
    return z3.is_quantifier(found) or any(map(_has_quantifier, found.children()))


def _constants(root: Any) -> list[Any]:
    """Return the variables of a z3 expression."""
    found, seen, stack = [], set(), [root]
    while stack:
        item = stack.pop()
        if item.get_id() in seen:
            continue
        seen.add(item.get_id())
        if z3.is_const(item) and item.decl().kind() == z3.Z3_OP_UNINTERPRETED:
            found.append(item)
        stack.extend(item.children())
    return found


def matching(block: Block, letter: Letter, own: Values) -> Values | None:
    """Return values of a letter in which the environment's inputs have given values."""
    translation = RealTranslation()
    solver = new_solver(_QUERY_S)
    for item, value in zip(block.terms, letter.truths):
        solver.add(translation(item) if value else z3.Not(translation(item)))
    solver.add(*translation.ranges)
    for item, value in own.items():
        if item in translation.variables:
            solver.add(translation(t.same(item, t.constant(value, item.sort))))
    if solver.check() != z3.sat:
        return None
    return {**_witness(solver.model(), translation.variables, True), **own}
