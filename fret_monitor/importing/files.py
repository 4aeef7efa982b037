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
The files of an import: what each of them is, and what they say together.

A file is known by what is in it, not by its name. Several files may speak of one component: a
project, its specification and its Lustre then give one component, whose requirements have the
wordings of all. Requirements that only share an id, or a handler, get ids of their own. One
without a component (FRET could not read its sentence) belongs to the only one of its project.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from fret_monitor.bundle.bundle import handler_name, Language, read_source
from fret_monitor.importing.component import Component, ComponentRequirement, ComponentVariable
from fret_monitor.importing.fret import (
    is_project, is_specification, read_project, read_specification,
)
from fret_monitor.importing.json_text import read_json
from fret_monitor.importing.lustre import is_lustre, read_lustre
from fret_monitor.importing.topics import (
    Connection, is_database, is_list, read_database, read_list,
)
from fret_monitor.model.diagnostics import did_you_mean, Problems, refuse, Source, Span
from fret_monitor.model.names import fret_name, handler_fault, shown

MAX_BYTES = 256 * 2 ** 20  # FRET writes some 10 KiB for a requirement
_KINDS = ('a project or component specification of FRET (JSON), its Lustre, a variable database '
          'of Ogma (JSON), or a list of names and topics')
_LONGEST_ID = 100


@dataclass(frozen=True)
class Files:
    """All that was read: the components, and the connections by `fret_name` of their inputs."""

    components: tuple[Component, ...]
    connections: dict[str, Connection]


def read_files(paths: Sequence[Path], problems: Problems) -> Files:
    """
    Read all files and put together what belongs together.

    Raises
    ------
    CompileError
        if a file cannot be read, is none of those known, or no requirement is in any.
    """
    components: list[Component] = []
    connections: dict[str, Connection] = {}
    for path in paths:
        found, links = _read(path, problems)
        components += found
        for item in links:
            _connect(item, connections, path.name, problems)
    merged = tuple(_told_apart(item, problems) for item in _settled(_merged(components)))
    if not any(item.requirements for item in merged):
        refuse('there is no requirement in ' + ', '.join(shown(str(path)) for path in paths),
               help=f'give {_KINDS}')
    return Files(tuple(item for item in merged if item.requirements), connections)


def _read(path: Path, problems: Problems) -> tuple[list[Component], list[Connection]]:
    source = read_source(path, MAX_BYTES)
    content = source.text.lstrip()
    if content[:1] in ('{', '['):
        return _read_json(source, path, problems)
    if is_lustre(source.text):
        return read_lustre(source, path.name, problems), []
    if is_list(source.text):
        return [], read_list(source, path.name, problems)
    refuse(f'{shown(str(path))} is nothing that can be imported',
           Span(source, 0, 1) if content else None,
           'begins here' if content else '', f'give {_KINDS}')


def _read_json(source: Source, path: Path,
               problems: Problems) -> tuple[list[Component], list[Connection]]:
    value = read_json(source)
    if is_database(value):
        return [], read_database(value, path.name, problems)
    if is_project(value):
        return read_project(value, source, path.name), []
    if is_specification(value):
        return read_specification(value, path.name, path.stem, problems), []
    refuse(f'{shown(str(path))} is JSON, but no export of FRET or Ogma',
           Span(source, 0, 1), "no 'requirements' with a 'reqid', no 'Requirements', no 'inputs'",
           f'give {_KINDS}')


def _connect(item: Connection, connections: dict[str, Connection], file: str,
             problems: Problems) -> None:
    """Add a connection; what a later file says of the same input counts where it says more."""
    key = fret_name(item.name)
    known = connections.get(key)
    if known is not None and known.topic and item.topic and known.topic != item.topic:
        problems.warning(f"{file}: '{item.name}' has a topic already: {known.topic}", None, '',
                         f'{item.topic} is left out')
        return
    if known is None:
        connections[key] = item
    else:
        connections[key] = Connection(
            known.name, known.topic or item.topic, known.message_type or item.message_type,
            known.field or item.field, known.type or item.type, known.note or item.note,
            known.file or item.file, known.place or item.place)


# What several files say of one component.

def _merged(components: Iterable[Component]) -> list[Component]:
    """Join components of one name, if at most one project has it."""
    found: dict[tuple[str, str], Component] = {}
    for item in sorted(components, key=lambda item: not item.project):
        same = [key for key in found if key[1] == item.name]
        key = (item.project, item.name)
        if not item.project and len(same) == 1:
            key = same[0]
        found[key] = _joined(found[key], item) if key in found else item
    return list(found.values())


