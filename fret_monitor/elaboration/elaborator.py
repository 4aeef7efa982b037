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
Elaborate one expression to a term: resolve names, infer types, evaluate bounds.

The tree is traversed with an explicit stack, each node once, operands first. A mistake is
reported at its operand, and every node that contains it becomes `Broken` without a report, so
that one run reports all mistakes and none twice.

`cells` are the delays (`pre`, `Y`, `Z`) through which an equation of a Lustre node depends on
itself. Each is replaced by the given `Feedback` (or, while its type is still unknown, by a
literal), and its operand is not traversed.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import assert_never, NoReturn, TypeAlias

from fret_monitor.elaboration import arithmetic
from fret_monitor.elaboration.aggregates import refuse_without_instances
from fret_monitor.elaboration.application import Application
from fret_monitor.elaboration.durations import approximate, STEPS, TimeScale
from fret_monitor.elaboration.functions import choice, COUNTING, FUNCTIONS, previous
from fret_monitor.elaboration.future import aligned, bounded, FUTURE, future_formula
from fret_monitor.elaboration.scope import Role, Scope
from fret_monitor.elaboration.terms import (
    alike, Broken, describe, expect_bool, joined_bounds, TypedTerm, Undeclared, Value, Vocabulary,
)
from fret_monitor.elaboration.windows import window
from fret_monitor.language.expression import (
    Boolean, Call, children, Conditional, Duration, Expression, Infix, Name, Number, postorder,
    Prefix,
)
from fret_monitor.language.fretish_words import TIME
from fret_monitor.language.misplaced import refuse_measure, refuse_time_last
from fret_monitor.logic.formula import (
    Binary, BinaryOperator, Choice, Constant, FALSE, Feedback, Formula, FTP, Historically, Once,
    Previous, Since, Triggered, TRUE, Unary, UnaryOperator, WeakYesterday, Window, Yesterday,
)
from fret_monitor.logic.numbers import ExactNumber, NumberError, parse_number
from fret_monitor.model.diagnostics import (
    CompileError, Diagnostic, did_you_mean, Problems, refuse, Span, TYPO,
)
from fret_monitor.model.policies import Policy

_CONNECTIVES = {item.value: item for item in BinaryOperator if item.is_boolean}
_RELATIONS = {item.value: item for item in BinaryOperator if item.is_relation}
_ARITHMETIC = {item.value: item for item in (
    BinaryOperator.ADD, BinaryOperator.SUB, BinaryOperator.MUL, BinaryOperator.DIV,
    BinaryOperator.MOD)}
_PRE_FUNCTIONS = frozenset({'preBool', 'preInt', 'preReal'})
# FRET's future-time functions, each with its closest past-time counterpart.
_FUTURE = {'persists': 'persisted(n, p)', 'occurs': 'occurred(n, p)', 'nextOcc': 'prevOcc(p, q)'}
_TYPED_PAIR = _RELATIONS.keys() | {'arrow'}
_NOT_FIRST = (Unary(UnaryOperator.NOT, FTP), Yesterday(TRUE))


FindVocabulary: TypeAlias = Callable[[str], Vocabulary | None]


def delayed(node: Expression) -> Expression | None:
    """Return the operand that a node delays by one step, or None if it is not a delay."""
    match node:
        case Prefix('pre' | 'Y' | 'Z', None, argument, _, _):
            return argument
        case Call(function, (_, argument), _, _) if function in _PRE_FUNCTIONS:
            return argument
        case _:
            return None


def gives_truth(node: Expression) -> bool:
    """Whether a node's operator always has a Boolean result; False for `pre`, `ite` and names."""
    match node:
        case Boolean():
            return True
        case Prefix():
            return node.operator not in ('-', 'pre')
        case Infix():
            return node.operator not in _ARITHMETIC and node.operator not in ('^', 'arrow')
        case Call():
            if node.variables:
                return node.function in ('any', 'all')
            return node.function in FUNCTIONS and FUNCTIONS[node.function].gives_truth
        case Name() | Number() | Duration() | Conditional():
            return False
        case _:
            assert_never(node)


