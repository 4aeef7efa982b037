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

/// engine_due.c: what is due by the time of an engine, and messages that wait for their stamps.

#define _POSIX_C_SOURCE 200809L

#include "engine_parts.h"

#include "due.h"
#include "instance.h"
#include "thread.h"

// Take what is due by `now`, or before it if the clock `stands` at `now`.
static void advance_locked(struct fm_engine * engine, int64_t now, bool stands)
{
  struct fm_evaluator * evaluator = engine->options.evaluator;
  const int64_t last = stands ? fm_later(now, -1) : now;
  if (engine->options.scopes != NULL) {
    fm_engine_advance_scopes_locked(engine, now, stands);
    return;
  }
  do {
    const uint32_t n = stands ?
      fm_evaluator_advance_to(evaluator, now, engine->found) :
      fm_evaluator_advance(evaluator, now, engine->found);
    if (engine->n_restarts != fm_evaluator_time_counts(evaluator).restarts) {
      engine->n_restarts = fm_evaluator_time_counts(evaluator).restarts;
      if (fm_evaluator_is_timed(evaluator)) {  // all groups have started afresh
        fm_engine_forget_violations_locked(engine);
      }
    }
    fm_engine_announce_locked(engine, n, n > 0 ? fm_engine_stamps_ahead_locked(engine) : 0);
  } while (fm_evaluator_wake(evaluator) <= last && fm_evaluator_wake(evaluator) != FM_NEVER);
}

// A message at the instant of a deadline comes before what is due then.
void fm_engine_take_due_before_locked(struct fm_engine * engine, int64_t now)
{
  struct fm_evaluator * evaluator = engine->options.evaluator;
  if (!fm_evaluator_has_begun(evaluator)) {
    advance_locked(engine, now, true);  // begins the time
  } else if (engine->options.scopes != NULL && fm_evaluator_is_timed(evaluator)) {
    advance_locked(engine, now, true);  // an instance may have taken a message at this time
  } else if (now != fm_evaluator_now(evaluator)) {
    advance_locked(engine, fm_later(now, -1), false);
  } else if (!fm_evaluator_is_timed(evaluator) && engine->source != FM_CLOCK) {
    advance_locked(engine, now, false);
  }
}

void fm_engine_take_due_after_locked(struct fm_engine * engine, int64_t instant, int64_t now)
{
  const int64_t next = fm_later(instant, 1);
  if (engine->source == FM_STEADY && !engine->in_round && next <= now &&
    fm_engine_wakes_at_locked(engine) <= next)
  {
    fm_engine_take_due_before_locked(engine, fm_later(next, 1));
  }
}

// Under FM_TIMED: let a message take effect at an instant. Returns when it does.
int64_t fm_engine_put_locked(
  struct fm_engine * engine, const struct fm_delivery * delivery, int64_t instant)
{
  struct fm_evaluator * evaluator = engine->options.evaluator;
  if (engine->options.scopes != NULL) {
    fm_engine_take_due_before_locked(engine, instant);
    return fm_engine_step_scopes_locked(engine, delivery, instant, FM_NEVER);
  }
  const int64_t now = fm_evaluator_arrival(evaluator, instant);
  fm_engine_take_due_before_locked(engine, now);
  fm_engine_store_locked(engine, delivery->topic, delivery->fields, now);
  const uint32_t n = fm_evaluator_message(evaluator, delivery->topic, now, engine->found);
  fm_engine_announce_locked(engine, n, n > 0 ? fm_engine_stamps_ahead_locked(engine) : 0);
  return now;
}

void fm_engine_put_waiting_locked(struct fm_engine * engine, int64_t now)
{
  const struct fm_waiting * first = fm_reorder_first(&engine->waiting);
  const int64_t earliest = fm_engine_time_locked(engine);
  const int64_t instant = first->stamp < earliest ? earliest : first->stamp;
  (void)fm_engine_put_locked(engine, &first->delivery, instant < now ? instant : now);
  fm_reorder_remove_first(&engine->waiting);
}

// No waiting message is of the time that comes. One with a stamp ahead of the time that is over
// takes effect at its end, so that nothing is due that has never come.
void fm_engine_release_all_locked(struct fm_engine * engine)
{
  const int64_t earliest = fm_engine_time_locked(engine);
  const int64_t end = engine->released < earliest ? earliest : engine->released;
  while (fm_reorder_first(&engine->waiting) != NULL) {
    fm_engine_put_waiting_locked(engine, end);
  }
}

void fm_engine_release_locked(struct fm_engine * engine, int64_t now)
{
  const struct fm_waiting * first = fm_reorder_first(&engine->waiting);
  if (now < engine->released) {
    fm_engine_release_all_locked(engine);
    first = NULL;
  }
  while (first != NULL && first->stamp <= now) {
    fm_engine_put_waiting_locked(engine, now);
    first = fm_reorder_first(&engine->waiting);
  }
  engine->released = now;
}

