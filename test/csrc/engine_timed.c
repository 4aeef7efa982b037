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

/// engine_timed.c: an engine under FM_TIMED, with time that is told, of a clock, or steady. Prints
/// what is not so.
///
/// The monitor, with windows in ns: ANSWER reads x and y: x -> y within 100 (that is, x was true
/// and since then, for 100 ticks, y was not). BEAT reads got_x: O[0,200] got_x. OLD reads age:
/// age < 0.5 s.

#define _POSIX_C_SOURCE 200809L

#include "engine.h"
#include "engine_locked.h"

#include <string.h>
#include <time.h>

#include "engines.h"
#include "fakes.h"
#include "scenarios.h"
#include "seen.h"

enum { X, Y, GOT_X, AGE, N_INPUTS };
enum { ANSWER, BEAT, OLD, N_REQUIREMENTS };
enum { TOPIC_X, TOPIC_Y, N_TOPICS };
enum { MOST = 4096, MS = 1000000, MOST_WAITING = 1024 };

struct inputs
{
  bool x;
  bool y;
  bool got_x;
  double age;
};

struct state
{
  int64_t asked;  // since then; -1: not
  int64_t got;    // last; -1: never
  bool was_got;
};

static int64_t window = 100;

static void reset_answer(void * state) {((struct state *)state)->asked = -1;}

static int64_t answer_at(void * state, const void * inputs, bool * verdicts, int64_t tick)
{
  struct state * cells = state;
  const struct inputs * in = inputs;
  if (in->y) {
    cells->asked = -1;
  } else if (in->x && cells->asked < 0) {
    cells->asked = tick;
  }
  verdicts[ANSWER] = cells->asked < 0 || tick - cells->asked < window;
  return cells->asked >= 0 && verdicts[ANSWER] ? cells->asked + window : FM_NEVER;
}

static void reset_beat(void * state)
{
  ((struct state *)state)->got = -1;
  ((struct state *)state)->was_got = false;
}

static int64_t beat_at(void * state, const void * inputs, bool * verdicts, int64_t tick)
{
  struct state * cells = state;
  const bool got = ((const struct inputs *)inputs)->got_x;
  cells->got = got ? tick : cells->was_got ? tick - 1 : cells->got;
  cells->was_got = got;
  verdicts[BEAT] = cells->got >= 0 && tick - cells->got <= 2 * window;
  return !got && verdicts[BEAT] ? cells->got + 2 * window + 1 : FM_NEVER;
}

static void reset_old(void * state) {(void)state;}

static int64_t old_at(void * state, const void * inputs, bool * verdicts, int64_t tick)
{
  (void)state;
  (void)tick;
  verdicts[OLD] = ((const struct inputs *)inputs)->age < 0.5;
  return FM_NEVER;
}

static const uint32_t numbers[] = {0, 1, 2, 3};
static const struct fm_input inputs[] = {
  {"x", (uint32_t)offsetof(struct inputs, x), FM_BOOL},
  {"y", (uint32_t)offsetof(struct inputs, y), FM_BOOL},
  {"got_x", (uint32_t)offsetof(struct inputs, got_x), FM_BOOL},
  {"age", (uint32_t)offsetof(struct inputs, age), FM_FLOAT64}};
static const struct fm_group groups[] = {
  {&numbers[X], 2, &numbers[ANSWER], 1, reset_answer, NULL, answer_at},
  {&numbers[GOT_X], 1, &numbers[BEAT], 1, reset_beat, NULL, beat_at},
  {&numbers[AGE], 1, &numbers[OLD], 1, reset_old, NULL, old_at}};
static const struct fm_requirement requirements[] = {{"ANSWER", 0}, {"BEAT", 1}, {"OLD", 2}};
static const struct fm_monitor monitor = {
  FM_ABI, N_INPUTS, 3, N_REQUIREMENTS, sizeof(struct state), sizeof(struct inputs), inputs,
  groups, requirements, "timed", "", NULL, NULL, 0, NULL};
static const uint32_t feeds_x[] = {X, GOT_X, AGE};
static const struct fm_topic topics[] = {{feeds_x, 3}, {&numbers[Y], 1}};
static const uint8_t sources[] = {FM_FIELD, FM_FIELD, FM_RECEPTION, FM_AGE};
static const uint8_t reports[] = {FM_ONSET, FM_ONSET, FM_ONSET};

// A message: a bool, then its stamp.
struct message
{
  int64_t stamp;
  uint8_t value;
};

