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

/// engine.c: see engine.h for the contract.
///
/// One mutex guards the whole struct. Functions whose names end in _locked need it held.

#define _POSIX_C_SOURCE 200809L

#include "engine_parts.h"

#include <stdlib.h>
#include <string.h>

#include "instance.h"
#include "thread.h"

#define MILLISECOND_NS 1000000

uint32_t fm_engine_abi(void) {return FM_ENGINE_ABI;}

// ---- making ------------------------------------------------------------------------------------

static uint32_t most_inputs(const struct fm_engine_options * options)
{
  uint32_t most = 1;
  for (uint32_t t = 0; t < options->n_topics; ++t) {
    most = options->topics[t].n_inputs > most ? options->topics[t].n_inputs : most;
  }
  struct fm_scopes * scopes = options->scopes;
  for (uint32_t k = 0; scopes != NULL && fm_scopes_kind(scopes, k) != NULL; ++k) {
    const uint32_t n = fm_scopes_kind(options->scopes, k)->options->monitor->n_inputs;
    most = n > most ? n : most;
  }
  return most;
}

static bool readers_fit(const struct fm_engine_options * options)
{
  if (options->n_topics == 0) {
    return true;
  }
  const struct fm_readers * readers = options->readers;
  if (readers == NULL || readers->abi != FM_ABI || readers->n_topics != options->n_topics) {
    return false;
  }
  for (uint32_t t = 0; t < options->n_topics; ++t) {
    if (readers->topics[t].n_inputs != options->topics[t].n_inputs ||
      (options->uses_header_stamps && readers->topics[t].stamp == NULL))
    {
      return false;
    }
  }
  return true;
}

static bool make_mutexes(struct fm_engine * engine)
{
  if (pthread_mutex_init(&engine->mutex, NULL) != 0) {
    return false;
  }
  if (pthread_mutex_init(&engine->catching, NULL) != 0) {
    pthread_mutex_destroy(&engine->mutex);
    return false;
  }
  return true;
}

static bool make_locks(struct fm_engine * engine)
{
  pthread_cond_t * const conditions[] = {
    &engine->violation_queued, &engine->detail_queued, &engine->state_changed,
    &engine->turn_ended};
  const uint32_t n = sizeof(conditions) / sizeof(conditions[0]);
  uint32_t n_made = 0;
  if (!make_mutexes(engine)) {
    return false;
  }
  while (n_made < n && fm_make_condition(conditions[n_made])) {
    n_made += 1;
  }
  for (uint32_t k = 0; n_made < n && k < n_made; ++k) {
    pthread_cond_destroy(conditions[k]);
  }
  if (n_made < n) {
    pthread_mutex_destroy(&engine->mutex);
    pthread_mutex_destroy(&engine->catching);
  }
  return n_made == n;
}

static uint64_t bytes_of_inputs(const struct fm_monitor * monitor)
{
  return monitor->inputs_bytes + monitor->n_inputs;
}

static struct fm_outbox_size size_of_outbox(const struct fm_engine * engine)
{
  uint64_t most = bytes_of_inputs(engine->options.monitor);
  for (uint32_t k = 0; k < engine->n_kinds; ++k) {
    const struct fm_kind * kind = fm_scopes_kind(engine->options.scopes, k);
    const uint64_t bytes = bytes_of_inputs(kind->options->monitor);
    most = bytes > most ? bytes : most;
  }
  return (struct fm_outbox_size) {engine->n_requirements, most, engine->options.scopes != NULL};
}

