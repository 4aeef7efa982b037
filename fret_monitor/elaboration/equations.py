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
Elaborate the equations of a Lustre node to the term of its result.

An equation is substituted wherever its name is used, like a definition. An equation that depends
on itself must do so through a delay (`pre`, `YtoPre`, `ZtoPre`). The delay becomes a `Feedback`
node, and its equation is returned separately. The type of the node is the declared one (`int` is
INT64, `real` FLOAT64), or else the common type of the initial value and the equation.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain, count

from fret_monitor.elaboration.durations import STEPS, TimeScale
from fret_monitor.elaboration.elaborator import Cell, delayed, Elaborator, gives_truth, references
from fret_monitor.elaboration.scope import Declaration, Role, Scope
from fret_monitor.elaboration.settling import settles
from fret_monitor.elaboration.terms import (
    Broken, cast, common_type, convert, describe, expect_bool, expect_number, joined_bounds,
    Lasting, TypedTerm, Undeclared,
)
from fret_monitor.language.expression import (
    Call, children, Conditional, Equations, Expression, Infix, LustreVariable, Name, postorder,
    Prefix,
)
from fret_monitor.logic.formula import FALSE, Feedback, Formula
from fret_monitor.logic.numbers import ExactNumber
from fret_monitor.model.diagnostics import CompileError, did_you_mean, Problems, refuse, Span
from fret_monitor.model.graph import components, cycle, is_cyclic
from fret_monitor.model.values import ValueType

_ROUNDS = 4  # a type widens at most to uint64, int64, float64; the last round changes nothing
_TYPES = {'bool': ValueType.BOOL, 'int': ValueType.INT64, 'real': ValueType.FLOAT64}


def equations_term(tree: Equations, scope: Scope, problems: Problems, owner: str,
                   feedback: dict[Feedback, Formula],
                   scale: TimeScale = STEPS) -> TypedTerm:
    """
    Return the term of the result of some equations; report mistakes to the problems.

    `owner` is the id or name of the requirement or definition with the equations; the names of the
    `Feedback` nodes begin with it. Their equations are added to `feedback`.
    """
    return _LustreNode(tree, scope, problems, owner, feedback, scale).result()