static bool read_stamp(const uint8_t * message, size_t size, int64_t * out)
{
  if (size < sizeof(struct message)) {
    return false;
  }
  memcpy(out, message, sizeof(*out));
  return true;
}

static bool read_y(const uint8_t * message, size_t size, struct fm_field * fields)
{
  struct message read;
  if (size < sizeof(read)) {
    return false;
  }
  memcpy(&read, message, sizeof(read));
  fields[0].value.i = read.value;
  fields[0].outcome = FM_FIELD_READ;
  return true;
}

static bool read_x(const uint8_t * message, size_t size, struct fm_field * fields)
{
  fields[1].value.i = 0;
  fields[1].outcome = FM_FIELD_OUTSIDE;  // an input that tells of a reception has no field
  fields[2].outcome = FM_FIELD_READ;
  return read_y(message, size, fields) && read_stamp(message, size, &fields[2].value.i);
}

static const struct fm_reader reader[] = {
  {.read = read_x, .n_inputs = 3, .stamp = read_stamp},
  {.read = read_y, .n_inputs = 1, .stamp = read_stamp}};
static const struct fm_readers readers = {FM_ABI, N_TOPICS, reader};

// ---- helpers -----------------------------------------------------------------------------------

static struct fm_violation taken[MOST];
static uint32_t n_taken;

static struct fm_engine * make(int64_t reorder)
{
  const struct fm_evaluator_options options = {
    .monitor = &monitor, .topics = topics, .n_topics = N_TOPICS, .policy = FM_TIMED,
    .reports = reports, .sources = sources, .reports_recoveries = true};
  n_taken = 0;
  return create_engine(&options, &readers, reorder);
}

static void deliver(
  struct fm_engine * engine, uint32_t topic, bool value, int64_t stamp, int64_t received)
{
  struct message message;
  memset(&message, 0, sizeof(message));
  message.stamp = stamp;
  message.value = value;
  const struct fm_origin origin = {received, 0, 0, NULL, false, NULL, 0};
  CHECK(fm_engine_message(
      engine, topic, (const uint8_t *)&message, sizeof(message), &origin) == FM_RECEIVED);
}

static void take(struct fm_engine * engine, uint32_t milliseconds)
{
  n_taken += fm_engine_take(engine, &taken[n_taken], MOST - n_taken, milliseconds);
}

static uint32_t count_of(uint32_t requirement)
{
  uint32_t n = 0;
  for (uint32_t k = 0; k < n_taken; ++k) {
    n += taken[k].requirement == requirement ? 1u : 0u;
  }
  return n;
}

static bool is_taken(uint32_t requirement, int64_t stamp, uint64_t tick)
{
  for (uint32_t k = 0; k < n_taken; ++k) {
    if (taken[k].requirement == requirement && taken[k].stamp == stamp) {
      return taken[k].step == tick;
    }
  }
  return false;
}

static struct clock simulated;

static struct fm_engine * make_with_clock(int64_t reorder, int64_t now)
{
  struct fm_engine * engine = make(reorder);
  simulated = (struct clock) {now, false};
  fm_engine_follow_clock(engine, read_clock, &simulated, false);
  fm_engine_begin(engine);
  return engine;
}

struct event
{
  enum {ADVANCES, CLOCK_MOVES, TAKES, COMES} what;
  int64_t time;  // of the clock; of a message, the stamp of its header
  uint32_t topic;
  bool value;
  int64_t received;
};

static void play(struct fm_engine * engine, const struct event * events, size_t count)
{
  for (const struct event * each = events; each < events + count; ++each) {
    switch (each->what) {
      case ADVANCES: fm_engine_advance(engine, each->time); break;
      case CLOCK_MOVES: simulated.now = each->time; break;
      case TAKES: take(engine, 0); break;
      case COMES: deliver(engine, each->topic, each->value, each->time, each->received); break;
    }
  }
}

#define ADVANCE(time) {ADVANCES, time, 0, false, 0}
#define CLOCK(time) {CLOCK_MOVES, time, 0, false, 0}
#define TAKE {TAKES, 0, 0, false, 0}
#define X_OF(value, stamp, received) {COMES, stamp, TOPIC_X, value, received}
#define Y_OF(value, stamp, received) {COMES, stamp, TOPIC_Y, value, received}
#define PLAY(engine, ...) \
  play( \
    engine, (const struct event[]) {__VA_ARGS__}, \
    sizeof((const struct event[]) {__VA_ARGS__}) / sizeof(struct event))

