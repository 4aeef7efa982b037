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

It waits until the subscriptions of the topic have stayed the same for half a second, publishes
`--count` messages at `--rate` Hz, and ends when the reliable subscriptions have acknowledged them.
Fields that are not named keep their defaults.
"""

import argparse
from importlib import import_module
import os
import sys
import time
from typing import Any

import rclpy
from rclpy.duration import Duration
from rclpy.exceptions import InvalidTopicNameException
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.publisher import Publisher
import yaml

POLL_S = 0.05
STABLE_S = 0.5
HINT_S = 10
DELIVERY_S = 5


def main() -> int:
    """Parse the command line and publish."""
    arguments = _parser().parse_args()
    try:
        message = _message(arguments.type)
        for field in arguments.fields:
            _set(message, field)
        rclpy.init()
        _publish(arguments, message)
    except ValueError as error:
        print(f'publish: {error}', file=sys.stderr)
        return 1
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
    parser.add_argument('--rate', type=_positive, default=10.0, help='messages a second (10)')
    parser.add_argument('--count', type=int, default=1, help='messages in all (1)')
    return parser


def _positive(text: str) -> float:
    value = float(text)
    if not value > 0:
        raise ValueError
    return value


def _message(name: str) -> Any:
    """Return a message with default values; raises `ValueError` if there is no such type."""
    os.environ['ROS_PYTHON_CHECK_FIELDS'] = '1'  # else a wrong type ends the process
    package, _, rest = name.partition('/')
    kind = rest.removeprefix('msg/')
    if not kind.isidentifier() or not package.isidentifier():
        raise ValueError(f"'{name}' is not a message type, such as std_msgs/msg/Float32")
    try:
        module = import_module(f'{package}.msg')
    except ModuleNotFoundError:
        raise ValueError(f"no messages of a package '{package}' are installed") from None
    if not hasattr(module, kind):
        raise ValueError(f"the package '{package}' has no message '{kind}'")
    return getattr(module, kind)()


def _set(message: Any, field: str) -> None:
    """Set `FIELD=VALUE`; raises `ValueError` if there is no such field, or it cannot have it."""
    path, equals, text = field.partition('=')
    if not equals:
        raise ValueError(f"'{field}' has no value: write {field}=VALUE")
    try:
        value = yaml.safe_load(text)
    except yaml.YAMLError:
        raise ValueError(f"'{text}' cannot be read as YAML") from None
    owner = message
    owners: list[str] = []
    for name in path.split('.'):
        fields = list(getattr(owner, 'get_fields_and_field_types', dict)())
        if name not in fields:
            what = f"'{'.'.join(owners)}'" if owners else 'the message'
            raise ValueError(f"there is no field '{path}': {what} has "
                             f'{", ".join(fields) or "no fields"}')
        owners.append(name)
        before, owner = owner, getattr(owner, name)
    is_real = isinstance(owner, float) and type(value) is int
    try:
        setattr(before, name, float(value) if is_real else value)
    except AssertionError as error:
        raise ValueError(f"'{field}': {error}") from None


def _publish(arguments: argparse.Namespace, message: Any) -> None:
    node = rclpy.create_node('test_publisher')
    try:
        publisher = node.create_publisher(type(message), arguments.topic, 10)
    except InvalidTopicNameException:
        raise ValueError(f"'{arguments.topic}' is not a name of a topic") from None
    if publisher.get_subscription_count() == 0:
        print(f'waiting for a subscription to {publisher.topic_name}', file=sys.stderr)
    _wait_until_matched(node, publisher)
    for _ in range(arguments.count):
        publisher.publish(message)
        time.sleep(1 / arguments.rate)
    publisher.wait_for_all_acked(Duration(seconds=DELIVERY_S))


def _wait_until_matched(node: Node, publisher: Publisher) -> None:
    """
    Wait until there are subscriptions, and they have stayed the same for a while.

    A subscription that this publisher has just discovered may not have discovered the publisher,
    and a monitor that then does replaces its subscription by one of the publisher's reliability.
    """
    before = None
    since = begin = time.monotonic()
    is_hint_due = True
    while before is None or time.monotonic() - since < STABLE_S:
        rclpy.spin_once(node, timeout_sec=POLL_S)
        count = publisher.get_subscription_count()
        ids = {tuple(item.endpoint_gid)
               for item in node.get_subscriptions_info_by_topic(publisher.topic_name)}
        now = (count, ids) if count else None
        if is_hint_due and now is None and time.monotonic() - begin > HINT_S:
            is_hint_due = False
            _print_subscribed(node)
        if now != before:
            before, since = now, time.monotonic()


def _print_subscribed(node: Node) -> None:
    """Print which topics have subscriptions: the name may be another one."""
    topics = [name for name, _ in node.get_topic_names_and_types()
              if node.count_subscribers(name) and name != '/parameter_events']
    print(f'nobody subscribes yet; there are subscriptions to {", ".join(topics)}' if topics
          else 'there is no subscription to any topic', file=sys.stderr)


if __name__ == '__main__':
    sys.exit(main())
