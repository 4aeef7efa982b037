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

"""
What a bundle with instance variables says, from its definition: the oracle of their tests.

A trace is cut into lives: what concerns one key from its start to its end. Each life is a trace of
the plain bundle in which the key is written in place of the variable, which the reference
evaluates. Aggregates are computed anew, at each step, from the values of all lives.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from random import Random
from typing import Any

from fret_monitor.logic.evaluate import evaluate
from fret_monitor.logic.formula import Aggregate, Formula, Over, TRUE, Variable, variables
from fret_monitor.logic.pointwise import aggregate, Value
from fret_monitor.logic.specification import (
    InstanceAggregate, Property, Signal, Specification,
)
from fret_monitor.logic.timed import evaluate_timed, TimedTrace, value_at
from fret_monitor.model.manifest import ManifestVariable
from fret_monitor.model.policies import InputSource, OverInstances
from fret_monitor.model.values import ValueType
from strategies import FormulaMaker, INPUTS, random_property, random_trace, specification_of

NEVER = 10 ** 30
_NUMBERS = {OverInstances.LEAST: Aggregate.LEAST, OverInstances.GREATEST: Aggregate.GREATEST,
            OverInstances.SUM: Aggregate.SUM}


@dataclass(frozen=True)
class Row:
    """A row of a trace: its time, its key of each variable, and its values by input."""

    time: int
    keys: tuple[str | None, ...]
    values: Mapping[str, Any]
    is_for_all: bool


@dataclass
class Life:
    """An instance from its start to its end: the rows that concern it, with its inputs there."""

    key: str
    begin: int
    rows: list[int] = field(default_factory=list)
    values: list[dict[str, Any]] = field(default_factory=list)
    last: int = 0
    end: int = NEVER  # its time; it is over then
    after: int = -1  # with an end: the last row that comes before it


def lives(specification: Specification, rows: Sequence[Row], variable: int) -> list[Life]:
    """Return the lives of the keys of a variable."""
    item = specification.instance_variables[variable]
    own = {signal.name for signal in specification.signals if signal.variables == (item.name,)}
    shared = {signal.name for signal in specification.signals if not signal.variables}
    alive = {key: Life(key, rows[0].time if rows else 0) for key in item.keys}
    inputs: dict[str, dict[str, Any]] = {key: {} for key in alive}
    found, present = list(alive.values()), dict[str, Any]()

    def let_end(by: int, besides: str | None, row: int) -> None:
        for key, life in [*alive.items()]:
            if item.forget and life.last + item.forget <= by and key != besides:
                life.end, life.after = life.last + item.forget, row
                del alive[key]

    for number, row in enumerate(rows):
        let_end(row.time - 1, None, number - 1)
        present |= {name: value for name, value in row.values.items() if name in shared}
        key = row.keys[variable]
        if key is not None and key not in alive and len(alive) < item.most:
            alive[key] = Life(key, row.time)
            inputs[key] = {}
            found.append(alive[key])
        if key is not None and key in alive:
            alive[key].last = row.time
            inputs[key] |= {name: value for name, value in row.values.items() if name in own}
        for name, life in alive.items():
            if name == key or row.is_for_all:
                life.rows.append(number)
                life.values.append({**present, **inputs[name]})
        let_end(row.time, key, number)
    return found


def of_instances(item: InstanceAggregate, values: Sequence[Value]) -> Value | None:
    """Return an aggregate of the values of its operand; None if it has no value."""
    match item.function:
        case OverInstances.COUNT:
            return sum(map(bool, values))
        case OverInstances.ANY:
            return any(values)
        case OverInstances.ALL:
            return all(values)
    function: Callable[[Sequence[Value]], Value] = aggregate(
        Over(_NUMBERS[item.function], 1, item.operand, TRUE))
    if not values:
        zero = 0.0 if item.operand.type.is_float else 0
        return zero if item.function is OverInstances.SUM else None
    return function(values)


# -- steps ----------------------------------------------------------------------------------------


def stepwise(formula: Formula, feedback: Any, numbers: Sequence[int],
             values: Sequence[Mapping[str, Any]]) -> dict[int, Value]:
    """Return the value of a formula at each row at which all of its inputs have values."""
    names = dict.fromkeys(item.name for item in variables(formula))
    for _, equation in feedback:
        names |= dict.fromkeys(item.name for item in variables(equation))
    ready = [(number, row) for number, row in zip(numbers, values, strict=True)
             if all(row.get(name) is not None for name in names)]
    trace = {name: [row[name] for _, row in ready] for name in names} or {'': [0] * len(ready)}
    return dict(zip((number for number, _ in ready), evaluate(formula, trace, feedback),
                    strict=True))


Lives = Mapping[tuple[str, ...], Sequence[Life]]
"""The lives of the instances of a variable, or of the pairs of two."""


def lives_of_one(specification: Specification, rows: Sequence[Row]) -> Lives:
    """Return the lives of the keys of each variable."""
    return {(item.name,): lives(specification, rows, place)
            for place, item in enumerate(specification.instance_variables)}


def step_table(specification: Specification, rows: Sequence[Row],
               of_pairs: Lives | None = None) -> list[list[str]]:
    """Return the cells of the requirements in each row, where a row is a step."""
    by_variable = {**(of_pairs or {}), **lives_of_one(specification, rows)}
    values = bundle_values(specification, rows, by_variable)
    for life in (life for all_ in by_variable.values() for life in all_):
        life.values = with_aggregates(specification, life, values)
    columns = [list(_column(specification, item, rows, by_variable, values))
               for item in specification.properties]
    return [list(cells) for cells in zip(*columns, strict=True)]


def _column(specification: Specification, item: Property, rows: Sequence[Row],
            by_variable: Lives, values: list[dict[str, Any]]) -> Iterator[str]:
    owner = owner_of(specification, item.inputs)
    if owner is None:
        found = stepwise(item.formula, item.feedback, range(len(rows)), values)
        yield from (str(int(bool(found[number]))) if number in found else ''
                    for number, _ in enumerate(rows))
        return
    place = [one.name for one in specification.instance_variables].index(owner)
    cells = [''] * len(rows)
    for life in by_variable[owner,]:
        for number, verdict in stepwise(item.formula, item.feedback, life.rows,
                                        life.values).items():
            if rows[number].keys[place] == life.key:
                cells[number] = str(int(bool(verdict)))
    yield from cells


def owner_of(specification: Specification, names: Sequence[str]) -> str | None:
    """Return the variable that inputs mention."""
    signals = {item.name: item for item in specification.signals}
    found = {name for item in names for name in signals[item].variables}
    return found.pop() if found else None


def with_aggregates(specification: Specification, life: Life,
                    values: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the inputs of an instance in its rows, with the aggregates in these rows."""
    names = {item.signal.name for item in specification.aggregates}
    return [{**own, **{name: value for name, value in values[number].items() if name in names}}
            for number, own in zip(life.rows, life.values, strict=True)]


