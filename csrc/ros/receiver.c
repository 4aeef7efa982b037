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

/// receiver.c: see receiver.h for the contract.
///
/// Lock order. The middleware calls `on_message` while it holds its own locks for the
/// subscription, and `on_message` then locks the engine's mutex. To take a message needs the same
/// locks of the middleware. A thread outside a callback must therefore not take while it holds the
/// engine's mutex: it could deadlock with a callback. `fm_receiver_drain` sets `is_draining` under
/// the mutex, which keeps callbacks from taking, and then takes without the mutex.

#define _POSIX_C_SOURCE 200809L

#include "receiver.h"

#include <stdlib.h>
#include <string.h>

#include "engine_locked.h"
#include "receiver_reading.h"
#include "serialized.h"

#define MOST_AT_ONCE 1000u  // messages; other topics wait for the mutex meanwhile
#define QUIET_POLLS 16u       // one in 16 polls without a callback drains

struct fm_receiver
{
  struct fm_engine * engine;
  const struct fm_middleware * middleware;
  void * subscription;
  // Used only by the thread that takes: a callback under the mutex, or the drain.
  struct fm_serialized message;  // as taken; read in place: a copy, if it is needed
  struct fm_field * fields;
  struct fm_reading reading;
  struct fm_padded_info info;
  uint32_t topic;
  enum fm_taking taking;
  // Guarded by the engine's mutex.
  bool is_retired;
  bool is_stopped;
  bool is_draining;
  bool is_awaited;    // a callback came during the drain
  bool is_behind;     // the last callback or drain stopped at its limit
  bool probes;        // the next callback takes more messages than its count
  bool was_notified;  // a callback came since the last poll
  uint32_t quiet;     // polls since the last callback
};

// ---- reading -----------------------------------------------------------------------------------

