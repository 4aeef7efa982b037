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

/// engine_time.c: an engine whose time is told, or follows a clock that the test sets.

#define _POSIX_C_SOURCE 200809L

#include "engine.h"
#include "seen.h"

#include <stdio.h>
#include <stdlib.h>

#include "engines.h"
#include "fakes.h"
#include "scenarios.h"

enum { BEAT, FED, N_REQUIREMENTS, PERIOD = 100, TIMEOUT = 1000, PATIENCE = 10, MOST = 4096 };

// ---- a monitor ---------------------------------------------------------------------------------

// BEAT reads no input and is violated in each step; FED reads a bool and is violated when it is
// false, or silent.
static void reset(void * state) {(void)state;}

static void step_beat(void * state, const void * inputs, bool * verdicts)
{
  (void)state;
  (void)inputs;
  verdicts[BEAT] = false;
}

static void step_fed(void * state, const void * inputs, bool * verdicts)
{
  (void)state;
  verdicts[FED] = *(const bool *)inputs;
}

static const uint32_t numbers[] = {0, 1};
static const struct fm_input inputs[] = {{"x", 0, FM_BOOL}};
static const struct fm_group groups[] = {
  {NULL, 0, &numbers[BEAT], 1, reset, step_beat, NULL},
  {&numbers[0], 1, &numbers[FED], 1, reset, step_fed, NULL}};
static const struct fm_requirement requirements[] = {{"BEAT", 0}, {"FED", 1}};
static const struct fm_monitor monitor = {
  FM_ABI, 1, 2, N_REQUIREMENTS, 8, 8, inputs, groups, requirements, "m", "", NULL, NULL, 0, NULL};
static const struct fm_topic topics[] = {{&numbers[0], 1}};

static bool read_message(const uint8_t * message, size_t size, struct fm_field * fields)
{
  fields[0].value.i = size > 0 ? message[0] : 0;
  fields[0].outcome = FM_FIELD_READ;
  return size > 0;
}

static const struct fm_reader reader[] = {{.read = read_message, .n_inputs = 1}};
static const struct fm_readers readers = {FM_ABI, 1, reader};

// ---- an engine ---------------------------------------------------------------------------------

static struct fm_engine * make(uint32_t policy, int64_t timeout, int64_t patience)
{
  const int64_t timeouts[] = {timeout};
  const bool violates[] = {true};
  const struct fm_evaluator_options options = {
    .monitor = &monitor, .topics = topics, .n_topics = 1, .policy = policy, .timeouts = timeouts,
    .violates = violates, .period = PERIOD, .patience = patience};
  return create_engine(&options, &readers, -1);
}

static uint32_t deliver_to(struct fm_engine * engine, uint32_t topic, bool value, int64_t received)
{
  const uint8_t message[] = {value};
  const struct fm_origin origin = {received, 0, 0, NULL, false, NULL, 0};
  return fm_engine_message(engine, topic, message, sizeof(message), &origin);
}

static void deliver(struct fm_engine * engine, bool value, int64_t received)
{
  CHECK(deliver_to(engine, 0, value, received) == FM_RECEIVED);
}

static struct fm_violation taken[MOST];

static uint32_t take(struct fm_engine * engine)
{
  return fm_engine_take(engine, taken, MOST, 0);
}

static bool is_taken(uint32_t k, uint32_t requirement, int64_t stamp)
{
  return taken[k].requirement == requirement && taken[k].stamp == stamp;
}

static bool are_counted(
  struct fm_engine * engine, uint64_t periods, uint64_t missed, uint64_t restarts)
{
  const struct fm_time_counts counts = time_counts_of(engine);
  return counts.periods == periods && counts.missed == missed && counts.restarts == restarts;
}

static void follow(struct fm_engine * engine, struct clock * clock)
{
  fm_engine_follow_clock(engine, read_clock, clock, false);
  fm_engine_begin(engine);
}