static bool make_memory(struct fm_engine * engine)
{
  const struct fm_engine_options * options = &engine->options;
  engine->fields = calloc(most_inputs(options), sizeof(struct fm_field));
  engine->prepared = calloc(most_inputs(options), sizeof(struct fm_field));
  engine->found =
    calloc(options->monitor->n_requirements + (size_t)1, sizeof(struct fm_violation));
  // One more: of a gate whose topic feeds no input.
  engine->topics = calloc(options->n_topics + (size_t)1, sizeof(struct fm_engine_topic));
  engine->are_violated =
    calloc(engine->n_requirements + (size_t)1, sizeof(*engine->are_violated));
  engine->n_violated = calloc(engine->n_requirements + (size_t)1, sizeof(*engine->n_violated));
  const struct fm_outbox_size size = size_of_outbox(engine);
  return fm_outbox_init(&engine->outbox, &size) && engine->fields != NULL &&
         engine->prepared != NULL && engine->found != NULL && engine->topics != NULL &&
         engine->are_violated != NULL && engine->n_violated != NULL &&
         fm_states_init(&engine->states, engine->n_requirements, options->monitor->n_inputs) &&
         (!fm_evaluator_is_timed(options->evaluator) || !options->uses_header_stamps ||
         fm_reorder_init(&engine->waiting, most_inputs(options)));
}

static void free_memory(struct fm_engine * engine)
{
  for (uint32_t t = 0; engine->topics != NULL && t <= engine->options.n_topics; ++t) {
    fm_arrivals_end_handover(&engine->topics[t].arrivals);
    free(engine->topics[t].evidence);
  }
  fm_engine_free_transforms(engine);
  fm_engine_free_derived(engine);
  fm_outbox_free(&engine->outbox);
  fm_outbox_free(&engine->instances);
  fm_reorder_free(&engine->waiting);
  free(engine->fields);
  free(engine->prepared);
  free(engine->found);
  free(engine->topics);
  free(engine->are_violated);
  free(engine->n_violated);
  free(engine->numbers);
  fm_states_free(&engine->states);
  free(engine);
}

static void find_sources(struct fm_engine * engine)
{
  const struct fm_engine_options * options = &engine->options;
  for (uint32_t t = 0; options->sources != NULL && t < options->n_topics; ++t) {
    for (uint32_t k = 0; k < options->topics[t].n_inputs; ++k) {
      engine->topics[t].has_sources = engine->topics[t].has_sources ||
        options->sources[options->topics[t].inputs[k]] != FM_FIELD;
    }
  }
}

struct fm_engine * fm_engine_create(const struct fm_engine_options * options)
{
  struct fm_engine * engine = readers_fit(options) ? calloc(1, sizeof(*engine)) : NULL;
  if (engine == NULL) {
    return NULL;
  }
  engine->options = *options;
  engine->options.reorder = options->uses_header_stamps ? options->reorder : 0;
  engine->wakes_at = INT64_MIN;
  engine->released = INT64_MIN;
  engine->later = FM_NEVER;
  if (!fm_engine_number_scopes(engine) || !make_memory(engine) || !make_locks(engine)) {
    free_memory(engine);
    return NULL;
  }
  engine->outbox.keeps_recoveries = options->takes_recoveries;
  find_sources(engine);
  return engine;
}

void fm_engine_destroy(struct fm_engine * engine)
{
  pthread_cond_destroy(&engine->violation_queued);
  pthread_cond_destroy(&engine->detail_queued);
  pthread_cond_destroy(&engine->state_changed);
  pthread_cond_destroy(&engine->turn_ended);
  pthread_mutex_destroy(&engine->mutex);
  pthread_mutex_destroy(&engine->catching);
  free_memory(engine);
}

void fm_engine_close(struct fm_engine * engine)
{
  fm_engine_lock(engine);
  engine->is_closed = true;
  pthread_cond_broadcast(&engine->violation_queued);
  pthread_cond_broadcast(&engine->detail_queued);
  pthread_cond_broadcast(&engine->state_changed);
  fm_engine_unlock(engine);
}

bool fm_engine_is_closed(struct fm_engine * engine)
{
  fm_engine_lock(engine);
  const bool is_closed = engine->is_closed;
  fm_engine_unlock(engine);
  return is_closed;
}

void fm_engine_keep_messages(struct fm_engine * engine, struct fm_blackbox * box)
{
  fm_engine_lock(engine);
  engine->blackbox = box;
  fm_engine_unlock(engine);
}