static const struct fm_reader * reader_of(const struct fm_receiver * receiver)
{
  return fm_engine_reader(receiver->engine, receiver->topic);
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

static void copy_message(struct fm_serialized * copy, const uint8_t * message, size_t size)
{
  copy->length = 0;
  if (size > copy->capacity) {
    uint8_t * room = realloc(copy->buffer, size);
    if (room == NULL) {
      return;
    }
    copy->buffer = room;
    copy->capacity = size;
  }
  if (size > 0) {
    memcpy(copy->buffer, message, size);
  }
  copy->length = size;
}

static void read_fields(struct fm_receiver * receiver, const uint8_t * message, size_t size)
{
  receiver->reading.is_decoded = fm_engine_read(
    receiver->engine, receiver->topic, message, size, receiver->fields,
    &receiver->reading.stamp);
}

const struct fm_in_place * fm_receiver_in_place(const struct fm_receiver * receiver)
{
  return &receiver->middleware->in_place;
}

void fm_receiver_read(struct fm_receiver * receiver, const uint8_t * message, size_t size)
{
  read_fields(receiver, message, size);
  if (fm_engine_keeps_messages(receiver->engine) || !receiver->reading.is_decoded ||
    !all_are_read(receiver->fields, reader_of(receiver)->n_inputs))
  {
    copy_message(&receiver->message, message, size);
  }
}

// ---- taking ------------------------------------------------------------------------------------

enum result
{
  EMPTY,    // no message is waiting, or the middleware failed
  TAKEN,
  DROPPED   // the middleware dropped a message without a CDR header
};

static enum result take(struct fm_receiver * receiver)
{
  struct fm_message_info * info = &receiver->info.info;
  const struct fm_middleware * middleware = receiver->middleware;
  bool taken = false;
  receiver->reading.is_decoded = false;
  const int result = receiver->taking == FM_LISTEN_IN_PLACE ?
    middleware->take_message(receiver->subscription, receiver, &taken, info, NULL) :
    middleware->take(receiver->subscription, &receiver->message, &taken, info, NULL);
  const bool has_error = middleware->has_error();
  if (has_error) {
    middleware->forget_error();
  }
  if (result != 0 || !taken) {
    return result == 0 && has_error ? DROPPED : EMPTY;
  }
  if (receiver->taking == FM_LISTEN) {
    read_fields(receiver, receiver->message.buffer, receiver->message.length);
  }
  receiver->reading.message = receiver->message.buffer;
  receiver->reading.size = receiver->message.length;
  return TAKEN;
}

static struct fm_origin origin_of(const struct fm_receiver * receiver)
{
  const struct fm_message_info * info = &receiver->info.info;
  const struct fm_origin origin = {
    info->received_timestamp, info->source_timestamp, info->publication_sequence_number,
    info->gid, receiver->is_retired};
  return origin;
}

static void deliver_locked(struct fm_receiver * receiver)
{
  const struct fm_origin origin = origin_of(receiver);
  (void)fm_engine_deliver_locked(receiver->engine, receiver->topic, &receiver->reading, &origin);
}

// Take the `count` messages of a notification, or up to the limit when catching up or probing.
// Asking for one more each time would cost a tenth of a message; a later one has its own callback.
static void take_locked(struct fm_receiver * receiver, size_t count)
{
  const bool takes_all = receiver->is_behind || receiver->probes;
  const size_t most = takes_all || count > MOST_AT_ONCE ? MOST_AT_ONCE : count;
  enum result result = TAKEN;
  for (size_t k = 0; k < most && result != EMPTY; ++k) {
    result = take(receiver);
    if (result == TAKEN) {
      deliver_locked(receiver);
    }
  }
  receiver->is_behind = result != EMPTY && (takes_all || count > most);
  receiver->probes = false;
}

// Called in a thread of the middleware.
static void on_message(const void * user_data, size_t count)
{
  struct fm_receiver * receiver = (struct fm_receiver *)user_data;
  if (receiver->middleware->has_error()) {
    receiver->middleware->forget_error();  // left by other code: this may be a publisher's thread
  }
  fm_engine_lock(receiver->engine);
  receiver->was_notified = true;
  if (receiver->is_draining) {
    receiver->is_awaited = true;
  } else if (!receiver->is_stopped) {
    take_locked(receiver, count);
  }
  fm_engine_unlock(receiver->engine);
}

// End the drain, unless a callback came meanwhile and left its messages to it. With `is_enough` it
// always ends, and the next callback or poll takes the rest. Returns whether it ended.
static bool end_draining(struct fm_receiver * receiver, bool is_enough)
{
  fm_engine_lock(receiver->engine);
  const bool is_over = is_enough || !receiver->is_awaited;
  receiver->is_behind = is_enough;
  receiver->is_awaited = false;
  receiver->is_draining = !is_over;
  fm_engine_unlock(receiver->engine);
  return is_over;
}

bool fm_receiver_take(struct fm_receiver * receiver, struct fm_record * out)
{
  enum result result = DROPPED;
  receiver->middleware->forget_error();  // left by earlier calls in this thread
  while (result == DROPPED) {
    result = take(receiver);
  }
  out->message = receiver->message.buffer;
  out->size = receiver->message.length;
  fm_engine_lock(receiver->engine);  // for is_retired
  out->origin = origin_of(receiver);
  fm_engine_unlock(receiver->engine);
  return result == TAKEN;
}

static void drain(struct fm_receiver * receiver)
{
  uint32_t left = MOST_AT_ONCE;
  receiver->middleware->forget_error();  // left by earlier calls in this thread
  do {
    enum result result = EMPTY;
    while (left > 0 && (result = take(receiver)) != EMPTY) {
      left -= 1;
      if (result == TAKEN) {
        fm_engine_lock(receiver->engine);
        deliver_locked(receiver);
        fm_engine_unlock(receiver->engine);
      }
    }
  } while (!end_draining(receiver, left == 0));
}

// ---- life --------------------------------------------------------------------------------------

static void free_receiver(struct fm_receiver * receiver)
{
  free(receiver->message.buffer);
  free(receiver->fields);
  free(receiver);
}

bool fm_receiver_start(
  struct fm_receiver ** started, struct fm_engine * engine,
  const struct fm_middleware * middleware, void * subscription, uint32_t topic, uint32_t taking)
{
  struct fm_receiver * receiver = calloc(1, sizeof(*receiver));
  if (receiver == NULL) {
    return false;
  }
  receiver->engine = engine;
  receiver->middleware = middleware;
  receiver->subscription = subscription;
  receiver->topic = topic;
  receiver->taking = (enum fm_taking)taking;
  receiver->message.allocator = fm_malloc_allocator();
  receiver->fields = calloc(reader_of(receiver)->n_inputs + 1u, sizeof(*receiver->fields));
  receiver->reading.fields = receiver->fields;
  const bool listens = taking != FM_WHEN_ASKED;
  receiver->is_draining = true;  // the middleware may call back at once, from within `listen`
  if (receiver->fields == NULL ||
    (listens && middleware->listen(subscription, on_message, receiver) != 0))
  {
    middleware->forget_error();
    free_receiver(receiver);
    return false;
  }
  if (listens) {
    drain(receiver);
  }
  *started = receiver;
  return true;
}

void fm_receiver_drain(struct fm_receiver * receiver)
{
  fm_engine_lock(receiver->engine);
  receiver->is_draining = true;
  fm_engine_unlock(receiver->engine);
  drain(receiver);
}

// While a topic is drained, its callbacks leave their messages to the drain, and later messages of
// other topics may be delivered first. A quiet topic is therefore drained on few polls only.
static bool begin_poll(struct fm_receiver * receiver)
{
  fm_engine_lock(receiver->engine);
  const bool is_quiet = !receiver->was_notified;
  const bool is_due = receiver->is_behind || (is_quiet && receiver->quiet % QUIET_POLLS == 0);
  receiver->quiet = is_quiet ? receiver->quiet + 1u : 0;
  receiver->probes = receiver->probes || !is_quiet;
  receiver->was_notified = false;
  receiver->is_draining = is_due;
  fm_engine_unlock(receiver->engine);
  return is_due;
}

void fm_receiver_poll(struct fm_receiver * receiver)
{
  if (begin_poll(receiver)) {
    drain(receiver);
  }
}

void fm_receiver_retire(struct fm_receiver * receiver)
{
  fm_engine_lock(receiver->engine);
  receiver->is_retired = true;
  fm_engine_unlock(receiver->engine);
}

bool fm_receiver_stop(struct fm_receiver ** started)
{
  struct fm_receiver * receiver = *started;
  if (receiver == NULL) {
    return true;
  }
  if (receiver->taking != FM_WHEN_ASKED &&
    receiver->middleware->listen(receiver->subscription, NULL, NULL) != 0)
  {
    receiver->middleware->forget_error();
    fm_engine_lock(receiver->engine);
    receiver->is_stopped = true;
    fm_engine_unlock(receiver->engine);
    return false;
  }
  *started = NULL;
  free_receiver(receiver);
  return true;
}
