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
The shape of a YAML mapping: its known keys and the kinds of their values.

A `Shape` reports each unknown key once, and returns the values of the others as texts, choices
and numbers. A refused value is reported and returned as None.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
import re
from typing import TypeVar

from fret_monitor.bundle.yaml_repair import (
    LACKS_SPACE, report_comma, report_lacking_space,
)
from fret_monitor.bundle.yaml_tree import Node, Unread, YamlList, YamlMapping, YamlScalar
from fret_monitor.model.diagnostics import (
    close_matches, did_you_mean, Problems, Span, suggestion, Text,
)
from fret_monitor.model.names import exact, Fault, number_fault, shown

_Choice = TypeVar('_Choice', bound=Enum)
_TRUTHS = ('true', 'false')
_WITH_UNIT = re.compile(r'([0-9.]+)\s*([A-Za-z]+)')


@dataclass(frozen=True)
class Quantity:
    """A quantity: its unit, an example, and the sizes of the units that users write."""

    unit: str
    example: str
    sizes: Mapping[str, Fraction]


SECONDS = Quantity('seconds', '0.5', {
    **dict.fromkeys(('ns', 'nanoseconds'), Fraction(1, 10 ** 9)),
    **dict.fromkeys(('us', 'microseconds'), Fraction(1, 10 ** 6)),
    **dict.fromkeys(('ms', 'msec', 'milliseconds'), Fraction(1, 1000)),
    **dict.fromkeys(('s', 'sec', 'secs', 'second', 'seconds'), Fraction(1)),
    **dict.fromkeys(('min', 'minute', 'minutes'), Fraction(60)),
    **dict.fromkeys(('h', 'hour', 'hours'), Fraction(3600)),
})
_HERTZ = {'hz': Fraction(1), 'khz': Fraction(1000)}
HERTZ = Quantity('steps a second (Hz)', '10', _HERTZ)
MESSAGES_A_SECOND = Quantity('messages a second (Hz)', '100', _HERTZ)


class Shape:
    """A mapping with the keys it may have; `what` names it in the user's words."""

    def __init__(self, mapping: YamlMapping, what: str, known: Iterable[str], problems: Problems,
                 slips: Mapping[str, str] | None = None,
                 elsewhere: Mapping[str, str] | None = None) -> None:
        """
        Report all keys that are not known.

        `slips` are common wrong words, each with the right one; `elsewhere` are keys of other
        mappings, each with its place.
        """
        self.what = what
        self.span = mapping.span
        self._known = tuple(known)
        self._problems = problems
        self._entries = {key.value: (key, node) for key, node in mapping.entries}
        self._meant: set[str] = set()
        self._unknown: list[tuple[Node, list[str]]] = []
        self._elsewhere = elsewhere or {}
        # Where a comma is missing in braces, the value before it includes the next key.
        self._has_swallowed = mapping.is_flow and any(
            isinstance(node, Unread) for _, node in mapping.entries)
        self.is_cut = _report_comma(mapping, self._known, problems)
        if not self.is_cut:
            for key, _ in mapping.entries:
                self._look_at(key, slips or {})

    def _look_at(self, key: YamlScalar, slips: Mapping[str, str]) -> None:
        if key.value in self._known:
            return
        spaceless = LACKS_SPACE.fullmatch(key.value) if not key.style else None
        if spaceless and spaceless[1] in self._known:
            self._meant.add(spaceless[1])
            self._unknown.append((self._entries[key.value][1], [spaceless[1]]))
            report_lacking_space(spaceless, key.span, self._problems)
            return
        meant: list[str] = []
        help_ = self._elsewhere.get(key.value)
        if help_ is None:
            slip = key.value.lower() if key.value.lower() in self._known else slips.get(key.value)
            meant = [slip] if slip else close_matches(key.value, self._known)
            help_ = suggestion(meant) or 'the keys are ' + ', '.join(self._known)
        self._meant.update(meant)
        self._unknown.append((self._entries[key.value][1], meant))
        self._problems.error(f'{self.what} has no key {shown(key.value)}', key.span,
                             'unknown key', help_)

    def lacks(self, *keys: str) -> bool:
        """Return whether all of the keys are missing, even in a misspelling."""
        return not self._has_swallowed and not any(
            key in self._entries or key in self._meant for key in keys)

    def may_hide(self, key: str) -> bool:
        """Return whether entries of the section `key` may stand where they cannot be read."""
        return self._has_swallowed or isinstance(self.node(key), Unread) or any(
            key in meant or not meant and not isinstance(unknown, YamlScalar)
            for unknown, meant in self._unknown)

    def key(self, key: str) -> YamlScalar | None:
        """Return a key with its place, None if it is missing."""
        return self._entries[key][0] if key in self._entries else None

    def node(self, key: str) -> Node | None:
        """Return the node under a key, None if it is missing."""
        return self._entries[key][1] if key in self._entries else None

    def text(self, key: str) -> Text | None:
        """Return the text under a key; it may not be left empty."""
        node = self.node(key)
        return None if node is None else text_of(node, f"'{key}'", self._problems)

    def free_text(self, key: str) -> str:
        """Return a descriptive text, which may be empty."""
        node = self.node(key)
        if node is None or (isinstance(node, YamlScalar) and not node.value):
            return ''
        text = text_of(node, f"'{key}'", self._problems)
        return text.value if text else ''

    def choice(self, key: str, kind: type[_Choice]) -> _Choice | None:
        """Return one of the values of an enumeration."""
        text = self.text(key)
        if text is None:
            return None
        words = [item.value for item in kind]
        if text.value in words:
            return kind(text.value)
        report_choice(text, key, words, self._problems)
        return None

    def truth(self, key: str) -> bool:
        """Return whether a key is `true`; without the key, or if its value is refused, False."""
        text = self.text(key)
        if text is not None and text.value not in _TRUTHS:
            report_choice(text, key, _TRUTHS, self._problems)
        return text is not None and text.value == _TRUTHS[0]

    def number(self, key: str, quantity: Quantity, least: Fraction,
               most: Fraction) -> Fraction | None:
        """Return an exact number between `least`, which is at least 0, and `most`."""
        text = self.text(key)
        if text is None:
            return None
        fault = number_fault(text.value)
        value = exact(text.value)
        if fault is not None:
            self._problems.error(
                f"'{key}' must be a number of {quantity.unit}: {fault.reason}", text.span,
                help=fault.help or f'{key}: {_without_unit(text.value, quantity)}')
        elif value is not None and value < 0 and not least:
            self._problems.error(f"'{key}' cannot be negative", text.span,
                                 help=f'{key}: {quantity.example}')
        elif value is not None and value <= 0 and least:
            self._problems.error(f"'{key}' must be greater than 0", text.span,
                                 help=f'{key}: {quantity.example}')
        elif value is None or not least <= value <= most:
            self._problems.error(
                f"'{key}' is out of range", text.span, f'a number of {quantity.unit} from '
                f'{float(least):g} to {float(most):g}')
        else:
            return value
        return None


