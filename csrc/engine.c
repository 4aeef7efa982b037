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

#include "engine_locked.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "instance.h"

#define SECOND_NS 1000000000
#define CLOSE_NS 10000  // two readings of clocks without a preemption in between
#define MOST_READINGS 10

// Tests sleep between two steps of the handling of time.
#ifndef FM_PAUSE
#define FM_PAUSE()
#endif

enum source
{
  TOLD,    // by fm_engine_advance, and with each message
  STEADY,  // CLOCK_MONOTONIC
  CLOCK    // `now`
};

struct topic
{
  struct fm_arrivals arrivals;
  uint8_t * evidence;
  size_t evidence_size;
};

struct fm_engine
{
  pthread_mutex_t mutex;
  pthread_cond_t violation_queued;
  pthread_cond_t detail_queued;
  struct fm_engine_options options;
  struct fm_field * fields;     // of the message being read
  struct fm_violation * found;  // violations of the steps of one message
  struct topic * topics;
  struct fm_outbox outbox;
  int (* now)(void * clock, int64_t * nanoseconds);
  void * clock;
  enum source source;
  int64_t system_ahead;  // of the steady clock, ns
  int64_t wakes_at;      // a thread in fm_engine_take waits until then; INT64_MIN: none does
  int64_t round;         // the time of the round
  bool has_rounds;       // messages are taken in rounds
  bool has_round;        // there is a time, of the round
  bool is_outdated;      // the clock, until fm_engine_wake
  bool has_begun;        // the time
  bool is_new_source;    // its time was not read yet
  bool is_closed;
};

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
    if (readers->topics[t].n_inputs != options->topics[t].n_inputs) {
      return false;
    }
  }
  return true;
}

static bool make_condition(pthread_cond_t * condition)
{
  pthread_condattr_t attributes;
  if (pthread_condattr_init(&attributes) != 0) {
    return false;
  }
  const bool is_made = pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC) == 0 &&
    pthread_cond_init(condition, &attributes) == 0;
  pthread_condattr_destroy(&attributes);
  return is_made;
}

static bool make_locks(struct fm_engine * engine)
{
  if (pthread_mutex_init(&engine->mutex, NULL) != 0) {
    return false;
  }
  if (!make_condition(&engine->violation_queued)) {
    pthread_mutex_destroy(&engine->mutex);
    return false;
  }
  if (!make_condition(&engine->detail_queued)) {
    pthread_cond_destroy(&engine->violation_queued);
    pthread_mutex_destroy(&engine->mutex);
    return false;
  }
  return true;
}

static bool make_memory(struct fm_engine * engine)
{
  const struct fm_engine_options * options = &engine->options;
  engine->fields = calloc(most_inputs(options), sizeof(struct fm_field));
  engine->found =
    calloc(options->monitor->n_requirements + (size_t)1, sizeof(struct fm_violation));
  engine->topics = calloc(options->n_topics + (size_t)1, sizeof(struct topic));
  return fm_outbox_init(&engine->outbox, options->monitor) && engine->fields != NULL &&
         engine->found != NULL && engine->topics != NULL;
}

static void free_memory(struct fm_engine * engine)
{
  for (uint32_t t = 0; engine->topics != NULL && t < engine->options.n_topics; ++t) {
    fm_arrivals_end_handover(&engine->topics[t].arrivals);
    free(engine->topics[t].evidence);
  }
  fm_outbox_free(&engine->outbox);
  free(engine->fields);
  free(engine->found);
  free(engine->topics);
  free(engine);
}

struct fm_engine * fm_engine_create(const struct fm_engine_options * options)
{
  struct fm_engine * engine = readers_fit(options) ? calloc(1, sizeof(*engine)) : NULL;
  if (engine == NULL) {
    return NULL;
  }
  engine->options = *options;
  engine->wakes_at = INT64_MIN;
  if (!make_memory(engine) || !make_locks(engine)) {
    free_memory(engine);
    return NULL;
  }
  return engine;
}