def _settled(components: Sequence[Component]) -> Iterator[Component]:
    """Give requirements without a component to that of their project, if it has only one."""
    settled = list(components)
    for item in components:
        named = [place for place, one in enumerate(settled)
                 if one.name and one.requirements and one.project in ('', item.project)]
        if not item.name and len(named) == 1:
            settled[named[0]] = _joined(settled[named[0]], item)
            settled.remove(item)
    yield from settled


def _joined(first: Component, second: Component) -> Component:
    return replace(first, variables=first.variables + second.variables,
                   requirements=first.requirements + second.requirements,
                   files=tuple(dict.fromkeys(first.files + second.files)))


def _told_apart(component: Component, problems: Problems) -> Component:
    """Join what is one requirement or variable, and give all others ids of their own."""
    requirements: list[ComponentRequirement] = []
    places: dict[str, list[int]] = {}
    for item in component.requirements:
        known = places.setdefault(item.id, [])
        same = next((place for place in known if _is_same(requirements[place], item)), None)
        if same is None:
            known.append(len(requirements))
            requirements.append(item)
        else:
            requirements[same] = _one(requirements[same], item)
    return replace(component, requirements=tuple(_with_ids(requirements, problems)),
                   variables=tuple(_variables(component.variables)))


def _sentences(item: ComponentRequirement) -> set[str]:
    return {' '.join(wording.text.split()) for wording in item.wordings
            if wording.languages == (Language.FRETISH,)}


def _is_same(first: ComponentRequirement, second: ComponentRequirement) -> bool:
    """Whether two requirements are one: the same id, and no other sentence."""
    if first.id != second.id:
        return False
    sentences = _sentences(first), _sentences(second)
    if all(sentences):
        return sentences[0] == sentences[1]
    files = {wording.label.split(', ')[0] for wording in first.wordings}
    return not files & {wording.label.split(', ')[0] for wording in second.wordings}


def _one(first: ComponentRequirement, second: ComponentRequirement) -> ComponentRequirement:
    known = {(item.languages, item.text) for item in first.wordings}
    more = tuple(item for item in second.wordings if (item.languages, item.text) not in known)
    return replace(first, wordings=first.wordings + more, title=first.title or second.title,
                   rationale=first.rationale or second.rationale,
                   modes=tuple(dict.fromkeys(first.modes + second.modes)))


def _with_ids(requirements: Iterable[ComponentRequirement],
              problems: Problems) -> Iterator[ComponentRequirement]:
    handlers: set[str] = set()
    for item in requirements:
        name = _free_id(_usable_id(item.id), handlers)
        handlers.add(handler_name(name))
        if name != item.id:
            problems.warning(
                f'the requirement {shown(item.id)} is called {shown(name)} in the bundle', None,
                '', 'ids and the handlers made of them are to be told apart: '
                "letters, digits and '_' count")
        yield replace(item, id=name)


def _usable_id(name: str) -> str:
    printable = ''.join(char if char.isprintable() else ' ' for char in name)
    usable = ' '.join(printable.split()) or 'R'
    return usable if handler_fault(handler_name(usable)) is None else usable[:_LONGEST_ID].strip()


def _free_id(name: str, handlers: set[str]) -> str:
    found, number = name, 2
    while handler_name(found) in handlers:
        found, number = f'{name}_{number}', number + 1
    return found


def _variables(variables: Iterable[ComponentVariable]) -> Iterator[ComponentVariable]:
    """Yield each variable once, with what any of its entries says."""
    found: dict[str, ComponentVariable] = {}
    for item in variables:
        known = found.setdefault(fret_name(item.name), item)
        if known is not item:
            found[fret_name(item.name)] = replace(
                known, type=known.type or item.type,
                role=item.role if item.assignments and not known.assignments else known.role,
                assignments=known.assignments or item.assignments)
    yield from found.values()


# Which of them are imported.

def choose(components: Sequence[Component], name: str | None) -> Component:
    """
    Return the component that is asked for, or the only one that has a name.

    Raises
    ------
    CompileError
        if there are several, or none of that name.
    """
    named = [item for item in components if item.name]
    full = [item.full_name for item in named]
    fitting = named if name is None and named else [
        item for item in components if name in (None, item.name, item.full_name)]
    if len(fitting) == 1:
        return fitting[0]
    if not fitting:
        refuse(f'there is no component {shown(name or "")}',
               help=did_you_mean(name or '', full) or 'there are ' + ', '.join(full))
    refuse(f'there are {len(fitting)} components, and a bundle is of one: '
           + ', '.join(item.full_name for item in fitting),
           help=f'choose one: --component {fitting[0].full_name}\n'
                'or name a folder, for a bundle of each: -o bundles/')