void fm_engine_keep_of(struct fm_engine * engine, uint32_t topic, enum fm_keeping keeping)
{
  fm_engine_lock(engine);
  engine->topics[topic].keeping = (uint8_t)keeping;
  fm_engine_unlock(engine);
}

// ---- taking ------------------------------------------------------------------------------------

// Wait for a signal, the deadline, or `end` of CLOCK_MONOTONIC. If the system time is set in the
// meantime, a wait for a stamp ends too early or at `end`.
static void wait_for_deadline_locked(struct fm_engine * engine, int64_t end)
{
  const bool waits = engine->has_begun && engine->source == FM_STEADY;
  const int64_t steady = fm_steady_time();
  int64_t ahead = 0;  // of the source
  if (waits && fm_engine_uses_headers(engine)) {
    int64_t now;
    (void)fm_engine_read_source_locked(engine, 0, &now);
    ahead = fm_between(steady, now);
  }
  const int64_t last = fm_later(end, ahead);
  const int64_t deadline = waits ? fm_engine_deadline_locked(engine) : last;
  engine->wakes_at = deadline < last ? deadline : last;
  FM_PAUSE();
  fm_wait_until(&engine->violation_queued, &engine->mutex, fm_between(ahead, engine->wakes_at));
  engine->wakes_at = INT64_MIN;
}

// Wait until a violation is queued, the engine is closed, or the time is over. Takes what is due.
static void wait_for_violation_locked(struct fm_engine * engine, uint32_t milliseconds)
{
  const int64_t end =
    fm_steady_time() + (int64_t)milliseconds * MILLISECOND_NS;
  engine->has_announcer = true;
  bool is_behind = fm_engine_catch_up_if_due_locked(engine);
  while (engine->outbox.n_violations == 0 && !engine->is_closed && milliseconds > 0 &&
    engine->states.changes == engine->taken_changes &&
    fm_steady_time() < end)
  {
    if (!is_behind) {
      wait_for_deadline_locked(engine, end);
    }
    is_behind = fm_engine_catch_up_if_due_locked(engine);
  }
}

uint32_t fm_engine_take(
  struct fm_engine * engine, struct fm_violation * out, uint32_t room, uint32_t milliseconds)
{
  return fm_engine_take_keyed(engine, out, NULL, room, milliseconds);
}

uint32_t fm_engine_take_keyed(
  struct fm_engine * engine, struct fm_violation * out, uint8_t * keys, uint32_t room,
  uint32_t milliseconds)
{
  fm_engine_lock(engine);
  wait_for_violation_locked(engine, milliseconds);
  fm_engine_look_for_hang_locked(engine);
  const uint32_t n = fm_outbox_take(&engine->outbox, out, keys, room);
  engine->taken_changes = engine->states.changes;
  fm_engine_unlock(engine);
  return n;
}

void fm_engine_follow_states(struct fm_engine * engine)
{
  fm_engine_lock(engine);
  engine->has_states = true;
  if (engine->options.scopes != NULL) {
    fm_scopes_count_unknown(engine->options.scopes);
  }
  fm_engine_unlock(engine);
}

bool fm_engine_follow_instances(struct fm_engine * engine)
{
  const struct fm_outbox_size size = {engine->n_requirements + UINT64_C(1), 0, true};
  fm_engine_lock(engine);
  engine->follows_instances = fm_outbox_init(&engine->instances, &size);
  engine->instances.keeps_recoveries = true;
  fm_engine_unlock(engine);
  return engine->follows_instances;
}

bool fm_engine_take_instance(
  struct fm_engine * engine, struct fm_violation * out, uint8_t * key)
{
  fm_engine_lock(engine);
  if (engine->instances.n_violations == 0 && engine->instances.unpublished > 0) {
    engine->instances.unpublished = 0;
    fm_engine_end_instances_locked(engine);
  }
  const uint32_t n = fm_outbox_take(&engine->instances, out, key, 1);
  fm_engine_unlock(engine);
  return n > 0;
}

