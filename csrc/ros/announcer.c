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

/// announcer.c: see announcer.h for the contract.

#define _POSIX_C_SOURCE 200809L

#include "announcer.h"

#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "text.h"
#include "thread.h"

#define BATCH 64u
#define MILLISECOND_NS 1000000
#define HANG_NS 500000000
#define LOCK_PERIODS 3
#define WAIT_MS 500u  // closing the engine wakes it at once

struct lock
{
  struct fm_lock settings;
  int64_t due;     // of the next message
  uint64_t occurrences;  // of its requirements, when they were looked at last
  bool is_locked;  // as published last
};

// The margins of all requirements; publishers is NULL if they are not published.
struct margins
{
  void ** publishers;
  double * found;
  double * published;  // a NaN: none is known
  int64_t due;
};

struct fm_announcer
{
  struct fm_engine * engine;
  const struct fm_middleware * middleware;
  void ** publishers;
  uint32_t n_publishers;
  struct lock * locks;
  uint32_t n_locks;
  struct fm_requirement_state * states;  // if there are locks
  struct margins margins;
  struct fm_memory memory;               // of all arrays
  pthread_t thread;
  uint64_t turns;  // atomic
};

static void publish(struct fm_announcer * announcer, const void * publisher, const void * message)
{
  if (announcer->middleware->publish(publisher, message, NULL) != 0) {
    announcer->middleware->forget_error();
    fm_engine_count_unpublished(announcer->engine, 1);
  }
}

static void announce(struct fm_announcer * announcer, const struct fm_violation * violation)
{
  const uint8_t empty = 0;  // std_msgs/msg/Empty is one byte in C
  if (violation->requirement < announcer->n_publishers) {
    publish(announcer, announcer->publishers[violation->requirement], &empty);
  }
}

// ---- locks -------------------------------------------------------------------------------------

static bool is_locked(const struct fm_lock * lock, const struct fm_requirement_state * states)
{
  bool all_hold = true;
  for (uint32_t k = 0; k < lock->n_requirements; ++k) {
    all_hold = all_hold && states[lock->requirements[k]].state == FM_HOLDS;
  }
  return !all_hold;
}

// Whether a violation has begun since the last look, which may be over by now.
static bool note_occurrences(struct lock * lock, const struct fm_requirement_state * states)
{
  uint64_t occurrences = 0;
  for (uint32_t k = 0; k < lock->settings.n_requirements; ++k) {
    occurrences += states[lock->settings.requirements[k]].occurrences;
  }
  const bool has_begun = occurrences != lock->occurrences;
  lock->occurrences = occurrences;
  return has_begun;
}

static void publish_lock(struct fm_announcer * announcer, struct lock * lock, bool state)
{
  publish(announcer, lock->settings.publisher, &state);  // as std_msgs/msg/Bool
  lock->is_locked = state;
}

// Publish the locks that have changed, also those that were locked in between, and those whose
// next message is due.
static void publish_locks(struct fm_announcer * announcer)
{
  if (announcer->n_locks == 0) {
    return;
  }
  const int64_t now = fm_steady_time();
  (void)fm_engine_states(announcer->engine, UINT64_MAX, 0, announcer->states);
  for (uint32_t k = 0; k < announcer->n_locks; ++k) {
    struct lock * lock = &announcer->locks[k];
    const bool state = is_locked(&lock->settings, announcer->states);
    if (note_occurrences(lock, announcer->states) && !state && !lock->is_locked) {
      publish_lock(announcer, lock, true);
    }
    const int64_t periods = LOCK_PERIODS * lock->settings.period;
    if (!state && fm_engine_hangs(announcer->engine, periods > HANG_NS ? periods : HANG_NS)) {
      lock->due = now + lock->settings.period;  // silent: what would lock it is not noticed
    } else if (state != lock->is_locked || lock->due <= now) {
      publish_lock(announcer, lock, state);
      lock->due = now + lock->settings.period;
    }
  }
}

// ---- margins -----------------------------------------------------------------------------------

static bool is_other(double one, double other)
{
  return one < other || one > other || isnan(one) != isnan(other);
}

static void publish_margins(struct fm_announcer * announcer)
{
  struct margins * margins = &announcer->margins;
  const int64_t now = fm_steady_time();
  if (margins->publishers == NULL || now < margins->due) {
    return;
  }
  margins->due = now + (int64_t)FM_MARGIN_PERIOD_MS * MILLISECOND_NS;
  fm_engine_take_margins(announcer->engine, margins->found);
  for (uint32_t r = 0; r < announcer->n_publishers; ++r) {
    if (is_other(margins->found[r], margins->published[r])) {
      publish(announcer, margins->publishers[r], &margins->found[r]);  // as std_msgs/msg/Float64
      margins->published[r] = margins->found[r];
    }
  }
}

