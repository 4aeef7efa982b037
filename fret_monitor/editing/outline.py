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
Where a place in a bundle is: under which keys, and whether a key or a value is written there.

Of text that is YAML, the product's own tree says so. While a line is being typed the text is often
no YAML: `mended` leaves such lines out for the tree, and of a place in them `place_at` goes by
indentation and open braces.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
import re
from typing import NamedTuple

from fret_monitor.bundle.yaml_tree import (
    MAX_DEPTH, Node, read_tree, Unread, YamlList, YamlMapping, YamlScalar,
)
from fret_monitor.model.diagnostics import Problems, Source

ITEM = '[]'
"""The step of a path that stands for an item of a list."""

_TRIES = 8
_LONGEST_KEY = 500  # characters of a line that are searched for a key
_KEY = re.compile(r"""(?P<key>"[^"\n]*"|'[^'\n]*'|[^\s:#"'{\[,-][^:#\n]*?)[ \t]*:(?=[ \t]|$)""")
_DASHES = re.compile(r'[ ]*(?:-(?:[ ]+|$))*')
_FLOW_KEY = re.compile(r"""[{,]\s*(?P<key>"[^"]*"|'[^']*'|[\w/~.{}-]+)\s*:(?=\s|$)""")
_OPENS = {'}': '{', ']': '['}


@dataclass(frozen=True, eq=False)
class OutlinePlace:
    """
    A place in a bundle.

    `path` are the keys above it, `ITEM` for an item of a list; of a value, its key is the last.
    `start` is where the key or value begins, and `beginning` what is written of it up to the
    place. `scalar` is the key or value where the text is YAML. `others` are the keys beside a key.
    """

    path: tuple[str, ...]
    is_key: bool
    start: int
    beginning: str
    scalar: YamlScalar | None = None
    others: frozenset[str] = frozenset()


def mended(source: Source) -> tuple[Source, Node | None]:
    """
    Return a source, and its tree; without lines that make it no YAML.

    Places are the same in both. The tree is None if even that does not help.
    """
    text = source.text
    for _ in range(_TRIES):
        problems, tried = Problems(), Source(source.name, text)
        root = read_tree(tried, problems)
        if root is not None or not problems.errors or problems.errors[-1].span is None:
            return (source if text == source.text else tried), root
        text = _without_line(tried, problems.errors[-1].span.line)
    return source, None


def _without_line(source: Source, number: int) -> str:
    start = source.line_start(number)
    end = start + len(source.line(number))
    return f'{source.text[:start]}{" " * (end - start)}{source.text[end:]}'


def top_keys(text: str) -> frozenset[str]:
    """Return the keys of a bundle, whether it is YAML or not."""
    return frozenset(match['key'] for line in text.splitlines()
                     if (match := _KEY.match(line[:_LONGEST_KEY])) is not None)


def place_at(source: Source, root: Node | None, offset: int) -> OutlinePlace:
    """Return where an offset of a text is, whose tree is `root`."""
    found = _scalar_at(root, offset) if root is not None else None
    if found is not None:
        return _of_scalar(source, found, offset)
    return _by_lines(source, offset)


class _FoundScalar(NamedTuple):
    scalar: YamlScalar
    path: tuple[str, ...]
    is_key: bool
    others: frozenset[str]


def _scalar_at(root: Node, offset: int) -> _FoundScalar | None:
    """Return the key or value that an offset is in, or just behind."""
    return next((found for found in scalars(root) if not found.scalar.is_missing
                 and found.scalar.span.start <= offset <= found.scalar.span.end), None)


def scalars(root: Node) -> Iterator[_FoundScalar]:
    """Yield each key and value of a tree, with the keys above it."""
    stack: list[tuple[Node, tuple[str, ...]]] = [(root, ())]
    while stack:
        node, path = stack.pop()
        match node:
            case YamlScalar():
                yield _FoundScalar(node, path, False, frozenset())
            case YamlList():
                stack.extend((item, (*path, ITEM)) for item in node.items)
            case YamlMapping():
                names = frozenset(key.value for key, _ in node.entries)
                for key, value in node.entries:
                    yield _FoundScalar(key, path, True, names - {key.value})
                    stack.append((value, (*path, key.value)))
            case Unread():
                pass


def _of_scalar(source: Source, found: _FoundScalar, offset: int) -> OutlinePlace:
    text = found.scalar.text
    count = next((number for number, place in enumerate(text.offsets) if place >= offset),
                 len(text.value))
    return OutlinePlace(found.path, found.is_key, text.offsets[0], text.value[:count],
                        found.scalar, found.others)


class _LineKey(NamedTuple):
    """A key of a line, or the dash of an item, with its column and what follows it."""

    column: int
    key: str
    rest: str


def _by_lines(source: Source, offset: int) -> OutlinePlace:
    number = source.position(offset)[0]
    start = source.line_start(number)
    before = source.text[start:offset]
    brace = _open_brace(before)
    if brace is not None:
        return _in_braces(source, number, start, before, brace)
    tokens = _tokens(before)
    if tokens and tokens[-1].key != ITEM:
        value = tokens[-1].rest.lstrip(' \t')
        path = _path(source, number, tokens[-1].column, tokens[:-1])
        return OutlinePlace((*path, tokens[-1].key), False, offset - len(value),
                            value.lstrip('"\''))
    word = before[_indent(before, tokens):]
    return _new_line(source, number, offset, word, tokens)


