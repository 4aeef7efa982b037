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
The process that watches a running monitor for a page, with rclpy.

    python -m fret_monitor.studio.watching

Standard input: a line of JSON with what to watch (`plan.py`, and the `namespace`), then lines
`{"reset": NODE}`; its end ends the process. Standard output: what is new (`turn.py`), a line ten
times a second at most. Nothing is evaluated here: verdicts are those that the monitor publishes,
on `copilot/verdict/ID` if it does, else on `copilot/violations` and `/diagnostics`.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from importlib import import_module
import json
import os
import resource
import signal
import sys
from threading import Event, Thread
from time import monotonic, time_ns
from typing import Any

from fret_monitor.model.names import DETAILS_TOPIC, DIAGNOSTICS_TOPIC
from fret_monitor.studio.turn import read_path, Shown, Turn

PERIOD_S = 0.1
_LOOK_S = 1.0
_STALE_S = 3.0  # a verdict is published once a second while it is known
_VERDICTS = {'satisfied': True, 'violated': False}  # the first word on `/diagnostics`
_MEMORY = 3_000_000_000
_MOST_TOPICS = 100  # of inputs
_MOST_INSTANCES = 100  # of requirements, that are shown
_NO_ROS = ('ROS 2 is not here: {}. Start studio in a terminal in which ROS 2 is sourced, and '
           'which reaches the robot')


def main() -> int:
    """Watch until standard input ends; return the exit status."""
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: sys.exit(0))
    plan = json.loads(_line() or 'null')
    if plan is None:
        return 0
    try:
        import rclpy  # noqa: F401
    except ImportError as error:
        _send({'error': _NO_ROS.format(error)})
        return 1
    try:
        watching = Watching(plan)
    except Exception as error:  # noqa: B902  of rclpy: a namespace that is none, say
        _send({'error': f'ROS 2 cannot be used: {error}'})
        return 1
    return watching.run()


def _line() -> bytes:
    """Return a line of standard input; without a buffer, no lock is held at exit."""
    raw = open(0, 'rb', buffering=0, closefd=False)  # noqa: SIM115
    return raw.readline()


def _send(found: Mapping[str, Any]) -> None:
    sys.stdout.write(json.dumps(found, separators=(',', ':')) + '\n')
    sys.stdout.flush()


def _now() -> int:
    return time_ns() // 1_000_000


def _take_nothing(_: Any) -> None:
    """Take no message: the node has no executor."""


def _profile(publishers: Sequence[Any]) -> Any:
    """
    Return a profile that all publishers match; no driver is slowed down by this page.

    Where all keep their last message, it is wanted: none may come for long.
    """
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
    reliable, kept = ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL
    if all(item.qos_profile.reliability is reliable and item.qos_profile.durability is kept
           for item in publishers):
        return QoSProfile(depth=1, reliability=reliable, durability=kept)
    return QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


