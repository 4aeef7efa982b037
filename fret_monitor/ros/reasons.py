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

"""Why a lock is locked, or a gate closed, in words."""

from collections.abc import Iterator, Sequence

from fret_monitor.model.manifest import ManifestGate
from fret_monitor.runtime import Engine, GateCounts, RequirementState, State


def why_locked(engine: Engine, states: Sequence[RequirementState],
               requirements: Sequence[int]) -> str:
    """Return why a lock of some requirements is locked; an empty text if it is free."""
    manifest = engine.monitor.manifest
    closing = [index for index in requirements if states[index].state is not State.HOLDS]
    reads = {index: manifest.groups[manifest.requirements[index].group].inputs
             for index in closing}
    violated = [manifest.requirements[index].id for index in closing
                if states[index].state is State.VIOLATED]
    reasons = [f'violated: {", ".join(violated)}'] if violated else []
    reasons += missing_inputs(engine, sorted(set().union(*reads.values())))
    unexplained = [manifest.requirements[index].id for index in closing
                   if states[index].state is State.UNKNOWN
                   and not any(missing_inputs(engine, reads[index]))]
    if unexplained:
        reasons.append('not evaluated since the start, ~/reset or a pause of this node: '
                       f'{", ".join(unexplained)}')
    return '; '.join(reasons)


def missing_inputs(engine: Engine, inputs: Sequence[int], *,
                   with_silent: bool = True) -> Iterator[str]:
    """Yield which of some inputs have no value yet, and which are silent."""
    names = [item.name for item in engine.monitor.manifest.inputs]
    unknown = [index for index in inputs if engine.value(index) is None]
    silent = [index for index in inputs if with_silent
              and index not in unknown and engine.silence(index).is_silent]
    if unknown:
        yield f'no value yet of {", ".join(names[index] for index in unknown)}'
    if silent:
        yield f'no message for {", ".join(names[index] for index in silent)}'


def why_closed(engine: Engine, counts: GateCounts) -> str:
    """Return why the gate of an engine is closed; an empty text if it is open."""
    return '; '.join(_reasons(engine, counts))


def _reasons(engine: Engine, counts: GateCounts) -> Iterator[str]:
    manifest = engine.monitor.manifest
    gate = manifest.gate
    assert gate is not None
    own = () if gate.topic is None else manifest.topics[gate.topic].inputs
    other = [index for index in range(len(manifest.inputs)) if index not in own]
    missing = list(missing_inputs(engine, other, with_silent=not gate.is_open_when_stale))
    yield from missing
    if not counts.is_known and not missing:
        yield 'this node stood still: whether an input is silent is not known yet'
    if counts.is_latched:
        yield f'latched by a violation, until {latch_end(gate)}'
    ids = [item.id for index, item in enumerate(manifest.requirements)
           if not engine.requirement_counts(index).holds]
    if ids:
        yield f'violated: {", ".join(ids)}'
    ids = [item.id for index, item in enumerate(manifest.requirements)
           if is_withheld_from_start(engine, index)]
    if ids:
        yield f'violated since the first message: {", ".join(ids)}'


def latch_end(gate: ManifestGate) -> str:
    """Return what opens a gate that is latched."""
    return f'{gate.open_after / 1e9:g} s without a violation' if gate.open_after else '~/reset'


def is_withheld_from_start(engine: Engine, index: int) -> bool:
    """Return whether a gate has withheld each message so far on which a requirement was judged."""
    counts = engine.requirement_counts(index)
    return engine.monitor.manifest.gate is not None and counts.holds and \
        counts.steps == counts.violations > 0