def references(root: Expression, vocabulary_of: FindVocabulary,
               through_delays: bool = True, in_bounds: bool = False) -> dict[str, Span]:
    """
    Return the names that an expression refers to, each with the place of its first use.

    `vocabulary_of` returns the names of an input's values, if it has any: if LANDING is a value of
    `state`, then `state = LANDING` does not refer to a name LANDING. Without `through_delays`,
    names below a delay are left out; those in bounds are found with `in_bounds` alone.
    """
    found: dict[str, Span] = {}
    for name in uses(root, vocabulary_of, through_delays, in_bounds):
        found.setdefault(name.text, name.span)
    return found


def uses(root: Expression, vocabulary_of: FindVocabulary, through_delays: bool = True,
         in_bounds: bool = False) -> Iterator[Name]:
    """Yield the names that an expression refers to, at each place; see `references`."""
    seen: set[Expression] = set()
    stack = [root]
    while stack:
        node = stack.pop()
        if node in seen:
            continue
        seen.add(node)
        if isinstance(node, Name):
            yield node
        if in_bounds and isinstance(node, Prefix | Infix) and node.bound is not None:
            stack.extend(end for end in (node.bound.low, node.bound.high)
                         if end is not None and not isinstance(end, str))
        parts = _without_values(node, vocabulary_of)
        if not through_delays and delayed(node) is not None:
            parts = parts[:-1]
        stack.extend(reversed(parts))


def _without_values(node: Expression, vocabulary_of: FindVocabulary) -> tuple[Expression, ...]:
    match node:
        case Infix(operator, _, Name(left), Name(right)) if operator in _RELATIONS:
            for name, value, part in ((left, right, node.left), (right, left, node.right)):
                vocabulary = vocabulary_of(name)
                if vocabulary is not None and value in vocabulary.listed:
                    return (part,)
    return children(node)


Cell: TypeAlias = Formula | ExactNumber


