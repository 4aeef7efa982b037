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

/// engine_clock.c: the mutex of an engine, and the sources of its time. Nothing is evaluated here.

#define _POSIX_C_SOURCE 200809L

#include "engine_parts.h"

#include "due.h"
#include "instance.h"
#include "thread.h"

#define SECOND_NS 1000000000
#define MOST_READINGS 10

void fm_engine_lock(struct fm_engine * engine) {pthread_mutex_lock(&engine->mutex);}

void fm_engine_unlock(struct fm_engine * engine) {pthread_mutex_unlock(&engine->mutex);}

// Within a callback, one reading shows that what was found before still holds.
static bool still_holds_locked(struct fm_engine * engine)
{
  if (engine->began == 0 || engine->ahead_read == 0) {
    return false;
  }
  const int64_t now = fm_between(engine->system_ahead, fm_read_clock(CLOCK_REALTIME));
  const bool holds = engine->began <= now && now - engine->began <= FM_CLOSE_NS;
  engine->ahead_read = holds ? engine->began : engine->ahead_read;
  return holds;
}

// Read both clocks once. The readings may be far apart if the thread is preempted, so that they
// only give limits, which a difference may miss by `most`. Returns how far they are apart.
static int64_t compare_clocks_locked(struct fm_engine * engine, int64_t most)
{
  const int64_t before = fm_steady_time();
  FM_PAUSE();
  const int64_t system = fm_read_clock(CLOCK_REALTIME);
  FM_PAUSE();
  const int64_t after = fm_steady_time();
  if (engine->system_ahead < system - after - most) {
    engine->system_ahead = system - after;
  } else if (engine->system_ahead > system - before + most) {
    engine->system_ahead = system - before;
  }
  engine->ahead_read = before;
  return after - before;
}

// The difference changes only when somebody sets the system time. So the first reading is kept,
// even if a later one is more precise: with one difference for all, the time from the reception of
// a message to a violation is the same in stamps as in instants.
int64_t fm_engine_system_ahead_locked(struct fm_engine * engine)
{
  if (still_holds_locked(engine)) {
    return engine->system_ahead;
  }
  const int64_t found = engine->system_ahead;
  const int64_t last_read = engine->ahead_read;
  const bool is_first = last_read == 0;
  int64_t apart;
  int readings = 0;
  do {
    apart = compare_clocks_locked(engine, is_first ? 0 : FM_CLOSE_NS);
    readings += 1;
  } while ((is_first || apart > FM_CLOSE_NS) && readings < MOST_READINGS);
  const int64_t change = fm_between(found, engine->system_ahead);
  if (is_first || change > FM_SET_NS || change < -FM_SET_NS) {
    engine->ahead_before = is_first ? engine->system_ahead : found;
    engine->set_after = last_read;
  }
  return engine->system_ahead;
}

bool fm_engine_uses_headers(const struct fm_engine * engine)
{
  return engine->options.uses_header_stamps;
}

// Within a callback the steady clock stands still, but for a message that was received since.
static int64_t steady_time_locked(const struct fm_engine * engine, int64_t received)
{
  return engine->began != 0 && fm_between(engine->system_ahead, received) <= engine->began ?
         engine->began : fm_steady_time();
}

bool fm_engine_read_source_locked(struct fm_engine * engine, int64_t told, int64_t * now)
{
  *now = told;
  if (engine->source == FM_STEADY) {
    *now = fm_engine_uses_headers(engine) ?
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
  return engine->source == FM_STEADY && !fm_engine_uses_headers(engine) ?
         fm_engine_system_ahead_locked(engine) : 0;
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

int64_t fm_engine_time_locked(const struct fm_engine * engine)
{
  return engine->options.scopes == NULL ? fm_evaluator_now(engine->options.evaluator) :
         fm_scopes_now(engine->options.scopes);
}

int64_t fm_engine_instant_locked(struct fm_engine * engine, int64_t received, int64_t now)
{
  if (engine->source != FM_STEADY || received <= 0) {
    return now;
  }
  const int64_t earliest = fm_engine_time_locked(engine);
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
  if (apart < -FM_SET_NS || apart > topic->behind) {
    const int64_t now = fm_steady_time();
    const int64_t behind = fm_since(steady_of_locked(engine, received, now), now);
    topic->behind = behind > topic->behind ? behind : topic->behind;
  }
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
int64_t fm_engine_clock_at_locked(const struct fm_engine * engine, int64_t received)
{
  const int64_t earliest = fm_engine_time_locked(engine);
  const struct fm_clock_mark * mark = received > 0 ? mark_at_locked(engine, received) : NULL;
  const int64_t clock = mark != NULL ? mark->clock :
    received > 0 && engine->n_marks > 0 ? earliest : engine->round;
  return fm_within(clock, earliest, engine->round);
}

// With stamps of headers: the time until which messages took effect when a message was received
// that is delivered in a round.
int64_t fm_engine_stamps_at_locked(const struct fm_engine * engine, int64_t received)
{
  const int64_t now = fm_engine_time_locked(engine);
  const int64_t earliest = now < engine->released ? engine->released : now;
  const int64_t then =
    received <= 0 ? engine->round : fm_later(received, -engine->options.reorder);
  return fm_within(then, earliest, engine->round);
}

int64_t fm_engine_round_received_by_locked(struct fm_engine * engine)
{
  return engine->has_round && engine->source == FM_STEADY ?
         fm_later(
    fm_later(engine->round, engine->options.reorder), fm_engine_stamps_ahead_locked(engine)) :
         fm_read_clock(CLOCK_REALTIME);
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
