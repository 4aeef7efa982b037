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

/// verdict_thread.c: see verdict_thread.h for the contract.

#define _POSIX_C_SOURCE 200809L

#include "verdict_thread.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "text.h"
#include "thread.h"
#include "verdicts.h"

#define MILLISECOND_NS 1000000
#define WAIT_MS 1000u  // closing the engine wakes it at once

struct fm_verdict_thread
{
  struct fm_engine * engine;
  const struct fm_middleware * middleware;
  void ** publishers;
  struct fm_verdict * verdicts;
  struct fm_requirement_state * states;
  uint32_t n;
  struct fm_memory memory;  // of all arrays
  pthread_t thread;
};

static void publish(const struct fm_verdict_thread * thread, uint32_t k, int64_t now)
{
  bool found[FM_MOST_VERDICTS];
  const uint32_t n = fm_verdict_look(&thread->verdicts[k], &thread->states[k], now, found);
  for (uint32_t v = 0; v < n; ++v) {  // bool is std_msgs/msg/Bool
    if (thread->middleware->publish(thread->publishers[k], &found[v], NULL) != 0) {
      thread->middleware->forget_error();
    }
  }
}

// Milliseconds until a verdict is published again, at most WAIT_MS.
static uint32_t time_left(const struct fm_verdict_thread * thread)
{
  const int64_t now = fm_steady_time();
  int64_t left = (int64_t)WAIT_MS * MILLISECOND_NS;
  for (uint32_t k = 0; k < thread->n; ++k) {
    const int64_t due = fm_verdict_due(&thread->verdicts[k]);
    left = due <= now ? 0 : due - now < left ? due - now : left;
  }
  return (uint32_t)((left + MILLISECOND_NS - 1) / MILLISECOND_NS);
}

static void * run(void * argument)
{
  const struct fm_verdict_thread * thread = argument;
  uint64_t seen = 0;
  bool is_closed = false;
  do {
    is_closed = fm_engine_is_closed(thread->engine);
    seen = fm_engine_states(thread->engine, seen, time_left(thread), thread->states);
    const int64_t now = fm_steady_time();
    for (uint32_t k = 0; k < thread->n; ++k) {
      publish(thread, k, now);
    }
  } while (!is_closed);
  return NULL;
}

static bool copy_publishers(struct fm_verdict_thread * thread, void * const * publishers)
{
  thread->publishers = fm_reserve(&thread->memory, thread->n, sizeof(*thread->publishers));
  thread->verdicts = fm_reserve(&thread->memory, thread->n, sizeof(*thread->verdicts));
  thread->states = fm_reserve(&thread->memory, thread->n, sizeof(*thread->states));
  if (thread->memory.is_short) {
    return false;
  }
  memcpy(thread->publishers, publishers, thread->n * sizeof(*publishers));
  return true;
}

bool fm_verdict_thread_start(
  struct fm_verdict_thread ** started, struct fm_engine * engine,
  const struct fm_middleware * middleware, void * const * publishers, uint32_t n)
{
  struct fm_verdict_thread * thread = calloc(1, sizeof(*thread));
  if (thread == NULL) {
    return false;
  }
  *thread = (struct fm_verdict_thread) {.engine = engine, .middleware = middleware, .n = n};
  fm_engine_follow_states(engine);
  if (!copy_publishers(thread, publishers) || !fm_start_thread(&thread->thread, run, thread)) {
    fm_memory_free(&thread->memory);
    free(thread);
    return false;
  }
  *started = thread;
  return true;
}

void fm_verdict_thread_join(struct fm_verdict_thread ** thread)
{
  if (*thread != NULL) {
    pthread_join((*thread)->thread, NULL);
    fm_memory_free(&(*thread)->memory);
    free(*thread);
    *thread = NULL;
  }
}
