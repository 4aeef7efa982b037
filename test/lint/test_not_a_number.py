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

"""NaN makes no requirement of a gate or a lock weaker without a warning."""

from pathlib import Path

from lint.warned import warned
import pytest

BUNDLE = """
format: 1
evaluation: {policy: relevant_message}
inputs:
  speed: {topic: raw, type: std_msgs/msg/Float32}
  x: {topic: front, type: std_msgs/msg/Float32, timeout: 0.5}
  y: {topic: other, type: std_msgs/msg/Float32, timeout: 0.5}
  t: {topic: odom, type: nav_msgs/msg/Odometry, field: header.stamp, timeout: 0.5}
  n: {topic: count, type: std_msgs/msg/Int32, timeout: 0.5}
  b: {topic: flag, type: std_msgs/msg/Bool, timeout: 0.5}
definitions:
  near: x < 1.0
requirements:
  - {id: R, %s}
gates:
  drive: {from: raw, to: out, type: std_msgs/msg/Float32, keep: [R], otherwise: drop}
"""


def warnings(folder: Path, requirement: str) -> list[tuple[str, str]]:
    """Return the titles and the advice of the warnings of NaN, of a gate that keeps one."""
    return [(title, help_) for title, help_ in warned(folder, BUNDLE % requirement)
            if 'NaN' in title]


@pytest.mark.parametrize('formula, names, strict, loose', [
    ('H (x < 1.0 -> speed <= 0.0)', 'x', '!(x >= 1.0)', 'x < 1.0'),
    ('near -> speed <= 0.0', 'x', '!(x >= 1.0)', 'x < 1.0'),
    ('speed <= 0.0 | !(x <= 1.0)', 'x', '!(x > 1.0)', 'x <= 1.0'),
    ('speed != 3.0', 'speed', '(speed < 3.0 | speed > 3.0)', 'speed != 3.0'),
    ('x = 3.0 -> b', 'x', '!(x < 3.0 | x > 3.0)', 'x = 3.0'),
    ('abs(x) - n > y -> speed <= 0.0', 'x or y', '!(abs(x) - n <= y)', 'abs(x) - n > y'),
    ('speed > 1.0 -> !(O[0,3] (x < 1.0))', 'x', '!(x >= 1.0)', 'x < 1.0'),
    ('(Y (x < 1.0)) -> speed <= 0.0', 'x', '!(x >= 1.0)', 'x < 1.0'),
    ('((b S (x > 1.0)) -> speed <= 0.0)', 'x', '!(x <= 1.0)', 'x > 1.0'),
    ('!(min(x, 5.0) >= 1.0) -> speed <= 0.0', 'x', 'min(5.0, x)', 'min(x, 5.0)'),
    ('!(max(x, y) >= 1.0) -> speed <= 0.0', 'x', 'max(y, x)', 'max(x, y)'),
    ('min(5.0, x) < 1.0 -> speed <= 0.0', 'x', '!(min(5.0, x) >= 1.0)', 'min(5.0, x) < 1.0'),
])
def test_a_comparison_that_nan_makes_weaker_is_warned_of(
        tmp_path: Path, formula: str, names: str, strict: str, loose: str) -> None:
    found = warnings(tmp_path, f'ptltl: "{formula}"')
    assert (f'R requires less while {names} is NaN',
            f'write {strict} instead of {loose}') in found
    rewritten = formula.replace('near', loose).replace(loose, strict)
    left = [title for title, _ in warnings(tmp_path, f'ptltl: "{rewritten}"')]
    assert not any(f'while {names} is' in title for title in left)


@pytest.mark.parametrize('formula', [
    '!(x >= 1.0) -> speed <= 0.0', 'speed <= 1.0 | x > 5.0', 'b -> speed <= 0.0 & x > 0.2',
    'n < 1 -> speed <= 0.0', 't < 5.0 -> speed <= 0.0', 'b -> n != 3',
    'H (x >= 0.0 & (x < 1.0 -> speed <= 0.0))',
    '!(x >= 1.0) | x < 1.0 -> speed <= 0.0', 'O[0,3] (x > 1.0)', 'x >= 1.0 S b',
    '!(x >= 1.0) & Y (x >= 1.0) -> speed <= 0.0', '(x < 1.0 <-> b) & speed <= 1.0',
    '!(min(5.0, x) >= 1.0) -> speed <= 0.0', 'min(x, 0.5) < 1.0 -> speed <= 0.0',
])
def test_a_comparison_that_nan_makes_stronger_is_not(tmp_path: Path, formula: str) -> None:
    assert warnings(tmp_path, f'ptltl: "{formula}"') == []


@pytest.mark.parametrize('timing', [
    'immediately', 'always', 'eventually', 'within 3 ticks', 'for 3 ticks', 'after 3 ticks',
    'at the next timepoint', 'until !(y <= 1.0)', 'before !(y <= 1.0)', 'never'])
@pytest.mark.parametrize('word', ['when', 'whenever'])
def test_the_advice_holds_in_sentences(tmp_path: Path, timing: str, word: str) -> None:
    def inputs(condition: str) -> str:
        sentence = f'{word} {condition} the base shall {timing} satisfy speed <= 0.0'
        return ' '.join(title for title, _ in warnings(tmp_path, f'fretish: "{sentence}"'))

    assert 'x is' not in inputs('!(x >= 1.0)')
    assert 'x is' in inputs('x < 1.0')


@pytest.mark.parametrize('formula, is_warned', [
    ('(if b then x else 0.5) < 1.0 => speed <= 0.0', True),
    ('(if b then x < 1.0 else false) => speed <= 0.0', True),
    ('(if x = x then x else 0.5) < 1.0 => speed <= 0.0', False),
    ('(if b then not (x >= 1.0) else true) => speed <= 0.0', False),
    ('if x >= 1.0 then speed <= 1.0 else speed <= 0.0', False),
    ('if b then x < 1.0 => speed <= 0.0 else speed <= 0.0', True)])
def test_choices_in_lustre(tmp_path: Path, formula: str, is_warned: bool) -> None:
    assert any('x is NaN' in title for title, _ in warnings(
        tmp_path, f'cocospec: "{formula}"')) == is_warned
