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

"""What a node under test is fed, and what the compiled monitor says of it."""

from array import array
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fret_monitor.build import compile_monitor, generate_monitor, read
from fret_monitor.logic.propositions import bounds, propositions
from fret_monitor.logic.specification import Signal, Specification
from fret_monitor.model.diagnostics import Text
from fret_monitor.model.policies import InputRole, Policy
from fret_monitor.model.times import NANOSECONDS
from fret_monitor.native.cache import evaluator_library
from fret_monitor.native.monitor import Monitor
from fret_monitor.runtime.evaluator import Evaluator
from fret_monitor.traces.alphabet import values_of
from fret_monitor.traces.csv_trace import seconds_text
from fret_monitor.traces.simulate import for_trace
from fret_monitor.traces.trace import Value

_USUAL_STAYS = (1, 2, 3)


@dataclass(frozen=True)
class InputTrace:
    """
    Values of inputs, by name, from each of some times on; a string is as its message has it.

    `times` are in nanoseconds from 0; except under `timed`, they are the numbers of the steps. The
    trace goes on until `end`.
    """

    times: tuple[int, ...]
    rows: tuple[Mapping[str, Any], ...]
    end: int
    is_timed: bool = False

    def __str__(self) -> str:
        """Return a table."""
        names = list(self.rows[0])
        labels = [seconds_text(time) if self.is_timed else str(time) for time in self.times]
        table = [['time' if self.is_timed else 'step', *names], *(
            [label, *(str(row[name]) for name in names)]
            for label, row in zip(labels, self.rows, strict=True))]
        widths = [max(map(len, column)) for column in zip(*table, strict=True)]
        lines = ['  '.join(cell.rjust(width) for cell, width in zip(line, widths, strict=True))
                 for line in table]
        return '\n'.join([*lines, *([f'until {seconds_text(self.end)}'] if self.is_timed else ())])


@dataclass(frozen=True)
class Tested:
    """
    A bundle for tests of a node: `fed` are the inputs that the node does not set.

    `pools` has values of each of `fed` to try, the simplest first; `stays` how long they should
    stay, in steps, or nanoseconds under `timed`. `library` is that of the evaluator.
    """

    specification: Specification
    monitor: Monitor
    fed: tuple[Signal, ...]
    pools: tuple[tuple[Any, ...], ...]
    stays: tuple[int, ...]
    library: Path

    @property
    def is_timed(self) -> bool:
        """Whether times are nanoseconds."""
        return self.specification.policy is Policy.TIMED

    def row(self, values: Mapping[str, Any]) -> list[Value]:
        """
        Return the values of all inputs, in the bundle's order, as rows have them.

        Raises
        ------
        ValueError
            if one is missing, or is no value of its input.
        """
        return [_stored(signal, values) for signal in self.specification.signals]

    def violated(self, trace: InputTrace) -> dict[str, int]:
        """Return the requirements that a trace of all inputs violates, each with a first time."""
        rows = [self.row(row) for row in trace.rows]
        inputs = self.monitor.manifest.inputs
        columns = [array(item.value_type.typecode, column)
                   for item, column in zip(inputs, zip(*rows, strict=True), strict=True)]
        ids = [item.id for item in self.monitor.manifest.requirements]
        found: dict[str, int] = {}
        for instants, verdicts in Evaluator(for_trace(self.monitor), library=self.library).rows(
                columns, array('q', trace.times), trace.end):
            for place, name in enumerate(ids):
                own = verdicts[place::len(ids)]
                if name not in found and 0 in own:
                    found[name] = instants[own.index(0)]
        return found


def tested(bundle: Path, constants: Mapping[str, Text], longest: int) -> Tested:
    """
    Read and compile a bundle; values stay for at most `longest` steps.

    Raises
    ------
    CompileError
        with all problems of the bundle.
    NativeError
        if there is no C compiler, or it fails.
    """
    reading = read(bundle, constants=constants)
    specification = reading.specification
    fed = tuple(signal for signal in specification.signals if signal.role is InputRole.INPUT)
    nodes = [node for item in specification.properties for node in propositions(item)]
    pools = [tuple(_shown(signal, value) for value in values_of(signal, nodes)[0]
                   if value == value) for signal in fed]
    ends = {end + offset for item in specification.properties for end in bounds(item)
            for offset in (-1, 0, 1)}
    is_timed = specification.policy is Policy.TIMED
    stays = {*ends, NANOSECONDS['ms'], NANOSECONDS['s']} if is_timed else {
        stay for stay in {*_USUAL_STAYS, *ends} if stay <= longest}
    return Tested(specification, compile_monitor(generate_monitor(reading)).monitor, fed,
                  tuple(pools), tuple(sorted(stay for stay in stays if stay > 0)),
                  evaluator_library())


def _shown(signal: Signal, value: Value) -> Any:
    """Return a value as its message has it."""
    return signal.values[int(value)][1] if signal.is_string else value


def _stored(signal: Signal, values: Mapping[str, Any]) -> Value:
    if signal.name not in values:
        raise ValueError(f"the node has no value of '{signal.name}'")
    value = values[signal.name]
    if signal.is_string:
        strings = [string for _, string in signal.values]
        if value not in strings:
            raise ValueError(f"'{value}' is no value of '{signal.name}'")
        return strings.index(value)
    return float(value) if signal.type.is_float else int(value)
