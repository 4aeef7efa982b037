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

"""Traces with keys: each instance is a plain bundle on what concerns its key."""

from collections.abc import Callable, Iterator
import csv
from dataclasses import replace
from io import BytesIO
import math
from pathlib import Path
from random import Random
from typing import Any

from fret_monitor.build import build_specification
from fret_monitor.logic import margins as reference
from fret_monitor.logic.formula import Formula, Over, postorder, variables
from fret_monitor.logic.specification import InstanceAggregate, Property, Specification
from fret_monitor.model.diagnostics import CompileError
from fret_monitor.model.manifest import ManifestInput, ManifestVariable
from fret_monitor.model.policies import OverInstances, Policy
from fret_monitor.model.values import ValueType
from fret_monitor.native import evaluator_library, load_evaluator
from fret_monitor.native.binding import ffi
from fret_monitor.runtime.keyed_rows import KeyedColumn
from fret_monitor.runtime.scopes import BUNDLE
from fret_monitor.start import start
from fret_monitor.traces.csv_trace import parse_seconds, seconds_text, TimeColumn
from fret_monitor.traces.keyed_trace import KeyedTraceReader
from fret_monitor.traces.simulate import simulate
from fret_monitor.traces.summary import Summary
from keyed import (
    bundle_values, Known, known, Lives, lives_of_one, owner_of, random_bundle, random_rows, Row,
    step_table, timed_aggregates, timed_life, with_aggregates,
)
import pytest
from traces.timed_traces import timed

FOUND = ManifestVariable('robot', (), 3)
LISTED = ManifestVariable('robot', ('alpha', 'b-2', 'ä'), 3)
OTHER = ManifestVariable('joint', (), 2)


def cell(value: Any) -> str:
    return str(int(value)) if isinstance(value, bool) else repr(value)


def write_rows(specification: Specification, rows: list[Row], path: Path,
               has_times: bool = False) -> None:
    names = [item.name for item in specification.signals if item.topic]
    with path.open('w', newline='', encoding='utf-8') as file:
        writer = csv.writer(file)
        writer.writerow([*(['time'] if has_times else []), *names,
                         *(item.name for item in specification.instance_variables)])
        for row in rows:
            writer.writerow([
                *([seconds_text(row.time)] if has_times else []),
                *(cell(row.values[name]) if name in row.values else '' for name in names),
                *(key or '' for key in row.keys)])


def run(tmp_path: Path, specification: Specification, rows: list[Row], has_times: bool = False,
        until: int | None = None) -> tuple[Summary, list[list[str]]]:
    write_rows(specification, rows, tmp_path / 'trace.csv', has_times)
    summary = simulate(build_specification(specification).monitor, tmp_path / 'trace.csv',
                       tmp_path / 'out.csv', until=until)
    with (tmp_path / 'out.csv').open(newline='', encoding='utf-8') as file:
        return summary, list(csv.reader(file))


@pytest.mark.parametrize(('policy', 'variables', 'levels'), [
    (Policy.EVERY_MESSAGE, [FOUND, OTHER], 3), (Policy.RELEVANT_MESSAGE, [LISTED], 2),
    (Policy.ALL_INPUTS, [FOUND], 2), (Policy.PERIODIC, [LISTED, OTHER], 1)])
def test_each_instance_is_the_plain_bundle_on_its_rows(
        tmp_path: Path, policy: Policy, variables: list[ManifestVariable], levels: int) -> None:
    rng = Random(f'{policy} {len(variables)} {variables[0].keys}')
    specification = replace(random_bundle(rng, variables, levels=levels), policy=policy)
    rows = random_rows(rng, specification, 120)
    _, (heading, *found) = run(tmp_path, specification, rows)
    expected = step_table(specification, rows)
    assert heading == ['step', *(item.name for item in variables),
                       *(item.id for item in specification.properties)]
    assert found == [[str(number), *(key or '' for key in row.keys), *cells]
                     for number, (row, cells) in enumerate(zip(rows, expected, strict=True))]


def of_definition(item: Property, numbers: list[int], values: list[dict[str, Any]],
                  ) -> Iterator[tuple[int, tuple[float, set[int]]]]:
    """Yield the margin at each row at which all inputs have values, and what rows decide it."""
    read = {*(one.name for one in variables(item.formula)), *(
        one.name for _, equation in item.feedback for one in variables(equation))}
    ready = [(number, row) for number, row in zip(numbers, values, strict=True)
             if all(row.get(name) is not None for name in read)]
    trace = {name: [row[name] for _, row in ready] for name in read} or {'': [0] * len(ready)}
    found = reference.margins(item.formula, trace, {}, item.feedback) if ready else []
    for (number, _), margin in zip(ready, found, strict=True):
        yield number, (margin.value, {ready[step][0] for _, step in margin.deciding})


