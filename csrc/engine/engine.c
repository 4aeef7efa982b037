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
#define FEWEST_AHEAD_NS (100 * (int64_t)MILLISECOND_NS)

uint32_t fm_engine_abi(void) {return FM_ENGINE_ABI;}

// ---- making ------------------------------------------------------------------------------------

static uint32_t most_inputs(const struct fm_engine_options * options)
{
  uint32_t most = 1;
  for (uint32_t t = 0; t < options->n_topics; ++t) {
    most = options->topics[t].n_inputs > most ? options->topics[t].n_inputs : most;
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
    calloc(options->monitor->n_requirements + (size_t)1, sizeof(*engine->are_violated));
  return fm_outbox_init(&engine->outbox, options->monitor) && engine->fields != NULL &&
         engine->prepared != NULL && engine->found != NULL && engine->topics != NULL &&
         engine->are_violated != NULL && fm_states_init(&engine->states, options->monitor) &&
         (!fm_evaluator_is_timed(options->evaluator) || !options->uses_header_stamps ||
         fm_reorder_init(&engine->waiting, most_inputs(options)));
}

static void free_memory(struct fm_engine * engine)
{
  for (uint32_t t = 0; engine->topics != NULL && t <= engine->options.n_topics; ++t) {
    fm_arrivals_end_handover(&engine->topics[t].arrivals);
    free(engine->topics[t].evidence);
  }
  fm_outbox_free(&engine->outbox);
  fm_reorder_free(&engine->waiting);
  free(engine->fields);
  free(engine->prepared);
  free(engine->found);
  free(engine->topics);
  free(engine->are_violated);
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
  if (!make_memory(engine) || !make_locks(engine)) {
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

void fm_engine_lock(struct fm_engine * engine) {pthread_mutex_lock(&engine->mutex);}
void fm_engine_unlock(struct fm_engine * engine) {pthread_mutex_unlock(&engine->mutex);}

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

// ---- queues ------------------------------------------------------------------------------------

// Note those that begin: a requirement may be violated at each step for hours.
static void note_occurrences_locked(struct fm_engine * engine, uint32_t n)
{
  const bool is_used = engine->blackbox != NULL || engine->has_states || engine->gate != NULL;
  for (uint32_t k = 0; is_used && k < n; ++k) {
    const uint32_t requirement = engine->found[k].requirement;
    if (!engine->found[k].is_recovery && !engine->are_violated[requirement]) {
      fm_states_begin_violation(&engine->states, requirement);
      if (engine->blackbox != NULL) {
        fm_blackbox_note(engine->blackbox, requirement, fm_steady_time());
      }
    }
    engine->are_violated[requirement] = !engine->found[k].is_recovery;
  }
}

static void note_conditions_locked(struct fm_engine * engine)
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

void fm_engine_update_states_locked(struct fm_engine * engine)
{
  if (engine->has_states) {
    fm_states_update(
      &engine->states, engine->options.evaluator, engine->options.monitor, engine->are_violated);
  }
  if (engine->has_states || engine->gate != NULL) {
    note_conditions_locked(engine);
  }
  if (engine->states.changes != engine->noted_changes) {
    engine->noted_changes = engine->states.changes;
    pthread_cond_signal(&engine->violation_queued);
    pthread_cond_broadcast(&engine->state_changed);
  }
}

void fm_engine_queue_locked(struct fm_engine * engine, uint32_t n, int64_t later)
{
  const uint32_t n_details = engine->outbox.n_details;
  for (uint32_t k = 0; k < n; ++k) {
    engine->found[k].stamp = fm_later(engine->found[k].stamp, later);
    fm_outbox_add(&engine->outbox, &engine->found[k], engine->options.evaluator);
  }
  note_occurrences_locked(engine, n);
  if (n > 0) {
    pthread_cond_signal(&engine->violation_queued);
    if (engine->outbox.n_details != n_details) {
      pthread_cond_signal(&engine->detail_queued);
    }
  }
}

void fm_engine_announce_locked(struct fm_engine * engine, uint32_t n, int64_t later)
{
  fm_engine_queue_locked(engine, fm_engine_note_gate_locked(engine, n), later);
  fm_engine_update_states_locked(engine);
}

void fm_engine_forget_violations_locked(struct fm_engine * engine)
{
  memset(engine->are_violated, 0, engine->options.monitor->n_requirements);
  if (engine->gate != NULL) {
    fm_gate_forget_violations(engine->gate);
  }
}

void fm_engine_reset(struct fm_engine * engine)
{
  fm_engine_begin_order(engine);
  fm_engine_lock(engine);
  fm_engine_take_due_now_locked(engine);
  fm_evaluator_reset(engine->options.evaluator);
  fm_engine_forget_violations_locked(engine);
  if (engine->gate != NULL) {
    fm_gate_reset(engine->gate);
  }
  fm_engine_update_states_locked(engine);
  fm_engine_take_due_now_locked(engine);
  fm_engine_unlock(engine);
  fm_engine_end_order(engine);
}

// ---- taking ------------------------------------------------------------------------------------

uint32_t fm_engine_take(
  struct fm_engine * engine, struct fm_violation * out, uint32_t room, uint32_t milliseconds)
{
  fm_engine_lock(engine);
  fm_engine_wait_for_violation_locked(engine, milliseconds);
  fm_engine_look_for_hang_locked(engine);
  const uint32_t n = fm_outbox_take(&engine->outbox, out, room);
  engine->taken_changes = engine->states.changes;
  fm_engine_unlock(engine);
  return n;
}

void fm_engine_follow_states(struct fm_engine * engine)
{
  fm_engine_lock(engine);
  engine->has_states = true;
  fm_engine_unlock(engine);
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
  memcpy(
    out, engine->states.requirements,
    engine->options.monitor->n_requirements * sizeof(*out));
  const uint64_t changes = engine->states.changes;
  fm_engine_unlock(engine);
  return changes;
}

void fm_engine_conditions(struct fm_engine * engine, uint8_t * out)
{
  fm_engine_catch_up_if_free(engine);
  fm_engine_lock(engine);
  fm_engine_look_for_hang_locked(engine);
  note_conditions_locked(engine);
  memcpy(out, fm_states_conditions(&engine->states), engine->states.condition_bytes);
  fm_engine_unlock(engine);
}

bool fm_engine_take_conditions(struct fm_engine * engine, uint8_t * out, uint64_t * missed)
{
  fm_engine_lock(engine);
  const bool has_one = fm_states_take_conditions(&engine->states, out, missed);
  fm_engine_unlock(engine);
  return has_one;
}

void fm_engine_want_details(struct fm_engine * engine, bool are_wanted, uint32_t most_per_s)
{
  fm_engine_lock(engine);
  fm_outbox_want_details(&engine->outbox, are_wanted, most_per_s);
  fm_engine_unlock(engine);
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

uint64_t fm_engine_unpublished(struct fm_engine * engine)
{
  fm_engine_lock(engine);
  const uint64_t unpublished = engine->outbox.unpublished;
  fm_engine_unlock(engine);
  return unpublished;
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

// ---- messages ----------------------------------------------------------------------------------

static void keep_evidence(
  struct fm_engine_topic * topic, const uint8_t * message, size_t size)
{
  if (topic->evidence == NULL && size > 0) {
    topic->evidence = malloc(size);
    if (topic->evidence != NULL) {
      memcpy(topic->evidence, message, size);
      topic->evidence_size = size;
    }
  }
}

size_t fm_engine_evidence(
  struct fm_engine * engine, uint32_t topic, uint8_t * out, size_t room)
{
  size_t size = 0;
  if (topic < engine->options.n_topics) {
    fm_engine_lock(engine);
    struct fm_engine_topic * cell = &engine->topics[topic];
    size = cell->evidence == NULL ? 0 : cell->evidence_size;
    if (size > 0 && size <= room) {
      memcpy(out, cell->evidence, size);
      free(cell->evidence);
      cell->evidence = NULL;
    }
    fm_engine_unlock(engine);
  }
  return size;
}

void fm_engine_keep_messages(struct fm_engine * engine, struct fm_blackbox * box)
{
  fm_engine_lock(engine);
  engine->blackbox = box;
  fm_engine_unlock(engine);
}

static bool all_are_read(const struct fm_field * fields, uint32_t n)
{
  for (uint32_t k = 0; k < n; ++k) {
    if (fields[k].outcome != FM_FIELD_READ) {
      return false;
    }
  }
  return true;
}

bool fm_engine_needs_bytes(
  const struct fm_engine * engine, uint32_t topic, const struct fm_field * fields)
{
  return engine->blackbox != NULL ||
         !all_are_read(fields, engine->options.topics[topic].n_inputs);
}

void fm_engine_keep_message_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_reading * reading, int64_t stamp,
  int64_t sent)
{
  if (reading->is_decoded &&
    !all_are_read(reading->fields, engine->options.topics[topic].n_inputs))
  {
    keep_evidence(&engine->topics[topic], reading->message, reading->size);
  }
  if (engine->blackbox != NULL) {
    const struct fm_kept kept =
    {reading->size, fm_steady_time(), stamp, sent, topic, 0};
    fm_blackbox_keep(engine->blackbox, &kept, reading->message);
  }
}

const struct fm_reader * fm_engine_reader(const struct fm_engine * engine, uint32_t topic)
{
  return &engine->options.readers->topics[topic];
}

bool fm_engine_read(
  const struct fm_engine * engine, uint32_t topic, const uint8_t * message, size_t size,
  struct fm_field * fields, int64_t * stamp)
{
  const struct fm_reader * reader = fm_engine_reader(engine, topic);
  *stamp = 0;
  return reader->read(message, size, fields) &&
         (!engine->options.uses_header_stamps || reader->stamp(message, size, stamp));
}

const struct fm_field * fm_engine_prepare_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_field * fields, int64_t received)
{
  const struct fm_topic * fed = &engine->options.topics[topic];
  if (!engine->topics[topic].has_sources) {
    return fields;
  }
  memcpy(engine->prepared, fields, fed->n_inputs * sizeof(*fields));
  for (uint32_t k = 0; k < fed->n_inputs; ++k) {
    struct fm_field * field = &engine->prepared[k];
    const uint8_t source = engine->options.sources[fed->inputs[k]];
    if (source == FM_RECEPTION) {
      field->value.i = 1;
      field->outcome = FM_FIELD_READ;
    } else if (source == FM_AGE && engine->source == FM_CLOCK && received == 0) {
      field->outcome = FM_FIELD_EMPTY;  // there is no time yet
    } else if (source == FM_AGE && field->outcome == FM_FIELD_READ) {
      field->value.f = (double)fm_between(field->value.i, received) / 1e9;
    }
  }
  return engine->prepared;
}

// Store the fields that were read, and count the others.
static void store_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_field * fields, int64_t now)
{
  const struct fm_topic * fed = &engine->options.topics[topic];
  for (uint32_t k = 0; k < fed->n_inputs; ++k) {
    if (fields[k].outcome == FM_FIELD_READ) {
      fm_evaluator_store(engine->options.evaluator, fed->inputs[k], fields[k].value, now);
    } else {
      fm_evaluator_unusable(engine->options.evaluator, fed->inputs[k]);
    }
  }
}

// Under FM_TIMED: let a message take effect at an instant. Returns when it does.
static int64_t put_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_field * fields, int64_t instant)
{
  struct fm_evaluator * evaluator = engine->options.evaluator;
  const int64_t now = fm_evaluator_arrival(evaluator, instant);
  fm_engine_take_due_before_locked(engine, now);
  store_locked(engine, topic, fields, now);
  const uint32_t n = fm_evaluator_message(evaluator, topic, now, engine->found);
  fm_engine_announce_locked(engine, n, n > 0 ? fm_engine_stamps_ahead_locked(engine) : 0);
  return now;
}

void fm_engine_take_due_after_locked(struct fm_engine * engine, int64_t instant, int64_t now)
{
  const int64_t next = fm_later(instant, 1);
  if (engine->source == FM_STEADY && next <= now &&
    fm_evaluator_wake(engine->options.evaluator) <= next)
  {
    fm_engine_take_due_before_locked(engine, fm_later(next, 1));
  }
}

void fm_engine_put_waiting_locked(struct fm_engine * engine, int64_t now)
{
  const struct fm_waiting * first = fm_reorder_first(&engine->waiting);
  const int64_t earliest = fm_evaluator_now(engine->options.evaluator);
  const int64_t instant = first->stamp < earliest ? earliest : first->stamp;
  (void)put_locked(engine, first->topic, first->fields, instant < now ? instant : now);
  fm_reorder_remove_first(&engine->waiting);
}

// A message waits for others with earlier stamps. If there is no room for it, the one with the
// earliest stamp takes effect now.
static void wait_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_field * fields, int64_t stamp,
  int64_t now)
{
  if (engine->waiting.n == engine->waiting.capacity) {
    engine->topics[fm_reorder_first(&engine->waiting)->topic].counts.overflows += 1;
    fm_engine_put_waiting_locked(engine, now);
  }
  fm_reorder_add(
    &engine->waiting, topic, stamp, fields, engine->options.topics[topic].n_inputs);
  fm_engine_release_locked(engine, now);
}

