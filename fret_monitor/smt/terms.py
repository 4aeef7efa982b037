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
Terms over truth values, machine words, floats and rings of bytes.

Terms are interned: equal terms are one object, so that most proofs only compare two references.
The constructors below normalise terms by rules that hold for all values: for example, constants
are folded, and a test of a word made from a truth value becomes the truth value.

Sorts: `BOOL`, `word(n)` (n bits), `real(n)` (IEEE 754 with n = 32 or 64, and a single NaN) and
`ring(n)` (n bytes).
"""

from collections.abc import Callable, Collection, Iterable
import ctypes
from fractions import Fraction
from itertools import count
import math
import struct
from threading import Lock
from typing import Any
from weakref import WeakValueDictionary

from fret_monitor.model.floats import to_float32

Sort = tuple[str, int]
BOOL: Sort = ('bool', 0)

# Weak references, so that unused terms are freed.
_interned: 'WeakValueDictionary[tuple[Any, ...], Term]' = WeakValueDictionary()
_interning = Lock()
_numbers = count()

LIBRARY = {
    'fmod': 2, 'pow': 2, 'atan2': 2,
    **dict.fromkeys(('sin', 'cos', 'tan', 'asin', 'acos', 'atan', 'sqrt', 'exp', 'log', 'floor',
                     'ceil', 'round'), 1)}
"""Functions of the C library on float64, with the number of their arguments."""


def _of_library(name: str, arguments: int) -> Callable[..., float]:
    function = ctypes.CDLL(None)[name]
    function.argtypes = (ctypes.c_double,) * arguments
    function.restype = ctypes.c_double
    return lambda width, *values: function(*values)


def word(bits: int) -> Sort:
    """Return the sort of words with a number of bits."""
    return ('word', bits)


def real(bits: int) -> Sort:
    """Return the sort of floats of 32 or 64 bits."""
    return ('real', bits)


def ring(size: int) -> Sort:
    """Return the sort of arrays with a number of bytes."""
    return ('ring', size)


class Term:
    """An operation on terms; `value` is its parameter, such as a constant, name or bit index."""

    __slots__ = ('__weakref__', 'args', 'number', 'op', 'sort', 'value')

    def __init__(self, op: str, sort: Sort, args: tuple['Term', ...], value: Any,
                 number: int) -> None:
        """Store the parts; only `term` calls this."""
        self.op = op
        self.sort = sort
        self.args = args
        self.value = value
        self.number = number

    def __repr__(self) -> str:
        """Return a text for debugging."""
        inner = ', '.join(map(repr, self.args))
        return f'{self.op}{"" if self.value is None else f":{self.value}"}({inner})'


def term(op: str, sort: Sort, args: tuple[Term, ...] = (), value: Any = None) -> Term:
    """Return the interned term with these parts, without normalisation."""
    key = (op, sort, args, value)
    found = _interned.get(key)
    if found is None:
        with _interning:  # otherwise two threads could make two terms for one key
            found = _interned.get(key)
            if found is None:
                found = _interned[key] = Term(op, sort, args, value, next(_numbers))
    return found


def variable(name: str, sort: Sort) -> Term:
    """Return a variable."""
    return term('variable', sort, (), name)


TRUE = term('constant', BOOL, (), True)
FALSE = term('constant', BOOL, (), False)


def truth(value: bool) -> Term:
    """Return TRUE or FALSE."""
    return TRUE if value else FALSE


def number(value: int, bits: int) -> Term:
    """Return a constant word, modulo 2^bits."""
    return term('constant', word(bits), (), value & ((1 << bits) - 1))


def floating(value: float, bits: int) -> Term:
    """Return a constant float; `value` must be exact in the sort."""
    if value != value:
        pattern = struct.pack('<d', math.nan)
    else:
        pattern = struct.pack('<d', value)
    return term('constant', real(bits), (), pattern)


def is_constant(item: Term) -> bool:
    """Whether a term is a constant."""
    return item.op == 'constant'


def plain(item: Term) -> Any:
    """Return the value of a constant: bool, int (unsigned) or float."""
    if item.sort[0] == 'real':
        return struct.unpack('<d', item.value)[0]
    return item.value


def constant(value: Any, sort: Sort) -> Term:
    """Return a constant of any sort."""
    kind, bits = sort
    if kind == 'bool':
        return truth(bool(value))
    return number(value, bits) if kind == 'word' else floating(value, bits)


def postorder(roots: Iterable[Term], known: Collection[Term] = ()) -> list[Term]:
    """Return each subterm of some roots once, after its arguments, except those in `known`."""
    order: list[Term] = []
    seen: set[Term] = set()
    stack = [(root, False) for root in roots]
    while stack:
        item, ready = stack.pop()
        if ready:
            order.append(item)
        elif item not in seen and item not in known:
            seen.add(item)
            stack.append((item, True))
            stack.extend((each, False) for each in item.args)
    return order


# -- semantics of operations -----------------------------------------------------------------

def signed(value: int, bits: int) -> int:
    """Return the value of a word in two's complement."""
    return value - (1 << bits) if value >> (bits - 1) else value


