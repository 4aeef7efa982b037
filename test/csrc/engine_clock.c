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

/// engine_clock.c: an engine that follows clocks which run, for the thread sanitizer.
///
/// Input `fed` gets a message in time, `quiet` does not, and requirement BEAT is violated in each
/// period. Meanwhile groups are reset, details are wanted and not, the engine is woken, and the
/// clock is changed for another one. Each period is taken once and stamped on its grid, however
/// late; `fed` is never silent. With engine_pause.h, threads also sleep between any two steps of
/// the engine that handle time.

#define _POSIX_C_SOURCE 200809L

#include "engine.h"
#include "seen.h"
#include "engines.h"

#include <pthread.h>
#include <stdio.h>
#include <time.h>

#ifdef FM_PAUSE
enum { PERIOD_MS = 40, RUN_MS = 8000, FED_MS = 4000, FEED_MS = 50, QUIET_MS = 200, SEND_MS = 1500,
  RESET_MS = 300, CHANGE_MS = 2000, WAKE_MS = 5 };
#else
enum { PERIOD_MS = 10, RUN_MS = 3000, FED_MS = 500, FEED_MS = 5, QUIET_MS = 30, SEND_MS = 200,
  RESET_MS = 30, CHANGE_MS = 300, WAKE_MS = 1 };
#endif

enum { BEAT, FED, QUIET, N_REQUIREMENTS, N_TOPICS = 2, MOST = 8192, PATIENCE_MS = 10,
  LEAST_SENT = 4 };

#define MS 1000000
#define OTHER_CLOCK 4000000000000000000  // ns ahead of the steady one; the system time is less
#define SYSTEM_TIME_MOVES 100000         // ns, when it is measured better: ten times CLOSE_NS

static int failures = 0;

#define CHECK(condition) check((condition), #condition, __LINE__)

static void check(bool condition, const char * text, int line)
{
  if (!condition) {
    printf("line %d: not so: %s\n", line, text);
    __atomic_fetch_add(&failures, 1, __ATOMIC_RELAXED);
  }
}

// ---- time --------------------------------------------------------------------------------------

static int64_t steady(void)
{
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (int64_t)now.tv_sec * 1000 * MS + (int64_t)now.tv_nsec;
}

static int other_clock(void * clock, int64_t * nanoseconds)
{
  (void)clock;
  *nanoseconds = steady() + OTHER_CLOCK;
  return 0;
}

static bool is_other(int64_t stamp) {return stamp > OTHER_CLOCK;}

static void sleep_ms(int64_t milliseconds)
{
  const struct timespec span = {
    (time_t)(milliseconds / 1000), (long)(milliseconds % 1000) * MS};
  nanosleep(&span, NULL);
}

#ifdef FM_PAUSE
void pause_at_random(void)
{
  static uint32_t calls = 0;
  const uint32_t chance = __atomic_add_fetch(&calls, 1, __ATOMIC_RELAXED) * 2654435761u >> 8;
  if (chance % 4 == 0) {
    sleep_ms(chance / 4 % 31);
  }
}
#endif

// ---- a monitor ---------------------------------------------------------------------------------

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
  (void)inputs;
  verdicts[FED] = true;
}

static void step_quiet(void * state, const void * inputs, bool * verdicts)
{
  (void)state;
  (void)inputs;
  verdicts[QUIET] = true;
}

static const uint32_t numbers[] = {0, 1, 2};
static const struct fm_input inputs[] = {{"fed", 0, FM_BOOL}, {"quiet", 1, FM_BOOL}};
static const struct fm_group groups[] = {
  {NULL, 0, &numbers[BEAT], 1, reset, step_beat, NULL},
  {&numbers[0], 1, &numbers[FED], 1, reset, step_fed, NULL},
  {&numbers[1], 1, &numbers[QUIET], 1, reset, step_quiet, NULL}};
static const struct fm_requirement requirements[] = {{"BEAT", 0}, {"FED", 1}, {"QUIET", 2}};
static const struct fm_monitor monitor = {
  FM_ABI, 2, 3, N_REQUIREMENTS, 8, 8, inputs, groups, requirements, "m", "", NULL, NULL, 0, NULL};
static const struct fm_topic topics[] = {{&numbers[0], 1}, {&numbers[1], 1}};

static bool read_message(const uint8_t * message, size_t size, struct fm_field * fields)
{
  (void)size;
  fields[0].value.i = message[0];
  fields[0].outcome = FM_FIELD_READ;
  return true;
}

static const struct fm_reader reader[] = {
  {.read = read_message, .n_inputs = 1},
  {.read = read_message, .n_inputs = 1}};
static const struct fm_readers readers = {FM_ABI, N_TOPICS, reader};

static struct fm_engine * make(int64_t fed_ms)
{
  const int64_t timeouts[] = {fed_ms * MS, (int64_t)QUIET_MS * MS};
  const bool violates[] = {true, true};
  const uint8_t onsets[] = {FM_EVERY_STEP, FM_EVERY_STEP, FM_ONSET};
  const struct fm_evaluator_options options = {
    .monitor = &monitor, .topics = topics, .n_topics = N_TOPICS, .policy = FM_PERIODIC,
    .reports = onsets, .timeouts = timeouts, .violates = violates,
    .period = (int64_t)PERIOD_MS * MS, .patience = (int64_t)PATIENCE_MS * MS};
  return create_engine(&options, &readers, -1);
}

