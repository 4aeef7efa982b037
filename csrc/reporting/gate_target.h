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

/// gate_target.h: the decisions about what a gate publishes on: with which durability, when the
/// publisher is replaced, and who else publishes there.
///
/// The publisher is reliable, which fits every subscription, and transient local if a publisher of
/// the source is. When that changes, a new publisher is made and used once it has matched as many
/// subscriptions as the one before, or after a while. Until then the one before is used, and no
/// new subscription of the source is taken: its history would not be kept for late subscribers.
///
/// The node publishes and looks. One thread at a time. Times are CLOCK_MONOTONIC in nanoseconds.

#ifndef GATE_TARGET_H_
#define GATE_TARGET_H_

#include "subscription.h"

/// What the node has to do with the next publisher, the one that is not used yet.
struct fm_target_decision
{
  bool drops_next;      // close it
  bool advertises;      // then make one, which is the next, with `is_durable` and `depth`
  bool is_durable;
  uint32_t depth;       // messages
};

struct fm_gate_target;

/// Begin with a volatile publisher. `node`: the full name of the node, which is copied. `depth`:
/// what the bundle fixes; 0: the default. NULL if memory is short.
FM_EXPORT struct fm_gate_target * fm_gate_target_create(const char * node, uint32_t depth);

/// Free it. NULL is allowed.
FM_EXPORT void fm_gate_target_destroy(struct fm_gate_target * state);

/// The quality of service of the first publisher; `advertises` is set.
FM_EXPORT struct fm_target_decision fm_gate_target_first(const struct fm_gate_target * state);

/// Note the identity of a publisher that the node has made. O(publishers made).
FM_EXPORT void fm_gate_target_note(struct fm_gate_target * state, const uint8_t * gid);

/// Publish with a durability from now on: that of the source's publishers.
FM_EXPORT struct fm_target_decision fm_gate_target_follow(
  struct fm_gate_target * state, bool is_durable, int64_t now);

/// The next publisher could not be made; it is tried again at the next call of
/// fm_gate_target_follow.
FM_EXPORT void fm_gate_target_fail(struct fm_gate_target * state);

/// Return whether to use the next publisher from now on, and to close the one before; `matched`
/// and `next_matched` are the subscriptions that the two have matched.
FM_EXPORT bool fm_gate_target_review(
  struct fm_gate_target * state, uint64_t matched, uint64_t next_matched, int64_t now);

/// Note the publishers on the target, the node's own among them. O(publishers^2).
FM_EXPORT void fm_gate_target_look(
  struct fm_gate_target * state, const struct fm_offer * offers, uint32_t n);

/// Who else publishes on the target: sorted, with commas; "": nobody. Valid until the next look.
FM_EXPORT const char * fm_gate_target_others(const struct fm_gate_target * state);

/// Whether the next look can wait until the graph changes.
FM_EXPORT bool fm_gate_target_is_settled(const struct fm_gate_target * state);

#endif  // GATE_TARGET_H_
