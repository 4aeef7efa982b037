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

"""What an engine counts, as a snapshot of it has it."""

from dataclasses import dataclass
from typing import Any

from fret_monitor.native.binding import ffi
from fret_monitor.runtime import Engine, Evaluator, GateCounts, State
from fret_monitor.runtime.gate import gate_counts


@dataclass(frozen=True)
class Conditions:
    """
    What decides whether a lock is locked, or the gate of an engine open (`states.h`).

    `violated`: requirements; `unknown`: inputs without a value; as indices.
    """

    is_known: bool
    is_latched: bool
    states: tuple[State, ...]
    violated: frozenset[int]
    unknown: frozenset[int]


@dataclass(frozen=True)
class Silence:
    """
    The silences of an input: times without a usable value, from its timeout on.

    `count` so far; `lasted` is the time (ns) from the value before the present one until now, or
    of the last one.
    """

    count: int
    lasted: int
    is_silent: bool


@dataclass(frozen=True)
class Seen:
    """
    The state of an engine, and how it has changed since the last look.

    `behind`: of each topic, the longest time (ns) from a reception to its evaluation.
    """

    gate: GateCounts
    behind: tuple[int, ...]
    are_violated: tuple[bool, ...]
    silences: tuple[Silence, ...]
    unpublished: int
    conditions: Conditions
    changes: tuple[Conditions, ...]
    missed: int


def see(engine: Engine) -> Seen:
    """Take a snapshot of an engine."""
    manifest = engine.monitor.manifest
    counts = len(manifest.requirements), len(manifest.inputs), len(manifest.topics)
    size = ffi.integer_const('FM_CONDITION_BYTES') + counts[0] + counts[1]
    most = ffi.integer_const('FM_MOST_CONDITIONS')
    kept: list[Any] = [
        *(ffi.new(f'struct {name}[]', count + 1) for name, count in zip(
            ('fm_requirement_counts', 'fm_input_snapshot', 'fm_topic_snapshot'), counts)),
        ffi.new('uint8_t[]', size), ffi.new('uint8_t[]', size * most)]
    seen: Any = ffi.new('struct fm_snapshot *', dict(zip(
        ('requirements', 'inputs', 'topics', 'conditions', 'changes'), kept)))
    engine.library.fm_engine_snapshot(engine.pointer, seen)
    changes = bytes(ffi.buffer(seen.changes, size * seen.n_changes))
    silences = [seen.inputs[place].silence for place in range(counts[1])]
    return Seen(
        gate_counts(seen.gate),
        tuple(int(seen.topics[place].behind) for place in range(counts[2])),
        tuple(bool(seen.requirements[place].is_violated) for place in range(counts[0])),
        tuple(_silence(item) for item in silences),
        int(seen.unpublished), _conditions(bytes(ffi.buffer(seen.conditions, size)), counts[0]),
        tuple(_conditions(changes[size * place:][:size], counts[0])
              for place in range(seen.n_changes)), int(seen.missed))


def is_stale(evaluator: Evaluator, index: int) -> bool:
    """Return whether an input is stale."""
    return bool(evaluator.library.fm_evaluator_is_stale(evaluator.pointer, index))


def silence_of(evaluator: Evaluator, index: int) -> Silence:
    """Return the silences of an input."""
    return _silence(evaluator.library.fm_evaluator_silence(evaluator.pointer, index))


def _silence(found: Any) -> Silence:
    return Silence(found.count, found.lasted, bool(found.is_silent))


def _conditions(found: bytes, requirements: int) -> Conditions:
    begin = ffi.integer_const('FM_CONDITION_BYTES')
    of_requirements, of_inputs = found[begin:][:requirements], found[begin + requirements:]
    mask, is_false, has_value = (ffi.integer_const(name) for name in (
        'FM_STATE_MASK', 'FM_IS_FALSE', 'FM_HAS_VALUE'))
    return Conditions(
        bool(found[ffi.integer_const('FM_GATE_IS_KNOWN')]),
        bool(found[ffi.integer_const('FM_GATE_IS_LATCHED')]),
        tuple(State(byte & mask) for byte in of_requirements),
        frozenset(place for place, byte in enumerate(of_requirements) if byte & is_false),
        frozenset(place for place, byte in enumerate(of_inputs) if not byte & has_value))
