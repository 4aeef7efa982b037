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

"""Signals while threads are being started, and while the node waits for them to end."""

import os
from pathlib import Path
import signal
from time import monotonic, sleep
from typing import Any

from bundles import BELOW_HALF, write_bundle
from fret_monitor.ros import MonitorNode
from fret_monitor.ros.intake import native_lifetimes
from fret_monitor.runtime import Engine
import pytest
from rclpy.parameter import Parameter
from ros import forked
from ros.harness import NodeProcess, Partner, PATIENCE, started

# Interrupts `destroy_node` while it waits for the feed's thread, and goes on publishing.
PROGRAM = """
import gc, signal, threading
import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import Float32
from fret_monitor.ros import MonitorNode

rclpy.init()
signal.signal(signal.SIGINT, signal.default_int_handler)
user = Node('user')
publisher = user.create_publisher(Float32, 'x', 10)
join = threading.Thread.join

def interrupted(self, *arguments):
    if self.name == {thread!r}:
        threading.Thread.join = join
        signal.raise_signal(signal.SIGINT)
    return join(self, *arguments)

def watch():
    node = MonitorNode(parameter_overrides=[Parameter('spec', value={bundle!r})])
    while not publisher.get_subscription_count():
        pass
    for _ in range(100):
        publisher.publish(Float32(data=2.0))
    threading.Thread.join = interrupted
    try:
        node.destroy_node()
    except KeyboardInterrupt:
        print('interrupted', flush=True)

watch()
gc.collect()
for _ in range(5000):
    publisher.publish(Float32(data=2.0))
print('still here', flush=True)
"""


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    return write_bundle(tmp_path, BELOW_HALF)


def threads(node: NodeProcess) -> int:
    try:
        return len(os.listdir(f'/proc/{node.process.pid}/task'))
    except FileNotFoundError:
        return 0


@pytest.mark.skipif(not Path('/proc/self/task').is_dir(), reason='needs /proc')
@pytest.mark.usefixtures('domain')
def test_a_signal_while_the_threads_start_ends_the_node(bundle: Path) -> None:
    arguments = ('-p', f'spec:={bundle}', '-p', 'hot_path:=on')
    with started('monitor', *arguments) as node:
        sleep(0.5)  # until the middleware has started its threads too
        running = threads(node)
    for before in (3, 2, 2, 2, 1, 1):
        node = NodeProcess('monitor', *arguments)
        try:
            end = monotonic() + PATIENCE
            while threads(node) < running - before and node.process.poll() is None:
                assert monotonic() < end, node.output
                sleep(0.0005)
            assert node.end(signal.SIGTERM) == 0, node.output
        finally:
            node.kill()


class InterruptedLibrary:
    """The functions of csrc; an exception is raised when one of them has returned."""

    def __init__(self, library: Any, interrupted: str) -> None:
        self._library = library
        self._interrupted = interrupted

    def __getattr__(self, name: str) -> Any:
        function = getattr(self._library, name)
        if name != self._interrupted:
            return function

        def call(*arguments: Any) -> None:
            function(*arguments)
            raise KeyboardInterrupt

        return call


@pytest.mark.skipif(not Path('/proc/self/task').is_dir(), reason='needs /proc')
@pytest.mark.parametrize('function', ['fm_announcer_start', 'fm_receiver_start'])
def test_an_interrupt_right_after_a_start_in_c_leaves_nothing_running(
    function: str, bundle: Path, partner: Partner, monkeypatch: pytest.MonkeyPatch,
) -> None:
    # A thread or a callback that was left would use the engine after it was freed.
    monkeypatch.setattr(
        Engine, 'library', property(lambda self: InterruptedLibrary(self._library, function)))
    parameters = [Parameter('spec', value=str(bundle)), Parameter('hot_path', value='on')]
    running, kept = len(os.listdir('/proc/self/task')), set(native_lifetimes._KEPT)
    with pytest.raises(KeyboardInterrupt):
        MonitorNode(context=partner.context, parameter_overrides=parameters)
    assert len(os.listdir('/proc/self/task')) <= running
    assert set(native_lifetimes._KEPT) == kept


