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
A bundle as it is being written: its text, what is wrong with it, and what can be used of it.

`read_edited` takes the text of an editor, saved or not, and never fails: of a text with errors,
and of one that is no YAML, it keeps the names, places and types that can be read. Diagnostics are
those of `check`, without what only a compiled monitor can find about gates.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property, partial
import json
from pathlib import Path
import re

from fret_monitor.build import check_reading, read, Reading
from fret_monitor.bundle.bundle import Bundle, InputEntry
from fret_monitor.bundle.reader import BUNDLE_KEYS, SIGNALS_KEYS, survey_bundle
from fret_monitor.bundle.source_file import read_source, ReadFile
from fret_monitor.bundle.yaml_tree import Node
from fret_monitor.editing.outline import mended, OutlinePlace, place_at, top_keys
from fret_monitor.elaboration.elaborate import name_uses
from fret_monitor.elaboration.memory import RequirementMemory
from fret_monitor.elaboration.signals import FindMessage, input_declaration
from fret_monitor.elaboration.terms import Vocabulary
from fret_monitor.language.expression import Name
from fret_monitor.logic.specification import Signal
from fret_monitor.messages.installed import find_message as find_installed
from fret_monitor.model.diagnostics import CompileError, Diagnostic, Problems, Source

_OF_BUNDLES = frozenset(BUNDLE_KEYS) - frozenset(SIGNALS_KEYS)
_AROUND = '<bundle>'
_QUOTED = re.compile(r"""'[^']*'|"[^"]*"|[0-9][0-9.,e+-]*""")
_NO_LETTERS = re.compile('[^a-z]+')


@dataclass(frozen=True, eq=False)
class EditedBundle:
    """
    A bundle that is being edited, or a signals file.

    `source` is its text. `diagnostics` are its errors, or its warnings if it has none; a place may
    be in another file. `reading` is None while there are errors. `find_message` returns the layout
    of a message type.
    """

    source: Source
    diagnostics: tuple[Diagnostic, ...]
    reading: Reading | None
    find_message: FindMessage
    read_file: ReadFile

    @cached_property
    def _readable(self) -> tuple[Source, Node | None]:
        return mended(self.source)

    @property
    def tree(self) -> Node | None:
        """Its tree, as far as it is YAML."""
        return self._readable[1]

    @cached_property
    def bundle(self) -> Bundle | None:
        """What can be used of it; None if nothing can."""
        if self.reading is not None:
            return self.reading.bundle
        source = self._readable[0]
        path = Path(source.name)
        return survey_bundle(path, Problems(), read_file=lambda other: (
            source if other == path else self.read_file(other)))

    @cached_property
    def inputs(self) -> dict[str, InputEntry]:
        """Its inputs by name, also those with mistakes."""
        return {item.name.value: item for item in self.bundle.inputs} if self.bundle else {}

    @cached_property
    def _declared(self) -> dict[str, tuple[Signal | None, Vocabulary | None]]:
        found = {name: input_declaration(item, self.find_message, Problems())
                 for name, item in self.inputs.items()}
        return {name: (signal, declared.term.vocabulary)
                for name, (signal, declared) in found.items()}

    def signal(self, name: str) -> Signal | None:
        """Return an input with its type, None if it has mistakes."""
        return self._declared.get(name, (None, None))[0]

    def vocabulary(self, name: str) -> Vocabulary | None:
        """Return the names of an input's values, if it has any."""
        return self._declared.get(name, (None, None))[1]

    @cached_property
    def uses(self) -> tuple[Name, ...]:
        """Each use of a name in a formula that can be parsed."""
        return name_uses(self.bundle, self.find_message) if self.bundle else ()

    def place_at(self, offset: int) -> OutlinePlace:
        """Return where an offset of the text is."""
        return place_at(self.source, self.tree, offset)

    @property
    def is_signals(self) -> bool:
        """Whether it is a signals file."""
        return _is_signals(self.source.text)


def looks_like_a_bundle(text: str) -> bool:
    """Return whether a text is meant as a bundle or signals file, not as any other YAML."""
    keys = top_keys(text)
    return 'format' in keys or {'inputs', 'requirements'} <= keys


def _is_signals(text: str) -> bool:
    keys = top_keys(text)
    return bool(keys) and not keys & _OF_BUNDLES and bool(keys - {'format'})


def unchecked(path: Path, text: str, *, read_file: ReadFile = read_source,
              find_message: FindMessage | None = None) -> EditedBundle:
    """
    Return a bundle without its diagnostics and its reading: enough for names and completion.

    Arguments as of `read_edited`; it takes a tenth of the time.
    """
    source = Source(str(path), text)
    return EditedBundle(source, (), None, find_message or find_installed, lambda other: (
        source if other == path else read_file(other)))


def read_edited(path: Path, text: str, *, read_file: ReadFile = read_source,
                find_message: FindMessage | None = None,
                memory: RequirementMemory | None = None) -> EditedBundle:
    """
    Return a bundle as it is in an editor.

    `read_file` reads the other files that it names, such as one that is open too. Without
    `find_message`, messages are those that are installed. With a `memory`, which is of one file,
    requirements that have not changed since the last call are not read again.
    """
    found = unchecked(path, text, read_file=read_file, find_message=find_message)
    if _is_signals(text):
        return replace(found, diagnostics=tuple(_of_signals(path, found)))
    checked = _checked(path, found, memory)
    if memory is not None and any(map(partial(_is_of_earlier, found.source), checked.diagnostics)):
        return _checked(path, found, None)
    return checked


def _is_of_earlier(source: Source, found: Diagnostic) -> bool:
    """Whether a diagnostic has a place in an earlier text of a file."""
    return any(span is not None and span.source.name == source.name
               and span.source.text != source.text for span in (found.span, found.related))


def _checked(path: Path, found: EditedBundle, memory: RequirementMemory | None) -> EditedBundle:
    try:
        found = replace(found, reading=read(
            path, takes_instances=True, find_message=found.find_message,
            read_file=found.read_file, memory=memory))
        assert found.reading is not None, 'read returns one'
        return replace(found, diagnostics=check_reading(found.reading))
    except CompileError as error:
        return replace(found, diagnostics=error.diagnostics)


def _of_signals(path: Path, found: EditedBundle) -> Iterable[Diagnostic]:
    """Yield the errors of a signals file, as of a bundle that takes it."""
    around = path.with_name(_AROUND)
    text = (f'format: 1\nsignals: {json.dumps(path.name, ensure_ascii=False)}\nrequirements: '
            '[{id: R, ptltl: "TRUE"}]\n')

    def read_file(other: Path) -> Source:
        return Source(_AROUND, text) if other == around else found.read_file(other)

    try:
        read(around, takes_instances=True, find_message=found.find_message, read_file=read_file)
    except CompileError as error:
        for item in error.diagnostics:
            if item.span is None or item.span.source.name == found.source.name:
                yield item


def code_of(found: Diagnostic) -> str:
    """Return the kind of a diagnostic: its title without what is in quotes, and numbers."""
    return _NO_LETTERS.sub('-', _QUOTED.sub('', found.title.lower())).strip('-')
