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

"""The log of locks that are locked or free, and of gates that open or close, with the reason."""

from collections.abc import Callable, Mapping

from fret_monitor.runtime import Conditions, Engine

from rclpy.impl.rcutils_logger import RcutilsLogger

_MOST_LINES = 10
"""Of one lock or gate at a look; the others are counted."""


class ConditionLog:
    """Logs each change of the locks and the gate of an engine, in the order in which they came."""

    def __init__(self, logger: RcutilsLogger, engine: Engine,
                 states: Mapping[str, Callable[[Conditions], str]]) -> None:
        """
        Follow `states`: a lock or gate, as the log names it, and the text of its state.

        A change is that of the text up to the colon: a change of the reason alone is logged if it
        lasts until `review`.
        """
        self._logger = logger
        self._engine = engine
        self._states = states
        self._logged: dict[str, str] = {}

    def review(self) -> None:
        """Log what has changed since the last call; call it once a second."""
        lines, missed = dict.fromkeys(self._states, 0), 0
        for conditions, more in self._engine.changed_conditions():
            missed += more
            for name, text in self._states.items():
                if _kind(text(conditions)) != _kind(self._logged.get(name, '')):
                    lines[name] += 1
                    self._log(name, text(conditions), is_shown=lines[name] <= _MOST_LINES)
        for name, count in lines.items():
            if count > _MOST_LINES:
                self._logger.info(f'{name} has changed {count - _MOST_LINES} times more since')
                del self._logged[name]  # the present state is logged
        if missed:
            self._logger.info(f'{missed} more changes of what locks and gates depend on came too '
                              'fast to be logged')
        present = self._engine.conditions()
        for name, text in self._states.items():
            if text(present) != self._logged.get(name):
                self._log(name, text(present))

    def _log(self, name: str, text: str, *, is_shown: bool = True) -> None:
        self._logged[name] = text
        if is_shown:
            self._logger.info(f'{name} is {text}')


def _kind(text: str) -> str:
    return text.partition(':')[0]
