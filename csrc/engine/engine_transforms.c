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

/// engine_transforms.c: a message comes: of a topic, or one with links between frames, of which
/// messages of transforms are made.

#define _POSIX_C_SOURCE 200809L

#include "engine_parts.h"

#include <stdlib.h>
#include <string.h>

#include "instance.h"
#include "seen.h"
#include "thread.h"

#define SECOND_NS INT64_C(1000000000)

// ---- making ------------------------------------------------------------------------------------

// The bytes of a geometry_msgs/msg/TransformStamped, of which stamp and pose will be filled in: an
// encapsulation header, the stamp, two strings, and seven numbers aligned to 8.
static bool make_message(struct fm_engine_transform * made)
{
  const char * const names[] = {made->options.from, made->options.to};
  size_t at = 8u;  // behind the encapsulation header
  for (int k = 0; k < 2; ++k) {
    at = ((at + 3u) & ~(size_t)3u) + sizeof(uint32_t) + strlen(names[k]) + 1u;
  }
  made->pose_at = 4u + ((at + 7u) & ~(size_t)7u);
  made->size = made->pose_at + sizeof(struct fm_pose);
  made->message = calloc(1u, made->size);
  made->next = calloc(1u, made->size);
  if (made->message == NULL || made->next == NULL) {
    return false;
  }
  const uint8_t * end = fm_write_header(made->next) + 8;
  for (int k = 0; k < 2; ++k) {
    at = ((size_t)(end - made->next) + 3u) & ~(size_t)3u;
    end = fm_write_string(made->next + at, names[k], (uint32_t)strlen(names[k]));
  }
  return true;
}

static bool make_fields(const struct fm_engine * engine, struct fm_engine_transform * made)
{
  const uint32_t n = engine->options.topics[made->options.topic].n_inputs;
  made->fields = calloc(n + (size_t)1, sizeof(*made->fields));
  return made->fields != NULL;
}

bool fm_engine_follow_transforms(
  struct fm_engine * engine, const struct fm_transform_topic * transforms, uint32_t n, uint32_t tf,
  uint32_t tf_static)
{
  engine->tf = tf;
  engine->tf_static = tf_static;
  engine->transforms = calloc(n + (size_t)1, sizeof(*engine->transforms));
  engine->tree = engine->transforms == NULL ? NULL : fm_tree_create();
  bool is_made = engine->tree != NULL && tf < engine->options.n_topics &&
    tf_static < engine->options.n_topics;
  for (uint32_t k = 0; is_made && k < n; ++k) {
    engine->transforms[k].options = transforms[k];
    engine->n_transforms = k + 1u;
    is_made = transforms[k].topic < engine->options.n_topics &&
      make_fields(engine, &engine->transforms[k]) && make_message(&engine->transforms[k]);
  }
  return is_made;
}

void fm_engine_free_transforms(struct fm_engine * engine)
{
  for (uint32_t k = 0; k < engine->n_transforms; ++k) {
    free(engine->transforms[k].fields);
    free(engine->transforms[k].message);
    free(engine->transforms[k].next);
  }
  free(engine->transforms);
  fm_tree_destroy(engine->tree);
}

// ---- messages ----------------------------------------------------------------------------------

// Fill in the transform of the tree; false if there is none, or it is the one that came last.
static bool is_new(struct fm_tree * tree, struct fm_engine_transform * made)
{
  struct fm_looked_up found;
  if (!fm_tree_look_up(tree, made->options.from, made->options.to, &found)) {
    return false;
  }
  const int32_t sec = (int32_t)(found.stamp / SECOND_NS - (found.stamp % SECOND_NS < 0));
  const uint32_t nanosec = (uint32_t)(found.stamp - (int64_t)sec * SECOND_NS);
  memcpy(made->next + 4, &sec, sizeof(sec));
  memcpy(made->next + 8, &nanosec, sizeof(nanosec));
  memcpy(made->next + made->pose_at, &found.pose, sizeof(found.pose));
  return memcmp(made->message, made->next, made->size) != 0;
}

