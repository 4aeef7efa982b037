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
The actions and gates of a bundle, resolved: names, types, and messages as bytes.

All mistakes are added to the problems, each at its place.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
import re

from fret_monitor.bundle.bundle import ActionEntry, Bundle, GateEntry
from fret_monitor.elaboration.acting_topics import check_topics, LOCK_TYPE
from fret_monitor.elaboration.instances import key_ranges
from fret_monitor.elaboration.message_values import is_given, message_bytes
from fret_monitor.elaboration.signals import find_layout, FindMessage
from fret_monitor.logic.specification import Gate, Property, Signal
from fret_monitor.messages.installed import check_complete, listed
from fret_monitor.messages.layout import MessageLayout
from fret_monitor.messages.serialize import has_stamp, STAMP_AT
from fret_monitor.model.diagnostics import CompileError, did_you_mean, Problems, Text
from fret_monitor.model.manifest import EVENTS, events_of, ManifestAction, ManifestGate
from fret_monitor.model.names import absolute, shown
from fret_monitor.model.payload import PayloadPart
from fret_monitor.model.policies import ActionKind, Otherwise, Policy, Stale, Stamp

_BEYOND_REQUEST = re.compile(r'\bresponse\b|\brequest\[[1-9]')
_GATED_POLICIES = (Policy.EVERY_MESSAGE, Policy.RELEVANT_MESSAGE, Policy.TIMED)


def resolve_acting(bundle: Bundle, signals: Iterable[Signal], find_message: FindMessage,
                   problems: Problems) -> tuple[tuple[ManifestAction, ...], tuple[Gate, ...]]:
    """Return the actions and the gates of a bundle; those with a mistake are left out."""
    if not bundle.actions and not bundle.gates and not _uses(bundle):
        return (), ()
    reader = _Acting(bundle, tuple(signals), find_message, problems)
    actions = [reader.action(entry) for entry in bundle.actions]
    gates = [reader.gate(entry) for entry in bundle.gates]
    reader.check()
    return tuple(filter(None, actions)), tuple(filter(None, gates))


def _uses(bundle: Bundle) -> dict[str, Text]:
    """Return the names of the actions that requirements use, each with its first place."""
    found: dict[str, Text] = {}
    for item in bundle.requirements:
        for name in (*item.on_violation, *item.on_end):
            found.setdefault(name.value, name)
    return found


def _nanoseconds(seconds: Fraction | None) -> int:
    return round((seconds or 0) * 10 ** 9)


def _period(rate: Fraction | None) -> int:
    return round(10 ** 9 / rate) if rate else 0


