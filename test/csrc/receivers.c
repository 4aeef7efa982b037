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

/// A receiver with a long queue, and a middleware that does not remove its callback.

#include "receiver.h"

#include <stdio.h>
#include <string.h>

#include "check.h"
#include "engines.h"
#include "fakes.h"
#include "engine_locked.h"
#include "seen.h"

// ---- a middleware with one subscription --------------------------------------------------------

struct subscription
{
  struct listener listener;
  uint64_t sent;
  uint64_t taken;
  uint64_t late;  // messages that come just after a take has found none
  uint64_t garbled;  // the next messages, without a header: the middleware drops them
};

static bool is_error_set = false;

static void forget_error_of_drop(void) {is_error_set = false;}
static bool has_error_of_drop(void) {return is_error_set;}

static void send(struct subscription * subscription, uint64_t count);

static int refuse(void * subscription, fm_on_message callback, const void * user_data)
{
  (void)subscription;
  (void)callback;
  (void)user_data;
  return 1;
}

static int take(
  const void * subscription, struct fm_serialized * message, bool * taken,
  struct fm_message_info * info, void * allocation)
{
  struct subscription * self = (struct subscription *)(uintptr_t)subscription;
  (void)message;
  (void)allocation;
  // A later version of the middleware may write the padding.
  memset(info, 0, sizeof(struct fm_padded_info));
  if (self->garbled > 0 && self->taken < self->sent) {
    self->garbled -= 1;
    self->taken += 1;
    is_error_set = true;
    return 0;
  }
  *taken = self->taken < self->sent;
  self->taken += *taken ? 1u : 0u;
  info->publication_sequence_number = self->taken;
  if (!*taken && self->late > 0) {
    const uint64_t before = self->taken;
    self->late -= 1;
    send(self, 1);
    CHECK(self->taken == before);  // the callback leaves it to the drain
  }
  return 0;
}

static const struct fm_middleware middleware =
  FAKE_MIDDLEWARE(take, set_listener, publish_nothing);

static void send(struct subscription * subscription, uint64_t count)
{
  subscription->sent += count;
  notify(&subscription->listener, (size_t)count);
}

// ---- an engine that counts ---------------------------------------------------------------------

static const struct fm_monitor monitor = {
  FM_ABI, 0, 0, 0, 8, 8, NULL, NULL, NULL, "m", "", NULL, NULL, 0, NULL};
static const struct fm_topic topics[] = {{NULL, 0}};

static bool read_message(const uint8_t * message, size_t size, struct fm_field * fields)
{
  (void)message;
  (void)size;
  (void)fields;
  return true;
}

static const struct fm_reader reader[] = {{.read = read_message, .n_inputs = 0}};
static const struct fm_readers readers = {FM_ABI, 1, reader};

static struct fm_engine * make_engine(void)
{
  const struct fm_evaluator_options evaluator = {
    .monitor = &monitor, .topics = topics, .n_topics = 1, .policy = FM_EVERY_MESSAGE};
  return create_engine(&evaluator, &readers, -1);
}

static uint64_t received(struct fm_engine * engine)
{
  return topic_counts_of(engine, 0).messages;
}

static void a_callback_takes_a_bounded_number_and_nothing_is_left(void)
{
  struct subscription subscription = {{NULL, NULL, false}, 0, 0, 0, 0};
  struct fm_engine * engine = make_engine();
  struct fm_receiver * receiver = NULL;
  CHECK(fm_receiver_start(&receiver, engine, &middleware, &subscription, 0, FM_LISTEN, NULL));
  send(&subscription, 2500);
  const uint64_t most = received(engine);
  CHECK(most == 1000);
  send(&subscription, 1);
  CHECK(received(engine) == most + 1);
  fm_engine_catch_up(engine);
  CHECK(received(engine) == 2 * most + 1);
  send(&subscription, 1);  // left: older ones wait
  CHECK(received(engine) == 2 * most + 1);
  fm_engine_catch_up(engine);
  CHECK(received(engine) == 2502);
  send(&subscription, 1);
  CHECK(received(engine) == 2503);
  CHECK(fm_receiver_stop(&receiver));
  CHECK(fm_engine_lost(engine, 0) == 0);
  destroy_engine(engine);
}

static void a_drain_delivers_all_that_waits(void)
{
  struct subscription subscription = {{NULL, NULL, false}, 2500, 0, 0, 0};
  struct fm_engine * engine = make_engine();
  struct fm_receiver * receiver = NULL;
  CHECK(fm_receiver_start(&receiver, engine, &middleware, &subscription, 0, FM_LISTEN, NULL));
  CHECK(received(engine) == 1000);
  fm_engine_drain(engine);
  CHECK(received(engine) == 2500);
  CHECK(fm_receiver_stop(&receiver));
  destroy_engine(engine);
}

