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

/// engine_threads.c: the hot path under load, for the thread sanitizer.
///
/// Real middleware cannot be built with it. So this has one of its own, which locks as Fast DDS
/// does: a callback is called with the subscription's two mutexes held, and `take` wants one of
/// them. Four threads flood two topics, with garbage among the messages; meanwhile subscriptions
/// are replaced, groups reset, details wanted and not. In the end every message was one step, and
/// every violation was published once.

#define _GNU_SOURCE

#include "announcer.h"
#include "receiver.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "check.h"
#include "engines.h"
#include "seen.h"
#include "fakes.h"

enum { N_TOPICS = 2, N_SENDERS = 4,
  N_MESSAGES = 4000, N_RENEWALS = 12, MESSAGE = 5, MOST_WAITING = 200 };

// ---- the middleware ----------------------------------------------------------------------------

struct item
{
  uint8_t data[MESSAGE];
  size_t size;
  uint64_t sequence;
};

struct subscription
{
  pthread_mutex_t reader;    // recursive
  pthread_mutex_t listener;
  struct item * items;
  size_t begin;
  size_t end;
  size_t unread;
  fm_on_message callback;
  const void * user_data;
};

struct topic
{
  pthread_mutex_t mutex;
  struct subscription * subscriptions[2];
  uint64_t sequence;
};

static struct topic topics[N_TOPICS];
static uint64_t published[N_TOPICS];
static uint64_t refused;  // by the middleware, of those

static struct subscription * make_subscription(void)
{
  struct subscription * made = calloc(1, sizeof(*made));
  pthread_mutexattr_t recursive;
  pthread_mutexattr_init(&recursive);
  pthread_mutexattr_settype(&recursive, PTHREAD_MUTEX_RECURSIVE);
  pthread_mutex_init(&made->reader, &recursive);
  pthread_mutex_init(&made->listener, NULL);
  pthread_mutexattr_destroy(&recursive);
  made->items = calloc(N_SENDERS * N_MESSAGES, sizeof(*made->items));
  return made;
}

static void free_subscription(struct subscription * subscription)
{
  pthread_mutex_destroy(&subscription->reader);
  pthread_mutex_destroy(&subscription->listener);
  free(subscription->items);
  free(subscription);
}

static size_t count_unread(struct subscription * subscription)
{
  pthread_mutex_lock(&subscription->reader);
  const size_t unread = subscription->unread;
  subscription->unread = 0;
  pthread_mutex_unlock(&subscription->reader);
  return unread;
}

static void arrive(struct subscription * subscription, const struct item * item)
{
  pthread_mutex_lock(&subscription->reader);
  subscription->items[subscription->end] = *item;
  subscription->end += 1;
  subscription->unread += 1;
  pthread_mutex_lock(&subscription->listener);
  if (subscription->callback != NULL) {
    const size_t unread = count_unread(subscription);
    if (unread > 0) {
      subscription->callback(subscription->user_data, unread);
    }
  }
  pthread_mutex_unlock(&subscription->listener);
  pthread_mutex_unlock(&subscription->reader);
}

static int listen(void * subscription, fm_on_message callback, const void * user_data)
{
  struct subscription * self = subscription;
  const size_t unread = callback == NULL ? 0 : count_unread(self);
  pthread_mutex_lock(&self->listener);
  if (unread > 0) {
    callback(user_data, unread);
  }
  self->callback = callback;
  self->user_data = user_data;
  pthread_mutex_unlock(&self->listener);
  return 0;
}

