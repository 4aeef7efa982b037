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

"""The timed loop runs as many steps as it counts, on the values that it is given."""

from array import array
from fractions import Fraction
from itertools import pairwise
import json
from pathlib import Path

from fret_monitor.build import build, generate_monitor, read
from fret_monitor.model.manifest import ManifestInput
from fret_monitor.model.values import ValueType
from fret_monitor.native.binding import ffi
from fret_monitor.native.monitor import Monitor
from fret_monitor.traces import benchmark
from fret_monitor.traces.benchmark import (
    Inputs, lasting_inputs, measure, random_inputs, step_nanoseconds, StepTimer,
)
from fret_monitor.traces.boundary import both_sides
from fret_monitor.traces.trace import Value
import pytest

BUNDLE = """\
format: 1
inputs:
  p: {type: bool}
  b: {type: uint8}
  n: {type: int16}
  x: {type: float32}
  d: {type: float64}
  word: {type: string, values: {stopped: halt, moving: go, lost: lost}}
requirements:
  - {id: R-1, ptltl: "O[0,9] (p & b > 250)"}
  - {id: R-2, ptltl: "x > 15.5 | d < -3.0 & n < 40000"}
  - {id: R-3, ptltl: "word = moving"}
"""


@pytest.fixture(autouse=True)
def few_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fill fewer rows than the benchmark does: their number changes no result of these tests."""
    monkeypatch.setattr(benchmark, '_MAX_ROWS', 1 << 13)


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    """Return a bundle with inputs of several types."""
    path = tmp_path / 'timed.yaml'
    path.write_text(BUNDLE)
    return path


def values_of(path: Path) -> list[list[Value]]:
    """Return the values that the inputs of a bundle take in a benchmark."""
    return both_sides(generate_monitor(read(path)).program)


def column(monitor: Monitor, inputs: Inputs, index: int) -> 'array[float]':
    """Return the values of an input in all rows."""
    item = monitor.manifest.inputs[index]
    found: array[float] = array(item.value_type.typecode)
    offset, size = monitor.pointer.inputs[index].offset, found.itemsize
    memory = bytes(ffi.buffer(inputs.memory))
    for row in range(inputs.count):
        start = row * inputs.stride + offset
        found.frombytes(memory[start:start + size])
    return found


def test_boundary_values_lie_on_both_sides_of_each_constant(bundle: Path) -> None:
    p, b, n, x, d, word = values_of(bundle)
    assert p == [False, True]
    assert {249, 251} <= set(b) and all(0 <= value <= 255 for value in b)
    assert {14.5, 16.5, -4.0, -2.0} <= set(x) & set(d)
    assert max(n) == 2 ** 15 - 1 and all(isinstance(value, int) for value in n)
    assert word == [0, 1, 2]


def test_every_row_has_values_among_the_boundary_values(bundle: Path) -> None:
    generated = generate_monitor(read(bundle))
    monitor, values = build(bundle).monitor, both_sides(generated.program)
    for make in (random_inputs, lasting_inputs):
        inputs = make(monitor, values)
        assert inputs.count >= 1000
        assert inputs.stride % 8 == 0 and inputs.stride >= monitor.pointer.inputs_bytes
        for index, allowed in enumerate(values):
            assert set(column(monitor, inputs, index)) == set(allowed)


def test_random_values_change_often_and_lasting_ones_seldom(bundle: Path) -> None:
    monitor, values = build(bundle).monitor, values_of(bundle)

    def changes(inputs: Inputs) -> Fraction:
        found = column(monitor, inputs, 0)
        return Fraction(sum(a != b for a, b in pairwise(found)), inputs.count)

    assert Fraction(2, 5) < changes(random_inputs(monitor, values)) < Fraction(3, 5)
    assert Fraction(1, 1000) < changes(lasting_inputs(monitor, values)) < Fraction(1, 200)
    assert bytes(ffi.buffer(random_inputs(monitor, values).memory)) == \
        bytes(ffi.buffer(random_inputs(monitor, values).memory))


def test_a_round_is_at_least_one_pass(bundle: Path) -> None:
    monitor = build(bundle).monitor
    rows = random_inputs(monitor, values_of(bundle))
    timer = StepTimer(monitor, Inputs(rows.memory, rows.stride, 1))
    assert timer.round() > 0
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(benchmark, '_ROUND_NANOSECONDS', 1)
        assert StepTimer(monitor, rows).round() > 0


def test_more_work_takes_more_time(bundle: Path, tmp_path: Path) -> None:
    lines = [f'  - {{id: M-{number}, ptltl: "O[0,{number + 3}] (x > {number}.5) S[0,9] p"}}\n'
             for number in range(150)]
    (tmp_path / 'more.yaml').write_text(BUNDLE + ''.join(lines))
    times = []
    for path in (bundle, tmp_path / 'more.yaml'):
        monitor, values = build(path).monitor, values_of(path)
        times.append(step_nanoseconds(monitor, random_inputs(monitor, values), rounds=3))
    assert times[0] * 3 < times[1] < times[0] * 3000


def test_the_result_is_the_median_of_the_rounds(
        bundle: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monitor, values = build(bundle).monitor, values_of(bundle)
    times = iter([5.0, 100.0, 1.0, 3.0, 4.0])
    monkeypatch.setattr(StepTimer, 'round', lambda timer: next(times))
    assert step_nanoseconds(monitor, random_inputs(monitor, values), rounds=5) == 4.0


def test_an_input_of_each_type_is_filled(tmp_path: Path) -> None:
    kinds = list(ValueType)
    lines = ['format: 1', 'inputs:',
             *(f'  i_{kind.value}: {{type: {kind.value}}}' for kind in kinds),
             'requirements:', '  - {id: R, ptltl: "i_bool"}']
    path = tmp_path / 'typed.yaml'
    path.write_text('\n'.join(lines) + '\n')
    monitor, values = build(path).monitor, values_of(path)
    inputs = random_inputs(monitor, values)
    found: list[ManifestInput] = list(monitor.manifest.inputs)
    assert [item.value_type for item in found] == kinds
    for index in range(len(kinds)):
        assert set(column(monitor, inputs, index)) == set(values[index])


def test_a_measurement_is_plausible(bundle: Path) -> None:
    found = measure(bundle)
    assert json.loads(json.dumps(found.as_dict())) == found.as_dict()
    assert found.requirements == 3 and 0 < found.state_bytes < 40
    assert 0.1 < found.ns_per_step < 1e5
    assert 0.1 < found.ns_per_step_lasting < 1e5
    assert 0.001 < found.compile_seconds < 600
    assert found.evaluations is None


def test_the_messages_of_a_timed_bundle_are_measured(tmp_path: Path) -> None:
    path = tmp_path / 'timed.yaml'
    path.write_text('format: 1\ninputs: {p: {type: bool}}\n'
                    'evaluation: {policy: timed, unit: 0.001}\n'
                    'requirements: [{id: A, ptltl: "O[0,5] p"}]\n')
    found = measure(path)
    # Of four messages in a row 10 ms apart, one ends p; a deadline comes 5 ms after p.
    assert found.evaluations is not None and 1.2 < found.evaluations < 1.3
    assert 0.1 < found.ns_per_step < 1e5
