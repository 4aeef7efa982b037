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

"""Pairs of two variables: each is a plain bundle on what concerns both of its keys."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from random import Random
from typing import Any

from fret_monitor.logic.formula import Variable
from fret_monitor.logic.specification import Specification
from fret_monitor.model.manifest import ManifestVariable
from fret_monitor.model.policies import OverInstances, Policy
from fret_monitor.traces.csv_trace import parse_seconds
from keyed import (
    bundle_values, known, Life, Lives, lives, lives_of_one, NEVER, OTHER, OWN, random_aggregate,
    random_bundle, random_requirement, random_rows, Row, step_table, stepwise, with_aggregates,
)
import pytest
from strategies import INPUTS
from traces.test_keyed_simulate import check_timed, has_messages, run, without
from traces.timed_traces import timed

ROBOT = ManifestVariable('robot', (), 3)
FLEET = ManifestVariable('robot', ('alpha', 'b-2', 'ä'), 3)
JOINT = ManifestVariable('joint', (), 2)
ARM = ManifestVariable('joint', ('elbow', 'wrist'), 2)
BOTH = ('robot', 'joint')
OF_BOTH = tuple(Variable(f'p_{item.name}', item.type) for item in INPUTS[1::3])


@dataclass
class PairLife(Life):
    """The life of a pair: `keys` are both."""

    keys: tuple[str, str] = ('', '')
    inputs: dict[str, Any] = field(default_factory=dict)


def pair_bundle(rng: Random, variables: Sequence[ManifestVariable],
                loops: int = 1) -> Specification:
    """Return requirements of pairs, of each variable and of the bundle, some over aggregates."""
    plain = random_bundle(rng, variables, loops=loops)
    template = plain.signals[0]
    signals = [replace(template, name=item.name, type=item.type, variables=BOTH,
                       topic=f'/{{robot}}/{{joint}}/{item.name}') for item in OF_BOTH]
    over_pairs = [random_aggregate(rng, number, BOTH, 20, inputs=OF_BOTH) for number in range(5)]
    of_one = [Variable(item.signal.name, item.signal.type) for item in plain.aggregates]
    values = [Variable(item.signal.name, item.signal.type) for item in over_pairs]
    properties = [random_requirement(
        rng, f'P-{number}', [*OF_BOTH, *OWN, *OTHER, *INPUTS, *of_one[:4], *values],
        rng.choice([OF_BOTH, OF_BOTH, OWN, OTHER]), 20, loops) for number in range(20)]
    of = {item.name for item in OF_BOTH}
    properties = [item for item in properties if of.intersection(item.inputs)]
    properties += [random_requirement(
        rng, f'V-{number}', [*values, *INPUTS, *(OWN if number % 2 else values)], values, 20,
        loops) for number in range(8)]
    return replace(plain, signals=(*signals, *plain.signals, *(
        item.signal for item in over_pairs)), aggregates=(*plain.aggregates, *over_pairs),
        properties=(*plain.properties, *properties))


def pair_rows(rng: Random, specification: Specification, count: int,
              times: Sequence[int] | None = None) -> list[Row]:
    """Return rows, of which some of a pair have values of the pair alone."""
    single = {item.name for item in (*OWN, *OTHER)}
    return [row if None in row.keys or rng.random() < 0.5 else replace(row, values={
        name: value for name, value in row.values.items() if name not in single})
            for row in random_rows(rng, specification, count, times, are_pairs=True)]


def of_one(specification: Specification, rows: Sequence[Row]) -> list[Row]:
    """Return rows with the keys that they are of: a pair's is of one with a value of its own."""
    alone = [{item.name for item in specification.signals if item.variables == (one.name,)}
             for one in specification.instance_variables]
    return [row if None in row.keys else replace(row, keys=tuple(
        key if own.intersection(row.values) else None
        for key, own in zip(row.keys, alone, strict=True))) for row in rows]


