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

"""Receptions in a trace with times: a message comes at an instant, and lasts one nanosecond."""

from collections.abc import Iterable, Sequence

from fret_monitor.logic.specification import Signal
from fret_monitor.model.policies import InputSource
from fret_monitor.traces.trace import Row


def with_instants(rows: Iterable[tuple[int, Row]],
                  signals: Sequence[Signal]) -> tuple[list[int], list[Row]]:
    """
    Return the times and rows of a trace in which each reception is true for one tick.

    `rows` have their times, which increase. After each with a reception comes one without, unless
    the next row of the trace is there.
    """
    places = {place for place, signal in enumerate(signals)
              if signal.source is InputSource.RECEIVED}
    found: dict[int, Row] = {}
    for tick, row in rows:
        found[tick] = row
        if any(row[place] for place in places):
            found[tick + 1] = tuple(False if place in places else value
                                    for place, value in enumerate(row))
    return list(found), list(found.values())