// ---- the thread --------------------------------------------------------------------------------

static int64_t milliseconds_until(int64_t due, int64_t now)
{
  return due <= now ? 0 : (due - now + MILLISECOND_NS - 1) / MILLISECOND_NS;
}

// Milliseconds until the next message of a lock, or of margins, is due, at most WAIT_MS.
static uint32_t time_left(const struct fm_announcer * announcer)
{
  const int64_t now = fm_steady_time();
  int64_t left = WAIT_MS;
  if (announcer->margins.publishers != NULL) {
    left = milliseconds_until(announcer->margins.due, now);
  }
  for (uint32_t k = 0; k < announcer->n_locks; ++k) {
    const int64_t milliseconds = milliseconds_until(announcer->locks[k].due, now);
    left = milliseconds < left ? milliseconds : left;
  }
  return (uint32_t)left;
}

static void * run(void * argument)
{
  struct fm_announcer * announcer = argument;
  struct fm_violation batch[BATCH];
  uint32_t n = 0;
  bool is_closed = false;
  do {
    is_closed = fm_engine_is_closed(announcer->engine);  // nothing is queued after this is true
    n = fm_engine_take(announcer->engine, batch, BATCH, time_left(announcer));
    for (uint32_t k = 0; k < n; ++k) {
      announce(announcer, &batch[k]);
    }
    publish_locks(announcer);
    publish_margins(announcer);
    __atomic_fetch_add(&announcer->turns, 1u, __ATOMIC_RELAXED);
  } while (n > 0 || !is_closed);
  return NULL;
}

static bool begin_margins(struct fm_announcer * announcer, void * const * publishers)
{
  struct margins * margins = &announcer->margins;
  struct fm_memory * memory = &announcer->memory;
  const size_t n = announcer->n_publishers;
  if (publishers == NULL || n == 0) {
    return true;
  }
  margins->publishers = fm_reserve(memory, n, sizeof(*publishers));
  margins->found = fm_reserve(memory, n, sizeof(*margins->found));
  margins->published = fm_reserve(memory, n, sizeof(*margins->published));
  if (memory->is_short) {
    return false;
  }
  memcpy(margins->publishers, publishers, n * sizeof(*publishers));
  for (size_t r = 0; r < n; ++r) {
    margins->published[r] = (double)NAN;
  }
  return true;
}

static bool copy_settings(
  struct fm_announcer * announcer, void * const * publishers, const struct fm_lock * locks)
{
  struct fm_memory * memory = &announcer->memory;
  announcer->publishers = fm_reserve(memory, announcer->n_publishers, sizeof(*publishers));
  announcer->locks = fm_reserve(memory, announcer->n_locks, sizeof(*announcer->locks));
  announcer->states = fm_reserve(memory, announcer->n_publishers, sizeof(*announcer->states));
  if (memory->is_short) {
    return false;
  }
  memcpy(announcer->publishers, publishers, announcer->n_publishers * sizeof(*publishers));
  for (uint32_t k = 0; k < announcer->n_locks; ++k) {
    announcer->locks[k].settings = locks[k];
    announcer->locks[k].due = INT64_MIN;  // published at once
  }
  return true;
}

bool fm_announcer_start(
  struct fm_announcer ** started, struct fm_engine * engine,
  const struct fm_middleware * middleware, void * const * publishers, uint32_t n_publishers,
  const struct fm_lock * locks, uint32_t n_locks, void * const * margins)
{
  struct fm_announcer * announcer = calloc(1, sizeof(*announcer));
  if (announcer == NULL) {
    return false;
  }
  announcer->engine = engine;
  announcer->middleware = middleware;
  announcer->n_publishers = n_publishers;
  announcer->n_locks = n_locks;
  if (n_locks > 0) {
    fm_engine_follow_states(engine);
  }
  if (!copy_settings(announcer, publishers, locks) || !begin_margins(announcer, margins) ||
    !fm_start_thread(&announcer->thread, run, announcer))
  {
    fm_memory_free(&announcer->memory);
    free(announcer);
    return false;
  }
  *started = announcer;
  return true;
}

uint64_t fm_announcer_turns(const struct fm_announcer * announcer)
{
  return __atomic_load_n(&announcer->turns, __ATOMIC_RELAXED);
}

void fm_announcer_join(struct fm_announcer ** announcer)
{
  if (*announcer != NULL) {
    pthread_join((*announcer)->thread, NULL);
    fm_memory_free(&(*announcer)->memory);
    free(*announcer);
    *announcer = NULL;
  }
}
