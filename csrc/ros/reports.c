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

/// reports.c: see reports.h for the contract.

#define _POSIX_C_SOURCE 200809L

#include "reports.h"

#include <stdlib.h>
#include <string.h>

#include "thread.h"
#include "violation_log.h"

#define WAIT_MS 200u  // longest wait for a detail; closing the engine ends it at once

// ---- statuses ----------------------------------------------------------------------------------

static struct fm_ros_string string_of(char * text)
{
  const size_t size = strlen(text);
  return (struct fm_ros_string) {text, size, size + 1u};
}

static struct fm_ros_status status_of(const struct fm_status * status, struct fm_memory * memory)
{
  struct fm_ros_pair * values = fm_reserve(memory, status->n_values, sizeof(*values));
  const uint32_t n = values == NULL ? 0 : status->n_values;
  for (uint32_t k = 0; k < n; ++k) {
    values[k] = (struct fm_ros_pair) {
      string_of(status->values[k].key), string_of(status->values[k].value)};
  }
  return (struct fm_ros_status) {
    status->level, string_of(status->name), string_of(status->message),
    string_of(status->hardware_id), values, n, n};
}

void fm_publish_statuses(
  const struct fm_middleware * middleware, const void * publisher,
  const struct fm_statuses * list, int64_t stamp)
{
  const int64_t rest = stamp % FM_SECOND < 0 ? stamp % FM_SECOND + FM_SECOND : stamp % FM_SECOND;
  char nothing[] = "";
  struct fm_memory memory = {NULL, false};
  struct fm_ros_status * statuses = fm_reserve(&memory, list->n, sizeof(*statuses));
  for (uint32_t k = 0; statuses != NULL && k < list->n; ++k) {
    statuses[k] = status_of(&list->statuses[k], &memory);
  }
  const struct fm_ros_statuses message = {
    (int32_t)((stamp - rest) / FM_SECOND), (uint32_t)rest, string_of(nothing), statuses, list->n,
    list->n};
  if (statuses != NULL && middleware->publish(publisher, &message, NULL) != 0) {
    middleware->forget_error();
  }
  fm_memory_free(&memory);
}

// ---- details -----------------------------------------------------------------------------------

struct fm_detail_publisher
{
  const struct fm_reporter * reporter;
  const struct fm_middleware * middleware;
  const void * publisher;
  struct fm_violation_log * log;  // NULL: violations are not logged
  struct fm_detail * detail;
  struct fm_statuses worded;
};

struct fm_detail_publisher * fm_detail_publisher_create(
  const struct fm_reporter * reporter, const struct fm_middleware * middleware,
  const void * publisher, bool logs_violations)
{
  struct fm_detail_publisher * details = calloc(1, sizeof(*details));
  if (details == NULL) {
    return NULL;
  }
  *details = (struct fm_detail_publisher) {
    .reporter = reporter, .middleware = middleware, .publisher = publisher,
    .log = logs_violations ? fm_violation_log_create(reporter) : NULL,
    .detail = malloc(fm_engine_detail_bytes(reporter->engine))};
  if (details->detail == NULL || (logs_violations && details->log == NULL)) {
    fm_detail_publisher_destroy(details);
    return NULL;
  }
  fm_engine_want_details(reporter->engine, true, FM_LOGGED_PER_S);
  return details;
}

void fm_detail_publisher_destroy(struct fm_detail_publisher * details)
{
  if (details != NULL) {
    fm_violation_log_destroy(details->log);
    fm_statuses_free(&details->worded);
    free(details->detail);
    free(details);
  }
}

static bool has_subscriber(const struct fm_detail_publisher * details)
{
  size_t n = 0;
  if (details->middleware->count_matched(details->publisher, &n) != 0) {
    details->middleware->forget_error();
  }
  return n > 0;
}

static void pass_on(struct fm_detail_publisher * details, struct fm_lines * lines)
{
  if (has_subscriber(details)) {
    fm_add_detail(&details->worded, details->reporter, details->detail);
    fm_publish_statuses(
      details->middleware, details->publisher, &details->worded,
      details->detail->violation.stamp);
    fm_statuses_clear(&details->worded);
  }
  if (details->log != NULL) {
    fm_violation_log_add(details->log, details->detail, fm_steady_time(), lines);
  }
}

bool fm_detail_publisher_turn(struct fm_detail_publisher * details, struct fm_lines * lines)
{
  struct fm_engine * engine = details->reporter->engine;
  const bool is_closed = fm_engine_is_closed(engine);  // nothing is queued after this is true
  fm_engine_want_details(
    engine, true, has_subscriber(details) ? FM_MOST_DETAILS_PER_S : FM_LOGGED_PER_S);
  const bool has_one = fm_engine_take_detail(engine, details->detail, WAIT_MS);
  if (has_one) {
    pass_on(details, lines);
  }
  const bool goes_on = has_one || !is_closed;
  if (details->log != NULL) {
    fm_violation_log_review(details->log, goes_on ? fm_steady_time() : FM_AT_END, lines);
  }
  return goes_on;
}
