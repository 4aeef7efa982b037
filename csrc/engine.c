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


/// engine.c: see engine.h for the contract.
///
/// One mutex guards all of it. The functions whose names end in _locked are called with it held.

#define _POSIX_C_SOURCE 200809L

#include "losses.h"
#include "engine_locked.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define FIRST_CAPACITY 64u
#define MOST_QUEUED (1u << 20)
#define MOST_DETAILS 1024u
#define DETAIL_MEMORY (4u << 20)
#define HELD_FOR_DETAIL 100u  // milliseconds
#define REMEMBERED 4096u  // messages of a topic that would be recognised if they came again

struct key
{
  int64_t sent;
  uint64_t sequence;
  uint64_t sender;  // of its gid, 0: not known
};

struct sender
{
  uint64_t id;
  int64_t newest;     // sent
  uint64_t sequence;  // the highest
};

struct topic
{
  struct key * keys;  // of the last messages, a ring; NULL until the first
  uint64_t n_keys;    // so far
  struct sender senders[FM_PUBLISHERS];  // those heard last
  uint32_t n_senders;                    // so far
  struct fm_losses losses;
  uint64_t settled;      // lost when the overlap began
  bool overlaps;
  bool has_history;
  uint8_t * evidence;
  size_t evidence_size;
};

// How many details of a requirement this second has seen.
struct quota
{
  int64_t second;
  uint32_t spent;
  uint64_t refused;
};

// A violation on its way out.
struct queued
{
  struct fm_violation violation;
  uint64_t detail;  // the number of its detail, from 1; 0: none is kept
};

struct fm_engine
{
  pthread_mutex_t mutex;
  pthread_cond_t violation_queued;
  pthread_cond_t detail_queued;
  struct fm_engine_options options;
  struct fm_field * fields;      // of one message
  struct fm_violation * found;   // by one step
  struct topic * topics;
  struct quota * quotas;
  struct queued * queue;         // a ring; capacity is a power of two
  uint32_t queue_begin;
  uint32_t queued;
  uint32_t queue_capacity;
  uint64_t untold;
  uint8_t * details;             // a ring of slots
  size_t slot;                   // bytes of one
  uint32_t detail_slots;
  uint32_t detail_begin;
  uint32_t detailed;
  uint32_t most_details;
  uint64_t details_kept;         // so far
  uint64_t details_out;          // published: what they belong to may follow
  uint64_t details_taken;
  int (* now)(void * clock, int64_t * nanoseconds);
  void * clock;
  bool wants_details;
  bool is_closed;
};

// ---- making ------------------------------------------------------------------------------------

static uint32_t most_inputs(const struct fm_engine_options * options)
{
  uint32_t most = 1;
  for (uint32_t t = 0; t < options->n_topics; ++t) {
    most = options->topics[t].n_inputs > most ? options->topics[t].n_inputs : most;
  }
  return most;
}

static bool readers_fit(const struct fm_engine_options * options)
{
  if (options->n_topics == 0) {
    return true;
  }
  const struct fm_readers * readers = options->readers;
  if (readers == NULL || readers->abi != FM_ABI || readers->n_topics != options->n_topics) {
    return false;
  }
  for (uint32_t t = 0; t < options->n_topics; ++t) {
    if (readers->topics[t].n_inputs != options->topics[t].n_inputs) {
      return false;
    }
  }
  return true;
}

static bool make_condition(pthread_cond_t * condition)
{
  pthread_condattr_t attributes;
  if (pthread_condattr_init(&attributes) != 0) {
    return false;
  }
  const bool is_made = pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC) == 0 &&
    pthread_cond_init(condition, &attributes) == 0;
  pthread_condattr_destroy(&attributes);
  return is_made;
}

static void * room_for(size_t count, size_t size) {return calloc(count == 0 ? 1 : count, size);}

