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

/// pool.h: the instances of one kind: blocks of instance.h, found by their keys.
///
/// A pool has the tables of one evaluator, whose counters are those of all instances together, and
/// memory for `most` instances, which is taken once. To enter an instance is to point the
/// evaluator at its block; every function of evaluator.h then works on it. What the evaluator has
/// while no instance is entered is the blank: a new instance begins as its copy.
///
/// A heap orders the instances by when something is due, so that a message costs O(1), and O(log
/// n) only if it brings that forward. Not thread-safe. No function allocates or blocks.

#ifndef POOL_H_
#define POOL_H_

#include "heap.h"
#include "keys.h"
#include "kinds.h"
#include "tables.h"

struct fm_pool
{
  struct fm_evaluator * evaluator;
  struct fm_instance blank;
  char * blocks;
  uint64_t block_bytes;
  struct fm_keys own_keys;
  struct fm_keys * keys;  // its own, or those of another pool, which adds and removes them
  struct fm_heap due;    // not after the deadline of the instance
  int64_t * lasts;       // with `forget`, an instance: the time of the last message of its key
  uint16_t * turns;      // an instance: the turn in which it took a message last
  uint16_t turn;         // that of the message that is being taken; not 0
  uint64_t * violated;   // a requirement: the instances whose violation goes on
  uint64_t * unknown;    // a requirement: the instances of which it is not known (states.h)
  bool counts_unknown;   // these are counted
  struct fm_nearest * nearest;  // an instance: one for each requirement; NULL: no margins
  struct fm_nearest * own_nearest;  // of the evaluator, while no instance is entered
  struct fm_heap * margins;  // a requirement: its instances by their present margins, if known
  bool is_short;         // a key found no room since start or reset: nothing is known of it
  uint64_t overflows;    // of fm_monitor.overflows, of all instances but the one entered
  int64_t forget;        // ns; 0: never
  uint32_t entered;      // FM_NO_SLOT: none, the evaluator has the blank
  struct fm_pool_counts counts;
};

/// What a pool is made of.
struct fm_pool_options
{
  const struct fm_evaluator_options * options;
  struct fm_keys * keys;  // of another pool with the same `most`; NULL: its own
  const uint64_t * seed;  // two words
  uint32_t most;
  int64_t forget;
};

/// The bytes of a pool; 0 if they do not fit in the address space. O(groups).
FM_INTERNAL uint64_t fm_pool_bytes(
  const struct fm_evaluator_options * options, uint64_t most, bool has_keys, bool forgets);

/// Make a pool without instances in fm_pool_bytes bytes, aligned to FM_ALIGNMENT. It must stay
/// where it is. Returns false as fm_evaluator_init. O(bytes).
FM_INTERNAL bool fm_pool_make(
  struct fm_pool * pool, void * memory, const struct fm_pool_options * made);

/// Count from now on the instances of which a requirement is not known; before the first message.
/// O(instances + requirements).
FM_INTERNAL void fm_pool_count_unknown(struct fm_pool * pool);

/// Begin a message: no instance has taken it. O(1), and O(slots in use) once in 65,535 calls.
FM_INTERNAL void fm_pool_begin_turn(struct fm_pool * pool);

/// Enter an instance, which is alive; any other is left. It gets the time of the bundle's scope.
/// O(groups + requirements).
FM_INTERNAL void fm_pool_enter(
  struct fm_pool * pool, uint32_t slot, const struct fm_instance_time * time);

/// Leave the instance that is entered, if one is. O(log n).
FM_INTERNAL void fm_pool_leave(struct fm_pool * pool);

/// Begin an instance, whose key has the slot. O(block).
FM_INTERNAL void fm_pool_begin(struct fm_pool * pool, uint32_t slot);

/// End an instance, whose key the caller removes. Returns whether it had a deadline. O(log n).
FM_INTERNAL bool fm_pool_end(struct fm_pool * pool, uint32_t slot);

/// When something is due in an instance that is entered, or it is to end. O(inputs + groups).
FM_INTERNAL int64_t fm_pool_deadline(struct fm_pool * pool);

/// The changes of all instances that found no room in a queue, since start or reset, also of those
/// that have ended; and the messages of which a rate had too many. O(queues).
FM_INTERNAL uint64_t fm_pool_overflows(const struct fm_pool * pool);

/// The instance whose present margin of a requirement is the least; FM_NO_SLOT: none is known. It
/// leaves the instance that is entered. O(log n).
FM_INTERNAL uint32_t fm_pool_nearest(struct fm_pool * pool, uint32_t requirement);

/// The least margin of a requirement of any instance since the last call, as
/// fm_evaluator_take_margin. It leaves the instance that is entered. O(log n).
FM_INTERNAL double fm_pool_take_margin(struct fm_pool * pool, uint32_t requirement);

/// Draw the least present margin of all instances, which one has changed at an instant: in lanes
/// it is the last one. Without instances it is plus infinity; where none is known, nothing is
/// drawn. O(requirements x log n), and O(1) without lanes.
FM_INTERNAL void fm_pool_draw(struct fm_pool * pool, int64_t instant);

/// Note when the last message of a key came; let it have come later. O(1).
FM_INTERNAL void fm_pool_note_last(struct fm_pool * pool, uint32_t slot, int64_t now);
FM_INTERNAL void fm_pool_shift_last(struct fm_pool * pool, uint32_t slot, int64_t by);

/// When the instance that is entered ends; FM_NEVER. O(1).
FM_INTERNAL int64_t fm_pool_end_of(const struct fm_pool * pool, uint32_t slot);

#endif  // POOL_H_
