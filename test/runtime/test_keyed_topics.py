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

"""Topics with an instance variable in their names, in a graph that changes."""

from typing import Any

from fret_monitor.native import evaluator_library, load_evaluator
from fret_monitor.native.binding import ffi
from fret_monitor.runtime.reporting import Lines
from fret_monitor.runtime.subscription import LOOK_AGAIN_S, Offer, SubscriptionState

FLOAT, BOOL = 'std_msgs/msg/Float32', 'std_msgs/msg/Bool'
PATTERN = '/{robot}/speed'
LATER = 10 ** 15  # a look may be due late after one that took long


class Graph:
    """Publishers by topic, as the middleware shows them; `topics` are names with their types."""

    def __init__(self, *patterns: str) -> None:
        self.topics: dict[str, list[str]] = {}
        self._kept: list[Any] = []
        self._library = load_evaluator(evaluator_library())
        self._lines = Lines(self._library)
        self._now = 0
        self.refused: set[str] = set()
        self.unpublished: set[str] = set()
        self.keys: list[bytes] = []  # that were found last
        self.is_silent = False
        functions = ffi.new('struct fm_graph_functions *', {
            'topic_names': self._keep(ffi.callback(
                'int(void const *, struct fm_allocator *, bool, struct fm_names_and_types *)',
                self._show)),
            'count_publishers': self._keep(ffi.callback(
                'int(void const *, char const *, size_t *)', self._count)),
            'free_topics': self._keep(ffi.callback(
                'int(struct fm_names_and_types *)', lambda _: 0)),
            'forget_error': self._keep(ffi.callback('void(void)', lambda: None))})
        texts = [tuple(self._keep(ffi.new('char[]', text.encode())) for text in (PATTERN, kind))
                 for kind in patterns]
        self._keep(functions)
        self._watch = self._library.fm_keyed_topics_create(
            functions, ffi.NULL, ffi.new('struct fm_keyed_pattern[]', [
                (number, *pair) for number, pair in enumerate(texts)]), len(texts))

    def _keep(self, made: Any) -> Any:
        self._kept.append(made)
        return made

    def _show(self, _: Any, __: Any, ___: Any, found: Any) -> int:
        found.names.size = len(self.topics)
        found.names.data = self._strings(self.topics)
        found.types = self._keep(ffi.new('struct fm_strings[]', len(self.topics) + 1))
        for place, types in enumerate(self.topics.values()):
            found.types[place].size = len(types)
            found.types[place].data = self._strings(types)
        return 0

    def _strings(self, texts: Any) -> Any:
        return self._keep(ffi.new('char *[]', [
            self._keep(ffi.new('char[]', text.encode())) for text in texts] or 1))

    def _count(self, _: Any, name: Any, count: Any) -> int:
        count[0] = not self.is_silent and _text(name) in {*self.topics} - self.unpublished
        return int(self.is_silent)

    def later(self, nanoseconds: int) -> int:
        """Let time pass, and return the present."""
        self._now += nanoseconds
        return self._now

    @property
    def due_in(self) -> int:
        """After which time something is to be done."""
        return int(self._library.fm_keyed_topics_next(self._watch)) - self._now

    def look(self, after: int = LATER) -> tuple[list[str], list[str]]:
        """Return the lines of a look at the graph, and the topics that it found."""
        self._library.fm_keyed_topics_review(
            self._watch, self.later(after), True, self._lines.pointer)
        found: Any = ffi.new('struct fm_keyed_topic *')
        names, self.keys = [], []
        while self._library.fm_keyed_topics_take(self._watch, self._now, found):
            names.append(_text(found.name))
            self.keys.append(bytes(ffi.buffer(found.key.bytes, found.key.size)))
            if names[-1] in self.refused:
                self._library.fm_keyed_topics_fail(self._watch, found, self._now)
        return [line.text for line in self._lines.take()], names

    def give_up(self, name: str) -> None:
        """Give up a topic of the first pattern that was found."""
        self._library.fm_keyed_topics_give_up(self._watch, 0, name.encode())


def _text(characters: Any) -> str:
    found: Any = ffi.string(characters)
    return str(found.decode())


