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

#include "question.h"
#include "thread.h"

struct watched
{
  struct fm_graph_source about;
  struct fm_question question;  // of a state or parameter
  int64_t absent_from;  // its absence is a value from then on
  int32_t n_nodes;      // of this name, in the last look
  int32_t n_before;
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

static bool is_asked_for(const struct watched * item)
{
  return item->about.kind == FM_GRAPH_LIFECYCLE || item->about.kind == FM_GRAPH_PARAMETER;
}

static bool is_of_node(const struct watched * item)
{
  return item->about.kind == FM_GRAPH_NODE || is_asked_for(item);
}

static bool make_question(
  struct watched * item, const struct fm_service_functions * services,
  const struct fm_service_client * client)
{
  return !is_asked_for(item) || fm_question_make(
    &item->question, services, client, item->about.topic,
    item->about.kind == FM_GRAPH_PARAMETER ? item->about.parameter : NULL);
}

static void free_watched(struct watched * watched, uint32_t n)
{
  for (uint32_t k = 0; watched != NULL && k < n; ++k) {
    fm_question_free(&watched[k].question);
  }
  free(watched);
}

struct fm_graph * fm_graph_create(
  struct fm_engine * engine, const struct fm_graph_functions * functions,
  const struct fm_service_functions * services, const void * node,
  const struct fm_graph_source * sources, const struct fm_service_client * clients, uint32_t n,
  int64_t now)
{
  struct fm_graph * graph = calloc(1, sizeof(*graph));
  struct watched * watched = calloc(n + (size_t)1, sizeof(*watched));
  bool is_made = graph != NULL && watched != NULL;
  if (is_made) {
    *graph = (struct fm_graph) {engine, functions, node, watched, n, now, now, true, false};
  }
  for (uint32_t k = 0; is_made && k < n; ++k) {
    watched[k].about = sources[k];
    watched[k].absent_from = now + sources[k].patience;
    graph->has_nodes = graph->has_nodes || is_of_node(&watched[k]);
    is_made = make_question(&watched[k], services, &clients[k]);
  }
  if (!is_made) {
    free_watched(watched, n);
    free(graph);
    return NULL;
  }
  return graph;
}

void fm_graph_destroy(struct fm_graph * graph)
{
  if (graph != NULL) {
    free_watched(graph->watched, graph->n);
    free(graph);
  }
}

// ---- looks -------------------------------------------------------------------------------------

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
    item->n_nodes = 0;
    for (size_t i = 0; is_of_node(item) && i < names->size; ++i) {
      item->n_nodes += is_name(item->about.name, namespaces->data[i], names->data[i]);
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

static void observe(
  struct fm_graph * graph, const struct watched * item, uint32_t type, int32_t value)
{
  const struct fm_seen seen = {type, {.i = value}, NULL, 0};
  (void)fm_engine_observe(
    graph->engine, item->about.topic, &seen, FM_ANY_EVENTS, fm_read_clock(CLOCK_REALTIME));
}

// A state is 0 without a node; a parameter stays as it was.
static void note_absence(struct fm_graph * graph, const struct watched * item, int64_t now)
{
  if (!item->has_come && now < item->absent_from) {
    return;
  }
  if (item->about.kind == FM_GRAPH_LIFECYCLE) {
    observe(graph, item, FM_SEEN_INT32, 0);
  } else {
    fm_engine_note_fault(graph->engine, item->about.topic, FM_NO_NODE);
  }
}

// A node is asked when it has come, and when another one of its name has.
static void note_asked(struct fm_graph * graph, struct watched * item, int64_t now)
{
  if (item->n_nodes == 0) {
    fm_question_end(&item->question);
    note_absence(graph, item, now);
  } else if (item->n_nodes != item->n_before) {
    fm_engine_note_node(graph->engine, item->about.topic);
    fm_question_begin(&item->question, now);
  } else {
    fm_question_repeat(&item->question, now);
  }
  item->n_before = item->n_nodes;
}

static void note(struct fm_graph * graph, struct watched * item, int32_t found, int64_t now)
{
  item->has_come = item->has_come || found != 0;
  if (is_asked_for(item)) {
    note_asked(graph, item, now);
  } else if (item->has_come || now >= item->absent_from) {
    observe(
      graph, item, item->about.kind == FM_GRAPH_NODE ? FM_SEEN_BOOL : FM_SEEN_INT32, found);
  }
}

static void look(struct fm_graph * graph, int64_t now, const uint32_t * own)
{
  const bool are_nodes_known = graph->has_nodes && look_at_nodes(graph);
  for (uint32_t k = 0; k < graph->n; ++k) {
    struct watched * const item = &graph->watched[k];
    int32_t found = item->n_nodes > 0 ? 1 : 0;
    if (is_of_node(item) ? are_nodes_known : count(graph, item, own[k], &found)) {
      note(graph, item, found, now);
    }
  }
}

// Returns when to look again.
static int64_t look_for_answers(struct fm_graph * graph, int64_t now)
{
  int64_t next = INT64_MAX;
  for (uint32_t k = 0; k < graph->n; ++k) {
    const int64_t due = fm_question_look(
      &graph->watched[k].question, graph->engine, now, fm_read_clock(CLOCK_REALTIME));
    next = due < next ? due : next;
  }
  return next;
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
    const int64_t began = fm_read_clock(CLOCK_THREAD_CPUTIME_ID);
    graph->has_changed = false;
    look(graph, now, own);
    graph->earliest = now + pause_after(fm_read_clock(CLOCK_THREAD_CPUTIME_ID) - began);
    graph->latest = absence < now + FM_GRAPH_AGAIN_NS ? absence : now + FM_GRAPH_AGAIN_NS;
  }
  const int64_t next =
    graph->has_changed || graph->latest < graph->earliest ? graph->earliest : graph->latest;
  const int64_t answer = look_for_answers(graph, now);
  return answer < next ? answer : next;
}
