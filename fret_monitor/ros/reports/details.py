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
The details of violations: `copilot/violations` (docs/ros_interface.md, Topics), and the log.

C words, publishes and decides (`csrc/ros/reports.h`), in a thread of Python, which writes the log:
the handler's message does not wait.
"""

from contextlib import ExitStack
from typing import Any

from fret_monitor.native.binding import ffi
from fret_monitor.ros.intake import native_lifetimes
from fret_monitor.ros.intake.hot_path import Middleware
from fret_monitor.ros.intake.rcl_endpoint import RclPublisher
from fret_monitor.ros.intake.symbols import Unavailable
from fret_monitor.ros.log_lines import log_lines
from fret_monitor.ros.watch import WatchedThread
from fret_monitor.runtime.reporting import Lines, Reporter

from rclpy.impl.rcutils_logger import RcutilsLogger


class DetailThread:
    """Publishes the details of violations while their topic has a subscriber, and logs them."""

    def __init__(self, reporter: Reporter, middleware: Middleware, publisher: RclPublisher,
                 logger: RcutilsLogger, *, logs_violations: bool = True) -> None:
        """Start the thread; raises `Unavailable` if memory is short."""
        library = reporter.library
        self._kept = reporter, middleware
        self._engine = reporter.engine
        self._turn = library.fm_detail_publisher_turn
        self._logger = logger
        self._lines = Lines(library)
        self._held = ExitStack()
        self.turns = 0
        """How often the thread has looked for work: several times a second unless it hangs."""
        self._thread = WatchedThread('details', self._loop)
        with ExitStack() as undo:
            undo.callback(self.close)
            self._held.enter_context(publisher.handle)
            self._pointer: Any = ffi.gc(library.fm_detail_publisher_create(
                reporter.pointer, middleware.functions, middleware.handle(publisher),
                logs_violations), library.fm_detail_publisher_destroy)
            if self._pointer == ffi.NULL:
                raise Unavailable('memory is short')
            native_lifetimes.keep(self)
            self._thread.start()
            undo.pop_all()

    def end(self) -> None:
        """Close the engine, and wait until the thread has emptied its queue; idempotent."""
        self._engine.close()
        if self._thread.ident is not None:
            self._thread.join()
        native_lifetimes.release(self)

    def close(self) -> None:
        """Do as `end`; afterwards the publisher may be destroyed."""
        self.end()
        self._held.close()

    @property
    def failure(self) -> Exception | None:
        """The error that ended the thread, if any; no detail is published or logged after it."""
        return self._thread.failure

    def _loop(self) -> None:
        goes_on = True
        while goes_on:
            self.turns += 1
            goes_on = self._turn(self._pointer, self._lines.pointer)
            log_lines(self._logger, self._lines.take())
