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

/// used_names.c: see session_parts.h for the contract.

#include "session_parts.h"

#include <stdlib.h>
#include <string.h>

#include "shared_names.h"

#define STAND_IN "fm_key"

const char * fm_resolve(
  const struct fm_node * node, struct fm_memory * memory, const char * name, bool is_service)
{
  char * resolved = NULL;
  if (rcl_node_resolve_name(
      &node->node, name, node->allocator, is_service, false, &resolved) != RCL_RET_OK)
  {
    return NULL;
  }
  const char * copy = fm_reserve_text(memory, resolved);
  node->allocator.deallocate(resolved, node->allocator.state);
  return copy;
}

static const char * in_memory(struct fm_memory * memory, struct fm_text * text)
{
  const char * copy = fm_reserve_text(memory, fm_text_get(text));
  fm_text_free(text);
  return copy;
}

const char * fm_with_key(
  struct fm_memory * memory, const char * name, const char * variable, const char * key)
{
  struct fm_text text = {NULL, 0, 0};
  const char * const found = strstr(name, variable);
  fm_text_add(&text, "%.*s%s%s", (int)(found - name), name, key, found + strlen(variable));
  return in_memory(memory, &text);
}

// In a name with a variable another word stands for it while it is resolved.
const char * fm_topic_name(
  const struct fm_node * node, struct fm_memory * memory, const struct fm_report_topic * topic)
{
  if (topic->kind >= FM_TRANSFORM) {
    return fm_reserve_text(memory, topic->name);
  }
  if (topic->variable[0] == '\0') {
    return fm_resolve(node, memory, topic->name, false);
  }
  const char * const name = fm_with_key(memory, topic->name, topic->variable, STAND_IN);
  const char * const full = name == NULL ? NULL : fm_resolve(node, memory, name, false);
  return full == NULL ? NULL : fm_with_key(memory, full, STAND_IN, topic->variable);
}

const char * fm_node_name(
  const struct fm_node * node, struct fm_memory * memory, const char * name)
{
  const char * const space = rcl_node_get_namespace(&node->node);
  struct fm_text text = {NULL, 0, 0};
  if (name[0] != '/') {
    fm_text_add(&text, "%s%s", space, strcmp(space, "/") == 0 ? "" : "/");
  }
  fm_text_add(&text, "%s", name);
  return in_memory(memory, &text);
}

// ---- all names of a node -----------------------------------------------------------------------

// Topics of the node itself, and services that no action may call.
static const char * const OWN_NAMES[] = {
  "/diagnostics", FM_DETAILS_TOPIC, "~/alive", "~/reset", "~/change_state"};
enum { TOPICS_OF_NODE = 3, OF_NODE = sizeof(OWN_NAMES) / sizeof(OWN_NAMES[0]) };

struct used
{
  const struct fm_node * node;
  struct fm_use * uses;
  struct fm_typed_use * typed;
  struct fm_memory memory;  // of all that it points to
  uint32_t n_uses;
  uint32_t n_typed;
  bool is_good;           // all names could be resolved
};

static const char * resolve(struct used * used, const char * name, bool is_service)
{
  const char * full = fm_resolve(used->node, &used->memory, name, is_service);
  if (full == NULL) {
    used->is_good = false;
    fm_log_failure(used->node, "cannot subscribe or advertise");
  }
  return full == NULL ? "" : full;
}

static void add_use(struct used * used, struct fm_use use)
{
  used->uses[used->n_uses++] = use;
}

static void add_type(struct used * used, struct fm_typed_use use)
{
  used->typed[used->n_typed++] = use;
}

static void add_own(struct used * used, const struct fm_node_tables * tables)
{
  const struct fm_report_table * table = &tables->tables[0]->report;
  for (uint32_t k = 0; k < OF_NODE; ++k) {
    const bool is_topic = k < TOPICS_OF_NODE;
    add_use(used, (struct fm_use) {
      "", "", "", is_topic ? "publish on" : "call", resolve(used, OWN_NAMES[k], !is_topic),
      is_topic && k > 0, NULL, NULL});  // an action may publish on /diagnostics
  }
  for (uint32_t k = table->n_topics; k < table->n_used; ++k) {
    const struct fm_report_topic * topic = &table->topics[k];
    if (topic->kind == FM_OWN) {
      const char * name = resolve(used, topic->name, false);
      add_type(used, (struct fm_typed_use) {name, topic->type, 0, false, false});
    }
  }
  for (uint32_t k = 0; k < tables->n_services; ++k) {
    const char * name = resolve(used, tables->services[k].name, true);
    add_type(used, (struct fm_typed_use) {name, tables->services[k].type, 0, true, false});
  }
}