// A stamp that is ahead of the clock delays its message without any other sign of it.
static void count_ahead(struct fm_order_counts * counts, int64_t ahead, int64_t reorder)
{
  if (ahead > reorder && ahead > FEWEST_AHEAD_NS) {
    counts->ahead += 1;
    counts->most_ahead = ahead > counts->most_ahead ? ahead : counts->most_ahead;
  }
}

// A message with a stamp in its header. One that comes too late takes effect now: what waits, and
// what is due, until then comes first.
static void deliver_stamped_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_field * fields, int64_t stamp,
  int64_t now)
{
  const bool is_late = stamp < now;
  engine->topics[topic].counts.late += is_late ? 1u : 0u;
  count_ahead(
    &engine->topics[topic].counts, stamp - fm_later(now, engine->options.reorder),
    engine->options.reorder);
  if (is_late) {
    fm_engine_release_locked(engine, now);
    (void)put_locked(engine, topic, fields, now);
  } else {
    wait_locked(engine, topic, fields, stamp, now);
  }
}

// Under FM_TIMED: a message that was received at a time of the system, `now` by the source.
static void deliver_timed_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_field * fields,
  const struct fm_reading * reading, int64_t received, int64_t now)
{
  fm_engine_note_restart_locked(engine, now);
  if (engine->options.uses_header_stamps) {
    deliver_stamped_locked(engine, topic, fields, reading->stamp, now);
    return;
  }
  const int64_t instant = fm_engine_instant_locked(engine, received, now);
  fm_engine_take_due_after_locked(engine, put_locked(engine, topic, fields, instant), now);
}

