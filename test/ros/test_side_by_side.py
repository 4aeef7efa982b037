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
The node on rclpy and the node on rcl, side by side: whatever they publish and log is equal.

Both receive the same random messages and faults, one after the other: each is waited for. Reports
on `/diagnostics` come at other moments in each node; so messages are sent between two reports of
both, and the next ones are equal, with what has happened since the last report. What may differ:

* the name of the node: each has a namespace of its own;
* `rate`, `behind` and `written` in statuses, which depend on real time, and without `/clock` also
  for how long nothing came, and the stamps of details and reports;
* when ACK_probe is evaluated, and so the times of /probe: its messages show whether `/clock` has
  moved in both nodes;
* which violations a line shows: there is one a second. Lines about the same violation are equal,
  and the number of violations in lines is;
* the ten seconds of real time without a name: whether it is over, and how often it was;
* what has no value yet five seconds after an activation, unless values are given after that line;
* the order of log lines from different threads;
* when changes of the lock are logged, and so which reasons: both look once a second;
* the name of a publisher's node, which is discovered later than the publisher;
* which violations share a file of the black box, and so how many files there are: what they hold
  together is equal;
* the origin of the bundle in the line `watching`, and how messages are taken, which are facts of
  one node.
"""

from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, ExitStack
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from random import Random
import re
from time import monotonic, sleep, time_ns
from typing import Any

from bundles import write_bundle
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
import pytest
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros.exported import exported_bundle, ExportedNode
from ros.harness import (
    BEST_EFFORT, change_state, NodeProcess, Partner, PATIENCE, RELIABLE, wait_until,
)
from ros.received import read_detail
from rosbags.rosbag2 import Reader
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Empty, Int32
from strategies import thorough

sensor_msgs = pytest.importorskip('sensor_msgs.msg')

BUNDLE = """
format: 1
constants: {limit: 0.7}
topics:
  /probe: {type: sensor_msgs/msg/Range, fields: {got_probe: received()}}
  /x:
    type: sensor_msgs/msg/Range
    timeout: TIMEOUT
    startup: 5.0
    stale: violate
    fields: {x: range, delay: SINCE, got_x: received()}
  /level:
    type: sensor_msgs/msg/Range
    timeout: TIMEOUT
    fields:
      level: {field: radiation_type, initial: 7, values: {LOW: 1, HIGH: 200}}
      got_level: received()
  /joints:
    type: sensor_msgs/msg/JointState
    fields:
      elbow: "position[1]"
      reach: max(position)
      wrist: "position[name = wrist]"
      got_joints: received()
  /state:
    type: sensor_msgs/msg/CompressedImage
    fields:
      state: {field: format, values: {IDLE: "idle", MOVING: "moving"}}
      got_state: received()
  /never: {type: sensor_msgs/msg/Range, fields: {never: range}}
  /fixed: {type: sensor_msgs/msg/Range, qos: {reliability: reliable}, fields: {fixed: range}}
actions: {stop: {lock: {topic: e_stop, rate: 10}}}
requirements:
  - {id: X-1, title: "x is \\"small\\"", ptltl: "x < limit -> O[0,3] (x > 0.2)"}
  - {id: X-2, ptltl: "Y (x > 0.3) | x > 0.5", report: onset, severity: warn}
  - {id: RANGE, ptltl: "H (x < 0.9)", report: occurrence, on_violation: [stop]}
  - {id: ELBOW, ptltl: "elbow < 1.0 & reach < 4.0"}
  - {id: WRIST, ptltl: "wrist < 1.0 | state = IDLE", report: onset}
  - {id: STILL, ptltl: "state = IDLE -> level = HIGH"}
  - {id: LEVEL, ptltl: "H (level != HIGH -> O[1,4] (state = MOVING))", report: occurrence}
  - {id: FIXED, ptltl: "fixed < 1.0"}
  - {id: NEVER, ptltl: "never < 1.0"}
  - {id: FRESH, ptltl: "delay < 1.5"}
  - id: OFTEN
    fretish: upon x > 0.5 the robot shall with probability > 0.9 immediately satisfy x < 0.7
    confidence: 0.9
    report: onset