// The linker puts it in place of clock_gettime: a system time that the test sets back, and clocks
// that stand.
static int64_t set_back = 0;
// Volatile: the compiler takes for granted that clock_gettime does not read it.
static volatile int64_t stands_at = 0;  // by CLOCK_MONOTONIC; 0: the clocks run
static int64_t takes = 0;      // ns, for each reading of a clock that stands
static uint32_t n_readings = 0;

int __real_clock_gettime(clockid_t clock, struct timespec * out);
int __wrap_clock_gettime(clockid_t clock, struct timespec * out);

int __wrap_clock_gettime(clockid_t clock, struct timespec * out)
{
  const int result = __real_clock_gettime(clock, out);
  n_readings += 1;
  stands_at += stands_at != 0 ? takes : 0;
  const int64_t back = clock == CLOCK_REALTIME ? set_back : 0;
  const int64_t read = (int64_t)out->tv_sec * 1000 * MS + (int64_t)out->tv_nsec;
  const int64_t time = (stands_at != 0 ? stands_at : read) - back;
  out->tv_sec = (time_t)(time / (1000 * MS));
  out->tv_nsec = (long)(time % (1000 * MS));
  return result;
}

static int64_t time_of(clockid_t clock)
{
  struct timespec now;
  clock_gettime(clock, &now);
  return (int64_t)now.tv_sec * 1000 * MS + (int64_t)now.tv_nsec;
}

// ---- time that is told -------------------------------------------------------------------------

SCENARIO(deadlines_before_a_message_come_first)
{
  struct fm_engine * engine = make(-1);
  PLAY(engine, ADVANCE(1000), Y_OF(false, 0, 1000), X_OF(true, 0, 1010), Y_OF(true, 0, 1500),
    TAKE);
  CHECK(is_taken(ANSWER, 1110, 100) && is_taken(BEAT, 1211, 201));
  PLAY(engine, Y_OF(false, 0, 1600), X_OF(true, 0, 1700), Y_OF(true, 0, 1800));
  CHECK(fm_engine_deadline(engine) == 1901);
  fm_engine_advance(engine, 5000);
  n_taken = 0;
  take(engine, 0);
  CHECK(count_of(ANSWER) == 1);  // at 1700: x was still true when y ended at 1600
  destroy_engine(engine);
}

SCENARIO(ages_are_seconds_from_the_stamp_to_the_reception)
{
  struct fm_engine * engine = make(-1);
  double age = 0.0;
  fm_engine_advance(engine, 0);
  deliver(engine, TOPIC_X, true, INT64_C(1000000000), INT64_C(1250000000));
  CHECK(value_of(engine, AGE, &age) && age == 0.25);
  take(engine, 0);
  CHECK(count_of(OLD) == 0);
  deliver(engine, TOPIC_X, true, INT64_C(1000000000), INT64_C(1500000000));
  take(engine, 0);
  CHECK(is_taken(OLD, INT64_C(1500000000), 250000000));
  destroy_engine(engine);
}

SCENARIO(a_recovery_is_a_detail_and_no_violation)
{
  struct fm_engine * engine = make(-1);
  struct { struct fm_detail detail; char rest[64]; } room;
  fm_engine_want_details(engine, true, 100);
  fm_engine_advance(engine, 0);
  deliver(engine, TOPIC_X, true, 0, INT64_C(1000000000));
  deliver(engine, TOPIC_X, true, INT64_C(2000000000), INT64_C(2000000000));
  take(engine, 0);
  CHECK(count_of(OLD) == 1 && n_taken == 2);  // and BEAT, in the second between
  uint32_t n_recoveries = 0;
  uint32_t n = 0;
  while (fm_engine_take_detail(engine, &room.detail, 0)) {
    n += 1;
    n_recoveries += room.detail.violation.is_recovery ? 1u : 0u;
  }
  CHECK(n == 4 && n_recoveries == 2);
  destroy_engine(engine);
}

// ---- a clock -----------------------------------------------------------------------------------

SCENARIO(a_clock_that_starts_again_starts_the_groups_afresh)
{
  struct fm_engine * engine = make_with_clock(-1, 1000);
  PLAY(engine, Y_OF(false, 0, 1), X_OF(true, 0, 1), CLOCK(1050), TAKE, CLOCK(20),
    X_OF(true, 0, 1));
  CHECK(time_counts_of(engine).restarts == 1);
  CHECK(time_counts_of(engine).restarted_at == 20);
  PLAY(engine, CLOCK(119), TAKE);
  CHECK(count_of(ANSWER) == 0);
  PLAY(engine, CLOCK(500), TAKE);
  // x and y keep their values: asked when the time began again.
  CHECK(count_of(ANSWER) == 1 && is_taken(ANSWER, 120, 100));
  destroy_engine(engine);
}

