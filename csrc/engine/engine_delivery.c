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

/// engine_delivery.c: a message takes effect, after what is due before it.

#define _POSIX_C_SOURCE 200809L

#include "engine_parts.h"

#include "instance.h"
#include "thread.h"

#define FEWEST_AHEAD_NS INT64_C(100000000)

// A message waits for others with earlier stamps. If there is no room for it, the one with the
// earliest stamp takes effect now; if there is no memory for its bytes, it does.
static void wait_locked(
  struct fm_engine * engine, const struct fm_delivery * delivery, int64_t stamp, int64_t now)
{
  const uint32_t n_inputs = engine->options.topics[delivery->topic].n_inputs;
  const bool has_parts = fm_engine_reader(engine, delivery->topic)->parts != NULL;
  if (engine->waiting.n == engine->waiting.capacity) {
    engine->topics[fm_reorder_first(&engine->waiting)->delivery.topic].counts.overflows += 1;
    fm_engine_put_waiting_locked(engine, now);
  }
  if (!fm_reorder_add(&engine->waiting, delivery, stamp, n_inputs, has_parts)) {
    engine->topics[delivery->topic].counts.overflows += 1;
    (void)fm_engine_put_locked(engine, delivery, now);
  }
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
  struct fm_engine * engine, const struct fm_delivery * delivery, int64_t stamp, int64_t now)
{
  struct fm_order_counts * counts = &engine->topics[delivery->topic].counts;
  const bool is_late = stamp < now;
  counts->late += is_late ? 1u : 0u;
  count_ahead(
    counts, stamp - fm_later(now, engine->options.reorder),
    engine->options.reorder);
  if (is_late) {
    fm_engine_release_locked(engine, now);
    (void)fm_engine_put_locked(engine, delivery, now);
  } else {
    wait_locked(engine, delivery, stamp, now);
  }
}

// A message that is a step, if it is one, when it is delivered. Under FM_TIMED a step is an
// instant of the evaluator.
static void deliver_step_locked(
  struct fm_engine * engine, const struct fm_delivery * delivery, int64_t stamp, int64_t now)
{
  const int64_t instant = fm_evaluator_is_timed(engine->options.evaluator) ? now : stamp;
  const uint32_t topic = delivery->topic;
  if (engine->options.scopes != NULL) {
    (void)fm_engine_step_scopes_locked(engine, delivery, now, fm_between(now, stamp));
    return;
  }
  fm_engine_store_locked(engine, topic, delivery->fields, now);
  fm_engine_announce_locked(
    engine, fm_evaluator_message(engine->options.evaluator, topic, instant, engine->found),
    fm_between(instant, stamp));
}

// Under FM_TIMED: a message that takes effect at an instant, `now` by the source.
static void deliver_timed_locked(
  struct fm_engine * engine, const struct fm_delivery * delivery, int64_t stamp,
  int64_t instant, int64_t now)
{
  if (engine->options.uses_header_stamps) {
    deliver_stamped_locked(engine, delivery, stamp, now);
  } else {
    const int64_t taken = fm_engine_put_locked(engine, delivery, instant);
    fm_engine_take_due_after_locked(engine, taken, now);
  }
}

// The time of a message, for its age and the black box. Under FM_TIMED it is that at which the
// message takes effect: a recording then has the times by which the node judged.
static int64_t time_of_locked(
  struct fm_engine * engine, int64_t received, bool has_time, bool is_timed, int64_t instant)
{
  if (engine->source == FM_CLOCK) {
    return has_time ? fm_later(instant, engine->options.reorder) : 0;
  }
  const bool is_converted = is_timed && received > 0 && engine->source == FM_STEADY &&
    !fm_engine_uses_headers(engine);
  const int64_t taken = !is_converted || engine->options.scopes != NULL ? instant :
    fm_evaluator_arrival(engine->options.evaluator, instant);
  return is_converted ? fm_later(taken, engine->system_ahead) : received;
}

