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

/// keyed_topics.c: see keyed_topics.h for the contract.

#define _POSIX_C_SOURCE 200809L

#include "keyed_topics.h"

#include <stdlib.h>
#include <string.h>

#include "serialized.h"
#include "subscription.h"
#include "thread.h"

#define SHARE 20            // of time: a look in so many times what the last one took
#define MOST_BYTES 1024u    // of a name
#define MOST_GONE 1000u     // names that are gone, but are not logged again

// A name in the graph that fits a pattern.
struct known
{
  char * name;
  uint32_t pattern;
  bool is_taken;      // the node has it
  bool is_other_type; // logged
  bool is_seen;       // in the present look
  int64_t retry;      // between two attempts to subscribe; 0: none failed
  int64_t retry_at;
};

struct fm_keyed_topics
{
  const struct fm_graph_functions * functions;
  const void * node;
  struct fm_keyed_pattern * patterns;
  uint32_t n_patterns;
  struct known * known;  // sorted
  uint32_t n_known;
  uint32_t n_sorted;     // the others came in the present look
  uint32_t capacity;
  int64_t earliest;      // of the next look
  int64_t latest;
  bool has_changed;
};

struct fm_keyed_topics * fm_keyed_topics_create(
  const struct fm_graph_functions * functions, const void * node,
  const struct fm_keyed_pattern * patterns, uint32_t n)
{
  struct fm_keyed_topics * watch = calloc(1, sizeof(*watch));
  struct fm_keyed_pattern * copies = calloc(n + (size_t)1, sizeof(*copies));
  if (watch == NULL || copies == NULL) {
    free(watch);
    free(copies);
    return NULL;
  }
  memcpy(copies, patterns, n * sizeof(*copies));
  watch->functions = functions;
  watch->node = node;
  watch->patterns = copies;
  watch->n_patterns = n;
  watch->has_changed = true;
  return watch;
}

void fm_keyed_topics_destroy(struct fm_keyed_topics * watch)
{
  if (watch != NULL) {
    for (uint32_t k = 0; k < watch->n_known; ++k) {
      free(watch->known[k].name);
    }
    free(watch->known);
    free(watch->patterns);
    free(watch);
  }
}

// ---- names -------------------------------------------------------------------------------------

// The key in a name that fits a pattern: the part in place of that in braces; size 0: it does not.
static struct fm_key key_in(const char * pattern, const char * name)
{
  const char * const opened = strchr(pattern, '{');
  const char * const closed = opened == NULL ? NULL : strchr(opened, '}');
  const struct fm_key none = {NULL, 0};
  if (closed == NULL || strncmp(pattern, name, (size_t)(opened - pattern)) != 0) {
    return none;
  }
  const char * const key = name + (opened - pattern);
  const size_t size = strcspn(key, "/");
  return size > FM_MOST_KEY_BYTES || strcmp(key + size, closed + 1) != 0 ? none :
         (struct fm_key) {(const uint8_t *)key, (uint32_t)size};
}

static int compare(const void * one, const void * other)
{
  const struct known * const first = one;
  const struct known * const second = other;
  const int by_name = strcmp(first->name, second->name);
  return by_name != 0 ? by_name :
         first->pattern < second->pattern ? -1 : first->pattern > second->pattern;
}

static struct known * find(
  const struct fm_keyed_topics * watch, uint32_t pattern, const char * name)
{
  char text[MOST_BYTES];
  const size_t size = strlen(name);
  if (size >= sizeof(text) || watch->n_sorted == 0) {
    return NULL;
  }
  memcpy(text, name, size + 1u);
  const struct known wanted = {text, pattern, false, false, false, 0, 0};
  return bsearch(&wanted, watch->known, watch->n_sorted, sizeof(wanted), compare);
}

static struct known * add(struct fm_keyed_topics * watch, uint32_t pattern, const char * name)
{
  struct known * known =
    fm_with_room(watch->known, watch->n_known, &watch->capacity, sizeof(*known));
  if (known == NULL) {
    return NULL;
  }
  watch->known = known;
  char * const copy = strlen(name) < MOST_BYTES ? fm_copy_of(name) : NULL;
  if (copy == NULL) {
    return NULL;
  }
  struct known * const item = &watch->known[watch->n_known++];
  *item = (struct known) {copy, pattern, false, false, true, 0, 0};
  return item;
}

// ---- looks -------------------------------------------------------------------------------------

static bool has_type(const struct fm_strings * types, const char * wanted)
{
  bool is_found = false;
  for (size_t k = 0; k < types->size; ++k) {
    is_found = is_found || strcmp(types->data[k], wanted) == 0;
  }
  return is_found;
}

// What the middleware did not answer is asked again at the next look, which is due.
static void note_failure(struct fm_keyed_topics * watch)
{
  watch->functions->forget_error();
  watch->has_changed = true;
}

static bool is_published(struct fm_keyed_topics * watch, const char * name)
{
  size_t n = 0;
  if (watch->functions->count_publishers(watch->node, name, &n) != 0) {
    note_failure(watch);
  }
  return n > 0;
}

// Inputs of one topic with different `where` have patterns that differ in nothing else.
static bool is_logged_by_another(const struct fm_keyed_topics * watch, uint32_t pattern)
{
  const struct fm_keyed_pattern * const own = &watch->patterns[pattern];
  bool is_logged = false;
  for (uint32_t k = 0; k < pattern; ++k) {
    is_logged = is_logged || (strcmp(watch->patterns[k].name, own->name) == 0 &&
      strcmp(watch->patterns[k].type, own->type) == 0);
  }
  return is_logged;
}

