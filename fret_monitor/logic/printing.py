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
Print formulas in FRET's SMV syntax and in CoCoSpec.

Parsing the text (`parse_smv` or `parse_cocospec`, then `elaborate` with the same inputs) returns
the same formula; if bounds are printed as times, under the policy timed. Conversions are not
printed, because elaboration inserts them again, and numbers are printed so that elaboration rounds
them to the same value. There are three exceptions, which the languages cannot express: a
`Feedback` (printed as `pre` of its equation), an empty window other than `[0,-1]` (printed as
that), and the difference between `<->` and `=` in CoCoSpec.

There are more parentheses than the precedence of operators here requires, as in `(H p) & q` and
`(p & q) | r`, because other tools define other precedences. A shared subformula is printed once
for each use, so the length can be exponential: pass a limit for formulas of unknown size.
"""

from collections.abc import Mapping, Sequence
from enum import auto, Enum
import re
from typing import assert_never, ClassVar, Final, NamedTuple, TypeAlias

from fret_monitor.language import cocospec, smv
from fret_monitor.logic.formula import (
    Ago, Binary, BinaryOperator, Choice, Constant, Conversion, Feedback, Formula, FTP, Held,
    Historically, MessageSlope, NotRefuted, Once, operands, Over, Previous, Since, Slope,
    TimeOver, Trial, Triggered, Unary, UnaryOperator, Variable, WeakYesterday, Window,
    Yesterday,
)
from fret_monitor.model.floats import shortest_float32
from fret_monitor.model.policies import OverInstances
from fret_monitor.model.times import LONGEST_NS, short_seconds, time_text
from fret_monitor.model.values import ValueType

Values: TypeAlias = Mapping[str, Sequence[tuple[str, int | str]]]
"""The names of an input's values, as in `Signal.values`, by the input's name."""

_CUT: Final = ' ...'


def to_smv(formula: Formula, limit: int | None = None, values: Values | None = None,
           names: Mapping[Formula, str] | None = None, is_timed: bool = False,
           has_typed_names: bool = False) -> str:
    """
    Return a formula in FRET's SMV syntax, on one line.

    A text longer than `limit` characters is cut to that length and ends with ` ...`. `values`
    replaces numbers that an input is compared with by their names, `names` replaces formulas by
    their names. With `is_timed`, bounds are nanoseconds, and printed as times. With
    `has_typed_names`, functions have FRET's own names (`absReal`), which end in a type.
    """
    return _render(formula, _Smv(values or {}, is_timed, has_typed_names), limit, names)


def to_cocospec(formula: Formula, limit: int | None = None, values: Values | None = None,
                is_timed: bool = False) -> str:
    """
    Return a formula in CoCoSpec, on one line.

    A text longer than `limit` characters is cut to that length and ends with ` ...`. `values`
    replaces numbers that an input is compared with by their names. With `is_timed`, bounds are
    nanoseconds, and printed as times.
    """
    return _render(formula, _CocoSpec(values or {}, is_timed, True), limit)


class _Shape(Enum):
    """The syntactic form of a formula, which decides whether it needs parentheses."""

    ATOM = auto()
    NOT = auto()
    TEMPORAL = auto()
    SIGNED = auto()
    POWER = auto()
    PRODUCT = auto()
    SUM = auto()
    RELATION = auto()
    CONNECTIVE = auto()


_ANY = frozenset(_Shape)
_ATOM = frozenset({_Shape.ATOM})
_LITERAL = _ATOM | {_Shape.NOT}
_FACTOR = _ATOM | {_Shape.SIGNED, _Shape.POWER}
_PRODUCT = _FACTOR | {_Shape.PRODUCT}
_NUMBER = _PRODUCT | {_Shape.SUM}
_OPERAND = _LITERAL | {_Shape.RELATION}
_CHAIN = _ANY - {_Shape.TEMPORAL}


class _Part(NamedTuple):
    """An operand, and the shapes that need no parentheses in its place."""

    node: Formula
    bare: frozenset[_Shape] = _ANY


_Pieces: TypeAlias = list[str | _Part]
_Temporal: TypeAlias = Yesterday | WeakYesterday | Once | Historically | Since | Triggered

_LETTERS: dict[type[_Temporal], str] = {
    Yesterday: 'Y', WeakYesterday: 'Z', Once: 'O', Historically: 'H', Since: 'S', Triggered: 'T'}


def _render(root: Formula, style: '_Style', limit: int | None,
            names: Mapping[Formula, str] | None = None) -> str:
    done: list[str] = []
    length = 0
    stack: _Pieces = [_Part(root)]
    while stack:
        item = stack.pop()
        if isinstance(item, str):
            done.append(item)
            length += len(item)
            if limit is not None and length > limit:
                break
            continue
        if names and item.node in names:
            stack.append(names[item.node])
            continue
        node = _unconverted(item.node)
        pieces = style.pieces(node)
        if style.shape(node) not in item.bare:
            pieces = ['(', *pieces, ')']
        stack.extend(reversed(pieces))
    text = ''.join(done)
    return text if not stack and (limit is None or length <= limit) else _cut(text, limit or 0)


def _cut(text: str, limit: int) -> str:
    return text[:max(limit - len(_CUT), 0)].rstrip() + _CUT


def _unconverted(node: Formula) -> Formula:
    while isinstance(node, Conversion):
        node = node.argument
    return node


_SUMS = frozenset({BinaryOperator.ADD, BinaryOperator.SUB})
_PRODUCTS = frozenset({BinaryOperator.MUL, BinaryOperator.DIV, BinaryOperator.MOD})
_CALLS = frozenset({BinaryOperator.MIN, BinaryOperator.MAX, BinaryOperator.ATAN2})
_EQUALITIES = frozenset({BinaryOperator.EQ, BinaryOperator.NE})


class _Style:
    """The printing rules of both languages: a node becomes text and operands to be printed."""

    operators: ClassVar[Mapping[BinaryOperator, str]]
    truths: ClassVar[tuple[str, str]]
    negation: ClassVar[str]
    reserved: ClassVar[frozenset[str]]

    def __init__(self, values: Values, is_timed: bool, has_typed_names: bool) -> None:
        self._values = values
        self._is_timed = is_timed
        self._has_typed_names = has_typed_names

    def shape(self, node: Formula) -> _Shape:
        match node:
            case Constant(value):
                is_signed = not isinstance(value, bool) and _is_negative(value)
                return _Shape.SIGNED if is_signed else _Shape.ATOM
            case Unary(UnaryOperator.NOT):
                return _Shape.NOT
            case Unary(UnaryOperator.NEG):
                return _Shape.SIGNED
            case Binary():
                return self._binary_shape(node)
            case TimeOver():
                return _Shape.RELATION
            case Ago():
                return _Shape.SUM
            case _:
                return _Shape.ATOM

    def _binary_shape(self, node: Binary) -> _Shape:
        if node.operator in _CALLS or is_change(node):
            return _Shape.ATOM
        if node.operator in _SUMS:
            return _Shape.SUM
        if node.operator in _PRODUCTS:
            return _Shape.PRODUCT
        if node.operator is BinaryOperator.POW:
            return _Shape.POWER
        is_number = node.operator.is_relation and node.left.type is not ValueType.BOOL
        return _Shape.RELATION if is_number else _Shape.CONNECTIVE

    def pieces(self, node: Formula) -> _Pieces:
        match node:
            case Constant():
                return [self._constant(node)]
            case Variable():
                return [self._name(node.name)]
            case Feedback():
                return [f'pre({node.name})']
            case Conversion():
                return [_Part(node.argument)]
            case Unary():
                return self._unary(node)
            case Binary():
                return self._binary(node)
            case Choice():
                yes, no = self._alike(node.yes, node.no)
                return self._choice(node, yes, no)
            case Previous():
                initial, argument = self._alike(node.initial, node.argument)
                return _call(f'pre{_kind(node)}', initial, argument)
            case Over():
                return self._over(node.aggregate.value, node.past, node.argument)
            case Ago():
                return [_Part(node.argument, _NUMBER), ' - ',
                        *self._over('changeOver', node.past, node.argument)]
            case Held():
                return _call('heldAt', _Part(node.condition), _Part(node.argument))
            case Slope() | MessageSlope():
                return _call('derivative', _Part(node.argument))
            case TimeOver():
                return [*self._over('timeOver', node.past, node.argument), self._least(node.least)]
            case Trial():
                return _call('trial', *map(_Part, operands(node)))
            case NotRefuted():
                return _call('tested', _Part(node.argument), repr(node.allowed))
            case Yesterday() | WeakYesterday() | Once() | Historically() | Since() | Triggered():
                return ['FTP'] if node is FTP else self._temporal(node)
            case _:
                assert_never(node)

    def _least(self, least: int) -> str:
        """Return the comparison that fits: `> 10` of a nanosecond more than ten seconds."""
        if not self._is_timed:
            return f' >= {least}'
        return min(f' >= {short_seconds(least)}', f' > {short_seconds(least - 1)}', key=len)

    def _over(self, function: str, past: int, argument: Formula) -> _Pieces:
        past_text = time_text(past) if self._is_timed else str(past)
        return _call(function, past_text, _Part(argument))

    def _constant(self, node: Constant) -> str:
        if isinstance(node.value, bool):
            return self.truths[node.value]
        return _number(node)

    def _name(self, name: str) -> str:
        if re.fullmatch(_PLAIN, name) and name not in self.reserved or _AGGREGATE.fullmatch(name):
            return name
        return '"' + re.sub(r'(["\\])', r'\\\1', name) + '"'

    def _unary(self, node: Unary) -> _Pieces:
        match node.operator:
            case UnaryOperator.NOT:
                return [self.negation, _Part(node.argument, _ATOM)]
            case UnaryOperator.NEG:
                return ['-', _Part(node.argument, _ATOM)]
            case UnaryOperator.ABS:
                return self._function('abs', node, node.argument)
            case _:
                return _call(node.operator.value, _Part(node.argument))

    def _binary(self, node: Binary) -> _Pieces:
        if node.operator is BinaryOperator.ATAN2:
            return _call('atan2', _Part(node.left), _Part(node.right))
        if is_change(node):
            assert isinstance(node.right, Ago)
            return self._over('changeOver', node.right.past, node.left)
        if node.operator in _CALLS:
            return self._function(node.operator.value, node, node.left, node.right)
        left, right = self._sides(node)
        return [left, f' {self.operators[node.operator]} ', right]

    def _function(self, name: str, node: Formula, *arguments: Formula) -> _Pieces:
        # `absReal(n)` of an integer is a real number, unlike `abs(n)`.
        converts = node.type.is_float and all(
            isinstance(item, Conversion) and item.argument.type.is_integer for item in arguments)
        kind = _kind(node) if self._has_typed_names or converts else ''
        return _call(f'{name}{kind}', *map(_Part, arguments))

    def _sides(self, node: Binary) -> tuple[_Part | str, _Part | str]:
        match self._binary_shape(node):
            case _Shape.RELATION:
                return self._alike(node.left, node.right, _NUMBER)
            case _Shape.SUM:
                return _Part(node.left, _NUMBER), _Part(node.right, _PRODUCT)
            case _Shape.PRODUCT:
                return _Part(node.left, _PRODUCT), _Part(node.right, _FACTOR)
            case _Shape.POWER:
                return _Part(node.left, _ATOM), _Part(node.right, _ATOM)
            case _:
                return self._connected(node)

    def _connected(self, node: Binary) -> tuple[_Part, _Part]:
        if node.operator in _EQUALITIES or node.operator is BinaryOperator.IFF:
            return _Part(node.left, _ATOM), _Part(node.right, _ATOM)
        is_chain = (node.operator in (BinaryOperator.AND, BinaryOperator.OR)
                    and isinstance(node.left, Binary) and node.left.operator is node.operator)
        return _Part(node.left, _CHAIN if is_chain else _OPERAND), _Part(node.right, _OPERAND)

    def _alike(self, left: Formula, right: Formula,
               bare: frozenset[_Shape] = _ANY) -> tuple[_Part | str, _Part | str]:
        """Return two operands of one type; a number that the other one has a name for, as it."""
        return (self._value(left, right) or _Part(left, bare),
                self._value(right, left) or _Part(right, bare))

    def _value(self, node: Formula, beside: Formula) -> str | None:
        if not self._values or not isinstance(node, Constant) or not node.type.is_integer:
            return None
        for variable in _sources(beside):
            for name, value in self._values.get(variable.name, ()):
                if self._number_of(variable, value) == node.value:
                    return self._name(name)
        return None

    def _number_of(self, variable: Variable, value: int | str) -> int:
        if isinstance(value, int):
            return value
        return [item for _, item in self._values[variable.name]].index(value)

    def _choice(self, node: Choice, yes: _Part | str, no: _Part | str) -> _Pieces:
        raise NotImplementedError

    def _temporal(self, node: _Temporal) -> _Pieces:
        raise NotImplementedError


_AGGREGATE = re.compile(
    rf'(?:{"|".join(item.value for item in OverInstances)})\([A-Za-z_][\w, ]*: .*\)')
_PLAIN = re.compile(r'[A-Za-z_$][\w$]*(?:[.%][\w$]+)*', re.ASCII)


def _call(function: str, *arguments: _Part | str) -> _Pieces:
    pieces: _Pieces = [f'{function}(']
    for argument in arguments:
        pieces += [argument, ', ']
    return [*pieces[:-1], ')']


def is_change(node: Binary) -> bool:
    """Whether it is what `changeOver` means."""
    return node.operator is BinaryOperator.SUB and isinstance(node.right, Ago) \
        and node.right.argument is node.left


def _kind(node: Formula) -> str:
    """Return the suffix of FRET's typed spelling of a function: Bool, Int or Real."""
    if node.type is ValueType.BOOL:
        return 'Bool'
    return 'Real' if node.type.is_float else 'Int'