def margin_cells(specification: Specification,
                 rows: list[Row]) -> dict[tuple[int, str], tuple[float, set[int]]]:
    """Return the margins of rows, by row and requirement, and which rows may decide them."""
    by_variable = lives_of_one(specification, rows)
    values = bundle_values(specification, rows, by_variable)
    cells: dict[tuple[int, str], tuple[float, set[int]]] = {}
    for item in specification.properties:
        owner = owner_of(specification, item.inputs)
        if owner is None:
            cells |= {(number, item.id): found for number, found in of_definition(
                item, [*range(len(rows))], values)}
        place = [one.name for one in specification.instance_variables].index(owner) \
            if owner else 0
        for life in by_variable[owner,] if owner else []:
            cells |= {(number, item.id): found for number, found in of_definition(
                item, life.rows, with_aggregates(specification, life, values))
                if rows[number].keys[place] == life.key}
    return cells


@pytest.mark.parametrize(('policy', 'levels'), [(Policy.EVERY_MESSAGE, 2), (Policy.PERIODIC, 1)])
def test_margins_of_each_instance_are_those_of_its_rows(
        tmp_path: Path, policy: Policy, levels: int) -> None:
    rng = Random(f'margins {policy}')
    specification = replace(random_bundle(rng, [replace(FOUND, forget=0), OTHER], levels=levels),
                            policy=policy, has_margins=True)
    rows = random_rows(rng, specification, 100)
    write_rows(specification, rows, tmp_path / 'trace.csv')
    simulate(build_specification(specification).monitor, tmp_path / 'trace.csv',
             tmp_path / 'out.csv', margins=tmp_path / 'margins.csv')
    expected = margin_cells(specification, rows)
    with (tmp_path / 'margins.csv').open(newline='', encoding='utf-8') as file:
        found = list(csv.DictReader(file))
    assert {(int(line['step']), line['requirement']) for line in found} == {*expected}
    for line in found:
        value, deciding = expected[int(line['step']), line['requirement']]
        assert float(line['margin']) == value
        assert [line[item.name] for item in specification.instance_variables] == [
            key or '' for key in rows[int(line['step'])].keys]
        assert not math.isfinite(value) or int(line['at']) in deciding
    assert sum(math.isfinite(value) for value, _ in expected.values()) > 100


TIMED = """format: 1
evaluation: {policy: timed, unit: 1}
inputs:
  x: {topic: "KEYx", type: std_msgs/msg/Float64, max_rate: 20}
  y: {topic: y, type: std_msgs/msg/Float64, max_rate: 20}
requirements:
  - {id: WITHIN, ptltl: "O[1,4] (x < y)"}
  - {id: SINCE, ptltl: "(x > -1.0) S[0,3] (y > 0.5)"}
"""


@pytest.mark.parametrize('seed', range(2))
def test_under_timed_margins_of_a_key_are_those_of_a_bundle_for_it(
        tmp_path: Path, seed: int) -> None:
    rng = Random(seed)
    rows = [(0.0, 'a', 0.25, 0.5)]
    for _ in range(40):
        key = rng.choice(['a', 'b', ''])
        rows.append((rows[-1][0] + rng.choice([0.25, 1, 2.5]), key, rng.gauss(0, 1),
                     rng.gauss(0, 1) if not key or rng.random() < 0.3 else math.nan))
    until = rows[-1][0] + 6
    keyed = margin_rows(tmp_path, 'for_each: {robot: {most: 2}}\n' + TIMED.replace(
        'KEY', '/{robot}/'), rows, until)
    assert len({time for time, *_ in keyed} - {time for time, *_ in rows}) > 10
    for key in ('a', 'b'):
        begin = next(time for time, name, *_ in rows if name == key)
        y = 0.5
        own: list[tuple[float, str, float, float]] = []
        for time, name, x, given in rows:
            y = y if math.isnan(given) else given
            if time >= begin and (name == key or not math.isnan(given)):
                own.append((time, '', x if name == key else math.nan, y))
        plain = margin_rows(tmp_path, TIMED.replace('KEY', ''), own, until)
        shown = {(time, item): value for time, name, item, value in keyed if name == key}
        by_time: dict[float, dict[str, float]] = {}
        for time, _, item, value in plain:
            by_time.setdefault(time, {})[item] = value
        last: dict[str, float] = {}
        wanted: dict[tuple[float, str], float] = {}
        for time, values in by_time.items():
            if values != last or any(time == row[0] and key == row[1] for row in rows):
                wanted |= {(time, item): value for item, value in values.items()}
            last = values
        assert shown == wanted


