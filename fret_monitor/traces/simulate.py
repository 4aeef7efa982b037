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
Run a compiled bundle on a trace in a CSV file.

Rows are read and verdicts are written block by block, so that memory does not grow with the
trace. A file of verdicts is created only if the whole trace could be read.
"""

from array import array
from collections.abc import Callable, Iterable, Iterator
from contextlib import nullcontext
import csv
from dataclasses import replace
from functools import partial
import os
from pathlib import Path
import stat
import sys
from typing import BinaryIO, TextIO

from fret_monitor.model.diagnostics import counted, refuse
from fret_monitor.model.output import open_output
from fret_monitor.model.policies import Policy, Stamp
from fret_monitor.model.progress import no_progress, Progress
from fret_monitor.native.monitor import Monitor
from fret_monitor.runtime.csv_rows import verdict_rows
from fret_monitor.runtime.evaluator import Evaluator
from fret_monitor.runtime.scopes import Scopes
from fret_monitor.traces.csv_trace import (
    LAST_TICK, open_trace, seconds_text, TIME, time_column, TraceReader,
)
from fret_monitor.traces.margin_table import MarginTable, with_margins
from fret_monitor.traces.summary import Summary


def simulate(monitor: Monitor, trace: Path, verdicts: Path | None,
             read: Iterable[Path] = (), until: int | None = None,
             progress: Progress = no_progress, library: Path | None = None,
             margins: Path | None = None) -> Summary:
    """
    Step a monitor once for each row of a trace.

    Parameters
    ----------
    monitor
        a compiled bundle.
    trace
        CSV with a heading: a column for each input (others are ignored), a row for each step;
        under `timed`, a column `time` in seconds.
    verdicts
        output file, with a row for each step: its number from 0, then 1 (satisfied) or 0 for each
        requirement, in the bundle's order. Standard output if None. Under `timed` the time in
        place of the number, and further rows where a verdict changes between those of the trace.
    read
        files of the bundle; `verdicts` must not be one of them, nor the trace.
    until
        under `timed`, the time in nanoseconds up to which verdicts are given; None: that of the
        last row.
    progress
        called with the part of the trace that was read.
    library
        as of `Evaluator`.
    margins
        output file, as `MarginTable` writes it; the monitor then has margins.

    Raises
    ------
    CompileError
        if the trace cannot be used, with the place, or the verdicts cannot be written.
    """
    writing = nullcontext(sys.stdout) if verdicts is None else open_output(
        verdicts, (trace, *read))
    writing_margins = nullcontext(None) if margins is None else open_output(
        margins, (trace, *read, *([verdicts] if verdicts else [])))
    with open_trace(trace) as file, writing as out, writing_margins as margins_out:
        if monitor.manifest.variables:
            return _run_scopes(monitor, str(trace), file, out, until,
                               partial(_report, file, progress), library, margins_out)
        evaluator = Evaluator(for_trace(monitor), library=library)
        reader = TraceReader(str(trace), file, monitor.manifest.inputs,
                             time_column(monitor.manifest), evaluator.library)
        table = None if margins_out is None else MarginTable(
            monitor.manifest, margins_out, has_times=reader.has_times)
        return _run(evaluator, reader, out, until, partial(_report, file, progress), table)


def _run_scopes(monitor: Monitor, name: str, file: BinaryIO, out: TextIO, until: int | None,
                report: Callable[[int], None], library: Path | None,
                margins_out: TextIO | None) -> Summary:
    # Imported here: bundles without instances do not need it.
    from fret_monitor.traces.simulate_scopes import ScopedRun
    scopes = Scopes(for_trace(monitor), library=library)
    return ScopedRun(monitor, name, file, out, report, scopes, margins_out).run(until)


def for_trace(monitor: Monitor) -> Monitor:
    """Return a monitor whose steps are the rows of a trace, each with values of all inputs."""
    manifest = monitor.manifest
    inputs = tuple(replace(item, timeout=None) for item in manifest.inputs)
    kinds = tuple(replace(item, monitor=for_trace(item.monitor)) for item in monitor.kinds)
    return replace(monitor, kinds=kinds, manifest=replace(
        manifest, inputs=inputs, topics=(), period=None, stamp=Stamp.RECEIVED,
        reorder=0))


def _report(file: BinaryIO, progress: Progress, steps: int) -> None:
    """Report the part of a trace that was read, which is unknown in a pipe."""
    status = os.fstat(file.fileno())
    is_file = stat.S_ISREG(status.st_mode) and status.st_size > 0
    progress(min(file.tell() / status.st_size, 1.0) if is_file else None,
             counted(steps, 'step'))


def _run(evaluator: Evaluator, trace: TraceReader, out: TextIO, until: int | None,
         report: Callable[[int], None], table: MarginTable | None) -> Summary:
    ids = [item.id for item in evaluator.monitor.manifest.requirements]
    is_timed = evaluator.monitor.manifest.policy is Policy.TIMED
    csv.writer(out, lineterminator='\n').writerow([TIME if is_timed else 'step', *ids])
    violations = [0] * len(ids)
    first: dict[str, int] = {}
    steps = 0
    for times, found in _verdicts(evaluator, trace, until, table):
        labels = times if is_timed else array('q', range(steps, steps + len(times)))
        out.write(verdict_rows(evaluator.library, labels, found, len(ids), are_times=is_timed))
        for index, name in enumerate(ids):
            verdicts = found[index::len(ids)]
            if name not in first and 0 in verdicts:
                first[name] = labels[verdicts.index(0)]
            violations[index] += verdicts.count(0)
        steps += len(times)
        report(steps)
    return Summary(steps, dict(zip(ids, violations, strict=True)), first,
                   overflows=evaluator.time_counts().overflows)


def _verdicts(evaluator: Evaluator, trace: TraceReader, until: int | None,
              table: MarginTable | None) -> Iterator[tuple['array[int]', bytes]]:
    take = evaluator.rows if table is None else partial(with_margins, table, evaluator)
    last: int | None = None
    for times, columns in trace.blocks():
        yield from take(columns, times)
        last = times[-1]
    if until is None or last is None:
        return
    if until - trace.first > LAST_TICK:
        refuse(f'--until {seconds_text(until)} is more than 146 years after the first row')
    if until < last:
        refuse(f'--until {seconds_text(until)} is before the last row of the trace',
               help=f'which is at {seconds_text(last)}')
    empty: list[array[int] | None] = [None] * len(evaluator.monitor.manifest.inputs)
    yield from take(empty, array('q'), until)
