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
The JSON schema of a bundle, for editors.

The keys are those of the tables that the reader uses; here each has a description and the shape of
its value. What a schema cannot say (types of messages, formulas, keys that go together) is left to
`fret-monitor check`.
"""

from collections.abc import Iterable
from enum import Enum
from typing import Any, TypeAlias

from fret_monitor.bundle.actions import KIND_KEYS, STATES
from fret_monitor.bundle.formulas import FORMULA_KEYS
from fret_monitor.bundle.gates import GATE_KEYS, OTHERWISE_KEYS, WhenStale
from fret_monitor.bundle.inputs import (
    BLOCK_KEYS, FIELD_KEYS, INPUT_KEYS, PARAMETER_KEYS, QOS_KEYS, TRANSFORM_KEYS,
)
from fret_monitor.bundle.instances import VARIABLE_KEYS
from fret_monitor.bundle.reader import BUNDLE_KEYS, EVALUATION_KEYS, SIGNALS_KEYS
from fret_monitor.bundle.requirements import REQUIREMENT_KEYS
from fret_monitor.model.policies import (
    ActionKind, InputRole, Policy, Report, Severity, Stale, Stamp,
)

Schema: TypeAlias = dict[str, Any]
Values: TypeAlias = dict[str, tuple[Schema, str]]

_SCALAR = ['string', 'number', 'boolean']  # an id `010` is a text for the reader


def bundle_schema() -> Schema:
    """Return the schema of a bundle (draft 2020-12)."""
    return {
        '$schema': 'https://json-schema.org/draft/2020-12/schema',
        'title': 'A bundle of fret_monitor, or a signals file',
        'if': {'required': ['requirements']},
        'then': {'$ref': '#/$defs/bundle'},
        'else': {'$ref': '#/$defs/signals'},
        '$defs': {
            'bundle': _mapping(BUNDLE_KEYS, required=('format', 'requirements')),
            'signals': _mapping(SIGNALS_KEYS),
        },
    }


def _mapping(keys: Iterable[str], required: Iterable[str] = (),
             own: Values | None = None) -> Schema:
    """
    Return the schema of a mapping with these keys and no others.

    `own` are the values of keys that mean something else here than in other mappings.
    """
    values = {**_VALUES, **(own or {})}
    return {'type': 'object', 'properties': {key: _key(*values[key]) for key in keys},
            'required': list(required), 'additionalProperties': False}


def _key(shape: Schema, description: str) -> Schema:
    """Return the schema of the value of a key."""
    return {**shape, 'description': description}


def _named(values: Schema) -> Schema:
    return {'type': ['object', 'null'], 'additionalProperties': values}


def _words(kind: type[Enum]) -> Schema:
    return {'enum': [item.value for item in kind]}


def _number(**limits: float) -> Schema:
    """Return the schema of a number, which may be quoted."""
    return {'anyOf': [{'type': 'number', **limits},
                      {'type': 'string', 'pattern': r'^[+-]?[0-9.]+([eE][+-]?[0-9]+)?$'}]}


_TEXT: Schema = {'type': _SCALAR, 'minLength': 1}
_FREE: Schema = {'type': [*_SCALAR, 'null']}
_SECONDS = _number(exclusiveMinimum=0)
_QOS: Schema = {'type': ['object', 'null'], 'additionalProperties': False, 'properties': {
    key: {'enum': list(words)} if words else {'type': 'integer', 'minimum': 1}
    for key, words in QOS_KEYS.items()}}
_ONE_FORMULA: Schema = {'oneOf': [{'required': [key]} for key in FORMULA_KEYS]}

_NAMES: Schema = {'anyOf': [_TEXT, {'type': ['array', 'null'], 'items': _TEXT}]}
_CONTENT: Schema = {'type': ['object', 'null']}

# The shape of each key's value, and its description.
_VALUES: Values = {
    'format': ({'enum': [1, '1']}, 'the version of the format: 1'),
    'title': (_FREE, 'a title'),
    'description': (_FREE, 'a description'),
    'where': (_TEXT, 'selects messages by a field of theirs, such as "name = {robot}"'),
    'component': (_TEXT, 'the component that FRETish sentences must name; default: any'),
    'signals': ({'anyOf': [{'type': 'string'}, {'type': 'array', 'items': {'type': 'string'}}]},
                'a file or a list of files, relative to the bundle, with inputs and constants'),
    'constants': (_named({'type': ['number', 'boolean', 'string']}),
                  'numbers or true, false, by name'),
    'topic': (_TEXT, 'the topic of the input'),
    'type': (_TEXT, 'a message type, such as std_msgs/msg/Float32'),
    'field': (_TEXT, 'a path into the message, or a function of a field, such as min(ranges)'),
    'initial': (_TEXT, 'the value before the first message; default: none'),
    'values': ({'type': 'object', 'additionalProperties': {'type': _SCALAR}, 'minProperties': 1},
               'names for numbers or strings: {IDLE: 0, LANDING: 1}'),
    'role': (_words(InputRole), 'for analyze: output where the system sets it; default: input'),
    'qos': (_QOS, "policies that override those of the topic's publishers"),
    'timeout': (_SECONDS, 'seconds without a message after which an input is silent'),
    'stale': (_words(Stale), 'with a timeout: warn logs a silence; violate also reports the '
                             'requirements that read the input as violated'),
    'startup': (_SECONDS, 'with a timeout: seconds within which the first message must come; '
                          'default: 10, or the timeout if that is longer'),
    'scale': (_number(exclusiveMinimum=0),
              'margins are distances divided by this; default: 1'),
    'max_rate': (_number(exclusiveMinimum=0), 'the greatest number of messages in a second (Hz)'),
    'definitions': (_named({'anyOf': [_TEXT, {
        'type': 'object', 'additionalProperties': False, **_ONE_FORMULA,
        'properties': dict.fromkeys(FORMULA_KEYS, _TEXT)}]}), 'expressions by name'),
    'policy': (_words(Policy), 'when a step happens; default: every_message'),
    'period': (_SECONDS, 'with the policy periodic: the seconds between two steps'),
    'rate': (_number(exclusiveMinimum=0), 'with the policy periodic: steps a second (Hz)'),
    'unit': (_SECONDS, 'with the policy timed: seconds that a count without a unit stands for'),
    'stamp': (_words(Stamp), 'with the policy timed: what time a message counts at'),
    'reorder': (_number(minimum=0), 'with the policy timed: seconds that a message waits for '
                                    'others with earlier stamps'),
    'report': (_words(Report), 'which violations are announced'),
    'severity': (_words(Severity), 'the level at which violations are logged; default: error'),
    'confidence': (_number(minimum=0.5, exclusiveMaximum=1), 'how sure the verdict about a '
                   'probability has to be; default: 0.999'),
    'id': (_TEXT, 'the name of the requirement'),
    'assume': ({'type': 'boolean'}, 'for analyze: true where the environment has to fulfil it'),
    'rationale': (_FREE, 'why the requirement is there'),
    'source': (_FREE, 'its id where it comes from, if that is another'),
    'fretish': (_TEXT, 'a sentence in FRETish'),
    'ptltl': (_TEXT, 'a formula of past-time MTL, as FRET writes it for SMV'),
    'cocospec': (_TEXT, 'a formula in CoCoSpec (Lustre)'),
    'mltl': (_TEXT, 'a formula with bounded operators of the future, as for R2U2'),
}
_ACTION_VALUES: Values = {
    'topic': (_TEXT, 'the topic that is published'),
    'rate': (_number(exclusiveMinimum=0), 'messages a second (Hz)'),
    'for': (_SECONDS, 'seconds of publishing at the rate; default: until the violation is over'),
    'message': (_CONTENT, 'the fields of the message; the others have their default values'),
    'service': (_TEXT, 'the service that is called'),
    'request': (_CONTENT, 'the fields of the request; the others have their default values'),
    'timeout': (_SECONDS, 'seconds that each try may take; default: 1'),
    'retries': ({'type': ['integer', 'string'], 'minimum': 0},
                'tries after the first one; default: 3'),
    'node': (_TEXT, 'the lifecycle node'),
    'to': ({'enum': list(STATES)}, 'the state that the node is brought to'),
    'after': (_number(minimum=0), 'seconds that the violation lasts before the action'),
    'cooldown': (_number(minimum=0), 'the least seconds between two starts of the action'),
}
_KIND_VALUES: Values = {
    ActionKind.LOCK.value: (_mapping(
        KIND_KEYS[ActionKind.LOCK], ['topic'], _ACTION_VALUES),
        'publishes std_msgs/msg/Bool all the time: true while a requirement is violated'),
    ActionKind.PUBLISH.value: (_mapping(
        KIND_KEYS[ActionKind.PUBLISH], ['topic', 'type'], _ACTION_VALUES), 'publishes a message'),
    ActionKind.CALL.value: (_mapping(
        KIND_KEYS[ActionKind.CALL], ['service', 'type'], _ACTION_VALUES), 'calls a service'),
    ActionKind.TRANSITION.value: (_mapping(
        KIND_KEYS[ActionKind.TRANSITION], ['node', 'to'], _ACTION_VALUES),
        'brings a lifecycle node to a state'),
}
_ACTION: Schema = {
    **_mapping((*_KIND_VALUES, 'after', 'cooldown'), own=_ACTION_VALUES | _KIND_VALUES),
    'oneOf': [{'required': [kind]} for kind in _KIND_VALUES]}
_VARIABLE_VALUES: Values = {
    'most': ({'type': 'integer', 'minimum': 1}, 'how many instances there are at once at most'),
    'forget': (_SECONDS, 'seconds without a message of its key after which an instance ends; '
                         'default: never'),
}
_OTHERWISE_VALUES: Values = {
    'substitute': (_CONTENT, 'the fields of the message that is sent instead'),
    'hold': (_SECONDS, 'seconds for which the last good message is sent again'),
    'respond': (_CONTENT, 'the fields of the response to a request that is withheld'),
    'rate': (_number(exclusiveMinimum=0), 'with a substitute: messages a second (Hz), until a '
                                          'message passes'),
}
_GATE_VALUES: Values = {
    'from': (_TEXT, 'the topic that is judged'),
    'service': (_TEXT, 'the service that the gate offers'),
    'to': (_TEXT, 'the topic that the gate publishes, or the service that it calls'),
    'type': (_TEXT, 'the type of both'),
    'keep': (_NAMES, 'the ids of the requirements that each message must satisfy'),
    'otherwise': ({'anyOf': [{'const': 'drop'}, _mapping(OTHERWISE_KEYS, own=_OTHERWISE_VALUES)]},
                  'what is sent instead of a message that is withheld; default: drop'),
    'stale': (_words(WhenStale), 'whether the gate is closed while an input is silent; '
                                 'default: closed'),
    'latch': ({'type': 'boolean'}, 'stay closed after a violation until ~/reset'),
    'open_after': (_SECONDS, 'with a latch: seconds without a violation after which it opens'),
    'timeout': (_SECONDS, 'of a service: seconds until a request is refused that its server does '
                          'not answer; default: 60'),
}
_VALUES |= {
    'actions': (_named(_ACTION), 'what may follow a violation, by name'),
    'on_violation': (_NAMES, 'the actions that follow a violation'),
    'on_end': (_NAMES, 'the actions that follow the end of a violation'),
    'gates': (_named(_mapping(GATE_KEYS, ['to', 'type', 'keep'], _GATE_VALUES)),
              'topics and services that pass on only what satisfies their requirements, by name'),
}
_VALUES |= {
    'transform': (_mapping(TRANSFORM_KEYS, TRANSFORM_KEYS, {
        'from': (_TEXT, 'the frame in which the pose is given'),
        'to': (_TEXT, 'the frame whose pose it is')}),
        'in place of a topic: two frames of /tf and /tf_static'),
    'node': (_TEXT, 'in place of a topic: a node, and whether it is there'),
    'publishers': (_TEXT, 'in place of a topic: how many publishers a topic has'),
    'subscribers': (_TEXT, 'in place of a topic: how many subscribers a topic has'),
    'lifecycle': (_TEXT, 'in place of a topic: a lifecycle node, and its state'),
    'parameter': (_mapping(PARAMETER_KEYS, PARAMETER_KEYS, {
        'node': (_TEXT, 'the node'), 'name': (_TEXT, 'its parameter')}),
        'in place of a topic: a parameter of a node'),
}
_VALUES |= {
    'for_each': (_named({'anyOf': [
        {'type': 'array', 'minItems': 1, 'items': _TEXT},
        _mapping(VARIABLE_KEYS, ['most'], _VARIABLE_VALUES)]}),
        'instance variables: each of their keys has an instance of what mentions them'),
    'evaluation': ({**_mapping(EVALUATION_KEYS), 'type': ['object', 'null']},
                   'when a step happens'),
    'inputs': (_named({**_mapping(INPUT_KEYS), 'anyOf': [
        {'required': [key]} for key in (
            'type', 'transform', 'node', 'publishers', 'subscribers', 'lifecycle')]}),
               'the values that are read, by name'),
    'fields': ({'type': 'object', 'minProperties': 1, 'additionalProperties': {
        'anyOf': [_TEXT, _mapping(FIELD_KEYS)]}}, 'the fields that become inputs, by name'),
    'requirements': ({'type': 'array', 'minItems': 1, 'items': {
        **_mapping(REQUIREMENT_KEYS, required=['id']), **_ONE_FORMULA}}, 'the requirements'),
}
_VALUES |= {
    'topics': (_named(_mapping(BLOCK_KEYS, required=['type', 'fields'])),
               'topics by name, each with the fields that become inputs'),
}
