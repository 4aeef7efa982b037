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

/// status_array.c: see status_array.h for the contract.

#include "status_array.h"

#include <diagnostic_msgs/msg/diagnostic_status.h>
#include <diagnostic_msgs/msg/key_value.h>
#include <rosidl_runtime_c/string_functions.h>

bool fm_statuses_begin(fm_status_array * array, size_t most, int64_t stamp)
{
  if (!diagnostic_msgs__msg__DiagnosticArray__init(array)) {
    return false;
  }
  if (!diagnostic_msgs__msg__DiagnosticStatus__Sequence__init(&array->status, most)) {
    diagnostic_msgs__msg__DiagnosticArray__fini(array);
    return false;
  }
  array->status.size = 0;  // `capacity` are there, and are freed
  const int64_t second = INT64_C(1000000000);
  const int64_t rest = stamp % second < 0 ? stamp % second + second : stamp % second;
  array->header.stamp.sec = (int32_t)((stamp - rest) / second);
  array->header.stamp.nanosec = (uint32_t)rest;
  return true;
}

fm_status * fm_status_add(
  fm_status_array * array, uint8_t level, const char * name, const char * message,
  const char * hardware_id, size_t most)
{
  if (array->status.size == array->status.capacity) {
    return NULL;
  }
  fm_status * status = &array->status.data[array->status.size++];
  status->level = level;
  (void)rosidl_runtime_c__String__assign(&status->name, name);
  (void)rosidl_runtime_c__String__assign(&status->message, message);
  (void)rosidl_runtime_c__String__assign(&status->hardware_id, hardware_id);
  if (!diagnostic_msgs__msg__KeyValue__Sequence__init(&status->values, most)) {
    return NULL;
  }
  status->values.size = 0;
  return status;
}

void fm_status_value(fm_status * status, const char * key, const char * format, ...)
{
  struct fm_text text = {NULL, 0, 0};
  va_list arguments;
  if (status == NULL || status->values.size == status->values.capacity) {
    return;
  }
  diagnostic_msgs__msg__KeyValue * value = &status->values.data[status->values.size++];
  va_start(arguments, format);
  fm_text_add_arguments(&text, format, arguments);
  va_end(arguments);
  (void)rosidl_runtime_c__String__assign(&value->key, key);
  (void)rosidl_runtime_c__String__assign(&value->value, fm_text_get(&text));
  fm_text_free(&text);
}

void fm_statuses_end(fm_status_array * array)
{
  diagnostic_msgs__msg__DiagnosticArray__fini(array);
}
