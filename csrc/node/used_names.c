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

/// used_names.c: see session.h for the contract.

#include "session.h"

#include <string.h>

#include "shared_names.h"
#include "words.h"

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

static bool is_part(const char * name, const char * found, size_t size)
{
  return (found == name || found[-1] == '/') && (found[size] == '\0' || found[size] == '/');
}

const char * fm_with_key(
  struct fm_memory * memory, const char * name, const char * variable, const char * key)
{
  struct fm_text text = {NULL, 0, 0};
  const size_t size = strlen(variable);
  const char * found = strstr(name, variable);
  while (found != NULL && !is_part(name, found, size)) {
    found = strstr(found + 1, variable);
  }
  if (found == NULL) {
    return fm_reserve_text(memory, name);
  }
  fm_text_add(&text, "%.*s%s%s", (int)(found - name), name, key, found + size);
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

struct used
{
  const struct fm_node * node;
  struct fm_memory memory;  // of all that it points to
  struct fm_use * uses;
  struct fm_typed_use * types;
  uint32_t n_uses;
  uint32_t n_types;
  bool is_good;             // all names could be resolved
};

static const char * resolve(struct used * used, const char * name, bool is_service)
{
  const char * full = fm_resolve(used->node, &used->memory, name, is_service);
  if (full == NULL) {
    used->is_good = false;
    fm_log_failure(used->node, FM_WORDS_NO_ENDPOINT);
  }
  return full == NULL ? "" : full;
}

static void add(struct used * used, const struct fm_used_names * names)
{
  for (uint32_t k = 0; k < names->n_uses; ++k) {
    struct fm_use use = names->uses[k];
    const bool is_service = strcmp(use.verb, "publish on") != 0;
    use.name = resolve(used, use.name, is_service);
    use.from = use.from == NULL ? NULL : resolve(used, use.from, is_service);
    use.to = use.to == NULL ? NULL : resolve(used, use.to, is_service);
    used->uses[used->n_uses++] = use;
  }
  for (uint32_t k = 0; k < names->n_types; ++k) {
    struct fm_typed_use use = names->types[k];
    use.name = resolve(used, use.name, use.is_service);
    used->types[used->n_types++] = use;
  }
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
    &lines, used->types, used->n_types, owners, has_gates ? "gate" : "bundle");
  fm_log_lines(used->node, &lines);
  return !is_found;
}

bool fm_refuse_names(const struct fm_node * node, const struct fm_node_tables * tables)
{
  struct used used = {.node = node, .is_good = true};
  size_t n_uses = tables->own.n_uses;
  size_t n_types = tables->own.n_types;
  for (uint32_t k = 0; k < tables->n; ++k) {
    n_uses += tables->tables[k]->names.n_uses;
    n_types += tables->tables[k]->names.n_types;
  }
  used.uses = fm_reserve(&used.memory, n_uses, sizeof(*used.uses));
  used.types = fm_reserve(&used.memory, n_types, sizeof(*used.types));
  const char ** owners = fm_reserve(&used.memory, tables->n, sizeof(*owners));
  bool is_good = !used.memory.is_short;
  if (is_good) {
    add(&used, &tables->own);
    for (uint32_t k = 0; k < tables->n; ++k) {
      add(&used, &tables->tables[k]->names);
    }
    is_good = used.is_good && is_clear(&used, tables, owners);
  }
  fm_memory_free(&used.memory);
  return is_good;
}