def _rounded(value: float, bits: int) -> float:
    return value if bits == 64 else to_float32(value)


def _quotient(a: float, b: float) -> float:
    if b == 0:
        if a == 0 or a != a:
            return math.nan
        return math.copysign(math.inf, a) * math.copysign(1.0, b)
    return a / b


def from_integer(value: int, bits: int) -> float:
    """Convert an integer to a float, with one rounding."""
    return float(value) if bits == 64 else to_float32(Fraction(value))


def _sdiv(w: int, a: int, b: int) -> int:
    x, y = signed(a, w), signed(b, w)
    if y == 0:
        return 1 if x < 0 else -1
    found = abs(x) // abs(y)
    return found if (x < 0) == (y < 0) else -found


def _srem(w: int, a: int, b: int) -> int:
    x, y = signed(a, w), signed(b, w)
    if y == 0:
        return x
    return int(math.copysign(1, x)) * (abs(x) % abs(y))


def _ashr(w: int, a: int, b: int) -> int:
    return signed(a, w) >> min(b, w)


# Each takes the width of its first operand (of the result, for conversions) and the operands.
# Words are unsigned, and results are reduced modulo 2^width by the caller. Division by zero is as
# in SMT-LIB; that C does not divide by zero is a separate obligation.
FUNCTIONS: dict[str, Callable[..., Any]] = {
    'not': lambda w, a: not a,
    'and': lambda w, a, b: a and b,
    'iff': lambda w, a, b: a == b,
    'word': lambda w, a: int(a),
    'add': lambda w, a, b: a + b,
    'sub': lambda w, a, b: a - b,
    'mul': lambda w, a, b: a * b,
    'bitand': lambda w, a, b: a & b,
    'bitor': lambda w, a, b: a | b,
    'bitxor': lambda w, a, b: a ^ b,
    'complement': lambda w, a: ~a,
    'shl': lambda w, a, b: a << b if b < w else 0,
    'lshr': lambda w, a, b: a >> b if b < w else 0,
    'ashr': _ashr,
    'udiv': lambda w, a, b: a // b if b else -1,
    'urem': lambda w, a, b: a % b if b else a,
    'sdiv': _sdiv,
    'srem': _srem,
    'ult': lambda w, a, b: a < b,
    'slt': lambda w, a, b: signed(a, w) < signed(b, w),
    'equal': lambda w, a, b: a == b,
    'zext': lambda w, a: a,
    'sext': lambda w, a: signed(a, w),
    'trunc': lambda w, a: a,
    'fneg': lambda w, a: -a,
    'fadd': lambda w, a, b: _rounded(a + b, w),
    'fsub': lambda w, a, b: _rounded(a - b, w),
    'fmul': lambda w, a, b: _rounded(a * b, w),
    'fdiv': lambda w, a, b: _rounded(_quotient(a, b), w),
    'flt': lambda w, a, b: a < b,
    'fle': lambda w, a, b: a <= b,
    'feq': lambda w, a, b: a == b,
    **{name: _of_library(name, arguments) for name, arguments in LIBRARY.items()},
    'float': lambda w, a: _rounded(a, w),
    'float_u': lambda w, a: from_integer(a, w),
    'float_s': lambda w, a: from_integer(a, w),
}
_COMMUTE = frozenset({'add', 'mul', 'bitand', 'bitor', 'bitxor', 'equal', 'iff', 'and', 'fadd',
                      'fmul', 'feq'})
