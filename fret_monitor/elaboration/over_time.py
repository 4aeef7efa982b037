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
The functions of numbers over time (docs/over_time.md): their names, arguments and formulas.

A window [0,d] holds the steps from d ago to this one. Under the policy timed a sum, a mean and a
count take each message of the window once; else they take each step.
"""

from collections.abc import Callable

from fret_monitor.elaboration.application import Application, count_of, Function
from fret_monitor.elaboration.terms import (
    alike, cast, convert, expect_bool, expect_number, Lasting, promoted, TypedTerm,
)
from fret_monitor.logic.formula import (
    Aggregate, Ago, ALWAYS, Binary, BinaryOperator, Choice, Constant, Formula, FTP, Held,
    MessageSlope, Over, Previous, Since, Slope, TRUE, Unary, UnaryOperator,
)
from fret_monitor.logic.numbers import ExactNumber
from fret_monitor.model.diagnostics import refuse
from fret_monitor.model.policies import Policy
from fret_monitor.model.values import ValueType

_ZERO = Constant(0.0, ValueType.FLOAT64)
_TRUTHS = {'maxOver': 'occurred', 'minOver': 'persisted', 'meanOver': 'countOver',
           'sumOver': 'countOver'}
"""Functions that say of a truth value what others say of numbers."""


def _past(call: Application) -> int:
    """Return the length of a window."""
    term = call.arguments[0]
    length = count_of(call, term)
    if length == 0:
        refuse(f'{call.quoted} takes a window that is longer than 0', term.span, 'this is 0',
               f'write {call.name}(1 s, ...)' if call.scale.is_timed else
               f'write {call.name}(1, ...), for this step and the one before')
    return length


def _number(call: Application, kind: ValueType | None = None) -> Formula:
    """Return the last argument, a number that an input gives, as one of a type."""
    term = call.arguments[-1]
    value = expect_number(term, call.quoted, _numbers_of(call, term))
    if isinstance(value, ExactNumber):
        refuse(f'{call.quoted} takes a number that an input changes', term.span,
               f'this is {value} at every step', 'write an input, or what is computed of one')
    return cast(term, value, kind) if kind else promoted(value)


def _numbers_of(call: Application, term: TypedTerm) -> str:
    """Return what to write for a truth value, or text, in place of a number."""
    condition = term.span.written
    if term.is_text:
        condition += f' = {next(iter(term.vocabulary.numbers))}' if term.vocabulary else ''
    if call.name not in _TRUTHS:
        return f'write {call.name}({call.arguments[0].span.written}, ite({condition}, 1, 0))' \
            if len(call.arguments) > 1 else f'write {call.name}(ite({condition}, 1, 0))'
    return f'write {_TRUTHS[call.name]}({call.arguments[0].span.written}, {condition})'


def _messages(call: Application, formula: Formula) -> Formula:
    """Return when a message comes on a topic that a formula reads."""
    if isinstance(formula, Constant):
        refuse(f'{call.quoted} takes a condition that an input changes', call.arguments[-1].span,
               f'this is {"TRUE" if formula.value else "FALSE"} at every message',
               'write a comparison of an input, as in x > 0')
    found = call.implied.messages(formula) if call.implied else None
    if found is None:
        refuse(f'{call.quoted} takes what the messages of an input say', call.arguments[-1].span,
               'this reads no input', 'write a comparison of an input, as in x > 0')
    return found


def _extreme(aggregate: Aggregate) -> Callable[[Application], Formula]:
    return lambda call: Over(aggregate, _past(call), _number(call), TRUE)


def _at(call: Application, formula: Formula) -> Formula:
    """Return at which steps of a window there is a value."""
    return _messages(call, formula) if call.scale.is_timed else TRUE


def _sum(call: Application) -> Formula:
    number = _number(call)
    if number.type.is_float:
        number = convert(number, ValueType.FLOAT64)
    return Over(Aggregate.SUM, _past(call), number, _at(call, number))


def _mean(call: Application) -> Formula:
    number = _number(call, ValueType.FLOAT64)
    return Over(Aggregate.MEAN, _past(call), number, _at(call, number))


def _count(call: Application) -> Formula:
    event = expect_bool(call.arguments[-1], call.quoted)
    return Over(Aggregate.COUNT, _past(call), event, _at(call, event))


def _time(call: Application) -> Lasting:
    return Lasting(_past(call), expect_bool(call.arguments[-1], call.quoted))


def _change(call: Application) -> Formula:
    number = _number(call)
    return Binary(BinaryOperator.SUB, number, Ago(_past(call), number))


def _derivative(call: Application) -> Formula:
    number = _number(call, ValueType.FLOAT64)
    if call.scale.is_timed:
        return Slope(number, _messages(call, number), 1)
    if call.scale.policy is not Policy.PERIODIC:
        return _between_messages(call, number)
    change = Binary(BinaryOperator.SUB, number, Previous(_ZERO, number))
    period = Constant(float(call.scale.period or 1), ValueType.FLOAT64)
    return Choice(FTP, _ZERO, Binary(BinaryOperator.DIV, change, period))


def _between_messages(call: Application, number: Formula) -> Formula:
    """
    Return a derivative where a step is a message: by the times of reception.

    Under all_inputs each step has a new message of each topic.
    """
    at = _messages(call, number)
    time = call.implied.time(number) if call.implied else None
    if time is None:
        refuse(f'{call.quoted} divides by a time', call.place, 'here a step has no length')
    if call.scale.policy is Policy.ALL_INPUTS:
        at = TRUE
    return MessageSlope(number, at, time)


def _held(call: Application) -> Formula:
    condition = expect_bool(call.arguments[0], call.quoted)
    value, = alike(call.arguments[1:], call.quoted)
    if value.type is not ValueType.BOOL:
        return Held(condition, value)
    taken = Binary(BinaryOperator.OR, condition, FTP)
    return Since(ALWAYS, Unary(UnaryOperator.NOT, condition),
                 Binary(BinaryOperator.AND, taken, value))


OVER_TIME = {
    'changeOver': Function(('d, x',), _change, counts_steps=True),
    'countOver': Function(('d, p',), _count, counts_steps=True),
    'derivative': Function(('x',), _derivative),
    'heldAt': Function(('p, x',), _held),
    'maxOver': Function(('d, x',), _extreme(Aggregate.GREATEST), counts_steps=True),
    'meanOver': Function(('d, x',), _mean, counts_steps=True),
    'minOver': Function(('d, x',), _extreme(Aggregate.LEAST), counts_steps=True),
    'sumOver': Function(('d, x',), _sum, counts_steps=True),
    'timeOver': Function(('d, p',), _time, counts_steps=True, is_timed=True),
}
