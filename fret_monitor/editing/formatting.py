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
Formats a bundle: two blanks for each level, no blanks at the ends of lines, a last line end.

Only white space changes, and only if the text means the same afterwards: the trees of YAML are
compared. A text that is no YAML, or that would change, stays as it is.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
import re

from fret_monitor.bundle.yaml_tree import (
    Node, read_tree, Unread, YamlList, YamlMapping, YamlScalar,
)
from fret_monitor.model.diagnostics import Problems, Source

_STEP = 2
_DASH = re.compile(r'-(?:[ ]+(?=\S)|$)')
_END = re.compile(r'\r?\n|$')


def formatted(text: str) -> str:
    """Return a bundle in the usual indentation; the same text where that is not sure."""
    root = _tree(text)
    if root is None:
        return text
    lines = _lines(text)
    trimmed = _trimmed(lines, frozenset(_inside_values(root, in_braces=False)))
    inside = frozenset(_inside_values(root, in_braces=True))
    for tried in (_joined(_indented(trimmed, inside)), _joined(trimmed)):
        other = _tree(tried)
        if other is not None and _is_same(root, other):
            return tried
    return text


def _tree(text: str) -> Node | None:
    """Return the tree of a text without any problem."""
    problems = Problems()
    root = read_tree(Source('', text), problems)
    return None if problems.errors else root


def _lines(text: str) -> list[tuple[str, str]]:
    """Return the lines, each with its line end."""
    ends = [0, *(match.end() for match in _END.finditer(text) if match[0])]
    ends += [len(text)] if ends[-1] < len(text) else []
    found = [text[start:end] for start, end in pairwise(ends)]
    return [(line.rstrip('\r\n'), line[len(line.rstrip('\r\n')):]) for line in found]


def _joined(lines: Sequence[tuple[str, str]]) -> str:
    """Return the text of lines, of which the last one ends in a line end."""
    kept = [*lines]
    while kept and not kept[-1][0]:
        kept.pop()
    end = next((end for _, end in lines if end), '\n')
    return ''.join(line + (ending or end) for line, ending in kept)


def _inside_values(root: Node, *, in_braces: bool) -> Iterator[int]:
    """Yield the numbers, from 0, of lines that begin inside of a text, or also of braces."""
    stack = [root]
    while stack:
        node = stack.pop()
        if in_braces or isinstance(node, YamlScalar):
            yield from range(node.span.line, _last_line(node))
        if isinstance(node, YamlList):
            stack.extend(node.items)
        elif isinstance(node, YamlMapping):
            stack.extend(part for entry in node.entries for part in entry)


def _last_line(node: Node) -> int:
    """Return the line in which a text ends, or what is in braces; else that of its beginning."""
    span = node.span
    if isinstance(node, YamlScalar):
        return span.source.position(max(span.start, span.end - 1))[0]
    if span.source.text[span.start:span.start + 1] not in ('{', '['):
        return span.line
    parts = node.items if isinstance(node, YamlList) else [
        part for entry in node.entries for part in entry] if isinstance(node, YamlMapping) else []
    return max([span.line, *map(_last_line, parts)])


def _trimmed(lines: Sequence[tuple[str, str]], inside: frozenset[int]) -> list[tuple[str, str]]:
    return [(line if number in inside else line.rstrip(' \t'), end)
            for number, (line, end) in enumerate(lines)]


def _indented(lines: Sequence[tuple[str, str]], inside: frozenset[int]) -> list[tuple[str, str]]:
    """Return lines with two blanks for each level; those inside of values move with them."""
    indentation = _Indentation()
    found: list[tuple[str, str]] = []
    comments: list[int] = []
    for number, (line, end) in enumerate(lines):
        content = line.lstrip(' ')
        if number in inside or line.lstrip(' ').startswith(('}', ']')):
            found.append((indentation.moved(line), end))
        elif not content or content.startswith('#'):
            comments += [number] if content else []
            found.append((line, end))
        else:
            new = indentation.line(line)
            for other in comments:  # they stand with the line that they are above
                found[other] = (_beside(found[other][0], line, new), found[other][1])
            comments = []
            found.append((new, end))
    return found


def _beside(comment: str, line: str, new: str) -> str:
    """Return a comment above a line that has moved; one of another depth moves as far."""
    old, moved = (len(text) - len(text.lstrip(' ')) for text in (line, new))
    column = len(comment) - len(comment.lstrip(' '))
    return ' ' * max(0, column + moved - old) + comment.lstrip(' ')


class _Indentation:
    """The columns of the keys and dashes above a line, with those that they move to."""

    def __init__(self) -> None:
        self._above: list[tuple[int, int, bool]] = []
        self._shift = 0

    def line(self, line: str) -> str:
        """Return a line that begins with a key, a dash or a value, at its new column."""
        column = len(line) - len(line.lstrip(' '))
        written = ''
        rest = line[column:]
        while (match := _DASH.match(rest)) is not None:
            new = self._column(column, is_dash=True)
            written += ' ' * (new - len(written)) + '-'
            column, rest = column + match.end(), rest[match.end():]
        new = self._column(column, is_dash=False)
        self._shift = new - column
        return (written + ' ' * (new - len(written)) + rest).rstrip(' ')

    def moved(self, line: str) -> str:
        """Return a line inside of a value, moved as far as the line in which that begins."""
        content = line.lstrip(' ')
        if not content:
            return line
        return ' ' * max(0, len(line) - len(content) + self._shift) + content

    def _column(self, column: int, *, is_dash: bool) -> int:
        """Return the new column of a key or dash, and remember it."""
        while self._above and (self._above[-1][0] > column or self._above[-1][0] == column and (
                self._above[-1][2] or not is_dash)):
            self._above.pop()
        if not self._above:
            new = 0
        else:
            old, above, _ = self._above[-1]
            new = above if old == column else above + _STEP
        self._above.append((column, new, is_dash))
        return new


def _is_same(first: Node, second: Node) -> bool:
    """Return whether two trees have the same keys and values, in the same order and style."""
    match first, second:
        case YamlScalar(), YamlScalar():
            return (first.value, first.style) == (second.value, second.style)
        case YamlList(), YamlList():
            pairs = [*zip(first.items, second.items, strict=False)]
            return len(first.items) == len(second.items) and all(
                _is_same(*pair) for pair in pairs)
        case YamlMapping(), YamlMapping():
            mine = [part for entry in first.entries for part in entry]
            other = [part for entry in second.entries for part in entry]
            return len(mine) == len(other) and first.is_flow is second.is_flow and all(
                _is_same(*pair) for pair in zip(mine, other, strict=False))
        case Unread(), Unread():
            return True
        case _:
            return False
