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

/// scopes_steps.c: what is done in one scope: an instance begins and is evaluated; a scope has new
/// values of the aggregates.

#include <string.h>

#include "due.h"
#include "scopes_parts.h"

void fm_scopes_note(
  struct fm_scopes * scopes, enum fm_scope_event event, uint32_t kind, uint32_t slot,
  int64_t instant, uint32_t n)
{
  const struct fm_stepped stepped = {instant, kind, slot, event, n};
  if (scopes->n_stepped < scopes->most_stepped) {
    scopes->stepped[scopes->n_stepped] = stepped;
    scopes->n_stepped += 1;
  }
  if (scopes->sink != NULL) {
    scopes->sink(scopes->context, &stepped, scopes->found);
  }
}

struct fm_evaluator * fm_scopes_enter_slot(
  struct fm_scopes * scopes, uint32_t kind, uint32_t slot)
{
  struct fm_pool * pool = &scopes->kinds[kind].pool;
  fm_pool_enter(pool, slot, scopes->bundle->instance.time);
  return pool->evaluator;
}

// ---- operands ----------------------------------------------------------------------------------

void fm_scopes_before_step(struct fm_scopes * scopes, uint32_t kind)
{
  const struct fm_instance_group * groups = scopes->kinds[kind].pool.evaluator->instance.groups;
  for (uint32_t a = 0; a < scopes->n_totals; ++a) {
    if (scopes->totals[a].options.kind == kind) {
      scopes->steps[a] = groups[scopes->totals[a].group].steps;
    }
  }
}

void fm_scopes_after_step(struct fm_scopes * scopes, uint32_t kind, int64_t instant)
{
  struct fm_pool * pool = &scopes->kinds[kind].pool;
  const struct fm_instance * instance = &pool->evaluator->instance;
  for (uint32_t a = 0; a < scopes->n_totals; ++a) {
    struct fm_total * total = &scopes->totals[a];
    if (total->options.kind == kind && scopes->steps[a] != instance->groups[total->group].steps) {
      fm_total_update(total, instance, pool->entered);
    }
  }
  fm_pool_draw(pool, instant);
}

void fm_scopes_uncount(struct fm_scopes * scopes, uint32_t kind, uint32_t slot)
{
  for (uint32_t a = 0; a < scopes->n_totals; ++a) {
    if (scopes->totals[a].options.kind == kind) {
      fm_total_remove(&scopes->totals[a], slot);
    }
  }
}

// ---- values of aggregates ----------------------------------------------------------------------

static void evaluate_readers(struct fm_evaluator * evaluator, uint32_t input, int64_t instant)
{
  const struct fm_input_cell * cell = &evaluator->inputs[input];
  const bool is_timed = evaluator->policy == FM_TIMED && evaluator->instance.time->has_begun;
  for (uint32_t k = 0; is_timed && k < cell->n_readers; ++k) {
    if (evaluator->instance.groups[cell->readers[k]].unset == 0) {
      fm_set_group_due(evaluator, cell->readers[k], instant);
    }
  }
}

static bool has_other(
  const struct fm_evaluator * evaluator, uint32_t input, union fm_value value)
{
  const struct fm_instance * instance = &evaluator->instance;
  const struct fm_input * about = &instance->monitor->inputs[input];
  const union fm_value own = fm_instance_value(
    (enum fm_type)about->type, (const char *)instance->values + about->offset);
  return !instance->inputs[input].has_value || memcmp(&own, &value, sizeof value) != 0;
}

static void give(
  struct fm_evaluator * evaluator, uint32_t input, struct fm_total * total, int64_t instant)
{
  union fm_value value;
  if (!fm_total_value(total, &value)) {
    fm_evaluator_withdraw(evaluator, input, instant);
  } else if (evaluator->policy == FM_ALL_INPUTS && total->is_touched) {
    fm_evaluator_store(evaluator, input, value, instant);
  } else if (has_other(evaluator, input, value)) {
    fm_evaluator_put(evaluator, input, value, instant);
    evaluate_readers(evaluator, input, instant);
  }
}

