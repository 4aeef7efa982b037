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
The rules for names, topics, types and numbers in a bundle.

Each `*_fault` function takes a string and returns None if it is valid, else the reason and what to
write instead. The rules for topics are those of `rcl` and `rmw`, those for types of `rosidl`.
"""

from collections.abc import Iterable, Sequence
from fractions import Fraction
import re
from typing import NamedTuple
from unicodedata import normalize

from fret_monitor.model.diagnostics import did_you_mean
from fret_monitor.model.values import ValueType

MAX_TOPIC = 247  # rmw: 255 less 8 that are reserved for the prefixes of DDS
HANDLER_TOPIC = 'copilot/'
HANDLER_PREFIX = 'handlerprop'
DETAILS_TOPIC = f'{HANDLER_TOPIC}violations'
VERDICT_TOPIC = f'{HANDLER_TOPIC}verdict/'
MARGIN_TOPIC = f'{HANDLER_TOPIC}margin/'
VERDICT_TYPE = 'std_msgs/msg/Bool'
DIAGNOSTICS_TOPIC = '/diagnostics'
OWN_TOPICS = {
    DIAGNOSTICS_TOPIC: 'diagnostic_msgs/msg/DiagnosticArray',
    '~/alive': 'std_msgs/msg/Header',
    '~/transition_event': 'lifecycle_msgs/msg/TransitionEvent',
    '/parameter_events': 'rcl_interfaces/msg/ParameterEvent',
    '/rosout': 'rcl_interfaces/msg/Log',
    '/clock': 'rosgraph_msgs/msg/Clock',
}
"""The topics of a node itself, with their types, besides those of violations."""

_PUBLISHED = (f'/{DETAILS_TOPIC}', DIAGNOSTICS_TOPIC, '~/alive')
OWN_SERVICE_TYPES = {
    '~/reset': 'std_srvs/srv/Trigger',
    **{f'~/{name}': f'lifecycle_msgs/srv/{kind}' for name, kind in (
        ('change_state', 'ChangeState'), ('get_state', 'GetState'),
        ('get_available_states', 'GetAvailableStates'),
        ('get_available_transitions', 'GetAvailableTransitions'),
        ('get_transition_graph', 'GetAvailableTransitions'))},
    **{f'~/{name}': f'rcl_interfaces/srv/{kind}' for name, kind in (
        ('describe_parameters', 'DescribeParameters'),
        ('get_parameter_types', 'GetParameterTypes'), ('get_parameters', 'GetParameters'),
        ('list_parameters', 'ListParameters'), ('set_parameters', 'SetParameters'),
        ('set_parameters_atomically', 'SetParametersAtomically'))},
    '~/get_type_description': 'type_description_interfaces/srv/GetTypeDescription',
}
"""The services of a node itself, with their types."""

OWN_SERVICES = ('~/reset', '~/change_state')  # those that change what is monitored

# As in formulas: FRET's names may have points and percent signs inside.
_IDENTIFIER = re.compile(r'[A-Za-z_$][A-Za-z0-9_$]*(?:[.%][A-Za-z0-9_$]+)*')
_NUMBER = re.compile(r'[+-]?(?:(?:0|[1-9][0-9]*)(?:\.[0-9]+)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?')
_INTEGER = re.compile(r'[+-]?(?:0|[1-9][0-9]*)')
_LIKE_NUMBER = re.compile(r'[+-]?\.?[0-9]')
_PACKAGE = re.compile(r'(?!.*__)[a-z][a-z0-9_]*(?<!_)')
_MESSAGE = re.compile(r'[A-Z][A-Za-z0-9]*')
_DERIVED = {
    'srv': ('a service', ('_Event',)),
    'action': ('an action', ('_FeedbackMessage', '_SendGoal_Event', '_GetResult_Event')),
}
_ACTING_NAME = re.compile(r'[A-Za-z][A-Za-z0-9_]{0,59}')
_TOPIC_TOKEN = re.compile(r'[A-Za-z_][A-Za-z0-9_]*')
_SUBSTITUTION = re.compile(r'\{(?:node|ns|namespace)\}')
PLACEHOLDER = re.compile(r'\{([A-Za-z_][A-Za-z0-9_]*)\}')  # of an instance variable
LONGEST_KEY = 255  # bytes of a key of an instance variable
_WRONG_INDEX = re.compile(r'\[\s*-\s*[0-9]+\s*\]')
_MAX_SHOWN = 60
LONGEST_PATH = 4096  # characters; a path is not shortened, since its end matters most
_MAX_EXPONENT = 30

_MEANINGS = {
    'H': 'historically', 'O': 'once', 'S': 'since', 'T': 'triggered', 'SI': 'since inclusive',
    'Y': 'yesterday', 'Z': 'weak yesterday', 'FTP': 'first time point', 'mod': 'the remainder',
    'div': 'the quotient', 'xor': 'exclusive or', 'and': '&', 'or': '|', 'not': '!',
    'pre': 'the value before', 'if': 'a conditional', 'then': 'a conditional',
    'else': 'a conditional', 'OT': "CoCoSpec's bounded once",
    'HT': "CoCoSpec's bounded historically", 'ST': "CoCoSpec's bounded since",
    'SIT': "CoCoSpec's bounded since inclusive", 'TT': "CoCoSpec's bounded triggered",
    'YtoPre': "CoCoSpec's yesterday", 'ZtoPre': "CoCoSpec's weak yesterday",
}

PLAIN_TYPES = (*(kind.value for kind in ValueType), 'string')
_ALSO_KNOWN = {
    'boolean': 'bool', 'float': 'float32', 'single': 'float32', 'double': 'float64',
    'real': 'float64', 'int': 'int32', 'integer': 'int64', 'unsigned': 'uint32',
    'uint': 'uint32', 'long': 'int64', 'short': 'int16', 'byte': 'uint8', 'char': 'uint8',
    'float64_t': 'float64', 'int64_t': 'int64', 'int32_t': 'int32', 'uint8_t': 'uint8',
    'str': 'string',
}


class Fault(NamedTuple):
    """Why a word cannot be used, and what to do (may be empty)."""

    reason: str
    help: str = ''


def shown(text: str, longest: int = _MAX_SHOWN) -> str:
    """Return a user's text in quotes, on one line, shortened, with control characters escaped."""
    short = text if len(text) <= longest else text[:longest] + '...'
    safe = ''.join(c if c.isprintable() else c.encode('unicode_escape').decode() for c in short)
    return f"'{safe}'"


