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
Parse projects and component specifications: the JSON that FRET exports and Ogma reads.

A project is a list of requirements (old versions), or an object with `requirements` and
`variables`; it may contain several components. A component specification is an object that maps
the name of a component to its internal variables, other variables and requirements. Ogma's JSON
formats allow other keys for them, which occur in practice.
"""

from collections.abc import Iterator
import re

from fret_monitor.bundle.bundle import Language
from fret_monitor.importing.component import (
    ComponentRequirement, ComponentVariable, ImportedComponent, VariableRole, Wording,
)
from fret_monitor.importing.json_text import items, mapping, names, text
from fret_monitor.model.diagnostics import Problems, refuse, Source, Span

_TAG = re.compile(r'</?(?:b|i|em|strong|br)\s*/?>', re.IGNORECASE)
_ROLES = {
    'internal': VariableRole.INTERNAL, 'output': VariableRole.OUTPUT, 'mode': VariableRole.MODE,
    'function': VariableRole.FUNCTION,
}
_EITHER = (Language.PTLTL, Language.COCOSPEC)
_INTERNAL = ('Internal_variables', 'internal_variables')
_OTHER = ('Other_variables', 'external_variables', 'Input_variables')
_OUTPUT = ('Output_variables',)
_REQUIREMENTS = ('Requirements', 'properties', 'requirements')
_FUNCTIONS = ('Functions', 'functions')
_IDS = ('name', 'id', 'reqid')
# Texts that FRET and Ogma write for a missing formula or sentence.
_PLACEHOLDERS = frozenset({
    'meaning not specified', 'no meaning assigned', 'under construction', 'unhandled',
    'undefined', 'true',
})
_PROBABILITY = re.compile(r'\bwith\s+probability\b', re.IGNORECASE)
_RESULTS = ('result_type', 'result_formula')


def plain(formula: str) -> str:
    """Return a formula on one line, without the HTML markup of old versions of FRET."""
    # Not html.unescape: it replaces `&not` even where no semicolon follows.
    cleaned = _TAG.sub('', formula)
    for entity, char in (('&lt;', '<'), ('&gt;', '>'), ('&amp;', '&')):
        cleaned = cleaned.replace(entity, char)
    return ' '.join(cleaned.split())


def is_project(value: object) -> bool:
    """Whether a JSON value is a project as FRET exports it."""
    found = items(mapping(value).get('requirements') if isinstance(value, dict) else value)
    return any('reqid' in item or 'fulltext' in item for item in found)


def is_specification(value: object) -> bool:
    """Whether a JSON value is a component specification."""
    return any(_specifications(value, ''))


def read_project(value: object, source: Source, file: str) -> list[ImportedComponent]:
    """
    Return the components of a project, in the order of their first requirements.

    Raises
    ------
    CompileError
        if a requirement has no id.
    """
    content = mapping(value)
    requirements = items(content.get('requirements')) if content else items(value)
    found: dict[tuple[str, str], list[dict[str, object]]] = {}
    for item in requirements:
        found.setdefault(_owner(item), []).append(item)
    variables: dict[tuple[str, str], list[ComponentVariable]] = {}
    for item in items(content.get('variables')):
        if item.get('modeldoc') is not True and text(item, 'variable_name'):
            key = (text(item, 'project'), text(item, 'component_name'))
            variables.setdefault(key, []).append(_variable(item, file))
    return [
        ImportedComponent(name, project, tuple(variables.get((project, name), ())),
                          tuple(_requirement(item, source, file) for item in owned), (file,))
        for (project, name), owned in found.items()
    ]


def _owner(item: dict[str, object]) -> tuple[str, str]:
    semantics = mapping(item.get('semantics'))
    name = plain(text(semantics, 'component_name', 'component'))
    return text(item, 'project'), name or component_in(text(item, 'fulltext'))


def component_in(sentence: str) -> str:
    """Return the word before 'shall', usually the component; '' if there is none."""
    match = re.search(r'(\w+)\s+shall\b', sentence)
    return match[1] if match else ''


def _variable(item: dict[str, object], file: str) -> ComponentVariable:
    name = text(item, 'variable_name')
    role = _ROLES.get(text(item, 'idType').lower(), VariableRole.INPUT)
    return ComponentVariable(name, role, text(item, 'dataType'), tuple(_assignments(
        item, f'{file}, {name}', ('modeRequirement', 'assignment'), ('smvAssignment',),
        ('copilotAssignment',), ('r2u2Assignment',))))


def _assignments(item: dict[str, object], label: str, lustre: tuple[str, ...],
                 smv: tuple[str, ...], either: tuple[str, ...],
                 r2u2: tuple[str, ...] = ()) -> Iterator[Wording]:
    for languages, keys in (((Language.COCOSPEC,), lustre), ((Language.PTLTL,), smv),
                            (_EITHER, either), ((Language.MLTL,), r2u2)):
        found = text(item, *keys)
        if found:
            yield Wording(languages, found.rstrip(';').rstrip(), f'{label}, assignment')


def _requirement(item: dict[str, object], source: Source, file: str) -> ComponentRequirement:
    name = text(item, 'reqid', '_id')
    if not name:
        refuse('a requirement has no id', Span(source, 0, 1), "FRET writes a 'reqid' for each")
    semantics = mapping(item.get('semantics'))
    wordings = _wordings(f'{file}, {name}', text(item, 'fulltext'),
                         text(semantics, 'ptExpanded', 'pt'), text(semantics, 'CoCoSpecCode'),
                         text(semantics, 'R2U2Code'))
    notes = [text(item, 'rationale'), text(item, 'comments')]
    rationale = '\n'.join(dict.fromkeys(note for note in notes if note))
    modes = names(mapping(semantics.get('variables')).get('modes'))
    return ComponentRequirement(name, tuple(wordings), '', rationale, tuple(modes),
                                _is_assumption(name))


def _is_assumption(name: str) -> bool:
    """Whether FRET takes a requirement as an assumption: by its id."""
    return 'assumption' in name.lower()


def _wordings(label: str, sentence: str, ptltl: str, cocospec: str,
              r2u2: str) -> Iterator[Wording]:
    # FRET's formulas of a sentence with a probability are those of the sentence without it.
    if _PROBABILITY.search(sentence):
        ptltl = cocospec = r2u2 = ''
    of_the_past = (
        (Language.FRETISH, 'sentence', ' '.join(sentence.split())),
        (Language.PTLTL, 'ptLTL', plain(ptltl)),
        (Language.COCOSPEC, 'CoCoSpec', plain(cocospec)))
    found = [item for item in of_the_past if _is_text(item[2])]
    # The formula for R2U2 has its verdict later than the others: it is not compared with them.
    for language, name, written in found or [(Language.MLTL, 'R2U2', plain(r2u2))]:
        if _is_text(written):
            yield Wording((language,), written, f'{label}, {name}')


def _is_text(written: str) -> bool:
    return bool(written) and written.lower().strip(' .()') not in _PLACEHOLDERS


# Component specifications.

def _specifications(value: object, stem: str) -> Iterator[tuple[str, dict[str, object]]]:
    """Yield names and contents; the file's stem names a component that has no name."""
    content = mapping(value)
    if _is_specified(content):
        yield stem, content
        return
    for name, inner in content.items():
        if _is_specified(mapping(inner)):
            yield name, mapping(inner)