static int64_t after_last(const struct fm_evaluator * evaluator, int64_t instant)
{
  const int64_t taken = evaluator->instance.time->taken;
  return evaluator->policy != FM_TIMED || instant > taken ? instant : fm_later(taken, 1);
}

static bool reads(const struct fm_scopes * scopes, uint32_t kind, uint32_t a)
{
  return scopes->kinds[kind].copies[scopes->totals[a].options.input] != UINT32_MAX;
}

void fm_scopes_give_aggregates(struct fm_scopes * scopes, uint32_t kind, int64_t instant)
{
  const struct fm_scope_kind * cell = &scopes->kinds[kind];
  if (!cell->reads_aggregates) {
    return;
  }
  const int64_t at = after_last(cell->pool.evaluator, instant);
  for (uint32_t a = 0; a < scopes->n_totals; ++a) {
    if (reads(scopes, kind, a)) {
      struct fm_total * total = &scopes->totals[a];
      give(cell->pool.evaluator, cell->copies[total->options.input], total, at);
    }
  }
}

bool fm_scopes_has_news(struct fm_scopes * scopes, uint32_t kind)
{
  const enum fm_policy policy = scopes->options.policy;
  bool has_news = false;
  for (uint32_t a = 0; scopes->kinds[kind].reads_aggregates && a < scopes->n_totals; ++a) {
    struct fm_total * total = &scopes->totals[a];
    has_news = has_news || (reads(scopes, kind, a) &&
      ((policy == FM_ALL_INPUTS && total->is_touched) ||
      (policy == FM_TIMED && fm_total_has_changed(total))));
  }
  return has_news;
}

void fm_scopes_store_aggregates(struct fm_scopes * scopes, int64_t instant)
{
  for (uint32_t a = 0; a < scopes->n_totals; ++a) {
    struct fm_total * total = &scopes->totals[a];
    if (total->is_touched) {
      give(scopes->bundle, total->options.input, total, instant);
      total->is_touched = false;
      total->has_last = fm_total_value(total, &total->last);
    }
  }
}

// ---- an instance -------------------------------------------------------------------------------

// Of an input of the bundle's scope, or of a half, an instance that begins knows the value, and
// whether it is silent. As after a reset, a stale input makes what reads it violated anew.
static void inherit(
  const struct fm_instance * from, struct fm_evaluator * evaluator, uint32_t i, uint32_t b,
  int64_t now)
{
  static const bool NO = false;
  struct fm_instance_input * cell = &evaluator->instance.inputs[i];
  if (from->inputs[b].has_value) {
    // A reception is over, but for that of a period that is not.
    const bool is_over = evaluator->inputs[i].source == FM_RECEPTION &&
      (evaluator->policy != FM_PERIODIC || from->time->receptions_end != INT64_MAX);
    fm_evaluator_initial_from(
      evaluator, i, is_over ? (const void *)&NO :
      (const char *)from->values + from->monitor->inputs[b].offset);
  }
  cell->has_come = from->inputs[b].has_come;
  if (from->time->has_begun) {
    cell->stored_at = from->inputs[b].stored_at;
    cell->is_silent = from->inputs[b].is_silent;
    cell->is_put_off = from->inputs[b].is_put_off;
    cell->is_stale = from->inputs[b].is_stale;
    fm_set_due(evaluator, i, cell->is_stale ? now : from->inputs[b].due);
  }
  for (uint32_t k = 0; cell->is_stale && k < evaluator->inputs[i].n_readers; ++k) {
    evaluator->instance.groups[evaluator->inputs[i].readers[k]].stale += 1;
  }
}