// A message that is a step, if it is one, when it is delivered. Under FM_TIMED a step is an
// instant of the evaluator.
static void deliver_step_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_field * fields, int64_t stamp,
  int64_t now)
{
  const int64_t instant = fm_evaluator_is_timed(engine->options.evaluator) ? now : stamp;
  store_locked(engine, topic, fields, now);
  fm_engine_announce_locked(
    engine, fm_evaluator_message(engine->options.evaluator, topic, instant, engine->found),
    fm_between(instant, stamp));
}

static void deliver_fields_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_reading * reading,
  const struct fm_origin * origin)
{
  struct fm_evaluator * evaluator = engine->options.evaluator;
  const int64_t received = origin->received;
  int64_t now;
  const bool has_time = fm_engine_read_for_message_locked(engine, received, &now);
  const int64_t stamp = engine->source != FM_CLOCK ? received :
    has_time ? fm_later(now, engine->options.reorder) : 0;
  const struct fm_field * fields = fm_engine_prepare_locked(engine, topic, reading->fields, stamp);
  fm_engine_keep_message_locked(engine, topic, reading, stamp, origin->sent);
  if (!has_time || !engine->has_begun) {
    now = fm_evaluator_arrival(evaluator, fm_evaluator_now(evaluator));
    deliver_step_locked(engine, topic, fields, stamp, now);
  } else if (fm_evaluator_is_timed(evaluator)) {
    deliver_timed_locked(engine, topic, fields, reading, received, now);
  } else {
    if (engine->in_round) {
      now = fm_engine_instant_locked(engine, received, now);
    }
    fm_engine_take_due_before_locked(engine, now);
    deliver_step_locked(engine, topic, fields, stamp, now);
  }
}

