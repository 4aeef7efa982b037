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
Measure how long a step of a compiled bundle takes.

The timed loop is in C (`benchmark.c`); the inputs are generated before it starts.
"""

from array import array
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from random import Random
from statistics import median
import tempfile
import time
from typing import Any

from fret_monitor.build import generate_monitor, read_one_instance
from fret_monitor.model.manifest import ManifestInput
from fret_monitor.model.policies import Policy
from fret_monitor.native.binding import ffi
from fret_monitor.native.cache import build_library, csrc_file, runtime_headers
from fret_monitor.native.compiler import compile_library, find_compiler
from fret_monitor.native.folder import library_file
from fret_monitor.native.monitor import CData, Library, load, Monitor
from fret_monitor.runtime.evaluator import NEVER
from fret_monitor.traces.boundary import both_sides
from fret_monitor.traces.trace import Value

# Too many rows for the branch predictor to learn, few enough for the cache.
_MAX_ROWS = 1 << 17
_MAX_BYTES = 4 << 20
_WORD_BYTES = 8
_LINE_BYTES = 64
_PAGE_BYTES = 4096
_ROUND_NANOSECONDS = 20_000_000
_LASTING_ROWS = 200  # mean number of rows for which an input keeps its value
_SIGNATURE = ('uint64_t (*)(const struct fm_monitor *, void *, const void *, uint64_t, uint64_t, '
              'bool *, int64_t *, int64_t *)')
_SPACING_NS = 10_000_000  # between messages under `timed`

# For each input the values it takes, such as both sides of a threshold.
Values = Sequence[Sequence[Value]]


@dataclass(frozen=True)
class Inputs:
    """An array of `count` inputs structs in memory, `stride` bytes apart."""

    memory: CData
    stride: int
    count: int


def random_inputs(monitor: Monitor, values: Values, seed: int = 0) -> Inputs:
    """Return rows in which every input takes a new random value in every row."""
    rng = Random(seed)
    return _fill(monitor, values, lambda choices, last: rng.choice(choices))


def lasting_inputs(monitor: Monitor, values: Values, seed: int = 0) -> Inputs:
    """Return rows in which inputs keep a random value for 200 rows on average."""
    rng = Random(seed)
    return _fill(monitor, values, lambda choices, last: last
                 if last is not None and rng.randrange(_LASTING_ROWS) else rng.choice(choices))


def _fill(monitor: Monitor, values: Values,
          choose: Callable[[Sequence[Any], Any], Any]) -> Inputs:
    stride = -(-int(monitor.pointer.inputs_bytes) // _WORD_BYTES) * _WORD_BYTES
    count = min(_MAX_ROWS, max(1, _MAX_BYTES // stride))
    rows = bytearray(count * stride)
    for index, (item, choices) in enumerate(zip(monitor.manifest.inputs, values, strict=True)):
        column = _column(item, choices, choose, count)
        cells = column.tobytes()
        offset = int(monitor.pointer.inputs[index].offset)
        for byte in range(column.itemsize):
            rows[offset + byte::stride] = cells[byte::column.itemsize]
    return Inputs(ffi.from_buffer(rows), stride, count)


def _column(item: ManifestInput, choices: Sequence[Value],
            choose: Callable[[Sequence[Any], Any], Any], count: int) -> 'array[Any]':
    column = array(item.value_type.typecode)
    last: Any = None
    for _ in range(count):
        last = choose(choices, last)
        column.append(last)
    return column


class StepTimer:
    """Times the steps of a monitor on given inputs; the state is kept between rounds."""

    def __init__(self, monitor: Monitor, inputs: Inputs) -> None:
        """Reset the state, and choose the number of passes that take about 20 ms."""
        text = csrc_file('benchmark.c').read_text(encoding='utf-8')
        library = build_library({'benchmark.c': text}, name='fm_benchmark')
        self._library = Library(library)
        self._time: Any = ffi.cast(_SIGNATURE, self._library.find('fm_benchmark'))
        self._monitor = monitor
        self._inputs = inputs
        # A step takes up to a third longer if state and verdicts share cache lines or the lower
        # bits of their addresses. So the state starts at a page boundary, and the verdicts at the
        # next cache line after it.
        after = (monitor.state_bytes // _LINE_BYTES + 1) * _LINE_BYTES
        self._memory = ffi.new(
            'char[]', _PAGE_BYTES + after + monitor.pointer.n_requirements
            + monitor.pointer.n_more_verdicts + 1)
        start = -(-int(ffi.cast('uintptr_t', self._memory)) // _PAGE_BYTES) * _PAGE_BYTES
        self._state: Any = ffi.cast('void *', start)
        self._verdicts: Any = ffi.cast('bool *', start + after)
        count = monitor.pointer.n_groups
        for group in range(count):
            monitor.pointer.groups[group].reset(self._state)
        is_timed = monitor.manifest.policy is Policy.TIMED
        self._clock = ffi.new('int64_t[3]', [-_SPACING_NS, _SPACING_NS, 0])
        self._due = ffi.new('int64_t[]', [NEVER] * count) if is_timed else ffi.NULL
        self.repeats = max(1, round(_ROUND_NANOSECONDS / max(1, self._pass())))

    def _pass(self) -> int:
        return int(self._time(self._monitor.pointer, self._state, self._inputs.memory,
                              self._inputs.stride, self._inputs.count, self._verdicts,
                              self._clock, self._due))

    @property
    def evaluations(self) -> float:
        """How often a group was evaluated for each message, deadlines included."""
        if self._due == ffi.NULL:
            return 1.0
        messages = (self._clock[0] + _SPACING_NS) / _SPACING_NS
        return float(self._clock[2] / messages / self._monitor.pointer.n_groups)

    def round(self) -> float:
        """Run one round and return the nanoseconds per step."""
        total = sum(self._pass() for _ in range(self.repeats))
        return total / (self.repeats * self._inputs.count)


def step_nanoseconds(monitor: Monitor, inputs: Inputs, rounds: int = 9) -> float:
    """Return the median of the nanoseconds per step over some rounds."""
    return timed_steps(monitor, inputs, rounds)[0]


def timed_steps(monitor: Monitor, inputs: Inputs, rounds: int = 9) -> tuple[float, float]:
    """Return the same, and how often a group was evaluated for each message under `timed`."""
    timer = StepTimer(monitor, inputs)
    return median(timer.round() for _ in range(rounds)), timer.evaluations


@dataclass(frozen=True)
class Measurement:
    """
    The cost of a bundle: median nanoseconds, sizes in bytes, and seconds to build it.

    Under `timed` a step is a message, 10 ms after the one before, with all deadlines in between;
    `evaluations` are those of a group for each message, on random inputs. Otherwise None.
    """

    requirements: int
    ns_per_step: float
    ns_per_step_lasting: float
    state_bytes: int
    compile_seconds: float
    evaluations: float | None = None

    def as_dict(self) -> dict[str, int | float | None]:
        """Return the figures by name; `ns_per_step` is that for random inputs."""
        return asdict(self)


def measure(path: Path) -> Measurement:
    """
    Build a bundle without the cache, and time its steps on random and on slowly changing inputs.

    Errors are those of `build`.
    """
    with tempfile.TemporaryDirectory(prefix='fret_monitor-') as folder:
        before = time.perf_counter()
        generated = generate_monitor(read_one_instance(path))
        header, text = generated.module.header
        files = {**runtime_headers(), header: text, **dict(generated.module.sources)}
        for name, content in files.items():
            (Path(folder) / name).write_text(content, encoding='utf-8')
        file = library_file(generated.manifest)
        compile_library(find_compiler(), [name for name, _ in generated.module.sources], file,
                        folder=Path(folder))
        seconds = time.perf_counter() - before
        monitor = load(Path(folder) / file, generated.manifest)
    values = both_sides(generated.program)
    of_step, evaluations = timed_steps(monitor, random_inputs(monitor, values))
    return Measurement(
        len(generated.manifest.requirements),
        of_step,
        step_nanoseconds(monitor, lasting_inputs(monitor, values)),
        generated.manifest.state_bytes,
        seconds,
        evaluations if generated.manifest.policy is Policy.TIMED else None,
    )
