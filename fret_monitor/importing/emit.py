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
The YAML text of a draft, for people to read and for `parse_bundle` to parse.

Each text is written in the simplest form that preserves it: a word as a plain scalar, a short
text in quotes, a long text as a folded block, several lines as a literal block, and any other
text in double quotes with escapes. Manual tasks are comments at the end.
"""

from collections.abc import Iterator
import re
from textwrap import wrap

from fret_monitor.bundle.bundle import Language
from fret_monitor.importing.draft import Draft, DraftDefinition, DraftInput, DraftRequirement

_WIDTH = 96
_MOST_QUOTED = 10_000  # characters of what is left out
_WORD = re.compile(r'[A-Za-z_/~][A-Za-z0-9_./~%-]*')
_NUMBER = re.compile(r'-?[0-9]+(?:\.[0-9]+)?(?:[eE][+-]?[0-9]+)?')
# Other YAML parsers read these as Booleans or null.
_NOT_WORDS = frozenset({'y', 'n', 'yes', 'no', 'on', 'off', 'true', 'false', 'null', '~'})
_UNSAFE = re.compile('[^\x20-\x7e\xa0-\u2027\u202a-\ud7ff\ue000-\ufefe\uff00-\ufffd'
                     '\U00010000-\U0010ffff]')


def emit(draft: Draft) -> str:
    """Return the text of a bundle."""
    return '\n'.join(_lines(draft)) + '\n'


def _lines(draft: Draft) -> Iterator[str]:
    yield f'# From {", ".join(_comment(name) for name in draft.files)}, by fret-monitor import.'
    yield 'format: 1'
    if draft.component:
        yield f'component: {scalar(draft.component)}'
    yield from (f'{key}: {value}' for key, value in draft.keys)
    if draft.constants:
        yield 'constants:'
        yield from (f'  {scalar(name)}: {value}' for name, value in draft.constants)
    if draft.inputs:
        yield 'inputs:'
        for item in draft.inputs:
            yield from _input(item)
    if draft.definitions:
        yield 'definitions:'
        for definition in draft.definitions:
            yield from _definition(definition)
    yield from _times(draft)
    yield 'requirements:'
    for requirement in draft.requirements:
        yield from _requirement(requirement)
    yield from _left_out(draft)
    yield from _notes(draft)


def _times(draft: Draft) -> Iterator[str]:
    """Offer the policy timed where durations have units of time."""
    if draft.times is None:
        return
    ids = ', '.join(draft.times.ids)
    yield from _commented(f'Durations count messages here. For real time ({ids}) write:', '# ')
    yield f'# {draft.times.evaluation}'
    if draft.times.refused:
        yield from _commented('and give times to the counts of ' + ', '.join(draft.times.refused),
                              '# ')


def _input(item: DraftInput) -> Iterator[str]:
    yield f'  {scalar(item.name)}:'
    if item.topic is not None:
        yield f'    topic: {scalar(item.topic)}'
    yield f'    type: {scalar(item.type)}'
    if item.field is not None:
        yield f'    field: {scalar(item.field)}'
    if item.values:
        pairs = ', '.join(f'{scalar(name)}: {value}' for name, value in item.values)
        yield f'    values: {{{pairs}}}'
    if item.is_output:
        yield '    role: output'


def _definition(item: DraftDefinition) -> Iterator[str]:
    name = scalar(item.name)
    if item.language is Language.PTLTL:
        yield from _entry(f'  {name}: ', item.text)
    else:
        yield f'  {name}:'
        yield from _entry(f'    {item.language.value}: ', item.text)


def _requirement(item: DraftRequirement) -> Iterator[str]:
    yield f'  - id: {scalar(item.id)}'
    if item.title:
        yield from _entry('    title: ', item.title)
    yield from _entry(f'    {item.language.value}: ', item.text, is_text=True)
    if item.is_assumption:
        yield '    assume: true'
    if item.source:
        yield from _entry('    source: ', item.source)
    if item.rationale:
        yield from _entry('    rationale: ', item.rationale)


def _entry(key: str, text: str, is_text: bool = False) -> Iterator[str]:
    """Yield the lines of a key with a text."""
    inner = ' ' * (len(key) - len(key.lstrip()) + 2)
    if len(key) + len(text) + 2 <= _WIDTH and not _UNSAFE.search(text):
        yield key + scalar(text, is_text)
    elif _can_fold(text):
        yield f'{key}>-'
        yield from _wrapped(text, inner, inner)
    elif _can_be_literal(text):
        yield f'{key}|-'
        yield from (inner + line if line else '' for line in text.split('\n'))
    else:
        yield key + _escaped(text)


def _can_fold(text: str) -> bool:
    """Whether folding preserves a text: one line, with single blanks between words."""
    return not _UNSAFE.search(text) and text == ' '.join(text.split())


def _can_be_literal(text: str) -> bool:
    """Whether a literal block preserves a text."""
    lines = text.split('\n')
    return len(lines) > 1 and not any(_UNSAFE.search(line) for line in lines) and not (
        lines[0].startswith(' ') or not lines[0] or not lines[-1].strip())


def scalar(text: str, is_text: bool = False) -> str:
    """Return a text on one line, quoted if YAML requires it, or always with `is_text`."""
    is_plain = _WORD.fullmatch(text) and text.lower() not in _NOT_WORDS and text[0] != '~'
    if is_plain and not is_text:
        return text
    if _UNSAFE.search(text):
        return _escaped(text)
    if '"' in text or '\\' in text:
        return "'" + text.replace("'", "''") + "'"
    return f'"{text}"'


def _escaped(text: str) -> str:
    """Return a text in double quotes, with special characters escaped."""
    return '"' + ''.join(_escape(char) for char in text) + '"'


def _escape(char: str) -> str:
    if char in '"\\':
        return '\\' + char
    if char == '\n':
        return '\\n'
    if not _UNSAFE.search(char):
        return char
    code = ord(char)
    return f'\\x{code:02x}' if code < 256 else f'\\u{code:04x}' if code < 65536 else (
        f'\\U{code:08x}')


# Comments

def _comment(text: str) -> str:
    """Return a text as one line of a comment, without characters that YAML forbids."""
    return _UNSAFE.sub(' ', ' '.join(text.split()))


def _left_out(draft: Draft) -> Iterator[str]:
    for item, reason in draft.left_out:
        yield from _commented(f'left out: {item.id} ({reason})', '  #  ')
        for wording in item.wordings[:1]:
            more = '...' if len(wording.text) > _MOST_QUOTED else ''
            yield from _commented(f'{wording.languages[0].value}: {wording.text[:_MOST_QUOTED]}'
                                  f'{more}', '  #      ')


def _notes(draft: Draft) -> Iterator[str]:
    """Yield the comments at the end: unread and renamed inputs, and the manual tasks."""
    if draft.unused:
        yield ''
        yield from _commented('No requirement reads: ' + ', '.join(draft.unused), '# ')
    if draft.renamed:
        yield ''
        pairs = ', '.join(f'{old} is {new}' for old, new in draft.renamed)
        yield from _commented(f'Renamed: {pairs}', '# ')
    if draft.todo:
        yield ''
        yield f'# TO DO ({len(draft.todo)}):'
    for item in draft.todo:
        first, *lines = item.split('\n')
        yield from _commented(first, '# - ', '#   ')
        yield from (f'#       {_UNSAFE.sub(" ", line)}' for line in lines)


def _commented(text: str, indent: str, further: str = '') -> list[str]:
    """Return the lines of a comment; all lines except the first start with `further`."""
    return _wrapped(_comment(text), indent, further or f'{indent}  ')


def _wrapped(text: str, first: str, further: str) -> list[str]:
    return wrap(text, _WIDTH, initial_indent=first, subsequent_indent=further,
                break_long_words=False, break_on_hyphens=False)
