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

/// reports.h: publishes what csrc/reporting words: statuses, and the details of violations.

#ifndef REPORTS_H_
#define REPORTS_H_

#include "middleware.h"
#include "reporter.h"

// ---- the structs of messages (ROS 2 Jazzy) -----------------------------------------------------

/// rosidl_runtime_c__String. `capacity` counts the zero after the text.
struct fm_ros_string
{
  char * data;
  size_t size;
  size_t capacity;
};

/// diagnostic_msgs__msg__KeyValue.
struct fm_ros_pair
{
  struct fm_ros_string key;
  struct fm_ros_string value;
};

/// diagnostic_msgs__msg__DiagnosticStatus.
struct fm_ros_status
{
  uint8_t level;
  struct fm_ros_string name;
  struct fm_ros_string message;
  struct fm_ros_string hardware_id;
  struct fm_ros_pair * values;
  size_t n_values;
  size_t capacity;
};

/// diagnostic_msgs__msg__DiagnosticArray.
struct fm_ros_statuses
{
  int32_t sec;
  uint32_t nanosec;
  struct fm_ros_string frame_id;
  struct fm_ros_status * statuses;
  size_t n;
  size_t capacity;
};

// ---- statuses ----------------------------------------------------------------------------------

/// Publish a list of statuses with a time stamp in nanoseconds. `publisher`: rmw_publisher_t of
/// diagnostic_msgs/msg/DiagnosticArray. Any thread; what does not fit in memory is left out.
/// O(characters).
FM_EXPORT void fm_publish_statuses(
  const struct fm_middleware * middleware, const void * publisher,
  const struct fm_statuses * list, int64_t stamp);

// ---- details -----------------------------------------------------------------------------------

/// Publishes the details of an engine's violations (details.h) while somebody subscribes, and logs
/// them (violation_log.h). One thread at a time; no other may take details.
struct fm_detail_publisher;

/// Make one, which publishes as fm_publish_statuses. What it is given outlives it. From now on the
/// engine queues details: a violation before the first turn is published and logged, too. NULL if
/// memory is short. O(requirements).
FM_EXPORT struct fm_detail_publisher * fm_detail_publisher_create(
  const struct fm_reporter * reporter, const struct fm_middleware * middleware,
  const void * publisher, bool logs_violations);

/// Wait for a detail, at most 200 ms, and publish it; add the lines that are due. Without a
/// subscriber FM_LOGGED_PER_S details of a requirement are queued, so that one that has just
/// matched misses none of them. To be called again while it returns true: until the engine is
/// closed, and its queue empty. O(requirements + characters).
FM_EXPORT bool fm_detail_publisher_turn(
  struct fm_detail_publisher * details, struct fm_lines * lines);

/// Free it. NULL is allowed.
FM_EXPORT void fm_detail_publisher_destroy(struct fm_detail_publisher * details);

#endif  // REPORTS_H_