"""
IDS = ('X_1', 'X_2', 'RANGE', 'ELBOW', 'WRIST', 'STILL', 'LEVEL', 'FIXED', 'FRESH', 'NEVER',
       'OFTEN')
TOPICS = {'probe': 'Range', 'x': 'Range', 'level': 'Range', 'joints': 'JointState',
          'state': 'CompressedImage'}  # each with an acknowledging requirement
NODES = ('python', 'native')
REORDER_NS = 500_000_000
GARBAGE = (b'\0\1\0\0', b'\0\1\0\0' + b'\xff' * 4,  # a header, and too little after it
           b'\xff' * 8, b'\0')  # no header
EPOCH_NS = 100_000_000_000
LATCHED_LITTLE = QoSProfile(depth=20, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""A history that no subscription is too slow for: its queue has 100 messages."""

ROUND_S = 0.35  # what a round takes at most, between two reports of both nodes
MARGIN_S = 0.1  # before a report: it is published some time after the node has looked


def bundle(folder: Path, evaluation: str, *, is_simulated: bool) -> Path:
    """Write a bundle that acknowledges each message."""
    words = {'TIMEOUT': '1.0', 'SINCE': 'age(header.stamp)'} if is_simulated \
        else {'TIMEOUT': '5.0', 'SINCE': 'min_range'}
    acknowledging = ''.join(
        f'  - {{id: ACK_{name}, ptltl: "!got_{name}", report: every_step}}\n' for name in TOPICS)
    text = f'{BUNDLE}{acknowledging}evaluation: {{{evaluation}}}\n'
    return write_bundle(
        folder, re.sub('|'.join(words), lambda found: words[found[0]], text))


LOGGED = ('violated at', 'satisfied again at', 'cannot be decoded', 'keeps its value',
          'publishes std_msgs/msg/Int32 on /level', '/fixed: it offers best effort', 'restarted')
OF_CLOCK = ('time went back', 'no usable value on /x', 'values on /x again', 'time is negative')

MISSING = 'not evaluated yet'  # once after each activation

Line = tuple[str, str]
"""Of the log: its level and its text."""

_LOGGED = re.compile(r'^\[([A-Z]+)\] \[[0-9.]+\] \[[\w.]+\]: ', re.MULTILINE)
_OF_LOCK = re.compile(r"^lock 'stop' |more changes? of what locks and gates depend on")
_VERDICT = re.compile(r'([\w-]+) (violated|satisfied again)(?: at ([0-9.]+))?'
                      r'(?: (\d+) times more)?(.*?)'
                      r'(?: \((\d+) more violations? since the last line\))?', re.DOTALL)


