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

/// scopes_due.c: the time of all scopes, and what is due in them. See scopes.h.

#include "due.h"
#include "scopes_parts.h"

// ---- the time ----------------------------------------------------------------------------------

static void begin_instances(struct fm_scopes * scopes, int64_t now)
{
  for (uint32_t k = 0; k < scopes->n_kinds; ++k) {
    struct fm_pool * pool = &scopes->kinds[k].pool;
    for (uint32_t slot = 0; slot < pool->keys->end; ++slot) {
      if (fm_keys_has(pool->keys, slot)) {
        fm_pool_note_last(pool, slot, now);
        (void)fm_reach(fm_scopes_enter_slot(scopes, k, slot), now);
        fm_pool_leave(pool);
      }
    }
  }
}

static void set_instances_back(struct fm_scopes * scopes, int64_t now)
{
  const int64_t by = -fm_since(now, scopes->bundle->instance.time->now);
  for (uint32_t k = 0; k < scopes->n_kinds; ++k) {
    struct fm_pool * pool = &scopes->kinds[k].pool;
    for (uint32_t slot = 0; slot < pool->keys->end; ++slot) {
      if (fm_keys_has(pool->keys, slot)) {
        fm_pool_shift_last(pool, slot, by);
        (void)fm_reach(fm_scopes_enter_slot(scopes, k, slot), now);
        fm_scopes_give_aggregates(scopes, k, now);
        fm_pool_leave(pool);
        if (scopes->options.policy == FM_TIMED) {
          fm_scopes_uncount(scopes, k, slot);
        }
      }
    }
  }
}

void fm_scopes_reach(struct fm_scopes * scopes, int64_t now)
{
  const bool goes_back = fm_goes_back(scopes->bundle, now);
  if (goes_back) {
    set_instances_back(scopes, now);
  }
  if (!fm_reach(scopes->bundle, now)) {
    begin_instances(scopes, now);
  } else if (goes_back) {
    fm_scopes_store_aggregates(scopes, now);
  }
  // The instances have the clock from there, also while the bundle's scope is ahead of it.
  (void)fm_evaluator_arrival(scopes->bundle, now);
}

// ---- what is due -------------------------------------------------------------------------------

// A bound is made exact until the first one is.
int64_t fm_scopes_first_due_of(
  struct fm_scopes * scopes, uint32_t kind, int64_t last, bool misses)
{
  struct fm_pool * pool = &scopes->kinds[kind].pool;
  fm_pool_leave(pool);
  for (;;) {
    const uint32_t slot = fm_heap_first(&pool->due);
    if (slot == FM_NO_SLOT || pool->due.words[slot] > last) {
      return FM_NEVER;
    }
    struct fm_evaluator * evaluator = fm_scopes_enter_slot(scopes, kind, slot);
    if (misses) {
      fm_miss_periods(evaluator, last);
    }
    const int64_t due = fm_pool_deadline(pool);
    fm_pool_leave(pool);
    if (fm_heap_first(&pool->due) == slot && pool->due.words[slot] == due) {
      return due <= last ? due : FM_NEVER;
    }
  }
}

int64_t fm_scopes_first_due(struct fm_scopes * scopes, int64_t last, bool misses)
{
  if (misses && scopes->bundle->wake <= last) {
    fm_miss_periods(scopes->bundle, last);
  }
  int64_t first =
    scopes->bundle->wake <= last ? fm_evaluator_deadline(scopes->bundle) : FM_NEVER;
  for (uint32_t k = 0; k < scopes->n_kinds; ++k) {
    const int64_t due = fm_scopes_first_due_of(scopes, k, last, misses);
    first = due < first ? due : first;
  }
  return first <= last ? first : FM_NEVER;
}

static void take_due_in(
  struct fm_scopes * scopes, uint32_t kind, uint32_t slot, int64_t instant)
{
  (void)fm_scopes_enter_slot(scopes, kind, slot);
  fm_scopes_take_due_of(scopes, kind, instant);
  fm_pool_leave(&scopes->kinds[kind].pool);
}

