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

static void copy_inputs_locked(struct fm_engine * engine, struct fm_snapshot * out)
{
  const struct fm_evaluator * evaluator = engine->options.evaluator;
  for (uint32_t i = 0; i < engine->options.monitor->n_inputs; ++i) {
    out->inputs[i] = (struct fm_input_snapshot) {
      fm_evaluator_input_counts(evaluator, i), fm_evaluator_silence(evaluator, i),
      fm_evaluator_has_value(evaluator, i)};
  }
}

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
  copy_inputs_locked(engine, out);
  copy_topics_locked(engine, out);
  out->time = fm_evaluator_time_counts(engine->options.evaluator);
  out->links = engine->tree == NULL ? no_links : fm_tree_left_out(engine->tree);
  out->gate = engine->gate == NULL ? none : fm_gate_counts(engine->gate, fm_steady_time());
  out->unpublished = engine->outbox.unpublished;
  fm_engine_unlock(engine);
}
