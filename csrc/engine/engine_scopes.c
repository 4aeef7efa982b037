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

/// engine_scopes.c: messages and deadlines of a bundle with instances, and what they report.
/// Without instances, what is due in the evaluator.

#define _POSIX_C_SOURCE 200809L

#include "engine_parts.h"

#include <stdlib.h>

#include "due.h"
#include "steps.h"

// ---- what instances report ---------------------------------------------------------------------

static const struct fm_monitor * monitor_of(const struct fm_engine * engine, uint32_t kind)
{
  return kind == FM_BUNDLE ? engine->options.monitor :
         fm_scopes_kind(engine->options.scopes, kind)->options->monitor;
}

static uint32_t first_number(const struct fm_engine * engine, uint32_t kind)
{
  return kind == FM_BUNDLE ? 0 : engine->numbers[kind];
}

static int64_t later_locked(struct fm_engine * engine)
{
  return engine->later == FM_NEVER ? fm_engine_stamps_ahead_locked(engine) : engine->later;
}

// That of a requirement of instances goes on while one violates it.
static void note_violated_locked(
  struct fm_engine * engine, uint32_t requirement, uint64_t n,
  const struct fm_outbox_scope * scope)
{
  const bool begins = n > engine->n_violated[requirement];
  if (begins) {
    fm_engine_begin_violation_locked(engine, requirement);
  }
  if (n != engine->n_violated[requirement]) {
    fm_engine_note_instance_locked(engine, requirement, begins, scope);
  }
  engine->n_violated[requirement] = n;
  engine->are_violated[requirement] = n > 0;
}

// The scope of a step, with its key, which is copied.
static struct fm_outbox_scope scope_of(
  struct fm_engine * engine, const struct fm_stepped * stepped,
  uint8_t key[FM_MOST_KEY_BYTES])
{
  struct fm_scopes * scopes = engine->options.scopes;
  const size_t size = stepped->kind == FM_BUNDLE ? 0 :
    fm_scopes_key(scopes, stepped->kind, stepped->slot, key);
  return (struct fm_outbox_scope) {
    fm_scopes_look(scopes, stepped->kind, stepped->slot), monitor_of(engine, stepped->kind),
    {key, (uint32_t)size}, first_number(engine, stepped->kind), later_locked(engine)};
}

// Queue violations of a scope.
static void queue_of_scope_locked(
  struct fm_engine * engine, const struct fm_stepped * stepped,
  const struct fm_violation * violations, uint32_t n)
{
  struct fm_scopes * scopes = engine->options.scopes;
  uint8_t key[FM_MOST_KEY_BYTES];
  const struct fm_outbox_scope scope = scope_of(engine, stepped, key);
  fm_engine_queue_of_locked(engine, violations, n, &scope);
  for (uint32_t k = 0; stepped->kind != FM_BUNDLE && k < n; ++k) {
    const uint32_t r = violations[k].requirement;
    note_violated_locked(
      engine, scope.first + r, fm_scopes_violated(scopes, stepped->kind, r), &scope);
  }
}

// The violations of an instance end with it.
static void end_violations_locked(struct fm_engine * engine, const struct fm_stepped * stepped)
{
  uint8_t key[FM_MOST_KEY_BYTES];
  const struct fm_outbox_scope scope = scope_of(engine, stepped, key);
  const struct fm_evaluator * ended = scope.evaluator;
  for (uint32_t r = 0; scope.first + r < engine->numbers[stepped->kind + 1]; ++r) {
    if (!ended->instance.previous[r]) {
      const uint32_t group = ended->monitor->requirements[r].group;
      const struct fm_violation end = {
        fm_number_at(ended, group, stepped->instant), stepped->instant, r, true, false, true};
      if (ended->reports_recoveries) {
        queue_of_scope_locked(engine, stepped, &end, 1);
      }
      note_violated_locked(
        engine, scope.first + r,
        fm_scopes_violated(engine->options.scopes, stepped->kind, r) - 1u, &scope);
    }
  }
}

static void take_event(
  void * context, const struct fm_stepped * stepped, const struct fm_violation * violations)
{
  struct fm_engine * engine = context;
  if (stepped->event == FM_SCOPE_STEPPED && stepped->n_violations > 0) {
    queue_of_scope_locked(engine, stepped, violations, stepped->n_violations);
  } else if (stepped->event == FM_SCOPE_ENDED) {
    end_violations_locked(engine, stepped);
  }
}

// ---- details -----------------------------------------------------------------------------------

struct fm_detail_scope fm_engine_detail_scope(
  const struct fm_engine * engine, const struct fm_detail * detail)
{
  const uint32_t requirement = detail->violation.requirement;
  uint32_t kind = 0;
  if (requirement < engine->numbers[0]) {
    return (struct fm_detail_scope) {engine->options.monitor, FM_BUNDLE, NULL, 0};
  }
  while (requirement >= engine->numbers[kind + 1]) {
    kind += 1;
  }
  const struct fm_monitor * monitor = monitor_of(engine, kind);
  const uint8_t * key =
    (const uint8_t *)detail + sizeof(*detail) + monitor->inputs_bytes + monitor->n_inputs;
  return (struct fm_detail_scope) {monitor, kind, key + 1, key[0]};
}

// ---- making ------------------------------------------------------------------------------------

// Operands of aggregates come last, and have no number.
static uint32_t count_reported(const struct fm_evaluator_options * options)
{
  uint32_t n = 0;
  while (n < options->monitor->n_requirements &&
    (options->reports == NULL || options->reports[n] != FM_UNREPORTED))
  {
    n += 1;
  }
  return n;
}

static bool kind_fits(const struct fm_engine * engine, const struct fm_kind * kind)
{
  return engine->options.n_topics == 0 ||
         (kind->options->n_topics == engine->options.n_topics && kind->keyed != NULL &&
         kind->concerns != NULL);
}

