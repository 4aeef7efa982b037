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

"""Topics with an instance variable in their names, found in a graph that is made up."""

from collections.abc import Iterator
from typing import Any

from fret_monitor.native import evaluator_library, load_evaluator
from fret_monitor.native.binding import ffi
from fret_monitor.runtime.reporting import Lines
from fret_monitor.runtime.subscription import LOOK_AGAIN_S, Offer, SubscriptionState
import pytest

SPEED, OTHER = 'std_msgs/msg/Float32', 'std_msgs/msg/Bool'
PERIOD = 2 * 10**9  # ns: longer than a look may rest


class Graph:
    """A graph of ROS: the types of topics, and how many publishers they have."""

    def __init__(self) -> None:
        self.topics: dict[str, tuple[str, ...]] = {}
        self.unpublished: set[str] = set()
        self._kept: list[Any] = []
        self.functions: Any = ffi.new('struct fm_graph_functions *')
        for name, act in (('topic_names', self._names), ('free_topics', self._free),
                          ('count_publishers', self._count)):
            self._kept.append(ffi.callback(ffi.typeof(getattr(self.functions, name)), act))
            setattr(self.functions, name, self._kept[-1])

    def _names(self, _: Any, __: Any, ___: Any, found: Any) -> int:
        found.names = self._strings(list(self.topics))
        types = ffi.new('struct fm_strings[]', [
            self._strings(list(names)) for names in self.topics.values()] or 1)
        self._kept.append(types)
        found.types = types
        return 0

    def _strings(self, texts: list[str]) -> dict[str, Any]:
        kept = [ffi.new('char[]', text.encode()) for text in texts]
        data = ffi.new('char *[]', [*kept, ffi.NULL])
        self._kept += [kept, data]
        return {'size': len(texts), 'data': data}

    def _count(self, _: Any, name: Any, count: Any) -> int:
        text: Any = ffi.string(name)
        count[0] = text.decode() not in self.unpublished
        return 0

    def _free(self, _: Any) -> int:
        return 0


class Watch:
    """A watch of `/{robot}/speed`, as topic 3."""

    def __init__(self, graph: Graph, library: Any) -> None:
        self._graph, self._library, self._now = graph, library, 0
        self._texts = [ffi.new('char[]', text.encode()) for text in ('/{robot}/speed', SPEED)]
        self._lines = Lines(library)
        self._pointer: Any = ffi.gc(library.fm_keyed_topics_create(
            graph.functions, ffi.NULL,
            ffi.new('struct fm_keyed_pattern[]', [(3, *self._texts)]), 1),
            library.fm_keyed_topics_destroy)

    def look(self) -> tuple[list[tuple[str, str]], list[str]]:
        """Return what is found anew, names with keys, and the lines of the log."""
        self._now += PERIOD
        self._library.fm_keyed_topics_review(
            self._pointer, self._now, True, self._lines.pointer)
        return [*self._found()], [line.text for line in self._lines.take()]

    def _found(self) -> Iterator[tuple[str, str]]:
        found: Any = ffi.new('struct fm_keyed_topic *')
        while self._library.fm_keyed_topics_take(self._pointer, found):
            assert found.topic == 3
            name: Any = ffi.string(found.name)
            yield name.decode(), bytes(ffi.buffer(found.key.bytes, found.key.size)).decode()

    def give_up(self, name: str) -> None:
        self._library.fm_keyed_topics_give_up(self._pointer, 3, name.encode())


@pytest.fixture
def library() -> Any:
    return load_evaluator(evaluator_library())


def test_a_topic_that_fits_is_found_once_until_it_is_given_up(library: Any) -> None:
    graph = Graph()
    watch = Watch(graph, library)
    assert watch.look() == ([], [])
    graph.topics = {f'/{key}/speed': (SPEED,) for key in ('b', 'a', 'long_key')}
    graph.topics |= {'/speed': (SPEED,), '/a/b/speed': (SPEED,), '/a/speed/x': (SPEED,),
                     '//speed': (SPEED,), '/a/speeds': (SPEED,)}
    found, lines = watch.look()
    assert sorted(found) == [(f'/{key}/speed', key) for key in ('a', 'b', 'long_key')]
    assert lines == []
    del graph.topics['/a/speed']  # the node has it, until it gives it up
    assert watch.look() == ([], [])
    watch.give_up('/a/speed')
    assert watch.look() == ([], [])
    graph.topics['/a/speed'] = (SPEED,)
    graph.topics['/c/speed'] = (SPEED, OTHER)
    assert watch.look() == ([('/a/speed', 'a'), ('/c/speed', 'c')], [])


def test_a_topic_of_another_type_is_logged_once_while_it_is_there(library: Any) -> None:
    graph = Graph()
    watch = Watch(graph, library)
    graph.topics = {'/crane/speed': (OTHER,), '/crane/load': (OTHER,)}
    line = f'/crane/speed is of type {OTHER}, where the bundle says {SPEED} of /{{robot}}/speed: '
    assert watch.look() == ([], [f'{line}it is not received'])
    assert watch.look() == ([], [])
    del graph.topics['/crane/speed']
    assert watch.look() == ([], [])
    graph.topics['/crane/speed'] = (OTHER,)
    assert len(watch.look()[1]) == 1
    graph.topics['/crane/speed'] = (OTHER, SPEED)
    assert watch.look() == ([('/crane/speed', 'crane')], [])


def test_a_topic_without_a_publisher_is_found_when_it_has_one(library: Any) -> None:
    graph = Graph()
    watch = Watch(graph, library)
    graph.topics, graph.unpublished = {'/a/speed': (SPEED,)}, {'/a/speed'}
    assert watch.look() == ([], [])
    graph.unpublished = set()
    assert watch.look() == ([('/a/speed', 'a')], [])


def test_a_subscription_to_a_topic_that_was_found_requests_what_is_offered(library: Any) -> None:
    offer = Offer(b'1' * 16, 'robot', '/', SPEED, is_reliable=True, is_durable=True)
    state = SubscriptionState(library, '/a/speed', SPEED, {})
    assert not state.request.is_reliable
    state.begin([offer], 10)
    assert (state.request.is_reliable, state.request.is_durable) == (True, True)
    assert state.decide([offer], 1, 20).request is None
    assert state.conclude(None, 0, 20) == []


def test_a_subscription_is_abandoned_when_it_has_had_no_publisher_for_long(library: Any) -> None:
    offer = Offer(b'1' * 16, 'robot', '/', SPEED, is_reliable=False, is_durable=False)
    state = SubscriptionState(library, '/a/speed', SPEED, {})
    lasts = int(LOOK_AGAIN_S * 1e9)
    state.begin([offer], 10)
    state.decide([], 0, 100 * lasts)  # it has just gone
    assert not state.is_abandoned(101 * lasts - 1)
    assert state.is_abandoned(101 * lasts)
    state.decide([offer], 0, 101 * lasts)
    assert not state.is_abandoned(200 * lasts)