static bool make_memory(struct fm_engine * engine)
{
  const struct fm_engine_options * options = &engine->options;
  const size_t requirements = options->monitor->n_requirements;
  engine->fields = room_for(most_inputs(options), sizeof(struct fm_field));
  engine->found = room_for(requirements, sizeof(struct fm_violation));
  engine->quotas = room_for(requirements, sizeof(struct quota));
  engine->topics = room_for(options->n_topics, sizeof(struct topic));
  engine->queue = room_for(FIRST_CAPACITY, sizeof(struct queued));
  engine->queue_capacity = FIRST_CAPACITY;
  return engine->fields != NULL && engine->found != NULL && engine->quotas != NULL &&
         engine->topics != NULL && engine->queue != NULL;
}

static void free_memory(struct fm_engine * engine)
{
  for (uint32_t t = 0; engine->topics != NULL && t < engine->options.n_topics; ++t) {
    free(engine->topics[t].keys);
    free(engine->topics[t].evidence);
  }
  free(engine->fields);
  free(engine->found);
  free(engine->quotas);
  free(engine->topics);
  free(engine->queue);
  free(engine->details);
  free(engine);
}

struct fm_engine * fm_engine_create(const struct fm_engine_options * options)
{
  struct fm_engine * engine = readers_fit(options) ? calloc(1, sizeof(*engine)) : NULL;
  if (engine == NULL) {
    return NULL;
  }
  engine->options = *options;
  if (!make_memory(engine) || pthread_mutex_init(&engine->mutex, NULL) != 0) {
    free_memory(engine);
    return NULL;
  }
  if (!make_condition(&engine->violation_queued) || !make_condition(&engine->detail_queued)) {
    pthread_mutex_destroy(&engine->mutex);
    free_memory(engine);
    return NULL;
  }
  return engine;
}

void fm_engine_destroy(struct fm_engine * engine)
{
  pthread_cond_destroy(&engine->violation_queued);
  pthread_cond_destroy(&engine->detail_queued);
  pthread_mutex_destroy(&engine->mutex);
  free_memory(engine);
}

void fm_engine_close(struct fm_engine * engine)
{
  pthread_mutex_lock(&engine->mutex);
  engine->is_closed = true;
  engine->details_out = engine->details_kept;
  pthread_cond_broadcast(&engine->violation_queued);
  pthread_cond_broadcast(&engine->detail_queued);
  pthread_mutex_unlock(&engine->mutex);
}

bool fm_engine_is_closed(struct fm_engine * engine)
{
  pthread_mutex_lock(&engine->mutex);
  const bool is_closed = engine->is_closed;
  pthread_mutex_unlock(&engine->mutex);
  return is_closed;
}

// ---- queues ------------------------------------------------------------------------------------

static bool grow_queue_locked(struct fm_engine * engine)
{
  const uint32_t before = engine->queue_capacity;
  if (before >= MOST_QUEUED) {
    return false;
  }
  struct queued * queue = malloc(2u * (size_t)before * sizeof(*queue));
  if (queue == NULL) {
    return false;
  }
  for (uint32_t k = 0; k < engine->queued; ++k) {
    queue[k] = engine->queue[(engine->queue_begin + k) & (before - 1u)];
  }
  free(engine->queue);
  engine->queue = queue;
  engine->queue_begin = 0;
  engine->queue_capacity = 2u * before;
  return true;
}

static void queue_violation_locked(
  struct fm_engine * engine, const struct fm_violation * item, uint64_t detail)
{
  if (engine->queued == engine->queue_capacity && !grow_queue_locked(engine)) {
    engine->untold += 1;
    return;
  }
  const struct queued entry = {*item, detail};
  engine->queue[(engine->queue_begin + engine->queued) & (engine->queue_capacity - 1u)] = entry;
  engine->queued += 1;
}

static int64_t monotonic_seconds(void)
{
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (int64_t)now.tv_sec;
}

static bool may_detail_locked(struct fm_engine * engine, struct quota * quota, int64_t second)
{
  if (second != quota->second) {
    quota->second = second;
    quota->spent = 0;
  }
  return quota->spent < engine->most_details && engine->detailed < engine->detail_slots;
}

