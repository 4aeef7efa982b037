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
Search for a trace, starting with a reset, on which the C and the program differ.

A failed proof yields a state and inputs at which a step is wrong, but the state may be
unreachable. So the C and the transition system are executed side by side on traces. The values in
the traces are those of failed proofs and boundary values of the requirements, repeated for as
many steps as the bounds require. The trace found is then shrunk.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, islice
import math
from random import Random
import time
from typing import Any

from fret_monitor.logic.specification import Signal
from fret_monitor.model.floats import to_float32
from fret_monitor.program.monitor_program import Delay
from fret_monitor.proving.c_source import Unreadable
from fret_monitor.proving.contracts import ARITHMETIC
from fret_monitor.proving.execution import Machine
from fret_monitor.proving.monitor import ALL, ANY, ProofSubject
from fret_monitor.smt import numbers
from fret_monitor.smt import terms as t
from fret_monitor.smt.concrete import function_of
from fret_monitor.smt.terms import Sort, Term
from fret_monitor.smt.transition import NotModelled, transition_system
from fret_monitor.traces.boundary import both_sides
from fret_monitor.traces.csv_trace import trace_text
from fret_monitor.traces.random_traces import Pools, random_traces
from fret_monitor.traces.shrink import Shrinker
from fret_monitor.traces.trace import first_steps, rows_of, Trace

_SHORT_TRACES = 100  # tried before traces of the length that the bounds require
_MAX_TRACE_STEPS = 70_000
_MAX_SHRINK_STEPS = 60_000
_Row = tuple[Any, ...]


@dataclass(frozen=True)
class Counterexample:
    """
    A trace, and the errors at its last step.

    `rows` hold the inputs in the bundle's order. `meant` and `found` are the verdicts of the
    program and of the C at the last step, by the index of the requirement; `undefined` are the
    violated conditions for defined behaviour.
    """

    rows: tuple[_Row, ...]
    meant: Mapping[int, bool]
    found: Mapping[int, bool]
    undefined: tuple[str, ...]


class ProgramRunner:
    """Executes the C of a group, or of all groups, and the transition system side by side."""

    def __init__(self, subject: ProofSubject, group: int) -> None:
        """Build the terms of a reset and a step of both; raises `Unreadable` and `KeyError`."""
        groups = [group] if group >= 0 else range(len(subject.layouts))
        state, inputs = subject.state(groups), subject.inputs()
        reset = Machine(subject.code, state, ARITHMETIC)
        subject.call_reset(reset, group)
        step = Machine(subject.code, {**state, **inputs}, ARITHMETIC)
        subject.call_step(step, group)
        systems = [transition_system(subject.layouts[number].group, subject.signals(),
                                     f'meant.{number}') for number in groups]
        self.kept = [item for system in systems for item in system.state]
        meant = {number: item for system in systems for number, item in system.verdicts.items()}
        self.verdicts = sorted(meant)
        self.conditions = [*step.conditions, *reset.conditions]
        self.state = [*state.values(), *(item.now for item in self.kept)]
        self.inputs = list(inputs.values())
        found = [step.memory.get(('verdicts', number), t.FALSE) for number in self.verdicts]
        self.after = [*(step.memory[path] for path in state), *(item.after for item in self.kept)]
        self.results = [*found, *(meant[number] for number in self.verdicts),
                        *(item.holds for item in self.conditions)]
        self.starts = [*(reset.memory[path] for path in state),
                       *(item.start for item in self.kept)]
        self.begins = self._begins(list(state.values()))
        arguments = [*self.state, *self.inputs]
        unknown = self._unknown([*self.after, *self.results], arguments)
        values = [_odd(item.sort) for item in unknown]
        compute = function_of([*self.after, *self.results], [*arguments, *unknown])
        self._compute: Callable[..., list[Any]] = compute if not unknown else \
            lambda *given: compute(*given, *values)

    def _unknown(self, roots: Sequence[Term], known: Sequence[Term]) -> list[Term]:
        """Return the variables that stand for uninitialised memory."""
        arguments = set(known)
        return [item for item in t.postorder(roots)
                if item.op == 'variable' and item not in arguments]

    def _begins(self, before: Sequence[Term]) -> list[list[Any]]:
        """Return the states after a reset of memory with odd values and of zeroed memory."""
        everything = [*before, *self._unknown(self.starts, before)]
        compute = function_of(self.starts, everything)
        ones = compute(*(_odd(item.sort) for item in everything))
        zeros = compute(*(zero(item.sort) for item in everything))
        return [ones] if repr(ones) == repr(zeros) else [ones, zeros]

    def judged(self, results: Sequence[Any]) -> tuple[list[bool], list[bool], list[bool]]:
        """Split results into the C's verdicts, the program's verdicts and the conditions."""
        count = len(self.verdicts)
        return (list(results[:count]), list(results[count:2 * count]), list(results[2 * count:]))

    def example(self, rows: Sequence[_Row], results: Sequence[Any]) -> Counterexample:
        """Return a counterexample that ends with these results."""
        found, meant, holds = self.judged(results)
        undefined = tuple(item.what for item, each in zip(self.conditions, holds) if not each)
        return Counterexample(tuple(rows), dict(zip(self.verdicts, meant)),
                              dict(zip(self.verdicts, found)), undefined)

    def first_difference(self, rows: Sequence[_Row], until: float) -> tuple[int, list[Any]] | None:
        """Return the first step with an error and its results, or None."""
        found = (self._difference(state, rows, until) for state in self.begins)
        return next((each for each in found if each is not None), None)

    def _difference(self, state: list[Any], rows: Sequence[_Row],
                    until: float) -> tuple[int, list[Any]] | None:
        compute, size = self._compute, len(self.state)
        for number, row in enumerate(rows):
            values = compute(*state, *row)
            found, meant, holds = self.judged(values[size:])
            if found != meant or not all(holds):
                return number, values[size:]
            state = values[:size]
            if number % 1000 == 999 and time.monotonic() > until:
                return None
        return None


