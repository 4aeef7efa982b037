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

/// A relay between a middleware that sends from several threads, and a publisher that is slow.

#define _POSIX_C_SOURCE 200809L

#include "receiver.h"
#include "relay.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "check.h"
#include "engines.h"
#include "seen.h"
#include "fakes.h"

#define LEVEL 0u
#define FLAG 1u
#define LIMIT 100
#define MOST_PUBLISHED 100000u
#define MESSAGE_BYTES 16u

// ---- a middleware: a message is a level, and its number ----------------------------------------

struct subscription
{
  pthread_mutex_t mutex;   // as the middleware's own
  uint64_t first;
  uint64_t sent;
  uint64_t taken;
  fm_on_message callback;
  const void * user_data;
  bool has_no_callbacks;
  bool keeps_callback;     // it does not remove its callback
};

static int listen(void * subscription, fm_on_message callback, const void * user_data)
{
  struct subscription * self = subscription;
  if (self->has_no_callbacks || (callback == NULL && self->keeps_callback)) {
    return 1;
  }
  pthread_mutex_lock(&self->mutex);
  self->callback = callback;
  self->user_data = user_data;
  pthread_mutex_unlock(&self->mutex);
  return 0;
}

static void write_message(uint8_t * bytes, uint32_t level, uint64_t number)
{
  memset(bytes, 0, MESSAGE_BYTES);
  bytes[1] = 1;
  bytes[4] = (uint8_t)level;
  memcpy(bytes + 8, &number, sizeof(number));
}

static void * grow(struct fm_serialized * message)
{
  if (message->capacity < MESSAGE_BYTES) {
    message->buffer = message->allocator.reallocate(
      message->buffer, MESSAGE_BYTES, message->allocator.state);
    message->capacity = MESSAGE_BYTES;
  }
  return message->buffer;
}

static uint32_t level_of(uint64_t number) {return (uint32_t)(number * 7 % 128);}

static int take(
  const void * subscription, struct fm_serialized * message, bool * taken,
  struct fm_message_info * info, void * allocation)
{
  struct subscription * self = (struct subscription *)(uintptr_t)subscription;
  static const uint8_t gid[16] = {1};
  (void)allocation;
  memset(info, 0, sizeof(struct fm_padded_info));
  pthread_mutex_lock(&self->mutex);
  *taken = self->taken < self->sent;
  if (*taken) {
    self->taken += 1;
    info->publication_sequence_number = self->first + self->taken;
    memcpy(info->gid, gid, sizeof(gid));
    write_message(
      grow(message), level_of(info->publication_sequence_number),
      info->publication_sequence_number);
    message->length = MESSAGE_BYTES;
  }
  pthread_mutex_unlock(&self->mutex);
  return 0;
}

static void send(struct subscription * self, uint64_t count)
{
  pthread_mutex_lock(&self->mutex);
  self->sent += count;
  if (self->callback != NULL) {
    self->callback(self->user_data, (size_t)count);
  }
  pthread_mutex_unlock(&self->mutex);
}

static uint64_t left(struct subscription * self)
{
  pthread_mutex_lock(&self->mutex);
  const uint64_t n = self->sent - self->taken;
  pthread_mutex_unlock(&self->mutex);
  return n;
}

static void make_subscription(struct subscription * self, uint64_t first)
{
  memset(self, 0, sizeof(*self));
  self->first = first;
  pthread_mutexattr_t kind;
  pthread_mutexattr_init(&kind);
  pthread_mutexattr_settype(&kind, PTHREAD_MUTEX_RECURSIVE);  // a receiver's callback takes
  pthread_mutex_init(&self->mutex, &kind);
  pthread_mutexattr_destroy(&kind);
}

static const struct fm_middleware middleware = FAKE_MIDDLEWARE(take, listen, NULL);

struct publisher
{
  pthread_mutex_t mutex;
  uint64_t numbers[MOST_PUBLISHED];
  uint32_t levels[MOST_PUBLISHED];
  int64_t times[MOST_PUBLISHED];
  uint32_t n;
  int64_t delay;   // ns
  bool fails;
  bool has_stamps; // a stamp was filled in
};

static int64_t steady(void)
{
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (int64_t)now.tv_sec * 1000000000 + (int64_t)now.tv_nsec;
}

static void pause_ns(int64_t nanoseconds)
{
  const struct timespec time = {
    (time_t)(nanoseconds / 1000000000), (long)(nanoseconds % 1000000000)};
  nanosleep(&time, NULL);
}

