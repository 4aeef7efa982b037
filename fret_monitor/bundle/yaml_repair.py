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
Finds and reports values that YAML cuts or misreads because they are not in quotes.

In YAML a formula such as `!p & q`, `a: b` or `[x] > 3` is invalid or has another meaning. The
error gives the line to paste, and reading continues after the value. Other errors of YAML get
their place and a label, and end the reading.
"""

import re

from fret_monitor.model.diagnostics import Problems, Source, Span, Text
from fret_monitor.model.names import shown
import yaml

_MAX_REPAIRS = 50
_MAX_VALUE = 2000  # characters of a line to paste, and before a value for its key and brace
_MAX_READ = 2 ** 26  # characters in total, a limit for many repairs of a huge file

_KEY = re.compile(
    r"""(?:^[ \t]*(?:-[ ]+)*|[{,][ \t]*)(?:[A-Za-z_][^:#'"\[\]{},\n]*|"[^"\n]*"|'[^'\n]*')"""
    r'[ \t]*:[ \t]+(?=\S)', re.MULTILINE)
_NEXT_KEY = re.compile(r',[ \t]*[A-Za-z_]\w*[ \t]*:(?:[ \t]|$)')
_TAB = re.compile(r'[ ]*(?:-[ ]*)*(\t)')
_QUOTE_WITHIN = re.compile(r"""(?:"[^"]*"|'[^']*')\w""")
_ITEM = re.compile('^ *- ', re.MULTILINE)
_CLOSERS = {'(': ')', '[': ']', '{': '}'}
_MARKS = {
    '!': 'starts a tag', '&': 'starts an anchor', '*': 'starts an alias', '#': 'starts a comment',
    '|': 'starts a block of lines', '>': 'starts a folded block', '[': 'starts a list',
    '{': 'starts a mapping', '%': 'starts a directive', '@': 'is reserved', '`': 'is reserved',
    '-': 'starts a list', '?': 'starts a key',
}
# Messages of libyaml and PyYAML, each with a label for the user.
_LABELS = {
    'flow mapping': 'this brace is not closed',
    "expected ':'": "a ':' is missing after this key",
    'expected key': 'expected a key: indent it like those above',
    'expected <block end>': 'expected a key: indent it like those above',
    'mapping values': "a ':' is not allowed here: indent this line like the key above, "
                      'or put the text in quotes',
    "expected '-'": "expected a '-', or indent it like the key after the '-' above",
    'escape': 'write two backslashes, or put the text in single quotes',
}


LACKS_SPACE = re.compile(r'[ ]*(?:-[ ]+)*([A-Za-z_]\w*):(?=[^\s/:]|/[^/])[^\r\n]*')
"""A line with a key and a value, but no space between them."""


def report_lacking_space(match: re.Match[str], span: Span, problems: Problems) -> None:
    """Report `key:value`, which `LACKS_SPACE` matches, at its place."""
    key, value = match.string[match.start(1):match.end()].split(':', 1)
    problems.error("a space is missing after the ':'", span, 'YAML reads this as a text',
                   f'{key}: {value.strip()}')


def report_misread(source: Source, start: int, problems: Problems) -> None:
    """Report that the value that starts at `start` needs quotes, with the line to paste."""
    written = value_as_written(source, start)
    label, help_ = 'put it in quotes', quoted_line(source, start, written)
    has_colon = re.search(r':(?:\s|$)', written)
    if written[0] in '"\'':
        title, label = 'text follows the closing quote', 'put quotes around all of it'
        if _QUOTE_WITHIN.match(written):
            label, help_ = 'the quotes around a text must differ from those within', ''
    elif written[0] in _MARKS:
        title = f"'{written[0]}' {_MARKS[written[0]]} in YAML"
    else:
        title = "a ':' ends a key in YAML" if has_colon else 'YAML cannot read this as text'
    if has_colon and written[0] not in _MARKS and _is_in_braces(source, start):
        label, help_ = 'put all of it in quotes, or add the missing comma', ''
    shown = source.text[start:_value_end(source, start)].partition('\n')[0].rstrip()
    problems.error(title, Span(source, start, start + len(shown)), label, help_)


def report_comma(key: Text, span: Span, problems: Problems) -> None:
    """Report the value of a key in braces that a comma cuts; `span` is what YAML read of it."""
    written = value_as_written(span.source, span.start)
    problems.error('a comma ends a value in braces', span,
                   f'put the value of {shown(key.value)} in quotes',
                   quoted_line(span.source, span.start, written))


def value_as_written(source: Source, start: int) -> str:
    """Return what the user seems to have meant as the value that starts at `start`."""
    return re.sub(r'\s*\n\s*', ' ', source.text[start:_value_end(source, start)].rstrip())


def quoted_line(source: Source, start: int, value: str) -> str:
    """Return `key: "value"` for the value at `start`, to be pasted; '' for a very long one."""
    if len(value) > _MAX_VALUE:
        return ''
    keys = _keys_before(source.text, start)
    key = keys[-1][0].strip(' \t{,') if keys and keys[-1].end() == start else ''
    if '"' not in value and '\\' not in value:
        return f'{key} "{value}"'.strip()
    return f"{key} '{value.replace(chr(39), chr(39) * 2)}'".strip()


def _keys_before(text: str, place: int) -> list[re.Match[str]]:
    """Return the keys with a value in the line of `place`, up to a value that starts there."""
    return [*_KEY.finditer(text, max(_line_start(text, place), place - _MAX_VALUE), place + 1)]


def _value_end(source: Source, start: int) -> int:
    """Return where the value ends that starts at `start`, by indentation or within braces."""
    number, column = source.position(start)
    line = source.line(number)
    if _is_in_braces(source, start):
        return start + _flow_length(line[column - 1:])
    deeper = len(line) - len(line.lstrip(' -')) + 1
    more = re.compile(rf'\r*\n(?:[ \t\r]*\n)*+[ ]{{{deeper},}}(?![\s#])[^\n]*')
    end = source.line_start(number) + len(line)
    while match := more.match(source.text, end):
        end = match.end()
    return end


def _is_in_braces(source: Source, start: int) -> bool:
    """Return whether a brace is open at `start`, in its line or those that contain it."""
    *above, line = source.text[max(start - _MAX_VALUE, 0):start].split('\n')
    outer = next((number for number, text in reversed([*enumerate(above)])
                  if text.strip() and _indentation(text) < _indentation(line)), len(above))
    before = '\n'.join([*above[outer:], line])
    return any(before.count(left) > before.count(right) for left, right in ('{}', '[]'))


def _flow_length(rest: str) -> int:
    """Return the length of a value within braces: up to the closing brace or the next key."""
    opened: list[str] = []
    for place, char in enumerate(rest):
        if char in _CLOSERS:
            opened.append(_CLOSERS[char])
        elif opened and char == opened[-1]:
            opened.pop()
        elif char in ']}' or char == ',' and not opened and _NEXT_KEY.match(rest, place):
            return len(rest[:place].rstrip())
    return len(rest.rstrip().removesuffix(',').rstrip())


def _indentation(line: str) -> int:
    return len(line) - len(line.lstrip(' '))


def _line_start(text: str, place: int) -> int:
    return text.rfind('\n', 0, place) + 1


class YamlRepair:
    """
    Continues reading after values that YAML cannot read.

    Such a value is reported and replaced by a word of the same length, so that places stay valid.
    `unread` are the places of such values.
    """

    def __init__(self, source: Source, problems: Problems) -> None:
        self._source = source
        self._problems = problems
        self._shift = 1 if source.text.startswith('\ufeff') else 0
        self.text = source.text[self._shift:]
        self.unread: frozenset[int] = frozenset()

    def mend(self, error: yaml.YAMLError) -> bool:
        """Report an error of YAML; return whether the changed text can be read again."""
        fault = f"{getattr(error, 'context', None) or ''} {getattr(error, 'problem', None) or ''}"
        mark = getattr(error, 'problem_mark', None)
        context = getattr(error, 'context_mark', None) or mark
        place = min((mark.index if mark else 0) + self._shift, len(self._source.text) - 1)
        opened = min(context.index + self._shift if context else place, place)
        if self._is_tab(place) or self._lacks_space(fault, place):
            return False
        start = self._value_start(fault, opened, place)
        limit = min(_MAX_REPAIRS, _MAX_READ // max(len(self.text), 1))
        if start is None or len(self.unread) >= limit or 'escape' in fault:
            at = opened if 'simple key' in fault or 'flow' in fault else place
            label = next((text for part, text in _LABELS.items() if part in fault), fault.strip())
            text = self._source.text
            if 'expected' in fault and text.startswith('- ', place) and _ITEM.search(
                    text, 0, place):
                label = "indent this '-' like the '-' above"
            self._error('not valid YAML', at, label)
            return False
        self._report_value(fault, start, place)
        self._blank(start)
        return True

    def _error(self, title: str, place: int, label: str) -> None:
        self._problems.error(title, Span(self._source, place, place + 1), label)

    def _is_tab(self, place: int) -> bool:
        match = _TAB.match(self._source.text, _line_start(self._source.text, place))
        if match:
            self._error('YAML cannot be indented with tabs', match.start(1), 'use spaces here')
        return match is not None

    def _lacks_space(self, fault: str, place: int) -> bool:
        """Report `key:value` in the line above, which YAML reads as a text."""
        end = len(self._source.text[:_line_start(self._source.text, place)].rstrip())
        match = LACKS_SPACE.match(self._source.text, _line_start(self._source.text, end))
        if match is None or 'mapping values' not in fault:
            return False
        span = Span(self._source, match.start(1), match.end())
        report_lacking_space(match, span, self._problems)
        return True

    def _value_start(self, fault: str, opened: int, place: int) -> int | None:
        """Return the start of the value that is most likely the cause."""
        text = self._source.text
        lines = [_line_start(text, opened), _line_start(text, place)]
        is_within = lines[0] == lines[1] or _indentation(text[lines[0]:opened]) < _indentation(
            text[lines[1]:place])
        places = [opened] if re.search('anchor|alias|tag|scalar|flow', fault) else [place]
        if 'flow mapping' in fault and is_within:
            places = [place, opened]
        return next((key.end() for at in places for key in reversed(_keys_before(text, at))
                     if key.end() not in self.unread
                     and text.count('}', key.end(), at) <= text.count('{', key.end(), at)), None)

    def _report_value(self, fault: str, start: int, place: int) -> None:
        text = self._source.text
        written = value_as_written(self._source, start)
        unclosed = next((left for left, right in ('[]', '{}')
                         if written.count(left) > written.count(right)), '')
        if text[start] in '"\'' and 'end of stream' in fault:
            self._error('this quote is not closed', start, 'opened here')
        elif text[start] not in '"\'' and unclosed:
            self._error(f"this '{unclosed}' is not closed", text.index(unclosed, start),
                        'opened here')
        elif _KEY.match(text, start):
            self._error('these braces cannot be read', place,
                        'look for a missing comma or bracket before this')
        else:
            report_misread(self._source, start, self._problems)

    def _blank(self, start: int) -> None:
        """Replace a value, including its further lines, by a word and blanks."""
        begin, end = start - self._shift, _value_end(self._source, start) - self._shift
        blanks = ''.join(char if char in '\r\n' else ' ' for char in self.text[begin + 1:end])
        self.text = f'{self.text[:begin]}x{blanks}{self.text[end:]}'
        self.unread |= {start}
