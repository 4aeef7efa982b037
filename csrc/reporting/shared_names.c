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

/// shared_names.c: see shared_names.h for the contract.

#include "shared_names.h"

#include <stdlib.h>
#include <string.h>

// ---- circles of gates --------------------------------------------------------------------------

static bool leads_to(const struct fm_use * one, const struct fm_use * other)
{
  return one->from != NULL && other->from != NULL && strcmp(one->verb, other->verb) == 0 &&
         strcmp(one->to, other->from) == 0;
}

// The use after the first on a shortest circle, and in `after` the use after each; n: it is on
// none. `found` has room for n.
static uint32_t second_of_circle(
  const struct fm_use * uses, uint32_t n, uint32_t first, uint32_t * found, uint32_t * after)
{
  uint32_t n_found = 1;
  for (uint32_t k = 0; k < n; ++k) {
    after[k] = n;
  }
  found[0] = after[first] = first;
  for (uint32_t k = 0; k < n_found; ++k) {
    if (leads_to(&uses[first], &uses[found[k]])) {
      return found[k];
    }
    for (uint32_t before = 0; before < n; ++before) {
      if (after[before] == n && leads_to(&uses[before], &uses[found[k]])) {
        after[before] = found[k];
        found[n_found++] = before;
      }
    }
  }
  return n;
}

static bool find_circle(struct fm_lines * lines, const struct fm_use * uses, uint32_t n)
{
  uint32_t * found = calloc(2u * (size_t)n + 1u, sizeof(*found));
  struct fm_text way = {NULL, 0, 0};
  for (uint32_t first = 0; found != NULL && way.length == 0 && first < n; ++first) {
    uint32_t next = second_of_circle(uses, n, first, found, found + n);
    if (next < n) {
      fm_text_add(&way, "%s -> %s", uses[first].from, uses[first].to);
      for (; next != first; next = found[n + next]) {
        fm_text_add(&way, " -> %s", uses[next].to);
      }
      fm_lines_add(lines, FM_ERROR,
        "these gates are a circle: %s; remap their names to different ones", fm_text_get(&way));
    }
  }
  const bool is_found = way.length > 0;
  fm_text_free(&way);
  free(found);
  return is_found;
}

// ---- one name ----------------------------------------------------------------------------------

static void add_what(struct fm_text * text, const struct fm_use * use, bool names_bundle)
{
  if (use->kind[0] == '\0') {
    fm_text_add(text, "the node itself");
  } else {
    fm_text_add(text, "the %s '%s'", use->kind, use->owner);
  }
  if (names_bundle) {
    fm_text_add(text, " of '%s'", use->bundle);
  }
}

static void add_shared(
  struct fm_lines * lines, const struct fm_use * owner, const struct fm_use * use)
{
  const bool are_alike = strcmp(owner->kind, use->kind) == 0 &&
    strcmp(owner->owner, use->owner) == 0;
  struct fm_text first = {NULL, 0, 0};
  struct fm_text second = {NULL, 0, 0};
  add_what(&first, owner, are_alike);
  add_what(&second, use, are_alike);
  fm_lines_add(lines, FM_ERROR, "%s and %s both %s %s; write different names, or remap them",
    fm_text_get(&first), fm_text_get(&second), use->verb, use->name);
  fm_text_free(&first);
  fm_text_free(&second);
}

// The first use of a name that must be alone; NULL: there is none.
static const struct fm_use * owner_of(
  const struct fm_use * uses, uint32_t n, const struct fm_use * use)
{
  for (uint32_t k = 0; k < n; ++k) {
    if (uses[k].is_alone && strcmp(uses[k].verb, use->verb) == 0 &&
      strcmp(uses[k].name, use->name) == 0)
    {
      return &uses[k];
    }
  }
  return NULL;
}

static bool find_shared(struct fm_lines * lines, const struct fm_use * uses, uint32_t n)
{
  for (uint32_t k = 0; k < 2u * n; ++k) {  // first those that must be alone
    const struct fm_use * use = &uses[k % n];
    const struct fm_use * owner = use->is_alone == (k < n) ? owner_of(uses, n, use) : NULL;
    if (owner != NULL && owner != use && (owner->kind[0] != '\0' || use->kind[0] != '\0')) {
      add_shared(lines, owner, use);
      return true;
    }
  }
  return false;
}

