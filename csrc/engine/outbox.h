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

/// outbox.h: queues of violations and of their details, to be published by other threads.
///
/// Violations are never suppressed. Details are queued only while wanted, and are limited.
///
/// Not thread-safe: the caller holds a mutex. The caller owns the struct; the outbox owns the
/// memory that the struct points to, except for the monitor.

#ifndef OUTBOX_H_
#define OUTBOX_H_

#include "kinds.h"

/// Bytes of a key that is kept: its size, then the bytes. The size is 0 for the bundle's scope.
#define FM_KEY_ROOM 256u

/// One violation in detail, followed in memory by the values of the inputs (the struct of the
/// module of its scope), and by a byte of flags for each input: 1 if it has a value, 2 if it is
/// stale. With instances, a key of FM_KEY_ROOM bytes follows.
struct fm_detail
{
  struct fm_violation violation;
  uint64_t suppressed;  // violations of this requirement so far whose details were not queued
  uint64_t number;      // of the violation, from 1; of a recovery, that of the last violation
  struct fm_test_counts test;  // of a requirement with a probability
  struct fm_closest beyond;    // how far the violation went beyond so far
};

/// What became of a requirement's violations, at one instant.
struct fm_detail_counts
{
  uint64_t violations;  // the number of the last one; 0: there was none
  uint32_t queued;      // details that were not taken yet
  bool is_violated;     // the last violation is not over
};

struct fm_quota;

/// What an outbox is for.
struct fm_outbox_size
{
  uint64_t n_requirements;
  uint64_t inputs_bytes;       // with the flags, of the scope with most
  bool has_keys;               // of instances
};

/// The scope of a violation.
struct fm_outbox_scope
{
  const struct fm_evaluator * evaluator;
  const struct fm_monitor * monitor;
  struct fm_key key;           // of an instance; size 0: the bundle's scope
  uint32_t first;              // the number of its first requirement
  int64_t later;               // how much later stamps are than the times of the evaluator
};

struct fm_outbox
{
  struct fm_outbox_size size;
  struct fm_violation * violations;  // a ring; the capacity is a power of two
  uint32_t begin;
  uint32_t n_violations;
  uint32_t capacity;
  uint8_t * keys;              // of the violations, one after another, if there are any
  size_t keys_begin;
  size_t keys_end;
  size_t keys_room;
  uint64_t unpublished;        // violations that were dropped or could not be published
  struct fm_quota * quotas;    // and counters, by requirement
  uint8_t * details;           // a ring of slots
  size_t detail_slot_bytes;
  uint32_t detail_slots;
  uint32_t detail_begin;
  uint32_t n_details;
  uint32_t most_details_per_s;
  bool wants_details;
  bool keeps_recoveries;       // as violations; set by the owner
};

/// Make an empty outbox. Returns false if memory is short; the caller must call fm_outbox_free
/// even then. O(requirements).
bool fm_outbox_init(struct fm_outbox * outbox, const struct fm_outbox_size * size);

/// Free its memory. A zeroed outbox may be freed. O(1).
void fm_outbox_free(struct fm_outbox * outbox);

/// Queue a violation (a recovery with `keeps_recoveries` only), and a detail with the evaluator's
/// current values if details are wanted and within their limit. Amortised O(1), O(inputs) with a
/// detail; allocates when the queue grows. If the queue is full (2^20) or cannot grow, the
/// violation is counted as unpublished.
void fm_outbox_add(
  struct fm_outbox * outbox, const struct fm_violation * violation,
  const struct fm_outbox_scope * scope);

/// Take up to `room` violations, oldest first, and their keys, FM_KEY_ROOM bytes for each; `keys`
/// NULL: not. Returns their number. O(room).
uint32_t fm_outbox_take(
  struct fm_outbox * outbox, struct fm_violation * out, uint8_t * keys, uint32_t room);

/// Queue details from now on, at most `most_per_s` a second for each requirement, and 1024 at a
/// time; the others are counted (fm_detail.suppressed). With `are_wanted` false, no details are
/// queued, and those in the queue are dropped. Allocates once, about 4 MiB at most; if that fails,
/// no details are queued. O(1), O(requirements) if details are dropped.
void fm_outbox_want_details(
  struct fm_outbox * outbox, bool are_wanted, uint32_t most_per_s);

/// The bytes of a detail with all that follows it. O(1).
size_t fm_outbox_detail_bytes(const struct fm_outbox * outbox);

/// Take the oldest detail, fm_outbox_detail_bytes. Returns whether there was one. O(bytes of the
/// inputs).
bool fm_outbox_take_detail(struct fm_outbox * outbox, struct fm_detail * out);

/// The counts of a requirement, all but `is_violated`. O(1).
struct fm_detail_counts fm_outbox_counts(const struct fm_outbox * outbox, uint32_t requirement);

#endif  // OUTBOX_H_
