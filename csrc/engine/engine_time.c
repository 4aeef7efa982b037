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

/// engine_time.c: the time of an engine, and what is due by it. See engine.h and engine_time.h.

#define _POSIX_C_SOURCE 200809L

#include "engine_parts.h"

#include "deadlines.h"
#include "instance.h"
#include "thread.h"

#define SECOND_NS 1000000000
#define CLOSE_NS 10000  // two readings of clocks without a preemption in between
#define MOST_READINGS 10
#define SET_NS 1000000  // a change of the system time by more is no error of a measurement

// Tests sleep between two steps of the handling of time.
#ifndef FM_PAUSE
#define FM_PAUSE()
#endif

// ---- clocks ------------------------------------------------------------------------------------

// How much the system time is ahead of the steady clock. Readings may be far apart if the thread
// is preempted, so that they only give limits. What was found before holds while it is within
// them: the stamps of periods are then exactly a period apart.
int64_t fm_engine_system_ahead_locked(struct fm_engine * engine)
{
  int64_t before;
  int64_t system;
  int64_t after;
  int readings = 0;
  do {
    before = fm_steady_time();
    FM_PAUSE();
    system = fm_read_clock(CLOCK_REALTIME);
    FM_PAUSE();
    after = fm_steady_time();
    readings += 1;
  } while (after - before > CLOSE_NS && readings < MOST_READINGS);
  const int64_t found = engine->system_ahead;
  if (found < system - after) {
    engine->system_ahead = system - after;
  } else if (found > system - before) {
    engine->system_ahead = system - before;
  }
  const int64_t change = fm_between(found, engine->system_ahead);
  if (engine->ahead_read == 0 || change > SET_NS || change < -SET_NS) {
    engine->ahead_before = engine->ahead_read == 0 ? engine->system_ahead : found;
    engine->set_after = engine->ahead_read;
  }
  engine->ahead_read = before;
  return engine->system_ahead;
}

static bool uses_headers(const struct fm_engine * engine)
{
  return engine->options.uses_header_stamps;
}

// Within a callback the steady clock stands still, but for a message that was received since.
static int64_t steady_time_locked(const struct fm_engine * engine, int64_t received)
{
  return engine->began != 0 && fm_between(engine->system_ahead, received) <= engine->began ?
         engine->began : fm_steady_time();
}

// Read the time of the source; returns false if it has none. `told`: the time if it is told. With
// stamps of headers, messages take effect, and deadlines come, `reorder` later.
static bool read_source_locked(struct fm_engine * engine, int64_t told, int64_t * now)
{
  *now = told;
  if (engine->source == FM_STEADY) {
    *now = uses_headers(engine) ?
      fm_read_clock(CLOCK_REALTIME) : steady_time_locked(engine, told);
  } else if (engine->source == FM_CLOCK &&
    (engine->is_outdated || engine->now(engine->clock, now) != 0 || *now <= 0))
  {
    return false;
  }
  *now = fm_later(*now, -engine->options.reorder);
  return true;
}

int64_t fm_engine_stamps_ahead_locked(struct fm_engine * engine)
{
  return engine->source == FM_STEADY && !uses_headers(engine) ? fm_engine_system_ahead_locked(engine) : 0;
}

// The time of reception is system time, which somebody may have set since: a time before that, or
// in the future, was read before.
static int64_t steady_of_locked(struct fm_engine * engine, int64_t received, int64_t now)
{
  const int64_t ahead = fm_engine_system_ahead_locked(engine);
  const int64_t instant = fm_between(ahead, received);
  return instant < engine->set_after || instant > now ?
         fm_between(engine->ahead_before, received) : instant;
}

int64_t fm_engine_instant_locked(struct fm_engine * engine, int64_t received, int64_t now)
{
  if (engine->source != FM_STEADY || received <= 0) {
    return now;
  }
  const int64_t earliest = fm_evaluator_now(engine->options.evaluator);
  return fm_within(steady_of_locked(engine, received, now), earliest, now);
}