// ---- tests -------------------------------------------------------------------------------------

SCENARIO(what_is_due_is_stamped_with_its_instant)
{
  struct fm_engine * engine = make(FM_PERIODIC, 0, 0);
  CHECK(fm_engine_deadline(engine) == FM_NEVER);
  fm_engine_advance(engine, 7);
  CHECK(fm_engine_deadline(engine) == 7 + PERIOD && take(engine) == 0);
  fm_engine_advance(engine, 6 + PERIOD);
  CHECK(take(engine) == 0);
  fm_engine_advance(engine, 7 + PERIOD);
  CHECK(take(engine) == 1 && is_taken(0, BEAT, 7 + PERIOD) && taken[0].step == 0);
  fm_engine_advance(engine, 50 + 10 * PERIOD);
  CHECK(take(engine) == 9);
  for (uint32_t k = 0; k < 9; ++k) {
    CHECK(is_taken(k, BEAT, 7 + (k + 2) * PERIOD) && taken[k].step == k + 1);
  }
  const struct fm_time_counts counts = time_counts_of(engine);
  CHECK(counts.periods == 10 && counts.late == 8 && counts.missed == 0 && counts.restarts == 0);
  destroy_engine(engine);
}

SCENARIO(of_very_many_periods_the_last_are_taken)
{
  struct clock clock = {PERIOD, false};
  struct fm_engine * engine = make(FM_PERIODIC, 0, 0);
  follow(engine, &clock);
  clock.now = 3001 * PERIOD + 1;
  CHECK(take(engine) == FM_MOST_PERIODS_BEHIND && are_counted(engine, 1000, 2000, 0));
  for (uint32_t k = 0; k < FM_MOST_PERIODS_BEHIND; ++k) {
    CHECK(is_taken(k, BEAT, (2002 + (int64_t)k) * PERIOD));
  }
  destroy_engine(engine);
}

SCENARIO(a_clock_that_goes_back_loses_no_period_and_adds_none)
{
  struct clock clock = {1000000, false};
  struct fm_engine * engine = make(FM_PERIODIC, TIMEOUT, 0);
  follow(engine, &clock);
  clock.now += 30;
  CHECK(take(engine) == 0);
  clock.now = 5;
  CHECK(take(engine) == 0 && are_counted(engine, 0, 0, 1));
  CHECK(fm_engine_deadline(engine) == 5 + PERIOD - 30);
  clock.now = 5 + PERIOD - 29;
  CHECK(take(engine) == 1 && is_taken(0, BEAT, 5 + PERIOD - 30));
  clock.now = 5 + TIMEOUT - 30;
  CHECK(take(engine) == 8 && !silence_of(engine, 0).is_silent);
  clock.now = 5 + TIMEOUT - 29;
  CHECK(take(engine) == 2 && is_taken(0, FED, clock.now - 1) && is_taken(1, BEAT, clock.now - 1));
  deliver(engine, true, 3);
  clock.now = 1;
  deliver(engine, true, 3);
  CHECK(are_counted(engine, 10, 0, 2));
  destroy_engine(engine);
}

SCENARIO(a_clock_without_time_lets_nothing_be_due)
{
  struct clock clock = {0, false};
  struct fm_engine * engine = make(FM_EVERY_MESSAGE, TIMEOUT, 0);
  follow(engine, &clock);
  deliver(engine, false, 77);
  CHECK(take(engine) == 2 && is_taken(0, BEAT, 0) && is_taken(1, FED, 0));
  clock.now = 500;
  clock.fails = true;
  deliver(engine, false, 78);
  CHECK(take(engine) == 2 && is_taken(1, FED, 0));
  clock.fails = false;
  CHECK(take(engine) == 0 && fm_engine_deadline(engine) == 500 + TIMEOUT);
  deliver(engine, false, 79);
  CHECK(take(engine) == 2 && is_taken(1, FED, 500));
  clock.now += TIMEOUT;
  clock.fails = true;
  CHECK(take(engine) == 0);
  deliver(engine, true, 80);
  CHECK(take(engine) == 1 && is_taken(0, BEAT, 0));
  clock.fails = false;
  CHECK(take(engine) == 0 || silence_of(engine, 0).is_silent);
  destroy_engine(engine);
}

