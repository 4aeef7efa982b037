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


/// schedules.c: see schedules.h for the contract.

#include "schedules.h"

#include <stdlib.h>
#include <string.h>

static struct fm_instance_schedule * make(
  const struct fm_schedules * schedules, const char * variable, const uint8_t * key)
{
  struct fm_instance_schedule * made = calloc(1, sizeof(*made));
  struct fm_schedule * schedule = fm_schedule_create(&schedules->options, true);
  if (made == NULL || schedule == NULL) {
    free(made);
    fm_schedule_destroy(schedule);
    return NULL;
  }
  made->schedule = schedule;
  made->variable = variable;
  memcpy(made->key, key, key[0] + (size_t)1);
  return made;
}

struct fm_instance_schedule * fm_schedules_of(
  struct fm_schedules * schedules, const char * variable, const uint8_t * key)
{
  struct fm_instance_schedule ** place = &schedules->first;
  for (; *place != NULL; place = &(*place)->next) {
    if (memcmp((*place)->key, key, key[0] + (size_t)1) == 0 &&
      strcmp((*place)->variable, variable) == 0)
    {
      return *place;
    }
  }
  *place = make(schedules, variable, key);
  return *place;
}

static void drop(struct fm_instance_schedule ** place)
{
  struct fm_instance_schedule * dropped = *place;
  *place = dropped->next;
  fm_schedule_destroy(dropped->schedule);
  free(dropped);
}

void fm_schedules_drop_idle(struct fm_schedules * schedules, int64_t now)
{
  struct fm_instance_schedule ** place = &schedules->first;
  while (*place != NULL) {
    if (fm_schedule_is_idle((*place)->schedule, now)) {
      drop(place);
    } else {
      place = &(*place)->next;
    }
  }
}

int64_t fm_schedules_due(const struct fm_schedules * schedules)
{
  int64_t due = FM_NEVER;
  for (const struct fm_instance_schedule * one = schedules->first; one != NULL; one = one->next) {
    const int64_t other = fm_schedule_due(one->schedule);
    due = other < due ? other : due;
  }
  return due;
}

void fm_schedules_free(struct fm_schedules * schedules)
{
  while (schedules->first != NULL) {
    drop(&schedules->first);
  }
}