// The clocks are compared only if it may be a longer time than any before. Within a callback,
// which has just begun, none is read before that: it would cost an eighth of a message.
void fm_engine_note_behind_locked(
  struct fm_engine * engine, struct fm_engine_topic * topic, int64_t received)
{
  if (engine->source == FM_TOLD || received <= 0) {
    return;
  }
  const int64_t system = engine->began == 0 || engine->ahead_read == 0 ?
    fm_read_clock(CLOCK_REALTIME) : fm_later(engine->began, engine->system_ahead);
  const int64_t apart = fm_between(received, system);
  if (apart < -SET_NS || apart > topic->behind) {
    const int64_t now = fm_steady_time();
    const int64_t behind = fm_since(steady_of_locked(engine, received, now), now);
    topic->behind = behind > topic->behind ? behind : topic->behind;
  }
}

// With stamps of headers: note that the system time was set back, also by less than has passed
// since it was last read. What waits has stamps of before, and takes effect.
static void note_set_back_locked(struct fm_engine * engine)
{
  if (engine->source != FM_STEADY || !uses_headers(engine)) {
    return;
  }
  const int64_t before = engine->ahead_noted;  // others may have compared the clocks since
  engine->ahead_noted = fm_engine_system_ahead_locked(engine);
  const int64_t step = fm_between(engine->ahead_noted, before);
  if (engine->has_begun && !engine->is_new_source && step > CLOSE_NS) {
    const int64_t now = fm_evaluator_now(engine->options.evaluator);
    fm_engine_take_due_by_locked(engine, fm_later(now, -step));
  }
}

// Shift the evaluator's times to a source that is read for the first time.
static void join_source_locked(struct fm_engine * engine, int64_t now)
{
  struct fm_evaluator * evaluator = engine->options.evaluator;
  note_set_back_locked(engine);
  if (engine->is_new_source && engine->has_begun) {
    fm_evaluator_shift(evaluator, fm_between(fm_evaluator_now(evaluator), now));
    engine->is_new_source = false;
  }
  FM_PAUSE();
}

