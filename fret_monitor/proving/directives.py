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
C text held to what `compile` writes where a compiler could see something else than the proof.

The proof preprocesses without the macros and words of a compiler. So the preprocessor's lines have
to be those that `compile` writes, in their order; what stands under a condition is as it was; and
the rest, which may differ, has no word that belongs to a compiler.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import zip_longest
import re
from typing import NoReturn

from fret_monitor.proving.c_source import Unreadable

_TRIGRAPH = re.compile(r"\?\?[=/'()!<>-]")
_CONTROL = re.compile(r'[^\t\n\x20-\x7e\x80-\U0010ffff]')
_SPLICE = re.compile(r'\\[ \t]*$')
_COMMENT_OR_STRING = re.compile(r'//.*|/\*|"(?:\\.|[^"\\])*"|\'(?:\\.|[^\'\\])*\'')
# Digraphs, quotes without an end, strings with a prefix, universal character names.
_STRANGE = re.compile(r'<:|:>|<%|%>|%:|["\'\\]|\w\0')
_WORD = re.compile(r'(?<!\w)[A-Za-z_]\w*')
_OF_COMPILERS = re.compile(
    '_[A-Z_].*|alignas|alignof|asm|auto|constexpr|goto|register|restrict|thread_local|typeof.*'
    '|volatile')
_HEAD = re.compile(r'#define \w+\([^)]*\)')


@dataclass(frozen=True)
class _Line:
    """A line after splicing and without comments; the number is that of its first line."""

    number: int
    text: str
    is_spliced: bool = False

    @property
    def is_directive(self) -> bool:
        return self.text.startswith('#')


@dataclass
class _Section:
    """A directive, and the code up to the next; the first section has no directive."""

    directive: _Line
    code: list[_Line] = field(default_factory=list)


def require_same_directives(texts: Mapping[str, str], written: Mapping[str, str]) -> None:
    """
    Hold C files to what `compile` writes, but for their plain code; both by file name.

    Raises
    ------
    Unreadable
        with the file and line, and what it is.
    """
    for name, text in texts.items():
        if name in written:
            _File(name).compare(text, written[name])


class _File:

    def __init__(self, name: str) -> None:
        self._name = name

    def compare(self, text: str, written: str) -> None:
        found, wanted = self._sections(text), self._sections(written)
        known = {word for section in wanted
                 for line in _plain(section, section.directive.is_spliced)
                 for word in _WORD.findall(_without_strings(line.text))}
        depth, outer = 0, _depth_of_code(wanted)
        for one, other in zip_longest(found, wanted):
            if other is None:
                self._refuse(one.directive, 'compile writes no such line')
            if one is None:
                self._refuse(found[-1].directive, f'`{other.directive.text}` is not there')
            self._require_directive(one.directive, other.directive)
            depth += _step(other.directive)
            if depth > outer or not other.code:
                self._require_code(one, other)
            self._require_words(_plain(one, other.directive.is_spliced), known)

    def _refuse(self, line: _Line, what: str) -> NoReturn:
        raise Unreadable(f'{self._name}:{line.number}: {what}: {line.text[:80]}')

    def _require_directive(self, found: _Line, wanted: _Line) -> None:
        if found.text == wanted.text:
            return
        # The body of a macro of several lines is code like any other.
        if not wanted.is_spliced or _head(found) != _head(wanted):
            self._refuse(found, f'compile writes `{wanted.text[:40]}` here')

    def _require_code(self, found: _Section, wanted: _Section) -> None:
        for one, other in zip_longest(found.code, wanted.code):
            if one is None or other is None or one.text != other.text:
                self._refuse(one or found.directive,
                             'no code of `compile` under a condition, or between its lines '
                             'for the preprocessor')

    def _require_words(self, lines: Iterator[_Line], known: set[str]) -> None:
        for line in lines:
            text = _without_strings(line.text)
            if _STRANGE.search(text) or not text.isascii():
                self._refuse(line, 'not written as `compile` writes C')
            for word in _WORD.findall(text):
                if _OF_COMPILERS.fullmatch(word) and word not in known:
                    self._refuse(line, f'`{word}` is not a word of `compile`')

    def _sections(self, text: str) -> list[_Section]:
        sections = [_Section(_Line(1, ''))]
        for line in self._lines(text):
            if line.is_directive:
                sections.append(_Section(line))
            elif line.text:
                sections[-1].code.append(line)
        return sections

    def _lines(self, text: str) -> Iterator[_Line]:
        waiting: list[str] = []
        for number, raw in enumerate(text.split('\n'), 1):
            here = _Line(number, raw)
            if _TRIGRAPH.search(raw):
                self._refuse(here, 'a trigraph')
            if _CONTROL.search(raw):
                self._refuse(here, f'a control character, {_CONTROL.findall(raw)[0]!r}')
            is_first = not waiting
            waiting.append(raw.removesuffix('\\'))
            if raw.endswith('\\') and (raw.startswith('#define ') or not is_first) \
                    and raw.endswith((' \\', '\t\\')):
                continue
            if _SPLICE.search(raw):
                self._refuse(here, 'a line that a backslash continues')
            yield self._bare(number - len(waiting) + 1, ''.join(waiting), len(waiting) > 1)
            waiting = []
        if waiting:
            self._refuse(here, 'a line that a backslash continues')

    def _bare(self, number: int, raw: str, is_spliced: bool) -> _Line:
        def kept(found: re.Match[str]) -> str:
            if found[0] == '/*':
                self._refuse(_Line(number, raw), '`compile` writes comments with `//`')
            return ' ' if found[0].startswith('//') else found[0]
        return _Line(number, ' '.join(_COMMENT_OR_STRING.sub(kept, raw).split()), is_spliced)


def _step(directive: _Line) -> int:
    """Return by how much a directive makes conditions deeper."""
    return directive.text.startswith('#if') - directive.text.startswith('#endif')


def _depth_of_code(sections: list[_Section]) -> int:
    """Return how deep code lies that is under no condition: 1 with an include guard."""
    name = sections[1].directive.text.removeprefix('#ifndef ') if len(sections) > 2 else ''
    return int(bool(name) and sections[2].directive.text == f'#define {name}')


def _head(line: _Line) -> str | None:
    found = _HEAD.match(line.text)
    return found[0] if found else None


def _plain(section: _Section, is_macro: bool) -> Iterator[_Line]:
    """Yield the code of a section: also what a macro of several lines stands for."""
    if is_macro:
        yield _Line(section.directive.number, _HEAD.sub('', section.directive.text, count=1))
    yield from section.code


def _without_strings(text: str) -> str:
    """Return code with a NUL for each string."""
    return _COMMENT_OR_STRING.sub('\0', text)
