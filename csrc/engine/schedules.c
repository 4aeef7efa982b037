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

#define _POSIX_C_SOURCE 200809L

#include "schedules.h"

#include <stdlib.h>
#include <string.h>

#include "thread.h"

#define FEWEST 16u

// ---- memory ------------------------------------------------------------------------------------

static uint64_t lay_out(const struct fm_schedules * schedules, uint32_t most, uint64_t * places)
{
  const uint32_t n_actions = schedules->options.n_actions;
  struct fm_block block = {0, true};
  places[0] = fm_block_append(&block, fm_keys_bytes(most), 1);
  places[1] = fm_block_append(&block, most, sizeof(*schedules->items));
  places[2] = fm_block_append(&block, n_actions, sizeof(*schedules->waiting));
  places[3] = fm_block_append(&block, n_actions + UINT64_C(1), fm_heap_bytes(most));
  return block.fits && fm_keys_bytes(most) > 0 ? block.bytes : 0;
}

// Without schedules, with room for `most`. Returns false if memory is short.
static bool make_room(struct fm_schedules * schedules, uint32_t most)
{
  const uint64_t seed[2] = {(uint64_t)fm_steady_time(), (uint64_t)(uintptr_t)schedules};
  uint64_t places[4];
  const uint64_t bytes = lay_out(schedules, most, places);
  char * const memory = bytes == 0 ? NULL : calloc(1, (size_t)bytes);
  schedules->memory = memory;
  if (memory == NULL) {
    return false;
  }
  schedules->keys = fm_keys_make(memory + places[0], most, seed);
  schedules->items = (struct fm_instance_schedule **)(void *)(memory + places[1]);
  schedules->waiting = (struct fm_heap *)(void *)(memory + places[2]);
  schedules->due = fm_heap_make(memory + places[3], most);
  for (uint32_t k = 0; k < schedules->options.n_actions; ++k) {
    schedules->waiting[k] =
      fm_heap_make(memory + places[3] + (k + UINT64_C(1)) * fm_heap_bytes(most), most);
  }
  schedules->most = most;
  return true;
}

static void keep_word(
  struct fm_heap * heap, uint32_t slot, const struct fm_heap * before, uint32_t old)
{
  if (before->places[old] != 0) {
    fm_heap_set(heap, slot, before->words[old]);
  }
}

static void move(struct fm_schedules * schedules, const struct fm_schedules * before)
{
  for (uint32_t old = 0; old < before->keys.end; ++old) {
    if (!fm_keys_has(&before->keys, old)) {
      continue;
    }
    struct fm_instance_schedule * one = before->items[old];
    one->slot = fm_keys_add(&schedules->keys, one->key + 1, one->key[0]);
    schedules->items[one->slot] = one;
    keep_word(&schedules->due, one->slot, &before->due, old);
    for (uint32_t k = 0; k < schedules->options.n_actions; ++k) {
      keep_word(&schedules->waiting[k], one->slot, &before->waiting[k], old);
    }
  }
}

// Returns false if memory is short: then nothing has changed.
static bool grow(struct fm_schedules * schedules)
{
  const struct fm_schedules before = *schedules;
  if (!make_room(schedules, before.most == 0 ? FEWEST : 2 * before.most)) {
    *schedules = before;
    return false;
  }
  move(schedules, &before);
  free(before.memory);
  return true;
}

// ---- one schedule ------------------------------------------------------------------------------

static struct fm_instance_schedule * make(struct fm_schedules * schedules, const uint8_t * key)
{
  struct fm_instance_schedule * made = calloc(1, sizeof(*made));
  struct fm_schedule * schedule = fm_schedule_create(&schedules->options, true);
  if (made == NULL || schedule == NULL) {
    free(made);
    fm_schedule_destroy(schedule);
    return NULL;
  }
  made->schedule = schedule;
  made->schedules = schedules;
  memcpy(made->key, key, key[0] + (size_t)1);
  made->slot = fm_keys_add(&schedules->keys, key + 1, key[0]);
  schedules->items[made->slot] = made;
  return made;
}

static void drop(struct fm_instance_schedule * one)
{
  struct fm_schedules * schedules = one->schedules;
  fm_heap_remove(&schedules->due, one->slot);
  for (uint32_t k = 0; k < schedules->options.n_actions; ++k) {
    fm_heap_remove(&schedules->waiting[k], one->slot);
  }
  fm_keys_remove(&schedules->keys, one->slot);
  fm_schedule_destroy(one->schedule);
  free(one);
}

struct fm_instance_schedule * fm_schedules_of(
  struct fm_schedules * schedules, const uint8_t * key)
{
  const uint32_t slot = schedules->most == 0 ? FM_NO_SLOT :
    fm_keys_find(&schedules->keys, key + 1, key[0]);
  if (slot != FM_NO_SLOT) {
    return schedules->items[slot];
  }
  return schedules->keys.n < schedules->most || grow(schedules) ? make(schedules, key) : NULL;
}

void fm_schedules_settle(struct fm_instance_schedule * one, int64_t now)
{
  struct fm_heap * due = &one->schedules->due;
  const int64_t wake = fm_schedule_wake(one->schedule, now);
  if (fm_schedule_is_idle(one->schedule, now)) {
    drop(one);
  } else if (wake == FM_NEVER) {
    fm_heap_remove(due, one->slot);
  } else {
    fm_heap_set(due, one->slot, wake);
  }
}

// ---- all of them -------------------------------------------------------------------------------

int64_t fm_schedules_due(const struct fm_schedules * schedules)
{
  const uint32_t slot = fm_heap_first(&schedules->due);
  return slot == FM_NO_SLOT ? FM_NEVER : schedules->due.words[slot];
}

struct fm_instance_schedule * fm_schedules_first(
  const struct fm_schedules * schedules, int64_t now)
{
  return fm_schedules_due(schedules) > now ? NULL :
         schedules->items[fm_heap_first(&schedules->due)];
}

void fm_schedules_wait(struct fm_instance_schedule * one, uint32_t action)
{
  struct fm_schedules * schedules = one->schedules;
  if (schedules->waiting[action].places[one->slot] == 0) {
    schedules->n_waits += 1;
    fm_heap_set(&schedules->waiting[action], one->slot, schedules->n_waits);
  }
}

void fm_schedules_end_wait(struct fm_instance_schedule * one, uint32_t action)
{
  fm_heap_remove(&one->schedules->waiting[action], one->slot);
}

struct fm_instance_schedule * fm_schedules_waiting(
  const struct fm_schedules * schedules, uint32_t action)
{
  const uint32_t slot =
    schedules->most == 0 ? FM_NO_SLOT : fm_heap_first(&schedules->waiting[action]);
  return slot == FM_NO_SLOT ? NULL : schedules->items[slot];
}

struct fm_instance_schedule * fm_schedules_next(
  const struct fm_schedules * schedules, uint32_t slot)
{
  while (slot < schedules->keys.end && !fm_keys_has(&schedules->keys, slot)) {
    slot += 1;
  }
  return slot < schedules->keys.end ? schedules->items[slot] : NULL;
}

void fm_schedules_free(struct fm_schedules * schedules)
{
  for (uint32_t slot = 0; slot < schedules->keys.end; ++slot) {
    if (fm_keys_has(&schedules->keys, slot)) {
      drop(schedules->items[slot]);
    }
  }
  free(schedules->memory);
  *schedules = (struct fm_schedules) {.options = schedules->options};
}
