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
The details of violations: `copilot/violations` (docs/ros.md, Topics).

A detail has the requirement, the step and time of the violation, and the values of its inputs and
constants; under the policy timed, the time since the requirement began in place of the step. A
status with the level OK says that a violation is over. Details are built only while the topic has
a subscriber or violations are logged. The handler's message does not wait for them.
"""

from dataclasses import dataclass
import re
from threading import Event

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from fret_monitor.model.manifest import Manifest
from fret_monitor.model.names import DETAILS_TOPIC
from fret_monitor.model.policies import Severity
from fret_monitor.ros.intake.node_time import as_time
from fret_monitor.ros.settings.qos import DEFAULT_HANDLER_DEPTH, violation_profile
from fret_monitor.runtime import ViolationDetail
from fret_monitor.runtime.detail_text import (
    detail_text, OF_STEPS, OF_TIMES, value_name, WITHHELD_BY,
)

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node

LEVELS = {Severity.ERROR: DiagnosticStatus.ERROR, Severity.WARN: DiagnosticStatus.WARN}

_COUNT = re.compile(r'[0-9]{1,20}')
_STAMP = re.compile(r'-?[0-9]{1,12}\.[0-9]{9}')
_TIME = re.compile(r'[0-9]{1,12}(\.[0-9]{1,9})?')


@dataclass(frozen=True)
class Detail:
    """
    A violation as published: step, time in seconds, names and values of inputs and constants.

    Under the policy timed `step` is None, and `time` the seconds since the requirement began, as
    text. `silent` names the stale inputs, if they are the reason; `suppressed` counts the details
    of the requirement that were not published so far. With `is_recovery` a violation is over.
    `gate` has withheld the message that violates, if it is not empty.
    """

    step: int | None
    stamp: float
    values: tuple[tuple[str, str], ...]
    silent: str = ''
    suppressed: int = 0
    time: str | None = None
    is_recovery: bool = False
    gate: str = ''


def read_detail(status: DiagnosticStatus) -> Detail | None:
    """Parse a status that `Details` has published; return None if it has another form."""
    pairs = [(item.key, item.value) for item in status.values]
    of_all = tuple(key for key, _ in pairs[:4])
    if of_all not in (OF_STEPS, OF_TIMES):
        return None
    place, stamp, suppressed = (value for _, value in pairs[:3])
    is_timed = of_all == OF_TIMES
    if not (_TIME if is_timed else _COUNT).fullmatch(place) or not _STAMP.fullmatch(stamp) \
            or not _COUNT.fullmatch(suppressed):
        return None
    values = tuple((value_name(key), value) for key, value in pairs[4:] if key != WITHHELD_BY)
    return Detail(
        None if is_timed else int(place), float(stamp), values, pairs[3][1], int(suppressed),
        place if is_timed else None, status.level == DiagnosticStatus.OK,
        dict(pairs).get(WITHHELD_BY, ''))


class Details:
    """Publishes details of violations."""

    def __init__(self, node: Node, manifest: Manifest, depth: int = DEFAULT_HANDLER_DEPTH) -> None:
        """Advertise the topic, with a queue of `depth` messages."""
        self._node = node
        self._manifest = manifest
        self.listening = Event()
        self._publisher = node.create_publisher(
            DiagnosticArray, DETAILS_TOPIC, violation_profile(depth),
            event_callbacks=PublisherEventCallbacks(matched=lambda _: self.listening.set()))

    def listeners(self) -> int:
        """Return the number of subscribers; `listening` is set whenever it changes."""
        return int(self._publisher.get_subscription_count())

    def publish(self, detail: ViolationDetail) -> None:
        """Publish the details of a violation."""
        array = DiagnosticArray(status=[self._status(detail)])
        array.header.stamp = as_time(detail.violation.stamp)
        self._publisher.publish(array)

    def describe(self, detail: ViolationDetail) -> Detail:
        """Return the details of a violation as a subscriber reads them."""
        found = read_detail(self._status(detail))
        assert found is not None
        return found

    def close(self) -> None:
        """Withdraw the topic."""
        self._node.destroy_publisher(self._publisher)

    def _status(self, detail: ViolationDetail) -> DiagnosticStatus:
        text = detail_text(self._manifest, detail)
        return DiagnosticStatus(
            level=DiagnosticStatus.OK if text.severity is None else LEVELS[text.severity],
            name=text.name,
            message=text.message,
            hardware_id=text.hardware_id,
            values=[KeyValue(key=key, value=value) for key, value in text.values])
