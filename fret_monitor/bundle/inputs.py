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
Reads the inputs of a bundle, and checks that inputs on one topic agree.

An input is written under `inputs`, or as a field under `topics`. Its `InputEntry` is returned even
if some keys are refused, which are in `damaged`.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from fractions import Fraction

from fret_monitor.bundle.bundle import InputEntry, ValueEntry
from fret_monitor.bundle.declared_name import DeclaredName
from fret_monitor.bundle.yaml_shape import (
    line_of, mapping_of, MESSAGES_A_SECOND, Quantity, report_choice, report_fault, SECONDS, Shape,
    text_of,
)
from fret_monitor.bundle.yaml_tree import Node, Unread, YamlMapping, YamlScalar
from fret_monitor.model.diagnostics import Problems, Text
from fret_monitor.model.made import (
    Made, MadeKind, PARAMETER_SLIPS, PARAMETER_TYPES, STATES, USUAL_PATIENCE_S,
)
from fret_monitor.model.names import (
    exact, Fault, is_integer, keyed_topic_fault, looks_like_number, name_fault, number_fault,
    PLAIN_TYPES, shown, topic_fault, type_fault,
)
from fret_monitor.model.policies import InputRole, Stale
from fret_monitor.model.transforms import STAMPED

FIELD_KEYS = ('field', 'initial', 'values', 'role', 'scale')
_TOPIC_KEYS = ('where', 'qos', 'timeout', 'stale', 'startup', 'max_rate')
TRANSFORM_KEYS = ('from', 'to')
PARAMETER_KEYS = ('node', 'name')
INPUT_KEYS = ('topic', *(item.value for item in MadeKind), 'type', *FIELD_KEYS, *_TOPIC_KEYS)
BLOCK_KEYS = ('type', *_TOPIC_KEYS, 'fields')
_SLIPS = {'message': 'type', 'message_type': 'type', 'msg': 'type', 'path': 'field'}
_FIELDS_EXAMPLE = 'fields: {altitude: pose.pose.position.z}'
_SHORTEST_TIMEOUT_S = Fraction(1, 10 ** 3)
_LONGEST_TIMEOUT_S = Fraction(10 ** 9)
_RATES_HZ = (Fraction(1, 10 ** 9), Fraction(10 ** 9))
_DISTANCE = Quantity("the input's unit", '2.5', {})
_SCALES = (Fraction(1, 10 ** 9), Fraction(10 ** 9))
_NOTHING = 'none'
_WATCHED = (MadeKind.PARAMETER, *(  # which has a node, but in its mapping
    item for item in MadeKind if item not in (MadeKind.TRANSFORM, MadeKind.PARAMETER)))
_LONGEST_FRAME = 255  # bytes; FM_MOST_FRAME_BYTES
_PARAMETER_EXAMPLE = 'parameter: {node: /controller_server, name: max_vel}'
_TRANSFORM_EXAMPLE = 'transform: {from: map, to: base_link}'
QOS_KEYS = {
    'reliability': ('reliable', 'best_effort'),
    'durability': ('volatile', 'transient_local'),
    'history': ('keep_last', 'keep_all'),
    'depth': (),
}


def read_input(name: DeclaredName, mapping: YamlMapping, problems: Problems) -> InputEntry:
    """Return an entry under `inputs`."""
    shape = Shape(mapping, 'an input', INPUT_KEYS, problems, _SLIPS)
    if shape.key('transform'):
        return _transform(name, shape, problems)
    if kind := next((item for item in _WATCHED if shape.key(item.value)), None):
        return _watched(name, kind, shape, problems)
    topic = _checked(shape, 'topic', keyed_topic_fault, problems)
    entry = InputEntry(name.text, topic=topic, damaged=_refused(shape, topic=topic))
    return _with_field(_with_topic_keys(entry, shape, problems), shape, problems)