SCENARIO(messages_at_one_time_of_a_clock_take_effect_one_by_one)
{
  struct fm_engine * engine = make_with_clock(-1, 1000);
  deliver(engine, TOPIC_Y, false, 0, 1);
  for (int k = 0; k < 50; ++k) {
    deliver(engine, TOPIC_X, k % 2 == 0, 0, 1);
    take(engine, 0);
  }
  PLAY(engine, CLOCK(1010), TAKE, X_OF(false, 0, 1));
  CHECK(time_counts_of(engine).restarts == 0);
  PLAY(engine, CLOCK(1099), TAKE);
  CHECK(n_taken == 0);
  PLAY(engine, CLOCK(1101), TAKE);
  CHECK(n_taken == 0);  // a message may still come at that time
  PLAY(engine, CLOCK(1102), TAKE);
  CHECK(is_taken(ANSWER, 1101, 100));  // asked by the second message, at 1001
  destroy_engine(engine);
}

SCENARIO(a_violation_before_another_clock_has_a_time_has_the_stamp_0)
{
  struct clock none = {0, false};
  window = 2;
  struct fm_engine * engine = make_with_clock(-1, 5000);
  PLAY(engine, Y_OF(false, 0, 1), X_OF(true, 0, 1));
  fm_engine_follow_clock(engine, read_clock, &none, false);
  for (int k = 0; k < 5; ++k) {
    deliver(engine, TOPIC_Y, false, 0, 1);
  }
  take(engine, 0);
  CHECK(count_of(ANSWER) == 1 && is_taken(ANSWER, 0, 2));
  destroy_engine(engine);
  window = 100;
}

// A simulator sends its messages after the tick of /clock to which they belong.
SCENARIO(an_answer_while_the_clock_stands_at_the_deadline_counts)
{
  for (int64_t reorder = -1; reorder <= 0; ++reorder) {  // without and with stamps of headers
    for (int64_t late = 0; late < 2; ++late) {
      struct fm_engine * engine = make_with_clock(reorder, 1000);
      const int64_t times[] = {1000, 1000, 1101 + late, 1300};
      for (int k = 0; k < 4; ++k) {
        PLAY(engine, CLOCK(times[k]), TAKE);
        deliver(engine, k == 1 ? TOPIC_X : TOPIC_Y, k == 1 || k == 2, times[k], 1);
        take(engine, 0);
      }
      CHECK(count_of(ANSWER) == (uint32_t)late);  // asked at 1001
      CHECK(late == 0 || is_taken(ANSWER, 1101, 100));
      CHECK(time_counts_of(engine).restarts == 0);
      destroy_engine(engine);
    }
  }
}

SCENARIO(without_a_time_messages_are_steps_of_the_last_instant)
{
  struct fm_engine * engine = make_with_clock(-1, 0);
  PLAY(engine, Y_OF(false, 0, 1), X_OF(true, 0, 1), TAKE);
  CHECK(n_taken == 0 && requirement_counts_of(engine, ANSWER).steps == 0);
  PLAY(engine, CLOCK(500), TAKE);
  CHECK(requirement_counts_of(engine, ANSWER).steps == 0);
  PLAY(engine, CLOCK(501), TAKE);
  CHECK(requirement_counts_of(engine, ANSWER).steps == 1);
  simulated.fails = true;
  deliver(engine, TOPIC_X, false, 0, 1);
  CHECK(requirement_counts_of(engine, ANSWER).steps == 2);
  CHECK(count_of(OLD) == 0 && input_counts_of(engine, AGE).unusable == 2);
  simulated.fails = false;
  PLAY(engine, CLOCK(10000), TAKE);
  CHECK(is_taken(ANSWER, 600, 100) && is_taken(BEAT, 702, 202));
  destroy_engine(engine);
}

// ---- the steady clock --------------------------------------------------------------------------