static void note_name(
  struct fm_keyed_topics * watch, uint32_t k, const char * name, const struct fm_strings * types,
  struct fm_lines * lines)
{
  const struct fm_keyed_pattern * const pattern = &watch->patterns[k];
  if (key_in(pattern->name, name).size == 0) {
    return;
  }
  const bool is_ours = has_type(types, pattern->type);
  struct known * item = find(watch, k, name);
  if (item == NULL) {
    item = is_published(watch, name) ? add(watch, k, name) : NULL;
    if (item != NULL) {
      item->is_other_type = !is_ours;
    }
    if (item != NULL && !is_ours && types->size > 0 && !is_logged_by_another(watch, k)) {
      fm_add_other_type(lines, name, types->data[0], pattern->name, pattern->type);
    }
  } else {
    item->is_seen = true;
    item->is_other_type = item->is_other_type && !(is_ours && is_published(watch, name));
  }
}

static void remove_at(struct fm_keyed_topics * watch, uint32_t k)
{
  free(watch->known[k].name);
  memmove(
    watch->known + k, watch->known + k + 1, (watch->n_known - k - 1u) * sizeof(*watch->known));
  watch->n_known -= 1u;
}

// Forget the names that are gone, unless the node has them, or they would be logged again.
static void settle(struct fm_keyed_topics * watch)
{
  uint32_t n_kept = 0;
  for (uint32_t k = watch->n_known; k > 0; --k) {
    const struct known * const item = &watch->known[k - 1u];
    const bool is_kept = item->is_seen || item->is_taken;
    if (!is_kept && item->is_other_type && n_kept < MOST_GONE) {
      n_kept += 1;
    } else if (!is_kept) {
      remove_at(watch, k - 1u);
    }
  }
  if (watch->n_known > 0) {
    qsort(watch->known, watch->n_known, sizeof(*watch->known), compare);
  }
  watch->n_sorted = watch->n_known;
}

static void look(struct fm_keyed_topics * watch, struct fm_lines * lines)
{
  struct fm_allocator allocator = fm_malloc_allocator();
  struct fm_names_and_types found;
  memset(&found, 0, sizeof(found));
  if (watch->functions->topic_names(watch->node, &allocator, false, &found) != 0) {
    note_failure(watch);
    return;
  }
  for (uint32_t k = 0; k < watch->n_known; ++k) {
    watch->known[k].is_seen = false;
  }
  for (size_t i = 0; i < found.names.size; ++i) {
    for (uint32_t k = 0; k < watch->n_patterns; ++k) {
      note_name(watch, k, found.names.data[i], &found.types[i], lines);
    }
  }
  settle(watch);
  if (watch->functions->free_topics(&found) != 0) {
    watch->functions->forget_error();
  }
}

int64_t fm_keyed_topics_next(const struct fm_keyed_topics * watch)
{
  int64_t next = watch->has_changed ? watch->earliest : watch->latest;
  for (uint32_t k = 0; k < watch->n_known; ++k) {
    const struct known * const item = &watch->known[k];
    if (item->retry > 0 && !item->is_taken && item->retry_at < next) {
      next = item->retry_at;
    }
  }
  return next;
}

void fm_keyed_topics_review(
  struct fm_keyed_topics * watch, int64_t now, bool has_changed, struct fm_lines * lines)
{
  watch->has_changed = watch->has_changed || has_changed;
  if (now < watch->earliest || (!watch->has_changed && now < watch->latest)) {
    return;
  }
  const int64_t began = fm_steady_time();
  watch->has_changed = false;
  look(watch, lines);
  const int64_t rest = SHARE * (fm_steady_time() - began);
  watch->earliest = now + (rest > FM_KEYED_PERIOD_NS ? rest : FM_KEYED_PERIOD_NS);
  watch->latest = now + FM_GRAPH_AGAIN_NS;
}

bool fm_keyed_topics_knows_change(const struct fm_keyed_topics * watch)
{
  return watch->has_changed;
}

// ---- what the node has -------------------------------------------------------------------------

bool fm_keyed_topics_take(
  struct fm_keyed_topics * watch, int64_t now, struct fm_keyed_topic * found)
{
  for (uint32_t k = 0; k < watch->n_known; ++k) {
    struct known * const item = &watch->known[k];
    if (!item->is_taken && !item->is_other_type && now >= item->retry_at) {
      const struct fm_keyed_pattern * const pattern = &watch->patterns[item->pattern];
      item->is_taken = true;
      *found = (struct fm_keyed_topic) {
        pattern->topic, item->name, key_in(pattern->name, item->name)};
      return true;
    }
  }
  return false;
}

void fm_keyed_topics_fail(
  struct fm_keyed_topics * watch, const struct fm_keyed_topic * found, int64_t now)
{
  for (uint32_t k = 0; k < watch->n_known; ++k) {
    struct known * const item = &watch->known[k];
    if (item->name == found->name) {
      item->retry = fm_retry_wait(item->retry);
      item->retry_at = now + item->retry;
      item->is_taken = false;
    }
  }
}

void fm_keyed_topics_give_up(
  struct fm_keyed_topics * watch, uint32_t topic, const char * name)
{
  for (uint32_t k = 0; k < watch->n_known; ++k) {
    if (watch->patterns[watch->known[k].pattern].topic == topic &&
      strcmp(watch->known[k].name, name) == 0)
    {
      remove_at(watch, k);
      watch->n_sorted = watch->n_known;
      watch->has_changed = true;  // it may have come back
      return;
    }
  }
}