static bool calls_node(const struct fm_use * use, const struct fm_use * other)
{
  return use->kind[0] != '\0' && other->kind[0] == '\0' && strcmp(use->verb, "call") == 0 &&
         strcmp(other->verb, "call") == 0 && strcmp(use->name, other->name) == 0;
}

static bool find_call(struct fm_lines * lines, const struct fm_use * uses, uint32_t n)
{
  for (uint32_t k = 0; k < n; ++k) {
    for (uint32_t other = 0; other < n; ++other) {
      if (calls_node(&uses[k], &uses[other])) {
        fm_lines_add(lines, FM_ERROR,
          "the action '%s' calls %s, a service of this node: a violation would end its own "
          "monitoring or begin it anew; choose a service of another node", uses[k].owner,
          uses[k].name);
        return true;
      }
    }
  }
  return false;
}

bool fm_find_shared(struct fm_lines * lines, const struct fm_use * uses, uint32_t n)
{
  return find_circle(lines, uses, n) || find_shared(lines, uses, n) || find_call(lines, uses, n);
}

// ---- types -------------------------------------------------------------------------------------

#define ONE_TYPE ": a process can use a %s with one type only; correct the type, or "

static bool is_of_one(const struct fm_typed_use * first, const struct fm_typed_use * use)
{
  return first->owner == use->owner || first->owner == 0;
}

static void add_two_types(
  struct fm_lines * lines, const struct fm_typed_use * first, const struct fm_typed_use * use,
  const char * const * owners, const char * kind)
{
  const char * what = use->is_service ? "service" : "topic";
  if (is_of_one(first, use)) {
    fm_lines_add(lines, FM_ERROR,
      "the %s %s has the types %s and %s" ONE_TYPE "write different names", what, use->name,
      first->type, use->type, what);
  } else {
    fm_lines_add(lines, FM_ERROR,
      "the %s %s has the type %s in the %s '%s' and %s in '%s'" ONE_TYPE "start a %s for each %s",
      what, use->name, first->type, kind, owners[first->owner - 1u], use->type,
      owners[use->owner - 1u], what, strcmp(kind, "gate") == 0 ? "node" : "monitor", kind);
  }
}

static const struct fm_typed_use * first_of(
  const struct fm_typed_use * uses, const struct fm_typed_use * use)
{
  const struct fm_typed_use * first = uses;
  while (first->is_service != use->is_service || strcmp(first->name, use->name) != 0) {
    first += 1;
  }
  return first;
}

bool fm_find_two_types(
  struct fm_lines * lines, const struct fm_typed_use * uses, uint32_t n,
  const char * const * owners, const char * kind)
{
  bool is_found = false;
  for (uint32_t k = 0; k < n; ++k) {
    const struct fm_typed_use * first = first_of(uses, &uses[k]);
    const bool is_left = uses[k].owner == 0 || (uses[k].is_input && is_of_one(first, &uses[k]));
    if (!is_left && strcmp(first->type, uses[k].type) != 0) {
      add_two_types(lines, first, &uses[k], owners, kind);
      is_found = true;
    }
  }
  return is_found;
}

// ---- topics that are one -----------------------------------------------------------------------

static bool is_conflict(const struct fm_report_topic * one, const struct fm_report_topic * other)
{
  const bool is_shared = (one->kind == FM_OWN || other->kind == FM_OWN) &&
    one->kind != FM_ANNOUNCED && other->kind != FM_ANNOUNCED;
  return strcmp(one->type, other->type) != 0 ||
         (strcmp(one->name, other->name) != 0 && !is_shared);
}

bool fm_find_merged(
  struct fm_lines * lines, const struct fm_report_table * table, const char * const * names)
{
  for (uint32_t k = 0; k < table->n_used; ++k) {
    const struct fm_report_topic * topic = &table->topics[k];
    for (uint32_t other = 0; other < k; ++other) {
      if (strcmp(names[k], names[other]) == 0 && is_conflict(&table->topics[other], topic)) {
        fm_lines_add(lines, FM_ERROR, "'%s' and %s'%s' are both remapped to %s; %s",
          table->topics[other].name, topic->kind == FM_OWN ? "the node's own " : "", topic->name,
          names[k], topic->kind == FM_TOPIC ?
          "if they are one topic, give the inputs that they feed one `topic:` in the bundle" :
          "what the node announces needs a topic of its own");
        return true;
      }
    }
  }
  return false;
}
