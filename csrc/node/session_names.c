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

/// session_names.c: see session_names.h for the contract.

#include "session_names.h"

#include <stdlib.h>
#include <string.h>

#include "words.h"

static uint32_t most_uses(const struct fm_session * sessions, uint32_t n)
{
  uint32_t most = 3u;  // of the node itself
  for (uint32_t k = 0; k < n; ++k) {
    const struct fm_report_table * table = &sessions[k].table->report;
    most += sessions[k].n_handlers + table->n_locks + table->n_actions + 1u;
  }
  return most;
}

static struct fm_use use_of_node(const char * name)
{
  return (struct fm_use) {"", "", "", "publish on", name, true};
}

static uint32_t add_uses(const struct fm_session * session, struct fm_use * uses)
{
  const struct fm_node_table * table = session->table;
  uint32_t n = 0;
  for (uint32_t k = 0; k < session->n_handlers; ++k) {
    uses[n++] = use_of_node(rcl_publisher_get_topic_name(&session->handlers[k]));
  }
  if (table->gate != NULL) {
    const bool is_service = table->report.gate->is_service;
    uses[n++] = (struct fm_use) {
      "gate", table->report.gate->name, table->bundle, is_service ? "offer" : "publish on",
      is_service ? session->gate_source : session->gate_target, true};
  }
  return n + fm_node_actions_uses(&session->actions, &uses[n]);
}

static bool refuse_shared(const struct fm_session * sessions, uint32_t n)
{
  const struct fm_node * node = sessions->node;
  struct fm_use * uses = calloc(most_uses(sessions, n), sizeof(*uses));
  char * alive = fm_resolved_name(node, "~/alive");
  char * health = fm_resolved_name(node, "/diagnostics");
  struct fm_lines lines = {NULL, 0, 0};
  bool is_good = uses != NULL && alive != NULL && health != NULL;
  if (is_good) {
    uint32_t n_uses = 3;
    uses[0] = use_of_node(health);
    uses[0].is_alone = false;  // an action may publish on it
    uses[1] = use_of_node(rcl_publisher_get_topic_name(&sessions->details));
    uses[2] = use_of_node(alive);
    for (uint32_t k = 0; k < n; ++k) {
      n_uses += add_uses(&sessions[k], &uses[n_uses]);
    }
    is_good = !fm_find_shared(&lines, uses, n_uses);
    fm_log_lines(node, &lines);
  }
  free(alive);
  free(health);
  free(uses);
  return is_good;
}

// What a gate reads or offers, and what it publishes on or calls, by full names.
struct way
{
  const char * from;
  const char * to;
};

// Find the last way of a shortest circle that begins with the first of `found`: `before` has the
// way before each. Returns n if there is none.
static uint32_t close_circle(
  const struct way * ways, uint32_t n, uint32_t * found, uint32_t * before)
{
  uint32_t n_found = 1;
  for (uint32_t k = 0; k < n_found; ++k) {
    const struct way * way = &ways[found[k]];
    if (strcmp(way->to, ways[found[0]].from) == 0) {
      return found[k];
    }
    for (uint32_t next = 0; next < n; ++next) {
      if (before[next] == n && strcmp(way->to, ways[next].from) == 0) {
        before[next] = found[k];
        found[n_found++] = next;
      }
    }
  }
  return n;
}

static void log_circle(
  const struct fm_node * node, const struct way * ways, const uint32_t * before, uint32_t * found,
  uint32_t last)
{
  struct fm_text text = {NULL, 0, 0};
  const uint32_t first = found[0];
  uint32_t length = 1;
  for (found[0] = last; found[length - 1u] != first; ++length) {
    found[length] = before[found[length - 1u]];
  }
  fm_text_add(&text, "%s", ways[first].from);
  while (length > 0) {
    fm_text_add(&text, " -> %s", ways[found[--length]].to);
  }
  fm_log(node, FM_ERROR, FM_WORDS_CIRCLE, fm_text_get(&text));
  fm_text_free(&text);
}

// Log a shortest circle of gates, by which a message would go round for ever. O(n^3).
static bool find_circle(const struct fm_node * node, const struct way * ways, uint32_t n)
{
  uint32_t * found = calloc(2u * (size_t)n + 1u, sizeof(*found));
  uint32_t last = n;
  for (uint32_t first = 0; found != NULL && last == n && first < n; ++first) {
    for (uint32_t k = 0; k < n; ++k) {
      found[n + k] = k == first ? first : n;
    }
    found[0] = first;
    last = close_circle(ways, n, found, found + n);
  }
  if (last != n) {
    log_circle(node, ways, found + n, found, last);
  }
  free(found);
  return last != n;
}

// Of the gates on topics, or of those on services.
static bool refuse_circle(const struct fm_session * sessions, uint32_t n, bool is_service)
{
  struct way * ways = calloc(n, sizeof(*ways));
  uint32_t n_ways = 0;
  for (uint32_t k = 0; ways != NULL && k < n; ++k) {
    const struct fm_node_table * table = sessions[k].table;
    if (table->gate != NULL && table->report.gate->is_service == is_service) {
      ways[n_ways++] = (struct way) {sessions[k].gate_source, sessions[k].gate_target};
    }
  }
  const bool is_good = ways != NULL && !find_circle(sessions->node, ways, n_ways);
  free(ways);
  return is_good;
}

bool fm_refuse_shared_names(const struct fm_session * sessions, uint32_t n)
{
  bool is_good = refuse_circle(sessions, n, false) && refuse_circle(sessions, n, true) &&
    refuse_shared(sessions, n);
  for (uint32_t k = 0; is_good && k < n; ++k) {
    is_good = !fm_node_actions_call_own(&sessions[k].actions);
  }
  return is_good;
}