SCENARIO(a_wait_ends_at_the_deadline)
{
  struct fm_engine * engine = make(-1);
  window = 30 * MS;
  fm_engine_follow_steady(engine);
  fm_engine_begin(engine);
  deliver(engine, TOPIC_Y, false, 0, time_of(CLOCK_REALTIME));
  const int64_t asked = time_of(CLOCK_REALTIME);
  deliver(engine, TOPIC_X, true, asked, asked);
  take(engine, 1000);
  const int64_t now = time_of(CLOCK_REALTIME);
  CHECK(count_of(ANSWER) == 1 && now - asked >= 30 * MS && now - asked < 300 * MS);
  // Stamped with the time of reception and 30 ms, exactly, if no thread was preempted.
  CHECK(taken[0].stamp - asked - 30 * MS < MS && taken[0].stamp - asked >= 29 * MS);
  window = 100;
  destroy_engine(engine);
}

SCENARIO(a_reception_ends_with_its_message_and_wakes_no_thread)
{
  struct fm_engine * engine = make(-1);
  fm_engine_follow_steady(engine);
  fm_engine_begin(engine);
  const struct timespec pause = {0, 2 * MS};
  nanosleep(&pause, NULL);
  deliver(engine, TOPIC_X, true, 0, time_of(CLOCK_REALTIME) - MS);
  CHECK(requirement_counts_of(engine, BEAT).steps == 2);
  CHECK(requirement_counts_of(engine, BEAT).verdict);
  destroy_engine(engine);
}

// As a receiver does in a callback of the middleware. Returns the number of clocks that were read.
static uint32_t deliver_in_callback(
  struct fm_engine * engine, uint32_t topic, bool value, int64_t received)
{
  struct fm_field fields[N_INPUTS];
  const struct message message = {0, value};
  const struct fm_origin origin = {received, 0, 0, NULL, false, NULL, 0};
  struct fm_reading reading;
  (void)fm_engine_read(
    engine, topic, (const uint8_t *)&message, sizeof(message), fields, &reading);
  CHECK(fm_engine_begin_taking(engine));
  const uint32_t before = n_readings;
  fm_engine_deliver_locked(engine, topic, &reading, &origin);
  const uint32_t n = n_readings - before;
  fm_engine_end_taking(engine, false);
  return n;
}

SCENARIO(a_message_in_a_callback_costs_one_reading_of_a_clock)
{
  window = 100 * MS;
  stands_at = time_of(CLOCK_MONOTONIC);
  struct fm_engine * engine = make(-1);
  fm_engine_follow_steady(engine);
  fm_engine_begin(engine);
  deliver_in_callback(engine, TOPIC_Y, false, stands_at - MS);
  deliver_in_callback(engine, TOPIC_X, false, stands_at - MS);
  stands_at += 10 * MS;
  CHECK(deliver_in_callback(engine, TOPIC_Y, false, stands_at) == 1);
  stands_at += 10 * MS;
  set_back = 1000 * MS;  // the system time
  CHECK(deliver_in_callback(engine, TOPIC_X, true, stands_at - set_back) > 1);
  CHECK(fm_engine_deadline(engine) == stands_at + 1);  // the reception ends
  set_back = stands_at = 0;
  window = 100;
  destroy_engine(engine);
}

// ---- stamps of headers -------------------------------------------------------------------------

SCENARIO(messages_take_effect_in_the_order_of_their_stamps)
{
  struct fm_engine * engine = make(50);
  PLAY(engine, ADVANCE(1000), Y_OF(false, 1000, 1010), Y_OF(true, 1120, 1130),
    X_OF(true, 1100, 1140), Y_OF(false, 1130, 1141));
  CHECK(fm_engine_deadline(engine) == 1100);
  fm_engine_advance(engine, 1149);
  CHECK(requirement_counts_of(engine, ANSWER).steps == 0);
  PLAY(engine, ADVANCE(1279), TAKE);
  CHECK(count_of(ANSWER) == 0 && requirement_counts_of(engine, ANSWER).steps == 3);
  fm_engine_advance(engine, 1280);  // x is still true since 1130, and no answer until 1230
  take(engine, 0);
  CHECK(is_taken(ANSWER, 1230, 130));
  CHECK(fm_engine_order_counts(engine, TOPIC_X).late == 0);
  destroy_engine(engine);
}

SCENARIO(a_message_that_is_too_late_takes_effect_at_once)
{
  struct fm_engine * engine = make(50);
  PLAY(engine, ADVANCE(1000), Y_OF(false, 990, 1010), ADVANCE(1200), X_OF(true, 1100, 1201));
  CHECK(fm_engine_order_counts(engine, TOPIC_X).late == 1);
  CHECK(fm_engine_order_counts(engine, TOPIC_Y).late == 0);
  PLAY(engine, ADVANCE(2000), TAKE);
  CHECK(is_taken(ANSWER, 1251, 100));  // asked at 1151: what came before is decided
  destroy_engine(engine);
}