static void add_topics(struct used * used, const struct fm_report_table * table, uint32_t owner)
{
  for (uint32_t k = 0; k < table->n_used; ++k) {
    const struct fm_report_topic * topic = &table->topics[k];
    if (topic->kind == FM_TOPIC && topic->variable[0] == '\0') {
      const char * name = resolve(used, topic->name, false);
      add_type(used, (struct fm_typed_use) {name, topic->type, owner, false, true});
    } else if (topic->kind == FM_ANNOUNCED) {
      const char * name = resolve(used, topic->name, false);
      add_use(used, (struct fm_use) {"", "", "", "publish on", name, true, NULL, NULL});
    }
  }
}

static void add_gate(struct used * used, const struct fm_node_table * table, uint32_t owner)
{
  const struct fm_node_gate_table * gate = table->gate;
  const bool is_service = gate->service != NULL;
  const char * from = resolve(used, gate->name, is_service);
  const char * to = resolve(used, gate->to, is_service);
  add_use(used, (struct fm_use) {
    "gate", table->report.gate->name, table->bundle, is_service ? "offer" : "publish on",
    is_service ? from : to, true, from, to});
  add_type(used, (struct fm_typed_use) {from, gate->type, owner, is_service, false});
  add_type(used, (struct fm_typed_use) {to, gate->type, owner, is_service, false});
}

static void add_locks(struct used * used, const struct fm_node_table * table, uint32_t owner)
{
  for (uint32_t k = 0; k < table->report.n_locks; ++k) {
    const struct fm_report_lock * lock = &table->report.locks[k];
    const char * name = resolve(used, lock->topic, false);
    add_use(used, (struct fm_use) {
      "lock", lock->name, table->bundle, "publish on", name, true, NULL, NULL});
    add_type(used, (struct fm_typed_use) {name, "std_msgs/msg/Bool", owner, false, false});
  }
}

// The topic or service of an action; of a transition, the service that changes the state.
static const char * name_of_action(struct used * used, const struct fm_action * action)
{
  struct fm_text target = {NULL, 0, 0};
  const bool is_transition = action->kind == FM_ACTION_TRANSITION;
  fm_text_add(&target, "%s%s", action->target, is_transition ? "/change_state" : "");
  const char * name = resolve(used, fm_text_get(&target), action->kind != FM_ACTION_PUBLISH);
  fm_text_free(&target);
  return name;
}

static void add_actions(struct used * used, const struct fm_node_table * table, uint32_t owner)
{
  for (uint32_t k = 0; k < table->report.n_actions; ++k) {
    const struct fm_action * action = &table->report.actions[k];
    const bool publishes = action->kind == FM_ACTION_PUBLISH;
    const char * name = name_of_action(used, action);
    add_use(used, (struct fm_use) {
      "action", action->name, table->bundle, publishes ? "publish on" : "call", name, false, NULL,
      NULL});
    if (action->kind != FM_ACTION_TRANSITION) {
      const char * type = table->action_types[k].type;
      add_type(used, (struct fm_typed_use) {name, type, owner, !publishes, false});
    }
  }
}

static void add_all(struct used * used, const struct fm_node_tables * tables)
{
  add_own(used, tables);
  for (uint32_t k = 0; k < tables->n; ++k) {
    const struct fm_node_table * table = tables->tables[k];
    add_topics(used, &table->report, k + 1u);
    if (table->gate != NULL) {
      add_gate(used, table, k + 1u);
    }
    add_locks(used, table, k + 1u);
    add_actions(used, table, k + 1u);
  }
}

// How many uses and types there are at most.
static size_t most(const struct fm_node_tables * tables)
{
  size_t n = OF_NODE + (size_t)tables->n_services + tables->tables[0]->report.n_used;
  for (uint32_t k = 0; k < tables->n; ++k) {
    const struct fm_report_table * table = &tables->tables[k]->report;
    n += (size_t)table->n_used + table->n_locks + table->n_actions + 2u;
  }
  return n;
}

static bool is_clear(
  const struct used * used, const struct fm_node_tables * tables, const char ** owners)
{
  const bool has_gates = tables->tables[0]->gate != NULL;
  struct fm_lines lines = {NULL, 0, 0};
  for (uint32_t k = 0; k < tables->n; ++k) {
    const struct fm_report_table * table = &tables->tables[k]->report;
    owners[k] = has_gates ? table->gate->name : table->bundle;
  }
  const bool is_found = fm_find_shared(&lines, used->uses, used->n_uses) || fm_find_two_types(
    &lines, used->typed, used->n_typed, owners, has_gates ? "gate" : "bundle");
  fm_log_lines(used->node, &lines);
  return !is_found;
}

bool fm_refuse_names(const struct fm_node * node, const struct fm_node_tables * tables)
{
  const size_t n = most(tables);
  struct used used = {.node = node, .is_good = true};
  used.uses = fm_reserve(&used.memory, n, sizeof(*used.uses));
  used.typed = fm_reserve(&used.memory, n, sizeof(*used.typed));
  const char ** owners = fm_reserve(&used.memory, tables->n, sizeof(*owners));
  bool is_good = !used.memory.is_short;
  if (is_good) {
    add_all(&used, tables);
    is_good = used.is_good && is_clear(&used, tables, owners);
  }
  fm_memory_free(&used.memory);
  return is_good;
}
