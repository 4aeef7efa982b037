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
Watches a running monitor for one page: a process with rclpy (`watching.py`), and its lines.

The process is ended with the page. A page that reads slowly makes the process wait: what it
cannot send in time is left out there, and nothing is stored here.
"""

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
import json
import os
import signal
import sys
from typing import Any

_MOST_LINE = 16 * 1024 * 1024
_PATIENCE_S = 5.0


class Live:
    """What one page watches; for one event loop."""

    def __init__(self, send: Callable[[dict[str, Any]], Awaitable[None]]) -> None:
        """Watch nothing yet; `send` sends to the page."""
        self._send = send
        self._process: asyncio.subprocess.Process | None = None
        self._reading: asyncio.Task[None] | None = None

    async def watch(self, plan: Mapping[str, Any]) -> None:
        """Watch what a plan has, in place of what was watched before."""
        await self.end()
        process = self._process = await asyncio.create_subprocess_exec(
            sys.executable, '-m', 'fret_monitor.studio.watching',
            stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE, limit=_MOST_LINE,
            start_new_session=True)
        await self.tell(plan)
        self._reading = asyncio.create_task(self._read(process))

    async def tell(self, request: Mapping[str, Any]) -> None:
        """Give the process a line; does nothing without a process."""
        if self._process is not None and self._process.stdin is not None:
            with suppress(ConnectionError):
                self._process.stdin.write(json.dumps(request).encode() + b'\n')
                await self._process.stdin.drain()

    async def _read(self, process: asyncio.subprocess.Process) -> None:
        assert process.stdout is not None
        found: dict[str, Any] = {}
        while line := await process.stdout.readline():
            found = json.loads(line)
            await self._send({'live': found})
        if 'error' not in found:
            await self._send({'live': {'error': 'the process that watches has ended'}})

    async def end(self) -> None:
        """Watch nothing more."""
        process, self._process = self._process, None
        reading, self._reading = self._reading, None
        if process is None:
            return
        if reading is not None:
            reading.cancel()
            await asyncio.gather(reading, return_exceptions=True)
        # Killed, it would leave files in shared memory, and its node in the graph for a while.
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGTERM)
        try:
            await asyncio.wait_for(process.wait(), _PATIENCE_S)
        except TimeoutError:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            await process.wait()
