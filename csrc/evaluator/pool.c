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

/// pool.c: see pool.h for the contract.

#include "pool.h"

#include <math.h>
#include <string.h>

#include "due.h"
#include "fret_windows.h"
#include "steps.h"

// ---- layout ------------------------------------------------------------------------------------

// Offsets of the parts of the memory, in bytes.
struct layout
{
  uint64_t evaluator;
  uint64_t violated;
  uint64_t unknown;
  uint64_t nearest;
  uint64_t margins;
  uint64_t heaps;
  uint64_t keys;
  uint64_t due;
  uint64_t lasts;
  uint64_t turns;
  uint64_t blocks;
  struct fm_block block;
};

static struct layout lay_out(
  const struct fm_evaluator_options * options, uint64_t most, bool has_keys, bool forgets)
{
  const uint64_t evaluator = fm_evaluator_bytes(options);
  struct layout layout = {0};
  layout.block.fits = evaluator > 0 && fm_keys_bytes(most) > 0;
  layout.evaluator = fm_block_append(&layout.block, evaluator, 1);
  layout.violated =
    fm_block_append(&layout.block, options->monitor->n_requirements, sizeof(uint64_t));
  layout.unknown =
    fm_block_append(&layout.block, options->monitor->n_requirements, sizeof(uint64_t));
  const uint64_t n_margins = options->margins == NULL ? 0 : options->monitor->n_requirements;
  layout.nearest = fm_block_append(&layout.block, most * n_margins, sizeof(struct fm_nearest));
  layout.margins = fm_block_append(&layout.block, n_margins, sizeof(struct fm_heap));
  layout.heaps = fm_block_append(&layout.block, n_margins * fm_heap_bytes(most), 1);
  layout.keys = fm_block_append(&layout.block, has_keys ? fm_keys_bytes(most) : 0, 1);
  layout.due = fm_block_append(&layout.block, fm_heap_bytes(most), 1);
  layout.lasts = fm_block_append(&layout.block, forgets ? most : 0, sizeof(int64_t));
  layout.turns = fm_block_append(&layout.block, most, sizeof(uint16_t));
  layout.blocks = fm_block_append(
    &layout.block, most,
    evaluator > 0 ? fm_instance_bytes(options->monitor, fm_measure_words(options)) : 1);
  return layout;
}

uint64_t fm_pool_bytes(
  const struct fm_evaluator_options * options, uint64_t most, bool has_keys, bool forgets)
{
  if (options->monitor == NULL || options->monitor->abi != FM_ABI) {
    return 0;
  }
  const struct layout layout = lay_out(options, most, has_keys, forgets);
  return layout.block.fits ? layout.block.bytes : 0;
}

static void make_margins(
  struct fm_pool * pool, char * bytes, const struct layout * layout, uint32_t most)
{
  pool->own_nearest = pool->evaluator->nearest;
  pool->nearest = (struct fm_nearest *)(void *)(bytes + layout->nearest);
  pool->margins = (struct fm_heap *)(void *)(bytes + layout->margins);
  for (uint32_t r = 0; r < pool->evaluator->monitor->n_requirements; ++r) {
    pool->margins[r] = fm_heap_make(bytes + layout->heaps + r * fm_heap_bytes(most), most);
  }
}

bool fm_pool_make(
  struct fm_pool * pool, void * memory, const struct fm_pool_options * made)
{
  const struct fm_evaluator_options * options = made->options;
  const struct layout layout = lay_out(
    options, made->most, made->keys == NULL, made->forget > 0);
  char * const bytes = memory;
  pool->evaluator = fm_evaluator_init(bytes + layout.evaluator, options);
  if (pool->evaluator == NULL || made->forget < 0) {
    return false;
  }
  if (made->keys == NULL) {
    pool->own_keys = fm_keys_make(bytes + layout.keys, made->most, made->seed);
  }
  pool->keys = made->keys == NULL ? &pool->own_keys : made->keys;
  pool->blank = pool->evaluator->instance;
  pool->blocks = bytes + layout.blocks;
  pool->block_bytes = fm_instance_bytes(options->monitor, fm_measure_words(options));
  pool->due = fm_heap_make(bytes + layout.due, made->most);
  pool->lasts = (int64_t *)(void *)(bytes + layout.lasts);
  pool->turns = (uint16_t *)(void *)(bytes + layout.turns);
  pool->turn = 1;
  pool->violated = (uint64_t *)(void *)(bytes + layout.violated);
  pool->unknown = (uint64_t *)(void *)(bytes + layout.unknown);
  pool->forget = made->forget;
  pool->entered = FM_NO_SLOT;
  if (options->margins != NULL) {
    make_margins(pool, bytes, &layout, made->most);
  }
  return true;
}

