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

/// engine_findings.c: violations into the queue, states and conditions for those who follow them.

#define _POSIX_C_SOURCE 200809L

#include "engine_parts.h"

#include <string.h>

#include "instance.h"
#include "thread.h"

void fm_engine_begin_violation_locked(struct fm_engine * engine, uint32_t requirement)
{
  if (engine->blackbox != NULL || engine->has_states || engine->gate != NULL) {
    fm_states_begin_violation(&engine->states, requirement);
  }
  if (engine->blackbox != NULL) {
    fm_blackbox_note(engine->blackbox, requirement, fm_steady_time());
  }
}

// Note one that begins: a requirement may be violated at each step for hours. Of instances, the
// scopes know how many violate it.
static void note_occurrence_locked(struct fm_engine * engine, const struct fm_violation * found)
{
  const uint32_t requirement = found->requirement;
  if (requirement >= engine->options.monitor->n_requirements) {
    return;
  }
  if (!found->is_recovery && !engine->are_violated[requirement]) {
    fm_engine_begin_violation_locked(engine, requirement);
  }
  engine->are_violated[requirement] = !found->is_recovery;
}

void fm_engine_note_instance_locked(
  struct fm_engine * engine, uint32_t requirement, bool begins,
  const struct fm_outbox_scope * scope)
{
  if (engine->follows_instances) {
    const struct fm_violation event = {.requirement = requirement, .is_recovery = !begins};
    fm_outbox_add(&engine->instances, &event, scope);
    engine->states.changes += 1;  // wakes who takes it
  }
}

void fm_engine_end_instances_locked(struct fm_engine * engine)
{
  const struct fm_outbox_scope all = {NULL, NULL, {NULL, 0}, 0, 0};
  fm_engine_note_instance_locked(engine, engine->n_requirements, false, &all);
}

void fm_engine_note_conditions_locked(struct fm_engine * engine)
{
  bool is_known = false;
  bool is_latched = false;
  if (engine->gate != NULL) {
    const struct fm_gate_counts counts = fm_gate_counts(engine->gate, fm_steady_time());
    is_known = counts.is_known;
    is_latched = counts.is_latched;
  }
  fm_states_note_conditions(
    &engine->states, engine->options.evaluator, engine->options.monitor, is_known, is_latched);
}

// Of instances: violated while one violates it, and not known while it is not known of one.
static void update_instances_locked(struct fm_engine * engine)
{
  for (uint32_t k = 0; k < engine->n_kinds; ++k) {
    for (uint32_t n = engine->numbers[k]; n < engine->numbers[k + 1u]; ++n) {
      const uint32_t r = n - engine->numbers[k];
      fm_states_set(
        &engine->states, n, engine->n_violated[n] > 0 ? FM_VIOLATED :
        fm_scopes_unknown(engine->options.scopes, k, r) > 0 ? FM_UNKNOWN : FM_HOLDS);
    }
  }
}

void fm_engine_update_states_locked(struct fm_engine * engine)
{
  if (engine->has_states) {
    fm_states_update(
      &engine->states, engine->options.evaluator, engine->options.monitor, engine->are_violated);
    update_instances_locked(engine);
  }
  if (engine->has_states || engine->gate != NULL) {
    fm_engine_note_conditions_locked(engine);
  }
  if (engine->states.changes != engine->noted_changes) {
    engine->noted_changes = engine->states.changes;
    pthread_cond_signal(&engine->violation_queued);
    pthread_cond_broadcast(&engine->state_changed);
  }
}

void fm_engine_queue_of_locked(
  struct fm_engine * engine, const struct fm_violation * found, uint32_t n,
  const struct fm_outbox_scope * scope)
{
  const uint32_t n_details = engine->outbox.n_details;
  for (uint32_t k = 0; k < n; ++k) {
    struct fm_violation violation = found[k];
    violation.stamp = fm_later(violation.stamp, scope->later);
    violation.requirement += scope->first;
    fm_outbox_add(&engine->outbox, &violation, scope);
    note_occurrence_locked(engine, &violation);
  }
  pthread_cond_signal(&engine->violation_queued);
  if (engine->outbox.n_details != n_details) {
    pthread_cond_signal(&engine->detail_queued);
  }
}

void fm_engine_queue_locked(struct fm_engine * engine, uint32_t n, int64_t later)
{
  const struct fm_outbox_scope scope =
  {engine->options.evaluator, engine->options.monitor, {NULL, 0}, 0, later};
  if (n > 0) {
    fm_engine_queue_of_locked(engine, engine->found, n, &scope);
  }
}

uint32_t fm_engine_note_gate_locked(struct fm_engine * engine, uint32_t n)
{
  if (engine->gate != NULL &&
    fm_gate_note(engine->gate, engine->found, &n, fm_steady_time()) &&
    engine->on_due != NULL)
  {
    engine->on_due(engine->on_due_argument);
  }
  return n;
}

void fm_engine_announce_locked(struct fm_engine * engine, uint32_t n, int64_t later)
{
  fm_engine_queue_locked(engine, fm_engine_note_gate_locked(engine, n), later);
  fm_engine_update_states_locked(engine);
}

void fm_engine_forget_violations_locked(struct fm_engine * engine)
{
  memset(engine->are_violated, 0, engine->n_requirements);
  memset(engine->n_violated, 0, engine->n_requirements * sizeof(*engine->n_violated));
  fm_engine_end_instances_locked(engine);
  if (engine->gate != NULL) {
    fm_gate_forget_violations(engine->gate);
  }
}

void fm_engine_look_for_hang_locked(struct fm_engine * engine)
{
  if (engine->gate != NULL) {
    fm_gate_note_hang(engine->gate, fm_engine_hangs_locked(engine, FM_HANG_NS));
    (void)fm_engine_note_gate_locked(engine, 0);
    fm_engine_update_states_locked(engine);
  }
}
