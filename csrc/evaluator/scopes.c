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

/// scopes.c: see scopes.h for the contract. Messages and answers; scopes_making.c makes scopes,
/// scopes_due.c has their time.

#include "scopes.h"

#include <math.h>

#include "due.h"
#include "scopes_parts.h"

// ---- messages ----------------------------------------------------------------------------------

static void stage(
  struct fm_scopes * scopes, uint32_t input, union fm_value value, bool is_usable)
{
  struct fm_scopes_message * message = &scopes->message;
  if (message->n_staged < scopes->bundle->monitor->n_inputs) {
    const struct fm_staged staged = {value, input, is_usable};
    scopes->staged[message->n_staged] = staged;
    message->n_staged += 1;
  }
}

void fm_scopes_store(struct fm_scopes * scopes, uint32_t input, union fm_value value)
{
  if (input < scopes->bundle->monitor->n_inputs) {
    stage(scopes, input, value, true);
  }
}

static union fm_value value_from(
  const struct fm_monitor * monitor, uint32_t input, const void * value)
{
  return fm_instance_value((enum fm_type)monitor->inputs[input].type, value);
}

void fm_scopes_store_from(struct fm_scopes * scopes, uint32_t input, const void * value)
{
  if (input < scopes->bundle->monitor->n_inputs) {
    stage(scopes, input, value_from(scopes->bundle->monitor, input, value), true);
  }
}

void fm_scopes_unusable(struct fm_scopes * scopes, uint32_t input)
{
  const union fm_value none = {.u = 0};
  if (input < scopes->bundle->monitor->n_inputs) {
    stage(scopes, input, none, false);
  }
}

// Whether the message is one for all instances of a kind. Where a topic feeds nothing of a kind,
// it is a step under FM_EVERY_MESSAGE alone.
static bool is_for_all(const struct fm_scopes * scopes, uint32_t kind)
{
  const struct fm_scopes_message * message = &scopes->message;
  const struct fm_scope_kind * cell = &scopes->kinds[kind];
  if (message->is_row) {
    return message->is_for_all;
  }
  const enum fm_policy policy = scopes->options.policy;
  const uint8_t concerns =
    message->topic < scopes->options.n_topics ? cell->options.concerns[message->topic] : 0u;
  return ((concerns & FM_CONCERNS_VALUE) != 0u &&
         (policy == FM_RELEVANT_MESSAGE || policy == FM_ALL_INPUTS)) ||
         ((concerns & FM_CONCERNS_ALL) != 0u && (policy == FM_EVERY_MESSAGE ||
         cell->options.options->topics[message->topic].n_inputs > 0 ||
         cell->pool.evaluator->topics[message->topic].n_groups > 0));
}

// What is due in an instance before the message takes effect in it is taken first.
static int64_t arrive(struct fm_scopes * scopes, uint32_t kind)
{
  struct fm_evaluator * evaluator = scopes->kinds[kind].pool.evaluator;
  const int64_t at = fm_evaluator_arrival(evaluator, scopes->message.now);
  if (at != scopes->message.now) {
    fm_scopes_take_due_of(scopes, kind, fm_later(at, -1));
  }
  return at;
}

static void store_copies(struct fm_scopes * scopes, uint32_t kind, int64_t at)
{
  const struct fm_scope_kind * cell = &scopes->kinds[kind];
  for (uint32_t n = 0; n < scopes->message.n_staged; ++n) {
    const struct fm_staged * staged = &scopes->staged[n];
    const uint32_t input = cell->copies[staged->input];
    if (staged->is_usable && input != UINT32_MAX) {
      fm_evaluator_store(cell->pool.evaluator, input, staged->value, at);
    }
  }
}

static void store_parts(struct fm_scopes * scopes, uint32_t kind, int64_t at)
{
  const struct fm_scope_kind * cell = &scopes->kinds[kind];
  for (uint32_t n = 0; n < scopes->message.n_parts; ++n) {
    const struct fm_staged * part = &scopes->parts[n];
    if (cell->parts[part->input] != UINT32_MAX) {
      fm_evaluator_store(cell->pool.evaluator, cell->parts[part->input], part->value, at);
    }
  }
}