static int publish(const void * publisher, const struct fm_serialized * message, void * allocation)
{
  struct publisher * self = (struct publisher *)(uintptr_t)publisher;
  (void)allocation;
  if (self->delay > 0) {
    pause_ns(self->delay);
  }
  pthread_mutex_lock(&self->mutex);
  const bool fails = self->fails;
  if (!fails && self->n < MOST_PUBLISHED) {
    memcpy(&self->numbers[self->n], message->buffer + 8, 8);
    self->levels[self->n] = message->buffer[4];
    self->times[self->n] = steady();
    self->n += 1;
  }
  pthread_mutex_unlock(&self->mutex);
  return fails ? 1 : 0;
}

static uint32_t published(struct publisher * self)
{
  pthread_mutex_lock(&self->mutex);
  const uint32_t n = self->n;
  pthread_mutex_unlock(&self->mutex);
  return n;
}

static struct publisher publishers[2];

// ---- a monitor: level < LIMIT, and flag --------------------------------------------------------

struct inputs {uint8_t level; bool flag;};

static void reset(void * state) {(void)state;}

static void step(void * state, const void * inputs, bool * verdicts)
{
  const struct inputs * in = inputs;
  (void)state;
  verdicts[0] = in->level < LIMIT && in->flag;
}

static const struct fm_input inputs[] = {
  {"level", (uint32_t)offsetof(struct inputs, level), FM_UINT8},
  {"flag", (uint32_t)offsetof(struct inputs, flag), FM_BOOL}};
static const uint32_t indices[] = {0, 1};
static const struct fm_group groups[] = {{indices, 2, indices, 1, reset, step, NULL}};
static const struct fm_requirement requirements[] = {{"R", 0}};
static const struct fm_monitor monitor = {
  FM_ABI, 2, 1, 1, 8, sizeof(struct inputs), inputs, groups, requirements, "m", "", NULL, NULL, 0,
  NULL};
static const struct fm_topic topics[] = {{indices, 1}, {indices + 1, 1}};

static bool read_level(const uint8_t * message, size_t size, struct fm_field * fields)
{
  fields[0] = (struct fm_field) {{.u = size > 4 ? message[4] : 0u}, FM_FIELD_READ, 0};
  return size > 4;
}

static const struct fm_reader reader[] = {
  {.read = read_level, .n_inputs = 1},
  {.read = read_level, .n_inputs = 1}};
static const struct fm_readers readers = {FM_ABI, 2, reader};

// ---- a gate ------------------------------------------------------------------------------------

struct bench
{
  void * gate_memory;
  struct fm_engine * engine;
  struct fm_relay * relay;
};

static void give_flag(struct fm_engine * engine, bool flag)
{
  const struct fm_origin origin = {0, 0, 0, NULL, false, NULL, 0};
  uint8_t message[MESSAGE_BYTES];
  write_message(message, flag ? 1u : 0u, 0);
  (void)fm_engine_message(engine, FLAG, message, sizeof(message), &origin);
}

static struct bench begin(enum fm_otherwise otherwise, int64_t period)
{
  struct bench bench = {NULL, NULL, NULL};
  uint8_t substitute[MESSAGE_BYTES];
  const struct fm_evaluator_options evaluator = {
    .monitor = &monitor, .topics = topics, .n_topics = 2, .policy = FM_EVERY_MESSAGE,
    .reports_recoveries = true};
  bench.engine = create_engine(&evaluator, &readers, -1);
  const struct fm_gate_options rules = {
    bench.engine->options.evaluator, &monitor, topics, 2, LEVEL, (uint32_t)otherwise, 1000000000,
    period, false, false, 0};
  bench.gate_memory = malloc((size_t)fm_gate_bytes(&rules));
  fm_engine_guard(bench.engine, fm_gate_init(bench.gate_memory, &rules), &rules);
  fm_engine_follow_steady(bench.engine);
  fm_engine_begin(bench.engine);
  for (uint32_t k = 0; k < 2; ++k) {
    memset(&publishers[k], 0, sizeof(publishers[k]));
    pthread_mutex_init(&publishers[k].mutex, NULL);
  }
  write_message(substitute, 0, 12345);
  const struct fm_relay_options relay = {
    bench.engine, &middleware, publish, &publishers[0], substitute, sizeof(substitute),
    otherwise == FM_HOLD, -1};
  CHECK(fm_relay_start(&bench.relay, &relay));
  return bench;
}

