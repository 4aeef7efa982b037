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

from collections.abc import Collection, Iterator, Sequence

from fret_monitor.model.manifest import Manifest, ManifestGate
from fret_monitor.runtime import Conditions, Engine, State


def why_locked(manifest: Manifest, conditions: Conditions, requirements: Sequence[int]) -> str:
    """Return why a lock of some requirements is locked; an empty text if it is free."""
    states = conditions.states
    closing = [index for index in requirements if states[index] is not State.HOLDS]
    reads = {index: manifest.groups[manifest.requirements[index].group].inputs
             for index in closing}
    violated = [index for index in closing if states[index] is State.VIOLATED]
    reasons = [f'violated: {_ids(manifest, violated)}'] if violated else []
    reasons += missing_inputs(manifest, conditions, set().union(*reads.values()))
    unexplained = [index for index in closing if states[index] is State.UNKNOWN
                   and not any(missing_inputs(manifest, conditions, reads[index]))]
    if unexplained:
        reasons.append('not evaluated since the start, ~/reset or a pause of this node: '
                       f'{_ids(manifest, unexplained)}')
    return '; '.join(reasons)


def _ids(manifest: Manifest, requirements: Collection[int]) -> str:
    return ', '.join(manifest.requirements[index].id for index in sorted(requirements))


def missing_inputs(manifest: Manifest, conditions: Conditions, inputs: Collection[int], *,
                   with_silent: bool = True) -> Iterator[str]:
    """Yield which of some inputs have no value yet, and which are silent."""
    def names(which: Collection[int]) -> str:
        return ', '.join(manifest.inputs[index].name for index in sorted(which))

    unknown = conditions.unknown & set(inputs)
    silent = (conditions.silent - unknown) & set(inputs) if with_silent else set()
    if unknown:
        yield f'no value yet of {names(unknown)}'
    if silent:
        yield f'no message for {names(silent)}'


def why_closed(manifest: Manifest, conditions: Conditions) -> str:
    """Return why the gate of a manifest is closed; an empty text if it is open."""
    return '; '.join(_reasons(manifest, conditions))


def _reasons(manifest: Manifest, conditions: Conditions) -> Iterator[str]:
    gate = manifest.gate
    assert gate is not None
    own = () if gate.topic is None else manifest.topics[gate.topic].inputs
    other = set(range(len(manifest.inputs))).difference(own)
    missing = list(missing_inputs(
        manifest, conditions, other, with_silent=not gate.is_open_when_stale))
    yield from missing
    if not conditions.is_known and not missing:
        yield 'this node stood still: whether an input is silent is not known yet'
    if conditions.is_latched:
        yield f'latched by a violation, until {latch_end(gate)}'
    if conditions.violated:
        yield f'violated: {_ids(manifest, conditions.violated)}'
    if conditions.withheld_from_start:
        from_start = _ids(manifest, conditions.withheld_from_start)
        yield f'violated since the first message: {from_start}'


def latch_end(gate: ManifestGate) -> str:
    """Return what opens a gate that is latched."""
    return f'{gate.open_after / 1e9:g} s without a violation' if gate.open_after else '~/reset'


def is_withheld_from_start(engine: Engine, index: int) -> bool:
    """Return whether a gate has withheld each message so far on which a requirement was judged."""
    return engine.monitor.manifest.gate is not None \
        and index in engine.conditions().withheld_from_start