// Take what is due by `now`, or before it if the clock `stands` at `now`.
static void advance_locked(struct fm_engine * engine, int64_t now, bool stands)
{
  struct fm_evaluator * evaluator = engine->options.evaluator;
  const int64_t last = stands ? fm_later(now, -1) : now;
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

// No waiting message is of the time that comes. One with a stamp ahead of the time that is over
// takes effect at its end, so that nothing is due that has never come.
static void release_all_locked(struct fm_engine * engine)
{
  const int64_t earliest = fm_evaluator_now(engine->options.evaluator);
  const int64_t end = engine->released < earliest ? earliest : engine->released;
  while (fm_reorder_first(&engine->waiting) != NULL) {
    fm_engine_put_waiting_locked(engine, end);
  }
}

void fm_engine_release_locked(struct fm_engine * engine, int64_t now)
{
  const struct fm_waiting * first = fm_reorder_first(&engine->waiting);
  if (now < engine->released) {
    release_all_locked(engine);
    first = NULL;
  }
  while (first != NULL && first->stamp <= now) {
    fm_engine_put_waiting_locked(engine, now);
    first = fm_reorder_first(&engine->waiting);
  }
  engine->released = now;
}

void fm_engine_take_due_by_locked(struct fm_engine * engine, int64_t now)
{
  fm_engine_release_locked(engine, now);
  advance_locked(engine, now, engine->source == FM_CLOCK);
}

void fm_engine_note_restart_locked(struct fm_engine * engine, int64_t now)
{
  if (now < engine->released) {
    fm_engine_take_due_by_locked(engine, now);
  }
}

// A message at the instant of a deadline comes before what is due then.
void fm_engine_take_due_before_locked(struct fm_engine * engine, int64_t now)
{
  struct fm_evaluator * evaluator = engine->options.evaluator;
  if (!fm_evaluator_has_begun(evaluator)) {
    advance_locked(engine, now, true);  // begins the time
  } else if (now != fm_evaluator_now(evaluator)) {
    advance_locked(engine, fm_later(now, -1), false);
  } else if (!fm_evaluator_is_timed(evaluator) && engine->source != FM_CLOCK) {
    advance_locked(engine, now, false);
  }
}

int64_t fm_engine_deadline_locked(struct fm_engine * engine)
{
  const struct fm_waiting * first = fm_reorder_first(&engine->waiting);
  const int64_t deadline = fm_evaluator_deadline(engine->options.evaluator);
  return first != NULL && first->stamp < deadline ? first->stamp : deadline;
}

void fm_engine_take_due_now_locked(struct fm_engine * engine)
{
  int64_t now;
  if (engine->has_begun && engine->source != FM_TOLD && !engine->in_round &&
    !engine->is_closed && read_source_locked(engine, 0, &now))
  {
    join_source_locked(engine, now);
    fm_engine_take_due_by_locked(engine, now);
  }
}

// Note when the clock moved. Returns whether that changes nothing: it has not gone back, and
// nothing is due.
static bool mark_clock_locked(struct fm_engine * engine)
{
  int64_t now;
  if (engine->source != FM_CLOCK || !read_source_locked(engine, 0, &now)) {
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
  return has_moved_on && fm_engine_deadline_locked(engine) > now;
}

// The last mark at a system time, or before it; NULL if none is kept.
static const struct fm_clock_mark * mark_at_locked(const struct fm_engine * engine, int64_t system)
{
  uint64_t low = engine->n_marks < FM_MOST_MARKS ? 0 : engine->n_marks - FM_MOST_MARKS;
  const uint64_t first = low;
  uint64_t high = engine->n_marks;
  while (low < high) {
    const uint64_t middle = low + (high - low) / 2;
    if (engine->marks[middle % FM_MOST_MARKS].system <= system) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  return low == first ? NULL : &engine->marks[(low - 1) % FM_MOST_MARKS];
}

// What the clock said when a message was received that is delivered in a round: it may have moved
// since. Between the evaluator's time and the round's; the evaluator's may be ahead of the round's
// by nanoseconds: messages that came while the clock stood.
static int64_t clock_at_locked(const struct fm_engine * engine, int64_t received)
{
  const int64_t earliest = fm_evaluator_now(engine->options.evaluator);
  const struct fm_clock_mark * mark = received > 0 ? mark_at_locked(engine, received) : NULL;
  const int64_t clock = mark != NULL ? mark->clock :
    received > 0 && engine->n_marks > 0 ? earliest : engine->round;
  return fm_within(clock, earliest, engine->round);
}

int64_t fm_engine_round_received_by_locked(struct fm_engine * engine)
{
  return engine->has_round && engine->source == FM_STEADY ?
         fm_later(
    fm_later(engine->round, engine->options.reorder), fm_engine_stamps_ahead_locked(engine)) :
         fm_read_clock(CLOCK_REALTIME);
}

// With stamps of headers: the time until which messages took effect when a message was received
// that is delivered in a round.
static int64_t stamps_at_locked(const struct fm_engine * engine, int64_t received)
{
  const int64_t now = fm_evaluator_now(engine->options.evaluator);
  const int64_t earliest = now < engine->released ? engine->released : now;
  const int64_t then =
    received <= 0 ? engine->round : fm_later(received, -engine->options.reorder);
  return fm_within(then, earliest, engine->round);
}

bool fm_engine_read_for_message_locked(struct fm_engine * engine, int64_t received, int64_t * now)
{
  if (engine->in_round && engine->source != FM_TOLD) {
    *now = engine->source == FM_CLOCK ? clock_at_locked(engine, received) :
      uses_headers(engine) ? stamps_at_locked(engine, received) : engine->round;
    return engine->has_round;
  }
  return fm_engine_read_now_locked(engine, received, now);
}

bool fm_engine_read_now_locked(struct fm_engine * engine, int64_t received, int64_t * now)
{
  if (!read_source_locked(engine, received, now)) {
    return false;
  }
  join_source_locked(engine, *now);
  return true;
}

void fm_engine_end_wait_if_earlier_locked(struct fm_engine * engine)
{
  const struct fm_waiting * first = fm_reorder_first(&engine->waiting);
  if (engine->source == FM_STEADY &&
    (fm_evaluator_wake(engine->options.evaluator) < engine->wakes_at ||
    (first != NULL && first->stamp < engine->wakes_at)))
  {
    pthread_cond_signal(&engine->violation_queued);
  }
}

void fm_engine_advance(struct fm_engine * engine, int64_t now)
{
  fm_engine_lock(engine);
  if (engine->source == FM_TOLD && !engine->is_closed) {
    engine->has_begun = true;
    fm_engine_take_due_by_locked(engine, fm_later(now, -engine->options.reorder));
  }
  fm_engine_unlock(engine);
}

static void follow(
  struct fm_engine * engine, enum fm_source_of_time source,
  int (* now)(void * clock, int64_t * nanoseconds), void * clock, bool is_outdated)
{
  fm_engine_begin_order(engine);
  fm_engine_lock(engine);
  fm_engine_take_due_now_locked(engine);  // brings the time up to date, for the shift
  release_all_locked(engine);  // their stamps are of another clock
  engine->released = INT64_MIN;
  engine->source = source;
  engine->now = now;
  engine->clock = clock;
  engine->is_outdated = is_outdated;
  engine->clock_served = fm_steady_time();
  engine->is_new_source = true;
  engine->has_round = false;
  engine->n_marks = 0;
  (void)mark_clock_locked(engine);
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

void fm_engine_serve_clock(struct fm_engine * engine)
{
  fm_engine_lock(engine);
  engine->clock_served = fm_steady_time();
  fm_engine_unlock(engine);
}

bool fm_engine_hangs_locked(const struct fm_engine * engine, int64_t nanoseconds)
{
  const int64_t now = fm_steady_time();
  return engine->source == FM_CLOCK && fm_since(engine->clock_served, now) > nanoseconds;
}

bool fm_engine_hangs(struct fm_engine * engine, int64_t nanoseconds)
{
  fm_engine_lock(engine);
  const bool hangs = fm_engine_hangs_locked(engine, nanoseconds);
  fm_engine_unlock(engine);
  return hangs;
}

void fm_engine_wake(struct fm_engine * engine)
{
  fm_engine_lock(engine);
  engine->is_outdated = false;
  if (!mark_clock_locked(engine)) {
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

// ---- waiting -----------------------------------------------------------------------------------

// Wait for a signal, the deadline, or `end` of CLOCK_MONOTONIC. If the system time is set in the
// meantime, a wait for a stamp ends too early or at `end`.
static void wait_for_deadline_locked(struct fm_engine * engine, int64_t end)
{
  const bool waits = engine->has_begun && engine->source == FM_STEADY;
  const int64_t steady = fm_steady_time();
  int64_t ahead = 0;  // of the source
  if (waits && uses_headers(engine)) {
    int64_t now;
    (void)read_source_locked(engine, 0, &now);
    ahead = fm_between(steady, now);
  }
  const int64_t last = fm_later(end, ahead);
  const int64_t deadline = waits ? fm_engine_deadline_locked(engine) : last;
  engine->wakes_at = deadline < last ? deadline : last;
  FM_PAUSE();
  fm_wait_until(&engine->violation_queued, &engine->mutex, fm_between(ahead, engine->wakes_at));
  engine->wakes_at = INT64_MIN;
}

void fm_engine_wait_for_violation_locked(struct fm_engine * engine, uint32_t milliseconds)
{
  const int64_t end =
    fm_steady_time() + (int64_t)milliseconds * (SECOND_NS / 1000);
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
