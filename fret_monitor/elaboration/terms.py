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
Terms: expressions during type inference, and the rules for common types.

A `TypedTerm` holds a typed `Formula`, an `ExactNumber` without a type yet, a name that only a
comparison can resolve (`LANDING` in `state = LANDING`), or a mark that a mistake was reported.
`unify`, `convert` and `cast` implement the conversions of docs/numbers.md. Errors are
`CompileError`, at the place of the operand with the wrong type.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NoReturn, TypeAlias

from fret_monitor.logic.formula import Constant, Conversion, Formula
from fret_monitor.logic.numbers import constant, ExactNumber, NumberError
from fret_monitor.messages.constants import FieldConstants, NamedValues, NO_CONSTANTS
from fret_monitor.model.diagnostics import refuse, Span
from fret_monitor.model.values import ValueType

_MANY = 8


@dataclass(frozen=True)
class Vocabulary:
    """
    The names of an input's values: pairs `(name, number or string)`.

    `values` are those that the bundle lists, `constants` those of the message, which names that
    the bundle declares hide. A string is represented by the index of its first occurrence in
    `named`.
    """

    values: NamedValues
    constants: FieldConstants = NO_CONSTANTS

    @cached_property
    def named(self) -> NamedValues:
        """The names of `Signal.values`: those of the bundle, and the field's own constants."""
        if not self._are_constants_used:
            return self.values
        own = self.constants.all if self.is_text else self.constants.own
        return self.values + tuple(item for item in own if item[0] not in self.listed)

    @property
    def _are_constants_used(self) -> bool:
        """Whether constants are added: never to strings that the bundle lists."""
        return not any(isinstance(value, str) for _, value in self.values)

    @cached_property
    def is_text(self) -> bool:
        """Whether the input is a string."""
        return any(isinstance(value, str) for _, value in self.values or self.constants.all)

    @cached_property
    def numbers(self) -> dict[str, int]:
        """The number of each name."""
        constants = self.constants.all if self._are_constants_used else ()
        found = [value for _, value in self.named]
        return {name: value if isinstance(value, int) else found.index(value)
                for name, value in (*constants, *self.values)}

    @cached_property
    def listed(self) -> frozenset[str]:
        """The names that the bundle lists."""
        return frozenset(name for name, _ in self.values)

    def __str__(self) -> str:
        """Return the names for a message; only the first ones if there are many."""
        names = [name for name, _ in self.named or self.constants.all]
        return ', '.join(names[:_MANY]) + (', ...' if len(names) > _MANY else '')


@dataclass(frozen=True, eq=False)
class Undeclared:
    """A name without a declaration; it may be the name of a value in a comparison."""

    name: str


@dataclass(frozen=True, eq=False)
class Broken:
    """An expression with a mistake that was reported; what contains it is broken, too."""


@dataclass(frozen=True, eq=False)
class Lasting:
    """
    `timeOver`: how long `argument` held in the last `past` nanoseconds.

    It changes at every nanosecond, and is therefore only compared with constants.
    """

    past: int
    argument: Formula


Value: TypeAlias = Formula | ExactNumber | Undeclared | Broken | Lasting
Number: TypeAlias = Formula | ExactNumber


@dataclass(frozen=True, eq=False)
class TypedTerm:
    """
    The value of an expression, and its place.

    `vocabulary` is set if it is an input with names of values, or `pre` or a choice of such
    inputs. `undefined` is the number of initial steps at which it has no value, because of a
    `pre` of Lustre without `->` at the place `origin`. `bounds` are the largest few of the
    numbers of steps in its text. `horizon` is how many steps later its value is known.
    """

    value: Value
    span: Span
    vocabulary: Vocabulary | None = None
    undefined: int = 0
    origin: Span | None = None
    bounds: frozenset[int] = frozenset()
    horizon: int = 0

    @property
    def is_broken(self) -> bool:
        """Whether it contains a mistake, which was reported."""
        return isinstance(self.value, Broken)

    @property
    def is_boolean(self) -> bool:
        """Whether it is Boolean."""
        match self.value:
            case ExactNumber() | Undeclared() | Broken() | Lasting():
                return False
            case formula:
                return formula.type is ValueType.BOOL

    @property
    def is_text(self) -> bool:
        """Whether it is a string input, or a name of its values."""
        return self.vocabulary is not None and self.vocabulary.is_text


MANY_BOUNDS = 5  # that a term remembers


def joined_bounds(*bounds: Iterable[int]) -> frozenset[int]:
    """Return the largest few of some bounds."""
    found = {steps for each in bounds for steps in each if steps > 0}
    return frozenset(sorted(found)[-MANY_BOUNDS:])


def describe(term: TypedTerm) -> str:
    """Return a description of a term for messages."""
    if term.is_text:
        return 'text'
    match term.value:
        case ExactNumber() as literal:
            return f'the number {literal}'
        case Undeclared(name):
            return f"the unknown name '{name}'"
        case Broken():
            return 'a mistake'
        case Lasting():
            return 'a time that changes all the time'
        case Constant(bool(value), _):
            return str(value).upper()
        case formula:
            return 'true or false' if term.is_boolean else f'a number ({formula.type.value})'


def expect_bool(term: TypedTerm, operator: str) -> Formula:
    """Return a term's formula; refuse it unless it is BOOL, as `operator` requires."""
    value = term.value
    if not term.is_boolean or isinstance(value, (ExactNumber, Undeclared, Broken, Lasting)):
        refuse(f'{operator} takes only true or false', term.span,
               f'this is {describe(term)}', truth_help(term))
    return value


