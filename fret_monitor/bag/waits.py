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

"""The ids of the requirements that are violated while a response with a deadline is waited for."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

_MARK = '#'  # between the parts of an id


@dataclass(frozen=True)
class Lanes:
    """
    The ids of two requirements beside one with a deadline, `bound` steps or ns after its trigger.

    `waits` is violated from a trigger until its response, or until the end of the scope;
    `at_once` from the first trigger on that came together with its response.
    """

    id: str
    bound: int

    @property
    def waits(self) -> str:
        """The id of the first one."""
        return _MARK.join(('waits', str(self.bound), self.id))

    @property
    def at_once(self) -> str:
        """The id of the other one."""
        return _MARK.join(('at_once', str(self.bound), self.id))


def lanes_of(ids: Iterable[str]) -> Iterator[Lanes]:
    """Yield those of which there are ids."""
    for item in ids:
        kind, _, rest = item.partition(_MARK)
        bound, _, name = rest.partition(_MARK)
        if kind == 'waits':
            yield Lanes(name, int(bound))
