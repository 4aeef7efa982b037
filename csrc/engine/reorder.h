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

/// reorder.h: messages that wait for others with earlier stamps.
///
/// With `stamp: header` a message takes effect at the time in its header. It waits until messages
/// with earlier stamps can no longer be expected, and leaves the buffer in the order of stamps; of
/// equal stamps, in the order of arrival.
///
/// Not thread-safe: the caller holds a mutex. The caller owns the struct; the buffer owns its
/// memory, which does not grow, but for the bytes of messages with parts for instances.

#ifndef REORDER_H_
#define REORDER_H_

#include "fret_fields.h"

/// The messages that wait at most; fewer if these take more than 4 MiB.
#define FM_MOST_WAITING 1024

/// A message that takes effect. The owner keeps all that it points to.
struct fm_delivery
{
  uint32_t topic;
  uint32_t key_size;
  const struct fm_field * fields;  // of the topic's inputs in the bundle's scope
  const uint8_t * message;         // with parts for instances, otherwise not used
  size_t size;
  const uint8_t * key;             // in the name of its topic; NULL: none
  int64_t received;                // by ROS time
};

/// A message that waits.
struct fm_waiting
{
  int64_t stamp;             // ns
  struct fm_delivery delivery;
  struct fm_field * fields;  // those of the delivery
  uint8_t * bytes;           // its message, then its key; NULL: neither
};

struct fm_reorder
{
  struct fm_waiting * slots;
  struct fm_field * fields;  // of all slots
  uint32_t * order;          // the slots by stamp, then those that are free
  uint32_t capacity;
  uint32_t n;                // messages that wait
};

/// Make an empty buffer for messages of up to `most_fields` fields. Returns false if memory is
/// short; the caller must call fm_reorder_free even then. O(messages).
bool fm_reorder_init(struct fm_reorder * reorder, uint32_t most_fields);

/// Free its memory. A zeroed buffer may be freed. O(1).
void fm_reorder_free(struct fm_reorder * reorder);

/// Add a message; the buffer must not be full. With `has_parts` its bytes and its key are copied,
/// for which memory is allocated. Returns false if it is short. O(n_fields + bytes + messages with
/// later stamps).
bool fm_reorder_add(
  struct fm_reorder * reorder, const struct fm_delivery * delivery, int64_t stamp,
  uint32_t n_fields, bool has_parts);

/// The message with the earliest stamp; NULL if none waits. Valid until the next add. O(1).
const struct fm_waiting * fm_reorder_first(const struct fm_reorder * reorder);

/// Remove the message with the earliest stamp; there must be one. O(messages).
void fm_reorder_remove_first(struct fm_reorder * reorder);

#endif  // REORDER_H_