def bundle_values(specification: Specification, rows: Sequence[Row],
                  by_variable: Lives) -> list[dict[str, Any]]:
    """Return the inputs of the bundle's scope at each row, with its aggregates."""
    found, present = list[dict[str, Any]](), dict[str, Any]()
    shared = {signal.name for signal in specification.signals if not signal.variables}
    for row in rows:
        present |= {name: value for name, value in row.values.items() if name in shared}
        found.append(dict(present))
    for item in specification.aggregates:  # those that others read come first
        each = [(life, stepwise(item.operand, item.feedback, life.rows,
                                with_aggregates(specification, life, found)))
                for life in by_variable[item.variables]]
        for number, values in enumerate(found):
            there = [known[max(before)] for life, known in each
                     if (life.end == NEVER or number <= life.after)
                     and (before := [step for step in known if step <= number])]
            values[item.signal.name] = of_instances(item, there)
    return found


# -- random bundles and traffic -------------------------------------------------------------------

OWN = tuple(Variable(f'a_{item.name}', item.type) for item in INPUTS)
OTHER = tuple(Variable(f'b_{item.name}', item.type) for item in INPUTS[::3])
VARIABLES = {'robot': OWN, 'joint': OTHER}


def random_bundle(rng: Random, variables_: Sequence[ManifestVariable],
                  reach: int = 20, loops: int = 1, levels: int = 1) -> Specification:
    """
    Return requirements of each variable and of the bundle, some of them over aggregates.

    With more levels, aggregates and requirements of a variable read aggregates of the level below.
    """
    inputs = [*INPUTS, *OWN, *OTHER]
    plain = specification_of([], inputs)
    of = {item.name: name for name, items in VARIABLES.items() for item in items}
    signals = [replace(item, variables=(of[item.name],), topic=f'/{{{of[item.name]}}}/{item.name}')
               if item.name in of else item for item in plain.signals]
    aggregates = [random_aggregate(rng, number, [rng.choice(variables_).name], reach)
                  for number in range(8)]
    values = [Variable(item.signal.name, item.signal.type) for item in aggregates]
    names = [item.name for item in variables_]
    properties = [random_requirement(rng, f'R-{number}', [*VARIABLES[name], *INPUTS],
                                     VARIABLES[name], reach, loops)
                  for number, name in enumerate(rng.choices(names, k=8))]
    below = values
    for level in range(1, levels):
        properties += [random_requirement(rng, f'L-{level}-{number}', [*VARIABLES[name], *below],
                                          VARIABLES[name], reach, loops, below)
                       for number, name in enumerate(rng.choices(names, k=4))]
        more = [random_aggregate(rng, f'{level}-{number}', [rng.choice(names)], reach, below)
                for number in range(4)]
        aggregates += more
        below = [Variable(item.signal.name, item.signal.type) for item in more]
        values = [*values, *below]
    properties += [random_requirement(rng, f'B-{number}', [*values, *INPUTS], values, reach, loops)
                   for number in range(6)]
    rng.shuffle(properties)
    used = [item for item in signals if not item.variables or item.variables[0] in names]
    return replace(plain, signals=(*used, *(item.signal for item in aggregates)),
                   properties=tuple(properties), instance_variables=tuple(variables_),
                   aggregates=tuple(aggregates))


