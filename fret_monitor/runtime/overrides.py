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
A wrapper of `csrc/reporting/overrides.h`: the parameters `qos_overrides`. Without ROS.

C checks them, says what is wrong or ignored, and applies them to what a bundle fixes.
"""

from collections.abc import Collection, Iterator, Mapping
from typing import Any, NamedTuple

from fret_monitor.model.policies import fixed_qos
from fret_monitor.native import words
from fret_monitor.native.binding import ffi
from fret_monitor.runtime.reporting import Lines, lines_of, LogLine

_POLICIES: int = ffi.integer_const('FM_POLICIES')
_MEMBERS = {type(None): ('FM_UNSET', ''), bool: ('FM_TRUTH', 'is_true'),
            int: ('FM_WHOLE', 'whole'), float: ('FM_REAL', 'real'), str: ('FM_WORD', 'word')}


def _texts_of(topics: Collection[str]) -> tuple[list[Any], int]:
    return [ffi.new('char[]', name.encode(errors='replace')) for name in topics], len(topics)


class ShownPolicy(NamedTuple):
    """A policy of a subscription, and the parameter that shows it."""

    policy: str
    value: str | int
    parameter: str
    description: str


class Overrides:
    """The overrides among the parameters that were given."""

    def __init__(self, library: Any, given: Mapping[str, object]) -> None:
        """Take the values of parameters by name; `library` has the functions of csrc."""
        self._library = library
        self._texts: list[Any] = []
        self._given = (ffi.new('struct fm_given[]', [
            self._given_of(*item) for item in given.items()]), len(given))

    def _text(self, text: str) -> Any:
        self._texts.append(ffi.new('char[]', text.encode(errors='replace')))
        return self._texts[-1]

    def _given_of(self, name: str, value: object) -> dict[str, Any]:
        kind, member = _MEMBERS.get(type(value), ('FM_LIST', ''))
        found: dict[str, Any] = {'name': self._text(name), 'type': ffi.integer_const(kind)}
        return found | ({member: self._text(value) if isinstance(value, str) else value}
                        if member else {})

    def problems(self, announced: Collection[str] = ()) -> list[LogLine]:
        """
        Return a line about each that cannot be used; `announced` are topics of violations.

        Raises MemoryError if one cannot be used, and memory is too short for its line.
        """
        lines = Lines(self._library)
        is_good = self._library.fm_check_overrides(
            lines.pointer, *self._given, *_texts_of(announced))
        found = lines.take()
        if not is_good and not found:
            raise MemoryError('too little memory for what is wrong with qos_overrides')
        return found

    def unused(self, subscribed: Collection[str]) -> list[LogLine]:
        """Return a line about each that no subscription uses; names of topics are full."""
        return lines_of(self._library, self._library.fm_add_unused_overrides, *self._given,
                        *_texts_of(subscribed))

    def apply(self, topic: str, fixed: Mapping[str, str | int]) -> dict[str, str | int]:
        """Return the policies of a subscription: those that are fixed, replaced by overrides."""
        return {item.policy: item.value for item in self.shown(topic, fixed)}

    def shown(self, topic: str, fixed: Mapping[str, str | int]) -> Iterator[ShownPolicy]:
        """Yield these policies as parameters."""
        *choices, depth = fixed_qos(fixed)
        qos = ffi.new('struct fm_fixed_qos *', [*map(ffi.integer_const, choices), depth])
        self._library.fm_apply_overrides(qos, *self._given, topic.encode())
        for place in range(_POLICIES):
            item = self._library.fm_show_policy(qos, place)
            texts: list[Any] = [ffi.string(text) for text in (item.name, item.word, item.note)]
            policy, word, note = (text.decode() for text in texts)
            yield ShownPolicy(
                policy, word or item.depth, words.OVERRIDES + words.OVERRIDE % (topic, policy),
                words.POLICY % (policy, topic, note))
