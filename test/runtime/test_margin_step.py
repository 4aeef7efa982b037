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

"""A function of Python that takes a row and returns a margin, beside rows that C takes at once."""

from array import array
from collections.abc import Callable
from contextlib import redirect_stdout
import gc
from io import StringIO
from pathlib import Path
from random import Random
import re
from typing import Any

from fret_monitor.native import csrc_directory
from fret_monitor.runtime import Evaluator, margin_step, MarginStep
from fret_monitor.start import start
import pytest

BUNDLE = """format: 1
evaluation: {policy: POLICY}
inputs:
  level: {type: float64, max_rate: 100000000}
  part: {type: float32, max_rate: 100000000}
  count: {type: int8, max_rate: 100000000}
  big: {type: uint64, max_rate: 100000000}
  armed: {type: bool, max_rate: 100000000}
requirements:
  - {id: NEAR, ptltl: "H[0,40 ns] (armed -> O[0,9 ns] level < 2)"}
  - {id: SUM, ptltl: "(count < 100) S (part > 3 | big > 5)"}
"""


def evaluator(folder: Path, policy: str) -> Evaluator:
    path = folder / 'bundle.yaml'
    text = BUNDLE if policy == 'timed' else BUNDLE.replace(' ns', '')
    path.write_text(text.replace('POLICY', policy), encoding='utf-8')
    return Evaluator(start(path, margins=True).monitor)


def random_rows(count: int) -> list[tuple[Any, ...]]:
    rng, now, rows = Random(1), 0, []
    for _ in range(count):
        now += rng.randint(1, 9)
        rows.append((now, rng.uniform(-3, 6), rng.choice((0.5, 2.75, 4.0)),
                     rng.randint(-128, 127), rng.choice((0, 7, 2**64 - 1)), rng.random() < 0.5))
    return rows


@pytest.mark.parametrize('policy', ['every_message', 'timed'])
def test_a_step_returns_the_margin_of_its_row(tmp_path: Path, policy: str) -> None:
    rows = random_rows(300)
    whole = evaluator(tmp_path, policy)
    columns: list[array[Any] | None] = [
        array(item.value_type.typecode, [row[place] for row in rows])
        for place, item in enumerate(whole.monitor.manifest.inputs, start=1)]
    expected = {}
    for instants, _, margins in whole.margin_rows(columns, array('q', [row[0] for row in rows])):
        for place, instant in enumerate(instants):
            expected[instant] = [item.value for item in margins[2 * place:2 * place + 2]]
    steps = [margin_step(whole.monitor, name) for name in ('NEAR', 'SUM')]
    for row in rows:
        values = row if policy == 'timed' else row[1:]
        assert [step(*values) for step in steps] == expected[row[0]]


def test_a_step_keeps_alive_what_it_needs_and_is_freed(tmp_path: Path) -> None:
    step: MarginStep = margin_step(evaluator(tmp_path, 'every_message').monitor, 'NEAR')
    gc.collect()
    assert step(1.5, 0.0, 0, 0, True) == 0.5
    del step
    gc.collect()


def test_a_row_that_is_refused_is_not_taken(tmp_path: Path) -> None:
    step = margin_step(evaluator(tmp_path, 'timed').monitor, 'NEAR')
    assert step(1, 1.5, 0.0, 0, 0, True) == 0.5
    for row, error in {
            (2, 1.0, 0.0, 0, 0): TypeError, (): TypeError, (2.5, 1.0, 0.0, 0, 0, True): TypeError,
            (2, 'high', 0.0, 0, 0, True): TypeError, (2, 1.0, 0.0, 1.5, 0, True): TypeError,
            (2, 3.0, 0.0, 128, 0, True): OverflowError,
            (2, 3.0, 0.0, -129, 0, True): OverflowError,
            (2, 3.0, 0.0, 0, -1, True): OverflowError,
            (2, 3.0, 0.0, 0, 2**64, True): OverflowError, (2, 3.0, 0.0, 0, 0, 2): OverflowError,
            (2**63, 3.0, 0.0, 0, 0, True): OverflowError, (1, 3.0, 0.0, 0, 0, True): ValueError,
            (0, 3.0, 0.0, 0, 0, True): ValueError}.items():
        with pytest.raises(error):
            step(*row)
    assert [step(now, 3.0, 0.0, 127, 2**64 - 1, True) for now in (2, 10, 11)] == [0.5, 0.5, -1.0]