def random_requirement(rng: Random, name: str, inputs: Sequence[Variable],
                       needed: Sequence[Variable], reach: int, loops: int,
                       below: Sequence[Variable] = ()) -> Property:
    """Return a requirement that reads one of the needed inputs, of those below, and others."""
    names, aggregated = {item.name for item in needed}, {item.name for item in below}
    while True:
        taken = [rng.choice(needed), *rng.sample(list(inputs), 3),
                 *([rng.choice(below)] if below else [])]
        found = random_property(rng, name, taken, reach=reach, loops=rng.randint(0, loops))
        if names.intersection(found.inputs) and (
                not below or aggregated.intersection(found.inputs)):
            return found


def random_aggregate(rng: Random, number: int | str, names: Sequence[str], reach: int,
                     below: Sequence[Variable] = (),
                     inputs: Sequence[Variable] = ()) -> InstanceAggregate:
    """Return a function of a random operand that reads one of the inputs, if not below others."""
    function = rng.choice([*OverInstances])
    inputs = inputs or VARIABLES[names[0]]
    own = {item.name for item in inputs}
    aggregated = {item.name for item in below}
    while True:
        maker = FormulaMaker(rng.randrange, [
            rng.choice(inputs),
            *(rng.sample(list(below), 2) if below else rng.sample(INPUTS, 2))], reach=reach)
        kinds = [ValueType.INT64, ValueType.UINT64, ValueType.FLOAT64] + [
            ValueType.FLOAT32] * (function is not OverInstances.SUM)
        operand = maker.formula(6) if function.takes_truth else maker.term(rng.choice(kinds), 6)
        read = {item.name for item in variables(operand)}
        if own.intersection(read) and (not below or aggregated.intersection(read)):
            break
    kind = {OverInstances.COUNT: ValueType.INT64, OverInstances.ANY: ValueType.BOOL,
            OverInstances.ALL: ValueType.BOOL}.get(function, operand.type)
    name = f'{function.value}({", ".join(names)}: {number})'
    signal = Signal(name, kind, None, None, (), (), None, (), source=InputSource.INSTANCES)
    return InstanceAggregate(signal, function, tuple(names), operand)


def random_rows(rng: Random, specification: Specification, count: int,
                times: Sequence[int] | None = None, *, are_pairs: bool = False) -> list[Row]:
    """Return rows of keys that come, end and return, of the bundle alone, and of several."""
    pools = [item.keys or [f'{item.name}-{number}' for number in range(item.most + 1)]
             for item in specification.instance_variables]
    inputs = [Variable(item.name, item.type) for item in specification.signals
              if item.source is not InputSource.INSTANCES]
    columns = random_trace(rng, inputs, count)
    mentioned = {item.name: item.variables for item in specification.signals}
    rows = []
    for number in range(count):
        busy = rng.choice(pools[0])
        keys = tuple(rng.choice([None, busy, rng.choice(pool)] if pool is pools[0] else
                                [None, rng.choice(pool) if are_pairs else None,
                                 rng.choice(pool)]) for pool in pools)
        of = {item.name for item, key in zip(specification.instance_variables, keys, strict=True)
              if key is not None}
        has_shared = number < 2 or rng.random() < 0.3
        values = {item.name: columns[item.name][number] for item in inputs
                  if (has_shared if not mentioned[item.name] else of.issuperset(
                      mentioned[item.name])) and (number < 2 or rng.random() < 0.8)}
        is_for_all = any(not mentioned[name] for name in values) or not any(keys)
        rows.append(Row(number if times is None else times[number], keys, values, is_for_all))
    return rows


