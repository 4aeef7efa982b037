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
Publishers, subscriptions and clients of a node that the node does not list: C uses them.

They are made with the node's handle, so no executor serves them.
"""

from typing import Any

from fret_monitor.native.binding import ffi
from fret_monitor.ros.intake.in_place import capsule_pointer
from fret_monitor.ros.settings.names import one_type

from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.qos import qos_profile_services_default, QoSProfile
from rclpy.type_support import check_is_valid_msg_type, check_is_valid_srv_type


UNNAMED = '_NODE_NAME_UNKNOWN_'
"""The node of an endpoint, until the middleware has discovered it."""


class RclEndpoint:
    """
    A publisher or subscription of a node; its owner closes it.

    `handle` is rclpy's object for that of rcl: hold it (`with`) while C uses it.
    """

    KIND: str  # in names of functions of rcl
    HANDLE: Any  # rclpy's class

    def __init__(self, node: Node, msg_type: Any, topic: str, qos_profile: QoSProfile) -> None:
        """
        Advertise the topic, or subscribe to it.

        Raises `InvalidTopicNameException` if the name of the topic is not valid, and
        `RuntimeError` if the middleware refuses.
        """
        self.msg_type = msg_type
        self.qos_profile = qos_profile
        check_is_valid_msg_type(msg_type)  # imports its type support
        try:
            with node.handle:
                self.handle: Any = self.HANDLE(
                    node.handle, msg_type, topic, qos_profile.get_c_qos_profile())
        except ValueError:
            node._validate_topic_or_service_name(topic)
            raise

    @property
    def topic_name(self) -> str:
        """The full name of the topic."""
        with self.handle:
            return str(self.handle.get_topic_name())

    def close(self) -> None:
        """Destroy it as soon as its handle is no longer held."""
        self.handle.destroy_when_not_in_use()


class RclPublisher(RclEndpoint):
    """
    A publisher of a node; its owner closes it.

    It has no events, so that threads other than the executor's may make and destroy it.
    """

    KIND, HANDLE = 'publisher', _rclpy.Publisher

    @property
    def subscriptions(self) -> int:
        """How many subscriptions have matched."""
        with self.handle:
            return int(self.handle.get_subscription_count())


class RclSubscription(RclEndpoint):
    """
    A subscription of a node; its owner takes the messages and closes it.

    An executor takes the messages of every subscription that the node lists, and rclpy's
    `EventsExecutor` replaces the callback that C has set on it.
    """

    KIND, HANDLE = 'subscription', _rclpy.Subscription


class RclClient:
    """
    A client of a node; its owner closes it. Hold `handle` (`with`) while C uses it.

    `name`, the full name of the service, and `support`, of its type, are those of C.
    """

    KIND = 'client'

    def __init__(self, node: Node, kind: Any, name: str) -> None:
        """
        Make a client of a service of the type `kind`.

        Raises `InvalidTopicNameException` if the name of the service is not valid, and `Refusal`
        if the process uses the service otherwise.
        """
        check_is_valid_srv_type(kind)  # imports its type support
        interface = f'{kind.__module__.partition(".")[0]}/srv/{kind.__name__}'
        with one_type(node, 'call', name, interface, is_service=True):
            try:
                with node.handle:
                    self.handle: Any = _rclpy.Client(
                        node.handle, kind, name, qos_profile_services_default.get_c_qos_profile())
            except ValueError:
                node._validate_topic_or_service_name(name, is_service=True)
                raise
        self.support = ffi.cast(
            'struct fm_service_support *', capsule_pointer(type(kind)._TYPE_SUPPORT, None))
        with self.handle:
            self.name = ffi.new('char[]', str(self.handle.service_name).encode())

    def close(self) -> None:
        """Destroy it as soon as its handle is no longer held."""
        self.handle.destroy_when_not_in_use()