// Enter an instance, and let it know the shared inputs. Returns when the message takes effect.
static int64_t enter(struct fm_scopes * scopes, uint32_t kind, uint32_t slot)
{
  (void)fm_scopes_enter_slot(scopes, kind, slot);
  const int64_t at = arrive(scopes, kind);
  store_copies(scopes, kind, at);
  return at;
}

// What reads aggregates takes the message no earlier than the instances that they are of.
static int64_t read_aggregates(struct fm_scopes * scopes, uint32_t kind, int64_t arrival)
{
  const int64_t reached = scopes->message.reached;
  const bool is_later = scopes->options.policy == FM_TIMED && reached > arrival;
  if (is_later) {
    fm_scopes_take_due_of(scopes, kind, fm_later(reached, -1));
  }
  const int64_t at = is_later ? reached : arrival;
  fm_scopes_give_aggregates(scopes, kind, at);
  return at;
}

// The instance that is entered takes the message.
static void step(struct fm_scopes * scopes, uint32_t kind, uint32_t slot, int64_t arrival)
{
  struct fm_scopes_message * message = &scopes->message;
  struct fm_pool * pool = &scopes->kinds[kind].pool;
  const int64_t at = scopes->kinds[kind].reads_aggregates ?
    read_aggregates(scopes, kind, arrival) : arrival;
  if (scopes->n_totals > 0) {
    fm_scopes_before_step(scopes, kind);
  }
  const uint32_t n = message->is_row ? fm_evaluator_step(pool->evaluator, at, scopes->found) :
    fm_evaluator_message(pool->evaluator, message->topic, at, scopes->found);
  fm_scopes_after_step(scopes, kind, at);
  fm_pool_leave(pool);
  message->reached = at > message->reached ? at : message->reached;
  message->instant = at > message->instant ? at : message->instant;
  fm_scopes_report(scopes, FM_SCOPE_STEPPED, kind, slot, at, n);
}

// The instance that is entered steps when all instances of the kinds before have.
static void put_off(struct fm_scope_kind * cell, uint32_t slot)
{
  fm_pool_leave(&cell->pool);
  cell->pool.turns[slot] = cell->pool.turn;
  cell->waiting[cell->n_waiting] = slot;
  cell->n_waiting += 1;
}

// The message is one for the other kinds with the key, too, which read aggregates.
static void pass_on(struct fm_scopes * scopes, uint32_t base, uint32_t slot)
{
  for (uint32_t k = base + 1u; k < scopes->n_kinds; ++k) {
    if (scopes->kinds[k].pool.keys == scopes->kinds[base].pool.keys) {
      store_parts(scopes, k, enter(scopes, k, slot));
      put_off(&scopes->kinds[k], slot);
    }
  }
}

static void store_half(struct fm_scopes * scopes, uint32_t kind, uint32_t half, int64_t at)
{
  const struct fm_scope_kind * cell = &scopes->kinds[kind];
  const uint32_t * inputs = cell->options.halves[half].inputs;
  for (uint32_t n = 0; n < scopes->message.n_parts; ++n) {
    const struct fm_staged * part = &scopes->parts[n];
    for (uint32_t i = 0; i < cell->pool.evaluator->monitor->n_inputs; ++i) {
      if (inputs[i] == part->input) {
        fm_evaluator_store(cell->pool.evaluator, i, part->value, at);
      }
    }
  }
}

// A pair takes a message of an instance of its half, with any part of its own.
static void give_half(struct fm_scopes * scopes, uint32_t kind, uint32_t half, uint32_t slot)
{
  struct fm_scope_kind * cell = &scopes->kinds[kind];
  if (cell->pool.turns[slot] != cell->pool.turn) {
    store_half(scopes, kind, half, enter(scopes, kind, slot));
    put_off(cell, slot);
  } else {
    (void)fm_scopes_enter_slot(scopes, kind, slot);
    store_half(scopes, kind, half, arrive(scopes, kind));
    fm_pool_leave(&cell->pool);
  }
}

