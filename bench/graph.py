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
What a graph of ROS costs that keeps changing: processor time of the watch, by node names.

A process has 200 nodes, of which one comes and goes ten times a second; in another one the watch
of `csrc/ros/graph.c` looks at a node and two topics whenever the graph has changed. Its looks are
measured in processor time of the thread within them: it waits for changes in any case. Beside it,
the same looks through rclpy.

    .venv/bin/python -m bench.graph [--seconds N] [--nodes N]
"""

from argparse import ArgumentParser
import os
from pathlib import Path
import subprocess
import sys
from tempfile import TemporaryDirectory
from time import monotonic, sleep, thread_time_ns
from typing import Any

from fret_monitor.ros.intake.graph_sources import GraphSources
from fret_monitor.ros.intake.graph_wait import GraphWait
from fret_monitor.ros.intake.hot_path import Middleware
from fret_monitor.runtime.engine import Engine
from fret_monitor.runtime.evaluator import Evaluator
from fret_monitor.start import start
import rclpy
from rclpy.node import Node

BUNDLE = """
format: 1
inputs:
  alive: {node: /flapping}
  scans: {publishers: /scan}
  heard: {subscribers: /scan}
requirements:
  - {id: R, ptltl: alive & scans < 1 & heard < 1}
"""
FLAPPING = """
import sys, time, rclpy
from rclpy.node import Node
rclpy.init()
options = {'start_parameter_services': False, 'enable_rosout': False}
nodes = [Node(f'node_{number}', **options) for number in range(int(sys.argv[1]))]
print('ready', flush=True)
while True:
    if not rclpy.ok():
        break
    node = Node('flapping', **options)
    time.sleep(0.05)
    node.destroy_node()
    time.sleep(0.05)
"""


def measured(act: Any, seconds: float, node: Node) -> tuple[float, int]:
    """
    Call a function at each change, and when it asks for it.

    Return the processor time within it, in ms a second, and the changes.
    """
    graph = GraphWait(node)
    calls = used = 0
    wait = 0.05
    end = monotonic() + seconds
    while monotonic() < end:
        has_changed = graph.wait(min(0.05, wait))
        began = thread_time_ns()
        wait = act(has_changed)
        used += thread_time_ns() - began
        calls += has_changed
    graph.close()
    return used / 1e6 / seconds, calls


def main() -> int:
    """Print the table."""
    parser = ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('--seconds', type=float, default=10.0)
    parser.add_argument('--nodes', type=int, default=200)
    options = parser.parse_args()
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    os.environ.setdefault('ROS_DOMAIN_ID', '101')
    others = subprocess.Popen([sys.executable, '-c', FLAPPING, str(options.nodes)],
                              stdout=subprocess.PIPE)
    try:
        assert others.stdout is not None and others.stdout.readline() == b'ready\n'
        with TemporaryDirectory() as folder:
            spec = Path(folder) / 'bundle.yaml'
            spec.write_text(BUNDLE, encoding='utf-8')
            engine = Engine(Evaluator(start(spec).monitor))
        rclpy.init()
        node = Node('bench')
        sleep(3.0)  # discovery
        sources = GraphSources(node, engine, Middleware())

        def look(has_changed: bool) -> float:
            if has_changed:
                node.get_node_names_and_namespaces()
                node.count_publishers('/scan')
                node.count_subscribers('/scan')
            return 1.0

        print(f'{len(node.get_node_names())} nodes\n')
        print('| looks | processor time (ms/s) | changes |\n|---|---|---|')
        for name, act in (('the watch', lambda changed: sources.review(changed, lambda _: 0)),
                          ('rclpy, at each change', look)):
            used, calls = measured(act, options.seconds, node)
            print(f'| {name} | {used:.2f} | {calls} |')
    finally:
        others.terminate()
        others.wait()
    return 0


if __name__ == '__main__':
    sys.exit(main())
