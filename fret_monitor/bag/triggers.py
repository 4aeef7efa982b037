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
Whether the trigger of each requirement came in a recording: without it, a verdict says little.

A monitor beside the bundle's has requirements that are violated at each trigger (`deadlines.py`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from fret_monitor.bag.check import Aside, RecordingResult, Selection, variant_of
from fret_monitor.bag.findings import Findings
from fret_monitor.model.diagnostics import refuse
from fret_monitor.start import Variant

if TYPE_CHECKING:  # what is in the cache needs no parser
    from fret_monitor.build import Reading
    from fret_monitor.elaboration.signals import FindMessage


def trigger_asides(bundle: Path, selection: Selection, find: 'FindMessage') -> Iterator[Aside]:
    """
    Yield the monitor that finds out whether triggers came.

    A requirement without a condition or a scope is triggered where it is judged. Raises
    `CompileError` if the bundle has instances.
    """
    monitor = variant_of(bundle, replace(selection, margins=False), find, _DENIALS).monitor
    if monitor.manifest.variables:
        refuse("--triggers does not take bundles with 'for_each' yet")
    yield Aside(monitor, _note)


def _note(result: RecordingResult, findings: Sequence[Findings]) -> None:
    came = {item.id: item.verdict is False for item in result.findings}
    for item in findings:
        item.triggered = item.verdict is not None and came.get(item.id, True)


def _make(reading: 'Reading', find: 'FindMessage') -> 'Reading':
    from fret_monitor.bag.deadlines import with_denials
    return with_denials(reading, find)


_DENIALS = Variant('denials', _make)
