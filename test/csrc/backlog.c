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

/// Messages that wait in the middleware's queues: nothing is due before them, they count from
/// their reception, and callbacks that take too long leave them.
///
/// ANSWER reads x and y: x -> y within WINDOW. FED reads y, which has a timeout.

#define _POSIX_C_SOURCE 200809L

#include "receiver.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "check.h"
#include "seen.h"
#include "engines.h"
#include "fakes.h"
#include "engine_locked.h"

enum { X, Y, N_TOPICS };
enum { ANSWER, FED, N_REQUIREMENTS };
enum { MOST = 30000, MOST_AT_ONCE = 1000 };
enum { MESSAGE_BYTES = 1 + sizeof(int64_t) };  // the value, then the stamp of its header

#define MS ((int64_t)1000000)
#define WINDOW (50 * MS)
#define TIMEOUT (100 * MS)

static int64_t set_by = 0;  // somebody has set the system time
static void (* meanwhile)(void) = NULL;  // called once, after the system time was read

static int64_t time_of(clockid_t clock)
{
  struct timespec now;
  clock_gettime(clock, &now);
  return (int64_t)now.tv_sec * 1000 * MS + (int64_t)now.tv_nsec;
}

static int64_t system_now(void) {return time_of(CLOCK_REALTIME);}

int __real_clock_gettime(clockid_t clock, struct timespec * now);
int __wrap_clock_gettime(clockid_t clock, struct timespec * now);

int __wrap_clock_gettime(clockid_t clock, struct timespec * now)
{
  const int result = __real_clock_gettime(clock, now);
  if (clock == CLOCK_REALTIME) {
    now->tv_sec += (time_t)(set_by / (1000 * MS));
  }
  if (clock == CLOCK_REALTIME && meanwhile != NULL) {
    void (* const once)(void) = meanwhile;
    meanwhile = NULL;
    once();
  }
  return result;
}

static void sleep_ms(int64_t milliseconds)
{
  const struct timespec span = {(time_t)(milliseconds / 1000), (long)(milliseconds % 1000 * MS)};
  nanosleep(&span, NULL);
}

static void work_ms(int64_t milliseconds)
{
  const int64_t end = time_of(CLOCK_THREAD_CPUTIME_ID) + milliseconds * MS;
  while (time_of(CLOCK_THREAD_CPUTIME_ID) < end) {}
}

// ---- a middleware ------------------------------------------------------------------------------

struct subscription
{
  struct listener listener;
  int64_t received[MOST];
  uint8_t values[MOST];
  uint32_t sent;
  uint32_t taken;
};

static struct subscription subscriptions[N_TOPICS];
static void (* in_take)(void) = NULL;  // called once
static bool is_endless = false;  // X always has another message
static uint32_t is_asked_to_rest = 0;  // atomic: the next to take one of these
static uint32_t n_takes = 0;
static uint32_t set_back_at_take = N_TOPICS;  // of a message of this topic

static int take(
  const void * subscription, struct fm_serialized * message, bool * taken,
  struct fm_message_info * info, void * allocation)
{
  struct subscription * self = (struct subscription *)(uintptr_t)subscription;
  static uint64_t sequence = 0;
  (void)allocation;
  memset(info, 0, sizeof(struct fm_padded_info));
  n_takes += 1;
  if (in_take != NULL) {
    void (* const once)(void) = in_take;
    in_take = NULL;
    once();
  }
  if (set_back_at_take == self - subscriptions) {
    set_by = -3600 * 1000 * MS;
    set_back_at_take = N_TOPICS;
  }
  if (is_endless && self == &subscriptions[X]) {
    self->taken = 0;
    self->sent = 1;
    self->received[0] = system_now();
    if (__atomic_exchange_n(&is_asked_to_rest, 0u, __ATOMIC_SEQ_CST) != 0) {
      sleep_ms(10);
    }
  }
  *taken = self->taken < self->sent;
  if (*taken) {
    if (message->capacity == 0) {
      message->buffer = message->allocator.allocate(MESSAGE_BYTES, NULL);
      message->capacity = MESSAGE_BYTES;
    }
    message->buffer[0] = self->values[self->taken];
    memcpy(&message->buffer[1], &self->received[self->taken], sizeof(self->received[0]));
    message->length = MESSAGE_BYTES;
    info->received_timestamp = self->received[self->taken];
    self->taken += 1;
    sequence += 1;
    info->publication_sequence_number = sequence;
  }
  return 0;
}

static const struct fm_middleware middleware =
  FAKE_MIDDLEWARE(take, set_listener, publish_nothing);

// Receive a message; its callback is still to come.
static void receive(uint32_t topic, uint8_t value, int64_t received)
{
  struct subscription * self = &subscriptions[topic];
  self->values[self->sent] = value;
  self->received[self->sent] = received;
  self->sent += 1;
}

static void call_back(uint32_t topic);

// ---- a monitor ---------------------------------------------------------------------------------

struct inputs
{
  bool x;
  bool y;
};