@dataclass
class Face:
    """What one node publishes and logs."""

    name: str
    process: NodeProcess
    is_simulated: bool
    is_late: bool
    blackbox: Path
    details: list[DiagnosticStatus] = field(default_factory=list)
    violations: Counter[str] = field(default_factory=Counter)
    acknowledged: Counter[str] = field(default_factory=Counter)
    probed: int = 0  # when the last message on /probe was evaluated
    reports: list[tuple[float, DiagnosticArray]] = field(default_factory=list)
    """With the time at which each was published (monotonic)."""

    def listen(self, partner: Partner) -> Callable[[], bool]:
        """Subscribe to all that the node publishes; return whether it is advertised."""
        make, prefix = partner.node.create_subscription, f'/{self.name}/copilot'
        made = [make(DiagnosticArray, f'{prefix}/violations', self._take_detail, RELIABLE), *(
            make(Empty, f'{prefix}/handlerprop{name}', partial(self._count, name), RELIABLE)
            for name in (*IDS, *(f'ACK_{topic}' for topic in TOPICS)))]
        return lambda: all(item.get_publisher_count() == 1 for item in made)

    def _count(self, name: str, _: Empty) -> None:
        self.violations[name] += 1

    def _take_detail(self, array: DiagnosticArray) -> None:
        for status in array.status:
            detail = read_detail(status)
            self.details.append(status)
            topic = status.name.removeprefix('ACK_')
            if topic != status.name and not detail.is_recovery and not detail.silent:
                self.acknowledged[topic] += 1
                if topic == 'probe':
                    self.probed = int(next(pair.value for pair in status.values
                                           if pair.key == 'stamp').replace('.', ''))

    def take_report(self, array: DiagnosticArray, info: Any) -> None:
        """Keep a report if it is of this node."""
        if array.status[0].name.startswith(f'{self.name}/'):
            age = (time_ns() - info['source_timestamp']) / 1e9
            self.reports.append((monotonic() - age, array))

    def report(self) -> list[str]:
        """Return the statuses of the last report, without what may differ."""
        array = self.reports[-1][1]
        return [*([f'stamp {array.header.stamp}'] if self.is_simulated else []), *(
            self._shown(status) for status in array.status if 'ACK_probe' not in status.name)]

    def _shown(self, status: DiagnosticStatus) -> str:
        message = status.message if self.is_simulated else re.sub(
            r'for [0-9.]+ s of', 'for long of', status.message)
        message = re.sub(r'(; )?no message has had the names for 10 s: wrist', '', message)
        level = status.level if message else DiagnosticStatus.OK
        values = [(pair.key, pair.value) for pair in status.values
                  if pair.key not in ('rate', 'behind', 'written')]
        item = status.name.partition('/')[2]
        return f'{item} {level!r} {status.hardware_id} {message or "received"} {values}'

    def shown_details(self) -> Counter[tuple[str, int, str]]:
        """Return the details of each requirement, numbered, without what may differ."""
        numbers: Counter[str] = Counter()
        shown: Counter[tuple[str, int, str]] = Counter()
        for status in self.details:
            if status.name != 'ACK_probe':
                values = [(pair.key, pair.value) for pair in status.values
                          if self.is_simulated or pair.key != 'stamp']
                shown[status.name, numbers[status.name], f'{status.level!r} {status.hardware_id} '
                      f'{status.message} {values}'] += 1
                numbers[status.name] += 1
        return shown

    def lines(self) -> list[Line]:
        """Return the log."""
        _, *parts = _LOGGED.split(self.process.output)
        return [(level, text.rstrip('\n')) for level, text in zip(parts[::2], parts[1::2])]

    def kept(self) -> set[tuple[object, ...]]:
        """Return topics, types, definitions and messages of all files, without real times."""
        found: set[tuple[object, ...]] = set()
        for path in self.blackbox.iterdir():
            with Reader(path) as reader:
                for item in reader.connections:
                    found.add((item.topic.replace(f'/{self.name}/', '/NODE/'), item.msgtype,
                               item.msgdef.data))
                found |= {(item.topic, time if self.is_simulated else None, data)
                          for item, time, data in reader.messages()
                          if item.topic != '/probe' and not item.topic.endswith('_end')}
        return found

    def plain_lines(self) -> Counter[Line]:
        """Return the log without violations and their ends, and without what may differ."""
        found = [(level, self._plain(text)) for level, text in self.lines()
                 if _VERDICT.fullmatch(text) is None and _OF_LOCK.search(text) is None]
        return Counter(item for item in found if 'no message has had' not in item[1]
                       and not item[1].startswith(('the last messages', 'No transition matching')))

    def _plain(self, text: str) -> str:
        if text.startswith(('watching', 'bundle ')):
            return re.sub(r' \([^()]*\)$', '', text)
        if text.startswith('messages are taken in C'):
            return 'messages are taken'
        if MISSING in text and not self.is_late:
            return MISSING
        text = re.sub(r'(to receive from) (?:a publisher of no known node|/\w+)', r'\1 one', text)
        text = text if self.is_simulated else re.sub(
            r'again after [0-9.]+ s', 'again after long', text)
        return text.replace(f'/{self.name}/', '/NODE/')

    def verdicts(self) -> tuple[dict[tuple[str, ...], set[Line]], Counter[str]]:
        """Return the lines of violations, by what they are about, and how many violations."""
        found: dict[tuple[str, ...], set[Line]] = {}
        counts: Counter[str] = Counter()
        for level, text in self.lines():
            match = _VERDICT.fullmatch(text)
            if match is None or match[1] == 'ACK_probe':
                continue
            name, kind, moment, times, rest, more = match.groups()
            if kind == 'violated':
                counts[name] += int(times or 1) + int(more or 0)
            place = re.search(r'\[(step \d+|\S+ s after)', rest)
            key = (name, kind, str(moment if self.is_simulated else ''), str(place and place[1]))
            found.setdefault(key, set()).add((level, rest))
        return found, counts


