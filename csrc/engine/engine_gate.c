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

/// engine_gate.c: the functions of engine.h with which a gate judges and replaces messages.

#define _POSIX_C_SOURCE 200809L

#include "engine_parts.h"

#include "instance.h"
#include "thread.h"

#define SECOND_NS 1000000000

void fm_engine_guard(
  struct fm_engine * engine, struct fm_gate * gate, const struct fm_gate_options * options)
{
  fm_engine_lock(engine);
  engine->gate = gate;
  engine->gated = options->from;
  fm_engine_unlock(engine);
}

void fm_engine_on_due(struct fm_engine * engine, void (* on_due)(void * argument), void * argument)
{
  fm_engine_lock(engine);
  engine->on_due = on_due;
  engine->on_due_argument = argument;
  fm_engine_unlock(engine);
}

// The fields of a message of the gate's topic, which may feed no input; NULL if they cannot be
// read.
static const struct fm_field * read_gated_locked(
  struct fm_engine * engine, const uint8_t * message, size_t size, int64_t stamp)
{
  struct fm_reading reading;
  if (engine->gated == engine->options.n_topics) {
    return engine->fields;
  }
  if (!fm_engine_read(engine, engine->gated, message, size, engine->fields, &reading) ||
    reading.is_unrelated)
  {
    return NULL;
  }
  return fm_engine_prepare_locked(engine, engine->gated, engine->fields, stamp);
}

// A step of the gate, at a time of the evaluator, with the stamp of its violations.
struct gated_step
{
  int64_t now;
  int64_t stamp;
  int64_t source;     // the time of the source; INT64_MIN: it has none
};

// Take what is due before a message of the gate's topic, which is never left to a round: it is to
// be sent at once. Under FM_TIMED it takes effect now, and not when it was received: it may have
// waited in the middleware's queue while an input became silent.
static struct gated_step begin_gated_locked(struct fm_engine * engine, int64_t received)
{
  struct fm_evaluator * evaluator = engine->options.evaluator;
  struct gated_step step = {0, engine->source == FM_CLOCK ? 0 : received, INT64_MIN};
  int64_t now;
  if (!fm_engine_read_now_locked(engine, received, &now) || !engine->has_begun) {
    step.now = fm_evaluator_arrival(evaluator, fm_evaluator_now(evaluator));
  } else {
    if (engine->queues != NULL && engine->has_round) {
      now = fm_within(engine->round, fm_evaluator_now(evaluator), now);
    }
    step.source = now;
    step.stamp = engine->source == FM_CLOCK ? now : received;
    if (fm_evaluator_is_timed(evaluator)) {
      fm_engine_note_restart_locked(engine, now);
      fm_engine_release_locked(engine, now);
    }
    step.now = fm_evaluator_arrival(evaluator, now);
    fm_engine_take_due_before_locked(engine, step.now);
    if (fm_evaluator_is_timed(evaluator) && engine->source == FM_STEADY) {
      step.stamp = fm_later(step.now, fm_engine_stamps_ahead_locked(engine));
    }
  }
  return step;
}

static int64_t stamp_of_step(const struct fm_engine * engine, const struct gated_step * step)
{
  return fm_evaluator_is_timed(engine->options.evaluator) ? step->now : step->stamp;
}

static void end_gated_locked(struct fm_engine * engine, const struct gated_step * step, uint32_t n)
{
  const bool is_timed = fm_evaluator_is_timed(engine->options.evaluator);
  fm_engine_queue_locked(engine, n, n > 0 && is_timed ? fm_engine_stamps_ahead_locked(engine) : 0);
  fm_gate_finish(engine->gate);
  fm_engine_update_states_locked(engine);  // a message that is withheld never happened
  int64_t now;
  if (is_timed && step->source != INT64_MIN && fm_engine_read_now_locked(engine, 0, &now)) {
    fm_engine_take_due_after_locked(engine, step->now, now);
  }
  fm_engine_end_wait_if_earlier_locked(engine);
}

static void keep_gated_locked(
  struct fm_engine * engine, const uint8_t * message, size_t size,
  const struct fm_origin * origin, const struct gated_step * step, bool is_read)
{
  const struct fm_reading reading = {engine->fields, message, size, 0, is_read, false};
  if (engine->gated < engine->options.n_topics) {
    const bool has_time = step->source != INT64_MIN || engine->source != FM_CLOCK;
    fm_engine_keep_message_locked(
      engine, engine->gated, &reading, has_time ? step->stamp : 0, origin);
  }
}

