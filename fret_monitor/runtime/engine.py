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
A wrapper of the engine of `engine.c`: an evaluator that threads share, and that knows time.

Its mutex is in C and is held only inside a call, so that a thread never waits for Python's
interpreter lock while it holds the mutex. Independent of ROS.
"""

from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from enum import Enum
from functools import partial
from typing import Any

from fret_monitor.model.frozen import frozen
from fret_monitor.model.made import MadeKind, SEEN_TYPES
from fret_monitor.model.manifest import Manifest
from fret_monitor.model.policies import Policy, Stamp
from fret_monitor.model.transforms import TOPICS
from fret_monitor.native.binding import ffi
from fret_monitor.native.errors import LibraryError
from fret_monitor.native.monitor import Monitor
from fret_monitor.runtime.evaluator import Evaluator, Violation, violation
from fret_monitor.runtime.gate import Judgement, MessageGate
from fret_monitor.runtime.keyed_rows import KeyedBlock, KeyedRows
from fret_monitor.runtime.scopes import Scopes

MOST_DETAILS_PER_S: int = ffi.integer_const('FM_MOST_DETAILS_PER_S')
"""Details of a requirement in a second for subscribers; the others are counted."""

MOST_QUEUED = 1 << 14
"""Violations of a recording that wait to be taken, unless the caller wants fewer."""

_BATCH = 64
_KEY_ROOM = 256  # bytes of a key with its size
_LONGEST_WAIT_MS = 60_000


class Receipt(Enum):
    """The result of delivering a message; the values are those of `enum fm_receipt`."""

    RECEIVED = 0
    UNDECODABLE = 1
    REPEATED = 2
    UNRELATED = 3


class State(Enum):
    """
    What locks and actions follow; the values are those of `enum fm_state`.

    A requirement is unknown before its first step since start or reset, and while an input that it
    reads is silent.
    """

    UNKNOWN = 0
    HOLDS = 1
    VIOLATED = 2


@frozen
class RequirementState:
    """The state of a requirement, and how often a violation has begun."""

    occurrences: int
    state: State


@frozen
class OrderCounts:
    """
    Messages of a topic that took effect out of the order of their stamps, or wait for long.

    `late` are older than what was evaluated before; `overflows` could not wait, for want of room.
    The stamps of `ahead` were ahead of the clock, by `most_ahead` nanoseconds at most.
    """

    late: int = 0
    overflows: int = 0
    ahead: int = 0
    most_ahead: int = 0


def _in_root(name: str) -> str:
    return name if name.startswith('/') else f'/{name}'


class Engine:
    """
    Evaluates messages, takes what is due, and queues violations and their details.

    All methods may be called from any thread at any time, except where stated.
    """

    def __init__(self, evaluator: Evaluator, *, takes_recoveries: bool = False,
                 scopes: Scopes | None = None,
                 full_name: Callable[[str], str] = _in_root) -> None:
        """
        Share an evaluator; no other code may call it from now on.

        With `takes_recoveries`, `take` and `records` also return the ends of violations, if the
        evaluator reports them. Of `scopes`, the evaluator is that of the bundle's scope;
        violations then have the numbers of `Manifest.numbered`. `full_name` returns that of a
        node, of which a parameter is read.

        Raises
        ------
        LibraryError
            if the monitor's library does not read the messages of its topics.
        """
        self.evaluator, self.scopes = evaluator, scopes
        self._library: Any = evaluator.library
        self._monitor = evaluator.monitor
        options = evaluator.options
        readers = self._monitor.readers
        manifest = self._monitor.manifest
        self.is_timed = evaluator.policy is Policy.TIMED
        uses_header_stamps = self.is_timed and manifest.stamp is Stamp.HEADER
        pointer = self._library.fm_engine_create(ffi.new('struct fm_engine_options *', {
            'evaluator': evaluator.pointer,
            'monitor': self._monitor.pointer,
            'readers': ffi.NULL if readers is None else readers,
            'topics': options.topics,
            'n_topics': options.n_topics,
            'sources': options.sources,
            'uses_header_stamps': uses_header_stamps,
            'reorder': manifest.reorder if uses_header_stamps else 0,
            'takes_recoveries': takes_recoveries,
            'scopes': ffi.NULL if scopes is None else scopes.pointer,
        }))
        self.scopes = scopes
        self._keys = ffi.new('uint8_t[]', _BATCH * _KEY_ROOM)
        if pointer == ffi.NULL:
            raise LibraryError('the library does not read the topics of its manifest')
        # Holds the library too: a reference to its function would not keep it open.
        self.pointer: Any = ffi.gc(pointer, partial(_destroy, self._library))
        self._frames: list[Any] = []
        if transforms := manifest.made_of(MadeKind.TRANSFORM):
            self._follow_transforms(manifest, transforms)
        self._follow_derived(manifest, full_name)
        self._gate: MessageGate | None = None  # so does this
        self._origin: Any = ffi.new('struct fm_origin *')
        self._detail = ffi.new('char[]', self._library.fm_engine_detail_bytes(self.pointer))

    def _follow_transforms(self, manifest: Manifest,
                           transforms: Mapping[int, tuple[str, ...]]) -> None:
        self._frames = [(*(ffi.new('char[]', name.encode()) for name in names), topic)
                        for topic, names in transforms.items()]
        names = [topic.name for topic in manifest.topics]
        if not self._library.fm_engine_follow_transforms(
                self.pointer, ffi.new('struct fm_transform_topic[]', self._frames),
                len(self._frames), *map(names.index, TOPICS)):
            raise LibraryError('there is no memory for the transforms of its manifest')

    def _follow_derived(self, manifest: Manifest, full_name: Callable[[str], str]) -> None:
        self._derived = [
            (topic, source, ffi.integer_const(SEEN_TYPES[manifest.topics[topic].message_type]),
             ffi.new('char[]', full_name(made.names[0]).encode()),
             ffi.new('char[]', made.names[-1].encode()))
            for topic, (made, source) in manifest.derived.items()]
        if not self._library.fm_engine_follow_derived(
                self.pointer, ffi.new('struct fm_derived_topic[]', self._derived),
                len(self._derived)):
            raise LibraryError('there is no memory for the parameters of its manifest')

    @property
    def library(self) -> Any:
        """The loaded library with the functions of csrc."""
        return self._library

    @property
    def monitor(self) -> Monitor:
        """The monitor that is run."""
        return self._monitor

    def close(self) -> None:
        """Ignore messages from now on, and stop waiting when the queues are empty."""
        self._library.fm_engine_close(self.pointer)

    def follow_states(self) -> None:
        """Keep `states` up to date; call it before any message is delivered."""
        self._library.fm_engine_follow_states(self.pointer)

    def states(self, seen: int, timeout: float) -> tuple[int, list[RequirementState]]:
        """
        Wait until a state has changed since `seen`, or the engine is closed, or for `timeout`.

        Returns the number of changes so far, to pass as `seen` (0 at first), and the state of each
        requirement. `timeout` is in seconds; 0: do not wait.
        """
        count = len(self._monitor.manifest.numbered)
        found = ffi.new('struct fm_requirement_state[]', count + 1)
        changes = self._library.fm_engine_states(
            self.pointer, seen, min(int(timeout * 1000), _LONGEST_WAIT_MS), found)
        return int(changes), [
            RequirementState(int(found[k].occurrences), State(found[k].state))
            for k in range(count)]

    def guard(self, gate: MessageGate) -> None:
        """Let a gate of the evaluator judge; call it before any message is delivered."""
        self._gate = gate
        self._library.fm_engine_guard(self.pointer, gate.pointer, gate.options)

    def judge(self, message: bytes, received: int) -> Judgement:
        """Judge a serialized message of the gate's topic, received at a time of the system."""
        origin = ffi.new('struct fm_origin *', {'received': received})
        return Judgement(self._library.fm_engine_judge(
            self.pointer, ffi.from_buffer('uint8_t[]', message), len(message), origin,
            ffi.new('int64_t *')))

    def replace(self, message: bytes, stamp_at: int | None = None) -> bytes | None:
        """Take the step of a replacement that is due; return what to send, None if nothing."""
        sent = bytearray(message)
        is_sent = self._library.fm_engine_replace(
            self.pointer, ffi.from_buffer('uint8_t[]', sent), len(sent),
            -1 if stamp_at is None else stamp_at, ffi.new('int64_t *'))
        return bytes(sent) if is_sent else None

    def message(self, topic: int, message: bytes, received: int, *, sent: int = 0,
                sequence: int = 0, gid: Any = ffi.NULL, is_retired: bool = False) -> Receipt:
        """
        Deliver a serialized message of a topic; one thread at a time may call this.

        Parameters
        ----------
        topic
            index in the manifest's topics.
        message
            CDR with its encapsulation header.
        received, sent
            nanoseconds, by the receiver's and the sender's clock.
        sequence
            the sender's number of the message.
        gid
            16 bytes that identify the publisher (`uint8_t *`), or `ffi.NULL`: not known.
        is_retired
            whether it was received by a subscription that is being replaced.
        """
        origin = self._origin
        origin.received, origin.sent, origin.sequence = received, sent, sequence
        origin.gid, origin.is_retired = gid, is_retired
        return Receipt(self._library.fm_engine_message(
            self.pointer, topic, ffi.from_buffer('uint8_t[]', message), len(message), origin))

    def records(self, topics: 'array[int]', times: 'array[int]', sizes: 'array[int]',
                messages: bytes, counts: 'array[int]', *,
                most: int = MOST_QUEUED,
                keys: tuple[bytes, 'array[int]'] | None = None) -> Iterator[list[Violation]]:
        """
        Deliver messages of a recording, in the order of their times, while the time is told.

        What is due between them is taken first. All must be taken from the iterator.

        Parameters
        ----------
        topics
            typecode `I`: of each message, an index in the manifest's topics.
        times
            typecode `q`: when each was received, in nanoseconds.
        sizes
            typecode `Q`: the length of each, in bytes.
        messages
            the serialized messages, one after another.
        counts
            typecode `Q`: of each topic, to which the number of messages is added.
        most
            the number of violations after which some are yielded.
        keys
            those in the names of the topics, one after another, and the length of each (typecode
            `I`); None: no name has one.

        Yields
        ------
        list[Violation]
            those so far, in the order in which they were found.
        """
        records = ffi.new('struct fm_records *', {
            'topics': ffi.from_buffer('uint32_t[]', topics),
            'times': ffi.from_buffer('int64_t[]', times),
            'sizes': ffi.from_buffer('uint64_t[]', sizes),
            'bytes': ffi.from_buffer('uint8_t[]', messages),
            'n': len(topics), 'counts': ffi.from_buffer('uint64_t[]', counts),
            'keys': ffi.NULL if keys is None else ffi.from_buffer('uint8_t[]', keys[0]),
            'key_sizes': ffi.NULL if keys is None else ffi.from_buffer('uint32_t[]', keys[1])})
        while not self._library.fm_engine_records(self.pointer, records, most):
            yield self._take_all()
        yield self._take_all()

    def rows(self, columns: Sequence['array[Any] | None'], times: 'array[int]',
             come: 'Sequence[bytes] | None' = None, *,
             most: int = MOST_QUEUED) -> Iterator[list[Violation]]:
        """
        Take rows of a trace, while the time is told; what is due between them is taken first.

        The inputs have no timeouts, and the policy no period. `columns`, `times` and `come` are as
        of `Evaluator.native_rows`; otherwise as `records`.
        """
        rows = self.evaluator.native_rows(columns, times, come)
        while not self._library.fm_engine_rows(self.pointer, rows.pointer, most):
            yield self._take_all()
        yield self._take_all()

    def keyed_rows(self, rows: KeyedRows, block: KeyedBlock, begin: int, end: int, *,
                   most: int = MOST_QUEUED) -> Iterator[list[Violation]]:
        """Take some rows of a trace with keys, as `rows`; of the scopes of this engine."""
        for _ in rows.feed(self.pointer, block, begin, end, most):
            yield self._take_all()

    def advance_all(self, now: int, *, most: int = MOST_QUEUED) -> Iterator[list[Violation]]:
        """Move the time while it is told, and yield what is found until then, as `records`."""
        while not self._library.fm_engine_advance_all(self.pointer, now, most):
            yield self._take_all()
        yield self._take_all()

    @property
    def latest_waiting(self) -> int | None:
        """The latest stamp of the messages that wait for their time; None if none does."""
        found = int(self._library.fm_engine_latest_waiting(self.pointer))
        return None if found == -2**63 else found

    def _take_all(self) -> list[Violation]:
        found: list[Violation] = []
        while batch := self.take(0):
            found += batch
        return found

    def reset(self) -> None:
        """Put all groups at their start; the inputs keep their values, and the counters go on."""
        self._library.fm_engine_reset(self.pointer)

    def advance(self, now: int) -> None:
        """Move the time while it is told, and take what is due; the first call begins it."""
        self._library.fm_engine_advance(self.pointer, now)

    def follow_steady(self) -> None:
        """Follow a clock that nobody sets; stamps are in system time."""
        self._library.fm_engine_follow_steady(self.pointer)

    def follow_clock(self, now: Any, clock: Any, *, is_outdated: bool = False) -> None:
        """
        Follow a clock in C that may stand still or jump; stamps are its times.

        The clock must live as long as this object, or until another is followed. Call `wake`
        whenever it has moved; if it `is_outdated`, there is no time before.
        """
        self._library.fm_engine_follow_clock(self.pointer, now, clock, is_outdated)

    def begin(self) -> None:
        """Begin the time of the clock that is followed; timeouts and periods run from now on."""
        self._library.fm_engine_begin(self.pointer)

    def wake(self) -> None:
        """Let the thread in `take` look at the clock, which has moved."""
        self._library.fm_engine_wake(self.pointer)

    def drain(self) -> None:
        """Deliver all that was received before the call, with what is due by then."""
        self._library.fm_engine_drain(self.pointer)

    def serve_clock(self) -> None:
        """Show that the thread that moves the clock is alive: see `fm_engine_hangs`."""
        self._library.fm_engine_serve_clock(self.pointer)

    @property
    def deadline(self) -> int:
        """The next instant at which something is due without a message; `NEVER` if none is."""
        return int(self._library.fm_engine_deadline(self.pointer))

    def begin_handover(self, topic: int, *, has_history: bool) -> None:
        """Drop messages that both an old and a new subscription receive (`handover.h`)."""
        self._library.fm_engine_begin_handover(self.pointer, topic, has_history)

    def end_handover(self, topic: int) -> None:
        """Stop looking for messages that are received twice."""
        self._library.fm_engine_end_handover(self.pointer, topic)

    def take(self, milliseconds: int) -> list[Violation]:
        """
        Return violations, oldest first; wait if there are none. One thread at a time.

        While a clock is followed, this takes what is due, also during the wait.
        """
        batch: Any = ffi.new('struct fm_violation[]', _BATCH)
        if self.scopes is None:
            count = self._library.fm_engine_take(self.pointer, batch, _BATCH, milliseconds)
            return [violation(item) for item in batch[0:count]]
        count = self._library.fm_engine_take_keyed(
            self.pointer, batch, self._keys, _BATCH, milliseconds)
        return [violation(item, self._key(place)) for place, item in enumerate(batch[0:count])]

    def _key(self, place: int) -> bytes | None:
        """Return the key of a violation of the batch; its size is the first byte."""
        begin = place * _KEY_ROOM + 1
        size = self._keys[begin - 1]
        return bytes(ffi.buffer(self._keys + begin, size)) if size else None

    def want_details(self, are_wanted: bool, most_per_s: int = MOST_DETAILS_PER_S) -> None:
        """Queue details from now on; or queue none, and drop those in the queue."""
        self._library.fm_engine_want_details(self.pointer, are_wanted, most_per_s)

    def take_detail(self, milliseconds: int) -> Any | None:
        """
        Return the next detail; wait if there is none. One thread at a time.

        It is a `struct fm_detail *` with values and flags behind it, for `reporting.py`; it is
        overwritten by the next call.
        """
        detail: Any = ffi.cast('struct fm_detail *', self._detail)
        found = self._library.fm_engine_take_detail(self.pointer, detail, milliseconds)
        return detail if found else None

    def detail_key(self, detail: Any) -> bytes | None:
        """Return the key of the instance that a detail is of, as `Violation.key`."""
        scope = self._library.fm_engine_detail_scope(self.pointer, detail)
        return bytes(ffi.buffer(scope.key, scope.key_size)) if scope.key_size else None

    def order_counts(self, topic: int) -> OrderCounts:
        """Return how many messages of a topic took effect out of order, or wait for long."""
        found = self._library.fm_engine_order_counts(self.pointer, topic)
        return OrderCounts(found.late, found.overflows, found.ahead, found.most_ahead)

    def evidence(self, topic: int) -> bytes | None:
        """Take the kept message with a field that could not be used; None if there is none."""
        size = self._library.fm_engine_evidence(self.pointer, topic, ffi.NULL, 0)
        while size > 0:
            room = ffi.new('uint8_t[]', size)
            found = self._library.fm_engine_evidence(self.pointer, topic, room, size)
            if found <= size:
                return bytes(ffi.buffer(room, found))
            size = found
        return None

    def lost(self, topic: int) -> int:
        """Return how many messages of a topic were lost."""
        return int(self._library.fm_engine_lost(self.pointer, topic))


def _destroy(library: Any, pointer: Any) -> None:
    library.fm_engine_destroy(pointer)