// Returns the number of the detail, 0 if it is left out.
static uint64_t queue_detail_locked(struct fm_engine * engine, const struct fm_violation * item)
{
  struct quota * quota = &engine->quotas[item->requirement];
  if (!may_detail_locked(engine, quota, monotonic_seconds())) {
    quota->refused += 1;
    return 0;
  }
  const struct fm_detail detail = {*item, quota->refused};
  const uint32_t place = (engine->detail_begin + engine->detailed) % engine->detail_slots;
  uint8_t * slot = engine->details + place * engine->slot;
  memcpy(slot, &detail, sizeof(detail));
  memcpy(
    slot + sizeof(detail), fm_evaluator_inputs(engine->options.evaluator),
    (size_t)engine->options.monitor->inputs_bytes);
  uint8_t * flags = slot + sizeof(detail) + engine->options.monitor->inputs_bytes;
  for (uint32_t i = 0; i < engine->options.monitor->n_inputs; ++i) {
    const unsigned has_value = fm_evaluator_has_value(engine->options.evaluator, i) ? 1u : 0u;
    const unsigned is_stale = fm_evaluator_is_stale(engine->options.evaluator, i) ? 2u : 0u;
    flags[i] = (uint8_t)(has_value | is_stale);
  }
  quota->spent += 1;
  engine->detailed += 1;
  engine->details_kept += 1;
  return engine->details_kept;
}

static void announce_locked(struct fm_engine * engine, uint32_t n)
{
  for (uint32_t k = 0; k < n; ++k) {
    const uint64_t detail =
      engine->wants_details ? queue_detail_locked(engine, &engine->found[k]) : 0;
    queue_violation_locked(engine, &engine->found[k], detail);
  }
  if (n > 0) {
    pthread_cond_signal(&engine->violation_queued);
    if (engine->wants_details) {
      pthread_cond_signal(&engine->detail_queued);
    }
  }
}

static size_t detail_bytes(const struct fm_engine * engine)
{
  const struct fm_monitor * monitor = engine->options.monitor;
  return sizeof(struct fm_detail) + (size_t)monitor->inputs_bytes + monitor->n_inputs;
}

static bool make_details_locked(struct fm_engine * engine)
{
  engine->slot = (detail_bytes(engine) + 15u) & ~(size_t)15u;
  const size_t slots = DETAIL_MEMORY / engine->slot + 1u;
  engine->detail_slots = slots > MOST_DETAILS ? MOST_DETAILS : (uint32_t)slots;
  engine->details = malloc(engine->detail_slots * engine->slot);
  return engine->details != NULL;
}

// Whoever publishes details does it no longer: hold no violation back for them.
static void release_all_locked(struct fm_engine * engine)
{
  engine->details_out = engine->details_kept;
  pthread_cond_signal(&engine->violation_queued);
}

void fm_engine_want_details(struct fm_engine * engine, bool is_wanted, uint32_t most)
{
  pthread_mutex_lock(&engine->mutex);
  engine->most_details = most;
  engine->wants_details =
    is_wanted && (engine->details != NULL || make_details_locked(engine));
  if (!engine->wants_details) {
    release_all_locked(engine);
  }
  pthread_mutex_unlock(&engine->mutex);
}

static struct timespec in_milliseconds(uint32_t milliseconds)
{
  struct timespec end;
  clock_gettime(CLOCK_MONOTONIC, &end);
  end.tv_sec += (time_t)(milliseconds / 1000u);
  end.tv_nsec += (long)(milliseconds % 1000u) * 1000000L;
  if (end.tv_nsec >= 1000000000L) {
    end.tv_nsec -= 1000000000L;
    end.tv_sec += 1;
  }
  return end;
}

// Violations at the head of the queue whose details are out.
static uint32_t released_locked(const struct fm_engine * engine, uint32_t room)
{
  uint32_t n = 0;
  while (n < room && n < engine->queued &&
    engine->queue[(engine->queue_begin + n) & (engine->queue_capacity - 1u)].detail <=
    engine->details_out)
  {
    n += 1;
  }
  return n;
}

