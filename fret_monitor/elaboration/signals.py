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
The inputs and constants of a bundle, with their types and values checked.

The type of an input is that of its message field, or the scalar type in the bundle. Mistakes are
added to the problems; the declaration is then `Broken`, so that its uses are not reported.
"""

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
import re

from fret_monitor.bundle.bundle import ConstantEntry, InputEntry, ValueEntry
from fret_monitor.elaboration.functions import FUNCTIONS
from fret_monitor.elaboration.scope import Declaration, Role
from fret_monitor.elaboration.terms import Broken, TypedTerm, Vocabulary
from fret_monitor.logic.formula import FALSE, TRUE, Variable
from fret_monitor.logic.numbers import ExactNumber, NumberError, parse_number, stored
from fret_monitor.logic.specification import Signal
from fret_monitor.messages.constants import NamedValues, NO_CONSTANTS
from fret_monitor.messages.field_path import (
    check_reachable, doubt_part, field_line, is_key, key_type, resolve_field, ResolvedField,
)
from fret_monitor.messages.installed import listed, nested_layout
from fret_monitor.messages.layout import ArrayKind, MessageLayout
from fret_monitor.messages.path_parts import read_part
from fret_monitor.messages.serialize import has_stamp
from fret_monitor.model.diagnostics import CompileError, did_you_mean, Problems, refuse, Text
from fret_monitor.model.manifest import REDUCTIONS
from fret_monitor.model.names import is_integer, looks_like_number
from fret_monitor.model.paths import LookUp
from fret_monitor.model.policies import InputRole, InputSource, Stale
from fret_monitor.model.times import time_text
from fret_monitor.model.transforms import STAMPED
from fret_monitor.model.values import ValueType

FindMessage = Callable[[str], MessageLayout]

_PLAIN = {kind.value: kind for kind in ValueType}
_TEXT = 'string'
_TRANSFORM = 'transform'  # the field of geometry_msgs/msg/TransformStamped
_AGE, _OF_STAMP, _RECEIVED = 'age()', 'age(header.stamp)', 'received()'
_PERIOD, _RATE = 'period()', 'rate('
_USUAL_STARTUP_S = 10.0
_NUMBERS = {InputSource.AGE: ('an age', 'seconds'), InputSource.PERIOD: ('a period', 'seconds'),
            InputSource.RATE: ('a rate', 'messages a second')}
_MOST_MESSAGES = 2 ** 21  # of a rate: 16 MiB
_FIELD = r'(?P<field>[A-Za-z][A-Za-z0-9_.]*(?:\[[^][]*\][A-Za-z0-9_.]*)*)'
_CALL = re.compile(rf'\s*(?P<function>[A-Za-z_][A-Za-z0-9_]*)\s*\(\s*{_FIELD}\s*\)\s*')
_AMOUNT = r'[0-9.]+'
_ARITHMETIC = re.compile(
    rf'\s*(?P<before>{_AMOUNT}\s*[-+*/]\s*|-\s*)?{_FIELD}'
    rf'(?P<after>\s*[-+*/^]\s*{_AMOUNT})?\s*')
_TRUTHS = {'true': TRUE, 'false': FALSE}


def constant_declaration(entry: ConstantEntry, problems: Problems) -> Declaration:
    """Return the declaration of a constant: a Boolean or an exact number."""
    value = _TRUTHS.get(entry.value.value.strip().lower())
    if value is not None:
        return Declaration(Role.CONSTANT, TypedTerm(value, entry.value.span))
    try:
        literal = parse_number(entry.value.value)
    except NumberError as error:
        problems.error(f"the constant '{entry.name}' cannot be read", entry.value.span, str(error),
                       'a constant is a number, true or false')
        return Declaration(Role.CONSTANT, TypedTerm(Broken(), entry.value.span))
    return Declaration(Role.CONSTANT, TypedTerm(literal, entry.value.span))


def input_declaration(entry: InputEntry, find_message: FindMessage,
                      problems: Problems) -> tuple[Signal | None, Declaration]:
    """
    Return the signal of an input, None if it cannot be used, and the declaration of its name.

    If the parser refused a part of the entry, the other parts are checked all the same.
    """
    try:
        signal, vocabulary = _signal(entry, find_message, problems)
    except CompileError as error:
        problems.extend(error.diagnostics)
        signal = None
    if signal is None:
        return None, Declaration(Role.INPUT, TypedTerm(Broken(), entry.name.span))
    variable = Variable(signal.name, signal.type)
    return signal, Declaration(Role.INPUT, TypedTerm(
        variable, entry.name.span, vocabulary if vocabulary and vocabulary.numbers else None))


def _signal(entry: InputEntry, find_message: FindMessage,
            problems: Problems) -> tuple[Signal | None, Vocabulary | None]:
    if _is_type_damaged(entry, find_message) or 'variables' in entry.damaged:
        return None, None
    kind, layout, field = _type(entry, find_message)
    doubt = doubt_part(layout, field, entry.field) if layout and field else None
    problems.extend([doubt] if doubt else [])
    source = field.source if field else InputSource.FIELD
    if source in _NUMBERS and entry.values:
        title, unit = _NUMBERS[source]
        refuse(f'{title} has no names for its values', entry.values[0].name.span,
               f'it is a number of {unit}', "remove 'values'")
    if source.is_measured:
        _check_measure(entry, source, field.window if field else 0)
    constants = field.constants if field else NO_CONSTANTS
    values = None if 'values' in entry.damaged else \
        _values(entry, kind, bool(constants.all), problems)
    stored_as = ValueType.INT32 if kind is None else kind
    if values is None:
        # Without usable values, only a numeric initial value can be checked.
        if kind and entry.initial and looks_like_number(entry.initial.value.strip()):
            _initial(entry, kind, Vocabulary(()))
        return None, None
    vocabulary = Vocabulary(values, constants)
    initial = None
    try:
        initial = _initial(entry, stored_as, vocabulary)
        if source is InputSource.RECEIVED and initial and entry.initial:
            refuse(f"'{entry.name}' cannot be true at first", entry.initial.span,
                   'no message has come then', 'initial: false')
    except CompileError as error:
        # Continue: the type is known, so that formulas with this input can be checked.
        problems.extend(error.diagnostics)
    signal = Signal(
        name=entry.name.value,
        type=stored_as,
        topic=entry.topic.value if entry.topic else None,
        message_type=layout.name if layout else None,
        path=field.path if field else (),
        values=vocabulary.named,
        initial=initial,
        qos=tuple((key.value, _qos_value(value.value)) for key, value in entry.qos),
        timeout=None if entry.timeout is None else float(entry.timeout),
        stale=entry.stale or Stale.WARN,
        startup=_startup(entry),
        reduction=field.reduction if field else '',
        layout=layout,
        max_rate=entry.max_rate,
        source=source,
        role=entry.role or InputRole.INPUT,
        place=entry.name.span,
        made=entry.made,
        variables=entry.variables,
        where=_where(entry, layout) if entry.where and layout else None,
        window=field.window if field else 0,
        scale=1.0 if entry.scale is None else float(entry.scale),
    )
    _check_scale(entry, signal, problems)
    return signal, vocabulary


def _check_scale(entry: InputEntry, signal: Signal, problems: Problems) -> None:
    """Report a scale of values that have no distance."""
    if entry.scale is not None and (signal.type is ValueType.BOOL or signal.values):
        what = 'names' if signal.values else 'true and false'
        problems.error(f"'{entry.name}' cannot have a scale", entry.name.span,
                       f'its values are {what}, which have no distance', "remove 'scale'")


def _where(entry: InputEntry, layout: MessageLayout) -> LookUp:
    """Return what `where` compares: a field of the message with a name, a number or a key."""
    text = entry.where
    assert text is not None, 'called for an input with `where`'
    found = read_part(text, lambda inside: f'where: "{inside}"')
    if not isinstance(found, LookUp):
        refuse("'where' must compare a field of the message", text.span, 'expected FIELD = VALUE',
               f'where: "name = {entry.variables[0] if entry.variables else "imu"}"')
    key = key_type(layout, found.key)
    name = '.'.join(found.key)
    start = text.value.index(found.key[0])
    place = text.at(start, start + len(name))
    if key is None or key.array is not ArrayKind.NONE or not is_key(key.base):
        names = [item.name for item in layout.fields
                 if item.type.array is ArrayKind.NONE and is_key(item.type.base)]
        names += ['header.frame_id'] if has_stamp(layout) else []
        refuse(f"'{name}' cannot be compared in 'where'", place,
               f'{layout.name} has no such field' if key is None else f'this is {key}',
               listed(names) if names else
               f'{layout.name} has no string and no whole number to select by')
    if key.base != _TEXT and not found.variable and not is_integer(found.name):
        refuse(f"'{name}' is a number", text.span, f'this compares it with the text {found.name}',
               f'where: "{name} = 1"')
    return found


def _check_measure(entry: InputEntry, source: InputSource, window: int) -> None:
    """Refuse a measure of messages without a topic, or without a bound on their number."""
    field = entry.field or entry.name
    if entry.topic is None and entry.made is None and 'topic' not in entry.damaged:
        refuse(f"the input '{entry.name}' has no topic", field.span,
               f'{_NUMBERS[source][0]} is one of messages on a topic', 'topic: scan')
    if source is not InputSource.RATE or 'max_rate' in entry.damaged:
        return
    if entry.max_rate is None:
        refuse(f"the rate of '{entry.name}' needs the greatest number of messages a second",
               field.span, f'it keeps the times of the messages of {time_text(window)}',
               'max_rate: 100   # Hz')
    room = Signal(entry.name.value, ValueType.FLOAT64, None, None, (), (), None, (),
                  max_rate=entry.max_rate, source=source, window=window).room
    if room > _MOST_MESSAGES:
        refuse(f"the rate of '{entry.name}' keeps the times of {room:,} messages", field.span,
               f'at most {_MOST_MESSAGES:,}', 'write a shorter time, or a lower max_rate')


def _is_type_damaged(entry: InputEntry, find_message: FindMessage) -> bool:
    """Whether the parser refused the input's type or field; report an unknown message too."""
    if entry.type is None:
        return 'type' in entry.damaged
    if 'field' not in entry.damaged or '/' not in entry.type.value:
        return False
    find_layout(entry.type.value, entry.type, find_message)
    return True