static int64_t window = WINDOW;
static int64_t cost_ms = 0;  // of reading a message
static bool works = false;   // for so long, and does not only stand still
static int64_t reorder = 0;  // if not 0: stamps of headers count
static bool forbids_x = false;  // under other policies than FM_TIMED, ANSWER is !x

static void reset_answer(void * state) {*(int64_t *)state = -1;}

static int64_t answer_at(void * state, const void * inputs, bool * verdicts, int64_t tick)
{
  int64_t * asked = state;
  const struct inputs * in = inputs;
  *asked = in->y ? -1 : in->x && *asked < 0 ? tick : *asked;
  verdicts[ANSWER] = *asked < 0 || tick - *asked <= window;
  return *asked >= 0 && verdicts[ANSWER] ? *asked + window + 1 : FM_NEVER;
}

static void step_answer(void * state, const void * inputs, bool * verdicts)
{
  (void)state;
  verdicts[ANSWER] = !forbids_x || !((const struct inputs *)inputs)->x;
}

static void reset_fed(void * state) {(void)state;}

static int64_t fed_at(void * state, const void * inputs, bool * verdicts, int64_t tick)
{
  (void)state;
  (void)inputs;
  (void)tick;
  verdicts[FED] = true;
  return FM_NEVER;
}

static void step_fed(void * state, const void * inputs, bool * verdicts)
{
  (void)fed_at(state, inputs, verdicts, 0);
}

static const uint32_t numbers[] = {0, 1};
static const struct fm_input inputs[] = {
  {"x", (uint32_t)offsetof(struct inputs, x), FM_BOOL},
  {"y", (uint32_t)offsetof(struct inputs, y), FM_BOOL}};
static const struct fm_group groups[] = {
  {numbers, 2, &numbers[ANSWER], 1, reset_answer, step_answer, answer_at},
  {&numbers[Y], 1, &numbers[FED], 1, reset_fed, step_fed, fed_at}};
static const struct fm_requirement requirements[] = {{"ANSWER", 0}, {"FED", 1}};
static const struct fm_monitor monitor = {
  FM_ABI, N_TOPICS, 2, N_REQUIREMENTS, sizeof(int64_t), sizeof(struct inputs), inputs, groups,
  requirements, "backlog", "", NULL, NULL, 0, NULL};
static const struct fm_topic topics[] = {{&numbers[X], 1}, {&numbers[Y], 1}};
static uint8_t reports[] = {FM_ONSET, FM_ONSET};
static const bool violates[] = {false, true};

static bool read_message(const uint8_t * message, size_t size, struct fm_field * fields)
{
  (void)size;
  if (works) {
    work_ms(cost_ms);
  } else if (cost_ms > 0) {
    sleep_ms(cost_ms);
  }
  fields[0].value.i = message[0];
  fields[0].outcome = FM_FIELD_READ;
  return true;
}

static bool read_stamp(const uint8_t * message, size_t size, int64_t * stamp)
{
  memcpy(stamp, &message[1], sizeof(*stamp));
  return size == MESSAGE_BYTES;
}

static const struct fm_reader reader[] = {
  {.read = read_message, .n_inputs = 1, .stamp = read_stamp},
  {.read = read_message, .n_inputs = 1, .stamp = read_stamp}};
static const struct fm_readers readers = {FM_ABI, N_TOPICS, reader};

// ---- a bench -----------------------------------------------------------------------------------

static struct fm_receiver * receivers[N_TOPICS];
static struct fm_violation taken[MOST];
static uint32_t n_taken;
static bool begins = true;
static uint32_t taking = FM_LISTEN;
static struct fm_engine * woken = NULL;  // with FM_WAKE: callbacks are followed by a catch up

static struct fm_engine * make(uint32_t policy, int64_t timeout)
{
  const int64_t timeouts[] = {0, timeout};
  const struct fm_evaluator_options evaluator = {
    .monitor = &monitor, .topics = topics, .n_topics = N_TOPICS, .policy = policy,
    .reports = reports, .timeouts = timeouts, .violates = violates};
  struct fm_engine * engine = create_engine(&evaluator, &readers, reorder > 0 ? reorder : -1);
  memset(subscriptions, 0, sizeof(subscriptions));
  n_taken = 0;
  fm_engine_follow_steady(engine);
  for (uint32_t topic = 0; topic < N_TOPICS; ++topic) {
    CHECK(fm_receiver_start(
        &receivers[topic], engine, &middleware, &subscriptions[topic], topic, taking, NULL));
  }
  woken = taking == FM_WAKE ? engine : NULL;
  if (begins) {
    fm_engine_begin(engine);
  }
  return engine;
}

static void destroy(struct fm_engine * engine)
{
  for (uint32_t topic = 0; topic < N_TOPICS; ++topic) {
    CHECK(fm_receiver_stop(&receivers[topic]));
  }
  destroy_engine(engine);
}

static void call_back(uint32_t topic)
{
  notify(&subscriptions[topic].listener, 1);
  if (woken != NULL) {
    fm_engine_catch_up(woken);
  }
}