// Wait until a violation may go out, the time is over, or it is closed and all are out.
static uint32_t wait_for_violations_locked(
  struct fm_engine * engine, uint32_t room, uint32_t milliseconds)
{
  const struct timespec end = in_milliseconds(milliseconds);
  struct timespec held = {0, 0};  // since a violation was seen that has to wait
  uint32_t n = released_locked(engine, room);
  while (n == 0 && (engine->queued > 0 || (!engine->is_closed && milliseconds > 0))) {
    if (engine->queued > 0 && held.tv_sec == 0) {
      held = in_milliseconds(HELD_FOR_DETAIL);
    }
    if (engine->queued == 0) {
      if (pthread_cond_timedwait(&engine->violation_queued, &engine->mutex, &end) != 0) {
        return released_locked(engine, room);
      }
    } else if (pthread_cond_timedwait(&engine->violation_queued, &engine->mutex, &held) != 0) {
      release_all_locked(engine);  // a violation is worth more than its detail
    }
    n = released_locked(engine, room);
  }
  return n;
}

uint32_t fm_engine_take(
  struct fm_engine * engine, struct fm_violation * out, uint32_t room, uint32_t milliseconds)
{
  pthread_mutex_lock(&engine->mutex);
  const uint32_t n = wait_for_violations_locked(engine, room, milliseconds);
  for (uint32_t k = 0; k < n; ++k) {
    out[k] = engine->queue[(engine->queue_begin + k) & (engine->queue_capacity - 1u)].violation;
  }
  engine->queue_begin = (engine->queue_begin + n) & (engine->queue_capacity - 1u);
  engine->queued -= n;
  pthread_mutex_unlock(&engine->mutex);
  return n;
}

static void wait_for_details_locked(struct fm_engine * engine, uint32_t milliseconds)
{
  const struct timespec end = in_milliseconds(milliseconds);
  while (engine->detailed == 0 && !engine->is_closed && milliseconds > 0) {
    if (pthread_cond_timedwait(&engine->detail_queued, &engine->mutex, &end) != 0) {
      return;
    }
  }
}

bool fm_engine_take_detail(struct fm_engine * engine, struct fm_detail * out, uint32_t milliseconds)
{
  pthread_mutex_lock(&engine->mutex);
  if (engine->details_out < engine->details_taken) {
    engine->details_out = engine->details_taken;
    pthread_cond_signal(&engine->violation_queued);
  }
  wait_for_details_locked(engine, milliseconds);
  const bool has_one = engine->detailed > 0;
  if (has_one) {
    memcpy(out, engine->details + engine->detail_begin * engine->slot, detail_bytes(engine));
    engine->detail_begin = (engine->detail_begin + 1u) % engine->detail_slots;
    engine->detailed -= 1;
    engine->details_taken = engine->details_kept - engine->detailed;
  }
  pthread_mutex_unlock(&engine->mutex);
  return has_one;
}

uint64_t fm_engine_unpublished(struct fm_engine * engine)
{
  pthread_mutex_lock(&engine->mutex);
  const uint64_t untold = engine->untold;
  pthread_mutex_unlock(&engine->mutex);
  return untold;
}

void fm_engine_count_unpublished(struct fm_engine * engine, uint64_t more)
{
  pthread_mutex_lock(&engine->mutex);
  engine->untold += more;
  pthread_mutex_unlock(&engine->mutex);
}

// ---- messages that come twice ------------------------------------------------------------------

static bool is_known(const struct topic * topic, struct key key)
{
  const uint64_t n = topic->n_keys < REMEMBERED ? topic->n_keys : REMEMBERED;
  for (uint64_t k = 1; k <= n; ++k) {
    const struct key known = topic->keys[(topic->n_keys - k) % REMEMBERED];
    if (known.sent == key.sent && known.sequence == key.sequence && known.sender == key.sender) {
      return true;
    }
  }
  return false;
}

// FNV-1a of a gid; 0 where there is none.
static uint64_t id_of(const uint8_t * gid)
{
  uint64_t id = 0xcbf29ce484222325u;
  for (uint32_t k = 0; gid != NULL && k < FM_GID_BYTES; ++k) {
    id = (id ^ gid[k]) * 0x100000001b3u;
  }
  return gid == NULL ? 0 : id;
}

