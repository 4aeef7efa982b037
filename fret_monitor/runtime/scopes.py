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
A thin typed wrapper of the scopes in C: the bundle, and an instance for each key.

`scopes.h` describes each call. Times are in nanoseconds, of any clock that the caller chooses.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from mmap import mmap
from pathlib import Path
from typing import Any

from fret_monitor.model.manifest import Manifest
from fret_monitor.model.policies import Policy
from fret_monitor.model.report_table import concerns, OPERATIONS
from fret_monitor.native import evaluator_library, LibraryError, load_evaluator, Monitor
from fret_monitor.native.binding import ffi
from fret_monitor.native.monitor import CData, MonitorKind
from fret_monitor.runtime.evaluator import (
    closest_of, Evaluator, EvaluatorOptions, input_counts, InputCounts, Margin, margin_of,
    MarginLanes, requirement_counts, RequirementCounts,
)

BUNDLE = 2**32 - 1
"""The scope of the bundle, in place of the index of a kind; its slot is 0."""

_KEYED = 2**32 - 1
_NO_SLOT = 2**32 - 1
_MOST_KEY_BYTES = 255
_MOST_LOGGED = 8192


@dataclass(frozen=True)
class KindCounts:
    """
    Counters of the instances of a kind; `open`: ended while something was pending.

    Of `beyond`, `unsized` have a key of too many bytes or none, and `second` are pairs that found
    room for their first key.
    """

    alive: int
    begun: int
    ended: int
    open: int
    beyond: int
    unsized: int
    second: int

    @property
    def by_variable(self) -> tuple[int, int]:
        """How many found no room for their key, of pairs their first one, and their second one."""
        return self.beyond - self.unsized - self.second, self.second


