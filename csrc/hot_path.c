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
/// it takes the watch's mutex and calls `take`, which wants the subscription's. Whoever is not in
/// a callback must therefore not hold the watch's mutex while it takes. So `fm_source_drain` keeps
/// callbacks from taking by a flag, which the mutex guards, and takes without the mutex.

#define _POSIX_C_SOURCE 200809L

#include "hot_path.h"

#include <pthread.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>

#include "losses.h"
#include "watch_locked.h"

#define BATCH 64u
#define MOST_DRAINED 1000u
#define PATIENCE 200u  // milliseconds; an end of the watch wakes it at once

// ---- sources -----------------------------------------------------------------------------------

struct fm_source
{
  struct fm_watch * watch;
  const struct fm_middleware * middleware;
  void * subscription;
  struct fm_serialized message;  // of who takes: a callback under the mutex, or the drain
  uint32_t topic;
  bool is_retired;   // these four are guarded by the watch's mutex
  bool is_draining;
  bool is_awaited;   // a callback came while it was drained
  bool is_behind;    // some may be left that a callback has told of
  struct fm_losses losses;  // guarded likewise
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

static bool take(struct fm_source * source, struct fm_message_info * info)
{
  bool taken = false;
  const int result = source->middleware->take(
    source->subscription, &source->message, &taken, info, NULL);
  if (result != 0) {
    source->middleware->forget_error();
    return false;
  }
  return taken;
}

static void deliver_locked(struct fm_source * source, const struct fm_message_info * info)
{
  const struct fm_origin origin = {
    info->received_timestamp, info->source_timestamp, info->publication_sequence_number,
    source->is_retired};
  if (!source->is_retired) {  // what the new subscription brings is not lost
    fm_losses_note(&source->losses, info->gid, info->publication_sequence_number);
  }
  (void)fm_watch_message_locked(
    source->watch, source->topic, source->message.buffer, source->message.length, &origin);
}

// In the middleware's thread. Takes as many as it is told of: one that comes later has a callback
// of its own, and asking whether there is one costs a tenth of a message.
static void on_message(const void * user_data, size_t count)
{
  struct fm_source * source = (struct fm_source *)user_data;
  struct fm_message_info info;
  fm_watch_lock(source->watch);
  if (source->is_draining) {
    source->is_awaited = true;
  } else {
    for (size_t k = 0; k < count || source->is_behind; ++k) {
      if (!take(source, &info)) {
        source->is_behind = false;
        break;
      }
      deliver_locked(source, &info);
    }
  }
  fm_watch_unlock(source->watch);
}

static void begin_draining(struct fm_source * source)
{
  fm_watch_lock(source->watch);
  source->is_draining = true;
  fm_watch_unlock(source->watch);
}

// Returns whether it is over: nothing came while it was found empty, or it has taken enough; what
// is left is for the next callback or drain.
static bool end_draining(struct fm_source * source, bool is_enough)
{
  fm_watch_lock(source->watch);
  const bool is_over = is_enough || !source->is_awaited;
  source->is_behind = is_enough;
  source->is_awaited = false;
  source->is_draining = !is_over;
  fm_watch_unlock(source->watch);
  return is_over;
}

static void drain(struct fm_source * source)
{
  struct fm_message_info info;
  uint32_t left = MOST_DRAINED;
  do {
    while (left > 0 && take(source, &info)) {
      left -= 1;
      fm_watch_lock(source->watch);
      deliver_locked(source, &info);
      fm_watch_unlock(source->watch);
    }
  } while (!end_draining(source, left == 0));
}

struct fm_source * fm_source_start(
  struct fm_watch * watch, const struct fm_middleware * middleware, void * subscription,
  uint32_t topic)
{
  struct fm_source * source = calloc(1, sizeof(*source));
  if (source == NULL) {
    return NULL;
  }
  source->watch = watch;
  source->middleware = middleware;
  source->subscription = subscription;
  source->topic = topic;
  source->message.allocator =
    (struct fm_allocator) {allocate, deallocate, reallocate, zero_allocate, NULL};
  source->is_draining = true;  // the middleware may call back at once, from within `listen`
  if (middleware->listen(subscription, on_message, source) != 0) {
    middleware->forget_error();
    free(source);
    return NULL;
  }
  drain(source);
  return source;
}

void fm_source_drain(struct fm_source * source)
{
  begin_draining(source);
  drain(source);
}

void fm_source_retire(struct fm_source * source)
{
  fm_watch_lock(source->watch);
  source->is_retired = true;
  fm_watch_unlock(source->watch);
}

uint64_t fm_source_lost(const struct fm_source * source)
{
  fm_watch_lock(source->watch);
  const uint64_t lost = source->losses.lost;
  fm_watch_unlock(source->watch);
  return lost;
}

void fm_source_stop(struct fm_source * source)
{
  if (source->middleware->listen(source->subscription, NULL, NULL) != 0) {
    source->middleware->forget_error();
  }
  free(source->message.buffer);
  free(source);
}

// ---- announcers --------------------------------------------------------------------------------

struct fm_announcer
{
  struct fm_watch * watch;
  const struct fm_middleware * middleware;
  void ** publishers;
  uint32_t n_publishers;
  pthread_t thread;
  uint64_t failures;
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
    fm_watch_lock(announcer->watch);
    announcer->failures += 1;
    fm_watch_unlock(announcer->watch);
  }
}

static void * run(void * argument)
{
  struct fm_announcer * announcer = argument;
  struct fm_violation batch[BATCH];
  uint32_t n = 0;
  do {
    n = fm_watch_take(announcer->watch, batch, BATCH, PATIENCE);
    for (uint32_t k = 0; k < n; ++k) {
      publish(announcer, &batch[k]);
    }
  } while (n > 0 || !fm_watch_is_closed(announcer->watch));
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
  struct fm_watch * watch, const struct fm_middleware * middleware, void * const * publishers,
  uint32_t n_publishers)
{
  struct fm_announcer * announcer = calloc(1, sizeof(*announcer));
  if (announcer == NULL) {
    return NULL;
  }
  announcer->watch = watch;
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

uint64_t fm_announcer_failures(const struct fm_announcer * announcer)
{
  fm_watch_lock(announcer->watch);
  const uint64_t failures = announcer->failures;
  fm_watch_unlock(announcer->watch);
  return failures;
}

void fm_announcer_join(struct fm_announcer * announcer)
{
  pthread_join(announcer->thread, NULL);
  free_announcer(announcer);
}