RELATIONS = frozenset({'ult', 'slt', 'equal', 'flt', 'fle', 'feq'})


def apply(op: str, sort: Sort, values: list[Any], sorts: list[Sort]) -> Any:
    """Evaluate an operation of `FUNCTIONS` on plain values."""
    kind, bits = sort
    if op == 'float_s':
        return from_integer(signed(values[0], sorts[0][1]), bits)
    width = bits if op.startswith('float') else sorts[0][1]
    found = FUNCTIONS[op](width, *values)
    return found & ((1 << bits) - 1) if kind == 'word' else found


def _make(op: str, sort: Sort, *args: Term) -> Term:
    if all(item.op == 'constant' for item in args):
        found = apply(op, sort, [plain(item) for item in args], [item.sort for item in args])
        return constant(found, sort)
    if op in _COMMUTE and args[0].number > args[1].number:
        args = (args[1], args[0])
    return term(op, sort, args)


# -- truth values ----------------------------------------------------------------------------

def negation(item: Term) -> Term:
    """Return `not item`."""
    if item.op == 'constant':
        return truth(not item.value)
    return item.args[0] if item.op == 'not' else term('not', BOOL, (item,))


def conjunction(left: Term, right: Term) -> Term:
    """Return `left and right`."""
    if left is right or right is TRUE:
        return left
    if left is TRUE:
        return right
    if FALSE in (left, right) or left is negation(right):
        return FALSE
    return _make('and', BOOL, left, right)


def all_of(items: Iterable[Term]) -> Term:
    """Return the conjunction of some truth values."""
    found = TRUE
    for item in items:
        found = conjunction(found, item)
    return found


def disjunction(left: Term, right: Term) -> Term:
    """Return `left or right`."""
    return negation(conjunction(negation(left), negation(right)))


def implies(left: Term, right: Term) -> Term:
    """Return `not left or right`."""
    return negation(conjunction(left, negation(right)))


def same_truth(left: Term, right: Term) -> Term:
    """Return whether two truth values are equal."""
    flip = (left.op == 'not') != (right.op == 'not')
    left = left.args[0] if left.op == 'not' else left
    right = right.args[0] if right.op == 'not' else right
    if left is right:
        found = TRUE
    elif left.op == 'constant':
        found = right if left is TRUE else negation(right)
    elif right.op == 'constant':
        found = left if right is TRUE else negation(left)
    else:
        found = _make('iff', BOOL, left, right)
    return negation(found) if flip else found


def choice(condition: Term, yes: Term, no: Term) -> Term:
    """Return `yes` if the condition holds, else `no`."""
    if condition.op == 'not':
        condition, yes, no = condition.args[0], no, yes
    if condition.op == 'constant':
        return yes if condition.value else no
    if yes is no:
        return yes
    if yes.sort == BOOL and (is_constant(yes) or is_constant(no)):
        if yes.op == 'constant':
            return disjunction(condition, no) if yes.value \
                else conjunction(negation(condition), no)
        return implies(condition, yes) if no.value else conjunction(condition, yes)
    bits = [_as_bit(yes), _as_bit(no)]
    if yes.sort[0] == 'word' and bits[0] is not None and bits[1] is not None \
            and 'word' in (yes.op, no.op):
        return from_truth(choice(condition, bits[0], bits[1]), yes.sort[1])
    return term('choice', yes.sort, (condition, yes, no))


# -- words -----------------------------------------------------------------------------------

def from_truth(item: Term, bits: int) -> Term:
    """Convert a truth value to a word: 1 or 0."""
    if item.op == 'constant':
        return number(int(item.value), bits)
    return term('word', word(bits), (item,))


def _as_bit(item: Term) -> Term | None:
    """Return a truth value equivalent to a word that is known to be 0 or 1, else None."""
    if item.op == 'word':
        return item.args[0]
    if item.op == 'constant' and item.sort[0] == 'word' and item.value < 2:
        return truth(bool(item.value))
    return None


def is_true(item: Term) -> Term:
    """Return whether a value is nonzero, which is C's rule for conditions."""
    if item.sort == BOOL:
        return item
    if item.sort[0] == 'real':
        return negation(relation('feq', item, floating(0.0, item.sort[1])))
    return negation(relation('equal', item, number(0, item.sort[1])))


