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

/// snapshot.c: see snapshot.h for the contract.

#define _POSIX_C_SOURCE 200809L

#include "snapshot.h"

#include <string.h>

#include "engine_parts.h"
#include "tables.h"
#include "thread.h"

static void copy_requirements_locked(struct fm_engine * engine, struct fm_snapshot * out)
{
  for (uint32_t r = 0; r < engine->options.monitor->n_requirements; ++r) {
    struct fm_requirement_counts * counts = &out->requirements[r];
    *counts = fm_evaluator_requirement_counts(engine->options.evaluator, r);
    if (engine->gate != NULL) {
      counts->is_violated = counts->is_violated || engine->are_violated[r];
    }
  }
}

// ---- instances ---------------------------------------------------------------------------------

static void add_key(
  struct fm_named_keys * named, const struct fm_scopes * scopes, uint32_t kind, uint32_t slot)
{
  named->n += 1;
  if (named->n_keys < FM_MOST_NAMED_KEYS) {
    uint8_t * key = named->keys[named->n_keys];
    key[0] = (uint8_t)fm_scopes_key(scopes, kind, slot, key + 1);
    named->n_keys += 1;
  }
}

// Of an instance that was entered.
static void name_instance(
  struct fm_scopes * scopes, uint32_t kind, uint32_t slot, uint32_t n_requirements,
  struct fm_kind_snapshot * out)
{
  const struct fm_evaluator * evaluator = fm_scopes_look(scopes, kind, slot);
  const bool is_listed = fm_scopes_kind(scopes, kind)->n_listed > 0;
  for (uint32_t r = 0; r < n_requirements; ++r) {
    const uint32_t group = evaluator->monitor->requirements[r].group;
    if (!evaluator->instance.previous[r]) {
      add_key(&out->violated[r], scopes, kind, slot);
    }
    if (is_listed && evaluator->instance.groups[group].steps == 0) {
      add_key(&out->unevaluated[r], scopes, kind, slot);
    }
  }
}

static bool are_worth_naming(
  const struct fm_scopes * scopes, uint32_t kind, uint32_t n_requirements)
{
  bool is_violated = false;
  for (uint32_t r = 0; r < n_requirements; ++r) {
    is_violated = is_violated || fm_scopes_violated(scopes, kind, r) > 0;
  }
  return is_violated || fm_scopes_kind(scopes, kind)->n_listed > 0;
}

static void copy_instances_locked(
  struct fm_scopes * scopes, uint32_t kind, uint32_t n_requirements,
  struct fm_kind_snapshot * out)
{
  memset(out->violated, 0, n_requirements * sizeof(*out->violated));
  memset(out->unevaluated, 0, n_requirements * sizeof(*out->unevaluated));
  if (!are_worth_naming(scopes, kind, n_requirements)) {
    return;
  }
  for (uint32_t slot = fm_scopes_next(scopes, kind, 0); slot != FM_NO_SLOT;
    slot = fm_scopes_next(scopes, kind, slot + 1u))
  {
    name_instance(scopes, kind, slot, n_requirements, out);
  }
}

static bool is_of_occurrences(const struct fm_kind * kind, uint32_t requirement)
{
  return kind->options->reports != NULL && kind->options->reports[requirement] == FM_OCCURRENCE;
}

// Of all instances: no violation goes on, and with FM_OCCURRENCE, `H p` holds.
static void copy_verdicts_locked(
  struct fm_scopes * scopes, uint32_t kind, uint32_t n_requirements,
  struct fm_requirement_counts * out)
{
  const struct fm_kind * options = fm_scopes_kind(scopes, kind);
  bool is_any = false;
  for (uint32_t r = 0; r < n_requirements; ++r) {
    out[r].is_violated = fm_scopes_violated(scopes, kind, r) > 0;
    out[r].verdict = !out[r].is_violated;
    is_any = is_any || is_of_occurrences(options, r);
  }
  for (uint32_t slot = is_any ? fm_scopes_next(scopes, kind, 0) : FM_NO_SLOT;
    slot != FM_NO_SLOT; slot = fm_scopes_next(scopes, kind, slot + 1u))
  {
    const bool * verdicts = fm_evaluator_verdicts(fm_scopes_look(scopes, kind, slot));
    for (uint32_t r = 0; r < n_requirements; ++r) {
      out[r].verdict = out[r].verdict && (verdicts[r] || !is_of_occurrences(options, r));
    }
  }
}

