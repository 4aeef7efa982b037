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

"""The benchmark of the nodes: its C programs build, and every message is counted."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
import re

from bench import graph, ros as bench, trace
from fret_monitor.native.ros_files import prefixes
from native import engine
import pytest
from strategies import thorough

if not any(prefix.glob('include/*/rcl/rcl.h') for prefix in prefixes()) or \
        not any((prefix / 'lib/fret_monitor/monitor').is_file() for prefix in prefixes()):
    pytest.skip('needs the headers of rcl, and the installed node', allow_module_level=True)

SAMPLE = bench.Sample(sent=100, counted=100, answers=100, cpu=10.0, p50=1.0, p99=2.0,
                      resident=30.0, highest=40.0)


@thorough
@pytest.mark.usefixtures('domain')
def test_each_node_in_a_graph_that_changes_uses_the_processor(
        capsys: pytest.CaptureFixture[str]) -> None:
    assert graph.main(['--nodes', '3', '--windows', '3', '--seconds', '1', '--settle', '1']) == 0
    _, _, *rows = (line.split(' | ') for line in capsys.readouterr().out.splitlines())
    names, medians = [row[0].removeprefix('| ') for row in rows], [float(row[1]) for row in rows]
    monitors = ['monitor of a topic', 'monitor of a topic and the graph']
    assert names == ['a bare node of rclpy', *monitors,
                     *(f'{name}, native:=true' for name in monitors)]
    assert all(0.0 < median < 1000.0 for median in medians)


@pytest.fixture(scope='module')
def prepared(short_bench: None) -> Iterator[bench.Bench]:
    built_engine = engine.entry()
    with bench.prepared(rounds=1, rate=200.0, seconds=0.5, flood=2000) as made:
        engine.put(built_engine)
        yield made


@pytest.fixture
def short(prepared: bench.Bench, domain: int) -> bench.Bench:
    """Return a short benchmark in a domain of its own; its programs are built once."""
    return prepared


@thorough
@pytest.mark.usefixtures('forking')
def test_every_subject_counts_and_answers_every_message(short: bench.Bench) -> None:
    rows = list(bench.violations(short))
    assert {row.note for row in rows} <= {'', 'in callbacks', 'in a thread'}
    measured = {row.subject: row for row in rows if row.figure.startswith('CPU a message')}
    assert {'rcl in C', 'monitor', 'rclpy', bench.UNREAD} <= set(measured)
    assert all(measured[name].value > 0.0 for name in ('rcl in C', 'rclpy'))
    assert measured['rcl in C'].ratio == 1.0
    p50, p99 = ({row.subject: row.value for row in rows if row.figure.endswith(name)}
                for name in ('p50', 'p99'))
    assert set(p50) == set(p99) == set(measured) - {bench.UNREAD}
    assert all(0.0 < p50[name] <= p99[name] for name in p50)


@thorough
@pytest.mark.usefixtures('forking')
def test_a_large_message_is_counted_by_every_subject_that_takes(short: bench.Bench) -> None:
    rows = list(bench.cloud(replace(short, seconds=0.4)))
    # On a busy machine a few may be missing; their number stands in the note.
    notes = {re.sub(r'(, )?\b[1-5] messages missing', '', row.note) for row in rows}
    assert notes <= {'', 'in callbacks', 'in a thread'}
    work = short.work(('points',), bench.CLOUDS, content='cloud', depth=10)
    assert bench.sample(short.load, work, short.unread(work)).counted == 0


@thorough
@pytest.mark.usefixtures('forking')
def test_a_flood_is_never_counted_as_more_messages_than_were_sent(short: bench.Bench) -> None:
    rows = list(bench.flood(short))
    assert len(rows) >= 3
    assert all(0.0 < row.value <= 100.0 for row in rows)


def test_a_start_ends_with_the_first_step_after_the_first_subscription(short: bench.Bench) -> None:
    handler = 'copilot/handlerpropR'
    work = bench.Work(('a', 'b'), 1, 0.0, echo=handler)
    bundle = short.bundle(
        'two', bench.float_input('a', 'a') + bench.float_input('b', 'b'),
        '  - {id: R, ptltl: "a < 0.0 & b < 0.0"}\n')
    for subject in (short.bare(work, '--publish', handler), *short.monitors(bundle)):
        start = bench.started(short.load, work, subject)
        assert 0.0 < start.first <= start.every <= start.step


@thorough
@pytest.mark.usefixtures('forking')
def test_nodes_at_rest_are_compared_with_bare_ones_also_while_others_come(
    short: bench.Bench,
) -> None:
    rows = list(bench.idle(replace(short, idle_topics=(2,), settle=1.0)))
    assert [row.subject for row in rows] == 2 * ['rclpy', 'rcl in C', 'monitor', bench.EXPORTED]
    assert all(row.value > 0.0 for row in rows)
    bare = {row.figure: row.value for row in rows if row.subject == 'rclpy'}
    for row in rows:
        if row.subject == 'monitor':
            assert row.ratio == pytest.approx(row.value / bare[row.figure])


@thorough
def test_a_trace_has_each_hand_over_of_each_message_in_order(short: bench.Bench) -> None:
    library = trace.library_of(short)
    for case, work, (bare, monitor, *_), chain in trace.cases(short):
        if case not in ('violation', 'gate'):
            continue
        for subject in (bare, monitor):
            found = trace.trace(short, work, subject, chain, library)
            moments = list(found.values())
            assert {len(times) for times in moments} == {work.count}
            for before, after in pairwise(moments):
                assert all(a <= b for a, b in zip(before, after)), (case, subject.name)
            *stages, total = trace.rows(subject.name, [found])
            assert [row[1] for row in stages] == [
                f'{a} to {b}' for a, b in pairwise(found)]
            assert total[1] == f'sent to {[*found][-1]}'


def test_missing_figures_are_reported_and_ratios_compare_the_same_round() -> None:
    in_a_thread = replace(SAMPLE, way='in a thread', cpu=30.0)
    found = {'rcl in C': [SAMPLE, replace(SAMPLE, cpu=20.0), SAMPLE],
             bench.UNREAD: [replace(SAMPLE, counted=0, answers=0)] * 3,
             'monitor': [replace(SAMPLE, counted=99, cpu=5.0), replace(SAMPLE, cpu=20.0),
                         in_a_thread]}
    rows = {row.subject: row for row in bench.rows('CPU', 'us', found, lambda item: item.cpu, '1')}
    monitor = rows['monitor']
    assert (monitor.value, monitor.lowest, monitor.highest) == (20.0, 5.0, 30.0)
    assert monitor.ratio == 1.0
    assert {name: row.note for name, row in rows.items()} == {
        'rcl in C': '', bench.UNREAD: '', 'monitor': 'in a thread, 1 messages missing'}


def test_a_subject_that_does_not_start_is_reported_with_its_output(short: bench.Bench) -> None:
    work = short.work(('a',), 100.0)
    bad = short.bundle('bad', bench.float_input('a', 'a'), '  - {id: R, ptltl: "nobody > 0.0"}\n')
    with pytest.raises(SystemExit, match='nobody'):
        bench.sample(short.load, work, short.monitors(bad)[0])
