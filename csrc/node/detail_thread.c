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

#include <stdlib.h>

#include "reports.h"
#include "rmw_functions.h"
#include "thread.h"

struct fm_detail_thread
{
  const struct fm_node * node;
  struct fm_detail_publisher * details;
  pthread_t thread;
  uint64_t turns;  // atomic
};

static void * run(void * argument)
{
  struct fm_detail_thread * thread = argument;
  struct fm_lines lines = {NULL, 0, 0};
  bool goes_on = true;
  while (goes_on) {
    __atomic_fetch_add(&thread->turns, 1u, __ATOMIC_RELAXED);
    goes_on = fm_detail_publisher_turn(thread->details, &lines);
    fm_log_lines(thread->node, &lines);
  }
  return NULL;
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
  thread->details = fm_detail_publisher_create(
    reporter, fm_node_middleware(), rcl_publisher_get_rmw_handle(publisher), logs_violations);
  if (thread->details == NULL || !fm_start_thread(&thread->thread, run, thread)) {
    fm_detail_publisher_destroy(thread->details);
    free(thread);
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
    fm_detail_publisher_destroy(thread->details);
    free(thread);
  }
}
