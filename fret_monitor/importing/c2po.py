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
Reads the specifications of R2U2's compiler C2PO.

A file has sections: INPUT with declarations `a, b: bool;`, DEFINE with `name = expression;`,
FTSPEC and PTSPEC with `name: formula;` or a formula alone. The formulas are kept as texts; those
that `mltl` cannot read are left out with their reasons, as of other files. An assume-guarantee
contract `p => q` becomes an implication, `G[5]` is `G[0,5]`, and the members of ENUM are
constants. STRUCT is reported; what reads a structure, or the time stamp TAU, is left out.

C2PO binds some operators otherwise than `mltl`: `->`, `xor` and `<->` alike and from the left, `!`
tighter than comparisons, and in older versions the operators over time, too. What this could
change is reported, and left out, with what reads it: parentheses make it the same in both. So are
`S` and `T` with a lower bound above 0: R2U2 asks for `p` at the steps up to that bound alone.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
import re

from fret_monitor.bundle.bundle import Language
from fret_monitor.importing.component import (
    ComponentRequirement, ComponentVariable, ImportedComponent, VariableRole, Wording,
)
from fret_monitor.model.diagnostics import Diagnostic, Level, Problems, Source, Text

_SECTION = re.compile(r'^[ \t]*(INPUT|DEFINE|ATOMIC|STRUCT|ENUM|FTSPEC|PTSPEC)\b', re.MULTILINE)
_COMMENT = re.compile(r'--[^\n]*')
_NAMED = re.compile(r'([A-Za-z_]\w*)\s*:(?!=)')
_DEFINED = re.compile(r'([A-Za-z_]\w*)\s*:?=(?![=>])')
_LEXEME = re.compile(r'\s+|[A-Za-z_]\w*|[\d.]+|<->|<<|>>|->|=>|&&|\|\||[<>=!]=|.', re.DOTALL)
_FROM_LEFT = frozenset({'->', '<->', 'xor'})
_PREFIX = frozenset('!GFHOYX')
_SHIFTED = {'S': 'O', 'T': 'H'}
_TIGHTER = frozenset({'<', '>', '<=', '>=', '=', '==', '!=', '+', '-', '*', '/', '%'})
_OF_BITS = frozenset({'&', '|', '^', '~', '<<', '>>'})
_OPENING = frozenset('([')
_CLOSING = frozenset(')]')
_SHORT_BOUND = re.compile(r'\b[GFHOURST]\s*\[\s*(?=\d+\s*\])')
_BRACED = re.compile(r'([A-Za-z_]\w*)\s*:\s*\{([^}]*)\}?')
_MEMBER = re.compile(r'([A-Za-z_]\w*)(?:\s*:\s*(-?\d+))?')
_UNREAD = {'TAU': 'it is the time stamp of R2U2, and no input'}
_DECLARED = re.compile(r'([A-Za-z_]\w*(?:\s*,\s*[A-Za-z_]\w*)*)\s*:\s*(\w+)')


def is_c2po(content: str) -> bool:
    """Whether a text has a section of formulas of C2PO."""
    found = {match[1] for match in _SECTION.finditer(_COMMENT.sub('', content))}
    return bool(found & {'FTSPEC', 'PTSPEC'})


