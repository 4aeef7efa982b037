#!/usr/bin/env python3
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
Publish test messages where there is no `ros2` command.

    python3 publish.py odom nav_msgs/msg/Odometry twist.twist.linear.x=1.5

It waits for a subscription, publishes `--count` messages at `--rate` Hz, and ends when they have
been delivered. Fields that are not named keep their defaults.
"""

import argparse
from importlib import import_module
from operator import attrgetter
import os
import sys
import time
from typing import Any

import rclpy
from rclpy.duration import Duration
from rclpy.executors import ExternalShutdownException
import yaml

POLL_S = 0.05
DELIVERY_S = 5


def main() -> int:
    """Parse the command line and publish."""
    arguments = _parser().parse_args()
    try:
        message = _message(arguments.type, arguments.fields)
    except (AttributeError, AssertionError, ModuleNotFoundError, ValueError) as error:
        print(f'publish: {error}', file=sys.stderr)
        return 1
    try:
        rclpy.init()
        _publish(arguments, message)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('topic')
    parser.add_argument('type', help='such as std_msgs/msg/Float32')
    parser.add_argument('fields', nargs='*', metavar='FIELD=VALUE')
    parser.add_argument('--rate', type=float, default=10.0, help='messages a second (10)')
    parser.add_argument('--count', type=int, default=1, help='messages in all (1)')
    return parser


def _message(name: str, fields: list[str]) -> Any:
    os.environ['ROS_PYTHON_CHECK_FIELDS'] = '1'  # else a wrong type ends the process
    module, _, kind = name.replace('/', '.').rpartition('.')
    message = getattr(import_module(module), kind)()
    for field in fields:
        path, _, value = field.partition('=')
        *parents, last = path.split('.')
        owner = attrgetter('.'.join(parents))(message) if parents else message
        setattr(owner, last, yaml.safe_load(value))
    return message


def _publish(arguments: argparse.Namespace, message: Any) -> None:
    node = rclpy.create_node('test_publisher')
    publisher = node.create_publisher(type(message), arguments.topic, 10)
    if publisher.get_subscription_count() == 0:
        print(f'waiting for a subscription to {publisher.topic_name}', file=sys.stderr)
    while publisher.get_subscription_count() == 0:
        rclpy.spin_once(node, timeout_sec=POLL_S)
    for _ in range(arguments.count):
        publisher.publish(message)
        time.sleep(1 / arguments.rate)
    publisher.wait_for_all_acked(Duration(seconds=DELIVERY_S))


if __name__ == '__main__':
    sys.exit(main())
