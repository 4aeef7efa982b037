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

"""What `simulate` counts."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Summary:
    """
    The number of steps, and the number of violating steps by id of the requirement.

    `first` has the step at which each violated requirement was violated first. Under `timed` the
    steps are the rows that were written, and `first` is a time in nanoseconds. `beyond` are the
    variables that had more keys than there is room for, and `overflows` the changes that found no
    room in a window: they came faster than `max_rate`.
    """

    steps: int
    violations: dict[str, int]
    first: dict[str, int]
    beyond: tuple['Beyond', ...] = ()
    overflows: int = 0


@dataclass(frozen=True)
class Beyond:
    """How many rows had a key of a variable for which `most` left no room; None: for its size."""

    variable: str
    most: int | None
    rows: int