bool fm_engine_number_scopes(struct fm_engine * engine)
{
  struct fm_scopes * scopes = engine->options.scopes;
  uint32_t n_kinds = 0;
  while (scopes != NULL && fm_scopes_kind(scopes, n_kinds) != NULL) {
    n_kinds += 1;
  }
  engine->numbers = calloc(n_kinds + (size_t)1, sizeof(*engine->numbers));
  if (engine->numbers == NULL) {
    return false;
  }
  engine->numbers[0] = engine->options.monitor->n_requirements;
  for (uint32_t k = 0; k < n_kinds; ++k) {
    const struct fm_kind * kind = fm_scopes_kind(scopes, k);
    if (!kind_fits(engine, kind)) {
      return false;
    }
    engine->numbers[k + 1] = engine->numbers[k] + count_reported(kind->options);
  }
  engine->n_kinds = n_kinds;
  engine->n_requirements = engine->numbers[n_kinds];
  if (scopes != NULL) {
    fm_scopes_listen(scopes, take_event, engine);
  }
  return true;
}

// ---- messages ----------------------------------------------------------------------------------

static void store_shared_locked(struct fm_engine * engine, const struct fm_delivery * delivery)
{
  const struct fm_topic * fed = &engine->options.topics[delivery->topic];
  for (uint32_t k = 0; k < fed->n_inputs; ++k) {
    if (delivery->fields[k].outcome == FM_FIELD_READ) {
      fm_scopes_store(engine->options.scopes, fed->inputs[k], delivery->fields[k].value);
    } else {
      fm_scopes_unusable(engine->options.scopes, fed->inputs[k]);
    }
  }
}

static void store_part_locked(
  struct fm_engine * engine, const struct fm_topic * fed, const struct fm_field * fields)
{
  const struct fm_delivery * delivery = engine->delivery;
  for (uint32_t k = 0; k < fed->n_inputs; ++k) {
    if (fields[k].outcome == FM_FIELD_READ) {
      fm_scopes_store_keyed(engine->options.scopes, fed->inputs[k], fields[k].value);
    } else {
      fm_scopes_unusable_keyed(engine->options.scopes, fed->inputs[k]);
      fm_engine_keep_evidence_locked(
        engine, delivery->topic, delivery->message, delivery->size);
    }
  }
}

static void take_part(
  void * context, uint32_t kind, const uint8_t * key, size_t key_size,
  const struct fm_field * fields)
{
  struct fm_engine * engine = context;
  const struct fm_kind * options = fm_scopes_kind(engine->options.scopes, kind);
  const uint32_t topic = engine->delivery->topic;
  if (options != NULL &&
    fm_scopes_enter(engine->options.scopes, kind, key, key_size) != FM_NO_SLOT)
  {
    const struct fm_topic * fed = &options->keyed[topic];
    const uint8_t * sources = options->options->sources;
    store_part_locked(
      engine, fed, sources == NULL ? fields :
      fm_engine_prepare_inputs_locked(engine, fed, sources, fields, engine->delivery->received));
  }
}

int64_t fm_engine_step_scopes_locked(
  struct fm_engine * engine, const struct fm_delivery * delivery, int64_t now, int64_t later)
{
  const struct fm_reader * reader = fm_engine_reader(engine, delivery->topic);
  engine->later = later;
  engine->delivery = delivery;
  fm_scopes_begin(engine->options.scopes, delivery->topic, now);
  store_shared_locked(engine, delivery);
  if (reader->parts != NULL) {
    (void)reader->parts(
      delivery->message, delivery->size, delivery->key, delivery->key_size, take_part, engine);
  }
  const int64_t taken = fm_scopes_end(engine->options.scopes);
  engine->delivery = NULL;
  engine->later = FM_NEVER;
  fm_engine_update_states_locked(engine);
  return taken;
}

// ---- time --------------------------------------------------------------------------------------

// Under FM_TIMED time that goes back lets all groups start afresh.
static void note_restart_locked(struct fm_engine * engine, int64_t now)
{
  if (fm_goes_back(engine->options.evaluator, now) &&
    fm_evaluator_is_timed(engine->options.evaluator))
  {
    fm_scopes_finish_early(engine->options.scopes);
    fm_engine_forget_violations_locked(engine);
  }
}

void fm_engine_advance_scopes_locked(struct fm_engine * engine, int64_t now, bool stands)
{
  struct fm_scopes * scopes = engine->options.scopes;
  note_restart_locked(engine, now);
  while ((stands ? fm_scopes_advance_to(scopes, now) : fm_scopes_advance(scopes, now)) !=
    FM_NEVER)
  {
  }
  fm_engine_update_states_locked(engine);
}

int64_t fm_engine_wakes_at_locked(const struct fm_engine * engine)
{
  return engine->options.scopes == NULL ? fm_evaluator_wake(engine->options.evaluator) :
         fm_scopes_wake(engine->options.scopes);
}

int64_t fm_engine_next_due_locked(struct fm_engine * engine)
{
  return engine->options.scopes == NULL ? fm_evaluator_deadline(engine->options.evaluator) :
         fm_scopes_deadline(engine->options.scopes);
}

void fm_engine_shift_locked(struct fm_engine * engine, int64_t by)
{
  if (engine->options.scopes == NULL) {
    fm_evaluator_shift(engine->options.evaluator, by);
  } else {
    fm_scopes_shift(engine->options.scopes, by);
  }
}

void fm_engine_reset_locked(struct fm_engine * engine)
{
  if (engine->options.scopes == NULL) {
    fm_evaluator_reset(engine->options.evaluator);
  } else {
    fm_scopes_reset(engine->options.scopes);
  }
}
