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
import sys
import time
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

    def play(*arguments: object) -> dict[str, str]:
        calls.append(0)
        if len(calls) == 3:
            raise AssertionError('violated: OPENS')
        return {}

    monkeypatch.setattr(testing, '_play', play)
    with pytest.raises(AssertionError, match=r'trace:\n.*(\n.*)+violated: OPENS') as caught:
        check_node(bundle, ['node'])
    assert caught.value.__notes__ == [
        'the node has not violated it each time that it was fed this trace']


class SlowNode:
    """Takes the place of `_play`, and of the clock: each trace takes 20 s."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, missing: dict[str, str] | None = None,
                 error: AssertionError | None = None) -> None:
        """Answer each trace with an error, or with the requirements that were not evaluated."""
        self.calls = 0
        self._missing, self._error = missing or {}, error
        monkeypatch.setattr(testing, '_play', self._play)
        monkeypatch.setattr(testing, 'monotonic', lambda: 20.0 * self.calls)

    def _play(self, *arguments: object) -> dict[str, str]:
        self.calls += 1
        if self._error is not None:
            raise self._error
        return self._missing


def test_no_trace_is_begun_after_the_time(bundle: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    slow = SlowNode(monkeypatch)
    with pytest.warns(UserWarning, match=r'^the time was over after 60 s and 4 traces of 10: '):
        check_node(bundle, ['node'])
    assert slow.calls == 4
    slow = SlowNode(monkeypatch, error=AssertionError('violated: OPENS'))
    with pytest.raises(AssertionError, match=r'trace:\n.*(\n.*)+violated: OPENS') as caught:
        check_node(bundle, ['node'], timeout=30)
    assert caught.value.__notes__ == [
        'the time was over after 30 s and 2 traces: a shorter one may exist']


def test_a_requirement_that_is_evaluated_on_no_trace_is_an_error(
        bundle: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    SlowNode(monkeypatch, {'OPENS': 'no value yet of open', 'SAFE': 'no value yet of open'})
    with pytest.raises(AssertionError) as caught:
        check_node(bundle, ['node'], tries=2)
    first, _, third, heading, *_, last = str(caught.value).splitlines()
    assert first == 'OPENS was evaluated on no trace: no value yet of open'
    assert (third, heading.split()) == ('the last of 2 traces:', ['step', 'pressure', 'mode'])
    assert last == 'if the node needs more time for an answer, allow more with `pause`'


def test_a_node_that_does_not_start_is_started_once(
        bundle: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    slow = SlowNode(monkeypatch, error=testing._DoesNotStart('nobody publishes open'))
    with pytest.raises(AssertionError, match=r'^nobody publishes open$'):
        check_node(bundle, ['node'])
    assert slow.calls == 1


def test_what_a_node_writes_when_it_is_ended_is_not_shown(
        capfd: pytest.CaptureFixture[str]) -> None:
    script = 'import sys, time; print("begun"); sys.stdout.flush(); time.sleep(60)'
    with testing._running([sys.executable, '-c', script], 10.0) as node:
        while not node.output():
            time.sleep(0.01)
        assert node.ending() == ['the node has written:', 'begun']
    assert (node.has_ended, capfd.readouterr()) == (True, ('', ''))
