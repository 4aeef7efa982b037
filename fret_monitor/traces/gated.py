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
Gates that would stay closed, and substitutes that violate: found by example.

The monitor of a gate gets random messages of the other topics, and messages of the gate's topic as
the gate passes them. Wherever a requirement is violated, values of a message are tried that matter
to the formulas. What is not found may exist.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice, product
from math import prod
from random import Random
from typing import TypeAlias

from fret_monitor.build import build_specification
from fret_monitor.elaboration.restrict import (
    gates_with_keys, judged_formula, kept_by,
)
from fret_monitor.logic.formula import (
    Binary, Choice, Constant, Conversion, Feedback, postorder, Previous, Unary, Variable,
)
from fret_monitor.logic.specification import Gate, Property, Signal, Specification
from fret_monitor.model.diagnostics import Diagnostic, Level
from fret_monitor.model.policies import InputSource, Otherwise, Report, Stale
from fret_monitor.model.values import ValueType
from fret_monitor.native.monitor import Monitor
from fret_monitor.runtime import Evaluator
from fret_monitor.runtime.fields import read_fields
from fret_monitor.traces.boundary import boundary_values, constants, discrete_values
from fret_monitor.traces.trace import Value

_RUNS = 60
_STEPS = 12
_MOST_CONSTANTS = 8
_MOST_NODES = 5000
_MOST_MESSAGES = 256  # that are tried wherever a requirement is violated
_FEWEST_STATES = 20  # in which a substitute was tried, before it is called violating
_PLAIN = (Binary, Choice, Constant, Conversion, Unary, Variable)  # nodes without a past
_PAUSES_NS = (1, 10 ** 6, 10 ** 8, 10 ** 9, 10 ** 10)


@dataclass(frozen=True)
class Repair:
    """
    Whether some message of a gate's topic satisfies a requirement in every state.

    `example` are inputs after which none does, None: one always does. `is_first`: at the first
    step none does, whatever the other inputs are.
    """

    example: tuple[tuple[str, Value], ...] | None = None
    is_first: bool = False


Decide: TypeAlias = Callable[[Specification, Gate], Mapping[str, Repair]]
"""Returns what is known of the requirements of a gate of a specification, by id."""


def doubtful_gates(specification: Specification,
                   decide: Decide = lambda specification, gate: {}) -> Iterator[Diagnostic]:
    """
    Yield a warning for each requirement that nothing, or not the substitute, can satisfy.

    What `decide` does not decide is found by example. Each gate is compiled; of those for each key
    of a variable, the first.

    Raises
    ------
    NativeError
        if there is no C compiler, or it fails.
    """
    first = {gate.place: (whole, gate) for whole, gate in reversed(
        [*gates_with_keys(specification)])}
    for whole, gate in reversed(first.values()):
        yield from _GateSearch(whole, gate, decide(whole, gate)).warnings()


@dataclass
class _Tried:
    """What was found about a requirement; `opens`: some message satisfied its first step."""

    repair: Repair | None = None
    opens: bool = False
    substituted: int = 0
    violated: int = 0
    violating: tuple[tuple[str, Value], ...] | None = None