void fm_engine_destroy(struct fm_engine * engine)
{
  pthread_cond_destroy(&engine->violation_queued);
  pthread_cond_destroy(&engine->detail_queued);
  pthread_mutex_destroy(&engine->mutex);
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

// Queue the violations of engine->found, whose stamps are `later` than found.
static void announce_locked(struct fm_engine * engine, uint32_t n, int64_t later)
{
  for (uint32_t k = 0; k < n; ++k) {
    engine->found[k].stamp = fm_later(engine->found[k].stamp, later);
    fm_outbox_add(&engine->outbox, &engine->found[k], engine->options.evaluator);
  }
  if (n > 0) {
    pthread_cond_signal(&engine->violation_queued);
    if (engine->outbox.wants_details) {
      pthread_cond_signal(&engine->detail_queued);
    }
  }
}

// ---- time --------------------------------------------------------------------------------------

static int64_t read_clock(clockid_t clock)
{
  struct timespec now;
  clock_gettime(clock, &now);
  return (int64_t)now.tv_sec * SECOND_NS + (int64_t)now.tv_nsec;
}

// How much the system time is ahead of the steady clock. Readings may be far apart if the thread
// is preempted, so that they only give limits. What was found before holds while it is within
// them: the stamps of periods are then exactly a period apart.
static int64_t system_ahead_locked(struct fm_engine * engine)
{
  int64_t before;
  int64_t system;
  int64_t after;
  int readings = 0;
  do {
    before = read_clock(CLOCK_MONOTONIC);
    FM_PAUSE();
    system = read_clock(CLOCK_REALTIME);
    FM_PAUSE();
    after = read_clock(CLOCK_MONOTONIC);
    readings += 1;
  } while (after - before > CLOSE_NS && readings < MOST_READINGS);
  if (engine->system_ahead < system - after) {
    engine->system_ahead = system - after;
  } else if (engine->system_ahead > system - before) {
    engine->system_ahead = system - before;
  }
  return engine->system_ahead;
}

// Read the time of the source; returns false if it has none. `told`: the time if it is told.
static bool read_source_locked(struct fm_engine * engine, int64_t told, int64_t * now)
{
  *now = told;
  if (engine->source == STEADY) {
    *now = read_clock(CLOCK_MONOTONIC);
  } else if (engine->source == CLOCK) {
    return !engine->is_outdated && engine->now(engine->clock, now) == 0 && *now > 0;
  }
  return true;
}

// Shift the evaluator's times to a source that is read for the first time.
static void join_source_locked(struct fm_engine * engine, int64_t now)
{
  struct fm_evaluator * evaluator = engine->options.evaluator;
  if (engine->is_new_source && engine->has_begun) {
    fm_evaluator_shift(evaluator, fm_between(fm_evaluator_now(evaluator), now));
    engine->is_new_source = false;
  }
  FM_PAUSE();
}

static void take_due_locked(struct fm_engine * engine, int64_t now)
{
  struct fm_evaluator * evaluator = engine->options.evaluator;
  do {
    const uint32_t n = fm_evaluator_advance(evaluator, now, engine->found);
    const bool is_steady = n > 0 && engine->source == STEADY;
    announce_locked(engine, n, is_steady ? system_ahead_locked(engine) : 0);
  } while (fm_evaluator_wake(evaluator) <= now && fm_evaluator_wake(evaluator) != FM_NEVER);
}

// A message at the instant of a deadline comes before what is due then.
static void take_due_before_locked(struct fm_engine * engine, int64_t now)
{
  const bool is_here = now == fm_evaluator_now(engine->options.evaluator);
  take_due_locked(engine, is_here ? now : fm_later(now, -1));
}

// Take what is due by a clock that is followed, unless that is left to the end of a round.
static void take_due_now_locked(struct fm_engine * engine)
{
  int64_t now;
  if (engine->has_begun && engine->source != TOLD && !engine->has_rounds && !engine->is_closed &&
    read_source_locked(engine, 0, &now))
  {
    join_source_locked(engine, now);
    take_due_locked(engine, now);
  }
}

// The time of a message; false if there is none.
static bool read_for_message_locked(struct fm_engine * engine, int64_t received, int64_t * now)
{
  if (engine->has_rounds && engine->source != TOLD) {
    *now = engine->round;
    return engine->has_round;
  }
  if (!read_source_locked(engine, received, now)) {
    return false;
  }
  join_source_locked(engine, *now);
  return true;
}

// A deadline may now come before the end of a wait in fm_engine_take.
static void end_wait_if_earlier_locked(struct fm_engine * engine)
{
  if (engine->source == STEADY && !engine->has_rounds &&
    fm_evaluator_wake(engine->options.evaluator) < engine->wakes_at)
  {
    pthread_cond_signal(&engine->violation_queued);
  }
}

void fm_engine_advance(struct fm_engine * engine, int64_t now)
{
  fm_engine_lock(engine);
  if (engine->source == TOLD && !engine->is_closed) {
    engine->has_begun = true;
    take_due_locked(engine, now);
  }
  fm_engine_unlock(engine);
}

static void follow(
  struct fm_engine * engine, enum source source,
  int (* now)(void * clock, int64_t * nanoseconds), void * clock, bool is_outdated)
{
  fm_engine_lock(engine);
  take_due_now_locked(engine);  // brings the time up to date, for the shift
  engine->source = source;
  engine->now = now;
  engine->clock = clock;
  engine->is_outdated = is_outdated;
  engine->is_new_source = true;
  engine->has_round = false;
  take_due_now_locked(engine);
  pthread_cond_signal(&engine->violation_queued);
  fm_engine_unlock(engine);
}

void fm_engine_follow_steady(struct fm_engine * engine)
{
  follow(engine, STEADY, NULL, NULL, false);
}

void fm_engine_follow_clock(
  struct fm_engine * engine, int (* now)(void * clock, int64_t * nanoseconds), void * clock,
  bool is_outdated)
{
  follow(engine, CLOCK, now, clock, is_outdated);
}

void fm_engine_begin(struct fm_engine * engine)
{
  fm_engine_lock(engine);
  if (!engine->has_begun && engine->source != TOLD) {
    engine->has_begun = true;
    engine->is_new_source = false;  // the evaluator has no times yet
    take_due_now_locked(engine);
    pthread_cond_signal(&engine->violation_queued);
  }
  fm_engine_unlock(engine);
}

void fm_engine_begin_round(struct fm_engine * engine)
{
  fm_engine_lock(engine);
  engine->has_rounds = true;
  engine->has_round = !engine->is_closed && read_source_locked(engine, 0, &engine->round);
  if (engine->has_round) {
    join_source_locked(engine, engine->round);
  }
  fm_engine_unlock(engine);
}

void fm_engine_end_round(struct fm_engine * engine)
{
  fm_engine_lock(engine);
  if (engine->has_begun && engine->has_round && engine->source != TOLD && !engine->is_closed) {
    take_due_locked(engine, engine->round);
  }
  fm_engine_unlock(engine);
}

int64_t fm_engine_time_left(struct fm_engine * engine, int64_t most)
{
  int64_t left = most;
  fm_engine_lock(engine);
  if (engine->has_begun && engine->source == STEADY) {
    const int64_t now = read_clock(CLOCK_MONOTONIC);
    const int64_t deadline = fm_evaluator_deadline(engine->options.evaluator);
    left = deadline <= now ? 0 : fm_between(now, deadline);
  }
  fm_engine_unlock(engine);
  return left < most ? left : most;
}

void fm_engine_wake(struct fm_engine * engine)
{
  fm_engine_lock(engine);
  engine->is_outdated = false;
  pthread_cond_signal(&engine->violation_queued);
  fm_engine_unlock(engine);
}

int64_t fm_engine_deadline(struct fm_engine * engine)
{
  fm_engine_lock(engine);
  const int64_t deadline =
    engine->has_begun ? fm_evaluator_deadline(engine->options.evaluator) : FM_NEVER;
  fm_engine_unlock(engine);
  return deadline;
}

// ---- taking ------------------------------------------------------------------------------------

// Wait for a signal, or until a time of CLOCK_MONOTONIC.
static void wait_until_locked(
  struct fm_engine * engine, pthread_cond_t * condition, int64_t until)
{
  struct timespec end;
  end.tv_sec = (time_t)(until / SECOND_NS);
  end.tv_nsec = (long)(until % SECOND_NS);
  pthread_cond_timedwait(condition, &engine->mutex, &end);
}

static int64_t in_milliseconds(uint32_t milliseconds)
{
  return read_clock(CLOCK_MONOTONIC) + (int64_t)milliseconds * (SECOND_NS / 1000);
}

// Wait until a violation is queued, the engine is closed, or the time is over. Takes what is due.
static void wait_for_violation_locked(struct fm_engine * engine, uint32_t milliseconds)
{
  struct fm_evaluator * evaluator = engine->options.evaluator;
  const int64_t end = in_milliseconds(milliseconds);
  take_due_now_locked(engine);
  while (engine->outbox.n_violations == 0 && !engine->is_closed && milliseconds > 0 &&
    read_clock(CLOCK_MONOTONIC) < end)
  {
    const bool waits = engine->has_begun && engine->source == STEADY && !engine->has_rounds;
    const int64_t deadline = waits ? fm_evaluator_deadline(evaluator) : end;
    engine->wakes_at = deadline < end ? deadline : end;
    FM_PAUSE();
    wait_until_locked(engine, &engine->violation_queued, engine->wakes_at);
    engine->wakes_at = INT64_MIN;
    take_due_now_locked(engine);
  }
}

uint32_t fm_engine_take(
  struct fm_engine * engine, struct fm_violation * out, uint32_t room, uint32_t milliseconds)
{
  fm_engine_lock(engine);
  wait_for_violation_locked(engine, milliseconds);
  const uint32_t n = fm_outbox_take(&engine->outbox, out, room);
  fm_engine_unlock(engine);
  return n;
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
  const int64_t end = in_milliseconds(milliseconds);
  fm_engine_lock(engine);
  while (engine->outbox.n_details == 0 && !engine->is_closed &&
    read_clock(CLOCK_MONOTONIC) < end)
  {
    wait_until_locked(engine, &engine->detail_queued, end);
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
  if (topic < engine->options.n_topics) {
    fm_engine_lock(engine);
    fm_arrivals_begin_handover(&engine->topics[topic].arrivals, has_history);
    fm_engine_unlock(engine);
  }
}

void fm_engine_end_handover(struct fm_engine * engine, uint32_t topic)
{
  if (topic < engine->options.n_topics) {
    fm_engine_lock(engine);
    fm_arrivals_end_handover(&engine->topics[topic].arrivals);
    fm_engine_unlock(engine);
  }
}

uint64_t fm_engine_lost(struct fm_engine * engine, uint32_t topic)
{
  uint64_t lost = 0;
  if (topic < engine->options.n_topics) {
    fm_engine_lock(engine);
    lost = fm_arrivals_lost(&engine->topics[topic].arrivals);
    fm_engine_unlock(engine);
  }
  return lost;
}

// ---- messages ----------------------------------------------------------------------------------

static void keep_evidence(struct topic * topic, const uint8_t * message, size_t size)
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
    struct topic * cell = &engine->topics[topic];
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

// Store the fields that were read, and count the others. Returns whether all could be used.
static bool store_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_field * fields, int64_t now)
{
  const struct fm_topic * fed = &engine->options.topics[topic];
  bool is_usable = true;
  for (uint32_t k = 0; k < fed->n_inputs; ++k) {
    if (fields[k].outcome == FM_FIELD_READ) {
      fm_evaluator_store(engine->options.evaluator, fed->inputs[k], fields[k].value, now);
    } else {
      fm_evaluator_unusable(engine->options.evaluator, fed->inputs[k]);
      is_usable = false;
    }
  }
  return is_usable;
}

const struct fm_reader * fm_engine_reader(const struct fm_engine * engine, uint32_t topic)
{
  return &engine->options.readers->topics[topic];
}

uint32_t fm_engine_deliver_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_reading * reading,
  const struct fm_origin * origin)
{
  struct topic * cell = &engine->topics[topic];
  struct fm_evaluator * evaluator = engine->options.evaluator;
  int64_t now;
  if (engine->is_closed) {
    return FM_RECEIVED;
  }
  if (fm_arrivals_is_repeated(&cell->arrivals, origin)) {
    return FM_REPEATED;
  }
  fm_arrivals_note(&cell->arrivals, origin);
  if (!reading->is_decoded) {
    fm_evaluator_undecodable(evaluator, topic);
    return FM_UNDECODABLE;
  }
  const bool has_time = read_for_message_locked(engine, origin->received, &now);
  const int64_t stamp = has_time && engine->source == CLOCK ? now : origin->received;
  if (!has_time || !engine->has_begun) {
    now = fm_evaluator_now(evaluator);
  } else if (!engine->has_rounds) {
    take_due_before_locked(engine, now);
  }
  if (!store_locked(engine, topic, reading->fields, now)) {
    keep_evidence(cell, reading->message, reading->size);
  }
  announce_locked(engine, fm_evaluator_message(evaluator, topic, stamp, engine->found), 0);
  end_wait_if_earlier_locked(engine);
  return FM_RECEIVED;
}