uint64_t fm_engine_states(
  struct fm_engine * engine, uint64_t seen, uint32_t milliseconds,
  struct fm_requirement_state * out)
{
  const int64_t end = fm_steady_time() + (int64_t)milliseconds * MILLISECOND_NS;
  fm_engine_lock(engine);
  while (engine->states.changes == seen && !engine->is_closed && fm_steady_time() < end) {
    fm_wait_until(&engine->state_changed, &engine->mutex, end);
  }
  memcpy(out, engine->states.requirements, engine->n_requirements * sizeof(*out));
  const uint64_t changes = engine->states.changes;
  fm_engine_unlock(engine);
  return changes;
}

void fm_engine_take_margins(struct fm_engine * engine, double * out)
{
  fm_engine_lock(engine);
  for (uint32_t r = 0; r < engine->numbers[0]; ++r) {
    out[r] = fm_evaluator_take_margin(engine->options.evaluator, r);
  }
  for (uint32_t k = 0; k < engine->n_kinds; ++k) {
    for (uint32_t r = engine->numbers[k]; r < engine->numbers[k + 1]; ++r) {
      out[r] = fm_scopes_take_margin(engine->options.scopes, k, r - engine->numbers[k]);
    }
  }
  fm_engine_unlock(engine);
}

void fm_engine_want_details(struct fm_engine * engine, bool are_wanted, uint32_t most_per_s)
{
  fm_engine_lock(engine);
  fm_outbox_want_details(&engine->outbox, are_wanted, most_per_s);
  fm_engine_unlock(engine);
}

size_t fm_engine_detail_bytes(struct fm_engine * engine)
{
  return fm_outbox_detail_bytes(&engine->outbox);
}

bool fm_engine_take_detail(
  struct fm_engine * engine, struct fm_detail * out, uint32_t milliseconds)
{
  const int64_t end = fm_steady_time() + (int64_t)milliseconds * MILLISECOND_NS;
  fm_engine_lock(engine);
  while (engine->outbox.n_details == 0 && !engine->is_closed &&
    fm_steady_time() < end)
  {
    fm_wait_until(&engine->detail_queued, &engine->mutex, end);
  }
  const bool has_one = fm_outbox_take_detail(&engine->outbox, out);
  fm_engine_unlock(engine);
  return has_one;
}

void fm_engine_detail_counts(struct fm_engine * engine, struct fm_detail_counts * out)
{
  fm_engine_lock(engine);
  for (uint32_t r = 0; r < engine->n_requirements; ++r) {
    out[r] = fm_outbox_counts(&engine->outbox, r);
    out[r].is_violated = engine->are_violated[r];
  }
  fm_engine_unlock(engine);
}

void fm_engine_count_unpublished(struct fm_engine * engine, uint64_t more)
{
  fm_engine_lock(engine);
  engine->outbox.unpublished += more;
  fm_engine_unlock(engine);
}

// ---- handover ----------------------------------------------------------------------------------

void fm_engine_begin_handover(struct fm_engine * engine, uint32_t topic, bool has_history)
{
  if (topic <= engine->options.n_topics) {
    fm_engine_lock(engine);
    fm_arrivals_begin_handover(&engine->topics[topic].arrivals, has_history);
    fm_engine_unlock(engine);
  }
}

void fm_engine_end_handover(struct fm_engine * engine, uint32_t topic)
{
  if (topic <= engine->options.n_topics) {
    fm_engine_lock(engine);
    fm_arrivals_end_handover(&engine->topics[topic].arrivals);
    fm_engine_unlock(engine);
  }
}

uint64_t fm_engine_lost(struct fm_engine * engine, uint32_t topic)
{
  uint64_t lost = 0;
  if (topic <= engine->options.n_topics) {
    fm_engine_lock(engine);
    lost = fm_arrivals_lost(&engine->topics[topic].arrivals);
    fm_engine_unlock(engine);
  }
  return lost;
}

// ---- answers -----------------------------------------------------------------------------------

