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
Errors and warnings about what a user wrote, with the place in the source and a caret.

Every stage that reads what a user wrote reports through `Diagnostic`, with the place as a `Span`
of a `Source`. A stage collects as many as it can in a `Problems` and raises one `CompileError`.
A user's mistake is a `CompileError`; any other exception is a bug in this program.
"""

from bisect import bisect_right
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
import shlex
import sys
import sysconfig
from typing import NoReturn, TypeAlias
from unicodedata import east_asian_width

_MAX_SHOWN = 160
UNKNOWN_CONSTANT = 'the value of an unknown constant'  # a label

# Similarities of two words, as `difflib` counts them: a letter more or less in eight gives 0.93.
SIMILAR = 0.6  # where one of the known words must be meant
TYPO = 0.8  # where another, unknown word may be meant: `sin` is not a misspelt `min`


@dataclass(frozen=True, eq=False)
class Source:
    """A text with a name: the file name that the user gave, or a label such as `<sentence>`."""

    name: str
    text: str

    @cached_property
    def _line_starts(self) -> list[int]:
        starts = [0]
        starts.extend(i + 1 for i, char in enumerate(self.text) if char == '\n')
        return starts

    def position(self, offset: int) -> tuple[int, int]:
        """Return line and column, both from 1, of a character offset."""
        line = bisect_right(self._line_starts, offset)
        return line, offset - self._line_starts[line - 1] + 1

    def line_start(self, number: int) -> int:
        """Return the offset at which a line begins; lines are numbered from 1."""
        return self._line_starts[number - 1]

    def line(self, number: int) -> str:
        """Return the text of a line without its line end; lines are numbered from 1."""
        start = self.line_start(number)
        end = self.text.find('\n', start)
        return self.text[start:len(self.text) if end < 0 else end].rstrip('\r')


@dataclass(frozen=True)
class Span:
    """A range of characters of a source: `start` inclusive, `end` exclusive."""

    source: Source
    start: int
    end: int

    @property
    def line(self) -> int:
        """Line of the start, from 1."""
        return self.source.position(self.start)[0]

    @property
    def column(self) -> int:
        """Column of the start, from 1, in characters."""
        return self.source.position(self.start)[1]

    @property
    def written(self) -> str:
        """The characters, on one line."""
        return ' '.join(self.source.text[self.start:self.end].split())


@dataclass(frozen=True, eq=False)
class Text:
    """
    A piece of text with the place of each of its characters in a source.

    The value of a folded, quoted or escaped YAML scalar differs from the text of the file.
    `offsets[i]` is the place in `source.text` of `value[i]`, and `offsets[len(value)]` the place
    just after the last character, so that `len(offsets) == len(value) + 1`.
    """

    value: str
    source: Source
    offsets: Sequence[int]

    @classmethod
    def whole(cls, source: Source) -> 'Text':
        """Return the whole text of a source."""
        return cls(source.text, source, range(len(source.text) + 1))

    @property
    def span(self) -> Span:
        """The place of the whole text."""
        return self.at(0, len(self.value))

    def at(self, start: int, end: int) -> Span:
        """Return the place of the characters `start` to `end` (exclusive) of the value."""
        begin = self.offsets[start]
        last = self.offsets[end - 1] + 1 if end > start else begin
        return Span(self.source, begin, max(last, begin))

    def __str__(self) -> str:
        return self.value


Paint: TypeAlias = Callable[[str, str], str]
"""Returns a text in a style: `title`, `help`, or the value of a `Level`."""


def _plain(text: str, style: str) -> str:
    return text


class Level(Enum):
    """How serious a diagnostic is."""

    ERROR = 'error'
    WARNING = 'warning'


@dataclass(frozen=True)
class Diagnostic:
    """
    One problem, in the user's words.

    `title` is the mistake, `label` the text beside the caret, and `help` the way to correct it: a
    line to paste where possible. `span` is None if there is no place (the file does not exist).
    `related` is the other place that it is about, such as that of the first of two declarations.
    """

    title: str
    span: Span | None = None
    label: str = ''
    help: str = ''
    level: Level = Level.ERROR
    related: Span | None = None

    @property
    def in_one_line(self) -> str:
        """The same as `render`, in one line, without the line of the source."""
        place = '' if self.span is None else \
            f'{self.span.source.name}:{self.span.line}:{self.span.column}: '
        parts = [f'{place}{self.title}', self.label, ' '.join(self.help.split())]
        return printable('; '.join(part for part in parts if part))

    def render(self, paint: Paint = _plain) -> str:
        """Render as `file:line:column: error: title`, the line, a caret, and the help."""
        return '\n'.join(self._lines(paint))

    def _lines(self, paint: Paint) -> Iterable[str]:
        level = self.level.value
        title = f'{paint(f"{level}:", level)} {paint(_lines_of(self.title), "title")}'
        if self.span is None:
            yield title
            margin = ''
        else:
            line, column = self.span.source.position(self.span.start)
            yield f'{self.span.source.name}:{line}:{column}: {title}'
            margin = ' ' * len(str(line))
            yield from _excerpt(self.span, self.label, lambda text: paint(text, level))
        for number, text in enumerate(self.help.splitlines()):
            head = paint('= help:', 'help') if number == 0 else '       '
            yield f'{margin}   {head} {printable(text)}'


def _excerpt(span: Span, label: str, paint: Callable[[str], str]) -> Iterable[str]:
    line, column = span.source.position(span.start)
    text = printable(span.source.line(line))
    width = max(1, min(span.end - span.start, len(text) - column + 1))
    first = max(0, column - 1 - _MAX_SHOWN // 2) if len(text) > _MAX_SHOWN else 0
    shown = text[first:first + _MAX_SHOWN]
    head = '...' if first else ''
    tail = '...' if first + _MAX_SHOWN < len(text) else ''
    before = head + text[first:column - 1]
    marked = text[column - 1:min(column - 1 + width, first + _MAX_SHOWN)]
    pad = ' ' * _cells(before)
    carets = paint('^' * max(1, _cells(marked)))
    yield f' {line} | {head}{shown}{tail}'
    yield f' {" " * len(str(line))} | {pad}{carets} {printable(label)}'.rstrip()


def printable(text: str) -> str:
    """
    Replace each character that would shift a caret or control the terminal by one other.

    Texts of users go through it wherever they are printed on one line.
    """
    return ''.join(' ' if char == '\t' else char if char.isprintable() else '\ufffd'
                   for char in text)


def _lines_of(text: str) -> str:
    return '\n'.join(map(printable, text.split('\n')))


def _cells(text: str) -> int:
    return sum(2 if east_asian_width(char) in 'WF' else 1 for char in text)


class CompileError(Exception):
    """A mistake in what a user wrote; has at least one diagnostic, in the order found."""

    def __init__(self, diagnostics: Sequence[Diagnostic]) -> None:
        """Take at least one diagnostic."""
        self.diagnostics = tuple(diagnostics)
        super().__init__(self.diagnostics)

    def __str__(self) -> str:
        """Return all diagnostics as they are printed."""
        return '\n'.join(item.render() for item in self.diagnostics)


class Problems:
    """Collects diagnostics of one run, so that all problems of a file are reported together."""

    def __init__(self) -> None:
        """Start with none."""
        self._found: list[Diagnostic] = []

    def error(self, title: str, span: Span | None = None, label: str = '', help: str = '',
              related: Span | None = None) -> None:
        """Add an error."""
        self._found.append(Diagnostic(title, span, label, help, related=related))

    def warning(self, title: str, span: Span | None = None, label: str = '',
                help: str = '') -> None:
        """Add a warning, which refuses nothing."""
        self._found.append(Diagnostic(title, span, label, help, Level.WARNING))

    def extend(self, diagnostics: Iterable[Diagnostic]) -> None:
        """Add the diagnostics of another stage."""
        self._found.extend(diagnostics)

    @property
    def warnings(self) -> tuple[Diagnostic, ...]:
        """All warnings so far."""
        return tuple(item for item in self._found if item.level is Level.WARNING)

    @property
    def errors(self) -> tuple[Diagnostic, ...]:
        """All errors so far."""
        return tuple(item for item in self._found if item.level is Level.ERROR)

    def raise_errors(self) -> None:
        """Raise `CompileError` with all errors, by file and place, if there are any."""
        if self.errors:
            raise CompileError(by_place(self.errors))


def by_place(diagnostics: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Return diagnostics, each once, by file and place; those without a place first."""
    return tuple(sorted(dict.fromkeys(diagnostics), key=_place))