class Elaborator:
    """Elaborates the expressions of one text; see the module's docstring."""

    def __init__(self, scope: Scope, problems: Problems, *, is_lustre: bool = False,
                 cells: Mapping[Expression, Cell] | None = None,
                 left: Formula | None = FTP, scale: TimeScale = STEPS,
                 counters: dict[Feedback, Formula] | None = None) -> None:
        """
        Store the scope of the names and the list for reports.

        `is_lustre` enables the warnings for Lustre. `left` holds at the left end of the interval
        in which `persisted`, `occurred` and `prevOcc` look back; None for no left end. `scale`
        says what counts and times mean. `counters` collects the equations of numbers that count,
        which operators of the future need.
        """
        self._scope = scope
        self._problems = problems
        self._is_lustre = is_lustre
        self._cells = cells or {}
        self._left = left
        self._scale = scale
        self._counters = {} if counters is None else counters
        self._done: dict[Expression, TypedTerm] = {}
        self._reported: set[str] = set()

    def term(self, root: Expression) -> TypedTerm:
        """Return the term of an expression; report mistakes to the problems."""
        stack = [(root, False)]
        while stack:
            node, ready = stack.pop()
            if node in self._done:
                continue
            parts = self._operands(node)
            if ready:
                self._done[node] = self._build(node, [self._done[part] for part in parts])
            else:
                stack.append((node, True))
                stack.extend((part, False) for part in reversed(parts))
        term = self._done[root]
        if isinstance(term.value, Undeclared):
            return self._settle(term.value, term.span, None)
        return term

    def _operands(self, node: Expression) -> tuple[Expression, ...]:
        parts = children(node)
        return parts[:-1] if node in self._cells else parts

    def _build(self, node: Expression, operands: list[TypedTerm]) -> TypedTerm:
        if isinstance(node, Name):
            return replace(self._declared(node), span=node.span)
        operands = self._named(node, operands)
        is_broken = any(term.is_broken for term in operands)
        if is_broken or any(map(self._is_broken, _bound_names(node))):
            return TypedTerm(Broken(), node.span)
        try:
            operands, horizon = aligned(node, self._counted(node, operands))
            horizon = self._horizon(node, horizon)
            value, vocabulary = self._meaning(node, operands)
        except CompileError as error:
            self._problems.extend(error.diagnostics)
            return TypedTerm(Broken(), node.span)
        bounds = joined_bounds(self._own_bounds(node, operands),
                               *(term.bounds for term in operands))
        term = TypedTerm(value, node.span, vocabulary, bounds=bounds, horizon=horizon)
        return _with_first_steps(term, node, operands)

    def _horizon(self, node: Expression, of_operands: int) -> int:
        """Return how many steps later the value of a node is known."""
        if not isinstance(node, Prefix | Infix) or node.operator not in FUTURE:
            return of_operands
        past = window(node.bound, self._constant, self._scale, is_ahead=True)
        ahead = bounded(node.operator, past, node.operator_span)
        self._scale.check_longest(ahead + of_operands, node.span)
        return ahead + of_operands

    def _future(self, operator: str, past: Window, operands: list[Formula]) -> Formula:
        return future_formula(operator, past, operands,
                              self._counters if self._scale.is_timed else None)

    def _own_bounds(self, node: Expression, operands: list[TypedTerm]) -> Iterator[int]:
        """Yield the numbers of steps in the bound or the arguments of a node itself."""
        match node:
            case Prefix() | Infix() if node.bound is not None:
                past = window(node.bound, self._constant, self._scale)
                yield from (end for end in (past.low, past.high) if end is not None)
            case Call(function) if function in COUNTING:
                # The operands are steps or nanoseconds here, see _counted.
                yield from (term.value.value.numerator for term in operands[:-1]
                            if isinstance(term.value, ExactNumber))

    # Names

    def _declared(self, node: Name) -> TypedTerm:
        declaration = self._scope.find(node.text)
        return declaration.term if declaration else TypedTerm(Undeclared(node.text), node.span)

    def _named(self, node: Expression, operands: list[TypedTerm]) -> list[TypedTerm]:
        """Replace names of values by their numbers, and report undeclared names."""
        group = () if node in self._cells else _sharing(node)
        shared = [operands[i] for i in group]
        vocabulary = next((term.vocabulary for term in shared if term.vocabulary), None)
        parts = self._operands(node)
        named = list(operands)
        for i in group:
            named[i] = self._value(parts[i], operands[i], vocabulary)
        # The unknown name may be a value of an operand that was reported: do not report it.
        is_cascade = any(operands[i].is_broken and isinstance(parts[i], Name) for i in group)
        return [term if not isinstance(term.value, Undeclared)
                else TypedTerm(Broken(), term.span) if is_cascade and i in group
                else self._settle(term.value, term.span, vocabulary if i in group else None)
                for i, term in enumerate(named)]

    def _value(self, node: Expression, term: TypedTerm,
               vocabulary: Vocabulary | None) -> TypedTerm:
        if not isinstance(node, Name) or vocabulary is None:
            return term
        if node.text not in vocabulary.numbers or term.vocabulary == vocabulary:
            return term
        declaration = self._scope.find(node.text)
        if declaration is not None and node.text not in vocabulary.listed:
            hidden = vocabulary.numbers[node.text]
            if isinstance(term.value, ExactNumber) and term.value.value != hidden:
                self._problems.warning(
                    f"'{node.text}' is {declaration.role.value} and a value of "
                    f"'{vocabulary.constants.field}'", node.span,
                    f'here it is {declaration.role.value}: {term.value.value}',
                    f'give it another name; the value of the message is {hidden}')
            return term
        if declaration is not None:
            self._problems.warning(
                f"'{node.text}' is {declaration.role.value} and the name of a value", node.span,
                'here it is the value')
        constants = vocabulary.constants
        owner = dict(constants.strangers).get(node.text)
        if owner is not None and node.text not in vocabulary.listed:
            own = [name for name, _ in constants.own]
            self._problems.warning(
                f"'{node.text}' is a value of '{owner}' by its name", node.span,
                f"and not of '{constants.field}'",
                did_you_mean(node.text, own) or (f'its values are {vocabulary}' if own else ''))
        number = ExactNumber(Fraction(vocabulary.numbers[node.text]), False)
        return TypedTerm(number, node.span, vocabulary)

    def _settle(self, value: Undeclared, span: Span, vocabulary: Vocabulary | None) -> TypedTerm:
        """Report an undeclared name, unless it was reported before; return a broken term."""
        if value.name not in self._reported and not self._scope.is_cut:
            self._reported.add(value.name)
            self._report_unknown(value.name, span, vocabulary)
        return TypedTerm(Broken(), span)

    def _report_unknown(self, name: str, span: Span, vocabulary: Vocabulary | None) -> None:
        if vocabulary is None:
            self._problems.error(f"'{name}' is not declared", span, 'unknown name',
                                 self._scope.help_for(name))
            return
        owners = self._scope.owners.get(name)
        known = dict.fromkeys([*vocabulary.numbers, *self._scope.known()])
        meant = next((value for value, text in vocabulary.named if text == name), '')
        help_ = f"it is a value of '{owners[0]}'" if owners else \
            f'write its name: {meant}' if meant else did_you_mean(name, known)
        self._problems.error(
            f"'{name}' is neither declared nor a value of the other operand", span,
            'unknown name', help_ or f'the values are {vocabulary}')

    def _constant(self, node: Name) -> int:
        """Return the value of a constant in a bound; refuse other names."""
        declaration = self._scope.find(node.text)
        if declaration is None:
            if TIME.fullmatch(node.text):
                refuse('a time is written without quotes', node.span, 'a name in quotes',
                       f'write {node.text}')
            refuse(f"'{node.text}' is not declared", node.span,
                   'a bound takes numbers and constants',
                   did_you_mean(node.text, self._scope.constants)
                   or f'declare it, as in constants: {{{node.text}: 10}}')
        if declaration.role is not Role.CONSTANT:
            refuse('a bound takes numbers and constants', node.span,
                   f'this is {declaration.role.value}')
        value = declaration.term.value
        if not isinstance(value, ExactNumber) or value.is_real or value.value < 0:
            is_real = (isinstance(value, ExactNumber) and value.value.denominator == 1
                       and value.is_real)
            if self._scale.is_timed and isinstance(value, ExactNumber) and value.value >= 0:
                time = approximate(value.value * (self._scale.unit or 1))
                refuse('a constant in a bound must be a whole number of units', node.span,
                       f'this is {describe(declaration.term)}' + ', as a real number' * is_real,
                       f'write the time itself, such as {time} s: a constant has no unit')
            refuse('a bound must be a whole number of steps, at least 0', node.span,
                   f'this is {describe(declaration.term)}' + ', as a real number' * is_real)
        return value.value.numerator

    def _is_broken(self, name: Name) -> bool:
        declaration = self._scope.find(name.text)
        return self._scope.is_cut if declaration is None else declaration.term.is_broken

    def _counted(self, node: Expression, operands: list[TypedTerm]) -> list[TypedTerm]:
        """Return the operands with the counts and times among them as steps or nanoseconds."""
        parts = self._operands(node)
        counts = len(parts) - 1 if isinstance(node, Call) and node.function in COUNTING else 0
        if isinstance(node, Call) and counts:
            self._check_policy(node)
        for part in parts[counts:]:
            if isinstance(part, Duration):
                if isinstance(node, Call) and node.function not in FUNCTIONS:
                    if node.function == 'rate':
                        refuse_measure(part.span)
                    self._refuse_function(node)
                if isinstance(node, Call) and counts:
                    refuse_time_last(node.function, parts[0].span.written, part.span)
                refuse('a time cannot be used here', part.span, 'this has a unit',
                       'only bounds, and functions such as persisted, take times')
        return [replace(term, value=self._steps(part, term)) for part, term in
                zip(parts[:counts], operands, strict=False)] + operands[counts:]

    def _check_policy(self, node: Call) -> None:
        if FUNCTIONS[node.function].is_timed and not self._scale.is_timed:
            first = node.arguments[0]
            is_count = not isinstance(first, Duration) or self._scale.policy is Policy.PERIODIC
            refuse(f"'{node.function}' needs the policy timed", node.span,
                   'here steps are counted, and have no length',
                   f'write countOver({first.span.written if is_count else 10}, ...), which counts '
                   'steps; or evaluation: {policy: timed}')

    def _steps(self, part: Expression, term: TypedTerm) -> Value:
        if isinstance(part, Duration):
            return ExactNumber(Fraction(self._scale.time(part)), False)
        value = term.value
        if isinstance(value, ExactNumber) and not value.is_real:
            return replace(value, value=Fraction(
                self._scale.count(value.value.numerator, term.span)))
        return value

    # Operators

    def _meaning(self, node: Number | Boolean | Duration | Prefix | Infix | Call | Conditional,
                 operands: list[TypedTerm]) -> tuple[Value, Vocabulary | None]:
        match node:
            case Number():
                return _number(node), None
            case Boolean():
                return TRUE if node.value else FALSE, None
            case Duration():
                return ExactNumber(Fraction(0), False), None  # see _counted
            case Prefix():
                return self._prefix(node, operands)
            case Infix():
                return self._infix(node, operands[0], operands[1])
            case Call():
                return self._call(node, operands)
            case Conditional():
                return choice(operands[0], operands[1], operands[2], "'if'"), _common(operands[1:])
            case _:
                assert_never(node)

    def _prefix(self, node: Prefix, operands: list[TypedTerm]) -> tuple[Value, Vocabulary | None]:
        if node in self._cells:
            return _delay(node.operator, self._cells[node]), None
        (operand,) = operands
        if node.operator == 'pre':
            return _bare_pre(operand), operand.vocabulary
        if node.operator == '-':
            return arithmetic.minus(operand), None
        argument = expect_bool(operand, f"'{node.operator}'")
        past = window(node.bound, self._constant, self._scale)
        if node.operator in FUTURE:
            return self._future(node.operator, past, [argument]), None
        return _past(node, past, argument), None

    def _infix(self, node: Infix, left: TypedTerm,
               right: TypedTerm) -> tuple[Value, Vocabulary | None]:
        operator = node.operator
        name = f"'{operator}'"
        if operator == 'arrow':
            return self._arrow(node, left, right), _common([left, right])
        if operator in _RELATIONS:
            return arithmetic.relation(_RELATIONS[operator], left, right, name, node.span,
                                       self._problems), None
        if operator in _ARITHMETIC:
            return arithmetic.arithmetic(_ARITHMETIC[operator], left, right, name, node.span,
                                         self._problems), None
        if operator == '^':
            return arithmetic.power(left, right, node.span), None
        return self._logical(node, left, right, name), None

    def _arrow(self, node: Infix, left: TypedTerm, right: TypedTerm) -> Formula:
        if isinstance(node.right, Prefix) and node.right.operator == 'pre' and (
                node.right not in self._cells):
            return previous(left, self._done[node.right.argument], "'->'")
        first, later = alike([left, right], "'->'")
        return Choice(FTP, first, later)

    def _logical(self, node: Infix, left: TypedTerm, right: TypedTerm, name: str) -> Formula:
        _refuse_mistaken_relation(node, right)
        p, q = _both_true(left, right, name)
        if node.operator in _CONNECTIVES:
            return Binary(_CONNECTIVES[node.operator], p, q)
        past = window(node.bound, self._constant, self._scale)
        if node.operator in FUTURE:
            return self._future(node.operator, past, [p, q])
        if self._is_lustre and past.low > 0:
            self._problems.warning(
                "FRET's own Lustre library differs when the lower bound is above 0",
                node.operator_span, 'the metric meaning is used here',
                "FRET's library computes the unbounded operator and the bounded O")
        match node.operator:
            case 'S':
                return Since(past, p, q)
            case 'SI':
                return Since(past, p, Binary(BinaryOperator.AND, p, q))
            case 'T':
                return Triggered(past, p, q)
            case _:
                raise AssertionError(f'no operator {node.operator}')

    def _call(self, node: Call, operands: list[TypedTerm]) -> tuple[Value, Vocabulary | None]:
        name = node.function
        if node.variables:
            if self._scope.aggregates is None:
                refuse_without_instances(node)
            return self._scope.aggregates.value(node, operands[0]), None
        function = FUNCTIONS.get(name)
        if function is None:
            self._refuse_function(node)
        if not function.takes(len(node.arguments)):
            forms = ' or '.join(f'{name}({form})' for form in function.forms)
            refuse(f"'{name}' has the wrong number of arguments", node.span,
                   f'{len(node.arguments)} given', f'write {forms}')
        if node in self._cells:
            delayed_term = TypedTerm(self._cells[node], node.span)
            first, later = alike([operands[0], delayed_term], f"'{name}'")
            return Choice(FTP, first, later), None
        call = Application(name, tuple(operands), node.span, self._problems, self._left,
                           self._scale, self._scope.implied)
        return function.meaning(call), self._shared_vocabulary(node, operands)

    def _shared_vocabulary(self, node: Call, operands: list[TypedTerm]) -> Vocabulary | None:
        group = _sharing(node)
        return _common([operands[i] for i in group]) if group else None

    def _refuse_function(self, node: Call) -> NoReturn:
        declaration = self._scope.find(node.function)
        if declaration is not None:
            _refuse_application(node, declaration.role)
        if node.function in _FUTURE:
            refuse('the future cannot be monitored', node.function_span,
                   f"'{node.function}' refers to the future", f'write {_FUTURE[node.function]}')
        title = f"there is no function '{node.function}'"
        near = did_you_mean(node.function, FUNCTIONS, TYPO)
        element = _element(node)
        if element and not near:
            refuse(f'{title}, and arrays are not supported', node.span, 'not known',
                   f'for an element of an array declare an input of its own, such as {element}')
        refuse(title, node.function_span, '', near or 'one of ' + ', '.join(sorted(FUNCTIONS)))


