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
All faces on one stream of messages, on a clock with ticks: three nodes, `bag` and the reference.

Bounds, windows and timeouts fall on the ticks. After each tick of `/clock` messages come while it
stands, on several topics, and each is waited for: so all faces see the same messages at the same
times. A bundle defines conditions and numbers over time by each other; values are NaN, too.
"""

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, ExitStack
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

from bag.random_texts import (
    bundle, Change, expected, INPUTS, lowered, random_value, recorded, TICK_NS, TOPICS, Words,
)
from bag.reference import last_values, Message
from bundles import write_bundle
from diagnostic_msgs.msg import DiagnosticArray
from fret_monitor import build
from fret_monitor.model.names import DETAILS_TOPIC
from fret_monitor.model.policies import InputSource, Policy
import pytest
from ros.exported import monitoring
from ros.harness import NodeProcess, Partner, RELIABLE, wait_until
from ros.received import read_detail
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Bool, Float32, Header, Int16
from strategies import EXAMPLES, thorough

KINDS: dict[str, Any] = {'Bool': Bool, 'Float32': Float32, 'Int16': Int16}
NODES = {'hot': 'on', 'cold': 'off', 'native': 'rcl'}
SIMULATED = ('-p', 'use_sim_time:=true')


@dataclass
class Run:
    """What one node reports between two restarts of `/clock`."""

    evaluated: list[tuple[str, int]] = field(default_factory=list)  # messages, when
    changes: list[Change] = field(default_factory=list)


@dataclass
class Face:
    """What one node reports, from its details, which come in order."""

    runs: list[Run] = field(default_factory=lambda: [Run()])
    count: int = 0  # of messages evaluated
    last: int = 0  # the time of the last one
    alive: int = 0  # its latest sign of life, in its time

    def live(self, header: Header) -> None:
        self.alive = header.stamp.sec * 10**9 + header.stamp.nanosec

    def hear(self, array: DiagnosticArray) -> None:
        for status in array.status:
            detail = read_detail(status)
            assert detail.suppressed == 0
            stamp = int(status.values[1].value.replace('.', ''))
            topic = status.name.removeprefix('ACK_')
            if topic == status.name:
                self.runs[-1].changes.append((topic, stamp, detail.is_recovery))
            elif not detail.is_recovery and not detail.silent:
                if stamp < self.last:
                    self.runs.append(Run())
                self.runs[-1].evaluated.append((topic, stamp))
                self.last = stamp
                self.count += 1


class Stream:
    """Publishes `/clock` and messages to all nodes, and waits until each was evaluated."""

    def __init__(self, partner: Partner) -> None:
        self.faces = {name: Face() for name in NODES}
        self.sent: list[tuple[str, float]] = []
        self.now = 100 * TICK_NS
        self._clock = partner.publisher(Clock, '/clock')
        self._publishers = {topic: partner.publisher(KINDS[kind], f'/{topic}')
                            for topic, kind in TOPICS.items()}
        for name, face in self.faces.items():
            details = partner.node.create_subscription(
                DiagnosticArray, f'/{name}/{DETAILS_TOPIC}', face.hear, RELIABLE)
            wait_until(partial(_is_matched, details), f'details of {name}')
            partner.node.create_subscription(
                Header, f'/{name}/fret_monitor/alive', face.live, RELIABLE)
        wait_until(partial(_is_heard_by_all, self._clock), '/clock')
        partner.wait_for_subscriptions(len(NODES), *self._publishers.values())

    def begin(self) -> None:
        """Begin the time of all nodes; before, nothing is evaluated."""
        def has_begun() -> bool:
            self.tell(-5 * 10**9)  # ignored
            self.tell(self.now)  # best effort: what is sent before it is matched is lost
            return all(face.alive == self.now for face in self.faces.values())

        wait_until(has_begun, '/clock')

    def move(self, by: int) -> None:
        """Move `/clock`, and wait until it has moved in each node."""
        self.now += by
        self.tell(self.now)
        self.send('probe', 1)
        while not all(0 <= face.last - self.now < TICK_NS
                      for face in self.faces.values()):
            self.tell(self.now)
            self.send('probe', 1)

    def tell(self, time: int) -> None:
        """Publish a time on `/clock`."""
        clock = Clock()
        clock.clock.sec, clock.clock.nanosec = divmod(time, 10**9)
        self._clock.publish(clock)

    def send(self, topic: str, value: float) -> None:
        """Publish a message, and wait until all nodes have evaluated it."""
        kind = KINDS[TOPICS[topic]]
        self.sent.append((topic, value))
        self._publishers[topic].publish(kind(data=type(kind().data)(value)))
        wait_until(lambda: all(face.count == len(self.sent) for face in self.faces.values()),
                   f'{topic} evaluated')

    def streams(self, name: str) -> Iterator[tuple[list[Message], list[Change]]]:
        """Yield the messages that a node evaluated in each run, and what it found."""
        sent = iter(self.sent)
        for run in self.faces[name].runs:
            stream = []
            for topic, time in run.evaluated:
                was, value = next(sent)
                assert topic == was
                kind = KINDS[TOPICS[topic]]
                stream.append(Message(f'/{topic}', time, kind(data=type(kind().data)(value))))
            yield stream, run.changes


def _is_matched(subscription: Any) -> bool:
    return int(subscription.get_publisher_count()) > 0


def _is_heard_by_all(publisher: Any) -> bool:
    return int(publisher.get_subscription_count()) >= len(NODES)


@contextmanager
def all_nodes(bundle: Path) -> Iterator[dict[str, NodeProcess]]:
    """Start the nodes, each in a namespace of its own."""
    with ExitStack() as stack:
        yield {name: stack.enter_context(node(name, bundle)) for name in NODES}


def node(name: str, bundle: Path) -> AbstractContextManager[NodeProcess]:
    """Start a node."""
    return monitoring(NODES[name], bundle, '-r', f'__ns:=/{name}', *SIMULATED)


def play(rng: Random, stream: Stream, ticks: int, every: int) -> None:
    """Publish random messages while the clock stands at each tick; it goes back after `every`."""
    stream.begin()
    for tick in range(ticks):
        if tick == 0 or tick % every >= every - 2:  # no input is silent when the clock goes back
            send_all(rng, stream)
        else:
            for _ in range(rng.choice([0, 1, 1, 2, 3])):
                topic = rng.choice(INPUTS)
                stream.send(topic, random_value(rng, topic))
        is_over = tick % every == every - 1 and tick < ticks - 1
        stream.move(-rng.randrange(1, 15) * TICK_NS if is_over else rng.choice(
            [TICK_NS, TICK_NS, TICK_NS // 2, TICK_NS // 2 + 1, TICK_NS - 1]))
        if is_over:
            send_all(rng, stream)
    for _ in range(20):
        stream.move(TICK_NS - 12345)


def send_all(rng: Random, stream: Stream) -> None:
    """Publish a message of each topic."""
    for topic in INPUTS:
        stream.send(topic, rng.randrange(8))


@pytest.mark.parametrize('seed', range(max(1, EXAMPLES // 50)))
@pytest.mark.parametrize('policy', [
    Policy.TIMED,
    *(pytest.param(policy, marks=thorough) for policy in (
        Policy.EVERY_MESSAGE, Policy.RELEVANT_MESSAGE, Policy.ALL_INPUTS))])
def test_all_faces_find_the_same_on_a_clock_with_ticks(
    partner: Partner, tmp_path: Path, policy: Policy, seed: int,
) -> None:
    rng = Random(seed)
    path = write_bundle(tmp_path, bundle(Words(rng, policy), 24))
    specification = lowered(build.read(path).specification)
    runs = 3 if policy is Policy.TIMED else 1  # the others keep their past if the clock goes back
    with all_nodes(path) as nodes:
        stream = Stream(partner)
        play(rng, stream, 20 * runs, 20)
        for process in nodes.values():
            process.wait_for('a message on /clock is ignored: its time is negative, -5.000 s')
            if runs > 1:
                process.wait_for('time went back')
    found = 0
    for name in NODES:
        carried: dict[str, Any] = {}
        for number, (messages, changes) in enumerate(stream.streams(name)):
            due = expected(specification, messages, carried)
            end = messages[-1].received
            assert sorted(item for item in changes if item[1] < end) == due, (name, number)
            if number == 0:
                assert recorded(path, messages, tmp_path / name) == due
            carried |= last_values(specification, messages)
            carried |= {signal.name: False for signal in specification.signals
                        if signal.source is InputSource.RECEIVED}
            found += len(due)
        assert number == runs - 1
    assert found > 30 * runs
