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
Compare evaluations under `timed` with steps, and with other monitors of dense time.

The same loop in C (`benchmark.c`) drives both on the same rows, in interleaved rounds; under
`timed` messages are 10 ms apart, and each deadline between two is evaluated. A ratio is that of
the time of one evaluation to that of one step, the median of the rounds' ratios. reelay and rtamt
(PyPI), where they are installed, are called from Python, the only interface of their wheels: most
of reelay's time may be Python's.

    python -m bench.timed
"""

from collections.abc import Callable, Iterator
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from statistics import median
import sys
import tempfile
import time
from typing import Any

from bench.run import operator, ROUNDS
from fret_monitor.build import compile_monitor, generate_monitor, GeneratedMonitor, read
from fret_monitor.native.binding import ffi
from fret_monitor.native.monitor import Monitor
from fret_monitor.traces.benchmark import Inputs, lasting_inputs, random_inputs, StepTimer
from fret_monitor.traces.boundary import both_sides

SPACING_S = 0.01  # between messages
BOUNDS = ('10 ms', '1 s', '100 s', '10 h')
FORMULAS = ('H[0,{b}] p', 'O[0,{b}] p', 'p S[0,{b}] q')
PEER_ROWS = 2000
HEAD = """format: 1
inputs: {current: {type: float32}, wind: {type: float32}}
definitions: {overload: current > 15.0 & wind > 8.0}
evaluation: {policy: POLICY}
requirements:
  - id: R
    fretish: if persisted(LONG, overload) sw shall within LONG satisfy current <= 15.0
"""


def main() -> int:
    """Print the tables."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        print('| work | inputs | a step | an evaluation | ratio | evaluations a message | state |')
        print('|---|---|---|---|---|---|---|')
        for row in evaluations(folder):
            print(row, flush=True)
        print()
        print('peers:', ', '.join(name for name in PEERS if find_spec(name)) or
              'none found; pip install reelay rtamt')
        print('| work | peer | ours, a message | peer, a message | peer / ours |')
        print('|---|---|---|---|---|')
        for row in peers(folder):
            print(row, flush=True)
    return 0


def compiled(text: str, folder: Path) -> tuple[GeneratedMonitor, Monitor]:
    """Compile the text of a bundle."""
    path = folder / 'bundle.yaml'
    path.write_text(text, encoding='utf-8')
    generated = generate_monitor(read(path))
    return generated, compile_monitor(generated).monitor


def example(bound: str, policy: str) -> str:
    """Return a bundle of the running example."""
    number, unit = bound.split()
    words = {'ms': 'milliseconds', 's': 'seconds', 'h': 'hours'}
    long = f'{number} {words[unit]}' if policy == 'timed' else str(steps(bound))
    text = HEAD.replace('POLICY', policy)
    if policy == 'timed':
        return text.replace('LONG', long)
    return text.replace('persisted(LONG', f'persisted({long}').replace('LONG', f'{long} ticks')


def steps(bound: str) -> int:
    """Return how many messages come in a time."""
    number, unit = bound.split()
    return max(1, round(float(number) * {'ms': 0.001, 's': 1.0, 'h': 3600.0}[unit] / SPACING_S))


def evaluations(folder: Path) -> Iterator[str]:
    """Yield a row for each work, bound and kind of inputs."""
    for bound in BOUNDS:
        yield from rows('running example', bound, example(bound, 'timed'),
                        example(bound, 'relevant_message'), folder)
    for formula in FORMULAS:
        for bound in BOUNDS:
            stepped = operator(formula.format(b=steps(bound)))
            timed = operator(formula.format(b=bound)) + 'evaluation: {policy: timed}\n'
            yield from rows(f'`{formula.format(b="b")}`', bound, timed, stepped, folder)