def _sources(node: Formula) -> list[Variable]:
    """Return the inputs whose names of values apply: the term is one, or `pre` or a choice."""
    found = []
    stack = [node]
    seen: set[Formula] = set()
    while stack:
        item = stack.pop()
        if item in seen:
            continue
        seen.add(item)
        match item:
            case Variable():
                found.append(item)
            case Conversion(argument):
                stack.append(argument)
            case Previous(initial, argument):
                stack += [argument, initial]
            case Choice(_, yes, no):
                stack += [no, yes]
            case Held(_, argument):
                stack.append(argument)
    return found


class _Smv(_Style):

    operators: ClassVar = {item: item.value for item in BinaryOperator}
    truths = ('FALSE', 'TRUE')
    negation = '!'
    reserved = smv.RESERVED

    def shape(self, node: Formula) -> _Shape:
        match node:
            case Once() | Historically() | Yesterday():
                return _Shape.TEMPORAL
            case WeakYesterday():
                return _Shape.ATOM if node is FTP else _Shape.TEMPORAL
            case Since() | Triggered():
                return _Shape.CONNECTIVE
            case _:
                return super().shape(node)

    def _choice(self, node: Choice, yes: _Part | str, no: _Part | str) -> _Pieces:
        return _call('ite', _Part(node.condition), yes, no)

    def _temporal(self, node: _Temporal) -> _Pieces:
        letter = _LETTERS[type(node)]
        match node:
            case Yesterday() | WeakYesterday():
                return [f'{letter} ', _Part(node.argument, _LITERAL)]
            case Once() | Historically():
                return [f'{letter}{self._bound(node.window)} ', _Part(node.argument, _LITERAL)]
            case Since() | Triggered():
                return [_Part(node.left, _LITERAL), f' {letter}{self._bound(node.window)} ',
                        _Part(node.right, _LITERAL)]

    def _bound(self, window: Window) -> str:
        if window.is_unbounded:
            return ''
        if window.is_empty:
            return '[0,-1]'
        if self._is_timed:
            relation, *times = _times(window)
            return f"[{relation.strip('[]')}{', '.join(times)}]"
        return f'[>={window.low}]' if window.high is None else f'[{window.low},{window.high}]'