bool fm_engine_has_come(struct fm_engine * engine, uint32_t topic)
{
  bool has_come = false;
  if (topic < engine->options.n_topics) {
    fm_engine_lock(engine);
    has_come = fm_evaluator_topic_counts(engine->options.evaluator, topic).messages > 0;
    fm_engine_unlock(engine);
  }
  return has_come;
}

struct fm_order_counts fm_engine_order_counts(struct fm_engine * engine, uint32_t topic)
{
  struct fm_order_counts counts = {0, 0, 0, 0};
  if (topic < engine->options.n_topics) {
    fm_engine_lock(engine);
    counts = engine->topics[topic].counts;
    fm_engine_unlock(engine);
  }
  return counts;
}

// ---- time --------------------------------------------------------------------------------------

void fm_engine_advance(struct fm_engine * engine, int64_t now)
{
  fm_engine_lock(engine);
  if (engine->source == FM_TOLD && !engine->is_closed) {
    engine->has_begun = true;
    fm_engine_take_due_by_locked(engine, fm_later(now, -engine->options.reorder));
  }
  fm_engine_unlock(engine);
}

void fm_engine_reset(struct fm_engine * engine)
{
  fm_engine_begin_order(engine);
  fm_engine_lock(engine);
  fm_engine_take_due_now_locked(engine);
  fm_engine_reset_locked(engine);
  fm_engine_forget_violations_locked(engine);
  if (engine->gate != NULL) {
    fm_gate_reset(engine->gate);
  }
  fm_engine_update_states_locked(engine);
  fm_engine_take_due_now_locked(engine);
  fm_engine_unlock(engine);
  fm_engine_end_order(engine);
}

static void follow(
  struct fm_engine * engine, enum fm_source_of_time source,
  int (* now)(void * clock, int64_t * nanoseconds), void * clock, bool is_outdated)
{
  fm_engine_begin_order(engine);
  fm_engine_lock(engine);
  fm_engine_take_due_now_locked(engine);  // brings the time up to date, for the shift
  fm_engine_release_all_locked(engine);  // their stamps are of another clock
  engine->released = INT64_MIN;
  engine->source = source;
  engine->now = now;
  engine->clock = clock;
  engine->is_outdated = is_outdated;
  engine->clock_served = fm_steady_time();
  engine->is_new_source = true;
  engine->has_round = false;
  engine->n_marks = 0;
  (void)fm_engine_mark_clock_locked(engine);
  fm_engine_take_due_now_locked(engine);
  pthread_cond_signal(&engine->violation_queued);
  fm_engine_unlock(engine);
  fm_engine_end_order(engine);
}

void fm_engine_follow_steady(struct fm_engine * engine)
{
  follow(engine, FM_STEADY, NULL, NULL, false);
}

void fm_engine_follow_clock(
  struct fm_engine * engine, int (* now)(void * clock, int64_t * nanoseconds), void * clock,
  bool is_outdated)
{
  follow(engine, FM_CLOCK, now, clock, is_outdated);
}

void fm_engine_begin(struct fm_engine * engine)
{
  fm_engine_lock(engine);
  if (!engine->has_begun && engine->source != FM_TOLD) {
    engine->has_begun = true;
    engine->is_new_source = false;  // the evaluator has no times yet
    fm_engine_take_due_now_locked(engine);
    pthread_cond_signal(&engine->violation_queued);
  }
  fm_engine_unlock(engine);
}

void fm_engine_wake(struct fm_engine * engine)
{
  fm_engine_lock(engine);
  engine->is_outdated = false;
  if (!fm_engine_mark_clock_locked(engine)) {
    engine->caught_up = 0;
    pthread_cond_signal(&engine->violation_queued);
  }
  fm_engine_unlock(engine);
}

int64_t fm_engine_deadline(struct fm_engine * engine)
{
  fm_engine_lock(engine);
  const int64_t deadline =
    engine->has_begun ? fm_engine_deadline_locked(engine) : FM_NEVER;
  fm_engine_unlock(engine);
  return deadline;
}
