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

/// node_graph.h: what the bundle names in the graph of ROS; graph.h looks, in the main thread.

#ifndef NODE_GRAPH_H_
#define NODE_GRAPH_H_

#include "mapped_topic.h"

/// Zeroed: there is nothing. The functions make and end what it holds.
struct fm_node_graph
{
  struct fm_node * node;
  struct fm_graph_source * sources;
  char ** names;        // of each, in full
  uint32_t * own;       // subscriptions of this node
  rcl_client_t * clients;  // of states and parameters
  struct fm_service_client * services;
  uint32_t n;
  struct fm_graph * watch;
  bool has_changed;     // the graph, since the last look
};

/// The full name of a node: in the namespace of this one, unless it begins with a slash. NULL if
/// memory is short. The caller frees it.
char * fm_node_name(const struct fm_node * node, const char * name);

/// Prepare to look, for an engine, which outlives it. Returns false, with the error logged.
bool fm_node_graph_begin(
  struct fm_node_graph * graph, struct fm_node * node, const struct fm_node_table * table,
  struct fm_engine * engine);

/// Look if it is time; the node's own subscriptions, which `count_own` returns for a topic, are
/// not counted. Returns when to call it next: CLOCK_MONOTONIC, INT64_MAX if there is nothing to
/// look for. As fm_graph_review.
int64_t fm_node_graph_review(
  struct fm_node_graph * graph, uint32_t (* count_own)(const void * context, const char * topic),
  const void * context);

void fm_node_graph_end(struct fm_node_graph * graph);

#endif  // NODE_GRAPH_H_