@dataclass(frozen=True)
class _Acting:
    bundle: Bundle
    signals: tuple[Signal, ...]
    find_message: FindMessage
    problems: Problems
    unusable: set[str] = field(default_factory=set)
    """Types that are not installed, or cannot be read."""

    # -- actions ----------------------------------------------------------------------------------

    def action(self, entry: ActionEntry) -> ManifestAction | None:
        """Return an action, None if it has a mistake."""
        payload, stamp_at = b'', None
        parts: tuple[PayloadPart, ...] = ()
        interface = LOCK_TYPE if entry.kind is ActionKind.LOCK else ''
        if entry.kind in (ActionKind.PUBLISH, ActionKind.CALL):
            layout = self._layout(entry.type, '_Request' if entry.kind is ActionKind.CALL else '')
            if layout is None or entry.type is None:
                return None
            interface = entry.type.value
            payload, parts = message_bytes(
                layout, entry.content, self.problems,
                key_ranges(self.bundle.instance_variables, self.signals))
            if entry.kind is ActionKind.PUBLISH and has_stamp(layout) and \
                    not is_given(entry.content, layout.fields[0].name, 'stamp'):
                stamp_at = STAMP_AT
        if entry.target is None:
            return None
        return ManifestAction(
            name=entry.name.value, kind=entry.kind, target=entry.target.value,
            interface=interface, payload=payload, parts=parts, stamp_at=stamp_at,
            period=_period(entry.rate), duration=_nanoseconds(entry.duration),
            timeout=_nanoseconds(entry.timeout), retries=entry.retries,
            after=_nanoseconds(entry.after), cooldown=_nanoseconds(entry.cooldown),
            state=entry.state)

    def _layout(self, type_: Text | None, part: str) -> MessageLayout | None:
        """Return the layout of a message, or of a service's part; None with a problem."""
        if type_ is None:
            return None
        try:
            layout = find_layout(type_.value + part, type_, self.find_message)
            check_complete(layout, type_.span)
        except CompileError as error:
            self.problems.extend(error.diagnostics)
            self.unusable.add(type_.value)
            return None
        return layout

    # -- gates ------------------------------------------------------------------------------------

    def gate(self, entry: GateEntry) -> Gate | None:
        """Return a gate, None if it has a mistake."""
        layout = self._layout(entry.type, '_Response' if entry.is_service else '')
        content = message_bytes(layout, entry.content, self.problems)[0] \
            if layout and entry.content else b''
        self._check_sides(entry)
        self._check_keep(entry)
        if None in (entry.source, entry.target, entry.otherwise) or layout is None:
            return None
        assert entry.source and entry.target and entry.type and entry.otherwise
        is_stamped = not entry.is_service and has_stamp(layout) and not is_given(
            entry.content, layout.fields[0].name, 'stamp') and entry.otherwise is not \
            Otherwise.DROP
        return Gate(ManifestGate(
            name=entry.name.value, source=entry.source.value, target=entry.target.value,
            interface=entry.type.value, is_service=entry.is_service, topic=None,
            otherwise=entry.otherwise, hold=_nanoseconds(entry.hold), substitute=content,
            period=_period(entry.rate), stamp_at=STAMP_AT if is_stamped else None,
            is_open_when_stale=entry.is_open_when_stale, latches=entry.latches,
            open_after=_nanoseconds(entry.open_after), timeout=_nanoseconds(entry.timeout)),
            keep=tuple(name.value for name in entry.keep), place=entry.name.span,
            otherwise_place=entry.otherwise_place,
            keep_places=tuple(name.span for name in entry.keep))

    def _check_sides(self, entry: GateEntry) -> None:
        """Check the topic that a gate reads, against itself and the inputs on it."""
        source, target = entry.source, entry.target
        if source is None:
            return
        if target and absolute(source.value) == absolute(target.value):
            self.problems.error(
                f'the gate {shown(entry.name.value)} leads from {shown(source.value)} to itself',
                target.span, 'what it lets through would come back to it',
                f'to: {target.value}_raw   # the name of the real server' if entry.is_service
                else f'to: {target.value}_checked   # the name that the subscriber reads')
        judged = events_of(source.value) if entry.is_service else source.value
        for item in self.bundle.inputs:
            if item.topic is not None and item.topic.value != judged and \
                    absolute(item.topic.value) == absolute(judged):
                self.problems.error(
                    f'{shown(source.value)} is written in two ways', source.span,
                    f"the input '{item.name}' has {shown(item.topic.value)}",
                    f'service: {item.topic.value.removesuffix(EVENTS)}' if entry.is_service
                    else f'from: {item.topic.value}')
                return

    def _check_keep(self, entry: GateEntry) -> None:
        """Check the ids that a gate keeps."""
        if 'requirements' in self.bundle.cut:
            return
        for name in entry.keep:
            if name.value not in self.bundle.ids:
                self.problems.error(
                    f'no requirement has the id {shown(name.value)}', name.span, 'unknown id',
                    did_you_mean(name.value, self.bundle.ids) or listed(self.bundle.ids))

    # -- all together -----------------------------------------------------------------------------

    def check(self) -> None:
        """Check what concerns several actions, gates and requirements."""
        if self.bundle.gates:
            self._check_policy(self.bundle.gates[0])
        self._check_uses()
        self._check_kept()
        check_topics(self.bundle, self.unusable, self.problems)

    def _check_policy(self, entry: GateEntry) -> None:
        """Refuse policies under which a message is not judged when it comes."""
        bundle = self.bundle
        if bundle.policy not in _GATED_POLICIES:
            self.problems.error(
                f'gates cannot judge each message under the policy {bundle.policy.value}',
                bundle.policy_place or entry.name.span,
                f'the gate {shown(entry.name.value)} needs a step for each message',
                'policy: ' + (Policy.TIMED if bundle.policy is Policy.PERIODIC
                              else Policy.RELEVANT_MESSAGE).value)
        elif bundle.stamp is Stamp.HEADER:
            self.problems.error(
                f'the gate {shown(entry.name.value)} cannot wait for earlier stamps',
                entry.name.span, 'with stamp: header a message waits for others',
                'stamp: received')

    def _check_uses(self) -> None:
        bundle = self.bundle
        names = [entry.name.value for entry in bundle.actions]
        uses = _uses(bundle)
        known = bundle.acting_names - {entry.name.value for entry in bundle.gates}
        for name, place in uses.items():
            if name not in known and 'actions' not in bundle.cut:
                self.problems.error(
                    f'no action has the name {shown(name)}', place.span, 'unknown action',
                    did_you_mean(name, names) or (
                        listed(names) if names else
                        f'actions:\n  {name}: {{lock: {{topic: e_stop}}}}'))
        ended = {name.value: name for item in bundle.requirements for name in item.on_end}
        for entry in bundle.actions:
            if entry.name.value not in uses:
                self.problems.warning(
                    f'no requirement uses the action {shown(entry.name.value)}', entry.name.span,
                    'it never starts', f'on_violation: [{entry.name.value}]')
            place_of_end = ended.get(entry.name.value)
            if place_of_end is not None:
                self._check_at_end(entry, place_of_end)

    def _check_at_end(self, entry: ActionEntry, place: Text) -> None:
        if entry.kind is ActionKind.LOCK:
            self.problems.error(
                f'{shown(entry.name.value)} is a lock, which is freed by itself', place.span,
                'a lock follows a violation and its end',
                f'on_violation: [{entry.name.value}]')
        elif entry.rate is not None and entry.duration is None:
            self.problems.error(
                f'{shown(entry.name.value)} would never end', place.span,
                "at a rate without 'for' it is published until the violation is over",
                'for: 2   # seconds, in the action')

    def _check_kept(self) -> None:
        """Refuse a requirement that two gates keep."""
        first: dict[str, GateEntry] = {}
        for entry in self.bundle.gates:
            for name in entry.keep:
                other = first.setdefault(name.value, entry)
                if other is not entry:
                    self.problems.error(
                        f'two gates keep {shown(name.value)}', name.span,
                        f'{shown(other.name.value)} keeps it already',
                        'a requirement has one verdict: write it twice, with two ids')


