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
What an action calls: a service, or those of a lifecycle node. Each call may take time.

The functions here block, so each action has a thread of its own for them. The node's executor
receives the answers.
"""

from collections.abc import Callable, Mapping
from importlib import import_module
from threading import Event
from time import monotonic
from typing import Any

from fret_monitor.model.manifest import ManifestAction
from fret_monitor.model.policies import ActionKind
from fret_monitor.ros.intake.fields import message_class
from fret_monitor.ros.settings.endpoint_types import one_type

from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.client import Client
from rclpy.node import Node
from rclpy.serialization import deserialize_message

_POLL_S = 0.05  # between two checks for a server that is not there

# From a state to the next one on the way to another, by the id of the transition that leads there.
_CONFIGURE, _CLEANUP, _ACTIVATE, _DEACTIVATE = 1, 2, 3, 4
_SHUTDOWNS = {'unconfigured': 5, 'inactive': 6, 'active': 7}
_STEPS: Mapping[str, Mapping[str, int]] = {
    'unconfigured': {'inactive': _CLEANUP, 'active': _DEACTIVATE},
    'inactive': {'unconfigured': _CONFIGURE, 'active': _DEACTIVATE},
    'active': {'unconfigured': _CONFIGURE, 'inactive': _ACTIVATE},
    'finalized': _SHUTDOWNS,
}
_MOST_STEPS = 3


class CallError(Exception):
    """A call that failed; the text says how."""


class Service:
    """Calls a service, and waits for the answer."""

    def __init__(self, node: Node, kind: Any, name: str) -> None:
        """Create the client; raises `Refusal` if the process uses the service otherwise."""
        self._node = node
        interface = f'{kind.__module__.partition(".")[0]}/srv/{kind.__name__}'
        with one_type(node, 'call', name, interface, is_service=True):
            self._client: Client = node.create_client(kind, name)
        self._name = node.resolve_service_name(name)

    def call(self, request: Any, timeout: float, is_over: Event) -> Any:
        """
        Return the response; `timeout` is in seconds.

        Raises
        ------
        CallError
            if there is no server or no answer in time, or `is_over` is set meanwhile.
        """
        end = monotonic() + timeout
        while not self._client.service_is_ready():
            if is_over.wait(_POLL_S):
                raise CallError('the node ends')
            if monotonic() >= end:
                raise CallError(f'no server of {self._name} in {timeout:g} s')
        answered = Event()
        future = self._client.call_async(request)
        future.add_done_callback(lambda _: answered.set())
        while not answered.wait(max(0.0, min(_POLL_S, end - monotonic()))):
            if is_over.is_set() or monotonic() >= end:
                self._client.remove_pending_request(future)
                raise CallError('the node ends' if is_over.is_set() else
                                f'{self._name} has not answered in {timeout:g} s')
        if (error := future.exception()) is not None:
            raise CallError(str(error)) from error
        return future.result()

    @property
    def name(self) -> str:
        """The full name of the service."""
        return self._name

    def close(self) -> None:
        """Destroy the client."""
        self._node.destroy_client(self._client)


class ActionCall:
    """The call of an action: `call` or `transition`."""

    def __init__(self, node: Node, action: ManifestAction) -> None:
        """
        Create the clients.

        Raises
        ------
        MessageTypeError
            if the type of the service is not installed.
        Refusal
            as `Service`.
        """
        self._action = action
        self._timeout = action.timeout / 1e9
        self._services: list[Service] = []
        if action.kind is ActionKind.TRANSITION:
            self._services = [Service(node, GetState, f'{action.target}/get_state'),
                              Service(node, ChangeState, f'{action.target}/change_state')]
            self._once: Callable[[Event], None] = self._transition
        else:
            request = message_class(action.payload_type)
            kind = getattr(import_module(request.__module__.rpartition('.')[0]),
                           action.interface.rpartition('/')[2])
            self._request = deserialize_message(action.payload, request)
            self._services = [Service(node, kind, action.target)]
            self._once = self._call

    def run(self, is_over: Event) -> None:
        """
        Try until a try succeeds, at intervals of at least the timeout.

        Raises
        ------
        CallError
            why the last try failed.
        """
        for number in range(self._action.retries + 1):
            begin = monotonic()
            try:
                self._once(is_over)
                return
            except CallError:
                if number == self._action.retries or is_over.is_set():
                    raise
            is_over.wait(max(0.0, begin + self._timeout - monotonic()))

    def close(self) -> None:
        """Destroy the clients."""
        for service in self._services:
            service.close()

    def _call(self, is_over: Event) -> None:
        response = self._services[0].call(self._request, self._timeout, is_over)
        if getattr(response, 'success', True) is False:
            message = getattr(response, 'message', '')
            raise CallError(f'{self._services[0].name} answered without success'
                            + (f': {message}' if message else ''))

    def _transition(self, is_over: Event) -> None:
        get, change = self._services
        for _ in range(_MOST_STEPS):
            state = get.call(GetState.Request(), self._timeout, is_over).current_state.label
            if state == self._action.state:
                return
            step = _STEPS[self._action.state].get(state)
            if step is None:
                raise CallError(f'{self._action.target} is {state}, from where no transition '
                                f'leads to {self._action.state}')
            request = ChangeState.Request()
            request.transition.id = step
            if not change.call(request, self._timeout, is_over).success:
                raise CallError(f'{self._action.target} refused to leave the state {state}')
        state = get.call(GetState.Request(), self._timeout, is_over).current_state.label
        if state != self._action.state:
            raise CallError(f'{self._action.target} is {state}')
