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

"""The values of constants: as a bundle has them, and as a user overrides them."""

from collections.abc import Mapping
from dataclasses import replace
import re

from fret_monitor.bundle.bundle import Bundle, ConstantEntry
from fret_monitor.bundle.declared_name import DeclaredName
from fret_monitor.bundle.yaml_shape import kind_of, text_of
from fret_monitor.bundle.yaml_tree import Node, YamlList, YamlMapping, YamlScalar
from fret_monitor.model.diagnostics import did_you_mean, Problems, Span, Text, UNKNOWN_CONSTANT
from fret_monitor.model.names import fret_name, is_integer, number_fault, shown

_TRUTHS = ('true', 'false')
_WHOLE = re.compile('[+-]?[0-9]+')
_DIGITS = re.compile('[0-9]+')
_MORE_DIGITS = re.compile('[ \t]*,[ \t]*[0-9]')


def read_constant(node: Node, what: str, problems: Problems) -> Text | None:
    """Return the value of a constant; `what` names it for messages."""
    if isinstance(node, YamlMapping | YamlList):
        problems.error(f'{what} must be a number, true or false', node.span,
                       f'this is {kind_of(node)}')
        return None
    text = text_of(node, what, problems)
    if text is not None:
        _check(text, what, kind_of(node), problems)
    return text


def report_decimal_comma(name: DeclaredName, node: Node, rest: DeclaredName,
                         problems: Problems) -> bool:
    """Report `{v_max: 1,2}`, which YAML reads as 1 and another key 2; return whether it is one."""
    if not isinstance(node, YamlScalar) or not _WHOLE.fullmatch(node.value):
        return False
    source, start, end = node.span.source, node.span.start, rest.span.end
    digits = rest.value
    if source.text[start:end] != f'{node.value},{digits}' or not _DIGITS.fullmatch(digits) or \
            _MORE_DIGITS.match(source.text, end):
        return False
    is_thousand = len(digits) == 3  # `1,000` may be either
    problems.error(
        'a comma ends a value in braces', Span(source, start, end),
        'a decimal point is needed' if not is_thousand else 'a number has no comma',
        f'{name.text.value}: {node.value}.{digits}' + (
            f'   # or {node.value}{digits}' if is_thousand else ''))
    return True


def override_constants(bundle: Bundle, values: Mapping[str, Text], problems: Problems) -> Bundle:
    """
    Return a bundle with other values of some constants.

    The name of a value's source is how the user gave it, such as `--constant v_max`: errors have
    their place there.
    """
    constants = {fret_name(item.name.value): item for item in bundle.constants}
    unreadable = {fret_name(name) for name in bundle.unreadable}
    for name, text in values.items():
        key = fret_name(name)
        if key in constants:
            constants[key] = _overridden(constants[key], text, problems)
        elif key not in unreadable and not bundle.cut & {'constants', 'signals'}:
            names = [item.name.value for item in bundle.constants]
            problems.error(
                f'{bundle.sources[0].name} has no constant {shown(name)}', text.span,
                UNKNOWN_CONSTANT, did_you_mean(name, names) or (
                    'the constants are ' + ', '.join(names) if names else 'there are none'))
    return replace(bundle, constants=tuple(constants.values()))


def _overridden(entry: ConstantEntry, text: Text, problems: Problems) -> ConstantEntry:
    found = Problems()
    what = f'the constant {shown(entry.name.value)}'
    _check(text, what, f'the text {shown(text.value)}' if text.value else 'empty', found)
    written = entry.value.value
    is_truth = written.lower() in _TRUTHS
    if not found.errors and (text.value.lower() in _TRUTHS) is not is_truth:
        found.error(
            f'{what} must be {"true or false" if is_truth else "a number"}, as in the bundle',
            text.span, f'in {entry.value.source.name}, line {entry.value.span.line}, it is '
            f'{written}')
    problems.extend(found.errors)
    if found.errors:
        return entry
    if is_integer(text.value) and not is_truth and not is_integer(written):
        # A whole number would make an integer of what is a real number in the bundle.
        offsets = [*text.offsets, text.offsets[-1], text.offsets[-1]]
        text = Text(f'{text.value}.0', text.source, offsets)
    return replace(entry, value=text)


def _check(text: Text, what: str, kind: str, problems: Problems) -> None:
    fault = None if text.value.lower() in _TRUTHS else number_fault(text.value)
    if fault is not None:
        problems.error(f'{what} must be a number, true or false, and is {kind}', text.span,
                       help=fault.help)
