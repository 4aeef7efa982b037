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

/// node_graph.c: see session.h for the contract.

#include "session.h"

#include <lifecycle_msgs/srv/get_state.h>
#include <rcl_interfaces/srv/get_parameters.h>
#include <string.h>

#include "endpoints.h"
#include "rmw_functions.h"

static bool is_of_topic(const struct fm_graph_source * source)
{
  return source->kind == FM_GRAPH_PUBLISHERS || source->kind == FM_GRAPH_SUBSCRIBERS;
}

static bool find_names(struct fm_node_graph * graph, const struct fm_graph_source * sources)
{
  for (uint32_t k = 0; k < graph->n; ++k) {
    graph->sources[k] = sources[k];
    graph->sources[k].name = is_of_topic(&sources[k]) ?
      fm_resolve(graph->node, &graph->memory, sources[k].name, false) :
      fm_node_name(graph->node, &graph->memory, sources[k].name);
    if (graph->sources[k].name == NULL) {
      return false;
    }
  }
  return true;
}

static bool make_client(
  struct fm_node_graph * graph, uint32_t k, const rosidl_service_type_support_t * type,
  const char * service)
{
  struct fm_text name = {NULL, 0, 0};
  fm_text_add(&name, "%s/%s", graph->sources[k].name, service);
  const bool is_made = fm_client_open(
    graph->node, &graph->clients[k], type, fm_text_get(&name), &graph->services[k]);
  fm_text_free(&name);
  return is_made;
}

static bool make_clients(struct fm_node_graph * graph)
{
  bool is_good = true;
  for (uint32_t k = 0; is_good && k < graph->n; ++k) {
    if (graph->sources[k].kind == FM_GRAPH_LIFECYCLE) {
      is_good = make_client(
        graph, k, ROSIDL_GET_SRV_TYPE_SUPPORT(lifecycle_msgs, srv, GetState), "get_state");
    } else if (graph->sources[k].kind == FM_GRAPH_PARAMETER) {
      is_good = make_client(
        graph, k, ROSIDL_GET_SRV_TYPE_SUPPORT(rcl_interfaces, srv, GetParameters),
        "get_parameters");
    }
  }
  return is_good;
}

bool fm_node_graph_begin(
  struct fm_node_graph * graph, struct fm_node * node, const struct fm_node_table * table,
  struct fm_engine * engine)
{
  const size_t n = table->n_in_graph;
  if (n == 0) {
    return true;
  }
  struct fm_memory * memory = &graph->memory;
  *graph = (struct fm_node_graph) {.node = node, .n = table->n_in_graph, .has_changed = true};
  graph->sources = fm_reserve(memory, n, sizeof(*graph->sources));
  graph->own = fm_reserve(memory, n, sizeof(*graph->own));
  graph->clients = fm_reserve(memory, n, sizeof(*graph->clients));
  graph->services = fm_reserve(memory, n, sizeof(*graph->services));
  if (!memory->is_short && find_names(graph, table->in_graph) && make_clients(graph)) {
    graph->watch = fm_graph_create(
      engine, &fm_rmw_graph, &fm_rmw_services, rcl_node_get_rmw_handle(&node->node),
      graph->sources, graph->services, graph->n, fm_steady_now());
  }
  if (graph->watch == NULL) {
    fm_log_failure(node, "cannot look at the graph of ROS");
  }
  return graph->watch != NULL;
}

int64_t fm_node_graph_review(
  struct fm_node_graph * graph,
  uint32_t (* count_own)(const struct fm_session * session, const char * topic),
  const struct fm_session * session)
{
  if (graph->watch == NULL) {
    return INT64_MAX;
  }
  const bool has_changed = graph->has_changed;
  graph->has_changed = false;
  for (uint32_t k = 0; k < graph->n; ++k) {
    graph->own[k] = graph->sources[k].kind == FM_GRAPH_SUBSCRIBERS ?
      count_own(session, graph->sources[k].name) : 0;
  }
  return fm_graph_review(graph->watch, fm_steady_now(), has_changed, graph->own);
}

void fm_node_graph_end(struct fm_node_graph * graph)
{
  fm_graph_destroy(graph->watch);
  for (uint32_t k = 0; graph->clients != NULL && k < graph->n; ++k) {
    fm_client_close(graph->node, &graph->clients[k]);
  }
  fm_memory_free(&graph->memory);
  memset(graph, 0, sizeof(*graph));
}