def name_fault(name: str) -> Fault | None:
    """Check the name of an input, constant, definition or value, given without its quotes."""
    if not name:
        return Fault('a name is missing')
    if _IDENTIFIER.fullmatch(name) is None:
        return Fault(f'{shown(name)} cannot be a name in a formula',
                     f"use letters, digits and '_', such as {_identifier(name)}")
    if name.lower() in ('true', 'false'):
        return Fault(f'{shown(name)} is a truth value', _other_name(name))
    if name in _MEANINGS:
        return Fault(f'{shown(name)} is an operator ({_MEANINGS[name]})', _other_name(name))
    return None


def quoted_name_fault(name: str) -> Fault | None:
    """Check a name that formulas write in double quotes, as FRET allows."""
    if name.isprintable() and name == name.strip() and name and not set(name) & {'"', '\\'}:
        return None
    return Fault(f'{shown(name)} cannot be a name in quotes',
                 'it must be one line, without quotes or backslashes, '
                 'and without spaces at its ends')


def index_fault(path: str) -> Fault | None:
    """Find an index of a field path that counts from the end."""
    if _WRONG_INDEX.search(path) is None:
        return None
    return Fault('an index is a number from 0',
                 'the first element is [0], the last one of N is [N-1]')


def _identifier(name: str) -> str:
    plain = normalize('NFKD', name[:_MAX_SHOWN]).encode('ascii', 'ignore').decode()
    word = re.sub(r'[^A-Za-z0-9_]+', '_', plain).strip('_') or 'signal'
    word = f'x{word}' if word[0].isdigit() else word
    return word if name_fault(word) is None else f'{word}_value'


def _other_name(name: str) -> str:
    return f'choose another name, such as {name}_value'


