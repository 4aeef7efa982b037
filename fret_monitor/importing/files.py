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
Read the files of an import and merge their descriptions of each component.

The format of a file is recognised by its content, not its name. Several files may describe one
component: a FRET project, a component specification and a Lustre file result in one component,
whose requirements have the wordings of all three. Different requirements with the same id or
handler get new ids. A requirement without a component (FRET could not parse its sentence) is
added to the component of its project, if there is only one.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from fret_monitor.bundle.bundle import Language
from fret_monitor.bundle.source_file import read_source
from fret_monitor.importing.c2po import is_c2po, read_c2po
from fret_monitor.importing.component import (
    ComponentRequirement, ComponentVariable, ImportedComponent, VariableRole,
)
from fret_monitor.importing.diagram import is_diagram, read_diagram
from fret_monitor.importing.fret import (
    is_project, is_specification, read_project, read_specification,
)
from fret_monitor.importing.json_text import read_json
from fret_monitor.importing.lustre import is_lustre, read_lustre
from fret_monitor.importing.reqif_file import is_reqif
from fret_monitor.importing.reqifz import SUFFIX as ARCHIVE, unpacked
from fret_monitor.importing.state_machine import component_of, DiagramOptions
from fret_monitor.importing.tables import (
    decoded, encoding_of, has_heads, read_rows, read_table, refuse_packed, SUFFIXES,
    WORKBOOK,
)
from fret_monitor.importing.topics import (
    Connection, is_database, is_list, read_database, read_inputs, read_list,
)
from fret_monitor.importing.xml_format import read_xml, XmlFormat
from fret_monitor.importing.xml_text import MAX_XML
from fret_monitor.model.bundle_files import refuse_irregular
from fret_monitor.model.diagnostics import did_you_mean, Problems, refuse, Source, Span
from fret_monitor.model.names import fret_name, handler_fault, handler_name, shown

MAX_BYTES = 256 * 2 ** 20  # FRET writes about 10 KiB for each requirement
_KINDS = ('a project or component specification of FRET (JSON), its Lustre, a specification of '
          'R2U2 (C2PO), a table (CSV, XLSX) with columns of ids and requirements, ReqIF, a '
          'state diagram (Mermaid, DOT), a variable database of Ogma (JSON), a list of names '
          'and topics, or a bundle with inputs (.yaml)')
_BUNDLE = ('.yaml', '.yml')
_LONGEST_ID = 100
_BEGIN_BYTES = 1000


@dataclass(frozen=True)
class ImportOptions:
    """How files are read: `columns` as of `read_table`, the mode of diagrams, that of XML."""

    columns: Mapping[str, str] = field(default_factory=dict)
    diagram: DiagramOptions = field(default_factory=DiagramOptions)
    xml: XmlFormat | None = None


@dataclass(frozen=True)
class Files:
    """The components in the files, and the connections by the `fret_name` of their inputs."""

    components: tuple[ImportedComponent, ...]
    connections: dict[str, Connection]


def read_files(paths: Sequence[Path], problems: Problems,
               options: ImportOptions) -> Files:
    """
    Read all files and merge their descriptions of each component.

    Raises
    ------
    CompileError
        if a file cannot be read or is of an unknown kind, or no file has a requirement.
    """
    if options.xml is not None and not any(map(_is_xml, paths)):
        refuse('a format is given, and no file is XML', help='leave out --format')
    components: list[ImportedComponent] = []
    connections: dict[str, Connection] = {}
    for path in paths:
        found, links = _read(path, problems, options)
        components += found
        for item in links:
            _connect(item, connections, path.name, problems)
    merged = tuple(_with_unique_ids(item, problems) for item in _with_owners(_merged(components)))
    if not any(item.requirements for item in merged):
        if not any('/' in (item.topic or '') for item in connections.values()):
            for path in paths:
                if path.suffix.lower() in SUFFIXES:  # no list of topics: reports its heads
                    read_table(path, MAX_BYTES, options.columns, problems)
        refuse('there is no requirement in ' + ', '.join(shown(str(path)) for path in paths),
               help=f'give {_KINDS}')
    return Files(tuple(item for item in merged if item.requirements), connections)


def _is_xml(path: Path) -> bool:
    begin = _begin(path)
    if not begin:
        return True  # reading it will report why
    return begin.decode(encoding_of(begin), 'replace').lstrip().startswith('<')


def _begin(path: Path) -> bytes:
    """Return how a file begins; nothing of a pipe of the shell, which can be read once only."""
    try:
        if path.is_file():
            with path.open('rb') as file:
                return file.read(_BEGIN_BYTES)
    except (OSError, ValueError):
        pass  # reading it will report why
    return b''


