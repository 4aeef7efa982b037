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

"""A new requirement of a form is written behind all others, however these are written."""

from pathlib import Path

from fret_monitor import editing
from fret_monitor.model.diagnostics import CompileError, Level
import pytest

INPUTS = 'format: 1\ninputs: {p: {type: bool}, q: {type: bool}}\n'
FIELDS = {'scope': '', 'condition': 'when p', 'component': 'base', 'probability': '',
          'timing': 'within 3 ticks', 'response': 'q != "x: #1"'}
SENTENCE = 'when p the base shall within 3 ticks satisfy q != "x: #1"'
BUNDLES = {
    'lines': 'requirements:\n  - id: A\n    ptltl: "p"\n',
    'as deep as its key': 'requirements:\n- {id: A, ptltl: "p"}  # one\n# last\n',
    'a block': 'requirements:\n    - id: A\n      ptltl: >\n        p &\n        q\n\n',
    'keys behind it': 'requirements:\n  - {id: A, ptltl: p}\nevaluation:\n  policy: timed\n',
    'over lines': 'requirements:\n  - {id: A,\n     ptltl: p\n    }\n',
    'brackets': 'requirements: [{id: A, ptltl: "p"}]\n',
    'brackets, lines': 'requirements: [\n  {id: A, ptltl: "p",\n   tags: {x: y}},  # }\n]\n',
    'no line end': 'requirements:\n  - {id: A, ptltl: p}',
    'empty': 'requirements: []\n',
    'nothing': 'requirements:  # none\n',
    'no key': '# none\n',
    'a mistake elsewhere': 'requirements:\n  - {id: A, ptltl: "p & r"}\n',
}


def edited(text: str) -> editing.EditedBundle:
    return editing.read_edited(Path('b.yaml'), INPUTS + text)


@pytest.mark.parametrize('name', BUNDLES)
def test_it_is_written_behind_all_others(name: str) -> None:
    before = edited(BUNDLES[name])
    edit = editing.with_requirement(before, ' B-1 ', FIELDS)
    after = editing.unchecked(Path('b.yaml'), editing.with_edits(before.source.text, [edit]))
    assert after.bundle is not None
    ids = [item.id.value for item in after.bundle.requirements]
    assert ids == (['A', 'B-1'] if 'id: A' in BUNDLES[name] else ['B-1'])
    assert after.bundle.requirements[-1].text.value == SENTENCE
    assert edit.place.start == edit.place.end  # nothing else is touched
    assert after.source.text.count('#') == before.source.text.count('#') + 1


def test_comments_of_the_item_before_stay_with_it() -> None:
    text = 'requirements:\n  - id: A\n    ptltl: p  # one\n    # two\n\n  # of none\n'
    before = edited(text)
    edit = editing.with_requirement(before, 'B', FIELDS)
    assert before.source.text[edit.place.start:] == '\n\n  # of none\n'


def test_what_is_written_is_a_requirement_of_the_bundle() -> None:
    before = edited(BUNDLES['lines'])
    fields = {**FIELDS, 'response': 'q'}
    edit = editing.with_requirement(before, 'yes: no', fields)
    after = edited(editing.with_edits(before.source.text, [edit])[len(INPUTS):])
    assert not [item for item in after.diagnostics if item.level is Level.ERROR]
    form = {item.name: item.text for item in editing.sentence_form(after, 'yes: no')}
    assert form == fields
    assert {item.name: item.words for item in editing.sentence_form(after, 'yes: no')} == {
        item.name: item.words for item in editing.blank_form()}


@pytest.mark.parametrize(('id', 'text', 'message'), [
    ('', BUNDLES['lines'], 'a requirement has an id'),
    ('A', BUNDLES['lines'], "'A' already"),
    ('B', 'requirements: {A: p}\n', 'cannot be written'),
    ('B', 'requirements: &x\n', 'cannot be written'),
])
def test_what_cannot_be_written_is_refused(id: str, text: str, message: str) -> None:
    with pytest.raises(CompileError, match=message):
        editing.with_requirement(edited(text), id, FIELDS)
