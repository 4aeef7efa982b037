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
Reads the actions of a bundle, and the lists of actions that follow a violation or its end.

Names and types are resolved in `elaboration`.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction

from fret_monitor.bundle.bundle import ActionEntry
from fret_monitor.bundle.yaml_shape import (
    kind_of, mapping_of, Quantity, report_choice, report_fault, SECONDS, Shape, text_of,
)
from fret_monitor.bundle.yaml_tree import Node, YamlList, YamlMapping, YamlScalar
from fret_monitor.model.diagnostics import Problems, Text
from fret_monitor.model.names import (
    acting_name_fault, Fault, is_integer, keyed_topic_fault, PLAIN_TYPES, service_type_fault,
    shown, topic_fault, type_fault,
)
from fret_monitor.model.policies import ActionKind

STATES = ('unconfigured', 'inactive', 'active', 'finalized')
_STATE_AFTER = {'configure': 'inactive', 'cleanup': 'unconfigured', 'activate': 'active',
                'deactivate': 'inactive', 'shutdown': 'finalized'}
_CONDITIONS = ('after', 'cooldown')
ACTION_KEYS = (*(kind.value for kind in ActionKind), *_CONDITIONS)
KIND_KEYS = {
    ActionKind.LOCK: ('topic', 'rate'),
    ActionKind.PUBLISH: ('topic', 'type', 'message', 'rate', 'for'),
    ActionKind.CALL: ('service', 'type', 'request', 'timeout', 'retries'),
    ActionKind.TRANSITION: ('node', 'to', 'timeout', 'retries'),
}
EXAMPLES = {
    ActionKind.LOCK: 'stop: {lock: {topic: e_stop, rate: 10}}',
    ActionKind.PUBLISH: 'brake: {publish: {topic: cmd_vel, type: geometry_msgs/msg/Twist, '
                        'message: {}, rate: 10, for: 2}}',
    ActionKind.CALL: 'halt: {call: {service: /base/stop, type: std_srvs/srv/Trigger, '
                     'request: {}, timeout: 1, retries: 3}}',
    ActionKind.TRANSITION: 'park: {transition: {node: /arm_driver, to: inactive}}',
}
_TARGETS = {ActionKind.CALL: 'service', ActionKind.TRANSITION: 'node'}
_CONTENTS = {ActionKind.PUBLISH: 'message', ActionKind.CALL: 'request'}
_SLIPS = {'msg': 'message', 'duration': 'for', 'state': 'to', 'hz': 'rate'}
_SHORTEST_S = Fraction(1, 1000)
_LONGEST_S = Fraction(10 ** 6)
_USUAL_LOCK_HZ = Fraction(10)
_USUAL_TIMEOUT_S = Fraction(1)
_USUAL_RETRIES = 3
_MOST_RETRIES = 1000
MESSAGES = Quantity('messages a second (Hz)', '10', {'hz': Fraction(1), 'khz': Fraction(1000)})
RATES_HZ = (Fraction(1, 100), Fraction(1000))


def read_actions(shape: Shape, problems: Problems) -> Iterator[tuple[Text, ActionEntry | None]]:
    """Yield the name of each action with its entry; None: it was refused."""
    mapping = mapping_of(shape.node('actions'), "'actions'", problems, EXAMPLES[ActionKind.LOCK])
    for key, node in mapping.entries if mapping else ():
        report_fault(acting_name_fault(key.value), key.text, problems)
        inner = mapping_of(node, f'the action {shown(key.value)}', problems,
                           EXAMPLES[ActionKind.LOCK])
        yield key.text, _action(key, inner, problems) if inner else None


def _action(name: YamlScalar, mapping: YamlMapping, problems: Problems) -> ActionEntry | None:
    shape = Shape(mapping, 'an action', ACTION_KEYS, problems)
    kinds = [kind for kind in ActionKind if shape.key(kind.value)]
    after, cooldown = (shape.number(key, SECONDS, Fraction(0), _LONGEST_S) for key in _CONDITIONS)
    if len(kinds) != 1:
        if kinds:
            second = shape.key(kinds[1].value)
            assert second is not None
            problems.error(f'the action {shown(name.value)} is of two kinds', second.span,
                           f"'{kinds[0].value}' is already given",
                           'write two actions, and both names under on_violation')
        elif shape.lacks(*(kind.value for kind in ActionKind)):
            problems.error(f'the action {shown(name.value)} does nothing', name.span,
                           'one of ' + ', '.join(kind.value for kind in ActionKind),
                           '\n'.join(EXAMPLES.values()))
        return None
    kind = kinds[0]
    if kind is ActionKind.LOCK:
        _refuse_conditions(shape, problems)
    inner = mapping_of(shape.node(kind.value), f"'{kind.value}'", problems, EXAMPLES[kind])
    if inner is None:
        return None
    part = Shape(inner, f"'{kind.value}'", KIND_KEYS[kind], problems, _SLIPS, dict.fromkeys(
        _CONDITIONS, f"it belongs beside '{kind.value}', not into it"))
    if not inner.entries:
        problems.error(f"'{kind.value}' is empty", name.span, help=EXAMPLES[kind])
        return None
    return replace(_of_kind(name.text, kind, part, problems), after=after, cooldown=cooldown)


