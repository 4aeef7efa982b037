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

/// engine_graph.c: what is seen of the graph of ROS comes in as messages.

#define _POSIX_C_SOURCE 200809L

#include "engine_parts.h"

#include <string.h>

#include "thread.h"

// A std_msgs/msg/Bool or Int32: an encapsulation header and the value, in this machine's order.
static size_t serialize(bool is_truth, int32_t value, uint8_t bytes[8])
{
  const uint16_t one = 1u;
  const uint8_t truth = value != 0;
  memset(bytes, 0, 8u);
  memcpy(bytes + 1, &one, 1u);
  memcpy(bytes + 4, is_truth ? (const void *)&truth : &value, is_truth ? 1u : sizeof(value));
  return is_truth ? 5u : 8u;
}

bool fm_engine_observe(
  struct fm_engine * engine, uint32_t topic, bool is_truth, int32_t value, int64_t received)
{
  uint8_t bytes[8];
  bool is_new = false;
  if (topic >= engine->options.n_topics) {
    return false;
  }
  fm_engine_begin_order(engine);
  fm_engine_lock(engine);
  struct fm_observed * const observed = &engine->topics[topic].observed;
  if (!observed->has_value || observed->value != value) {
    const struct fm_origin origin = {received, received, 0, NULL, false, NULL, 0};
    const size_t size = serialize(is_truth, value, bytes);
    is_new = true;
    *observed = (struct fm_observed) {value, true, observed->was_there || value != 0};
    (void)fm_engine_message_locked(engine, topic, bytes, size, &origin);
  }
  fm_engine_unlock(engine);
  fm_engine_end_order(engine);
  return is_new;
}
