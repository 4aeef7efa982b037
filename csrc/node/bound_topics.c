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

/// bound_topics.c: see session_parts.h for the contract.

#include "session_parts.h"

#include <stdlib.h>
#include <string.h>

#include "rmw_functions.h"

// ---- topics ------------------------------------------------------------------------------------

static struct fm_bound_topic * add(struct fm_bound_topics * bound, const char * name)
{
  struct fm_bound_topic ** items =
    fm_with_room(bound->items, bound->n, &bound->capacity, sizeof(*items));
  struct fm_bound_topic * item = items == NULL ? NULL : calloc(1, sizeof(*item));
  bound->items = items == NULL ? bound->items : items;
  if (item == NULL) {
    return NULL;
  }
  item->name = fm_copy_of(name);
  bound->items[bound->n++] = item;
  return item->name == NULL ? NULL : item;
}

// Subscribe to a topic, by its full name.
static bool open_topic(
  struct fm_bound_topics * bound, const char * name, uint32_t topic, struct fm_key key,
  bool is_found)
{
  const struct fm_bound_options * options = &bound->options;
  struct fm_bound_topic * item = name == NULL ? NULL : add(bound, name);
  if (item == NULL) {
    fm_log(options->node, FM_ERROR, "cannot subscribe to %s as %s: memory is short",
      options->names[topic], options->table->report.topics[topic].type);
    return false;
  }
  item->mapped.taking = options->taking;
  item->mapped.key = key;
  item->mapped.is_found = is_found;
  item->mapped.n_handovers = &bound->n_handovers[topic];
  return fm_topic_open(
    &item->mapped, options->node, options->table, item->name, &options->fixed[topic], topic);
}

static void remove_at(struct fm_bound_topics * bound, uint32_t k)
{
  struct fm_bound_topic * item = bound->items[k];
  if (item->mapped.state != NULL) {
    bound->is_leaked = !fm_topic_close(&item->mapped) || bound->is_leaked;
  }
  free(item->name);
  free(item);
  bound->n -= 1u;
  memmove(bound->items + k, bound->items + k + 1, (bound->n - k) * sizeof(*bound->items));
}

// ---- listed keys -------------------------------------------------------------------------------

static bool open_listed(struct fm_bound_topics * bound, uint32_t topic)
{
  const struct fm_report_topic * about = &bound->options.table->report.topics[topic];
  const struct fm_node_topic * with = &bound->options.table->topics[topic];
  struct fm_memory memory = {NULL, false};
  bool is_good = true;
  for (uint32_t k = 0; is_good && k < with->n_listed; ++k) {
    const char * const key = (const char *)with->listed[k].bytes;
    const char * const name = fm_with_key(&memory, about->name, about->variable, key);
    is_good = open_topic(
      bound, name == NULL ? NULL : fm_resolve(bound->options.node, &memory, name, false), topic,
      with->listed[k], false);
  }
  fm_memory_free(&memory);
  return is_good;
}

bool fm_bound_begin(struct fm_bound_topics * bound, const struct fm_bound_options * options)
{
  const struct fm_node_table * table = options->table;
  bool is_good = true;
  memset(bound, 0, sizeof(*bound));
  bound->options = *options;
  bound->n_handovers = calloc(table->report.n_topics + (size_t)1, sizeof(*bound->n_handovers));
  for (uint32_t k = 0; is_good && bound->n_handovers != NULL && k < table->report.n_topics; ++k) {
    is_good = open_listed(bound, k);
  }
  return is_good && bound->n_handovers != NULL;
}

// ---- found keys --------------------------------------------------------------------------------