SCENARIO(a_stamp_ahead_of_the_clock_is_counted)
{
  struct fm_engine * engine = make(50);
  PLAY(engine, ADVANCE(1000), X_OF(true, 1010 + 100000000, 1010));
  CHECK(fm_engine_order_counts(engine, TOPIC_X).ahead == 0);
  PLAY(engine, X_OF(true, 1010 + 300000000, 1010), X_OF(true, 1010 + 200000000, 1010));
  CHECK(fm_engine_order_counts(engine, TOPIC_X).ahead == 2);
  CHECK(fm_engine_order_counts(engine, TOPIC_X).most_ahead == 300000000);
  CHECK(fm_engine_order_counts(engine, TOPIC_Y).ahead == 0);
  destroy_engine(engine);
}

SCENARIO(a_late_message_takes_effect_after_what_is_decided_then)
{
  struct fm_engine * engine = make_with_clock(100, 1000);
  PLAY(engine, CLOCK(1110), Y_OF(false, 1020, 1), X_OF(true, 1030, 1));
  // Nothing was taken since. x waits until 1130, its deadline is 1130, and all before 1900 passed.
  PLAY(engine, CLOCK(2000), Y_OF(true, 0, 1));
  CHECK(fm_engine_order_counts(engine, TOPIC_Y).late == 1);
  take(engine, 0);
  CHECK(count_of(ANSWER) == 1 && is_taken(ANSWER, 1130, 100));
  deliver(engine, TOPIC_Y, false, 1850, 1);
  CHECK(fm_engine_order_counts(engine, TOPIC_Y).late == 2);
  n_taken = 0;
  PLAY(engine, CLOCK(3000), TAKE);
  CHECK(is_taken(ANSWER, 2001, 971));  // asked again at 1901, after the message at 1900
  CHECK(time_counts_of(engine).restarts == 0);
  destroy_engine(engine);
}

SCENARIO(messages_of_one_stamp_do_not_move_the_time_back)
{
  struct fm_engine * engine = make_with_clock(50, 1000);
  for (int k = 0; k < 4; ++k) {
    PLAY(engine, Y_OF(false, 1000, 1), X_OF(false, 1000, 1));
  }
  PLAY(engine, CLOCK(1050), TAKE, X_OF(false, 10, 1), X_OF(false, 10, 1), X_OF(false, 10, 1),
    TAKE);
  CHECK(time_counts_of(engine).restarts == 0);
  CHECK(requirement_counts_of(engine, ANSWER).steps == 10);
  destroy_engine(engine);
}

SCENARIO(when_too_many_wait_the_oldest_takes_effect)
{
  struct fm_engine * engine = make(1000000);
  PLAY(engine, ADVANCE(1000000), Y_OF(false, 1, 1000000));
  for (int64_t k = 0; k < MOST_WAITING + 9; ++k) {
    deliver(engine, TOPIC_X, false, 1000 + k, 1000000);
  }
  CHECK(fm_engine_order_counts(engine, TOPIC_X).overflows == 9);
  CHECK(fm_engine_order_counts(engine, TOPIC_Y).overflows == 1);
  CHECK(requirement_counts_of(engine, ANSWER).steps == 9);
  fm_engine_advance(engine, 3000000);
  CHECK(requirement_counts_of(engine, ANSWER).steps == MOST_WAITING + 9);
  CHECK(time_counts_of(engine).restarts == 0);
  destroy_engine(engine);
}

SCENARIO(when_the_clock_of_stamps_goes_back_what_waits_takes_effect)
{
  struct fm_engine * engine = make_with_clock(50, 10000);
  PLAY(engine, Y_OF(false, 10000, 1), X_OF(true, 10010, 1), CLOCK(500), X_OF(false, 490, 1));
  CHECK(time_counts_of(engine).restarts == 1);
  CHECK(fm_engine_order_counts(engine, TOPIC_X).late == 0);
  PLAY(engine, CLOCK(540), TAKE, CLOCK(1000), TAKE);
  CHECK(count_of(ANSWER) == 1 && is_taken(ANSWER, 550, 100));  // asked at 450, the begin
  destroy_engine(engine);
}

