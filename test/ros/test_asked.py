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

"""States of lifecycle nodes, and parameters, as inputs: both nodes side by side."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from bundles import write_bundle
import pytest
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.node import Node
from rclpy.parameter import Parameter
from ros.exported import exported_bundle, running
from ros.harness import NodeProcess, Partner, started, wait_until
from std_msgs.msg import Empty

diagnostic_msgs = pytest.importorskip('diagnostic_msgs.msg')

BUNDLE = """
format: 1
inputs:
  state: {lifecycle: /robot/controller, startup: 4}
  never: {lifecycle: /robot/never, startup: 4, timeout: 1, stale: violate}
  plain: {lifecycle: /robot/plain, startup: 4}
  speed: {parameter: {node: /robot/plain, name: speed}, type: float64}
  mode:
    parameter: {node: /robot/plain, name: mode}
    type: string
    values: {FAST: fast, SLOW: slow}
  none: {parameter: {node: /robot/plain, name: none}, type: bool, initial: true}
  other: {parameter: {node: /robot/plain, name: other}, type: int64}
  gone: {parameter: {node: /robot/gone, name: speed}, type: int64, startup: 4}
evaluation: {policy: relevant_message}
requirements:
  - {id: ACTIVE, ptltl: state = ACTIVE}
  - {id: INACTIVE, ptltl: state != INACTIVE}
  - {id: FINAL, ptltl: state != FINALIZED}
  - {id: THERE, ptltl: state != UNKNOWN}
  - {id: NEVER, ptltl: never != ACTIVE}
  - {id: PLAIN, ptltl: plain = ACTIVE}
  - {id: SPEED, ptltl: speed < 1}
  - {id: FAST, ptltl: mode != FAST}
  - {id: NONE, ptltl: none}
  - {id: OTHER, ptltl: other < 1}
  - {id: GONE, ptltl: gone < 1}
