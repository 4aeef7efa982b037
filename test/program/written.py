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

"""Formulas as a user writes them, on a fixed set of inputs, and their lowering."""

from collections.abc import Sequence
from pathlib import Path
import tempfile

from fret_monitor.build import generate_monitor, GeneratedMonitor, read, Reading
from fret_monitor.logic.specification import Specification
from fret_monitor.program.layout import GroupLayout, lay_out, MAX_STATE_BYTES
from fret_monitor.program.lower import lower

INPUTS = """\
  p: {type: bool}
  q: {type: bool}
  r: {type: bool}
  x: {type: float32}
  y: {type: float32}
  d: {type: float64}
  n: {type: int32}
  m: {type: int64}
  u: {type: uint64}
  b: {type: uint8}
"""


def specified(*formulas: str) -> Specification:
    """Return the specification of a bundle with these formulas over the inputs above."""
    lines = ['format: 1', 'inputs:', INPUTS.rstrip(), 'requirements:']
    lines += [f'  - {{id: R-{number}, ptltl: "{item}"}}' for number, item in enumerate(formulas)]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'written.yaml'
        path.write_text('\n'.join(lines) + '\n', encoding='utf-8')
        return read(path).specification


def generate(specification: Specification, limit: int = MAX_STATE_BYTES) -> GeneratedMonitor:
    """Generate C for a specification, as if it came from a file."""
    return generate_monitor(Reading(specification, (), '', ()), max_state_bytes=limit)


def layouts_of(specification: Specification) -> tuple[GroupLayout, ...]:
    """Lower a specification and place its state."""
    return tuple(lay_out(group) for group in lower(specification).groups)


def operations(*formulas: str) -> list[str]:
    """Return the kinds of operations that formulas lower to, without inputs and constants."""
    return sorted(kind for layout in layouts_of(specified(*formulas)) for kind in kinds(layout))


def kinds(layout: GroupLayout) -> Sequence[str]:
    """Return the kinds of a group's operations, without inputs and constants."""
    names = [type(item.operation).__name__ for item in layout.group.equations]
    return [name for name in names if name not in ('Read', 'Literal', 'Convert')]


def state(*formulas: str) -> list[str]:
    """Return the fields of state that formulas need, as kind, type and length."""
    fields = [field for layout in layouts_of(specified(*formulas)) for field in layout.fields]
    return sorted(f'{field.kind.value} {field.type.value}'
                  + (f'[{field.length}]' if field.length else '') for field in fields)