def equal[F: Face](
        shown: Callable[[F], Counter[Any]], faces: Sequence[F], what: str) -> None:
    """Wait until both nodes show the same, or fail with what only one of them shows."""
    try:
        wait_until(lambda: shown(faces[0]) == shown(faces[1]), what, 8.0)
    except AssertionError:
        ours, theirs = map(shown, faces)
        only = '\n'.join([f'only {name}: {item}' for name, found in zip(
            NODES, (ours - theirs, theirs - ours)) for item in found.elements()])
        raise AssertionError(f'{what} differ:\n{only}') from None


Act = tuple[Callable[[], None], bool]
"""Something that happens, and whether it takes too long for a round with others."""


class Traffic:
    """Publishes to both nodes, and compares what they publish."""

    def __init__(self, partner: Partner, stranger: Partner, faces: list[Face], rng: Random,
                 *, is_simulated: bool, uses_stamps: bool) -> None:
        self._partner = partner
        self._stranger = stranger
        self._faces = faces
        self.rng = rng
        self._is_simulated = is_simulated
        self._uses_stamps = uses_stamps
        self.now = EPOCH_NS
        self.statuses = self.rounds = self.exact = 0
        self.passed = 0  # ns of `/clock`
        self._activations = 0
        self._due = Counter[str]()  # messages to be acknowledged
        self._waiting: list[tuple[int, str]] = []  # stamps of others
        self._others: dict[object, Publisher] = {}  # publishers that come and go
        self._are_advertised = [face.listen(partner) for face in faces]
        for face in faces:
            take: Any = face.take_report  # rclpy's annotation knows no callback with two arguments
            partner.node.create_subscription(DiagnosticArray, '/diagnostics', take, 10)
        self._clock = partner.publisher(Clock, '/clock')
        offers = {'x': BEST_EFFORT, 'state': LATCHED_LITTLE}
        self._publishers = {topic: partner.publisher(
            getattr(sensor_msgs, kind), f'/{topic}', offers.get(topic, RELIABLE))
            for topic, kind in TOPICS.items()}
        self._fixed = stranger.publisher(sensor_msgs.Range, '/fixed', BEST_EFFORT)

    # Messages and time.

    def message(self, topic: str, *, is_good: bool = False) -> Any:
        """Return a random message."""
        rng = self.rng
        if TOPICS[topic] == 'JointState':
            names = [[], ['elbow'], ['elbow', 'wrist', 'hand']][2 if is_good else rng.randrange(3)]
            positions = [rng.choice([0.5, 1.5, 4.5, float('nan')])
                         for _ in range(3 if is_good else rng.randrange(5))]
            return sensor_msgs.JointState(name=names, position=positions)
        if topic == 'state':
            words = ['idle', 'moving'] if is_good else ['idle', 'moving', 'moving', 'broken']
            return sensor_msgs.CompressedImage(format=rng.choice(words))
        if topic == 'level':
            return sensor_msgs.Range(radiation_type=rng.choice([1, 200, 5]))
        return sensor_msgs.Range(range=rng.choice([0.0, 0.25, 0.5, 0.75, 1.0, float('nan')]))

    def publisher(self, topic: str) -> Publisher:
        """Return a random publisher of a topic."""
        return self.rng.choice(self._matching(topic))

    def _matching(self, topic: str) -> list[Publisher]:
        own = self._publishers[topic]
        return [own, *(item for item in self._others.values() if (item.topic, item.msg_type) == (
            own.topic, own.msg_type))]

    def send(self, topic: str, message: Any = None, publisher: Publisher | None = None) -> None:
        """Publish a message, and wait until both nodes have evaluated it, or what comes later."""
        message = self.message(topic) if message is None else message
        publisher = self.publisher(topic) if publisher is None else publisher
        if self._uses_stamps and topic != 'probe':
            late = self.rng.random() < 0.2
            stamp = self.now + self.rng.randrange(-2 * REORDER_NS if late else -REORDER_NS,
                                                  REORDER_NS)
            self._stamp(message, stamp)
            publisher.publish(message)
            self._waiting.append((stamp, topic))
            message = self.message(topic)
        # If stamps count, this one is too late: it takes effect at once.
        self._stamp(message, 10**9 if self._uses_stamps else self.now - self.rng.randrange(
            3 * 10**9))
        publisher.publish(message)
        self._due[topic] += 1
        self._wait(topic)

    @staticmethod
    def _stamp(message: Any, stamp: int) -> None:
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)

    def _wait(self, *topics: str) -> None:
        for stamp, topic in list(self._waiting):
            if stamp <= self._evaluated:
                self._waiting.remove((stamp, topic))
                self._due[topic] += 1
        for topic in topics:
            wait_until(lambda: all(face.acknowledged[topic] >= self._due[topic]  # noqa: B023
                                   for face in self._faces), f'{topic} evaluated')

    def garble(self, topic: str, garbage: bytes) -> None:
        """Publish bytes that cannot be decoded."""
        publisher = self.publisher(topic)
        publisher.publish(garbage)
        self.send(topic, publisher=publisher)

    def move(self, by: int) -> None:
        """Move `/clock`, and wait until it has moved in both nodes."""
        self.now += by
        self.passed += by
        self._probe()
        end = monotonic() + PATIENCE
        while any(face.probed != self._evaluated for face in self._faces):
            assert monotonic() < end, '/clock'
            self.now += 10**6  # a second probe would take a nanosecond of the same time
            self._probe()
        self._wait(*TOPICS)

    @property
    def _evaluated(self) -> int:
        return self.now - (REORDER_NS if self._uses_stamps else 0)

    def _probe(self) -> None:
        self._tell(self.now)
        sleep(0.002)  # else many a probe comes before the time
        self.send('probe')

    def _tell(self, time: int) -> None:
        clock = Clock()
        clock.clock.sec, clock.clock.nanosec = divmod(time, 10**9)
        self._clock.publish(clock)

    def begin(self) -> None:
        """Start both nodes at once, then `/clock`; if late, after what is logged until then."""
        for face in self._faces:
            face.process.wait_for('waiting to be configured')
        self.change(Transition.TRANSITION_CONFIGURE)
        self.change(Transition.TRANSITION_ACTIVATE)
        wait_until(lambda: all(is_so() for is_so in self._are_advertised), 'handlers')
        for face in self._faces:
            wait_until(lambda: len(face.reports) > 0, 'reports')  # noqa: B023
            if face.is_late and self._is_simulated:
                face.process.wait_for('nothing was received on /clock')
        if self._is_simulated:
            wait_until(self._ignore_negative, 'a negative time')
            wait_until(self._has_clock, '/clock')
        self.give_values()

    # What is sent before /clock is matched is lost, and a later time replaces one that waits.

    def _ignore_negative(self) -> bool:
        self._tell(-5 * 10**9)
        return all('time is negative' in face.process.output for face in self._faces)

    def _has_clock(self) -> bool:
        self._tell(self.now)
        return all(face.reports[-1][1].header.stamp.sec == self.now // 10**9
                   for face in self._faces)

    def give_values(self) -> None:
        """Give all inputs values but one, whose publisher does not match; if late, late."""
        self._activations += 1
        for face in self._faces:
            if face.is_late:
                wait_until(lambda: face.process.output.count(  # noqa: B023
                    MISSING) >= self._activations, MISSING)
        wait_until(lambda: self._are_matched(*TOPICS), 'subscriptions')
        self._count_anew()
        for topic in TOPICS:
            self.send(topic, self.message(topic, is_good=True))

    def _are_matched(self, *topics: str) -> bool:
        return all(publisher.get_subscription_count() == len(NODES)
                   for topic in topics for publisher in self._matching(topic))

    # Rounds.

    def settle(self, is_due: Callable[[], bool] = lambda: True) -> None:
        """Wait until both nodes report the same after a change of the graph."""
        self._wait_for_reports()
        wait_until(is_due, 'reports')
        equal(lambda face: Counter(enumerate(face.report())), self._faces, 'statuses')
        self._note_equal()

    def _note_equal(self) -> None:
        self.rounds += 1
        self.statuses += len(self._faces[0].report())
        equal(lambda face: face.violations, self._faces, 'violations')
        equal(Face.shown_details, self._faces, 'details')

    def left(self) -> float:
        """Return the seconds until a node may report: once a second, of which some are late."""
        now = monotonic()
        return min((when - now) % 1.0 for face in self._faces for when, _ in face.reports[-5:])

    def round(self, acts: deque[Act]) -> None:
        """Do what fits between two reports of both nodes, and compare the next ones."""
        end = monotonic() + 3.0  # on a busy machine reports come at any time
        wait_until(lambda: self.left() > ROUND_S or monotonic() > end, 'reports')
        before, begin = self._numbers(), monotonic()
        acts.popleft()[0]()
        while acts and not acts[0][1] and self.left() > 2 * MARGIN_S \
                and self._numbers() == before:
            acts.popleft()[0]()
        end = monotonic() + MARGIN_S
        self._wait_for_reports()
        if not all(face.reports[-2][0] < begin and end < face.reports[-1][0]
                   for face in self._faces):  # one node may have reported in between
            self.settle()
            return
        self.exact += 1
        ours, theirs = (face.report() for face in self._faces)
        assert ours == theirs, [pair for pair in zip(ours, theirs) if pair[0] != pair[1]]
        self._note_equal()

    def _numbers(self) -> list[int]:
        return [len(face.reports) for face in self._faces]

    def _wait_for_reports(self) -> None:
        before = self._numbers()
        wait_until(lambda: all(now > count for now, count in zip(self._numbers(), before)),
                   'reports')

    # Faults of the graph, and services.

    def join(self, topic: str, kind: Any, profile: QoSProfile) -> None:
        """Let a publisher come, or go if it is there."""
        print(f'{monotonic():.3f} a publisher comes to /{topic}, or goes')
        key = (topic, kind, profile.reliability)
        if key in self._others:
            self._stranger.node.destroy_publisher(self._others.pop(key))
        else:
            self._others[key] = self._stranger.publisher(kind, f'/{topic}', profile)
        begin = monotonic()
        # The feeds of both nodes look four times a second; reports of later have seen it.
        self.settle(lambda: self._are_matched(topic) and all(
            face.reports[-1][0] > begin + 1.5 for face in self._faces))

    def reset(self) -> None:
        """Reset both nodes."""
        answers = {self._partner.reset(f'/{face.name}/fret_monitor/reset') for face in self._faces}
        assert len(answers) == 1
        self._count_anew()

    def go_back(self, by: int) -> None:
        """Let `/clock` begin again at an earlier time."""
        self._pass_on()
        self.now -= by
        self._tell(self.now)
        self._count_anew()
        self.move(10**6)

    def _pass_on(self) -> None:
        """Let all messages take effect that wait for earlier stamps."""
        if self._uses_stamps:
            self.move(3 * REORDER_NS)

    def _count_anew(self) -> None:
        """Count acknowledgements again: a message is evaluated twice where groups start afresh."""
        if self._is_simulated:  # what is due at a time of `/clock` is taken when it moves on
            self.settle()  # a node that is behind receives only the last of two times
            self.now += 10**6
            self._tell(self.now)
        self.settle()
        self._due = self._faces[0].acknowledged.copy()

    def change(self, transition: int) -> None:
        """Take both nodes through a transition."""
        for face in self._faces:
            client = self._partner.node.create_client(
                ChangeState, f'/{face.name}/fret_monitor/change_state')
            # `configure` may compile
            assert change_state(client, transition, 4 * PATIENCE), face.process.output
            self._partner.node.destroy_client(client)

    def restart(self) -> None:
        """Stop monitoring in both nodes, and start anew."""
        self._pass_on()
        print(f'{monotonic():.3f} restart')
        for topic in () if self._is_simulated else ('x', 'level'):
            self.send(topic)  # else a timeout may be over in the one that is stopped later
        self.change(Transition.TRANSITION_DEACTIVATE)
        wait_until(lambda: not any(publisher.get_subscription_count()
                                   for publisher in self._publishers.values()), 'their end')
        self.change(Transition.TRANSITION_ACTIVATE)
        self.give_values()

    def act(self) -> Act:
        """Return a random message, fault or movement of the clock; and whether it is large."""
        rng = self.rng
        topic = rng.choice(list(TOPICS)[1:])
        ahead, back = rng.choice([1, 2, 5, 7, 20, 50, 200, 1000]), rng.choice([5, 100, 300])
        if rng.random() < 0.02:
            return self.reset, True
        if rng.random() < 0.15:
            return partial(self.garble, topic, rng.choice(GARBAGE)), False
        if not self._is_simulated or rng.random() < 0.6:
            return partial(self.send, topic), False
        if rng.random() < 0.05:
            return partial(self.go_back, back * 10**8), True
        return partial(self.move, ahead * 10**8), False

    def run(self, number: int) -> None:
        """Do so many random acts."""
        acts = deque(self.act() for _ in range(number))
        while acts:
            if acts[0][1]:
                acts.popleft()[0]()
            else:
                self.round(acts)


