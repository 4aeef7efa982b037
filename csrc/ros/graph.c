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

/// graph.c: see graph.h for the contract.

#define _POSIX_C_SOURCE 200809L

#include "graph.h"

#include <stdlib.h>
#include <string.h>
#include <time.h>

#define SECOND_NS INT64_C(1000000000)

struct watched
{
  struct fm_graph_source about;
  int64_t absent_from;  // its absence is a value from then on
  bool is_there;        // of a node: it was found in the present look
  bool has_come;
};

struct fm_graph
{
  struct fm_engine * engine;
  const struct fm_graph_functions * functions;
  const void * node;
  struct watched * watched;
  uint32_t n;
  int64_t earliest;  // of the next look
  int64_t latest;
  bool has_changed;
  bool has_nodes;    // among what is watched
};

struct fm_graph * fm_graph_create(
  struct fm_engine * engine, const struct fm_graph_functions * functions, const void * node,
  const struct fm_graph_source * sources, uint32_t n, int64_t now)
{
  struct fm_graph * graph = calloc(1, sizeof(*graph));
  struct watched * watched = calloc(n + (size_t)1, sizeof(*watched));
  if (graph == NULL || watched == NULL) {
    free(graph);
    free(watched);
    return NULL;
  }
  *graph = (struct fm_graph) {engine, functions, node, watched, n, now, now, true, false};
  for (uint32_t k = 0; k < n; ++k) {
    watched[k] = (struct watched) {sources[k], now + sources[k].patience, false, false};
    graph->has_nodes = graph->has_nodes || sources[k].kind == FM_GRAPH_NODE;
  }
  return graph;
}

void fm_graph_destroy(struct fm_graph * graph)
{
  if (graph != NULL) {
    free(graph->watched);
    free(graph);
  }
}

// ---- looks -------------------------------------------------------------------------------------

static int64_t time_of(clockid_t clock)
{
  struct timespec now;
  (void)clock_gettime(clock, &now);
  return (int64_t)now.tv_sec * SECOND_NS + now.tv_nsec;
}

// Whether `full` is the name of a node in a namespace: "/" or "/robot".
static bool is_name(const char * full, const char * name_space, const char * name)
{
  const size_t length = strcmp(name_space, "/") == 0 ? 0u : strlen(name_space);
  return strncmp(full, name_space, length) == 0 && full[length] == '/' &&
         strcmp(full + length + 1u, name) == 0;
}

static void find_nodes(
  struct fm_graph * graph, const struct fm_strings * names, const struct fm_strings * namespaces)
{
  for (uint32_t k = 0; k < graph->n; ++k) {
    struct watched * const item = &graph->watched[k];
    item->is_there = false;
    for (size_t i = 0; item->about.kind == FM_GRAPH_NODE && i < names->size && !item->is_there;
      ++i)
    {
      item->is_there = is_name(item->about.name, namespaces->data[i], names->data[i]);
    }
  }
}

static bool look_at_nodes(struct fm_graph * graph)
{
  struct fm_strings names;
  struct fm_strings namespaces;
  memset(&names, 0, sizeof(names));
  memset(&namespaces, 0, sizeof(namespaces));
  const bool is_read = graph->functions->node_names(graph->node, &names, &namespaces) == 0 &&
    names.size == namespaces.size;
  if (is_read) {
    find_nodes(graph, &names, &namespaces);
  }
  if (graph->functions->free_strings(&names) != 0 ||
    graph->functions->free_strings(&namespaces) != 0 || !is_read)
  {
    graph->functions->forget_error();
  }
  return is_read;
}

// Returns false if it cannot be read.
static bool count(
  const struct fm_graph * graph, const struct watched * item, uint32_t own, int32_t * found)
{
  const struct fm_graph_functions * const functions = graph->functions;
  size_t n = 0;
  const int result = item->about.kind == FM_GRAPH_PUBLISHERS ?
    functions->count_publishers(graph->node, item->about.name, &n) :
    functions->count_subscribers(graph->node, item->about.name, &n);
  if (result != 0) {
    functions->forget_error();
  }
  n = n > own ? n - own : 0u;
  *found = n < INT32_MAX ? (int32_t)n : INT32_MAX;
  return result == 0;
}

static void note(struct fm_graph * graph, struct watched * item, int32_t found, int64_t now)
{
  item->has_come = item->has_come || found != 0;
  if (item->has_come || now >= item->absent_from) {
    (void)fm_engine_observe(
      graph->engine, item->about.topic, item->about.kind == FM_GRAPH_NODE, found,
      time_of(CLOCK_REALTIME));
  }
}

static void look(struct fm_graph * graph, int64_t now, const uint32_t * own)
{
  const bool are_nodes_known = graph->has_nodes && look_at_nodes(graph);
  for (uint32_t k = 0; k < graph->n; ++k) {
    struct watched * const item = &graph->watched[k];
    int32_t found = item->is_there ? 1 : 0;
    if (item->about.kind == FM_GRAPH_NODE ? are_nodes_known : count(graph, item, own[k], &found)) {
      note(graph, item, found, now);
    }
  }
}

// When the absence of something becomes a value.
static int64_t next_absence(const struct fm_graph * graph, int64_t now)
{
  int64_t next = INT64_MAX;
  for (uint32_t k = 0; k < graph->n; ++k) {
    const int64_t from = graph->watched[k].absent_from;
    next = !graph->watched[k].has_come && from > now && from < next ? from : next;
  }
  return next;
}

static int64_t pause_after(int64_t used)
{
  const int64_t wanted = used * FM_GRAPH_SHARE;
  return wanted < FM_GRAPH_PERIOD_NS ? FM_GRAPH_PERIOD_NS :
         wanted < FM_GRAPH_LONGEST_NS ? wanted : FM_GRAPH_LONGEST_NS;
}

bool fm_graph_knows_change(const struct fm_graph * graph)
{
  return graph->has_changed;
}

int64_t fm_graph_review(
  struct fm_graph * graph, int64_t now, bool has_changed, const uint32_t * own)
{
  graph->has_changed = graph->has_changed || has_changed;
  if (now >= graph->earliest && (graph->has_changed || now >= graph->latest)) {
    const int64_t absence = next_absence(graph, now);
    const int64_t began = time_of(CLOCK_THREAD_CPUTIME_ID);
    graph->has_changed = false;
    look(graph, now, own);
    graph->earliest = now + pause_after(time_of(CLOCK_THREAD_CPUTIME_ID) - began);
    graph->latest = absence < now + FM_GRAPH_AGAIN_NS ? absence : now + FM_GRAPH_AGAIN_NS;
  }
  return graph->has_changed || graph->latest < graph->earliest ? graph->earliest : graph->latest;
}
