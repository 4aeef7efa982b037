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
Shrink a trace while a judge still accepts it.

Fewer steps count most, then fewer changes of inputs, then simpler values.
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import islice, pairwise

from fret_monitor.traces.random_traces import Pools
from fret_monitor.traces.trace import joined, length, Run, Trace, Value

_BATCH = 48
_RUN_STEPS = 40  # steps in C that take as long as Python takes to change a run

# Returns for each trace whether it is accepted: whether it still shows what it should.
Judge = Callable[[Sequence[Trace]], Sequence[bool]]


class Shrinker:
    """Shrinks traces; deterministic for given values and a given trace."""

    def __init__(self, pools: Pools, work_steps: int) -> None:
        """Store the values of each input, the simplest first, and the limit on steps to try."""
        self._ranks = [{_key(value): (rank, value) for rank, value in enumerate(values)}
                       for values in pools]
        self._work_steps = work_steps

    def shrink(self, trace: Trace, judge: Judge) -> Trace:
        """Return the simplest trace found that `judge` accepts; it must accept `trace`."""
        left = self._work_steps
        trace = joined(trace)
        while left > 0:
            better, work = self._better(trace, judge, left)
            if better is None:
                break
            trace, left = better, left - work
        return trace

    def _better(self, trace: Trace, judge: Judge, left: int) -> tuple[Trace | None, int]:
        """Return the first simpler trace that is accepted, and the steps used."""
        cost = self._cost(trace)
        candidates = (candidate for each in self._simpler(trace)
                      if self._cost(candidate := joined(each)) < cost)
        size = max(1, min(_BATCH, self._work_steps // 50 // length(trace)))
        work = 0
        while work < left and (batch := list(islice(candidates, size))):
            work += sum(_RUN_STEPS * len(each) + length(each) for each in batch)
            for candidate, is_accepted in zip(batch, judge(batch), strict=True):
                if is_accepted:
                    return candidate, work
        return None, work

    def _simpler(self, trace: Trace) -> Iterator[Trace]:
        """Yield variants of a trace: shorter ones first, then those with fewer changes."""
        size = len(trace) // 2
        while size > 0:
            for start in range(0, len(trace), size):
                yield (*trace[:start], *trace[start + size:])
            size //= 2
        for place, ranks in enumerate(self._ranks):
            for _, value in ranks.values():
                yield tuple(_with(run, place, value) for run in trace)
        for number, run in enumerate(trace):
            for steps in dict.fromkeys((1, run.steps // 2, run.steps - 1)):
                if 0 < steps < run.steps:
                    yield (*trace[:number], Run(run.row, steps), *trace[number + 1:])
        for number in range(len(trace)):
            yield from _calmer(trace, number)

    def _cost(self, trace: Trace) -> tuple[int, int, int]:
        """Return the numbers of steps and of changes, and the distance from simplest values."""
        changes = sum(_key(a) != _key(b) for one, two in pairwise(trace)
                      for a, b in zip(one.row, two.row, strict=True))
        ranks = sum(rank[_key(value)][0] for run in trace
                    for rank, value in zip(self._ranks, run.row, strict=True))
        return length(trace), changes, ranks


def _key(value: Value) -> Value | str:
    return 'nan' if value != value else value


def _with(run: Run, place: int, value: Value) -> Run:
    """Return a run with the value of one input replaced."""
    return Run((*run.row[:place], value, *run.row[place + 1:]), run.steps)


def _calmer(trace: Trace, number: int) -> Iterator[Trace]:
    """Yield traces in which a run takes one or all values of a neighbouring run."""
    run = trace[number]
    for neighbour in trace[max(number - 1, 0):number] + trace[number + 1:number + 2]:
        yield (*trace[:number], Run(neighbour.row, run.steps), *trace[number + 1:])
        for place, value in enumerate(neighbour.row):
            yield (*trace[:number], _with(run, place, value), *trace[number + 1:])