def pair_lives(specification: Specification, rows: Sequence[Row]) -> list[PairLife]:
    """Return the lives of pairs, from what a pair is."""
    both = specification.instance_variables
    halves = [lives(specification, of_one(specification, rows), place) for place in range(2)]
    alone = [{item.name for item in specification.signals if item.variables == (one.name,)}
             for one in both]
    shared = {item.name for item in specification.signals if not item.variables}
    forget = min((item.forget for item in both if item.forget), default=0)
    found = [PairLife('', 0, keys=(one, other)) for one in both[0].keys for other in both[1].keys]
    alive = {life.keys: life for life in found}
    present: dict[str, Any] = {}

    def single(half: int, key: str | None, number: int) -> dict[str, Any] | None:
        """Return the inputs of an instance of a half in a row; None if it does not concern it."""
        for life in halves[half]:
            if life.key == key and number in life.rows:
                return {name: value for name, value in life.values[life.rows.index(number)].items()
                        if name in alone[half]}
        return None

    def known_of(half: int, key: str, number: int) -> dict[str, Any]:
        """Return the inputs of an instance of a half that is there at a row."""
        for life in halves[half]:
            if life.key == key and (life.end == NEVER or life.after >= number):
                values = [values for row, values in zip(life.rows, life.values) if row <= number]
                return {name: value for name, value in values[-1].items()
                        if name in alone[half]} if values else {}
        return {}

    def let_end(by: int, besides: object, row: int) -> None:
        for keys, life in [*alive.items()]:
            if forget and life.last + forget <= by and keys != besides:
                life.end, life.after = life.last + forget, row
                del alive[keys]

    def has_room(keys: tuple[str, str]) -> bool:
        return all(item.keys or len({other[half] for other in alive} | {keys[half]}) <= item.most
                   for half, item in enumerate(both))

    for number, row in enumerate(rows):
        let_end(row.time - 1, None, number - 1)
        present |= {name: value for name, value in row.values.items() if name in shared}
        keys = row.keys[0], row.keys[1]
        if keys[0] is not None and keys[1] is not None:
            own = keys[0], keys[1]
            if own not in alive and not (both[0].keys and both[1].keys) and has_room(own):
                alive[own] = PairLife('', row.time, keys=own)
                found.append(alive[own])
                for half in range(2):
                    alive[own].inputs |= known_of(half, own[half], number)
            if own in alive:
                alive[own].last = row.time
                alive[own].inputs |= {name: value for name, value in row.values.items()
                                      if name.startswith('p_')}
        for pair, life in alive.items():
            concerned = pair == keys or row.is_for_all
            for half in range(2):
                values = {name: row.values[name] for name in alone[half] if name in row.values}
                if pair[half] == keys[half] and (None in keys or values) and single(
                        half, keys[half], number) is not None:
                    concerned = True
                    life.inputs |= values
            if concerned:
                life.rows.append(number)
                life.values.append({**present, **life.inputs})
        let_end(row.time, keys, number)
    return found


def of_pairs(specification: Specification) -> list[int]:
    """Return the places of the requirements of pairs."""
    mentioned = {item.name: {*item.variables} for item in specification.signals}
    return [place for place, item in enumerate(specification.properties)
            if len(set[str]().union(*(mentioned[name] for name in item.inputs))) == 2]


def split(specification: Specification) -> tuple[Specification, list[int], list[int]]:
    """Return a specification without pairs, and the places of requirements: its own, of pairs."""
    pairs = of_pairs(specification)
    others = [place for place, _ in enumerate(specification.properties) if place not in pairs]
    return replace(
        specification, properties=tuple(specification.properties[place] for place in others),
        signals=tuple(item for item in specification.signals if len(item.variables) < 2),
    ), others, pairs


@pytest.mark.parametrize(('policy', 'variables', 'forget'), [
    (Policy.EVERY_MESSAGE, [ROBOT, JOINT], (0, 0)), (Policy.ALL_INPUTS, [ROBOT, JOINT], (20, 9)),
    (Policy.RELEVANT_MESSAGE, [FLEET, JOINT], (0, 13)), (Policy.PERIODIC, [FLEET, ARM], (0, 0))])
def test_a_pair_is_the_plain_bundle_on_its_rows(
        tmp_path: Path, policy: Policy, variables: list[ManifestVariable],
        forget: tuple[int, int]) -> None:
    rng = Random(f'{policy}')
    both = [replace(item, forget=time) for item, time in zip(variables, forget)]
    specification = replace(pair_bundle(rng, both), policy=policy)
    times = [0]
    for _ in range(119):
        times.append(times[-1] + rng.choice([1, 1, 2, 5, 7, 20]))
    rows = pair_rows(rng, specification, 120, times)
    _, (_, *found) = run(tmp_path, specification, rows, has_times=True)
    plain, others, pairs = split(specification)
    assert len(pairs) > 5
    expected = [[''] * len(specification.properties) for _ in rows]
    single = of_one(plain, rows)
    of_pairs: Lives = {BOTH: pair_lives(specification, rows)}
    for cells, wanted in zip(expected, step_table(plain, single, of_pairs), strict=True):
        for place, cell in zip(others, wanted, strict=True):
            cells[place] = cell
    values = bundle_values(plain, single, {**of_pairs, **lives_of_one(plain, single)})
    count = 0
    for life in pair_lives(specification, rows):
        inputs = with_aggregates(specification, life, values)
        for place in pairs:
            item = specification.properties[place]
            for number, verdict in stepwise(
                    item.formula, item.feedback, life.rows, inputs).items():
                if rows[number].keys == life.keys:
                    expected[number][place] = str(int(bool(verdict)))
                    count += 1
    assert [cells[3:] for cells in found] == expected
    assert count > 30