// The message of an instance is one for all pairs of its key.
static void give_to_pairs(struct fm_scopes * scopes, uint32_t single, uint32_t slot)
{
  uint8_t bytes[FM_MOST_KEY_BYTES];
  const size_t size = fm_keys_copy(scopes->kinds[single].pool.keys, slot, bytes);
  const struct fm_key key = {bytes, (uint32_t)size};
  for (uint32_t k = 0; k < scopes->n_kinds; ++k) {
    const struct fm_scope_kind * cell = &scopes->kinds[k];
    const struct fm_pairs * pairs = cell->pairs;
    for (uint32_t h = 0; h < 2; ++h) {
      uint32_t pair = pairs != NULL && cell->options.halves[h].kind == single ?
        fm_pairs_first(pairs, h, &key) : FM_NO_SLOT;
      for (; pair != FM_NO_SLOT; pair = fm_pairs_next(pairs, h, pair)) {
        give_half(scopes, k, h, pair);
      }
    }
  }
}

static void step_entered(struct fm_scopes * scopes)
{
  struct fm_scopes_message * message = &scopes->message;
  const uint32_t kind = message->kind;
  if (kind == FM_BUNDLE) {
    return;
  }
  message->kind = FM_BUNDLE;
  if (scopes->kinds[kind].waiting != NULL) {
    put_off(&scopes->kinds[kind], message->slot);
  } else {
    step(scopes, kind, message->slot, message->entered_at);
  }
  if (scopes->kinds[kind].keeps_parts) {
    pass_on(scopes, kind, message->slot);
    give_to_pairs(scopes, kind, message->slot);
  }
}

// A new key gets a slot, and is in the index of pairs. FM_NO_SLOT: there is no room.
static uint32_t add_key(struct fm_scope_kind * cell, const struct fm_key * key)
{
  struct fm_keys * keys = cell->pool.keys;
  const uint32_t slot = key->size > 0 ? fm_keys_add(keys, key->bytes, key->size) : FM_NO_SLOT;
  if (slot != FM_NO_SLOT && cell->pairs != NULL && !fm_pairs_add(cell->pairs, slot, key)) {
    fm_keys_remove(keys, slot);
    return FM_NO_SLOT;
  }
  return slot;
}

// Whether a key may begin an instance, if there is room: none that is listed is lacking.
static bool may_begin(const struct fm_scope_kind * cell, const struct fm_key * key)
{
  const bool is_pair = cell->pairs != NULL && key->size > 0 && key->size <= FM_MOST_KEY_BYTES;
  return cell->options.n_listed == 0 && (!is_pair || fm_pairs_fit(cell->pairs, key));
}

static uint32_t find_or_begin(
  struct fm_scopes * scopes, uint32_t kind, const void * key, size_t size)
{
  struct fm_pool * pool = &scopes->kinds[kind].pool;
  const struct fm_key found = {key, (uint32_t)size};
  uint32_t slot = fm_keys_find(pool->keys, key, size);
  if (slot != FM_NO_SLOT || !may_begin(&scopes->kinds[kind], &found)) {
    return slot;
  }
  slot = add_key(&scopes->kinds[kind], &found);
  if (slot == FM_NO_SLOT) {
    pool->counts.beyond += 1;
    const bool is_sized = size > 0 && size <= FM_MOST_KEY_BYTES;
    const struct fm_pairs * pairs = scopes->kinds[kind].pairs;
    pool->counts.unsized += is_sized ? 0u : 1u;
    pool->counts.second +=
      is_sized && pairs != NULL && fm_pairs_lack_second(pairs, &found) ? 1u : 0u;
    pool->is_short = pool->is_short || size > 0;
    fm_scopes_report(scopes, FM_SCOPE_BEYOND, kind, slot, scopes->message.now, 0);
  } else {
    fm_scopes_begin_instance(scopes, kind, slot, scopes->message.now);
  }
  return slot;
}

