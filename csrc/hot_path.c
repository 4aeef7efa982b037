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


/// hot_path.c: see hot_path.h for the contract.
///
/// Locks. The middleware calls `on_message` with locks of its own for that subscription held, and
/// it takes the engine's mutex and calls `take`, which wants the subscription's. Whoever is not in
/// a callback must therefore not hold the engine's mutex while it takes. So `fm_receiver_drain` keeps
/// callbacks from taking by a flag, which the mutex guards, and takes without the mutex.

#define _POSIX_C_SOURCE 200809L

#include "hot_path.h"

#include <pthread.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>

#include "engine_locked.h"

#define BATCH 64u
#define MOST_DRAINED 1000u
#define QUIET_LOOKS 16u  // of which one drains
#define PATIENCE 200u  // milliseconds; an end of the engine wakes it at once

// ---- receivers -----------------------------------------------------------------------------------

struct fm_receiver
{
  struct fm_engine * engine;
  const struct fm_middleware * middleware;
  void * subscription;
  // These are of who takes: a callback under the mutex, or the drain.
  struct fm_serialized message;  // as taken; if it is read in place, a copy of what is odd
  struct fm_field * fields;
  struct fm_reading reading;
  uint32_t topic;
  bool is_in_place;
  bool is_retired;   // these are guarded by the engine's mutex
  bool is_draining;
  bool is_awaited;   // a callback came while it was drained
  bool is_behind;    // some may be left that a callback has told of
  bool was_told;     // a callback came since the last look
  uint32_t quiet;    // looks since the last callback
};

static void * allocate(size_t size, void * state)
{
  (void)state;
  return malloc(size);
}

static void deallocate(void * pointer, void * state)
{
  (void)state;
  free(pointer);
}

static void * reallocate(void * pointer, size_t size, void * state)
{
  (void)state;
  return realloc(pointer, size);
}

static void * zero_allocate(size_t count, size_t size, void * state)
{
  (void)state;
  return calloc(count, size);
}

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
  receiver->reading.is_decoded = reader_of(receiver)->read(message, size, receiver->fields);
}

static const void * pointer_at(const void * object, size_t offset)
{
  const void * found;
  memcpy(&found, (const uint8_t *)object + offset, sizeof(found));
  return found;
}

bool fm_in_place_read(void * cdr, void * receiver)
{
  struct fm_receiver * self = receiver;
  const struct fm_in_place * place = &self->middleware->in_place;
  const void * buffer = pointer_at(cdr, place->buffer_of_cdr);
  const uint8_t * message = pointer_at(buffer, place->data_of_buffer);
  size_t size;
  memcpy(&size, (const uint8_t *)buffer + place->size_of_buffer, sizeof(size));
  read_fields(self, message, size);
  if (!self->reading.is_decoded || !all_are_read(self->fields, reader_of(self)->n_inputs)) {
    copy_message(&self->message, message, size);
  }
  return true;
}

static const char fast_identifier[] = "rosidl_typesupport_fastrtps_c";

static const struct fm_type_support * support_for(
  const struct fm_type_support * handle, const char * identifier)
{
  const struct fm_in_place_type * type = (const struct fm_in_place_type *)(const void *)handle;
  if (strcmp(identifier, fast_identifier) == 0) {
    return &type->fast;
  }
  if (strcmp(identifier, handle->typesupport_identifier) == 0) {
    return handle;
  }
  return type->original->func(type->original, identifier);
}

bool fm_in_place_make(const struct fm_type_support * original, struct fm_in_place_type * made)
{
  const struct fm_type_support * fast = original->func(original, fast_identifier);
  if (fast == NULL || strcmp(fast->typesupport_identifier, fast_identifier) != 0) {
    return false;
  }
  made->original = original;
  made->support = *original;
  made->support.func = support_for;
  made->fast = *fast;
  made->callbacks = *fast->data;
  made->callbacks.cdr_deserialize = fm_in_place_read;
  made->fast.data = &made->callbacks;
  return true;
}

static bool find_word(const uint64_t * words, size_t n, uint64_t wanted, size_t * offset)
{
  for (size_t k = 0; k < n; ++k) {
    if (words[k] == wanted) {
      *offset = k * sizeof(*words);
      return true;
    }
  }
  return false;
}

bool fm_in_place_find(
  void (* make_buffer)(void * self, char * data, size_t size),
  void (* make_cdr)(void * self, void * buffer, int endianness, int version),
  struct fm_in_place * found)
{
  enum { BUFFER_WORDS = 8, CDR_WORDS = 64 };  // where to look; the objects may be larger
  uint64_t buffer[64] = {0};
  uint64_t cdr[256] = {0};
  char data[40] = {0};
  if (sizeof(void *) != sizeof(uint64_t) || sizeof(size_t) != sizeof(uint64_t)) {
    return false;
  }
  make_buffer(buffer, data, sizeof(data));
  make_cdr(cdr, buffer, 1, 0);
  return find_word(buffer, BUFFER_WORDS, (uint64_t)(uintptr_t)data, &found->data_of_buffer) &&
         find_word(buffer, BUFFER_WORDS, sizeof(data), &found->size_of_buffer) &&
         find_word(cdr, CDR_WORDS, (uint64_t)(uintptr_t)buffer, &found->buffer_of_cdr);
}