static struct key key_of(const struct fm_origin * origin)
{
  const struct key key = {origin->sent, origin->sequence, id_of(origin->gid)};
  return key;
}

// The sender of a message, NULL if nothing was heard of it.
static struct sender * find_sender(struct topic * topic, uint64_t id)
{
  const uint32_t n = topic->n_senders < FM_PUBLISHERS ? topic->n_senders : FM_PUBLISHERS;
  for (uint32_t k = 0; k < n; ++k) {
    if (topic->senders[k].id == id) {
      return &topic->senders[k];
    }
  }
  return NULL;
}

// By the number, where there is one: a sender's clock may be set back.
static bool is_older(const struct fm_origin * origin, const struct sender * sender)
{
  const bool has_number = origin->sequence != 0 && origin->sequence != UINT64_MAX;
  return has_number ? origin->sequence < sender->sequence : origin->sent < sender->newest;
}

static bool is_repeated(struct topic * topic, const struct fm_origin * origin)
{
  const struct key key = key_of(origin);
  const struct sender * sender = find_sender(topic, key.sender);
  const bool is_history = topic->has_history && !origin->is_retired && sender != NULL &&
    is_older(origin, sender);
  return is_history || is_known(topic, key);
}

static void remember_key(struct topic * topic, struct key key)
{
  if (topic->keys == NULL) {
    topic->keys = malloc(REMEMBERED * sizeof(*topic->keys));
  }
  if (topic->keys != NULL) {
    topic->keys[topic->n_keys % REMEMBERED] = key;
    topic->n_keys += 1;
  }
}

static void remember_sender(struct topic * topic, struct key key)
{
  struct sender * sender = find_sender(topic, key.sender);
  if (sender == NULL) {
    sender = &topic->senders[topic->n_senders % FM_PUBLISHERS];
    topic->n_senders += 1;
    sender->id = key.sender;
    sender->newest = key.sent;
    sender->sequence = key.sequence;
  }
  sender->sequence = key.sequence > sender->sequence ? key.sequence : sender->sequence;
  sender->newest = key.sent > sender->newest ? key.sent : sender->newest;
}

// Returns how many of its sender's were left out in front of it, and are counted as lost.
static uint64_t remember(struct topic * topic, const struct fm_origin * origin)
{
  const struct key key = key_of(origin);
  const uint64_t before = topic->losses.lost;
  remember_key(topic, key);
  remember_sender(topic, key);
  if (origin->gid != NULL) {
    if (topic->overlaps) {  // what one subscription leaves out the other may still bring
      fm_losses_note_new(&topic->losses, origin->gid, origin->sequence);
    } else {
      fm_losses_note(&topic->losses, origin->gid, origin->sequence);
    }
  }
  return topic->losses.lost > before ? topic->losses.lost - before : 0;
}

uint64_t fm_engine_lost(struct fm_engine * engine, uint32_t topic)
{
  uint64_t missed = 0;
  if (topic < engine->options.n_topics) {
    pthread_mutex_lock(&engine->mutex);
    const struct topic * cell = &engine->topics[topic];
    missed = cell->overlaps ? cell->settled : cell->losses.lost;
    pthread_mutex_unlock(&engine->mutex);
  }
  return missed;
}

void fm_engine_begin_handover(struct fm_engine * engine, uint32_t topic, bool has_history)
{
  if (topic < engine->options.n_topics) {
    pthread_mutex_lock(&engine->mutex);
    struct topic * cell = &engine->topics[topic];
    cell->settled = cell->overlaps ? cell->settled : cell->losses.lost;
    cell->overlaps = true;
    cell->has_history = has_history;
    pthread_mutex_unlock(&engine->mutex);
  }
}

void fm_engine_end_handover(struct fm_engine * engine, uint32_t topic)
{
  if (topic < engine->options.n_topics) {
    pthread_mutex_lock(&engine->mutex);
    engine->topics[topic].overlaps = false;
    pthread_mutex_unlock(&engine->mutex);
  }
}

// ---- messages ----------------------------------------------------------------------------------

