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

"""Logging: of the lines that C words, and of repeated events at intervals."""

from collections.abc import Iterable
from time import monotonic

from fret_monitor.runtime.reporting import LogLevel, LogLine

from rclpy.impl.rcutils_logger import RcutilsLogger


def log_lines(logger: RcutilsLogger, lines: Iterable[LogLine]) -> None:
    for line in lines:
        # One call for each severity: rclpy allows only one severity at a place in the code.
        match line.level:
            case LogLevel.INFO:
                logger.info(line.text)
            case LogLevel.WARN:
                logger.warning(line.text)
            case LogLevel.ERROR:
                logger.error(line.text)


class Throttle:
    """Lets the first event pass, and later ones at most once per interval."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._next = float('-inf')

    def passes(self) -> bool:
        now = monotonic()
        if now < self._next:
            return False
        self._next = now + self._seconds
        return True
