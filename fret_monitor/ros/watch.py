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
Watches the threads and timers of a node: no error ends or stops one of them unseen.

The first error of each is logged. From then on a monitor gives no sign of life, and
`/diagnostics` has a status with the level ERROR, until the node is activated again. What has not
failed goes on.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager
from threading import Thread
import traceback

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.timer import Timer


NO_SIGN = 'no sign of life on ~/alive until the node is activated again'


def steady_timer(node: Node, seconds: float, callback: Callable[[], object]) -> Timer:
    """Create a timer of a node that does not follow `/clock`."""
    return node.create_timer(
        seconds, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))


class ErrorKeeper(AbstractContextManager[None]):
    """Catches and keeps an error that is raised inside the block."""

    def __init__(self) -> None:
        self.error: Exception | None = None

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> bool:
        if isinstance(error, Exception):
            self.error = error
        return isinstance(error, Exception)


class WatchedThread(Thread):
    """A daemon thread that keeps the error that ends it."""

    def __init__(self, name: str, work: Callable[[], None]) -> None:
        super().__init__(target=work, name=name, daemon=True)
        self.failure: Exception | None = None

    def run(self) -> None:
        kept = ErrorKeeper()
        with kept:
            super().run()
        self.failure = kept.error


class Watch:
    """What has failed since the node was activated; for the thread of the executor."""

    def __init__(self, node: Node, effect: str = NO_SIGN) -> None:
        """Log to the node's log; `effect` is what the log says of each failure."""
        self._node = node
        self._effect = effect
        self.failures: dict[str, str] = {}
        """What has failed, by name, and its error."""

    def note(self, name: str, error: Exception | None) -> None:
        """Note the error of a thread or timer, if there is one; log the first one of each."""
        if error is None or name in self.failures:
            return
        self.failures[name] = f'{type(error).__name__}: {error}'
        self._node.get_logger().error(
            f'the part of the node that is called {name} has failed: {self._effect}\n'
            f'{"".join(traceback.format_exception(error)).rstrip()}')

    def run(self, name: str, callback: Callable[[], None],
            has_ended: Callable[[], bool] = lambda: False) -> None:
        """
        Call a timer's callback, and note its error.

        Another thread may end what the callback uses; an error after `has_ended` is none.
        """
        kept = ErrorKeeper()
        with kept:
            callback()
        if not has_ended():
            self.note(name, kept.error)

    def forget(self) -> None:
        """Forget what has failed: all of it begins anew."""
        self.failures.clear()