uint32_t fm_engine_message(
  struct fm_engine * engine, uint32_t topic, const uint8_t * message, size_t size,
  const struct fm_origin * origin)
{
  if (topic >= engine->options.n_topics) {
    return FM_RECEIVED;
  }
  fm_engine_lock(engine);
  struct fm_reading reading = {engine->fields, message, size, false};
  reading.is_decoded = fm_engine_reader(engine, topic)->read(message, size, engine->fields);
  const uint32_t receipt = fm_engine_deliver_locked(engine, topic, &reading, origin);
  fm_engine_unlock(engine);
  return receipt;
}

void fm_engine_reset(struct fm_engine * engine)
{
  fm_engine_lock(engine);
  take_due_now_locked(engine);
  fm_evaluator_reset(engine->options.evaluator);
  take_due_now_locked(engine);
  fm_engine_unlock(engine);
}

// ---- answers -----------------------------------------------------------------------------------

struct fm_requirement_counts fm_engine_requirement_counts(
  struct fm_engine * engine, uint32_t requirement)
{
  fm_engine_lock(engine);
  const struct fm_requirement_counts counts =
    fm_evaluator_requirement_counts(engine->options.evaluator, requirement);
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

struct fm_silence fm_engine_silence(struct fm_engine * engine, uint32_t input)
{
  fm_engine_lock(engine);
  take_due_now_locked(engine);  // brings the time up to date
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
