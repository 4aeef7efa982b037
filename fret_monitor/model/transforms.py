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
Transforms between coordinate frames: the topics they come from, and the types of their messages.

For the evaluator a transform is a topic: its messages, of the type `STAMPED`, are made by the
engine of what comes on `TOPICS`.
"""

STAMPED = 'geometry_msgs/msg/TransformStamped'
LINKS = 'tf2_msgs/msg/TFMessage'
TOPICS = ('/tf', '/tf_static')
QOS: dict[str, tuple[tuple[str, str | int], ...]] = {
    '/tf': (),
    '/tf_static': (('reliability', 'reliable'), ('durability', 'transient_local')),
}
"""What is fixed of the quality of service of these topics, as in tf2."""

DEFINITIONS = {LINKS: 'geometry_msgs/TransformStamped[] transforms\n'}
"""Definitions that are used where the package of a type is not installed."""