static int take(
  const void * subscription, struct fm_serialized * message, bool * taken,
  struct fm_message_info * info, void * allocation)
{
  struct subscription * self = (struct subscription *)subscription;
  (void)allocation;
  pthread_mutex_lock(&self->reader);
  *taken = self->begin < self->end;
  if (*taken) {
    const struct item * item = &self->items[self->begin];
    self->begin += 1;
    if (message->capacity < MESSAGE) {
      message->buffer = message->allocator.reallocate(
        message->buffer, MESSAGE, message->allocator.state);
      message->capacity = MESSAGE;
    }
    memcpy(message->buffer, item->data, item->size);
    message->length = item->size;
    memset(info, 0, sizeof(*info));
    info->publication_sequence_number = item->sequence;
    info->source_timestamp = (int64_t)item->sequence;
    info->received_timestamp = (int64_t)item->sequence;
  }
  pthread_mutex_unlock(&self->reader);
  return 0;
}

static int publish(const void * publisher, const void * message, void * allocation)
{
  (void)message;
  (void)allocation;
  const uint64_t before =
    __atomic_fetch_add(&published[*(const uint32_t *)publisher], 1, __ATOMIC_RELAXED);
  const bool fails = before % 100 == 99;
  __atomic_fetch_add(&refused, fails, __ATOMIC_RELAXED);
  return fails;
}

static const struct fm_middleware middleware = FAKE_MIDDLEWARE(take, listen, publish);

// ---- the monitor: a requirement a topic, false where the message says so ----------------------

struct inputs
{
  bool is_good[N_TOPICS];
};

static void reset(void * state) {(void)state;}

static void step_0(void * state, const void * inputs, bool * verdicts)
{
  (void)state;
  verdicts[0] = ((const struct inputs *)inputs)->is_good[0];
}

static void step_1(void * state, const void * inputs, bool * verdicts)
{
  (void)state;
  verdicts[1] = ((const struct inputs *)inputs)->is_good[1];
}

static const uint32_t numbers[] = {0, 1};
static const struct fm_input inputs[] = {{"a", 0, FM_BOOL}, {"b", 1, FM_BOOL}};
static const struct fm_group groups[] = {
  {&numbers[0], 1, &numbers[0], 1, reset, step_0, NULL},
  {&numbers[1], 1, &numbers[1], 1, reset, step_1, NULL}};
static const struct fm_requirement requirements[] = {{"A", 0}, {"B", 1}};
static const struct fm_monitor monitor = {
  FM_ABI, N_TOPICS, 2, 2, 8, sizeof(struct inputs), inputs, groups, requirements, "m", "",
  NULL, NULL, 0, NULL};
static const struct fm_topic fed[] = {{&numbers[0], 1}, {&numbers[1], 1}};

static bool read_message(const uint8_t * message, size_t size, struct fm_field * fields)
{
  if (size < MESSAGE) {
    return false;
  }
  fields[0].value.i = message[4];
  fields[0].outcome = message[4] == 2 ? FM_FIELD_OUTSIDE : FM_FIELD_READ;
  return true;
}

static const struct fm_reader reader[] = {
  {.read = read_message, .n_inputs = 1},
  {.read = read_message, .n_inputs = 1}};
static const struct fm_readers readers = {FM_ABI, N_TOPICS, reader};

// ---- the load ----------------------------------------------------------------------------------

static void pause_a_little(void)
{
  const struct timespec a_little = {0, 2000000};
  nanosleep(&a_little, NULL);
}

static size_t count_waiting(struct subscription * subscription)
{
  pthread_mutex_lock(&subscription->reader);
  const size_t waiting = subscription->end - subscription->begin;
  pthread_mutex_unlock(&subscription->reader);
  return waiting;
}

// Every third message is false, every fiftieth has a field that cannot be used, every hundredth
// is garbage.
static void * send(void * argument)
{
  struct topic * topic = argument;
  for (int k = 0; k < N_MESSAGES; ++k) {
    struct item item = {{0}, k % 100 == 7 ? 2 : MESSAGE, 0};
    item.data[4] = (uint8_t)(k % 50 == 9 ? 2 : k % 3 != 0);
    pthread_mutex_lock(&topic->mutex);
    topic->sequence += 1;
    item.sequence = topic->sequence;
    size_t waiting = 0;
    for (int s = 0; s < 2; ++s) {
      if (topic->subscriptions[s] != NULL) {
        arrive(topic->subscriptions[s], &item);
        waiting += count_waiting(topic->subscriptions[s]);
      }
    }
    pthread_mutex_unlock(&topic->mutex);
    if (waiting > MOST_WAITING) {  // as a queue of that depth would make it
      pause_a_little();
    }
  }
  return NULL;
}