def _refuse_conditions(shape: Shape, problems: Problems) -> None:
    for key in filter(None, map(shape.key, _CONDITIONS)):
        problems.error(f"a lock has no '{key.value}'", key.span,
                       'it is published all the time, and says at once what is violated',
                       'remove it')


def _of_kind(name: Text, kind: ActionKind, part: Shape, problems: Problems) -> ActionEntry:
    content = _CONTENTS.get(kind)
    type_ = None
    if kind is ActionKind.PUBLISH:
        type_ = required(part, 'type', message_type_fault, problems, 'std_msgs/msg/Bool')
    elif kind is ActionKind.CALL:
        type_ = required(part, 'type', service_type_fault, problems, 'std_srvs/srv/Trigger')
    target = _TARGETS.get(kind, 'topic')
    rate = part.number('rate', MESSAGES, *RATES_HZ)
    if kind is ActionKind.LOCK and rate is None:
        rate = _USUAL_LOCK_HZ
    duration = part.number('for', SECONDS, _SHORTEST_S, _LONGEST_S)
    if (key := part.key('for')) and part.lacks('rate'):
        problems.error("'for' needs a 'rate'", key.span, 'without a rate one message is sent',
                       'rate: 10   # messages a second')
    tries = kind in (ActionKind.CALL, ActionKind.TRANSITION)
    state = _state(part, problems) if kind is ActionKind.TRANSITION else ''
    return ActionEntry(
        name=name, kind=kind,
        target=required(part, target, name_of_resource(target, target), problems,
                        {'topic': 'e_stop', 'service': '/base/stop'}.get(target, '/arm_driver')),
        type=type_,
        content=mapping_of(part.node(content), f"'{content}'", problems, f'{content}: {{}}')
        if content else None,
        rate=rate, duration=duration,
        timeout=(part.number('timeout', SECONDS, _SHORTEST_S, _LONGEST_S) or _USUAL_TIMEOUT_S)
        if tries else None,
        retries=_retries(part, problems) if tries else 0,
        state=state)


def message_type_fault(name: str) -> Fault | None:
    """Check the type of a message that is sent: `pkg/msg/Name`."""
    if name in PLAIN_TYPES:
        return Fault(f'{shown(name)} is not a message type', 'type: std_msgs/msg/Float32')
    if '/srv/' in name or '/action/' in name:
        return Fault(f'{shown(name)} is not a message type',
                     'a message type is written pkg/msg/Name, such as std_msgs/msg/Float32')
    return type_fault(name)


def name_of_resource(what: str, key: str,
                     has_keys: bool = False) -> Callable[[str], Fault | None]:
    """
    Return the check for the name of a topic, a service or a node, which have the same rules.

    `key` is that under which it stands. `has_keys`: it may mention instance variables.
    """
    def fault(name: str) -> Fault | None:
        found = keyed_topic_fault(name) if has_keys else topic_fault(name)
        return None if found is None else Fault(
            found.reason.replace('topic', what), found.help.replace('topic:', f'{key}:', 1))

    return fault


def required(part: Shape, key: str, find_fault: Callable[[str], Fault | None],
             problems: Problems, example: str) -> Text | None:
    """Return the text under a key that must be there; None if it is not, or is refused."""
    text = part.text(key)
    if text is None:
        if part.lacks(key):
            problems.error(f"{part.what} has no '{key}'", part.span, f"'{key}' is missing",
                           f'{key}: {example}')
        return None
    fault = find_fault(text.value)
    report_fault(fault, text, problems)
    return None if fault else text


def _state(part: Shape, problems: Problems) -> str:
    text = required(part, 'to', lambda _: None, problems, 'inactive')
    if text is not None and text.value not in STATES:
        report_choice(text, 'to', STATES, problems, _STATE_AFTER)
    return text.value if text else ''


def _retries(part: Shape, problems: Problems) -> int:
    text = part.text('retries')
    if text is None:
        return _USUAL_RETRIES
    if not is_integer(text.value) or len(text.value) > 5 or \
            not 0 <= int(text.value) <= _MOST_RETRIES:
        problems.error("'retries' must be a whole number", text.span,
                       f'from 0 to {_MOST_RETRIES}', f'retries: {_USUAL_RETRIES}')
        return 0
    return int(text.value)


def read_names(shape: Shape, key: str, problems: Problems) -> tuple[Text, ...] | None:
    """Return the list of names under a key, each once; None if the key is missing."""
    node = shape.node(key)
    if node is None:
        return None
    found: dict[str, Text] = {}
    for item in _items(node, key, problems):
        text = text_of(item, f"a name under '{key}'", problems)
        if text is not None and text.value in found:
            problems.error(f'{shown(text.value)} is given twice', text.span, '', 'remove one')
        elif text is not None:
            found[text.value] = text
    return tuple(found.values())


def _items(node: Node, key: str, problems: Problems) -> tuple[Node, ...]:
    match node:
        case YamlList():
            return node.items
        case YamlScalar() if node.is_missing:
            return ()
        case YamlScalar():
            return (node,)
        case YamlMapping():
            problems.error(f"'{key}' must be a list of names", node.span,
                           f'this is {kind_of(node)}', f'{key}: [name]')
    return ()
