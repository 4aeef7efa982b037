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

/// bound_topics.h: the topics with an instance variable in their names, such as /{robot}/odom:
/// those of listed keys from the start, the others as they are found in the graph.
///
/// Each is a mapped topic, whose key is bound to its receiver. All functions are called by the
/// main thread only.

#ifndef BOUND_TOPICS_H_
#define BOUND_TOPICS_H_

#include "keyed_topics.h"
#include "mapped_topic.h"

struct fm_bound_topic
{
  struct fm_mapped_topic mapped;
  char * name;     // the full one, with the key
};

/// What it needs of a session, which outlives it.
struct fm_bound_options
{
  struct fm_node * node;
  const struct fm_node_table * table;
  const char * const * names;          // of the table's topics, as resolved
  const struct fm_fixed_qos * fixed;   // of each
  enum fm_taking taking;
};

/// Zeroed: none.
struct fm_bound_topics
{
  struct fm_bound_options options;
  struct fm_engine * engine;           // NULL before fm_bound_start
  struct fm_bound_topic ** items;
  uint32_t n;
  uint32_t capacity;
  uint32_t * n_handovers;              // a topic of the table
  struct fm_keyed_topics * watch;      // NULL: no keys are found
  bool has_changed;                    // the graph; set by the owner
  bool is_leaked;                      // the middleware may still call back for one
};

/// Subscribe to the topics of listed keys. Returns false, with the reason logged; fm_bound_end is
/// to be called even then. O(listed keys).
bool fm_bound_begin(struct fm_bound_topics * bound, const struct fm_bound_options * options);

/// Begin to take their messages, and to look for others. The engine outlives them. As
/// fm_bound_begin.
bool fm_bound_start(struct fm_bound_topics * bound, struct fm_engine * engine);

/// Look at the graph if it is time: subscribe to what is found, end what is abandoned. Returns
/// when to call it again, on the steady clock. As fm_keyed_topics_review.
int64_t fm_bound_review(struct fm_bound_topics * bound);

/// The publishers of all that are one topic of the table: their number, and what is wrong with the
/// first of which something is. O(topics).
struct fm_publishers fm_bound_publishers(const struct fm_bound_topics * bound, uint32_t topic);

/// Unsubscribe from all. Returns false if the middleware may still call back: the engine must then
/// live as long as the process.
bool fm_bound_end(struct fm_bound_topics * bound);

#endif  // BOUND_TOPICS_H_
