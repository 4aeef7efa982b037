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

"""Graphs of names that depend on other names: dependency order and cycles."""

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence


def components(graph: Mapping[str, Sequence[str]]) -> list[list[str]]:
    """
    Return the strongly connected components, each after all components that it depends on.

    `graph` maps each name to the names it depends on, all of them keys. The algorithm is
    Tarjan's (1972), with an explicit stack, because chains of definitions can exceed Python's
    recursion limit.
    """
    found: list[list[str]] = []
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    open_names: dict[str, None] = {}
    for root in graph:
        if root in index:
            continue
        walk: list[tuple[str, Iterator[str]]] = [(root, iter(graph[root]))]
        index[root] = low[root] = len(index)
        open_names[root] = None
        while walk:
            name, rest = walk[-1]
            after = next(rest, None)
            if after is None:
                walk.pop()
                if walk:
                    low[walk[-1][0]] = min(low[walk[-1][0]], low[name])
                if low[name] == index[name]:
                    found.append(_closed(name, open_names))
            elif after not in index:
                index[after] = low[after] = len(index)
                open_names[after] = None
                walk.append((after, iter(graph[after])))
            elif after in open_names:
                low[name] = min(low[name], index[after])
    return found


def _closed(name: str, open_names: dict[str, None]) -> list[str]:
    component: list[str] = []
    while not component or component[-1] != name:
        component.append(open_names.popitem()[0])
    return component[::-1]


def is_cyclic(component: Sequence[str], graph: Mapping[str, Sequence[str]]) -> bool:
    """Whether the names of a component depend on themselves."""
    return len(component) > 1 or component[0] in graph[component[0]]


def cycle(component: Sequence[str], graph: Mapping[str, Sequence[str]]) -> list[str]:
    """Return a shortest cycle from a component's first name to itself, both ends included."""
    start = component[0]
    inside = set(component)
    ways = [[start]]
    seen: set[str] = set()
    for way in ways:
        for after in graph[way[-1]]:
            if after == start:
                return [*way, start]
            if after in inside and after not in seen:
                seen.add(after)
                ways.append([*way, after])
    raise AssertionError(f'{start} is on no cycle')


def cycles(edges: Iterable[tuple[str, str]]) -> Iterator[list[str]]:
    """Yield a shortest cycle, as `cycle`, of each part of a graph that has one."""
    graph: dict[str, list[str]] = {}
    for source, target in edges:
        graph.setdefault(source, []).append(target)
        graph.setdefault(target, [])
    for component in components(graph):
        if is_cyclic(component, graph):
            yield cycle(component, graph)


class DisjointSets[T: Hashable]:
    """Sets that are joined two by two; each item is in a set of its own at first (union-find)."""

    def __init__(self) -> None:
        self._parents: dict[T, T] = {}
        self._sizes: dict[T, int] = {}

    def root(self, item: T) -> T:
        """Return the item that stands for the set of an item."""
        parents = self._parents
        if item not in parents:
            parents[item], self._sizes[item] = item, 1
        while (parent := parents[item]) != item:
            parents[item] = parents[parent]
            item = parent
        return item

    def join(self, one: T, other: T) -> T:
        """Join the sets of two items; return the item that stands for both."""
        root, joined = self.root(one), self.root(other)
        if root != joined:
            if self._sizes[root] < self._sizes[joined]:
                root, joined = joined, root
            self._parents[joined] = root
            self._sizes[root] += self._sizes[joined]
        return root


def sharing[T](items: Sequence[T], keys: Callable[[T], Iterable[Hashable]]) -> list[list[T]]:
    """
    Return the items in groups: those that share keys, directly or through others.

    Groups come in the order of their first items.
    """
    sets: DisjointSets[tuple[str, Hashable]] = DisjointSets()
    for place, item in enumerate(items):
        for key in keys(item):
            sets.join(('item', place), ('key', key))
    groups: dict[Hashable, list[T]] = {}
    for place, item in enumerate(items):
        groups.setdefault(sets.root(('item', place)), []).append(item)
    return list(groups.values())