def topic_fault(topic: str) -> Fault | None:
    """Check a topic name: absolute, relative or private, as `rcl_validate_topic_name`."""
    if not topic:
        return Fault('the topic has no name')
    plain = _SUBSTITUTION.sub('x', topic[1:] if topic.startswith('~') else topic)
    if topic.startswith('~') and topic != '~' and not topic.startswith('~/'):
        return Fault("the '~' must be followed by '/'", f'topic: ~/{topic[1:]}')
    if topic.endswith('/'):
        right = topic.rstrip('/')
        return Fault("a topic cannot end with '/'", f'topic: {right}' if right else '')
    if '//' in topic:
        return Fault("a topic cannot contain '//'", f'topic: {re.sub("/+", "/", topic)}')
    for token in plain.removeprefix('/').split('/'):
        if token and _TOPIC_TOKEN.fullmatch(token) is None:
            right = '/'.join(part and _identifier(part) for part in topic.split('/'))
            return _token_fault(token, f'topic: {right}' if plain == topic else '')
    return _length_fault(topic, f'the topic name {shown(topic)}')


def _token_fault(token: str, help_: str) -> Fault:
    if token[0].isdigit():
        return Fault(f'a part of a topic cannot begin with a digit: {shown(token)}', help_)
    return Fault(f"a topic can contain letters, digits, '_' and '/' only: {shown(token)}", help_)


def _length_fault(topic: str, what: str) -> Fault | None:
    length = len(topic.removeprefix('/')) + 1
    if length <= MAX_TOPIC:
        return None
    return Fault(f'{what} is longer than ROS allows ({length} characters, at most {MAX_TOPIC})')


def absolute(name: str) -> str:
    """Return the name of a topic or service in the root namespace."""
    return name if name.startswith(('/', '~')) else f'/{name}'


def is_own_topic(topic: str) -> bool:
    """Return whether the node itself publishes on a topic, if it is in the root namespace."""
    full = absolute(topic)
    return full in _PUBLISHED or full.startswith(f'/{HANDLER_TOPIC}{HANDLER_PREFIX}')


def handler_name(id: str) -> str:
    """Return `handlerprop` and the id, with `_` for characters that C or ROS does not allow."""
    letters = (c if c.isascii() and (c.isalnum() or c == '_') else '_' for c in id)
    return HANDLER_PREFIX + ''.join(letters)


def verdict_topic(handler: str) -> str:
    """Return the topic of the verdicts of a requirement, by its handler: `copilot/verdict/ID`."""
    return VERDICT_TOPIC + _last_part(handler)


def margin_topic(handler: str) -> str:
    """Return the topic of the margins of a requirement, by its handler: `copilot/margin/ID`."""
    return MARGIN_TOPIC + _last_part(handler)


def _last_part(handler: str) -> str:
    """
    Return the id in a handler as a part of a topic.

    No part of a name in ROS may begin with a digit, and one that begins with `_` is hidden. Such
    ids get `prop` in front, and those that begin with it, so that no two topics are the same.
    """
    name = handler.removeprefix(HANDLER_PREFIX)
    is_plain = name[:1].isalpha() and not name.startswith('prop')
    return f'{"" if is_plain else "prop"}{name}'


def handler_fault(handler: str) -> Fault | None:
    """Check the topic on which a requirement's violations are announced."""
    return _length_fault(HANDLER_TOPIC + handler, 'the topic of its handler')


def type_fault(name: str) -> Fault | None:
    """Check an input's type: `pkg/msg/Name`, one of `pkg/srv`, `pkg/action`, or a plain type."""
    parts = re.split(r'/|::|\.', name)
    if name in PLAIN_TYPES:
        return None
    if len(parts) == 1:
        return _plain_type_fault(name)
    if len(parts) == 3 and parts[1] in _DERIVED and _PACKAGE.fullmatch(parts[0]):
        return _derived_fault(name, parts)
    if not (_PACKAGE.fullmatch(parts[0]) and _MESSAGE.fullmatch(parts[-1])):
        return Fault(f'{shown(name)} is not the name of a message type',
                     'a message type is written pkg/msg/Name, such as std_msgs/msg/Float32')
    if parts[1:-1] not in ([], ['msg']):
        return Fault(f'{shown(name)} is not the name of a message type',
                     f'type: {parts[0]}/msg/{parts[-1]}')
    right = f'{parts[0]}/msg/{parts[-1]}'
    return None if name == right else Fault(f'{shown(name)} is not in the form of a ROS 2 type',
                                            f'type: {right}')


