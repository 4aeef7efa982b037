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

/// lines.h: what reporting answers with: lines of the log, and statuses.
///
/// The node logs the lines and clears their list. It makes messages of the statuses: details of
/// violations, and `/diagnostics`. Not thread-safe. When memory is short a line, status or value
/// is left out. O(characters).

#ifndef LINES_H_
#define LINES_H_

#include "text.h"

enum fm_level
{
  FM_INFO = 0,
  FM_WARN = 1,
  FM_ERROR = 2
};

struct fm_line
{
  uint32_t level;  // enum fm_level
  char * text;     // UTF-8, ended by a zero
};

/// Zeroed: an empty list. The owner calls fm_lines_free.
struct fm_lines
{
  struct fm_line * lines;
  uint32_t n;
  uint32_t capacity;
};

/// Add a line, in the format of printf.
void fm_lines_add(struct fm_lines * lines, enum fm_level level, const char * format, ...)
FM_PRINTF(3, 4);

/// Whether a line may be logged, at most one in an interval: if so, `*next` is set, which is 0 at
/// first. All are times of one clock. O(1).
bool fm_passes(int64_t * next, int64_t now, int64_t interval);

/// Whether what is to be done at times an interval apart, the next of which is `*next`, is due: if
/// so, `*next` is set to the first of them after `now`. So a late call moves none of them, and
/// after a stop one is made up for. As a timer of rcl, which the node on rclpy has. O(1).
bool fm_is_due(int64_t * next, int64_t now, int64_t interval);

/// Whether this is the first call with a flag, which is set. O(1).
static inline bool fm_is_first(bool * flag)
{
  const bool is_first = !*flag;
  *flag = true;
  return is_first;
}

/// Remove all lines; keep the memory of the list.
FM_EXPORT void fm_lines_clear(struct fm_lines * lines);

/// Remove all lines, and free the memory of the list.
FM_EXPORT void fm_lines_free(struct fm_lines * lines);

// ---- statuses ----------------------------------------------------------------------------------

/// As the constants of diagnostic_msgs/msg/DiagnosticStatus.
enum fm_status_level
{
  FM_STATUS_OK = 0,
  FM_STATUS_WARN = 1,
  FM_STATUS_ERROR = 2
};

struct fm_key_value
{
  char * key;
  char * value;
};

/// All texts are UTF-8 and ended by a zero.
struct fm_status
{
  uint8_t level;  // enum fm_status_level
  char * name;
  char * message;
  char * hardware_id;
  struct fm_key_value * values;
  uint32_t n_values;
  uint32_t capacity;
};

/// Zeroed: an empty list. The owner calls fm_statuses_free.
struct fm_statuses
{
  struct fm_status * statuses;
  uint32_t n;
  uint32_t capacity;
};

/// Add a status. NULL if memory is short. Valid until the next one is added.
struct fm_status * fm_statuses_add(
  struct fm_statuses * list, enum fm_status_level level, const char * name, const char * message,
  const char * hardware_id);

/// Add a value, in the format of printf. Does nothing if `status` is NULL.
void fm_status_value(struct fm_status * status, const char * key, const char * format, ...)
FM_PRINTF(3, 4);

/// Add a text as a value, and clear it.
void fm_status_text(struct fm_status * status, const char * key, struct fm_text * text);

/// Remove all statuses; keep the memory of the list.
FM_EXPORT void fm_statuses_clear(struct fm_statuses * list);

/// Remove all statuses, and free the memory of the list.
FM_EXPORT void fm_statuses_free(struct fm_statuses * list);

#endif  // LINES_H_