def _watched(name: DeclaredName, kind: MadeKind, shape: Shape, problems: Problems) -> InputEntry:
    """Return an input that is seen in the graph of ROS, or that a node there is asked for."""
    place = shape.key(kind.value) or name
    is_parameter = kind is MadeKind.PARAMETER
    others = [item for item in _WATCHED if item is not kind
              and not (is_parameter and item is MadeKind.NODE)]
    for key in ('topic', 'where', 'qos', *(item.value for item in others),
                *(() if is_parameter else ('type',))):
        if other := shape.key(key):
            problems.error(f"an input with '{kind.value}' has no '{key}'", other.span,
                           f'it is {kind.words}' if kind.is_asked_for else
                           'it is seen in the graph of ROS', 'remove it')
    names = _names(kind, shape, problems)
    message_type = _message_type(name, kind, shape, problems)
    is_damaged = names is None or message_type is None
    made = Made(kind, names or ('', ''))
    entry = InputEntry(name.text, topic=_at(made.topic, place.text), made=made,
                       type=_at(message_type or kind.message_types[0], place.text),
                       damaged=frozenset(['qos', *(['type'] if is_damaged else [])]))
    entry = _with_field(_with_topic_keys(entry, shape, problems), shape, problems)
    patience = USUAL_PATIENCE_S if entry.startup is None else float(entry.startup)
    entry = replace(entry, made=replace(made, patience=patience))
    if kind is MadeKind.LIFECYCLE and shape.lacks('values') and entry.field is None:
        entry = replace(entry, values=tuple(
            ValueEntry(_at(state, place.text), _at(str(number), place.text), is_string=False)
            for state, number in STATES.items()))
    return replace(entry, type=None) if is_damaged else entry


def _names(kind: MadeKind, shape: Shape, problems: Problems) -> tuple[str, ...] | None:
    """Return the name of a node or topic, or of a node and its parameter."""
    if kind is not MadeKind.PARAMETER:
        found = _checked(shape, kind.value, lambda text: _graph_fault(kind.value, text), problems)
        return (found.value,) if found else None
    mapping = _parameter(shape, problems)
    if mapping is None:
        return None
    part = Shape(mapping, "'parameter'", PARAMETER_KEYS, problems, {
        'parameter': 'name', 'of': 'node'})
    for key in PARAMETER_KEYS:
        if part.lacks(key):
            problems.error(f"'parameter' has no '{key}'", mapping.span,
                           'the name of a node' if key == 'node' else 'that of its parameter',
                           _PARAMETER_EXAMPLE)
    node = _checked(part, 'node', lambda text: _graph_fault('node', text), problems)
    name = _checked(part, 'name', _parameter_fault, problems)
    return (node.value, name.value) if node and name else None


def _parameter(shape: Shape, problems: Problems) -> YamlMapping | None:
    """Return the node and name of a parameter; refuse a node beside them."""
    node, written = shape.node('node'), shape.node('parameter')
    names = [item.value if isinstance(item, YamlScalar) and not _parameter_fault(item.value)
             else usual for item, usual in ((node, '/controller_server'), (written, 'max_vel'))]
    example = f'parameter: {{node: {names[0]}, name: {names[1]}}}'
    mapping = mapping_of(written, "'parameter'", problems, example)
    if mapping is not None and node is not None:
        problems.error("an input with 'parameter' has no 'node' of its own", node.span,
                       'it belongs to the parameter', example)
    return mapping


def _message_type(name: DeclaredName, kind: MadeKind, shape: Shape,
                  problems: Problems) -> str | None:
    if kind is not MadeKind.PARAMETER:
        return kind.message_types[0]
    found = shape.text('type')
    if found is None:
        if shape.lacks('type'):
            problems.error(f"the parameter '{name.value}' has no type", name.span,
                           'a node may give a parameter any', 'type: float64')
        return None
    if found.value not in PARAMETER_TYPES:
        report_choice(found, 'type', tuple(PARAMETER_TYPES), problems, PARAMETER_SLIPS)
    return PARAMETER_TYPES.get(found.value)


