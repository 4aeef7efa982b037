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
Random messages, serialized and read again: the reference for generated extractors.

A value of a message is a `Tree`, with an attribute for each field, like the objects of rclpy.
`serialize` writes one in either byte order, and `taken` returns what an input must read from one,
or from a message object of rclpy. Neither uses the generated C.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial
from importlib import import_module
import math
from operator import attrgetter
from pathlib import Path
from random import Random
import struct
from types import SimpleNamespace
from typing import Any

from fret_monitor.logic.specification import Signal
from fret_monitor.messages.field_path import resolve_field
from fret_monitor.messages.installed import find_message
from fret_monitor.messages.layout import ArrayKind, FieldType, MessageField, MessageLayout
from fret_monitor.model.diagnostics import Source, Text
from fret_monitor.model.manifest import ANGLES
from fret_monitor.model.paths import LookUp, path_text, Sector, Slice
from fret_monitor.model.values import ValueType
from fret_monitor.runtime.fields import FieldReading, ReadOutcome
from hypothesis import strategies as st

Tree = SimpleNamespace
FORMATS = {
    'bool': '?', 'byte': 'B', 'char': 'B', 'int8': 'b', 'uint8': 'B', 'int16': 'h', 'uint16': 'H',
    'int32': 'i', 'uint32': 'I', 'int64': 'q', 'uint64': 'Q', 'float32': 'f', 'float64': 'd'}
WORDS = (('EMPTY', ''), ('IDLE', 'idle'), ('ODD', 'é😀"\\?'), ('LONG', 'a' * 40))
PARTS = ('[1:3]', '[-2:]', '[:-1]', '[2:]', '[-30 deg : 90 deg]', '[150 deg : -150 deg]')
_TIMES = ('builtin_interfaces/msg/Time', 'builtin_interfaces/msg/Duration')
_DEEPEST = 6
_LONGEST = 5
_FLOATS = (-0.0, math.nan, math.inf, -math.inf, 2.0 ** 127, 2.0 ** -149, 0.1)
# By identity, since hashing an input with its layout takes longer than reading its value.
_bases: dict[int, tuple[Signal, str]] = {}


# -- values ---------------------------------------------------------------------------------------


def trees(layout: MessageLayout) -> st.SearchStrategy[Tree]:
    """Return a strategy for the values of a message."""
    return st.builds(Tree, **{item.name: _values(layout, item.type) for item in layout.fields})


def random_tree(layout: MessageLayout, rng: Random) -> Tree:
    """Return a value of a message; hypothesis takes fifty times as long to draw one."""
    return Tree(**{item.name: _random_value(layout, item.type, rng) for item in layout.fields})


def _nested(layout: MessageLayout, kind: FieldType) -> MessageLayout:
    return _found(kind.base, layout.search_path)


@cache
def _found(name: str, prefixes: Sequence[Path]) -> MessageLayout:
    # `find_message` looks each time whether the file has changed.
    return find_message(name, prefixes or None)


def weight(layout: MessageLayout) -> int:
    """Return about how many values a message has."""
    total = 0
    for item in layout.fields:
        one = weight(_nested(layout, item.type)) if item.type.is_message else 1
        is_fixed = item.type.array is ArrayKind.FIXED
        total += one * ((item.type.size or 0) if is_fixed else 1)
    return total


def _values(layout: MessageLayout, kind: FieldType) -> st.SearchStrategy[Any]:
    element = trees(_nested(layout, kind)) if kind.is_message else _scalars(kind)
    match kind.array:
        case ArrayKind.NONE:
            return element
        case ArrayKind.FIXED:
            return st.lists(element, min_size=kind.size or 0, max_size=kind.size)
        case ArrayKind.BOUNDED:
            return st.lists(element, max_size=min(kind.size or 0, _LONGEST))
        case ArrayKind.UNBOUNDED:
            return st.lists(element, max_size=_LONGEST)


def _scalars(kind: FieldType) -> st.SearchStrategy[Any]:
    base = kind.base
    if base in ('string', 'wstring'):
        # rclpy drops a byte order mark. No surrogates: they cannot be encoded.
        character = st.characters(exclude_categories=['Cs'], exclude_characters='\0\ufeff')
        return st.sampled_from(_words(kind)) | st.text(character, max_size=_most(kind))
    if base == 'bool':
        return st.booleans()
    if base.startswith('float'):
        return st.floats(width=32 if base == 'float32' else 64)
    return st.integers(*_ends(base))


def _most(kind: FieldType) -> int:
    """Return the most characters of a random string, of up to four bytes each."""
    return (8 if kind.text_limit is None else kind.text_limit) // 4


def _words(kind: FieldType) -> list[str]:
    return [word for _, word in WORDS
            if kind.text_limit is None or len(word.encode()) <= kind.text_limit]