SCENARIO(a_message_at_the_instant_of_a_deadline_comes_first)
{
  struct clock clock = {100, false};
  for (int is_told = 0; is_told < 2; ++is_told) {
    struct fm_engine * engine = make(FM_PERIODIC, TIMEOUT, 0);
    clock.now = 100;
    if (is_told) {
      fm_engine_advance(engine, 100);
    } else {
      follow(engine, &clock);
    }
    for (int64_t now = 100 + TIMEOUT; now < 100 + 10 * TIMEOUT; now += TIMEOUT) {
      clock.now = now;
      deliver(engine, true, now);
    }
    CHECK(silence_of(engine, 0).count == 0);
    // What is due at the time at which a clock stands is due when it moves on.
    clock.now += TIMEOUT - (is_told ? 1 : 0);
    fm_engine_advance(engine, clock.now);
    CHECK(!silence_of(engine, 0).is_silent);
    clock.now += 1;
    fm_engine_advance(engine, clock.now);
    const struct fm_silence silence = silence_of(engine, 0);
    CHECK(silence.is_silent && silence.count == 1);
    CHECK(silence.lasted == TIMEOUT + (is_told ? 0 : 1));
    destroy_engine(engine);
  }
}

SCENARIO(a_timeout_that_is_found_late_is_put_off_once)
{
  struct clock clock = {100, false};
  struct fm_engine * engine = make(FM_EVERY_MESSAGE, TIMEOUT, PATIENCE);
  follow(engine, &clock);
  clock.now += 5 * TIMEOUT;  // the process was stopped, and a message is waiting
  CHECK(take(engine) == 0 && silence_of(engine, 0).count == 0);
  CHECK(fm_engine_deadline(engine) == clock.now + TIMEOUT);
  deliver(engine, true, 0);
  CHECK(silence_of(engine, 0).count == 0 && take(engine) == 1);
  clock.now += TIMEOUT + PATIENCE + 1;
  CHECK(take(engine) == 0 && fm_engine_deadline(engine) == clock.now + 10 * PATIENCE);
  clock.now += 5 * TIMEOUT;  // not put off twice
  CHECK(take(engine) == 1 && is_taken(0, FED, clock.now - 5 * TIMEOUT - PATIENCE - 1));
  deliver(engine, true, 0);
  clock.now += TIMEOUT + PATIENCE;
  CHECK(take(engine) == 2 && is_taken(1, FED, clock.now - PATIENCE));
  destroy_engine(engine);
}

SCENARIO(a_timeout_that_a_coarse_clock_finds_late_is_not_put_off)
{
  for (int is_quiet = 0; is_quiet < 2; ++is_quiet) {
    struct clock clock = {100, false};
    struct fm_engine * engine = make(FM_EVERY_MESSAGE, TIMEOUT, PATIENCE);
    follow(engine, &clock);
    for (; clock.now < 100 + TIMEOUT; clock.now += 2 * TIMEOUT / 5) {
      if (is_quiet) {
        fm_engine_wake(engine);  // as a node does at each tick
      } else {
        CHECK(take(engine) == 0);
      }
    }
    CHECK(clock.now > 100 + TIMEOUT + PATIENCE);
    fm_engine_wake(engine);
    CHECK(take(engine) == 1 && is_taken(0, FED, 100 + TIMEOUT));
    clock.now -= 2 * TIMEOUT;  // what was seen before the clock went back shows nothing of after
    fm_engine_wake(engine);
    CHECK(take(engine) == 0 && silence_of(engine, 0).is_silent);
    deliver(engine, true, 0);
    clock.now += 2 * TIMEOUT;
    fm_engine_wake(engine);
    CHECK(take(engine) == 1 && silence_of(engine, 0).count == 1);
    destroy_engine(engine);
  }
}

