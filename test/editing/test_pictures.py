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

"""A bundle as a picture, and a sentence as a form."""

from pathlib import Path

from fret_monitor import editing
from fret_monitor.editing import PictureKind, sentence_of
from fret_monitor.model.diagnostics import CompileError, Level, Source
import pytest

SIGNALS = 'inputs:\n  battery: {topic: battery, type: std_msgs/msg/Float64}\n'
BUNDLE = """\
format: 1
signals: signals.yaml
inputs:
  speed: {topic: odom, type: nav_msgs/msg/Odometry, field: twist.twist.linear.x}
  turn: {topic: odom, type: nav_msgs/msg/Odometry, field: twist.twist.angular.z}
  unread: {topic: other, type: std_msgs/msg/Bool}
definitions:
  fast: speed > 1.5
  wild: fast & turn > 1
actions:
  stop: {lock: {topic: e_stop}}
requirements:
  - id: SLOW
    fretish: when battery < 0.2 the base shall within 3 seconds satisfy ! fast
    on_violation: stop
  - {id: CALM, ptltl: "! wild"}
"""


def edited(text: str = BUNDLE) -> editing.EditedBundle:
    return editing.read_edited(Path('b.yaml'), text, read_file=lambda path: Source(
        str(path), SIGNALS))


def links(found: editing.Picture) -> set[tuple[str, str]]:
    return {(found.nodes[begin].name, found.nodes[end].name) for begin, end in found.links}


def test_a_picture_has_what_is_read_and_what_reads_it() -> None:
    found = editing.picture(edited())
    assert [(node.kind, node.name) for node in found.nodes] == [
        *((PictureKind.TOPIC, name) for name in ('odom', 'other', 'battery')),
        *((PictureKind.INPUT, name) for name in ('speed', 'turn', 'unread', 'battery')),
        *((PictureKind.DEFINITION, name) for name in ('fast', 'wild')),
        *((PictureKind.REQUIREMENT, name) for name in ('SLOW', 'CALM')),
        (PictureKind.ACTION, 'stop')]
    assert links(found) == {
        ('battery', 'battery'), ('odom', 'speed'), ('odom', 'turn'), ('other', 'unread'),
        ('speed', 'fast'), ('fast', 'wild'), ('turn', 'wild'), ('battery', 'SLOW'),
        ('fast', 'SLOW'), ('wild', 'CALM'), ('SLOW', 'stop')}


def test_what_is_broken_is_so_in_the_picture() -> None:
    found = editing.picture(edited(BUNDLE.replace('! wild', '! wildd')))
    assert {node.name: node.level for node in found.nodes if node.level} == {'CALM': Level.ERROR}
    assert ('wild', 'CALM') not in links(found) and ('fast', 'SLOW') in links(found)
    assert editing.picture(edited('{')).nodes == ()


STYLES = ['fretish: {}', 'fretish: "{}"', "fretish: '{}'", 'fretish: >\n      {}',
          'fretish: |-\n      {}\n']
SENTENCE = 'in landing mode when p & q the base shall within 3 seconds satisfy r'


def bundle(style: str, sentence: str) -> str:
    inputs = ''.join(f'  {name}: {{type: bool}}\n' for name in ('landing', 'p', 'q', 'r'))
    return (f'format: 1\ninputs:\n{inputs}requirements:\n  - id: R\n    {style}\n'
            '    title: a # b\n').replace('{}', sentence)


@pytest.mark.parametrize('style', STYLES)
def test_the_fields_of_a_sentence_are_written_back(style: str) -> None:
    text = bundle(style, SENTENCE)
    found = edited(text)
    fields = {item.name: item.text for item in editing.sentence_form(found, 'R')}
    assert fields == {
        'scope': 'in landing mode', 'condition': 'when p & q', 'component': 'base',
        'probability': '', 'timing': 'within 3 seconds', 'response': 'r'}
    assert sentence_of(fields) == SENTENCE
    new = {**fields, 'scope': '', 'condition': 'upon q', 'response': 'r | "p"'}
    after = editing.with_edits(text, [editing.with_sentence(found, 'R', new)])
    assert after.endswith('title: a # b\n') and 'landing mode' not in after
    again = edited(after)
    assert not [item for item in again.diagnostics if item.level is Level.ERROR]
    assert {item.name: item.text for item in editing.sentence_form(again, 'R')} == new


def test_a_form_proposes_words_and_takes_a_sentence_that_is_half_typed() -> None:
    found = edited(bundle(STYLES[0], SENTENCE))
    words = {item.name: item.words for item in editing.sentence_form(found, 'R')}
    assert {'within', 'always', 'until'} <= {*words['timing']}
    assert {'when', 'upon', 'in'} <= {*words['condition']} and 'the' not in words['scope']
    half = editing.with_edits(found.source.text, [editing.with_sentence(found, 'R', {
        'component': 'base', 'timing': 'within', 'response': 'r'})])
    again = edited(half)
    assert editing.sentence_form(again, 'R') == () and again.diagnostics
    whole = editing.with_edits(half, [editing.with_sentence(again, 'R', {
        'component': 'base', 'timing': 'within 2 seconds', 'response': 'r'})])
    assert edited(whole).reading is not None


def test_what_is_no_sentence_of_this_file_has_no_form() -> None:
    found = edited()
    assert editing.sentence_form(found, 'CALM') == ()
    with pytest.raises(CompileError, match="no requirement 'NONE'"):
        editing.sentence_form(found, 'NONE')
