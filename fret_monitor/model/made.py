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
Topics whose messages the monitor makes itself, of what a bundle names in place of a topic.

For the evaluator they are topics like all others.
"""

from dataclasses import dataclass
from enum import Enum
from typing import assert_never

from fret_monitor.model.transforms import LINKS, QOS, STAMPED, TOPICS


@dataclass(frozen=True)
class SourceTopic:
    """A topic of ROS, of whose messages others are made."""

    name: str
    message_type: str
    qos: tuple[tuple[str, str | int], ...] = ()


class MadeKind(Enum):
    """What the messages are made of; the value is the key in the bundle."""

    TRANSFORM = 'transform'
    NODE = 'node'
    PUBLISHERS = 'publishers'
    SUBSCRIBERS = 'subscribers'
    LIFECYCLE = 'lifecycle'
    PARAMETER = 'parameter'

    @property
    def is_in_graph(self) -> bool:
        """Whether it is seen in the graph of ROS alone, of which recordings have nothing."""
        return self in (MadeKind.NODE, MadeKind.PUBLISHERS, MadeKind.SUBSCRIBERS)

    @property
    def is_asked_for(self) -> bool:
        """Whether a node is asked for its first value."""
        return self in (MadeKind.LIFECYCLE, MadeKind.PARAMETER)

    @property
    def has_absence(self) -> bool:
        """Whether it is a value that it is not there."""
        return self.is_in_graph or self is MadeKind.LIFECYCLE

    @property
    def message_types(self) -> tuple[str, ...]:
        """The types that the messages may have, usually one."""
        match self:
            case MadeKind.TRANSFORM:
                return (STAMPED,)
            case MadeKind.NODE:
                return ('std_msgs/msg/Bool',)
            case MadeKind.PUBLISHERS | MadeKind.SUBSCRIBERS | MadeKind.LIFECYCLE:
                return ('std_msgs/msg/Int32',)
            case MadeKind.PARAMETER:
                return tuple(PARAMETER_TYPES.values())
            case _:
                assert_never(self)

    @property
    def words(self) -> str:
        """What an input of it is, as in `it is a transform`."""
        match self:
            case MadeKind.TRANSFORM:
                return 'a transform'
            case MadeKind.NODE | MadeKind.PUBLISHERS | MadeKind.SUBSCRIBERS:
                return 'in the graph of ROS'
            case MadeKind.LIFECYCLE:
                return 'the state of a lifecycle node'
            case MadeKind.PARAMETER:
                return 'a parameter of a node'
            case _:
                assert_never(self)

    @property
    def c_name(self) -> str:
        """The kind of its topic in C."""
        return 'FM_IN_GRAPH' if self.is_in_graph else f'FM_{self.name}'


USUAL_PATIENCE_S = 10.0
PARAMETER_TYPES = {'float64': 'std_msgs/msg/Float64', 'int64': 'std_msgs/msg/Int64',
                   'bool': 'std_msgs/msg/Bool', 'string': 'std_msgs/msg/String'}
"""The types of parameters, and of the messages that are made of them."""

PARAMETER_SLIPS = {**{message: name for name, message in PARAMETER_TYPES.items()},
                   **dict.fromkeys(('double', 'float', 'float32', 'real'), 'float64'),
                   **dict.fromkeys(('int', 'int32', 'integer', 'long'), 'int64'),
                   'boolean': 'bool', 'str': 'string'}
"""What is written in place of the types of parameters."""

STATES = {'UNKNOWN': 0, 'UNCONFIGURED': 1, 'INACTIVE': 2, 'ACTIVE': 3, 'FINALIZED': 4}
"""The states of a lifecycle node, as in lifecycle_msgs/msg/State."""

SEEN_TYPES = {'std_msgs/msg/Bool': 'FM_SEEN_BOOL', 'std_msgs/msg/Int32': 'FM_SEEN_INT32',
              'std_msgs/msg/Int64': 'FM_SEEN_INT64', 'std_msgs/msg/Float64': 'FM_SEEN_FLOAT64',
              'std_msgs/msg/String': 'FM_SEEN_TEXT'}
"""The `enum fm_seen_type` of messages that are made of what is seen."""


@dataclass(frozen=True)
class Made:
    """
    What the messages of a topic are made of.

    `names` are, of a transform, the frames `from` and `to`; of what is in the graph, the name of
    the node or topic; of a parameter, those of the node and of the parameter. `patience`: for so
    many seconds since the start what is not in the graph may not have been discovered yet.
    """

    kind: MadeKind
    names: tuple[str, ...]
    patience: float = USUAL_PATIENCE_S

    @property
    def topic(self) -> str:
        """The name of the topic, for logs and reports."""
        match self.kind:
            case MadeKind.TRANSFORM:
                return ' -> '.join(self.names)
            case MadeKind.NODE | MadeKind.LIFECYCLE:
                return f'{self.kind.value} {self.names[0]}'
            case MadeKind.PUBLISHERS | MadeKind.SUBSCRIBERS:
                return f'{self.kind.value} of {self.names[0]}'
            case MadeKind.PARAMETER:
                return f'parameter {self.names[1]} of {self.names[0]}'
            case _:
                assert_never(self.kind)

    @property
    def sources(self) -> tuple[SourceTopic, ...]:
        """The topics of ROS that the messages are made of."""
        match self.kind:
            case MadeKind.TRANSFORM:
                return tuple(SourceTopic(name, LINKS, QOS[name]) for name in TOPICS)
            case MadeKind.LIFECYCLE:
                return (SourceTopic(f'{self.names[0]}/transition_event',
                                    'lifecycle_msgs/msg/TransitionEvent'),)
            case MadeKind.PARAMETER:
                return (SourceTopic('/parameter_events', 'rcl_interfaces/msg/ParameterEvent',
                                    (('depth', 1000),)),)
            case MadeKind.NODE | MadeKind.PUBLISHERS | MadeKind.SUBSCRIBERS:
                return ()
            case _:
                assert_never(self.kind)
