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

/// engine_graph.c: what is seen of the graph of ROS, and of nodes, comes in as messages.

#define _POSIX_C_SOURCE 200809L

#include "engine_parts.h"

#include <stdlib.h>

#include "instance.h"
#include "seen.h"
#include "thread.h"

// ---- derived from others -----------------------------------------------------------------------

bool fm_engine_follow_derived(
  struct fm_engine * engine, const struct fm_derived_topic * topics, uint32_t n)
{
  engine->derived = calloc(n + (size_t)1, sizeof(*engine->derived));
  bool is_made = engine->derived != NULL;
  for (uint32_t k = 0; is_made && k < n; ++k) {
    is_made = topics[k].topic < engine->options.n_topics &&
      topics[k].source < engine->options.n_topics;
    if (is_made) {
      engine->topics[topics[k].source].is_source = true;
      engine->topics[topics[k].topic].observed.wanted = topics[k].type;
      engine->derived[engine->n_derived++] = topics[k];
    }
  }
  return is_made;
}

void fm_engine_free_derived(struct fm_engine * engine)
{
  free(engine->derived);
  free(engine->made);
  free(engine->made_fields);
}

// ---- messages ----------------------------------------------------------------------------------

static uint32_t most_fields(const struct fm_engine_options * options)
{
  uint32_t most = 1u;
  for (uint32_t t = 0; t < options->n_topics; ++t) {
    most = options->topics[t].n_inputs > most ? options->topics[t].n_inputs : most;
  }
  return most;
}

static bool make_room(struct fm_engine * engine, size_t size)
{
  if (engine->made_fields == NULL) {
    engine->made_fields = calloc(most_fields(&engine->options), sizeof(*engine->made_fields));
  }
  if (size > engine->made_room) {
    uint8_t * const made = realloc(engine->made, size);
    engine->made = made == NULL ? engine->made : made;
    engine->made_room = made == NULL ? engine->made_room : size;
  }
  return engine->made_fields != NULL && engine->made_room >= size;
}

// The messages have no publisher: none of them is lost.
static void deliver_seen_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_seen * seen,
  const struct fm_origin * origin)
{
  const struct fm_origin unnumbered = {origin->received, origin->sent, 0, NULL, false, NULL, 0};
  struct fm_reading reading;
  uint32_t receipt;
  if (!make_room(engine, FM_SEEN_OVERHEAD + (size_t)seen->length)) {
    return;
  }
  (void)fm_engine_read(
    engine, topic, engine->made, fm_write_seen(seen, engine->made), engine->made_fields, &reading);
  if (fm_engine_accept_locked(engine, topic, &reading, &unnumbered, &receipt)) {
    fm_engine_deliver_locked(engine, topic, &reading, &unnumbered);
  }
}

static void count_unusable_locked(struct fm_engine * engine, uint32_t topic)
{
  const struct fm_topic * const fed = &engine->options.topics[topic];
  for (uint32_t k = 0; k < fed->n_inputs; ++k) {
    fm_evaluator_unusable(engine->options.evaluator, fed->inputs[k]);
  }
}

// Whether a parameter has a value of the type of its topic; a fault is noted.
static bool is_usable_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_seen * seen)
{
  struct fm_observed * const observed = &engine->topics[topic].observed;
  const struct fm_observed before = *observed;
  observed->type = seen->type;
  observed->fault = before.wanted == FM_SEEN_NOTHING || before.wanted == seen->type ? FM_NO_FAULT :
    seen->type == FM_SEEN_NOTHING ? FM_NOT_SET : FM_OTHER_TYPE;
  if (observed->fault == FM_OTHER_TYPE &&
    (before.fault != FM_OTHER_TYPE || before.type != seen->type))
  {
    count_unusable_locked(engine, topic);
  }
  return observed->fault == FM_NO_FAULT;
}

static bool is_there(const struct fm_observed * observed, int64_t bits)
{
  const bool is_parameter =
    observed->wanted != FM_SEEN_NOTHING && observed->wanted != FM_SEEN_INT32;
  return is_parameter || bits != 0;
}

// Deliver what was seen, if it is usable and another than last time. Returns whether it is.
static bool observe_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_seen * seen,
  const struct fm_origin * origin)
{
  struct fm_observed * const observed = &engine->topics[topic].observed;
  const int64_t bits = fm_seen_bits(seen);
  if (!is_usable_locked(engine, topic, seen) || (observed->has_value && observed->value == bits)) {
    return false;
  }
  observed->value = bits;
  observed->has_value = true;
  observed->was_there = observed->was_there || is_there(observed, bits);
  deliver_seen_locked(engine, topic, seen, origin);
  return true;
}

static enum fm_found read_made(
  const struct fm_derived_topic * made, const struct fm_reading * reading, struct fm_seen * seen)
{
  return made->type == FM_SEEN_INT32 ? fm_read_state(reading->message, reading->size, seen) :
         fm_read_parameter(reading->message, reading->size, made->node, made->parameter, seen);
}

bool fm_engine_take_derived_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_reading * reading,
  const struct fm_origin * origin)
{
  bool is_read = true;
  for (uint32_t k = 0; k < engine->n_derived; ++k) {
    struct fm_seen seen;
    const struct fm_derived_topic * const made = &engine->derived[k];
    if (made->source != topic) {
      continue;
    }
    const enum fm_found found = read_made(made, reading, &seen);
    is_read = is_read && found != FM_FOUND_UNREADABLE;
    if (found == FM_FOUND) {
      engine->topics[made->topic].observed.events += 1u;
      (void)observe_locked(engine, made->topic, &seen, origin);
    }
  }
  if (!is_read) {
    fm_evaluator_undecodable(engine->options.evaluator, topic);
  }
  return is_read;
}

// ---- what was asked for ------------------------------------------------------------------------

bool fm_engine_observe(
  struct fm_engine * engine, uint32_t topic, const struct fm_seen * seen, uint64_t events,
  int64_t received)
{
  const struct fm_origin origin = {received, received, 0, NULL, false, NULL, 0};
  if (topic >= engine->options.n_topics) {
    return false;
  }
  fm_engine_begin_order(engine);
  fm_engine_lock(engine);
  const bool is_current =
    events == FM_ANY_EVENTS || events == engine->topics[topic].observed.events;
  if (is_current) {
    (void)observe_locked(engine, topic, seen, &origin);
  }
  fm_engine_unlock(engine);
  fm_engine_end_order(engine);
  return is_current;
}

struct fm_observed fm_engine_observed(struct fm_engine * engine, uint32_t topic)
{
  struct fm_observed observed = {0, 0, 0, 0, 0, false, false};
  fm_engine_lock(engine);
  if (topic < engine->options.n_topics) {
    observed = engine->topics[topic].observed;
  }
  fm_engine_unlock(engine);
  return observed;
}

void fm_engine_note_node(struct fm_engine * engine, uint32_t topic)
{
  fm_engine_lock(engine);
  if (topic < engine->options.n_topics) {
    engine->topics[topic].observed.was_there = true;
  }
  fm_engine_unlock(engine);
}

void fm_engine_note_fault(struct fm_engine * engine, uint32_t topic, enum fm_fault fault)
{
  fm_engine_lock(engine);
  if (topic < engine->options.n_topics) {
    engine->topics[topic].observed.fault = fault;
  }
  fm_engine_unlock(engine);
}
