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
Show where the latency of the monitor goes: the time between two hand-overs, beside bare C.

`bench/ros/trace.c` is loaded before the functions of rmw and notes when they are called, in the
load, in the subject, and in the bare subscriber in C of the same round. For each stage the table
has the median, the 99th percentile, and the mean among the slowest hundredth of the messages: the
stage in which those lose their time is the one to mend.

Answers are assigned to messages by their order, so a run in which any is missing is repeated.

    .venv/bin/python -m bench.trace [--only NAME] [--rounds N]
"""

from argparse import ArgumentParser
from bisect import bisect_left, bisect_right
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import pairwise
import os
from pathlib import Path
from statistics import mean
import sys

from bench.ros import (
    Bench, both, compiled, float_input, HANDLER, HERE, Load, number, OPTIMIZATION, prepared, RATE,
    Running, show_cells, SILENCES, Subject, TIMEOUT, TOPICS, Work,
)

ATTEMPTS = 5  # on a busy machine a timeout may be put off, and a message lost

Chain = Mapping[str, Sequence[int]]
"""The moments (ns) of each message by the name of the hand-over, in the order of hand-overs."""


@dataclass(frozen=True)
class Trace:
    """The events of a process: sorted times (ns) and threads by kind."""

    events: Mapping[str, Sequence[tuple[int, int]]]

    def times(self, kind: str, thread: int | None = None) -> list[int]:
        """Return the times of a kind of event, in one thread or in all."""
        return [time for time, found in self.events.get(kind, ()) if thread in (None, found)]

    def busiest(self, kind: str) -> int:
        """Return the thread with the most events of a kind."""
        return Counter(thread for _, thread in self.events[kind]).most_common(1)[0][0]


def read_trace(path: Path) -> Trace:
    """Return the events that `trace.c` has written."""
    events: dict[str, list[tuple[int, int]]] = {}
    for line in path.read_text(encoding='ascii').splitlines():
        time, thread, kind = line.split()
        events.setdefault(kind, []).append((int(time), int(thread)))
    return Trace({kind: sorted(found) for kind, found in events.items()})


def first_after(times: Sequence[int], moment: int) -> int:
    """Return the first of sorted times that is not before a moment, which it is without one."""
    place = bisect_left(times, moment)
    return times[place] if place < len(times) else moment


def last_before(times: Sequence[int], moment: int) -> int:
    """Return the last of sorted times that is not after a moment; 0 if there is none."""
    place = bisect_right(times, moment)
    return times[place - 1] if place else 0


def from_first(times: Sequence[int], first: int, n: int) -> list[int]:
    """Return the first `n` times that are not before the first message."""
    begin = bisect_left(times, first)
    return list(times[begin:begin + n])


def inline(load: Trace, subject: Trace, n: int) -> Chain:
    """Return the hand-overs of messages that one thread takes, and another answers."""
    sent = load.times('publish')[:n]
    taken = subject.events['taken'][:n]
    publisher = subject.busiest('publish')
    publish = from_first(subject.times('publish', publisher), sent[0], n)
    woken = subject.times('woken', publisher)
    signals = {thread: subject.times('signal', thread) for thread in {item[1] for item in taken}}
    queued = [min(first_after(signals[thread], time), answer)
              for (time, thread), answer in zip(taken, publish)]
    return {'sent': sent, 'taken': [time for time, _ in taken],
            'queued': queued,
            'announcer awake': [max(last_before(woken, answer), time)
                                for time, answer in zip(queued, publish)],
            'publish': publish, 'received': from_first(load.times('taken'), sent[0], n)}


def deadline(load: Trace, subject: Trace, n: int) -> Chain:
    """Return the hand-overs from the end of a timeout on."""
    found = inline(load, subject, n)
    ends = [time + int(TIMEOUT * 1e9) for time in found['taken']]
    return {'end of the timeout': ends,
            'announcer awake': [max(pair) for pair in zip(ends, found['announcer awake'])],
            'publish': found['publish'], 'received': found['received']}


def relayed(load: Trace, subject: Trace, n: int) -> Chain:
    """Return the hand-overs of messages that one thread takes and publishes."""
    relay = subject.busiest('taken')
    taken = subject.times('taken', relay)[:n]
    woken = subject.times('woken', relay)
    sent = load.times('publish')[:n]
    return {'sent': sent,
            'relay awake': [max(last_before(woken, time), before)
                            for before, time in zip(sent, taken)],
            'taken': taken, 'publish': from_first(subject.times('publish', relay), sent[0], n),
            'received': from_first(load.times('taken'), sent[0], n)}


@contextmanager
def preloaded(library: Path, traces: Path) -> Iterator[None]:
    """Let processes that are started in this block write traces."""
    os.environ.update(LD_PRELOAD=str(library), FM_TRACE=str(traces))
    try:
        yield
    finally:
        del os.environ['LD_PRELOAD'], os.environ['FM_TRACE']


def trace(bench: Bench, work: Work, subject: Subject, chain: Callable[[Trace, Trace, int], Chain],
          library: Path) -> Chain:
    """Run a subject with its own load until it has answered all; return the hand-overs."""
    for _ in range(ATTEMPTS):
        traces, answers = run(bench, work, subject, library)
        if answers == work.count:
            return chain(read_trace(traces[0]), read_trace(traces[1]), work.count)
    raise SystemExit(f'{subject.name}: {answers} answers to {work.count} messages')


def run(bench: Bench, work: Work, subject: Subject, library: Path) -> tuple[list[Path], int]:
    """Run a subject with its load once; return their traces, and the number of answers."""
    traces = bench.folder / 'trace'
    with preloaded(library, traces):
        load = Load(bench.load, *work.arguments,
                    '--relayed' if work.is_relayed else '--echo', str(work.echo))
        running = Running(subject)
        pids = load.process.pid, running.process.pid
    with both(load, running):
        if subject.is_monitor:
            running.wait_for('watching')
        load.ask('match', running)
        sent = load.send(work.count, work.rate)
    return [Path(f'{traces}.{pid}') for pid in pids], sent.answers


def library_of(bench: Bench) -> Path:
    """Compile the library that writes traces."""
    return compiled(bench.folder / 'trace.so', [
        '-std=gnu11', OPTIMIZATION, '-fPIC', '-shared', str(HERE / 'ros' / 'trace.c'), '-ldl'])


def percentile(values: Sequence[int], share: float) -> float:
    """Return a percentile in microseconds."""
    return sorted(values)[int(len(values) * share)] / 1e3


def rows(name: str, chains: Sequence[Chain]) -> Iterator[tuple[str, ...]]:
    """Yield a row for each stage, and one for all of them together."""
    names = list(chains[0])
    moments = {key: [time for chain in chains for time in chain[key]] for key in names}
    total = [last - first for first, last in zip(moments[names[0]], moments[names[-1]])]
    slowest = sorted(range(len(total)), key=total.__getitem__)[-max(1, len(total) // 100):]
    for first, last in [*pairwise(names), (names[0], names[-1])]:
        spent = [after - before for before, after in zip(moments[first], moments[last])]
        yield (name, f'{first} to {last}',
               *(number(value) for value in (
                   percentile(spent, 0.5), percentile(spent, 0.99),
                   mean(spent[place] for place in slowest) / 1e3)))


def cases(bench: Bench) -> Iterator[tuple[str, Work, Sequence[Subject], Callable[..., Chain]]]:
    """Yield what is traced: its name, the messages, the subjects (bare C first), the chain."""
    work = bench.work(TOPICS, bench.rate, echo=HANDLER)
    bundle = bench.bundle(
        'each', float_input('current', TOPICS[0]) + float_input('wind', TOPICS[1]),
        '  - {id: EACH, ptltl: "current < 0.0 & wind < 0.0"}\n')
    publish = ('--publish', HANDLER)
    yield 'violation', work, [bench.callback(work, *publish), bench.monitors(bundle)[0],
                              bench.exported(bundle)], inline
    work = Work(TOPICS[:1], int(bench.seconds * SILENCES), SILENCES, echo=HANDLER)
    more = f', timeout: {TIMEOUT}, startup: {TIMEOUT}, stale: violate'
    bundle = bench.bundle('silent', float_input('current', TOPICS[0], more),
                          '  - {id: EACH, report: onset, ptltl: "current > 0.0"}\n')
    yield 'deadline', work, [
        bench.callback(work, *publish, '--after', str(TIMEOUT)), bench.monitors(bundle)[0],
        bench.exported(bundle)], deadline
    inputs = 'inputs:\n  x: {topic: raw, type: std_msgs/msg/Float32, timeout: 5}\n'
    work = replace(bench.work(('raw',), bench.rate, echo='relayed'), is_relayed=True)
    bare = bench.bare(work, '--relay', 'relayed', name='bare relay, rcl in C')
    yield 'gate', work, [bare, bench.gate('gate_passes', inputs, 'x >= 0', 'drop')], relayed
    yield 'substitute', work, [bare, bench.gate(
        'gate_withholds', inputs, 'x > 1e30', '{substitute: {data: 1.0}}')], relayed


def main() -> int:
    """Trace all cases, or one, and print a table."""
    parser = ArgumentParser(description='Show where latency goes, beside bare rcl in C.')
    parser.add_argument('--rounds', type=int, default=1)
    parser.add_argument('--rate', type=float, default=RATE, help='messages a second')
    parser.add_argument('--only', choices=('violation', 'deadline', 'gate', 'substitute'))
    options = parser.parse_args()
    show_cells('case', 'subject', 'stage', 'median', '99 %', 'mean of the slowest 1 %')
    print('|---|---|---|---|---|---|')
    with prepared(options.rounds, options.rate) as bench:
        library = library_of(bench)
        for case, work, subjects, chain in cases(bench):
            if options.only not in (None, case):
                continue
            found: dict[str, list[Chain]] = {}
            for _ in range(bench.rounds):  # in turns, so that all have the same other load
                for subject in subjects:
                    found.setdefault(subject.name, []).append(
                        trace(bench, work, subject, chain, library))
            for name, chains in found.items():
                for row in rows(name, chains):
                    show_cells(case, *row)
    return 0


if __name__ == '__main__':
    sys.exit(main())