def _source(path: Path) -> Source:
    """Return a file that is in UTF-8, or in another encoding by its mark or declaration."""
    begin = _begin(path)
    refuse_packed(begin, shown(str(path)))
    if encoding_of(begin) == 'utf-8-sig' and path.suffix.lower() not in SUFFIXES:
        return read_source(path, MAX_BYTES)
    return Source(str(path), decoded(path, MAX_BYTES))


def _read(path: Path, problems: Problems, options: ImportOptions
          ) -> tuple[list[ImportedComponent], list[Connection]]:
    refuse_irregular(path)
    kind, columns = path.suffix.lower(), options.columns
    if kind == WORKBOOK or kind in SUFFIXES and (columns or has_heads(path, MAX_BYTES)):
        return read_table(path, MAX_BYTES, columns, problems), []
    if kind == ARCHIVE:
        return [item for name, text in unpacked(path, MAX_XML)
                for item in read_table(path, MAX_BYTES, columns, problems, text, name)], []
    if kind in _BUNDLE and (links := read_inputs(path, problems)):
        return [], links
    source = _source(path)
    content = source.text.lstrip()
    if content[:1] in ('{', '['):
        return _read_json(source, path, problems)
    if is_c2po(source.text):
        return [read_c2po(source, path.name, path.stem, problems)], []
    if options.xml is not None and content.startswith('<'):
        return _read_xml(source.text, path, options.xml, problems), []
    if is_reqif(source.text):
        return read_table(path, MAX_BYTES, columns, problems, source.text), []
    if content.startswith('<'):
        refuse(f'{shown(str(path))} is XML, but not ReqIF', Span(source, 0, 1), 'begins here',
               '--format FORMAT names the file that says where its requirements are')
    if is_diagram(source.text):
        return [component_of(read_diagram(source, problems), options.diagram, path.stem,
                             path.name, problems)], []
    if is_lustre(source.text):
        return read_lustre(source, path.name, problems), []
    if is_list(source.text):
        return [], read_list(source, path.name, problems)
    if kind in SUFFIXES and content:
        return read_table(path, MAX_BYTES, columns, problems), []  # reports its heads
    refuse(f'{shown(str(path))} is not a file that can be imported',
           Span(source, 0, 1) if content else None,
           'begins here' if content else '', f'give {_KINDS}')


def _read_xml(text: str, path: Path, form: XmlFormat,
              problems: Problems) -> list[ImportedComponent]:
    content = read_xml(text, path, form)
    return [replace(item, variables=content.variables)
            for item in read_rows(content.rows, path, problems)]


def _read_json(source: Source, path: Path,
               problems: Problems) -> tuple[list[ImportedComponent], list[Connection]]:
    value = read_json(source)
    if is_database(value):
        return [], read_database(value, path.name, problems)
    if is_project(value):
        return read_project(value, source, path.name), []
    if is_specification(value):
        return read_specification(value, path.name, path.stem, problems), []
    refuse(f'{shown(str(path))} is JSON, but not an export of FRET or Ogma',
           Span(source, 0, 1), "no 'requirements' with a 'reqid', no 'Requirements', no 'inputs'",
           f'give {_KINDS}')


def _connect(item: Connection, connections: dict[str, Connection], file: str,
             problems: Problems) -> None:
    """Add a connection; earlier files take precedence, later ones only add missing fields."""
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


# Merging descriptions of one component.

def _merged(components: Iterable[ImportedComponent]) -> list[ImportedComponent]:
    """Merge components with the same name, if at most one project has such a component."""
    found: dict[tuple[str, str], ImportedComponent] = {}
    for item in sorted(components, key=lambda item: not item.project):
        same = [key for key in found if key[1] == item.name]
        key = (item.project, item.name)
        if not item.project and len(same) == 1:
            key = same[0]
        found[key] = _joined(found[key], item) if key in found else item
    return list(found.values())


def _with_owners(components: Sequence[ImportedComponent]) -> Iterator[ImportedComponent]:
    """Add requirements without a component to the only component of their project, if any."""
    owners = list(components)
    for item in components:
        named = [place for place, one in enumerate(owners)
                 if one.name and one.requirements and one.project in ('', item.project)]
        if not item.name and len(named) == 1:
            owners[named[0]] = _joined(owners[named[0]], item)
            owners.remove(item)
    yield from owners


def _joined(first: ImportedComponent, second: ImportedComponent) -> ImportedComponent:
    return replace(first, variables=first.variables + second.variables,
                   requirements=first.requirements + second.requirements,
                   files=tuple(dict.fromkeys(first.files + second.files)),
                   keys=tuple({**dict(first.keys), **dict(second.keys)}.items()),
                   exclusions=first.exclusions + second.exclusions)