// ---- one instance ------------------------------------------------------------------------------

#if defined(__GNUC__)
#define PREFETCH(place) __builtin_prefetch(place)
#else
#define PREFETCH(place) ((void)(place))
#endif

// With many instances, most of the time of a message is that of loading the block.
static void load(const char * block, uint64_t bytes)
{
  for (uint64_t place = 0; place < bytes && place < 512; place += 64) {
    PREFETCH(block + place);
  }
}

static char * block_of(const struct fm_pool * pool, uint32_t slot)
{
  return pool->blocks + slot * pool->block_bytes;
}

// The place in another block of what lies at `place` in the blank.
static void * moved(const struct fm_pool * pool, const void * place, char * block)
{
  return block + ((const char *)place - (const char *)(const void *)pool->blank.time);
}

static struct fm_instance instance_at(const struct fm_pool * pool, uint32_t slot)
{
  char * const block = block_of(pool, slot);
  const struct fm_instance * blank = &pool->blank;
  struct fm_instance instance;
  instance.monitor = blank->monitor;
  instance.time = (struct fm_instance_time *)(void *)block;
  instance.inputs = (struct fm_instance_input *)moved(pool, blank->inputs, block);
  instance.groups = (struct fm_instance_group *)moved(pool, blank->groups, block);
  instance.verdicts = (bool *)moved(pool, blank->verdicts, block);
  instance.previous = (bool *)moved(pool, blank->previous, block);
  instance.values = moved(pool, blank->values, block);
  instance.measures = (int64_t *)moved(pool, blank->measures, block);
  instance.state = moved(pool, blank->state, block);
  return instance;
}

// ---- margins -----------------------------------------------------------------------------------

static struct fm_nearest * nearest_of(const struct fm_pool * pool, uint32_t slot)
{
  return pool->nearest + (uint64_t)slot * pool->evaluator->monitor->n_requirements;
}

// Keep the instances in the order of their present margins, where these are known.
static void order_margins(const struct fm_pool * pool, uint32_t slot)
{
  for (uint32_t r = 0; r < pool->evaluator->monitor->n_requirements; ++r) {
    const double margin = fm_margin_now(pool->evaluator, r).value;
    if (margin != margin) {
      fm_heap_remove(&pool->margins[r], slot);
    } else {
      fm_heap_set(&pool->margins[r], slot, fm_key_f64(margin, false));
    }
  }
}

static void begin_margins(const struct fm_pool * pool, uint32_t slot)
{
  const uint32_t n = pool->evaluator->monitor->n_requirements;
  memset(nearest_of(pool, slot), 0, n * sizeof(struct fm_nearest));
}

static void end_margins(const struct fm_pool * pool, uint32_t slot)
{
  for (uint32_t r = 0; r < pool->evaluator->monitor->n_requirements; ++r) {
    fm_heap_remove(&pool->margins[r], slot);
  }
}

static struct fm_margin least_margin(const struct fm_pool * pool, uint32_t requirement)
{
  const struct fm_margin none = {(double)INFINITY, (double)INFINITY, 0, -1};
  const uint32_t first = fm_heap_first(&pool->margins[requirement]);
  const uint64_t place = pool->evaluator->margins->margins[requirement];
  return first == FM_NO_SLOT ? none : *(const struct fm_margin *)(const void *)(
    (const char *)instance_at(pool, first).state + place);
}

