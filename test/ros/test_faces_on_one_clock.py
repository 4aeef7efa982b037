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

Bounds and timeouts fall on the ticks. After each tick of `/clock` messages come while it stands,
on several topics, and each is waited for: so all faces see the same messages at the same times.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, ExitStack
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

from bag.recordings import TYPES
from bag.reference import findings, Message
from diagnostic_msgs.msg import DiagnosticArray
from fret_monitor import build
from fret_monitor.bag import check
from fret_monitor.logic.specification import Specification
from fret_monitor.model.names import DETAILS_TOPIC
from fret_monitor.model.policies import InputSource
from fret_monitor.program.rewriting import without_queues
import pytest
from ros.exported import exported_bundle, running
from ros.harness import NodeProcess, Partner, RELIABLE, started, wait_until
from ros.received import read_detail
from rosbags.rosbag2 import StoragePlugin, Writer
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Bool, Float32, Header
from strategies import EXAMPLES

TICK_NS = 100_000_000
TOPICS: dict[str, Any] = {'probe': Bool, 'x': Float32, 'p': Bool, 'q': Bool}
NODES = ('hot', 'cold', 'native')  # in callbacks, in a thread that they wake, without Python
SIMULATED = ('-p', 'use_sim_time:=true')
Change = tuple[str, int, bool]
"""A requirement, a time, and whether its violation is over."""


def condition(rng: Random) -> str:
    return rng.choice(['p', 'q', '!p', 'x > 3.0', 'x <= 5.0', '(p | x > 6.0)', 'came_q'])


def requirement(rng: Random) -> str:
    """Return a requirement whose bounds are a few ticks."""
    one, other = condition(rng), condition(rng)
    low, high = sorted(rng.randrange(7) / 10 for _ in range(2))
    window = rng.choice([f'[0, {high} s]', f'[{low} s, {high + 0.1} s]', f'[<= {high} s]',
                         f'[>= {low} s]', f'[< {high + 0.1} s]'])
    return rng.choice([
        f'ptltl: "{one} -> O{window} ({other})"', f'ptltl: "H (H{window} ({one}) -> {other})"',
        f'ptltl: "({one}) S{window} ({other})"', f'ptltl: "H ({one} & Y !({one}) -> {other})"',
        f'fretish: "when {one} the robot shall within {high} seconds satisfy {other}"',
        f'fretish: "if persisted({low or 0.1} seconds, {one}) the robot shall within {high} '
        f'seconds satisfy {other}"',
        f'fretish: "upon {one} the robot shall for {high} seconds satisfy {other}"',
    ]).replace('0.0 s', '0 s')


def bundle(rng: Random, number: int) -> str:
    """Return a bundle of random requirements; ACK_* acknowledges each message."""
    lines = ['format: 1', 'report: occurrence', 'evaluation: {policy: timed, unit: 0.1}',
             'inputs:']
    for topic, kind in TOPICS.items():
        options = f'topic: /{topic}, type: std_msgs/msg/{kind.__name__}'
        if topic in 'xp' and rng.randrange(2):
            options += f', timeout: {rng.choice([0.3, 0.4])}, stale: violate'
        names = (f'got_{topic}', *(['came_q'] if topic == 'q' else []))
        lines += [f'  {topic}: {{{options}, max_rate: 1000}}', *(
            f'  {name}: {{{options}, field: received(), max_rate: 1000}}' for name in names)]
    lines += ['requirements:',
              *(f'  - {{id: R{k}, {requirement(rng)}}}' for k in range(number)),
              *(f'  - {{id: ACK_{topic}, ptltl: "!got_{topic}", report: every_step}}'
                for topic in TOPICS)]
    return '\n'.join([*lines, ''])


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
        self._publishers = {topic: partner.publisher(kind, f'/{topic}')
                            for topic, kind in TOPICS.items()}
        for name, face in self.faces.items():
            details = partner.node.create_subscription(
                DiagnosticArray, f'/{name}/{DETAILS_TOPIC}', face.hear, RELIABLE)
            wait_until(partial(_is_matched, details), f'details of {name}')
            partner.node.create_subscription(
                Header, f'/{name}/fret_monitor/alive', face.live, RELIABLE)
        for publisher in (self._clock, *self._publishers.values()):
            wait_until(partial(_is_heard_by_all, publisher), publisher.topic_name)

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
        kind = TOPICS[topic]
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
                kind = TOPICS[topic]
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
    options = ('-r', f'__ns:=/{name}', *SIMULATED)
    if name == 'native':
        return running(exported_bundle(bundle), *options)
    hot_path = 'off' if name == 'cold' else 'on'
    return started('monitor', '-p', f'spec:={bundle}', '-p', f'hot_path:={hot_path}', *options)