// Receive a message now, and take it.
static void arrive(uint32_t topic, uint8_t value)
{
  receive(topic, value, system_now());
  call_back(topic);
}

// As the announcer does.
static void announce(struct fm_engine * engine)
{
  n_taken += fm_engine_take(engine, &taken[n_taken], MOST - n_taken, 0);
}

static bool is_taken(uint32_t requirement, int64_t stamp)
{
  for (uint32_t k = 0; k < n_taken; ++k) {
    const int64_t off = taken[k].stamp - stamp;
    if (taken[k].requirement == requirement && off < MS && off > -MS) {
      return true;
    }
  }
  return false;
}

// ---- tests -------------------------------------------------------------------------------------

static void nothing_is_overdue_while_an_answer_waits(void)
{
  struct fm_engine * engine = make(FM_TIMED, 0);
  arrive(Y, false);
  const int64_t asked = system_now();
  receive(X, true, asked);
  call_back(X);
  announce(engine);
  receive(Y, true, asked + WINDOW / 2);  // in time, and its thread does not run
  sleep_ms(2 * WINDOW / MS);
  receive(X, false, system_now());       // nor is another topic's message taken before it
  call_back(X);
  CHECK(subscriptions[X].taken == 1);
  announce(engine);
  CHECK(n_taken == 0 && subscriptions[X].taken == 2 && subscriptions[Y].taken == 2);
  // An answer that is late by its reception is late.
  const int64_t again = system_now();
  receive(X, true, again);
  call_back(X);
  receive(Y, false, again + 1);
  call_back(Y);
  sleep_ms(2 * WINDOW / MS);
  receive(Y, true, again + WINDOW + MS);
  announce(engine);
  CHECK(n_taken == 1 && is_taken(ANSWER, again + WINDOW));
  destroy(engine);
}

static void an_input_is_not_silent_while_its_message_waits(uint32_t policy)
{
  struct fm_engine * engine = make(policy, TIMEOUT);
  const int64_t fed = system_now();
  receive(Y, true, fed);
  call_back(Y);
  announce(engine);
  receive(Y, true, fed + TIMEOUT / 2);  // waits
  receive(X, true, fed + TIMEOUT / 4);
  sleep_ms(3 * TIMEOUT / 2 / MS + 10);
  announce(engine);
  CHECK(n_taken == 2 && silence_of(engine, Y).count == 1);  // ANSWER reads y, too
  CHECK(is_taken(FED, fed + 3 * TIMEOUT / 2) && is_taken(ANSWER, fed + 3 * TIMEOUT / 2));
  destroy(engine);
}

static void a_message_counts_from_its_reception_however_late_it_is(void)
{
  struct fm_engine * engine = make(FM_TIMED, 0);
  const int64_t begun = system_now();
  sleep_ms(1200);
  receive(Y, false, begun + MS);
  receive(X, true, begun + 2 * MS);
  announce(engine);
  CHECK(n_taken == 1 && is_taken(ANSWER, begun + 2 * MS + WINDOW));
  destroy(engine);
}

static void a_message_of_before_the_system_time_was_set_counts_as_well(int64_t seconds)
{
  struct fm_engine * engine = make(FM_TIMED, 0);
  arrive(Y, false);
  const int64_t asked = system_now();
  receive(X, true, asked);
  sleep_ms(WINDOW / 2 / MS);
  set_by = seconds * 1000 * MS;
  fm_engine_drain(engine);
  sleep_ms(2 * WINDOW / MS);
  announce(engine);
  CHECK(n_taken == 1 && is_taken(ANSWER, asked + WINDOW + set_by));
  set_by = 0;
  destroy(engine);
}

// Nothing is taken before the announcer comes, and then in the order of reception.
static void callbacks_that_only_wake_leave_all_in_order(void)
{
  taking = FM_WAKE;
  struct fm_engine * engine = make(FM_TIMED, 0);
  woken = NULL;
  const int64_t asked = system_now() - WINDOW;
  sleep_ms(1);
  receive(Y, false, asked - 2);
  call_back(Y);
  receive(Y, true, asked + WINDOW / 2);
  call_back(Y);
  receive(X, true, asked);
  call_back(X);
  CHECK(subscriptions[X].taken == 0 && subscriptions[Y].taken == 0);
  announce(engine);
  sleep_ms(2 * WINDOW / MS);
  announce(engine);
  CHECK(n_taken == 0 && subscriptions[X].taken == 1 && subscriptions[Y].taken == 2);
  taking = FM_LISTEN;
  destroy(engine);
}

// Whether an answer that is so many nanoseconds late violates, if both messages wait.
static bool is_late_in_a_queue(int64_t late)
{
  window = 0;
  struct fm_engine * engine = make(FM_TIMED, 0);
  sleep_ms(1);
  arrive(Y, false);
  sleep_ms(1);
  const int64_t asked = system_now();
  receive(X, true, asked);
  receive(Y, true, asked + late);
  sleep_ms(1);
  fm_engine_drain(engine);
  announce(engine);
  const bool is_late = n_taken == 1 && taken[0].stamp == asked + 1;
  CHECK(n_taken == (is_late ? 1u : 0u));
  window = WINDOW;
  destroy(engine);
  return is_late;
}