def _with_unique_ids(component: ImportedComponent, problems: Problems) -> ImportedComponent:
    """Merge entries for the same requirement or variable; make the ids of others unique."""
    requirements: list[ComponentRequirement] = []
    places: dict[str, list[int]] = {}
    for item in component.requirements:
        known = places.setdefault(item.id, [])
        same = next((place for place in known if _is_same(requirements[place], item)), None)
        if same is None:
            known.append(len(requirements))
            requirements.append(item)
        else:
            _tell_repeated(requirements[same], item, problems)
            requirements[same] = _one(requirements[same], item)
    return replace(component, requirements=tuple(_with_ids(requirements, problems)),
                   variables=tuple(_variables(component.variables)))


def _tell_repeated(first: ComponentRequirement, second: ComponentRequirement,
                   problems: Problems) -> None:
    """Report that a file has a requirement twice; several files may describe the same one."""
    labels = [item.wordings[0].label if item.wordings else '' for item in (first, second)]
    if all(labels) and labels[0].split(', ')[0] == labels[1].split(', ')[0] and (
            labels[0] != labels[1]):
        problems.warning(f'{labels[1]}: the requirement {shown(second.id)} is that of {labels[0]}',
                         None, '', 'they are one requirement')


def _sentences(item: ComponentRequirement) -> set[str]:
    return {' '.join(wording.text.split()) for wording in item.wordings
            if wording.languages == (Language.FRETISH,)}


def _is_same(first: ComponentRequirement, second: ComponentRequirement) -> bool:
    """Whether two requirements with one id are the same: their sentences do not differ."""
    if first.id != second.id:
        return False
    if _repeats(first, second):
        return True
    sentences = _sentences(first), _sentences(second)
    if all(sentences):
        return sentences[0] == sentences[1]
    files = {wording.label.split(', ')[0] for wording in first.wordings}
    return not files & {wording.label.split(', ')[0] for wording in second.wordings}


def _repeats(first: ComponentRequirement, second: ComponentRequirement) -> bool:
    """Whether two requirements have the same texts, as two rows of a table may have."""
    texts = [{' '.join(wording.text.split()) for wording in item.wordings}
             for item in (first, second)]
    return bool(texts[0]) and texts[0] == texts[1]


def _one(first: ComponentRequirement, second: ComponentRequirement) -> ComponentRequirement:
    known = {(item.languages, item.text) for item in first.wordings}
    more = tuple(item for item in second.wordings if (item.languages, item.text) not in known)
    return replace(first, wordings=first.wordings + more, title=first.title or second.title,
                   rationale=first.rationale or second.rationale,
                   modes=tuple(dict.fromkeys(first.modes + second.modes)),
                   is_assumption=first.is_assumption or second.is_assumption)


def _with_ids(requirements: Iterable[ComponentRequirement],
              problems: Problems) -> Iterator[ComponentRequirement]:
    handlers: set[str] = set()
    ids: set[str] = set()
    for item in requirements:
        usable = _usable_id(item.id)
        name = _free_id(usable, handlers)
        handlers.add(handler_name(name))
        if name != item.id:
            problems.warning(
                f'the requirement {shown(item.id)} has the id {shown(name)} in the bundle', None,
                '', 'an id is one line of printable characters, of which some fit into the name '
                'of a handler' if name == usable else 'another requirement has this id'
                if item.id in ids else 'handler names must be unique: they keep only the letters '
                "and digits of an id, and '_' for the rest")
        ids.add(item.id)
        yield replace(item, id=name, source='' if name == item.id else item.id)


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
    """Yield each variable once, merged from all its entries."""
    found: dict[str, ComponentVariable] = {}
    for item in variables:
        known = found.setdefault(fret_name(item.name), item)
        if known is not item:
            found[fret_name(item.name)] = replace(
                known, type=known.type or item.type,
                role=_role(known, item),
                assignments=known.assignments or item.assignments,
                values=known.values or item.values)
    yield from found.values()


def _role(known: ComponentVariable, item: ComponentVariable) -> VariableRole:
    """Return the role of a variable that two entries describe."""
    if item.assignments and not known.assignments:
        return item.role
    return item.role if known.role is VariableRole.INPUT else known.role


# Choosing a component.

def choose(components: Sequence[ImportedComponent], name: str | None) -> ImportedComponent:
    """
    Return the component with the given name, or the only one that has a name.

    Raises
    ------
    CompileError
        if several components fit, or none.
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
    refuse(f'there are {len(fitting)} components, but a bundle is for one: '
           + ', '.join(item.full_name for item in fitting),
           help=f'choose one: --component {fitting[0].full_name}\n'
                'or write a bundle for each into a folder: -o bundles/')
