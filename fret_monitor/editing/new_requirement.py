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

"""A new requirement, as a FRETish sentence: where it is written in the text of a bundle."""

from collections.abc import Iterator, Mapping
import json
from pathlib import Path
import re

from fret_monitor.bundle.yaml_tree import Node, YamlList, YamlMapping, YamlScalar
from fret_monitor.editing.edited_bundle import EditedBundle, unchecked
from fret_monitor.editing.edits import edited as with_edits, TextEdit
from fret_monitor.editing.outline import scalars
from fret_monitor.editing.sentence_form import sentence_of
from fret_monitor.model.diagnostics import refuse, Source, Span

_KEY = 'requirements'
_PLAIN_ID = re.compile(r'[A-Za-z][\w.-]*')
_MOST = 6  # places that are tried


def with_requirement(edited: EditedBundle, id: str, fields: Mapping[str, str]) -> TextEdit:
    """
    Return what to write so that a bundle has one more requirement, behind all others.

    `fields` are those of a form (`sentence_form`).

    Raises
    ------
    CompileError
        if there is no id, or one that is taken, or the requirement cannot be written there.
    """
    name, before = ' '.join(id.split()), _sentences(edited)
    if not name:
        refuse('a requirement has an id', help='write one, such as SPEED-1')
    if name in before:
        refuse(f"there is a requirement '{name}' already", help='write another id')
    sentence = sentence_of(fields)
    written = {'id': name if _PLAIN_ID.fullmatch(name) else _quoted(name),
               'fretish': _quoted(sentence)}
    for edit in _ways(edited, written):
        after = unchecked(Path(edited.source.name), with_edits(edited.source.text, [edit]),
                          read_file=edited.read_file, find_message=edited.find_message)
        if _sentences(after) == {**before, name: sentence}:
            return edit
    refuse('the requirement cannot be written into this text', help='write it yourself')


def _sentences(edited: EditedBundle) -> dict[str, str]:
    return {item.id.value: ' '.join(item.text.value.split())
            for item in edited.bundle.requirements} if edited.bundle else {}


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def _ways(edited: EditedBundle, written: Mapping[str, str]) -> Iterator[TextEdit]:
    """Yield the edits that may add a requirement, the likeliest first."""
    source, root = edited.source, edited.tree
    if not isinstance(root, YamlMapping) or root.is_flow and not root.entries:
        return
    key, found = next(((key, node) for key, node in root.entries if key.value == _KEY),
                      (None, None))
    match found:
        case YamlList() if source.text[found.span.start] == '[':
            yield from _in_brackets(source, found, written)
        case YamlList():
            column = found.span.start - source.line_start(found.span.line)
            for end in _line_ends(source, _end(found)):
                yield _insert(source, _behind_comments(source, end, column),
                              f'\n{_as_item(written, column)}')
        case YamlScalar() if key is not None and found.is_missing:
            for end in _line_ends(source, key.span.end):
                yield _insert(source, end, f'\n{_as_item(written, 2)}')
        case None if not root.is_flow:
            yield _insert(source, len(source.text),
                          f'\n{_KEY}:\n{_as_item(written, 2)}\n')


def _as_item(written: Mapping[str, str], column: int) -> str:
    first, *others = (f'{key}: {value}' for key, value in written.items())
    indent = ' ' * column
    return '\n'.join([f'{indent}- {first}', *(f'{indent}  {line}' for line in others)])


def _in_brackets(source: Source, found: YamlList,
                 written: Mapping[str, str]) -> Iterator[TextEdit]:
    item = '{' + ', '.join(f'{key}: {value}' for key, value in written.items()) + '}'
    if not found.items:
        yield _insert(source, found.span.start + 1, item)
        return
    place = _end(found)
    for _ in range(_MOST):  # braces of the last item, and in a comment behind it
        place = source.text.find('}', place) + 1
        if not place:
            return
        yield _insert(source, place, f', {item}')


def _end(node: Node) -> int:
    """Return where the last key or value of a node ends."""
    return max((each.scalar.span.end for each in scalars(node)), default=node.span.end)


def _line_ends(source: Source, offset: int) -> Iterator[int]:
    """Yield the end of the line of an offset, and of those that follow it."""
    end = max(offset - 1, 0)  # a block of text ends behind its line
    for _ in range(_MOST):
        end = source.text.find('\n', end)
        yield end if end >= 0 else len(source.text)
        if end < 0:
            return
        end += 1


def _behind_comments(source: Source, end: int, column: int) -> int:
    """Return where the comments end that follow a line and belong to the item before."""
    found = re.compile(rf'(?:\n {{{column + 1},}}#[^\n]*)*').match(source.text, end)
    return found.end() if found else end


def _insert(source: Source, offset: int, text: str) -> TextEdit:
    return TextEdit(Span(source, offset, offset), text)