static void an_answer_that_waits_is_late_only_after_the_last_nanosecond(void)
{
  CHECK(!is_late_in_a_queue(0));
  CHECK(!is_late_in_a_queue(1));
  CHECK(is_late_in_a_queue(2));
}

// Two messages of one instant, each of which violates: the stamps, less the instant.
static void find_both(uint32_t policy, bool waits, int64_t * stamps)
{
  struct fm_engine * engine = make(policy, 0);
  woken = NULL;
  sleep_ms(1);
  receive(Y, false, system_now());
  fm_engine_drain(engine);
  sleep_ms(1);
  const int64_t received = system_now();
  for (uint32_t topic = 0; topic < N_TOPICS; ++topic) {
    receive(topic, topic == X, received);
    if (!waits) {
      call_back(topic);
    }
  }
  sleep_ms(1);
  fm_engine_drain(engine);
  announce(engine);
  CHECK(n_taken == N_TOPICS);
  for (uint32_t k = 0; k < N_TOPICS; ++k) {
    stamps[k] = taken[k].stamp - received;
  }
  destroy(engine);
}

static void messages_of_one_instant_are_announced_alike_whoever_takes_them(void)
{
  const uint32_t policies[] = {FM_EVERY_MESSAGE, FM_RELEVANT_MESSAGE, FM_TIMED};
  window = -1;
  forbids_x = true;
  reports[ANSWER] = FM_EVERY_STEP;
  for (uint32_t k = 0; k < 3; ++k) {
    for (uint32_t way = 0; way < 3; ++way) {  // in callbacks, in a round, woken by callbacks
      int64_t stamps[N_TOPICS] = {-1, -1};
      taking = way == 2 ? FM_WAKE : FM_LISTEN;
      find_both(policies[k], way == 1, stamps);
      CHECK(stamps[0] == 0 && stamps[1] == (policies[k] == FM_TIMED ? 1 : 0));
    }
  }
  taking = FM_LISTEN;
  window = WINDOW;
  forbids_x = false;
  reports[ANSWER] = FM_ONSET;
}

// Each round brings more than is taken in it.
static void a_flood_does_not_suspend_a_deadline(void)
{
  const uint32_t n = taking == FM_WAKE ? 3 * MOST_AT_ONCE / 2 : MOST_AT_ONCE;
  struct fm_engine * engine = make(FM_TIMED, 0);
  arrive(Y, false);
  const int64_t asked = system_now();
  receive(X, true, asked);
  call_back(X);
  woken = NULL;
  for (uint32_t sent = n; n_taken == 0 && sent < MOST; sent += n) {
    for (uint32_t k = 0; k < n; ++k) {
      receive(Y, false, system_now());
    }
    call_back(Y);
    sleep_ms(WINDOW / 10 / MS);
    announce(engine);
  }
  CHECK(n_taken == 1 && is_taken(ANSWER, asked + WINDOW));
  CHECK(subscriptions[Y].taken < subscriptions[Y].sent);
  destroy(engine);
}

static int64_t sim_time = 0;

static int read_sim_time(void * clock, int64_t * nanoseconds)
{
  (void)clock;
  *nanoseconds = sim_time;
  return 0;
}

static struct fm_engine * make_on_clock(void)
{
  struct fm_engine * engine = make(FM_TIMED, 0);
  sim_time = 1000 * MS;
  fm_engine_follow_clock(engine, read_sim_time, NULL, false);
  return engine;
}

static void move_clock(struct fm_engine * engine, int64_t to)
{
  sleep_ms(2);
  sim_time = to;
  fm_engine_wake(engine);
  sleep_ms(2);
}

static void under_a_clock_a_message_counts_from_what_it_said_then(bool is_in_time)
{
  struct fm_engine * engine = make_on_clock();
  arrive(Y, false);
  arrive(X, true);
  announce(engine);
  move_clock(engine, 1040 * MS);
  const int64_t early = system_now();
  move_clock(engine, 1060 * MS);
  receive(Y, true, is_in_time ? early : system_now());
  move_clock(engine, 1080 * MS);
  announce(engine);
  CHECK(n_taken == (is_in_time ? 0u : 1u) && subscriptions[Y].taken == 2);
  CHECK(is_in_time || (taken[0].requirement == ANSWER && taken[0].stamp == 1050 * MS + 2));
  destroy(engine);
}

static void a_message_counts_by_the_clock_of_its_reception_while_that_runs_on(uint32_t ticks)
{
  struct fm_engine * engine = make_on_clock();
  arrive(Y, false);
  arrive(X, true);
  announce(engine);
  move_clock(engine, 1000 * MS + 2 * WINDOW);
  receive(Y, true, system_now());  // too late
  for (uint32_t tick = 0; tick < ticks; ++tick) {
    sim_time += MS;
    fm_engine_wake(engine);
  }
  announce(engine);
  CHECK(n_taken == 1 && taken[0].stamp == 1000 * MS + WINDOW + 2);
  destroy(engine);
}