static bool is_over;

static void * read_details(void * argument)
{
  struct fm_engine * engine = argument;
  uint64_t room[32];
  while (!__atomic_load_n(&is_over, __ATOMIC_ACQUIRE)) {
    if (fm_engine_take_detail(engine, (struct fm_detail *)(void *)room, 20)) {
      CHECK(((struct fm_detail *)(void *)room)->violation.requirement < 2);
    }
  }
  return NULL;
}

static void put(struct topic * topic, int place, struct subscription * subscription)
{
  pthread_mutex_lock(&topic->mutex);
  topic->subscriptions[place] = subscription;
  pthread_mutex_unlock(&topic->mutex);
}

// As the feed does now and then.
static void empty(struct fm_engine * engine, struct subscription * subscription)
{
  while (count_waiting(subscription) > 0) {
    fm_engine_drain(engine);
  }
}

// Replace the subscription of a topic while messages come; the new one first.
static struct fm_receiver * renew(
  struct fm_engine * engine, uint32_t t, int place, struct fm_receiver * before)
{
  struct topic * topic = &topics[t];
  struct subscription * old = topic->subscriptions[1 - place];
  struct subscription * fresh = make_subscription();
  fm_engine_begin_handover(engine, t, false);
  fm_receiver_retire(before);
  put(topic, place, fresh);
  struct fm_receiver * receiver = NULL;
  CHECK(fm_receiver_start(&receiver, engine, &middleware, fresh, t, FM_LISTEN, NULL));
  for (int k = 0; k < 20; ++k) {
    pause_a_little();
    fm_engine_drain(engine);
  }
  put(topic, 1 - place, NULL);
  empty(engine, old);
  CHECK(fm_receiver_stop(&before));
  fm_engine_end_handover(engine, t);
  free_subscription(old);
  return receiver;
}

static void disturb(struct fm_engine * engine, struct fm_receiver ** receivers)
{
  uint8_t room[64] = {0};
  const struct fm_origin origin = {0, 0, 0, NULL, false, NULL, 0};
  for (int k = 0; k < N_RENEWALS; ++k) {
    for (uint32_t t = 0; t < N_TOPICS; ++t) {
      receivers[t] = renew(engine, t, 1 - k % 2, receivers[t]);
      fm_engine_reset(engine);
      fm_engine_want_details(engine, k % 2 == 0, 100);
      (void)fm_engine_evidence(engine, t, room, sizeof(room));
      (void)value_of(engine, t, room);
      (void)input_counts_of(engine, t);
      (void)requirement_counts_of(engine, t);
      (void)unpublished_of(engine);
      CHECK(fm_engine_message(engine, t, room, 1, &origin) == FM_UNDECODABLE);
    }
  }
}

// Reads a small ring, which is overwritten meanwhile: what is whole must be right.
static void * read_kept(void * box)
{
  uint64_t place = 0;
  while (!__atomic_load_n(&is_over, __ATOMIC_ACQUIRE)) {
    struct { struct fm_kept kept; uint8_t data[MESSAGE]; } found;
    uint64_t begin;
    const uint64_t n =
      fm_blackbox_copy(box, place, (uint8_t *)&found, sizeof(found.kept) + MESSAGE, &begin);
    if (n >= sizeof(found.kept)) {
      CHECK(found.kept.topic < N_TOPICS && found.kept.size > 0 && found.kept.size <= MESSAGE);
      place += sizeof(found.kept) + found.kept.size;
    } else if (place < begin) {
      place = begin;
    } else {
      (void)fm_blackbox_take_occurrences(box);
    }
  }
  return NULL;
}