class Watching:
    """A node that listens to a monitor and to the topics of its inputs."""

    def __init__(self, plan: Mapping[str, Any]) -> None:
        """Subscribe."""
        import rclpy
        from rclpy.experimental.events_executor import EventsExecutor
        from rclpy.signals import SignalHandlerOptions
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        self._node: Any = rclpy.create_node(
            f'_fret_studio_{os.getpid()}', namespace=plan['namespace'] or '/',
            enable_rosout=False, start_parameter_services=False)
        # Not of the executor: the last message is taken when it is shown, not each as it comes.
        self._readers: Any = rclpy.create_node(
            f'_fret_studio_inputs_{os.getpid()}', namespace=plan['namespace'] or '/',
            enable_rosout=False, start_parameter_services=False)
        self._executor = EventsExecutor()
        self._executor.add_node(self._node)
        self._turn = Turn()
        self._is_over = Event()
        self._last: dict[str, bool | None] = {}  # verdicts, as sent
        self._published: dict[str, float] = {}  # when a verdict came on its topic
        self._monitors: list[str] | None = None
        self._elsewhere: list[str] = []  # namespaces of others
        self._inputs: Sequence[Mapping[str, Any]] = plan['inputs']
        self._classes: dict[str, Any] = {}
        self._ids = {item['id'] for item in plan['requirements']}
        self._instances: set[str] = set()  # that were violated, such as SLOW[robot=alpha]
        self._clients: dict[str, Any] = {}
        self._heard: dict[str, Any] = {}  # topics of inputs, and their subscriptions
        self._listen(plan['requirements'])
        self._find_types()

    # Subscriptions.

    def _listen(self, requirements: Sequence[Mapping[str, str]]) -> None:
        from diagnostic_msgs.msg import DiagnosticArray
        from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
        from std_msgs.msg import Bool
        reliable = ReliabilityPolicy.RELIABLE
        last = QoSProfile(depth=20, reliability=reliable,
                          durability=DurabilityPolicy.TRANSIENT_LOCAL)
        for item in requirements:
            self._node.create_subscription(
                Bool, item['topic'], partial(self._take_verdict, item['id']), last)
        self._node.create_subscription(
            DiagnosticArray, DETAILS_TOPIC, self._take_details,
            QoSProfile(depth=200, reliability=reliable))
        self._node.create_subscription(
            DiagnosticArray, DIAGNOSTICS_TOPIC, self._take_health, 10)

    def _find_types(self) -> None:
        types = {item['topic']: item['type'] for item in self._inputs}
        for topic, kind in list(types.items())[:_MOST_TOPICS]:
            package, folder, name = kind.split('/')
            with suppress(ImportError, AttributeError):
                self._classes[topic] = getattr(import_module(f'{package}.{folder}'), name)
        missing = [item['name'] for item in self._inputs if item['topic'] not in self._classes]
        self._turn.note(missing=missing)

    def _listen_to_inputs(self) -> None:
        """Subscribe to the inputs that are published by now."""
        for topic in self._classes.keys() - self._heard:
            publishers = self._node.get_publishers_info_by_topic(
                self._node.resolve_topic_name(topic))
            if publishers:
                self._heard[topic] = self._readers.create_subscription(
                    self._classes[topic], topic, _take_nothing, _profile(publishers))

    def _values(self) -> Iterator[tuple[str, tuple[int, Shown]]]:
        """Yield the inputs that are new since the last call, and their values."""
        for topic, subscription in self._heard.items():
            with suppress(RuntimeError, ValueError):
                found = subscription.handle.take_message(self._classes[topic], False)
                if found is None:
                    continue
                message, facts = found
                time = facts['received_timestamp'] // 1_000_000 or _now()
                for item in self._inputs:
                    if item['topic'] == topic:
                        yield item['name'], (time, read_path(message, item['path']))

    def _take_verdict(self, requirement: str, message: Any) -> None:
        self._published[requirement] = monotonic()
        self._note(requirement, message.data)

    def _note(self, requirement: str, verdict: bool | None) -> None:
        if self._last.get(requirement) is not verdict:
            self._last[requirement] = verdict
            self._turn.add_verdict(requirement, _now(), verdict)

    def _take_details(self, array: Any) -> None:
        for status in array.status:
            is_over = status.level == b'\0'
            self._turn.add_occurrence({
                'time': _now(), 'id': status.name, 'text': status.message, 'isOver': is_over,
                'isWarning': status.level == b'\1',
                'values': [[item.key, item.value] for item in status.values]})
            if self._is_without_topic(status.name) or self._is_instance(status.name):
                self._note(status.name, is_over)

    def _is_without_topic(self, requirement: str) -> bool:
        return requirement in self._ids and requirement not in self._published

    def _is_instance(self, name: str) -> bool:
        if name not in self._ids and name.partition('[')[0] in self._ids \
                and len(self._instances) < _MOST_INSTANCES:
            self._instances.add(name)
        return name in self._instances

    def _take_health(self, array: Any) -> None:
        """Take the statuses of the monitors; others publish on `/diagnostics`, too."""
        prefixes = tuple(f'{name[1:]}: ' for name in self._monitors or ())
        own = [item for item in array.status if prefixes and item.name.startswith(prefixes)]
        if not own:
            return
        node = own[0].name.partition(': ')[0]
        self._turn.note(**{f'health {node}': [
            {'name': item.name.partition(': ')[2], 'level': item.level[0],
             'text': item.message, 'values': [[pair.key, pair.value] for pair in item.values]}
            for item in own]})
        for item in own:
            name = item.name.partition(': ')[2]
            if self._is_without_topic(name):
                self._note(name, _VERDICTS.get(item.message.partition(' ')[0].rstrip(':,')))

    # Monitors, and what is asked of them.

    def _look(self) -> None:
        found = sorted({
            f'{item.node_namespace.rstrip("/")}/{item.node_name}'
            for item in self._node.get_publishers_info_by_topic(
                self._node.resolve_topic_name(DETAILS_TOPIC))})
        others = [] if found else self._others()
        if (found, others) != (self._monitors, self._elsewhere):
            self._monitors, self._elsewhere = found, others
            self._turn.note(monitors=found, others=others)
        self._listen_to_inputs()
        stale = monotonic() - _STALE_S
        for requirement in self._ids | self._instances:
            if not found or self._published.get(requirement, stale) < stale:
                self._note(requirement, None)

    def _others(self) -> list[str]:
        """Return the other namespaces in which there is a monitor."""
        end = f'/{DETAILS_TOPIC}'
        return sorted(name.removesuffix(end) or '/'
                      for name, _ in self._node.get_topic_names_and_types()
                      if name.endswith(end) and self._node.count_publishers(name))

    def _obey(self) -> None:
        while line := _line():
            request = json.loads(line)
            if request.get('reset') in (self._monitors or ()):
                self._reset(request['reset'])
        self._is_over.set()

    def _reset(self, node: str) -> None:
        from std_srvs.srv import Trigger
        client = self._clients.setdefault(node, self._node.create_client(Trigger, f'{node}/reset'))
        if not client.service_is_ready():
            self._turn.note(told=f'{node}/reset does not answer')
            return
        client.call_async(Trigger.Request()).add_done_callback(self._take_reset)

    def _take_reset(self, answer: Any) -> None:
        self._turn.note(told=answer.result().message)
        for name in self._instances:
            self._note(name, None)

    # Its life.

    def _spin(self) -> None:
        while not self._is_over.is_set():
            self._executor.spin_once(timeout_sec=PERIOD_S)

    def run(self) -> int:
        """Send what is new until standard input ends, or nobody reads."""
        threads = [Thread(target=work, daemon=True) for work in (self._spin, self._obey)]
        for thread in threads:
            thread.start()
        with suppress(BrokenPipeError, KeyboardInterrupt, SystemExit):
            self._send_all()
        self._is_over.set()
        threads[0].join()
        self._end()
        return 0

    def _send_all(self) -> None:
        next_look = monotonic()
        while not self._is_over.wait(PERIOD_S):
            if monotonic() >= next_look:
                next_look = monotonic() + _LOOK_S
                self._look()
            if found := self._turn.take(dict(self._values())):
                _send(found)

    def _end(self) -> None:
        import rclpy
        ends: Sequence[Callable[[], object]] = (
            self._readers.destroy_node, self._node.destroy_node, self._executor.shutdown,
            rclpy.try_shutdown)
        for end in ends:
            end()


if __name__ == '__main__':
    sys.exit(main())