static void the_time_does_not_go_back_while_the_clock_stands(void)
{
  struct fm_engine * engine = make_on_clock();
  for (uint32_t k = 0; k < 3; ++k) {
    receive(Y, false, system_now());
    receive(X, true, system_now());
    fm_engine_drain(engine);
  }
  announce(engine);
  CHECK(subscriptions[X].taken == 3 && time_counts_of(engine).restarts == 0);
  destroy(engine);
}

enum call { CONDITIONS, RESET, FOLLOW };

static void no_call_takes_what_is_due_before_an_answer_that_waits(enum call call)
{
  struct fm_engine * engine = make(FM_TIMED, 0);
  struct seen seen;
  arrive(Y, false);
  const int64_t asked = system_now();
  receive(X, true, asked);
  call_back(X);
  receive(Y, true, asked + WINDOW / 2);
  sleep_ms(2 * WINDOW / MS);
  if (call == CONDITIONS) {
    see(engine, &seen);
  } else if (call == RESET) {
    fm_engine_reset(engine);
  } else {
    fm_engine_follow_clock(engine, read_sim_time, NULL, false);
  }
  announce(engine);
  CHECK(n_taken == 0 && subscriptions[Y].taken == 2);
  destroy(engine);
}

static int64_t overdue_at;

// The thread that catches up stands still after it has read the time: an answer comes, and it is
// overdue when that thread goes on.
static void answer_in_time(void)
{
  receive(Y, true, overdue_at - MS);
  while (system_now() < overdue_at + MS) {}
}

static void a_round_takes_what_is_due_by_the_time_until_which_it_delivers(void)
{
  struct fm_engine * engine = make(FM_TIMED, 0);
  arrive(Y, false);
  const int64_t asked = system_now();
  receive(X, true, asked);
  call_back(X);
  overdue_at = asked + WINDOW;
  meanwhile = answer_in_time;
  fm_engine_drain(engine);
  announce(engine);
  CHECK(n_taken == 0 && subscriptions[Y].taken == 2);
  destroy(engine);
}

static void a_message_that_waits_for_its_stamp_takes_effect_in_time(void)
{
  reorder = 20 * MS;
  struct fm_engine * engine = make(FM_TIMED, 0);
  bool value = false;
  arrive(Y, true);
  announce(engine);
  CHECK(!value_of(engine, Y, &value));
  sleep_ms(reorder / MS + 1);
  announce(engine);
  CHECK(value_of(engine, Y, &value) && value);
  reorder = 0;
  destroy(engine);
}

static void how_late_a_message_was_evaluated_is_known(int64_t seconds)
{
  struct fm_engine * engine = make(FM_EVERY_MESSAGE, 0);
  announce(engine);
  receive(X, true, system_now() - 300 * MS);
  receive(X, true, system_now());
  receive(Y, true, system_now());
  set_by = seconds * 1000 * MS;
  fm_engine_drain(engine);
  struct seen seen;
  see(engine, &seen);
  const int64_t behind = seen.topics[X].behind;
  CHECK(behind >= 300 * MS && behind < 5000 * MS);
  CHECK(seen.topics[Y].behind < behind);
  see(engine, &seen);
  CHECK(seen.topics[X].behind == 0);
  set_by = 0;
  destroy(engine);
}

static void callbacks_that_take_too_long_leave_their_messages(void)
{
  struct fm_engine * engine = make(FM_EVERY_MESSAGE, 0);
  announce(engine);
  cost_ms = 2;
  works = true;
  uint32_t n = 0;
  while (subscriptions[X].taken == subscriptions[X].sent && n < 1000) {
    arrive(X, true);
    n += 1;
  }
  CHECK(n > 1 && n < 1000);
  cost_ms = 0;
  works = false;
  announce(engine);
  CHECK(subscriptions[X].taken == n);
  n = 0;
  do {  // callbacks take them again once there is less to do
    sleep_ms(50);
    receive(X, true, system_now());
    announce(engine);
    arrive(X, true);
    n += 1;
  } while (subscriptions[X].taken < subscriptions[X].sent && n < 100);
  CHECK(n > 10 && n < 100);
  destroy(engine);
}

// As on a busy machine, where others have the processor meanwhile.
static void callbacks_that_stand_still_take_their_messages(void)
{
  struct fm_engine * engine = make(FM_EVERY_MESSAGE, 0);
  announce(engine);
  cost_ms = 2;
  for (uint32_t k = 0; k < 60; ++k) {
    work_ms(1);  // the middleware's
    arrive(X, true);
  }
  cost_ms = 0;
  CHECK(subscriptions[X].taken == 60);
  destroy(engine);
}

