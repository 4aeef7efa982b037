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

/// graph.h: looks at the graph of ROS for what a bundle names there: nodes, publishers and
/// subscribers of topics. The engine gets each change as a message, and what is seen first.
/// Lifecycle nodes are asked for their state when they come, and nodes for their parameters
/// (question.h): messages of theirs that the engine receives have what follows.
///
/// What is not there at first may not have been discovered yet: it has no value until it comes, or
/// until `patience` is over since the creation, when its absence is a value. After a look there is
/// none for FM_GRAPH_PERIOD_NS, or longer if it took long, up to FM_GRAPH_LONGEST_NS: a graph that
/// keeps changing takes less than a thousandth of a processor, with what a caller needs itself. (A
/// look mostly waits for memory: it visits each node and endpoint that the middleware knows.)
///
/// One thread at a time. Times are CLOCK_MONOTONIC in nanoseconds.

#ifndef GRAPH_H_
#define GRAPH_H_

#include "engine.h"
#include "middleware.h"
#include "service_call.h"

#define FM_GRAPH_PERIOD_NS 100000000
#define FM_GRAPH_LONGEST_NS 5000000000
#define FM_GRAPH_SHARE 2500  // of processor time: a look in so many times what the last one took
#define FM_GRAPH_AGAIN_NS 10000000000  // though no change is known of

/// What is counted.
enum fm_graph_kind
{
  FM_GRAPH_NODE = 0,
  FM_GRAPH_PUBLISHERS = 1,
  FM_GRAPH_SUBSCRIBERS = 2,
  FM_GRAPH_LIFECYCLE = 3,  // the state of a node
  FM_GRAPH_PARAMETER = 4   // of a node
};

struct fm_graph_source
{
  uint32_t topic;     // of the engine
  uint32_t kind;      // enum fm_graph_kind
  const char * name;  // the full name of the node or topic
  int64_t patience;   // ns
  const char * parameter;  // its name; "" of all else
};

/// rcutils_string_array_t.
struct fm_strings
{
  size_t size;
  char ** data;
  struct fm_allocator allocator;
};

/// rmw_names_and_types_t.
struct fm_names_and_types
{
  struct fm_strings names;
  struct fm_strings * types;  // of each name
};

/// Functions of the middleware, as those in middleware.h.
struct fm_graph_functions
{
  /// rmw_get_node_names
  int (* node_names)(
    const void * node, struct fm_strings * names, struct fm_strings * namespaces);
  /// rmw_count_publishers, rmw_count_subscribers
  int (* count_publishers)(const void * node, const char * topic, size_t * count);
  int (* count_subscribers)(const void * node, const char * topic, size_t * count);
  /// rcutils_string_array_fini
  int (* free_strings)(struct fm_strings * strings);
  /// rcutils_reset_error
  void (* forget_error)(void);
  /// rmw_get_topic_names_and_types, rmw_names_and_types_fini
  int (* topic_names)(
    const void * node, struct fm_allocator * allocator, bool no_demangle,
    struct fm_names_and_types * found);
  int (* free_topics)(struct fm_names_and_types * found);
};

struct fm_graph;

/// Make a watch of `n` sources, for an engine. `node` is the handle of rmw; `clients` are, of each
/// state or parameter, one of its service, and are called through `services`. All that is given
/// outlives the watch; the sources are copied, their names are not. NULL if memory is short.
/// O(n); allocates.
FM_EXPORT struct fm_graph * fm_graph_create(
  struct fm_engine * engine, const struct fm_graph_functions * functions,
  const struct fm_service_functions * services, const void * node,
  const struct fm_graph_source * sources, const struct fm_service_client * clients, uint32_t n,
  int64_t now);

/// Free a watch; NULL is ignored. O(1).
FM_EXPORT void fm_graph_destroy(struct fm_graph * graph);

/// Look at the graph if it is time: it has changed, or something else is due. `own` are, of each
/// source, the subscriptions of this node that are not counted. Returns when to call it next, if
/// the graph does not change before. What cannot be read stays as it was. O(nodes + sources) for a
/// look, with the costs of fm_engine_observe; allocates in the middleware.
FM_EXPORT int64_t fm_graph_review(
  struct fm_graph * graph, int64_t now, bool has_changed, const uint32_t * own);

/// Whether the graph has changed since the last look, and is looked at when it is time: until
/// then, no more changes need be noted. O(1).
FM_EXPORT bool fm_graph_knows_change(const struct fm_graph * graph);

#endif  // GRAPH_H_
