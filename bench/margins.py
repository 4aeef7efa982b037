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
Measure steps with margins beside the same steps without, and beside other monitors.

The same loop in C (`benchmark.c`) steps both on the same rows, in interleaved rounds: random
values of the inputs, and random walks. Times are of the processor, the median of the rounds; a
ratio is the median of the rounds'. Under `timed` messages are 10 ms apart, and each deadline
between two is evaluated. If reelay, rtamt and mstlo (PyPI: mstlo-python) are installed, they
answer the same questions with their margins (robustness) through their Python bindings, the only
interface of their wheels; ours are called from Python, too (`margin_step`). All loops do nothing
but the calls.

    python -m bench.margins
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from importlib import import_module
from importlib.util import find_spec
import math
from pathlib import Path
from random import Random
from statistics import median
import tempfile
import time
from typing import Any

from bench.run import ROUNDS
from fret_monitor.build import compile_monitor, generate_monitor, GeneratedMonitor, read
from fret_monitor.native.binding import ffi
from fret_monitor.native.monitor import Monitor
from fret_monitor.runtime import margin_step
from fret_monitor.traces.benchmark import Inputs, StepTimer

FORMULAS = ('H (x > 3 -> y < 8)', 'H[0,1000 TICKS] x > 0',
            'H[0,1000 TICKS] (x > 3 -> O[0,100 TICKS] y < 0)', '(x > -2) S (y > 8)',
            'H (H[0,10 TICKS] (x > 5 & y > 3) -> O[0,10 TICKS] x <= 5)')
BUNDLE = """format: 1
evaluation: {policy: POLICY}
inputs: {x: {type: float64, max_rate: 200}, y: {type: float64, max_rate: 200}}
requirements: [{id: R, ptltl: "FORMULA"}]
"""
POLICIES = {'every_message': '', 'timed': '0 ms'}
ROWS = 10_000
LONGEST_S = 5.0  # to fill the windows
FULL_STEPS = 1_200
PEER_STEPS, ROUND_S = 10_000, 0.1  # of a round, at most


