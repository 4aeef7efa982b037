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
Reads the formula of a requirement or definition: one key that names the language, and its text.

An unquoted formula that YAML cuts or misreads is refused with the line to write.
"""

import re

from fret_monitor.bundle.bundle import Language
from fret_monitor.bundle.declared_name import DeclaredName
from fret_monitor.bundle.yaml_repair import quoted_line, report_misread
from fret_monitor.bundle.yaml_shape import kind_of, Shape
from fret_monitor.bundle.yaml_tree import Node, Unread, YamlList, YamlMapping, YamlScalar
from fret_monitor.model.diagnostics import Problems, Span, Text
from fret_monitor.model.names import shown

FORMULA_KEYS = tuple(language.value for language in Language)
FORMULA_SLIPS = {
    'formula': 'ptltl', 'smv': 'ptltl', 'ltl': 'ptltl', 'mtl': 'ptltl', 'ptmtl': 'ptltl',
    'pastltl': 'ptltl', 'lustre': 'cocospec', 'text': 'fretish', 'sentence': 'fretish',
    'c2po': 'mltl', 'r2u2': 'mltl', 'future': 'mltl', 'name': 'id', 'reqid': 'id',
}
"""Keys that people write instead of the right ones."""
_COMMENT = re.compile(r'[ \t]+(#[^\r\n]*)')


def read_definition(name: DeclaredName, node: Node,
                    problems: Problems) -> tuple[Language, Text | None]:
    """Read a definition: an expression, or one under the key of its language."""
    if not isinstance(node, YamlMapping):
        return Language.PTLTL, _formula(name.key, node, problems)
    if node.is_flow and not any(key.value in FORMULA_KEYS for key, _ in node.entries):
        return Language.PTLTL, _formula(name.key, node, problems)
    shape = Shape(node, f'the definition {shown(name.value)}', FORMULA_KEYS, problems,
                  FORMULA_SLIPS)
    return read_one_formula(shape, f'the definition {shown(name.value)}', shape.span, problems)


def read_one_formula(shape: Shape, what: str, place: Span,
                     problems: Problems) -> tuple[Language, Text | None]:
    """Read the formula under the one key that names a language."""
    keys = [key for name in FORMULA_KEYS if (key := shape.key(name))]
    keys.sort(key=lambda key: key.span.start)
    if not keys and shape.lacks(*FORMULA_KEYS):
        problems.error(f'{what} has no formula', place, 'one of ' + ', '.join(FORMULA_KEYS),
                       'ptltl: "H (speed <= 2.0)"')
    for key in keys[1:]:
        problems.error(f'{what} has two formulas', key.span,
                       f"'{keys[0].value}' is already given", 'remove one of them')
    if not keys:
        return Language.PTLTL, None
    node = shape.node(keys[0].value)
    assert node is not None, 'a key has a node'
    return Language(keys[0].value), _formula(keys[0], node, problems)


def _formula(key: YamlScalar, node: Node, problems: Problems) -> Text | None:
    """Read a formula; refuse it if YAML did not read all of it as written."""
    source = key.span.source
    if isinstance(node, Unread):
        return None
    if not isinstance(node, YamlScalar):
        if not (node.items if isinstance(node, YamlList) else node.entries):
            problems.error('there is no formula', key.span,
                           f'this is {kind_of(node)} without entries')
        elif source.text[node.span.start] in '[{':
            report_misread(source, node.span.start, problems)
        else:
            problems.error('a formula must be a text', node.span, f'this is {kind_of(node)}')
        return None
    comment = None if node.style else _COMMENT.match(source.text, max(
        node.span.end, key.span.end + (1 if node.is_missing else 0)))
    if not node.value.strip():
        problems.error('there is no formula', key.span,
                       "a '#' starts a comment: put the formula in quotes" if comment else
                       'nothing follows this key')
        return None
    if comment:
        written = ' '.join(node.value.split())
        problems.error(
            "'#' starts a comment in YAML and ends the formula",
            Span(source, comment.start(1), comment.end(1)), 'not part of the formula: put the '
            'formula in quotes', quoted_line(source, node.span.start, written) + '  ' + comment[1])
        return None
    return node.text