@cache
def _ends(base: str) -> tuple[int, int]:
    """Return the least and the greatest value of a type of integers."""
    bits = 8 * struct.calcsize(f'={FORMATS[base]}')
    return (-2 ** (bits - 1), 2 ** (bits - 1) - 1) if base.startswith('int') \
        else (0, 2 ** bits - 1)


def _random_value(layout: MessageLayout, kind: FieldType, rng: Random) -> Any:
    draw = partial(random_tree, _nested(layout, kind), rng) if kind.is_message \
        else partial(_random_scalar, kind, rng)
    match kind.array:
        case ArrayKind.NONE:
            return draw()
        case ArrayKind.FIXED:
            length = kind.size or 0
        case ArrayKind.BOUNDED:
            length = rng.randint(0, min(kind.size or 0, _LONGEST))
        case ArrayKind.UNBOUNDED:
            length = rng.randint(0, _LONGEST)
    return [draw() for _ in range(length)]


def _random_scalar(kind: FieldType, rng: Random) -> Any:
    """Return a value of any bits, or one of those at which mistakes are likelier."""
    base = kind.base
    if base in ('string', 'wstring'):
        if rng.random() < 0.5:
            return rng.choice(_words(kind))
        return ''.join(_random_character(rng) for _ in range(rng.randint(0, _most(kind))))
    if base == 'bool':
        return rng.random() < 0.5
    if base.startswith('float'):
        code = FORMATS[base]
        size = struct.calcsize(code)
        data = rng.randbytes(size) if rng.random() < 0.3 else struct.pack(
            code, rng.choice((*_FLOATS, rng.uniform(-10, 10), float(rng.randint(-9, 9)))))
        return struct.unpack(code, data)[0]
    least, most = _ends(base)
    return rng.choice((least, most, 0, 1, rng.randint(max(least, -9), 9),
                       rng.randint(least, most)))


def _random_character(rng: Random) -> str:
    while True:
        found = chr(rng.randrange(1, rng.choice((0x80, 0x800, 0x10000, 0x110000))))
        if not '\ud800' <= found <= '\udfff' and found != '\ufeff':
            return found


# -- CDR ------------------------------------------------------------------------------------------


def serialize(layout: MessageLayout, tree: Any, *, big: bool = False) -> bytes:
    """Return a message in plain CDR, as ROS 2 sends it."""
    out = bytearray()
    _write_message(out, layout, tree, '>' if big else '<')
    return (b'\0\0\0\0' if big else b'\0\1\0\0') + bytes(out)


def _write_message(out: bytearray, layout: MessageLayout, tree: Any, order: str) -> None:
    if not layout.fields:
        out.append(0)
    for item in layout.fields:
        value = getattr(tree, item.name)
        if item.type.array is ArrayKind.NONE:
            _write_element(out, layout, item.type, value, order)
            continue
        if item.type.array is not ArrayKind.FIXED:
            _write_number(out, 'I', len(value), order)
        for element in value:
            _write_element(out, layout, item.type, element, order)


def _write_element(out: bytearray, layout: MessageLayout, kind: FieldType, value: Any,
                   order: str) -> None:
    if kind.is_message:
        _write_message(out, _nested(layout, kind), value, order)
    elif kind.base == 'string':
        data = value.encode()
        _write_number(out, 'I', len(data) + 1, order)
        out += data + b'\0'
    elif kind.base == 'wstring':
        units = _units(value)
        _write_number(out, 'I', len(units), order)
        for unit in units:
            _write_number(out, 'I', unit, order)
    else:
        _write_number(out, FORMATS[kind.base], value, order)


def _write_number(out: bytearray, code: str, value: Any, order: str) -> None:
    size = struct.calcsize(f'={code}')
    out += bytes(-len(out) % size)
    out += struct.pack(order + code, value)


def _units(text: str) -> list[int]:
    return [unit for (unit,) in struct.iter_unpack('<H', text.encode('utf-16-le'))]


# -- rclpy ----------------------------------------------------------------------------------------


def message_class(name: str) -> Any:
    """Import the class of a message, also of a service or an action."""
    package, folder, word = name.split('/')
    module = import_module(f'{package}.{folder}')
    if folder == 'action' and not hasattr(module, word):
        action, _, part = word.partition('_')
        inside = getattr(module, action)
        return inside.Impl.FeedbackMessage if part == 'FeedbackMessage' else getattr(inside, part)
    return getattr(module, word)


def message_object(layout: MessageLayout, tree: Any) -> Any:
    """Return the message object of rclpy that holds a tree's values."""
    made = message_class(layout.name)()
    for item in layout.fields:
        value = getattr(tree, item.name)
        if item.type.is_message:
            inside = _nested(layout, item.type)
            value = message_object(inside, value) if item.type.array is ArrayKind.NONE \
                else [message_object(inside, element) for element in value]
        elif item.type.base == 'byte':
            value = bytes([value]) if item.type.array is ArrayKind.NONE \
                else [bytes([element]) for element in value]
        setattr(made, item.name, value)
    return made


