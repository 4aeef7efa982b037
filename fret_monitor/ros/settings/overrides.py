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
The standard parameters for the quality of service: `qos_overrides` (docs/ros_interface.md).

Their names are those of rclcpp and rclpy, with the topic's name after remapping:
`qos_overrides./windspeed.subscription.reliability`. They override the bundle.
"""

from collections.abc import Collection, Iterator, Mapping
from typing import Any

from fret_monitor.model.diagnostics import did_you_mean
from fret_monitor.model.frozen import frozen
from fret_monitor.model.policies import QOS_CHOICES
from fret_monitor.native import words
from fret_monitor.ros.settings.parameters import LARGEST_DEPTH, Refusal
from fret_monitor.ros.watch import steady_timer, Watch
from fret_monitor.runtime.subscription import DEFAULT_DEPTH

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

_PREFIX = 'qos_overrides.'
_AVAILABLE = 'best_available'  # the subscription requests what its publishers offer
_FOLLOWS = f'; {_AVAILABLE}: as its publishers offer'
_POLICIES = (*QOS_CHOICES, 'depth')
_TIMED = ('deadline', 'lifespan', 'liveliness', 'liveliness_lease_duration')
_OF_RCLPY = ('/clock', '/parameter_events', '/rosout')
_DECLARE_S = 0.01  # between two topics


@frozen
class _Override:
    """One parameter: its name; the topic, endpoint and policy in the name; its value."""

    name: str
    topic: str
    endpoint: str
    policy: str
    value: object


class Overrides:
    """The overrides given to a node, checked."""

    def __init__(self, given: Mapping[str, object]) -> None:
        """
        Read the values of parameters by name; those that are not overrides are ignored.

        Raises `Refusal` with all problems of the overrides.
        """
        problems: list[str] = []
        self._all = list(_read(given, problems))
        for item in self._all:
            if item.endpoint.startswith('subscription'):
                problems += _problems(item)
        if problems:
            raise Refusal(*problems)

    @classmethod
    def of(cls, node: Node) -> 'Overrides':
        """Return the overrides given to a node."""
        given: dict[str, Any] = node._parameter_overrides
        return cls({name: item.value for name, item in given.items()})

    def apply(self, topic: str, fixed: Mapping[str, str | int]) -> dict[str, str | int]:
        """Return the fixed policies of a subscription: the bundle's, replaced by overrides."""
        found = dict(fixed)
        for item in self._all:
            if (item.topic, item.endpoint) == (topic, 'subscription'):
                value = str(item.value).lower()
                found.pop(item.policy, None)
                if value != _AVAILABLE:
                    found[item.policy] = int(value) if item.policy == 'depth' else value
        return found

    def refuse_publishers(self, topics: Collection[str]) -> None:
        """
        Refuse overrides of the publishers of violations.

        Raises `Refusal` if there is one for a publisher of these topics.
        """
        names = [item.name for item in self._all
                 if item.endpoint == 'publisher' and item.topic in topics]
        if names:
            raise Refusal(*(words.OF_VIOLATIONS % name for name in names))

    def unused(self, subscribed: Collection[str]) -> Iterator[str]:
        """Yield a warning for each override that no subscription uses."""
        for item in self._all:
            if item.endpoint != 'subscription':
                yield words.ONLY_SUBSCRIPTIONS % item.name
            elif item.topic not in subscribed:
                hint = did_you_mean(item.topic, subscribed)
                yield words.NOT_SUBSCRIBED % (item.name, item.topic) + (hint and f'; {hint}')


class DeclaredOverrides:
    """
    Declares the overrides as parameters, so that `ros2 param` lists and describes them.

    rclpy needs 0.1 ms for a parameter, so a timer declares them one topic at a time: neither the
    start nor a period waits for all of them.
    """

    def __init__(self, node: Node, watch: Watch,
                 topics: Mapping[str, Mapping[str, str | int]]) -> None:
        """Start declaring; `topics` has full names, each with the policies the bundle fixes."""
        self._node = node
        self._left = sorted(topics.items(), reverse=True)
        self._names: list[str] = []
        self._timer = steady_timer(
            node, _DECLARE_S, lambda: watch.run('parameters', self._declare_next))

    def _declare_next(self) -> None:
        if not self._left:
            self._timer.cancel()
            return
        topic, fixed = self._left.pop()
        for policy, default in (
                ('reliability', _AVAILABLE), ('durability', _AVAILABLE),
                ('history', 'keep_last'), ('depth', DEFAULT_DEPTH)):
            name = f'{_PREFIX}{topic}.subscription.{policy}'
            if self._node.has_parameter(name):
                continue
            self._node.declare_parameter(name, fixed.get(policy, default), ParameterDescriptor(
                description=f'{policy} of the subscription to {topic}; read at the start of the '
                            f'process{"" if default != _AVAILABLE else _FOLLOWS}',
                dynamic_typing=True))
            self._names.append(name)

    def close(self) -> None:
        """Undeclare the parameters."""
        self._node.destroy_timer(self._timer)
        while self._names:
            self._node.undeclare_parameter(self._names.pop())


def _read(given: Mapping[str, object], problems: list[str]) -> Iterator[_Override]:
    for name, value in given.items():
        if not name.startswith(_PREFIX):
            continue
        topic, *rest = name.removeprefix(_PREFIX).split('.')
        if topic in _OF_RCLPY:
            continue
        if len(rest) != 2 or not topic.startswith('/') \
                or rest[0].partition('_')[0] not in ('subscription', 'publisher'):
            problems.append(words.NO_OVERRIDE % name)
        else:
            yield _Override(name, topic, rest[0], rest[1], value)


def _problems(item: _Override) -> Iterator[str]:
    where = f"parameter '{item.name}'"
    if item.endpoint != 'subscription':
        yield words.NO_ENDPOINT % item.name
    elif item.policy in _TIMED:
        yield words.OF_TIME % item.name
    elif item.policy not in _POLICIES:
        yield words.NO_POLICY % item.name
    elif item.policy == 'depth':
        if not isinstance(item.value, int) or isinstance(item.value, bool) \
                or not 0 < item.value <= LARGEST_DEPTH:
            yield f'{where} is {item.value!r}, and has to be {words.COUNT}'
    else:
        choices = [*QOS_CHOICES[item.policy]]
        choices += [] if item.policy == 'history' else [_AVAILABLE]
        if str(item.value).lower() not in choices:
            yield f'{where} is {item.value!r}, and has to be one of {", ".join(choices)}'
