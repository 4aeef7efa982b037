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

"""Runs in the compiled monitor."""

from array import array
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any

from fret_monitor.build import compile_monitor, generate_monitor, Reading
from fret_monitor.logic.specification import Signal
from fret_monitor.native.monitor import Monitor
from fret_monitor.runtime.evaluator import Evaluator
from fret_monitor.smt import numbers
from fret_monitor.smt import terms as t
from fret_monitor.smt.terms import Term
from fret_monitor.traces.simulate import for_trace
from fret_monitor.traces.trace import Row

Replay = Callable[[Sequence[Row], int], list[list[bool]]]
"""Takes the rows of a run and the nanoseconds between them; returns verdicts in their order."""


class CompiledReplay:
    """Runs in a compiled bundle, which is compiled when the first run comes."""

    def __init__(self, reading: Reading) -> None:
        """Store the bundle."""
        self._reading = reading

    @cached_property
    def _monitor(self) -> Monitor:
        return for_trace(compile_monitor(generate_monitor(self._reading)).monitor)

    def __call__(self, rows: Sequence[Row], spacing: int) -> list[list[bool]]:
        """
        Return the verdicts at each step, in the bundle's order.

        Under `timed` they are those at the rows, and at the instants between them at which one
        changes.
        """
        evaluator = Evaluator(self._monitor)
        manifest = self._monitor.manifest
        columns = [array(item.value_type.typecode, column)
                   for item, column in zip(manifest.inputs, zip(*rows, strict=True))]
        times = array('q', range(0, len(rows) * spacing, spacing))
        width = len(manifest.requirements)
        found = []
        for instants, verdicts in evaluator.rows(columns, times):
            found += [[bool(value) for value in verdicts[place * width:(place + 1) * width]]
                      for place in range(len(instants))]
        return found


def rows_of(rows: Sequence[Mapping[Term, Any]], signals: Sequence[Signal]) -> tuple[Row, ...]:
    """Return the values of all inputs of a bundle at each step, 0 for those that have none."""
    inputs = [t.variable(item.name, numbers.sort_of(item.type)) for item in signals]
    return tuple(row_of(values, signals, inputs) for values in rows)


def row_of(values: Mapping[Term, Any], signals: Sequence[Signal],
           inputs: Sequence[Term]) -> Row:
    """Return the values of all inputs of a bundle, 0 for those that have none."""
    return tuple(numbers.input_value(values.get(item, 0), signal.type)
                 for item, signal in zip(inputs, signals, strict=True))