@contextmanager
def both(path: Path, *, is_simulated: bool, is_late: bool) -> Iterator[list[Face]]:
    """Start both nodes, each in a namespace of its own; neither is configured."""
    with ExitStack() as stack:
        boxes = {name: path.parent / f'blackbox_{name}' for name in NODES}
        options = {name: ('-r', f'__ns:=/{name}', '-p', 'autostart:=false', '-p',
                          f'use_sim_time:={is_simulated}'.lower(), '-p',
                          f'blackbox:={boxes[name]}', '-p', 'blackbox_files:=1000')
                   for name in NODES}
        program = exported_bundle(path)
        faces = [Face('python', NodeProcess('monitor', '-p', f'spec:={path}', *options['python']),
                      is_simulated, is_late, boxes['python']),
                 Face('native', ExportedNode(program, *options['native']), is_simulated, is_late,
                      boxes['native'])]
        for face in faces:
            stack.callback(face.process.kill)
        try:
            yield faces
        except BaseException:  # noqa: B902  whatever ends the test: the logs are shown
            for face in faces:
                print(f'---- {face.name}\n{face.process.output}')
            raise
        for face in faces:
            assert face.process.end() == 0, face.process.output
        compare_files(faces)


def compare_files(faces: Sequence[Face], least: int = 20) -> None:
    """Compare the messages of the files of the black boxes, which are complete after the end."""
    ours, theirs = map(Face.kept, faces)
    assert len(ours) > least
    assert ours == theirs, f'only python: {ours - theirs}\nonly native: {theirs - ours}'


