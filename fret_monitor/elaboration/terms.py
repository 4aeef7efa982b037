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
Terms: what an expression means while its types are being worked out, and how types meet.

A `TypedTerm` is a typed `Formula`, or an `ExactNumber` that has no type yet, or a name that only a
comparison can place (`LANDING` in `state = LANDING`), or a mistake already reported. `unify`,
`convert` and `cast` are the rule by which types meet (docs/numbers.md); errors are
`CompileError`, with the place of the operand that does not fit.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

from fret_monitor.logic.formula import Constant, Conversion, Formula
from fret_monitor.logic.numbers import constant, ExactNumber, NumberError
from fret_monitor.model.diagnostics import refuse, Span
from fret_monitor.model.values import ValueType

_MANY = 8


@dataclass(frozen=True)
class Vocabulary:
    """
    The names of an input's values, `(name, number or string)` each, as in `Signal.values`.

    A string counts as the index of its first place among the strings.
    """

    values: tuple[tuple[str, int | str], ...]

    @cached_property
    def is_text(self) -> bool:
        """Whether the input is a string."""
        return any(isinstance(value, str) for _, value in self.values)

    @cached_property
    def numbers(self) -> dict[str, int]:
        """The number that each name stands for."""
        found = [value for _, value in self.values]
        return {name: value if isinstance(value, int) else found.index(value)
                for name, value in self.values}

    def __str__(self) -> str:
        """Return the names for a message, the first ones where there are many."""
        names = [name for name, _ in self.values]
        return ', '.join(names[:_MANY]) + (', ...' if len(names) > _MANY else '')


@dataclass(frozen=True, eq=False)
class Undeclared:
    """A name that is nothing in its scope; it may be a value's name in a comparison."""

    name: str


@dataclass(frozen=True, eq=False)
class Broken:
    """The place of a mistake that was reported; whatever is made of it is broken silently."""


Value: TypeAlias = Formula | ExactNumber | Undeclared | Broken
Number: TypeAlias = Formula | ExactNumber


@dataclass(frozen=True, eq=False)
class TypedTerm:
    """
    The meaning of an expression, and where it stands.

    `vocabulary` are the names of its values, if it is an input that has some (or `pre` or a
    choice of such). `undefined` is the number of first steps at which a bare `pre` of Lustre
    leaves it without a value, `origin` the place of that `pre`. `bounds` are the numbers of steps
    that were written in it, the largest few.
    """

    value: Value
    span: Span
    vocabulary: Vocabulary | None = None
    undefined: int = 0
    origin: Span | None = None
    bounds: frozenset[int] = frozenset()

    @property
    def is_broken(self) -> bool:
        """Whether a mistake in it was reported."""
        return isinstance(self.value, Broken)

    @property
    def is_boolean(self) -> bool:
        """Whether it is true or false."""
        match self.value:
            case ExactNumber() | Undeclared() | Broken():
                return False
            case formula:
                return formula.type is ValueType.BOOL

    @property
    def is_text(self) -> bool:
        """Whether it is a string input, or a name of its values."""
        return self.vocabulary is not None and self.vocabulary.is_text


MANY_BOUNDS = 5
"""How many bounds a term remembers."""


def joined_bounds(*bounds: Iterable[int]) -> frozenset[int]:
    """Return the largest few of some bounds."""
    found = {steps for each in bounds for steps in each if steps > 0}
    return frozenset(sorted(found)[-MANY_BOUNDS:])


def describe(term: TypedTerm) -> str:
    """Say in the user's words what a term is."""
    if term.is_text:
        return 'text'
    match term.value:
        case ExactNumber() as literal:
            return f'the number {literal}'
        case Undeclared(name):
            return f"the unknown name '{name}'"
        case Broken():
            return 'a mistake'
        case Constant(bool(value), _):
            return str(value).upper()
        case formula:
            return 'true or false' if term.is_boolean else f'a number ({formula.type.value})'