def _parameter_fault(name: str) -> Fault | None:
    if name and name.isprintable() and len(name.encode()) <= _LONGEST_FRAME:
        return None
    return Fault(f'the name of a parameter has up to {_LONGEST_FRAME} printable bytes')


def _graph_fault(key: str, name: str) -> Fault | None:
    if name.startswith('~') or '{' in name:
        return Fault('the name is that of a node or topic, as `ros2 node list` and `ros2 topic '
                     f'list` have it: {shown(name)}', 'write it in full, from its first slash')
    fault = topic_fault(name)
    return fault and fault._replace(help=fault.help.replace('topic: ', f'{key}: '))


def _transform(name: DeclaredName, shape: Shape, problems: Problems) -> InputEntry:
    """Return an input that is a part of a transform between two frames."""
    place = shape.key('transform') or name
    for key in ('topic', 'type', 'qos'):
        if other := shape.key(key):
            problems.error(f"an input with a 'transform' has no '{key}'", other.span,
                           'transforms come from /tf and /tf_static', 'remove it')
    frames = _frames(shape, problems)
    made = Made(MadeKind.TRANSFORM, frames or ('', ''))
    topic, kind = (_at(text, place.text) for text in (made.topic, STAMPED))
    entry = InputEntry(name.text, topic=topic, type=kind, made=made,
                       damaged=frozenset(['qos'] if frames else ['qos', 'type']))
    entry = _with_field(_with_topic_keys(entry, shape, problems), shape, problems)
    return entry if frames else replace(entry, type=None)


def _frames(shape: Shape, problems: Problems) -> tuple[str, str] | None:
    """Return the frames of a transform, None if one is missing or refused."""
    mapping = mapping_of(shape.node('transform'), "'transform'", problems, _TRANSFORM_EXAMPLE)
    if mapping is None:
        return None
    part = Shape(mapping, "'transform'", TRANSFORM_KEYS, problems, {
        'source': 'from', 'parent': 'from', 'target': 'to', 'child': 'to'})
    for key in TRANSFORM_KEYS:
        if part.lacks(key):
            problems.error(f"'transform' has no '{key}'", mapping.span, 'the name of a frame',
                           _TRANSFORM_EXAMPLE)
    frames = [_checked(part, key, _frame_fault, problems) for key in TRANSFORM_KEYS]
    first, second = frames
    if first is None or second is None:
        return None
    if first.value == second.value:
        problems.error('the transform from a frame to itself is always the same', second.span,
                       f"'from' is {shown(first.value)} too", _TRANSFORM_EXAMPLE)
        return None
    return first.value, second.value


def _frame_fault(name: str) -> Fault | None:
    if name.startswith('/'):
        return Fault(f'the name of a frame has no slash before it: {shown(name)}',
                     f'write {name.lstrip("/")}')
    if len(name.encode()) > _LONGEST_FRAME or not name.isprintable():
        return Fault(f'the name of a frame has up to {_LONGEST_FRAME} printable bytes')
    return None


def _at(value: str, place: Text) -> Text:
    """Return a text that is not written, with the place of one that is."""
    span = place.span
    return Text(value, span.source, [span.start] * max(len(value), 1) + [span.end])


def read_block(topic: YamlScalar, mapping: YamlMapping,
               problems: Problems) -> tuple[InputEntry, YamlMapping | None]:
    """
    Return what an entry under `topics` says of the topic, and its fields by name.

    Each input of the topic begins as this entry, see `read_field`.
    """
    shape = Shape(mapping, 'a topic', BLOCK_KEYS, problems, _SLIPS, dict.fromkeys(
        FIELD_KEYS, f'it belongs under fields, as in\n{_FIELDS_EXAMPLE}'))
    report_fault(keyed_topic_fault(topic.value), topic.text, problems)
    entry = InputEntry(topic.text, topic=topic.text, block=topic.text)
    entry = _with_topic_keys(entry, shape, problems)
    if entry.type and entry.type.value in PLAIN_TYPES:
        problems.error(f'{shown(entry.type.value)} is not a message type', entry.type.span,
                       'only a message has fields', 'type: std_msgs/msg/Float32')
    fields = mapping_of(shape.node('fields'), "'fields'", problems, _FIELDS_EXAMPLE)
    if shape.lacks('fields') or fields is not None and not fields.entries:
        problems.error(f'the topic {shown(topic.value)} has no fields', topic.span,
                       'these become the inputs, by name', _FIELDS_EXAMPLE)
    return entry, fields


