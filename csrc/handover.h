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

/// handover.h: repeated and lost messages of one topic.
///
/// A subscription whose quality of service does not fit is replaced: for a while both the old and
/// the new one receive messages. From fm_arrivals_begin_handover to fm_arrivals_end_handover
/// messages that have been received already are recognised.
///
/// Publishers number their messages. A number that is left out is a lost message: a queue
/// overflowed, the network dropped it, or the middleware could not decode it. What a publisher sent
/// before its first received message is not counted, nor what one without a gid lost.
///
/// Not thread-safe: the caller holds a mutex. The caller owns the struct and zeroes it first.

#ifndef HANDOVER_H_
#define HANDOVER_H_

#include "fret_monitor.h"

#define FM_GID_BYTES 16u
/// Publishers of a topic that are known at a time. Where more send in turn, no loss is found.
#define FM_MOST_PUBLISHERS 64u

/// Where a message is from.
struct fm_origin
{
  int64_t received;    // ns; the stamp of what it violates, if there is no clock
  int64_t sent;        // ns, by its publisher's clock
  uint64_t sequence;   // its publisher's number of it, from 1; 0 or UINT64_MAX: none
  const uint8_t * gid; // of the publisher, FM_GID_BYTES; NULL: not known
  bool is_retired;     // it came by a subscription that is being replaced
};

struct fm_publisher
{
  uint8_t gid[FM_GID_BYTES];
  uint64_t first;        // the first number received, 0 before that
  uint64_t last;         // the highest number received
  int64_t sent;          // the latest of its times of sending
  uint64_t last_before;  // `last` and `sent` when the handover began
  int64_t sent_before;
};

struct fm_message_key;

/// What is known of the messages of a topic.
struct fm_arrivals
{
  struct fm_publisher publishers[FM_MOST_PUBLISHERS];  // the one that sent last comes first
  uint32_t n_publishers;
  uint64_t lost;
  uint64_t lost_before;         // `lost` when the handover began
  struct fm_message_key * keys; // a ring of those received since then, allocated for its time
  uint64_t n_keys;              // so far
  bool is_handover;
  bool has_history;
};

/// Expect messages twice from now on. `has_history`: the new subscription also brings what its
/// publishers sent earlier. Without memory for a ring (128 KiB), or beyond its 4096 messages,
/// repetitions of what was received during the handover are not recognised. O(publishers).
void fm_arrivals_begin_handover(struct fm_arrivals * arrivals, bool has_history);

/// Expect no message twice any more, and free the ring. O(1).
void fm_arrivals_end_handover(struct fm_arrivals * arrivals);

/// Whether a message was received before, or is history. Always false outside a handover.
/// O(messages since the handover began), 4096 at most.
bool fm_arrivals_is_repeated(
  const struct fm_arrivals * arrivals, const struct fm_origin * origin);

/// Note a message that is not repeated, and the gap in front of it. O(1) for the publisher that
/// sent last, O(FM_MOST_PUBLISHERS) for another.
void fm_arrivals_note(struct fm_arrivals * arrivals, const struct fm_origin * origin);

/// Messages that were lost. During a handover those lost before it: what one subscription left out
/// the other may still bring. O(1).
uint64_t fm_arrivals_lost(const struct fm_arrivals * arrivals);

#endif  // HANDOVER_H_
