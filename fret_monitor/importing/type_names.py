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

"""Type names in FRET, Ogma, Copilot, C and Lustre, and the corresponding messages of ROS."""

from fret_monitor.model.values import ValueType

_ALSO_CALLED = {
    ValueType.BOOL: ('boolean', '_bool', 'logical'),
    ValueType.INT8: ('i8', 'sint8'),
    ValueType.INT16: ('i16', 'sint16', 'short'),
    ValueType.INT32: ('i32', 'sint32'),
    # FRET and Lustre do not define the width of an integer.
    ValueType.INT64: ('i64', 'sint64', 'int', 'integer', 'long', 'subrange'),
    ValueType.UINT8: ('u8', 'word8', 'byte', 'char'),
    ValueType.UINT16: ('u16', 'word16'),
    ValueType.UINT32: ('u32', 'word32', 'unsigned', 'unsigned integer', 'uint'),
    ValueType.UINT64: ('u64', 'word64'),
    ValueType.FLOAT32: ('f32', 'float', 'single'),
    ValueType.FLOAT64: ('f64', 'double', 'real'),
}
_TYPES = {name: kind for kind, names in _ALSO_CALLED.items() for name in (kind.value, *names)}
_MESSAGES = {ValueType.BOOL: 'Bool', ValueType.FLOAT32: 'Float32', ValueType.FLOAT64: 'Float64'}


def plain_type(written: str) -> ValueType | None:
    """Return the type for a name in another tool; None for a struct or an unknown name."""
    name = written.strip().lower().removeprefix('std::').removesuffix('_t')
    return _TYPES.get(name)


def message_for(kind: ValueType) -> str:
    """Return the message type of std_msgs that contains one value of a type."""
    name = _MESSAGES.get(kind) or kind.value.replace('uint', 'UInt').replace('int', 'Int')
    return f'std_msgs/msg/{name}'
