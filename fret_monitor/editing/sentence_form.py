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

"""A FRETish sentence as a form: its fields as texts, and what to write when one has changed."""

from collections.abc import Mapping
import json
from pathlib import Path
from typing import NamedTuple

from fret_monitor.bundle.bundle import Language, Requirement
from fret_monitor.editing.edited_bundle import EditedBundle, unchecked
from fret_monitor.editing.edits import edited as with_edits, TextEdit
from fret_monitor.language.fretish import continue_fretish, parse_fretish
from fret_monitor.language.sentence import Sentence
from fret_monitor.model.diagnostics import CompileError, refuse, Source, Text

FIELDS = ('scope', 'condition', 'component', 'probability', 'timing', 'response')
"""The fields of a sentence, in the order in which they are written."""

_OF_SENTENCES = ('the', 'shall', 'satisfy')


class SentenceField(NamedTuple):
    """A field: its name, what is written in it, and words with which it may begin."""

    name: str
    text: str
    words: tuple[str, ...]


def sentence_form(edited: EditedBundle, id: str) -> tuple[SentenceField, ...]:
    """Return the fields of a requirement; () if it is not a sentence that can be parsed."""
    item = _requirement(edited, id)
    if item.language is not Language.FRETISH:
        return ()
    try:
        sentence = parse_fretish(_on_one_line(item.text.value))
    except CompileError:
        return ()
    texts = _texts(sentence)
    return tuple(item._replace(text=texts[item.name]) for item in blank_form())


def blank_form() -> tuple[SentenceField, ...]:
    """Return the fields of a sentence in which nothing is written yet."""
    return tuple(SentenceField(name, '', _words(name)) for name in FIELDS)


def _texts(sentence: Sentence) -> dict[str, str]:
    parts = {'scope': sentence.scope, 'condition': sentence.condition,
             'probability': sentence.probability, 'timing': sentence.timing}
    return {**{name: part.span.written if part else '' for name, part in parts.items()},
            'component': sentence.component.name, 'response': sentence.response.span.written}


def _words(name: str) -> tuple[str, ...]:
    """Return the words with which a field may begin."""
    match name:
        case 'scope' | 'condition':
            found = continue_fretish('')
        case 'timing' | 'probability':
            found = continue_fretish('the it shall ')
        case _:
            found = None
    return tuple(word for word in found.words if word not in _OF_SENTENCES) if found else ()


def sentence_of(fields: Mapping[str, str]) -> str:
    """Return the sentence that the fields of a form make."""
    texts = {name: ' '.join(fields.get(name, '').split()) for name in FIELDS}
    component = texts['component']
    parts = (texts['scope'], texts['condition'], 'the' if component else '', component, 'shall',
             texts['probability'], texts['timing'], 'satisfy', texts['response'])
    return ' '.join(filter(None, parts))


def with_sentence(edited: EditedBundle, id: str, fields: Mapping[str, str]) -> TextEdit:
    """
    Return what to write so that a requirement is the sentence of a form.

    Raises
    ------
    CompileError
        if it cannot be written there.
    """
    item = _requirement(edited, id)
    sentence = sentence_of(fields)
    edit = _edit(edited, item.text, sentence)
    after = unchecked(Path(edited.source.name), with_edits(edited.source.text, [edit]),
                      read_file=edited.read_file, find_message=edited.find_message)
    written = [each.text.value for each in after.bundle.requirements
               if each.id.value == id] if after.bundle else []
    if [' '.join(text.split()) for text in written] != [sentence]:
        refuse(f"the sentence of '{id}' cannot be replaced here", item.text.span,
               help='change it in the text')
    return edit


def _edit(edited: EditedBundle, text: Text, sentence: str) -> TextEdit:
    """Replace a value of YAML, in quotes unless it is a block."""
    scalar = edited.place_at(text.span.start).scalar
    if scalar is None or scalar.style in ('|', '>'):
        return TextEdit(text.at(0, len(text.value.rstrip())), sentence)
    return TextEdit(scalar.span, json.dumps(sentence, ensure_ascii=False))


def _requirement(edited: EditedBundle, id: str) -> Requirement:
    found = [item for item in edited.bundle.requirements if item.id.value == id] \
        if edited.bundle else []
    if len(found) != 1 or found[0].text.source.name != edited.source.name:
        refuse(f"there is no requirement '{id}' in this file")
    return found[0]


def _on_one_line(text: str) -> Text:
    return Text.whole(Source('<sentence>', ' '.join(text.split())))
