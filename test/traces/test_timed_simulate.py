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

"""Timed traces: `simulate` writes the verdicts of the reference, and where they change."""

from array import array
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from random import Random
import re

from fret_monitor.build import build_specification
from fret_monitor.logic.formula import (
    ALWAYS, Binary, BinaryOperator, Constant, Formula, Historically, Once, Variable, Window,
)
from fret_monitor.logic.specification import Specification
from fret_monitor.logic.timed import evaluate_timed, TimedTrace, verdict_rows
from fret_monitor.model.diagnostics import CompileError
from fret_monitor.model.policies import Report
from fret_monitor.model.values import ValueType
from fret_monitor.runtime.evaluator import Evaluator
from fret_monitor.traces import csv_trace
from fret_monitor.traces.csv_trace import parse_seconds, seconds_text
from fret_monitor.traces.simulate import simulate
import pytest
from strategies import (
    INPUTS, property_of, random_inputs, random_property, random_trace, specification_of,
)
from traces.timed_traces import timed, write_trace

P = Variable('p', ValueType.BOOL)


def response() -> Specification:
    """Return `O[0,10] p`, in nanoseconds."""
    return timed(specification_of([property_of('R', Once(Window(0, 10), P))], (P,)))


def rows(path: Path) -> list[list[str]]:
    return [line.split(',') for line in path.read_text().splitlines()]


@pytest.mark.parametrize('seed', range(4))
def test_verdicts_equal_the_reference_at_every_tick(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int,
) -> None:
    rng = Random(seed)
    monkeypatch.setattr(csv_trace, '_BLOCK_ROWS', (1, 2, 7, 4096)[seed])
    specification = timed(specification_of(
        [random_property(rng, f'R-{number}', random_inputs(rng), reach=70, loops=0)
         for number in range(20)], INPUTS))
    ticks = [0]
    for _ in range(60):
        ticks.append(ticks[-1] + rng.choice([1, 1, 2, 3, 9, 30, 100]))
    columns = random_trace(rng, INPUTS, len(ticks))
    write_trace(ticks, columns, tmp_path / 'trace.csv', 5_000_000_000)
    until = ticks[-1] + rng.choice([0, 5, 200])
    summary = simulate(build_specification(specification).monitor, tmp_path / 'trace.csv',
                       tmp_path / 'verdicts.csv', until=5_000_000_000 + until)
    trace = TimedTrace(ticks, columns, until)
    wanted = verdict_rows(
        evaluate_timed([item.formula for item in specification.properties], trace), trace)
    heading, *found = rows(tmp_path / 'verdicts.csv')
    assert heading == ['time', *(item.id for item in specification.properties)]
    assert found == [[seconds_text(5_000_000_000 + tick), *(str(int(bool(flag))) for flag in row)]
                     for tick, row in wanted]
    assert summary.steps == len(wanted) > len(ticks)


def run(tmp_path: Path, text: str, specification: Specification | None = None,
        until: int | None = None) -> list[list[str]]:
    (tmp_path / 'trace.csv').write_text(text)
    monitor = build_specification(specification or response()).monitor
    simulate(monitor, tmp_path / 'trace.csv', tmp_path / 'out.csv', until=until)
    return rows(tmp_path / 'out.csv')


def test_a_verdict_changes_between_the_rows_and_after_them(tmp_path: Path) -> None:
    text = 'time,p\n1.5,1\n1.500000002,0\n1.5000001,1\n1.500000101,0\n'
    assert run(tmp_path, text, until=1_600_000_000) == [
        ['time', 'R'], ['1.5', '1'], ['1.500000002', '1'], ['1.500000012', '0'],
        ['1.5000001', '1'], ['1.500000101', '1'], ['1.500000111', '0']]


@pytest.mark.parametrize(('until', 'more'), [(10, []), (11, [['0.000000011', '0']])])
def test_a_violation_at_exactly_the_end_is_written(
        tmp_path: Path, until: int, more: list[list[str]]) -> None:
    assert run(tmp_path, 'time,p\n0,1\n0.000000001,0\n', until=until) == [
        ['time', 'R'], ['0', '1'], ['0.000000001', '1'], *more]


def test_nothing_is_written_after_the_last_row_without_until(tmp_path: Path) -> None:
    assert run(tmp_path, 'time,p\n0,1\n0.000000001,0\n') == [
        ['time', 'R'], ['0', '1'], ['0.000000001', '1']]


@pytest.mark.parametrize(('text', 'place', 'message', 'help'), [
    ('p\n1\n', '1:1', "the trace has no column 'time'", 'under policy: timed each row has a time'),
    *((f'p,{name}\n1,0\n', '1:1', "the trace has no column 'time'",
       f"rename the column '{name}' to 'time'") for name in ('Time', 't', 'timestamp')),
    ('time,time,p\n0,0,1\n', '1:1', "the trace has two columns 'time'", ''),
    ('time,p\n0,1\n0,1\n', '3:1', 'the same time as that of the row before', 'it was 0 there'),
    ('time,p\n2.5,1\n2.25,1\n', '3:1', 'a time before that of the row before', 'it was 2.5 there'),
    ('p,time\n1,0.0000000001\n', '2:3', "'0.0000000001' is no time", 'at most nine digits'),
    ('p,time\n1,\n', '2:3', 'empty cell for the time', 'write seconds in decimal'),
    ('p,time\n1,1e3\n', '2:3', "'1e3' is no time", 'write seconds in decimal'),
    ('p,time\n1,9999999999\n', '2:3', "'9999999999' is no time", '146 years'),
])
def test_bad_times_are_refused_with_their_place(
    tmp_path: Path, text: str, place: str, message: str, help: str,
) -> None:
    with pytest.raises(CompileError) as error:
        run(tmp_path, text)
    shown = str(error.value)
    assert re.search(rf'trace\.csv:{place}: error: {re.escape(message)}', shown), shown
    assert help in shown
    assert not (tmp_path / 'out.csv').exists()


