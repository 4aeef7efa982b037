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
/// Two threads take from a subscription: one of the middleware, within `on_message`, with the
/// engine's mutex held (unless it only wakes); or one that catches up, without it
/// (csrc/engine/engine_backlog.c), while callbacks leave their messages. The middleware calls
/// `on_message` while it holds its own locks for the subscription, and to take a message needs the
/// same locks: a thread outside a callback must not take while it holds the engine's mutex.

#define _POSIX_C_SOURCE 200809L

#include "receiver.h"

#include <stdlib.h>
#include <string.h>

#include "engine_locked.h"
#include "receiver_reading.h"
#include "serialized.h"

#define MOST_AT_ONCE 1000u  // messages; other topics wait for the mutex meanwhile

struct fm_receiver
{
  struct fm_engine * engine;
  const struct fm_middleware * middleware;
  void * subscription;
  struct fm_queue queue;
  // Used only by the thread that takes.
  struct fm_serialized message;  // as taken; read in place: a copy, if it is needed
  struct fm_field * fields;
  struct fm_reading reading;
  struct fm_padded_info info;
  uint32_t topic;
  uint32_t dropped;  // by the middleware, and not counted yet
  enum fm_taking taking;
  struct fm_key key;  // in the topic's name; bytes NULL: none
  uint8_t key_bytes[FM_MOST_KEY_BYTES];
  // Guarded by the engine's mutex.
  bool is_retired;
  bool is_stopped;
};

uint32_t fm_receiver_taking(const char * middleware)
{
  return strcmp(middleware, "rmw_fastrtps_cpp") == 0 ? FM_LISTEN : FM_WAKE;
}

// ---- reading -----------------------------------------------------------------------------------

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
  (void)fm_engine_read(
    receiver->engine, receiver->topic, message, size, receiver->fields, &receiver->reading);
}

const struct fm_in_place * fm_receiver_in_place(const struct fm_receiver * receiver)
{
  return &receiver->middleware->in_place;
}

void fm_receiver_read(struct fm_receiver * receiver, const uint8_t * message, size_t size)
{
  read_fields(receiver, message, size);
  if (fm_engine_needs_bytes(receiver->engine, receiver->topic, &receiver->reading)) {
    copy_message(&receiver->message, message, size);
  }
}

// ---- taking ------------------------------------------------------------------------------------

static enum fm_take take(struct fm_receiver * receiver)
{
  struct fm_message_info * info = &receiver->info.info;
  const struct fm_middleware * middleware = receiver->middleware;
  const bool is_in_place = receiver->taking == FM_LISTEN_IN_PLACE;
  bool taken = false;
  receiver->reading.is_decoded = false;
  const int result = is_in_place ?
    middleware->take_message(receiver->subscription, receiver, &taken, info, NULL) :
    middleware->take(receiver->subscription, &receiver->message, &taken, info, NULL);
  const enum fm_take done = fm_take_result(middleware, result, taken, &receiver->dropped);
  if (done == FM_TAKEN) {
    if (!is_in_place) {
      read_fields(receiver, receiver->message.buffer, receiver->message.length);
    }
    receiver->reading.message = receiver->message.buffer;
    receiver->reading.size = receiver->message.length;
  }
  return done;
}

static struct fm_origin origin_of(const struct fm_receiver * receiver)
{
  const struct fm_message_info * info = &receiver->info.info;
  const struct fm_origin origin = {
    info->received_timestamp, info->source_timestamp, info->publication_sequence_number,
    info->gid, receiver->is_retired, receiver->key.bytes, receiver->key.size};
  return origin;
}

// During a handover the new subscription receives the same messages.
static void count_dropped_locked(struct fm_receiver * receiver)
{
  if (receiver->dropped > 0 && !receiver->is_retired) {
    fm_engine_drop_locked(receiver->engine, receiver->topic, receiver->dropped);
  }
  receiver->dropped = 0;
}

static void deliver_locked(void * argument)
{
  struct fm_receiver * receiver = argument;
  const struct fm_origin origin = origin_of(receiver);
  (void)fm_engine_receive_locked(receiver->engine, receiver->topic, &receiver->reading, &origin);
}