def main() -> int:
    """Print the tables."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        print('| formula | policy | inputs | without | with margins | ratio | state, without |'
              ' with |')
        print('|---|---|---|---:|---:|---:|---:|---:|')
        for policy in POLICIES:
            for formula in FORMULAS:
                for row in ratios(folder, policy, formula):
                    print(row, flush=True)
        print()
        print('peers:', ', '.join(name for name in PEERS if find_spec(name)) or
              'none found; pip install reelay rtamt mstlo-python')
        print('| formula | ours, in C | ours, from Python | peer | from Python |'
              ' peer / ours in C | peer / ours from Python |')
        print('|---|---:|---:|---|---:|---:|---:|')
        for number, formula in enumerate(ASKED):
            for row in beside_peers(folder, number, formula):
                print(row, flush=True)
    return 0


def compiled(folder: Path, policy: str, formula: str, *,
             has_margins: bool) -> tuple[GeneratedMonitor, Monitor]:
    """Compile a bundle of one requirement."""
    path = folder / 'bundle.yaml'
    path.write_text(BUNDLE.replace('POLICY', policy).replace(
        'FORMULA', formula.replace(' TICKS', POLICIES[policy])), encoding='utf-8')
    reading = read(path)
    generated = generate_monitor(replace(reading, specification=replace(
        reading.specification, has_margins=has_margins)))
    return generated, compile_monitor(generated).monitor


def values(kind: str, seed: int) -> list[float]:
    """Return numbers from -5 to 15: random ones, or a walk."""
    rng, found = Random(seed), [5.0]
    while len(found) < ROWS:
        found.append(rng.uniform(-5, 15) if kind == 'random' else
                     min(15.0, max(-5.0, found[-1] + rng.gauss(0, 0.5))))
    return found


def inputs_of(kind: str) -> Inputs:
    """Return rows of x and y."""
    pairs = zip(values(kind, 1), values(kind, 2))
    return Inputs(ffi.new('double[]', [number for pair in pairs for number in pair]), 16, ROWS)


def ratios(folder: Path, policy: str, formula: str) -> Iterator[str]:
    """Yield a row for each kind of inputs."""
    (_, plain), (_, closest) = (compiled(folder, policy, formula, has_margins=has_margins)
                                for has_margins in (False, True))
    for kind in ('random', 'walk'):
        rows = inputs_of(kind)
        timers = [StepTimer(monitor, rows) for monitor in (plain, closest)]
        rounds = [[processor_time(timer, rows) for timer in timers] for _ in range(ROUNDS)]
        without, with_margins = (median(each) for each in zip(*rounds))
        ratio = median(after / before for before, after in rounds)
        shown = formula.replace(' TICKS', POLICIES[policy])
        yield (f'| `{shown}` | {policy} | {kind} | {without:.1f} ns | '
               f'{with_margins:.1f} ns | {ratio:.1f} | {plain.state_bytes:,} | '
               f'{closest.state_bytes:,} |')


def processor_time(timer: StepTimer, rows: Inputs) -> float:
    """Return the processor time of a step (ns), in one round."""
    begin = time.process_time_ns()
    timer.round()
    return (time.process_time_ns() - begin) / (timer.repeats * rows.count)


# -- peers ----------------------------------------------------------------------------------------

@dataclass(frozen=True)
class Peer:
    """How a monitor is called for a row `step, x, y`: an expression, and what is in its names."""

    call: str
    names: Mapping[str, object]


ASKED = ('H[0,1000] x > 0', 'H[0,1000] (x > 3 -> O[0,100] y > 8)', '(x > -2) S[0,1000] (y > 8)')
"""Of the present and the past; mstlo answers the mirrored question about the future, later."""


def reelay(number: int) -> Peer:
    """Return how reelay is called."""
    pattern = ('historically[0:1000]{x > 0.0}',
               'historically[0:1000](not {x > 3.0} or once[0:100]{y > 8.0})',
               '{x > -2.0} since[0:1000] {y > 8.0}')[number]
    monitor = import_module('reelay').discrete_timed_monitor(
        pattern=pattern, semantics='robustness', condense=False)
    return Peer('update({"x": x})' if number == 0 else 'update({"x": x, "y": y})',
                {'update': monitor.update})


def rtamt(number: int) -> Peer:
    """Return how rtamt is called."""
    specification = import_module('rtamt').StlDiscreteTimeSpecification()
    for name in ('x', 'y'):
        specification.declare_var(name, 'float')
    specification.spec = ('historically[0:1000](x > 0)',
                          'historically[0:1000]((x > 3) -> once[0:100](y > 8))',
                          '(x > -2) since[0:1000] (y > 8)')[number]
    specification.parse()
    return Peer('update(step, [("x", x), ("y", y)])', {'update': specification.update})


def mstlo(number: int) -> Peer:
    """Return how mstlo is called, for the same formula about the future."""
    tool = import_module('mstlo_python')
    monitor = tool.Monitor(tool.parse_formula((
        'G[0, 1000](x > 0)', 'G[0, 1000]((x > 3) -> F[0, 100](y > 8))',
        '(x > -2) U[0, 1000] (y > 8)')[number]),
        semantics='DelayedQuantitative', algorithm='Incremental')
    first = 'update("x", x, float(step))'
    return Peer(first if number == 0 else f'{first}; update("y", y, float(step))',
                {'update': monitor.update})


PEERS: dict[str, Callable[[int], Peer]] = {
    'reelay': reelay, 'rtamt': rtamt, 'mstlo_python': mstlo}


def beside_peers(folder: Path, number: int, formula: str) -> Iterator[str]:
    """Yield a row for each peer, or one without."""
    _, monitor = compiled(folder, 'every_message', formula, has_margins=True)
    rows = inputs_of('random')
    timer = StepTimer(monitor, rows)
    found = [name for name in PEERS if find_spec(name) is not None]
    calls = {name: Calls(PEERS[name](number)) for name in found}
    ours = Calls(Peer('take(x, y)', {'take': margin_step(monitor, 'R')}))
    rounds = [(processor_time(timer, rows), ours.round(), *(calls[name].round() for name in found))
              for _ in range(ROUNDS)]
    in_c, from_python, *others = (median(column) for column in zip(*rounds))
    for place, (name, peer) in enumerate(zip(found or ['-'], others or [math.nan]), start=2):
        ratios = [median(each[place] / each[mine] for each in rounds) if found else math.nan
                  for mine in (0, 1)]
        yield (f'| `{formula}` | {in_c:.1f} ns | {from_python:,.0f} ns | '
               f'{name.removesuffix("_python")} | {peer:,.0f} ns | '
               f'{ratios[0]:,.0f} | {ratios[1]:,.1f} |')


class Calls:
    """Times calls from Python, in a loop that does nothing else."""

    def __init__(self, peer: Peer) -> None:
        """Fill the windows."""
        self._pairs = [*zip(values('random', 1), values('random', 2))]
        self._step = 0
        names = dict(peer.names)
        exec(f'def loop(step, pairs):\n for x, y in pairs:\n  {peer.call}\n  step += 1', names)
        self._loop: Any = names['loop']
        self._take(FULL_STEPS, LONGEST_S)
        self._size = max(1, min(PEER_STEPS, round(ROUND_S * 1e9 / self._take(100, 0.1))))

    def _take(self, most: int, longest: float) -> float:
        """Take steps, and return the processor time of one (ns)."""
        begin, done = time.process_time_ns(), 0
        while done < most and time.process_time_ns() - begin < longest * 1e9:
            pairs = self._pairs[:min(most - done, 100 if done else 1)]
            self._loop(self._step, pairs)
            self._step += len(pairs)
            done += len(pairs)
        return (time.process_time_ns() - begin) / done

    def round(self) -> float:
        """Return the processor time of a step (ns)."""
        pairs = self._pairs[:self._size]
        begin = time.process_time_ns()
        self._loop(self._step, pairs)
        self._step += len(pairs)
        return (time.process_time_ns() - begin) / len(pairs)


if __name__ == '__main__':
    main()
