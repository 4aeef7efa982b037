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


/// relay.c: see relay.h for the contract.
///
/// Lock order. The middleware calls `on_message` with locks of its own held, and the engine calls
/// `on_due` with its mutex held; both lock the relay's mutex. So nothing of the middleware or the
/// engine is called with the relay's mutex held.

#define _POSIX_C_SOURCE 200809L

#include "relay.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "engine_locked.h"
#include "serialized.h"
#include "thread.h"

#define WAIT_NS 250000000  // between two probes, which find messages whose notification was lost
#define MOST_AT_END 1000u  // messages of a subscription that is removed

struct source
{
  struct fm_relay * relay;
  void * subscription;
  uint64_t waiting;    // messages by the notifications
  uint32_t left;       // messages to take before it is removed
  bool probes;         // there may be more, whose notification was lost
  bool is_retired;
  bool is_leaving;
};

struct fm_relay
{
  struct fm_relay_options options;
  pthread_t thread;
  pthread_mutex_t mutex;
  pthread_cond_t woken;      // the thread
  pthread_cond_t released;   // what the thread used
  // Used by the thread only.
  struct fm_serialized message;
  struct fm_serialized replacement;
  struct fm_padded_info info;
  int64_t due;               // of a replacement
  // Guarded by the mutex.
  struct source * sources[FM_MOST_SOURCES];
  uint32_t n_sources;
  void * publisher;
  uint64_t turns;
  uint64_t unpublished;
  int64_t probed_at;
  bool is_due_earlier;       // the engine has said so
  bool is_busy;              // the thread uses a source or the publisher
  bool is_closing;
  bool has_ended;
  bool is_called;            // a callback could not be removed
};

// ---- memory ------------------------------------------------------------------------------------

static bool make_buffers(struct fm_relay * relay)
{
  const struct fm_relay_options * options = &relay->options;
  relay->replacement.allocator = relay->message.allocator;
  if (options->substitute == NULL) {
    return true;
  }
  relay->replacement.buffer = malloc(options->substitute_size + 1);
  relay->replacement.capacity = options->substitute_size;
  relay->replacement.length = options->substitute_size;
  if (relay->replacement.buffer == NULL) {
    return false;
  }
  memcpy(relay->replacement.buffer, options->substitute, options->substitute_size);
  return true;
}

static void free_relay(struct fm_relay * relay)
{
  free(relay->message.buffer);
  free(relay->replacement.buffer);
  free(relay);
}

// ---- waking ------------------------------------------------------------------------------------

// Called in a thread of the middleware.
static void on_message(const void * user_data, size_t count)
{
  struct source * source = (struct source *)user_data;
  struct fm_relay * relay = source->relay;
  pthread_mutex_lock(&relay->mutex);
  source->waiting += count;
  pthread_cond_signal(&relay->woken);
  pthread_mutex_unlock(&relay->mutex);
}

// Called with the engine's mutex held.
static void on_due(void * argument)
{
  struct fm_relay * relay = argument;
  pthread_mutex_lock(&relay->mutex);
  relay->is_due_earlier = true;
  pthread_cond_signal(&relay->woken);
  pthread_mutex_unlock(&relay->mutex);
}

// Asking for one message more each time would cost a tenth of a message.
static void probe_if_due_locked(struct fm_relay * relay, int64_t now)
{
  if (now >= relay->probed_at + WAIT_NS) {
    relay->probed_at = now;
    for (uint32_t k = 0; k < relay->n_sources; ++k) {
      relay->sources[k]->probes = true;
    }
  }
}

static void wait_locked(struct fm_relay * relay)
{
  const int64_t probe = relay->probed_at + WAIT_NS;
  const int64_t until = relay->due < probe ? relay->due : probe;
  fm_wait_until(&relay->woken, &relay->mutex, until);
}

// ---- messages ----------------------------------------------------------------------------------

static bool publish(
  struct fm_relay * relay, void * publisher, const struct fm_serialized * message)
{
  if (relay->options.publish(publisher, message, NULL) == 0) {
    return true;
  }
  relay->options.middleware->forget_error();
  pthread_mutex_lock(&relay->mutex);
  relay->unpublished += 1;
  pthread_mutex_unlock(&relay->mutex);
  return false;
}

static void keep_for_hold(struct fm_relay * relay)
{
  const struct fm_serialized before = relay->replacement;
  relay->replacement = relay->message;
  relay->message = before;
}

// Judge a message that was taken, and publish it if it passes.
static void pass_on(struct fm_relay * relay, bool is_retired, void * publisher)
{
  const struct fm_message_info * info = &relay->info.info;
  const struct fm_origin origin = {
    info->received_timestamp, info->source_timestamp, info->publication_sequence_number,
    info->gid, is_retired, NULL, 0};
  const uint32_t judgement = fm_engine_judge(
    relay->options.engine, relay->message.buffer, relay->message.length, &origin, &relay->due);
  if (judgement == FM_PASSED) {
    (void)publish(relay, publisher, &relay->message);
    if (relay->options.holds) {
      keep_for_hold(relay);
    }
  }
}