// Take the `count` messages of a notification, at most MOST_AT_ONCE. Asking for one more each time
// would cost a tenth of a message; a later one has its own callback. Returns whether some are
// left.
static bool take_locked(struct fm_receiver * receiver, size_t count)
{
  const size_t most = count > MOST_AT_ONCE ? MOST_AT_ONCE : count;
  enum fm_take result = FM_TAKEN;
  for (size_t k = 0; k < most && result != FM_EMPTY; ++k) {
    result = take(receiver);
    count_dropped_locked(receiver);
    if (result == FM_TAKEN) {
      deliver_locked(receiver);
    }
  }
  return result != FM_EMPTY && count > most;
}

// Called in a thread of the middleware, as the next function.
static void on_message(const void * user_data, size_t count)
{
  struct fm_receiver * receiver = (struct fm_receiver *)user_data;
  if (receiver->middleware->has_error()) {
    receiver->middleware->forget_error();  // left by other code: this may be a publisher's thread
  }
  if (fm_engine_begin_taking(receiver->engine)) {
    const bool is_behind = !receiver->is_stopped && take_locked(receiver, count);
    fm_engine_end_taking(receiver->engine, is_behind);
  }
}

static void wake(const void * user_data, size_t count)
{
  (void)count;
  fm_engine_leave(((const struct fm_receiver *)user_data)->engine);
}

static enum fm_take take_any(struct fm_receiver * receiver)
{
  enum fm_take result = FM_DROPPED;
  while (result == FM_DROPPED) {
    result = take(receiver);
  }
  return result;
}

static bool take_for_queue(void * argument, int64_t * received)
{
  struct fm_receiver * receiver = argument;
  receiver->middleware->forget_error();  // left by earlier calls in this thread
  const bool is_taken = take_any(receiver) == FM_TAKEN;
  if (receiver->dropped > 0) {
    fm_engine_lock(receiver->engine);
    count_dropped_locked(receiver);
    fm_engine_unlock(receiver->engine);
  }
  *received = receiver->info.info.received_timestamp;
  return is_taken;
}

// ---- life --------------------------------------------------------------------------------------

static void free_receiver(struct fm_receiver * receiver)
{
  free(receiver->message.buffer);
  free(receiver->fields);
  free(receiver);
}

static void copy_key(struct fm_receiver * receiver, const struct fm_key * key)
{
  receiver->key.bytes = receiver->key_bytes;
  receiver->key.size = key->size < FM_MOST_KEY_BYTES ? key->size : FM_MOST_KEY_BYTES;
  memcpy(receiver->key_bytes, key->bytes, receiver->key.size);
}

bool fm_receiver_start(
  struct fm_receiver ** started, struct fm_engine * engine,
  const struct fm_middleware * middleware, void * subscription, uint32_t topic, uint32_t taking,
  const struct fm_key * key)
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
  if (key != NULL) {
    copy_key(receiver, key);
  }
  receiver->message.allocator = fm_malloc_allocator();
  receiver->fields =
    calloc(fm_engine_reader(engine, topic)->n_inputs + 1u, sizeof(*receiver->fields));
  receiver->reading.fields = receiver->fields;
  receiver->queue.receiver = receiver;
  receiver->queue.take = take_for_queue;
  receiver->queue.deliver_locked = deliver_locked;
  if (receiver->fields == NULL) {
    free_receiver(receiver);
    return false;
  }
  fm_engine_add_queue(engine, &receiver->queue);  // the middleware may call back at once
  const fm_on_message callback = taking == FM_WAKE ? wake : on_message;
  if (middleware->listen(subscription, callback, receiver) != 0) {
    middleware->forget_error();
    fm_engine_remove_queue(engine, &receiver->queue);
    fm_engine_catch_up(engine);
    free_receiver(receiver);
    return false;
  }
  fm_engine_catch_up(engine);
  *started = receiver;
  return true;
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
  if (receiver->middleware->listen(receiver->subscription, NULL, NULL) != 0) {
    receiver->middleware->forget_error();
    fm_engine_lock(receiver->engine);
    receiver->is_stopped = true;
    fm_engine_unlock(receiver->engine);
    fm_engine_remove_queue(receiver->engine, &receiver->queue);
    return false;
  }
  fm_engine_remove_queue(receiver->engine, &receiver->queue);
  *started = NULL;
  free_receiver(receiver);
  return true;
}
