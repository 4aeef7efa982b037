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

/// Verdicts of one requirement: what is published at a look, and by a thread beside an engine.

#define _POSIX_C_SOURCE 200809L

#include "verdict_thread.h"

#include <pthread.h>
#include <string.h>
#include <time.h>

#include "check.h"
#include "fakes.h"
#include "verdicts.h"

#include "below_one.h"  // the last: it has names that headers use as parameters

#define SECOND_NS INT64_C(1000000000)

// ---- one look ----------------------------------------------------------------------------------

static struct fm_verdict verdict;

// Look at a state, and return what is published: none, a digit a verdict, 1 for true.
static const char * look(enum fm_state state, uint64_t occurrences, int64_t now)
{
  static char text[FM_MOST_VERDICTS + 1];
  const struct fm_requirement_state found = {occurrences, (uint8_t)state};
  bool out[FM_MOST_VERDICTS];
  const uint32_t n = fm_verdict_look(&verdict, &found, now, out);
  for (uint32_t k = 0; k < n; ++k) {
    text[k] = out[k] ? '1' : '0';
  }
  text[n] = '\0';
  return text;
}

static void check_looks(void)
{
  CHECK(strcmp(look(FM_UNKNOWN, 0, 5), "") == 0);
  CHECK(fm_verdict_due(&verdict) == INT64_MAX);
  CHECK(strcmp(look(FM_HOLDS, 0, 10), "1") == 0);
  CHECK(fm_verdict_due(&verdict) == 10 + SECOND_NS);
  CHECK(strcmp(look(FM_HOLDS, 0, 9 + SECOND_NS), "") == 0);
  CHECK(strcmp(look(FM_HOLDS, 0, 10 + SECOND_NS), "1") == 0);
  CHECK(strcmp(look(FM_VIOLATED, 1, 20 + SECOND_NS), "0") == 0);
  CHECK(fm_verdict_due(&verdict) == 20 + 2 * SECOND_NS);
  CHECK(strcmp(look(FM_HOLDS, 1, 30 + SECOND_NS), "1") == 0);
  CHECK(strcmp(look(FM_HOLDS, 2, 40 + SECOND_NS), "01") == 0);  // over already
  CHECK(strcmp(look(FM_VIOLATED, 3, 50 + SECOND_NS), "0") == 0);
  CHECK(strcmp(look(FM_UNKNOWN, 3, 60 + SECOND_NS), "") == 0);
  CHECK(fm_verdict_due(&verdict) == INT64_MAX);
  CHECK(strcmp(look(FM_VIOLATED, 3, 70 + SECOND_NS), "0") == 0);  // known again
  CHECK(strcmp(look(FM_UNKNOWN, 3, 80 + SECOND_NS), "") == 0);
  CHECK(strcmp(look(FM_VIOLATED, 4, 90 + SECOND_NS), "0") == 0);
}

// ---- a thread ----------------------------------------------------------------------------------

static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static uint64_t n_published = 0;
static uint64_t n_false = 0;
static bool last = false;
static bool fails = false;

static int publish(const void * publisher, const void * message, void * allocation)
{
  (void)publisher;
  (void)allocation;
  pthread_mutex_lock(&mutex);
  memcpy(&last, message, sizeof(last));
  n_published += 1;
  n_false += last ? 0u : 1u;
  const bool is_refused = fails;
  pthread_mutex_unlock(&mutex);
  return is_refused ? 1 : 0;
}

static const struct fm_middleware middleware = FAKE_MIDDLEWARE(NULL, NULL, publish);

static uint64_t count(uint64_t * n_of_false, bool * verdict_of_last)
{
  pthread_mutex_lock(&mutex);
  const uint64_t n = n_published;
  *n_of_false = n_false;
  *verdict_of_last = last;
  pthread_mutex_unlock(&mutex);
  return n;
}

// Wait for more than `seen` messages, of which the last is `wanted`. Returns whether they came.
static bool comes(bool wanted, uint64_t seen)
{
  const struct timespec millisecond = {0, 1000000};
  uint64_t unused;
  bool found = !wanted;
  for (int k = 0; k < 20000 && (count(&unused, &found) <= seen || found != wanted); ++k) {
    nanosleep(&millisecond, NULL);
  }
  return count(&unused, &found) > seen && found == wanted;
}

static void deliver(struct fm_engine * engine, uint8_t value)
{
  static uint64_t sequence = 0;
  const uint8_t gid[FM_GID_BYTES] = {1};
  sequence += 1;
  const struct fm_origin origin = {0, 0, sequence, gid, false, NULL, 0};
  CHECK(fm_engine_message(engine, 0, &value, 1, &origin) == FM_RECEIVED);
}

static void check_thread(void)
{
  int publisher = 0;
  void * publishers[] = {&publisher};
  uint64_t n_of_false;
  bool found;
  struct fm_verdict_thread * thread = NULL;
  struct fm_engine * engine = make_engine(NULL);
  fm_engine_follow_steady(engine);
  CHECK(fm_verdict_thread_start(&thread, engine, &middleware, publishers, 1));
  fm_engine_begin(engine);
  CHECK(count(&n_of_false, &found) == 0);
  deliver(engine, 0);
  CHECK(comes(true, 0));
  pthread_mutex_lock(&mutex);
  fails = true;
  pthread_mutex_unlock(&mutex);
  deliver(engine, 1);
  CHECK(comes(false, 1));
  CHECK(comes(false, 2));  // a second later
  deliver(engine, 0);
  CHECK(comes(true, 3));
  const uint64_t before = count(&n_of_false, &found);
  const uint64_t n_before = n_of_false;
  deliver(engine, 1);  // over at once
  deliver(engine, 0);
  CHECK(comes(true, before + 1));
  CHECK(count(&n_of_false, &found) >= before + 2 && n_of_false > n_before);
  fm_engine_close(engine);
  fm_verdict_thread_join(&thread);
  fm_verdict_thread_join(&thread);  // does nothing
  CHECK(thread == NULL);
  destroy_engine(engine);
}

int main(void)
{
  check_looks();
  check_thread();
  return failures == 0 ? 0 : 1;
}
