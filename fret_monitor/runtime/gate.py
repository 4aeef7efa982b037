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
A thin typed wrapper of a gate in C, which decides which messages of a topic pass.

`gate.h` describes it. Times are in nanoseconds.
"""

from collections.abc import Sequence
from enum import Enum
from typing import Any

from fret_monitor.model.frozen import frozen
from fret_monitor.model.manifest import ManifestGate
from fret_monitor.model.report_table import OTHERWISE
from fret_monitor.model.values import ValueType
from fret_monitor.native.binding import ffi
from fret_monitor.native.errors import LibraryError
from fret_monitor.runtime.evaluator import ALIGNMENT, Evaluator, Violation, violation


class Judgement(Enum):
    """
    The result of judging a message; values of `enum fm_judgement`.

    A duplicate was judged before, from another subscription; only an engine finds these.
    """

    PASSED = 0
    VIOLATES = 1
    CLOSED = 2
    LATCHED = 3
    UNREADABLE = 4
    DUPLICATE = 5


@frozen
class GateCounts:
    """
    The state and the counters of a gate.

    Messages that `passed`, and that were withheld: a requirement `violates`, the gate was `closed`
    or `latched`, or the message `unreadable`. `replaced` counts the replacements that were sent,
    and `violating` those of them after which a requirement did not hold.
    """

    passed: int
    violates: int
    closed: int
    latched: int
    unreadable: int
    replaced: int
    violating: int
    is_known: bool
    is_latched: bool
    holds: bool


class MessageGate:
    """
    Judges the messages of one topic of an evaluator.

    Not thread-safe; where the evaluator belongs to an engine, only the engine calls it.
    """

    def __init__(self, evaluator: Evaluator, rules: ManifestGate) -> None:
        """
        Make a gate for an evaluator that got no message yet.

        Raises
        ------
        LibraryError
            if the rules do not fit the evaluator.
        """
        self.evaluator = evaluator
        self.rules = rules
        self._library: Any = evaluator.library
        options = evaluator.options
        self.options = ffi.new('struct fm_gate_options *', {
            'evaluator': evaluator.pointer,
            'monitor': evaluator.monitor.pointer,
            'topics': options.topics,
            'n_topics': options.n_topics,
            'from': options.n_topics if rules.topic is None else rules.topic,
            'otherwise': ffi.integer_const(OTHERWISE[rules.otherwise]),
            'hold': rules.hold,
            'period': rules.period,
            'passes_silent': rules.is_open_when_stale,
            'latches': rules.latches,
            'open_after': rules.open_after,
        })
        size = self._library.fm_gate_bytes(self.options)
        self._block = ffi.new('char[]', size + ALIGNMENT)
        memory = self._block + -int(ffi.cast('uintptr_t', self._block)) % ALIGNMENT
        self.pointer: Any = self._library.fm_gate_init(memory, self.options)
        if self.pointer == ffi.NULL:
            raise LibraryError('the evaluator refuses the rules of the gate')
        manifest = evaluator.monitor.manifest
        fed = () if rules.topic is None else manifest.topics[rules.topic].inputs
        self._types = [manifest.inputs[index].value_type for index in fed]
        self._fields = ffi.new('struct fm_field[]', len(self._types) + 1)
        self._found = ffi.new('struct fm_violation[]', len(manifest.requirements) + 1)
        self._count = ffi.new('uint32_t *')

    def judge(self, values: Sequence[bool | int | float | None] | None, now: int,
              steady: int | None = None) -> tuple[Judgement, list[Violation]]:
        """
        Judge a message of the topic; what was due before it was taken.

        Parameters
        ----------
        values
            its fields, in the order of the topic's inputs; None: a field that cannot be used, or
            for all of them a message that cannot be decoded.
        now
            when it takes effect, by the time of the evaluator.
        steady
            the same by the steady clock; None: `now`.

        Returns
        -------
        tuple[Judgement, list[Violation]]
            whether it passes, and what is to be announced.
        """
        judgement = self._library.fm_gate_judge(
            self.pointer, ffi.NULL if values is None else self._set(values), now, now,
            now if steady is None else steady, self._found, self._count)
        self._library.fm_gate_finish(self.pointer)
        return Judgement(judgement), self._violations()

    def replace(self, values: Sequence[bool | int | float | None], now: int,
                steady: int | None = None) -> tuple[bool, list[Violation]]:
        """Take the step of a replacement that is due; return whether it is sent. As `judge`."""
        is_sent = self._library.fm_gate_replace(
            self.pointer, self._set(values), now, now, now if steady is None else steady,
            self._found, self._count)
        return bool(is_sent), self._violations()

    def note(self, found: Sequence[Violation], steady: int) -> tuple[bool, list[Violation]]:
        """
        Note a step of another topic, or of what was due.

        Return whether `due` has changed, and what of the step's findings is to be announced.
        """
        for place, item in enumerate(found):
            self._found[place] = {
                'step': item.step, 'stamp': item.stamp, 'requirement': item.requirement,
                'is_recovery': item.is_recovery}
        self._count[0] = len(found)
        is_due = self._library.fm_gate_note(self.pointer, self._found, self._count, steady)
        return bool(is_due), self._violations()

    @property
    def due(self) -> int:
        """When a replacement is due by the steady clock; `NEVER`: none is."""
        return int(self._library.fm_gate_due(self.pointer))

    def reset(self) -> None:
        """Open the latch."""
        self._library.fm_gate_reset(self.pointer)

    def counts(self, steady: int) -> GateCounts:
        """Return the counters, and the state at a time of the steady clock."""
        return gate_counts(self._library.fm_gate_counts(self.pointer, steady))

    def _set(self, values: Sequence[bool | int | float | None]) -> Any:
        for field, kind, value in zip(self._fields[0:len(values)], self._types, values,
                                      strict=True):
            field.outcome = ffi.integer_const(
                'FM_FIELD_EMPTY' if value is None else 'FM_FIELD_READ')
            if value is not None:
                setattr(field.value, _member(kind), value)
        return self._fields

    def _violations(self) -> list[Violation]:
        return [violation(item) for item in self._found[0:self._count[0]]]


def gate_counts(found: Any) -> GateCounts:
    """Return a `struct fm_gate_counts`."""
    return GateCounts(
        found.passed, found.violates, found.closed, found.latched, found.unreadable,
        found.replaced, found.violating, bool(found.is_known), bool(found.is_latched),
        bool(found.holds))


def _member(kind: ValueType) -> str:
    if kind.is_float:
        return 'f'
    return 'u' if kind.name.startswith('U') else 'i'
