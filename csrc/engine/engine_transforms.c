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
  const uint16_t one = 1u;
  memcpy(made->next + 1, &one, 1u);  // the byte order of this machine
  at = 8u;
  for (int k = 0; k < 2; ++k) {
    const uint32_t length = (uint32_t)strlen(names[k]) + 1u;
    at = (at + 3u) & ~(size_t)3u;
    memcpy(made->next + 4u + at, &length, sizeof(length));
    memcpy(made->next + 4u + at + sizeof(length), names[k], length);
    at += sizeof(length) + length;
  }
  return true;
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
      make_message(&engine->transforms[k]);
  }
  return is_made;
}

void fm_engine_free_transforms(struct fm_engine * engine)
{
  for (uint32_t k = 0; k < engine->n_transforms; ++k) {
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

static uint32_t deliver_links_locked(
  struct fm_engine * engine, uint32_t topic, const uint8_t * message, size_t size,
  const struct fm_origin * origin)
{
  if (!fm_tree_read(engine->tree, message, size, topic == engine->tf_static)) {
    fm_evaluator_undecodable(engine->options.evaluator, topic);
    return FM_UNDECODABLE;
  }
  for (uint32_t k = 0; k < engine->n_transforms; ++k) {
    struct fm_engine_transform * const made = &engine->transforms[k];
    if (is_new(engine->tree, made)) {
      struct fm_reading reading = {engine->fields, made->message, made->size, 0, false};
      memcpy(made->message, made->next, made->size);
      reading.is_decoded = fm_engine_read(
        engine, made->options.topic, made->message, made->size, engine->fields, &reading.stamp);
      (void)fm_engine_deliver_locked(engine, made->options.topic, &reading, origin);
    }
  }
  return FM_RECEIVED;
}

uint32_t fm_engine_message_locked(
  struct fm_engine * engine, uint32_t topic, const uint8_t * message, size_t size,
  const struct fm_origin * origin)
{
  if (engine->tree != NULL && (topic == engine->tf || topic == engine->tf_static)) {
    const uint32_t receipt = deliver_links_locked(engine, topic, message, size, origin);
    if (receipt == FM_UNDECODABLE || engine->options.topics[topic].n_inputs == 0) {
      return receipt;
    }
  }
  struct fm_reading reading = {engine->fields, message, size, 0, false};
  reading.is_decoded =
    fm_engine_read(engine, topic, message, size, engine->fields, &reading.stamp);
  return fm_engine_deliver_locked(engine, topic, &reading, origin);
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

bool fm_engine_missing_link(struct fm_engine * engine, uint32_t transform, char * from, char * to)
{
  bool is_missing = false;
  fm_engine_lock(engine);
  if (transform < engine->n_transforms) {
    const struct fm_transform_topic * const options = &engine->transforms[transform].options;
    struct fm_looked_up found;
    is_missing = !fm_tree_look_up(engine->tree, options->from, options->to, &found);
    strcpy(from, is_missing ? fm_tree_missing(engine->tree, false) : "");
    strcpy(to, is_missing ? fm_tree_missing(engine->tree, true) : "");
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
