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

"""Warnings about requirements whose verdict does not depend on any input."""

from collections.abc import Iterator

from fret_monitor.logic.specification import Specification
from fret_monitor.model.diagnostics import Diagnostic, Level
from fret_monitor.program.monitor_program import MonitorProgram, TRUE


def constant_verdicts(specification: Specification,
                      program: MonitorProgram, count: int | None = None) -> Iterator[Diagnostic]:
    """
    Yield a warning for each requirement whose verdict is constant.

    The first `count` properties are requirements, all if None.
    """
    for group in program.groups:
        for index, verdict in zip(group.properties, group.verdicts):
            item = specification.properties[index]
            if verdict.is_constant and item.place is not None and (
                    count is None or index < count):
                yield Diagnostic(
                    f'{item.id} is {"true" if verdict == TRUE else "false"} at every step',
                    item.place, 'no message changes it',
                    'a requirement must depend on the inputs', Level.WARNING)