static void end(struct bench * bench)
{
  fm_relay_join(&bench->relay);
  fm_engine_close(bench->engine);
  destroy_engine(bench->engine);
  free(bench->gate_memory);
}

static bool wait_for(struct publisher * publisher, uint32_t n)
{
  for (int k = 0; k < 5000 && published(publisher) < n; ++k) {
    pause_ns(1000000);
  }
  return published(publisher) >= n;
}

// ---- the tests ---------------------------------------------------------------------------------

#define FLOOD 6000u  // half of it in a handover, which knows 4096 messages

static struct subscription flooded[2];

static void * flood(void * argument)
{
  (void)argument;
  for (uint32_t k = 0; k < FLOOD; k += 10) {
    send(&flooded[0], 10);
    if (k >= FLOOD / 2) {
      send(&flooded[1], 10);  // the new subscription gets the same messages
    }
  }
  return NULL;
}

static void * keep_flag(void * argument)
{
  for (int k = 0; k < 2000; ++k) {
    give_flag(argument, true);
  }
  return NULL;
}

static void a_flood_passes_in_order_through_a_handover(void)
{
  struct bench bench = begin(FM_DROP, 0);
  pthread_t sender;
  pthread_t other;
  make_subscription(&flooded[0], 0);
  make_subscription(&flooded[1], FLOOD / 2);
  give_flag(bench.engine, true);
  CHECK(fm_relay_add(bench.relay, &flooded[0]));
  pthread_create(&sender, NULL, flood, NULL);
  pthread_create(&other, NULL, keep_flag, bench.engine);
  pause_ns(1000000);
  fm_engine_begin_handover(bench.engine, LEVEL, false);
  fm_relay_retire(bench.relay, &flooded[0]);
  CHECK(fm_relay_add(bench.relay, &flooded[1]));
  fm_relay_publish_with(bench.relay, &publishers[1]);
  const uint32_t before = published(&publishers[0]);
  pthread_join(sender, NULL);
  pthread_join(other, NULL);
  for (int k = 0; k < 5000 && left(&flooded[0]) + left(&flooded[1]) > 0; ++k) {
    pause_ns(1000000);
  }
  CHECK(fm_relay_remove(bench.relay, &flooded[0]));
  CHECK(fm_relay_remove(bench.relay, &flooded[1]));
  CHECK(published(&publishers[0]) == before);
  const struct fm_gate_counts counts = gate_counts_of(bench.engine);
  CHECK(counts.passed == before + published(&publishers[1]));
  CHECK(counts.passed + counts.violates >= FLOOD / 2 && counts.closed == 0);
  uint64_t last = 0;
  bool is_in_order = true;
  bool is_good = true;
  for (uint32_t k = 0; k < before + publishers[1].n; ++k) {
    const struct publisher * from = &publishers[k < before ? 0 : 1];
    const uint32_t place = k < before ? k : k - before;
    is_in_order = is_in_order && from->numbers[place] > last;
    is_good = is_good && from->levels[place] < LIMIT;
    last = from->numbers[place];
  }
  CHECK(is_good);
  CHECK(is_in_order);
  end(&bench);
}

// The new one may get its messages before; what it has is no history for the old one.
static void a_subscription_that_is_replaced_delivers_what_it_has_late(void)
{
  struct bench bench = begin(FM_DROP, 0);
  struct subscription before;
  struct subscription after;
  make_subscription(&before, 0);
  make_subscription(&after, 2);
  give_flag(bench.engine, true);
  CHECK(fm_relay_add(bench.relay, &before));
  send(&before, 1);
  CHECK(wait_for(&publishers[0], 1));
  fm_engine_begin_handover(bench.engine, LEVEL, true);
  fm_relay_retire(bench.relay, &before);
  CHECK(fm_relay_add(bench.relay, &after));
  send(&after, 1);
  CHECK(wait_for(&publishers[0], 2));
  send(&before, 1);
  CHECK(wait_for(&publishers[0], 3));
  CHECK(publishers[0].numbers[1] == 3 && publishers[0].numbers[2] == 2);
  CHECK(fm_relay_remove(bench.relay, &before));
  CHECK(fm_relay_remove(bench.relay, &after));
  end(&bench);
}