uint32_t fm_engine_deliver_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_reading * reading,
  const struct fm_origin * origin)
{
  struct fm_engine_topic * cell = &engine->topics[topic];
  if (engine->is_closed) {
    return FM_RECEIVED;
  }
  if (fm_arrivals_is_repeated(&cell->arrivals, origin)) {
    return FM_REPEATED;
  }
  fm_arrivals_note(&cell->arrivals, origin);
  fm_engine_note_behind_locked(engine, cell, origin->received);
  if (!reading->is_decoded) {
    fm_evaluator_undecodable(engine->options.evaluator, topic);
    fm_engine_keep_message_locked(
      engine, topic, reading, engine->source == FM_CLOCK ? 0 : origin->received, origin->sent);
    return FM_UNDECODABLE;
  }
  deliver_fields_locked(engine, topic, reading, origin);
  fm_engine_end_wait_if_earlier_locked(engine);
  return FM_RECEIVED;
}

uint32_t fm_engine_message_locked(
  struct fm_engine * engine, uint32_t topic, const uint8_t * message, size_t size,
  const struct fm_origin * origin)
{
  struct fm_reading reading = {engine->fields, message, size, 0, false};
  reading.is_decoded =
    fm_engine_read(engine, topic, message, size, engine->fields, &reading.stamp);
  return fm_engine_deliver_locked(engine, topic, &reading, origin);
}

