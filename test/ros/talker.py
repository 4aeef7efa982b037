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
A process that publishes numbers on a topic, and that can be killed.

It is driven by lines on standard input. `say COUNT PAUSE` publishes so many numbers, from 0 on,
with PAUSE seconds between. `go PAUSE` publishes until the next line, `greet PAUSE` likewise, but
-1 each time. After each command it prints how many numbers it has published since its start.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import os
from pathlib import Path
from select import select
import sys

import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from ros.forked import ForkedScript
import std_msgs.msg

# Fast DDS keeps a participant that died for 20 s; a participant may ask for a shorter lease. One
# that sends nothing for so long, because it was stopped perhaps, is removed as well.
_SHORT_LEASE = """<?xml version="1.0" encoding="UTF-8"?>
<profiles xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
  <participant profile_name="mortal" is_default_profile="true"><rtps><builtin>
    <discovery_config>
      <leaseDuration><sec>4</sec></leaseDuration>
      <leaseAnnouncement><nanosec>400000000</nanosec></leaseAnnouncement>
    </discovery_config>
  </builtin></rtps></participant>
</profiles>
"""


class Talker:
    """Starts the process and drives it."""

    def __init__(self, topic: str, message: str, depth: int, profile: Path | None) -> None:
        """Start the process; the caller sets ROS_DOMAIN_ID. A profile sets a short lease."""
        environment = dict(os.environ)
        if profile is not None:
            profile.write_text(_SHORT_LEASE, encoding='utf-8')
            environment['FASTRTPS_DEFAULT_PROFILES_FILE'] = str(profile)
        self.process = ForkedScript('ros.talker', topic, message, str(depth),
                                    environment=environment)

    def greet(self, wait: Callable[[], None]) -> None:
        """Publish -1 until `wait` returns: the subscription then receives all that follows."""
        self._tell('greet 0.02')
        wait()
        self.stop()

    def say(self, count: int, pause: float = 0.0) -> int:
        """Publish so many numbers; return how many it has published in all."""
        self._tell(f'say {count} {pause}')
        return self._answer()

    def go(self, pause: float) -> None:
        """Publish until it is stopped or killed."""
        self._tell(f'go {pause}')

    def stop(self) -> int:
        """Stop publishing; return how many it has published in all."""
        self._tell('stop')
        return self._answer()

    def kill(self) -> None:
        """Kill the process at once, so that it cannot leave the graph in order."""
        self.process.kill()

    def close(self) -> None:
        """End the process; it leaves the graph in order."""
        self.process.stdin.close()
        self.process.wait(30)

    def _tell(self, line: str) -> None:
        self.process.stdin.write(f'{line}\n')
        self.process.stdin.flush()

    def _answer(self) -> int:
        for line in self.process.stdout:
            if line.strip().isdecimal():  # Fast DDS writes its errors there too
                return int(line)
        raise AssertionError(f'the talker ended: {self.process.wait()}')


@contextmanager
def talking(folder: Path, topic: str = 'n', message: str = 'Int32',
            depth: int = 1000, is_mortal: bool = True) -> Iterator[Talker]:
    """Start a talker and close it afterwards."""
    talker = Talker(topic, message, depth, folder / 'mortal.xml' if is_mortal else None)
    try:
        yield talker
        if talker.process.poll() is None:
            talker.close()
    finally:
        talker.process.kill()


def main() -> None:
    """Read lines and publish."""
    topic, message, depth = sys.argv[1:]
    kind = getattr(std_msgs.msg, message)
    number = type(kind().data)
    rclpy.init()
    node = Node('talker')
    publisher = node.create_publisher(
        kind, topic, QoSProfile(depth=int(depth), reliability=ReliabilityPolicy.RELIABLE))
    said = 0

    def is_told(pause: float) -> bool:
        return bool(select([sys.stdin], [], [], pause)[0])

    while line := sys.stdin.readline():
        word, *numbers = line.split()
        left = int(numbers.pop(0)) if word == 'say' else -1
        while word != 'stop' and left != 0:
            publisher.publish(kind(data=number(-1 if word == 'greet' else said)))
            said += word != 'greet'
            left -= 1
            if is_told(float(numbers[0])):
                break
        if word != 'stop':
            print(said, flush=True)
    node.destroy_node()
    rclpy.shutdown()
