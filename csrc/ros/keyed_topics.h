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

/// keyed_topics.h: finds the topics in the graph of ROS whose names fit one with an instance
/// variable, such as /{robot}/odom.
///
/// The node subscribes to each that is found, as to any topic, with the key bound to its receiver;
/// while it has no publisher for long (fm_subscription_is_abandoned), the node ends it, and says
/// so here. A topic of another type is logged once, also if it goes and returns. A topic that has
/// no publisher is none: the subscription of another monitor would keep it alive.
///
/// After a look there is none for FM_KEYED_PERIOD_NS, or longer if it took long: a graph that
/// keeps changing takes at most a twentieth of a processor.
///
/// One thread at a time. Times are CLOCK_MONOTONIC in nanoseconds.

#ifndef KEYED_TOPICS_H_
#define KEYED_TOPICS_H_

#include "graph.h"
#include "lines.h"

#define FM_KEYED_PERIOD_NS 100000000

/// A topic with a variable in its name, of which the keys are found.
struct fm_keyed_pattern
{
  uint32_t topic;        // of the engine
  const char * name;     // the full name, with the variable in braces
  const char * type;     // package/msg/Name
};

/// A topic that was found.
struct fm_keyed_topic
{
  uint32_t topic;        // of the engine
  const char * name;     // the full name
  struct fm_key key;     // within the name
};

struct fm_keyed_topics;

/// Make a watch of `n` patterns, which are copied; their texts, the functions and the node (a
/// handle of rmw) outlive it. NULL if memory is short. O(n); allocates.
FM_EXPORT struct fm_keyed_topics * fm_keyed_topics_create(
  const struct fm_graph_functions * functions, const void * node,
  const struct fm_keyed_pattern * patterns, uint32_t n);

/// Free it; NULL is ignored. O(topics found).
FM_EXPORT void fm_keyed_topics_destroy(struct fm_keyed_topics * watch);

/// Look at the graph if it has changed and it is time, or if that was long ago. What cannot be
/// read stays as it was, and is read again at the next look, which is due.
/// O(topics of the graph * n + found log found); allocates.
FM_EXPORT void fm_keyed_topics_review(
  struct fm_keyed_topics * watch, int64_t now, bool has_changed, struct fm_lines * lines);

/// When to review next, if the graph does not change before: for a look, or for another attempt at
/// a topic. O(topics found).
FM_EXPORT int64_t fm_keyed_topics_next(const struct fm_keyed_topics * watch);

/// Whether the graph has changed since the last look, and is looked at when it is time. O(1).
FM_EXPORT bool fm_keyed_topics_knows_change(const struct fm_keyed_topics * watch);

/// Take the next topic that was found, once. What it points to stays until it is given up. False:
/// there is none at `now`. O(topics found).
FM_EXPORT bool fm_keyed_topics_take(
  struct fm_keyed_topics * watch, int64_t now, struct fm_keyed_topic * found);

/// Give a topic that was taken back, since it could not be subscribed to: it is found again after
/// FM_RETRY_NS, and later with each failure. O(topics found).
FM_EXPORT void fm_keyed_topics_fail(
  struct fm_keyed_topics * watch, const struct fm_keyed_topic * found, int64_t now);

/// Give up a topic that was taken: it may be found again. O(topics found).
FM_EXPORT void fm_keyed_topics_give_up(
  struct fm_keyed_topics * watch, uint32_t topic, const char * name);

#endif  // KEYED_TOPICS_H_
