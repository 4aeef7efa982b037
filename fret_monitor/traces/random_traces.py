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
Random traces whose values stay constant for about as many steps as the bounds of a formula.

With independent values at each step, a condition would rarely stay true for the length of a bound.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from random import Random

from fret_monitor.traces.trace import Run, Trace, Value

_PEAK = 0.9  # probability of the favoured value
_STAY = 0.6  # probability that a row stays for the length of a bound
_CHANGE_ALL = 0.3  # probability that all inputs may change, not one alone

# For each input the values it may take, the simplest first.
Pools = Sequence[Sequence[Value]]


def random_traces(pools: Pools, bounds: Iterable[int], reach: int, rng: Random,
                  longest: int = 200_000) -> Iterator[Trace]:
    """
    Yield an infinite sequence of traces, about half of them short.

    Parameters
    ----------
    pools
        the possible values of each input.
    bounds
        numbers of steps for which values should stay constant, each varied by one.
    reach
        how many steps back the formula depends on the trace.
    rng
        source of randomness; the same state gives the same traces.
    longest
        number of steps after which a trace gets no further run.
    """
    near = {end + offset for end in bounds for offset in (-1, 0, 1)}
    stays = sorted(steps for steps in {1, 2, 3, *near} if 0 < steps <= longest)
    reach = min(reach, longest)
    while True:
        target = rng.choice((4, 8, reach + 4, 2 * reach + 8))
        yield _random_trace(pools, stays, min(target, longest), rng)


def _random_trace(pools: Pools, stays: Sequence[int], target: int, rng: Random) -> Trace:
    choose = _chooser(rng)
    row = [choose(values) for values in pools]
    runs: list[Run] = []
    steps = 0
    while steps < target:
        runs.append(Run(tuple(row), rng.choice(stays) if rng.random() < _STAY else 1))
        steps += runs[-1].steps
        for number in range(len(pools)) if rng.random() < _CHANGE_ALL else _any_one(pools, rng):
            row[number] = choose(pools[number])
    return tuple(runs)


def _chooser(rng: Random) -> Callable[[Sequence[Value]], Value]:
    """
    Return a function that chooses a value: uniformly, or mostly the first, or mostly the last.

    With uniform choices, a conjunction of many inputs (`a & b & c & ...`) would rarely be true.
    """
    favoured = rng.choice((None, 0, -1))
    if favoured is None:
        return rng.choice
    return lambda values: values[favoured] if rng.random() < _PEAK else rng.choice(values)


def _any_one(pools: Pools, rng: Random) -> list[int]:
    return [rng.randrange(len(pools))] if pools else []