def read_c2po(source: Source, file: str, name: str, problems: Problems) -> ImportedComponent:
    """Return the component of a file; `name` is its name."""
    variables: list[ComponentVariable] = []
    requirements: list[ComponentRequirement] = []
    kinds: dict[str, str] = {}
    unread = {**_UNREAD}
    for section, written in _statements(source):
        text, place = written.value, written.span
        braced = _BRACED.match(text) if section in ('ENUM', 'STRUCT') else None
        if braced:
            kinds[braced[1]] = section
        if braced and section == 'ENUM':
            variables += _members(braced[2], f'{file}, {braced[1]}', variables, unread)
            continue
        if section == 'STRUCT' and not braced:
            continue  # the fields of one that was reported
        declared = _DECLARED.fullmatch(text) if section == 'INPUT' else None
        defined = _DEFINED.match(text) if section in ('DEFINE', 'ATOMIC') else None
        if declared:
            kind = 'int' if kinds.get(declared[2]) == 'ENUM' else declared[2]
            variables += [ComponentVariable(one.strip(), VariableRole.INPUT, kind)
                          for one in declared[1].split(',')]
        elif defined and (kind := _kind_of(text[defined.end():], kinds)):
            unread[defined[1]] = f'it is of the structure {kind}'
        elif defined:
            wording = _wording(written, defined.end(), f'{file}, {defined[1]}')
            variables.append(
                ComponentVariable(defined[1], VariableRole.INTERNAL, assignments=(wording,)))
        elif section in ('FTSPEC', 'PTSPEC'):
            requirements.append(
                _requirement(section, written, file, len(requirements) + 1))
        else:
            problems.warning(f'{file}: a part of the section {section} is left out', place,
                             'cannot be read', 'INPUT has names and types, DEFINE expressions')
    variables = _read_alike(variables, unread, problems)
    names = {item.name for item in variables}
    unread |= {item.id: 'it is the name of a formula: DEFINE gives names that formulas read'
               for item in requirements if item.id not in names}
    return ImportedComponent(name, '', tuple(variables), tuple(
        replace(item, wordings=tuple(_faulty(one, unread) for one in item.wordings))
        for item in requirements), (file,))


def _members(text: str, label: str, known: Sequence[ComponentVariable],
             unread: dict[str, str]) -> Iterator[ComponentVariable]:
    """Yield the members of an enumeration as constants; one with two numbers is `unread`."""
    numbers = {item.name: item.assignments[0].text for item in known if item.assignments}
    free = 0
    for member in _MEMBER.finditer(text):
        number = member[2] or str(free)
        free += member[2] is None
        if numbers.setdefault(member[1], number) != number:
            unread[member[1]] = f'it is {numbers[member[1]]} and {number} in ENUM'
        elif not any(item.name == member[1] for item in known):
            yield ComponentVariable(member[1], VariableRole.INTERNAL, 'int', (
                Wording((Language.MLTL,), number, f'{label}, {member[1]}'),))


def _kind_of(text: str, kinds: Mapping[str, str]) -> str:
    """Return the structure that an expression makes, or ''."""
    name = text.lstrip().partition('(')[0].strip()
    return name if kinds.get(name) == 'STRUCT' else ''


def _read_alike(variables: Sequence[ComponentVariable], unread: dict[str, str],
                problems: Problems) -> list[ComponentVariable]:
    """Return the variables without definitions that are left out; add why to `unread`."""
    left = [*variables]
    while wrong := [item for item in left for one in item.assignments
                    if _faulty(one, unread).fault is not None]:
        for item in wrong:
            fault = _faulty(item.assignments[0], unread).fault
            assert fault is not None
            problems.warning(fault.title, fault.span, fault.label, fault.help)
            unread[item.name] = 'its definition is left out'
            left.remove(item)
    return left


def _faulty(wording: Wording, unread: Mapping[str, str]) -> Wording:
    """Return a wording with its fault, if C2PO reads it otherwise, or it reads what is unread."""
    label, help_ = _other_meaning(wording.text) or ('', '')
    title = 'C2PO reads it otherwise'
    if not label:
        name = next((word for word in _LEXEME.findall(wording.text) if word in unread), '')
        if not name:
            return wording
        title, label = f"it reads '{name}': {unread[name]}", ''
    place = wording.place.span if wording.place else None
    return replace(wording, fault=Diagnostic(title, place, label, help_, Level.WARNING))


def _requirement(section: str, text: Text, file: str, number: int) -> ComponentRequirement:
    named = _NAMED.match(text.value)
    id_ = named[1] if named else f'{section.removesuffix("SPEC")}{number}'
    return ComponentRequirement(
        id_, (_wording(text, named.end() if named else 0, f'{file}, {id_}'),))