class Scopes:
    """
    Runs a bundle with instance variables; otherwise as `Evaluator`. Not thread-safe.

    An engine gives it the messages, or `KeyedRows` the rows of a trace.
    """

    def __init__(self, monitor: Monitor, *, policy: Policy | None = None,
                 period: float | None = None, library: Path | None = None, patience: float = 0.0,
                 is_of_engine: bool = False) -> None:
        """
        Make the scopes, with the instances of listed keys.

        `monitor` is the monitor to run; `library` that of the evaluator, which is built, or taken
        from the cache, when None. `policy`, `period` and `patience` are as of `Evaluator`. An
        engine takes the events, and recoveries too.

        Raises
        ------
        LibraryError
            if the monitor, its manifest and the evaluator do not match, or the memory for all
            instances cannot be had.
        """
        self.monitor = monitor
        self.path = library or evaluator_library()
        self.library: Any = load_evaluator(self.path)
        self.patience = patience
        manifest = monitor.manifest
        self.policy = manifest.policy if policy is None else policy
        self.period = manifest.period if period is None else period
        self._options = _Options(monitor, self.policy, self.period, patience,
                                 is_of_engine=is_of_engine)
        size = self.library.fm_scopes_bytes(self._options.pointer)
        if size == 0:
            raise LibraryError('the monitor was compiled for another evaluator')
        try:
            memory = ffi.from_buffer(mmap(-1, size))  # zeros, aligned to pages
        except (OSError, ValueError, OverflowError):
            raise LibraryError(f'there is no memory for all instances: {size:,} bytes') from None
        self._block = memory
        self.library.fm_use_large_pages(memory, size)
        self.pointer: CData = self.library.fm_scopes_init(memory, self._options.pointer)
        if self.pointer == ffi.NULL:
            raise LibraryError('the evaluator refuses what the manifest says of instances')
        # Of the kinds, then of the bundle: its index is -1.
        self._manifests = [*(item.monitor.manifest for item in monitor.kinds), monitor.manifest]
        self._next = [_places(item.inputs) for item in self._manifests]
        self._key = ffi.new('uint8_t[]', _MOST_KEY_BYTES)
        self._set_initial_values()

    def _set_initial_values(self) -> None:
        bundle = self.library.fm_scopes_bundle(self.pointer)
        for kind, manifest in enumerate(self._manifests):
            for index, item in enumerate(manifest.inputs):
                if item.initial is None:
                    continue
                place = self._next[kind][index]
                place[0] = item.initial
                if kind < len(self.monitor.kinds):
                    self.library.fm_scopes_initial_from(self.pointer, kind, index, place)
                else:
                    self.library.fm_evaluator_initial_from(bundle, index, place)

    def evaluator(self) -> Evaluator:
        """Return the evaluator of the bundle's scope, for an engine that runs these scopes."""
        return _BundleEvaluator(self)

    def requirement_counts(self, kind: int, index: int) -> RequirementCounts:
        """Return the counters of a requirement of a kind, those of all instances together."""
        return requirement_counts(self.library, self._blank(kind), index)

    def input_counts(self, kind: int, index: int) -> InputCounts:
        """Return the counters of an input of a kind, those of all instances together."""
        return input_counts(self.library, self._blank(kind), index)

    def _blank(self, kind: int) -> CData:
        return self.library.fm_scopes_look(self.pointer, kind, _NO_SLOT)

    def closest(self, kind: int, index: int) -> Iterator[tuple[bytes, Margin, int]]:
        """Yield the least margin of a requirement of each instance: key, margin, step's time."""
        for slot in self._slots(kind):
            found = closest_of(self.library.fm_evaluator_closest(
                self.library.fm_scopes_look(self.pointer, kind, slot), index))
            if found is not None:
                yield self.key(kind, slot), *found

    def steps(self, kind: int, index: int) -> Iterator[tuple[bytes, int]]:
        """Yield the keys of instances, and how many steps a requirement has taken in each."""
        group = self._manifests[kind].requirements[index].group
        for slot in self._slots(kind):
            yield self.key(kind, slot), int(self.library.fm_evaluator_steps(
                self.library.fm_scopes_look(self.pointer, kind, slot), group))

    def forget_closest(self) -> None:
        """Forget the least margins of all instances."""
        for kind, _ in enumerate(self.monitor.kinds):
            for slot in self._slots(kind):
                self.library.fm_evaluator_forget_closest(
                    self.library.fm_scopes_look(self.pointer, kind, slot))

    def _slots(self, kind: int) -> Iterator[int]:
        slot = self.library.fm_scopes_next(self.pointer, kind, 0)
        while slot != _NO_SLOT:
            yield slot
            slot = self.library.fm_scopes_next(self.pointer, kind, slot + 1)

    def log_closest(self) -> 'ClosestLog':
        """Return a log of the least margins of instances that end from now on."""
        self._log = ClosestLog()
        self.library.fm_scopes_log_closest(self.pointer, self._log.pointer)
        return self._log

    def draw_margins(self, begin: int, end: int, parts: int) -> list[MarginLanes]:
        """Return the margins of each kind: of all instances the least, as `Evaluator` has them."""
        self._lanes = [MarginLanes(len(kind.monitor.manifest.requirements), begin, end, parts)
                       for kind in self.monitor.kinds]
        for kind, lanes in enumerate(self._lanes):
            self.library.fm_evaluator_draw_margins(self._blank(kind), lanes.pointer)
        return self._lanes

    def key(self, kind: int, slot: int) -> bytes:
        """Return the key of an instance."""
        size = self.library.fm_scopes_key(self.pointer, kind, slot, self._key)
        return bytes(ffi.buffer(self._key, size))

    def overflows(self) -> int:
        """Return the changes that found no room in a window, of all instances together."""
        return int(self.library.fm_scopes_time_counts(self.pointer).overflows)

    def counts(self, kind: int) -> KindCounts:
        """Return the counters of the instances of a kind."""
        found = self.library.fm_scopes_counts(self.pointer, kind)
        return KindCounts(found.alive, found.begun, found.ended, found.open, found.beyond,
                          found.unsized, found.second)


class ClosestLog:
    """A `struct fm_closest_log`, which scopes write to."""

    def __init__(self) -> None:
        """Allocate room."""
        self._records = ffi.new('struct fm_closest_record[]', _MOST_LOGGED)
        self.pointer: CData = ffi.new('struct fm_closest_log *', {
            'records': self._records, 'room': _MOST_LOGGED})

    @property
    def missed(self) -> int:
        """How many found no room since the log was made."""
        return int(self.pointer.missed)

    def take(self) -> list[tuple[int, int, bytes, Margin, int]]:
        """Return what was logged since the last call: kind, requirement, key, and as `closest`."""
        found = [(item.kind, item.requirement, bytes(item.key[0:item.key_size]),
                  margin_of(item.closest.margin), item.closest.at)
                 for item in self._records[0:self.pointer.n]] if self.pointer.n else []
        self.pointer.n = 0
        return found


def _places(inputs: Any) -> list[CData]:
    return [ffi.new(f'{item.value_type.c_name} *') for item in inputs]


