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

"""The lines of what a node watches, and those that belong to no bundle; both nodes log them."""

from pathlib import Path

from fret_monitor import build
from fret_monitor.model.policies import Policy
from fret_monitor.native import evaluator_library, load_evaluator
from fret_monitor.runtime import Engine, Evaluator
from fret_monitor.runtime.reporting import LogLevel, LogLine, Reporter, ReportTable
from fret_monitor.runtime.start_lines import restarted, WatchedBundle, watching
import pytest

ONE = """
format: 1
inputs:
  x: {topic: x, type: geometry_msgs/msg/PointStamped, field: point.x}
EVALUATION
requirements:
  - {id: R, ptltl: "x < 1"}
"""
TWO = """
format: 1
inputs:
  a: {topic: x, type: geometry_msgs/msg/PointStamped, field: point.x}
  b: {topic: x, type: geometry_msgs/msg/PointStamped, field: point.y}
  c: {topic: z, type: std_msgs/msg/Bool}
requirements:
  - {id: Q, ptltl: "a < b"}
  - {id: S, ptltl: "O c"}
"""


def reporter(folder: Path, name: str, text: str, *, policy: Policy | None = None,
             period: float | None = None, is_one_of_several: bool = False) -> Reporter:
    path = folder / f'{name}.yaml'
    path.write_text(text, encoding='utf-8')
    monitor = build.build(path).monitor
    engine = Engine(Evaluator(monitor, policy=policy, period=period))
    return Reporter(engine, ReportTable(
        monitor.manifest, name if is_one_of_several else '', policy=policy, period=period))


def state(*found: Reporter) -> str:
    number = sum(item.engine.monitor.manifest.state_bytes for item in found)
    return f'{number} byte{"s"[:number != 1]} of state'


@pytest.mark.parametrize(('evaluation', 'policy', 'period', 'terms'), [
    ('', None, None, 'every_message, '),
    ('evaluation: {policy: relevant_message}', None, None, 'relevant_message, '),
    ('evaluation: {policy: relevant_message}', Policy.ALL_INPUTS, None, 'all_inputs, '),
    ('evaluation: {policy: periodic, rate: 50}', None, None, 'periodic, 0.02 s, '),
    ('', Policy.PERIODIC, 2.5, 'periodic, 2.5 s, '),
    ('evaluation: {policy: timed}', None, None, 'timed, '),
    ('evaluation: {policy: timed, stamp: header, reorder: 0.05}', None, None,
     'timed, by the stamps of headers, reordered within 0.05 s, '),
])
def test_the_line_of_a_bundle_has_its_policy_with_what_belongs_to_it(
        evaluation: str, policy: Policy | None, period: float | None, terms: str,
        tmp_path: Path) -> None:
    one = reporter(tmp_path, 'one', ONE.replace('EVALUATION', evaluation), policy=policy,
                   period=period)
    watched = 'watching 1 requirement on 1 input of 1 topic, policy '
    assert watching([WatchedBundle(one, '')]) == [
        LogLine(LogLevel.INFO, f'{watched}{terms}{state(one)}')]
    line, = watching([WatchedBundle(one, 'one.yaml')])
    assert line.text == f'{watched}{terms}{state(one)} (one.yaml)'


def test_several_bundles_have_a_line_each_and_one_in_which_a_topic_counts_once(
        tmp_path: Path) -> None:
    found = [reporter(tmp_path, name, text.replace('EVALUATION', ''), is_one_of_several=True)
             for name, text in (('one', ONE), ('two', TWO))]
    one, two = found
    assert [line.text for line in watching([*map(WatchedBundle, found, 'ab')])] == [
        f'bundle one: 1 requirement on 1 input of 1 topic, policy every_message, {state(one)} (a)',
        f'bundle two: 2 requirements on 3 inputs of 2 topics, policy every_message, {state(two)} '
        '(b)',
        f'watching 3 requirements on 4 inputs of 2 topics in 2 bundles, {state(one, two)}']


def test_lines_of_no_bundle() -> None:
    library = load_evaluator(evaluator_library())
    assert restarted(library, 1).text == 'restarted 1 step group; input values kept'
    assert restarted(library, 2).text == 'restarted 2 step groups; input values kept'
