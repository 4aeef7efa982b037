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
The threads that empty the queues of a watch: who delivers a message never publishes.

C publishes the handlers where the hot path is (`hot_path.Announcer`); here is the thread that does
it otherwise, and the one that publishes details while somebody listens.
"""

from threading import Event, Thread

from fret_monitor.ros import native_lifetimes
from fret_monitor.ros.details import Details
from fret_monitor.ros.handlers import Handlers
from fret_monitor.runtime import SharedEvaluator, Violation, ViolationDetail

_PATIENCE = 200  # ms; the end of the watch wakes a thread at once
_LOOKS = 0.1  # s between two looks whether somebody listens, where no event tells


class HandlerPublisher:
    """Publishes the violations of a watch from a thread in Python."""

    def __init__(self, watch: SharedEvaluator, handlers: Handlers) -> None:
        """Start the thread."""
        self._watch = watch
        self._handlers = handlers
        self._thread = Thread(target=self._run, name='handlers', daemon=True)
        native_lifetimes.keep(self)
        self._thread.start()

    def end(self) -> None:
        """Close the watch, and wait until all is published."""
        self._watch.close()
        if self._thread.is_alive():
            self._thread.join()
        native_lifetimes.release(self)

    def announce_now(self) -> None:
        """Publish in the caller's thread what may go out: who brings messages is not faster."""
        while violations := self._watch.take(0):
            self._announce(violations)

    def _run(self) -> None:
        while violations := self._next():
            self._announce(violations)

    def _announce(self, violations: list[Violation]) -> None:
        for violation in violations:
            try:
                self._handlers.announce(violation)
            except RuntimeError:  # the context was shut down
                self._watch.count_unpublished(1)

    def _next(self) -> list[Violation]:
        """Return what is to be announced; nothing once the watch is closed and empty."""
        while True:
            is_closed = self._watch.is_closed
            violations = self._watch.take(_PATIENCE)
            if violations or is_closed:
                return violations


class DetailPublisher:
    """Publishes the details of violations while somebody listens."""

    def __init__(self, watch: SharedEvaluator, details: Details) -> None:
        """Start the thread."""
        self._watch = watch
        self._details = details
        self._is_over = Event()
        self._thread = Thread(target=self._run, name='details', daemon=True)
        native_lifetimes.keep(self)
        self._thread.start()

    def end(self) -> None:
        """Close the watch, and wait until all is published."""
        self._watch.close()
        self._is_over.set()
        self._details.listening.set()
        if self._thread.is_alive():
            self._thread.join()
        native_lifetimes.release(self)

    def _run(self) -> None:
        while not self._is_over.is_set():
            are_wanted = self._are_wanted()
            self._watch.want_details(are_wanted)
            if not are_wanted:
                self._details.listening.wait(_LOOKS)
                self._details.listening.clear()
            elif (detail := self._watch.take_detail(_PATIENCE)) is not None:
                self._publish(detail)
        while (detail := self._watch.take_detail(0)) is not None:
            self._publish(detail)

    def _are_wanted(self) -> bool:
        try:
            return self._details.listeners() > 0
        except RuntimeError:  # the context was shut down
            return False

    def _publish(self, detail: ViolationDetail) -> None:
        try:
            self._details.publish(detail)
        except RuntimeError:  # the context was shut down
            pass