def _without_unit(text: str, quantity: Quantity) -> str:
    """Return the number of a text such as `500 ms`; the example if the unit is unknown."""
    match = _WITH_UNIT.fullmatch(text)
    number = exact(match[1]) if match else None
    size = quantity.sizes.get(match[2].lower()) if match else None
    return quantity.example if number is None or size is None else f'{float(number * size):.15g}'


def _report_comma(mapping: YamlMapping, known: tuple[str, ...], problems: Problems) -> bool:
    """Report a value in braces that was cut at a comma, so that the rest became a key."""
    if not mapping.is_flow:
        return False
    for (before, cut), (key, node) in zip(mapping.entries, mapping.entries[1:], strict=False):
        if (isinstance(node, YamlScalar) and node.is_missing and key.value not in known
                and not (isinstance(cut, YamlScalar) and cut.style)):
            if isinstance(cut, YamlScalar):
                span = Span(cut.span.source, cut.span.start, key.span.end)
                report_comma(before.text, span, problems)
            return True
    return False


def kind_of(node: Node) -> str:
    """Return a description of a node for messages."""
    match node:
        case YamlMapping():
            return 'a mapping'
        case YamlList():
            return 'a list'
        case YamlScalar():
            return f'the text {shown(node.value)}' if node.value else 'empty'
        case Unread():
            return 'not readable'


def text_of(node: Node, what: str, problems: Problems) -> Text | None:
    """Return a text that is not empty."""
    if isinstance(node, YamlScalar) and node.value.strip():
        return node.text
    if isinstance(node, YamlScalar):
        problems.error(f'{what} has no value', node.span, 'write one, or remove the key')
    elif not isinstance(node, Unread):
        problems.error(f'{what} must be a text', node.span, f'this is {kind_of(node)}')
    return None


def mapping_of(node: Node | None, what: str, problems: Problems,
               help: str = '') -> YamlMapping | None:
    """Return a mapping; a missing value is an empty one."""
    if isinstance(node, YamlMapping):
        return node
    if isinstance(node, YamlScalar) and node.is_missing:
        return YamlMapping((), False, node.span)
    plain = node.value if isinstance(node, YamlScalar) and not node.style else ''
    if node is not None and (match := LACKS_SPACE.fullmatch(plain)):
        report_lacking_space(match, node.span, problems)
    elif node is not None and not isinstance(node, Unread):
        problems.error(f'{what} must be a mapping of keys to values', node.span,
                       f'this is {kind_of(node)}', help)
    return None


def report_choice(text: Text, key: str, words: Iterable[str], problems: Problems,
                  slips: Mapping[str, str] | None = None) -> None:
    """Report a word that is not one of the choices; `slips` are wrong words with right ones."""
    words = list(words)
    meant = (slips or {}).get(text.value)
    problems.error(f"{shown(text.value)} is not valid for '{key}'", text.span,
                   'one of ' + ', '.join(words),
                   suggestion([meant]) if meant else did_you_mean(text.value, words))


def is_empty(node: Node) -> bool:
    """Return whether nothing was written here."""
    return isinstance(node, YamlScalar) and node.is_missing


def line_of(text: Text, here: Span) -> str:
    """Return the line of a text for messages, with its file if that differs."""
    file = '' if text.source is here.source else f'{text.source.name}, '
    return f'{file}line {text.span.line}'


def report_fault(fault: Fault | None, text: Text, problems: Problems) -> None:
    """Report why a text cannot be used, if there is a reason."""
    if fault is not None:
        problems.error(fault.reason, text.span, help=fault.help)