SCENARIO(another_source_of_the_time_puts_nothing_off)
{
  struct clock one = {1000000, false};
  struct clock other = {5, false};
  struct clock none = {0, false};
  struct fm_engine * engine = make(FM_PERIODIC, TIMEOUT, 0);
  fm_engine_advance(engine, -50);
  fm_engine_advance(engine, -20);  // 70 are left
  follow(engine, &one);
  CHECK(fm_engine_deadline(engine) == one.now + 70);
  fm_engine_advance(engine, INT64_MAX);  // ignored: the time is not told
  one.now += 30;
  follow(engine, &other);
  CHECK(fm_engine_deadline(engine) == other.now + 40);
  other.now += 41;
  CHECK(take(engine) == 1 && is_taken(0, BEAT, 45));
  other.now += 9;
  follow(engine, &none);
  CHECK(take(engine) == 0);
  none.now = 7000;
  CHECK(take(engine) == 0 && fm_engine_deadline(engine) == 7090);
  CHECK(are_counted(engine, 1, 0, 0));
  destroy_engine(engine);
}

SCENARIO(a_reset_finds_a_silent_input_anew)
{
  struct clock clock = {100, false};
  struct fm_engine * engine = make(FM_EVERY_MESSAGE, TIMEOUT, 0);
  follow(engine, &clock);
  clock.now += TIMEOUT + 1;
  CHECK(take(engine) == 1 && is_taken(0, FED, 100 + TIMEOUT));
  fm_engine_reset(engine);
  CHECK(take(engine) == 0);
  clock.now += 1;
  CHECK(take(engine) == 1 && is_taken(0, FED, clock.now - 1) && taken[0].step == 0);
  CHECK(silence_of(engine, 0).count == 1 && take(engine) == 0);
  destroy_engine(engine);
}

SCENARIO(a_closed_engine_takes_nothing)
{
  struct clock clock = {100, false};
  struct fm_engine * engine = make(FM_PERIODIC, TIMEOUT, 0);
  follow(engine, &clock);
  fm_engine_close(engine);
  clock.now += 10 * TIMEOUT;
  deliver(engine, true, 0);
  CHECK(take(engine) == 0 && are_counted(engine, 0, 0, 0));
  CHECK(topic_counts_of(engine, 0).messages == 0);
  CHECK(!silence_of(engine, 0).is_silent);
  destroy_engine(engine);
  engine = make(FM_PERIODIC, TIMEOUT, 0);
  fm_engine_advance(engine, 0);
  fm_engine_close(engine);
  fm_engine_advance(engine, 10 * TIMEOUT);
  CHECK(take(engine) == 0 && are_counted(engine, 0, 0, 0));
  destroy_engine(engine);
}

// ---- bad input ---------------------------------------------------------------------------------

SCENARIO(a_record_of_an_unknown_topic_is_ignored)
{
  struct fm_engine * engine = make(FM_EVERY_MESSAGE, TIMEOUT, 0);
  uint8_t room[8];
  CHECK(deliver_to(engine, 1, true, 0) == FM_RECEIVED);
  CHECK(deliver_to(engine, UINT32_MAX, true, 0) == FM_RECEIVED);
  CHECK(take(engine) == 0 && topic_counts_of(engine, 0).messages == 0);
  CHECK(topic_counts_of(engine, 1).messages == 0);
  CHECK(input_counts_of(engine, 0).received == 0);
  CHECK(fm_engine_lost(engine, 1) == 0 && fm_engine_evidence(engine, 1, room, 8) == 0);
  CHECK(!silence_of(engine, 1).is_silent && !value_of(engine, 1, room));
  fm_engine_begin_handover(engine, 1, true);
  fm_engine_end_handover(engine, 1);
  destroy_engine(engine);
}