def check_judged(properties: Iterable[Property], gates: Iterable[Gate],
                 signals: Iterable[Signal], bundle: Bundle, problems: Problems) -> None:
    """
    Refuse what a gate cannot judge by.

    That is what speaks of the future or of a probability, `stale: open` for inputs that violate
    while they are stale, and fields of a service's events that a request has not. A lock is
    refused for a probability, too.
    """
    known = {signal.name: signal for signal in signals}
    items = {item.id: item for item in properties}
    _check_locks(items, bundle, problems)
    places = {entry.name.value: entry.stale_place for entry in bundle.gates}
    fields = {entry.name.value: entry.field or entry.name for entry in bundle.inputs}
    for gate in gates:
        read = dict.fromkeys(name for id_ in gate.keep if id_ in items
                             for name in items[id_].inputs)
        for item, span in zip(map(items.get, gate.keep), gate.keep_places, strict=True):
            if item is not None and item.horizon:
                problems.error(
                    f'the gate {shown(gate.name)} cannot keep {shown(item.id)}: it speaks of the '
                    'future', span, 'its verdict is about an earlier message',
                    'keep a requirement of the past, which can be judged before a message passes')
            elif item is not None and item.probability:
                problems.error(
                    f'the gate {shown(gate.name)} cannot keep {shown(item.id)}: it is about a '
                    'probability', span, 'no single message violates it',
                    'keep the sentence without its probability')
        for name in read if gate.settings.is_service else ():
            place = fields[name]
            if known[name].topic == gate.settings.judged_topic and \
                    _BEYOND_REQUEST.search(place.value):
                problems.error(
                    f'the gate {shown(gate.name)} judges requests, and {shown(name)} is no part '
                    'of one', place.span, 'a request is judged before there is a response',
                    'field: request[0].FIELD')
        for name in read if gate.settings.is_open_when_stale else ():
            if known[name].stale is Stale.VIOLATE and \
                    known[name].topic != gate.settings.judged_topic:
                problems.error(
                    f'the gate {shown(gate.name)} cannot be open while '
                    f'{shown(name)} is stale', places[gate.name] or gate.place,
                    f'{shown(name)} has stale: violate: its silence violates the requirements',
                    'stale: closed')


def _check_locks(items: Mapping[str, Property], bundle: Bundle, problems: Problems) -> None:
    """Refuse locks for probabilities: the verdict is final, so that they would stay for ever."""
    locks = {entry.name.value for entry in bundle.actions if entry.kind is ActionKind.LOCK}
    for requirement in bundle.requirements:
        item = items.get(requirement.id.value)
        for name in requirement.on_violation if item and item.probability else ():
            if name.value in locks:
                problems.error(
                    f'the lock {shown(name.value)} cannot follow '
                    f'{shown(requirement.id.value)}: it is about a probability', name.span,
                    'its verdict is final, and the lock would stay for ever',
                    'lock by the sentence without its probability')
