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

/// detail_thread.c: see session.h for the contract.

#define _POSIX_C_SOURCE 200809L

#include "session.h"

#include <pthread.h>
#include <stdlib.h>

#include "details.h"
#include "endpoints.h"
#include "violation_log.h"

#define WAIT_MS 200u     // longest wait for a detail; closing the engine ends it at once

struct fm_detail_thread
{
  const struct fm_node * node;
  const struct fm_reporter * reporter;
  const rcl_publisher_t * publisher;
  struct fm_violation_log * log;  // NULL: violations are not logged
  struct fm_detail * detail;
  struct fm_lines lines;
  pthread_t thread;
  uint64_t turns;  // atomic
};

static void publish(const struct fm_detail_thread * thread)
{
  struct fm_statuses list = {NULL, 0, 0};
  fm_add_detail(&list, thread->reporter, thread->detail);
  fm_publish_statuses(thread->publisher, &list, thread->detail->violation.stamp);
  fm_statuses_free(&list);
}

static void pass_on(struct fm_detail_thread * thread)
{
  if (fm_listeners(thread->publisher) > 0) {
    publish(thread);
  }
  if (thread->log != NULL) {
    fm_violation_log_add(thread->log, thread->detail, fm_steady_now(), &thread->lines);
    fm_log_lines(thread->node, &thread->lines);
  }
}

static void * run(void * argument)
{
  struct fm_detail_thread * thread = argument;
  while (!fm_engine_is_closed(thread->reporter->engine)) {
    const bool is_heard = fm_listeners(thread->publisher) > 0;
    __atomic_fetch_add(&thread->turns, 1u, __ATOMIC_RELAXED);
    fm_engine_want_details(
      thread->reporter->engine, is_heard || thread->log != NULL,
      is_heard ? FM_MOST_DETAILS_PER_S : FM_LOGGED_PER_S);
    if (fm_engine_take_detail(thread->reporter->engine, thread->detail, WAIT_MS)) {
      pass_on(thread);
    }
    if (thread->log != NULL) {
      fm_violation_log_review(thread->log, fm_steady_now(), &thread->lines);
      fm_log_lines(thread->node, &thread->lines);
    }
  }
  while (fm_engine_take_detail(thread->reporter->engine, thread->detail, 0)) {
    pass_on(thread);
  }
  if (thread->log != NULL) {
    fm_violation_log_end(thread->log, &thread->lines);
    fm_log_lines(thread->node, &thread->lines);
  }
  return NULL;
}

static void free_thread(struct fm_detail_thread * thread)
{
  fm_violation_log_destroy(thread->log);
  free(thread->detail);
  free(thread);
}

struct fm_detail_thread * fm_detail_thread_start(
  const struct fm_node * node, const struct fm_reporter * reporter,
  const rcl_publisher_t * publisher, bool logs_violations)
{
  struct fm_detail_thread * thread = calloc(1, sizeof(*thread));
  if (thread == NULL) {
    return NULL;
  }
  thread->node = node;
  thread->reporter = reporter;
  thread->publisher = publisher;
  thread->detail = malloc(fm_engine_detail_bytes(reporter->engine));
  thread->log = logs_violations ? fm_violation_log_create(reporter) : NULL;
  if (thread->detail == NULL || (logs_violations && thread->log == NULL) ||
    pthread_create(&thread->thread, NULL, run, thread) != 0)
  {
    free_thread(thread);
    return NULL;
  }
  return thread;
}

uint64_t fm_detail_thread_turns(const struct fm_detail_thread * thread)
{
  return __atomic_load_n(&thread->turns, __ATOMIC_RELAXED);
}

void fm_detail_thread_join(struct fm_detail_thread * thread)
{
  if (thread != NULL) {
    pthread_join(thread->thread, NULL);
    free_thread(thread);
  }
}
