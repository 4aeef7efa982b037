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

"""Requests that are not answered by their server, and responses that cannot be sent."""

from typing import Any
from unittest.mock import MagicMock

from fret_monitor.model.manifest import ManifestGate
from fret_monitor.model.policies import Otherwise
from fret_monitor.native import evaluator_library, load_evaluator
from fret_monitor.ros.acting import service_gate
from fret_monitor.runtime import Judgement
import pytest

from rclpy import create_node
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.serialization import serialize_message
from rclpy.task import Future
from ros.harness import answer_of, Partner, wait_until
from ros.test_executors import EXECUTORS, spun
from std_srvs.srv import SetBool


GATE = ManifestGate(
    name='arm', source='arm', target='arm_raw', interface='std_srvs/srv/SetBool',
    is_service=True, topic=None, otherwise=Otherwise.RESPOND, hold=0, period=0,
    substitute=bytes(serialize_message(SetBool.Response(message='withheld'))),
    stamp_at=None, is_open_when_stale=False, latches=False, open_after=0, timeout=2 * 10**9)


def make_gate(node: Any, engine: MagicMock) -> service_gate.ServiceGate:
    """Return a gate whose requests pass, with a timeout of 2 s."""
    engine.judge.return_value = Judgement.PASSED
    engine.library = load_evaluator(evaluator_library())
    return service_gate.ServiceGate(node, engine, GATE)


def mocked() -> MagicMock:
    """Return a node in whose place a mock is."""
    node = MagicMock()
    node.create_client.return_value.call_async.return_value = Future()
    node.count_services.return_value = 1
    return node


@pytest.fixture(autouse=True)
def no_event(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(service_gate.ServiceGate, '_event', lambda *_: b'')


@pytest.mark.parametrize('executor', EXECUTORS)
def test_the_answer_of_the_server_is_passed_on_in_every_executor(
    partner: Partner, executor: Any,
) -> None:
    def serve(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        response.message = f'done {request.data}'
        return response

    partner.node.create_service(SetBool, 'arm_raw', serve)
    node = create_node('gated', context=partner.context)
    gate = make_gate(node, MagicMock())
    with spun(executor(context=partner.context), node):
        client = partner.node.create_client(SetBool, 'arm')
        wait_until(lambda: answer_of(client, SetBool.Request(data=True)).message == 'done True',
                   'the answer of the server')
        gate.close()


def sent(gate: service_gate.ServiceGate, respond: MagicMock) -> list[str]:
    """Serve a request as the executor does; return the responses that were sent so far."""
    gate._send(gate._serve(SetBool.Request(), SetBool.Response()), 'a request')
    return [call.args[0].message for call in respond.call_args_list]


def test_a_request_without_a_server_is_no_step() -> None:
    node, engine = mocked(), MagicMock()
    respond = node.create_service.return_value.send_response
    node.create_client.return_value.service_is_ready.return_value = False
    gate = make_gate(node, engine)
    assert sent(gate, respond) == ['withheld']
    assert gate.look().unsent == 1
    engine.judge.assert_not_called()


def test_a_request_that_cannot_be_sent_is_refused() -> None:
    node = mocked()
    respond = node.create_service.return_value.send_response
    gate = make_gate(node, MagicMock())
    node.create_client.return_value.call_async.side_effect = _rclpy.RCLError
    assert sent(gate, respond) == ['withheld']
    assert gate.look().unsent == 1


def test_a_request_waits_no_longer_than_its_timeout(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr(service_gate, 'monotonic', lambda: now[0])
    node = mocked()
    respond = node.create_service.return_value.send_response
    gate = make_gate(node, MagicMock())
    answer = node.create_client.return_value.call_async.return_value
    assert sent(gate, respond) == []
    now[0] = 1.9
    gate.look()
    respond.assert_not_called()
    now[0] = 2.0
    assert gate.look().unsent == 1
    assert respond.call_args.args[0].message == 'withheld'
    answer.set_result(SetBool.Response(message='late'))
    respond.assert_called_once()


def test_a_request_that_waits_is_refused_before_the_service_is_withdrawn() -> None:
    node = mocked()
    respond = node.create_service.return_value.send_response
    gate = make_gate(node, MagicMock())
    assert sent(gate, respond) == []
    gate.close()
    names = [name for name, _, _ in node.mock_calls]
    assert names.index('create_service().send_response') < names.index('destroy_service')


def test_a_response_that_cannot_be_sent_is_logged() -> None:
    node = mocked()
    respond = node.create_service.return_value.send_response
    respond.side_effect = _rclpy.RCLError('no client')
    gate = make_gate(node, MagicMock())
    sent(gate, respond)
    gate.close()
    assert 'is not sent: no client' in node.get_logger.return_value.warning.call_args.args[0]
    node.destroy_service.assert_called_once()


def test_a_request_that_another_thread_has_taken_before_the_gate_was_closed_ends_well(
    partner: Partner,
) -> None:
    node = create_node('gated', context=partner.context)
    gate = make_gate(node, MagicMock())
    gate.close()
    gate._send(gate._serve(SetBool.Request(), SetBool.Response()), MagicMock())
    assert (gate.source, gate.unanswered) == ('/arm', 1)
    node.destroy_node()