def _element(node: Call) -> str:
    """Return a name for an element of an array; '' unless all arguments are numbers."""
    indices = [item.text for item in node.arguments if isinstance(item, Number)]
    return '_'.join([node.function, *indices]) if len(indices) == len(node.arguments) else ''


def _refuse_application(node: Call, role: Role) -> NoReturn:
    """Refuse a declared name with arguments: numbers are taken as an array's index."""
    name = node.function
    if element := _element(node):
        refuse('arrays are not supported', node.span, f"'{name}' is {role.value}",
               f'declare each element as an input of its own, such as {element}')
    refuse(f"there is no function '{name}'", node.function_span, f"'{name}' is {role.value}",
           f'declare the value of {name}(...) as an input of its own')


def _bound_names(node: Expression) -> Iterator[Name]:
    """Yield the names in the bound of a node, if it has one."""
    if isinstance(node, Prefix | Infix) and node.bound is not None:
        for end in (node.bound.low, node.bound.high):
            if end is not None and not isinstance(end, str):
                yield from (part for part in postorder(end) if isinstance(part, Name))


def _number(node: Number) -> ExactNumber:
    try:
        return parse_number(node.text)
    except NumberError as error:
        refuse('this number cannot be used', node.span, str(error))


def _bare_pre(operand: TypedTerm) -> Formula:
    """Return Lustre's `pre x` without `->`: undefined at the first step, false or 0 here."""
    if operand.is_boolean:
        return previous(TypedTerm(FALSE, operand.span), operand, "'pre'")
    argument = alike([operand], "'pre'")[0]
    zero = 0.0 if argument.type.is_float else 0
    return Previous(Constant(zero, argument.type), argument)