def margin_rows(tmp_path: Path, bundle: str, rows: list[tuple[float, str, float, float]],
                until: float) -> list[tuple[float, str, str, float]]:
    """Return times, keys, requirements and margins; NaN is an input that keeps its value."""
    (tmp_path / 'bundle.yaml').write_text(bundle)
    is_keyed = bundle.startswith('for_each')
    before = math.nan
    with (tmp_path / 'trace.csv').open('w') as file:
        file.write(f'time,{"robot," if is_keyed else ""}x,y\n')
        for time, key, x, y in rows:
            before = before if math.isnan(x) else x
            cells = [key, cell(x) if key else '', '' if math.isnan(y) else cell(y)] \
                if is_keyed else [cell(before), cell(y)]
            file.write(','.join([f'{time:g}', *cells]) + '\n')
    monitor = start(tmp_path / 'bundle.yaml', takes_instances=True, margins=True).monitor
    simulate(monitor, tmp_path / 'trace.csv', tmp_path / 'out.csv', until=round(until * 1e9),
             margins=tmp_path / 'margins.csv')
    with (tmp_path / 'margins.csv').open(newline='') as found:
        return [(float(line['time']), line.get('robot', ''), line['requirement'],
                 float(line['margin'])) for line in csv.DictReader(found)]


@pytest.mark.parametrize('seed', range(3))
def test_an_instance_ends_after_its_last_message_and_another_begins(
        tmp_path: Path, seed: int) -> None:
    rng = Random(seed)
    variables = [replace(FOUND, forget=20), replace(OTHER, forget=rng.choice([0, 7]))]
    specification = random_bundle(rng, variables, levels=1 + seed)
    times = [0]
    for _ in range(119):
        times.append(times[-1] + rng.choice([1, 1, 2, 5, 7, 20, 21]))
    rows = random_rows(rng, specification, 120, times)
    _, (_, *found) = run(tmp_path, specification, rows, has_times=True)
    assert [cells[3:] for cells in found] == step_table(specification, rows)


@pytest.mark.parametrize('seed', range(4))
def test_under_timed_each_change_of_an_instance_is_a_row(tmp_path: Path, seed: int) -> None:
    rng = Random(seed)
    forget = (0, 30)[seed % 2]
    mentioned = [replace(FOUND, forget=forget), OTHER] if seed % 4 < 2 else [LISTED]
    specification = timed(random_bundle(rng, mentioned, loops=0, levels=3 if seed else 1))
    specification = without(specification, lambda item: has_messages(item.operand) or (
        # Without an instance, these have no value: see the test below.
        forget > 0 and item.function in (OverInstances.LEAST, OverInstances.GREATEST)))
    times = [5 * 10 ** 9]
    for _ in range(59):
        times.append(times[-1] + rng.choice([1, 1, 2, 5, 9, 30, 31]))
    rows = random_rows(rng, specification, 60, times)
    until = times[-1] + rng.choice([0, 5, 100])
    _, (_, *found) = run(tmp_path, specification, rows, has_times=True, until=until)
    check_timed(specification, rows, until, found)


def has_messages(formula: Formula) -> bool:
    """Whether it counts messages, which a random formula does not name: each tick would be one."""
    return any(isinstance(node, Over) and not node.aggregate.is_extreme
               for node in postorder([formula]))


def without(specification: Specification,
            is_left_out: Callable[[InstanceAggregate], bool]) -> Specification:
    """Return a specification without some aggregates, what reads them, and what has messages."""
    gone = set[str]()
    for item in specification.aggregates:  # those that others read come first
        if is_left_out(item) or gone.intersection(one.name for one in variables(item.operand)):
            gone.add(item.signal.name)
    return replace(
        specification,
        signals=tuple(item for item in specification.signals if item.name not in gone),
        aggregates=tuple(item for item in specification.aggregates
                         if item.signal.name not in gone),
        properties=tuple(item for item in specification.properties
                         if gone.isdisjoint(item.inputs) and not has_messages(item.formula)))