void fm_pool_draw(struct fm_pool * pool, int64_t instant)
{
  const struct fm_evaluator * evaluator = pool->evaluator;
  if (evaluator->lanes == NULL || pool->margins == NULL) {
    return;
  }
  if (pool->entered != FM_NO_SLOT) {
    order_margins(pool, pool->entered);
  }
  for (uint32_t r = 0; r < evaluator->monitor->n_requirements; ++r) {
    if (pool->margins[r].n > 0 || pool->counts.alive == 0) {
      fm_draw_last(evaluator->lanes, r, least_margin(pool, r), instant);
    }
  }
}

uint32_t fm_pool_nearest(struct fm_pool * pool, uint32_t requirement)
{
  fm_pool_leave(pool);
  return pool->margins == NULL ? FM_NO_SLOT : fm_heap_first(&pool->margins[requirement]);
}

double fm_pool_take_margin(struct fm_pool * pool, uint32_t requirement)
{
  const uint32_t first = fm_pool_nearest(pool, requirement);
  const int64_t key = first == FM_NO_SLOT ? FM_NAN_KEY : pool->margins[requirement].words[first];
  return fm_take_recent(pool->evaluator, requirement, fm_of_key_f64(key, false));
}

// ---- counters ----------------------------------------------------------------------------------

static void count_unknown(struct fm_pool * pool, const struct fm_instance * instance, uint64_t by)
{
  for (uint32_t r = 0; pool->counts_unknown && r < instance->monitor->n_requirements; ++r) {
    pool->unknown[r] += fm_is_known(instance, r) ? 0u : by;
  }
}

// Count the steps of the instance, and its violations, with those of the others, or apart: `by` is
// 1 or -1, and wraps.
static void count(struct fm_pool * pool, uint64_t by)
{
  const struct fm_evaluator * evaluator = pool->evaluator;
  const struct fm_monitor * monitor = evaluator->monitor;
  const struct fm_instance_group * groups = evaluator->instance.groups;
  const bool * previous = evaluator->instance.previous;
  uint64_t * steps = evaluator->steps_before;
  uint64_t * violated = pool->violated;
  for (uint32_t g = 0, n = monitor->n_groups; g < n; ++g) {
    steps[g] += by * groups[g].steps;
  }
  for (uint32_t r = 0, n = monitor->n_requirements; r < n; ++r) {
    violated[r] += previous[r] ? 0u : by;
  }
  if (monitor->overflows != NULL) {
    pool->overflows += by * monitor->overflows(evaluator->instance.state);
  }
  count_unknown(pool, &evaluator->instance, by);
}

uint64_t fm_pool_overflows(const struct fm_pool * pool)
{
  return pool->overflows + fm_evaluator_time_counts(pool->evaluator).overflows;
}

// Messages move the time of their own instance alone. Under FM_TIMED each scope may be ahead of
// the clock on its own.
static void tell_time(const struct fm_evaluator * evaluator, const struct fm_instance_time * time)
{
  struct fm_instance_time * own = evaluator->instance.time;
  if (own->has_begun && time != NULL) {
    own->now = own->now > time->clock ? own->now : time->clock;
    own->before = time->before;
    own->clock = time->clock;
  }
}

void fm_pool_enter(
  struct fm_pool * pool, uint32_t slot, const struct fm_instance_time * time)
{
  struct fm_evaluator * evaluator = pool->evaluator;
  load(block_of(pool, slot), pool->block_bytes);
  fm_pool_leave(pool);
  evaluator->instance = instance_at(pool, slot);
  evaluator->wake = !evaluator->instance.time->has_begun ? INT64_MIN :
    pool->due.n > 0 && pool->due.places[slot] != 0 ? pool->due.words[slot] : FM_NEVER;
  evaluator->is_exact = false;
  evaluator->nearest = pool->nearest == NULL ? evaluator->nearest : nearest_of(pool, slot);
  pool->entered = slot;
  count(pool, UINT64_MAX);
  tell_time(evaluator, time);
}

void fm_pool_note_last(struct fm_pool * pool, uint32_t slot, int64_t now)
{
  if (pool->forget > 0) {
    pool->lasts[slot] = now;
  }
}

