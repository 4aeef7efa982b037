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

/// Locks beside a thread that delivers messages: their first message, changes, heartbeats, how
/// long a thread may hang until they are silent, a publisher that fails, and the end.

#define _POSIX_C_SOURCE 200809L

#include "announcer.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "check.h"
#include "seen.h"
#include "fakes.h"

#include "below_one.h"  // the last: it has names that headers use as parameters

#define HEARTBEAT_NS 20000000
#define SECOND_NS 1000000000

// ---- a middleware that notes what is published -------------------------------------------------

static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static int lock_publisher;
static int slow_publisher;        // of a lock of 1 Hz
static uint64_t n_published = 0;  // of the lock
static uint64_t n_locked = 0;     // of these, how often it was locked
static uint64_t n_slow_free = 0;
static bool last = false;
static bool fails = false;

static int publish(const void * publisher, const void * message, void * allocation)
{
  (void)allocation;
  pthread_mutex_lock(&mutex);
  const bool is_refused = fails;
  if (publisher == &lock_publisher) {
    memcpy(&last, message, sizeof(last));
    n_published += 1;
    n_locked += last ? 1u : 0u;
  }
  n_slow_free += publisher == &slow_publisher && !*(const bool *)message ? 1u : 0u;
  pthread_mutex_unlock(&mutex);
  return is_refused ? 1 : 0;
}

static const struct fm_middleware middleware = FAKE_MIDDLEWARE(NULL, NULL, publish);

static uint64_t count(bool * state)
{
  pthread_mutex_lock(&mutex);
  const uint64_t n = n_published;
  *state = last;
  pthread_mutex_unlock(&mutex);
  return n;
}

static void set_fails(bool value)
{
  pthread_mutex_lock(&mutex);
  fails = value;
  pthread_mutex_unlock(&mutex);
}

static void pause_ns(int64_t nanoseconds)
{
  const struct timespec time = {0, (long)nanoseconds};
  nanosleep(&time, NULL);
}

// Wait until the slow lock has said so often that it is free. Returns whether it did.
static bool is_slow_free(uint64_t n)
{
  uint64_t found = 0;
  for (int k = 0; k < 10000 && found < n; ++k) {
    pthread_mutex_lock(&mutex);
    found = n_slow_free;
    pthread_mutex_unlock(&mutex);
    pause_ns(1000000);
  }
  return found >= n;
}

// Wait for a message with a state, published after the first `seen`. Returns whether it came.
static bool comes(bool state, uint64_t seen)
{
  bool found = !state;
  for (int k = 0; k < 10000 && (count(&found) <= seen || found != state); ++k) {
    pause_ns(1000000);
  }
  return count(&found) > seen && found == state;
}

// Wait until the lock was locked once more than `seen` times. Returns whether it was.
static bool is_locked_again(uint64_t seen)
{
  uint64_t found = 0;
  for (int k = 0; k < 10000 && found <= seen; ++k) {
    pthread_mutex_lock(&mutex);
    found = n_locked;
    pthread_mutex_unlock(&mutex);
    pause_ns(1000000);
  }
  return found > seen;
}

static void deliver(struct fm_engine * engine, uint8_t value)
{
  static uint64_t sequence = 0;
  const uint8_t gid[FM_GID_BYTES] = {1};
  sequence += 1;
  const struct fm_origin origin = {0, 0, sequence, gid, false, NULL, 0};
  CHECK(fm_engine_message(engine, 0, &value, 1, &origin) == FM_RECEIVED);
}

static struct clock simulated = {SECOND_NS, false};

// Wait until the lock is silent. Returns how many messages came before.
static uint64_t end_of_messages(void)
{
  bool state = false;
  pause_ns(800000000);
  const uint64_t seen = count(&state);
  pause_ns(5 * HEARTBEAT_NS);
  CHECK(count(&state) == seen);
  return seen;
}

int main(void)
{
  const int64_t timeout = SECOND_NS / 2;
  struct fm_engine * engine = make_engine(&timeout);
  fm_engine_follow_clock(engine, read_clock, &simulated, false);
  int handler = 0;
  void * publishers[] = {&handler};
  const struct fm_lock locks[] = {
    {&lock_publisher, first, 1, HEARTBEAT_NS}, {&slow_publisher, first, 1, SECOND_NS}};
  struct fm_announcer * announcer = NULL;
  CHECK(fm_announcer_start(&announcer, engine, &middleware, publishers, 1, locks, 2, NULL));
  fm_engine_begin(engine);
  CHECK(comes(true, 0));  // not known
  CHECK(comes(true, 2));  // a heartbeat
  bool state = false;
  deliver(engine, 0);
  CHECK(comes(false, 0));
  CHECK(is_slow_free(1));
  const uint64_t unserved = end_of_messages();  // the thread that moves the clock hangs
  CHECK(is_slow_free(2));  // after one of the three periods for which it may hang
  fm_engine_serve_clock(engine);
  CHECK(comes(false, unserved));
  fm_engine_follow_steady(engine);
  const uint8_t values[] = {0, 1, 0};
  for (size_t k = 0; k < sizeof(values); ++k) {
    const uint64_t seen = count(&state);
    deliver(engine, values[k]);
    CHECK(comes(values[k] > 0, seen));
  }
  for (int k = 0; k < 20; ++k) {  // violations that are over at once
    pthread_mutex_lock(&mutex);
    const uint64_t seen = n_locked;
    pthread_mutex_unlock(&mutex);
    deliver(engine, 1);
    deliver(engine, 0);
    CHECK(is_locked_again(seen));
    CHECK(comes(false, 0));
  }
  CHECK(comes(true, count(&state)));  // silent
  const uint64_t silent = count(&state);
  deliver(engine, 0);
  CHECK(comes(false, silent));
  CHECK(comes(true, silent));  // silent again
  const uint64_t before = unpublished_of(engine);
  set_fails(true);
  CHECK(comes(true, count(&state) + 2));
  set_fails(false);
  CHECK(unpublished_of(engine) > before);
  fm_engine_close(engine);
  fm_announcer_join(&announcer);
  const uint64_t at_end = count(&state);
  pause_ns(3 * HEARTBEAT_NS);
  CHECK(count(&state) == at_end);
  destroy_engine(engine);
  return failures == 0 ? 0 : 1;
}
