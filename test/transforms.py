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

"""Messages of /tf for tests: CDR of tf2_msgs/msg/TFMessage."""

from dataclasses import dataclass
from struct import pack


@dataclass(frozen=True)
class LinkOf:
    """A geometry_msgs/msg/TransformStamped; the stamp in nanoseconds, the rotation x, y, z, w."""

    stamp: int
    parent: str
    child: str
    translation: list[float]
    rotation: list[float]


def links(*items: LinkOf, is_little: bool = True) -> bytes:
    """Return a serialized tf2_msgs/msg/TFMessage."""
    order = '<' if is_little else '>'
    out = pack(f'{order}I', len(items))
    for item in items:
        out = _aligned(out, 4) + pack(f'{order}iI', *divmod(item.stamp, 10**9))
        for name in (item.parent, item.child):
            text = name.encode() + b'\0'
            out = _aligned(out, 4) + pack(f'{order}I', len(text)) + text
        out = _aligned(out, 8) + pack(f'{order}7d', *item.translation, *item.rotation)
    return bytes((0, is_little, 0, 0)) + out


def _aligned(out: bytes, size: int) -> bytes:
    return out + bytes(-len(out) % size)