// Log how close an instance came that ends.
static void log_closest(struct fm_scopes * scopes, uint32_t kind, uint32_t slot)
{
  struct fm_closest_log * log = scopes->closest;
  const struct fm_evaluator * ended = fm_scopes_enter_slot(scopes, kind, slot);
  for (uint32_t r = 0; r < ended->monitor->n_requirements; ++r) {
    if (ended->nearest[r].closest.is_known && log->n == log->room) {
      log->missed += 1;
    } else if (ended->nearest[r].closest.is_known) {
      struct fm_closest_record * record = &log->records[log->n];
      *record = (struct fm_closest_record) {ended->nearest[r].closest, kind, r, 0, {0}};
      record->key_size =
        (uint32_t)fm_keys_copy(scopes->kinds[kind].pool.keys, slot, record->key);
      log->n += 1;
    }
  }
}

void fm_scopes_end_instance(
  struct fm_scopes * scopes, uint32_t kind, uint32_t slot, int64_t instant)
{
  struct fm_pool * own = &scopes->kinds[kind].pool;
  bool is_open = false;
  for (uint32_t k = kind + 1u; k < scopes->n_kinds; ++k) {
    if (fm_scopes_have_same_keys(scopes, k, kind)) {
      take_due_in(scopes, k, slot, instant);
    }
  }
  for (uint32_t k = kind; k < scopes->n_kinds; ++k) {
    if (fm_scopes_have_same_keys(scopes, k, kind)) {
      fm_scopes_report(scopes, FM_SCOPE_ENDED, k, slot, instant, 0);
      if (scopes->closest != NULL) {
        log_closest(scopes, k, slot);
      }
      fm_pool_leave(&scopes->kinds[k].pool);
      fm_scopes_uncount(scopes, k, slot);
      is_open = fm_pool_end(&scopes->kinds[k].pool, slot) || is_open;
      fm_pool_draw(&scopes->kinds[k].pool, instant);
    }
  }
  own->counts.open += is_open ? 1u : 0u;
  if (scopes->kinds[kind].pairs != NULL) {
    fm_pairs_remove(scopes->kinds[kind].pairs, slot);
  }
  fm_keys_remove(own->keys, slot);
}

void fm_scopes_spread_news(struct fm_scopes * scopes, uint32_t kind, int64_t instant)
{
  struct fm_pool * pool = &scopes->kinds[kind].pool;
  for (uint32_t slot = 0; slot < pool->keys->end; ++slot) {
    if (fm_keys_has(pool->keys, slot)) {
      (void)fm_scopes_enter_slot(scopes, kind, slot);
      fm_scopes_give_aggregates(scopes, kind, instant);
      fm_pool_leave(pool);
    }
  }
}

uint32_t fm_scopes_take_until_end(struct fm_scopes * scopes, uint32_t kind, int64_t instant)
{
  struct fm_pool * pool = &scopes->kinds[kind].pool;
  while (fm_scopes_first_due_of(scopes, kind, instant, false) != FM_NEVER) {
    const uint32_t slot = fm_heap_first(&pool->due);
    take_due_in(scopes, kind, slot, instant);
    if (fm_pool_end_of(pool, slot) <= instant) {
      return slot;
    }
  }
  return FM_NO_SLOT;
}

int64_t fm_scopes_deadline(struct fm_scopes * scopes)
{
  return fm_evaluator_has_begun(scopes->bundle) ?
         fm_scopes_first_due(scopes, FM_NEVER, false) : INT64_MIN;
}

int64_t fm_scopes_wake(const struct fm_scopes * scopes)
{
  int64_t wake = scopes->bundle->wake;
  for (uint32_t k = 0; k < scopes->n_kinds; ++k) {
    const struct fm_heap * due = &scopes->kinds[k].pool.due;
    const uint32_t slot = fm_heap_first(due);
    wake = slot != FM_NO_SLOT && due->words[slot] < wake ? due->words[slot] : wake;
  }
  return wake;
}
