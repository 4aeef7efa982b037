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
Where a name of a bundle is declared and used, and how to give it another one.

The names are those of inputs, constants and definitions, in all files of the bundle, and the ids
of requirements and the names of actions where others refer to them.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from fret_monitor.bundle.bundle import Bundle, Language
from fret_monitor.editing.edited_bundle import EditedBundle, read_edited
from fret_monitor.editing.edits import edited as with_edits, TextEdit
from fret_monitor.editing.formulas import formula_at, owner_at, word_at, written_name
from fret_monitor.editing.outline import ITEM
from fret_monitor.model.diagnostics import Level, refuse, Source, Span, Text
from fret_monitor.model.names import fret_name, quoted_name_fault


@dataclass(frozen=True)
class NamedThing:
    """
    What a name stands for: its declarations and its uses; `name` is as declared.

    `is_formula_name` are inputs, constants and definitions.
    """

    name: str
    declarations: tuple[Span, ...]
    uses: tuple[Span, ...]
    is_formula_name: bool


def thing_at(edited: EditedBundle, offset: int) -> NamedThing | None:
    """Return what the name at an offset stands for, None if there is no name."""
    place = edited.place_at(offset)
    if place.scalar is None:
        return None
    if formula_at(place) is not None:
        word = word_at(place.scalar.text, offset)
        return word and _declared(edited, word.text.strip('"'))
    value = place.scalar.value
    match (place.path, place.is_key):
        case ((('inputs' | 'constants' | 'definitions'),), True) | (('topics', _, 'fields'), True):
            return _declared(edited, value.strip('"'))
        case (('requirements', step, 'id'), False) if step == ITEM:
            return _requirement(edited, value)
        case ((*_, 'keep') | (*_, 'keep', '[]'), False):
            return _requirement(edited, value)
        case (('actions',), True):
            return _action(edited, value)
        case ((*_, ('on_violation' | 'on_end')) | (*_, ('on_violation' | 'on_end'), '[]'), False):
            return _action(edited, value)
        case _:
            return None


def definition(edited: EditedBundle, offset: int) -> tuple[Span, ...]:
    """Return where the name at an offset is declared; () if there is none."""
    found = thing_at(edited, offset)
    return found.declarations if found else ()


def references(edited: EditedBundle, offset: int) -> tuple[Span, ...]:
    """Return where the name at an offset is used, its declarations first."""
    found = thing_at(edited, offset)
    return (*found.declarations, *found.uses) if found else ()


def rename(edited: EditedBundle, offset: int, name: str) -> tuple[TextEdit, ...]:
    """
    Return what to write to give the input, constant or definition at an offset another name.

    Raises
    ------
    CompileError
        if there is none, the bundle has errors, or the name is not free: it must mean the same
        everywhere afterwards.
    """
    found = thing_at(edited, offset)
    place = Span(edited.source, offset, offset)
    if found is None or not found.is_formula_name or not found.declarations:
        refuse('only inputs, constants and definitions can be renamed', place)
    _refuse_errors(edited, place)
    fault = quoted_name_fault(name)
    if fault is not None:
        refuse(fault.reason, place, help=fault.help)
    edits = tuple(TextEdit(span, _declaration(span, name)) for span in found.declarations) + tuple(
        TextEdit(span, written_name(name, _language(edited, span))) for span in found.uses)
    _check(edited, found, edits, name, place)
    return edits


def _refuse_errors(edited: EditedBundle, place: Span) -> None:
    error = next((item for item in edited.diagnostics if item.level is Level.ERROR), None)
    if error is not None:
        refuse('nothing can be renamed while the bundle has errors', place,
               help=error.in_one_line)


def _declaration(span: Span, name: str) -> str:
    """Return a name as the key of a mapping, in the quotes that the old one has."""
    written = written_name(name, Language.PTLTL)
    if written != name:
        return f"'{written}'"
    old = span.source.text[span.start:span.end]
    return f'{old[0]}{name}{old[0]}' if old[0] in '"\'' and not old.startswith("'\"") else name


def _language(edited: EditedBundle, span: Span) -> Language:
    owner = owner_at(edited, span.start)
    return owner.language if owner else Language.PTLTL


def _check(edited: EditedBundle, found: NamedThing, edits: tuple[TextEdit, ...], name: str,
           place: Span) -> None:
    """Refuse a name unless the bundle with the edits has no errors, and the same uses."""
    texts = {Path(source.name): with_edits(source.text, [
        edit for edit in edits if edit.place.source.name == source.name])
        for source in _sources(edited)}
    path = Path(edited.source.name)

    def read_file(other: Path) -> Source:
        return Source(str(other), texts[other]) if other in texts else edited.read_file(other)

    after = read_edited(path, texts[path], find_message=edited.find_message, read_file=read_file)
    error = next((item for item in after.diagnostics if item.level is Level.ERROR), None)
    if error is not None:
        refuse(f"'{found.name}' cannot be named '{name}'", place, error.title, error.help)
    if len(after.uses) != len(edited.uses):
        refuse(f"'{name}' has another meaning here", place, '', 'choose another name')


def _sources(edited: EditedBundle) -> tuple[Source, ...]:
    return edited.bundle.sources if edited.bundle else (edited.source,)


def _declared(edited: EditedBundle, name: str) -> NamedThing | None:
    """Return an input, constant or definition by its name, in either spelling."""
    spelled = fret_name(name)
    bundle = edited.bundle
    names = [text for text in _formula_names(bundle) if fret_name(text.value) == spelled] \
        if bundle else []
    if not names:
        return None
    uses = tuple(item.span for item in edited.uses if fret_name(item.text) == spelled)
    return NamedThing(names[0].value, tuple(_key(text) for text in names), uses, True)


def _formula_names(bundle: Bundle) -> Iterator[Text]:
    yield from (item.name for item in bundle.inputs)
    yield from (item.name for item in bundle.constants)
    yield from (item.name for item in bundle.definitions)


def _key(text: Text) -> Span:
    """Return the place of a key with its quotes."""
    source, start, end = text.source, text.span.start, text.span.end
    while source.text[start - 1:start] == source.text[end:end + 1] != '' and (
            source.text[end] in '"\''):
        start, end = start - 1, end + 1
    return Span(source, start, end)


def _requirement(edited: EditedBundle, name: str) -> NamedThing | None:
    if edited.bundle is None:
        return None
    ids = [item.id.span for item in edited.bundle.requirements if item.id.value == name]
    uses = [text.span for gate in edited.bundle.gates for text in gate.keep if text.value == name]
    return NamedThing(name, tuple(ids), tuple(uses), False)


def _action(edited: EditedBundle, name: str) -> NamedThing | None:
    bundle = edited.bundle
    if bundle is None:
        return None
    places = dict.fromkeys(text.span for item in bundle.requirements
                           for text in (*item.on_violation, *item.on_end) if text.value == name)
    declared = tuple(item.name.span for item in bundle.actions if item.name.value == name)
    return NamedThing(name, declared, tuple(places), False)
