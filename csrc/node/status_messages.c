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

/// status_messages.c: see status_messages.h for the contract.

#include "status_messages.h"

#include <diagnostic_msgs/msg/diagnostic_array.h>
#include <diagnostic_msgs/msg/diagnostic_status.h>
#include <diagnostic_msgs/msg/key_value.h>
#include <rosidl_runtime_c/string_functions.h>

#include "log.h"
#include "reporter.h"

static void fill_status(
  diagnostic_msgs__msg__DiagnosticStatus * message, const struct fm_status * status)
{
  message->level = status->level;
  (void)rosidl_runtime_c__String__assign(&message->name, status->name);
  (void)rosidl_runtime_c__String__assign(&message->message, status->message);
  (void)rosidl_runtime_c__String__assign(&message->hardware_id, status->hardware_id);
  if (!diagnostic_msgs__msg__KeyValue__Sequence__init(&message->values, status->n_values)) {
    return;
  }
  for (uint32_t k = 0; k < status->n_values; ++k) {
    diagnostic_msgs__msg__KeyValue * value = &message->values.data[k];
    (void)rosidl_runtime_c__String__assign(&value->key, status->values[k].key);
    (void)rosidl_runtime_c__String__assign(&value->value, status->values[k].value);
  }
}

void fm_publish_statuses(
  const rcl_publisher_t * publisher, const struct fm_statuses * list, int64_t stamp)
{
  diagnostic_msgs__msg__DiagnosticArray array;
  if (!diagnostic_msgs__msg__DiagnosticArray__init(&array)) {
    return;
  }
  const int64_t rest = stamp % FM_SECOND < 0 ? stamp % FM_SECOND + FM_SECOND : stamp % FM_SECOND;
  array.header.stamp.sec = (int32_t)((stamp - rest) / FM_SECOND);
  array.header.stamp.nanosec = (uint32_t)rest;
  if (diagnostic_msgs__msg__DiagnosticStatus__Sequence__init(&array.status, list->n)) {
    for (uint32_t k = 0; k < list->n; ++k) {
      fill_status(&array.status.data[k], &list->statuses[k]);
    }
    fm_ignore(rcl_publish(publisher, &array, NULL));
  }
  diagnostic_msgs__msg__DiagnosticArray__fini(&array);
}
