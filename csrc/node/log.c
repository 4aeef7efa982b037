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

/// log.c: see log.h for the contract.

#define _POSIX_C_SOURCE 200809L

#include "log.h"

#include <pthread.h>
#include <rcl/error_handling.h>
#include <rcl/logging.h>
#include <rcl/logging_rosout.h>
#include <rcutils/logging.h>
#include <stdio.h>
#include <time.h>

#include "thread.h"

// rcl's own handler and the levels of rcutils are for one thread at a time.
static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static uint32_t n_errors;

static void write_line(
  const rcutils_log_location_t * location, int severity, const char * name,
  rcutils_time_point_value_t timestamp, const char * format, va_list * arguments)
{
  pthread_mutex_lock(&mutex);
  rcl_logging_multiple_output_handler(location, severity, name, timestamp, format, arguments);
  pthread_mutex_unlock(&mutex);
}

FM_PRINTF(3, 4)
static void write_text(int severity, const char * name, const char * format, ...)
{
  static const rcutils_log_location_t nowhere = {"", "", 0};  // rosout reads it
  va_list arguments;
  va_start(arguments, format);
  write_line(&nowhere, severity, name, fm_system_now(), format, &arguments);
  va_end(arguments);
}

bool fm_log_begin(struct fm_node * node)
{
  return rcl_logging_configure_with_output_handler(
    &node->context.global_arguments, &node->allocator, write_line) == RCL_RET_OK;
}

void fm_log_end(void)
{
  fm_ignore(rcl_logging_fini());
}

void fm_log_on_rosout(struct fm_node * node, bool is_published)
{
  if (rcl_logging_rosout_enabled()) {
    pthread_mutex_lock(&mutex);
    fm_ignore(
      is_published ? rcl_logging_rosout_init_publisher_for_node(&node->node) :
      rcl_logging_rosout_fini_publisher_for_node(&node->node));
    pthread_mutex_unlock(&mutex);
  }
}

void fm_log_set_level(const struct fm_node * node, int severity)
{
  const char * name = rcl_node_get_logger_name(&node->node);
  pthread_mutex_lock(&mutex);
  // rcutils caches the level when it is first read: here, and not in another thread.
  if (rcutils_logging_set_logger_level(name, severity) != RCUTILS_RET_OK ||
    rcutils_logging_get_logger_effective_level(name) < 0)
  {
    rcutils_reset_error();
  }
  pthread_mutex_unlock(&mutex);
}

// rcutils_log would look up the level a second time, outside the mutex.
void fm_log(const struct fm_node * node, enum fm_level level, const char * format, ...)
{
  static const int severities[] = {
    RCUTILS_LOG_SEVERITY_INFO, RCUTILS_LOG_SEVERITY_WARN, RCUTILS_LOG_SEVERITY_ERROR};
  const char * name = rcl_node_get_logger_name(&node->node);
  struct fm_text text = {NULL, 0, 0};
  va_list arguments;
  pthread_mutex_lock(&mutex);
  n_errors += level == FM_ERROR ? 1u : 0u;
  const bool is_enabled = rcutils_logging_logger_is_enabled_for(name, severities[level]);
  pthread_mutex_unlock(&mutex);
  const bool is_printed = node->is_starting && level == FM_ERROR;
  if (!is_enabled && !is_printed) {
    return;
  }
  va_start(arguments, format);
  fm_text_add_arguments(&text, format, arguments);
  va_end(arguments);
  const char * told = text.bytes == NULL ? FM_NO_MEMORY : fm_text_get(&text);
  if (is_printed) {
    fprintf(stderr, "error: %s\n", told);
  } else {
    write_text(severities[level], name, "%s", told);
  }
  fm_text_free(&text);
}

void fm_log_lines(const struct fm_node * node, struct fm_lines * lines)
{
  for (uint32_t k = 0; k < lines->n; ++k) {
    fm_log(node, (enum fm_level)lines->lines[k].level, "%s", lines->lines[k].text);
  }
  fm_lines_free(lines);
}

void fm_log_failure(const struct fm_node * node, const char * what)
{
  fm_log(node, FM_ERROR, "%s: %s", what,
    rcl_error_is_set() ? rcl_get_error_string().str : FM_NO_MEMORY);
  rcl_reset_error();
}

uint32_t fm_log_errors(void)
{
  pthread_mutex_lock(&mutex);
  const uint32_t n = n_errors;
  pthread_mutex_unlock(&mutex);
  return n;
}

void fm_ignore(rcl_ret_t result)
{
  if (result != RCL_RET_OK) {
    rcl_reset_error();
  }
}

int64_t fm_steady_now(void)
{
  return fm_steady_time();
}

int64_t fm_system_now(void)
{
  return fm_read_clock(CLOCK_REALTIME);
}
