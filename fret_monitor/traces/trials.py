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
Run many short traces through a compiled requirement, or one step from a given state.

The loops are in C (`trials.c`) and call the step function of the requirement's group.
"""

from array import array
from collections.abc import Sequence
import struct
from typing import Any

from fret_monitor.model.manifest import ManifestInput
from fret_monitor.native.binding import ffi
from fret_monitor.native.cache import build_library, csrc_file
from fret_monitor.native.monitor import CData, Library, Monitor
from fret_monitor.traces.trace import length, Row, Trace

_WORD = 8
_RUN = ('void (*)(const void *, const void *, uint64_t, const uint32_t *, uint64_t, uint32_t *)')
_FOLLOW = ('void (*)(const void *, const void *, uint64_t, uint64_t, uint64_t, uint64_t, '
           'const void *, uint8_t *, uint32_t *)')
_INIT = 'void (*)(void *, const struct fm_group *, void *, bool *, const uint32_t *, uint32_t)'


class TrialLibrary:
    """The compiled loops of `trials.c`."""

    def __init__(self) -> None:
        """Build and open the library; raises `NativeError`."""
        text = csrc_file('trials.c').read_text(encoding='utf-8')
        self._library = Library(build_library({'trials.c': text}, name='fm_trials'))
        self.bytes: Any = ffi.cast('uint64_t (*)(void)', self._library.find('fm_trials_bytes'))
        self.init: Any = ffi.cast(_INIT, self._library.find('fm_trials_init'))
        self.run: Any = ffi.cast(_RUN, self._library.find('fm_trials_run'))
        self.follow: Any = ffi.cast(_FOLLOW, self._library.find('fm_trials_follow'))


class Trials:
    """
    Runs traces through some requirements of one group.

    The verdicts of a step are one number: bit i is the verdict of the i-th requirement.
    """

    def __init__(self, library: TrialLibrary, monitor: Monitor,
                 requirements: Sequence[int]) -> None:
        """Store the indices of at most 32 requirements, all of one group."""
        group = monitor.manifest.requirements[requirements[0]].group
        self._library = library
        self._monitor = monitor
        self._group = monitor.pointer.groups[group]
        self._inputs = monitor.manifest.groups[group].inputs
        self._state = ffi.new('uint64_t[]', monitor.state_bytes // _WORD + 2)
        self._verdicts = ffi.new(
            'bool[]', monitor.pointer.n_requirements + monitor.pointer.n_more_verdicts)
        self._watched = ffi.new('uint32_t[]', list(requirements))
        self._self = ffi.new('uint64_t[]', int(library.bytes()) // _WORD + 1)
        library.init(self._self, monitor.pointer.groups + group, self._state, self._verdicts,
                     self._watched, len(requirements))
        self._begin, self._size = self._place()

    @property
    def inputs(self) -> tuple[ManifestInput, ...]:
        """The inputs of a row."""
        return tuple(self._monitor.manifest.inputs[index] for index in self._inputs)

    def _place(self) -> tuple[int, int]:
        """Return the offset and size of the group's state: the bytes that its reset writes."""
        memory = ffi.buffer(self._state)
        begin, end = len(memory), 0
        for fill in (b'\x00', b'\xff'):
            memory[:] = fill * len(memory)
            self._group.reset(self._state)
            found = bytes(memory)
            begin = min(begin, len(found) - len(found.lstrip(fill)))
            end = max(end, len(found.rstrip(fill)))
        memory[:] = bytes(len(memory))
        return (begin, end - begin) if end else (0, 0)

    def run(self, traces: Sequence[Trace]) -> list['array[int]']:
        """Return the verdicts at each step of each trace, each run from the initial state."""
        index: dict[Row, int] = {}
        runs = array('I')
        for trace in traces:
            runs.extend((0, 0))
            for row, steps in trace:
                runs.extend((index.setdefault(row, len(index)), steps))
        lengths = [length(trace) for trace in traces]
        bits = array('I', bytes(4 * max(1, sum(lengths))))
        rows, stride = self._pack(list(index))
        self._library.run(self._self, rows, stride, ffi.from_buffer('uint32_t[]', runs),
                          len(runs) // 2, ffi.from_buffer('uint32_t[]', bits))
        found, start = [], 0
        for count in lengths:
            found.append(bits[start:start + count])
            start += count
        return found

    def _pack(self, rows: Sequence[Row]) -> tuple[CData, int]:
        """Return some rows as an array of inputs structs, and the stride in bytes."""
        stride = -(-int(self._monitor.pointer.inputs_bytes) // _WORD) * _WORD
        block = bytearray(max(1, stride * len(rows)))
        places = [(int(self._monitor.pointer.inputs[index].offset),
                   '=' + item.value_type.typecode)
                  for index, item in zip(self._inputs, self.inputs, strict=True)]
        for number, row in enumerate(rows):
            for (offset, code), value in zip(places, row, strict=True):
                struct.pack_into(code, block, number * stride + offset, value)
        return ffi.from_buffer(block), stride

    def start(self) -> bytes:
        """Return the state before the first step."""
        self._group.reset(self._state)
        return bytes(ffi.buffer(self._state)[self._begin:self._begin + self._size])

    def follower(self, rows: Sequence[Row]) -> 'Follower':
        """Return a function that takes one step from a state with each of some rows."""
        packed, stride = self._pack(rows)
        return Follower(self._library, self._self, (packed, stride, len(rows)),
                        (self._begin, self._size), self)


class Follower:
    """Takes one step from a given state with each of some rows."""

    def __init__(self, library: TrialLibrary, trials: CData, rows: tuple[CData, int, int],
                 place: tuple[int, int], owner: Trials) -> None:
        """Store the parts; only `Trials.follower` calls this."""
        self._library, self._trials, self._rows, self._place = library, trials, rows, place
        self._owner = owner
        self._states = bytearray(max(1, rows[2] * place[1]))
        self._bits = array('I', bytes(4 * max(1, rows[2])))

    def __call__(self, state: bytes) -> list[tuple[bytes, int]]:
        """Return, for each row, the next state and the verdicts of the step."""
        rows, stride, count = self._rows
        begin, size = self._place
        self._library.follow(self._trials, rows, stride, count, begin, size,
                             ffi.from_buffer(state), ffi.from_buffer('uint8_t[]', self._states),
                             ffi.from_buffer('uint32_t[]', self._bits))
        found = bytes(self._states)
        return [(found[number * size:number * size + size], bits)
                for number, bits in enumerate(self._bits[:count])]