// A message at the very instant at which the time begins comes before what is due then.
void fm_engine_take_due_by_locked(struct fm_engine * engine, int64_t now)
{
  fm_engine_release_locked(engine, now);
  const bool begins = !fm_evaluator_has_begun(engine->options.evaluator);
  advance_locked(engine, now, begins || engine->source == FM_CLOCK);
}

void fm_engine_note_restart_locked(struct fm_engine * engine, int64_t now)
{
  if (now < engine->released) {
    fm_engine_release_locked(engine, now);
    advance_locked(engine, now, true);  // the message comes before what is due at this instant
  }
}

// With stamps of headers: note that the system time was set back, also by less than has passed
// since it was last read. What waits has stamps of before, and takes effect.
static void note_set_back_locked(struct fm_engine * engine)
{
  if (engine->source != FM_STEADY || !fm_engine_uses_headers(engine)) {
    return;
  }
  const int64_t before = engine->ahead_noted;  // others may have compared the clocks since
  engine->ahead_noted = fm_engine_system_ahead_locked(engine);
  const int64_t step = fm_between(engine->ahead_noted, before);
  if (engine->has_begun && !engine->is_new_source && step > FM_CLOSE_NS) {
    const int64_t now = fm_engine_time_locked(engine);
    fm_engine_take_due_by_locked(engine, fm_later(now, -step));
  }
}

// Shift the evaluator's times to a source that is read for the first time.
static void join_source_locked(struct fm_engine * engine, int64_t now)
{
  note_set_back_locked(engine);
  if (engine->is_new_source && engine->has_begun) {
    fm_engine_shift_locked(engine, fm_between(fm_engine_time_locked(engine), now));
    engine->is_new_source = false;
  }
  FM_PAUSE();
}

bool fm_engine_read_now_locked(struct fm_engine * engine, int64_t received, int64_t * now)
{
  if (!fm_engine_read_source_locked(engine, received, now)) {
    return false;
  }
  join_source_locked(engine, *now);
  return true;
}

bool fm_engine_read_for_message_locked(struct fm_engine * engine, int64_t received, int64_t * now)
{
  if (engine->in_round && engine->source != FM_TOLD) {
    *now = engine->source == FM_CLOCK ? fm_engine_clock_at_locked(engine, received) :
      fm_engine_uses_headers(engine) ?
      fm_engine_stamps_at_locked(engine, received) : engine->round;
    return engine->has_round;
  }
  return fm_engine_read_now_locked(engine, received, now);
}

int64_t fm_engine_deadline_locked(struct fm_engine * engine)
{
  const struct fm_waiting * first = fm_reorder_first(&engine->waiting);
  const int64_t deadline = fm_engine_next_due_locked(engine);
  return first != NULL && first->stamp < deadline ? first->stamp : deadline;
}

void fm_engine_take_due_now_locked(struct fm_engine * engine)
{
  int64_t now;
  if (engine->has_begun && engine->source != FM_TOLD && !engine->in_round &&
    !engine->is_closed && fm_engine_read_source_locked(engine, 0, &now))
  {
    join_source_locked(engine, now);
    fm_engine_take_due_by_locked(engine, now);
  }
}

void fm_engine_end_wait_if_earlier_locked(struct fm_engine * engine)
{
  const struct fm_waiting * first = fm_reorder_first(&engine->waiting);
  if (engine->source == FM_STEADY &&
    (fm_engine_wakes_at_locked(engine) < engine->wakes_at ||
    (first != NULL && first->stamp < engine->wakes_at)))
  {
    pthread_cond_signal(&engine->violation_queued);
  }
}

// Note when the clock moved. Returns whether that changes nothing: it has not gone back, and
// nothing is due.
bool fm_engine_mark_clock_locked(struct fm_engine * engine)
{
  int64_t now;
  if (engine->source != FM_CLOCK || !fm_engine_read_source_locked(engine, 0, &now)) {
    return false;
  }
  const struct fm_clock_mark mark = {fm_read_clock(CLOCK_REALTIME), now};
  const struct fm_clock_mark last = engine->n_marks == 0 ?
    (struct fm_clock_mark) {INT64_MIN, INT64_MAX} :
    engine->marks[(engine->n_marks - 1u) % FM_MOST_MARKS];
  const bool has_moved_on = last.clock <= now;
  if (mark.system < last.system) {
    engine->n_marks = 0;  // set back: the marks of before are not in order with those since
  }
  engine->marks[engine->n_marks % FM_MOST_MARKS] = mark;
  engine->n_marks += 1;
  const bool is_quiet = has_moved_on && fm_engine_deadline_locked(engine) > now;
  if (is_quiet) {
    fm_see_time(engine->options.evaluator, now);
  }
  return is_quiet;
}
