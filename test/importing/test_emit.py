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

"""Everything written into a bundle is read back unchanged."""

from pathlib import Path

from fret_monitor.bundle.bundle import Language
from fret_monitor.bundle.reader import parse_bundle
from fret_monitor.importing.component import ComponentRequirement
from fret_monitor.importing.draft import Draft, DraftDefinition, DraftRequirement
from fret_monitor.importing.emit import emit
from fret_monitor.model.diagnostics import Source
from hypothesis import example, given, settings, strategies as st

ODD = st.text(st.characters(exclude_categories=['Cs']), min_size=1).filter(str.strip)
PLAIN = st.text('ab |&#:-"\'\\{}[]<>%@!,?*\n\t', min_size=1, max_size=200).filter(str.strip)
TEXTS = ODD | PLAIN


def draft(formula: str, note: str, title: str) -> Draft:
    """Return a draft with texts in all places that hold them."""
    return Draft(
        component='c', files=(note,), constants=(), inputs=(),
        definitions=(DraftDefinition('d', Language.PTLTL, formula),
                     DraftDefinition('e', Language.COCOSPEC, formula)),
        requirements=(DraftRequirement('on', Language.FRETISH, formula, title, note),),
        left_out=((ComponentRequirement(note, ()), title),), unused=(note,),
        todo=(f'{note}\n{title}',), comparisons=())


@settings(max_examples=150)
@given(TEXTS, TEXTS, TEXTS)
@example('a: b # c', 'x\n\n  y\n', '- a')
@example("it's", ' x\ny', '"')
@example('a\xa0b ' * 60 + 'c', 'x\ny\n ', 'a  b' * 40)
@example('a' * 200, 'a\n' * 3, 'b ' * 90 + 'c')
@example('\u2028 \x85 \ufeff', '\x07', '\U0001f600')
def test_texts_are_read_back_as_they_were(formula: str, note: str, title: str) -> None:
    bundle = parse_bundle(Source('b.yaml', emit(draft(formula, note, title))), Path('.'))
    [item] = bundle.requirements
    assert (item.id.value, item.text.value, item.title, item.rationale) == (
        'on', formula, title, note)
    assert [one.text.value for one in bundle.definitions] == [formula, formula]


def test_a_long_sentence_is_folded_and_a_note_stands_in_lines() -> None:
    text = emit(draft('word ' * 40 + 'end', 'first\nsecond', 't'))
    assert '    fretish: >-\n      word word' in text
    assert '  - id: "on"\n' in text
    assert '    rationale: |-\n      first\n      second\n' in text
    assert max(map(len, text.splitlines())) < 100
