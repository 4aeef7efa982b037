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

from fret_monitor.runtime import Engine, RequirementState, State


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
        yield f'nothing comes of {", ".join(names[index] for index in silent)}'
