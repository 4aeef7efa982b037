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

The recording is read once more, by a monitor of its own, whose requirements are violated at each
trigger.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

from fret_monitor.bag.check import (
    compiled, opened, read_bundle, RecordingResult, run, Selection,
)
from fret_monitor.bag.evidence import beside
from fret_monitor.build import Reading
from fret_monitor.elaboration.signals import FindMessage
from fret_monitor.explain.report import meanings
from fret_monitor.logic.formula import variables
from fret_monitor.logic.propositions import untriggered
from fret_monitor.logic.specification import Property
from fret_monitor.model.diagnostics import refuse


def with_triggers(check: Callable[[], RecordingResult], bundle: Path, path: Path,
                  selection: Selection) -> RecordingResult:
    """
    Return what `check` finds in a recording, with whether triggers came, if `selection` asks.

    A requirement without a condition or a scope is triggered where it is judged.

    Raises
    ------
    CompileError
        if the bundle has instances; as `check_recording`.
    """
    result = check()
    if selection.triggers:
        came = _triggered(bundle, path, selection)
        for item in result.findings:
            item.triggered = item.verdict is not None and came.get(item.id, True)
    return result


def _triggered(bundle: Path, path: Path, selection: Selection) -> dict[str, bool]:
    """Return by id whether the trigger came; requirements without one are not in it."""
    with opened(path) as (recording, find):
        reading = read_bundle(bundle, replace(selection, margins=False), find)
        if reading.specification.instance_variables:
            refuse("--triggers does not take bundles with 'for_each' yet")
        asked = tuple(_denials(reading, find))
        if not asked:
            return {}
        monitor = compiled(replace(reading, specification=replace(
            reading.specification, properties=asked, actions=(), gates=()))).monitor
        found = run(monitor, recording, replace(selection, margins=False), checks_remaps=False)
    return {item.id: item.verdict is False for item in found.findings}


def _denials(reading: Reading, find: FindMessage) -> Iterator[Property]:
    """Yield requirements that are violated where those of a bundle are triggered."""
    known = meanings(reading, find)
    for item in reading.specification.properties:
        denial = known[item.id].denial or untriggered(item)
        if denial is not None and variables(denial):
            yield replace(beside(denial, item, reading.specification), on_violation=(), on_end=(),
                          horizon=0, probability=None)
