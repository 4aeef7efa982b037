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

/// handover.h: finds repeated and lost messages of one topic.
///
/// A subscription whose quality of service does not fit is replaced; during this handover both the
/// old and the new one receive messages. From fm_arrivals_begin_handover to
/// fm_arrivals_end_handover, messages that were received before are recognised as repeated.
///
/// Publishers number their messages. A missing number counts as a lost message: a queue
/// overflowed, or the network dropped it. Not counted are the numbers of messages that the
/// middleware dropped because it could not decode them (the owner counts these in `dropped`),
/// those before the first message of a publisher, and those of messages without a gid.
///
/// Not thread-safe: the caller holds a mutex. The caller owns the struct and zeroes it first.

#ifndef HANDOVER_H_
#define HANDOVER_H_

#include "fret_monitor.h"

#define FM_GID_BYTES 16u
/// Publishers of a topic that are remembered. If more than these send in turn, losses are missed,
/// and at a handover the history of a publisher that was forgotten is not recognised as repeated.
#define FM_MOST_PUBLISHERS 64u

/// The origin of a message.
struct fm_origin
{
  int64_t received;    // ns; the stamp of its violations, if there is no clock
  int64_t sent;        // ns, by its publisher's clock
  uint64_t sequence;   // its number, counted by its publisher from 1; 0 or UINT64_MAX: none
  const uint8_t * gid; // of the publisher, FM_GID_BYTES; NULL: not known
  bool is_retired;     // received by a subscription that is being replaced
  const uint8_t * key; // of an instance, in the topic's name; NULL: none
  uint32_t key_size;   // bytes
};

struct fm_publisher
{
  uint8_t gid[FM_GID_BYTES];
  uint64_t first;        // the first number received; 0: none yet
  uint64_t last;         // the highest number received
  int64_t sent;          // the latest time at which it sent a message
  uint64_t last_before;  // `last` and `sent` when the handover began
  int64_t sent_before;
};

struct fm_message_key;

/// The messages of a topic that were received.
struct fm_arrivals
{
  struct fm_publisher publishers[FM_MOST_PUBLISHERS];  // the one that sent last comes first
  uint32_t n_publishers;
  uint64_t lost;
  uint64_t lost_before;         // `lost` when the handover began
  uint64_t dropped;             // by the middleware, whose numbers are not missing yet
  struct fm_message_key * keys; // a ring of those received during the handover; NULL outside it
  uint64_t n_keys;              // received during the handover
  bool is_handover;
  bool has_history;
};

/// Begin a handover: from now on a message may arrive twice. `has_history`: the new subscription
/// also receives messages that its publishers sent earlier. Allocates a ring of 128 KiB. If that
/// fails, or beyond the ring's 4096 messages, repetitions of messages that were first received
/// during the handover are not recognised. O(publishers).
FM_EXPORT void fm_arrivals_begin_handover(struct fm_arrivals * arrivals, bool has_history);

/// End the handover, and free the ring. O(1).
FM_EXPORT void fm_arrivals_end_handover(struct fm_arrivals * arrivals);

/// Whether a message was received before, or is history. False outside a handover.
/// O(messages since the handover began), 4096 at most.
FM_EXPORT bool fm_arrivals_is_repeated(
  const struct fm_arrivals * arrivals, const struct fm_origin * origin);

/// Note a message that is not repeated, and count the numbers missing before it as lost. O(1) for
/// the publisher that sent last, O(FM_MOST_PUBLISHERS) for another.
FM_EXPORT void fm_arrivals_note(struct fm_arrivals * arrivals, const struct fm_origin * origin);

/// The number of lost messages. During a handover it is the number before the handover: a message
/// that one subscription lost may still arrive by the other. O(1).
FM_EXPORT uint64_t fm_arrivals_lost(const struct fm_arrivals * arrivals);

#endif  // HANDOVER_H_
