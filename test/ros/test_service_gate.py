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

"""A request that its server never answers."""

from unittest.mock import MagicMock

from fret_monitor.model.manifest import ManifestGate
from fret_monitor.model.policies import Otherwise
from fret_monitor.native import evaluator_library, load_evaluator
from fret_monitor.ros.acting import service_gate
from fret_monitor.runtime import Judgement
import pytest

from rclpy.serialization import serialize_message
from rclpy.task import Future
from std_srvs.srv import SetBool


def make_gate(node: MagicMock, engine: MagicMock) -> service_gate.ServiceGate:
    """Return a gate whose requests pass, with a timeout of 2 s."""
    engine.judge.return_value = Judgement.PASSED
    node.create_client.return_value.call_async.return_value = Future()
    node.count_services.return_value = 1
    engine.library = load_evaluator(evaluator_library())
    return service_gate.ServiceGate(node, engine, ManifestGate(
        name='arm', source='arm', target='arm_raw', interface='std_srvs/srv/SetBool',
        is_service=True, topic=None, otherwise=Otherwise.RESPOND, hold=0, period=0,
        substitute=bytes(serialize_message(SetBool.Response(message='withheld'))),
        stamp_at=None, is_open_when_stale=False, latches=False, open_after=0,
        timeout=2 * 10**9))


@pytest.fixture(autouse=True)
def no_event(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(service_gate.ServiceGate, '_event', lambda *_: b'')


def test_a_request_without_a_server_is_no_step() -> None:
    node, engine = MagicMock(), MagicMock()
    node.create_client.return_value.service_is_ready.return_value = False
    gate = make_gate(node, engine)
    with pytest.raises(StopIteration) as found:
        gate._serve(SetBool.Request(), SetBool.Response()).send(None)
    assert found.value.value.message == 'withheld'
    assert gate.look().unsent == 1
    engine.judge.assert_not_called()


def test_a_request_waits_no_longer_than_its_timeout(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr(service_gate, 'monotonic', lambda: now[0])
    gate = make_gate(MagicMock(), MagicMock())
    waiting = gate._serve(SetBool.Request(), SetBool.Response())
    waiting.send(None)
    now[0] = 1.9
    gate.look()
    waiting.send(None)  # it waits still
    now[0] = 2.0
    gate.look()
    with pytest.raises(StopIteration) as found:
        waiting.send(None)
    assert found.value.value.message == 'withheld'
    assert gate.look().unsent == 1