"""
IDS = ('ACTIVE', 'INACTIVE', 'FINAL', 'THERE', 'NEVER', 'PLAIN', 'SPEED', 'FAST', 'NONE', 'OTHER',
       'GONE')
SPACES = ('one', 'two')
WARN, ERROR = b'\1', b'\2'


class Controller(LifecycleNode):
    """A lifecycle node that does not let itself be deactivated."""

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        del state
        return TransitionCallbackReturn.FAILURE


@contextmanager
def both(bundle: Path) -> Iterator[tuple[NodeProcess, NodeProcess]]:
    """Run the node on rclpy in the namespace /one, that in C in /two."""
    with running(exported_bundle(bundle), '-r', '__ns:=/two') as other, \
            started('monitor', '-p', f'spec:={bundle}', '-r', '__ns:=/one') as first:
        yield first, other


class Watcher:
    """What both nodes publish."""

    def __init__(self, partner: Partner, ids: Iterable[str] = IDS) -> None:
        self._partner = partner
        self._statuses: dict[tuple[str, str], Any] = {}
        partner.node.create_subscription(
            diagnostic_msgs.DiagnosticArray, '/diagnostics', self._take, 10)
        for space in SPACES:
            for name in ids:
                partner.node.create_subscription(
                    Empty, f'/{space}/copilot/handlerprop{name}',
                    partial(self._count, f'{space} {name}'), 10)

    def _count(self, name: str, _: Any) -> None:
        self._partner.heard[name] += 1

    def _take(self, array: Any) -> None:
        for item in array.status:
            node, _, name = item.name.partition(': ')
            self._statuses[node.partition('/')[0], name] = item.level, item.message

    def expect(self, name: str, text: str, level: bytes = b'\0') -> None:
        """Wait until both nodes say this of a source."""
        def is_said() -> bool:
            return all(self._statuses.get((space, name)) == (level, text) for space in SPACES)
        wait_until(is_said, f'{name}: {text}')

    def violations(self, **expected: int) -> None:
        """Wait for these violations since the last call, in both nodes, and no others."""
        self._partner.expect({f'{space} {name}': number for space in SPACES
                              for name, number in expected.items()})
        self._partner.heard.clear()


@contextmanager
def living(partner: Partner, kind: type[Node], name: str,
           namespace: str = '/robot') -> Iterator[Any]:
    """Spin another node."""
    node = kind(name, namespace=namespace, context=partner.context)
    partner._executor.add_node(node)
    try:
        yield node
    finally:
        partner._executor.remove_node(node)
        node.destroy_node()
        if isinstance(node, LifecycleNode):  # otherwise it stays in the graph
            node._state_machine.destroy_when_not_in_use()


def test_states_and_parameters_are_seen_when_nodes_come_change_and_go(
        partner: Partner, tmp_path: Path) -> None:
    watcher = Watcher(partner)
    with both(write_bundle(tmp_path, BUNDLE)) as processes:
        watcher.expect('graph lifecycle /robot/controller', 'never seen', WARN)
        watcher.expect('graph parameter speed of /robot/gone', 'its node is not there', WARN)
        watcher.violations(ACTIVE=1, THERE=1, PLAIN=1, NEVER=1)
        with living(partner, Controller, 'controller') as controller:
            watcher.expect('graph lifecycle /robot/controller', 'unconfigured')
            watcher.violations(ACTIVE=1)
            controller.trigger_configure()
            watcher.expect('graph lifecycle /robot/controller', 'inactive')
            watcher.violations(ACTIVE=1, INACTIVE=1)
            controller.trigger_activate()
            watcher.expect('graph lifecycle /robot/controller', 'active')
            controller.trigger_deactivate()  # fails: it stays active
            watcher.violations()
        watcher.expect('graph lifecycle /robot/controller', 'not there any more')
        watcher.violations(ACTIVE=1, THERE=1)
        with living(partner, Controller, 'controller2'), \
                living(partner, Controller, 'controller') as controller:  # started again
            watcher.expect('graph lifecycle /robot/controller', 'unconfigured')
            watcher.violations(ACTIVE=1)
            controller.trigger_shutdown()
            watcher.expect('graph lifecycle /robot/controller', 'finalized')
            watcher.violations(ACTIVE=1, FINAL=1)
        watcher.violations(ACTIVE=1, THERE=1)
        _change_parameters(partner, watcher)
        for process in processes:
            process.wait_for('lifecycle /robot/plain: the node does not answer its get_state '
                             'service; its input keeps its value')
            process.wait_for('lifecycle /robot/never: nothing is there since the start')
            process.wait_for('parameter other of /robot/plain: its type is string, and not int64; '
                             'its input has no value yet')


def _change_parameters(partner: Partner, watcher: Watcher) -> None:
    about = 'graph parameter {} of /robot/plain'.format
    watcher.expect(about('speed'), 'its node is not there', WARN)

    def plain(name: str, **options: Any) -> Node:
        node = Node(name, **options)
        for parameter, value in (('speed', 0.5), ('mode', 'fast'), ('other', 'text')):
            node.declare_parameter(parameter, value)
        return node

    with living(partner, plain, 'plain') as node:  # type: ignore[arg-type]
        watcher.expect(about('speed'), 'it has a value')
        watcher.expect(about('other'), 'its type is string, and not int64', ERROR)
        watcher.expect(about('none'), 'the node has no such parameter', WARN)
        watcher.violations(FAST=1)
        node.declare_parameter('none', False)
        watcher.expect(about('none'), 'it has a value')
        watcher.violations(NONE=1)
        node.set_parameters([Parameter('speed', value=2.0), Parameter('mode', value='slow')])
        node.set_parameters([Parameter('speed', value=2.0)])  # no change
        watcher.violations(SPEED=1)
        node.undeclare_parameter('none')
        watcher.expect(about('none'), 'the node has no such parameter', WARN)
        watcher.expect('graph lifecycle /robot/plain',
                       'the node does not answer its get_state service', WARN)
    watcher.expect(about('speed'), 'its node is not there', WARN)
    watcher.expect('graph lifecycle /robot/plain', 'not there any more')
    with living(partner, plain, 'plain'):  # type: ignore[arg-type]
        watcher.expect(about('speed'), 'it has a value')
        watcher.violations(FAST=1)