// In a flood, the messages since then would all be of the round, for an hour.
static void a_system_time_that_is_set_back_in_a_flood_suspends_no_deadline(void)
{
  struct fm_engine * engine = make(FM_TIMED, 0);
  arrive(Y, false);
  arrive(X, true);
  sleep_ms(2 * WINDOW / MS);
  is_endless = true;
  set_back_at_take = X;
  for (int k = 0; k < 3; ++k) {
    announce(engine);
  }
  is_endless = false;
  CHECK(set_by != 0 && n_taken == 1 && taken[0].requirement == ANSWER);
  set_by = 0;
  destroy(engine);
}

static void the_marks_of_a_clock_are_in_order_after_the_system_time_was_set_back(void)
{
  struct fm_engine * engine = make_on_clock();
  for (uint32_t k = 0; k < 100; ++k) {
    fm_engine_wake(engine);
  }
  set_by = -3600 * 1000 * MS;
  arrive(Y, false);
  arrive(X, true);
  announce(engine);
  move_clock(engine, 1000 * MS + 2 * WINDOW);
  receive(Y, true, system_now());  // too late
  move_clock(engine, 1000 * MS + 3 * WINDOW);
  announce(engine);
  CHECK(n_taken == 1 && taken[0].requirement == ANSWER);
  set_by = 0;
  destroy(engine);
}

// As nodes do: what waits counts by the clock of before.
static void what_waits_while_a_clock_goes_back_is_of_the_time_before(void)
{
  struct fm_engine * engine = make_on_clock();
  arrive(Y, false);
  arrive(X, true);
  announce(engine);
  move_clock(engine, 1000 * MS + 2 * WINDOW);
  receive(Y, true, system_now());  // too late
  fm_engine_drain(engine);
  move_clock(engine, MS);
  announce(engine);
  CHECK(n_taken == 1 && taken[0].stamp == 1000 * MS + WINDOW + 2);
  CHECK(time_counts_of(engine).restarts == 1);
  destroy(engine);
}

// Receive more messages than a callback and a catch up take, so that a round stops within.
static void stop_within_a_round(struct fm_engine * engine, uint32_t n_left)
{
  const uint32_t n = (taking == FM_WAKE ? 1u : 2u) * MOST_AT_ONCE + n_left;
  for (uint32_t k = 0; k < n; ++k) {
    receive(Y, false, system_now());
  }
  notify(&subscriptions[Y].listener, n);
  announce(engine);
  CHECK(subscriptions[Y].sent - subscriptions[Y].taken <= n_left);
  CHECK(subscriptions[Y].taken < subscriptions[Y].sent);
}

static void what_begins_within_a_round_begins_once(void)
{
  begins = false;
  struct fm_engine * engine = make(FM_TIMED, 0);
  begins = true;
  stop_within_a_round(engine, MOST_AT_ONCE);
  sleep_ms(5);
  fm_engine_begin(engine);
  announce(engine);
  announce(engine);
  CHECK(subscriptions[Y].taken == subscriptions[Y].sent);
  CHECK(time_counts_of(engine).restarts == 0);
  destroy(engine);
}

static void a_held_message_outlives_a_system_time_that_is_set_back(void)
{
  struct fm_engine * engine = make(FM_TIMED, 0);
  sleep_ms(500);
  cost_ms = 5;  // of taking one of Y, which is asked first
  receive(X, false, system_now());
  receive(Y, false, system_now() + MS);
  set_back_at_take = X;
  announce(engine);
  cost_ms = 0;
  CHECK(set_by != 0);
  announce(engine);
  CHECK(subscriptions[X].taken == 1 && topic_counts_of(engine, Y).messages == 1);
  set_by = 0;
  destroy(engine);
}

static void a_header_counts_however_late_its_message_is_processed(void)
{
  reorder = 20 * MS;
  struct fm_engine * engine = make(FM_TIMED, 0);
  arrive(Y, false);
  announce(engine);
  const int64_t asked = system_now();
  receive(X, true, asked);
  sleep_ms(10);
  receive(Y, false, system_now() - MS);
  sleep_ms(3 * WINDOW / MS);
  announce(engine);
  CHECK(n_taken == 1 && is_taken(ANSWER, asked + WINDOW));
  CHECK(fm_engine_order_counts(engine, X).late == 0);
  CHECK(fm_engine_order_counts(engine, Y).late == 0);
  reorder = 0;
  destroy(engine);
}

// ---- a gate ------------------------------------------------------------------------------------

static void * gate_memory;

static struct fm_engine * make_gate(uint32_t policy)
{
  struct fm_engine * engine = make(policy, 0);
  const struct fm_gate_options rules = {
    .evaluator = engine->options.evaluator, .monitor = &monitor, .topics = topics,
    .n_topics = N_TOPICS, .from = N_TOPICS, .otherwise = FM_DROP};
  gate_memory = malloc((size_t)fm_gate_bytes(&rules));
  fm_engine_guard(engine, fm_gate_init(gate_memory, &rules), &rules);
  arrive(X, false);
  arrive(Y, false);
  return engine;
}