def _place(item: Diagnostic) -> tuple[str, int]:
    return (item.span.source.name, item.span.start) if item.span else ('', 0)


def refuse(title: str, span: Span | None = None, label: str = '', help: str = '') -> NoReturn:
    """Raise a `CompileError` of one diagnostic."""
    raise CompileError([Diagnostic(title, span, label, help)])


def counted(number: int, noun: str) -> str:
    """Return a number with its noun: `1 topic`, `2,000 topics`."""
    return f'{number:,} {noun}' if number == 1 else f'{number:,} {noun}s'


def close_matches(name: str, known: Iterable[str], similarity: float = SIMILAR) -> list[str]:
    """Return at most three of the known words: those with the most similar spelling."""
    from difflib import get_close_matches  # seldom needed, and not at a start
    return get_close_matches(name, list(known), n=3, cutoff=similarity)


def did_you_mean(name: str, known: Iterable[str], similarity: float = SIMILAR) -> str:
    """Return a help text that names the known words closest to `name`, or an empty string."""
    return suggestion(close_matches(name, known, similarity))


def suggestion(words: Iterable[str]) -> str:
    """Return a help text that offers the words, or an empty string if there are none."""
    shown = ' or '.join(f"'{word}'" for word in words)
    return f'did you mean {shown}?' if shown else ''


def require_packages(user: str, needed: Mapping[str, str]) -> None:
    """
    Refuse if a package is not installed that `user`, such as a verb, needs.

    `needed` has each module and the package that it comes from.
    """
    if missing := missing_packages(needed):
        refuse(f'{user} needs {" and ".join(missing)}, which '
               f'{"are" if len(missing) > 1 else "is"} not installed', help=pip_install(*missing))


def missing_packages(needed: Mapping[str, str]) -> list[str]:
    """Return those packages whose modules are not found."""
    return [package for module, package in needed.items() if find_spec(module) is None]


def pip_install(*packages: str) -> str:
    """
    Return the command that installs packages for the running Python interpreter.

    Outside of a virtual environment, pip refuses to install beside the packages of Debian, as
    PEP 668 describes, unless it is asked to; with `--user` it changes none of them.
    """
    is_managed = sys.prefix == sys.base_prefix and (
        Path(sysconfig.get_path('stdlib')) / 'EXTERNALLY-MANAGED').is_file()
    options = ['--user', '--break-system-packages'] if is_managed else []
    command = shlex.join([sys.executable, '-m', 'pip', 'install', *options, *packages])
    has_pip = find_spec('pip') is not None or not is_managed
    return command if has_pip else f'sudo apt install python3-pip && {command}'