static int take_any(struct fm_receiver * receiver, bool * taken, struct fm_message_info * info)
{
  const struct fm_middleware * middleware = receiver->middleware;
  return receiver->is_in_place ?
         middleware->take_message(receiver->subscription, receiver, taken, info, NULL) :
         middleware->take(receiver->subscription, &receiver->message, taken, info, NULL);
}

enum result
{
  NOTHING,  // to be had, or the middleware fails
  TAKEN,
  GARBAGE   // was there, and is gone: no header, so that nobody was asked to read it
};

// Takes one of `waiting`, as far as is known. A message without a header is thrown away in passing:
// there may have been as many as are waiting, and there was one.
static enum result take(
  struct fm_receiver * receiver, struct fm_message_info * info, uint64_t waiting)
{
  bool taken = false;
  receiver->reading.is_decoded = false;
  const int result = take_any(receiver, &taken, info);
  const bool has_error = receiver->middleware->has_error();
  if (has_error) {
    receiver->middleware->forget_error();
    receiver->reading.thrown += waiting > 2 ? waiting - 1 : 1;
  }
  if (result != 0 || !taken) {
    receiver->reading.thrown -= has_error ? 1 : 0;  // it is counted now
    receiver->reading.size = 0;
    return result == 0 && has_error ? GARBAGE : NOTHING;
  }
  if (!receiver->is_in_place) {
    read_fields(receiver, receiver->message.buffer, receiver->message.length);
  }
  receiver->reading.message = receiver->message.buffer;
  receiver->reading.size = receiver->message.length;
  return TAKEN;
}

static void deliver_locked(
  struct fm_receiver * receiver, enum result result, const struct fm_message_info * info)
{
  if (result == GARBAGE) {
    if (!receiver->is_retired) {  // the subscription that takes its place counts it
      fm_engine_undecodable_locked(receiver->engine, receiver->topic);
    }
    return;
  }
  const struct fm_origin origin = {
    info->received_timestamp, info->source_timestamp, info->publication_sequence_number,
    info->gid, receiver->is_retired};
  (void)fm_engine_deliver_locked(receiver->engine, receiver->topic, &receiver->reading, &origin);
  receiver->reading.thrown = 0;
}

// In the middleware's thread. Takes as many as it is told of: one that comes later has a callback
// of its own, and asking whether there is one costs a tenth of a message.
static void on_message(const void * user_data, size_t count)
{
  struct fm_receiver * receiver = (struct fm_receiver *)user_data;
  struct fm_message_info info;
  if (receiver->middleware->has_error()) {
    receiver->middleware->forget_error();  // somebody else's: the thread may be a publisher's
  }
  fm_engine_lock(receiver->engine);
  receiver->was_told = true;
  if (receiver->is_draining) {
    receiver->is_awaited = true;
  } else {
    for (size_t k = 0; k < count || receiver->is_behind; ++k) {
      const enum result result = take(receiver, &info, k < count ? count - k : 1);
      if (result == NOTHING) {
        receiver->is_behind = false;
        break;
      }
      deliver_locked(receiver, result, &info);
    }
  }
  fm_engine_unlock(receiver->engine);
}

static void begin_draining(struct fm_receiver * receiver)
{
  fm_engine_lock(receiver->engine);
  receiver->is_draining = true;
  fm_engine_unlock(receiver->engine);
}

// Returns whether it is over: nothing came while it was found empty, or it has taken enough; what
// is left is for the next callback or drain.
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

static void drain(struct fm_receiver * receiver)
{
  struct fm_message_info info;
  uint32_t left = MOST_DRAINED;
  receiver->middleware->forget_error();  // one that this thread may have had before
  do {
    enum result result = NOTHING;
    while (left > 0 && (result = take(receiver, &info, 1)) != NOTHING) {
      left -= 1;
      fm_engine_lock(receiver->engine);
      deliver_locked(receiver, result, &info);
      fm_engine_unlock(receiver->engine);
    }
  } while (!end_draining(receiver, left == 0));
}

static void free_receiver(struct fm_receiver * receiver)
{
  free(receiver->message.buffer);
  free(receiver->fields);
  free(receiver);
}