uint32_t fm_engine_message(
  struct fm_engine * engine, uint32_t topic, const uint8_t * message, size_t size,
  const struct fm_origin * origin)
{
  if (topic >= engine->options.n_topics) {
    return FM_RECEIVED;
  }
  fm_engine_lock(engine);
  const uint32_t receipt = fm_engine_message_locked(engine, topic, message, size, origin);
  fm_engine_unlock(engine);
  return receipt;
}

// ---- answers -----------------------------------------------------------------------------------

struct fm_requirement_counts fm_engine_requirement_counts(
  struct fm_engine * engine, uint32_t requirement)
{
  fm_engine_lock(engine);
  struct fm_requirement_counts counts =
    fm_evaluator_requirement_counts(engine->options.evaluator, requirement);
  if (engine->gate != NULL && requirement < engine->options.monitor->n_requirements) {
    counts.is_violated = counts.is_violated || engine->are_violated[requirement];
  }
  fm_engine_unlock(engine);
  return counts;
}

struct fm_input_counts fm_engine_input_counts(struct fm_engine * engine, uint32_t input)
{
  fm_engine_lock(engine);
  const struct fm_input_counts counts =
    fm_evaluator_input_counts(engine->options.evaluator, input);
  fm_engine_unlock(engine);
  return counts;
}

struct fm_topic_counts fm_engine_topic_counts(struct fm_engine * engine, uint32_t topic)
{
  fm_engine_lock(engine);
  const struct fm_topic_counts counts =
    fm_evaluator_topic_counts(engine->options.evaluator, topic);
  fm_engine_unlock(engine);
  return counts;
}

struct fm_time_counts fm_engine_time_counts(struct fm_engine * engine)
{
  fm_engine_lock(engine);
  const struct fm_time_counts counts = fm_evaluator_time_counts(engine->options.evaluator);
  fm_engine_unlock(engine);
  return counts;
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

int64_t fm_engine_take_behind(struct fm_engine * engine, uint32_t topic)
{
  int64_t behind = 0;
  if (topic < engine->options.n_topics) {
    fm_engine_lock(engine);
    behind = engine->topics[topic].behind;
    engine->topics[topic].behind = 0;
    fm_engine_unlock(engine);
  }
  return behind;
}

struct fm_silence fm_engine_silence(struct fm_engine * engine, uint32_t input)
{
  fm_engine_catch_up_if_free(engine);  // brings the time up to date
  fm_engine_lock(engine);
  const struct fm_silence silence = fm_evaluator_silence(engine->options.evaluator, input);
  fm_engine_unlock(engine);
  return silence;
}

bool fm_engine_value(struct fm_engine * engine, uint32_t input, void * out)
{
  fm_engine_lock(engine);
  const bool has_value = fm_evaluator_value(engine->options.evaluator, input, out);
  fm_engine_unlock(engine);
  return has_value;
}
