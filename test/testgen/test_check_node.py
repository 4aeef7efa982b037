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

"""Properties of nodes: traces of inputs that Hypothesis draws, and the shortest that violates."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from fret_monitor import testing
from fret_monitor.testing import check_node, traces
from hypothesis import given, settings
import pytest

VALVE = """\
format: 1
component: valve
inputs:
  open: {type: bool, role: output}
  pressure: {type: float64}
  mode: {type: string, topic: mode, values: {calm: c, alarm: a}}
requirements:
  - {id: OPENS, fretish: "upon pressure > 3.0 valve shall within 2 ticks satisfy open"}
  - {id: SAFE, ptltl: "H (mode = alarm -> open)"}
"""


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    (tmp_path / 'valve.yaml').write_text(VALVE)
    return tmp_path / 'valve.yaml'


def valve(threshold: float, seen: list[int]) -> Callable[[], Any]:
    """Return a node that opens above a threshold."""
    def made() -> Callable[[dict[str, Any]], Mapping[str, Any]]:
        seen.append(0)
        is_open = False

        def step(row: dict[str, Any]) -> Mapping[str, Any]:
            nonlocal is_open
            assert set(row) == {'pressure', 'mode'}
            seen[-1] += 1
            is_open = is_open or row['pressure'] > threshold
            return {'open': is_open or row['mode'] == 'a'}
        return step
    return made


def test_a_node_that_keeps_its_requirements_passes(bundle: Path) -> None:
    seen: list[int] = []
    check_node(bundle, valve(3.0, seen))
    assert len(seen) > 50 and max(seen) > 5


def test_the_shortest_violating_trace_is_shown(bundle: Path) -> None:
    with pytest.raises(AssertionError) as caught:
        check_node(bundle, valve(4.0, []))
    assert str(caught.value).splitlines() == [
        'the node violates OPENS on this trace:',
        'step  pressure  mode   open',
        '   0       4.0     c  False',
        '   1       4.0     c  False',
        '   2       4.0     c  False']


def test_what_a_node_returns_has_to_be_its_outputs(bundle: Path) -> None:
    with pytest.raises(ValueError, match="the node has no value of 'open'"):
        check_node(bundle, lambda: lambda row: {}, tries=1)


def test_traces_have_values_around_those_compared_with(bundle: Path) -> None:
    found: set[tuple[float, str]] = set()

    @settings(max_examples=100, deadline=None, database=None)
    @given(traces(bundle, max_steps=7))
    def holds(trace: Any) -> None:
        assert trace.times == tuple(range(len(trace.rows))) and 1 <= len(trace.rows) <= 7
        found.update((row['pressure'], row['mode']) for row in trace.rows)

    holds()
    assert found == {(pressure, mode) for pressure in (2.0, 3.0, 4.0) for mode in 'ca'}


def test_times_are_nanoseconds_under_the_policy_timed(bundle: Path) -> None:
    bundle.write_text(VALVE.replace('format: 1', 'format: 1\nevaluation: {policy: timed}').replace(
        '2 ticks', '2 seconds'))
    with pytest.raises(AssertionError) as caught:
        check_node(bundle, valve(4.0, []))
    assert str(caught.value).splitlines() == [
        'the node violates OPENS on this trace:',
        'time  pressure  mode   open',
        '   0       4.0     c  False',
        'until 2']


def test_a_violation_that_does_not_come_again_is_shown_all_the_same(
        bundle: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[int] = []

    def play(*arguments: object) -> None:
        calls.append(0)
        if len(calls) == 3:
            raise AssertionError('violated: OPENS')

    monkeypatch.setattr(testing, '_play', play)
    with pytest.raises(AssertionError, match=r'trace:\n.*(\n.*)+violated: OPENS') as caught:
        check_node(bundle, ['node'])
    assert caught.value.__notes__ == [
        'the node has not violated it each time that it was fed this trace']