static void deliver(struct fm_engine * engine, uint32_t topic)
{
  const uint8_t message[] = {1};
  const struct fm_origin origin = {steady(), 0, 0, NULL, false, NULL, 0};
  CHECK(fm_engine_message(engine, topic, message, sizeof(message), &origin) == FM_RECEIVED);
}

// ---- threads -----------------------------------------------------------------------------------

static bool is_over;

static bool is_running(void) {return !__atomic_load_n(&is_over, __ATOMIC_ACQUIRE);}

static int64_t longest_gap;  // between two messages for `fed`, ns

static void * feed(void * engine)
{
  int64_t last = steady();
  while (is_running()) {
    deliver(engine, 0);
    const int64_t now = steady();
    longest_gap = now - last > longest_gap ? now - last : longest_gap;
    last = now;
    sleep_ms(FEED_MS);
  }
  return NULL;
}

static uint64_t sent;  // messages for `quiet`; atomic

static void * send_seldom(void * engine)
{
  while (is_running()) {
    sleep_ms(SEND_MS);
    deliver(engine, 1);
    __atomic_fetch_add(&sent, 1, __ATOMIC_RELAXED);
  }
  return NULL;
}

static uint64_t resets;

static void * disturb(void * engine)
{
  while (is_running()) {
    sleep_ms(RESET_MS);
    fm_engine_reset(engine);
    resets += 1;
    fm_engine_want_details(engine, resets % 2 == 0, 1000);
    CHECK(fm_engine_deadline(engine) != FM_NEVER);
    CHECK(time_counts_of(engine).restarts == 0);
  }
  return NULL;
}

static void * wake(void * engine)
{
  while (is_running()) {
    sleep_ms(WAKE_MS);
    fm_engine_wake(engine);
    CHECK(silence_of(engine, 0).lasted >= 0);
  }
  return NULL;
}

static uint64_t changes;
static int64_t lost;  // ns between a reading of one clock and the first of the other, at most

static void * change_clocks(void * engine)
{
  while (is_running()) {
    sleep_ms(CHANGE_MS);
    const int64_t begin = steady();
    if (changes % 2 == 0) {
      fm_engine_follow_clock(engine, other_clock, NULL, false);
      fm_engine_begin(engine);
    } else {
      fm_engine_follow_steady(engine);
      fm_engine_begin(engine);
    }
    lost += steady() - begin;
    changes += 1;
  }
  return NULL;
}

// A timeout that was put off comes after what was due meanwhile, stamped with its end.
static bool is_in_order(const struct fm_violation * violation, int64_t last)
{
  const int64_t stamp = violation->stamp;
  return is_other(stamp) != is_other(last) || stamp >= last || violation->requirement != BEAT;
}

static void * take_details(void * engine)
{
  uint64_t room[32];
  int64_t last = 0;
  while (is_running()) {
    struct fm_detail * detail = (struct fm_detail *)(void *)room;
    if (fm_engine_take_detail(engine, detail, 20)) {
      CHECK(is_in_order(&detail->violation, last));
      last = detail->violation.stamp;
    }
  }
  return NULL;
}

static struct fm_violation taken[MOST];
static uint32_t n_taken;

static void * take(void * engine)
{
  bool is_closed = false;
  uint32_t n = 0;
  do {
    is_closed = fm_engine_is_closed(engine);
    n = fm_engine_take(engine, &taken[n_taken], 64, 1000);
    n_taken += n;
  } while ((n > 0 || !is_closed) && n_taken + 64 < MOST);
  return NULL;
}

// ---- checks ------------------------------------------------------------------------------------

static int64_t distance(int64_t one, int64_t other)
{
  return one < other ? other - one : one - other;
}

// Violations come in the order of their instants, but for timeouts that were put off; each period
// once, on a grid that only a change of the clock moves. Returns the number of periods.
static uint64_t check_order(void)
{
  uint64_t beats = 0;
  uint64_t first_steps = 0;
  uint64_t clocks = 0;
  struct fm_violation last = {0, 0, 0, false, false, false};
  struct fm_violation beat = {0, 0, 0, false, false, false};
  for (uint32_t k = 0; k < n_taken; ++k) {
    const struct fm_violation now = taken[k];
    const bool is_changed = is_other(now.stamp) != is_other(last.stamp);
    CHECK(is_in_order(&now, last.stamp));
    clocks += is_changed ? 1u : 0u;
    last = now;
    if (now.requirement == BEAT) {
      CHECK(beats == 0 || is_other(beat.stamp) != is_other(now.stamp) ||
        distance(now.stamp, beat.stamp + PERIOD_MS * MS) < SYSTEM_TIME_MOVES);
      CHECK(now.step == 0 || now.step == beat.step + 1);
      first_steps += now.step == 0 ? 1u : 0u;
      beats += 1;
      beat = now;
    }
  }
  CHECK(clocks <= changes && clocks + 2 >= changes);
  CHECK(first_steps <= resets + 1);
  return beats;
}