uint32_t fm_scopes_enter(
  struct fm_scopes * scopes, uint32_t kind, const void * key, size_t size)
{
  if (kind >= scopes->n_kinds || scopes->kinds[kind].parts != NULL) {
    return FM_NO_SLOT;
  }
  struct fm_scopes_message * message = &scopes->message;
  struct fm_pool * pool = &scopes->kinds[kind].pool;
  step_entered(scopes);
  const uint32_t slot = find_or_begin(scopes, kind, key, size);
  if (slot == FM_NO_SLOT || pool->turns[slot] == pool->turn) {
    return FM_NO_SLOT;
  }
  fm_pool_note_last(pool, slot, message->now);
  pool->turns[slot] = pool->turn;
  message->entered_at = enter(scopes, kind, slot);
  message->kind = kind;
  message->slot = slot;
  message->n_parts = 0;
  return slot;
}

// Keep a value for the other kinds with the key.
static void keep_part(struct fm_scopes * scopes, uint32_t input, union fm_value value)
{
  struct fm_scopes_message * message = &scopes->message;
  const struct fm_scope_kind * cell = &scopes->kinds[message->kind];
  const uint32_t n_inputs = cell->pool.evaluator->monitor->n_inputs;
  if (input < n_inputs && message->n_parts < n_inputs) {
    const struct fm_staged part = {value, input, true};
    scopes->parts[message->n_parts] = part;
    message->n_parts += 1;
  }
}

void fm_scopes_store_keyed(struct fm_scopes * scopes, uint32_t input, union fm_value value)
{
  const struct fm_scopes_message * message = &scopes->message;
  if (message->kind != FM_BUNDLE) {
    fm_evaluator_store(
      scopes->kinds[message->kind].pool.evaluator, input, value, message->entered_at);
    if (scopes->kinds[message->kind].keeps_parts) {
      keep_part(scopes, input, value);
    }
  }
}

void fm_scopes_store_keyed_from(struct fm_scopes * scopes, uint32_t input, const void * value)
{
  const struct fm_scopes_message * message = &scopes->message;
  const struct fm_monitor * monitor = message->kind == FM_BUNDLE ? NULL :
    scopes->kinds[message->kind].pool.evaluator->monitor;
  if (monitor != NULL && input < monitor->n_inputs) {
    fm_scopes_store_keyed(scopes, input, value_from(monitor, input, value));
  }
}

void fm_scopes_unusable_keyed(struct fm_scopes * scopes, uint32_t input)
{
  if (scopes->message.kind != FM_BUNDLE) {
    fm_evaluator_unusable(scopes->kinds[scopes->message.kind].pool.evaluator, input);
  }
}

static void step_one_waiting(struct fm_scopes * scopes, uint32_t kind, uint32_t slot)
{
  (void)fm_scopes_enter_slot(scopes, kind, slot);
  step(scopes, kind, slot, arrive(scopes, kind));
}

// Those that have ended at the instant of the message have taken it.
static void step_waiting(struct fm_scopes * scopes, uint32_t kind)
{
  struct fm_scope_kind * cell = &scopes->kinds[kind];
  for (uint32_t n = 0; n < cell->n_waiting; ++n) {
    if (fm_keys_has(cell->pool.keys, cell->waiting[n])) {
      step_one_waiting(scopes, kind, cell->waiting[n]);
    }
  }
  cell->n_waiting = 0;
}

static void step_others(struct fm_scopes * scopes, uint32_t kind)
{
  struct fm_pool * pool = &scopes->kinds[kind].pool;
  for (uint32_t slot = 0; slot < pool->keys->end; ++slot) {
    if (fm_keys_has(pool->keys, slot) && pool->turns[slot] != pool->turn) {
      step(scopes, kind, slot, enter(scopes, kind, slot));
    }
  }
}

// Before an instance ends at the instant of the message, it takes it in the kinds with its key
// that have not, from `first` on.
static void take_in_last(
  struct fm_scopes * scopes, uint32_t kind, uint32_t slot, uint32_t first)
{
  for (uint32_t k = kind + 1u > first ? kind + 1u : first; k < scopes->n_kinds; ++k) {
    const struct fm_pool * pool = &scopes->kinds[k].pool;
    if (!fm_scopes_have_same_keys(scopes, k, kind)) {
      continue;
    } else if (pool->turns[slot] == pool->turn) {
      step_one_waiting(scopes, k, slot);
    } else if (is_for_all(scopes, k)) {
      step(scopes, k, slot, enter(scopes, k, slot));
    }
  }
}