def read_field(block: InputEntry, name: DeclaredName, node: Node,
               problems: Problems) -> InputEntry | None:
    """Return an input of a topic: the path of its field, or a mapping with it."""
    entry = replace(block, name=name.text)
    what = f'the input {shown(name.value)}'
    if isinstance(node, YamlScalar):
        path = text_of(node, what, problems)
        damaged = frozenset() if path else frozenset(['field'])
        return replace(entry, field=path, damaged=entry.damaged | damaged)
    mapping = mapping_of(node, what, problems, f'{name.value}: pose.pose.position.z')
    if mapping is None:
        return None
    shape = Shape(mapping, 'a field', FIELD_KEYS, problems, _SLIPS, dict.fromkeys(
        ('type', *_TOPIC_KEYS), "it belongs to the topic, beside 'fields'"))
    return _with_field(entry, shape, problems)


def _with_topic_keys(entry: InputEntry, shape: Shape, problems: Problems) -> InputEntry:
    """Return an input with the keys in which all inputs on one topic agree."""
    found = Problems()
    entry = replace(
        entry,
        type=entry.type or _checked(shape, 'type', type_fault, problems),
        where=shape.text('where'),
        qos=tuple(_qos(shape.node('qos'), found)),
        timeout=shape.number('timeout', SECONDS, _SHORTEST_TIMEOUT_S, _LONGEST_TIMEOUT_S),
        stale=shape.choice('stale', Stale),
        startup=shape.number('startup', SECONDS, _SHORTEST_TIMEOUT_S, _LONGEST_TIMEOUT_S),
        max_rate=shape.number('max_rate', MESSAGES_A_SECOND, *_RATES_HZ),
        places=tuple((key, node.span if isinstance(node, YamlScalar) else written.span)
                     for key, _ in _TOPIC_ASPECTS
                     if (node := shape.node(key)) and (written := shape.key(key))))
    damaged = entry.damaged | _refused(
        shape, type=entry.type, timeout=entry.timeout, stale=entry.stale, startup=entry.startup,
        max_rate=entry.max_rate) | _refused_with(found, shape, 'qos', problems)
    if shape.lacks('type') and entry.type is None and 'type' not in entry.damaged:
        damaged |= {'type'}
        kind = 'input' if entry.block is None else 'topic'
        is_plain = entry.block is None and shape.lacks('topic')
        of_truth = '' if entry.block else 'bool' if is_plain else 'std_msgs/msg/Bool'
        problems.error(
            f'the {kind} {shown(entry.name.value)} has no type', entry.name.span,
            of_truth and f'{of_truth} if it is true or false',
            'type: float64' if is_plain else 'type: std_msgs/msg/Float32')
    _check_times(entry, shape, problems)
    return replace(entry, damaged=damaged)


def _with_field(entry: InputEntry, shape: Shape, problems: Problems) -> InputEntry:
    """Return an input with the keys of its own value."""
    found = Problems()
    entry = replace(entry, field=shape.text('field'), initial=shape.text('initial'),
                    values=tuple(_values(shape.node('values'), found)),
                    role=shape.choice('role', InputRole),
                    scale=shape.number('scale', _DISTANCE, *_SCALES))
    damaged = entry.damaged | _refused_with(found, shape, 'values', problems) \
        | _refused(shape, field=entry.field, initial=entry.initial, role=entry.role,
                   scale=entry.scale)
    if entry.field and entry.type and entry.type.value in PLAIN_TYPES and entry.block is None:
        damaged |= {'field'}
        is_measure = entry.field.value.startswith(('rate', 'period'))
        problems.error(f"'{entry.type.value}' has no fields", entry.field.span,
                       'this is measured of the messages of a topic' if is_measure else
                       'only a message has fields',
                       'topic: scan\ntype: sensor_msgs/msg/LaserScan' if is_measure else
                       "remove 'field', or name a message type")
    return replace(entry, damaged=damaged)


