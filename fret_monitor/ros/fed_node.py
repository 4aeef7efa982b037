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

"""A node that works from a feed: what the two nodes have in common."""

from typing import Any

from fret_monitor.ros.feed import Feed

from rclpy.node import Node


class FedNode(Node):
    """
    A node with a feed, which works from its making until `destroy_node`.

    Its parameters are those given; who makes one reads them. Messages need no executor; any
    executor may serve the rest of the node.
    """

    def __init__(self, node_name: str, **options: Any) -> None:
        """Make the node; `options` are those of `rclpy.node.Node`."""
        super().__init__(
            node_name, automatically_declare_parameters_from_overrides=True, **options)
        self.feed = Feed(self)

    def check(self) -> None:
        """Raise what went wrong in the feed's thread, if anything did."""
        if self.feed.failure is not None:
            raise self.feed.failure

    def destroy_node(self) -> None:
        """End the feed, then the node."""
        self.feed.close()
        super().destroy_node()