// Take what is due in the instances of a kind at an instant, before which nothing is due. The
// kinds from `first` on take the message of this instant.
static void take_kind(struct fm_scopes * scopes, uint32_t kind, int64_t instant, uint32_t first)
{
  if (fm_scopes_has_news(scopes, kind)) {
    fm_scopes_spread_news(scopes, kind, instant);
  }
  uint32_t slot;
  while ((slot = fm_scopes_take_until_end(scopes, kind, instant)) != FM_NO_SLOT) {
    take_in_last(scopes, kind, slot, first);
    fm_scopes_end_instance(scopes, kind, slot, instant);
  }
}

static void store_in_bundle(struct fm_scopes * scopes, int64_t at)
{
  for (uint32_t n = 0; n < scopes->message.n_staged; ++n) {
    const struct fm_staged * staged = &scopes->staged[n];
    if (staged->is_usable) {
      fm_evaluator_store(scopes->bundle, staged->input, staged->value, at);
    } else {
      fm_evaluator_unusable(scopes->bundle, staged->input);
    }
  }
  fm_scopes_store_aggregates(scopes, at);
}

// Whether the bundle's scope has nothing that a message changes, but for counts.
static bool is_bundle_empty(const struct fm_scopes * scopes)
{
  const struct fm_monitor * monitor = scopes->bundle->monitor;
  return monitor->n_groups == 0 && monitor->n_inputs == 0 && scopes->n_totals == 0 &&
         scopes->options.policy != FM_TIMED;
}

static void step_bundle(struct fm_scopes * scopes)
{
  const struct fm_scopes_message * message = &scopes->message;
  if (is_bundle_empty(scopes) && !message->is_row && message->topic < scopes->options.n_topics) {
    scopes->bundle->topics[message->topic].counts.messages += 1;
    fm_scopes_report(scopes, FM_SCOPE_STEPPED, FM_BUNDLE, 0, message->instant, 0);
    return;
  }
  const int64_t at = message->instant;
  if (at != message->now) {
    fm_scopes_take_bundle(scopes, fm_later(at, -1));
  }
  store_in_bundle(scopes, at);
  const uint32_t n = message->is_row ? fm_evaluator_step(scopes->bundle, at, scopes->found) :
    fm_evaluator_message(scopes->bundle, message->topic, at, scopes->found);
  fm_scopes_report(scopes, FM_SCOPE_STEPPED, FM_BUNDLE, 0, at, n);
}

static void take_in_others(struct fm_scopes * scopes, uint32_t kind)
{
  const bool is_message = !scopes->message.is_row;
  if (is_for_all(scopes, kind)) {
    step_others(scopes, kind);
  } else if (!scopes->kinds[kind].reads_aggregates || !fm_scopes_has_news(scopes, kind)) {
    return;
  } else if (is_message && scopes->options.policy == FM_TIMED) {
    step_others(scopes, kind);  // the groups that read inputs of the topic are evaluated now
  } else {
    fm_scopes_spread_news(scopes, kind, scopes->message.reached);
  }
}

static void take_in_kind(struct fm_scopes * scopes, uint32_t kind)
{
  step_waiting(scopes, kind);
  take_in_others(scopes, kind);
}

// The kinds from `first` on and the bundle's scope take the message. `takes_due`: all that is due
// at its instant is taken with it.
static void finish(struct fm_scopes * scopes, uint32_t first, bool takes_due)
{
  scopes->message.is_put_off = false;
  for (uint32_t kind = 0; kind < scopes->n_kinds; ++kind) {
    if (kind >= first) {
      take_in_kind(scopes, kind);
    }
    if (takes_due) {
      take_kind(scopes, kind, scopes->message.now, first);
    }
  }
  step_bundle(scopes);
}

// The first kind that reads aggregates, n_kinds if none does.
static uint32_t first_reader(const struct fm_scopes * scopes)
{
  uint32_t kind = 0;
  while (kind < scopes->n_kinds && !scopes->kinds[kind].reads_aggregates) {
    kind += 1;
  }
  return kind;
}

