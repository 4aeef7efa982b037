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
What works in threads of its own on memory of C, kept alive until it has ended.

An interrupt may come at any line, and what an interrupted constructor or `close` leaves behind is
collected. Here it is not: memory that a thread still uses is better kept than freed. What is left
when the process ends is ended then, C and threads alone; the objects of rclpy stay as they are.
"""

import atexit
from contextlib import suppress
from typing import Protocol


class Worker(Protocol):
    """What has a thread, or is called by one of the middleware's."""

    def end(self) -> None:
        """Let nobody use its memory any more; twice is once."""


_AT_WORK: dict[int, Worker] = {}


def begin(worker: Worker) -> None:
    """Keep a worker, before its work begins."""
    _AT_WORK[id(worker)] = worker


def ended(worker: Worker) -> None:
    """Let a worker go, whose work has ended."""
    _AT_WORK.pop(id(worker), None)


@atexit.register
def _end_all() -> None:
    for worker in reversed(list(_AT_WORK.values())):
        with suppress(Exception):
            worker.end()