# -- time -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Known:
    """The values of a formula from a time on, until before another."""

    begin: int
    end: int
    pieces: tuple[tuple[int, Value], ...]  # since `begin`

    def at(self, time: int) -> Value | None:
        """Return the value at a time; None if there is none."""
        return value_at(list(self.pieces), time - self.begin) \
            if self.begin <= time < self.end else None

    @property
    def changes(self) -> list[int]:
        """The times at which it begins, or changes."""
        return [self.begin + tick for tick, _ in self.pieces]


def known(formula: Formula, times: Sequence[int], values: Sequence[Mapping[str, Any]],
          end: int) -> Known | None:
    """Return the values of a formula from when its inputs have values; None if they never do."""
    names = dict.fromkeys(item.name for item in variables(formula))
    ready = [place for place, row in enumerate(values)
             if all(row.get(name) is not None for name in names)]
    if not ready or times[ready[0]] >= end:
        return None
    begin, first = times[ready[0]], ready[0]
    kept = [place for place in range(first, len(times)) if times[place] < end]
    trace = TimedTrace([times[place] - begin for place in kept],
                       {name: [values[place][name] for place in kept] for name in names},
                       end - 1 - begin)
    history, = evaluate_timed([formula], trace)
    return Known(begin, end, tuple(history))


def timed_aggregates(specification: Specification, rows: Sequence[Row], until: int,
                     by_variable: Lives) -> tuple[
                         list[int], list[dict[str, Any]], 'dict[str, _Over]']:
    """
    Return the times at which an input of the bundle's scope may change, and the inputs then.

    The aggregates come last.
    """
    over: dict[str, _Over] = {}
    for item in specification.aggregates:  # those that others read come first
        own = list[Known]()
        for life in by_variable[item.variables]:
            times, values = timed_life(life, rows, over)
            if found := known(item.operand, times, values, min(life.end, until + 1)):
                own.append(found)
        over[item.signal.name] = _Over(item, own)
    times = sorted({row.time for row in rows}.union(*(one.changes for one in over.values())))
    shared = {signal.name for signal in specification.signals if not signal.variables}
    table: list[dict[str, Any]] = []
    present, place = dict[str, Any](), 0
    for time in times:
        while place < len(rows) and rows[place].time <= time:
            present |= {name: value for name, value in rows[place].values.items()
                        if name in shared}
            place += 1
        table.append({**present, **{name: one.at(time) for name, one in over.items()}})
    kept = [place for place, time in enumerate(times) if time <= until]
    return [times[place] for place in kept], [table[place] for place in kept], over


@dataclass(frozen=True)
class _Over:
    """The values of an aggregate over time, from those of its operand in each life."""

    item: InstanceAggregate
    each: Sequence[Known]

    def at(self, time: int) -> Value | None:
        """Return the value at a time; None if there is none."""
        return of_instances(self.item, [
            value for one in self.each if (value := one.at(time)) is not None])

    @property
    def changes(self) -> set[int]:
        """The times at which it may change."""
        return {time for one in self.each for time in (*one.changes, one.end)}


def timed_life(life: Life, rows: Sequence[Row],
               over: Mapping[str, _Over]) -> tuple[list[int], list[dict[str, Any]]]:
    """Return the times at which an input of an instance may change, and its inputs then."""
    of_rows = {rows[number].time: values
               for number, values in zip(life.rows, life.values, strict=True)}
    first = min(of_rows, default=NEVER)
    changes = {time for one in over.values() for time in one.changes if time >= first}
    times, present = sorted({*of_rows, *changes}), dict[str, Any]()
    values = []
    for time in times:
        present = of_rows.get(time, present)
        values.append({**present, **{name: one.at(time) for name, one in over.items()}})
    return times, values