// Whether something is due in an instance at the very instant of the message. Until the instant is
// over, another message may come before that, so that the aggregates of this instant are unknown.
static bool aggregates_are_open(struct fm_scopes * scopes)
{
  const struct fm_scopes_message * message = &scopes->message;
  bool are_open = false;
  for (uint32_t kind = 0; message->instant == message->now && kind < scopes->n_kinds; ++kind) {
    are_open = are_open ||
      fm_scopes_first_due_of(scopes, kind, message->now, false) != FM_NEVER;
  }
  return are_open;
}

int64_t fm_scopes_end(struct fm_scopes * scopes)
{
  struct fm_scopes_message * message = &scopes->message;
  const bool is_timed = scopes->options.policy == FM_TIMED;
  const bool may_be_open = is_timed && !message->is_row && scopes->n_totals > 0;
  const uint32_t first = may_be_open ? first_reader(scopes) : 0;
  step_entered(scopes);
  for (uint32_t kind = 0; kind < first; ++kind) {
    take_in_kind(scopes, kind);
  }
  if (may_be_open && aggregates_are_open(scopes)) {
    message->is_put_off = true;
  } else {
    finish(scopes, first, is_timed && message->is_row);
  }
  return message->instant;
}

// The message that was put off takes effect before another one, without what is due.
void fm_scopes_finish_early(struct fm_scopes * scopes)
{
  if (scopes->message.is_put_off) {
    finish(scopes, first_reader(scopes), false);
  }
}

static void begin(struct fm_scopes * scopes, uint32_t topic, int64_t now)
{
  struct fm_scopes_message * message = &scopes->message;
  fm_scopes_finish_early(scopes);
  message->now = now;
  message->instant = fm_evaluator_arrival(scopes->bundle, now);
  message->reached = now;
  message->topic = topic;
  message->n_staged = 0;
  message->kind = FM_BUNDLE;
  for (uint32_t k = 0; k < scopes->n_kinds; ++k) {
    fm_pool_begin_turn(&scopes->kinds[k].pool);
  }
}

void fm_scopes_begin(struct fm_scopes * scopes, uint32_t topic, int64_t now)
{
  begin(scopes, topic, now);
  scopes->message.is_row = false;
}

void fm_scopes_begin_row(struct fm_scopes * scopes, bool is_for_all, int64_t now)
{
  if (scopes->options.policy == FM_TIMED && !fm_evaluator_has_begun(scopes->bundle)) {
    fm_scopes_reach(scopes, now);
  }
  begin(scopes, 0, now);
  scopes->message.is_row = true;
  scopes->message.is_for_all = is_for_all;
}

// ---- time --------------------------------------------------------------------------------------

void fm_scopes_shift(struct fm_scopes * scopes, int64_t by)
{
  fm_scopes_finish_early(scopes);
  for (uint32_t k = 0; k < scopes->n_kinds && fm_evaluator_has_begun(scopes->bundle); ++k) {
    struct fm_pool * pool = &scopes->kinds[k].pool;
    for (uint32_t slot = 0; slot < pool->keys->end; ++slot) {
      if (fm_keys_has(pool->keys, slot)) {
        fm_pool_shift_last(pool, slot, by);
        fm_evaluator_shift(fm_scopes_enter_slot(scopes, k, slot), by);
        fm_pool_leave(pool);
      }
    }
  }
  fm_evaluator_shift(scopes->bundle, by);
}

void fm_scopes_reset(struct fm_scopes * scopes)
{
  fm_scopes_finish_early(scopes);
  for (uint32_t k = 0; k < scopes->n_kinds; ++k) {
    struct fm_pool * pool = &scopes->kinds[k].pool;
    for (uint32_t slot = 0; slot < pool->keys->end; ++slot) {
      if (fm_keys_has(pool->keys, slot)) {
        struct fm_evaluator * evaluator = fm_scopes_enter_slot(scopes, k, slot);
        fm_scopes_give_aggregates(scopes, k, fm_evaluator_now(evaluator));
        fm_evaluator_reset(evaluator);
        fm_pool_leave(pool);
        fm_scopes_uncount(scopes, k, slot);
      }
    }
    pool->overflows = 0;  // of those that had ended
    pool->is_short = false;
  }
  fm_scopes_store_aggregates(
    scopes, fm_scopes_bundle_instant(scopes, fm_evaluator_now(scopes->bundle)));
  fm_evaluator_reset(scopes->bundle);
}