@pytest.mark.parametrize('seed', range(2))
def test_under_timed_values_over_pairs_are_those_of_their_lives(tmp_path: Path, seed: int) -> None:
    rng = Random(f'over pairs {seed}')
    both = [[replace(ROBOT, forget=20), JOINT], [FLEET, ARM]][seed]
    whole = pair_bundle(rng, both, loops=0)
    specification = timed(without(whole, lambda item: (
        item.variables != BOTH or has_messages(item.operand)
        or (seed == 0 and item.function in (OverInstances.LEAST, OverInstances.GREATEST)))))
    over = {item.signal.name for item in specification.aggregates}
    shared = over.union(item.name for item in specification.signals if not item.variables)
    specification = replace(specification, properties=tuple(
        item for item in specification.properties
        if shared.issuperset(item.inputs) and over.intersection(item.inputs)))
    assert len(specification.properties) > 1
    times = [5 * 10 ** 9]
    for _ in range(59):
        times.append(times[-1] + rng.choice([1, 1, 2, 5, 9, 30, 31]))
    rows = pair_rows(rng, specification, 60, times)
    until = times[-1] + 40
    _, (_, *found) = run(tmp_path, specification, rows, has_times=True, until=until)
    check_timed(specification, rows, until, found, {BOTH: pair_lives(specification, rows)})


@pytest.mark.parametrize('seed', range(3))
def test_under_timed_each_change_of_a_pair_is_a_row(tmp_path: Path, seed: int) -> None:
    rng = Random(seed)
    both = [[ROBOT, JOINT], [replace(FLEET, forget=0), replace(JOINT, forget=30)],
            [FLEET, ARM]][seed]
    specification = pair_bundle(rng, both, loops=0)
    pairs = [specification.properties[place] for place in of_pairs(specification)]
    aggregated = {item.signal.name for item in specification.aggregates}
    specification = timed(replace(specification, aggregates=(), signals=tuple(
        item for item in specification.signals if item.name not in aggregated), properties=tuple(
            item for item in pairs if aggregated.isdisjoint(item.inputs)
            and not has_messages(item.formula))))
    times = [5 * 10 ** 9]
    for _ in range(59):
        times.append(times[-1] + rng.choice([1, 1, 2, 5, 9, 30, 31]))
    rows = pair_rows(rng, specification, 60, times)
    until = times[-1] + rng.choice([0, 5, 100])
    _, (_, *found) = run(tmp_path, specification, rows, has_times=True, until=until)
    wanted: set[tuple[int, tuple[str, str], tuple[str, ...]]] = {
        (row.time, (row.keys[0] or '', row.keys[1] or ''), ('',) * len(specification.properties))
        for row in rows}
    for life in pair_lives(specification, rows):
        wanted = with_changes(specification, life, rows, min(life.end, until + 1), wanted)
    shown = [(parse_seconds(line[0]), (line[1], line[2]), tuple(line[3:])) for line in found]
    assert sorted(shown) == sorted(wanted)
    assert len({keys for _, keys, cells in shown if any(cells)}) > 3


def with_changes(specification: Specification, life: PairLife, rows: Sequence[Row], end: int,
                 wanted: set[tuple[int, tuple[str, str], tuple[str, ...]]],
                 ) -> set[tuple[int, tuple[str, str], tuple[str, ...]]]:
    """Return the rows with those of a pair: its own, and where its verdicts change."""
    times = [rows[number].time for number in life.rows]
    histories = [known(item.formula, times, life.values, end) for item in specification.properties]
    own = {rows[number].time for number in life.rows if rows[number].keys == life.keys}
    before = ('',) * len(histories)
    ticks = {tick for one in histories if one for tick in one.changes} | own
    for tick in sorted(ticks):
        values = [one.at(tick) if one else None for one in histories]
        cells = tuple('' if value is None else str(int(bool(value))) for value in values)
        if tick in own:
            wanted = {row for row in wanted if row[0] != tick or row[1] != life.keys}
        if tick in own or cells != before:
            wanted = {*wanted, (tick, life.keys, cells)}
        before = cells
    return wanted