class _LustreNode:
    """The elaboration of the equations of one text."""

    def __init__(self, tree: Equations, scope: Scope, problems: Problems, owner: str,
                 feedback: dict[Feedback, Formula], scale: TimeScale) -> None:
        self._tree = tree
        self._scale = scale
        self._problems = problems
        self._owner = owner
        self._feedback = feedback
        self._equations = {item.name: item for item in tree.equations}
        self._declared = {item.name: item for item in tree.declarations}
        self._outer = scope
        self._scope = Scope(outer=scope)
        self._taken: set[str] = set()
        self._full = {name: self._uses(item.expression, True)
                      for name, item in self._equations.items()}
        self._at_once = {name: self._uses(item.expression, False)
                         for name, item in self._equations.items()}

    def result(self) -> TypedTerm:
        """Elaborate the equations in the order of their dependencies; return the result's term."""
        self._check_declarations()
        for members in components(self._full):
            if is_cyclic(members, self._full):
                self._read_recursive(members)
            else:
                self._read(members[0], self._elaborator({}, self._problems), self._problems)
        result = self._tree.result
        return replace(self._term(result.name), span=result.expression.span)

    def _term(self, name: str) -> TypedTerm:
        """Return the term of an equation that has been elaborated."""
        found = self._scope.find(name)
        assert found is not None
        return found.term

    def _uses(self, expression: Expression, through_delays: bool) -> list[str]:
        return [name for name in self._references(expression, through_delays)
                if name in self._equations]

    def _references(self, expression: Expression, through_delays: bool) -> dict[str, Span]:
        return references(expression, self._outer.vocabulary_of, through_delays)

    def _elaborator(self, cells: Mapping[Expression, Cell], problems: Problems) -> Elaborator:
        return Elaborator(self._scope, problems, is_lustre=True, cells=cells,
                          scale=self._scale)

    # Declarations

    def _check_declarations(self) -> None:
        for item in self._tree.inputs:
            self._scope.declare(item.name, Declaration(Role.INPUT, self._input(item)))
        for equation in self._tree.equations:
            outer = self._outer.find(equation.name)
            if outer is not None:
                self._problems.warning(
                    f"'{equation.name}' is {outer.role.value} and an equation", equation.name_span,
                    'in these equations it is the equation')

    def _input(self, item: LustreVariable) -> TypedTerm:
        outer = self._outer.find(item.name)
        try:
            if outer is None:
                refuse(f"the bundle has no '{item.name}'", item.span, 'an input of this node',
                       self._outer.help_for(item.name))
            if outer.term.is_broken:
                return outer.term
            return _declared(replace(outer.term, span=item.span), item)
        except CompileError as error:
            self._problems.extend(error.diagnostics)
            return TypedTerm(Broken(), item.span)

    def _read(self, name: str, elaborator: Elaborator, problems: Problems) -> None:
        """Elaborate an equation and declare its name; its dependencies must be declared."""
        term = elaborator.term(self._equations[name].expression)
        if name in self._declared and not term.is_broken:
            try:
                term = _declared(term, self._declared[name])
            except CompileError as error:
                problems.extend(error.diagnostics)
                term = TypedTerm(Broken(), term.span)
        self._scope.declare(name, Declaration(Role.EQUATION, term))

    # Recursive equations

    def _read_recursive(self, members: list[str]) -> None:
        inside = {name: [other for other in self._at_once[name] if other in members]
                  for name in members}
        order = components(inside)
        for component in order:
            if is_cyclic(component, inside):
                self._report_cycle(cycle(component, inside))
                for name in members:
                    self._scope.declare(name, Declaration(
                        Role.EQUATION, TypedTerm(Broken(), self._equations[name].span)))
                return
        self._read_loop(_Loop(self._tree, members, self._uses), [item[0] for item in order])

    def _read_loop(self, loop: '_Loop', order: list[str]) -> None:
        """Find the types of a loop's delays by iteration, then elaborate its equations."""
        guesses = {delay: self._first_guess(delay) for delay in loop.delays}
        for _ in range(_ROUNDS):
            found = self._pass(loop, guesses, order, Problems())
            risen = {delay: _risen(guesses[delay], found[delay]) for delay in loop.delays}
            if risen == guesses:
                break
            guesses = risen
        cells = {delay: Feedback(self._feedback_name(delay), _kind(guess))
                 for delay, guess in guesses.items()}
        delayed = self._pass(loop, cells, order, self._problems)
        for delay, term in delayed.items():
            self._close(delay, cells[delay], term, list(cells.values()))
        # Every equation of a loop depends on the bounds in all of them.
        bounds = joined_bounds(*(term.bounds for term in delayed.values()),
                               *(self._term(name).bounds for name in order))
        for name in order:
            term = replace(self._term(name), bounds=bounds)
            self._scope.declare(name, Declaration(Role.EQUATION, term))

    def _pass(self, loop: '_Loop', cells: Mapping['_Delay', Cell], order: list[str],
              problems: Problems) -> dict['_Delay', TypedTerm]:
        """Elaborate the equations of a loop in order; return the operand's term for each delay."""
        by_node = {node: cells[delay] for node, delay in loop.nodes.items()}
        elaborator = self._elaborator(by_node, problems)
        for name in order:
            self._read(name, elaborator, problems)
        return {delay: elaborator.term(delay.argument) for delay in loop.delays}

    def _first_guess(self, delay: '_Delay') -> Cell:
        """Return a cell of the declared type, else the initial value, else a Boolean or number."""
        declared = self._declared.get(delay.name)
        if delay.kind is not None:
            return Feedback('', delay.kind)
        if declared is not None and isinstance(delay.argument, Name) and declared.type in _TYPES:
            return Feedback('', _TYPES[declared.type])
        initial = self._initial(delay.argument)
        if initial is not None:
            return initial
        return FALSE if self._is_boolean(delay.argument) else ExactNumber(Fraction(1), False)

    def _initial(self, argument: Expression) -> Cell | None:
        """Return the `i` of an equation `x = i -> ...`, if it uses no equation."""
        if isinstance(argument, Name) and argument.text in self._equations:
            argument = self._equations[argument.text].expression
        if not isinstance(argument, Infix) or argument.operator != 'arrow':
            return None
        if self._uses(argument.left, True):
            return None
        term = self._elaborator({}, Problems()).term(argument.left)
        match term.value:
            case Undeclared() | Broken() | Lasting():
                return None
            case value:
                return value

    def _is_boolean(self, expression: Expression) -> bool:
        """Whether an expression of a loop, before types are known, seems to be Boolean."""
        seen: set[Expression] = set()
        stack = [expression]
        while stack:
            node = stack.pop()
            if node in seen:
                continue
            seen.add(node)
            match node:
                case Name(text) if text in self._equations:
                    stack.append(self._equations[text].expression)
                case Name(text):
                    outer = self._outer.find(text)
                    return outer is not None and outer.term.is_boolean
                case Prefix('pre') | Infix('arrow') | Conditional() | Call('ite'):
                    stack.extend(reversed(children(node)[-2:]))
                case _:
                    return gives_truth(node)
        return True

    def _feedback_name(self, delay: '_Delay') -> str:
        """Return a name that no other feedback of the bundle has."""
        base = f'{self._owner}.{delay.name}'
        used = {item.name for item in self._feedback} | self._taken
        names = chain([base], (f'{base}.{number}' for number in count(2)))
        name = next(name for name in names if name not in used)
        self._taken.add(name)
        return name

    def _close(self, delay: '_Delay', cell: Feedback, term: TypedTerm,
               loop: Collection[Feedback]) -> None:
        """Record the equation of a feedback of a loop, converted to the feedback's type."""
        match term.value:
            case Undeclared() | Broken() | Lasting():
                return
            case value:
                pass
        if term.is_boolean != (cell.type is ValueType.BOOL) or (
                not term.is_boolean and common_type([cell, value]) is not cell.type):
            self._problems.error(
                f"the type of '{delay.name}' does not stay the same", delay.span,
                f'{_named(cell.type)} was expected, and this is {describe(term)}',
                f'declare it: var {delay.name}: real;')
            return
        try:
            equation = value if term.is_boolean and not isinstance(
                value, ExactNumber) else cast(term, value, cell.type)
        except CompileError as error:
            self._problems.extend(error.diagnostics)
            return
        self._feedback[cell] = equation
        if self._scale.is_timed and not settles(cell, equation, loop):
            self._report_counting(delay)

    def _report_counting(self, delay: '_Delay') -> None:
        self._problems.error(
            f"the equation of '{delay.name}' depends on how often it is evaluated", delay.span,
            'under policy: timed a step is one nanosecond',
            'write one that stays as it is until an input changes, as in a = p -> q or pre a; '
            'for time write a bound, as in OT(2 s, 0, p)')

    def _report_cycle(self, way: list[str]) -> None:
        equation = self._equations[way[0]]
        self._problems.error(
            f"the equation of '{way[0]}' uses its own value at the same step",
            self._references(equation.expression, False)[way[1]], ' -> '.join(way),
            'look at the step before: initial -> pre x')