def _delay(operator: str, cell: Cell) -> Cell:
    # Feedback is false at the first step, as Y is; Z is true there.
    if operator != 'Z' or isinstance(cell, ExactNumber):
        return cell
    return Binary(BinaryOperator.OR, FTP, cell)


def _past(node: Prefix, past: Window, argument: Formula) -> Formula:
    if node.bound is not None and node.operator not in ('O', 'H'):
        refuse(f"'{node.operator}' takes no bound", node.bound.span, 'only O, H, S, T, SI do')
    match node.operator:
        case '!':
            return Unary(UnaryOperator.NOT, argument)
        case 'Y':
            return Yesterday(argument)
        case 'Z':
            return WeakYesterday(argument)
        case 'O':
            return Once(past, argument)
        case 'H':
            return Historically(past, argument)
        case _:
            raise AssertionError(f'no operator {node.operator}')


def _refuse_mistaken_relation(node: Infix, right: TypedTerm) -> None:
    """Refuse `x => 3`: an implication of a number, where `>=` was probably meant."""
    place = node.operator_span
    is_number = not (right.is_boolean or right.is_broken or right.vocabulary)
    if is_number and place.source.text[place.start:place.end] == '=>':
        refuse("'=>' takes only true or false", right.span, f'this is {describe(right)}',
               "=> is an implication; for 'at least' write >=")