class _GateSearch:
    """Runs the monitor of a gate on random messages."""

    def __init__(self, specification: Specification, gate: Gate,
                 decided: Mapping[str, Repair]) -> None:
        part = kept_by(specification, gate)
        # No input is silent, and of `H p` what counts is p, as for the gate.
        part = replace(
            part,
            signals=tuple(replace(signal, timeout=None, startup=None, stale=Stale.WARN)
                          for signal in part.signals),
            properties=tuple(replace(item, report=Report.OCCURRENCE)
                             for item in part.properties))
        self._gate = gate
        self._part = part
        self._rng = Random(1)
        self._pools = {signal.name: _pool(signal, part) for signal in part.signals}
        monitor = build_specification(part).monitor
        self._evaluator = Evaluator(monitor)
        topics = [topic.inputs for topic in monitor.manifest.topics]
        names = [topic.name for topic in monitor.manifest.topics]
        judged = gate.settings.judged_topic
        self._judged = names.index(judged) if judged in names else None
        self._others = [index for index in range(len(topics)) if index != self._judged]
        self._topics = topics
        self._now = 0
        self._substitute = self._fields(monitor)
        self._tried = {index: _Tried(decided.get(item.id), opens=item.id in decided)
                       for index, item in enumerate(part.properties)
                       if self._judged is not None and any(
                           place in topics[self._judged]
                           for place in monitor.manifest.requirements[index].inputs)}

    def _fields(self, monitor: Monitor) -> dict[int, Value]:
        """Return the inputs that the substitute sets."""
        settings = self._gate.settings
        if settings.otherwise is not Otherwise.SUBSTITUTE or self._judged is None:
            return {}
        readings = read_fields(monitor, self._judged, settings.substitute) or ()
        inputs = self._topics[self._judged]
        return {index: reading.value for index, reading in zip(inputs, readings)
                if reading.value is not None}

    def warnings(self) -> Iterator[Diagnostic]:
        """Search, and yield what was found."""
        start = self._evaluator.save()
        for _ in range(_RUNS if self._tried else 0):
            self._evaluator.restore(start)
            self._run()
        for index, tried in self._tried.items():
            yield from self._of_requirement(self._part.properties[index], tried)

    def _of_requirement(self, item: Property, tried: _Tried) -> Iterator[Diagnostic]:
        gate, repair = self._gate, tried.repair
        place = gate.keep_places[gate.keep.index(item.id)]
        if not tried.opens or repair is not None and repair.is_first:
            has_past = _has_past(item)
            yield Diagnostic(
                f'{item.id} is false at its first step, whatever passes' if has_past else
                f'no message satisfies {item.id}', place, f"the gate '{gate.name}' never opens",
                'let it hold without a past: FTP | PROPERTY' if has_past else
                f'change {item.id}, or leave it to the monitor', Level.WARNING)
        elif repair is not None and repair.example is not None:
            yield Diagnostic(
                f"{item.id} can be violated whatever passes the gate '{gate.name}'", place,
                _after(repair.example), self._remedy(item), Level.WARNING)
        elif tried.substituted >= _FEWEST_STATES and tried.violated == tried.substituted:
            yield Diagnostic(
                f"the substitute of the gate '{gate.name}' violates {item.id}",
                gate.otherwise_place, f'in all {tried.substituted} states in which it was tried',
                'choose values that satisfy it', Level.WARNING)
        elif tried.violating is not None:
            yield Diagnostic(
                f"the substitute of the gate '{gate.name}' can violate {item.id}",
                gate.otherwise_place, _after(tried.violating),
                'it is sent nevertheless: choose values that satisfy it', Level.WARNING)

    def _remedy(self, item: Property) -> str:
        judged = () if self._judged is None else self._topics[self._judged]
        own = {self._part.signals[index].name for index in judged}
        if self._gate.settings.otherwise is Otherwise.SUBSTITUTE or not own >= {*item.inputs}:
            return 'until that changes, nothing passes, and no substitute satisfies it'
        return ('what is withheld never happens, so that nothing passes any more: write '
                'otherwise: {substitute: ...}, or what the message itself has to be (p, not Y p)')

    def _run(self) -> None:
        """Deliver random messages, each of the gate's topic only if it passes."""
        evaluator = self._evaluator
        self._now = 10 ** 9
        evaluator.advance(self._now)
        values: dict[int, Value] = {}
        for topic in self._others:
            values |= self._random(topic)
            self._deliver(topic, values)
        self._try_first()
        for _ in range(_STEPS):
            if self._others and self._rng.random() < 0.7:
                topic = self._rng.choice(self._others)
                values |= self._random(topic)
                self._deliver(topic, values)
            else:
                values |= self._pass(self._random(self._judged))
            self._try(values)

    def _random(self, topic: int | None) -> dict[int, Value]:
        return {} if topic is None else {
            index: self._rng.choice(self._pools[self._part.signals[index].name])
            for index in self._topics[topic]}

    def _deliver(self, topic: int, values: Mapping[int, Value]) -> None:
        evaluator = self._evaluator
        self._now += self._rng.choice(_PAUSES_NS)
        evaluator.advance(self._now - 1)
        self._now = evaluator.arrival(self._now)
        for index in self._topics[topic]:
            evaluator.store(index, values[index], self._now)
        evaluator.message(topic, self._now)

    def _pass(self, values: Mapping[int, Value]) -> Mapping[int, Value]:
        """Deliver a message of the gate's topic, and take it back if it violates."""
        assert self._judged is not None
        before, now = self._evaluator.save(), self._now
        self._deliver(self._judged, values)
        if all(map(self._holds, range(len(self._part.properties)))):
            return values
        self._evaluator.restore(before)
        self._now = now
        return {}

    def _holds(self, index: int) -> bool:
        return self._evaluator.requirement_counts(index).holds

    def _try(self, values: Mapping[int, Value]) -> None:
        """Try the substitute here, and what could satisfy the requirements that do not hold."""
        if self._judged is None or not all(
                self._evaluator.value(index) is not None
                for topic in self._others for index in self._topics[topic]):
            return
        before, now = self._evaluator.save(), self._now
        violated = []
        if len(self._substitute) == len(self._topics[self._judged]):
            self._deliver(self._judged, self._substitute)
            violated = [index for index in self._tried if not self._holds(index)]
            self._evaluator.restore(before)
            self._now = now
            for index, tried in self._tried.items():
                tried.substituted += 1
                tried.violated += index in violated
        doubtful = {index for index, tried in self._tried.items() if tried.repair is None and (
            not self._holds(index) or _has_past_truth(self._part.properties[index]))}
        open_ = [index for index, tried in self._tried.items()
                 if index in doubtful or tried.violating is None and index in violated]
        unrepaired = self._unrepaired(open_)
        for index in open_:
            tried = self._tried[index]
            if index not in unrepaired:
                if index in violated:
                    tried.violating = tried.violating or self._inputs(index, values)
            elif index in doubtful:
                tried.repair = Repair(self._inputs(index, values))

    def _inputs(self, requirement: int,
                values: Mapping[int, Value]) -> tuple[tuple[str, Value], ...]:
        """Return the names and values of the inputs of a requirement."""
        read = self._part.properties[requirement].inputs
        return tuple((name, value) for place, value in sorted(values.items())
                     if (name := self._part.signals[place].name) in read)

    def _try_first(self) -> None:
        """Try what satisfies the first step of each requirement."""
        if self._judged is not None:
            closed = [index for index, tried in self._tried.items() if not tried.opens]
            left = self._unrepaired(closed)
            for index in closed:
                self._tried[index].opens = index not in left

    def _unrepaired(self, indices: Sequence[int]) -> list[int]:
        """Return those of some requirements that no message satisfies."""
        assert self._judged is not None
        open_, before = list(indices), self._evaluator.save()
        places, now = self._topics[self._judged], self._now
        if not open_:
            return open_
        for row in self._rows(places):
            self._deliver(self._judged, dict(zip(places, row)))
            open_[:] = [index for index in open_ if not self._holds(index)]
            self._evaluator.restore(before)
            self._now = now
            if not open_:
                break
        return open_

    def _rows(self, places: Sequence[int]) -> Iterator[tuple[Value, ...]]:
        """Yield combinations of fields: all, or a sample."""
        pools = [self._pools[self._part.signals[place].name] for place in places]
        if prod(map(len, pools)) <= _MOST_MESSAGES:
            return product(*pools)
        return (tuple(self._rng.choice(pool) for pool in pools) for _ in range(_MOST_MESSAGES))