def _odd(sort: Sort) -> Any:
    """Return a value that a reset should overwrite."""
    kind, bits = sort
    if kind == 'ring':
        return bytes([0xA5]) * bits
    return {'bool': True, 'word': (1 << bits) - 1, 'real': 1.5}[kind]


def zero(sort: Sort) -> Any:
    """Return the value whose bytes are 0."""
    kind, size = sort
    return bytes(size) if kind == 'ring' else {'bool': False, 'word': 0, 'real': 0.0}[kind]


def find_counterexample(subject: ProofSubject, group: int, values: Sequence[Mapping[Term, Any]],
                        seconds: float) -> Counterexample | None:
    """
    Search for a trace on which a group (ALL: any group) is wrong, for at most `seconds`.

    `values` are those found by failed proofs.
    """
    entries = [ALL, ANY] if group == ALL and len(subject.layouts) > 1 else [group]
    for entry in entries:
        found = _find(subject, entry, values, seconds / len(entries))
        if found is not None:
            return found
    return None


def _find(subject: ProofSubject, group: int, values: Sequence[Mapping[Term, Any]],
          seconds: float) -> Counterexample | None:
    until = time.monotonic() + seconds
    try:
        runner = ProgramRunner(subject, group)
    except (NotModelled, Unreadable, KeyError):
        return None
    pools = _pools(subject, values)
    bounds = _bounds(subject, group)
    rng = Random(0)
    for trace in chain(islice(random_traces(pools, (), 0, rng), _SHORT_TRACES),
                       random_traces(pools, bounds, max(bounds, default=0), rng,
                                     _MAX_TRACE_STEPS)):
        if time.monotonic() > until:
            return None
        found = runner.first_difference(rows_of(trace), until)
        if found is not None:
            return _shrunk(runner, first_steps(trace, found[0] + 1), pools)
    return None


def _shrunk(runner: ProgramRunner, trace: Trace, pools: Pools) -> Counterexample:
    """Return a simpler trace that has an error at its last step and none before."""
    def judge(batch: Sequence[Trace]) -> list[bool]:
        return [runner.first_difference(rows_of(each), math.inf) is not None for each in batch]

    rows = rows_of(Shrinker(pools, _MAX_SHRINK_STEPS).shrink(trace, judge))
    found = runner.first_difference(rows, math.inf)
    assert found is not None
    step, results = found
    return runner.example(rows[:step + 1], results)


def _bounds(subject: ProofSubject, group: int) -> set[int]:
    found: set[int] = set()
    for number, layout in enumerate(subject.layouts):
        if group in (ALL, ANY, number):
            for equation in layout.group.equations:
                operation = equation.operation
                if isinstance(operation, Delay):
                    found.add(operation.steps)
                found.add(getattr(operation, 'bound', 0))
    return found


def _pools(subject: ProofSubject, values: Sequence[Mapping[Term, Any]]) -> list[list[Any]]:
    """Return values to try for each input, in the representation of terms."""
    pools = []
    for item, signal, known in zip(subject.inputs().values(), subject.program.signals,
                                   both_sides(subject.program)):
        pool = [_stored(value, signal) for value in known]
        if signal.type.is_float:
            pool += [_stored(value, signal) for value in (0.0, float('nan'), float('inf'), -0.5)]
        met = [found[item] for found in values if item in found]
        pool += [value for value in met if _is_named(value, signal)] * 2
        pools.append(pool)
    return pools or [[False]]  # without inputs, the C struct has one unused field


def _is_named(value: Any, signal: Signal) -> bool:
    """Whether a trace can contain a value: a string input needs the index of a string."""
    return not signal.is_string or 0 <= value < len(signal.values)


def _stored(value: Any, signal: Signal) -> Any:
    kind, bits = numbers.sort_of(signal.type)
    if kind == 'word':
        return int(value) & ((1 << bits) - 1)
    if kind == 'real':
        return to_float32(float(value)) if bits == 32 else float(value)
    return bool(value)


def to_csv(subject: ProofSubject, example: Counterexample) -> str:
    """Return the trace in the format of `simulate`; without inputs, with an unused column."""
    signals = subject.program.signals
    if not signals:
        return 'nothing\n' + '0\n' * len(example.rows)
    return trace_text(signals, ([numbers.input_value(value, signal.type) for value, signal
                                 in zip(row, signals, strict=True)] for row in example.rows))
