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

"""The soak test, run briefly: it reports no difference, and would report one."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from bench import ros as bench
from bench import soak
from fret_monitor.native.ros_files import prefixes
from native import engine
import pytest
from strategies import thorough

if not any(prefix.glob('include/*/rcl/rcl.h') for prefix in prefixes()) or \
        not any((prefix / 'lib/fret_monitor/monitor').is_file() for prefix in prefixes()):
    pytest.skip('needs the headers of rcl, and the installed node', allow_module_level=True)


@pytest.fixture(scope='module')
def built(short_bench: None) -> Iterator[bench.Bench]:
    built_engine = engine.entry()
    with bench.prepared(1) as made:
        engine.put(built_engine)
        yield made


@pytest.fixture
def prepared(built: bench.Bench, domain: int, forking: None) -> bench.Bench:
    """Return the programs, which are built once, with a domain of its own."""
    return built


@pytest.fixture
def wrong(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Remove a violation of the first requirement from the reference; return its row."""
    right, after = soak.turn_of, 700
    rows: list[int] = []

    def turn_of(bundle: Path) -> soak.Turn:
        turn = right(bundle)
        rows.append(next(row for row in range(after, soak.TURN) if not turn.later[row][0]))
        later = list(turn.later)
        later[rows[0]] = (True, *later[rows[0]][1:])
        return replace(turn, later=tuple(later))

    monkeypatch.setattr(soak, 'turn_of', turn_of)
    return rows


@thorough  # in `make test`, a short timed run
def test_a_short_run_gives_the_verdicts_of_the_reference(prepared: bench.Bench) -> None:
    results = [result for part in ('simulate', 'node')
               for result in soak.soak(prepared, 5000, part)]
    assert [result.messages for result in results] == [5000] * len(results)
    assert len({result.violations for result in results}) == 1
    assert results[0].violations > 5000
    assert {'simulate', 'monitor'} <= {result.title for result in results}


def test_a_short_timed_run_gives_the_verdicts_of_the_reference(prepared: bench.Bench) -> None:
    result, = soak.soak(prepared, 10 * 2500, 'timed')
    assert (result.title, result.messages) == ('simulate, timed', 2500)
    assert result.violations > 2500


def test_a_verdict_that_changes_a_nanosecond_early_ends_the_timed_run(
    prepared: bench.Bench, monkeypatch: pytest.MonkeyPatch,
) -> None:
    right = soak.timed_turn_of

    def turn_of(bundle: Path) -> soak.TimedTurn:
        turn = right(bundle)
        rows = {tick for tick, _ in turn.rows}
        place = next(place for place, (tick, _) in enumerate(turn.later) if tick - 1 not in rows
                     and tick not in rows)
        later = list(turn.later)
        later[place] = (later[place][0] - 1, later[place][1])
        return replace(turn, later=tuple(later))

    monkeypatch.setattr(soak, 'timed_turn_of', turn_of)
    with pytest.raises(SystemExit, match=r'simulate: .*, and not '):
        list(soak.soak(prepared, 10 * 2500, 'timed'))


def test_one_wrong_verdict_ends_the_simulation_at_its_row(
    prepared: bench.Bench, wrong: list[int],
) -> None:
    with pytest.raises(SystemExit) as failure:
        list(soak.soak(prepared, 5000, 'simulate'))
    assert f"'{soak.TURN + wrong[0]}," in str(failure.value)


@pytest.mark.usefixtures('wrong')
def test_one_violation_too_many_ends_the_run_of_the_node(prepared: bench.Bench) -> None:
    with pytest.raises(SystemExit, match=r'after \d+ messages (\d+) answers in place of \d+'):
        list(soak.soak(prepared, 5000, 'node'))


def test_the_violations_of_all_turns_are_summed() -> None:
    first = tuple((row % 3 == 0,) for row in range(soak.TURN))
    later = tuple((row % 7 == 0,) for row in range(soak.TURN))
    turn = soak.Turn(('R',), (0.0,) * soak.TURN, first, later)
    for messages in (1, 999, 1000, 1001, 2000, 5555):
        rows = [first[row] if row < soak.TURN else later[row % soak.TURN]
                for row in range(messages)]
        assert turn.violations(messages) == {'R': rows.count((False,))}


def test_memory_that_grows_in_the_second_half_is_reported() -> None:
    steady = soak.Result('x', 1, 1.0, *soak.halves([10.0, 50.0, 50.0, 50.0, 50.5, 51.0]), 0)
    growing = soak.Result('x', 1, 1.0, *soak.halves([10.0, 50.0, 51.0, 52.0, 53.0, 55.0]), 0)
    assert (steady.is_flat, growing.is_flat) == (True, False)


def test_the_parts_are_nearly_equal_and_add_up_to_the_whole() -> None:
    for number in (20, 21, 399, 10_000_000):
        parts = soak.parts_of(number)
        assert sum(parts) == number and max(parts) - min(parts) <= 1
