// Copyright 2026 The fret_monitor authors
//
// Licensed under the Apache License, Version 2.0 (the "License");
// you may not use this file except in compliance with the License.
// You may obtain a copy of the License at
//
//     http://www.apache.org/licenses/LICENSE-2.0
//
// Unless required by applicable law or agreed to in writing, software
// distributed under the License is distributed on an "AS IS" BASIS,
// WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
// See the License for the specific language governing permissions and
// limitations under the License.

/// seen.h: reads the state of a lifecycle node, or a parameter, from serialized messages, and
/// writes serialized messages of what was seen. No state; any thread.

#ifndef SEEN_H_
#define SEEN_H_

#include "engine.h"

#define FM_SEEN_OVERHEAD 16u  // bytes of a serialized message beside its text

/// What a message of a source says.
enum fm_found
{
  FM_FOUND_NOTHING = 0,      // about the topic
  FM_FOUND = 1,
  FM_FOUND_UNREADABLE = 2    // it cannot be decoded
};

/// Read a lifecycle_msgs/msg/TransitionEvent: the state after a transition. While one goes on
/// there is nothing. O(1).
FM_INTERNAL enum fm_found fm_read_state(
  const uint8_t * message, size_t size, struct fm_seen * seen);

/// Read a parameter from a rcl_interfaces/msg/ParameterEvent: what it is after the event. A text
/// is one in the message. O(size).
FM_INTERNAL enum fm_found fm_read_parameter(
  const uint8_t * message, size_t size, const char * node, const char * name,
  struct fm_seen * seen);

/// Begin a serialized message in this machine's byte order: 4 bytes. Returns their end. O(1).
FM_INTERNAL uint8_t * fm_write_header(uint8_t * out);

/// Write a string where a message has a multiple of 4 bytes before it. Returns its end. O(length).
FM_INTERNAL uint8_t * fm_write_string(uint8_t * out, const char * text, uint32_t length);

/// Write a message of std_msgs: Bool, Int32, Int64, Float64 or String. Returns its size; `out` has
/// room for FM_SEEN_OVERHEAD and the text. O(size).
FM_INTERNAL size_t fm_write_seen(const struct fm_seen * seen, uint8_t * out);

/// The bits of a number, or a hash of a text: equal for what is equal. O(size).
FM_INTERNAL int64_t fm_seen_bits(const struct fm_seen * seen);

#endif  // SEEN_H_
