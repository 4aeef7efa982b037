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
Requirements that were elaborated before, for a bundle that is read again after each key.

A requirement depends on its text and on all that is around the requirements' texts. While that is
the same, it is taken from here. Its sentence then has places in an earlier text.
"""

from dataclasses import replace
from itertools import pairwise
from typing import TypeAlias

from fret_monitor.bundle.bundle import Bundle, Requirement
from fret_monitor.logic.specification import Property

_Surroundings: TypeAlias = tuple[object, ...]
_MOST_KEPT = 3  # surroundings: a key may end a bundle's YAML, and the next one mend it


class RequirementMemory:
    """The requirements of the last versions of a bundle; of one thread at a time."""

    def __init__(self) -> None:
        """Start empty."""
        self._kept: dict[_Surroundings, dict[tuple[str, str], Property]] = {}
        self._known: dict[tuple[str, str], Property] = {}
        self._used: dict[tuple[str, str], Property] = {}

    def begin(self, bundle: Bundle) -> None:
        """Begin to read a version of the bundle."""
        around = _surroundings(bundle)
        self._known, self._used = self._kept.pop(around, {}), {}
        self._kept[around] = self._used
        while len(self._kept) > _MOST_KEPT:
            del self._kept[next(iter(self._kept))]

    def find(self, item: Requirement) -> Property | None:
        """Return a requirement with its new places, None if it is not known."""
        known = self._known.get((item.id.value, item.text.value))
        if known is not None:
            self._used[item.id.value, item.text.value] = known
            return replace(known, place=item.text.span, id_place=item.id.span)
        return None

    def keep(self, item: Requirement, found: Property) -> None:
        """Keep a requirement that depends on nothing else, and about which nothing was said."""
        self._used[item.id.value, item.text.value] = found


def _surroundings(bundle: Bundle) -> _Surroundings:
    """Return all that requirements depend on, beside their texts."""
    source, *others = bundle.sources
    spans = sorted((item.text.span.start, item.text.span.end) for item in bundle.requirements)
    parts = tuple(source.text[end:begin] for (_, end), (begin, _) in pairwise(
        [(0, 0), *spans, (len(source.text), len(source.text))]))
    return (parts, *((item.name, item.text) for item in others), bundle.policy, bundle.period,
            bundle.unit, bundle.cut, bundle.unreadable)
