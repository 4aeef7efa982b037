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

"""Monitor and logger as real processes, and a node in the same domain that talks to them."""

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
import os
from pathlib import Path
import shutil
import signal
import subprocess
import sys
from tempfile import TemporaryFile
from threading import Thread
from time import monotonic, sleep
from typing import Any

from fret_monitor.native import build_library
from fret_monitor.ros import MonitorNode, Refusal
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
import pytest
from rclpy.client import Client
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
import rclpy.node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription
from ros import forked
from std_msgs.msg import Empty
from std_srvs.srv import Trigger

PATIENCE = 30.0  # s; the machines that run the tests may be busy
ASK_AGAIN_S = 3.0
START = 'import sys; from fret_monitor.ros.{0} import main; sys.argv[0] = "{0}"; sys.exit(main())'
READY = {'monitor': 'watching', 'gate': 'watching', 'logger': 'listening', 'exported': 'watching'}

RELIABLE = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
DEEP = QoSProfile(depth=10_000, reliability=ReliabilityPolicy.RELIABLE)
BEST_EFFORT = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE,
                     durability=DurabilityPolicy.TRANSIENT_LOCAL)


def wait_until(is_true: Callable[[], bool], what: str, patience: float = PATIENCE) -> None:
    """Wait until a condition holds; fail with `what` after `patience` seconds."""
    end = monotonic() + patience
    while not is_true():
        assert monotonic() < end, f'waited in vain: {what}'
        sleep(0.01)


def without_interface_number(engine: Path) -> None:
    """Replace the engine of a compiled folder by one of an earlier version."""
    source = 'int old(void);\nint old(void) {return 0;}\n'
    shutil.copyfile(build_library({'old.c': source}, name='old'), engine)


HOT_PATH: str | None = None
"""What monitors are started with, where a test says nothing else; see `conftest.hot_path`."""


class NodeProcess:
    """The monitor or the logger as a process, with the arguments that a user gives."""

    def __init__(self, name: str, *arguments: str, environment: dict[str, str] | None = None,
                 folder: Path | None = None, is_anew: bool = False) -> None:
        """
        Start it with these ROS arguments; the caller sets ROS_DOMAIN_ID and the like.

        It is forked from a process that has imported much of what nodes import, unless it is to
        be started anew, as in tests of the start.
        """
        self.name = name
        if name == 'monitor' and HOT_PATH is not None and 'hot_path' not in ' '.join(arguments):
            arguments = (*arguments, '-p', f'hot_path:={HOT_PATH}')
        self._file = TemporaryFile()  # noqa: SIM115  closed by `kill`
        self.process: subprocess.Popen[bytes] | forked.ForkedNode
        if not (is_anew or 'COVERAGE_PROCESS_START' in os.environ):
            self.process = forked.ForkedNode(name, arguments, self._file.fileno(),
                                             {**os.environ, **(environment or {})}, folder)
            return
        self.process = subprocess.Popen(
            [sys.executable, '-c', START.format(name), '--ros-args', *arguments],
            stdin=subprocess.DEVNULL, stdout=self._file, stderr=subprocess.STDOUT, cwd=folder,
            env={**forked.environment(), 'PYTHONFAULTHANDLER': '1', **(environment or {})})

    @property
    def output(self) -> str:
        """Return what it has written so far, to both streams."""
        size = os.fstat(self._file.fileno()).st_size
        return os.pread(self._file.fileno(), size, 0).decode(errors='replace')

    def wait_for(self, words: str, patience: float = PATIENCE) -> None:
        """Wait until it has written these words."""
        end = monotonic() + patience
        while words not in self.output:
            assert self.process.poll() is None, f'{self.name} ended:\n{self.output}'
            assert monotonic() < end, f'{self.name} never wrote {words!r}:\n{self.output}'
            sleep(0.01)

    def end(self, number: int = signal.SIGINT, patience: float = PATIENCE) -> int:
        """Send a signal and return the exit status; fail if it does not end in time."""
        self.process.send_signal(number)
        return self.status(patience)

    def status(self, patience: float = PATIENCE) -> int:
        """Wait until it ends and return the exit status."""
        try:
            return self.process.wait(patience)
        except subprocess.TimeoutExpired:
            self.process.send_signal(signal.SIGABRT)  # faulthandler writes where its threads are
            sleep(1.0)
            output = self.output
            self.kill()
            raise AssertionError(f'{self.name} did not end:\n{output}') from None

    def error(self) -> str:
        """Wait until it ends with an error, and return what it has written."""
        try:
            assert self.status() == 1, self.output
            return self.output
        finally:
            self.kill()

    def kill(self) -> None:
        """Kill the process if it still runs, and close its file."""
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        self._file.close()


@contextmanager
def started(name: str, *arguments: str, environment: dict[str, str] | None = None,
            folder: Path | None = None, is_anew: bool = False) -> Iterator[NodeProcess]:
    """Start a node and wait until it is ready; it must end well if the test succeeds."""
    with ending_well(NodeProcess(name, *arguments, environment=environment, folder=folder,
                                 is_anew=is_anew)) as node:
        yield node


@contextmanager
def ending_well(node: NodeProcess) -> Iterator[NodeProcess]:
    """Wait until a node is ready; it must end well if the test succeeds."""
    has_succeeded = False
    try:
        node.wait_for(READY[node.name], 4 * PATIENCE)  # it may have to compile
        yield node
        if node.process.poll() is None:
            assert node.end() == 0, node.output
        assert 'Traceback' not in node.output, node.output
        has_succeeded = True
    finally:
        if not has_succeeded:
            print(node.output)  # shown with the failure
        node.kill()


