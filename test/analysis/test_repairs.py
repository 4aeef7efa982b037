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

"""The solver decides whether some message always satisfies what a gate keeps."""

from pathlib import Path

from fret_monitor.analysis.repairs import repairs
from fret_monitor.bundle.reader import parse_bundle
from fret_monitor.elaboration.elaborate import specify
from fret_monitor.model.diagnostics import Source
from fret_monitor.traces.gated import Repair
import pytest

BUNDLE = """
format: 1
evaluation: {policy: POLICY}
inputs:
  speed: {topic: raw, type: std_msgs/msg/Float32}
  front: {topic: front, type: std_msgs/msg/Float32}
  free: {topic: free, type: std_msgs/msg/Bool}
requirements:
  - {id: R, ptltl: "FORMULA"}
gates:
  drive: {from: raw, to: out, type: std_msgs/msg/Float32, keep: [R]}
"""
ALWAYS = Repair()


def decided(formula: str, policy: str = 'relevant_message', seconds: float = 30) -> Repair | None:
    """Return the answer about a formula; None: it is not decided."""
    text = BUNDLE.replace('FORMULA', formula).replace('POLICY', policy)
    specification, _ = specify(parse_bundle(Source('b.yaml', text), Path('.')))
    return repairs(specification, specification.gates[0], seconds).get('R')


@pytest.mark.parametrize('formula, expected', [
    ('H (front < 0.5 -> speed <= 0)', ALWAYS),
    ('H (front < 1 -> speed <= front)', ALWAYS),
    ('speed > 1 & speed < 0.5', Repair((), True)),
    ('O[2,2] (speed > 1)', Repair((), True)),
    ('speed < 1 S speed > 5', ALWAYS),
])
def test_a_first_step_can_always_be_satisfied_or_never(formula: str, expected: Repair) -> None:
    assert decided(formula) == expected


def test_the_second_step_has_nothing_two_steps_before_it() -> None:
    found = decided('FTP | O[2,2] (speed > 1)')
    assert found is not None and found.example is not None and not found.is_first


def test_other_inputs_make_it_false_whatever_passes() -> None:
    for policy in ('relevant_message', 'timed'):
        found = decided('free & speed < 1', policy)
        assert found == Repair((('free', False),))
    found = decided('H (front < 7.125 | front > 7.126 | speed > 1 & speed < 0.5)')
    assert found is not None and found.example is not None
    [(name, value)] = found.example
    assert name == 'front' and 7.125 <= value <= 7.126


def test_with_rounding_only_an_example_counts() -> None:
    found = decided('front + 1 < 7.125 | speed > 1 & speed < 0.5')
    assert found is not None and found.example is not None and not found.is_first
    # Floats confirm all combinations of these comparisons.
    assert decided('front + 1 < 7.125 -> speed + 1 < 2') == ALWAYS


def test_the_past_of_other_inputs_makes_it_false_whatever_passes() -> None:
    found = decided('H (O (front > 3) -> speed > 1 & Y (speed > 1))')
    assert found is not None and found.example is not None
    assert not found.is_first and dict(found.example)['front'] > 3
    # A message that passes satisfies it before, so that the past is never false.
    assert decided('FTP | Y (speed > 1) | speed > 1') == ALWAYS


def test_what_is_not_decided_is_left_out() -> None:
    assert decided('H (O[0, 1 s] (speed > 1))', 'timed') is None
    assert decided('speed > front', seconds=0) is None
    assert decided('O[100000,100000] (speed > 1)') is None