def test_an_input_named_time_beside_the_column_is_refused(tmp_path: Path) -> None:
    time = Variable('time', ValueType.BOOL)
    one = timed(specification_of([property_of('R', time)], (time,)))
    with pytest.raises(CompileError, match="give the input 'time' another name"):
        run(tmp_path, 'time\n0\n', one)


def test_until_before_the_last_row_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CompileError, match=r'--until 1\.5 is before the last row'):
        run(tmp_path, 'time,p\n1,1\n2,0\n', until=1_500_000_000)


def test_an_empty_trace_has_no_verdicts(tmp_path: Path) -> None:
    assert run(tmp_path, 'time,p\n', until=5) == [['time', 'R']]


def test_a_constant_needs_no_input(tmp_path: Path) -> None:
    one = timed(specification_of([property_of('R', Constant(False, ValueType.BOOL))], ()))
    assert run(tmp_path, 'time\n3\n4\n', one) == [['time', 'R'], ['3', '0'], ['4', '0']]


@pytest.mark.parametrize(('text', 'nanoseconds'), [
    ('0', 0), ('0.000000001', 1), ('12.5', 12_500_000_000), ('-1.25', -1_250_000_000),
    ('4611686018.427387904', 2 ** 62)])
def test_seconds_are_exact(text: str, nanoseconds: int) -> None:
    assert parse_seconds(text) == nanoseconds
    assert seconds_text(nanoseconds) == text


def test_changes_beyond_the_rate_are_counted(tmp_path: Path) -> None:
    one = timed(specification_of([property_of('R', Once(Window(10 ** 9, 10 ** 9), P))], (P,)))
    slow = replace(one, signals=tuple(replace(item, max_rate=Fraction(2))
                                      for item in one.signals))
    evaluator = Evaluator(build_specification(slow).monitor)
    columns = [array('B', [row % 2 for row in range(100)])]
    times = array('q', [row * 10_000_000 for row in range(100)])
    for _ in evaluator.rows(columns, times):
        pass
    # 50 intervals came. In a second and a bit p may change 4 times, and begin 4 intervals.
    assert evaluator.time_counts().overflows == 46
    assert evaluator.verdicts == [False]


def test_a_rate_does_not_change_a_verdict_that_keeps_it(tmp_path: Path) -> None:
    # Each message begins nine intervals of what is asked of; and a second's messages come at once.
    windows = [Window(number * 100, number * 100 + 1) for number in range(1, 10)]
    echo: Formula = P
    for window in windows:
        echo = Binary(BinaryOperator.OR, echo, Once(window, P))
    tautology = Binary(BinaryOperator.IMPLIES, Once(Window(2000, 2010), echo),
                       Once(Window(0, 2010), echo))
    exact = Binary(BinaryOperator.IMPLIES, Once(Window(3000, 3000), P), Once(Window(0, 3000), P))
    one = timed(specification_of([property_of('R', tautology), property_of('E', exact)], (P,)))
    rated = replace(one, signals=tuple(replace(item, max_rate=Fraction(40))
                                       for item in one.signals))
    ticks = [*range(0, 80, 2), *range(5000, 5080, 2)]
    write_trace(ticks, {'p': [row % 2 == 0 for row in range(len(ticks))]}, tmp_path / 'trace.csv')
    monitor = build_specification(rated).monitor
    simulate(monitor, tmp_path / 'trace.csv', tmp_path / 'out.csv', until=9000)
    assert all(row[1:] == ['1', '1'] for row in rows(tmp_path / 'out.csv')[1:])


def test_what_remembers_a_lost_change_stays_violated(tmp_path: Path) -> None:
    nested = Once(Window(0, 50), Once(Window(1000, 1000), P))
    one = timed(specification_of([property_of('N', nested), replace(
        property_of('H', Historically(ALWAYS, Binary(BinaryOperator.OR, nested, P))),
        report=Report.OCCURRENCE)], (P,)))
    rated = replace(one, signals=tuple(replace(item, max_rate=Fraction(1, 10 ** 9))
                                       for item in one.signals))
    evaluator = Evaluator(build_specification(rated).monitor)
    columns = [array('B', [1 - row % 2 for row in range(40)])]
    for _ in evaluator.rows(columns, array('q', [row * 10 for row in range(40)]), 9000):
        pass
    assert evaluator.time_counts().overflows > 0
    assert evaluator.verdicts == [False, False]
    assert evaluator.requirement_counts(1).announced > 0