static bool make_watch(struct fm_bound_topics * bound)
{
  const struct fm_node_table * table = bound->options.table;
  struct fm_keyed_pattern * patterns =
    calloc(table->report.n_topics + (size_t)1, sizeof(*patterns));
  uint32_t n = 0;
  for (uint32_t k = 0; patterns != NULL && k < table->report.n_topics; ++k) {
    const struct fm_report_topic * topic = &table->report.topics[k];
    if (topic->variable[0] != '\0' && table->topics[k].n_listed == 0) {
      patterns[n++] = (struct fm_keyed_pattern) {k, bound->options.names[k], topic->type};
    }
  }
  if (n > 0) {
    bound->watch = fm_keyed_topics_create(
      &fm_rmw_graph, rcl_node_get_rmw_handle(&bound->options.node->node), patterns, n);
  }
  const bool is_good = patterns != NULL && (n == 0 || bound->watch != NULL);
  free(patterns);
  if (!is_good) {
    fm_log(bound->options.node, FM_ERROR, "cannot look at the graph of ROS: memory is short");
  }
  return is_good;
}

bool fm_bound_start(struct fm_bound_topics * bound, struct fm_engine * engine)
{
  bound->engine = engine;
  bound->has_changed = true;
  for (uint32_t k = 0; k < bound->n; ++k) {
    if (!fm_topic_start(&bound->items[k]->mapped, engine, fm_node_middleware())) {
      return false;
    }
  }
  return make_watch(bound);
}

static void end_abandoned(struct fm_bound_topics * bound)
{
  const int64_t now = fm_steady_now();
  for (uint32_t k = bound->n; k > 0; --k) {
    struct fm_bound_topic * item = bound->items[k - 1u];
    if (item->mapped.is_found && fm_subscription_is_abandoned(item->mapped.state, now)) {
      const uint32_t topic = item->mapped.index;
      char * const name = fm_copy_of(item->name);
      remove_at(bound, k - 1u);
      if (name != NULL) {
        fm_keyed_topics_give_up(bound->watch, topic, name);
      }
      free(name);
    }
  }
}

// What cannot be subscribed to is found again later.
static void subscribe_found(struct fm_bound_topics * bound, int64_t now)
{
  struct fm_keyed_topic found;
  while (fm_keyed_topics_take(bound->watch, now, &found)) {
    const uint32_t n = bound->n;
    const bool is_open =
      open_topic(bound, found.name, found.topic, found.key, true) && fm_topic_start(
      &bound->items[n]->mapped, bound->engine, fm_node_middleware());
    if (!is_open) {
      fm_keyed_topics_fail(bound->watch, &found, now);
    }
    if (!is_open && bound->n > n) {
      remove_at(bound, n);
    }
  }
}

int64_t fm_bound_review(struct fm_bound_topics * bound)
{
  struct fm_lines lines = {NULL, 0, 0};
  if (bound->watch == NULL) {
    return INT64_MAX;
  }
  const bool has_changed = bound->has_changed;
  bound->has_changed = false;
  end_abandoned(bound);
  const int64_t now = fm_steady_now();
  fm_keyed_topics_review(bound->watch, now, has_changed, &lines);
  fm_log_lines(bound->options.node, &lines);
  subscribe_found(bound, now);
  return fm_keyed_topics_next(bound->watch);
}

struct fm_publishers fm_bound_publishers(const struct fm_bound_topics * bound, uint32_t topic)
{
  struct fm_publishers all = {0, "", ""};
  for (uint32_t k = 0; k < bound->n; ++k) {
    const struct fm_mapped_topic * mapped = &bound->items[k]->mapped;
    if (mapped->index == topic && mapped->state != NULL) {
      const struct fm_publishers one = fm_subscription_publishers(mapped->state);
      all.n += one.n;
      all.unmatched = all.unmatched[0] == '\0' ? one.unmatched : all.unmatched;
      all.other_types = all.other_types[0] == '\0' ? one.other_types : all.other_types;
    }
  }
  return all;
}

bool fm_bound_end(struct fm_bound_topics * bound)
{
  while (bound->n > 0) {
    remove_at(bound, bound->n - 1u);
  }
  const bool is_over = !bound->is_leaked;
  fm_keyed_topics_destroy(bound->watch);
  free(bound->items);
  free(bound->n_handovers);
  memset(bound, 0, sizeof(*bound));
  return is_over;
}
