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

#include <pthread.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>

#define BATCH 64u
#define WAIT_MS 500u  // closing the engine wakes it at once

struct fm_announcer
{
  struct fm_engine * engine;
  const struct fm_middleware * middleware;
  void ** publishers;
  uint32_t n_publishers;
  pthread_t thread;
  uint64_t turns;  // atomic
};

static void publish(struct fm_announcer * announcer, const struct fm_violation * violation)
{
  const uint8_t empty = 0;  // std_msgs/msg/Empty is one byte in C
  if (violation->requirement >= announcer->n_publishers) {
    return;
  }
  const int result = announcer->middleware->publish(
    announcer->publishers[violation->requirement], &empty, NULL);
  if (result != 0) {
    announcer->middleware->forget_error();
    fm_engine_count_unpublished(announcer->engine, 1);
  }
}

static void * run(void * argument)
{
  struct fm_announcer * announcer = argument;
  struct fm_violation batch[BATCH];
  uint32_t n = 0;
  bool is_closed = false;
  do {
    is_closed = fm_engine_is_closed(announcer->engine);  // nothing is queued after this is true
    n = fm_engine_take(announcer->engine, batch, BATCH, WAIT_MS);
    for (uint32_t k = 0; k < n; ++k) {
      publish(announcer, &batch[k]);
    }
    __atomic_fetch_add(&announcer->turns, 1u, __ATOMIC_RELAXED);
  } while (n > 0 || !is_closed);
  return NULL;
}

// Start the thread with all signals blocked, so that the main thread handles them.
static bool start_thread(struct fm_announcer * announcer)
{
  sigset_t all;
  sigset_t before;
  sigfillset(&all);
  if (pthread_sigmask(SIG_SETMASK, &all, &before) != 0) {
    return false;
  }
  const bool is_started = pthread_create(&announcer->thread, NULL, run, announcer) == 0;
  pthread_sigmask(SIG_SETMASK, &before, NULL);
  return is_started;
}

static void free_announcer(struct fm_announcer * announcer)
{
  free(announcer->publishers);
  free(announcer);
}

bool fm_announcer_start(
  struct fm_announcer ** started, struct fm_engine * engine,
  const struct fm_middleware * middleware, void * const * publishers, uint32_t n_publishers)
{
  struct fm_announcer * announcer = calloc(1, sizeof(*announcer));
  if (announcer == NULL) {
    return false;
  }
  announcer->engine = engine;
  announcer->middleware = middleware;
  announcer->n_publishers = n_publishers;
  announcer->publishers = calloc(n_publishers + 1u, sizeof(*publishers));
  if (announcer->publishers == NULL) {
    free_announcer(announcer);
    return false;
  }
  memcpy(announcer->publishers, publishers, n_publishers * sizeof(*publishers));
  if (!start_thread(announcer)) {
    free_announcer(announcer);
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
    free_announcer(*announcer);
    *announcer = NULL;
  }
}
