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
The predefined functions of FRET and of mathematics: their names, arguments and formulas.

docs/numbers.md defines the operand types of `abs`, `min`, `max`, `ite` and `pre`; FRET's typed
spellings (`absInt`, `preReal` ...) restrict them. `persisted`, `occurred` and `prevOcc` look back
at most to the left end of the interval in which they are used: `FTP`, or the left end of the
scope of a FRETish sentence. In the expression of a scope there is no left end. The formulas are
FRET's. `over_time.py` has the functions of docs/over_time.md.
"""

from collections.abc import Callable, Sequence

from fret_monitor.elaboration.application import Application, count_of, Function
from fret_monitor.elaboration.arithmetic import arithmetic, magnitude
from fret_monitor.elaboration.over_time import OVER_TIME
from fret_monitor.elaboration.terms import (
    alike, cast, convert, describe, expect_bool, expect_number, Number, TypedTerm,
)
from fret_monitor.logic.formula import (
    ALWAYS, Binary, BinaryOperator, Choice, Formula, Historically, Once, Previous, Since, Unary,
    UnaryOperator, Window, Yesterday,
)
from fret_monitor.logic.numbers import ExactNumber
from fret_monitor.model.diagnostics import refuse
from fret_monitor.model.values import ValueType


def choice(condition: TypedTerm, yes: TypedTerm, no: TypedTerm, name: str) -> Formula:
    """Return `if condition then yes else no`; the branches are converted to a common type."""
    first, second = alike([yes, no], name)
    return Choice(expect_bool(condition, name), first, second)


def previous(initial: TypedTerm, argument: TypedTerm, name: str) -> Formula:
    """Return `initial -> pre argument`; both are converted to a common type."""
    first, second = alike([initial, argument], name)
    return Previous(first, second)


def _abs(call: Application) -> Formula | ExactNumber:
    _check_kind(call, call.arguments)
    return magnitude(_real(call, call.arguments[0]), call.quoted)


def _extreme(operator: BinaryOperator) -> Callable[[Application], Formula | ExactNumber]:
    def meaning(call: Application) -> Formula | ExactNumber:
        _check_kind(call, call.arguments)
        left, right = (_real(call, term) for term in call.arguments)
        return arithmetic(operator, left, right, call.quoted, call.place, call.problems)

    return meaning


def _library(operator: UnaryOperator | BinaryOperator) -> 'Function':
    """Return a function of the C library; its arguments are converted to float64."""
    def meaning(call: Application) -> Formula:
        terms = [cast(term, expect_number(term, call.quoted), ValueType.FLOAT64)
                 for term in call.arguments]
        if isinstance(operator, UnaryOperator):
            return Unary(operator, terms[0])
        return Binary(operator, terms[0], terms[1])

    return Function(('x',) if isinstance(operator, UnaryOperator) else ('y, x',), meaning)


def _ite(call: Application) -> Formula:
    condition, yes, no = call.arguments
    return choice(condition, yes, no, call.quoted)


def _pre(call: Application) -> Formula:
    _check_kind(call, call.arguments)
    initial, argument = (_real(call, term) for term in call.arguments)
    return previous(initial, argument, call.quoted)


def _check_kind(call: Application, terms: Sequence[TypedTerm]) -> None:
    """Refuse arguments of another type than the suffix of the name: Bool, Int or Real."""
    for term in terms:
        if call.name.endswith('Bool'):
            expect_bool(term, call.quoted)
        elif call.name.endswith('Int') and not term.is_text:
            _check_whole(call, term, expect_number(term, call.quoted))
        elif call.name.endswith('Real'):
            expect_number(term, call.quoted)


def _check_whole(call: Application, term: TypedTerm, value: Number) -> None:
    is_real = value.is_real if isinstance(value, ExactNumber) else value.type.is_float
    if is_real:
        refuse(f'{call.quoted} takes whole numbers', term.span, f'this is {describe(term)}',
               f"write {call.name.removesuffix('Int')}Real")


def _real(call: Application, term: TypedTerm) -> TypedTerm:
    """Convert an integer argument of a function `...Real` to a real number."""
    if not call.name.endswith('Real'):
        return term
    value = expect_number(term, call.quoted)
    if isinstance(value, ExactNumber):
        value = ExactNumber(value.value, True, value.is_negative_zero)
    elif value.type.is_integer:
        value = convert(value, ValueType.FLOAT64)
    return TypedTerm(value, term.span)


def _window(call: Application) -> Window:
    *counts, _ = (call.arguments)
    low, high = ([0] if len(counts) == 1 else []) + [count_of(call, it) for it in counts]
    if high < low:
        first, second = call.scale.shown(high), call.scale.shown(low)
        what = 'shorter time' if call.scale.is_timed else 'smaller number of steps'
        refuse(f'{call.quoted} takes the {what} first', counts[0].span,
               f'{second} is more than {first}', f'write {call.name}({first}, {second}, ...)')
    return Window(low, high)


def _persisted(call: Application) -> Formula:
    window, held = _window(call), expect_bool(call.arguments[-1], call.quoted)
    lasting = Historically(window, held)
    if call.left is None:
        return lasting
    assert window.high is not None
    since_left = Historically(Window(0, window.high - 1), _not(call.left))
    return Binary(BinaryOperator.AND, lasting, since_left)


def _occurred(call: Application) -> Formula:
    window, event = _window(call), expect_bool(call.arguments[-1], call.quoted)
    if call.left is None:
        return Once(window, event)
    if len(call.arguments) == 3:
        return Since(window, _not(call.left), event)
    since_left = Since(ALWAYS, _not(call.left), event)
    return Binary(BinaryOperator.AND, since_left, Once(window, event))


def _prev_occ(call: Application) -> Formula:
    event, then = (expect_bool(term, call.quoted) for term in call.arguments)
    both = Binary(BinaryOperator.AND, event, then)
    if call.left is None:
        return Yesterday(Since(ALWAYS, _not(event), both))
    quiet = Binary(BinaryOperator.AND, _not(call.left), _not(event))
    at_last = Binary(BinaryOperator.IMPLIES, Since(ALWAYS, quiet, event),
                     Since(ALWAYS, quiet, both))
    return Binary(BinaryOperator.OR, call.left, Yesterday(at_last))


def _not(formula: Formula) -> Formula:
    return Unary(UnaryOperator.NOT, formula)


_MIN = Function(('x, y',), _extreme(BinaryOperator.MIN))
_MAX = Function(('x, y',), _extreme(BinaryOperator.MAX))
_ABS = Function(('x',), _abs)
_PRE = Function(('initial, x',), _pre)

FUNCTIONS = {
    'abs': _ABS,
    'absInt': _ABS,
    'absReal': _ABS,
    'ite': Function(('condition, yes, no',), _ite),
    'max': _MAX,
    'maxInt': _MAX,
    'maxReal': _MAX,
    'min': _MIN,
    'minInt': _MIN,
    'minReal': _MIN,
    'occurred': Function(('n, p', 'm, n, p'), _occurred, gives_truth=True, counts_steps=True),
    'persisted': Function(('n, p', 'm, n, p'), _persisted, gives_truth=True, counts_steps=True),
    'preBool': Function(('initial, x',), _pre, gives_truth=True),
    'preInt': _PRE,
    'preReal': _PRE,
    'prevOcc': Function(('p, q',), _prev_occ, gives_truth=True),
    **OVER_TIME,
    **{item.value: _library(item)
       for item in (*UnaryOperator, BinaryOperator.ATAN2)
       if item is BinaryOperator.ATAN2 or isinstance(item, UnaryOperator) and item.is_library},
}

COUNTING = frozenset(name for name, item in FUNCTIONS.items() if item.counts_steps)
"""The functions that take numbers of steps."""
