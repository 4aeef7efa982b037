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
Typed formulas of past-time MTL.

A `Formula` is interned: structurally equal formulas are one object, so equality and hashing take
O(1). It is typed: operands have exactly the types that an operator takes, and each conversion is
a node. docs/language.md defines the operators, and `evaluate.py` implements the definitions.
Formulas can be deeper than Python's recursion limit: traverse them with `postorder`.

Types of terms: an input has its declared type; every other node is BOOL, INT64, UINT64, FLOAT32
or FLOAT64.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields
from enum import Enum
from operator import attrgetter
import struct
from threading import Lock
from typing import Any, dataclass_transform, TypeAlias
from weakref import WeakValueDictionary

from fret_monitor.model.values import ValueType


@dataclass(frozen=True)
class Window:
    """
    The steps that a bounded operator covers, as distances into the past: low <= distance <= high.

    With `high` None there is no upper bound. `high < low` is an empty window (FRET's `[0,-1]`).
    """

    low: int
    high: int | None

    @property
    def is_unbounded(self) -> bool:
        """Whether it is the whole past, the window of an operator without a bound."""
        return self.low == 0 and self.high is None

    @property
    def is_empty(self) -> bool:
        """Whether it contains no distance."""
        return self.high is not None and self.high < self.low


ALWAYS = Window(0, None)


class UnaryOperator(Enum):
    """
    NOT: BOOL to BOOL. NEG and ABS: INT64, UINT64, FLOAT32 or FLOAT64 to the same type.

    The others are functions of the C library, with its names: FLOAT64 to FLOAT64.
    """

    NOT = '!'
    NEG = '-'
    ABS = 'abs'
    SIN = 'sin'
    COS = 'cos'
    TAN = 'tan'
    ASIN = 'asin'
    ACOS = 'acos'
    ATAN = 'atan'
    SQRT = 'sqrt'
    EXP = 'exp'
    LOG = 'log'
    FLOOR = 'floor'
    CEIL = 'ceil'
    ROUND = 'round'

    @property
    def is_library(self) -> bool:
        """Whether it is a function of the C library."""
        return self not in (UnaryOperator.NOT, UnaryOperator.NEG, UnaryOperator.ABS)


class BinaryOperator(Enum):
    """
    Operators with two operands of one type, with exceptions for relations and POW.

    AND to IFF: BOOL to BOOL. LT to NE: numbers to BOOL; EQ and NE also take BOOL. Relations also
    compare INT64 with UINT64, by value. ADD to MAX: numbers to their type. POW: a number and an
    INT64 Constant >= 0 (repeated multiplication), or FLOAT64 and FLOAT64 (C's pow).
    """

    AND = '&'
    OR = '|'
    XOR = 'xor'
    IMPLIES = '->'
    IFF = '<->'
    LT = '<'
    LE = '<='
    GT = '>'
    GE = '>='
    EQ = '='
    NE = '!='
    ADD = '+'
    SUB = '-'
    MUL = '*'
    DIV = '/'
    MOD = 'mod'
    POW = '^'
    MIN = 'min'
    MAX = 'max'
    ATAN2 = 'atan2'

    @property
    def is_boolean(self) -> bool:
        """Whether it is a connective: operands and result are BOOL."""
        return self in _BOOLEAN

    @property
    def is_relation(self) -> bool:
        """Whether it is a comparison."""
        return self in _RELATIONS


_BOOLEAN = frozenset({BinaryOperator.AND, BinaryOperator.OR, BinaryOperator.XOR,
                      BinaryOperator.IMPLIES, BinaryOperator.IFF})
_RELATIONS = frozenset({BinaryOperator.LT, BinaryOperator.LE, BinaryOperator.GT,
                        BinaryOperator.GE, BinaryOperator.EQ, BinaryOperator.NE})

_interned: WeakValueDictionary[tuple[object, ...], Any] = WeakValueDictionary()
_interning = Lock()


