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
What the ROS log says of a violation and of its end; monitor and logger write the same lines.

Each requirement is logged with its title, its sentence or formula, and the values of its inputs
and constants.
"""

from dataclasses import dataclass

from fret_monitor.model.manifest import ManifestRequirement
from fret_monitor.model.policies import Severity
from fret_monitor.ros.reports.details import Detail

from rclpy.impl.rcutils_logger import RcutilsLogger


@dataclass(frozen=True)
class ViolationLines:
    """Logs the violations of one requirement; `sentence` says what it requires."""

    logger: RcutilsLogger
    id: str
    sentence: str
    severity: Severity

    @classmethod
    def of(cls, logger: RcutilsLogger, requirement: ManifestRequirement) -> 'ViolationLines':
        """Return the lines of a requirement: both its title and its text, if it has a title."""
        text, title = (' '.join(item.split()) for item in (requirement.text, requirement.title))
        return cls(logger, requirement.id, f'{title} ({text})' if title else text,
                   requirement.severity)

    def violated(self, stamp: float, detail: Detail | None, note: str = '') -> None:
        """Log a violation at a time in seconds; `note` ends the line."""
        values = '' if detail is None else f' {_shown(detail)}'
        self._log(f'{self.id} violated at {stamp:.3f}: {self.sentence}{values}{note}')

    def violated_unseen(self, number: int) -> None:
        """Log violations of which no details are known."""
        times = 'once' if number == 1 else f'{number} times'
        self._log(f'{self.id} violated {times} more, without details: {self.sentence}')

    def satisfied(self, detail: Detail | None) -> None:
        """Log that a violation is over; without a detail its time is not known."""
        at = '' if detail is None else f' at {detail.stamp:.3f}'
        values = '' if detail is None else f' {_shown(detail)}'
        self.logger.info(f'{self.id} satisfied again{at}: {self.sentence}{values}')

    def _log(self, text: str) -> None:
        # One call for each severity: rclpy allows only one severity at a place in the code.
        if self.severity is Severity.ERROR:
            self.logger.error(text)
        else:
            self.logger.warning(text)


def _shown(detail: Detail) -> str:
    values = ', '.join(f'{name} = {value}' for name, value in detail.values)
    silent = f', no message for {detail.silent}' if detail.silent else ''
    place = f'step {detail.step}' if detail.time is None else f'{detail.time} s after its start'
    withheld = f", withheld by gate '{detail.gate}'" if detail.gate else ''
    return f'[{place}{silent}: {values}]{withheld}'
