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

"""A subscriber of `/diagnostics`."""

from time import monotonic
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from ros.harness import Partner, PATIENCE, wait_until


class Operator:
    """Collects the reports on /diagnostics."""

    def __init__(self, partner: Partner) -> None:
        """Subscribe to /diagnostics."""
        self.heard: list[Any] = []
        partner.node.create_subscription(
            DiagnosticArray, '/diagnostics', self.heard.append, 10)

    def status(self, name: str) -> tuple[bytes, str, dict[str, str]]:
        """Return level, message and values of one status in the next report."""
        self.wait(1)
        status = next(item for item in self.heard[-1].status
                      if item.name == f'fret_monitor: {name}')
        return status.level, status.message, {item.key: item.value for item in status.values}

    def wait(self, reports: int) -> None:
        """Wait for so many further reports."""
        wanted = len(self.heard) + reports
        wait_until(lambda: len(self.heard) >= wanted, 'a report on /diagnostics')

    def wait_for(self, name: str, level: bytes, words: str) -> dict[str, str]:
        """Wait until a status has this level and these words in its message; return its values."""
        found = self.status(name)
        end = monotonic() + PATIENCE
        while found[0] != level or words not in found[1]:
            assert monotonic() < end, f'waited in vain for {level!r} {words!r}: {found}'
            found = self.status(name)
        return found[2]

    def periods(self) -> dict[str, int]:
        """Return the counters of the periods, once they no longer change."""
        last, now = None, self.status('periods of bundle')[2]
        end = monotonic() + PATIENCE
        while last != now:
            assert monotonic() < end, f'time goes on: {now}'
            last, now = now, self.status('periods of bundle')[2]
        return {key: int(value) for key, value in now.items() if key != 'period'}
