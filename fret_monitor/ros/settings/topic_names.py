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

"""The full names of mapped topics, also of those with an instance variable."""

from fret_monitor.model.manifest import Manifest, ManifestTopic

from rclpy.node import Node

_STAND_IN = 'fm_key'  # in place of a variable while a name is resolved


def full_name(node: Node, manifest: Manifest, topic: ManifestTopic) -> str:
    """
    Return the name of a topic as a node resolves it; of one that is made, as it is.

    An instance variable stays in it, in braces.

    Raises
    ------
    InvalidTopicNameException
        if the name is not valid: from the namespace or a remapping.
    """
    if topic.made:
        return topic.name
    variable = manifest.key_of(topic)
    if variable is None:
        return str(node.resolve_topic_name(topic.name))
    shown = f'{{{variable.name}}}'
    parts = str(node.resolve_topic_name(topic.name.replace(shown, _STAND_IN))).split('/')
    return '/'.join(shown if part == _STAND_IN else part for part in parts)
