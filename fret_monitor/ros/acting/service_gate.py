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
A gate on a service: offers the service, judges each request, and forwards those that pass.

A request is judged as the message of the service's events that an input may read
(`SERVICE/_service_event`, with the fields `request[0].FIELD`). The executor runs this, in Python.
"""

from contextlib import ExitStack
from math import inf
from time import monotonic, time_ns
from typing import Any, cast

from fret_monitor.model.manifest import ManifestGate
from fret_monitor.native import words
from fret_monitor.ros.intake.fields import message_class
from fret_monitor.ros.log_lines import Throttle
from fret_monitor.ros.settings.names import one_type
from fret_monitor.runtime import Engine, Judgement
from fret_monitor.runtime.reporting import GateFacts

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.task import Future
from service_msgs.msg import ServiceEventInfo

_FAILED = _rclpy.RCLError, _rclpy.InvalidHandle  # the second: what was closed
_LOGGED_S = 10.0  # between two log lines about requests that no server answers


class ServiceGate:
    """
    Offers the source of a gate from its creation until `close`, and calls its target.

    A request that is withheld, or for which there is no server, gets the gate's response.
    """

    topic = None  # the feed reads none
    turns = None  # it has no thread

    def __init__(self, node: Node, engine: Engine, gate: ManifestGate) -> None:
        """Offer the service; `engine` has the gate. Raises `Refusal` as `one_type`."""
        self._node = node
        self._engine = engine
        self._kind: Any = message_class(gate.interface)
        self._refusal: Any = deserialize_message(gate.substitute, self._kind.Response)
        self._name = gate.name
        self._throttle = Throttle(_LOGGED_S)
        self._timeout = gate.timeout / 1e9
        self._pending: dict[Future, tuple[float, Any]] = {}  # the end of its time, the request
        # Others may call while a request waits for the server.
        group = ReentrantCallbackGroup()
        with ExitStack() as undo:
            with one_type(node, 'call', gate.target, gate.interface, is_service=True):
                self._client: Any = node.create_client(
                    self._kind, gate.target, callback_group=group)
            undo.callback(node.destroy_client, self._client)
            with one_type(node, 'offer', gate.source, gate.interface, is_service=True):
                self._service: Any = node.create_service(
                    self._kind, gate.source, self._serve, callback_group=group)
            undo.pop_all()
        # As text, since other threads may read them when the gate is closed.
        self.target = str(self._client.service_name)
        """The full name of the service that is called."""
        self.source = str(self._service.service_name)
        """The full name of the service that is offered."""
        self._respond = self._service.send_response
        cast(Any, self._service).send_response = self._send
        self.unanswered = 0
        """Requests that passed, and that no server answered."""

    def _serve(self, request: Any, response: Any) -> Any:
        """Return the response, or what `_send` waits for; also while another thread closes."""
        try:
            if not self._client.service_is_ready():  # not judged: a request that passes is a step
                return self._unanswered()
            if self._engine.judge(self._event(request), time_ns()) is not Judgement.PASSED:
                return self._refusal
            return self._client.call_async(request)
        except _FAILED:
            return self._unanswered()

    def _send(self, answer: Any, request: Any) -> None:
        """
        Send what `_serve` has returned, at once or when the server has answered.

        The executor calls it, in place of the service's own `send_response`. It must not wait for
        the server: `close` answers while the executor does not run.
        """
        if isinstance(answer, Future):
            self._pending[answer] = monotonic() + self._timeout, request
            answer.add_done_callback(self._pass_on)
            return
        try:
            self._respond(answer, request)
        except _FAILED as error:
            self._node.get_logger().warning(words.RESPONSE_NOT_SENT % (self.source, error))

    def _pass_on(self, future: Future) -> None:
        """Send the answer of the server, unless the request was refused meanwhile."""
        if (waiting := self._pending.pop(future, None)) is not None:
            self._send(future.result(), waiting[1])

    def _event(self, request: Any) -> bytes:
        info = ServiceEventInfo(event_type=ServiceEventInfo.REQUEST_RECEIVED)
        info.stamp = self._node.get_clock().now().to_msg()
        return bytes(serialize_message(self._kind.Event(info=info, request=[request])))

    def _unanswered(self) -> Any:
        self.unanswered += 1
        if self._throttle.passes():
            self._node.get_logger().error(words.UNANSWERED % (self._name, self.target))
        return self._refusal

    def look(self) -> GateFacts:
        """
        Return what is around the gate; to be called once a second.

        It refuses the requests that wait for a server that has gone, or too long: a server that
        was killed and started again is there, and has not the request.
        """
        if self._pending:
            self._refuse_pending(monotonic() if self._client.service_is_ready() else inf)
        others = self.source if self._node.count_services(self.source) > 1 else ''
        return GateFacts(others, self.source, self.unanswered)

    def _refuse_pending(self, now: float = inf) -> None:
        for future, (end, request) in list(self._pending.items()):
            if now >= end and self._pending.pop(future, None) is not None:
                self._client.remove_pending_request(future)
                self._send(self._unanswered(), request)

    def close(self) -> None:
        """Withdraw the service; requests that wait for the server are refused."""
        self._refuse_pending()
        self._node.destroy_service(self._service)
        self._node.destroy_client(self._client)