def _startup(entry: InputEntry) -> float | None:
    if entry.made and entry.made.kind.has_absence:  # there is a value when its patience is over
        return entry.made.patience + float(entry.timeout) if entry.timeout is not None else None
    if entry.startup is not None:
        return float(entry.startup)
    return None if entry.timeout is None else max(_USUAL_STARTUP_S, float(entry.timeout))


def _qos_value(text: str) -> str | int:
    return int(text) if text.isascii() and text.isdigit() else text


def _type(entry: InputEntry, find_message: FindMessage) -> tuple[
        ValueType | None, MessageLayout | None, ResolvedField | None]:
    """Return the type of an input (None for a string), its message, and the message's field."""
    if entry.type is None:
        refuse(f"the input '{entry.name}' has no type", entry.name.span, '',
               'type: std_msgs/msg/Float32')
    name = entry.type.value
    if '/' not in name:
        return _scalar(name, entry.type, _PLAIN), None, None
    layout = find_layout(name, entry.type, find_message)
    if entry.field is not None:
        _refuse_mathematics(entry.name.value, entry.field)
    field = _transform_field(layout, entry) if layout.name == STAMPED and entry.made else \
        resolve_field(layout, entry.field, entry.type)
    check_reachable(layout, field, entry.type.span)
    return _scalar(field.type_name, entry.field or entry.type, _PLAIN), layout, field