def check_timed(specification: Specification, rows: list[Row], until: int,
                found: list[list[str]], of_pairs: Lives | None = None) -> None:
    """Compare all rows with the reference: what they say, and where there is one."""
    names = [item.name for item in specification.instance_variables]
    by_variable = {**(of_pairs or {}), **lives_of_one(specification, rows)}
    owners = [owner_of(specification, item.inputs) for item in specification.properties]
    wanted: set[tuple[int, tuple[str, ...], tuple[str, ...]]] = set()
    of_row: dict[int, list[str]] = {row.time: [''] * len(owners) for row in rows}
    row_of = {row.time: row for row in rows}

    def add(keys: tuple[str, ...], histories: dict[int, Known | None], own: set[int]) -> None:
        """Add the rows of a scope: where its verdicts change, and the rows that are its own."""
        before: list[str] = [''] * len(owners)
        ticks = {tick for one in histories.values() if one for tick in one.changes} | own
        for tick in sorted(ticks):
            values = {place: one.at(tick) if one else None for place, one in histories.items()}
            cells = ['' if values.get(place) is None else str(int(bool(values[place])))
                     for place in range(len(owners))]
            if tick in own:
                of_row[tick] = [new or old for new, old in zip(cells, of_row[tick], strict=True)]
            elif cells != before:
                wanted.add((tick, keys, tuple(cells)))
            before = cells

    ticks, values, over = timed_aggregates(specification, rows, until, by_variable)
    for place, name in enumerate(names):
        for life in by_variable[name,]:
            end = min(life.end, until + 1)
            times, inputs = timed_life(life, rows, over)
            add(tuple(life.key if at == place else '' for at, _ in enumerate(names)),
                {number: known(item.formula, times, inputs, end)
                 for number, item in enumerate(specification.properties)
                 if owners[number] == name},
                {rows[number].time for number in life.rows
                 if rows[number].keys[place] == life.key})
    add(('',) * len(names), {
        number: known(item.formula, ticks, values, until + 1)
        for number, item in enumerate(specification.properties) if owners[number] is None},
        set(of_row))
    wanted |= {(time, tuple(key or '' for key in row_of[time].keys), tuple(cells))
               for time, cells in of_row.items()}
    shown = [(parse_seconds(line[0]), tuple(line[1:1 + len(names)]),
              tuple(line[1 + len(names):])) for line in found]
    assert sorted(shown) == sorted(wanted)
    assert [time for time, _, _ in shown] == sorted(time for time, _, _ in shown)


def read_rows(text: str, library: Any) -> list[tuple[int, list[bytes], dict[str, Any]]]:
    """Return the rows of a trace: time, keys, and values by input; at last the error, if any."""
    inputs = [ManifestInput(name, kind, name, None, (), (), None) for name, kind in (
        ('x', ValueType.FLOAT64), ('n', ValueType.INT8), ('on', ValueType.BOOL))]
    columns = [KeyedColumn(inputs[0], 0, 0), KeyedColumn(inputs[1], 1, 0),
               KeyedColumn(inputs[2], BUNDLE, 0)]
    reader = KeyedTraceReader(
        'trace.csv', BytesIO(text.encode()), columns, {'x': (0,), 'n': (0, 1)},
        [FOUND, replace(LISTED, name='joint', keys=('a', 'b,c', 'q"q', 'ä'))],
        TimeColumn.REQUIRED, library)
    found: list[tuple[int, list[bytes], dict[str, Any]]] = []
    try:
        for block in reader.keyed_blocks():
            count = len(block.times)
            for place, time in enumerate(block.times):
                keys = [block.keys[variable * count + place] for variable in range(2)]
                found.append((time, [bytes(ffi.buffer(key.bytes, key.size)) for key in keys], {
                    item.item.name: repr(column[0][place]) for item, column in zip(
                        reader.columns, block.columns, strict=True)
                    if column is not None and column[1][place]}))
    except CompileError as error:
        found.append((0, [str(error).encode()], {}))
    return found


@pytest.mark.parametrize('seed', range(8))
def test_rows_that_c_reads_are_those_that_python_reads(seed: int) -> None:
    rng = Random(seed)
    lines = ['time,robot, joint ,x,n,on,other']
    for number in range(300):
        odd = rng.randrange(3) if number % 70 == 65 else None  # C reads many others at once
        robot = rng.choice(['"r""5"', '\u00a0z', 'z\u00a0'] if odd == 0 else [
            '', 'r1', ' r2 ', '"r,4"', 'yüy', 'y' * 255])
        joint = rng.choice(['"q""q"', 'ä'] if odd == 1 else ['', 'a', '"b,c"', '\ta'])
        x = rng.choice(['\u00a02'] if odd == 2 else ['', '0.25', 'nan', '"1e-3"']) if robot else ''
        n = rng.choice(['', '7', '-128']) if robot and joint else ''
        lines.append(f'{number},{robot},{joint},{x},{n},{rng.choice(["", "1", "false"])},"k, l"')
    if 0 < seed < 5:
        wrong = ['300,r,,,5,,', '300,r,no,,,,', f'300,{"y" * 256},,,,,', '300,,a,,5,,']
        lines.append(wrong[seed - 1])
    text = '\n'.join([*lines, ''])
    read = read_rows(text, load_evaluator(evaluator_library()))
    assert read == read_rows(text, None)
    assert len(read) == 300 + (0 < seed < 5)
    assert len({repr(item) for item in read}) > 290
