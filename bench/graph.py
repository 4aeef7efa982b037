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
What a graph of ROS costs that keeps changing: processor time of nodes, beside a bare one.

A process has 200 nodes, of which one comes and goes ten times a second. Beside it run a bare node
of rclpy, which waits for nothing, and monitors with and without inputs of the graph: a node, and
the publishers and subscriptions of a topic. All run at once, and are measured over the same
windows of time. A bare node pays for the discovery of the middleware, too.

    .venv/bin/python -m bench.graph [--windows N] [--seconds N] [--nodes N]
"""

from argparse import ArgumentParser
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, ExitStack
import os
from pathlib import Path
from signal import SIGINT
from statistics import median
import subprocess
import sys
from tempfile import TemporaryDirectory
from time import sleep

from bench.native_start import BUNDLE

_GRAPH = """
format: 1
inputs:
  speed: {topic: speed, type: std_msgs/msg/Float32}
  alive: {node: /flapping}
  scans: {publishers: /scan}
  heard: {subscribers: /scan}
requirements:
  - {id: R, ptltl: speed <= 1.0}
  - {id: S, ptltl: alive & scans < 1 & heard < 1}
"""
_FLAPPING = """
import signal, sys, threading, rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
stop = threading.Event()
signal.signal(signal.SIGINT, lambda *_: stop.set())
rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
options = {'start_parameter_services': False, 'enable_rosout': False}
nodes = [Node(f'node_{number}', **options) for number in range(int(sys.argv[1]))]
print('watching', flush=True)
while not stop.is_set():
    node = Node('flapping', **options)
    stop.wait(0.05)
    node.destroy_node()
    stop.wait(0.05)
rclpy.shutdown()
"""
_BARE = """
import signal, rclpy
from rclpy.signals import SignalHandlerOptions
signal.signal(signal.SIGINT, lambda *_: None)
rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
node = rclpy.create_node('bare')
print('watching', flush=True)
signal.pause()
rclpy.shutdown()
"""
_MONITOR = 'from fret_monitor.ros.monitor import main; main()'


@contextmanager
def running(program: str, *arguments: str) -> Iterator[int]:
    """Run a program until it is ready; yield its process."""
    process = subprocess.Popen([sys.executable, '-c', program, *arguments],
                               stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert process.stdout is not None
    try:
        while 'watching' not in (line := process.stdout.readline()):
            if not line:
                raise RuntimeError(f'{arguments}: ended')
        yield process.pid
    finally:
        process.send_signal(SIGINT)
        process.communicate()


def used_ns(pid: int) -> int:
    """Return the processor time of all threads of a process."""
    return sum(int(file.read_text().split()[0])
               for file in Path(f'/proc/{pid}/task').glob('*/schedstat'))


def measured(pids: Sequence[int], windows: int, seconds: float) -> Iterator[list[float]]:
    """Yield the processor times in ms a second of some processes, for each window."""
    for _ in range(windows):
        before = [used_ns(pid) for pid in pids]
        sleep(seconds)
        yield [(used_ns(pid) - old) / 1e6 / seconds for pid, old in zip(pids, before, strict=True)]


@contextmanager
def subjects(folder: Path) -> Iterator[dict[str, int]]:
    """Run all subjects; yield their processes."""
    with ExitStack() as stack:
        found = {'a bare node of rclpy': stack.enter_context(running(_BARE))}
        for kind in ('', ', native:=true'):
            for name, text in (('a topic', BUNDLE), ('a topic and the graph', _GRAPH)):
                spec = folder / f'{len(found)}.yaml'
                spec.write_text(text, encoding='utf-8')
                found[f'monitor of {name}{kind}'] = stack.enter_context(running(
                    _MONITOR, '--ros-args', '-r', f'__node:=monitor_{len(found)}', '-p',
                    f'spec:={spec}', '-p', f'native:={"true" if kind else "false"}'))
        yield found


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('--windows', type=int, default=7)
    parser.add_argument('--seconds', type=float, default=10.0)
    parser.add_argument('--nodes', type=int, default=200)
    parser.add_argument('--settle', type=float, default=15.0, metavar='SECONDS',
                        help='before the first window, for discovery')
    options = parser.parse_args(arguments)
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    os.environ.setdefault('ROS_DOMAIN_ID', '101')
    with TemporaryDirectory() as folder, running(_FLAPPING, str(options.nodes)), \
            subjects(Path(folder)) as found:
        sleep(options.settle)
        rows = list(measured([*found.values()], options.windows, options.seconds))
    print('| processor time (ms/s) | median | windows | above the bare node |\n|---|---|---|---|')
    for name, *times in zip(found, *rows, strict=True):
        above = median(time - row[0] for time, row in zip(times, rows, strict=True))
        print(f'| {name} | {median(times):.2f} | {min(times):.2f} to {max(times):.2f} | '
              f'{above:.2f} |')
    return 0


if __name__ == '__main__':
    sys.exit(main())