class _Options:
    """The `struct fm_scopes_options` of a monitor; keeps alive what the struct points to."""

    def __init__(self, monitor: Monitor, policy: Policy, period: float | None, patience: float, *,
                 is_of_engine: bool) -> None:
        manifest = monitor.manifest
        self._settings = (policy, period, patience, is_of_engine)
        self._kept: list[Any] = [EvaluatorOptions(monitor, *self._settings)]
        kinds = ffi.new('struct fm_kind[]', max(1, len(monitor.kinds)))
        slots = 0
        for place, kind in enumerate(monitor.kinds):
            kinds[place] = self._kind(monitor, place, kind)
            slots += kinds[place].most
        aggregates = ffi.new('struct fm_aggregate[]', [
            {'kind': item.kind, 'operation': ffi.integer_const(OPERATIONS[item.function]),
             'operand': manifest.operand_of(item), 'input': item.input}
            for item in manifest.aggregates])
        self._kept += [kinds, aggregates]
        self.pointer = ffi.new('struct fm_scopes_options *', {
            'bundle': self._kept[0].pointer,
            'kinds': kinds,
            'n_kinds': len(monitor.kinds),
            'n_aggregates': len(manifest.aggregates),
            'aggregates': aggregates,
            'most_stepped': 0 if is_of_engine else 2 * slots + 4,
        })

    def _kind(self, monitor: Monitor, number: int, kind: MonitorKind) -> dict[str, Any]:
        manifest, described = monitor.manifest, monitor.manifest.kinds[number]
        options = EvaluatorOptions(kind.monitor, *self._settings, described.n_reported)
        topics = range(len(manifest.topics))
        fed = [ffi.new('uint32_t[]', [*manifest.keyed(number, place), 0]) for place in topics]
        keyed = ffi.new('struct fm_topic[]', [
            {'inputs': inputs, 'n_inputs': len(inputs) - 1} for inputs in fed] or 1)
        concerned = ffi.new('uint8_t[]', [*concerns(manifest, number), 0])
        shared = ffi.new('uint32_t[]', [
            *(_KEYED if place is None else place for place in described.shared), 0])
        base, of_base = manifest.base_of(number), manifest.of_base(number)
        same = ffi.NULL if of_base is None else ffi.new('uint32_t[]', [
            _KEYED if place is None else place for place in of_base])
        listed, count = self._keys(manifest.listed(number))
        self._kept += [options, shared, same, fed, keyed, concerned]
        return {
            'options': options.pointer, 'outputs': kind.outputs, 'concerns': concerned,
            'keyed': keyed, 'shared': shared, 'of_base': same, 'base': base, 'listed': listed,
            'n_listed': count, 'halves': self._halves(manifest, number),
            'most': manifest.most(number), 'forget': manifest.forget(number),
        }

    def _keys(self, keys: list[bytes]) -> tuple[CData, int]:
        texts = [ffi.new('uint8_t[]', key or b'\0') for key in keys]
        listed = ffi.new('struct fm_key[]', [
            {'bytes': text, 'size': len(key)} for text, key in zip(texts, keys, strict=True)])
        self._kept += [texts, listed]
        return listed, len(keys)

    def _halves(self, manifest: Manifest, number: int) -> CData:
        """Return the two `struct fm_half` of a kind of pairs; NULL of one variable."""
        halves = []
        for item in manifest.halves(number):
            listed, count = self._keys([key.encode() for key in item.variable.keys])
            inputs = ffi.new('uint32_t[]', [
                _KEYED if place is None else place for place in item.inputs] + [0])
            self._kept.append(inputs)
            halves.append({
                'listed': listed, 'n_listed': count, 'most': item.variable.most,
                'kind': BUNDLE if item.kind is None else item.kind, 'inputs': inputs})
        self._kept.append(made := ffi.new('struct fm_half[]', halves))
        return made if halves else ffi.NULL


class _BundleEvaluator(Evaluator):
    """The evaluator of the bundle's scope; keeps the scopes alive."""

    def __init__(self, scopes: Scopes) -> None:
        self._scopes = scopes
        super().__init__(scopes.monitor, policy=scopes.policy, period=scopes.period,
                         patience=scopes.patience, reports_recoveries=True, library=scopes.path)

    def _make(self) -> None:
        self.pointer = self._scopes.library.fm_scopes_bundle(self._scopes.pointer)
