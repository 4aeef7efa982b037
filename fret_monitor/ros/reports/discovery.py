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
Find out what the monitors of a namespace announce, from the graph of ROS.

A monitor advertises its handlers and `copilot/violations` whenever it is configured. A new
publisher of `copilot/violations` therefore shows that a monitor has read its bundle again.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from fret_monitor.model.names import DETAILS_TOPIC, HANDLER_PREFIX, HANDLER_TOPIC
from fret_monitor.ros.intake.feed import offers_on
from fret_monitor.ros.intake.rcl_endpoint import UNNAMED
from fret_monitor.runtime.subscription import Offer

from rclpy.node import Node, NodeNameNonExistentError


@dataclass(frozen=True)
class News:
    """
    The handlers of all monitors of a namespace, and which monitors were `configured` just now.

    Monitors are full names of nodes, handlers full names of topics.
    """

    configured: frozenset[str]
    handlers: Mapping[str, frozenset[str]]


class Announced:
    """The handlers that monitors announce in the namespace of a node."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._known: set[bytes] = set()

    def news(self) -> News | None:
        """
        Return what is announced if a monitor was configured since the last call; else None.

        A monitor that is seen for the first time counts as configured.
        """
        publishers = offers_on(self._node, DETAILS_TOPIC) or ()
        gids = {item.gid for item in publishers}
        if gids <= self._known or any(item.node == UNNAMED for item in publishers):
            return None
        try:
            handlers = {_full_name(item): self._handlers(item.node, item.namespace)
                        for item in publishers}
        except NodeNameNonExistentError:  # it has ended
            return None
        configured = frozenset(_full_name(item) for item in publishers
                               if item.gid not in self._known)
        self._known = gids
        return News(configured, handlers)

    def _handlers(self, name: str, namespace: str) -> frozenset[str]:
        prefix = self._node.resolve_topic_name(f'{HANDLER_TOPIC}{HANDLER_PREFIX}')
        topics = self._node.get_publisher_names_and_types_by_node(name, namespace)
        return frozenset(topic for topic, types in topics
                         if topic.startswith(prefix) and 'std_msgs/msg/Empty' in types)


def _full_name(publisher: Offer) -> str:
    return f'{publisher.namespace.rstrip("/")}/{publisher.node}'