def _wording(text: Text, begin: int, label: str) -> Wording:
    """Return the formula that begins in a statement at a place."""
    value = text.value[begin:].lstrip()
    begin = len(text.value) - len(value)
    whole = _with_lower_bounds(Text(value, text.source, text.offsets[begin:]))
    return Wording((Language.MLTL,), whole.value, label, whole)


def _with_lower_bounds(text: Text) -> Text:
    """Return a text with `[0,n]` for a bound `[n]`."""
    value, offsets = text.value, [*text.offsets]
    for bound in reversed([*_SHORT_BOUND.finditer(value)]):
        end = bound.end()
        value = f'{value[:end]}0,{value[end:]}'
        offsets[end:end] = [offsets[end]] * 2
    return Text(value, text.source, offsets)


def _other_meaning(text: str) -> tuple[str, str] | None:
    """Return what C2PO reads otherwise than `mltl`, and what to write; None if nothing."""
    lexemes = [item for item in _LEXEME.findall(text) if not item.isspace()]
    seen: list[set[str]] = [set()]
    for place, lexeme in enumerate(lexemes):
        if lexeme in _OPENING:
            seen.append(set())
        elif lexeme in _CLOSING and len(seen) > 1:
            seen.pop()
        elif lexeme in _OF_BITS:
            return f"'{lexeme}' is of bits", 'write && and || for truth values'
        elif lexeme in _FROM_LEFT | {'=>'} and seen[-1] & (_FROM_LEFT | {'=>'}):
            return 'C2PO reads this from the left', 'put parentheses around one of the two'
        elif lexeme in _PREFIX and _after_operand(lexemes, place + 1) in _TIGHTER:
            older = '' if lexeme == '!' else ' in older versions'
            return (f"C2PO reads '{lexeme}' before the comparison{older}",
                    'put parentheses around the comparison')
        elif lexeme in _SHIFTED and _has_lower_bound(lexemes[place + 1:place + 4]):
            return (f"'p {lexeme}[a,b] q' of R2U2 asks for p up to step t-a only",
                    f'write {_SHIFTED[lexeme]}[a,a] (p {lexeme}[0,b-a] q)')
        seen[-1].add(lexeme)
    return None


def _has_lower_bound(lexemes: list[str]) -> bool:
    """Whether the bound that begins here is `[a,b]` with another `a` than 0."""
    return lexemes[::2] == ['[', ','] and lexemes[1] != '0'


def _after_operand(lexemes: list[str], place: int) -> str:
    """
    Return what follows the bound and the operand of a prefix operator that ends at a place.

    It is '' if the operand begins with another prefix operator, which is closer to what follows.
    """
    depth = 0
    is_bound = lexemes[place:place + 1] == ['[']
    while place < len(lexemes):
        lexeme = lexemes[place]
        depth += (lexeme in _OPENING) - (lexeme in _CLOSING)
        place += 1
        if depth == 0 and is_bound:
            is_bound = False
        elif depth == 0 and lexeme in _PREFIX:
            return ''
        elif depth == 0 and lexemes[place:place + 1] != ['(']:
            break
    return lexemes[place] if place < len(lexemes) else ''


def _statements(source: Source) -> Iterator[tuple[str, Text]]:
    """Yield each statement with its section, without its semicolon, on one line."""
    content = _COMMENT.sub(lambda match: ' ' * len(match[0]), source.text)
    begins = [*_SECTION.finditer(content)]
    ends = [match.start() for match in begins[1:]] + [len(content)]
    for begin, end in zip(begins, ends, strict=True):
        for part in re.finditer(r'[^;]+', content[begin.end():end]):
            if part[0].strip():
                yield begin[1], _in_one_line(part[0], begin.end() + part.start(), source)


def _in_one_line(text: str, start: int, source: Source) -> Text:
    """Return a text that begins at a place of a source, with one blank between words."""
    value, offsets = list[str](), list[int]()
    for word in re.finditer(r'\S+', text):
        if value:
            offsets.append(start + word.start() - 1)
        value.append(word[0])
        offsets += range(start + word.start(), start + word.end())
    return Text(' '.join(value), source, [*offsets, offsets[-1] + 1])
