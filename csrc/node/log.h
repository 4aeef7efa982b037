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

/// log.h: the node's handles of rcl, and its log.
///
/// Any thread may log, but none that holds the engine's mutex, and not from within a callback of
/// the middleware: a line is published on /rosout.

#ifndef LOG_H_
#define LOG_H_

#include <rcl/rcl.h>

#include "lines.h"

/// The node. Owned by main.c; the others use it between its start and its end.
struct fm_node
{
  rcl_context_t context;
  rcl_node_t node;
  rcl_allocator_t allocator;
  bool is_starting;  // an error ends the process: it is printed as one, and not logged
};

/// Log to the terminal, the log file and /rosout, as the arguments of ROS say. Returns false, and
/// leaves the error of rcl, if the log's folder cannot be made.
bool fm_log_begin(struct fm_node * node);
void fm_log_end(void);

/// Publish the log on /rosout as well, from when the node is made, or no more, before it ends;
/// nothing, if an argument has disabled it. Call it from the main thread.
void fm_log_on_rosout(struct fm_node * node, bool is_published);

/// Set the least severity that the node logs, one of rcutils. Call it from the main thread.
void fm_log_set_level(const struct fm_node * node, int severity);

/// Log one line, in the format of printf.
void fm_log(const struct fm_node * node, enum fm_level level, const char * format, ...)
FM_PRINTF(3, 4);

/// Log the lines of a list, and free it: it is empty afterwards.
void fm_log_lines(const struct fm_node * node, struct fm_lines * lines);

/// How many errors this process has logged, also below the least severity.
uint32_t fm_log_errors(void);

#define FM_NO_MEMORY "memory is short"

/// Log the error of rcl after a text, and clear it; if there is none, memory was short.
void fm_log_failure(const struct fm_node * node, const char * what);

/// Clear the error of rcl, or of what it stands on, if a call has failed: nothing depends on it.
void fm_ignore(rcl_ret_t result);

/// CLOCK_MONOTONIC, and the system time, in nanoseconds.
int64_t fm_steady_now(void);
int64_t fm_system_now(void);

#endif  // LOG_H_