def rows(work: str, bound: str, timed: str, stepped: str, folder: Path) -> Iterator[str]:
    """Yield the rows of one bundle under both policies."""
    generated, ours = compiled(timed, folder)
    _, beside = compiled(stepped, folder)
    values = both_sides(generated.program)
    for name, fill in (('random', random_inputs), ('long-lasting', lasting_inputs)):
        inputs = fill(ours, values)
        evaluation, step = StepTimer(ours, inputs), StepTimer(beside, inputs)
        found = [(evaluation.round() / evaluation.evaluations, step.round())
                 for _ in range(ROUNDS)]
        ratio = median(one / other for one, other in found)
        yield (f'| {work}, {bound} | {name} | {median(other for _, other in found):.1f} ns '
               f'| {median(one for one, _ in found):.1f} ns | {ratio:.2f} '
               f'| {evaluation.evaluations:.2f} '
               f'| {ours.state_bytes} B beside {beside.state_bytes} B |')


# -- peers ----------------------------------------------------------------------------------------

_Update = Callable[[float, bool, bool], Any]


def reelay(formula: str, bound: float) -> _Update:
    """Return a function that gives reelay's dense monitor a message."""
    pattern = {'H': 'historically[0:{b}]{{p}}', 'O': 'once[0:{b}]{{p}}',
               'p': '{{p}} since[0:{b}] {{q}}'}[formula[0]].format(b=bound)
    monitor = import_module('reelay').dense_timed_monitor(pattern=pattern, semantics='boolean')
    return lambda now, p, q: monitor.update({'time': now, 'p': p, 'q': q})


def rtamt(formula: str, bound: float) -> _Update:
    """Return a function that gives rtamt's dense monitor a message."""
    specification = import_module('rtamt').StlDenseTimeSpecification()
    for name in ('p', 'q', 'out'):
        specification.declare_var(name, 'float')
    specification.spec = 'out = ' + {
        'H': 'historically[0:{b}](p > 0.5)', 'O': 'once[0:{b}](p > 0.5)',
        'p': '(p > 0.5) since[0:{b}] (q > 0.5)'}[formula[0]].format(b=bound)
    specification.parse()
    last: dict[str, list[tuple[float, float]]] = {'p': [], 'q': []}

    def update(now: float, p: bool, q: bool) -> Any:
        for name, value in (('p', p), ('q', q)):
            last[name] = [*last[name][-1:], (now, float(value))]
        names = ['p'] if formula[0] != 'p' else ['p', 'q']
        return specification.update(*([name, last[name]] for name in names))
    return update


PEERS: dict[str, Callable[[str, float], _Update]] = {'reelay': reelay, 'rtamt': rtamt}


def peers(folder: Path) -> Iterator[str]:
    """Yield a row for each formula and installed peer; messages are 10 ms apart."""
    bound = '1 s'
    for formula in FORMULAS:
        generated, ours = compiled(
            operator(formula.format(b=bound)) + 'evaluation: {policy: timed}\n', folder)
        inputs = lasting_inputs(ours, both_sides(generated.program))
        for name, make in PEERS.items():
            if find_spec(name):
                timer = StepTimer(ours, inputs)
                found = [(timer.round(), peer_time(make(formula, 1.0), ours, inputs))
                         for _ in range(3)]
                ratio = median(theirs / mine for mine, theirs in found)
                yield (f'| `{formula.format(b=bound)}` | {name} '
                       f'| {median(mine for mine, _ in found):.1f} ns '
                       f'| {median(theirs for _, theirs in found) / 1000:.1f} us '
                       f'| {ratio:,.0f} |')


def booleans(monitor: Monitor, inputs: Inputs) -> list[tuple[bool, bool]]:
    """Return p and q of the first rows."""
    block = bytes(ffi.buffer(inputs.memory, PEER_ROWS * inputs.stride))
    places = {item.name: int(monitor.pointer.inputs[index].offset)
              for index, item in enumerate(monitor.manifest.inputs)}
    return [(bool(block[row * inputs.stride + places['p']]),
             bool(block[row * inputs.stride + places['q']])) for row in range(PEER_ROWS)]


def peer_time(update: _Update, monitor: Monitor, inputs: Inputs) -> float:
    """Return the nanoseconds of a message."""
    messages = [(row * SPACING_S, p, q) for row, (p, q)
                in enumerate(booleans(monitor, inputs))]
    before = time.perf_counter_ns()
    for now, p, q in messages:
        update(now, p, q)
    return (time.perf_counter_ns() - before) / len(messages)


if __name__ == '__main__':
    sys.exit(main())
