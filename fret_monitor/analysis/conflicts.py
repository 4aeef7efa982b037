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
Smallest sets of requirements that conflict (the algorithm MARCO).

A set is smallest if it conflicts and none of its parts does.
"""

from collections.abc import Callable, Iterator, Sequence

import z3

Conflicts = Callable[[frozenset[int]], bool]


def smallest_conflicts(items: Sequence[int], conflicts: Conflicts) -> Iterator[frozenset[int]]:
    """Yield all smallest sets for which `conflicts` is true; it is so for all supersets."""
    solver = z3.Solver()
    chosen = {item: z3.Bool(f'item.{item}') for item in items}
    while solver.check() == z3.sat:
        model = solver.model()
        seed = frozenset(item for item, name in chosen.items()
                         if not z3.is_false(model.eval(name)))
        if conflicts(seed):
            found = shrunk(seed, conflicts)
            yield found
            solver.add(z3.Or(*(z3.Not(chosen[item]) for item in found)))
        else:
            largest = _grown(seed, items, conflicts)
            solver.add(z3.Or(*(chosen[item] for item in items if item not in largest)))


def shrunk(found: frozenset[int], conflicts: Conflicts) -> frozenset[int]:
    """Remove items while the rest still conflicts: first halves, then single ones."""
    size = max(1, len(found) // 2)
    while True:
        order = sorted(found)
        for start in range(0, len(order), size):
            less = found - frozenset(order[start:start + size])
            if len(less) < len(found) and conflicts(less):
                found = less
        if size == 1:
            return found
        size //= 2


def _grown(found: frozenset[int], items: Sequence[int], conflicts: Conflicts) -> frozenset[int]:
    for item in items:
        if item not in found and not conflicts(found | {item}):
            found |= {item}
    return found