static void keep_evidence(struct topic * topic, const uint8_t * message, size_t size)
{
  if (topic->evidence == NULL && size > 0) {
    topic->evidence = malloc(size);
    if (topic->evidence != NULL) {
      memcpy(topic->evidence, message, size);
      topic->evidence_size = size;
    }
  }
}

size_t fm_engine_evidence(struct fm_engine * engine, uint32_t topic, uint8_t * out, size_t room)
{
  size_t size = 0;
  if (topic < engine->options.n_topics) {
    pthread_mutex_lock(&engine->mutex);
    struct topic * cell = &engine->topics[topic];
    size = cell->evidence == NULL ? 0 : cell->evidence_size;
    if (size > 0 && size <= room) {
      memcpy(out, cell->evidence, size);
      free(cell->evidence);
      cell->evidence = NULL;
    }
    pthread_mutex_unlock(&engine->mutex);
  }
  return size;
}

// Store what was read. Returns whether all of it could be used.
static bool store_locked(struct fm_engine * engine, uint32_t topic, const struct fm_field * fields)
{
  const struct fm_topic * fed = &engine->options.topics[topic];
  bool is_usable = true;
  for (uint32_t k = 0; k < fed->n_inputs; ++k) {
    if (fields[k].outcome == FM_FIELD_READ) {
      fm_evaluator_store(engine->options.evaluator, fed->inputs[k], fields[k].value);
    } else {
      fm_evaluator_unusable(engine->options.evaluator, fed->inputs[k]);
      is_usable = false;
    }
  }
  return is_usable;
}

static int64_t stamp_of(const struct fm_engine * engine, const struct fm_origin * origin)
{
  int64_t stamp = origin->received;
  return engine->now != NULL && engine->now(engine->clock, &stamp) != 0 ? origin->received : stamp;
}

void fm_engine_lock(struct fm_engine * engine) {pthread_mutex_lock(&engine->mutex);}
void fm_engine_unlock(struct fm_engine * engine) {pthread_mutex_unlock(&engine->mutex);}

const struct fm_reader * fm_engine_reader(const struct fm_engine * engine, uint32_t topic)
{
  return &engine->options.readers->topics[topic];
}

// The middleware threw away messages in front of this one, and told of some: what was left out were
// these. While two subscriptions bring messages the other one may still bring them.
static void count_garbage_locked(
  struct fm_engine * engine, uint32_t topic, uint64_t gap, uint64_t thrown)
{
  struct topic * cell = &engine->topics[topic];
  const uint64_t n = cell->overlaps ? 0 : gap < thrown ? gap : thrown;
  cell->losses.lost -= n;
  for (uint64_t k = 0; k < n; ++k) {
    fm_evaluator_undecodable(engine->options.evaluator, topic);
  }
}

uint32_t fm_engine_deliver_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_reading * reading,
  const struct fm_origin * origin)
{
  struct topic * cell = &engine->topics[topic];
  struct fm_evaluator * evaluator = engine->options.evaluator;
  if (engine->is_closed) {
    return FM_RECEIVED;
  }
  if (cell->overlaps && is_repeated(cell, origin)) {
    return FM_REPEATED;
  }
  const uint64_t gap = remember(cell, origin);
  count_garbage_locked(engine, topic, gap, reading->thrown);
  if (!reading->is_decoded) {
    fm_evaluator_undecodable(evaluator, topic);
    return FM_UNDECODABLE;
  }
  if (!store_locked(engine, topic, reading->fields)) {
    keep_evidence(cell, reading->message, reading->size);
  }
  announce_locked(
    engine, fm_evaluator_message(evaluator, topic, stamp_of(engine, origin), engine->found));
  return FM_RECEIVED;
}

void fm_engine_undecodable_locked(struct fm_engine * engine, uint32_t topic)
{
  if (!engine->is_closed) {
    fm_losses_unnumbered(&engine->topics[topic].losses);
    fm_evaluator_undecodable(engine->options.evaluator, topic);
  }
}

