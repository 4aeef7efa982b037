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
The verdicts of examples in real time.

Examples of timed requirements are found on a grid of time (`traces/sampled.py`), where what lasts
a nanosecond lasts a point of the grid. The reference tells what the verdicts are in between, and
which examples are none.
"""

from dataclasses import replace

from fret_monitor.logic.specification import Property
from fret_monitor.logic.timed import evaluate_timed, TimedTrace, value_at
from fret_monitor.traces.receptions import with_instants
from fret_monitor.traces.search import Examples, Recovery
from fret_monitor.traces.subject import Subject
from fret_monitor.traces.trace import length, rows_of, Trace

_LONGEST = 5_000  # steps; longer examples are not drawn either


def verdicts_in_time(item: Property, subject: Subject, trace: Trace, grid: int) -> list[bool]:
    """Return the verdict at each point of a grid; inputs that are receptions last a tick."""
    ticks, rows = with_instants(
        ((step * grid, row) for step, row in enumerate(rows_of(trace))), subject.signals)
    columns = {signal.name: [row[number] for row in rows]
               for number, signal in enumerate(subject.signals)}
    timed = TimedTrace(ticks, columns, ticks[-1])
    history, = evaluate_timed([item.formula], timed, item.feedback)
    return [bool(value_at(history, step * grid)) for step in range(length(trace))]


def confirmed(item: Property, subject: Subject, examples: Examples, grid: int) -> Examples:
    """Return the examples without those that end with another verdict in real time."""
    def is_so(trace: Trace | None, wanted: bool) -> bool:
        return trace is None or length(trace) > _LONGEST or \
            verdicts_in_time(item, subject, trace, grid)[-1] == wanted

    found = replace(
        examples,
        satisfying=examples.satisfying if is_so(examples.satisfying, True) else None,
        violating=examples.violating if is_so(examples.violating, False) else None,
        recovering=examples.recovering if is_so(examples.recovering, True) else None)
    if found == examples:
        return examples
    is_lost = examples.recovering is not None and found.recovering is None
    return replace(found, is_proved=False,
                   recovery=Recovery.NONE_FOUND if is_lost else examples.recovery)