def test_a_requirement_without_margins_is_refused(tmp_path: Path) -> None:
    made = evaluator(tmp_path, 'every_message')
    with pytest.raises(ValueError, match="no margins of 'OTHER': the requirements are NEAR, SUM"):
        margin_step(made.monitor, 'OTHER')
    plain = start(tmp_path / 'bundle.yaml').monitor
    with pytest.raises(ValueError, match=r"of 'NEAR': write start\(BUNDLE, margins=True\)"):
        margin_step(plain, 'NEAR')


def test_a_step_needs_no_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = evaluator(tmp_path, 'every_message')
    monkeypatch.setenv('ROS_HOME', '/dev/null/home')
    assert margin_step(made.monitor, 'NEAR')(1.5, 0.0, 0, 0, True) == 0.5


def test_a_time_that_is_too_late_is_refused_as_that(tmp_path: Path) -> None:
    step = margin_step(evaluator(tmp_path, 'timed').monitor, 'NEAR')
    row = (1.5, 0.0, 0, 0, True)
    assert step(-2**63, *row) == 0.5
    for now in (-2**63, -2**63 + 2**62, 2**63 - 1):
        message = 'not after that of the row' if now == -2**63 else 'more than 146 years after'
        with pytest.raises(ValueError, match=message):
            step(now, *row)


class Number:
    """A number that calls a function where it is converted."""

    def __init__(self, value: int, call: Callable[[], object]) -> None:
        """Remember both."""
        self.value, self.call = value, call

    def __index__(self) -> int:
        """Return it."""
        self.call()
        return self.value

    def __float__(self) -> float:
        """Return it."""
        return float(self.__index__())


def test_a_row_is_never_mixed_with_that_of_a_call_within(tmp_path: Path) -> None:
    step = margin_step(evaluator(tmp_path, 'every_message').monitor, 'NEAR')
    assert step(1.5, 0.0, 0, Number(1, lambda: None), Number(1, lambda: None)) == 0.5
    for row in ((1.0, Number(0, lambda: step(0.0, 0.0, 0, 0, True)), 0, 0, True),
                (1.0, 0.0, 0, Number(0, lambda: step(0.0, 0.0, 0, 0, True)), True)):
        with pytest.raises(RuntimeError, match='another call began'):
            step(*row)


@pytest.mark.parametrize('name', ['bool_', 'uint64', 'int8', 'float32'])
def test_numbers_of_numpy_are_taken(tmp_path: Path, name: str) -> None:
    number = getattr(pytest.importorskip('numpy'), name)
    step = margin_step(evaluator(tmp_path, 'every_message').monitor, 'NEAR')
    row = [1.5, 0.5, 1, 1, True]
    row[['float32', 'int8', 'uint64', 'bool_'].index(name) + 1] = number(1)
    assert step(*row) == 0.5


def test_the_example_of_the_page_prints_what_it_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    text = (csrc_directory().parent / 'docs/margins.md').read_text(encoding='utf-8')
    bundle = re.findall(r'```yaml\n(# motor.yaml\n.*?)```', text, re.DOTALL)
    code, shown = re.findall(r'```python\n(.*?)```\n\n```text\n(.*?)```', text, re.DOTALL)[0]
    (tmp_path / 'motor.yaml').write_text(bundle[0], encoding='utf-8')
    monkeypatch.chdir(tmp_path)
    printed = StringIO()
    with redirect_stdout(printed):
        exec(code, {})
    assert printed.getvalue() == shown
