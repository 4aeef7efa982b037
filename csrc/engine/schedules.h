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
/// As schedule.h, without threads and clocks.

#ifndef SCHEDULES_H_
#define SCHEDULES_H_

#include "outbox.h"
#include "schedule.h"

/// The schedule of one key of an instance variable.
struct fm_instance_schedule
{
  struct fm_instance_schedule * next;
  struct fm_schedule * schedule;
  const char * variable;
  uint8_t key[FM_KEY_ROOM];  // its size, then its bytes
};

/// Zeroed, but for the options, before the first call; fm_schedules_free frees what it holds.
struct fm_schedules
{
  struct fm_schedule_options options;
  struct fm_instance_schedule * first;  // the oldest
};

/// Return the schedule of a key, which is made if there is none; the key is as of fm_outbox_take,
/// the variable outlives it. NULL if memory is short. O(schedules).
FM_INTERNAL struct fm_instance_schedule * fm_schedules_of(
  struct fm_schedules * schedules, const char * variable, const uint8_t * key);

/// Free the schedules that are idle. O(schedules * what follows all requirements).
FM_INTERNAL void fm_schedules_drop_idle(struct fm_schedules * schedules, int64_t now);

/// When the next action of any of them starts or publishes; FM_NEVER: none does. As
/// fm_schedules_drop_idle.
FM_INTERNAL int64_t fm_schedules_due(const struct fm_schedules * schedules);

/// Free all of them. O(schedules).
FM_INTERNAL void fm_schedules_free(struct fm_schedules * schedules);

#endif  // SCHEDULES_H_