// Take one message. Returns whether more may be waiting.
static bool take_one(
  struct fm_relay * relay, const void * subscription, bool is_retired, void * publisher)
{
  relay->message.length = 0;
  const uint32_t taken = fm_take_serialized(
    relay->options.middleware, subscription, &relay->message, &relay->info);
  if (taken == FM_TAKEN) {
    pass_on(relay, is_retired, publisher);
  }
  return taken != FM_EMPTY;
}

static void replace_if_due(struct fm_relay * relay, void * publisher)
{
  struct fm_serialized * message = &relay->replacement;
  if (relay->due <= fm_steady_time() &&
    fm_engine_replace(
      relay->options.engine, message->buffer, message->length, relay->options.stamp_at,
      &relay->due))
  {
    (void)publish(relay, publisher, message);
  }
}

// ---- the thread --------------------------------------------------------------------------------

// The oldest source with messages; NULL if there is none. During a handover the old subscription
// is emptied first, which keeps the messages in order.
static struct source * next_ready_locked(struct fm_relay * relay)
{
  for (uint32_t k = 0; k < relay->n_sources; ++k) {
    if (relay->sources[k]->waiting > 0 || relay->sources[k]->probes) {
      return relay->sources[k];
    }
  }
  return NULL;
}

static void unlink_locked(struct fm_relay * relay, const struct source * source)
{
  uint32_t n = 0;
  for (uint32_t k = 0; k < relay->n_sources; ++k) {
    if (relay->sources[k] != source) {
      relay->sources[n] = relay->sources[k];
      n += 1;
    }
  }
  relay->n_sources = n;
}

// Handle one message of a source, if there is one, and a replacement if it is due. The mutex is
// released meanwhile; what is in use then stays as it is, since the relay is busy.
static void turn_locked(struct fm_relay * relay, struct source * source)
{
  void * publisher = relay->publisher;
  const void * subscription = source == NULL ? NULL : source->subscription;
  const bool is_retired = source != NULL && source->is_retired;
  const bool is_due_earlier = relay->is_due_earlier;
  const uint64_t waiting = source == NULL ? 0 : source->waiting;
  bool has_more = false;
  relay->is_due_earlier = false;
  relay->is_busy = true;
  relay->turns += 1;
  pthread_mutex_unlock(&relay->mutex);
  if (is_due_earlier) {
    relay->due = fm_engine_replacement_due(relay->options.engine);
  }
  if (source != NULL) {
    has_more = take_one(relay, subscription, is_retired, publisher);
  }
  if (relay->due != FM_NEVER) {
    replace_if_due(relay, publisher);
  }
  pthread_mutex_lock(&relay->mutex);
  relay->is_busy = false;
  if (source != NULL) {
    source->waiting -= has_more ? (waiting > 0 ? 1u : 0u) : waiting;
    source->probes = source->probes && has_more;
    source->left -= source->is_leaving && source->left > 0 ? 1u : 0u;
    if (source->is_leaving && (!has_more || source->left == 0)) {
      unlink_locked(relay, source);
    }
  }
  pthread_cond_broadcast(&relay->released);
}

static void * run(void * argument)
{
  struct fm_relay * relay = argument;
  relay->due = fm_engine_replacement_due(relay->options.engine);
  pthread_mutex_lock(&relay->mutex);
  while (!relay->is_closing) {
    const int64_t now = fm_steady_time();
    probe_if_due_locked(relay, now);
    struct source * source = next_ready_locked(relay);
    if (source == NULL && !relay->is_due_earlier && relay->due > now) {
      wait_locked(relay);
      relay->turns += 1;
    } else {
      turn_locked(relay, source);
    }
  }
  relay->has_ended = true;
  pthread_cond_broadcast(&relay->released);
  pthread_mutex_unlock(&relay->mutex);
  return NULL;
}

// ---- life --------------------------------------------------------------------------------------

static bool make_locks(struct fm_relay * relay)
{
  if (pthread_mutex_init(&relay->mutex, NULL) != 0) {
    return false;
  }
  if (!fm_make_condition(&relay->woken)) {
    pthread_mutex_destroy(&relay->mutex);
    return false;
  }
  if (!fm_make_condition(&relay->released)) {
    pthread_cond_destroy(&relay->woken);
    pthread_mutex_destroy(&relay->mutex);
    return false;
  }
  return true;
}

static void free_locks(struct fm_relay * relay)
{
  pthread_cond_destroy(&relay->released);
  pthread_cond_destroy(&relay->woken);
  pthread_mutex_destroy(&relay->mutex);
}