def play(rng: Random, stream: Stream, ticks: int) -> None:
    """Publish random messages while the clock stands at one tick after the other."""
    stream.begin()
    for tick in range(ticks):
        if tick == 0 or tick % 20 >= 18:  # no input is silent when the clock goes back
            for topic in 'xpq':
                stream.send(topic, rng.randrange(8))
        else:
            for _ in range(rng.choice([0, 1, 1, 2, 3])):
                topic = rng.choice('xpq')
                stream.send(topic, rng.randrange(8) if topic == 'x' else rng.randrange(2))
        is_over = tick % 20 == 19 and tick < ticks - 1
        stream.move(-rng.randrange(1, 15) * TICK_NS if is_over else rng.choice(
            [TICK_NS, TICK_NS, TICK_NS // 2, TICK_NS // 2 + 1, TICK_NS - 1]))
        if is_over:
            for topic in 'xpq':
                stream.send(topic, rng.randrange(8))
    for _ in range(20):
        stream.move(TICK_NS - 12345)


def lowered(specification: Specification) -> Specification:
    """Return the formulas whose falls are occurrences: a response is overdue until it comes."""
    formulas = without_queues([item.formula for item in specification.properties])
    return replace(specification, properties=tuple(
        replace(item, formula=formulas[item.formula]) for item in specification.properties))


def expected(specification: Specification, run: Sequence[Message],
             carried: dict[str, Any]) -> list[Change]:
    """Return the changes that the reference evaluators find in a run before its last message."""
    return changes_of({item.id: one.spans for item, one in zip(
        specification.properties, findings(specification, run, carried=carried), strict=True)},
        run[-1].received)


def recorded(bundle: Path, run: Sequence[Message], path: Path) -> list[Change]:
    """Return the changes that `bag` finds in a recording of a run before its last message."""
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics = {f'/{topic}': (writer.add_connection(
            f'/{topic}', f'std_msgs/msg/{kind.__name__}', typestore=TYPES),
            TYPES.types[f'std_msgs/msg/{kind.__name__}']) for topic, kind in TOPICS.items()}
        for message in run:
            connection, kind = topics[message.topic]
            writer.write(connection, message.received, TYPES.serialize_cdr(
                kind(data=message.content.data), connection.msgtype))
    with check.opened(path) as (recording, find):
        reading = check.read_bundle(bundle, check.Selection(), find)
        result = check.run(check.compiled(reading).monitor, recording, check.Selection())
    assert result.errors == ()
    return changes_of({found.id: found.spans for found in result.findings}, run[-1].received)


def changes_of(spans: Mapping[str, Iterable[tuple[int, int | None]]], end: int) -> list[Change]:
    """Return the begins and ends of violations before a time."""
    return sorted((name, time, is_over) for name, found in spans.items() if name[0] == 'R'
                  for span in found for time, is_over in zip(span, (False, True))
                  if time is not None and time < end)


@pytest.mark.parametrize('seed', range(max(1, EXAMPLES // 50)))
def test_all_faces_find_the_same_on_a_clock_with_ticks(
    partner: Partner, tmp_path: Path, seed: int,
) -> None:
    rng = Random(seed)
    path = tmp_path / 'bundle.yaml'
    path.write_text(bundle(rng, 16), encoding='utf-8')
    specification = lowered(build.read(path).specification)
    with all_nodes(path) as nodes:
        stream = Stream(partner)
        play(rng, stream, 60)
        for process in nodes.values():
            process.wait_for('a message on /clock is ignored: its time is negative, -5.000 s')
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
            carried |= {signal.name: message.value(signal) for message in messages
                        for signal in specification.signals
                        if message.topic == signal.topic}
            carried |= {signal.name: False for signal in specification.signals
                        if signal.source is InputSource.RECEIVED}
            found += len(due)
        assert number == 2
    assert found > 100