static uint32_t judge(struct fm_engine * engine)
{
  static uint64_t sequence = 0;
  sequence += 1;
  static const uint8_t gid[FM_GID_BYTES] = {1};
  const struct fm_origin origin = {system_now(), 0, sequence, gid, false, NULL, 0};
  int64_t due;
  return fm_engine_judge(engine, gid, 1, &origin, &due);
}

static void a_gate_knows_what_was_received_before_its_message(void)
{
  forbids_x = true;
  struct fm_engine * engine = make_gate(FM_EVERY_MESSAGE);
  CHECK(judge(engine) == FM_PASSED);
  stop_within_a_round(engine, MOST_AT_ONCE / 2);
  for (uint32_t k = 0; k < 3 * MOST_AT_ONCE / 2; ++k) {
    receive(Y, false, system_now());
  }
  receive(X, true, system_now());
  CHECK(judge(engine) == FM_VIOLATES);
  forbids_x = false;
  destroy(engine);
  free(gate_memory);
}

// Without leaks, as the address sanitizer says.
static void an_engine_may_end_within_a_handover_of_its_gate(void)
{
  struct fm_engine * engine = make_gate(FM_EVERY_MESSAGE);
  fm_engine_begin_handover(engine, N_TOPICS, false);
  destroy(engine);
  free(gate_memory);
}

// Called between the catch up before a judgement and the judgement itself.
static void (* between)(void) = NULL;
static uint64_t n_caught_up = 0;  // messages of X before the judgement

void __real_fm_engine_begin_order(struct fm_engine * engine);
void __wrap_fm_engine_begin_order(struct fm_engine * engine);

void __wrap_fm_engine_begin_order(struct fm_engine * engine)
{
  __real_fm_engine_begin_order(engine);
  n_caught_up = topic_counts_of(engine, X).messages;
  if (between != NULL) {
    between();
  }
}

static void arrive_between(void) {arrive(X, false);}

static void a_callback_between_catching_up_and_judging_sets_no_time_back(uint32_t policy)
{
  struct fm_engine * engine = make_gate(policy);
  between = arrive_between;
  for (uint32_t k = 0; k < 10; ++k) {
    sleep_ms(1);
    CHECK(judge(engine) == FM_PASSED);
  }
  between = NULL;
  CHECK(subscriptions[X].taken == 11);
  CHECK(time_counts_of(engine).restarts == 0);
  destroy(engine);
  free(gate_memory);
}

static void a_judgement_makes_nothing_overdue_while_an_answer_waits(void)
{
  struct fm_engine * engine = make_gate(FM_TIMED);
  const int64_t asked = system_now();
  receive(X, true, asked);
  call_back(X);
  overdue_at = asked + WINDOW;
  between = answer_in_time;
  CHECK(judge(engine) == FM_PASSED);
  between = NULL;
  announce(engine);
  CHECK(n_taken == 0 && subscriptions[Y].taken == 2);
  destroy(engine);
  free(gate_memory);
}

static void * run_announcer(void * engine)
{
  struct fm_violation out[16];
  while (!fm_engine_is_closed(engine)) {
    (void)fm_engine_take(engine, out, 16, 100);
  }
  return NULL;
}

static void a_gate_gets_its_turn_during_a_flood(void)
{
  enum { JUDGED = 20 };
  struct fm_engine * engine = make_gate(FM_EVERY_MESSAGE);
  pthread_t announcer;
  is_endless = true;
  sleep_ms(500);  // so that the queues are looked at
  CHECK(pthread_create(&announcer, NULL, run_announcer, engine) == 0);
  while (topic_counts_of(engine, X).messages < MOST_AT_ONCE) {
    sleep_ms(1);
  }
  uint64_t delivered = 0;
  for (uint32_t k = 0; k < JUDGED; ++k) {
    __atomic_store_n(&is_asked_to_rest, 1u, __ATOMIC_SEQ_CST);
    while (__atomic_load_n(&is_asked_to_rest, __ATOMIC_SEQ_CST) != 0) {
      sleep_ms(1);
    }
    const uint64_t before = topic_counts_of(engine, X).messages;
    CHECK(judge(engine) == FM_PASSED);
    delivered += n_caught_up - before;
  }
  CHECK(delivered <= JUDGED * 3 / 2 * MOST_AT_ONCE);  // a turn has as many as MOST_AT_ONCE
  fm_engine_close(engine);
  CHECK(pthread_join(announcer, NULL) == 0);
  is_endless = false;
  destroy(engine);
  free(gate_memory);
}

static void a_clock_that_moves_looks_for_messages_only_if_something_is_due(void)
{
  struct fm_engine * engine = make_on_clock();
  arrive(Y, false);
  announce(engine);
  n_takes = 0;
  for (uint32_t k = 0; k < 50; ++k) {
    sim_time += MS;
    fm_engine_wake(engine);
    announce(engine);
  }
  CHECK(n_takes < 10);
  sim_time = 1 * MS;  // goes back
  fm_engine_wake(engine);
  announce(engine);
  CHECK(time_counts_of(engine).restarts == 1);
  destroy(engine);
}