bool fm_relay_start(struct fm_relay ** started, const struct fm_relay_options * options)
{
  struct fm_relay * relay = calloc(1, sizeof(*relay));
  if (relay == NULL) {
    return false;
  }
  relay->options = *options;
  relay->publisher = options->publisher;
  if (!make_buffers(relay) || !make_locks(relay)) {
    free_relay(relay);
    return false;
  }
  fm_engine_on_due(options->engine, on_due, relay);
  if (!fm_start_thread(&relay->thread, run, relay)) {
    fm_engine_on_due(options->engine, NULL, NULL);
    free_locks(relay);
    free_relay(relay);
    return false;
  }
  *started = relay;
  return true;
}

void fm_relay_end(struct fm_relay * relay)
{
  pthread_mutex_lock(&relay->mutex);
  const bool was_closing = relay->is_closing;
  relay->is_closing = true;
  pthread_cond_signal(&relay->woken);
  pthread_mutex_unlock(&relay->mutex);
  if (!was_closing) {
    pthread_join(relay->thread, NULL);
    fm_engine_on_due(relay->options.engine, NULL, NULL);
  }
}

void fm_relay_join(struct fm_relay ** relay)
{
  if (*relay != NULL) {
    fm_relay_end(*relay);
    if (!(*relay)->is_called) {
      free_locks(*relay);
      free_relay(*relay);
    }
    *relay = NULL;
  }
}

// ---- subscriptions -----------------------------------------------------------------------------

bool fm_relay_add(struct fm_relay * relay, void * subscription)
{
  const struct fm_middleware * middleware = relay->options.middleware;
  pthread_mutex_lock(&relay->mutex);
  const bool has_room = relay->n_sources < FM_MOST_SOURCES;
  pthread_mutex_unlock(&relay->mutex);
  struct source * source = has_room ? calloc(1, sizeof(*source)) : NULL;
  if (source == NULL) {
    return false;
  }
  source->relay = relay;
  source->subscription = subscription;
  source->probes = true;
  source->left = MOST_AT_END;
  if (middleware->listen(subscription, on_message, source) != 0) {
    middleware->forget_error();
    free(source);
    return false;
  }
  pthread_mutex_lock(&relay->mutex);
  relay->sources[relay->n_sources] = source;
  relay->n_sources += 1;
  pthread_cond_signal(&relay->woken);
  pthread_mutex_unlock(&relay->mutex);
  return true;
}

static struct source * find_locked(struct fm_relay * relay, const void * subscription)
{
  for (uint32_t k = 0; k < relay->n_sources; ++k) {
    if (relay->sources[k]->subscription == subscription) {
      return relay->sources[k];
    }
  }
  return NULL;
}

void fm_relay_retire(struct fm_relay * relay, const void * subscription)
{
  pthread_mutex_lock(&relay->mutex);
  struct source * source = find_locked(relay, subscription);
  if (source != NULL) {
    source->is_retired = true;
  }
  pthread_mutex_unlock(&relay->mutex);
}

bool fm_relay_remove(struct fm_relay * relay, const void * subscription)
{
  const struct fm_middleware * middleware = relay->options.middleware;
  pthread_mutex_lock(&relay->mutex);
  struct source * source = find_locked(relay, subscription);
  pthread_mutex_unlock(&relay->mutex);
  if (source == NULL) {
    return true;
  }
  const bool is_quiet = middleware->listen(source->subscription, NULL, NULL) == 0;
  if (!is_quiet) {
    middleware->forget_error();
  }
  pthread_mutex_lock(&relay->mutex);
  relay->is_called = relay->is_called || !is_quiet;
  source->is_leaving = true;
  source->probes = true;
  pthread_cond_signal(&relay->woken);
  while (find_locked(relay, subscription) != NULL && !relay->has_ended) {
    pthread_cond_wait(&relay->released, &relay->mutex);
  }
  unlink_locked(relay, source);
  pthread_mutex_unlock(&relay->mutex);
  if (is_quiet) {
    free(source);
  }
  return is_quiet;
}

void fm_relay_publish_with(struct fm_relay * relay, void * publisher)
{
  pthread_mutex_lock(&relay->mutex);
  relay->publisher = publisher;
  const uint64_t turns = relay->turns;
  while (relay->is_busy && relay->turns == turns) {  // a later turn uses the new one
    pthread_cond_wait(&relay->released, &relay->mutex);
  }
  pthread_mutex_unlock(&relay->mutex);
}

uint64_t fm_relay_turns(struct fm_relay * relay)
{
  pthread_mutex_lock(&relay->mutex);
  const uint64_t turns = relay->turns;
  pthread_mutex_unlock(&relay->mutex);
  return turns;
}

uint64_t fm_relay_unpublished(struct fm_relay * relay)
{
  pthread_mutex_lock(&relay->mutex);
  const uint64_t unpublished = relay->unpublished;
  pthread_mutex_unlock(&relay->mutex);
  return unpublished;
}