void fm_pool_shift_last(struct fm_pool * pool, uint32_t slot, int64_t by)
{
  if (pool->forget > 0) {
    pool->lasts[slot] = fm_later(pool->lasts[slot], by);
  }
}

int64_t fm_pool_end_of(const struct fm_pool * pool, uint32_t slot)
{
  return pool->forget > 0 ? fm_later(pool->lasts[slot], pool->forget) : FM_NEVER;
}

int64_t fm_pool_deadline(struct fm_pool * pool)
{
  const int64_t deadline = fm_evaluator_deadline(pool->evaluator);
  const int64_t end = fm_pool_end_of(pool, pool->entered);
  return deadline < end ? deadline : end;
}

// The heap keeps what was found when it was last looked for, unless something came before it.
static void note_due(struct fm_pool * pool)
{
  const uint32_t slot = pool->entered;
  struct fm_evaluator * evaluator = pool->evaluator;
  if (!evaluator->instance.time->has_begun) {
    return;
  }
  if (evaluator->wake == INT64_MIN) {
    (void)fm_evaluator_deadline(evaluator);
  }
  const int64_t end = fm_pool_end_of(pool, slot);
  const int64_t due = evaluator->wake < end ? evaluator->wake : end;
  if (due == FM_NEVER) {
    fm_heap_remove(&pool->due, slot);
  } else {
    fm_heap_set(&pool->due, slot, due);
  }
}

void fm_pool_begin_turn(struct fm_pool * pool)
{
  pool->turn = (uint16_t)(pool->turn + 1u);
  if (pool->turn == 0) {
    memset(pool->turns, 0, pool->keys->end * sizeof(*pool->turns));
    pool->turn = 1;
  }
}

static void enter_blank(struct fm_pool * pool)
{
  pool->entered = FM_NO_SLOT;
  pool->evaluator->instance = pool->blank;
  if (pool->nearest != NULL) {
    pool->evaluator->nearest = pool->own_nearest;
  }
}

void fm_pool_leave(struct fm_pool * pool)
{
  if (pool->entered != FM_NO_SLOT) {
    note_due(pool);
    count(pool, 1);
    if (pool->nearest != NULL) {
      order_margins(pool, pool->entered);
    }
    enter_blank(pool);
  }
}

void fm_pool_count_unknown(struct fm_pool * pool)
{
  fm_pool_leave(pool);
  pool->counts_unknown = true;
  for (uint32_t slot = 0; slot < pool->keys->end; ++slot) {
    if (fm_keys_has(pool->keys, slot)) {
      const struct fm_instance instance = instance_at(pool, slot);
      count_unknown(pool, &instance, 1);
    }
  }
}

void fm_pool_begin(struct fm_pool * pool, uint32_t slot)
{
  fm_pool_leave(pool);
  memcpy(block_of(pool, slot), pool->blank.time, (size_t)pool->block_bytes);
  pool->counts.begun += 1;
  pool->counts.alive += 1;
  if (pool->nearest != NULL) {
    begin_margins(pool, slot);
  }
  count_unknown(pool, &pool->blank, 1);  // of which it is a copy
}

static bool has_deadline(const struct fm_pool * pool, uint32_t slot)
{
  const struct fm_instance instance = instance_at(pool, slot);
  bool is_open = false;
  for (uint32_t g = 0; g < instance.monitor->n_groups; ++g) {
    is_open = is_open || instance.groups[g].due != FM_NEVER;
  }
  return is_open;
}

// What the instance has counted stays; its violations are over.
bool fm_pool_end(struct fm_pool * pool, uint32_t slot)
{
  const struct fm_instance instance = instance_at(pool, slot);
  fm_pool_leave(pool);
  for (uint32_t r = 0; r < instance.monitor->n_requirements; ++r) {
    pool->violated[r] -= instance.previous[r] ? 0u : 1u;
  }
  count_unknown(pool, &instance, UINT64_MAX);
  pool->counts.ended += 1;
  pool->counts.alive -= 1;
  pool->turns[slot] = 0;
  fm_heap_remove(&pool->due, slot);
  if (pool->nearest != NULL) {
    end_margins(pool, slot);
  }
  return has_deadline(pool, slot);
}