def _transform_field(layout: MessageLayout, entry: InputEntry) -> ResolvedField:
    """Return a field of a transform: one of geometry_msgs/msg/Transform, or of its stamp."""
    path, place = entry.field, entry.type or entry.name
    call = ''.join(path.value.split()) if path else ''
    if path and call == _AGE:
        at = path.offsets
        path = Text(_OF_STAMP, path.source, [at[0]] * len(_OF_STAMP) + [at[-1]])
    if call in (_AGE, _RECEIVED, _PERIOD) or call.startswith(_RATE):
        return resolve_field(layout, path, place)
    kind = next(item.type for item in layout.fields if item.name == _TRANSFORM)
    field = resolve_field(nested_layout(layout, kind, place.span), path, place)
    return replace(field, path=(_TRANSFORM, *field.path), types=(kind, *field.types))


def _refuse_mathematics(name: str, path: Text) -> None:
    """Refuse a function of formulas, and arithmetic, of a field."""
    called, worked_out = _CALL.fullmatch(path.value), _ARITHMETIC.fullmatch(path.value)
    if called and called['function'] in FUNCTIONS and called['function'] not in REDUCTIONS:
        read, use = called['field'], f'{called["function"]}({name})'
        place = path.at(*called.span('function'))
    elif worked_out and (worked_out['before'] or worked_out['after']):
        read = worked_out['field']
        use = f'{worked_out["before"] or ""}{name}{worked_out["after"] or ""}'
        place = path.span
    else:
        return
    refuse('a field is only read: formulas compute with it', place, 'this belongs in a formula',
           f'{field_line([read], path)}\nand in the formula, or in a definition: {use}')


