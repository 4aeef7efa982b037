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
The verdicts of requirements: `copilot/verdict/ID` (docs/ros_interface.md, Verdicts).

A thread of C (`csrc/ros/verdict_thread.h`) publishes them; this makes the publishers.
"""

from collections.abc import Iterator, Sequence

from fret_monitor.model.manifest import Manifest
from fret_monitor.model.names import verdict_topic
from fret_monitor.ros.intake import native_lifetimes
from fret_monitor.ros.intake.hot_path import Middleware
from fret_monitor.ros.intake.rcl_endpoint import RclPublisher
from fret_monitor.ros.settings.names import one_type
from fret_monitor.ros.settings.qos import LAST
from fret_monitor.runtime import Engine

from rclpy.node import Node
from std_msgs.msg import Bool


def verdict_publishers(node: Node, manifest: Manifest) -> Iterator[RclPublisher]:
    """Advertise the topics; raises `Refusal` if the process uses one with another type."""
    for item in manifest.numbered:
        topic = verdict_topic(item.handler)
        with one_type(node, 'publish on', topic, 'std_msgs/msg/Bool'):
            publisher = RclPublisher(node, Bool, topic, LAST)
        yield publisher


class VerdictThread(native_lifetimes.NativeThread):
    """Publishes the verdicts of an engine, in a thread of C."""

    def __init__(self, engine: Engine, middleware: Middleware,
                 publishers: Sequence[RclPublisher]) -> None:
        """Start the thread, before messages are delivered; raises `Unavailable`."""
        super().__init__('verdict_thread', engine)
        self._middleware = middleware
        with self._starting(publishers):
            self._start(engine.pointer, middleware.functions,
                        middleware.publishers(publishers), len(publishers))