SCENARIO(when_the_clock_goes_back_no_deadline_is_taken_that_never_came)
{
  struct fm_engine * engine = make_with_clock(50, 10000);
  // asked for an answer until 10050
  PLAY(engine, Y_OF(false, 9940, 1), X_OF(true, 9950, 1), TAKE);
  PLAY(engine, X_OF(false, 20000, 1), CLOCK(500), TAKE);
  CHECK(time_counts_of(engine).restarts == 1);
  CHECK(count_of(ANSWER) == 0);
  PLAY(engine, X_OF(true, 450, 1), X_OF(false, 9000, 1));  // and of another clock
  fm_engine_follow_steady(engine);
  take(engine, 0);
  CHECK(!is_taken(ANSWER, 550, 100));
  destroy_engine(engine);
}

SCENARIO(when_the_clock_goes_back_the_deadlines_that_have_come_are_taken_first)
{
  struct fm_engine * engine = make_with_clock(50, 10000);
  PLAY(engine, Y_OF(false, 9950, 1), X_OF(true, 9960, 1));  // asked for an answer until 10060
  // the time is 10100, and nothing was taken since
  PLAY(engine, CLOCK(10020), TAKE, CLOCK(10150), Y_OF(true, 20000, 1));
  PLAY(engine, CLOCK(500), TAKE);
  CHECK(time_counts_of(engine).restarts == 1);
  CHECK(count_of(ANSWER) == 1 && is_taken(ANSWER, 10060, 100));
  destroy_engine(engine);
}

SCENARIO(messages_that_wait_take_effect_before_another_clock_is_followed)
{
  struct clock other = {500, false};
  struct fm_engine * engine = make_with_clock(50, 10000);
  PLAY(engine, Y_OF(false, 9940, 1), X_OF(true, 9980, 1));
  CHECK(requirement_counts_of(engine, ANSWER).steps == 0);
  fm_engine_follow_clock(engine, read_clock, &other, false);
  CHECK(requirement_counts_of(engine, ANSWER).steps == 1);
  other.now = 20000;  // the stamp of the other clock has come, and means nothing
  take(engine, 0);
  CHECK(count_of(ANSWER) == 1 && is_taken(ANSWER, 550, 100));
  destroy_engine(engine);
}

SCENARIO(a_message_without_a_stamp_cannot_be_decoded)
{
  struct fm_engine * engine = make(50);
  const uint8_t message[] = {1};
  const struct fm_origin origin = {1, 0, 0, NULL, false, NULL, 0};
  CHECK(fm_engine_message(engine, TOPIC_Y, message, sizeof(message), &origin) == FM_UNDECODABLE);
  CHECK(topic_counts_of(engine, TOPIC_Y).undecodable == 1);
  destroy_engine(engine);
}

SCENARIO(a_wait_ends_when_a_message_takes_effect)
{
  struct fm_engine * engine = make(20 * MS);
  window = 5 * MS;
  fm_engine_follow_steady(engine);
  fm_engine_begin(engine);
  const int64_t now = time_of(CLOCK_REALTIME);
  PLAY(engine, Y_OF(false, now + 1, now), X_OF(true, now + 2, now));
  take(engine, 1000);
  const int64_t later = time_of(CLOCK_REALTIME) - now;
  CHECK(is_taken(ANSWER, now + 2 + 5 * MS, 5 * MS));
  CHECK(later >= 25 * MS && later < 300 * MS);
  window = 100;
  destroy_engine(engine);
}

// A step that is smaller than the time since the last reading is one all the same.
SCENARIO(a_system_time_that_is_set_back_by_little_lets_what_waits_take_effect)
{
  struct fm_engine * engine = make(100 * MS);
  const struct timespec pause = {0, 30 * MS};
  fm_engine_follow_steady(engine);
  fm_engine_begin(engine);
  deliver(engine, TOPIC_Y, false, time_of(CLOCK_REALTIME), time_of(CLOCK_REALTIME));
  deliver(engine, TOPIC_X, true, time_of(CLOCK_REALTIME), time_of(CLOCK_REALTIME));
  CHECK(requirement_counts_of(engine, OLD).steps == 0);
  nanosleep(&pause, NULL);
  set_back = 20 * MS;
  deliver(engine, TOPIC_Y, false, time_of(CLOCK_REALTIME), time_of(CLOCK_REALTIME));
  CHECK(time_counts_of(engine).restarts == 1);
  // At the message that waited, and at the start after it.
  CHECK(requirement_counts_of(engine, OLD).steps == 2);
  CHECK(requirement_counts_of(engine, ANSWER).steps == 2);
  set_back = 0;
  destroy_engine(engine);
}

