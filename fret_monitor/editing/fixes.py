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
Quick fixes: what a diagnostic says to write, as edits.

The help of a diagnostic is text for people. It is tried in the ways in which it may be meant: as
another word, as a line or value in place of the one there, as a key to add or to remove. An edit
is offered only if the diagnostic is gone with it, and no new one has come.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
import re

from fret_monitor.bundle.yaml_repair import value_as_written
from fret_monitor.editing.edited_bundle import EditedBundle, read_edited
from fret_monitor.editing.edits import edited as with_edits, TextEdit
from fret_monitor.elaboration.memory import RequirementMemory
from fret_monitor.model.diagnostics import Diagnostic, Level, Span
from fret_monitor.model.names import PLACEHOLDER

_MEANT = re.compile(r"'([^']+)'")
_LINE = re.compile(r'(?:- )?([A-Za-z_][\w.]*): (.*)')
_WRITE = re.compile(r'(?:.*?: |or )?write (.+)', re.DOTALL)
_PROSE = re.compile(r'\b(?:the|a|an|it|them|two|both|out|in|as|its|of)\b|\.\.\.')
_KEY_BEFORE = re.compile(r"""^[ \t]*(?:-[ ]+)*(["']?)(?P<key>[A-Za-z_][\w.]*)\1[ \t]*:[ \t]*""")
_KEY_JUST_BEFORE = re.compile(r"""([A-Za-z_][\w.]*)["']?[ \t]*:[ \t]+["']?$""")
_ENTRY = re.compile(r"""[\w.]+[ \t]*:[ \t]+(?:"[^"\n]*"|'[^'\n]*'|[^\s,{}\[\]]+)""")
_INDENTED = re.compile(r'[ ]*(?:-[ ]+)*')
_COMMENT = re.compile(r'[ ]{2,}#.*')
_OF_YAML = ('YAML', 'a comma ends a value')  # what is cut is read after the fix, with its errors
_INPUTS = re.compile(r'^inputs:[ \t]*(?:#[^\r\n]*)?'
                     r'(?=\r?\n(?:[ \t\r]*(?:#.*)?\n)*(?P<indent>[ ]+)\S)', re.MULTILINE)
_INPUTS_IN_BRACES = re.compile(r'^inputs:[ \t]*\{(?=\s*\w)', re.MULTILINE)
_NO_INPUTS = re.compile(r'(?<=^inputs:)[ \t]*(?:\{[ \t]*\})?(?=[ \t]*(?:#.*)?\r?$)', re.MULTILINE)
_REQUIREMENTS = re.compile(r'^requirements:', re.MULTILINE)
_NAME = re.compile(r'[A-Za-z_]\w*')
_MOST = 10  # ways that are tried for one diagnostic


@dataclass(frozen=True)
class QuickFix:
    """What to write so that a diagnostic is gone; `title` says it in one line."""

    title: str
    edit: TextEdit


def fixes(edited: EditedBundle, found: Diagnostic,
          memory: RequirementMemory | None = None) -> tuple[QuickFix, ...]:
    """
    Return the quick fixes of a diagnostic of the edited file, the likeliest first.

    `memory` is as of `read_edited`.
    """
    if found.span is None or found.span.source.name != edited.source.name:
        return ()
    good: dict[str, QuickFix] = {}
    is_choice = found.help.startswith('did you mean')
    for edit in list(dict.fromkeys(map(_with_line_ends, _ways(found, found.span))))[:_MOST]:
        if (is_choice or not good) and _mends(edited, found, edit, memory):
            written = ' '.join(edit.text.split()).rstrip(',')
            good[written] = QuickFix(f'write {written}' if written else 'remove it', edit)
    return tuple(good.values())


def _with_line_ends(edit: TextEdit) -> TextEdit:
    """Return an edit with line ends as that of the line before it, or of the first line."""
    text = edit.place.source.text
    end = text.rfind('\n', 0, edit.place.start)
    end = text.find('\n') if end < 0 else end
    return TextEdit(edit.place, edit.text.replace('\n', '\r\n')) \
        if text[:end].endswith('\r') and end > 0 else edit


def _ways(found: Diagnostic, span: Span) -> Iterator[TextEdit]:
    """Yield the edits that the help of a diagnostic may mean."""
    help_ = found.help.strip()
    if help_.startswith('did you mean'):
        written = '{{{}}}' if PLACEHOLDER.fullmatch(span.source.text, span.start, span.end) \
            else '{}'
        yield from (TextEdit(span, written.format(word)) for word in _MEANT.findall(help_))
    elif help_.startswith('declare it under inputs'):
        yield from _new_inputs(span)
    elif help_.startswith('remove'):
        yield from _without_entry(span)
    elif (line := _LINE.fullmatch(help_.partition('\n')[0])) is not None:
        yield from _lines(span, *line.groups())
    elif (match := _WRITE.fullmatch(help_)) is not None:
        for text in dict.fromkeys((match[1], *(match[1].split(end)[0] for end in (
                ', ', '; ', ' for ')))):
            if ' shall ' in text or not _PROSE.search(text):
                yield TextEdit(span, text)
                yield from _whole_value(span, text)