uint32_t fm_engine_message(
  struct fm_engine * engine, uint32_t topic, const uint8_t * message, size_t size,
  const struct fm_origin * origin)
{
  if (topic >= engine->options.n_topics) {
    return FM_RECEIVED;
  }
  pthread_mutex_lock(&engine->mutex);
  struct fm_reading reading = {engine->fields, message, size, false, 0};
  reading.is_decoded = fm_engine_reader(engine, topic)->read(message, size, engine->fields);
  const uint32_t receipt = fm_engine_deliver_locked(engine, topic, &reading, origin);
  pthread_mutex_unlock(&engine->mutex);
  return receipt;
}

void fm_engine_tick(struct fm_engine * engine, int64_t stamp)
{
  pthread_mutex_lock(&engine->mutex);
  if (!engine->is_closed) {
    announce_locked(engine, fm_evaluator_tick(engine->options.evaluator, stamp, engine->found));
  }
  pthread_mutex_unlock(&engine->mutex);
}

void fm_engine_stale(
  struct fm_engine * engine, uint32_t input, uint64_t received, int64_t stamp)
{
  pthread_mutex_lock(&engine->mutex);
  if (!engine->is_closed) {
    announce_locked(
      engine, fm_evaluator_stale(
        engine->options.evaluator, input, received, stamp, engine->found));
  }
  pthread_mutex_unlock(&engine->mutex);
}

bool fm_engine_is_stale(struct fm_engine * engine, uint32_t input)
{
  pthread_mutex_lock(&engine->mutex);
  const bool is_stale = fm_evaluator_is_stale(engine->options.evaluator, input);
  pthread_mutex_unlock(&engine->mutex);
  return is_stale;
}

void fm_engine_reset(struct fm_engine * engine)
{
  pthread_mutex_lock(&engine->mutex);
  fm_evaluator_reset(engine->options.evaluator);
  pthread_mutex_unlock(&engine->mutex);
}

void fm_engine_use_clock(
  struct fm_engine * engine, int (* now)(void * clock, int64_t * nanoseconds), void * clock)
{
  pthread_mutex_lock(&engine->mutex);
  engine->now = now;
  engine->clock = clock;
  pthread_mutex_unlock(&engine->mutex);
}

// ---- answers -----------------------------------------------------------------------------------

struct fm_requirement_counts fm_engine_requirement_counts(
  struct fm_engine * engine, uint32_t requirement)
{
  pthread_mutex_lock(&engine->mutex);
  const struct fm_requirement_counts counts =
    fm_evaluator_requirement_counts(engine->options.evaluator, requirement);
  pthread_mutex_unlock(&engine->mutex);
  return counts;
}

struct fm_input_counts fm_engine_input_counts(struct fm_engine * engine, uint32_t input)
{
  pthread_mutex_lock(&engine->mutex);
  const struct fm_input_counts counts =
    fm_evaluator_input_counts(engine->options.evaluator, input);
  pthread_mutex_unlock(&engine->mutex);
  return counts;
}

struct fm_topic_counts fm_engine_topic_counts(struct fm_engine * engine, uint32_t topic)
{
  pthread_mutex_lock(&engine->mutex);
  const struct fm_topic_counts counts =
    fm_evaluator_topic_counts(engine->options.evaluator, topic);
  pthread_mutex_unlock(&engine->mutex);
  return counts;
}

static size_t size_of(uint8_t type)
{
  static const uint8_t sizes[] = {1, 1, 2, 4, 8, 1, 2, 4, 8, 4, 8};  // by enum fm_type
  return type < sizeof(sizes) ? sizes[type] : 0;
}

bool fm_engine_value(struct fm_engine * engine, uint32_t input, void * out)
{
  if (input >= engine->options.monitor->n_inputs) {
    return false;
  }
  const struct fm_input * item = &engine->options.monitor->inputs[input];
  pthread_mutex_lock(&engine->mutex);
  const bool has_value = fm_evaluator_has_value(engine->options.evaluator, input);
  const uint8_t * values = fm_evaluator_inputs(engine->options.evaluator);
  memcpy(out, values + item->offset, size_of(item->type));
  pthread_mutex_unlock(&engine->mutex);
  return has_value;
}