static void nothing_is_lost_or_repeated_without_a_handover(void)
{
  struct bench bench = begin(FM_DROP, 0);
  struct subscription subscription;
  uint64_t expected = 0;
  bool are_equal = true;
  make_subscription(&subscription, 0);
  give_flag(bench.engine, true);
  CHECK(fm_relay_add(bench.relay, &subscription));
  for (uint32_t k = 0; k < 500; ++k) {
    send(&subscription, 3);
  }
  CHECK(wait_for(&publishers[0], 1100));
  CHECK(fm_relay_remove(bench.relay, &subscription));
  for (uint32_t k = 0; k < publishers[0].n; ++k) {
    do {
      expected += 1;
    } while (level_of(expected) >= LIMIT);
    are_equal = are_equal && publishers[0].numbers[k] == expected;
  }
  CHECK(are_equal);
  CHECK(gate_counts_of(bench.engine).passed == publishers[0].n);
  CHECK(gate_counts_of(bench.engine).passed +
    gate_counts_of(bench.engine).violates == 1500);
  end(&bench);
}

// Up to a thousand messages, however many were taken before.
static void what_waits_in_a_subscription_that_is_removed_is_taken(void)
{
  struct bench bench = begin(FM_DROP, 0);
  struct subscription subscription;
  make_subscription(&subscription, 0);
  give_flag(bench.engine, true);
  CHECK(fm_relay_add(bench.relay, &subscription));
  send(&subscription, 900);
  for (int k = 0; k < 5000 && left(&subscription) > 0; ++k) {
    pause_ns(1000000);
  }
  pthread_mutex_lock(&subscription.mutex);
  subscription.sent += 500;  // the relay does not know of them
  pthread_mutex_unlock(&subscription.mutex);
  CHECK(fm_relay_remove(bench.relay, &subscription));
  CHECK(left(&subscription) == 0);
  end(&bench);
}

static void substitutes_come_from_the_start_and_when_another_topic_violates(void)
{
  const int64_t period = 20000000;
  struct subscription subscription;
  struct bench bench = begin(FM_SUBSTITUTE, period);
  CHECK(wait_for(&publishers[0], 3));
  CHECK(publishers[0].numbers[0] == 12345);
  CHECK(publishers[0].times[2] - publishers[0].times[0] > period);
  make_subscription(&subscription, 0);
  give_flag(bench.engine, true);
  CHECK(fm_relay_add(bench.relay, &subscription));
  send(&subscription, 1);  // level 7 passes, and ends the substitutes
  pause_ns(3 * period);
  const uint32_t n = published(&publishers[0]);
  CHECK(publishers[0].numbers[n - 1] == 1);
  give_flag(bench.engine, false);
  CHECK(wait_for(&publishers[0], n + 2));
  CHECK(publishers[0].numbers[n] == 12345);
  CHECK(fm_relay_remove(bench.relay, &subscription));
  CHECK(gate_counts_of(bench.engine).violating > 0);
  end(&bench);
}

static void a_middleware_without_callbacks_is_refused(void)
{
  struct subscription subscription;
  struct bench bench = begin(FM_DROP, 0);
  make_subscription(&subscription, 0);
  subscription.has_no_callbacks = true;
  CHECK(!fm_relay_add(bench.relay, &subscription));
  CHECK(fm_relay_remove(bench.relay, &subscription));
  end(&bench);
}

static void there_is_room_for_eight_subscriptions(void)
{
  static struct subscription subscriptions[FM_MOST_SOURCES + 1];
  struct bench bench = begin(FM_DROP, 0);
  for (uint32_t k = 0; k <= FM_MOST_SOURCES; ++k) {
    make_subscription(&subscriptions[k], 0);
    CHECK(fm_relay_add(bench.relay, &subscriptions[k]) == (k < FM_MOST_SOURCES));
  }
  for (uint32_t k = 0; k < FM_MOST_SOURCES; ++k) {
    CHECK(fm_relay_remove(bench.relay, &subscriptions[k]));
  }
  end(&bench);
}

static void a_failing_publisher_is_counted(void)
{
  struct subscription subscription;
  struct bench bench = begin(FM_HOLD, 0);
  make_subscription(&subscription, 13);
  give_flag(bench.engine, true);
  CHECK(fm_relay_add(bench.relay, &subscription));
  send(&subscription, 2);  // levels 98 and 105
  CHECK(wait_for(&publishers[0], 2));
  CHECK(publishers[0].levels[0] == 98 && publishers[0].levels[1] == 98);
  CHECK(gate_counts_of(bench.engine).replaced == 1);
  pthread_mutex_lock(&publishers[0].mutex);
  publishers[0].fails = true;
  pthread_mutex_unlock(&publishers[0].mutex);
  send(&subscription, 3);
  CHECK(fm_relay_remove(bench.relay, &subscription));
  CHECK(fm_relay_unpublished(bench.relay) > 0);
  CHECK(fm_relay_turns(bench.relay) > 2);
  end(&bench);
}