// Take what is due at an instant, before which nothing is.
static void take_instant(struct fm_scopes * scopes, int64_t instant)
{
  for (uint32_t k = 0; k < scopes->n_kinds; ++k) {
    take_kind(scopes, k, instant, scopes->n_kinds);
  }
  fm_scopes_store_aggregates(scopes, fm_scopes_bundle_instant(scopes, instant));
  fm_scopes_take_bundle(scopes, instant);
}

static int64_t take_first(struct fm_scopes * scopes, int64_t now, int64_t last)
{
  const struct fm_scopes_message * message = &scopes->message;
  if (fm_goes_back(scopes->bundle, now)) {
    fm_scopes_finish_early(scopes);
  }
  fm_scopes_reach(scopes, now);
  const bool finishes = message->is_put_off && message->now <= last;
  const int64_t due = finishes ? message->now : fm_scopes_first_due(scopes, last, true);
  if (finishes) {
    finish(scopes, first_reader(scopes), true);
  } else if (due != FM_NEVER) {
    take_instant(scopes, due);
  }
  return due;
}

int64_t fm_scopes_advance(struct fm_scopes * scopes, int64_t now)
{
  return take_first(scopes, now, now);
}

int64_t fm_scopes_advance_to(struct fm_scopes * scopes, int64_t now)
{
  return take_first(scopes, now, fm_later(now, -1));
}

// ---- answers -----------------------------------------------------------------------------------

void fm_scopes_initial_from(
  struct fm_scopes * scopes, uint32_t kind, uint32_t input, const void * value)
{
  if (kind < scopes->n_kinds && input < scopes->kinds[kind].pool.evaluator->monitor->n_inputs) {
    const struct fm_monitor * monitor = scopes->kinds[kind].pool.evaluator->monitor;
    fm_scopes_initial(scopes, kind, input, value_from(monitor, input, value));
  }
}

const struct fm_stepped * fm_scopes_stepped(const struct fm_scopes * scopes, uint32_t * n)
{
  *n = scopes->n_stepped;
  return scopes->stepped;
}

void fm_scopes_clear(struct fm_scopes * scopes)
{
  scopes->n_stepped = 0;
}

const struct fm_evaluator * fm_scopes_look(
  struct fm_scopes * scopes, uint32_t kind, uint32_t slot)
{
  if (kind == FM_BUNDLE) {
    return slot == 0 ? scopes->bundle : NULL;
  }
  if (kind < scopes->n_kinds && slot == FM_NO_SLOT) {
    fm_pool_leave(&scopes->kinds[kind].pool);
    return scopes->kinds[kind].pool.evaluator;
  }
  if (kind >= scopes->n_kinds || !fm_keys_has(scopes->kinds[kind].pool.keys, slot)) {
    return NULL;
  }
  return fm_scopes_enter_slot(scopes, kind, slot);
}

double fm_scopes_take_margin(struct fm_scopes * scopes, uint32_t kind, uint32_t requirement)
{
  struct fm_pool * pool = kind < scopes->n_kinds ? &scopes->kinds[kind].pool : NULL;
  const bool is_there = pool != NULL && pool->margins != NULL &&
    requirement < pool->evaluator->monitor->n_requirements;
  return is_there ? fm_pool_take_margin(pool, requirement) : (double)NAN;
}

uint32_t fm_scopes_nearest(struct fm_scopes * scopes, uint32_t kind, uint32_t requirement)
{
  return fm_pool_nearest(&scopes->kinds[kind].pool, requirement);
}

void fm_scopes_log_closest(struct fm_scopes * scopes, struct fm_closest_log * log)
{
  scopes->closest = log;
}

struct fm_evaluator * fm_scopes_bundle(struct fm_scopes * scopes)
{
  return scopes->bundle;
}

int64_t fm_scopes_now(const struct fm_scopes * scopes)
{
  const struct fm_instance_time * time = scopes->bundle->instance.time;
  return scopes->options.policy == FM_TIMED ? time->clock : time->now;
}

