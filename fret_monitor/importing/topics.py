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
Parse the topics of inputs: Ogma's variable databases, lists of names and topics, and bundles.

All result in a `Connection` for each name. A database contains the topic of each input, the
message type of each topic, and sometimes the field. A list has a line for each input: name,
topic, and optionally message type and field.
"""

from dataclasses import dataclass
from dataclasses import field as attribute
from pathlib import Path
import re

from fret_monitor.bundle.reader import survey_bundle
from fret_monitor.importing.json_text import items, mapping, text
from fret_monitor.model.diagnostics import Problems, Source, Span
from fret_monitor.model.names import shown, topic_fault, type_fault

_ROS = ('ros/message', 'ros', 'ros2', 'ros2/message')
_LINE = re.compile(r'[^\s,;]+')
_NAME = re.compile(r'[A-Za-z_"]')
_COMMENT = re.compile(r'(?:^|\s)(?:#|--|//).*')
_MOST_COLUMNS = 4


@dataclass(frozen=True)
class Connection:
    """
    The topic and types of an input; None if unknown.

    `type` is the C type of the input in a database; `message_type` is the ROS type of the topic.
    `note` is the reason if there is no topic. `file` is the file with the input; `place` is its
    place in a list.
    """

    name: str
    topic: str | None = None
    message_type: str | None = None
    field: str | None = None
    type: str = ''
    note: str = ''
    file: str = attribute(default='', compare=False)
    place: Span | None = attribute(default=None, compare=False)


def is_database(value: object) -> bool:
    """Whether a JSON value is a variable database of Ogma."""
    content = mapping(value)
    return isinstance(content.get('inputs'), list) and any(
        isinstance(content.get(key), list) for key in ('topics', 'types'))


def read_database(value: object, file: str, problems: Problems) -> list[Connection]:
    """Return the connections of a database; inputs that are not on ROS have no topic."""
    content = mapping(value)
    topics = {text(item, 'topic'): _message_type(text(item, 'type'))
              for item in items(content.get('topics')) if text(item, 'scope') in _ROS}
    fields = {_message_type(text(item, 'fromType')): text(item, 'fromField')
              for item in items(content.get('types')) if text(item, 'fromScope') in _ROS}
    return [_connection(item, topics, fields, file, problems)
            for item in items(content.get('inputs')) if text(item, 'name')]


def _connection(item: dict[str, object], topics: dict[str, str], fields: dict[str, str],
                file: str, problems: Problems) -> Connection:
    name = text(item, 'name')
    links = items(item.get('connections'))
    link = next((one for one in links if text(one, 'scope') in _ROS), None)
    if link is None:
        scopes = ', '.join(shown(text(one, 'scope')) for one in links)
        note = f"{file} connects it to {scopes}, not 'ros/message'" if links else ''
        return Connection(name, type=text(item, 'type'), note=note, file=file)
    topic = text(link, 'topic')
    kind = topics.get(topic, '')
    field = text(link, 'field') or fields.get(kind, '')
    found = Connection(name, topic or None, kind or None, field or None, text(item, 'type'))
    return _usable(found, file, problems, None)


def _usable(found: Connection, file: str, problems: Problems, place: Span | None) -> Connection:
    """Remove a topic or type that is invalid in ROS, with a warning."""
    kind_fault = type_fault(found.message_type) if found.message_type else None
    for fault in (topic_fault(found.topic) if found.topic else None, kind_fault):
        if fault:
            problems.warning(f"{file}: '{found.name}' cannot be mapped like this: {fault.reason}",
                             place, '', fault.help)
    return Connection(
        found.name,
        None if found.topic and topic_fault(found.topic) else found.topic,
        None if kind_fault or found.message_type and '/' not in found.message_type
        else found.message_type,
        found.field, found.type, found.note, file, place)


def _message_type(name: str) -> str:
    """Return a message type as `pkg/msg/Name`; accepts C++'s `pkg::msg::Name`."""
    return re.sub(r'::|\.', '/', name.strip().removeprefix('::'))


def is_list(content: str) -> bool:
    """Whether each line of a text is a name with at most three more words."""
    lines = [_LINE.findall(line) for line in _lines(content) if line.strip()]
    return any(lines) and all(
        len(words) <= _MOST_COLUMNS and _NAME.match(words[0]) for words in lines if words)


def _lines(content: str) -> list[str]:
    return [_COMMENT.sub('', line) for line in content.split('\n')]


def read_list(source: Source, file: str, problems: Problems) -> list[Connection]:
    """Return the connections of a list: `name topic [message type [field]]` in each line."""
    found: list[Connection] = []
    start = 0
    for line, whole in zip(_lines(source.text), source.text.split('\n'), strict=True):
        words = _LINE.findall(line)
        if words:
            name, topic, kind, field = (words + [''] * _MOST_COLUMNS)[:_MOST_COLUMNS]
            item = Connection(name, topic or None, _message_type(kind) or None, field or None)
            place = Span(source, start, start + max(len(whole.rstrip()), 1))
            found.append(_usable(item, file, problems, place))
        start += len(whole) + 1
    return found


def read_inputs(path: Path, problems: Problems) -> list[Connection]:
    """
    Return the connections of the inputs of a bundle, such as one that `new` has written.

    Those are left out whose messages are chosen, or made by the monitor, with a warning; so are
    the evaluation and the timeouts.
    """
    bundle = survey_bundle(path, Problems())
    if bundle is None:
        return []
    left = {'evaluation': bundle.policy_place is not None,
            'timeout': any(item.timeout is not None for item in bundle.inputs)}
    if any(left.values()):
        problems.warning(
            f'{path.name}: of this bundle only topics, types and fields are taken over', None, '',
            f'copy {" and ".join(key for key in left if left[key])} into the new bundle, too')
    found: list[Connection] = []
    for item in bundle.inputs:
        if item.where or item.made or item.variables or item.scale:
            problems.warning(f"{path.name}: the input '{item.name.value}' is not taken over",
                             item.name.span, 'it is more than a field of each message',
                             'copy it into the new bundle')
        elif item.topic is not None:
            found.append(Connection(item.name.value, item.topic.value,
                                    item.type.value if item.type else None,
                                    item.field.value if item.field else None))
    return found