def operation(op: str, left: Term, right: Term) -> Term:
    """Return an operation on two words or two floats of one sort, which is also the result's."""
    bits = (_as_bit(left), _as_bit(right))
    if op in ('bitand', 'bitor', 'bitxor') and bits[0] is not None and bits[1] is not None:
        return from_truth(_connected(op, bits[0], bits[1]), left.sort[1])
    if left.sort[0] == 'word':
        known = _neutral(op, left, right) or _masked(op, left, right)
        if known is not None:
            return known
    return _make(op, left.sort, left, right)


def _connected(op: str, left: Term, right: Term) -> Term:
    if op == 'bitand':
        return conjunction(left, right)
    return disjunction(left, right) if op == 'bitor' else negation(same_truth(left, right))


def _masked(op: str, left: Term, right: Term) -> Term | None:
    """
    Return a simpler form of a bitwise operation, or None.

    Two words extended from one sort are combined before the extension; `x & m` and `x | m`, with
    a mask m that is all ones or 0, become a choice.
    """
    if op not in ('bitand', 'bitor', 'bitxor'):
        return None
    if left.op == right.op == 'zext' and left.args[0].sort == right.args[0].sort:
        return resized(operation(op, left.args[0], right.args[0]), left.sort[1], False)
    for item, mask in ((left, right), (right, left)):
        if _is_mask(mask) and op != 'bitxor':
            chosen = mask.args[1].args[0]
            if op == 'bitand':
                return choice(chosen, item, number(0, item.sort[1]))
            return choice(chosen, number(-1, item.sort[1]), item)
    return None


def _is_mask(item: Term) -> bool:
    """Whether a word has the form 0 - b with a truth value b: all ones or 0."""
    return item.op == 'sub' and item.args[1].op == 'word' and item.args[0].op == 'constant' \
        and item.args[0].value == 0


def _neutral(op: str, left: Term, right: Term) -> Term | None:
    zero = number(0, left.sort[1])
    if right is zero and op in ('add', 'sub', 'bitor', 'bitxor', 'shl', 'lshr', 'ashr'):
        return left
    if left is zero and op in ('add', 'bitor', 'bitxor'):
        return right
    if op == 'mul' and number(1, left.sort[1]) in (left, right):
        return right if left is number(1, left.sort[1]) else left
    if op in ('bitand', 'mul') and zero in (left, right):
        return zero
    return None


def unary(op: str, item: Term) -> Term:
    """Return `complement` of a word or `fneg` of a float."""
    if item.op == op:
        return item.args[0]
    return _make(op, item.sort, item)


def relation(op: str, left: Term, right: Term) -> Term:
    """Return a relation of two words or two floats."""
    if op == 'equal':
        return _equal(left, right)
    if op in ('ule', 'sle'):
        return negation(relation(op.replace('le', 'lt'), right, left))
    if left is right and op in ('ult', 'slt', 'flt'):
        return FALSE
    return _make(op, BOOL, left, right)


def _equal(left: Term, right: Term) -> Term:
    if left is right:
        return TRUE
    one, other = _as_bit(left), _as_bit(right)
    if one is not None and other is not None:
        return same_truth(one, other)
    for item, against in ((left, right), (right, left)):
        if item.op == 'word' and against.op == 'constant':
            return FALSE  # neither 0 nor 1
        if item.op == 'bitand' and against.op == 'constant' and against.value == 0:
            found = _tested_bit(item)
            if found is not None:
                return negation(found)
    return _make('equal', BOOL, left, right)


def _tested_bit(item: Term) -> Term | None:
    """Return bit k of x for `(x >> k) & 1`, else None."""
    for one, other in (item.args, item.args[::-1]):
        if one.op == 'constant' and one.value == 1:
            return bit(other, 0)
    return None


def bit(item: Term, place: int) -> Term:
    """Return a bit of a word, as a truth value."""
    match item.op:
        case 'constant':
            return truth(bool(item.value >> place & 1))
        case 'word':
            return item.args[0] if place == 0 else FALSE
        case 'bitor':
            return disjunction(bit(item.args[0], place), bit(item.args[1], place))
        case 'zext':
            inner = item.args[0]
            return bit(inner, place) if place < inner.sort[1] else FALSE
        case 'trunc':
            return bit(item.args[0], place)
        case 'lshr' | 'shl' if item.args[1].op == 'constant':
            shift = item.args[1].value if item.op == 'lshr' else -item.args[1].value
            inside = 0 <= place + shift < item.sort[1]
            return bit(item.args[0], place + shift) if inside else FALSE
        case _:
            return term('bit', BOOL, (item,), place)


