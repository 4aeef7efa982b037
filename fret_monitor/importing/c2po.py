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
contract `p => q` is read as an implication. Other sections (STRUCT, for instance) are reported.
"""

from collections.abc import Iterator
import re

from fret_monitor.bundle.bundle import Language
from fret_monitor.importing.component import (
    ComponentRequirement, ComponentVariable, ImportedComponent, VariableRole, Wording,
)
from fret_monitor.model.diagnostics import Problems, Source, Span

_SECTION = re.compile(r'^[ \t]*(INPUT|DEFINE|ATOMIC|STRUCT|ENUM|FTSPEC|PTSPEC)\b', re.MULTILINE)
_COMMENT = re.compile(r'--[^\n]*')
_NAMED = re.compile(r'([A-Za-z_]\w*)\s*:(?!=)')
_DEFINED = re.compile(r'([A-Za-z_]\w*)\s*:?=(?![=>])')
_DECLARED = re.compile(r'([A-Za-z_]\w*(?:\s*,\s*[A-Za-z_]\w*)*)\s*:\s*(\w+)')


def is_c2po(content: str) -> bool:
    """Whether a text has a section of formulas of C2PO."""
    found = {match[1] for match in _SECTION.finditer(_COMMENT.sub('', content))}
    return bool(found & {'FTSPEC', 'PTSPEC'})


def read_c2po(source: Source, file: str, name: str, problems: Problems) -> ImportedComponent:
    """Return the component of a file; `name` is its name."""
    variables: list[ComponentVariable] = []
    requirements: list[ComponentRequirement] = []
    for section, text, place in _statements(source):
        declared = _DECLARED.fullmatch(text) if section == 'INPUT' else None
        defined = _DEFINED.match(text) if section in ('DEFINE', 'ATOMIC') else None
        if declared:
            variables += [ComponentVariable(one.strip(), VariableRole.INPUT, declared[2])
                          for one in declared[1].split(',')]
        elif defined:
            wording = Wording((Language.MLTL,), text[defined.end():].strip(),
                              f'{file}, {defined[1]}')
            variables.append(
                ComponentVariable(defined[1], VariableRole.INTERNAL, assignments=(wording,)))
        elif section in ('FTSPEC', 'PTSPEC'):
            requirements.append(_requirement(section, text, file, len(requirements) + 1))
        else:
            problems.warning(f'{file}: a part of the section {section} is left out', place,
                             'cannot be read', 'INPUT has names and types, DEFINE expressions')
    return ImportedComponent(name, '', tuple(variables), tuple(requirements), (file,))


def _requirement(section: str, text: str, file: str, number: int) -> ComponentRequirement:
    named = _NAMED.match(text)
    id_ = named[1] if named else f'{section.removesuffix("SPEC")}{number}'
    formula = text[named.end():].strip() if named else text
    return ComponentRequirement(id_, (Wording((Language.MLTL,), formula, f'{file}, {id_}'),))


def _statements(source: Source) -> Iterator[tuple[str, str, Span]]:
    """Yield each statement with its section, without its semicolon, on one line."""
    content = _COMMENT.sub(lambda match: ' ' * len(match[0]), source.text)
    begins = [*_SECTION.finditer(content)]
    ends = [match.start() for match in begins[1:]] + [len(content)]
    for begin, end in zip(begins, ends, strict=True):
        for part in re.finditer(r'[^;]+', content[begin.end():end]):
            text = ' '.join(part[0].split())
            if text:
                first = begin.end() + part.start() + len(part[0]) - len(part[0].lstrip())
                yield begin[1], text, Span(source, first, begin.end() + part.end())
