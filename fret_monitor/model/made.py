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

from fret_monitor.model.transforms import STAMPED


class MadeKind(Enum):
    """What the messages are made of; the value is the key in the bundle."""

    TRANSFORM = 'transform'
    NODE = 'node'
    PUBLISHERS = 'publishers'
    SUBSCRIBERS = 'subscribers'

    @property
    def is_in_graph(self) -> bool:
        """Whether it is seen in the graph of ROS."""
        return self is not MadeKind.TRANSFORM

    @property
    def message_type(self) -> str:
        """The type of the messages."""
        match self:
            case MadeKind.TRANSFORM:
                return STAMPED
            case MadeKind.NODE:
                return 'std_msgs/msg/Bool'
            case MadeKind.PUBLISHERS | MadeKind.SUBSCRIBERS:
                return 'std_msgs/msg/Int32'
            case _:
                assert_never(self)

    @property
    def words(self) -> str:
        """What an input of it is, as in `it is a transform`."""
        return 'a transform' if self is MadeKind.TRANSFORM else 'in the graph of ROS'

    @property
    def c_name(self) -> str:
        """The kind of its topic in C."""
        return 'FM_IN_GRAPH' if self.is_in_graph else 'FM_TRANSFORM'


USUAL_PATIENCE_S = 10.0


@dataclass(frozen=True)
class Made:
    """
    What the messages of a topic are made of.

    `names` are, of a transform, the frames `from` and `to`; of what is in the graph, the name of
    the node or topic. `patience`: for so many seconds since the start what is not in the graph may
    not have been discovered yet.
    """

    kind: MadeKind
    names: tuple[str, ...]
    patience: float = USUAL_PATIENCE_S

    @property
    def topic(self) -> str:
        """The name of the topic, for logs and reports."""
        name = ' -> '.join(self.names)
        match self.kind:
            case MadeKind.TRANSFORM:
                return name
            case MadeKind.NODE:
                return f'node {name}'
            case MadeKind.PUBLISHERS | MadeKind.SUBSCRIBERS:
                return f'{self.kind.value} of {name}'
            case _:
                assert_never(self.kind)