def _is_specified(content: dict[str, object]) -> bool:
    """Whether there are requirements with names, or lists of variables."""
    requirements = _all(content, _REQUIREMENTS)
    if requirements:
        return any(text(item, *_IDS) for item in requirements)
    return any(isinstance(content.get(key), list) for key in (*_INTERNAL, *_OTHER, *_OUTPUT))


def read_specification(value: object, file: str, stem: str,
                       problems: Problems) -> list[ImportedComponent]:
    """Return the components of a file; add warnings about ignored parts to `problems`."""
    return [_component(name, content, file, problems)
            for name, content in _specifications(value, stem)]


def _component(name: str, content: dict[str, object], file: str,
               problems: Problems) -> ImportedComponent:
    requirements = tuple(_specified(item, file, number, problems)
                         for number, item in enumerate(_all(content, _REQUIREMENTS), 1))
    variables = [_internal(item, file) for item in _all(content, _INTERNAL)]
    variables += [
        ComponentVariable(text(item, 'name', 'id'), role, text(item, 'type'))
        for role, keys in ((VariableRole.INPUT, _OTHER), (VariableRole.OUTPUT, _OUTPUT))
        for item in _all(content, keys)]
    variables += [ComponentVariable(text(item, 'name', 'id'), VariableRole.FUNCTION)
                  for item in _all(content, _FUNCTIONS)]
    return ImportedComponent(component_name(name, requirements), '',
                             tuple(item for item in variables if item.name), requirements, (file,))


def _all(content: dict[str, object], keys: tuple[str, ...]) -> list[dict[str, object]]:
    return [item for key in keys for item in items(content.get(key))]


def component_name(name: str, requirements: tuple[ComponentRequirement, ...]) -> str:
    """
    Return the name of a component as in its sentences, if they agree.

    FRET appends 'Spec' to the name in exported files; other files may use any name.
    """
    sentences = [item.text for requirement in requirements for item in requirement.wordings
                 if item.languages == (Language.FRETISH,)]
    own = name.removesuffix('Spec') or name
    for known in (name, own):
        if any(re.search(rf'\b{re.escape(known)}\b', sentence) for sentence in sentences):
            return known
    named = {component_in(sentence) for sentence in sentences} - {''}
    return named.pop() if len(named) == 1 else own


def _internal(item: dict[str, object], file: str) -> ComponentVariable:
    name = text(item, 'name', 'id')
    return ComponentVariable(name, VariableRole.INTERNAL, text(item, 'type'), tuple(_assignments(
        item, f'{file}, {name}', ('assignmentLustre',), ('assignmentSMV',),
        ('assignmentCopilot', 'meaning', 'expression'))))


def _specified(item: dict[str, object], file: str, number: int,
               problems: Problems) -> ComponentRequirement:
    name = text(item, *_IDS) or f'R{number}'
    label = f'{file}, {name}'
    dropped = [key for key in _RESULTS if item.get(key)]
    if dropped:
        problems.warning(
            f"{label}: {' and '.join(map(repr, dropped))} left out", None, '',
            'a handler is an empty message; the details are on copilot/violations')
    wordings = list(_wordings(label, text(item, 'fretish'), text(item, 'ptLTL', 'ptExpanded'),
                              text(item, 'CoCoSpecCode'), text(item, 'R2U2Code')))
    formula = text(item, 'formula', 'expression')
    if formula:
        wordings.append(Wording(_EITHER, plain(formula), f'{label}, formula'))
    if text(item, 'PCTL') and not _PROBABILITY.search(text(item, 'fretish')):
        problems.warning(f'{label}: its probability is left out', None, '',
                         'only a sentence is read with its probability: shall with probability '
                         '> 0.98 ...')
    return ComponentRequirement(name, tuple(wordings), text(item, 'text', 'description'),
                                text(item, 'rationale'), is_assumption=_is_assumption(name))