def _lines(span: Span, key: str, value: str) -> Iterator[TextEdit]:
    """Yield edits that write a key and its value: those that are there, or new ones."""
    source = span.source
    start, text = source.line_start(span.line), source.line(span.line)
    before, line = source.text[start:span.start], f'{key}: {value}'
    own = _KEY_BEFORE.match(text)
    if own is not None and own['key'] == key:
        begin = start + own.start('key') - len(own[1])
        yield TextEdit(Span(source, begin, _end_of_value(span, start + own.end())), line)
    plain = _COMMENT.sub('', value)
    just = _KEY_JUST_BEFORE.search(before)
    if just is not None and just[1] == key:
        yield TextEdit(span, plain)
    yield TextEdit(span, line)
    yield from _new_keys(span, f'{key}: {plain}', line)


def _new_keys(span: Span, inside: str, line: str) -> Iterator[TextEdit]:
    """Yield edits that add a key: within braces, below a key, behind it, before it."""
    source = span.source
    start, text = source.line_start(span.line), source.line(span.line)
    column = span.start - start
    brace = text.find('{', column)
    if brace >= 0:
        yield TextEdit(Span(source, start + brace + 1, start + brace + 1), f'{inside}, ')
    if '{' in text[:column]:
        yield TextEdit(Span(source, span.start, span.start), f'{inside}, ')
    indent = _INDENTED.match(text)
    width = indent.end() if indent else 0
    after, first = start + len(text), start + width
    yield TextEdit(Span(source, after, after), f'\n{" " * width}{line}')
    yield TextEdit(Span(source, after, after), f'\n{" " * (width + 2)}{line}')
    yield TextEdit(Span(source, first, first), f'{line}\n{" " * width}')


def _new_inputs(span: Span) -> Iterator[TextEdit]:
    """Yield edits that declare a name as an input: a truth value, or a number."""
    source = span.source
    name = source.text[span.start:span.end]
    block = _INPUTS.search(source.text)
    brace = _INPUTS_IN_BRACES.search(source.text)
    empty = _NO_INPUTS.search(source.text)
    below = _REQUIREMENTS.search(source.text)
    for kind in ('Bool', 'Float64') if _NAME.fullmatch(name) else ():
        line = f'{name}: {{topic: {name}, type: std_msgs/msg/{kind}}}'
        if block is not None:
            yield TextEdit(Span(source, block.end(), block.end()), f'\n{block["indent"]}{line}')
        elif brace is not None:
            yield TextEdit(Span(source, brace.end(), brace.end()), f'{line}, ')
        elif empty is not None:
            yield TextEdit(Span(source, empty.start(), empty.end()), f'\n  {line}')
        elif below is not None:
            yield TextEdit(Span(source, below.start(), below.start()), f'inputs:\n  {line}\n')


def _without_entry(span: Span) -> Iterator[TextEdit]:
    """Yield edits that remove a key with its value: within braces, or a line of its own."""
    text = span.source.text
    entry = _ENTRY.match(text, span.start)
    if entry is not None and (comma := re.compile(r'[ ]*,[ ]*').match(text, entry.end())):
        yield TextEdit(Span(span.source, span.start, comma.end()), '')
    if entry is not None and (before := re.search(r',[ ]*$', text[:span.start])):
        yield TextEdit(Span(span.source, before.start(), entry.end()), '')
    start = span.source.line_start(span.line)
    line = span.source.line(span.line)
    if not line[:span.start - start].strip() and _ENTRY.fullmatch(line.strip()):
        yield TextEdit(Span(span.source, start, start + len(line) + 1), '')


def _whole_value(span: Span, text: str) -> Iterator[TextEdit]:
    """Yield an edit that writes a text in place of all of the value that a place is in."""
    source = span.source
    start = source.line_start(span.line)
    own = _KEY_BEFORE.match(source.line(span.line))
    if own is not None and start + own.end() <= span.start:
        value = start + own.end()
        quote = source.text[value:value + 1]
        written = f'{quote}{text}{quote}' if quote in ('"', "'") else text
        yield TextEdit(Span(source, value, _end_of_value(span, value)), written)


def _end_of_value(span: Span, value: int) -> int:
    """Return where the value that begins at a place ends, on its line or those below."""
    left, place = len(''.join(value_as_written(span.source, value).split())), value
    while left and place < len(span.source.text):
        left -= not span.source.text[place].isspace()
        place += 1
    return place


def _mends(edited: EditedBundle, found: Diagnostic, edit: TextEdit,
           memory: RequirementMemory | None) -> bool:
    """Return whether a diagnostic is gone with an edit, and no new one has come."""
    text = with_edits(edited.source.text, [edit])
    after = read_edited(Path(edited.source.name), text, find_message=edited.find_message,
                        read_file=edited.read_file, memory=memory)
    before = [_worded(item) for item in edited.diagnostics]
    left = [_worded(item) for item in after.diagnostics if item.level is found.level
            or item.level is Level.ERROR]
    if left.count(_worded(found)) >= before.count(_worded(found)):
        return False
    allowed = range(edit.place.start, edit.place.start + len(edit.text) + 1) if any(
        word in found.title for word in _OF_YAML) else range(0)
    return all(_worded(item) in before or item.span and item.span.start in allowed
               for item in after.diagnostics if item.level is found.level
               or item.level is Level.ERROR)


def _worded(found: Diagnostic) -> tuple[str, str]:
    return found.title, found.label