struct fm_receiver * fm_receiver_start(
  struct fm_engine * engine, const struct fm_middleware * middleware, void * subscription,
  uint32_t topic, bool is_in_place)
{
  struct fm_receiver * receiver = calloc(1, sizeof(*receiver));
  if (receiver == NULL) {
    return NULL;
  }
  receiver->engine = engine;
  receiver->middleware = middleware;
  receiver->subscription = subscription;
  receiver->topic = topic;
  receiver->is_in_place = is_in_place;
  receiver->message.allocator =
    (struct fm_allocator) {allocate, deallocate, reallocate, zero_allocate, NULL};
  receiver->fields = calloc(reader_of(receiver)->n_inputs + 1u, sizeof(*receiver->fields));
  receiver->reading.fields = receiver->fields;
  receiver->is_draining = true;  // the middleware may call back at once, from within `listen`
  if (receiver->fields == NULL || middleware->listen(subscription, on_message, receiver) != 0) {
    middleware->forget_error();
    free_receiver(receiver);
    return NULL;
  }
  drain(receiver);
  return receiver;
}

void fm_receiver_drain(struct fm_receiver * receiver)
{
  begin_draining(receiver);
  drain(receiver);
}

// While it is drained a message waits, and one of another topic may overtake it: seldom, therefore.
static bool begin_look(struct fm_receiver * receiver)
{
  fm_engine_lock(receiver->engine);
  const bool is_due = !receiver->was_told && receiver->quiet % QUIET_LOOKS == 0;
  receiver->quiet = receiver->was_told ? 0 : receiver->quiet + 1u;
  receiver->is_behind = receiver->is_behind || receiver->was_told;
  receiver->was_told = false;
  receiver->is_draining = is_due;
  fm_engine_unlock(receiver->engine);
  return is_due;
}

void fm_receiver_poll(struct fm_receiver * receiver)
{
  if (begin_look(receiver)) {
    drain(receiver);
  }
}

void fm_receiver_retire(struct fm_receiver * receiver)
{
  fm_engine_lock(receiver->engine);
  receiver->is_retired = true;
  fm_engine_unlock(receiver->engine);
}

void fm_receiver_stop(struct fm_receiver * receiver)
{
  if (receiver->middleware->listen(receiver->subscription, NULL, NULL) != 0) {
    receiver->middleware->forget_error();
  }
  free_receiver(receiver);
}

// ---- announcers --------------------------------------------------------------------------------

struct fm_announcer
{
  struct fm_engine * engine;
  const struct fm_middleware * middleware;
  void ** publishers;
  uint32_t n_publishers;
  pthread_t thread;
};

static void publish(struct fm_announcer * announcer, const struct fm_violation * violation)
{
  const uint8_t empty = 0;  // std_msgs/msg/Empty is one byte in C
  if (violation->requirement >= announcer->n_publishers) {
    return;
  }
  const int result = announcer->middleware->publish(
    announcer->publishers[violation->requirement], &empty, NULL);
  if (result != 0) {
    announcer->middleware->forget_error();
    fm_engine_count_unpublished(announcer->engine, 1);
  }
}

static void * run(void * argument)
{
  struct fm_announcer * announcer = argument;
  struct fm_violation batch[BATCH];
  uint32_t n = 0;
  do {
    n = fm_engine_take(announcer->engine, batch, BATCH, PATIENCE);
    for (uint32_t k = 0; k < n; ++k) {
      publish(announcer, &batch[k]);
    }
  } while (n > 0 || !fm_engine_is_closed(announcer->engine));
  return NULL;
}

// A thread that gets no signals: they are for the main one.
static bool start_thread(struct fm_announcer * announcer)
{
  sigset_t all;
  sigset_t before;
  sigfillset(&all);
  if (pthread_sigmask(SIG_SETMASK, &all, &before) != 0) {
    return false;
  }
  const bool is_started = pthread_create(&announcer->thread, NULL, run, announcer) == 0;
  pthread_sigmask(SIG_SETMASK, &before, NULL);
  return is_started;
}

static void free_announcer(struct fm_announcer * announcer)
{
  free(announcer->publishers);
  free(announcer);
}

struct fm_announcer * fm_announcer_start(
  struct fm_engine * engine, const struct fm_middleware * middleware, void * const * publishers,
  uint32_t n_publishers)
{
  struct fm_announcer * announcer = calloc(1, sizeof(*announcer));
  if (announcer == NULL) {
    return NULL;
  }
  announcer->engine = engine;
  announcer->middleware = middleware;
  announcer->n_publishers = n_publishers;
  announcer->publishers = calloc(n_publishers + 1u, sizeof(*publishers));
  if (announcer->publishers == NULL) {
    free_announcer(announcer);
    return NULL;
  }
  memcpy(announcer->publishers, publishers, n_publishers * sizeof(*publishers));
  if (!start_thread(announcer)) {
    free_announcer(announcer);
    return NULL;
  }
  return announcer;
}

void fm_announcer_join(struct fm_announcer * announcer)
{
  pthread_join(announcer->thread, NULL);
  free_announcer(announcer);
}