def truth_help(term: TypedTerm) -> str:
    """Return what to write for a term that is not true or false."""
    written = term.span.written
    match term.value:
        case ExactNumber() if written.isidentifier():  # the name of a constant
            return f'compare it with something, as in x <= {written}'
        case ExactNumber(value, _, _) if value in (0, 1):
            return f"write {'TRUE' if value else 'FALSE'}"
        case ExactNumber():
            return ''
        case Lasting():
            return 'compare it with seconds, as in timeOver(10 s, p) <= 2.5'
    if term.vocabulary is not None:
        return f'compare it with one of its values: {term.vocabulary}'
    return 'compare it with something, as in x > 0'


def expect_number(term: TypedTerm, operator: str, instead: str = '') -> Number:
    """Return a term's formula or literal; refuse it unless it is a number."""
    if term.is_text:
        refuse(f'{operator} takes numbers', term.span, 'this is text', instead or
               f'text can be compared by = and != with its names: {term.vocabulary}')
    value = term.value
    if isinstance(value, Lasting):
        _refuse_lasting(term)
    if term.is_boolean or isinstance(value, (Undeclared, Broken)):
        refuse(f'{operator} takes numbers', term.span, f'this is {describe(term)}',
               instead if term.is_boolean else '')
    return value


def _refuse_lasting(term: TypedTerm) -> NoReturn:
    refuse("'timeOver' is only compared with constants", term.span,
           f'this is {describe(term)}', 'write timeOver(10 s, p) <= 2.5, in seconds')


def unify(numbers: Iterable[Number]) -> ValueType | None:
    """
    Return the common type of some numbers; None if all are literals, which stay exact.

    float64, if one is float64, or a float or real literal occurs with an integer; else float32,
    if one is; else uint64, if all are uint64 or literals >= 0; else int64.
    """
    values = list(numbers)
    literals = [value for value in values if isinstance(value, ExactNumber)]
    types = {value.type for value in values if not isinstance(value, ExactNumber)}
    if not types:
        return None
    has_integer = any(kind.is_integer for kind in types)
    if types == {ValueType.FLOAT32}:
        return ValueType.FLOAT32
    if not has_integer or (len(types) > 1 and any(kind.is_float for kind in types)):
        return ValueType.FLOAT64
    if any(literal.is_real for literal in literals):
        return ValueType.FLOAT64
    is_unsigned = types == {ValueType.UINT64} and all(item.value >= 0 for item in literals)
    return ValueType.UINT64 if is_unsigned else ValueType.INT64


def common_type(values: Iterable[Number]) -> ValueType:
    """Return the common type of some numbers; int64, uint64 or float64 if all are literals."""
    numbers = list(values)
    kind = unify(numbers)
    if kind is not None:
        return kind
    literals = [value for value in numbers if isinstance(value, ExactNumber)]
    if any(literal.is_real for literal in literals):
        return ValueType.FLOAT64
    exact = [literal.value for literal in literals]
    is_unsigned = min(exact) >= 0 and max(exact) > ValueType.INT64.limits[1]
    return ValueType.UINT64 if is_unsigned else ValueType.INT64


def promoted(formula: Formula) -> Formula:
    """Return a number in a type that operators take: small integer types become INT64."""
    return convert(formula, common_type([formula]))


def convert(formula: Formula, kind: ValueType) -> Formula:
    """Convert a number to the type `kind`."""
    return formula if formula.type is kind else Conversion(formula, kind)


def cast(term: TypedTerm, value: Number, kind: ValueType) -> Formula:
    """Convert the number of a term to the type `kind`; a literal is rounded here, once."""
    if not isinstance(value, ExactNumber):
        return convert(value, kind)
    try:
        return constant(value, kind)
    except NumberError as error:
        refuse(f'{value} cannot be a number of type {kind.value}', term.span, str(error))


def alike(terms: Sequence[TypedTerm], operator: str) -> list[Formula]:
    """
    Return the terms as formulas of one type: all BOOL, or all numbers of the common type.

    Texts must have the same vocabulary.
    """
    if any(term.is_boolean for term in terms):
        return [_same_truth(term, operator) for term in terms]
    if any(term.is_text for term in terms):
        return same_text(terms, operator)
    numbers = [expect_number(term, operator) for term in terms]
    kind = common_type(numbers)
    return [cast(term, value, kind) for term, value in zip(terms, numbers)]


def _same_truth(term: TypedTerm, operator: str) -> Formula:
    if not term.is_boolean:
        refuse(f'{operator} takes two numbers, or two truth values', term.span,
               f'this is {describe(term)}, the other is true or false', truth_help(term))
    return expect_bool(term, operator)


def same_text(terms: Sequence[TypedTerm], operator: str) -> list[Formula]:
    """Return the indices of texts as INT64; all must have the same vocabulary."""
    vocabulary = next(term.vocabulary for term in terms if term.is_text)
    for term in terms:
        if term.vocabulary != vocabulary:
            refuse(f'{operator} cannot take text together with something else', term.span,
                   f'this is {describe(term)}',
                   f'text can be compared by = and != with its names: {vocabulary}')
    values = [term.value for term in terms]
    return [cast(term, value, ValueType.INT64) for term, value in zip(terms, values)
            if not isinstance(value, (Undeclared, Broken, Lasting))]


def formula_of(term: TypedTerm) -> Formula:
    """Return a term's formula; a whole literal becomes int64 or uint64, a real one float64."""
    match term.value:
        case Undeclared() | Broken():
            raise AssertionError('mistakes are reported before')
        case Lasting():
            _refuse_lasting(term)
        case ExactNumber() as literal:
            return cast(term, literal, common_type([literal]))
        case formula:
            return formula
