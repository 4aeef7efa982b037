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

/// snapshot.h: all counters of an engine at one instant, for what a node reports.

#ifndef SNAPSHOT_H_
#define SNAPSHOT_H_

#include "engine.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fm_input_snapshot
{
  struct fm_input_counts counts;
  struct fm_silence silence;
  bool has_value;
};

struct fm_topic_snapshot
{
  struct fm_topic_counts counts;
  struct fm_order_counts order;
  struct fm_observed observed;
  uint64_t lost;    // as fm_arrivals_lost
  int64_t behind;   // ns: the longest time between the reception of a message and its evaluation
                    // since the last snapshot; 0 while the time is told
};

/// The caller owns the arrays, as long as the comments say.
struct fm_snapshot
{
  struct fm_requirement_counts * requirements;  // n_requirements
  struct fm_input_snapshot * inputs;            // n_inputs
  struct fm_topic_snapshot * topics;            // n_topics
  uint8_t * conditions;   // states.h: the present ones, of an engine with a gate or with states
  uint8_t * changes;      // FM_MOST_CONDITIONS times as many bytes: conditions since the last
                          // snapshot, oldest first; NULL: they are left for the next one
  uint32_t n_changes;
  uint64_t missed;        // changes after these that were not kept
  struct fm_time_counts time;
  struct fm_tree_counts links; // between frames, that were left out
  struct fm_gate_counts gate;  // zeros without a gate
  uint64_t unpublished;   // violations: those dropped because the queue was full (2^20) or could
                          // not grow, and those counted with fm_engine_count_unpublished
};

/// Bytes of the conditions of a monitor.
static inline size_t fm_condition_bytes(const struct fm_monitor * monitor)
{
  return FM_CONDITION_BYTES + (size_t)monitor->n_requirements + (size_t)monitor->n_inputs;
}

/// Take what is due, while a clock is followed, and copy all counters. O(requirements + inputs +
/// topics + bytes of the changes + what is due).
FM_EXPORT void fm_engine_snapshot(struct fm_engine * engine, struct fm_snapshot * out);

#ifdef __cplusplus
}
#endif

#endif  // SNAPSHOT_H_
