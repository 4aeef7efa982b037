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

"""Both nodes end quietly on SIGINT and SIGTERM, every time, idle and flooded."""

from collections.abc import Iterator
from functools import partial
from itertools import cycle
from pathlib import Path
import signal
from threading import Event, Thread
from time import monotonic, sleep

from bundles import BELOW_HALF, write_bundle
from fret_monitor import build
import pytest
from ros.harness import NodeProcess, Partner, READY, wait_until
from std_msgs.msg import Empty, Float32
from strategies import EXAMPLES

# The monitor takes messages in callbacks, and in a thread of C; the logger in Python.
nodes = pytest.mark.parametrize(
    'name, hot_path', [('monitor', 'on'), ('monitor', 'off'), ('logger', 'off')],
    indirect=['hot_path'])
SIGNALS = (signal.SIGINT, signal.SIGTERM)
signals = pytest.mark.parametrize('number', SIGNALS)

IDLE_AT_ONCE = 2  # half of them get the one signal, half the other
BUSY_AT_ONCE = 4
BUSY_ROUNDS = max(1, EXAMPLES // 50)  # `make thorough`: ten
PATIENCE = 30.0  # s; it takes two on an idle machine, ten beside other tests


@pytest.fixture(scope='module')
def parameter(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Return the parameter to start a node with: a compiled bundle, which starts fastest."""
    folder = tmp_path_factory.mktemp('compiled')
    bundle = build.read(write_bundle(folder, BELOW_HALF))
    build.write(build.generate_monitor(bundle), folder / 'library')
    return f'library:={folder / "library"}'


@pytest.fixture
def flood(partner: Partner) -> Iterator[Event]:
    """
    Return an event: while it is set, monitor and logger receive several kHz of messages.

    Half of the messages are violations.
    """
    values = partner.publisher(Float32, 'x')
    violations = partner.publisher(Empty, 'copilot/handlerpropR')
    is_on, is_over = Event(), Event()

    def pour() -> None:
        number = 0
        while not is_over.is_set():
            is_on.wait()
            for _ in range(10):
                number += 1
                values.publish(Float32(data=float(number % 2)))
                violations.publish(Empty())
            sleep(0.002)

    thread = Thread(target=pour, daemon=True)
    thread.start()
    yield is_on
    is_over.set()
    is_on.set()
    thread.join()


def end_all(name: str, parameter: str, at_once: int, rounds: int, flood: Event, *,
            is_anew: bool) -> None:
    for turn in range(rounds):
        # Nodes of the last turn may still be in messages of the middleware.
        nodes = [NodeProcess(name, '-p', parameter, '-r', f'__node:=node{turn}_{place}',
                             is_anew=is_anew)
                 for place in range(at_once)]
        try:
            for node in nodes:
                node.wait_for(READY[name])
            flood.set()
            sleep(0.3)
            for node, number in zip(nodes, cycle(SIGNALS)):
                node.process.send_signal(number)
            for node in nodes:
                assert node.status(PATIENCE) == 0, node.output
                told = [line for line in node.output.splitlines()
                        if not line.startswith(('[INFO]', '[ERROR]')) or 'context' in line]
                # A flood may overflow a queue, which is logged.
                told = [line for line in told if ' lost on /' not in line]
                assert told == []
        finally:
            flood.clear()
            for node in nodes:
                node.kill()


@nodes
def test_an_idle_node_ends_quietly(
    name: str, hot_path: str, parameter: str, domain: int,
) -> None:
    # Once: an idle node has few threads that could meet.
    end_all(name, parameter, IDLE_AT_ONCE, 1, flood=Event(), is_anew=True)


@nodes
def test_a_busy_node_ends_quietly(
    name: str, hot_path: str, parameter: str, flood: Event,
) -> None:
    end_all(name, parameter, BUSY_AT_ONCE, BUSY_ROUNDS, flood, is_anew=False)


def catches(process: int, number: signal.Signals) -> bool:
    """Return whether a process has a handler for a signal."""
    status = Path(f'/proc/{process}/status').read_text()
    mask = next(line.split()[1] for line in status.splitlines() if line.startswith('SigCgt'))
    return bool(int(mask, 16) >> (number - 1) & 1)


@pytest.mark.skipif(not Path('/proc/self/status').exists(), reason='needs /proc')
@signals
@nodes
def test_a_node_that_is_still_starting_ends_quietly(
    name: str, hot_path: str, number: signal.Signals, parameter: str, domain: int,
) -> None:
    # Before Python runs (with the wheels it starts twice), no Python code can handle a signal.
    for delay in (0.0, 0.1, 0.3) if number == signal.SIGINT else (0.05, 0.2, 0.5):
        node = NodeProcess(name, '-p', parameter, is_anew=True)
        try:
            wait_until(partial(catches, node.process.pid, signal.SIGTERM), 'its first moment')
            sleep(delay)
            assert node.end(number, PATIENCE) == 0, f'after {delay} s:\n{node.output}'
            assert 'Traceback' not in node.output
        finally:
            node.kill()


def test_further_signals_do_not_disturb_the_shutdown(parameter: str, domain: int) -> None:
    node = NodeProcess('monitor', '-p', parameter, is_anew=True)
    try:
        node.wait_for(READY['monitor'])
        end = monotonic() + PATIENCE
        while node.process.poll() is None and monotonic() < end:
            node.process.send_signal(signal.SIGINT)
            sleep(0.002)
        assert node.status(PATIENCE) == 0, node.output
        assert 'Traceback' not in node.output
    finally:
        node.kill()