static void check_counts(struct fm_engine * engine, int64_t least, int64_t most)
{
  const struct fm_time_counts counts = time_counts_of(engine);
  const struct fm_silence quiet = silence_of(engine, 1);
  const uint64_t beats = check_order();
  CHECK(counts.periods == beats && counts.missed == 0 && counts.restarts == 0);
  CHECK(requirement_counts_of(engine, BEAT).steps == beats);
  CHECK((int64_t)beats >= (least - lost) / (PERIOD_MS * MS) - 1);
  CHECK((int64_t)beats <= most / (PERIOD_MS * MS) + 1);
  CHECK(quiet.count <= sent + 1 && quiet.count >= sent / 2);
  CHECK(requirement_counts_of(engine, QUIET).announced >= quiet.count);
  if (longest_gap < (FED_MS - PATIENCE_MS) * (int64_t)MS) {
    CHECK(silence_of(engine, 0).count == 0);
    CHECK(requirement_counts_of(engine, FED).violations == 0);
  }
#ifndef FM_PAUSE
  CHECK(counts.late * 2 < counts.periods);
#endif
}

// ---- tests -------------------------------------------------------------------------------------

static void threads_share_an_engine_that_follows_clocks(void)
{
  void * (* const functions[])(void *) = {
    take, feed, send_seldom, disturb, wake, change_clocks, take_details};
  enum { N_THREADS = sizeof(functions) / sizeof(*functions) };
  pthread_t threads[N_THREADS];
  struct fm_engine * engine = make(FED_MS);
  const int64_t begin = steady();
  fm_engine_follow_steady(engine);
  fm_engine_begin(engine);
  const int64_t begun = steady();
  for (int k = 0; k < N_THREADS; ++k) {
    pthread_create(&threads[k], NULL, functions[k], engine);
  }
  sleep_ms(RUN_MS);
  while (__atomic_load_n(&sent, __ATOMIC_RELAXED) < LEAST_SENT) {  // on a busy machine
    sleep_ms(PERIOD_MS);
  }
  __atomic_store_n(&is_over, true, __ATOMIC_RELEASE);
  for (int k = 1; k < N_THREADS; ++k) {
    pthread_join(threads[k], NULL);
  }
  const int64_t end = steady();
  (void)silence_of(engine, 0);  // takes what is due
  fm_engine_close(engine);
  const int64_t ended = steady();
  pthread_join(threads[0], NULL);
  check_counts(engine, end - begun, ended - begin);
  destroy_engine(engine);
}

static void a_process_that_did_not_run_loses_no_period_and_finds_no_silence(void)
{
  struct fm_engine * engine = make(3 * PERIOD_MS);
  fm_engine_follow_steady(engine);
  fm_engine_begin(engine);
  sleep_ms(30 * PERIOD_MS);
  deliver(engine, 0);  // it was waiting
  CHECK(silence_of(engine, 0).count == 0);
  const uint32_t n = fm_engine_take(engine, taken, MOST, 0);
  uint64_t beats = 0;
  int64_t last = 0;
  for (uint32_t k = 0; k < n; ++k) {
    if (taken[k].requirement == BEAT) {
      CHECK(taken[k].step == beats);
      CHECK(beats == 0 || distance(taken[k].stamp, last + PERIOD_MS * MS) < SYSTEM_TIME_MOVES);
      last = taken[k].stamp;
      beats += 1;
    }
  }
  CHECK(beats >= 30 && time_counts_of(engine).missed == 0);
  const int64_t begin = steady();
  while (silence_of(engine, 0).count == 0 && steady() < begin + 60000 * (int64_t)MS) {
    sleep_ms(PERIOD_MS);
  }
  CHECK(silence_of(engine, 0).is_silent);
  destroy_engine(engine);
}

static void an_engine_may_be_closed_in_the_middle_of_a_wait(void)
{
  for (int k = 0; k < 20; ++k) {
    pthread_t taker;
    struct fm_engine * engine = make(FED_MS);
    n_taken = 0;
    pthread_create(&taker, NULL, take, engine);
    fm_engine_follow_steady(engine);
    fm_engine_begin(engine);
    sleep_ms(k % 3 * PERIOD_MS / 2);
    fm_engine_wake(engine);
    fm_engine_close(engine);
    pthread_join(taker, NULL);
    uint64_t beats = 0;  // where the processors are busy, `quiet` is silent too
    for (uint32_t n = 0; n < n_taken; ++n) {
      beats += taken[n].requirement == BEAT ? 1u : 0u;
    }
    CHECK(beats == time_counts_of(engine).periods);
    destroy_engine(engine);
  }
}

int main(void)
{
  threads_share_an_engine_that_follows_clocks();
  a_process_that_did_not_run_loses_no_period_and_finds_no_silence();
  an_engine_may_be_closed_in_the_middle_of_a_wait();
  return failures == 0 ? 0 : 1;
}
