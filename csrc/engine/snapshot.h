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

/// Keys that are named, of more instances of which the same is so.
#define FM_MOST_NAMED_KEYS 10u

/// Instances of which something is so. The first of their keys, in the order of slots: each its
/// size, then the bytes.
struct fm_named_keys
{
  uint64_t n;
  uint32_t n_keys;
  uint8_t keys[FM_MOST_NAMED_KEYS][FM_KEY_ROOM];
};

/// Of a kind of instances.
struct fm_kind_snapshot
{
  struct fm_pool_counts counts;
  struct fm_input_snapshot * inputs;   // n_inputs of its monitor: counts of all instances
  struct fm_named_keys * violated;     // of its requirements that are reported
  struct fm_named_keys * unevaluated;  // the same, of listed keys alone: not evaluated yet
  struct fm_named_keys * nearest;      // that whose present margin is the least, if it is known
};

/// The caller owns the arrays, as long as the comments say.
struct fm_snapshot
{
  struct fm_requirement_counts * requirements;  // n_requirements of all scopes; of instances: sums
                                                // and the least margin
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
  struct fm_kind_snapshot * kinds;  // NULL: without instances, or they are not wanted
};

/// Bytes of the conditions: of all requirements, and the inputs of the bundle's scope.
static inline size_t fm_condition_bytes(uint32_t n_requirements, uint32_t n_inputs)
{
  return FM_CONDITION_BYTES + (size_t)n_requirements + (size_t)n_inputs;
}

/// Take what is due, while a clock is followed, and copy all counters. O(requirements + inputs +
/// topics + bytes of the changes + what is due), and O(instances) of a kind with listed keys, or
/// with violated ones.
FM_EXPORT void fm_engine_snapshot(struct fm_engine * engine, struct fm_snapshot * out);

#endif  // SNAPSHOT_H_
