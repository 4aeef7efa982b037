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


"""Details of violations as a subscriber reads them (docs/ros_interface.md, Topics)."""

from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticStatus


@dataclass(frozen=True)
class Detail:
    """A detail; `step` is None under the policy timed, and `time` is then its first value."""

    step: int | None
    time: str | None
    stamp: float
    suppressed: int
    silent: str
    values: tuple[tuple[str, str], ...]
    is_recovery: bool


def read_detail(status: DiagnosticStatus) -> Detail:
    """Read a status that has the form of a detail."""
    (first, place), stamp, suppressed, silent, *values = (
        (item.key, item.value) for item in status.values)
    assert first in ('step', 'time')
    assert (stamp[0], suppressed[0], silent[0]) == ('stamp', 'suppressed', 'silent')
    return Detail(
        int(place) if first == 'step' else None, place if first == 'time' else None,
        float(stamp[1]), int(suppressed[1]), silent[1], tuple(values),
        status.level == DiagnosticStatus.OK)
