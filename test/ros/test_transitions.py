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

"""Both nodes as managed nodes: they answer, log and advertise the same in each state."""

from collections.abc import Callable, Iterator
from pathlib import Path
import re
from typing import Any

from bundles import write_bundle
from lifecycle_msgs.msg import State, Transition, TransitionEvent
from lifecycle_msgs.srv import ChangeState, GetAvailableStates, GetAvailableTransitions, GetState
import pytest
from ros.exported import exported_bundle, ExportedNode
from ros.harness import answer_of, NodeProcess, Partner, RELIABLE, wait_until
from std_srvs.srv import Trigger

BUNDLE = """
format: 1
inputs:
  x: {topic: x, type: std_msgs/msg/Float32, timeout: 60.0}
  n: {topic: n, type: std_msgs/msg/Int32, qos: {depth: 5}}
actions:
  halt: {lock: {topic: halted}}
  stop: {publish: {topic: cmd, type: std_msgs/msg/Bool, message: {data: true}}}
  call: {call: {service: call, type: std_srvs/srv/Trigger}}
requirements:
  - {id: R-1, ptltl: "x < 0.5", report: occurrence, on_violation: [halt, stop, call]}
  - {id: R-2, ptltl: "n < 5 | FTP"}
"""
_LINE = re.compile(r'^\[([A-Z]+)\] \[[0-9.]+\] \[[\w.]+\]: ', re.MULTILINE)

T = Transition
ALL_STEPS: list[int | str] = [
    T.TRANSITION_ACTIVATE, T.TRANSITION_DEACTIVATE, 77, 'nonsense',
    T.TRANSITION_CONFIGURE, 'activate', T.TRANSITION_CONFIGURE, T.TRANSITION_DEACTIVATE,
    T.TRANSITION_ACTIVATE, T.TRANSITION_DEACTIVATE, 'cleanup', T.TRANSITION_CONFIGURE,
    T.TRANSITION_ACTIVATE, T.TRANSITION_CLEANUP, 'shutdown', T.TRANSITION_UNCONFIGURED_SHUTDOWN]


class Managed:
    """One of the nodes, in a namespace of its own, and what is seen of it."""

    def __init__(self, partner: Partner, name: str, process: NodeProcess) -> None:
        self.process = process
        self._name = name
        self._partner = partner
        self._events: list[str] = []
        events = partner.node.create_subscription(
            TransitionEvent, f'/{name}/fret_monitor/transition_event', self._take, RELIABLE)
        self._change = self._client(ChangeState, 'change_state')
        process.wait_for('waiting to be configured and activated')
        wait_until(lambda: events.get_publisher_count() > 0, 'events')

    def _take(self, event: TransitionEvent) -> None:
        self._events.append(f'{event.transition} {event.start_state} {event.goal_state}')

    def _client(self, kind: Any, name: str) -> Any:
        return self._partner.node.create_client(kind, f'/{self._name}/fret_monitor/{name}')

    def _answer(self, kind: Any, name: str) -> str:
        return str(answer_of(self._client(kind, name), kind.Request()))

    def change(self, step: int | str) -> Iterator[str]:
        """Request a transition, and yield what the node answers to all questions then."""
        answer_of(self._change, ChangeState.Request(transition=T(label='none')))  # it is matched
        answer = self._change.call_async(ChangeState.Request(
            transition=T(id=step) if isinstance(step, int) else T(id=1, label=step)))
        wait_until(answer.done, f'{step}')
        state = answer_of(self._client(GetState, 'get_state'), GetState.Request()).current_state
        yield f'{step}: {answer.result()} {state} {self._answer(Trigger, "reset")}'
        yield self._answer(GetAvailableTransitions, 'get_available_transitions')
        yield f'{self.endpoints(is_active=state.id == State.PRIMARY_STATE_ACTIVE)}'

    def endpoints(self, *, is_active: bool) -> list[str]:
        """Return what the node advertises and uses, once what an active node has has changed."""
        node, own = self._partner.node, ('fret_monitor', f'/{self._name}')
        wait_until(lambda: node.count_subscribers(f'/{self._name}/x') == is_active, 'x')
        wait_until(lambda: node.count_publishers(
            f'/{self._name}/fret_monitor/alive') == is_active, '~/alive')
        topics: list[tuple[Callable[..., Any], Callable[..., Any]]] = [
            (node.get_publisher_names_and_types_by_node, node.get_publishers_info_by_topic),
            (node.get_subscriber_names_and_types_by_node, node.get_subscriptions_info_by_topic)]
        found = [f'{topic} {types} {info.endpoint_type} {info.qos_profile}'
                 for names, infos in topics for topic, types in names(*own)
                 for info in infos(topic) if info.node_namespace == own[1]]
        return sorted(self._plain(item) for item in [
            *found, *map(str, node.get_service_names_and_types_by_node(*own)),
            *map(str, node.get_client_names_and_types_by_node(*own))])

    def _plain(self, text: str) -> str:
        return re.sub(r' \([^()]*\)$', '', text.replace(f'/{self._name}/', '/NODE/').rstrip())

    def seen(self, steps: list[int | str]) -> list[str]:
        """Return all answers to steps, the events, and the log."""
        found = [self._answer(GetAvailableStates, 'get_available_states'),
                 self._answer(GetAvailableTransitions, 'get_transition_graph'),
                 *(answer for step in steps for answer in self.change(step))]
        assert self.process.end() == 0, self.process.output
        _, *parts = _LINE.split(self.process.output)
        lines = [f'{level} {self._plain(text)}' for level, text in zip(parts[::2], parts[1::2])]
        return found + self._events + [line for line in lines if 'matching none' not in line]


@pytest.mark.parametrize(('steps', 'arguments', 'logged'), [
    (ALL_STEPS, ['-p', 'processors:="9999"'], 'INFO restarted 2 step groups; input values kept'),
    ([T.TRANSITION_CONFIGURE, T.TRANSITION_ACTIVATE], ['-r', 'x:=n'],
     'ERROR nothing is monitored until the node is active again')])
def test_both_nodes_answer_transitions_alike_and_log_the_same(
    partner: Partner, tmp_path: Path, steps: list[int | str], arguments: list[str], logged: str,
) -> None:
    path = write_bundle(tmp_path, BUNDLE)
    program = exported_bundle(path)

    def options(name: str) -> list[str]:
        return ['-r', f'__ns:=/{name}', '-p', 'autostart:=false', *arguments]

    nodes = {'python': NodeProcess('monitor', '-p', f'spec:={path}', *options('python')),
             'native': ExportedNode(program, *options('native'))}
    try:
        ours, theirs = (Managed(partner, *item).seen(steps) for item in nodes.items())
        assert ours == theirs, [pair for pair in zip(ours, theirs) if pair[0] != pair[1]]
        assert logged in ours
    finally:
        for node in nodes.values():
            node.kill()