def _has_past(item: Property) -> bool:
    return not all(isinstance(node, _PLAIN) for node in postorder([judged_formula(item)]))


def _has_past_truth(item: Property) -> bool:
    """Whether it depends on the past, but not on past numbers: of these too few are tried."""
    return _has_past(item) and not any(
        isinstance(node, Feedback | Previous) and node.type is not ValueType.BOOL
        for node in postorder(item.roots))


def _pool(signal: Signal, part: Specification) -> list[Value]:
    """Return values of an input that matter to the formulas."""
    if signal.source is InputSource.RECEIVED:
        return [True]
    if discrete := discrete_values(signal):
        return discrete
    numbers: set[int | float] = {0, 1}
    for item in part.properties:
        if signal.name in item.inputs:
            numbers |= constants(islice(postorder(item.roots), _MOST_NODES))
    named = [value for _, value in signal.values if isinstance(value, int)]
    values, _ = boundary_values(signal.type, sorted(numbers)[:_MOST_CONSTANTS])
    return [value for value in dict.fromkeys([*named, *values])
            if value == value and not (signal.is_never_negative and value < 0)]


def _after(inputs: Sequence[tuple[str, Value]]) -> str:
    return 'for example after ' + ', '.join(f'{name} = {_shown(value)}' for name, value in inputs)


def _shown(value: Value) -> str:
    return str(value).lower() if isinstance(value, bool) else f'{value:g}'