SCENARIOS = {
    'timed': 'policy: timed, unit: 0.5',
    'stamps': 'policy: timed, unit: 0.5, stamp: header, reorder: 0.5',
    'messages': 'policy: relevant_message',
}


def compare_lines(faces: list[Face]) -> int:
    """Compare the logs; return the number of lines that are equal."""
    equal(Face.plain_lines, faces, 'lines')
    equal(lambda face: face.verdicts()[1], faces, 'violations in lines')
    ours, theirs = (face.verdicts()[0] for face in faces)
    common = ours.keys() & theirs.keys()
    # Steps are counted anew after a restart.
    assert not [(ours[key], theirs[key]) for key in common if ours[key].isdisjoint(theirs[key])]
    assert 4 * len(common) > len(ours)
    return len(common) + faces[0].plain_lines().total()


@contextmanager
def traffic_to_both(partner: Partner, stranger: Partner, folder: Path, name: str,
                    seed: int, *, is_late: bool) -> Iterator[Traffic]:
    """Run a scenario; compare the logs at its end."""
    is_simulated = name != 'messages'
    path = bundle(folder, SCENARIOS[name], is_simulated=is_simulated)
    with both(path, is_simulated=is_simulated, is_late=is_late) as faces:
        traffic = Traffic(partner, stranger, faces, Random(seed), is_simulated=is_simulated,
                          uses_stamps=name == 'stamps')
        traffic.begin()
        traffic.send('state', sensor_msgs.CompressedImage(format='broken'))  # keeps its value
        traffic.settle()
        yield traffic
        lines = compare_lines(faces)
        for words in (*LOGGED, *(OF_CLOCK if is_simulated else ['subscribed anew to /joints'])):
            assert words in faces[1].process.output
        print(f'{name}, {seed}: equal are {lines} log lines, {traffic.statuses} statuses in '
              f'{traffic.rounds} reports ({traffic.exact} exact), '
              f'{faces[0].shown_details().total()} details, '
              f'{faces[0].violations.total()} violations')
    assert traffic.exact > 0


