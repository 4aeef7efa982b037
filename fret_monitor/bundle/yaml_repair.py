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
error gives the line to paste, and reading continues after the value.
"""

from collections.abc import Iterator
import re

from fret_monitor.model.diagnostics import Problems, Source, Span
from fret_monitor.model.names import index_fault
import yaml

_MAX_REPAIRS = 50
_MAX_LINES = 30  # of a value in braces
_MAX_PASTED = 2000
_MAX_READ = 2 ** 26  # characters in total, a limit for many repairs of a huge file

_VALUE_LINE = re.compile(
    r"""[ \t]*(?:-[ ]+)*(?P<key>[A-Za-z_][^:#'"\[\]{},]*|"[^"]*"|'[^']*')[ \t]*:[ \t]+(?=\S)""")
_CLOSERS = {'(': ')', '[': ']', '{': '}'}
_FLOW_KEY = re.compile(r'[{,][ \t]*[A-Za-z_]\w*[ \t]*:[ \t]+(?=\S)')
_OPEN_INDEX = re.compile(r'\[[0-9]+$')
_NEXT_KEY = re.compile(r',[ \t]*[A-Za-z_]\w*[ \t]*:(?:[ \t]|$)')

_LACKS_COMMA = re.compile(
    r"""(?:"[^"]*"|'[^']*'|[^\s,:{}"']+)(?P<gap>\s+)"""
    r'(?P<key>topic|type|field|initial|values|role|qos|timeout|stale|startup|max_rate'
    r'|fretish|ptltl|cocospec|title|report|severity|assume):\s')
_BRACE_KEY = re.compile(r'[{,]\s*[A-Za-z_]\w*[ \t]*:[ \t]+(?=\S)')
# Their values have no space, so that a word after one is a key.
_KEY_BEFORE = re.compile(
    r'\b(?:topic|type|field|initial|role|timeout|stale|startup|max_rate|id|report|severity'
    r'|assume)'
    r'[ \t]*:[ \t]+$')

_MARKS = {
    '!': 'starts a tag', '&': 'starts an anchor', '*': 'starts an alias', '#': 'starts a comment',
    '|': 'starts a block of lines', '>': 'starts a folded block', '[': 'starts a list',
    '{': 'starts a mapping', '%': 'starts a directive', '@': 'is reserved', '`': 'is reserved',
    '-': 'starts a list', '?': 'starts a key', ':': 'ends a key', ',': 'parts items',
    ']': 'ends a list', '}': 'ends a mapping',
}


LACKS_SPACE = re.compile(r'[ ]*(?:-[ ]+)*([A-Za-z_]\w*):(?=[^\s/:]|/[^/])[^\r\n]*')
"""A line with a key and a value, but no space between them."""
_KEY_LINE = re.compile(r'[ ]+([A-Za-z_]\w*)(?=:(?:[ ]|$))')


def report_lacking_space(match: re.Match[str], span: Span, problems: Problems) -> None:
    """Report `key:value`, which `LACKS_SPACE` matches, at its place."""
    key, value = match[0][match.start(1):].split(':', 1)
    problems.error("a space is missing after the ':'", span, 'YAML reads this as a text',
                   f'{key}: {value.strip()}')


def report_misread(source: Source, start: int, problems: Problems) -> None:
    """Report that the value that starts at `start` needs quotes, with the line to paste."""
    written = _OPEN_INDEX.sub(r'\g<0>]', value_as_written(source, start))
    fault = index_fault(written)
    if fault is not None and re.search(r'\bfield[ \t]*:[ \t]*$', source.text[:start][-99:]):
        problems.error(fault.reason, Span(source, start, start + len(written)), 'not supported',
                       fault.help)
        return
    first = source.text[start]
    quotes = first in '"\''
    if quotes:
        title = 'text follows the closing quote'
    elif first in _MARKS:
        title = f"'{first}' {_MARKS[first]} in YAML"
    elif re.search(r':(?:\s|$)', written):
        title = "a ':' ends a key in YAML"
    else:
        title = 'YAML cannot read this as text'
    label = 'put quotes around all of it' if quotes else 'put it in quotes'
    if _has_nested_quotes(written):
        label, written = 'the text has the same quotes within', _unwrapped(written)
    end = min(_line_end(source.text, start), _value_end(source, start))
    problems.error(title, Span(source, start, start + len(source.text[start:end].rstrip())),
                   label, quoted_line(source, start, written))


def _has_nested_quotes(written: str) -> bool:
    """
    Return whether a value is a text in quotes with the same quotes within: `"a = "b" & c"`.

    Then the second quote opens. In `"a" & "b"`, two names of a formula, it closes.
    """
    quote = written[0]
    return quote in '"\'' and written.endswith(quote) and written.count(quote) % 2 == 0 \
        and re.match(rf'{quote}[^{quote}]*{quote}\w', written) is not None


def _unwrapped(written: str) -> str:
    """Return a text without its quotes; a name that it looks up gets double quotes."""
    return re.sub(r"=\s*'([^'\"]*)'\s*\]", r'= "\1"]', written[1:-1])


def value_as_written(source: Source, start: int) -> str:
    """Return what the user seems to have meant as the value that starts at `start`."""
    lines = source.text[start:_value_end(source, start)].splitlines()
    return ' '.join(line.strip() for line in lines if line.strip())


def _value_end(source: Source, start: int) -> int:
    """Return where the value ends that starts at `start`, by indentation or within braces."""
    if _is_in_braces(source, start):
        return start + _flow_length(source.text[start:_line_end(source.text, start)])
    base = _indentation(source.line(source.position(start)[0]))
    end = found = _line_end(source.text, start)
    while end < len(source.text):
        begin, end = end + 1, _line_end(source.text, end + 1)
        line = source.text[begin:end]
        if line.strip() and (_indentation(line) <= base or line.lstrip().startswith('#')):
            break
        found = end if line.strip() else found
    return found


def _is_in_braces(source: Source, start: int) -> bool:
    """Return whether a brace is open at `start`, in its line or those that contain it."""
    number = source.position(start)[0]
    before = source.line(number)[:source.position(start)[1] - 1]
    base = _indentation(before) if before.strip() else start
    first = max(number - _MAX_LINES, 1)
    while number > first and base > 0:
        number -= 1
        line = source.line(number)
        before = f'{line}\n{before}'
        if line.strip() and _indentation(line) < base:
            break
    return any(before.count(left) > before.count(right) for left, right in ('{}', '[]'))


def _flow_length(rest: str) -> int:
    """Return the length of a value within braces: up to the closing brace or the next key."""
    opened: list[str] = []
    for place, char in enumerate(rest):
        if char in '([{':
            opened.append(_CLOSERS[char])
        elif opened and char == opened[-1]:
            opened.pop()
        elif char in ']}' or char == ',' and not opened and _NEXT_KEY.match(rest, place):
            return len(rest[:place].rstrip())
    return len(rest.rstrip().removesuffix(',').rstrip())


def _closed(value: str) -> str:
    """Return the opening brackets that are all closed."""
    return ''.join(left for left, right in _CLOSERS.items()
                   if value.count(left) <= value.count(right))


def quoted_line(source: Source, start: int, value: str) -> str:
    """Return `key: "value"` for the value at `start`, to be pasted; '' for a very long one."""
    if len(value) > _MAX_PASTED:
        return ''
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


class YamlRepair:
    """
    Continues reading after values that YAML cannot read.

    Such a value is reported and replaced by a word of the same length, so that places stay valid.
    `unread` are the places of such values; those in `swallowing` included keys below them.
    """

    def __init__(self, source: Source, problems: Problems) -> None:
        self._source = source
        self._problems = problems
        self._shift = 1 if source.text.startswith('\ufeff') else 0
        self.text = source.text[self._shift:]
        self.unread: frozenset[int] = frozenset()
        self.swallowing: frozenset[int] = frozenset()

    def mend(self, error: yaml.YAMLError, last_scalar: int) -> bool:
        """Report an error of YAML; return whether the changed text can be read again."""
        place = min(self._place(error), max(len(self._source.text) - 1, 0))
        if (self._is_tab(place) or self._lacks_space(error, place)
                or self._lacks_comma_above(error)):
            return False
        starts = self._value_starts(error, place, last_scalar)
        start = next((item for item in starts if item not in self.unread), None)
        limit = min(_MAX_REPAIRS, _MAX_READ // max(len(self.text), 1))
        if start is None or len(self.unread) >= limit:
            self._report(error, place)
            return False
        if not self._lacks_comma(start):
            self._report_value(error, start, place)
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
            self._problems.error('YAML cannot be indented with tabs',
                                 Span(self._source, match.start(1), match.end(1)),
                                 'use spaces here')
        return match is not None

    def _lacks_space(self, error: yaml.YAMLError, at: int) -> bool:
        """Report `key:value` in the line above, which YAML reads as a text."""
        if 'mapping values' not in str(error):
            return False
        number = self._line(at) - 1
        while number > 0 and not self._source.line(number).strip():
            number -= 1
        match = LACKS_SPACE.match(self._source.line(number)) if number else None
        if match is None:
            return False
        start = self._source.line_start(number)
        place = Span(self._source, start + match.start(1), start + match.end())
        report_lacking_space(match, place, self._problems)
        return True

    def _lacks_comma_above(self, error: yaml.YAMLError) -> bool:
        """Report a missing comma at the end of a line within braces."""
        opened, place = (getattr(error, name, None) for name in ('context_mark', 'problem_mark'))
        if not opened or not place or "',' or '}'" not in str(error):
            return False
        keys = [*_BRACE_KEY.finditer(self._source.text, opened.index + self._shift,
                                     place.index + self._shift)]
        match = _LACKS_COMMA.match(self._source.text, keys[-1].end()) if keys else None
        return match is not None and '\n' in match['gap'] and self._lacks_comma(keys[-1].end())

    def _lacks_comma(self, start: int) -> bool:
        """Report a key within braces that follows a value without a comma."""
        match = _LACKS_COMMA.match(self._source.text, start)
        before = _KEY_BEFORE.search(self._source.text, max(start - _MAX_PASTED, 0), start)
        if match is None or before is None or not _is_in_braces(self._source, start):
            return False
        self.swallowing |= {start}
        value, key = match[0][:match.start('gap') - start], match['key']
        self._problems.error(f"a comma is missing before '{key}'",
                             Span(self._source, match.start('key'), match.end('key')),
                             'the key after a value in braces',
                             f'{before[0]}{value}, {key}: ...')
        return True

    def _value_starts(self, error: yaml.YAMLError, place: int,
                      last_scalar: int) -> Iterator[int]:
        """Yield the starts of values that may be the cause, the most likely first."""
        context = getattr(error, 'context', None) or ''
        mark = getattr(error, 'context_mark', None)
        last = place
        if mark and any(word in context for word in ('anchor', 'alias', 'tag', 'scalar', 'flow')):
            place = min(mark.index + self._shift, last)
        elif self._line(last_scalar) != self._line(place) and 'mapping values' in str(error):
            place = last_scalar  # a plain text of several lines that has a colon
        if 'flow' in context:
            yield from self._within_braces(place, last)
        elif any(word in context for word in ('anchor', 'alias', 'tag')):
            # `{ptltl: !p}`: the brace is read as a part of the tag.
            keys = _FLOW_KEY.finditer(
                self._source.text, self._source.line_start(self._line(place)), place + 1)
            yield from [key.end() for key in keys][-1:]
        line_start = self._source.text.rfind('\n', 0, place) + 1
        match = _VALUE_LINE.match(self._source.text, line_start)
        if match and match.end() <= place:
            yield match.end()

    def _within_braces(self, opened: int, place: int) -> Iterator[int]:
        """Yield the starts of values between the bracket at `opened` and `place`."""
        line_start = self._source.text.rfind('\n', 0, place) + 1
        if self._source.text[opened] == '[':  # the cause is the list itself
            keys = _FLOW_KEY.finditer(
                self._source.text, self._source.text.rfind('\n', 0, opened) + 1, opened)
            yield from (key.end() for key in keys if key.end() == opened)
            return
        keys = _FLOW_KEY.finditer(self._source.text, max(opened, line_start), place + 1)
        yield from [key.end() for key in keys][-1:]
        match = _VALUE_LINE.match(self._source.text, line_start)
        if match and opened < line_start and match.end() <= place and _indentation(
                match[0]) > _indentation(self._source.line(self._line(opened))):
            yield match.end()

    def _line(self, place: int) -> int:
        return self._source.position(place)[0]

    def _report_value(self, error: yaml.YAMLError, start: int, place: int) -> None:
        text = self._source.text
        problem = getattr(error, 'problem', None) or ''
        if text[start] in '"\'' and 'end of stream' in problem:
            self._problems.error('this quote is not closed',
                                 Span(self._source, start, start + 1), 'opened here')
        elif text[start] in '[{' and text[start] not in _closed(
                value_as_written(self._source, start)):
            self._problems.error(f"this '{text[start]}' is not closed",
                                 Span(self._source, start, start + 1), 'opened here')
        elif _FLOW_KEY.match(text, start):
            self._problems.error('these braces cannot be read',
                                 Span(self._source, start, start + 1),
                                 'look at the brackets, commas and colons within them')
        elif 'escape' in problem:
            self._problems.error(
                "a '\\' in double quotes must start an escape sequence",
                Span(self._source, place, place + 2), 'this is not an escape sequence',
                'write two backslashes, or put the text in single quotes')
        elif self._line(place) != self._line(start) and text[start] not in _MARKS:
            self.swallowing |= {start}
            if self._is_too_deep(start, place):
                return
            self._problems.error(
                "a text of several lines contains ': '",
                Span(self._source, place, place + 1),
                f'the text begins in line {self._line(start)}',
                'put the text in quotes, or correct the indentation of this line')
        else:
            report_misread(self._source, start, self._problems)

    def _is_too_deep(self, start: int, place: int) -> bool:
        """Report a key that is indented deeper than the key above, and so is part of its value."""
        key = _KEY_LINE.match(self._source.line(self._line(place)))
        above = _VALUE_LINE.match(self._source.line(self._line(start)))
        begin = self._source.line_start(self._line(place))
        is_word = ' ' not in self._source.text[start:begin].strip()
        if key is None or above is None or begin + key.end(1) != place or not is_word:
            return False
        rest = self._source.line(self._line(place)).strip()
        line = ' ' * above.start('key') + rest
        self._problems.error(
            'this key is indented deeper than the one above',
            Span(self._source, begin + key.start(1), place),
            f'so YAML reads it as part of the text of line {self._line(start)}',
            f'indent it like {above["key"].strip()!r}, or put that text in quotes:\n{line}')
        return True

    def _blank(self, start: int) -> None:
        """Replace a value, including its further lines, by a word and blanks."""
        begin, end = start - self._shift, _value_end(self._source, start) - self._shift
        blanks = ''.join(char if char in '\r\n' else ' ' for char in self.text[begin + 1:end])
        self.text = f'{self.text[:begin]}x{blanks}{self.text[end:]}'
        self.unread |= {start}

    def _report(self, error: yaml.YAMLError, place: int) -> None:
        problem = getattr(error, 'problem', None) or 'this cannot be read'
        context = getattr(error, 'context', None) or ''
        mark = getattr(error, 'context_mark', None)
        if mark and ('simple key' in context or 'flow' in context):
            place = mark.index + self._shift
        label = next((label for part, label in _PROBLEMS if part in f'{context} {problem}'),
                     problem)
        self._problems.error('not valid YAML', Span(self._source, place, place + 1), label)


# Messages of libyaml and PyYAML, each with a label for the user.
_PROBLEMS = (
    ('flow sequence', 'this list is not closed'),
    ('flow mapping', 'this brace is not closed'),
    ("expected ':'", "a ':' is missing after this key"),
    ('expected key', 'expected a key: indent it like those above'),
    ('expected <block end>', 'expected a key: indent it like those above'),
    ('mapping values', "a ':' is not allowed here"),
    ("expected '-'", "expected a '-', or indent it like the key after the '-' above"),
    ('document start', 'text follows the end of the document'),
)
