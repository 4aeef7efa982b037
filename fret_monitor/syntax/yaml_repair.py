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
Values that YAML cuts or misreads because they are not in quotes: found, told, and stepped over.

A formula such as `!p & q`, `a: b` or `[x] > 3` means something else to YAML, or nothing. The user
gets the line to paste; the reader goes on behind the value.
"""

import re

from fret_monitor.diagnostics import Problems
from fret_monitor.diagnostics import Source
from fret_monitor.diagnostics import Span
import yaml

_MAX_REPAIRS = 50

_VALUE_LINE = re.compile(
    r"""[ \t]*(?:-[ ]+)*(?P<key>[A-Za-z_][^:#'"\[\]{},]*|"[^"]*"|'[^']*')[ \t]*:[ \t]+(?=\S)""")

_MARKS = {
    '!': 'starts a tag', '&': 'starts an anchor', '*': 'starts an alias', '#': 'starts a comment',
    '|': 'starts a block of lines', '>': 'starts a folded block', '[': 'starts a list',
    '{': 'starts a mapping', '%': 'starts a directive', '@': 'is reserved', '`': 'is reserved',
    '-': 'starts a list', '?': 'starts a key', ':': 'ends a key', ',': 'parts items',
    ']': 'ends a list', '}': 'ends a mapping',
}


def tell_misread(source: Source, start: int, problems: Problems) -> None:
    """Tell that the value at `start` needs quotes, with the line to paste."""
    written = value_as_written(source, start)
    first = source.text[start]
    quotes = first in '"\''
    if quotes:
        title = 'there is text behind a closing quote'
    elif first in _MARKS:
        title = f"'{first}' {_MARKS[first]} in YAML"
    else:
        title = 'YAML cannot read this as text'
    label = 'put quotes around all of it' if quotes else 'put it in quotes'
    end = _line_end(source.text, start)
    problems.error(title, Span(source, start, start + len(source.text[start:end].rstrip())),
                   label, quoted_line(source, start, written))


def value_as_written(source: Source, start: int) -> str:
    """Return what the user seems to have meant as the value that starts at `start`."""
    end = _line_end(source.text, start)
    lines = [source.text[start:end].strip()]
    base = _indentation(source.line(source.position(start)[0]))
    while end < len(source.text):
        begin = end + 1
        end = _line_end(source.text, begin)
        line = source.text[begin:end]
        if not line.strip() or _indentation(line) <= base or line.lstrip().startswith('#'):
            break
        lines.append(line.strip())
    return _without_closers(' '.join(lines))


def _without_closers(value: str) -> str:
    """Cut a value off where a bracket closes that was opened before it."""
    depth = 0
    for place, char in enumerate(value):
        depth += char in '([{'
        depth -= char in ')]}'
        if depth < 0 and char != ')':
            return value[:place].rstrip()
        depth = max(depth, 0)
    return value


def quoted_line(source: Source, start: int, value: str) -> str:
    """Return `key: "value"` for the value at `start`, to be pasted."""
    line_start = source.text.rfind('\n', 0, start) + 1
    match = _VALUE_LINE.match(source.text, line_start)
    before = source.text[line_start:start].strip() if match and match.end() == start else ''
    if not before:
        keys = re.findall(r'[A-Za-z_][\w.]*[ \t]*:[ \t]*$', source.text[line_start:start])
        before = keys[-1].strip() if keys else ''
    if '"' not in value and '\\' not in value:
        return f'{before} "{value}"'.strip()
    return f"{before} '{value.replace(chr(39), chr(39) * 2)}'".strip()


def _indentation(line: str) -> int:
    return len(line) - len(line.lstrip(' '))


def _line_end(text: str, start: int) -> int:
    end = text.find('\n', start)
    return len(text) if end < 0 else end


class Repair:
    """
    What goes on behind a value that YAML cannot read.

    The value is told, and replaced by a word of the same length, so that all places stay right.
    """

    def __init__(self, source: Source, problems: Problems) -> None:
        self._source = source
        self._problems = problems
        self._shift = 1 if source.text.startswith('\ufeff') else 0
        self._repairs = 0
        self.text = source.text[self._shift:]
        self.unread: frozenset[int] = frozenset()

    def mend(self, error: yaml.YAMLError, last_scalar: int) -> bool:
        """Tell the error; return whether the text was changed so that it can be read anew."""
        place = self._place(error)
        if place >= len(self._source.text):
            place = max(len(self._source.text) - 1, 0)
        if self._is_tab(place):
            return False
        start = self._value_start(error, place, last_scalar)
        if start is None or start in self.unread or self._repairs >= _MAX_REPAIRS:
            self._tell(error, place)
            return False
        self._tell_value(error, start, place)
        self._blank(start)
        return True

    def _place(self, error: yaml.YAMLError) -> int:
        mark = getattr(error, 'problem_mark', None) or getattr(error, 'context_mark', None)
        return (mark.index if mark else 0) + self._shift

    def _is_tab(self, place: int) -> bool:
        text = self._source.text
        start = text.rfind('\n', 0, place) + 1
        match = re.compile(r'[ ]*(?:-[ ]*)*(\t)').match(text, start)
        if match:
            self._problems.error('YAML is not indented with tabs',
                                 Span(self._source, match.start(1), match.end(1)),
                                 'use spaces here')
        return match is not None

    def _value_start(self, error: yaml.YAMLError, place: int, last_scalar: int) -> int | None:
        """Return where the value begins that is to blame, None where it is none."""
        context = getattr(error, 'context', None) or ''
        mark = getattr(error, 'context_mark', None)
        if mark and any(word in context for word in ('anchor', 'alias', 'tag', 'scalar', 'flow')):
            place = mark.index + self._shift
        elif self._line(last_scalar) != self._line(place) and 'mapping values' in str(error):
            place = last_scalar  # a plain text of several lines that has a colon
        line_start = self._source.text.rfind('\n', 0, place) + 1
        match = _VALUE_LINE.match(self._source.text, line_start)
        return match.end() if match and match.end() <= place else None

    def _line(self, place: int) -> int:
        return self._source.position(place)[0]

    def _tell_value(self, error: yaml.YAMLError, start: int, place: int) -> None:
        text = self._source.text
        problem = getattr(error, 'problem', None) or ''
        if text[start] in '"\'' and 'end of stream' in problem:
            self._problems.error('this quote is not closed',
                                 Span(self._source, start, start + 1), 'opened here')
        elif 'escape' in problem:
            self._problems.error(
                "a '\\' in double quotes starts an escape, and this is none",
                Span(self._source, place, place + 2), 'not an escape',
                'write two of them, or put the text in single quotes')
        elif self._line(place) != self._line(start) and text[start] not in _MARKS:
            self._problems.error(
                "there is a ': ' inside a text of several lines", Span(self._source, place,
                                                                       place + 1),
                f'the text begins in line {self._line(start)}',
                'put the text in quotes, or correct the indentation of this line')
        else:
            tell_misread(self._source, start, self._problems)

    def _blank(self, start: int) -> None:
        """Replace a value, and the lines that go on with it, by a plain word and blanks."""
        end = _line_end(self._source.text, start)
        base = _indentation(self._source.line(self._line(start)))
        while end < len(self._source.text):
            line_end = _line_end(self._source.text, end + 1)
            line = self._source.text[end + 1:line_end]
            if line.strip() and _indentation(line) <= base:
                break
            end = line_end
        old = self.text[start - self._shift:end - self._shift]
        new = 'x' + ''.join(char if char in '\r\n' else ' ' for char in old[1:])
        self.text = self.text[:start - self._shift] + new + self.text[end - self._shift:]
        self.unread |= {start}
        self._repairs += 1

    def _tell(self, error: yaml.YAMLError, place: int) -> None:
        problem = getattr(error, 'problem', None) or 'cannot be read'
        self._problems.error('not valid YAML', Span(self._source, place, place + 1),
                             problem.replace('did not find', 'no').replace('<', '').replace(
                                 '>', ''))