def find_layout(name: str, text: Text, find_message: FindMessage) -> MessageLayout:
    """Return the layout of a message; the errors have the place of the text."""
    try:
        return find_message(name)
    except CompileError as error:
        raise CompileError([item if item.span else replace(item, span=text.span)
                            for item in error.diagnostics]) from None


def _scalar(name: str, text: Text, plain: dict[str, ValueType]) -> ValueType | None:
    if name in (_TEXT, 'wstring'):
        return None
    if name not in plain:
        refuse(f"'{name}' is not a type that a monitor can read", text.span, '',
               did_you_mean(name, plain) or 'one of ' + ', '.join([*plain, _TEXT]))
    return plain[name]


def _values(entry: InputEntry, kind: ValueType | None, has_constants: bool,
            problems: Problems) -> NamedValues | None:
    """Return the names of an input's values with the values, or None if one is wrong."""
    if kind is None and not entry.values and not has_constants:
        refuse(f"the input '{entry.name}' is text, but a monitor reads numbers",
               (entry.type or entry.name).span, 'a string needs names for its values',
               'values: {IDLE: "idle", LANDING: "landing"}')
    if kind is ValueType.BOOL and entry.values:
        refuse(f"'{entry.values[0].name}' cannot be a value of type bool",
               entry.values[0].value.span, 'a bool is already true or false',
               'remove values, and write the input by itself or with ! before it')
    found: list[tuple[str, int | str]] = []
    for item in entry.values:
        try:
            value = _string(item) if kind is None else _value(item, kind)
        except CompileError as error:
            problems.extend(error.diagnostics)
        else:
            found.append((item.name.value, value))
    return tuple(found) if len(found) == len(entry.values) else None


def _string(item: ValueEntry) -> str:
    """Return the string of a name of values."""
    if not item.is_string:
        refuse(f"'{item.name}' cannot be a value of text", item.value.span, 'this is a number',
               f'{item.name}: "{item.value}"')
    return item.value.value


def _value(item: ValueEntry, kind: ValueType) -> int:
    """Return the number of a name of values."""
    title = f"'{item.name}' cannot be a value of type {kind.value}"
    if item.is_string:
        refuse(title, item.value.span, 'this is text',
               'write the number without quotes' if looks_like_number(item.value.value) else
               'write a number, such as 1')
    try:
        literal = parse_number(item.value.value)
        stored(literal, kind)
    except NumberError as error:
        refuse(title, item.value.span, str(error))
    if literal.is_real:
        refuse(title, item.value.span, 'names are for whole numbers')
    return literal.value.numerator


def _initial(entry: InputEntry, kind: ValueType,
             vocabulary: Vocabulary) -> bool | int | float | None:
    """Return the value of an input before the first message, as stored in the input's type."""
    if entry.initial is None:
        return None
    text = entry.initial.value.strip()
    if text in vocabulary.numbers:
        return _stored(ExactNumber(Fraction(vocabulary.numbers[text]), False), kind, entry.initial)
    if vocabulary.is_text:
        return _initial_text(text, vocabulary, entry.initial)
    if kind is ValueType.BOOL:
        return _initial_truth(text, entry.initial)
    try:
        literal = parse_number(text)
    except NumberError as error:
        refuse('this initial value cannot be read', entry.initial.span, str(error),
               f'a number of type {kind.value}'
               + (f', or {vocabulary}' if vocabulary.numbers else ''))
    return _stored(literal, kind, entry.initial)


def _stored(literal: ExactNumber, kind: ValueType, text: Text) -> int | float:
    try:
        return stored(literal, kind)
    except NumberError as error:
        refuse(f'this initial value cannot be of type {kind.value}', text.span, str(error))


def _initial_text(text: str, vocabulary: Vocabulary, place: Text) -> int:
    strings = [value for _, value in vocabulary.named]
    if text not in strings:
        refuse(f"'{text}' is not one of the input's values", place.span, '',
               did_you_mean(text, vocabulary.numbers) or f'the values are {vocabulary}')
    return strings.index(text)


def _initial_truth(text: str, place: Text) -> bool:
    if text.lower() not in _TRUTHS:
        refuse('this initial value cannot be of type bool', place.span, '', 'write true or false')
    return text.lower() == 'true'
