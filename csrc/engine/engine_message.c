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

/// engine_message.c: a message is read, stored in the evaluator's inputs, and kept as evidence.

#define _POSIX_C_SOURCE 200809L

#include "engine_parts.h"

#include <stdlib.h>
#include <string.h>

#include "instance.h"
#include "thread.h"

void fm_engine_keep_evidence_locked(
  struct fm_engine * engine, uint32_t number, const uint8_t * message, size_t size)
{
  struct fm_engine_topic * topic = &engine->topics[number];
  if (topic->evidence == NULL && size > 0) {
    topic->evidence = malloc(size);
    if (topic->evidence != NULL) {
      memcpy(topic->evidence, message, size);
      topic->evidence_size = size;
    }
  }
}

static bool all_are_read(const struct fm_field * fields, uint32_t n)
{
  for (uint32_t k = 0; k < n; ++k) {
    if (fields[k].outcome != FM_FIELD_READ) {
      return false;
    }
  }
  return true;
}

bool fm_engine_has_links(const struct fm_engine * engine, uint32_t topic)
{
  return engine->tree != NULL && (topic == engine->tf || topic == engine->tf_static);
}

bool fm_engine_is_source(const struct fm_engine * engine, uint32_t topic)
{
  return engine->topics[topic].is_source || fm_engine_has_links(engine, topic);
}

bool fm_engine_needs_bytes(
  const struct fm_engine * engine, uint32_t topic, const struct fm_reading * reading)
{
  return !reading->is_decoded || engine->topics[topic].keeping == FM_KEEP_ALL ||
         (!reading->is_unrelated && (
           engine->blackbox != NULL || fm_engine_is_source(engine, topic) ||
           fm_engine_reader(engine, topic)->parts != NULL ||
           !all_are_read(reading->fields, engine->options.topics[topic].n_inputs)));
}

void fm_engine_keep_message_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_reading * reading, int64_t stamp,
  const struct fm_origin * origin)
{
  if (reading->is_decoded && !reading->is_unrelated &&
    !all_are_read(reading->fields, engine->options.topics[topic].n_inputs))
  {
    fm_engine_keep_evidence_locked(engine, topic, reading->message, reading->size);
  }
  if (engine->blackbox != NULL && engine->topics[topic].keeping != FM_KEEP_NONE) {
    const struct fm_kept kept =
    {reading->size, fm_steady_time(), stamp, origin->sent, topic, origin->key_size};
    fm_blackbox_keep_keyed(engine->blackbox, &kept, reading->message, origin->key);
  }
}

size_t fm_engine_evidence(
  struct fm_engine * engine, uint32_t topic, uint8_t * out, size_t room)
{
  size_t size = 0;
  if (topic < engine->options.n_topics) {
    fm_engine_lock(engine);
    struct fm_engine_topic * cell = &engine->topics[topic];
    size = cell->evidence == NULL ? 0 : cell->evidence_size;
    if (size > 0 && size <= room) {
      memcpy(out, cell->evidence, size);
      free(cell->evidence);
      cell->evidence = NULL;
    }
    fm_engine_unlock(engine);
  }
  return size;
}

const struct fm_reader * fm_engine_reader(const struct fm_engine * engine, uint32_t topic)
{
  return &engine->options.readers->topics[topic];
}

static bool read_message(
  const struct fm_engine * engine, const struct fm_reader * reader, const uint8_t * message,
  size_t size, struct fm_field * fields, struct fm_reading * reading)
{
  bool is_selected = true;
  if (reader->selects != NULL && !reader->selects(message, size, &is_selected)) {
    return false;
  }
  reading->is_unrelated = !is_selected;
  return !is_selected || (
    reader->read(message, size, fields) &&
    (reader->parts == NULL || reader->parts(message, size, NULL, 0, NULL, NULL)) &&
    (!engine->options.uses_header_stamps || reader->stamp(message, size, &reading->stamp)));
}

bool fm_engine_read(
  const struct fm_engine * engine, uint32_t topic, const uint8_t * message, size_t size,
  struct fm_field * fields, struct fm_reading * reading)
{
  const struct fm_reader * reader = fm_engine_reader(engine, topic);
  const struct fm_reading unread = {fields, message, size, 0, false, false};
  *reading = unread;
  reading->is_decoded = read_message(engine, reader, message, size, fields, reading);
  return reading->is_decoded;
}

const struct fm_field * fm_engine_prepare_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_field * fields, int64_t received)
{
  return !engine->topics[topic].has_sources ? fields :
         fm_engine_prepare_inputs_locked(
    engine, &engine->options.topics[topic], engine->options.sources, fields, received);
}

const struct fm_field * fm_engine_prepare_inputs_locked(
  struct fm_engine * engine, const struct fm_topic * fed, const uint8_t * sources,
  const struct fm_field * fields, int64_t received)
{
  memcpy(engine->prepared, fields, fed->n_inputs * sizeof(*fields));
  for (uint32_t k = 0; k < fed->n_inputs; ++k) {
    struct fm_field * field = &engine->prepared[k];
    const uint8_t source = sources[fed->inputs[k]];
    if (source == FM_RECEPTION) {
      field->value.i = 1;
      field->outcome = FM_FIELD_READ;
    } else if (source == FM_AGE && engine->source == FM_CLOCK && received == 0) {
      field->outcome = FM_FIELD_EMPTY;  // there is no time yet
    } else if (source == FM_AGE && field->outcome == FM_FIELD_READ) {
      field->value.f = (double)fm_between(field->value.i, received) / 1e9;
    }
  }
  return engine->prepared;
}

// Store the fields that were read, and count the others.
void fm_engine_store_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_field * fields, int64_t now)
{
  const struct fm_topic * fed = &engine->options.topics[topic];
  for (uint32_t k = 0; k < fed->n_inputs; ++k) {
    if (fields[k].outcome == FM_FIELD_READ) {
      fm_evaluator_store(engine->options.evaluator, fed->inputs[k], fields[k].value, now);
    } else {
      fm_evaluator_unusable(engine->options.evaluator, fed->inputs[k]);
    }
  }
}
