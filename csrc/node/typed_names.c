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

/// typed_names.c: see typed_names.h for the contract.

#include "typed_names.h"

#include <stdlib.h>

#include "mapped_topic.h"
#include "shared_names.h"

// The names of `uses` are those in `names`, which owns them.
struct collected
{
  const struct fm_node * node;
  struct fm_typed_use * uses;
  char ** names;
  uint32_t n;
};

// A name that ROS refuses is left out: it is logged where it is used.
static void collect(
  struct collected * found, const char * name, const char * type, struct fm_typed_use use)
{
  char * full = use.is_service ?
    fm_resolved_service(found->node, name) : fm_resolved_name(found->node, name);
  if (full != NULL) {
    use.name = full;
    use.type = type;
    found->names[found->n] = full;
    found->uses[found->n] = use;
    found->n += 1u;
  }
}

static void collect_gate(
  struct collected * found, const struct fm_node_gate_table * gate, uint32_t owner)
{
  const struct fm_typed_use use = {.owner = owner, .is_service = gate->service != NULL};
  collect(found, gate->name, gate->type, use);
  collect(found, gate->to, gate->type, use);
}

static void collect_actions(
  struct collected * found, const struct fm_node_table * table, uint32_t owner)
{
  struct fm_typed_use use = {.owner = owner};
  for (uint32_t k = 0; k < table->report.n_locks; ++k) {
    collect(found, table->report.locks[k].topic, "std_msgs/msg/Bool", use);
  }
  for (uint32_t k = 0; k < table->report.n_actions; ++k) {
    const struct fm_action * action = &table->report.actions[k];
    use.is_service = action->kind == FM_ACTION_CALL;
    if (action->kind != FM_ACTION_TRANSITION) {
      collect(found, action->target, table->action_types[k].type, use);
    }
  }
}

static void collect_all(
  struct collected * found, const struct fm_node_table * table, uint32_t owner)
{
  const struct fm_typed_use use = {.owner = owner, .is_input = true};
  for (uint32_t k = 0; k < table->report.n_topics; ++k) {
    const struct fm_report_topic * topic = &table->report.topics[k];
    if (topic->kind == FM_TOPIC && topic->variable[0] == '\0') {
      collect(found, topic->name, topic->type, use);
    }
  }
  if (table->gate != NULL) {
    collect_gate(found, table->gate, owner);
  }
  collect_actions(found, table, owner);
}

static void collect_own(struct collected * found, const struct fm_node_tables * tables)
{
  const struct fm_report_table * table = &tables->tables[0]->report;
  struct fm_typed_use use = {.owner = 0};
  for (uint32_t k = table->n_topics; k < table->n_used; ++k) {
    if (table->topics[k].kind == FM_OWN) {
      collect(found, table->topics[k].name, table->topics[k].type, use);
    }
  }
  use.is_service = true;
  for (uint32_t k = 0; k < tables->n_services; ++k) {
    collect(found, tables->services[k].name, tables->services[k].type, use);
  }
}

static uint32_t most(const struct fm_node_tables * tables)
{
  uint32_t n = tables->tables[0]->report.n_used + tables->n_services;
  for (uint32_t k = 0; k < tables->n; ++k) {
    const struct fm_report_table * table = &tables->tables[k]->report;
    n += table->n_topics + table->n_locks + table->n_actions + 2u;
  }
  return n;
}

static bool is_clear(
  struct collected * found, const struct fm_node_tables * tables, const char ** owners)
{
  struct fm_lines lines = {NULL, 0, 0};
  collect_own(found, tables);
  for (uint32_t k = 0; k < tables->n; ++k) {
    const struct fm_node_table * table = tables->tables[k];
    owners[k] = table->gate == NULL ? table->report.bundle : table->report.gate->name;
    collect_all(found, table, k + 1u);
  }
  const bool is_found = fm_find_two_types(
    &lines, found->uses, found->n, owners, tables->tables[0]->gate == NULL ? "bundle" : "gate");
  fm_log_lines(found->node, &lines);
  for (uint32_t k = 0; k < found->n; ++k) {
    free(found->names[k]);
  }
  return !is_found;
}

bool fm_refuse_two_types(const struct fm_node * node, const struct fm_node_tables * tables)
{
  const size_t n = most(tables);
  struct collected found = {
    node, calloc(n, sizeof(*found.uses)), calloc(n, sizeof(*found.names)), 0};
  const char ** owners = calloc(tables->n, sizeof(*owners));
  const bool is_good = found.uses != NULL && found.names != NULL && owners != NULL &&
    is_clear(&found, tables, owners);
  free(found.uses);
  free(found.names);
  free(owners);
  return is_good;
}
