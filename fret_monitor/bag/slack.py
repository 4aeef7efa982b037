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
How much time was left until the deadlines of FRETish sentences when their responses came.

A monitor beside the bundle's has requirements that are violated while a response is waited for
(`deadlines.py`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from fret_monitor.bag.check import Aside, compiled, RecordingResult, Selection, variant_of
from fret_monitor.bag.findings import Findings
from fret_monitor.bag.waits import lanes_of, sum_up, Waits
from fret_monitor.native.monitor import Monitor
from fret_monitor.start import Variant

if TYPE_CHECKING:  # what is in the cache needs no parser
    from fret_monitor.build import Reading
    from fret_monitor.elaboration.signals import FindMessage


def slack_asides(bundle: Path, selection: Selection, find: 'FindMessage') -> Iterator[Aside]:
    """Yield the monitor that finds the slack of sentences with a deadline, if there are any."""
    yield from _asides(variant_of(
        bundle, replace(selection, margins=False), find, _DEADLINES).monitor)


def slack_asides_of(reading: 'Reading', find: 'FindMessage') -> Iterator[Aside]:
    """Do as `slack_asides`, for a bundle that was read."""
    yield from _asides(compiled(_make(reading, find)).monitor)


def _asides(monitor: Monitor) -> Iterator[Aside]:
    lanes = [*lanes_of(item.id for item in monitor.manifest.numbered)]
    waits = Waits(monitor.manifest)

    def note(result: RecordingResult, findings: Sequence[Findings]) -> None:
        violations = {item.id: item.violations for item in result.findings}
        by_id = {item.id: item for item in findings}

        def steps(name: str, key: bytes | None) -> int | None:
            return violations[name] if key is None else result.steps[name].get(key)

        for each in lanes:
            sum_up(by_id[each.id], waits.found(each, result.end, steps))

    if lanes:
        yield Aside(monitor, note, [waits])


def _make(reading: 'Reading', find: 'FindMessage') -> 'Reading':
    from fret_monitor.bag.deadlines import with_lanes
    return with_lanes(reading, find)


_DEADLINES = Variant('deadlines', _make)
