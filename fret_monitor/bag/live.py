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
The topics of the running graph, and a recording of them in a file, for `new --live`.

The recording is surveyed as any other, so that what is offered is what `new --bag` would offer.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from time import monotonic, time_ns
from typing import Any, TYPE_CHECKING

from fret_monitor.bag.first_bundle import fields_of, left_out, SeenTopic, warn_without_numbers
from fret_monitor.messages.installed import complete_definition, find_message
from fret_monitor.model.diagnostics import CompileError, Problems, refuse
from fret_monitor.model.progress import Progress
from fret_monitor.runtime.mcap import McapWriter

if TYPE_CHECKING:
    from rclpy.executors import Executor
    from rclpy.node import Node

_OWN = ('/rosout', '/parameter_events')  # every node publishes them
_UNCHANGED_S = 1.0
_LONGEST_WAIT_S = 10.0
_STEP_S = 0.1
_QUEUE = 1000


class LiveGraph:
    """A node that looks at the graph and records from it."""

    def __init__(self, node: 'Node', executor: 'Executor') -> None:
        """Look through a node, which the executor runs."""
        self._node = node
        self._executor = executor

    def topics(self, wanted: Sequence[str], problems: Problems) -> list[SeenTopic]:
        """
        Return the published topics, by name; warn of those that are left out.

        Waits until all those in `wanted` are published, or, without any, until the graph has not
        changed for a second; at most ten seconds.
        """
        found = self._discovered(wanted)
        topics = [self._seen(name, types, problems) for name, types in sorted(found.items())]
        warn_without_numbers(topics, problems, wanted)
        return topics

    def _discovered(self, wanted: Sequence[str]) -> dict[str, list[str]]:
        found: dict[str, list[str]] = {}
        begin = changed = monotonic()
        while monotonic() - begin < _LONGEST_WAIT_S:
            self._executor.spin_once(timeout_sec=_STEP_S)
            now = {name: types for name, types in self._node.get_topic_names_and_types()
                   if name not in _OWN and self._node.count_publishers(name)}
            if now != found:
                found, changed = now, monotonic()
            is_there = wanted and all(name in found for name in wanted)
            if is_there or not wanted and found and monotonic() - changed > _UNCHANGED_S:
                break
        return found

    def _seen(self, name: str, types: list[str], problems: Problems) -> SeenTopic:
        try:
            if len(types) > 1:
                refuse(f'the topic {name} has several types: {", ".join(types)}')
            _message_class(types[0])
            return SeenTopic(name, types[0], *fields_of(find_message(types[0])))
        except CompileError as error:
            return left_out(name, error.diagnostics[0].title, problems)

    def record(self, topics: Sequence[SeenTopic], seconds: float, path: Path,
               progress: Progress) -> None:
        """Write what comes on topics in a time to an MCAP file; an interrupt ends it earlier."""
        with path.open('wb') as file:
            writer = McapWriter(file)
            for topic in topics:
                channel = writer.add_channel(
                    topic.name, topic.type, complete_definition(find_message(topic.type)))
                self._subscribe(topic, _recorder(writer, channel))
            begin = monotonic()
            try:
                while (lasted := monotonic() - begin) < seconds:
                    progress(lasted / seconds, f'{lasted:.0f} of {seconds:g} s')
                    self._executor.spin_once(timeout_sec=min(_STEP_S, seconds - lasted))
            except KeyboardInterrupt:
                pass  # what has come until now is enough for the user
            writer.end()

    def _subscribe(self, topic: SeenTopic, callback: Callable[[bytes], None]) -> None:
        """Subscribe with what all publishers offer, so that latched messages come too."""
        from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
        offered = [item.qos_profile
                   for item in self._node.get_publishers_info_by_topic(topic.name)]
        is_reliable = all(one.reliability is ReliabilityPolicy.RELIABLE for one in offered)
        is_latched = all(one.durability is DurabilityPolicy.TRANSIENT_LOCAL for one in offered)
        self._node.create_subscription(
            _message_class(topic.type), topic.name, callback, QoSProfile(  # type: ignore[no-untyped-call]
                depth=_QUEUE,
                reliability=ReliabilityPolicy.RELIABLE if is_reliable
                else ReliabilityPolicy.BEST_EFFORT,
                durability=DurabilityPolicy.TRANSIENT_LOCAL if is_latched
                else DurabilityPolicy.VOLATILE), raw=True)


def _recorder(writer: McapWriter, channel: int) -> Callable[[bytes], None]:
    return lambda data: writer.add_message(channel, time_ns(), bytes(data))


def _message_class(name: str) -> Any:
    package, _, message = name.rpartition('/')
    try:
        return getattr(import_module(package.replace('/', '.')), message)
    except (ImportError, AttributeError):
        refuse(f'the message type {name} is not installed')


@contextmanager
def live_graph() -> Iterator[LiveGraph]:
    """
    Yield the running graph.

    Raises
    ------
    CompileError
        if rclpy cannot be imported.
    """
    try:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.signals import SignalHandlerOptions
    except ImportError:
        refuse('`new --live` needs ROS 2: there is no rclpy', help='source its setup.bash first')
    context = rclpy.Context()
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = rclpy.create_node('fret_monitor_new', context=context, enable_rosout=False,
                                 start_parameter_services=False)
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node)
        yield LiveGraph(node, executor)
        executor.shutdown()
        node.destroy_node()  # type: ignore[no-untyped-call]
    finally:
        rclpy.shutdown(context=context)