# -- reading --------------------------------------------------------------------------------------


def taken(message: Any, signal: Signal) -> FieldReading:
    """Return what an input must read from a tree or a message object."""
    value = message
    for step in signal.path:
        index: int | None = None
        match step:
            case str():
                beside, value = value, getattr(value, step)
                continue
            case Slice():
                indices = [index + len(value) if index < 0 else index
                           for index in (step.start or 0, _stop(step, value))]
                if not 0 <= indices[0] <= indices[1] <= len(value):
                    return FieldReading(ReadOutcome.OUTSIDE, None, len(value))
                value = [value[index] for index in range(*indices)]
                continue
            case Sector():
                value = [value[index] for index in in_sector(
                    beside.angle_min, beside.angle_increment, len(value), step)]
                if not value:
                    return FieldReading(ReadOutcome.EMPTY, None)
                continue
            case LookUp():
                index = _place_of(step, beside, value)
                if index is None:
                    return FieldReading(ReadOutcome.ABSENT, None, len(value))
            case int():
                index = step
        if index >= len(value):
            return FieldReading(ReadOutcome.OUTSIDE, None, len(value))
        value = value[index]
    base = _base(signal)
    if signal.reduction:
        return _reduced(signal.reduction, value, base)
    if base in ('string', 'wstring'):
        words = [word for _, word in signal.values]
        return FieldReading(ReadOutcome.READ, words.index(value)) if value in words \
            else FieldReading(ReadOutcome.UNNAMED, None, _length(value, base))
    return FieldReading(ReadOutcome.READ, _plain(value))


def _stop(step: Slice, value: Any) -> int:
    return len(value) if step.stop is None else step.stop


def _place_of(step: LookUp, beside: Any, array: Any) -> int | None:
    """Return the index of the first element of a name."""
    names = getattr(beside, step.key[0]) if step.is_parallel \
        else [attrgetter('.'.join(step.key))(element) for element in array]
    texts = list(map(str, names))
    return texts.index(step.name) if step.name in texts else None


def in_sector(least: float, increment: float, count: int, sector: Sector) -> list[int]:
    """Return the indices of a scan's elements in a sector, by the angle of each."""
    turn = 2 * math.pi
    size = abs(increment)
    if not (abs(least) <= 2 * turn and 0 < size <= turn and turn / size < 2 ** 32
            and (count - 1) * size <= 2 * turn):
        return []
    found = []
    for index in range(count):
        past = (least + index * increment - sector.first) % turn
        if past <= sector.width + 0.01 * size or past >= turn - 0.01 * size:
            found.append(index)
    return found


def _base(signal: Signal) -> str:
    """Return the type of the field that an input reads, or of its elements."""
    known = _bases.get(id(signal))
    if known is None:
        assert signal.layout is not None
        path = path_text(signal.path)
        call = f'{signal.reduction}({path})' if signal.reduction not in ('', 'seconds') else path
        found = resolve_field(signal.layout, text(call), text(signal.layout.name))
        known = _bases[id(signal)] = signal, found.types[-1].base
    return known[1]


def text(value: str) -> Text:
    """Return a text without a place in a file."""
    return Text.whole(Source('test', value))


def _plain(value: Any) -> bool | int | float:
    """Return a number of numpy or rclpy as a number of Python."""
    if isinstance(value, bytes):
        return value[0]
    found: bool | int | float = value.item() if hasattr(value, 'item') else value
    return found


def _length(value: Any, base: str) -> int:
    if isinstance(value, str):
        return len(_units(value)) if base == 'wstring' else len(value.encode())
    return len(value)


def _reduced(function: str, value: Any, base: str) -> FieldReading:
    if function == 'seconds':
        return FieldReading(ReadOutcome.READ, value.sec + value.nanosec * 1e-9)
    if function == 'len':
        return FieldReading(ReadOutcome.READ, _length(value, base))
    elements = [_plain(element) for element in _elements(value)]
    if not elements and function in ('min', 'max', 'mean'):
        return FieldReading(ReadOutcome.EMPTY, None)
    return FieldReading(ReadOutcome.READ, REDUCE[function](elements, base))


def _elements(value: Any) -> Iterable[Any]:
    """Return the elements of an array, or the fields of a message."""
    if isinstance(value, Tree):
        return vars(value).values()
    if hasattr(value, 'get_fields_and_field_types'):
        return [getattr(value, name) for name in value.get_fields_and_field_types()]
    found: Iterable[Any] = value
    return found


def _total(values: Iterable[float]) -> float:
    """Add as C does: Python's own sum of floats is more exact."""
    total = 0.0
    for value in values:
        total += value
    return total


