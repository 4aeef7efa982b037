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
"""Helpers of the tests of `explain`."""

from collections.abc import Sequence
from pathlib import Path

from fret_monitor.build import read
from fret_monitor.logic.evaluate import verdicts
from fret_monitor.traces.search import Budget, Examples, find_examples
from fret_monitor.traces.subject import Subject, subjects
from fret_monitor.traces.trace import rows_of, Trace

INPUTS = """\
format: 1
inputs:
  p: {type: bool}
  q: {type: bool}
  r: {type: bool}
  x: {type: float64}
  y: {type: float32}
  n: {type: int8}
  mode: {type: uint8, values: {IDLE: 0, LANDING: 7}}
requirements:
"""


def bundle(folder: Path, *formulas: str) -> Path:
    """Write a bundle of requirements R0, R1, ... in past-time MTL."""
    lines = [f'  - {{id: R{number}, ptltl: "{text}"}}\n' for number, text in enumerate(formulas)]
    path = folder / 'bundle.yaml'
    path.write_text(INPUTS + ''.join(lines), encoding='utf-8')
    return path


def examined(path: Path) -> list[tuple[Subject, Examples]]:
    """Return the requirements of a bundle with their examples."""
    specification = read(path).specification
    budget = Budget()
    return [(subject, find_examples(subject, budget))
            for subject in subjects(specification, specification.properties)]


def reference(subject: Subject, trace: Trace) -> list[bool]:
    """Return the verdicts of a trace by the reference semantics."""
    rows: Sequence[Sequence[bool | int | float]] = rows_of(trace)
    columns = {signal.name: [row[number] for row in rows]
               for number, signal in enumerate(subject.signals)}
    if not columns:
        columns = {'nothing': [False] * len(rows)}
    return verdicts(subject.item.formula, columns, subject.item.feedback)
