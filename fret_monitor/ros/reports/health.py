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
The state of the monitor on `/diagnostics`, once a second (docs/ros.md, Topics).

There is a status for each requirement and each topic, one for the periods with the policy
periodic, one for the time with the policy timed, one for a gate, one for a black box, one for each
action and lock, one for violations that could not be published, and one for threads that failed.
Each is named `NODE: ITEM`, as diagnostic aggregators expect. `describe_missing` makes the log line
about requirements that are not evaluated yet.
"""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from time import monotonic

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from fret_monitor.model.manifest import ManifestRequirement, ManifestTopic
from fret_monitor.model.policies import Report, Stale, Stamp
from fret_monitor.ros.acting.actions import Actions
from fret_monitor.ros.acting.blackbox import BlackBox, BlackBoxCounts
from fret_monitor.ros.acting.gate import RunningGate
from fret_monitor.ros.acting.reasons import is_withheld_from_start
from fret_monitor.ros.intake.feed import PublisherStatus
from fret_monitor.ros.intake.node_time import are_worth_reading
from fret_monitor.ros.reports.details import LEVELS
from fret_monitor.ros.reports.look_ups import LIMIT_S, LookUpLog
from fret_monitor.ros.reports.silences import SilenceLog, some
from fret_monitor.ros.watch import Watch
from fret_monitor.runtime import Engine, OrderCounts, Silence

from rclpy.node import Node

PERIOD = 1.0  # s between two reports
_MOST_BEHIND = 10**9  # ns


class Health:
    """Publishes diagnostics while `/diagnostics` has a subscriber."""

    def __init__(self, node: Node, engine: Engine,
                 silences: SilenceLog | None = None, period: float | None = None,
                 bundle: str = '', look_ups: LookUpLog | None = None,
                 blackbox: BlackBox | None = None, gate: RunningGate | None = None,
                 actions: Actions | None = None, watch: Watch | None = None) -> None:
        """
        Advertise the topic; the caller then calls `publish` once per `PERIOD`.

        `period` is in seconds, None unless the policy is periodic; `bundle` is the name of the
        bundle, empty if the node has only one.
        """
        self._node = node
        self._engine = engine
        self._manifest = engine.monitor.manifest
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self._prefix = node.get_fully_qualified_name().lstrip('/')
        self._received = [0] * len(self._manifest.topics)
        self._unusable = [0] * len(self._manifest.inputs)
        self._lost = [0] * len(self._manifest.topics)
        self._out_of_order = [OrderCounts()] * len(self._manifest.topics)
        self._behind = [0] * len(self._manifest.topics)
        self._unpublished = 0
        self._silences = silences
        self._look_ups = look_ups
        self._blackbox = blackbox
        self._gate = gate
        self._blackbox_counts = BlackBoxCounts()
        self._actions = actions
        self._watch = watch
        self._failed: dict[str, int] = {}  # by action
        self._period = period
        self._time_counts = engine.time_counts()
        self._bundle = bundle
        self._time = monotonic()

    def publish(self, statuses: Sequence[PublisherStatus]) -> None:
        """Publish the present state; `statuses` are the publishers of each topic, in order."""
        rates, unusable = list(self._rates()), self._newly_unusable()
        lost, periods = list(self._newly_lost(statuses)), list(self._of_periods())
        self._behind = [self._engine.take_behind(index)
                        for index in range(len(self._manifest.topics))]
        order = [list(self._of_order(index)) for index in range(len(self._manifest.topics))]
        unpublished, blackbox = list(self._of_unpublished()), list(self._of_blackbox())
        actions = list(self._of_actions())
        if not self._publisher.get_subscription_count():
            return
        array = DiagnosticArray()
        array.header.stamp = self._node.get_clock().now().to_msg()
        silences = self._silences.present() if self._silences else {}
        silent = {index: item for index, item in silences.items() if item.is_silent}
        array.status = [
            *(self._of_requirement(index, item, silent)
              for index, item in enumerate(self._manifest.requirements)),
            *(self._of_topic(index, status, rates[index], silences, [
                *self._of_silence(index, silent),
                *self._of_messages(index, unusable, lost[index]), *order[index]])
              for index, status in enumerate(statuses)),
            *self._of_gate(), *actions, *periods, *blackbox, *unpublished, *self._of_failures()]
        self._publisher.publish(array)

    def close(self) -> None:
        """Withdraw the topic."""
        self._node.destroy_publisher(self._publisher)

    def _rates(self) -> Iterator[float]:
        """Yield for each topic its messages per second of real time since the last report."""
        since, self._time = self._time, monotonic()
        for index in range(len(self._manifest.topics)):
            received = self._engine.topic_counts(index).messages
            yield (received - self._received[index]) / max(self._time - since, 1e-3)
            self._received[index] = received

    def _newly_unusable(self) -> set[int]:
        """Return the inputs that had an unusable field since the last report."""
        before = self._unusable
        self._unusable = [self._engine.input_counts(index).unusable
                          for index in range(len(before))]
        return {index for index, count in enumerate(self._unusable) if count > before[index]}

    def _newly_lost(self, statuses: Sequence[PublisherStatus]) -> Iterator[int]:
        """Yield for each topic how many messages were lost since the last report."""
        for index, status in enumerate(statuses):
            yield status.lost - self._lost[index]
            self._lost[index] = status.lost

    def _of_order(self, index: int) -> Iterator[tuple[bytes, str]]:
        before, now = self._out_of_order[index], self._engine.order_counts(index)
        self._out_of_order[index] = now
        if now.late > before.late:
            yield DiagnosticStatus.WARN, f'{now.late - before.late} late since the last report'
        if now.overflows > before.overflows:
            yield DiagnosticStatus.WARN, \
                f'{now.overflows - before.overflows} too early since the last report'
        if now.ahead > before.ahead:
            yield DiagnosticStatus.WARN, \
                f'{now.ahead - before.ahead} ahead of the clock since the last report'
        if self._behind[index] > _MOST_BEHIND:
            yield DiagnosticStatus.WARN, \
                f'evaluated up to {self._behind[index] / 1e9:.1f} s after reception'

    def _of_periods(self) -> Iterator[DiagnosticStatus]:
        before, self._time_counts = self._time_counts, self._engine.time_counts()
        counts = self._time_counts
        if self._engine.is_timed:
            went_back = counts.restarts > before.restarts
            is_full = counts.overflows > before.overflows
            message = 'went back since the last report' if went_back else \
                'more changes than max_rate allows' if is_full else 'passes'
            yield self._status(
                f'time of {self._bundle or self._manifest.name}',
                DiagnosticStatus.WARN if went_back or is_full else DiagnosticStatus.OK,
                message, {'restarts': counts.restarts, 'overflows': counts.overflows})
        if self._period is None:
            return
        level, message = DiagnosticStatus.OK, 'in time'
        if are_worth_reading(before, counts):
            level = DiagnosticStatus.WARN
            message = (f'{counts.missed - before.missed} missed, '
                       f'{counts.late - before.late} late since the last report')
        yield self._status(f'periods of {self._bundle or self._manifest.name}', level, message, {
            'period': f'{self._period:g}', 'taken': counts.periods, 'late': counts.late,
            'missed': counts.missed, 'restarts': counts.restarts})

    def _of_gate(self) -> Iterator[DiagnosticStatus]:
        gate = self._manifest.gate
        if self._gate is not None and gate is not None:
            yield self._status(f'gate {gate.name}', *self._gate.status())

    def _of_failures(self) -> Iterator[DiagnosticStatus]:
        """Yield a status if threads or timers of the node have failed."""
        if self._watch is not None and (failures := self._watch.failures):
            yield self._status('threads', DiagnosticStatus.ERROR, f'failed: {", ".join(failures)}',
                               dict(failures))

    def _of_unpublished(self) -> Iterator[DiagnosticStatus]:
        """Yield a status if violations could not be published; none if all were published."""
        before, self._unpublished = self._unpublished, self._engine.unpublished
        if not self._unpublished:
            return
        more = self._unpublished - before
        level, message = (DiagnosticStatus.ERROR, f'{more} not published since the last report') \
            if more else (DiagnosticStatus.WARN, 'some were not published')
        yield self._status(f'violations of {self._bundle or self._manifest.name}', level, message,
                           {'not published': self._unpublished})

    def _of_blackbox(self) -> Iterator[DiagnosticStatus]:
        if self._blackbox is None:
            return
        before, self._blackbox_counts = self._blackbox_counts, self._blackbox.counts()
        counts = self._blackbox_counts
        old, new = before.messages, counts.messages
        troubles = [text for is_wrong, text in (
            (counts.failed > before.failed, 'cannot write'),
            (new.left_out > old.left_out, 'messages are larger than `blackbox_bytes`'),
            (new.early > old.early, '`blackbox_bytes` is too little for `blackbox_seconds`'),
        ) if is_wrong]
        yield self._status(
            f'black box of {self._bundle or self._manifest.name}',
            DiagnosticStatus.WARN if troubles else DiagnosticStatus.OK,
            '; '.join(troubles) or 'keeps the last messages', {
                'written': counts.written, 'not written': counts.failed,
                'kept': new.kept, 'left out': new.left_out, 'overwritten early': new.early})

    def _of_actions(self) -> Iterator[DiagnosticStatus]:
        """Yield a status for each action: what it did, and whether it failed."""
        for item, counts in self._actions.counts() if self._actions else ():
            more = counts.failed - self._failed.get(item.name, 0)
            self._failed[item.name] = counts.failed
            level, message = (DiagnosticStatus.ERROR, f'{more} failed since the last report') \
                if more else (DiagnosticStatus.OK, 'ready')
            yield self._status(f'action {item.name}', level, message, {
                'started': counts.started, 'sent': counts.sent, 'failed': counts.failed,
                'skipped': counts.skipped})
        conditions = self._engine.conditions()
        for name, text in self._actions.lock_states() if self._actions else ():
            state = text(conditions)
            level = DiagnosticStatus.OK if state == 'free' else DiagnosticStatus.WARN
            yield self._status(f'lock {name}', level, state, {})

    def _named(self, places: Collection[int]) -> str:
        return ', '.join(self._manifest.inputs[place].name for place in places)

    def _of_requirement(self, index: int, item: ManifestRequirement,
                        silent: Collection[int]) -> DiagnosticStatus:
        counts = self._engine.requirement_counts(index)
        missing = [place for place in item.inputs if self._engine.value(place) is None]
        old = [place for place in item.inputs if place in silent]
        violating = [place for place in old
                     if self._manifest.inputs[place].stale is Stale.VIOLATE]
        if violating and counts.is_violated:
            level = LEVELS[item.severity]
            message = f'violated: no message for {self._named(violating)}'
        elif is_withheld_from_start(self._engine, index):
            level, message = LEVELS[item.severity], 'violated since the first message'
        elif missing:
            level, message = DiagnosticStatus.WARN, f'no value yet of {self._named(missing)}'
        elif not counts.steps:
            level, message = DiagnosticStatus.WARN, 'not evaluated yet'
        elif not counts.is_violated and old:
            level = DiagnosticStatus.WARN
            message = f'satisfied, on old values of {self._named(old)}'
        elif not counts.is_violated:
            level, message = DiagnosticStatus.OK, 'satisfied'
        else:
            level, message = LEVELS[item.severity], 'violated'
        is_timed = self._engine.is_timed
        return self._status(item.id, level, message, {
            'evaluations' if is_timed else 'steps': counts.steps,
            'violating evaluations' if is_timed else 'violations': counts.violations,
            'announced': counts.announced,
            **({'verdict': str(counts.verdict).lower()}
               if item.report is Report.OCCURRENCE else {}),
            'text': ' '.join((item.title or item.text).split())})

    def _of_silence(self, index: int, silent: dict[int, Silence]) -> Iterator[tuple[bytes, str]]:
        found = [place for place in self._manifest.topics[index].inputs if place in silent]
        if found:
            is_violating = self._manifest.inputs[found[0]].stale is Stale.VIOLATE
            yield (DiagnosticStatus.ERROR if is_violating else DiagnosticStatus.WARN,
                   describe_silences({self._manifest.inputs[place].name: silent[place].lasted
                                      for place in found}))

    def _of_messages(self, index: int, unusable: set[int],
                     lost: int) -> Iterator[tuple[bytes, str]]:
        found = [place for place in self._manifest.topics[index].inputs if place in unusable]
        if found:
            yield DiagnosticStatus.WARN, f'fields cannot be used: {self._named(found)}'
        missing = self._look_ups.missing if self._look_ups else ()
        absent = [place for place in self._manifest.topics[index].inputs if place in missing]
        if absent:
            yield DiagnosticStatus.WARN, \
                f'no message has had the names for {LIMIT_S:g} s: {self._named(absent)}'
        if lost > 0:
            yield DiagnosticStatus.WARN, f'{lost} lost since the last report'

    def _of_topic(self, index: int, status: PublisherStatus, rate: float,
                  silences: Mapping[int, Silence],
                  troubles: Sequence[tuple[bytes, str]]) -> DiagnosticStatus:
        item = self._manifest.topics[index]
        counts = self._engine.topic_counts(index)
        found = [*_troubles(item, status), *troubles]
        if not status.publishers and not status.other_types:
            found.append((DiagnosticStatus.WARN, 'no publisher'))
        names = {self._manifest.inputs[place].name: place for place in item.inputs}
        return self._status(
            f'topic {self._node.resolve_topic_name(item.name)}'
            f'{" for " if self._bundle else ""}{self._bundle}',
            max([level for level, _ in found], default=DiagnosticStatus.OK),
            '; '.join(message for _, message in found) or 'received', {
                'received': counts.messages, 'rate': f'{rate:.1f}',
                'undecodable': counts.undecodable, 'lost': status.lost,
                'behind': f'{self._behind[index] / 1e9:.3f}', 'publishers': status.publishers,
                **({'late': self._out_of_order[index].late,
                    'too early': self._out_of_order[index].overflows,
                    'ahead': self._out_of_order[index].ahead}
                   if self._manifest.stamp is Stamp.HEADER else {}),
                **{f'unusable {name}': self._unusable[place] for name, place in names.items()
                   if self._unusable[place]},
                **{f'silences {name}': silences[place].count for name, place in names.items()
                   if place in silences}})

    def _status(self, name: str, level: bytes, message: str,
                values: dict[str, object]) -> DiagnosticStatus:
        return DiagnosticStatus(
            name=f'{self._prefix}: {name}', level=level, message=message,
            hardware_id=self._manifest.component,
            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()])


def _troubles(topic: ManifestTopic, status: PublisherStatus) -> Iterator[tuple[bytes, str]]:
    """Yield the problems with the publishers of a topic, each with its level."""
    if status.other_types:
        yield DiagnosticStatus.ERROR, (
            f'a publisher of {", ".join(status.other_types)}, and not {topic.message_type}')
    if status.unmatched:
        yield DiagnosticStatus.ERROR, f'not received: {", ".join(status.unmatched)}'


def describe_silences(lasted: Mapping[str, int]) -> str:
    """Return for how long nothing came of each input, given in nanoseconds."""
    inputs: dict[str, list[str]] = {}
    for name, duration in lasted.items():
        inputs.setdefault(f'{duration / 1e9:.1f}', []).append(name)
    return 'nothing ' + ', '.join(
        f'for {seconds} s of {", ".join(names)}' for seconds, names in inputs.items())


def describe_missing(engine: Engine, statuses: Sequence[PublisherStatus],
                     full_name: Callable[[str], str]) -> str | None:
    """
    Return which requirements wait for which topics; None if no requirement waits.

    `full_name` resolves the name of a topic in the bundle.
    """
    manifest = engine.monitor.manifest
    waits = [_awaited(engine, index) for index in range(len(manifest.requirements))]
    waiting = [item for item, places in zip(manifest.requirements, waits) if places]
    if not waiting:
        return None
    awaited = set().union(*waits)
    reasons = []
    for index, topic in enumerate(manifest.topics):
        names = [_awaited_name(engine, place) for place in topic.inputs if place in awaited]
        if names:
            usable = 'usable ' if engine.topic_counts(index).messages else ''
            reasons.append(f'nothing {usable}received on {full_name(topic.name)} '
                           f'({_publishers(topic, statuses[index])}) for {some(names)}')
    return (f'{some([item.id for item in waiting])} {"is" if len(waiting) == 1 else "are"} '
            f'not evaluated yet: {some(reasons, "; ")}')


def _awaited(engine: Engine, index: int) -> set[int]:
    """
    Return the inputs for which a requirement waits before its first evaluation.

    These are the inputs without a value. If all have an initial value and there was no step yet,
    they are the inputs of which no message was received.
    """
    inputs = engine.monitor.manifest.requirements[index].inputs
    if is_withheld_from_start(engine, index):
        return set()
    missing = {place for place in inputs if engine.value(place) is None}
    if missing or engine.requirement_counts(index).steps:
        return missing
    return {place for place in inputs if not engine.input_counts(place).received}


def _awaited_name(engine: Engine, place: int) -> str:
    name = f"'{engine.monitor.manifest.inputs[place].name}'"
    return name if engine.value(place) is None else f'{name} (it has its initial value)'


def _publishers(topic: ManifestTopic, status: PublisherStatus) -> str:
    count = f'{status.publishers} publisher{"" if status.publishers == 1 else "s"}'
    return f'{count} of {topic.message_type}' if status.other_types else count
