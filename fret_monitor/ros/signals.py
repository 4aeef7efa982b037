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
End a node's process on SIGINT and SIGTERM, at any time and without a traceback.

Python runs signal handlers between two steps of its main thread, never in the middle of a call
into C. A main thread that waits in C must therefore be woken by another thread (`waking`). rclpy's
own handlers shut the context down while other threads still use it, which then raise errors:
initialize rclpy without them.

This module uses the standard library only, since it is imported before anything that is slow.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import os
import signal
from threading import Thread
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class _Uninterrupted:
    depth = 0  # of the blocks that were entered
    is_due = False  # a signal came meanwhile


@contextmanager
def uninterrupted() -> Iterator[None]:
    """
    Let a signal inside this block take effect at its end, where `interruptible` would raise.

    For starting threads: an exception inside `Thread.start` becomes a RuntimeError of its locks.
    """
    _Uninterrupted.depth += 1
    try:
        yield
    finally:
        _Uninterrupted.depth -= 1
        if _Uninterrupted.is_due and not _Uninterrupted.depth:
            _Uninterrupted.is_due = False
            raise SystemExit(0)


class StopRequest:
    """
    Records that the process received SIGINT or SIGTERM.

    Until `interruptible` is entered a signal ends the process at once, with status 0, since
    nothing has been started that needs cleaning up. Create this in the main thread.
    """

    def __init__(self) -> None:
        """Take over SIGINT and SIGTERM."""
        self.requested = False
        for number in SIGNALS:
            signal.signal(number, _end_at_once)

    @contextmanager
    def interruptible(self) -> Iterator[None]:
        """
        Raise `SystemExit` at a signal inside this block, so that it can clean up.

        Inside `uninterrupted`, it is raised at the end of that block.

        A second signal, or one after the block, only sets `requested`, which the main loop reads:
        a process that shares a terminal with `ros2 launch` gets SIGINT twice.
        """
        self._handle(self._raise)
        try:
            yield
        finally:
            self._handle(self._remember)

    @contextmanager
    def waking(self, wake: Callable[[], None]) -> Iterator[None]:
        """
        Call `wake` in another thread at the first signal that is received inside this block.

        It is called at once if a signal was received before.
        """
        read_end, write_end = os.pipe()
        os.set_blocking(write_end, False)

        def run() -> None:
            if self.requested or os.read(read_end, 1):
                wake()

        thread = Thread(target=run, name='signals', daemon=True)
        signal.set_wakeup_fd(write_end, warn_on_full_buffer=False)
        thread.start()
        try:
            yield
        finally:
            signal.set_wakeup_fd(-1)
            os.close(write_end)
            thread.join()
            os.close(read_end)

    def end(self) -> None:
        """Ignore further signals: one during the shutdown of Python would kill the process."""
        for number in SIGNALS:
            signal.signal(number, signal.SIG_IGN)

    def _handle(self, handler: 'signal._HANDLER') -> None:
        for number in SIGNALS:
            signal.signal(number, handler)

    def _remember(self, number: int, frame: FrameType | None) -> None:
        self.requested = True

    def _raise(self, number: int, frame: FrameType | None) -> None:
        self.requested = True
        self._handle(self._remember)
        if _Uninterrupted.depth:
            _Uninterrupted.is_due = True
        else:
            raise SystemExit(0)


def _end_at_once(number: int, frame: FrameType | None) -> None:
    # Not sys.exit: some modules print an exception that is raised while they are imported.
    os._exit(0)