def _both_true(left: TypedTerm, right: TypedTerm, name: str) -> list[Formula]:
    """Return two operands that must be BOOL; if neither is, raise both errors."""
    found: list[Formula] = []
    wrong: list[Diagnostic] = []
    for term in (left, right):
        try:
            found.append(expect_bool(term, name))
        except CompileError as error:
            wrong.extend(error.diagnostics)
    if wrong:
        raise CompileError(wrong)
    return found


def _sharing(node: Expression) -> tuple[int, ...]:
    """Return the indices of the operands that can name each other's values."""
    match node:
        case Infix(operator) if operator in _TYPED_PAIR:
            return (0, 1)
        case Call(function) if function in _PRE_FUNCTIONS and len(node.arguments) == 2:
            return (0, 1)
        case Call('ite') if len(node.arguments) == 3:
            return (1, 2)
        case Call('heldAt') if len(node.arguments) == 2:
            return (1,)
        case Conditional():
            return (1, 2)
        case _:
            return ()


def _common(terms: Sequence[TypedTerm]) -> Vocabulary | None:
    """Return the vocabulary of all terms if it is the same; plain numbers are ignored."""
    found = {term.vocabulary for term in terms
             if not isinstance(term.value, ExactNumber) or term.vocabulary}
    return found.pop() if len(found) == 1 else None


def _with_first_steps(term: TypedTerm, node: Expression, operands: list[TypedTerm]) -> TypedTerm:
    """Set the number of initial steps at which a bare `pre` leaves the term undefined."""
    worst = max(operands, key=lambda operand: operand.undefined, default=term)
    undefined, origin = worst.undefined, worst.origin
    match node:
        case Prefix('pre'):
            undefined, origin = undefined + 1, origin or node.operator_span
        case Infix('arrow'):
            first, later = operands
            undefined = later.undefined if later.undefined > 1 else min(first.undefined, 1)
        case Infix('|' | '&' | '->') if undefined == 1 and _is_guarded(node, operands):
            undefined = 0
    return replace(term, undefined=undefined, origin=origin) if undefined else term


def _is_guarded(node: Infix, operands: list[TypedTerm]) -> bool:
    """Whether FTP decides the result at the first step: `pre p | FTP`, `pre p & !FTP`."""
    left, right = (operand.value for operand in operands)
    if node.operator == '->':
        return left in _NOT_FIRST
    if node.operator == '|':
        return FTP in (left, right)
    return left in _NOT_FIRST or right in _NOT_FIRST