static void deliver_fields_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_reading * reading,
  const struct fm_origin * origin)
{
  struct fm_evaluator * evaluator = engine->options.evaluator;
  const int64_t received = origin->received;
  int64_t now = 0;
  const bool has_time = fm_engine_read_for_message_locked(engine, received, &now);
  const bool has_begun = has_time && engine->has_begun;
  const bool is_timed = has_begun && fm_evaluator_is_timed(evaluator);
  int64_t instant = now;
  if (is_timed) {
    fm_engine_note_restart_locked(engine, now);
    instant = fm_engine_uses_headers(engine) ? now :
      fm_engine_instant_locked(engine, received, now);
  }
  const int64_t stamp = time_of_locked(engine, received, has_time, is_timed, instant);
  const struct fm_delivery delivery = {
    topic, origin->key_size, fm_engine_prepare_locked(engine, topic, reading->fields, stamp),
    reading->message, reading->size, origin->key, stamp};
  fm_engine_keep_message_locked(engine, topic, reading, stamp, origin);
  if (!has_begun) {
    now = fm_evaluator_arrival(evaluator, fm_evaluator_now(evaluator));
    deliver_step_locked(engine, &delivery, stamp, now);
  } else if (is_timed) {
    deliver_timed_locked(engine, &delivery, reading->stamp, instant, now);
  } else {
    if (engine->in_round) {
      now = fm_engine_instant_locked(engine, received, now);
    }
    fm_engine_take_due_before_locked(engine, now);
    if (fm_evaluator_measures(evaluator)) {
      (void)fm_evaluator_arrival(evaluator, fm_engine_instant_locked(engine, received, now));
    }
    deliver_step_locked(engine, &delivery, stamp, now);
  }
}

// A message that the `where` of this topic does not select, for others with its name.
static void keep_unrelated_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_reading * reading,
  const struct fm_origin * origin)
{
  int64_t now = 0;
  const bool has_time = fm_engine_read_for_message_locked(engine, origin->received, &now);
  const bool is_timed =
    has_time && engine->has_begun && fm_evaluator_is_timed(engine->options.evaluator);
  const int64_t instant = is_timed && !fm_engine_uses_headers(engine) ?
    fm_engine_instant_locked(engine, origin->received, now) : now;
  fm_engine_keep_message_locked(
    engine, topic, reading,
    time_of_locked(engine, origin->received, has_time, is_timed, instant), origin);
}

bool fm_engine_accept_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_reading * reading,
  const struct fm_origin * origin, uint32_t * receipt)
{
  struct fm_engine_topic * cell = &engine->topics[topic];
  *receipt = FM_RECEIVED;
  if (engine->is_closed) {
    return false;
  }
  if (fm_arrivals_is_repeated(&cell->arrivals, origin)) {
    *receipt = FM_REPEATED;
    return false;
  }
  fm_arrivals_note(&cell->arrivals, origin);
  fm_engine_note_behind_locked(engine, cell, origin->received);
  if (!reading->is_decoded) {
    *receipt = FM_UNDECODABLE;
    fm_evaluator_undecodable(engine->options.evaluator, topic);
    fm_engine_keep_message_locked(
      engine, topic, reading, engine->source == FM_CLOCK ? 0 : origin->received, origin);
  }
  if (reading->is_unrelated) {
    *receipt = FM_UNRELATED;
    if (cell->keeping == FM_KEEP_ALL) {
      keep_unrelated_locked(engine, topic, reading, origin);
    }
  }
  return *receipt == FM_RECEIVED;
}

void fm_engine_deliver_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_reading * reading,
  const struct fm_origin * origin)
{
  deliver_fields_locked(engine, topic, reading, origin);
  fm_engine_end_wait_if_earlier_locked(engine);
}

void fm_engine_drop_locked(struct fm_engine * engine, uint32_t topic, uint32_t n)
{
  engine->topics[topic].arrivals.dropped += n;
  for (uint32_t k = 0; k < n && !engine->is_closed; ++k) {
    fm_evaluator_undecodable(engine->options.evaluator, topic);
  }
}