def _sum(values: list[Any], base: str) -> int | float:
    if base.startswith('float'):
        return _total(values)
    wrapped: int = sum(values) % 2 ** 64
    return wrapped - 2 ** 64 if base.startswith('int') and wrapped >= 2 ** 63 else wrapped


def _extreme(choose: Callable[[list[Any]], Any]) -> Callable[[list[Any], str], Any]:
    return lambda values, _: choose([value for value in values if value == value] or values)


def _turned(x: float, y: float, z: float, w: float) -> tuple[float, float, float]:
    """Return yaw, pitch and roll of a quaternion."""
    square = x * x + y * y + z * z + w * w
    sine = 2 * (w * y - x * z) / square if square else math.nan
    if math.isnan(sine):
        return sine, sine, sine
    sine = max(-1.0, min(1.0, sine))
    if abs(sine) > 0.99999:
        return (math.atan2(2 * (w * z - x * y), w * w - x * x + y * y - z * z), math.asin(sine),
                0.0)
    return (math.atan2(2 * (x * y + w * z), w * w + x * x - y * y - z * z), math.asin(sine),
            math.atan2(2 * (y * z + w * x), w * w - x * x - y * y + z * z))


REDUCE: dict[str, Callable[[list[Any], str], Any]] = {
    'min': _extreme(min),
    'max': _extreme(max),
    'sum': _sum,
    'mean': lambda values, _: _total(map(float, values)) / len(values),
    'norm': lambda values, _: math.sqrt(_total(float(value) * float(value) for value in values)),
    'yaw': lambda values, _: _turned(*values)[0],
    'pitch': lambda values, _: _turned(*values)[1],
    'roll': lambda values, _: _turned(*values)[2],
    'any': lambda values, _: any(values),
    'all': lambda values, _: all(values),
}


def same(one: FieldReading, other: FieldReading) -> bool:
    """Whether two readings are the same; NaN is NaN, and true is not 1."""
    if (one.outcome, one.length) != (other.outcome, other.length):
        return False
    if isinstance(one.value, float) and math.isnan(one.value):
        return isinstance(other.value, float) and math.isnan(other.value)
    return type(one.value) is type(other.value) and one.value == other.value


# -- inputs ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Topic:
    """A message type, and inputs on its fields."""

    layout: MessageLayout
    signals: tuple[Signal, ...]


def written_paths(layout: MessageLayout, prefix: str = '', depth: int = 0,
                  most_elements: int = 4) -> Iterator[str]:
    """Yield the paths of all readable values and a few others; of arrays, of a few elements."""
    if depth > _DEEPEST:
        return
    for item in layout.fields:
        path, kind = prefix + item.name, item.type
        is_text = kind.base in ('string', 'wstring')
        if kind.array is not ArrayKind.NONE:
            functions = ('len',) if kind.is_message or is_text else ('len', *REDUCE)
            yield from (f'{function}({path}{part})' for function in functions
                        for part in ('', *PARTS))
            for one in _looked_up(layout, item, prefix):
                yield one
                yield f'len({one})'
                if kind.is_message:
                    yield from written_paths(_nested(layout, kind), f'{one}.', depth + 1,
                                             most_elements)
        last = 9 if kind.size is None else kind.size - 1
        for one in [path] if kind.array is ArrayKind.NONE else \
                [f'{path}[{index}]' for index in _indices(last, most_elements)]:
            yield one
            if is_text:
                yield f'len({one})'
            if kind.is_message:
                yield from (f'{function}({one})' for function in ('norm', *ANGLES))
                yield from written_paths(_nested(layout, kind), f'{one}.', depth + 1,
                                         most_elements)


def _indices(last: int, most: int) -> list[int]:
    """Return the indices of so many elements of an array: the first and the last, or more."""
    found = [index for index in sorted({0, 1, 3, last}) if index <= last]
    return found if most >= 4 else sorted({*found[:most - 1], last})


def _looked_up(layout: MessageLayout, array: MessageField, prefix: str) -> Iterator[str]:
    """Yield elements of an array by all names there may be."""
    inside = _nested(layout, array.type).fields if array.type.is_message else ()
    for item in (*layout.fields, *inside):
        if item.type.base == 'string':
            yield f'{prefix}{array.name}[{item.name} = idle]'
            yield f'{prefix}{array.name}[{item.name} = ""]'


def signal_of(layout: MessageLayout, name: str, topic: str, field: str) -> Signal:
    """Return an input on a field, as a bundle would declare it."""
    found = resolve_field(layout, text(field), text(layout.name))
    is_text = found.type_name in ('string', 'wstring')
    return Signal(
        name, ValueType.INT32 if is_text else ValueType(found.type_name), topic, layout.name,
        found.path, WORDS if is_text else (), None, (), reduction=found.reduction, layout=layout)