def make_node[N](
    kind: Callable[..., N], context: Context, *arguments: str, **given: object,
) -> N:
    """Make a node in this process, with these ROS arguments and parameters."""
    overrides = [Parameter(name, value=str(value) if isinstance(value, Path) else value)
                 for name, value in given.items()]
    return kind(context=context, parameter_overrides=overrides,
                cli_args=['--ros-args', *arguments])


def refusal(context: Context, *arguments: str, kind: Any = MonitorNode, **given: Any) -> str:
    """Return why `make_node` makes no node."""
    with pytest.raises(Refusal) as found:
        make_node(kind, context, *arguments, **given)
    return str(found.value)


def settle(seconds: float) -> None:
    """Sleep so long, and longer where more processes want a processor than there are."""
    sleep(seconds * max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1)))


def answer_of(client: Client, request: Any, patience: float = PATIENCE) -> Any:
    """
    Call a service, again every few seconds until it answers; return the answer.

    A server that has not found its client yet drops the answer after 0.1 s, although the client
    has found the server (issue 842 of rmw_fastrtps). So this is for requests that may come twice.
    """
    wait_until(client.service_is_ready, client.srv_name, patience)
    begin = monotonic()
    answers: list[Any] = []

    def is_answered() -> bool:
        if monotonic() - begin >= len(answers) * ASK_AGAIN_S:
            answers.append(client.call_async(request))
        return any(answer.done() for answer in answers)

    wait_until(is_answered, f'an answer of {client.srv_name}', patience)
    return next(answer.result() for answer in answers if answer.done())


def change_state(client: Client, transition: int, patience: float = PATIENCE) -> bool:
    """Request a transition, once; return whether it succeeded."""
    # A transition that there is not is refused without effect, and so may come twice.
    answer_of(client, ChangeState.Request(transition=Transition(label='none')))
    answer = client.call_async(ChangeState.Request(transition=Transition(id=transition)))
    wait_until(answer.done, f'a transition by {client.srv_name}', patience)
    return bool(answer.result().success)


def _is_matched(subscription: Subscription, publishers: int) -> bool:
    return int(subscription.get_publisher_count()) >= publishers


class Partner:
    """A node of the test: publishes, and counts violations."""

    def __init__(self, domain: int, namespace: str = '/') -> None:
        """Create the node in a domain and spin it in a thread."""
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain,
                   signal_handler_options=SignalHandlerOptions.NO)
        self.node = rclpy.node.Node('partner', namespace=namespace, context=self.context)
        self.heard: Counter[str] = Counter()
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._is_closing = False
        self._thread = Thread(target=self._spin, daemon=True)
        self._thread.start()

    def _spin(self) -> None:
        while not self._is_closing:
            # rclpy raises this if a test destroys a publisher while its events are waited for.
            with suppress(_rclpy.InvalidHandle):
                self._executor.spin_once(timeout_sec=0.1)

    def close(self) -> None:
        """Stop spinning and destroy the node."""
        self._is_closing = True
        self._thread.join()
        self._executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()

    def publisher(self, message: Any, topic: str, profile: QoSProfile = RELIABLE) -> Publisher:
        """Advertise a topic."""
        return self.node.create_publisher(message, topic, profile)

    def listen(self, *handlers: str, prefix: str = 'copilot/handlerprop',
               publishers: int = 1) -> None:
        """Count messages on the handlers whose names end so, once their publishers are there."""
        def listener(name: str) -> Callable[[Empty], None]:
            def count(_: Empty) -> None:
                self.heard[name] += 1
            return count

        for name in handlers:
            subscription = self.node.create_subscription(
                Empty, prefix + name, listener(name), DEEP)
            wait_until(partial(_is_matched, subscription, publishers),
                       f'{publishers} of handler {name}')

    def wait_for_listener(self, *publishers: Publisher) -> None:
        """Wait until only current, compatible subscriptions of a monitor are matched."""
        for publisher in publishers:
            wait_until(partial(self._is_heard, publisher), f'a listener to {publisher.topic_name}')
        # Discovery is not symmetric: the other side matches a moment later.
        settle(0.3)

    def wait_for_subscriptions(self, count: int, *publishers: Publisher) -> None:
        """Wait until so many subscriptions are matched, and none is still to be replaced."""
        for publisher in publishers:
            wait_until(partial(self._are_current, publisher, count),
                       f'{count} subscriptions to {publisher.topic_name}')
        settle(0.5)  # the other side matches a moment later

    def _are_current(self, publisher: Publisher, count: int) -> bool:
        listed = self.node.get_subscriptions_info_by_topic(publisher.topic_name)
        return publisher.get_subscription_count() == len(listed) == count and all(
            item.qos_profile.reliability is publisher.qos_profile.reliability for item in listed)

    def _is_heard(self, publisher: Publisher) -> bool:
        listed = self.node.get_subscriptions_info_by_topic(publisher.topic_name)
        return publisher.get_subscription_count() > 0 and any(
            item.qos_profile.reliability is publisher.qos_profile.reliability
            for item in listed if item.node_name == 'fret_monitor')

    def expect(self, expected: dict[str, int]) -> None:
        """Wait for as many violations as expected, and a while longer to see that no more come."""
        wanted = Counter({name: number for name, number in expected.items() if number})
        end = monotonic() + PATIENCE
        while +self.heard.copy() != wanted and monotonic() < end:
            sleep(0.01)
        sleep(0.3)
        assert +self.heard == wanted, f'heard {dict(self.heard)}, due {dict(wanted)}'

    def reset(self, service: str = 'fret_monitor/reset') -> str:
        """Call the service and return its message."""
        answer = answer_of(self.node.create_client(Trigger, service), Trigger.Request())
        assert answer.success
        return str(answer.message)