static void check_counts(struct fm_engine * engine)
{
  uint64_t garbage = 0;
  uint64_t useless = 0;
  uint64_t bad = 0;
  for (int k = 0; k < N_MESSAGES; ++k) {
    garbage += k % 100 == 7;
    useless += k % 100 != 7 && k % 50 == 9;
    bad += k % 100 != 7 && k % 50 != 9 && k % 3 == 0;
  }
  const uint64_t senders = N_SENDERS / N_TOPICS;
  for (uint32_t t = 0; t < N_TOPICS; ++t) {
    const struct fm_topic_counts counts = topic_counts_of(engine, t);
    const struct fm_requirement_counts violated = requirement_counts_of(engine, t);
    CHECK(counts.undecodable == senders * garbage + N_RENEWALS);
    CHECK(counts.messages == senders * (N_MESSAGES - garbage));
    CHECK(input_counts_of(engine, t).unusable == senders * useless);
    CHECK(violated.violations >= senders * bad);
    CHECK(violated.violations <= senders * (bad + useless));
    CHECK(violated.announced == violated.violations);
    CHECK(published[t] == violated.announced);
    CHECK(fm_engine_lost(engine, t) == 0);
  }
}

int main(void)
{
  const struct fm_evaluator_options options = {
    .monitor = &monitor, .topics = fed, .n_topics = N_TOPICS, .policy = FM_RELEVANT_MESSAGE};
  struct fm_engine * engine = create_engine(&options, &readers, -1);
  void * publishers[] = {(void *)(uintptr_t)&numbers[0], (void *)(uintptr_t)&numbers[1]};
  struct fm_blackbox * box = fm_blackbox_create(1000, 0);
  CHECK(box != NULL);
  fm_engine_keep_messages(engine, box);
  struct fm_announcer * announcer = NULL;
  CHECK(fm_announcer_start(&announcer, engine, &middleware, publishers, 2, NULL, 0, NULL));
  struct fm_receiver * receivers[N_TOPICS] = {NULL};
  for (uint32_t t = 0; t < N_TOPICS; ++t) {
    pthread_mutex_init(&topics[t].mutex, NULL);
    topics[t].subscriptions[0] = make_subscription();
    CHECK(
      fm_receiver_start(
        &receivers[t], engine, &middleware, topics[t].subscriptions[0], t, FM_LISTEN, NULL));
  }
  pthread_t senders[N_SENDERS];
  pthread_t details;
  pthread_t kept;
  pthread_create(&details, NULL, read_details, engine);
  pthread_create(&kept, NULL, read_kept, box);
  for (int k = 0; k < N_SENDERS; ++k) {
    pthread_create(&senders[k], NULL, send, &topics[k % N_TOPICS]);
  }
  disturb(engine, receivers);
  for (int k = 0; k < N_SENDERS; ++k) {
    pthread_join(senders[k], NULL);
  }
  for (uint32_t t = 0; t < N_TOPICS; ++t) {
    empty(engine, topics[t].subscriptions[N_RENEWALS % 2]);
    CHECK(fm_receiver_stop(&receivers[t]));
    free_subscription(topics[t].subscriptions[N_RENEWALS % 2]);
  }
  fm_engine_close(engine);
  fm_announcer_join(&announcer);
  __atomic_store_n(&is_over, true, __ATOMIC_RELEASE);
  pthread_join(details, NULL);
  pthread_join(kept, NULL);
  CHECK(refused > 0 && unpublished_of(engine) == refused);
  check_counts(engine);
  CHECK(fm_blackbox_count(box).kept == N_SENDERS * N_MESSAGES + N_TOPICS * N_RENEWALS);
  destroy_engine(engine);
  fm_blackbox_destroy(box);
  return failures == 0 ? 0 : 1;
}