def service_type_fault(name: str) -> Fault | None:
    """Check the type of a service: `pkg/srv/Name`."""
    parts = re.split(r'/|::|\.', name)
    reason = f'{shown(name)} is not the name of a service type'
    if not (_PACKAGE.fullmatch(parts[0]) and len(parts) > 1 and _MESSAGE.fullmatch(parts[-1])):
        return Fault(
            reason, 'a service type is written pkg/srv/Name, such as std_srvs/srv/Trigger')
    right = f'{parts[0]}/srv/{parts[-1]}'
    is_message = 'msg' in parts[1:-1] and not parts[0].endswith('_srvs')
    return None if name == right else Fault(
        reason, 'this is a message; a service type is written pkg/srv/Name, such as '
        'std_srvs/srv/SetBool' if is_message else f'type: {right}')


def keyed_topic_fault(topic: str) -> Fault | None:
    """Check a topic; its instance variables are checked elsewhere."""
    return topic_fault(PLACEHOLDER.sub(lambda found: found[0] if topic_fault(
        found[0]) is None else 'x', topic))


def pair_key(first: bytes, second: bytes) -> bytes:
    """Return the key of a pair, as `fm_pair_key` of fret_cdr.h makes it."""
    return bytes([len(first)]) + first + second


def parts_of_key(key: bytes, variables: Sequence[str]) -> tuple[bytes, ...]:
    """Return the keys of the variables of an instance: one, or the two of a pair."""
    return (key,) if len(variables) < 2 else (key[1:key[0] + 1], key[key[0] + 1:])


def key_text(key: bytes, variables: Sequence[str]) -> str:
    """Return a key for people; of a pair, such as `alpha/3`."""
    return '/'.join(part.decode(errors='backslashreplace') for part in parts_of_key(
        key, variables))


def named_key(key: bytes, variables: Sequence[str]) -> str:
    """Return a key with its variable, or both of a pair: `robot=alpha,track=3`."""
    parts = (part.decode(errors='backslashreplace') for part in parts_of_key(key, variables))
    return ','.join(f'{name}={part}' for name, part in zip(variables, parts))


def name_with_keys(name: str, keys: Iterable[str]) -> str:
    """Return a name with the keys of its instance, for C and command lines: `speed_alpha`."""
    return '_'.join([name, *(re.sub('[^A-Za-z0-9_]', '_', key) for key in keys)])


def acting_name_fault(name: str) -> Fault | None:
    """Check the name of an action or a gate, which command lines and folders contain."""
    if _ACTING_NAME.fullmatch(name):
        return None
    return Fault(f'{shown(name)} cannot be the name of an action or a gate',
                 f"use letters, digits and '_', such as {_identifier(name)}")


def _derived_fault(name: str, parts: list[str]) -> Fault | None:
    """Check the type of a message of a service or an action."""
    package, folder, word = parts
    kind, suffixes = _DERIVED[folder]
    own, mark, part = word.partition('_')
    right = f'{package}/{folder}/{own}'
    if _MESSAGE.fullmatch(own) is None:
        return Fault(f'{shown(name)} is not the name of a message type',
                     f'a message of {kind} is written pkg/{folder}/Name{suffixes[0]}')
    if mark + part not in suffixes:
        return Fault(f'{shown(name)} is not a message type for a topic',
                     f'type: {right}{suffixes[0]}')
    return None if name == right + mark + part else Fault(
        f'{shown(name)} is not in the form of a ROS 2 type', f'type: {right}{mark}{part}')