// The least margin of all instances, and whose it is.
static void copy_nearest_locked(
  struct fm_scopes * scopes, uint32_t kind, uint32_t requirement, struct fm_kind_snapshot * out,
  struct fm_margin * margin)
{
  const uint32_t slot = fm_scopes_nearest(scopes, kind, requirement);
  out->nearest[requirement].n = out->nearest[requirement].n_keys = 0;
  if (slot != FM_NO_SLOT) {
    add_key(&out->nearest[requirement], scopes, kind, slot);
    *margin = fm_margin_now(fm_scopes_look(scopes, kind, slot), requirement);
  }
}

static void copy_inputs(const struct fm_evaluator * evaluator, struct fm_input_snapshot * inputs)
{
  for (uint32_t i = 0; i < evaluator->monitor->n_inputs; ++i) {
    inputs[i] = (struct fm_input_snapshot) {
      fm_evaluator_input_counts(evaluator, i), fm_evaluator_silence(evaluator, i),
      fm_evaluator_has_value(evaluator, i)};
  }
}

static void copy_kinds_locked(struct fm_engine * engine, struct fm_snapshot * out)
{
  struct fm_scopes * scopes = engine->options.scopes;
  for (uint32_t k = 0; out->kinds != NULL && k < engine->n_kinds; ++k) {
    const uint32_t first = engine->numbers[k];
    const uint32_t n = engine->numbers[k + 1u] - first;
    out->kinds[k].counts = fm_scopes_counts(scopes, k);
    copy_instances_locked(scopes, k, n, &out->kinds[k]);
    const struct fm_evaluator * all = fm_scopes_look(scopes, k, FM_NO_SLOT);
    for (uint32_t r = 0; r < n; ++r) {
      out->requirements[first + r] = fm_evaluator_requirement_counts(all, r);
    }
    copy_verdicts_locked(scopes, k, n, &out->requirements[first]);
    copy_inputs(all, out->kinds[k].inputs);
    for (uint32_t r = 0; r < n; ++r) {
      copy_nearest_locked(
        scopes, k, r, &out->kinds[k], &out->requirements[first + r].margin);
    }
  }
}

// ---- the bundle's scope, and topics ------------------------------------------------------------

static void copy_topics_locked(struct fm_engine * engine, struct fm_snapshot * out)
{
  for (uint32_t t = 0; t < engine->options.n_topics; ++t) {
    struct fm_engine_topic * topic = &engine->topics[t];
    out->topics[t] = (struct fm_topic_snapshot) {
      fm_evaluator_topic_counts(engine->options.evaluator, t), topic->counts,
      topic->observed, fm_arrivals_lost(&topic->arrivals), topic->behind};
    out->topics[t].counts.messages += topic->links;
    topic->behind = 0;
  }
}

static void copy_conditions_locked(struct fm_engine * engine, struct fm_snapshot * out)
{
  struct fm_states * states = &engine->states;
  fm_engine_look_for_hang_locked(engine);
  fm_engine_update_states_locked(engine);
  memcpy(out->conditions, fm_states_conditions(states), states->condition_bytes);
  out->n_changes = 0;
  out->missed = 0;
  while (out->changes != NULL && fm_states_take_conditions(
      states, out->changes + out->n_changes * states->condition_bytes, &out->missed))
  {
    out->n_changes += 1u;
  }
}

void fm_engine_snapshot(struct fm_engine * engine, struct fm_snapshot * out)
{
  const struct fm_gate_counts none = {.holds = true};
  const struct fm_tree_counts no_links = {0, 0, 0};
  fm_engine_catch_up_if_free(engine);
  fm_engine_lock(engine);
  copy_conditions_locked(engine, out);
  copy_requirements_locked(engine, out);
  copy_kinds_locked(engine, out);
  copy_inputs(engine->options.evaluator, out->inputs);
  copy_topics_locked(engine, out);
  out->time = engine->options.scopes == NULL ?
    fm_evaluator_time_counts(engine->options.evaluator) :
    fm_scopes_time_counts(engine->options.scopes);
  out->links = engine->tree == NULL ? no_links : fm_tree_left_out(engine->tree);
  out->gate = engine->gate == NULL ? none : fm_gate_counts(engine->gate, fm_steady_time());
  out->unpublished = engine->outbox.unpublished;
  fm_engine_unlock(engine);
}