@dataclass(frozen=True)
class _Delay:
    """A delayed expression of a loop; all operators that delay the same one share a feedback."""

    name: str
    argument: Expression
    kind: ValueType | None
    span: Span


class _Loop:
    """The delays through which some equations depend on themselves."""

    def __init__(self, tree: Equations, members: list[str],
                 uses: Callable[[Expression, bool], list[str]]) -> None:
        self.nodes: dict[Expression, _Delay] = {}
        same: dict[object, _Delay] = {}
        for equation in tree.equations:
            if equation.name not in members:
                continue
            for node in postorder(equation.expression):
                argument = delayed(node)
                if argument is not None and set(uses(argument, True)) & set(members):
                    # All `pre x` of one name x share a delay; other expressions do not.
                    kind = _kind_of(node)
                    key = (argument.text if isinstance(argument, Name) else argument, kind)
                    name = argument.text if isinstance(argument, Name) else equation.name
                    delay = _Delay(name, argument, kind, node.span)
                    self.nodes[node] = same.setdefault(key, delay)
        self.delays = list(same.values())


def _kind_of(node: Expression) -> ValueType | None:
    """Return the type that a delay requires of its operand, None for `pre`."""
    match node:
        case Call('preInt'):
            return ValueType.INT64
        case Call('preReal'):
            return ValueType.FLOAT64
        case Call() | Prefix('Y' | 'Z'):
            return ValueType.BOOL
        case _:
            return None


def _kind(guess: Cell) -> ValueType:
    return common_type([guess]) if isinstance(guess, ExactNumber) else guess.type


def _risen(guess: Cell, term: TypedTerm) -> Cell:
    """Return a guess widened to the type that was found with the previous guess."""
    match term.value:
        case Undeclared() | Broken() | Lasting():
            return guess
        case ExactNumber() as literal:
            found = common_type([literal])
        case formula:
            found = formula.type
    if isinstance(guess, ExactNumber) or guess.type is found:
        return Feedback('', found)
    if ValueType.BOOL in (guess.type, found):
        return guess
    return Feedback('', common_type([guess, Feedback('', found)]))


def _named(kind: ValueType) -> str:
    return 'true or false' if kind is ValueType.BOOL else f'a number ({kind.value})'


def _declared(term: TypedTerm, declaration: LustreVariable) -> TypedTerm:
    """Return a term converted to its declared type."""
    if declaration.type not in _TYPES:
        refuse(f"Lustre's type '{declaration.type}' is not known", declaration.span, '',
               did_you_mean(declaration.type, _TYPES) or 'the types are bool, int and real')
    what = f"'{declaration.name}: {declaration.type}'"
    if declaration.type == 'bool':
        expect_bool(term, what)
        return term
    value = expect_number(term, what)
    is_real = value.is_real if isinstance(value, ExactNumber) else value.type.is_float
    if declaration.type == 'int' and is_real:
        refuse(f'{what} takes whole numbers', term.span, f'this is {describe(term)}',
               f'{declaration.name}: real')
    if declaration.type == 'int' or is_real:
        return term
    if isinstance(value, ExactNumber):
        return replace(term, value=replace(value, is_real=True))
    return replace(term, value=convert(value, ValueType.FLOAT64), vocabulary=None)
