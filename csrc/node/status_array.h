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

/// status_array.h: makes a diagnostic_msgs/msg/DiagnosticArray.
///
/// Not thread-safe. What does not fit in memory is left out. A function costs O(characters).

#ifndef STATUS_ARRAY_H_
#define STATUS_ARRAY_H_

#include <diagnostic_msgs/msg/diagnostic_array.h>

#include "text.h"

typedef diagnostic_msgs__msg__DiagnosticArray fm_status_array;
typedef diagnostic_msgs__msg__DiagnosticStatus fm_status;

/// Make an array with room for `most` statuses. Returns false if memory is short; nothing is to be
/// freed then.
bool fm_statuses_begin(fm_status_array * array, size_t most, int64_t stamp);

/// Add a status with room for `most` values. NULL if there is no room. Owned by the array.
fm_status * fm_status_add(
  fm_status_array * array, uint8_t level, const char * name, const char * message,
  const char * hardware_id, size_t most);

/// Add a value, in the format of printf. Does nothing if `status` is NULL.
void fm_status_value(fm_status * status, const char * key, const char * format, ...)
FM_PRINTF(3, 4);

/// Free all of it.
void fm_statuses_end(fm_status_array * array);

#endif  // STATUS_ARRAY_H_
