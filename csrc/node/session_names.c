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

// Topics of the node itself, and services that no action may call.
static const char * const OWN_NAMES[] = {
  "/diagnostics", FM_DETAILS_TOPIC, "~/alive", "~/reset", "~/change_state"};
enum { TOPICS_OF_NODE = 3, OF_NODE = sizeof(OWN_NAMES) / sizeof(OWN_NAMES[0]) };

static uint32_t most_uses(const struct fm_session * sessions, uint32_t n)
{
  uint32_t most = OF_NODE;
  for (uint32_t k = 0; k < n; ++k) {
    const struct fm_report_table * table = &sessions[k].table->report;
    most += sessions[k].n_handlers + table->n_locks + table->n_actions + 1u;
  }
  return most;
}

static struct fm_use use_of_node(const char * name)
{
  return (struct fm_use) {"", "", "", "publish on", name, true, NULL, NULL};
}

static uint32_t add_own(char * const * names, struct fm_use * uses)
{
  for (uint32_t k = 0; k < OF_NODE; ++k) {
    uses[k] = use_of_node(names[k]);
    uses[k].verb = k < TOPICS_OF_NODE ? "publish on" : "call";
    uses[k].is_alone = k > 0 && k < TOPICS_OF_NODE;  // an action may publish on /diagnostics
  }
  return OF_NODE;
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
      is_service ? session->gate_source : session->gate_target, true, session->gate_source,
      session->gate_target};
  }
  return n + fm_node_actions_uses(&session->actions, &uses[n]);
}

bool fm_refuse_shared_names(const struct fm_session * sessions, uint32_t n)
{
  const struct fm_node * node = sessions->node;
  char * names[OF_NODE];
  struct fm_use * uses = calloc(most_uses(sessions, n), sizeof(*uses));
  struct fm_lines lines = {NULL, 0, 0};
  bool is_good = uses != NULL;
  for (uint32_t k = 0; k < OF_NODE; ++k) {
    names[k] = k < TOPICS_OF_NODE ?
      fm_resolved_name(node, OWN_NAMES[k]) : fm_resolved_service(node, OWN_NAMES[k]);
    is_good = is_good && names[k] != NULL;
  }
  if (is_good) {
    uint32_t n_uses = add_own(names, uses);
    for (uint32_t k = 0; k < n; ++k) {
      n_uses += add_uses(&sessions[k], &uses[n_uses]);
    }
    is_good = !fm_find_shared(&lines, uses, n_uses);
    fm_log_lines(node, &lines);
  }
  for (uint32_t k = 0; k < OF_NODE; ++k) {
    free(names[k]);
  }
  free(uses);
  return is_good;
}