const struct fm_kind * fm_scopes_kind(const struct fm_scopes * scopes, uint32_t kind)
{
  return kind < scopes->n_kinds ? &scopes->kinds[kind].options : NULL;
}

void fm_scopes_listen(struct fm_scopes * scopes, fm_scopes_sink sink, void * context)
{
  scopes->sink = sink;
  scopes->context = context;
}

size_t fm_scopes_key(
  const struct fm_scopes * scopes, uint32_t kind, uint32_t slot, uint8_t * out)
{
  return fm_scopes_next(scopes, kind, slot) != slot || slot == FM_NO_SLOT ? 0 :
         fm_keys_copy(scopes->kinds[kind].pool.keys, slot, out);
}

uint32_t fm_scopes_next(const struct fm_scopes * scopes, uint32_t kind, uint32_t slot)
{
  const struct fm_keys * keys = kind < scopes->n_kinds ? scopes->kinds[kind].pool.keys : NULL;
  while (keys != NULL && slot < keys->end) {
    if (fm_keys_has(keys, slot)) {
      return slot;
    }
    slot += 1;
  }
  return FM_NO_SLOT;
}

// The pool that has the keys of a kind.
static const struct fm_pool * base_of(const struct fm_scopes * scopes, uint32_t kind)
{
  const struct fm_scope_kind * cell = &scopes->kinds[kind];
  return cell->parts == NULL ? &cell->pool : &scopes->kinds[cell->options.base].pool;
}

struct fm_pool_counts fm_scopes_counts(const struct fm_scopes * scopes, uint32_t kind)
{
  const struct fm_pool_counts none = {0, 0, 0, 0, 0, 0, 0};
  return kind < scopes->n_kinds ? base_of(scopes, kind)->counts : none;
}

struct fm_time_counts fm_scopes_time_counts(const struct fm_scopes * scopes)
{
  struct fm_time_counts counts = fm_evaluator_time_counts(scopes->bundle);
  for (uint32_t k = 0; k < scopes->n_kinds; ++k) {
    counts.overflows += fm_pool_overflows(&scopes->kinds[k].pool);
  }
  return counts;
}

uint64_t fm_scopes_violated(
  const struct fm_scopes * scopes, uint32_t kind, uint32_t requirement)
{
  const struct fm_pool * pool = kind < scopes->n_kinds ? &scopes->kinds[kind].pool : NULL;
  if (pool == NULL || requirement >= pool->evaluator->monitor->n_requirements) {
    return 0;
  }
  const bool is_violated = !pool->evaluator->instance.previous[requirement];  // of the one entered
  return pool->violated[requirement] + (is_violated ? 1u : 0u);
}

void fm_scopes_count_unknown(struct fm_scopes * scopes)
{
  for (uint32_t k = 0; k < scopes->n_kinds; ++k) {
    fm_pool_count_unknown(&scopes->kinds[k].pool);
  }
}

// Pairs do not know what an instance of a half would, for which there was no room.
static bool half_is_short(const struct fm_scopes * scopes, const struct fm_scope_kind * cell)
{
  bool is_short = false;
  for (uint32_t h = 0; cell->pairs != NULL && h < 2; ++h) {
    const uint32_t kind = cell->options.halves[h].kind;
    is_short = is_short || (kind != FM_BUNDLE && scopes->kinds[kind].pool.is_short);
  }
  return is_short;
}

uint64_t fm_scopes_unknown(
  const struct fm_scopes * scopes, uint32_t kind, uint32_t requirement)
{
  const struct fm_pool * pool = &scopes->kinds[kind].pool;
  const bool is_unknown = pool->entered != FM_NO_SLOT &&
    !fm_is_known(&pool->evaluator->instance, requirement);
  const struct fm_pool * base = base_of(scopes, kind);
  const bool is_more = base->is_short || base->counts.begun == 0 ||
    half_is_short(scopes, &scopes->kinds[kind]);
  return pool->unknown[requirement] + (is_unknown ? 1u : 0u) + (is_more ? 1u : 0u);
}