@pytest.mark.parametrize('name', ['timed', 'messages'])
def test_both_nodes_publish_and_log_the_same(
    partner: Partner, stranger: Partner, tmp_path: Path, name: str,
) -> None:
    with traffic_to_both(partner, stranger, tmp_path, name, 7, is_late=False) as traffic:
        traffic.join('level', Int32, RELIABLE)  # of another type
        for garbage in GARBAGE:
            traffic.garble('x', garbage)
        traffic.run(30)
        traffic.reset()
        if name == 'timed':
            for _ in range(2):  # a time that jumps may put a timeout off once
                traffic.move(2 * 10**9)
            traffic.send('x', sensor_msgs.Range(range=0.5))
            traffic.run(10)
            traffic.go_back(30 * 10**9)
        else:
            traffic.join('x', sensor_msgs.Range, RELIABLE)
            traffic.join('joints', sensor_msgs.JointState, BEST_EFFORT)
        traffic.restart()
        traffic.run(10)


@thorough
@pytest.mark.timeout(3600)
@pytest.mark.parametrize('name', SCENARIOS)
@pytest.mark.parametrize('seed', range(2))
def test_both_nodes_answer_a_random_hour_with_the_same(
    partner: Partner, stranger: Partner, tmp_path: Path, name: str, seed: int,
) -> None:
    offers = {'level': (Int32, RELIABLE), 'x': (sensor_msgs.Range, RELIABLE),
              'joints': (sensor_msgs.JointState, BEST_EFFORT),
              'state': (sensor_msgs.CompressedImage, RELIABLE)}
    with traffic_to_both(partner, stranger, tmp_path, name, seed, is_late=True) as traffic:
        for number in range(20):
            traffic.run(50)
            topic = traffic.rng.choice(list(offers))
            traffic.join(topic, *offers[topic])
            if number % 7 == 6:
                traffic.restart()
        while name != 'messages' and traffic.passed < 3600 * 10**9:
            traffic.run(10)