def _refused(shape: Shape, **values: object) -> frozenset[str]:
    """Return the keys that are written, and whose values were refused."""
    return frozenset(key for key, value in values.items() if shape.is_cut or (
        not shape.lacks(key) and (shape.key(key) is None or value is None)))


def _refused_with(found: Problems, shape: Shape, key: str, problems: Problems) -> frozenset[str]:
    """Pass on the problems of a mapping under a key; return the key if it was refused."""
    problems.extend(found.errors)
    is_refused = bool(found.errors) or isinstance(shape.node(key), Unread) or bool(
        _refused(shape, **{key: ()}))
    return frozenset([key] if is_refused else ())


def _checked(shape: Shape, key: str, find_fault: Callable[[str], Fault | None],
             problems: Problems) -> Text | None:
    text = shape.text(key)
    fault = find_fault(text.value) if text is not None else None
    if text is not None:
        report_fault(fault, text, problems)
    return text if fault is None else None


def _check_times(entry: InputEntry, shape: Shape, problems: Problems) -> None:
    """Check the keys that go with a timeout."""
    stale, startup = shape.key('stale'), shape.key('startup')
    if stale and shape.lacks('timeout'):
        problems.error("'stale' needs a 'timeout'", stale.span,
                       'without a timeout it is never stale', 'timeout: 0.5   # seconds')
    is_watched = entry.made is not None and entry.made.kind in _WATCHED
    if startup and shape.lacks('timeout') and not is_watched:
        problems.error("'startup' needs a 'timeout'", startup.span,
                       'without a timeout nothing is due', 'timeout: 0.5   # seconds')
    place = dict(entry.places).get('startup')
    if place and entry.timeout and entry.startup and entry.startup < entry.timeout \
            and not is_watched:
        problems.warning(
            "'startup' is shorter than 'timeout'", place,
            'the first value is due earlier than any later one', 'remove it for the default: '
            '10 seconds, or the timeout if that is longer')


def _values(node: Node | None, problems: Problems) -> Iterator[ValueEntry]:
    mapping = mapping_of(node, "'values'", problems, 'values: {IDLE: 0, LANDING: 1}')
    if mapping is None:
        return
    if not mapping.entries:
        problems.error("'values' is empty", mapping.span,
                       help='values: {IDLE: 0, LANDING: 1}')
    found = [entry for key, item in mapping.entries if (entry := _value(key, item, problems))]
    _check_values(found, problems)
    yield from found


def _value(key: YamlScalar, node: Node, problems: Problems) -> ValueEntry | None:
    """Read one name of a value; a value in quotes, or that is not a number, is a string."""
    if is_integer(key.value) and isinstance(node, YamlScalar) and not name_fault(node.value):
        problems.error('a name of a value comes before its number', key.span, 'this is the number',
                       f'{node.value}: {key.value}')
        return None
    report_fault(name_fault(key.value), key.text, problems)
    if isinstance(node, YamlScalar) and node.style:
        return ValueEntry(key.text, node.text, is_string=True)
    text = text_of(node, f'the value {shown(key.value)}', problems)
    if text is None:
        return None
    is_string = not looks_like_number(text.value)
    if not is_string and not is_integer(text.value):
        fault = number_fault(text.value)
        problems.error('a named value must be a whole number or a string', text.span,
                       'this is neither', fault.help if fault and fault.help else
                       f'{key.value}: "{text.value}"   # if it is a string')
    return ValueEntry(key.text, text, is_string)