// The callback comes while a drain takes, so it leaves its message to the drain.
static void a_message_that_comes_during_a_drain_is_taken_by_it(void)
{
  struct subscription subscription = {{NULL, NULL, false}, 1, 0, 2, 0};
  struct fm_engine * engine = make_engine();
  struct fm_receiver * receiver = NULL;
  CHECK(fm_receiver_start(&receiver, engine, &middleware, &subscription, 0, FM_LISTEN, NULL));
  CHECK(received(engine) == 3);
  subscription.late = 1;
  fm_engine_drain(engine);
  CHECK(received(engine) == 4);
  send(&subscription, 1);
  CHECK(received(engine) == 5);  // the callback takes again
  CHECK(fm_receiver_stop(&receiver));
  destroy_engine(engine);
}

static void a_callback_that_is_not_forgotten_does_no_harm(void)
{
  struct subscription subscription = {{NULL, NULL, true}, 0, 0, 0, 0};
  struct fm_engine * engine = make_engine();
  struct fm_receiver * receiver = NULL;
  CHECK(fm_receiver_start(&receiver, engine, &middleware, &subscription, 0, FM_LISTEN, NULL));
  send(&subscription, 1);
  CHECK(!fm_receiver_stop(&receiver));
  send(&subscription, 1);
  CHECK(received(engine) == 1);
  subscription.listener.keeps_callback = false;  // so that the test can end
  CHECK(fm_receiver_stop(&receiver));
  destroy_engine(engine);
}

// Where the callback must not take, nothing is taken within it.
static void a_callback_that_only_wakes_leaves_its_messages_to_the_thread_that_catches_up(void)
{
  struct subscription subscription = {{NULL, NULL, false}, 2, 0, 0, 0};
  struct fm_engine * engine = make_engine();
  struct fm_receiver * receiver = NULL;
  struct fm_violation none;
  CHECK(fm_receiver_start(&receiver, engine, &middleware, &subscription, 0, FM_WAKE, NULL));
  CHECK(received(engine) == 2);
  for (uint64_t k = 0; k < 3; ++k) {
    send(&subscription, 1);
    CHECK(subscription.taken == 2 + k);
    CHECK(fm_engine_take(engine, &none, 1, 0) == 0);
    CHECK(received(engine) == 3 + k);
  }
  send(&subscription, 2500);
  fm_engine_drain(engine);
  CHECK(received(engine) == 2505);
  CHECK(fm_receiver_stop(&receiver));
  CHECK(fm_engine_lost(engine, 0) == 0);
  destroy_engine(engine);
}

static void what_the_middleware_drops_is_undecodable_and_not_lost(uint32_t taking)
{
  struct subscription subscription = {{NULL, NULL, false}, 1, 0, 0, 0};
  struct fm_engine * engine = make_engine();
  struct fm_middleware drops = middleware;
  struct fm_receiver * receiver = NULL;
  struct fm_violation none;
  drops.has_error = has_error_of_drop;
  drops.forget_error = forget_error_of_drop;
  CHECK(fm_receiver_start(&receiver, engine, &drops, &subscription, 0, taking, NULL));
  for (uint64_t k = 1; k < 4; ++k) {
    subscription.garbled = 2;
    send(&subscription, 2);
    CHECK(fm_engine_take(engine, &none, 1, 0) == 0);
    CHECK(topic_counts_of(engine, 0).undecodable == 2 * k);
    send(&subscription, 1);
    CHECK(fm_engine_take(engine, &none, 1, 0) == 0);
    CHECK(received(engine) == 1 + k && fm_engine_lost(engine, 0) == 0);
  }
  fm_receiver_retire(receiver);
  subscription.garbled = 1;
  send(&subscription, 1);
  fm_engine_drain(engine);
  CHECK(topic_counts_of(engine, 0).undecodable == 6);
  CHECK(fm_receiver_stop(&receiver));
  destroy_engine(engine);
}

static void a_middleware_without_a_callback_is_refused(void)
{
  struct subscription subscription = {{NULL, NULL, false}, 0, 0, 0, 0};
  struct fm_engine * engine = make_engine();
  struct fm_middleware without = middleware;
  struct fm_receiver * receiver = NULL;
  without.listen = refuse;
  CHECK(!fm_receiver_start(&receiver, engine, &without, &subscription, 0, FM_WAKE, NULL));
  CHECK(!fm_receiver_start(&receiver, engine, &without, &subscription, 0, FM_LISTEN, NULL));
  CHECK(receiver == NULL);
  destroy_engine(engine);
}

int main(void)
{
  a_callback_takes_a_bounded_number_and_nothing_is_left();
  a_drain_delivers_all_that_waits();
  a_message_that_comes_during_a_drain_is_taken_by_it();
  a_callback_that_is_not_forgotten_does_no_harm();
  a_callback_that_only_wakes_leaves_its_messages_to_the_thread_that_catches_up();
  what_the_middleware_drops_is_undecodable_and_not_lost(FM_LISTEN);
  what_the_middleware_drops_is_undecodable_and_not_lost(FM_WAKE);
  a_middleware_without_a_callback_is_refused();
  return failures == 0 ? 0 : 1;
}