def test_a_topic_that_fits_is_found_once_until_it_is_given_up() -> None:
    graph = Graph(FLOAT)
    assert graph.look() == ([], [])
    fitting = {f'/{key}/speed': [FLOAT] for key in ('b', 'a', 'long_key')}
    graph.topics = fitting | {name: [FLOAT] for name in (
        '/speed', '/a/b/speed', '/a/speed/x', '//speed', '/a/speeds')}
    lines, names = graph.look()
    assert (lines, sorted(names)) == ([], sorted(fitting))
    assert [f'/{key.decode()}/speed' for key in graph.keys] == names
    del graph.topics['/a/speed']  # the node has it, until it gives it up
    assert graph.look() == ([], [])
    graph.give_up('/a/speed')
    assert graph.look() == ([], [])
    graph.topics |= {'/a/speed': [FLOAT], '/c/speed': [FLOAT, BOOL]}
    assert graph.look() == ([], ['/a/speed', '/c/speed'])


def test_a_topic_without_a_publisher_is_found_when_it_has_one() -> None:
    graph = Graph(FLOAT)
    graph.topics, graph.unpublished = {'/a/speed': [FLOAT]}, {'/a/speed'}
    assert graph.look() == ([], [])
    graph.unpublished = set()
    assert graph.look() == ([], ['/a/speed'])


def test_a_topic_of_another_type_is_logged_once_also_if_it_returns() -> None:
    graph = Graph(FLOAT, FLOAT, BOOL)
    graph.topics = {'/crane/speed': ['std_msgs/msg/Int8']}
    lines, names = graph.look()
    assert lines == [
        f'/crane/speed is of type std_msgs/msg/Int8, where the bundle says {kind} of {PATTERN}: '
        'it is not received' for kind in (FLOAT, BOOL)]
    for topics in ({}, graph.topics, {}, graph.topics):
        graph.topics = topics
        assert graph.look() == ([], [])
    graph.topics = {'/crane/speed': [FLOAT], '/rover/speed': [BOOL]}
    lines, names = graph.look()
    assert names == ['/crane/speed', '/crane/speed', '/rover/speed']
    assert [line.split(':')[0] for line in lines] == [
        f'/rover/speed is of type {BOOL}, where the bundle says {FLOAT} of {PATTERN}']


def test_names_of_another_type_need_no_more_memory_than_so_many() -> None:
    graph = Graph(FLOAT)
    topics = {f'/r{number}/speed': [BOOL] for number in range(2000)}
    for expected in (2000, 1000, 1000):
        graph.topics = topics
        assert len(graph.look()[0]) == expected
        graph.topics = {}
        assert graph.look() == ([], [])


def test_a_topic_that_cannot_be_subscribed_to_is_found_again_later_and_later() -> None:
    graph = Graph(FLOAT)
    graph.topics, graph.refused = {'/a/speed': [FLOAT], '/b/speed': [FLOAT]}, {'/b/speed'}
    assert graph.look(0)[1] == ['/a/speed', '/b/speed']
    for wait in (1, 2, 4, 8, 16, 32, 60, 60):
        assert graph.due_in <= wait * 10**9
        assert graph.look(wait * 10**9 - 1)[1] == []
        assert graph.due_in == 1
        assert graph.look(1)[1] == ['/b/speed']
    graph.refused.clear()
    assert graph.look(60 * 10**9)[1] == ['/b/speed']
    assert graph.look()[1] == []


def test_a_question_that_the_middleware_did_not_answer_is_asked_again_at_once() -> None:
    graph = Graph(FLOAT)
    graph.topics, graph.is_silent = {'/a/speed': [FLOAT]}, True
    assert graph.look()[1] == []
    assert graph.due_in <= 10**9
    graph.is_silent = False
    assert graph.look(graph.due_in)[1] == ['/a/speed']


def test_a_subscription_to_a_topic_that_was_found_requests_what_is_offered() -> None:
    offer = Offer(b'1' * 16, 'robot', '/', FLOAT, is_reliable=True, is_durable=True)
    state = SubscriptionState(load_evaluator(evaluator_library()), '/a/speed', FLOAT, {})
    assert not state.request.is_reliable
    state.begin([offer], 10)
    assert (state.request.is_reliable, state.request.is_durable) == (True, True)
    assert state.decide([offer], 1, 20).request is None
    assert state.conclude(None, 0, 20) == []


def test_a_subscription_is_abandoned_when_it_has_had_no_publisher_for_long() -> None:
    offer = Offer(b'1' * 16, 'robot', '/', FLOAT, is_reliable=False, is_durable=False)
    state = SubscriptionState(load_evaluator(evaluator_library()), '/a/speed', FLOAT, {})
    lasts = int(LOOK_AGAIN_S * 1e9)
    state.begin([offer], 10)
    state.decide([], 0, 100 * lasts)  # it has just gone
    assert not state.is_abandoned(101 * lasts - 1)
    assert state.is_abandoned(101 * lasts)
    state.decide([offer], 0, 101 * lasts)
    assert not state.is_abandoned(200 * lasts)