// The messages that a topic of a transform gets have no publisher: none of them is lost.
static void deliver_transform_locked(
  struct fm_engine * engine, struct fm_engine_transform * made, const struct fm_origin * origin)
{
  const struct fm_origin unnumbered = {origin->received, origin->sent, 0, NULL, false, NULL, 0};
  struct fm_reading reading;
  uint32_t receipt;
  memcpy(made->message, made->next, made->size);
  (void)fm_engine_read(
    engine, made->options.topic, made->message, made->size, made->fields, &reading);
  if (fm_engine_accept_locked(engine, made->options.topic, &reading, &unnumbered, &receipt)) {
    fm_engine_deliver_locked(engine, made->options.topic, &reading, &unnumbered);
  }
}

// Time that has gone back outdates the samples.
static void note_restart_locked(struct fm_engine * engine)
{
  const uint64_t restarts = fm_evaluator_time_counts(engine->options.evaluator).restarts;
  if (restarts != engine->tree_restarts) {
    engine->tree_restarts = restarts;
    fm_tree_forget(engine->tree);
  }
}

static bool take_links_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_reading * reading,
  const struct fm_origin * origin)
{
  note_restart_locked(engine);
  if (!fm_tree_read(
      engine->tree, reading->message, reading->size, topic == engine->tf_static))
  {
    fm_evaluator_undecodable(engine->options.evaluator, topic);
    return false;
  }
  for (uint32_t k = 0; k < engine->n_transforms; ++k) {
    if (is_new(engine->tree, &engine->transforms[k])) {
      deliver_transform_locked(engine, &engine->transforms[k], origin);
    }
  }
  return true;
}

uint32_t fm_engine_receive_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_reading * reading,
  const struct fm_origin * origin)
{
  uint32_t receipt;
  if (!fm_engine_accept_locked(engine, topic, reading, origin, &receipt)) {
    return receipt;
  }
  if (!fm_engine_is_source(engine, topic)) {
    fm_engine_deliver_locked(engine, topic, reading, origin);
    return FM_RECEIVED;
  }
  if (fm_engine_has_links(engine, topic) ? !take_links_locked(engine, topic, reading, origin) :
    !fm_engine_take_derived_locked(engine, topic, reading, origin))
  {
    return FM_UNDECODABLE;
  }
  if (engine->options.topics[topic].n_inputs > 0) {
    fm_engine_deliver_locked(engine, topic, reading, origin);
  } else {
    engine->topics[topic].links += 1;
  }
  return FM_RECEIVED;
}

uint32_t fm_engine_message_locked(
  struct fm_engine * engine, uint32_t topic, const uint8_t * message, size_t size,
  const struct fm_origin * origin)
{
  struct fm_reading reading;
  (void)fm_engine_read(engine, topic, message, size, engine->fields, &reading);
  return fm_engine_receive_locked(engine, topic, &reading, origin);
}

uint32_t fm_engine_message(
  struct fm_engine * engine, uint32_t topic, const uint8_t * message, size_t size,
  const struct fm_origin * origin)
{
  if (topic >= engine->options.n_topics) {
    return FM_RECEIVED;
  }
  fm_engine_lock(engine);
  const uint32_t receipt = fm_engine_message_locked(engine, topic, message, size, origin);
  fm_engine_unlock(engine);
  return receipt;
}

// ---- answers -----------------------------------------------------------------------------------

static bool is_missing_locked(
  struct fm_engine * engine, const struct fm_transform_topic * transform, char * from, char * to)
{
  struct fm_looked_up found;
  note_restart_locked(engine);
  if (fm_tree_look_up(engine->tree, transform->from, transform->to, &found)) {
    return false;
  }
  strcpy(from, fm_tree_missing(engine->tree, false));
  strcpy(to, fm_tree_missing(engine->tree, true));
  return true;
}

bool fm_engine_missing_link(struct fm_engine * engine, uint32_t topic, char * from, char * to)
{
  bool is_missing = false;
  fm_engine_lock(engine);
  for (uint32_t k = 0; k < engine->n_transforms; ++k) {
    if (engine->transforms[k].options.topic == topic) {
      is_missing = is_missing_locked(engine, &engine->transforms[k].options, from, to);
    }
  }
  fm_engine_unlock(engine);
  return is_missing;
}

struct fm_tree_counts fm_engine_left_out(struct fm_engine * engine)
{
  struct fm_tree_counts counts = {0, 0, 0};
  fm_engine_lock(engine);
  if (engine->tree != NULL) {
    counts = fm_tree_left_out(engine->tree);
  }
  fm_engine_unlock(engine);
  return counts;
}
