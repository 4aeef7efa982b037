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

"""An example for the tests of an export: a trace, and its verdicts by the reference evaluator."""

from collections.abc import Iterable, Sequence
import csv
from io import StringIO
from itertools import accumulate, chain, islice
from random import Random

from fret_monitor.build import GeneratedMonitor
from fret_monitor.logic.evaluate import verdicts
from fret_monitor.logic.specification import Signal, Specification
from fret_monitor.logic.timed import evaluate_timed, TimedTrace, verdict_rows
from fret_monitor.model.policies import Policy
from fret_monitor.traces.boundary import both_sides
from fret_monitor.traces.csv_trace import LAST_TICK, seconds_text, TIME, trace_text
from fret_monitor.traces.random_traces import Pools, random_traces
from fret_monitor.traces.receptions import with_instants
from fret_monitor.traces.trace import Row, Value

_STEPS = 120
_REACH_STEPS = 12  # several short random traces in a row: each favours other values
_LONGEST_STEPS = 50  # for which a value stays: more would leave no room in the trace
_ROWS_IN_TIME = 60
_GAPS_NS = (1, 10 ** 6, 10 ** 8, 10 ** 9)  # between rows, besides the bounds of requirements


def example(generated: GeneratedMonitor) -> tuple[str, str]:
    """Return a trace and its verdicts, as `simulate` reads and writes them."""
    specification = generated.specification
    if not specification.signals:
        return 'no_input\n', _text('step', specification, ())
    pools, rng = both_sides(generated.program), Random(0)
    if specification.policy is Policy.TIMED:
        return _timed(specification, pools, rng)
    return _stepped(specification, pools, rng)


def _stepped(specification: Specification, pools: Pools, rng: Random) -> tuple[str, str]:
    bounds = {bound for item in specification.properties for bound in item.bounds
              if bound <= _LONGEST_STEPS}
    runs = chain.from_iterable(random_traces(pools, sorted(bounds), _REACH_STEPS, rng, _STEPS))
    rows = list(islice((run.row for run in runs for _ in range(run.steps)), _STEPS))
    columns = _columns(specification.signals, rows)
    found = [verdicts(item.formula, columns, item.feedback) for item in specification.properties]
    lines = ((str(step), row) for step, row in enumerate(zip(*found, strict=True)))
    return trace_text(specification.signals, rows), _text('step', specification, lines)


def _timed(specification: Specification, pools: Pools, rng: Random) -> tuple[str, str]:
    bounds = {bound for item in specification.properties for bound in item.bounds}
    gaps = sorted({*_GAPS_NS, *(bound + offset for bound in bounds for offset in (-1, 0, 1)
                                if 0 < bound <= LAST_TICK // _ROWS_IN_TIME)} - {0})
    times = list(accumulate([0, *(rng.choice(gaps) for _ in range(_ROWS_IN_TIME - 1))]))
    drawn = [(time, tuple(rng.choice(pool) for pool in pools)) for time in times
             if time < LAST_TICK]
    times, rows = with_instants(drawn, specification.signals)
    trace = TimedTrace(times, _columns(specification.signals, rows), times[-1])
    histories = [evaluate_timed([item.formula], trace, item.feedback)[0]
                 for item in specification.properties]
    heading, *lines = trace_text(specification.signals, rows).splitlines()
    text = [f'{TIME},{heading}', *(f'{seconds_text(time)},{line}' for time, line
                                   in zip(times, lines, strict=True))]
    found = ((seconds_text(tick), row) for tick, row in verdict_rows(histories, trace))
    return '\n'.join(text) + '\n', _text(TIME, specification, found)


def _columns(signals: Sequence[Signal], rows: Sequence[Row]) -> dict[str, list[Value]]:
    return {signal.name: [row[place] for row in rows] for place, signal in enumerate(signals)}


def _text(first: str, specification: Specification,
          rows: Iterable[tuple[str, Sequence[Value]]]) -> str:
    """Return verdicts as CSV."""
    text = StringIO()
    writer = csv.writer(text, lineterminator='\n')
    writer.writerow([first, *(item.id for item in specification.properties)])
    writer.writerows([label, *(int(verdict) for verdict in row)] for label, row in rows)
    return text.getvalue()