def resized(item: Term, bits: int, is_signed: bool) -> Term:
    """Truncate or extend a word to some bits; with `is_signed`, extend its sign."""
    have = item.sort[1]
    if have == bits:
        return item
    if item.op == 'word':
        return from_truth(item.args[0], bits)
    if bits < have:
        if item.op in ('zext', 'sext'):
            inner = item.args[0]
            return resized(inner, bits, item.op == 'sext')
        if _is_mask(item):
            return operation('sub', *(resized(each, bits, False) for each in item.args))
        return _make('trunc', word(bits), item)
    return _make('sext' if is_signed else 'zext', word(bits), item)


# -- floats ----------------------------------------------------------------------------------

def to_real(item: Term, bits: int, is_signed: bool = False) -> Term:
    """Convert a word or float to a float, rounded to nearest, ties to even."""
    if item.sort == real(bits):
        return item
    op = 'float' if item.sort[0] == 'real' else 'float_s' if is_signed else 'float_u'
    return _make(op, real(bits), item)


def library(name: str, *arguments: Term) -> Term:
    """Return the result of a function of the C library, uninterpreted."""
    return term(name, arguments[0].sort, arguments)


# -- rings and cells -------------------------------------------------------------------------

def filled(size: int, byte: int) -> Term:
    """Return a ring in which all bytes are equal."""
    return term('filled', ring(size), (), byte)


def select(array: Term, index: Term) -> Term:
    """Return the byte of a ring at an index, a word of 32 bits."""
    while array.op == 'store' and is_constant(array.args[1]) and is_constant(index):
        if array.args[1] is index:
            return array.args[2]
        array = array.args[0]
    if array.op == 'store' and array.args[1] is index:
        return array.args[2]
    if array.op == 'filled':
        return number(array.value, 8)
    return term('select', word(8), (array, index))


def store(array: Term, index: Term, byte: Term) -> Term:
    """Return a ring with the byte at an index replaced."""
    return term('store', array.sort, (array, index, byte))


def same(left: Term, right: Term) -> Term:
    """Return whether two values are identical: NaN equals NaN, and -0.0 differs from 0.0."""
    if left is right:
        return TRUE
    if left.sort == BOOL:
        return same_truth(left, right)
    if left.sort[0] == 'word':
        return _equal(left, right)
    if left.op == right.op == 'constant':
        return FALSE
    ordered = (left, right) if left.number < right.number else (right, left)
    return term('same', BOOL, ordered)


# -- substitution ----------------------------------------------------------------------------

def substituted(roots: Iterable[Term], parts: dict[Term, Term]) -> list[Term]:
    """Replace subterms in some terms, and normalise the result."""
    known = dict(parts)
    wanted = list(roots)
    for item in postorder(wanted, known):
        if item not in known:
            known[item] = _rebuilt(item, [known[each] for each in item.args])
    return [known[item] for item in wanted]


def _rebuilt(item: Term, args: list[Term]) -> Term:
    if tuple(args) == item.args:
        return item
    build = _BUILDERS.get(item.op)
    if build is not None:
        return build(*args)
    match item.op:
        case 'word':
            return from_truth(args[0], item.sort[1])
        case 'bit':
            return bit(args[0], item.value)
        case 'zext' | 'sext' | 'trunc':
            return resized(args[0], item.sort[1], item.op == 'sext')
        case 'float' | 'float_s' | 'float_u':
            return to_real(args[0], item.sort[1], item.op == 'float_s')
        case 'complement' | 'fneg':
            return unary(item.op, args[0])
        case _ if item.op in RELATIONS:
            return relation(item.op, args[0], args[1])
        case _ if item.op in FUNCTIONS and item.op not in LIBRARY:
            return operation(item.op, args[0], args[1])
        case _:
            return term(item.op, item.sort, tuple(args), item.value)


_BUILDERS: dict[str, Callable[..., Term]] = {
    'not': negation, 'and': conjunction, 'iff': same_truth, 'choice': choice, 'select': select,
    'store': store, 'same': same,
}
