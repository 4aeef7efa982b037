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

"""What is refused of sentences with probabilities, with its place; and what is taken over."""

from fractions import Fraction
from pathlib import Path

from bundles import write_bundle
from fret_monitor.build import read
from fret_monitor.logic.formula import NotRefuted
from fret_monitor.model.diagnostics import CompileError
import pytest

HEAD = """format: 1
inputs:
  c: {topic: c, type: std_msgs/msg/Bool}
  r: {topic: r, type: std_msgs/msg/Bool}
"""
SENTENCE = 'upon c the robot shall with probability > 0.98 within 2 ticks satisfy r'
ITEM = f'  - {{id: P, fretish: {SENTENCE}}}\n'


def refused(folder: Path, text: str) -> str:
    with pytest.raises(CompileError) as error:
        read(write_bundle(folder, text), takes_instances=True)
    return str(error.value)


def test_a_requirement_has_its_probability_and_the_confidence_of_the_bundle(
        tmp_path: Path) -> None:
    text = f'{HEAD}confidence: 0.9\nrequirements:\n{ITEM}' \
        f'  - {{id: Q, confidence: 0.75, fretish: {SENTENCE}}}\n'
    first, second = read(write_bundle(tmp_path, text)).specification.properties
    assert first.probability is not None and second.probability is not None
    assert first.probability.bound == Fraction('0.98')
    assert (first.probability.confidence, second.probability.confidence) == (
        Fraction(9, 10), Fraction(3, 4))
    assert isinstance(first.formula, NotRefuted)
    assert first.formula.limit == 10.0
    assert first.probability.required == '> 0.98'


@pytest.mark.parametrize(('text', 'expected'), [
    (f'{HEAD}requirements:\n  - {{id: P, confidence: 0.9, ptltl: c}}\n',
     "P has a 'confidence' and no probability"),
    (f'{HEAD}confidence: 1\nrequirements:\n{ITEM}', "'confidence' is out of range"),
    (f'{HEAD}confidence: 0.2\nrequirements:\n{ITEM}', "'confidence' is out of range"),
    (f'{HEAD}requirements:\n{ITEM.replace("within 2 ticks", "always")}',
     'only by failing: its scope has no end'),
    (f'{HEAD}requirements:\n{ITEM.replace("within 2 ticks", "")}',
     'only by succeeding: its scope has no end'),
    (f'{HEAD}evaluation: {{policy: timed, unit: 1}}\nrequirements:\n'
     f'{ITEM.replace("upon", "whenever").replace("ticks", "seconds")}',
     'would begin a trial each nanosecond'),
    (f'{HEAD}actions:\n  stop: {{lock: {{topic: e_stop}}}}\nrequirements:\n'
     f'  - {{id: P, on_violation: [stop], fretish: {SENTENCE}}}\n',
     "the lock 'stop' cannot follow 'P': it is about a probability"),
    (f'{HEAD}gates:\n  g: {{from: c, to: c_checked, type: std_msgs/msg/Bool, keep: [P]}}\n'
     f'requirements:\n{ITEM}', "the gate 'g' cannot keep 'P': it is about a probability"),
    (HEAD.replace('topic: r,', 'topic: "/{x}/r",').replace(
        'inputs', 'for_each: {x: [a]}\ninputs') + f'requirements:\n{ITEM}',
     "P is about a probability, and one for each 'x'"),
])
def test_what_cannot_be_tested_is_refused_with_its_place(
        tmp_path: Path, text: str, expected: str) -> None:
    found = refused(tmp_path, text)
    assert expected in found
    assert 'bundle.yaml:' in found


def test_a_scope_that_ends_gives_always_an_end(tmp_path: Path) -> None:
    text = f'{HEAD}requirements:\n' + ITEM.replace('upon c', 'while c').replace(
        'within 2 ticks', 'always')
    assert read(write_bundle(tmp_path, text)).specification.properties
