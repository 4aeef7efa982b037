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
A minimal subscriber in Python: rclpy, its default executor, a callback that counts.

It may publish a `std_msgs/Empty` for each message. On SIGINT it prints how many it received.

    python bench/listener.py --topics A,B [--depth N] [--publish TOPIC]
"""

from argparse import ArgumentParser

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from std_msgs.msg import Empty, Float32


class Listener(Node):
    """Counts the messages of some topics."""

    def __init__(self, topics: list[str], depth: int, handler: str | None) -> None:
        """Subscribe to the topics; publish on the topic `handler`, unless it is None."""
        super().__init__('subject')
        self.taken = 0
        self._handler = handler and self.create_publisher(Empty, handler, 1000)
        for topic in topics:
            self.create_subscription(Float32, topic, self._take, depth)

    def _take(self, message: Float32) -> None:
        self.taken += 1
        if self._handler:
            self._handler.publish(Empty())


def main() -> None:
    """Listen until SIGINT."""
    parser = ArgumentParser()
    parser.add_argument('--topics', required=True)
    parser.add_argument('--depth', type=int, default=100)
    parser.add_argument('--publish')
    options = parser.parse_args()
    rclpy.init()
    listener = Listener(options.topics.split(','), options.depth, options.publish)
    try:
        rclpy.spin(listener)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass  # on SIGINT, rclpy raises one of these or returns
    print(listener.taken)


if __name__ == '__main__':
    main()
