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

/// blackbox.h: the last messages of an engine, in memory that is allocated once.
///
/// The engine copies the bytes of each message into a ring of bytes; the oldest messages are
/// overwritten. Another thread reads the ring in small pieces, while messages come. Occurrences of
/// violations are noted for it.
///
/// All functions may be called from any thread, except fm_blackbox_create and fm_blackbox_destroy.
/// They wait for nothing except a mutex of their own, within which no other is locked.

#ifndef BLACKBOX_H_
#define BLACKBOX_H_

#include "fret_monitor.h"

struct fm_blackbox;

/// A message in the ring. Its `size` bytes follow, the key in the name of its topic first; then
/// comes the next one, without a gap.
struct fm_kept
{
  uint64_t size;
  int64_t steady;  // ns of CLOCK_MONOTONIC: when it was kept
  int64_t time;    // ns: its stamp, in the node's time; 0 if there was no time
  int64_t sent;    // ns, by the publisher's clock; 0: not known
  uint32_t topic;
  uint32_t key_size;
};

/// Violations that began.
struct fm_occurrences
{
  uint64_t n;
  int64_t first;         // ns of CLOCK_MONOTONIC
  int64_t last;
  uint32_t requirement;  // of the first
};

struct fm_blackbox_counts
{
  uint64_t kept;      // messages
  uint64_t left_out;  // messages larger than the ring, or for which memory was short
  uint64_t early;     // messages that were overwritten before `lasts` was over
};

/// Make a ring of so many bytes, in which messages should last for so many nanoseconds. All of it
/// is written once, so that no page fault comes later. NULL if memory is short. O(capacity).
FM_EXPORT struct fm_blackbox * fm_blackbox_create(uint64_t capacity, int64_t lasts);

/// Free it. No engine and no thread may use it any more. O(1).
FM_EXPORT void fm_blackbox_destroy(struct fm_blackbox * box);

/// Keep a message; `kept->size` is its size. Never allocates. O(size + messages overwritten).
FM_EXPORT void fm_blackbox_keep(
  struct fm_blackbox * box, const struct fm_kept * kept, const uint8_t * message);

/// The same, with the key in the name of its topic, of `kept->key_size` bytes.
FM_EXPORT void fm_blackbox_keep_keyed(
  struct fm_blackbox * box, const struct fm_kept * kept, const uint8_t * message,
  const uint8_t * key);

/// Note an occurrence, at a time of CLOCK_MONOTONIC. O(1).
FM_EXPORT void fm_blackbox_note(struct fm_blackbox * box, uint32_t requirement, int64_t steady);

/// Return the occurrences since the last call. O(1).
FM_EXPORT struct fm_occurrences fm_blackbox_take_occurrences(struct fm_blackbox * box);

/// Copy bytes of the ring from a place on, up to `room`. Places count from the first byte ever
/// kept; a message begins at place 0, and where another ends. Returns the number of bytes; 0 if
/// nothing is there yet, or if it was overwritten: then `*begin`, the place of the oldest message,
/// is above `from`. O(room).
FM_EXPORT uint64_t fm_blackbox_copy(
  struct fm_blackbox * box, uint64_t from, uint8_t * out, uint64_t room, uint64_t * begin);

FM_EXPORT struct fm_blackbox_counts fm_blackbox_count(struct fm_blackbox * box);

#endif  // BLACKBOX_H_
