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

"""Compile specifications under the policy `timed` and run them over timed traces (`run_at.c`)."""

from collections.abc import Sequence
import ctypes
from dataclasses import dataclass
from itertools import pairwise

from differential.compiled import c_columns, driver, FLAGS, load
from fret_monitor.logic.specification import Specification
from fret_monitor.logic.timed import History, TimedTrace


class _Rows(ctypes.Structure):
    _fields_ = (('columns', ctypes.c_void_p), ('ticks', ctypes.c_void_p),
                ('n_rows', ctypes.c_uint64), ('end', ctypes.c_int64),
                ('only_changes', ctypes.c_bool))


class _Evaluations(ctypes.Structure):
    _fields_ = (('capacity', ctypes.c_uint64), ('count', ctypes.c_uint64),
                ('ticks', ctypes.c_void_p), ('verdicts', ctypes.c_void_p))


@dataclass(frozen=True)
class TimedRun:
    """
    What a run has computed, for each requirement.

    Its verdict over time, the value whose falls are its occurrences, and the number of
    evaluations of its group.
    """

    verdicts: list[History]
    occurrences: list[History]
    evaluations: list[int]


class TimedMonitor:
    """A specification under `timed`, compiled and loaded."""

    def __init__(self, specification: Specification, flags: Sequence[str] = FLAGS) -> None:
        """Compile into a temporary folder and load it."""
        self._signals = specification.signals
        self._library = driver('run_at.c')
        self._monitor = load(specification, flags=flags)
        self._numbers = range(len(specification.properties))
        self._groups = [self._call('group', number) for number in self._numbers]
        self._occurrences = [self._call('occurrence', number) for number in self._numbers]

    def run(self, trace: TimedTrace, *, only_changes: bool = False,
            most: int = 20_000) -> TimedRun:
        """
        Step each group at the rows of a trace and at the deadlines that it returns.

        With `only_changes`, rows that change no input of a group are passed over, as the engine
        does with messages that feed none. `most` is the greatest number of evaluations of a group.
        """
        columns = c_columns(self._signals, trace.columns, len(trace.ticks))
        pointers = (ctypes.c_void_p * len(columns))(*map(ctypes.addressof, columns))
        ticks = (ctypes.c_int64 * len(trace.ticks))(*trace.ticks)
        rows = _Rows(ctypes.addressof(pointers), ctypes.addressof(ticks), len(ticks), trace.end,
                     only_changes)
        found = {group: self._run_group(group, rows, most) for group in set(self._groups)}
        pairs = list(zip(self._groups, self._occurrences, strict=True))
        return TimedRun(
            [_history(*found[self._groups[number]], number) for number in self._numbers],
            [_history(*found[group], index) for group, index in pairs],
            [len(found[group][0]) for group in self._groups])

    def _run_group(self, group: int, rows: _Rows, most: int) -> tuple[list[int], list[list[bool]]]:
        width = self._call('width')
        ticks = (ctypes.c_int64 * most)()
        verdicts = (ctypes.c_bool * (most * width))()
        found = _Evaluations(most, 0, ctypes.addressof(ticks), ctypes.addressof(verdicts))
        run = self._library.differential_run_at
        run.argtypes = (ctypes.c_void_p, ctypes.c_uint32, ctypes.c_void_p, ctypes.c_void_p)
        wrong = run(self._monitor, group, ctypes.byref(rows), ctypes.byref(found))
        assert wrong == 0, ('', 'no memory', 'a deadline is not later than its step')[wrong]
        assert found.count <= most, f'more than {most} evaluations of group {group}'
        return (ticks[:found.count],
                [verdicts[row * width:(row + 1) * width] for row in range(found.count)])

    def _call(self, name: str, *arguments: int) -> int:
        function = self._library[f'differential_{name}']
        function.argtypes = (ctypes.c_void_p, *(ctypes.c_uint32 for _ in arguments))
        function.restype = ctypes.c_uint32
        result: int = function(self._monitor, *arguments)
        return result


def _history(ticks: Sequence[int], verdicts: Sequence[Sequence[bool]], index: int) -> History:
    """Return one verdict of a group over time: it holds until the next evaluation."""
    pieces: History = [(tick, row[index]) for tick, row in zip(ticks, verdicts, strict=True)]
    return pieces[:1] + [piece for before, piece in pairwise(pieces) if piece[1] != before[1]]
