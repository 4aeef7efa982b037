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

/// status_messages.h: publishes statuses as a diagnostic_msgs/msg/DiagnosticArray.

#ifndef STATUS_MESSAGES_H_
#define STATUS_MESSAGES_H_

#include <rcl/publisher.h>

#include "statuses.h"

/// Publish a list of statuses with a time stamp in nanoseconds. Any thread; what does not fit in
/// memory is left out. O(characters).
void fm_publish_statuses(
  const rcl_publisher_t * publisher, const struct fm_statuses * list, int64_t stamp);

#endif  // STATUS_MESSAGES_H_