SCENARIO(an_engine_of_another_abi_is_refused)
{
  struct fm_monitor other = monitor;
  other.abi = FM_ABI + 1;
  struct fm_evaluator_options options = {
    .monitor = &other, .topics = topics, .n_topics = 1, .policy = FM_PERIODIC, .period = PERIOD};
  CHECK(fm_evaluator_bytes(&options) == 0);
  options.monitor = &monitor;
  void * memory = malloc((size_t)fm_evaluator_bytes(&options));
  options.monitor = &other;
  CHECK(fm_evaluator_init(memory, &options) == NULL);
  options.monitor = &monitor;
  struct fm_evaluator * evaluator = fm_evaluator_init(memory, &options);
  const struct fm_readers misfits[] = {
    {FM_ABI + 1, 1, reader}, {FM_ABI, 2, reader}, {FM_ABI, 0, reader},
    {FM_ABI, 1, (const struct fm_reader[]) {{.read = read_message, .n_inputs = 2}}}};
  for (size_t k = 0; k < sizeof(misfits) / sizeof(*misfits); ++k) {
    const struct fm_engine_options made = {
      .evaluator = evaluator, .monitor = &monitor, .readers = &misfits[k], .topics = topics,
      .n_topics = 1};
    CHECK(fm_engine_create(&made) == NULL);
  }
  const struct fm_engine_options none = {
    .evaluator = evaluator, .monitor = &monitor, .topics = topics, .n_topics = 1};
  CHECK(fm_engine_create(&none) == NULL);
  free(memory);
}

SCENARIO(a_deadline_that_never_comes_is_not_waited_for)
{
  struct fm_engine * engine = make(FM_EVERY_MESSAGE, 0, 0);
  fm_engine_advance(engine, 0);
  CHECK(fm_engine_deadline(engine) == FM_NEVER);
  fm_engine_advance(engine, FM_NEVER);
  deliver(engine, true, FM_NEVER);
  CHECK(take(engine) == 1 && fm_engine_deadline(engine) == FM_NEVER);
  destroy_engine(engine);
  engine = make(FM_PERIODIC, TIMEOUT, 0);
  fm_engine_advance(engine, FM_NEVER - PERIOD - 1);
  deliver(engine, true, FM_NEVER - PERIOD - 1);
  fm_engine_advance(engine, FM_NEVER);
  CHECK(take(engine) == 1 && is_taken(0, BEAT, FM_NEVER - 1));
  CHECK(fm_engine_deadline(engine) == FM_NEVER);
  fm_engine_advance(engine, FM_NEVER);
  CHECK(take(engine) == 0);
  destroy_engine(engine);
}

SCENARIO(times_at_the_ends_of_the_range_are_times)
{
  struct clock clock = {INT64_MAX - 1, false};
  struct fm_engine * engine = make(FM_PERIODIC, TIMEOUT, PATIENCE);
  fm_engine_advance(engine, INT64_MIN);
  fm_engine_advance(engine, INT64_MIN + 10);
  follow(engine, &clock);
  CHECK(take(engine) <= FM_MOST_PERIODS_BEHIND);
  clock.now = 1;
  CHECK(take(engine) <= FM_MOST_PERIODS_BEHIND && time_counts_of(engine).restarts == 1);
  deliver(engine, true, 0);
  destroy_engine(engine);
  engine = make(FM_PERIODIC, TIMEOUT, PATIENCE);
  fm_engine_advance(engine, INT64_MIN);
  fm_engine_advance(engine, INT64_MAX - 1);
  CHECK(take(engine) == FM_MOST_PERIODS_BEHIND);
  fm_engine_advance(engine, INT64_MIN);
  CHECK(take(engine) == 0 && time_counts_of(engine).restarts == 1);
  destroy_engine(engine);
}