def _times(window: Window) -> tuple[str, ...]:
    """Return the relation of a bound, `[]` for a closed one, and its times, in short texts."""
    low = time_text(window.low)
    if window.high is None:
        above = time_text(window.low - 1)
        return ('>', above) if len(above) < len(low) else ('>=', low)
    if window.low == window.high:
        return '=', low
    high, below = time_text(window.high), time_text(window.high + 1)
    if window.low == 0 and len(below) < len(high) and window.high < LONGEST_NS:
        return '<', below
    return '[]', low, high


class _CocoSpec(_Style):

    operators: ClassVar = {
        **{item: item.value for item in BinaryOperator},
        BinaryOperator.AND: 'and',
        BinaryOperator.OR: 'or',
        BinaryOperator.IMPLIES: '=>',
        BinaryOperator.IFF: '=',
        BinaryOperator.NE: '<>',
    }
    truths = ('false', 'true')
    negation = 'not '
    reserved = cocospec.RESERVED

    def shape(self, node: Formula) -> _Shape:
        return _Shape.CONNECTIVE if isinstance(node, Choice) else super().shape(node)

    def _choice(self, node: Choice, yes: _Part | str, no: _Part | str) -> _Pieces:
        return ['if ', _Part(node.condition), ' then ', yes, ' else ', no]

    def _temporal(self, node: _Temporal) -> _Pieces:
        letter = _LETTERS[type(node)]
        match node:
            case Yesterday() | WeakYesterday():
                return _call(f'{letter}toPre', _Part(node.argument))
            case Once() | Historically():
                return self._timed(letter, node.window, _Part(node.argument))
            case Since(window, left, Binary(BinaryOperator.AND, both, right)) if both is left:
                return self._timed('SI', window, _Part(right), _Part(left))
            case Since() | Triggered():
                return self._timed(letter, node.window, _Part(node.right), _Part(node.left))

    def _timed(self, function: str, window: Window, *arguments: _Part) -> _Pieces:
        if window.is_unbounded:
            return _call(function, *arguments)
        if window.is_empty:
            return _call(f'{function}T', '-1', '0', *arguments)
        if self._is_timed:
            relation, *times = _times(window)
            bound = times[::-1] if relation == '[]' else [times[0], cocospec.RELATIONS[relation]]
            return _call(f'{function}T', *bound, *arguments)
        if window.high is None:
            return _call(f'{function}T', str(window.low), 'GreaterThanOrEqual', *arguments)
        return _call(f'{function}T', str(window.high), str(window.low), *arguments)


def _is_negative(value: int | float) -> bool:
    return str(value).startswith('-')


def _number(node: Constant) -> str:
    """Return a text for a number that elaborates to the same constant in its context."""
    if isinstance(node.value, int):
        return str(node.value)
    text = shortest_float32(node.value) if node.type is ValueType.FLOAT32 else repr(node.value)
    match = re.fullmatch(r'(.*?)e([+-])0*([0-9]+)', text)
    if match:
        # FRET's grammar does not accept leading zeros in the exponent.
        return f'{match[1]}e{match[2].strip("+")}{match[3]}'
    return text if '.' in text else f'{text}.0'