def expect_bool(term: TypedTerm, operator: str) -> Formula:
    """Return a term's formula, which must be BOOL for `operator`, as the user wrote it."""
    value = term.value
    if not term.is_boolean or isinstance(value, (ExactNumber, Undeclared, Broken)):
        refuse(f'{operator} takes what is true or false', term.span,
               f'this is {describe(term)}', _truth_help(term))
    return value


def _truth_help(term: TypedTerm) -> str:
    written = term.span.source.text[term.span.start:term.span.end]
    match term.value:
        case ExactNumber() if written.isidentifier():  # a constant
            return f'compare it with something, as in x <= {written}'
        case ExactNumber(value, _, _) if value in (0, 1):
            return f"write {'TRUE' if value else 'FALSE'}"
        case ExactNumber():
            return ''
    if term.vocabulary is not None:
        return f'compare it with one of its values: {term.vocabulary}'
    return 'compare it with something, as in x > 0'


def expect_number(term: TypedTerm, operator: str) -> Number:
    """Return a term's formula or literal, which must be a number for `operator`."""
    if term.is_text:
        refuse(f'{operator} takes numbers', term.span, 'this is text',
               f'text can be compared by = and != with its names: {term.vocabulary}')
    value = term.value
    if term.is_boolean or isinstance(value, (Undeclared, Broken)):
        refuse(f'{operator} takes numbers', term.span, f'this is {describe(term)}')
    return value


def unify(numbers: Iterable[Number]) -> ValueType | None:
    """
    Return the type in which numbers meet; None if all are literals, and meet exactly.

    A float64, or a float beside an integer, makes float64; else a float32 makes float32; an
    integer beside a real literal makes float64; uint64 with none but its like and literals >= 0
    makes uint64; all other integers make int64.
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
    """Return the type in which numbers meet that must have one, `unify` or that of literals."""
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
    """Return a number in a type that operators take: the small integers become INT64."""
    return convert(formula, common_type([formula]))


def convert(formula: Formula, kind: ValueType) -> Formula:
    """Return a number in the type `kind`: INT64, FLOAT64, or its own."""
    return formula if formula.type is kind else Conversion(formula, kind)


def cast(term: TypedTerm, value: Number, kind: ValueType) -> Formula:
    """Return a term's number in the type `kind`; a literal is rounded here, once."""
    if not isinstance(value, ExactNumber):
        return convert(value, kind)
    try:
        return constant(value, kind)
    except NumberError as error:
        refuse(f'{value} cannot be a number of type {kind.value}', term.span, str(error))


def alike(terms: Sequence[TypedTerm], operator: str) -> list[Formula]:
    """
    Return formulas of one type: all BOOL, or all numbers of their common type.

    Text is alike only among names and inputs of the same `values`.
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
        refuse(f'{operator} takes two numbers, or two that are true or false', term.span,
               f'this is {describe(term)}, the other is true or false', _truth_help(term))
    return expect_bool(term, operator)


def same_text(terms: Sequence[TypedTerm], operator: str) -> list[Formula]:
    """Return the indices, as INT64, of terms that are all text with the same `values`."""
    vocabulary = next(term.vocabulary for term in terms if term.is_text)
    for term in terms:
        if term.vocabulary != vocabulary:
            refuse(f'{operator} cannot take text and something else', term.span,
                   f'this is {describe(term)}',
                   f'text can be compared by = and != with its names: {vocabulary}')
    values = [term.value for term in terms]
    return [cast(term, value, ValueType.INT64) for term, value in zip(terms, values)
            if not isinstance(value, (Undeclared, Broken))]


def formula_of(term: TypedTerm) -> Formula:
    """Return a term's formula; a literal becomes int64 or float64, as written."""
    match term.value:
        case Undeclared() | Broken():
            raise AssertionError('mistakes are reported before')
        case ExactNumber() as literal:
            return cast(term, literal, common_type([literal]))
        case formula:
            return formula