@dataclass_transform(frozen_default=True)
class _Interning(type):
    """Interns the instances of a class: equal fields give the same object."""

    def __call__(cls, *args: Any) -> Any:
        """Return the interned object."""
        key = (cls, *(_identity(arg) for arg in args))
        node = _interned.get(key)
        if node is not None:
            return node
        made = super().__call__(*args)
        with _interning:
            return _interned.setdefault(key, made)


def _identity(arg: object) -> object:
    # By bits: 0.0 and -0.0 compare equal but are two constants, and a NaN equals no NaN.
    if isinstance(arg, float):
        return ('float', struct.pack('<d', arg))
    if isinstance(arg, bool):
        return ('bool', arg)
    return arg


@dataclass(frozen=True, eq=False, repr=False)
class _Node(metaclass=_Interning):

    def __repr__(self) -> str:
        return f'<{type(self).__name__} at {id(self):#x}>'


@dataclass(frozen=True, eq=False, repr=False)
class Constant(_Node):
    """A bool (BOOL), int (INT64, UINT64) or float (FLOAT64, or FLOAT32 if rounded to it)."""

    value: bool | int | float
    type: ValueType


@dataclass(frozen=True, eq=False, repr=False)
class Variable(_Node):
    """The value of an input at the current step, in the input's declared type."""

    name: str
    type: ValueType


@dataclass(frozen=True, eq=False, repr=False)
class Conversion(_Node):
    """
    The same number in another type.

    int8..int32, uint8..uint32 to INT64; any integer and FLOAT32 to FLOAT64 (nearest, ties to
    even); INT64 to UINT64 and back, modulo 2^64. Nothing else.
    """

    argument: 'Formula'
    type: ValueType


@dataclass(frozen=True, eq=False, repr=False)
class Unary(_Node):
    """An operator on one operand of the same type."""

    operator: UnaryOperator
    argument: 'Formula'
    type: ValueType = field(init=False)

    def __post_init__(self) -> None:
        """Set the type to that of the operand."""
        object.__setattr__(self, 'type', self.argument.type)


@dataclass(frozen=True, eq=False, repr=False)
class Binary(_Node):
    """An operator on two operands."""

    operator: BinaryOperator
    left: 'Formula'
    right: 'Formula'
    type: ValueType = field(init=False)

    def __post_init__(self) -> None:
        """Set the type: BOOL for relations and connectives, else that of the left operand."""
        is_boolean = self.operator.is_boolean or self.operator.is_relation
        object.__setattr__(self, 'type', ValueType.BOOL if is_boolean else self.left.type)


@dataclass(frozen=True, eq=False, repr=False)
class Choice(_Node):
    """`yes` if the BOOL `condition` is true, else `no`; both have the same type, of any kind."""

    condition: 'Formula'
    yes: 'Formula'
    no: 'Formula'
    type: ValueType = field(init=False)

    def __post_init__(self) -> None:
        """Set the type to that of the branches."""
        object.__setattr__(self, 'type', self.yes.type)


@dataclass(frozen=True, eq=False, repr=False)
class Previous(_Node):
    """`argument` at the previous step; at step 0, `initial`. Both have the same type."""

    initial: 'Formula'
    argument: 'Formula'
    type: ValueType = field(init=False)

    def __post_init__(self) -> None:
        """Set the type to that of the argument."""
        object.__setattr__(self, 'type', self.argument.type)


@dataclass(frozen=True, eq=False, repr=False)
class Feedback(_Node):
    """
    The value of an equation at the previous step; at step 0 false, 0 or 0.0.

    It occurs only in formulas of Lustre nodes with an equation that refers to itself through
    `pre`. `name` is unique in the bundle; `Property.feedback` maps the node to its equation.
    """

    name: str
    type: ValueType


class Aggregate(Enum):
    """
    What an `Over` makes of the values in its window, none of which is left out.

    GREATEST and LEAST: INT64, UINT64, FLOAT32 or FLOAT64 to the same type. SUM: INT64, UINT64 or
    FLOAT64 to the same type. MEAN: FLOAT64 to FLOAT64. COUNT: BOOL to INT64.
    """

    GREATEST = 'maxOver'
    LEAST = 'minOver'
    SUM = 'sumOver'
    MEAN = 'meanOver'
    COUNT = 'countOver'

    @property
    def is_extreme(self) -> bool:
        """Whether it is the value at one step of the window."""
        return self in (Aggregate.GREATEST, Aggregate.LEAST)