def _check_values(entries: list[ValueEntry], problems: Problems) -> None:
    firsts: dict[str | Fraction, ValueEntry] = {}
    for item in entries:
        if item.is_string != entries[0].is_string:
            first = entries[0]
            problems.error("the 'values' must be all numbers or all strings", item.value.span,
                           f'{shown(first.name.value)} is a '
                           f'{"string" if first.is_string else "number"}')
            return
        number = None if item.is_string else exact(item.value.value)
        same = firsts.setdefault(item.value.value if number is None else number, item)
        if same is not item:
            kind = 'string' if item.is_string else 'number'
            problems.error(f'two names for one {kind}', item.value.span,
                           f'{shown(same.name.value)} already names it')


def _qos(node: Node | None, problems: Problems) -> Iterator[tuple[Text, Text]]:
    mapping = mapping_of(node, "'qos'", problems, 'qos: {reliability: best_effort, depth: 10}')
    if mapping is None:
        return
    shape = Shape(mapping, "'qos'", QOS_KEYS, problems)
    for key, words in QOS_KEYS.items():
        name, text = shape.key(key), shape.text(key)
        if name is None or text is None:
            continue
        if words and text.value not in words:
            report_choice(text, key, words, problems)
        elif not words and not (is_integer(text.value) and 0 < _whole(text.value) < 2 ** 31):
            problems.error(f"'{key}' must be a whole number of messages, at least 1", text.span)
        else:
            yield name.text, text


def _whole(text: str) -> int:
    return int(text) if len(text) < 20 else 0


def check_topics(inputs: Iterable[InputEntry], problems: Problems) -> None:
    """Check that inputs on one topic agree in the keys that concern the topic."""
    first: dict[str, InputEntry] = {}
    # All inputs of a block share its keys: one of them is enough.
    owners = {id(item.owner): item for item in inputs}
    for item in owners.values():
        if item.topic is not None:
            _check_topic(item, item.topic, first.setdefault(item.topic.value, item), problems)


def _check_topic(item: InputEntry, topic: Text, first: InputEntry,
                 problems: Problems) -> None:
    for key, aspect in _TOPIC_ASPECTS:
        if key not in item.damaged | first.damaged and aspect(item) != aspect(first):
            place = dict(item.places).get(key, topic.span)
            problems.error(
                f"inputs on one topic must agree in '{key}'", place,
                f'{shown(first.owner.value)} in {line_of(first.owner, place)} has '
                f'{_written(first, key)}, {shown(item.owner.value)} has {_written(item, key)}',
                _missing_line(item, first, key) or _missing_line(first, item, key),
                first.owner.span)


def _missing_line(item: InputEntry, other: InputEntry, key: str) -> str:
    """Return the line to add to an input that has no such key, as the other one has it."""
    written = _written(other, key)
    if key in dict(item.places) or key not in dict(other.places) or written == _NOTHING:
        return ''
    line = f'{{{written}}}' if key == 'qos' else written
    again = '' if item.block or other.block else "\nor write the topic once, under 'topics'"
    return f'add to {shown(item.owner.value)}: {key}: {line}{again}'


def _qos_of(item: InputEntry) -> object:
    return sorted((key.value, value.value) for key, value in item.qos)


def _written(item: InputEntry, key: str) -> str:
    """Return what is written under a key of an input."""
    place = dict(item.places).get(key)
    if place is None:
        return _NOTHING
    if key == 'qos':
        return ', '.join(f'{name.value}: {value.value}' for name, value in item.qos) or _NOTHING
    return shown(place.source.text[place.start:place.end])[1:-1]


_TOPIC_ASPECTS: tuple[tuple[str, Callable[[InputEntry], object]], ...] = (
    ('type', lambda item: item.type.value if item.type else None),
    ('qos', _qos_of),
    ('timeout', lambda item: item.timeout),
    ('stale', lambda item: item.stale or Stale.WARN),
    ('startup', lambda item: item.startup),
    ('max_rate', lambda item: item.max_rate),
)