// The times of the messages that a black box keeps. Returns their number.
static uint32_t times_in(struct fm_blackbox * box, int64_t * times)
{
  uint8_t bytes[1024];
  uint64_t begin;
  const uint64_t n_bytes = fm_blackbox_copy(box, 0, bytes, sizeof(bytes), &begin);
  uint32_t n = 0;
  for (uint64_t at = 0; at < n_bytes; ++n) {
    struct fm_kept kept;
    memcpy(&kept, &bytes[at], sizeof(kept));
    times[n] = kept.time;
    at += sizeof(kept) + kept.size;
  }
  return n;
}

// The clocks are compared more closely while the answer is awaited.
SCENARIO(a_deadline_is_stamped_with_a_reception_and_its_bound_to_the_nanosecond)
{
  struct fm_engine * engine = make(-1);
  set_back = MS;
  stands_at = time_of(CLOCK_MONOTONIC);
  takes = 70;
  fm_engine_follow_steady(engine);
  fm_engine_begin(engine);
  stands_at += MS;
  const int64_t asked = time_of(CLOCK_REALTIME);
  stands_at += MS;
  PLAY(engine, Y_OF(false, 0, asked - 1000), X_OF(true, 0, asked));
  for (takes = 30; takes > 0; takes -= 10) {
    PLAY(engine, X_OF(true, 0, asked + MS / 2 + takes));
  }
  stands_at += MS;
  take(engine, 0);
  CHECK(is_taken(ANSWER, asked + 100, 100));
  stands_at = 0;
  takes = 0;
  set_back = 0;
  destroy_engine(engine);
}

// Threads deliver messages of different topics in another order than that of their receptions.
SCENARIO(a_message_is_kept_with_the_time_at_which_it_takes_effect)
{
  struct fm_engine * engine = make(-1);
  struct fm_blackbox * box = fm_blackbox_create(1024, MS);
  int64_t times[3] = {0, 0, 0};
  fm_engine_keep_messages(engine, box);
  fm_engine_follow_steady(engine);
  fm_engine_begin(engine);
  const struct timespec pause = {0, 3 * MS};
  nanosleep(&pause, NULL);
  const int64_t now = time_of(CLOCK_REALTIME) - MS;
  PLAY(
    engine, Y_OF(true, 0, now), X_OF(true, now - MS, now), Y_OF(false, 0, now - MS / 2), TAKE);
  CHECK(times_in(box, times) == 3);
  CHECK(times[0] == now && times[1] == now + 1 && times[2] == now + 3);
  CHECK(is_taken(ANSWER, now + 103, 103) || is_taken(ANSWER, now + 103, 102));
  double age = 0.0;
  CHECK(value_of(engine, AGE, &age) && age == (double)(MS + 1) / 1e9);
  destroy_engine(engine);
  fm_blackbox_destroy(box);
}

// Whether y, received too late by half a millisecond before the system time was set forward, and
// delivered after that, violates.
static bool is_late_after_setting(int64_t forward)
{
  struct fm_engine * engine = make(-1);
  window = 20 * MS;
  stands_at = time_of(CLOCK_MONOTONIC);
  fm_engine_follow_steady(engine);
  fm_engine_begin(engine);
  deliver(engine, TOPIC_Y, false, 0, time_of(CLOCK_REALTIME));
  deliver(engine, TOPIC_X, true, 0, time_of(CLOCK_REALTIME));
  stands_at += window - MS / 5;
  deliver(engine, TOPIC_X, true, 0, time_of(CLOCK_REALTIME));  // the clocks are read
  stands_at += MS / 5 + MS / 2;
  const int64_t received = time_of(CLOCK_REALTIME);
  set_back = -forward;
  PLAY(engine, Y_OF(true, 0, received), TAKE);
  const bool is_late = count_of(ANSWER) == 1;
  stands_at = 0;
  set_back = 0;
  window = 100;
  destroy_engine(engine);
  return is_late;
}

SCENARIO(a_message_from_before_the_system_time_was_set_keeps_its_time)
{
  CHECK(is_late_after_setting(0));
  CHECK(is_late_after_setting(3600 * (int64_t)1000 * MS));
  CHECK(is_late_after_setting(MS + 1));
  CHECK(!is_late_after_setting(MS));  // no more than the clocks may be read apart
}