@dataclass(frozen=True, eq=False, repr=False)
class Over(_Node):
    """
    An aggregate of `argument` at the steps k with 0 <= t - k <= past at which `at` is true.

    `at` says at which steps there is a value: the messages, under the policy timed. It is TRUE
    for an extreme.
    """

    aggregate: Aggregate
    past: int
    argument: 'Formula'
    at: 'Formula'
    type: ValueType = field(init=False)

    def __post_init__(self) -> None:
        """Set the type: INT64 for a count, else that of the argument."""
        is_count = self.aggregate is Aggregate.COUNT
        object.__setattr__(self, 'type', ValueType.INT64 if is_count else self.argument.type)


@dataclass(frozen=True, eq=False, repr=False)
class Ago(_Node):
    """`argument` so many steps ago; at step 0 if that is later. A number of a term's type."""

    past: int
    argument: 'Formula'
    type: ValueType = field(init=False)

    def __post_init__(self) -> None:
        """Set the type to that of the argument."""
        object.__setattr__(self, 'type', self.argument.type)


@dataclass(frozen=True, eq=False, repr=False)
class Held(_Node):
    """`argument` at the last step at which `condition` held; at step 0 before. A number."""

    condition: 'Formula'
    argument: 'Formula'
    type: ValueType = field(init=False)

    def __post_init__(self) -> None:
        """Set the type to that of the argument."""
        object.__setattr__(self, 'type', self.argument.type)


@dataclass(frozen=True, eq=False, repr=False)
class Slope(_Node):
    """
    The change of `argument` between the last two steps at which `at` held, per second.

    A step has `step` nanoseconds; under the policy timed, one. 0.0 before the second one. FLOAT64.
    """

    argument: 'Formula'
    at: 'Formula'
    step: int

    @property
    def type(self) -> ValueType:
        """FLOAT64."""
        return ValueType.FLOAT64


@dataclass(frozen=True, eq=False, repr=False)
class MessageSlope(_Node):
    """
    The change of `argument` between the last two steps at which `at` held, per second.

    `time` is the time of a step in nanoseconds (INT64). 0.0 before the second one. FLOAT64.
    """

    argument: 'Formula'
    at: 'Formula'
    time: 'Formula'

    @property
    def type(self) -> ValueType:
        """FLOAT64."""
        return ValueType.FLOAT64


@dataclass(frozen=True, eq=False, repr=False)
class _Boolean(_Node):

    @property
    def type(self) -> ValueType:
        """BOOL."""
        return ValueType.BOOL


@dataclass(frozen=True, eq=False, repr=False)
class Yesterday(_Boolean):
    """`Y p`: there is a previous step, and p held there."""

    argument: 'Formula'


@dataclass(frozen=True, eq=False, repr=False)
class WeakYesterday(_Boolean):
    """`Z p`: there is no previous step, or p held there."""

    argument: 'Formula'


@dataclass(frozen=True, eq=False, repr=False)
class Once(_Boolean):
    """`O[w] p`."""

    window: Window
    argument: 'Formula'


@dataclass(frozen=True, eq=False, repr=False)
class Historically(_Boolean):
    """`H[w] p`."""

    window: Window
    argument: 'Formula'


@dataclass(frozen=True, eq=False, repr=False)
class Since(_Boolean):
    """`p S[w] q`, `left` is p and `right` is q."""

    window: Window
    left: 'Formula'
    right: 'Formula'


@dataclass(frozen=True, eq=False, repr=False)
class Triggered(_Boolean):
    """`p T[w] q`, `left` is p and `right` is q."""

    window: Window
    left: 'Formula'
    right: 'Formula'


@dataclass(frozen=True, eq=False, repr=False)
class TimeOver(_Boolean):
    """`argument` held at `least` or more of the last `past` steps, this one included."""

    past: int
    least: int
    argument: 'Formula'