@pytest.mark.usefixtures('domain')
@pytest.mark.parametrize('thread', ['feed', 'details'])
def test_an_interrupted_shutdown_does_not_crash(bundle: Path, thread: str) -> None:
    program = PROGRAM.format(bundle=str(bundle), thread=thread)
    done = forked.run(program, timeout=60)
    assert done.returncode == 0, f'{done.stdout}{done.stderr}'
    assert 'interrupted' in done.stdout
    assert 'still here' in done.stdout


START = """
import os, signal, sys
from fret_monitor.ros.signals import StopRequest
stop = StopRequest()
from fret_monitor.ros import {kind}
from fret_monitor.ros.process import run

def make():
    node = {kind}()
    print('made', flush=True)
    os.kill(os.getpid(), signal.SIGTERM)
    return node

sys.exit(run('{name}', make, stop))
"""


@pytest.mark.parametrize('kind, name, parameters', [
    ('LoggerNode', 'logger', ()),
    ('MonitorNode', 'monitor', ('-p', 'hot_path:=off')),
    ('MonitorNode', 'monitor', ('-p', 'hot_path:=on')),
])
def test_a_signal_just_before_the_node_is_handed_over_ends_the_process(
    kind: str, name: str, parameters: tuple[str, ...], domain: int,
) -> None:
    done = forked.run(START.format(kind=kind, name=name), '--ros-args', '-p',
                      'spec:=quadrotor.yaml', *parameters, timeout=120)
    assert 'made' in done.stdout, done.stderr
    assert done.returncode == 0, done.stderr


START_OF_A_THREAD = """
import signal, sys, threading
from fret_monitor.ros.signals import StopRequest
stop = StopRequest()
from fret_monitor.ros import {kind}
from fret_monitor.ros.process import run

start, acquire = threading.Thread.start, threading.Condition._acquire_restore

def interrupt():
    threading.Condition._acquire_restore = acquire
    signal.raise_signal(signal.SIGTERM)

def acquire_interrupted(self, state):
    interrupt()
    acquire(self, state)

def start_interrupted(self):
    if self.name != {thread!r}:
        return start(self)
    threading.Condition._acquire_restore = acquire_interrupted
    start(self)
    if threading.Condition._acquire_restore is acquire_interrupted:
        interrupt()  # it did not have to wait
    print('started', flush=True)

threading.Thread.start = start_interrupted
sys.exit(run('{name}', {kind}, stop))
"""


@pytest.mark.usefixtures('domain')
@pytest.mark.parametrize('kind, name, thread', [
    ('MonitorNode', 'monitor', 'details'), ('LoggerNode', 'logger', 'reports')])
def test_a_signal_inside_the_start_of_a_thread_takes_effect_after_it(
    kind: str, name: str, thread: str, bundle: Path,
) -> None:
    done = forked.run(START_OF_A_THREAD.format(kind=kind, name=name, thread=thread),
                      '--ros-args', '-p', f'spec:={bundle}', timeout=120)
    assert (done.returncode, done.stdout) == (0, 'started\n'), done.stderr


AFTER_A_BLOCK = """
import signal
from fret_monitor.ros.signals import StopRequest, uninterrupted
with StopRequest().interruptible():
    with uninterrupted():
        pass
    signal.raise_signal(signal.SIGTERM)
    print('went on')
"""


def test_a_signal_after_a_block_without_interruptions_takes_effect_at_once() -> None:
    done = forked.run(AFTER_A_BLOCK, timeout=60)
    assert (done.returncode, done.stdout) == (0, ''), done.stderr


# Tells by how many bytes the process grows while a thousand callbacks run.
CALLBACKS = """
import gc, os, signal, sys, tracemalloc
from fret_monitor.ros.signals import StopRequest
from fret_monitor.ros.process import run
from rclpy.node import Node

sizes = []

def make():
    node = Node('many')
    calls = []

    def call():
        calls.append(None)
        if len(calls) in (500, 1500):
            gc.collect()
            sizes.append(tracemalloc.get_traced_memory()[0])
            calls.append(None)
        if len(sizes) == 2:
            os.kill(os.getpid(), signal.SIGINT)

    node.create_timer(1e-5, call)
    tracemalloc.start()
    return node

status = run('monitor', make, StopRequest())
print(sizes[1] - sizes[0])
sys.exit(status)
"""


def test_a_node_does_not_grow_with_the_callbacks_of_its_executor(domain: int) -> None:
    done = forked.run(CALLBACKS, timeout=60)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) < 30_000  # a list of the calls, no object for each of them
