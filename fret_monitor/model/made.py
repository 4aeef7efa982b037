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


class MadeKind(Enum):
    """What the messages are made of; the value is the key in the bundle."""

    TRANSFORM = 'transform'


@dataclass(frozen=True)
class Made:
    """
    What the messages of a topic are made of.

    `names` are, of a transform, the frames `from` and `to`.
    """

    kind: MadeKind
    names: tuple[str, ...]

    @property
    def topic(self) -> str:
        """The name of the topic, for logs and reports."""
        return ' -> '.join(self.names)