@dataclass(frozen=True, eq=False, repr=False)
class Trial(_Node):
    """
    What becomes of a trial at a step: 1 if it succeeds, -1 if it fails, else 0. INT64.

    It begins where `begins` holds while none is open. It is decided at the first step at which
    `bad` (it fails) or `good` holds; `due` steps after its begin by `kept`, if `due` is not None;
    and where `ends` holds at a later step than its begin, before all else, by `good_at_end`. At
    the step of a decision no trial begins.
    """

    due: int | None
    begins: 'Formula'
    good: 'Formula'
    bad: 'Formula'
    kept: 'Formula'
    ends: 'Formula'
    good_at_end: 'Formula'

    @property
    def type(self) -> ValueType:
        """INT64."""
        return ValueType.INT64


@dataclass(frozen=True, eq=False, repr=False)
class NotRefuted(_Boolean):
    """
    Whether a test has not refuted that outcomes of -1 are as rare as allowed.

    `argument` is the outcome of a trial at a step, 0 of none. `allowed` is the probability, `rest`
    one minus it, and `limit` the evidence that decides (docs/probability.md).
    """

    argument: 'Formula'
    allowed: float
    rest: float
    limit: float


Formula: TypeAlias = (Constant | Variable | Conversion | Unary | Binary | Choice | Previous
                      | Feedback | Over | Ago | Held | Slope | MessageSlope | Yesterday
                      | WeakYesterday | Once | Historically | Since | Triggered | TimeOver | Trial
                      | NotRefuted)

NUMBERS_OVER_TIME = (Over, Ago, Held, Slope, MessageSlope, TimeOver)
"""The nodes of docs/over_time.md."""

TRUE = Constant(True, ValueType.BOOL)
FALSE = Constant(False, ValueType.BOOL)
FTP = WeakYesterday(FALSE)


# A table and not `match`, which compares with one class after the other: this is called often.
_OPERANDS: dict[type[Any], Callable[[Any], tuple[Formula, ...]]] = {
    **dict.fromkeys((Constant, Variable, Feedback), lambda node: ()),
    **dict.fromkeys((Conversion, Unary, Ago, Yesterday, WeakYesterday, Once, Historically,
                     TimeOver, NotRefuted), lambda node: (node.argument,)),
    **dict.fromkeys((Over, Slope), attrgetter('argument', 'at')),
    MessageSlope: attrgetter('argument', 'at', 'time'),
    Held: attrgetter('condition', 'argument'),
    **dict.fromkeys((Binary, Since, Triggered), attrgetter('left', 'right')),
    Choice: attrgetter('condition', 'yes', 'no'),
    Previous: attrgetter('initial', 'argument'),
    Trial: attrgetter('begins', 'good', 'bad', 'kept', 'ends', 'good_at_end'),
}


def operands(node: Formula) -> tuple[Formula, ...]:
    """Return the direct operands of a node, left to right."""
    return _OPERANDS[type(node)](node)


def rebuilt(node: Formula, found: Mapping[Formula, Formula]) -> Formula:
    """Return a node with its operands replaced by what `found` has for them."""
    kind: Any = type(node)
    parts = [getattr(node, item.name) for item in fields(node) if item.init]
    return kind(*(found.get(part, part) for part in parts))  # type: ignore[no-any-return]


def postorder(roots: Iterable[Formula]) -> list[Formula]:
    """Return every node of some formulas once, each after its operands."""
    order: list[Formula] = []
    seen: set[Formula] = set()
    stack = [(root, False) for root in reversed(list(roots))]
    while stack:
        node, ready = stack.pop()
        if ready:
            order.append(node)
        elif node not in seen:
            seen.add(node)
            stack.append((node, True))
            stack.extend((item, False) for item in reversed(operands(node)))
    return order


def variables(root: Formula) -> tuple[Variable, ...]:
    """Return the inputs a formula reads, in the order they first occur."""
    return tuple(node for node in postorder([root]) if isinstance(node, Variable))
