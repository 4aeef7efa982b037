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
The actions of a bundle on a node: what follows violations and their ends.

Locks are published by the announcer in C (`hot_path.Announcer`). All other actions start in one
thread, which waits in C for a change of a requirement's state; services are called in a thread for
each action, so that a slow one delays no other. No verdict waits for an action.
"""

from contextlib import ExitStack
from dataclasses import dataclass, field, replace
import struct
from threading import Event, Lock as Mutex, Thread
from time import monotonic

from fret_monitor.model.manifest import Manifest, ManifestAction
from fret_monitor.model.policies import ActionKind
from fret_monitor.ros.acting.action_calls import ActionCall, CallError
from fret_monitor.ros.intake import native_lifetimes
from fret_monitor.ros.intake.fields import message_class
from fret_monitor.ros.intake.hot_path import Lock
from fret_monitor.ros.intake.throttle import Throttle
from fret_monitor.ros.settings.endpoint_types import one_type
from fret_monitor.ros.watch import ErrorKeeper
from fret_monitor.runtime import Engine, State
from fret_monitor.runtime.reporting import ActionCounts

from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile

_DEPTH = 10
_LONGEST_WAIT_S = 0.5
_LOG_INTERVAL_S = 1.0
_JOIN_S = 2.0
_TIME = struct.Struct('<iI')
_SECOND_NS = 10 ** 9


class Actions:
    """
    The actions of one monitor.

    Between `start` and `stop` they follow an engine. `locks` are for its announcer.
    """

    def __init__(self, node: Node, manifest: Manifest) -> None:
        """
        Create the publishers and clients.

        Raises
        ------
        MessageTypeError
            if a type is not installed.
        Refusal
            if the process uses a topic or service with another type.
        """
        self._node = node
        self._manifest = manifest
        self._owned = ExitStack()
        self.locks: list[Lock] = []
        self._running: _ActionThread | None = None
        self._runners: dict[int, _Publishing | _Calling] = {}
        with ExitStack() as undo:
            undo.callback(self.close)
            for index, action in enumerate(manifest.actions):
                self._create(index, action)
            undo.pop_all()

    def _create(self, index: int, action: ManifestAction) -> None:
        node = self._node
        if action.kind in (ActionKind.CALL, ActionKind.TRANSITION):
            call = ActionCall(node, action)
            self._owned.callback(call.close)
            self._runners[index] = _Calling(node, action, call)
            return
        kind = message_class(action.interface)
        with one_type(node, 'publish on', action.target, action.interface):
            publisher = node.create_publisher(kind, action.target, QoSProfile(depth=_DEPTH))
        self._owned.callback(node.destroy_publisher, publisher)
        if action.kind is ActionKind.LOCK:
            users = tuple(number for number, item in enumerate(self._manifest.requirements)
                          if index in item.on_violation)
            self.locks.append(Lock(publisher, users, action.period))
        else:
            self._runners[index] = _Publishing(node, action, publisher)

    def prepare(self, engine: Engine) -> None:
        """Let an engine keep the states that actions follow; before messages are delivered."""
        if self._manifest.actions:
            engine.follow_states()

    def start(self, engine: Engine) -> None:
        """Follow an engine, in a thread; after `prepare`."""
        for runner in self._runners.values():
            if isinstance(runner, _Calling):
                runner.kept = ErrorKeeper()
        if self._runners:
            self._running = _ActionThread(engine, self._manifest, self._runners)

    def stop(self) -> None:
        """Close the engine, and wait until no action runs; idempotent."""
        if self._running is not None:
            self._running.end()
            self._running = None

    def close(self) -> None:
        """Stop, and remove publishers and clients from the node."""
        self.stop()
        self._owned.close()

    @property
    def turns(self) -> int | None:
        """How often the thread has looked for work; None without a thread."""
        return None if self._running is None else self._running.turns

    @property
    def failure(self) -> Exception | None:
        """The error that ended the thread or a call, if any."""
        kept = [runner.kept for runner in self._runners.values() if isinstance(runner, _Calling)]
        if self._running is not None:
            kept.append(self._running.kept)
        return next((item.error for item in kept if item.error is not None), None)

    def counts(self) -> list[ActionCounts]:
        """Return the counts of all actions but locks, in the order of the manifest."""
        return [runner.counts for runner in self._runners.values()]

    def describe(self) -> str:
        """Return the log line at the start: all locks and actions; '' if there are none."""
        node, found = self._node, self._manifest.actions
        parts = [f"lock '{item.name}' on {node.resolve_topic_name(item.target)}, "
                 f'{1e9 / item.period:g} Hz' for item in found if item.kind is ActionKind.LOCK]
        parts += [f"action '{item.name}' {_effect(node, item)}" for item in found
                  if item.kind is not ActionKind.LOCK]
        return '; '.join(parts)


def _effect(node: Node, action: ManifestAction) -> str:
    match action.kind:
        case ActionKind.LOCK | ActionKind.PUBLISH:
            return f'publishes on {node.resolve_topic_name(action.target)}'
        case ActionKind.CALL:
            return f'calls {node.resolve_service_name(action.target)}'
        case ActionKind.TRANSITION:
            return f'brings {action.target} to {action.state}'


class _Publishing:
    """Publishes the message of an action, once or at a rate."""

    def __init__(self, node: Node, action: ManifestAction, publisher: Publisher) -> None:
        self.action = action
        self.counts = ActionCounts()
        self._node = node
        self._publisher = publisher
        self._throttle = Throttle(_LOG_INTERVAL_S)
        self._payload = bytearray(action.payload)
        self._due = float('inf')
        self._end = 0.0
        self._is_first_due = False  # sent even if the violation is over by then

    def start(self, now: float, is_over: Event) -> bool:
        """Begin to publish; return True."""
        self._is_first_due = True
        self.counts = replace(self.counts, started=self.counts.started + 1)
        self._end = now + self.action.duration / 1e9 if self.action.duration else float('inf')
        if self._due > now:
            self._due = now
        return True

    def skip(self) -> None:
        self.counts = replace(self.counts, skipped=self.counts.skipped + 1)

    def due(self) -> float:
        return self._due

    def run(self, now: float, is_violated: bool) -> None:
        """Publish a message if one is due."""
        period = self.action.period / 1e9
        if self._due > now:
            return
        is_over = now >= self._end or not self.action.duration and not is_violated
        if period and is_over and not self._is_first_due:
            self._due = float('inf')
            return
        self._publish()
        self._is_first_due = False
        self._due = max(self._due + period, now) if period else float('inf')

    def _publish(self) -> None:
        if self.action.stamp_at is not None:
            seconds, rest = divmod(self._node.get_clock().now().nanoseconds, _SECOND_NS)
            _TIME.pack_into(self._payload, self.action.stamp_at, seconds, rest)
        try:
            self._publisher.publish(bytes(self._payload))
        except RuntimeError as error:  # also of a context that was shut down
            self.counts = replace(self.counts, failed=self.counts.failed + 1)
            if self._node.context.ok() and self._throttle.passes():
                self._node.get_logger().error(f"the action '{self.action.name}' failed: {error}")
        else:
            self.counts = replace(self.counts, sent=self.counts.sent + 1)

    def end(self) -> None:
        self._due = float('inf')


class _Calling:
    """Calls the service of an action in a thread, one call at a time."""

    def __init__(self, node: Node, action: ManifestAction, call: ActionCall) -> None:
        self.action = action
        self._counts = ActionCounts()
        self._node = node
        self._call = call
        self._mutex = Mutex()  # guards the counts
        self.kept = ErrorKeeper()
        self._thread: Thread | None = None

    @property
    def counts(self) -> ActionCounts:
        with self._mutex:
            return self._counts

    def _count(self, **more: int) -> None:
        with self._mutex:
            self._counts = replace(self._counts, **{
                name: getattr(self._counts, name) + count for name, count in more.items()})

    def start(self, now: float, is_over: Event) -> bool:
        """Begin a call; return False if one is under way."""
        if self._thread is not None and self._thread.is_alive():
            self.skip()
            return False
        self._count(started=1)
        thread = Thread(target=self._run, args=(is_over,), daemon=True,
                        name=f'action {self.action.name}')
        try:
            thread.start()
        except RuntimeError as error:  # too little memory, or too many threads
            self._fail(f': {error}')
        else:
            self._thread = thread
        return True

    def _fail(self, why: str) -> None:
        self._count(failed=1)
        self._node.get_logger().error(f"the action '{self.action.name}' failed{why}")

    def _run(self, is_over: Event) -> None:
        with self.kept:
            self._run_call(is_over)

    def _run_call(self, is_over: Event) -> None:
        try:
            self._call.run(is_over)
        except CallError as error:
            if not is_over.is_set():
                tries = self.action.retries + 1
                self._fail(f'{f" {tries} times" if tries > 1 else ""}: {error}')
        else:
            self._count(sent=1)

    def skip(self) -> None:
        self._count(skipped=1)

    def due(self) -> float:
        return float('inf')

    def run(self, now: float, is_violated: bool) -> None:
        """Do nothing: the thread runs by itself."""

    def end(self) -> None:
        if self._thread is not None:
            self._thread.join(_JOIN_S)


@dataclass
class _Watched:
    """A requirement as it was when its state was looked at last, and what it has scheduled."""

    occurrences: int = 0
    is_violated: bool = False
    scheduled: list[tuple[float, int]] = field(default_factory=list)  # when, and which action


class _ActionThread:
    """The thread that starts actions while an engine runs."""

    def __init__(self, engine: Engine, manifest: Manifest,
                 runners: dict[int, _Publishing | _Calling]) -> None:
        self.kept = ErrorKeeper()
        self.turns = 0
        self._engine = engine
        self._manifest = manifest
        self._runners = runners
        self._watched = [_Watched() for _ in manifest.requirements]
        self._last_start: dict[int, float] = {}
        self._is_over = Event()
        self._thread = Thread(target=self._run, name='actions', daemon=True)
        native_lifetimes.keep(self)
        self._thread.start()

    def end(self) -> None:
        """Close the engine, which ends the wait, and wait for all threads."""
        self._engine.close()
        self._is_over.set()
        if self._thread.is_alive():
            self._thread.join()
        for runner in self._runners.values():
            runner.end()
        native_lifetimes.release(self)

    def _run(self) -> None:
        with self.kept:
            seen = 0
            while not self._is_over.is_set():
                self.turns += 1
                seen, states = self._engine.states(seen, self._time_left())
                now = monotonic()
                for index, found in enumerate(states):
                    self._follow(index, found.occurrences, found.state is State.VIOLATED, now)
                self._start_due(now)
                for number, runner in self._runners.items():
                    runner.run(now, self._is_violated(number))

    def _time_left(self) -> float:
        """Return the seconds until something is due, in whole milliseconds, rounded up."""
        times = [when for item in self._watched for when, _ in item.scheduled]
        first = min([*times, *(runner.due() for runner in self._runners.values())],
                    default=float('inf'))
        return min(max(0.0, first - monotonic() + 0.000999), _LONGEST_WAIT_S)

    def _follow(self, index: int, occurrences: int, is_violated: bool, now: float) -> None:
        """Schedule what follows a violation that has begun, or one that has ended."""
        watched, item = self._watched[index], self._manifest.requirements[index]
        has_begun = occurrences > watched.occurrences
        has_ended = not is_violated and (watched.is_violated or has_begun)
        if has_begun or has_ended:
            watched.scheduled = []  # of the state before: it did not last
        if has_begun:
            self._schedule(watched, item.on_violation, now, is_over=has_ended)
        if has_ended:
            self._schedule(watched, item.on_end, now, is_over=False)
        watched.occurrences, watched.is_violated = occurrences, is_violated

    def _schedule(self, watched: _Watched, actions: tuple[int, ...], now: float,
                  is_over: bool) -> None:
        for number in actions:
            after = self._manifest.actions[number].after / 1e9
            if number in self._runners and not (after and is_over):
                watched.scheduled.append((now + after, number))

    def _start_due(self, now: float) -> None:
        for watched in self._watched:
            due = [number for when, number in watched.scheduled if when <= now]
            watched.scheduled = [item for item in watched.scheduled if item[0] > now]
            for number in due:
                self._start(number, now)

    def _start(self, number: int, now: float) -> None:
        runner = self._runners[number]
        cooldown = runner.action.cooldown / 1e9
        if cooldown and now < self._last_start.get(number, float('-inf')) + cooldown:
            runner.skip()
            return
        if runner.start(now, self._is_over):
            self._last_start[number] = now

    def _is_violated(self, number: int) -> bool:
        """Whether a requirement is violated that the action follows."""
        return any(watched.is_violated and number in item.on_violation
                   for watched, item in zip(self._watched, self._manifest.requirements))
