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

"""Traces of random bundles: `simulate` writes the verdicts of the reference for each row."""

from collections.abc import Iterator
import csv
from dataclasses import replace
from functools import cache
import io
import math
import os
from pathlib import Path
from random import Random
import tempfile
from typing import Any

from fret_monitor.build import build_specification
from fret_monitor.logic.evaluate import verdicts
from fret_monitor.logic.formula import FTP, Variable
from fret_monitor.logic.specification import Specification
from fret_monitor.model.diagnostics import CompileError
from fret_monitor.model.policies import Policy
from fret_monitor.model.values import ValueType
from fret_monitor.native.monitor import Monitor
from fret_monitor.runtime.evaluator import Evaluator
from fret_monitor.traces import csv_trace
from fret_monitor.traces.simulate import simulate
from hypothesis import given, settings
from hypothesis import strategies as st
import pytest
from strategies import (
    EXAMPLES, INPUTS, property_of, random_inputs, random_property, random_trace, specification_of,
    Trace,
)


def random_specification(rng: Random, policy: Policy) -> Specification:
    """Return random requirements, whose inputs have values before the first row."""
    properties = [random_property(rng, f'R-{number}', random_inputs(rng), reach=70,
                                  loops=number % 2) for number in range(20)]
    plain = specification_of(properties, INPUTS, policy)
    return replace(plain, signals=tuple(replace(item, initial=item.type.is_number and 1)
                                        for item in plain.signals))


def cell(rng: Random, value: Any) -> str:
    """Write a value in one of the ways that a trace may."""
    if isinstance(value, bool):
        return rng.choice(['0', 'false', 'False'] if not value else ['1', 'true', 'TRUE'])
    if isinstance(value, int):
        return rng.choice([str(value), f' {value} ', f'{value:+}'])
    if math.isfinite(value):
        return rng.choice([repr(value), f'{value:.17e}', f'{value:+.20g}'])
    return rng.choice([str(value), str(value).upper(), f' {value}'])


def write_trace(rng: Random, trace: Trace, path: Path) -> None:
    """Write a trace with its columns in any order, and an unused one."""
    names = list(trace)
    rng.shuffle(names)
    with path.open('w', newline='') as file:
        writer = csv.writer(file, quoting=rng.choice([csv.QUOTE_ALL, csv.QUOTE_MINIMAL]))
        writer.writerow([*names, 'note'])
        for row in zip(*(trace[name] for name in names), strict=True):
            writer.writerow([*(cell(rng, value) for value in row), 'a,"b"'])


def rows(path: Path) -> Iterator[list[str]]:
    """Yield the rows of a file of verdicts."""
    with path.open(newline='') as file:
        yield from csv.reader(file)


@pytest.mark.parametrize('policy', [item for item in Policy if item is not Policy.TIMED])
@pytest.mark.parametrize('steps', [0, 1, 300])
def test_verdicts_equal_the_reference_under_every_policy(
        tmp_path: Path, policy: Policy, steps: int) -> None:
    rng = Random(steps)
    specification = random_specification(rng, policy)
    trace = random_trace(rng, INPUTS, steps)
    write_trace(rng, trace, tmp_path / 'trace.csv')
    summary = simulate(build_specification(specification).monitor, tmp_path / 'trace.csv',
                       tmp_path / 'verdicts.csv')
    heading, *found = rows(tmp_path / 'verdicts.csv')
    expected = [verdicts(item.formula, trace, item.feedback) for item in specification.properties]
    assert heading == ['step', *(item.id for item in specification.properties)]
    assert found == [[str(step), *(str(int(column[step])) for column in expected)]
                     for step in range(steps)]
    assert summary.steps == steps
    assert list(summary.violations.values()) == [column.count(False) for column in expected]


@pytest.mark.parametrize('block', [1, 2, 7, 300])
def test_blocks_of_any_size_give_the_same_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                               block: int) -> None:
    rng = Random(7)
    specification = random_specification(rng, Policy.EVERY_MESSAGE)
    write_trace(rng, random_trace(rng, INPUTS, 300), tmp_path / 'trace.csv')
    monitor = build_specification(specification).monitor
    whole = simulate(monitor, tmp_path / 'trace.csv', tmp_path / 'whole.csv')
    monkeypatch.setattr(csv_trace, '_BLOCK_ROWS', block)
    assert simulate(monitor, tmp_path / 'trace.csv', tmp_path / 'cut.csv') == whole
    assert (tmp_path / 'cut.csv').read_bytes() == (tmp_path / 'whole.csv').read_bytes()


def test_a_bundle_without_inputs_takes_one_step_for_each_row(tmp_path: Path) -> None:
    monitor = build_specification(specification_of([property_of('R', FTP)], ())).monitor
    (tmp_path / 'trace.csv').write_text('time\n0\n1\n2\n')
    simulate(monitor, tmp_path / 'trace.csv', tmp_path / 'out.csv')
    assert (tmp_path / 'out.csv').read_text() == 'step,R\n0,1\n1,0\n2,0\n'


def test_an_error_in_a_later_block_leaves_no_verdicts(tmp_path: Path) -> None:
    rng = Random(1)
    specification = random_specification(rng, Policy.EVERY_MESSAGE)
    write_trace(rng, random_trace(rng, INPUTS, 9000), tmp_path / 'trace.csv')
    with (tmp_path / 'trace.csv').open('a') as file:
        file.write('1,2,3\n')
    with pytest.raises(CompileError, match=r'trace.csv:9002:1: error: 3 cells in a row'):
        simulate(build_specification(specification).monitor, tmp_path / 'trace.csv',
                 tmp_path / 'out.csv')
    assert [path.name for path in tmp_path.iterdir()] == ['trace.csv']