def _plain_type_fault(name: str) -> Fault:
    reason = f'{shown(name)} is not a type'
    if _MESSAGE.fullmatch(name) and name.lower() in PLAIN_TYPES:
        return Fault(reason, f'type: std_msgs/msg/{name}')
    if name.lower() in PLAIN_TYPES or name.lower() in _ALSO_KNOWN:
        return Fault(reason, f'type: {_ALSO_KNOWN.get(name.lower(), name.lower())}')
    if _MESSAGE.fullmatch(name):
        return Fault(reason, f'type: std_msgs/msg/{name}')
    return Fault(reason, did_you_mean(name, PLAIN_TYPES)
                 or 'write pkg/msg/Name, or a plain type: ' + ', '.join(PLAIN_TYPES))


def number_fault(text: str) -> Fault | None:
    """Check a number of a bundle: `15`, `-1.5`, `1e3`."""
    if _NUMBER.fullmatch(text):
        return None
    reason = f'{shown(text)} is not a number'
    mended = re.sub(r'^([+-]?)0+(?=[0-9])', r'\1', text.replace('_', '').replace(',', '.'))
    mended = re.sub(r'\.(?=[eE]|$)', '.0', mended)
    if text.lower().lstrip('+-.') in ('nan', 'inf', 'infinity'):
        return Fault(reason, 'NaN and infinity cannot be written as a number')
    if re.fullmatch(r'[+-]?0[xX][0-9A-Fa-f]{1,16}', text):
        return Fault(reason, f'write it in decimal: {int(text, 16)}')
    if len(mended) <= _MAX_SHOWN and _NUMBER.fullmatch(mended):
        return Fault(reason, f'did you mean {mended}?')
    return Fault(reason)


def looks_like_number(text: str) -> bool:
    """Return whether a text begins like a number: a valid or a mistyped one."""
    return _LIKE_NUMBER.match(text) is not None


def is_integer(text: str) -> bool:
    """Return whether a text is a whole number, by the grammar of formulas."""
    return _INTEGER.fullmatch(text) is not None


def exact(text: str) -> Fraction | None:
    """
    Return the exact value of a number; None if it is not a number, or too long or large.

    Exponents above 30 are refused, because computing `1e999999999` would take too long.
    """
    if len(text) > 100 or _NUMBER.fullmatch(text) is None:
        return None
    exponent = re.split('[eE]', text)[1:]
    if exponent and abs(int(exponent[0])) > _MAX_EXPONENT:
        return None
    return Fraction(text)


_SPELLED = {
    '.': '_DOT_', '%': '_PRC_', '#': '_HSH_', '$': '_DOL_', '&': '_AMP_', '@': '_ATS_',
    '!': '_BNG_', '?': '_QUS_', '-': '_HYP_', '*': '_AST_', '=': '_EQU_', '^': '_CRT_',
    ' ': '_SPC_', '+': '_PLS_', ';': '_SEM_', ':': '_CLN_', ',': '_CMA_', '/': '_FSL_',
    '\\': '_BSL_', '|': '_VBR_', '~': '_TLD_', '<': '_LAN_', '>': '_RAN_', '(': '_LPR_',
    ')': '_RPR_', '{': '_LCB_', '}': '_RCB_', '[': '_LSQ_', ']': '_RSQ_', "'": '_SQT_',
    '"': '_DQT_', '`': '_BQT_',
}


def fret_name(name: str) -> str:
    """
    Return a name as FRET writes it in formulas: `a.b` becomes `a_DOT_b`.

    FRET treats two names with the same result as equal. A name with special characters other than
    `.` and `%` is quoted in FRET, which replaces the quotes too: `_DQT_a_SPC_b_DQT_`.
    """
    name = name.strip('"')
    spelled = ''.join(_SPELLED.get(char, char) for char in name)
    is_quoted = any(char in _SPELLED for char in name if char not in '.%$')
    return f'_DQT_{spelled}_DQT_' if is_quoted else spelled


def distinct_names(given: Sequence[str]) -> list[str]:
    """Return distinct names, with numbers where they repeat; an empty name for a single one."""
    if len(given) == 1:
        return ['']
    names: list[str] = []
    for stem in given:
        name = stem
        number = 1
        while name in names:
            number += 1
            name = f'{stem} {number}'
        names.append(name)
    return names
