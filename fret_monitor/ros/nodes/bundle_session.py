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
One bundle on a node: from its subscriptions through the engine to published violations.

The engine in C decodes the messages, steps, and waits for what is due without a message; C
publishes the violations. C also takes the messages, inside the middleware's callbacks where it
allows that (`hot_path`). Closing a session removes from the node all that it created.
"""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from functools import partial
from typing import Any, TYPE_CHECKING

from diagnostic_msgs.msg import DiagnosticArray
from fret_monitor.model.manifest import Manifest, ManifestInput, ManifestTopic
from fret_monitor.model.names import DETAILS_TOPIC, verdict_topic
from fret_monitor.native import LibraryError, words
from fret_monitor.ros.acting.actions import Actions
from fret_monitor.ros.intake.feed import Feed, Topic
from fret_monitor.ros.intake.fields import message_class, MessageTypeError
from fret_monitor.ros.intake.graph_sources import GraphSources, node_name
from fret_monitor.ros.intake.hot_path import (
    Announcer, EngineTopic, Middleware, VerdictThread, why_callbacks_wake,
)
from fret_monitor.ros.intake.node_time import NodeTime, PATIENCE_S
from fret_monitor.ros.intake.rcl_endpoint import RclPublisher
from fret_monitor.ros.intake.symbols import Unavailable
from fret_monitor.ros.log_lines import log_lines
from fret_monitor.ros.reports.details import DetailThread
from fret_monitor.ros.reports.health import Health
from fret_monitor.ros.settings.names import ends_of, full_name, one_type, refuse_merged_topics
from fret_monitor.ros.settings.opened import Opened
from fret_monitor.ros.settings.parameters import Refusal, Settings
from fret_monitor.ros.settings.qos import LAST, violation_profile
from fret_monitor.ros.watch import Watch
from fret_monitor.runtime import Engine, Evaluator
from fret_monitor.runtime.overrides import Overrides
from fret_monitor.runtime.reporting import (
    Reporter, ReportTable, StatusRecord, together, TopicFacts,
)
from fret_monitor.runtime.scopes import Scopes
from fret_monitor.runtime.start_lines import WatchedBundle

from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.utilities import get_rmw_implementation_identifier
from std_msgs.msg import Bool, Empty, Float64

if TYPE_CHECKING:
    from fret_monitor.ros.acting.blackbox import BlackBox
    from fret_monitor.ros.acting.gate import Gate


class BundleSession:
    """
    Monitors one bundle on a given node, from each `start` to the next `stop`.

    While it is stopped it keeps an engine and the publishers, but steps and publishes nothing.
    `close` releases everything. The node calls `report`; messages need no executor.
    """

    def __init__(self, node: Node, opened: Opened, watch: Watch, settings: Settings,
                 overrides: Overrides, name: str = '', *, reports_failures: bool = True) -> None:
        """
        Prepare to monitor; `watch` is told of threads and timers that fail.

        `name` is the bundle's name in diagnostics, empty if the node has only one bundle;
        `reports_failures`: its diagnostics have what `watch` knows. Raises `Refusal` if the bundle
        cannot be monitored on this node. Nothing is left on the node.
        """
        self.opened = opened
        self._node = node
        self._watch = watch
        self._settings = settings
        self._overrides = overrides
        self._name = name
        self._reports_failures = reports_failures
        self._advertised = ExitStack()
        self._running = ExitStack()
        self._feed: Feed | None = None
        self._announcer: Announcer | None = None
        self._gate: Gate | None = None
        self._detail_thread: DetailThread | None = None
        self._health: Health | None = None
        refuse_inputs_off_ros(self.manifest)
        self._classes = _message_classes(self.manifest)
        self._table = ReportTable(
            self.manifest, name, policy=opened.policy, period=opened.period)
        self._engine = self._new_engine()
        self._blackbox = self._new_blackbox()
        with ExitStack() as undo:
            undo.callback(self.close)
            try:
                refuse_merged_topics(self._node, self.manifest, self._table, self.library)
                self._advertise()
            except InvalidTopicNameException as error:  # from the namespace or a remapping
                raise Refusal(f'{words.NO_ENDPOINT}: {error}') from None
            undo.pop_all()

    @property
    def manifest(self) -> Manifest:
        return self.opened.monitor.manifest

    @property
    def library(self) -> Any:
        """The functions of csrc."""
        return self._engine.library

    @property
    def _judged_index(self) -> int | None:
        """The topic that the gate takes: one of the manifest, or the one after them."""
        gate = self.manifest.gate
        if gate is None:
            return None
        return len(self.manifest.topics) if gate.topic is None else gate.topic

    # What few bundles have is imported only then: each start is shorter without it.

    def _new_blackbox(self) -> 'BlackBox | None':
        if self._settings.blackbox is None:
            return None
        from fret_monitor.ros.acting.blackbox import BlackBox
        return BlackBox(self._node, self.manifest, self._settings.blackbox, self.library)

    def _new_engine(self) -> Engine:
        scopes, evaluator = self._new_scopes()
        engine = Engine(evaluator, scopes=scopes, full_name=partial(node_name, self._node))
        if self.manifest.gate is not None:
            from fret_monitor.ros.acting.gate import gate_of
            engine.guard(gate_of(evaluator, self.manifest.gate, self._table))
        return engine

    def _new_scopes(self) -> tuple[Scopes | None, Evaluator]:
        opened = self.opened
        if not self.manifest.variables:
            return None, Evaluator(
                opened.monitor, policy=opened.policy, period=opened.period, patience=PATIENCE_S,
                reports_recoveries=True, library=opened.evaluator)
        try:
            scopes = Scopes(
                opened.monitor, policy=opened.policy, period=opened.period, patience=PATIENCE_S,
                library=opened.evaluator, is_of_engine=True)
        except LibraryError as error:  # `most` is more than there is memory for
            raise Refusal(str(error)) from None
        return scopes, scopes.evaluator()

    def _advertise(self) -> None:
        settings, manifest, depth = self._settings, self.manifest, self._settings.handler_depth
        self._handlers = self._owned(handlers_of(self._node, manifest, depth))
        self._margins = self._owned(
            RclPublisher(self._node, Float64, topic, LAST)
            for topic in (manifest.margin_topics if settings.margins else ()))
        self._details, = self._owned([RclPublisher(
            self._node, DiagnosticArray, DETAILS_TOPIC, violation_profile(depth))])
        self._actions = Actions(self._node, manifest, self._table, self.library)
        self._advertised.callback(self._actions.close)
        self._verdicts: list[RclPublisher] = []
        if settings.publishes_verdicts:
            self._verdicts = self._owned(verdict_publishers(self._node, manifest))

    def _owned(self, publishers: Iterable[RclPublisher]) -> list[RclPublisher]:
        """Return publishers that are closed with this session, also if another cannot be made."""
        found = []
        for publisher in publishers:
            self._advertised.callback(publisher.close)
            found.append(publisher)
        return found

    def start(self) -> None:
        """
        Start monitoring: from now on messages and periods step the monitor.

        Raises `Refusal` if the node cannot subscribe. Nothing is left running then.
        """
        with ExitStack() as undo:
            undo.callback(self.stop)
            try:
                middleware = self._connect()
            except InvalidTopicNameException as error:
                raise Refusal(f'cannot subscribe: {error}') from None
            self._health = Health(
                self._node, middleware, self.reporter, self._actions, self._gate, self._blackbox,
                self._watch if self._reports_failures else None)
            self._running.callback(self._health.close)
            self._running.callback(setattr, self, '_health', None)
            undo.pop_all()

    def stop(self) -> None:
        """
        Stop monitoring; the next start has a new engine, without past and without values.

        The old values may be outdated by then, and the messages sent in between are missing.
        """
        self._running.close()
        self._engine = self._new_engine()

    def close(self) -> None:
        """Stop monitoring, and remove everything from the node; a second call does nothing."""
        self._running.close()
        self._advertised.close()

    def turns(self) -> tuple[int, ...]:
        """Return a counter of each thread; each grows within a second unless its thread hangs."""
        threads = (self._announcer, self._feed, self._detail_thread, self._gate, self._actions)
        turns = [None if thread is None else thread.turns for thread in threads]
        return tuple(item for item in turns if item is not None)

    @property
    def watched(self) -> WatchedBundle:
        """What the log says at the start."""
        gate = self.manifest.gate
        return WatchedBundle(self.reporter, self.opened.origin,
                             ('', '') if gate is None else ends_of(self._node, gate),
                             *self._actions.names())

    def reset(self) -> int:
        """Reset all step groups between two steps; return how many there are, of one instance."""
        self._engine.reset()
        return len(self.manifest.groups) + sum(
            len(kind.manifest.groups) for kind in self.manifest.kinds)

    # Publishers and subscriptions are closed in reverse order of creation, so the threads that
    # publish outlive the subscriptions. Ending such a thread closes the engine before it waits
    # for the thread, so that an interrupted `stop` leaves no thread waiting.

    def _connect(self) -> Middleware:
        try:
            middleware = self._middleware()
            self._connect_through(middleware)
        except Unavailable as found:
            raise Refusal(f'cannot use the middleware: {found}') from None
        return middleware

    def _middleware(self) -> Middleware:
        """Return the middleware; on the hot path it reads in place if possible."""
        reason = why_callbacks_wake(self._settings.hot_path, self._engine.library)
        if reason is not None:
            self._way = words.WAKES + reason
            return Middleware(may_take=False)
        middleware, copied = Middleware(), ('', '')
        try:
            middleware.read_in_place(self._engine.library)
        except Unavailable as found:
            copied = words.ALL_COPIED, str(found)
        self._way = words.TAKES % (get_rmw_implementation_identifier(), *copied)
        return middleware

    def _connect_through(self, middleware: Middleware) -> None:
        engine = self._engine
        time = NodeTime(self._node, engine, middleware.clock_now)
        self._running.callback(time.close)
        if self._blackbox is not None:
            self._running.callback(self._stop_blackbox, self._blackbox)
            self._blackbox.start(engine)
        self._actions.prepare(engine)
        announcer = Announcer(
            engine, middleware, self._handlers, self._table, self._actions.locks, self._margins)
        self._running.callback(announcer.close)
        if self._verdicts:
            verdicts = VerdictThread(engine, middleware, self._verdicts)
            self._running.callback(verdicts.close)
        self._running.callback(
            lambda: log_lines(self._node.get_logger(), self._actions.stop()))
        self._actions.start(engine, middleware)
        self.reporter = Reporter(
            engine, self._table, self._node.get_fully_qualified_name(),
            [full_name(self._node, self.manifest, item) for item in self.manifest.topics])
        details = DetailThread(self.reporter, middleware, self._details, self._node.get_logger(),
                               logs_violations=self._settings.log_violations)
        self._running.callback(details.close)
        gate = self._open_gate(engine, middleware)
        graph = None
        if self.manifest.watched:
            graph = GraphSources(self._node, engine, middleware)
            self._running.callback(graph.close)
        feed = Feed(self._node)
        self._running.callback(feed.close)
        judged = None if gate is None else gate.topic
        for index, topic in enumerate((*self.manifest.topics, *self.manifest.judged)):
            if topic.made or self.manifest.key_of(topic) is not None:
                continue
            if index != self._judged_index:
                self._subscribe(feed, topic, EngineTopic(engine, middleware, index),
                                in_place=middleware)
            elif judged is not None:
                self._subscribe(feed, topic, judged)
        if graph is not None:
            feed.watch(graph)
        if self.manifest.variables:
            self._follow_keys(feed, engine, middleware)
        feed.start()
        self._feed, self._gate = feed, gate
        engine.begin()  # after the subscriptions, so that no timeout runs while they are made
        # Logged after the start, since rclpy needs 0.1 s for its first log line.
        self._node.get_logger().info(self._way, once=True)
        self._announcer, self._detail_thread = announcer, details

    def _follow_keys(self, feed: Feed, engine: Engine, middleware: Middleware) -> None:
        """Subscribe to the topics with listed keys in their names, and look for the others."""
        from fret_monitor.ros.intake.keyed_topics import found_topics, KeyedTopics, listed_topics
        for index, names in listed_topics(self.manifest).items():
            handovers: set[EngineTopic] = set()
            for key, name in names.items():
                self._subscribe(feed, self.manifest.topics[index], EngineTopic(
                    engine, middleware, index, key.encode(), handovers), name, middleware)
        if found_topics(self.manifest):
            feed.watch(KeyedTopics(self._node, engine, middleware, feed, partial(
                self._subscribe, feed, in_place=middleware, is_found=True)))

    def _stop_blackbox(self, blackbox: 'BlackBox') -> None:
        blackbox.end()
        log_lines(self._node.get_logger(), blackbox.lines())

    def _open_gate(self, engine: Engine, middleware: Middleware) -> 'Gate | None':
        if self.manifest.gate is None:
            return None
        from fret_monitor.ros.acting.gate import open_gate
        gate = open_gate(self._node, engine, self.manifest.gate, middleware, self._classes)
        self._running.callback(gate.close)
        return gate

    def _subscribe(self, feed: Feed, mapped: ManifestTopic, topic: Topic, name: str | None = None,
                   in_place: Middleware | None = None, *, is_found: bool = False) -> None:
        """
        Subscribe to a topic; read it in place if the middleware is given and does so.

        `name`: with the key, of one with a variable in its name; `is_found`: in the graph.
        """
        kind, name = self._classes[mapped.message_type], name or mapped.name
        try:
            kind = kind if in_place is None else in_place.class_in_place(kind)
        except Unavailable as reason:
            self._node.get_logger().info(
                f'{words.COPIED % self._node.resolve_topic_name(name)}{reason}')
        feed.subscribe(
            self._engine.library, name, mapped.message_type, kind, topic,
            dict(mapped.qos) if name != mapped.name else
            self._overrides.apply(self._node.resolve_topic_name(name), dict(mapped.qos)),
            is_found=is_found)

    # Reports.

    def _publishers(self) -> Sequence[TopicFacts]:
        if self._feed is None:
            return ()
        count, gate = len(self.manifest.topics), self.manifest.gate
        found: list[list[TopicFacts]] = [[] for _ in range(count + 1)]
        for topic, facts in self._feed.publishers():
            assert isinstance(topic, EngineTopic)
            found[topic.index].append(facts)
        if gate is not None and gate.is_service and gate.topic is not None:
            found[gate.topic].append(TopicFacts(1))  # requests come from this node
        return [together(facts) for facts in found[:count]]

    def report(self) -> None:
        """Log what is new, and publish the state; to be called every `health.PERIOD`."""
        health = self._health
        if health is None:  # stopped meanwhile
            return
        threads = {'feed': self._feed, 'details': self._detail_thread}
        for name, thread in threads.items():
            self._watch.note(self._part(name), None if thread is None else thread.failure)
        for name, act in (('log', lambda: health.review(self._publishers())),
                          ('diagnostics', health.publish)):
            self._watch.run(self._part(name), act, lambda: self._health is not health)

    def statuses(self) -> list[StatusRecord]:
        """Return the state at the last `report`."""
        health = self._health
        return [] if health is None else health.statuses()

    def _part(self, name: str) -> str:
        return f'{name} of {self._name}' if self._name else name


def handlers_of(node: Node, manifest: Manifest, depth: int) -> Iterator[RclPublisher]:
    """Advertise the topics that announce violations: yield a publisher for each requirement."""
    for item in manifest.numbered:
        yield RclPublisher(node, Empty, item.topic, violation_profile(depth))


def verdict_publishers(node: Node, manifest: Manifest) -> Iterator[RclPublisher]:
    """Advertise the topics of verdicts; raises `Refusal` if the process uses one otherwise."""
    for item in manifest.numbered:
        topic = verdict_topic(item.handler)
        with one_type(node, 'publish on', topic, 'std_msgs/msg/Bool'):
            publisher = RclPublisher(node, Bool, topic, LAST)
        yield publisher


def refuse_inputs_off_ros(manifest: Manifest) -> None:
    """
    Refuse inputs that requirements read and no topic feeds.

    Raises `Refusal` if there are any; the message has the lines to add to the bundle.
    """
    lines = [line for index in sorted(manifest.read)
             for line in _lines_wanted(manifest.inputs[index])]
    if lines:
        raise Refusal('these inputs have no ROS 2 topic to read; '
                      'say in the bundle where they come from:\n\n  inputs:\n' + '\n'.join(lines))


def _lines_wanted(item: ManifestInput) -> list[str]:
    if item.topic is not None and item.message_type is not None:
        return []
    plain = 'string' if item.is_string else item.value_type.value
    standard = plain.capitalize() if not plain.startswith('uint') else f'UInt{plain[4:]}'
    return [f'    {item.name}:',
            f'      topic: {item.topic or item.name}',
            f'      type: {item.message_type or f"std_msgs/msg/{standard}"}']


def _message_classes(manifest: Manifest) -> dict[str, Any]:
    gated = {manifest.gate.interface} if manifest.gate is not None else set()
    received = {topic.message_type for topic in manifest.received}
    classes, problems = {}, []
    for message_type in sorted(received | gated):
        try:
            classes[message_type] = message_class(message_type)
        except MessageTypeError as error:
            problems.append(str(error))
    if problems:
        raise Refusal(*problems, heading='')
    return classes
