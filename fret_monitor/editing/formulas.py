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

"""The formulas of a bundle that is being edited: which language a place has, and its words."""

from collections.abc import Iterator
import re
from typing import NamedTuple

from fret_monitor.bundle.bundle import Definition, Language, Requirement
from fret_monitor.bundle.formulas import FORMULA_KEYS
from fret_monitor.editing.edited_bundle import EditedBundle
from fret_monitor.editing.outline import ITEM, OutlinePlace
from fret_monitor.language.fretish_words import WORDS
from fret_monitor.model.diagnostics import Span, Text
from fret_monitor.model.names import name_fault

WORD = re.compile(r'"(?:[^"\\]|\\.)*"|[A-Za-z_$][\w$]*(?:[.%][\w$]+)*')
"""A name or word of a formula; a name with special characters is in quotes."""


class FormulaPlace(NamedTuple):
    """The language at a place, and whether it is a definition."""

    language: Language
    is_definition: bool


def formula_at(place: OutlinePlace) -> FormulaPlace | None:
    """Return the language of the formula that a place is in, None if it is in none."""
    if place.is_key:
        return None
    match place.path:
        case ('requirements', step, key) if step == ITEM and key in FORMULA_KEYS:
            return FormulaPlace(Language(key), False)
        case ('definitions', _, key) if key in FORMULA_KEYS:
            return FormulaPlace(Language(key), True)
        case ('definitions', _):
            return FormulaPlace(Language.PTLTL, True)
        case _:
            return None


class WordPlace(NamedTuple):
    """A word of a text, with its place."""

    text: str
    place: Span


def word_at(text: Text, offset: int) -> WordPlace | None:
    """Return the word of a formula at an offset of the file, or just before it."""
    for match in WORD.finditer(text.value):
        span = text.at(*match.span())
        if span.start <= offset <= span.end:
            return WordPlace(match[0], span)
    return None


def owner_at(edited: EditedBundle, offset: int) -> Requirement | Definition | None:
    """Return the requirement or definition whose id, name or formula an offset is in."""
    return next((item for item in _owners(edited) for text in (
        item.id if isinstance(item, Requirement) else item.name, item.text)
        if text.source.name == edited.source.name and text.value
        and text.span.start <= offset <= text.span.end), None)


def _owners(edited: EditedBundle) -> Iterator[Requirement | Definition]:
    if edited.bundle is not None:
        yield from edited.bundle.requirements
        yield from edited.bundle.definitions


def written_name(name: str, language: Language) -> str:
    """Return a name as a formula has it: in quotes if it is a keyword, or has other characters."""
    is_keyword = language is Language.FRETISH and name.lower() in WORDS
    return f'"{name}"' if name_fault(name) or is_keyword else name