@pytest.mark.parametrize(('rows_of_it', 'line'), [
    ('1,1,' + 'm' * 100 + '\n', 3), ('1,1,"m\n' + 'm\n' * 60 + '"\n', 3),
    ('1,1,1' + ',"\n"' * 40 + '\n', 3)])
def test_a_row_that_is_too_long_is_refused_where_it_begins(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rows_of_it: str, line: int) -> None:
    monkeypatch.setattr(csv_trace, '_MAX_ROW_CHARACTERS', 100)
    monkeypatch.setattr(csv_trace, '_READ_BYTES', 10)
    trace = tmp_path / 'trace.csv'
    trace.write_text('p,n,x\n1,-5,2.5\n' + rows_of_it)
    with pytest.raises(CompileError) as caught:
        simulate(damaged_monitor(), trace, tmp_path / 'out.csv')
    title, shown, *_ = str(caught.value).splitlines()
    assert title == f'{trace}:{line}:1: error: a row of more than 100 characters'
    assert shown == f' {line} | {rows_of_it.splitlines()[0][:101]}'  # it read no further
    assert os.listdir(tmp_path) == ['trace.csv']


@pytest.mark.parametrize('note', ['m' * 40, '"' + '\n' * 38 + '"'])
def test_long_rows_make_smaller_blocks(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, note: str) -> None:
    monkeypatch.setattr(csv_trace, '_MAX_ROW_CHARACTERS', 100)
    monkeypatch.setattr(csv_trace, '_READ_BYTES', 100)
    (tmp_path / 'trace.csv').write_text('p,n,x,y\n' + f'1,-5,2.5,{note}\n' * 90)
    blocks: list[int] = []
    monkeypatch.setattr(Evaluator, 'rows', recorded(Evaluator.rows, blocks))
    assert simulate(damaged_monitor(), tmp_path / 'trace.csv', tmp_path / 'out.csv').steps == 90
    assert sum(blocks) == 90
    assert max(blocks) <= 4  # rows of 50 bytes


def recorded(rows: Any, counts: list[int]) -> Any:
    """Return a method that also records the number of rows."""
    def method(evaluator: Any, columns: Any, times: Any) -> Any:
        counts.append(len(times))
        return rows(evaluator, columns, times)
    return method


def test_process_wide_settings_are_not_changed(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*arguments: object) -> int:
        assert not arguments, 'another thread would see the change'
        return 131_072

    monkeypatch.setattr(os, 'umask', refused)
    monkeypatch.setattr(csv, 'field_size_limit', refused)
    (tmp_path / 'trace.csv').write_text('p,n,x,long\n1,1,1,' + 'm' * 200_000 + '\n')
    assert simulate(damaged_monitor(), tmp_path / 'trace.csv', tmp_path / 'out.csv').steps == 1


CELLS = st.text(alphabet='ab ,"\r\n;\x00é', max_size=6)


@settings(max_examples=3 * EXAMPLES)
@given(st.lists(st.lists(CELLS, min_size=2, max_size=3), max_size=5))
def test_rows_are_split_as_python_splits_them(table: list[list[str]]) -> None:
    text = io.StringIO(newline='')
    csv.writer(text).writerows(table)
    file = io.BytesIO(text.getvalue().encode())
    found = [row.cells for row in csv_trace._Rows('trace.csv', file)]
    assert found == table


@settings(max_examples=3 * EXAMPLES)
@given(st.lists(st.tuples(st.integers(0, 400), st.sampled_from([
    b'', b'\n', b'\r', b',', b'"', b'\x00', b'\xff', b'\xef\xbb\xbf', b'1', b'-', b'.', b'e9',
    b'nan', b'\xc3\xa4', b' ', b'9' * 30, b'\x1b', b'true'])), max_size=6))
def test_a_damaged_trace_is_refused_or_read_and_never_a_crash(
        damage: list[tuple[int, bytes]]) -> None:
    monitor = damaged_monitor()
    content = b'p,n,x\n' + b'1,-5,2.5\n0,7,1e3\n' * 20
    for place, piece in damage:
        content = content[:place] + piece + content[place + len(piece) // 2:]
    with tempfile.TemporaryDirectory() as name:
        trace, out = Path(name) / 'trace.csv', Path(name) / 'out.csv'
        trace.write_bytes(content)
        try:
            summary = simulate(monitor, trace, out)
        except CompileError as error:
            assert not out.exists()
            assert len(error.diagnostics) == 1
            assert str(error).isprintable() or '\n' in str(error)
        else:
            assert len(out.read_text().splitlines()) == summary.steps + 1
        assert sorted(os.listdir(name)) in (['trace.csv'], ['out.csv', 'trace.csv'])


@cache
def damaged_monitor() -> Monitor:
    """Return a monitor of three inputs."""
    inputs = (Variable('p', ValueType.BOOL), Variable('n', ValueType.INT8),
              Variable('x', ValueType.FLOAT32))
    rng = Random(1)
    properties = [random_property(rng, f'R-{number}', inputs) for number in range(3)]
    return build_specification(specification_of(properties, inputs)).monitor