static void inherit_of_halves(
  struct fm_scopes * scopes, uint32_t kind, uint32_t slot, int64_t now)
{
  struct fm_scope_kind * cell = &scopes->kinds[kind];
  uint8_t bytes[FM_MOST_KEY_BYTES];
  const struct fm_key pair = {bytes, (uint32_t)fm_keys_copy(cell->pool.keys, slot, bytes)};
  for (uint32_t h = 0; h < 2; ++h) {
    const struct fm_half * half = &cell->options.halves[h];
    const struct fm_key key = fm_pair_part(&pair, h);
    const uint32_t own = half->kind == FM_BUNDLE ? FM_NO_SLOT :
      fm_keys_find(scopes->kinds[half->kind].pool.keys, key.bytes, key.size);
    if (own == FM_NO_SLOT) {
      continue;
    }
    const struct fm_evaluator * from = fm_scopes_enter_slot(scopes, half->kind, own);
    for (uint32_t i = 0; i < cell->pool.evaluator->monitor->n_inputs; ++i) {
      if (half->inputs[i] != UINT32_MAX) {
        inherit(&from->instance, cell->pool.evaluator, i, half->inputs[i], now);
      }
    }
    fm_pool_leave(&scopes->kinds[half->kind].pool);
  }
}

static void begin_in(struct fm_scopes * scopes, uint32_t kind, uint32_t slot, int64_t now)
{
  struct fm_scope_kind * cell = &scopes->kinds[kind];
  const struct fm_instance_time * time = scopes->bundle->instance.time;
  fm_pool_begin(&cell->pool, slot);
  struct fm_evaluator * evaluator = fm_scopes_enter_slot(scopes, kind, slot);
  if (time->has_begun) {
    (void)fm_reach(evaluator, now);
    fm_set_period_due(evaluator, time->next_period);
  }
  for (uint32_t i = 0; i < evaluator->monitor->n_inputs; ++i) {
    if (cell->options.shared[i] != UINT32_MAX) {
      inherit(&scopes->bundle->instance, evaluator, i, cell->options.shared[i], now);
    }
  }
  if (cell->pairs != NULL) {
    inherit_of_halves(scopes, kind, slot, now);
  }
  fm_scopes_report(scopes, FM_SCOPE_BEGAN, kind, slot, now, 0);
}

void fm_scopes_begin_instance(
  struct fm_scopes * scopes, uint32_t kind, uint32_t slot, int64_t now)
{
  for (uint32_t k = kind; k < scopes->n_kinds; ++k) {
    if (scopes->kinds[k].pool.keys == scopes->kinds[kind].pool.keys) {
      begin_in(scopes, k, slot, now);
    }
  }
}

void fm_scopes_take_due_of(struct fm_scopes * scopes, uint32_t kind, int64_t last)
{
  const struct fm_pool * pool = &scopes->kinds[kind].pool;
  const uint32_t slot = pool->entered;
  struct fm_evaluator * evaluator = pool->evaluator;
  while (evaluator->wake <= last) {
    const int64_t due = fm_evaluator_deadline(evaluator);
    if (due > last || due == FM_NEVER) {
      return;
    }
    if (scopes->options.policy != FM_ALL_INPUTS) {  // nothing steps then
      fm_scopes_give_aggregates(scopes, kind, due);
    }
    fm_scopes_before_step(scopes, kind);
    const uint32_t n = fm_take_first_due(evaluator, last, scopes->found);
    fm_scopes_after_step(scopes, kind, due);
    fm_scopes_report(scopes, FM_SCOPE_STEPPED, kind, slot, due, n);
    evaluator = fm_scopes_enter_slot(scopes, kind, slot);  // the sink may have looked elsewhere
  }
}

// ---- the bundle's scope ------------------------------------------------------------------------

int64_t fm_scopes_bundle_instant(const struct fm_scopes * scopes, int64_t instant)
{
  return after_last(scopes->bundle, instant);
}

void fm_scopes_take_bundle(struct fm_scopes * scopes, int64_t last)
{
  while (scopes->bundle->wake <= last) {
    const int64_t due = fm_evaluator_deadline(scopes->bundle);
    if (due > last || due == FM_NEVER) {
      return;
    }
    const uint32_t n = fm_take_first_due(scopes->bundle, last, scopes->found);
    fm_scopes_report(scopes, FM_SCOPE_STEPPED, FM_BUNDLE, 0, due, n);
  }
}
