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
A process that answers the questions of a page, one after the other, and can be ended.

Questions and answers are lines of JSON on its standard input and output (`questions.py`). One
that takes too long, or too much memory, ends the process with all it has started, such as the C
compiler; the next question starts another.
"""

import asyncio
from collections.abc import Callable
from contextlib import suppress
import json
import os
from pathlib import Path
import shutil
import signal
import sys
import tempfile
from typing import Any

LIMIT_S = 20.0
OUTDATED = 'outdated'
_MOST_LINE = 64 * 1024 * 1024


class Unanswered(Exception):
    """A question has no answer; the text says why."""


class Answering:
    """The process of one page for one kind of questions; for one event loop."""

    def __init__(self, folder: Path, limit_s: float = LIMIT_S) -> None:
        """Start nothing yet; `folder` has the bundles, a question may take `limit_s`."""
        self._folder = folder
        self._limit_s = limit_s
        self._process: asyncio.subprocess.Process | None = None
        self._scratch: Path | None = None
        self._turn = asyncio.Lock()

    async def ask(self, question: dict[str, Any], is_wanted: Callable[[], bool],
                  limit_s: float | None = None) -> Any:
        """
        Return the answer to a question, after those before it; `limit_s` is for this one.

        One that is not wanted any more when its turn comes, since a newer one of its kind has
        come, is left out.

        Raises
        ------
        Unanswered
            if there is none: the question is wrong, takes too long, or ended the process.
        """
        limit = limit_s or self._limit_s
        async with self._turn:
            if not is_wanted():
                raise Unanswered(OUTDATED)
            try:
                line = await asyncio.wait_for(self._exchange(question), limit)
            except TimeoutError:
                await self.end()
                raise Unanswered(
                    f'no answer within {limit:g} s: this is too large for this page; '
                    'use the command line') from None
            except (OSError, ValueError):
                line = b''
            except asyncio.CancelledError:
                await self.end()  # half an answer may be in the pipe
                raise
            if not line:
                await self.end()
                raise Unanswered('the process that answers has ended: memory, perhaps')
        found = json.loads(line)
        if 'error' in found:
            raise Unanswered(found['error'])
        return found['answer']

    async def _exchange(self, question: dict[str, Any]) -> bytes:
        if self._process is None or self._process.returncode is not None:
            await self.end()
            self._process = await self._started()
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.write(json.dumps(question).encode() + b'\n')
        await self._process.stdin.drain()
        return await self._process.stdout.readline()

    async def _started(self) -> asyncio.subprocess.Process:
        self._scratch = Path(tempfile.mkdtemp(prefix='fret_monitor-'))
        return await asyncio.create_subprocess_exec(
            sys.executable, '-m', 'fret_monitor.studio.questions', str(self._folder),
            env={**os.environ, 'TMPDIR': str(self._scratch)}, limit=_MOST_LINE,
            stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE,
            start_new_session=True)

    async def end(self) -> None:
        """End the process and all it has started, and remove its temporary files."""
        process, self._process = self._process, None
        scratch, self._scratch = self._scratch, None
        if process is not None:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            await process.wait()
        if scratch is not None:
            shutil.rmtree(scratch, ignore_errors=True)
