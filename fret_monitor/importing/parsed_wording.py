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
Parsed wordings of requirements: the tree of each, and the names in it.

The order of wordings is FRET's sentence, its past-time MTL, its CoCoSpec. A wording that cannot
be parsed keeps its diagnostics; they become warnings if another wording is valid.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TypeAlias

from fret_monitor.bundle.bundle import Language
from fret_monitor.elaboration.languages import read_formula
from fret_monitor.elaboration.types_by_use import TypesByUse
from fret_monitor.importing.component import Wording
from fret_monitor.language.expression import Equations, Expression, Name, postorder
from fret_monitor.language.sentence import Sentence
from fret_monitor.model.diagnostics import CompileError, Diagnostic, Source, Text
from fret_monitor.model.names import fret_name

Tree: TypeAlias = Expression | Equations | Sentence
_MOST_KEPT = 2 ** 17


@dataclass(frozen=True, eq=False)
class ParsedWording:
    """A wording with the language that parses it; `tree` is None if none does."""

    wording: Wording
    language: Language
    text: Text
    tree: Tree | None
    diagnostics: tuple[Diagnostic, ...] = ()


def parse_wording(wording: Wording) -> ParsedWording:
    """Parse a wording in the first of its languages that accepts it."""
    return replace(_parsed(wording))  # its identity is that of a requirement


@lru_cache(_MOST_KEPT)
def _parsed(wording: Wording) -> ParsedWording:
    text = Text.whole(Source(wording.label, wording.text)) if wording.place is None else \
        _of_its_own(wording.place)
    if wording.fault is not None:
        return ParsedWording(wording, wording.languages[0], text, None, (wording.fault,))
    failed: list[ParsedWording] = []
    for language in wording.languages:
        try:
            return ParsedWording(wording, language, text, read_formula(language, text))
        except CompileError as error:
            failed.append(ParsedWording(wording, language, text, None, error.diagnostics))
    return failed[0]


def _of_its_own(text: Text) -> Text:
    """Return a text in a source that no other wording has: errors are sorted by their sources."""
    return replace(text, source=replace(text.source))


def expressions(tree: Tree) -> Iterator[tuple[Expression, str]]:
    """Yield the expressions of a tree, each with its name ('' for a Boolean without a name)."""
    match tree:
        case Equations():
            yield from ((item.expression, item.name) for item in tree.equations)
        case Sentence():
            parts = (tree.scope and tree.scope.mode, tree.condition and tree.condition.expression,
                     tree.timing and tree.timing.stop, tree.response)
            yield from ((part, '') for part in parts if part)
        case _:
            yield tree, ''


def _free_names(tree: Tree) -> Iterator[Name]:
    """Yield the names that a tree uses and does not define, except FTP."""
    own = {item.name for item in tree.equations} if isinstance(tree, Equations) else set()
    for expression, _ in expressions(tree):
        for node in postorder(expression):
            if isinstance(node, Name) and node.text not in own and node.text != 'FTP':
                yield node


def names_in(reading: ParsedWording) -> Iterator[str]:
    """Yield the names that a wording uses and does not define, except FTP."""
    if reading.tree is not None:
        yield from (node.text for node in _free_names(reading.tree))


def rename(reading: ParsedWording, names: Mapping[str, str]) -> ParsedWording:
    """Return a wording with names replaced; `names` maps each `fret_name` to a new name."""
    if reading.tree is None:
        return reading
    if not any(fret_name(name) in names for name in names_in(reading)):
        return reading
    if reading.wording.place is not None:  # places are to be those in the text
        reading = parse_wording(replace(reading.wording, place=None))
    assert reading.tree is not None
    places = {node.span: names[fret_name(node.text)] for node in _free_names(reading.tree)
              if fret_name(node.text) in names}
    text = reading.wording.text
    for span, name in sorted(places.items(), key=lambda item: item[0].start, reverse=True):
        text = text[:span.start] + name + text[span.end:]
    return parse_wording(replace(reading.wording, text=text))


def add_uses(reading: ParsedWording, name: str, types: TypesByUse) -> None:
    """Add the uses of names in the definition of `name`, or with '' in a property."""
    if reading.tree is None or isinstance(reading.tree, Equations):
        return
    for expression, _ in expressions(reading.tree):
        if name:
            types.add_definition(name, expression)
        else:
            types.add_property(expression)


def used_names(reading: ParsedWording) -> set[str]:
    """Return the names that a wording uses, as `fret_name` spells them."""
    return {fret_name(name) for name in names_in(reading)}
