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

/// schedules.h: the schedules of instances, for actions with keys in their messages: one for each
/// key that has something under way or to come.
///
/// A table finds that of a key, a heap has what is due first, and another one of each action those
/// whose call has to wait for another one. As schedule.h, without threads and clocks.

#ifndef SCHEDULES_H_
#define SCHEDULES_H_

#include "heap.h"
#include "keys.h"
#include "outbox.h"
#include "schedule.h"

/// The schedule of one key of an instance variable.
struct fm_instance_schedule
{
  struct fm_schedule * schedule;
  struct fm_schedules * schedules;
  uint32_t slot;
  uint8_t key[FM_KEY_ROOM];  // its size, then its bytes
};

/// Those of one instance variable, or of the pairs of two. Zeroed, but for the options, before the
/// first call; fm_schedules_free frees what it holds.
struct fm_schedules
{
  struct fm_schedule_options options;
  struct fm_keys keys;
  struct fm_instance_schedule ** items;  // by the slot of the key
  struct fm_heap due;                    // by when something is due, or may be over
  struct fm_heap * waiting;              // an action: whose call waits, by which came first
  int64_t n_waits;
  void * memory;                         // of the table, the heaps and the items
  uint32_t most;
};

/// Return the schedule of a key, which is made if there is none; the key is as of fm_outbox_take.
/// NULL if memory is short. O(bytes of the key) expected, and now and then O(schedules).
FM_INTERNAL struct fm_instance_schedule * fm_schedules_of(
  struct fm_schedules * schedules, const uint8_t * key);

/// After anything was done with a schedule: free it if it is idle, else note when it is due.
/// O(what follows all requirements + log schedules).
FM_INTERNAL void fm_schedules_settle(struct fm_instance_schedule * one, int64_t now);

/// The first schedule in which something is due by `now`; NULL: none. O(1).
FM_INTERNAL struct fm_instance_schedule * fm_schedules_first(
  const struct fm_schedules * schedules, int64_t now);

/// When that is; FM_NEVER. O(1).
FM_INTERNAL int64_t fm_schedules_due(const struct fm_schedules * schedules);

/// Let the call of an action wait, if it does not; and no longer, if it does. O(log schedules).
FM_INTERNAL void fm_schedules_wait(struct fm_instance_schedule * one, uint32_t action);
FM_INTERNAL void fm_schedules_end_wait(struct fm_instance_schedule * one, uint32_t action);

/// That whose call of an action waits longest; NULL: none. O(1).
FM_INTERNAL struct fm_instance_schedule * fm_schedules_waiting(
  const struct fm_schedules * schedules, uint32_t action);

/// The schedule of a slot from `slot` on; NULL: there is none. O(slots).
FM_INTERNAL struct fm_instance_schedule * fm_schedules_next(
  const struct fm_schedules * schedules, uint32_t slot);

/// Free all of them. O(schedules).
FM_INTERNAL void fm_schedules_free(struct fm_schedules * schedules);

#endif  // SCHEDULES_H_