static uint32_t judge_locked(
  struct fm_engine * engine, const uint8_t * message, size_t size,
  const struct fm_origin * origin)
{
  struct fm_arrivals * arrivals = &engine->topics[engine->gated].arrivals;
  if (engine->is_closed || engine->gate == NULL) {
    return FM_CLOSED;
  }
  if (fm_arrivals_is_repeated(arrivals, origin)) {
    return FM_DUPLICATE;
  }
  fm_arrivals_note(arrivals, origin);
  fm_engine_note_behind_locked(engine, &engine->topics[engine->gated], origin->received);
  fm_engine_look_for_hang_locked(engine);
  const struct gated_step step = begin_gated_locked(engine, origin->received);
  const struct fm_field * fields = read_gated_locked(engine, message, size, step.stamp);
  keep_gated_locked(engine, message, size, origin, &step, fields != NULL);
  uint32_t n = 0;
  const uint32_t judgement = fm_gate_judge(
    engine->gate, fields, step.now, stamp_of_step(engine, &step), fm_steady_time(),
    engine->found, &n);
  end_gated_locked(engine, &step, n);
  return judgement;
}

static int64_t due_locked(const struct fm_engine * engine)
{
  return engine->gate == NULL || engine->is_closed ? FM_NEVER : fm_gate_due(engine->gate);
}

uint32_t fm_engine_judge(
  struct fm_engine * engine, const uint8_t * message, size_t size,
  const struct fm_origin * origin, int64_t * due)
{
  fm_engine_begin_order(engine);
  fm_engine_lock(engine);
  const uint32_t judgement = judge_locked(engine, message, size, origin);
  *due = due_locked(engine);
  fm_engine_unlock(engine);
  fm_engine_end_order(engine);
  return judgement;
}

// Write a builtin_interfaces/msg/Time, in the byte order of the message.
static void write_stamp(uint8_t * message, size_t size, int64_t stamp_at, int64_t time)
{
  const int64_t positive = time < 0 ? 0 : time;
  const uint32_t words[2] = {
    (uint32_t)(positive / SECOND_NS), (uint32_t)(positive % SECOND_NS)};
  if (stamp_at < 4 || size < 12 || (size_t)stamp_at > size - 8) {
    return;
  }
  const bool is_little = (message[1] & 1u) != 0;
  for (size_t k = 0; k < 8; ++k) {
    const size_t byte = is_little ? k % 4 : 3 - k % 4;
    message[(size_t)stamp_at + k] = (uint8_t)(words[k / 4] >> (8 * byte));
  }
}

int64_t fm_engine_ros_time(struct fm_engine * engine)
{
  int64_t now = 0;
  fm_engine_lock(engine);
  if (engine->source != FM_CLOCK) {
    now = fm_read_clock(CLOCK_REALTIME);
  } else if (engine->is_outdated || engine->now(engine->clock, &now) != 0) {
    now = 0;
  }
  fm_engine_unlock(engine);
  return now;
}

void fm_engine_write_time(
  struct fm_engine * engine, uint8_t * message, size_t size, int64_t stamp_at)
{
  write_stamp(message, size, stamp_at, fm_engine_ros_time(engine));
}

static bool replace_locked(
  struct fm_engine * engine, uint8_t * message, size_t size, int64_t stamp_at)
{
  uint32_t n = 0;
  if (engine->is_closed || engine->gate == NULL) {
    return false;
  }
  const int64_t system = fm_read_clock(CLOCK_REALTIME);
  struct gated_step step = begin_gated_locked(
    engine, engine->source == FM_TOLD ? fm_evaluator_now(engine->options.evaluator) : system);
  write_stamp(message, size, stamp_at, step.stamp);
  const struct fm_field * fields = read_gated_locked(engine, message, size, step.stamp);
  if (fields == NULL) {
    for (uint32_t k = 0; k < engine->options.topics[engine->gated].n_inputs; ++k) {
      engine->fields[k] = (struct fm_field) {.outcome = FM_FIELD_EMPTY};
    }
    fields = engine->fields;
  }
  const bool is_sent = fm_gate_replace(
    engine->gate, fields, step.now, stamp_of_step(engine, &step), fm_steady_time(),
    engine->found, &n);
  end_gated_locked(engine, &step, n);
  return is_sent;
}

bool fm_engine_replace(
  struct fm_engine * engine, uint8_t * message, size_t size, int64_t stamp_at, int64_t * due)
{
  fm_engine_begin_order(engine);
  fm_engine_lock(engine);
  const bool is_sent = replace_locked(engine, message, size, stamp_at);
  *due = due_locked(engine);
  fm_engine_unlock(engine);
  fm_engine_end_order(engine);
  return is_sent;
}

int64_t fm_engine_replacement_due(struct fm_engine * engine)
{
  fm_engine_lock(engine);
  const int64_t due = due_locked(engine);
  fm_engine_unlock(engine);
  return due;
}