def _indent(line: str, tokens: Sequence[_LineKey]) -> int:
    dashes = _DASHES.match(line)
    return dashes.end() if dashes else 0


def _new_line(source: Source, number: int, offset: int, word: str,
              tokens: Sequence[_LineKey]) -> OutlinePlace:
    """Return the place of what may be a key, or the next line of a value."""
    column = offset - source.line_start(number) - len(word)
    above = _value_above(source, number, column) if not tokens else None
    if above is not None:
        key, first, rest = above
        lines = [rest, *(source.line(each).strip() for each in range(first + 1, number)), word]
        beginning = ' '.join(filter(None, lines)).lstrip('"\'')
        path = _path(source, first, key.column, _tokens(source.line(first))[:-1])
        return OutlinePlace((*path, key.key), False, offset - len(word), beginning)
    path = _path(source, number, column, tokens)
    return OutlinePlace(path, True, offset - len(word), word,
                        others=_beside(source, number, column))


def _value_above(source: Source, number: int, column: int) -> tuple[_LineKey, int, str] | None:
    """Return the key whose value a line goes on with, its line, and the value's first line."""
    for each in range(number - 1, 0, -1):
        line = source.line(each)
        tokens = _tokens(line)
        if tokens and tokens[-1].column < column:
            rest = tokens[-1].rest.strip()
            is_value = tokens[-1].key != ITEM and bool(rest) and not rest.startswith(('{', '['))
            first = '' if rest.startswith(('|', '>')) else rest
            return (tokens[-1], each, first) if is_value else None
        if tokens:
            return None
    return None


def _tokens(line: str) -> list[_LineKey]:
    """Return the dashes at the beginning of a line, and its key."""
    dashes = _DASHES.match(line)
    begin = dashes.end() if dashes else 0
    found = [_LineKey(place, ITEM, line[place + 1:]) for place in range(begin)
             if line[place] == '-']
    if (match := _KEY.match(line[:begin + _LONGEST_KEY], begin)) is not None:
        found.append(_LineKey(begin, _unquoted(match['key']), line[match.end():]))
    return found


def _unquoted(key: str) -> str:
    return key[1:-1] if len(key) > 1 and key[0] == key[-1] and key[0] in '"\'' else key


def _path(source: Source, number: int, column: int, own: Sequence[_LineKey]) -> tuple[str, ...]:
    """Return the keys above a column of a line; `own` are the tokens before it in the line."""
    path: list[str] = []
    is_item = False
    tokens = list(own)
    for each in range(number, 0, -1):
        for token in reversed(tokens):
            # A list may stand as deep as its key.
            is_above = token.column < column or (
                is_item and token.column == column and token.key != ITEM)
            if is_above:
                path.append(token.key)
                column, is_item = token.column, token.key == ITEM
        if not column and not is_item:
            break
        tokens = _tokens(source.line(each - 1)) if each > 1 else []
    return tuple(reversed(path))


def _beside(source: Source, number: int, column: int) -> frozenset[str]:
    """Return the keys of the mapping that a column of a line is in, without those of the line."""
    found: set[str] = set()
    last = source.position(len(source.text))[0]
    for numbers in (range(number - 1, 0, -1), range(number + 1, last + 1)):
        for each in numbers:
            tokens = _tokens(source.line(each))
            keys = [token.key for token in tokens if token.column == column
                    and token.key != ITEM]
            starts_item = any(token.column < column for token in tokens)
            if starts_item and (each > number or not keys):
                break
            found.update(keys)
            if starts_item:
                break
    return frozenset(found)


def _open_brace(before: str) -> int | None:
    """Return the innermost open brace at the end of a line's beginning, if it is not too deep."""
    opened: list[int] = []
    quote = ''
    for place, char in enumerate(before):
        if quote:
            quote = '' if char == quote else quote
        elif char in '"\'' and (place == 0 or before[place - 1] in ' {[,:'):
            quote = char
        elif char == '#' and before[place - 1:place] in ('', ' '):
            break
        elif char in _OPENS.values() and before[:place].rstrip()[-1:] in ('', *':-,{['):
            opened.append(place)
        elif opened and _OPENS.get(char) == before[opened[-1]]:
            opened.pop()
    return opened[-1] if 0 < len(opened) <= MAX_DEPTH else None


def _in_braces(source: Source, number: int, start: int, before: str,
               brace: int) -> OutlinePlace:
    inside = before[brace:]
    outer = _by_lines(source, start + brace)
    keys = [*_FLOW_KEY.finditer(inside)]
    last = keys[-1] if keys else None
    tail = inside[last.end():] if last else inside[1:]
    is_value = last is not None and (',' not in _outside_quotes(tail))
    if before[brace] == '[':
        value = re.split(r'[\[,]\s*', inside)[-1]
        return OutlinePlace((*outer.path, ITEM), False, start + len(before) - len(value),
                            value.lstrip('"\''))
    if is_value and last is not None:
        value = tail.lstrip()
        return OutlinePlace((*outer.path, _unquoted(last['key'])), False,
                            start + len(before) - len(value), value.lstrip('"\''))
    word = re.split(r'[{,]\s*', inside)[-1]
    return OutlinePlace(outer.path, True, start + len(before) - len(word), word,
                        others=frozenset(_unquoted(item['key']) for item in keys))


def _outside_quotes(text: str) -> str:
    return re.sub(r""""[^"]*("|$)|'[^']*('|$)|\([^)]*(\)|$)""", '', text)