static void it_ends_while_publishing_blocks(void)
{
  struct subscription subscription;
  struct bench bench = begin(FM_DROP, 0);
  make_subscription(&subscription, 0);
  publishers[0].delay = 100000000;
  give_flag(bench.engine, true);
  CHECK(fm_relay_add(bench.relay, &subscription));
  send(&subscription, 100);
  pause_ns(20000000);
  const int64_t began = steady();
  fm_relay_end(bench.relay);
  CHECK(steady() - began < 1000000000);
  CHECK(published(&publishers[0]) == 1);  // the one that was being published
  send(&subscription, 1);                 // its callback does no harm
  CHECK(fm_relay_remove(bench.relay, &subscription));
  end(&bench);
}

static void another_publisher_has_all_after_the_message_that_is_being_published(void)
{
  struct subscription subscription;
  struct bench bench = begin(FM_DROP, 0);
  make_subscription(&subscription, 0);
  publishers[0].delay = 50000000;
  give_flag(bench.engine, true);
  CHECK(fm_relay_add(bench.relay, &subscription));
  send(&subscription, 100);
  while (left(&subscription) == 100) {
    pause_ns(1000000);
  }
  fm_relay_publish_with(bench.relay, &publishers[1]);
  const uint32_t before = published(&publishers[0]);
  CHECK(wait_for(&publishers[1], 50));
  CHECK(published(&publishers[0]) == before);
  CHECK(fm_relay_remove(bench.relay, &subscription));
  end(&bench);
}

static void a_callback_that_cannot_be_removed_outlives_the_relay(void)
{
  static struct subscription subscription;  // the middleware's: it refers to the relay's memory
  struct bench bench = begin(FM_DROP, 0);
  make_subscription(&subscription, 13);
  subscription.keeps_callback = true;
  give_flag(bench.engine, true);
  CHECK(fm_relay_add(bench.relay, &subscription));
  send(&subscription, 1);
  CHECK(wait_for(&publishers[0], 1));
  CHECK(!fm_relay_remove(bench.relay, &subscription));
  send(&subscription, 1);
  end(&bench);
  send(&subscription, 1);
  CHECK(left(&subscription) == 2);
}

static void a_message_is_judged_after_what_was_received_before_it(void)
{
  struct bench bench = begin(FM_DROP, 0);
  struct fm_receiver * receiver = NULL;
  static struct subscription flag;
  static struct subscription level;
  make_subscription(&flag, 126);  // 127 is true, 128 is false
  make_subscription(&level, 0);
  CHECK(fm_receiver_start(&receiver, bench.engine, &middleware, &flag, FLAG, FM_LISTEN, NULL));
  CHECK(fm_relay_add(bench.relay, &level));
  send(&flag, 1);
  send(&level, 1);
  CHECK(wait_for(&publishers[0], 1));
  pthread_mutex_lock(&flag.mutex);
  flag.sent += 1;  // its callback is still to come
  pthread_mutex_unlock(&flag.mutex);
  send(&level, 1);
  for (int k = 0; k < 1000 && (left(&level) > 0 || left(&flag) > 0); ++k) {
    pause_ns(1000000);
  }
  struct fm_gate_counts counts = gate_counts_of(bench.engine);
  for (int k = 0; k < 1000 && counts.passed + counts.violates < 2; ++k) {
    pause_ns(1000000);
    counts = gate_counts_of(bench.engine);
  }
  CHECK(counts.passed == 1 && counts.violates == 1 && published(&publishers[0]) == 1);
  CHECK(fm_receiver_stop(&receiver));
  end(&bench);
}

int main(void)
{
  a_message_is_judged_after_what_was_received_before_it();
  nothing_is_lost_or_repeated_without_a_handover();
  what_waits_in_a_subscription_that_is_removed_is_taken();
  a_flood_passes_in_order_through_a_handover();
  a_subscription_that_is_replaced_delivers_what_it_has_late();
  substitutes_come_from_the_start_and_when_another_topic_violates();
  a_failing_publisher_is_counted();
  a_middleware_without_callbacks_is_refused();
  there_is_room_for_eight_subscriptions();
  it_ends_while_publishing_blocks();
  another_publisher_has_all_after_the_message_that_is_being_published();
  a_callback_that_cannot_be_removed_outlives_the_relay();
  return failures > 0;
}