static struct fm_engine * asked;
static pthread_t asker;
static uint32_t has_answered;

static void * ask(void * unused)
{
  (void)silence_of(asked, Y);
  (void)gate_counts_of(asked);
  __atomic_store_n(&has_answered, 1u, __ATOMIC_SEQ_CST);
  return unused;
}

static void ask_meanwhile(void)
{
  CHECK(pthread_create(&asker, NULL, ask, NULL) == 0);
  for (int k = 0; k < 3000 && __atomic_load_n(&has_answered, __ATOMIC_SEQ_CST) == 0; ++k) {
    sleep_ms(1);
  }
  CHECK(__atomic_load_n(&has_answered, __ATOMIC_SEQ_CST) == 1);
}

static void a_thread_that_asks_does_not_wait_until_others_have_caught_up(void)
{
  struct fm_engine * engine = asked = make(FM_TIMED, TIMEOUT);
  receive(X, true, system_now());
  in_take = ask_meanwhile;
  fm_engine_drain(engine);
  CHECK(in_take == NULL && pthread_join(asker, NULL) == 0);
  destroy(engine);
}

int main(void)
{
  a_thread_that_asks_does_not_wait_until_others_have_caught_up();
  setvbuf(stdout, NULL, _IONBF, 0);  // one of these tests would hang
  callbacks_that_only_wake_leave_all_in_order();
  taking = FM_WAKE;
  an_input_is_not_silent_while_its_message_waits(FM_TIMED);
  a_message_counts_from_its_reception_however_late_it_is();
  a_flood_does_not_suspend_a_deadline();
  under_a_clock_a_message_counts_from_what_it_said_then(true);
  under_a_clock_a_message_counts_from_what_it_said_then(false);
  a_message_counts_by_the_clock_of_its_reception_while_that_runs_on(100);
  the_time_does_not_go_back_while_the_clock_stands();
  no_call_takes_what_is_due_before_an_answer_that_waits(CONDITIONS);
  no_call_takes_what_is_due_before_an_answer_that_waits(RESET);
  a_message_that_waits_for_its_stamp_takes_effect_in_time();
  a_header_counts_however_late_its_message_is_processed();
  a_gate_knows_what_was_received_before_its_message();
  an_answer_that_waits_is_late_only_after_the_last_nanosecond();
  taking = FM_LISTEN;
  an_answer_that_waits_is_late_only_after_the_last_nanosecond();
  messages_of_one_instant_are_announced_alike_whoever_takes_them();
  nothing_is_overdue_while_an_answer_waits();
  an_input_is_not_silent_while_its_message_waits(FM_TIMED);
  an_input_is_not_silent_while_its_message_waits(FM_RELEVANT_MESSAGE);
  a_message_counts_from_its_reception_however_late_it_is();
  a_message_of_before_the_system_time_was_set_counts_as_well(3600);
  a_message_of_before_the_system_time_was_set_counts_as_well(-3600);
  a_flood_does_not_suspend_a_deadline();
  under_a_clock_a_message_counts_from_what_it_said_then(true);
  under_a_clock_a_message_counts_from_what_it_said_then(false);
  a_message_counts_by_the_clock_of_its_reception_while_that_runs_on(100);
  the_time_does_not_go_back_while_the_clock_stands();
  no_call_takes_what_is_due_before_an_answer_that_waits(CONDITIONS);
  no_call_takes_what_is_due_before_an_answer_that_waits(RESET);
  no_call_takes_what_is_due_before_an_answer_that_waits(FOLLOW);
  a_round_takes_what_is_due_by_the_time_until_which_it_delivers();
  a_message_that_waits_for_its_stamp_takes_effect_in_time();
  how_late_a_message_was_evaluated_is_known(0);
  how_late_a_message_was_evaluated_is_known(3600);
  how_late_a_message_was_evaluated_is_known(-3600);
  callbacks_that_take_too_long_leave_their_messages();
  callbacks_that_stand_still_take_their_messages();
  a_system_time_that_is_set_back_in_a_flood_suspends_no_deadline();
  the_marks_of_a_clock_are_in_order_after_the_system_time_was_set_back();
  what_waits_while_a_clock_goes_back_is_of_the_time_before();
  what_begins_within_a_round_begins_once();
  a_header_counts_however_late_its_message_is_processed();
  a_gate_knows_what_was_received_before_its_message();
  an_engine_may_end_within_a_handover_of_its_gate();
  a_callback_between_catching_up_and_judging_sets_no_time_back(FM_EVERY_MESSAGE);
  a_callback_between_catching_up_and_judging_sets_no_time_back(FM_TIMED);
  a_judgement_makes_nothing_overdue_while_an_answer_waits();
  a_held_message_outlives_a_system_time_that_is_set_back();
  a_gate_gets_its_turn_during_a_flood();
  a_clock_that_moves_looks_for_messages_only_if_something_is_due();
  return failures == 0 ? 0 : 1;
}
