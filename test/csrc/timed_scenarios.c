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
/// Scenarios of the evaluator under FM_TIMED, on a hand-written monitor.
///
/// The monitor, with windows in ns:
///   WITHIN (group 0, reads p): O[0,100] p
///   ANSWER (group 1, reads p and q): H (p -> q); the verdict after the requirements is p -> q
///   ALIVE (group 2, reads got_p and got_q): O[0,10] got_p
///   SHORT (group 3, reads nothing): the first 50 ticks
///   QUIET (group 4, reads q): !q for 20 ticks is a state, and that state lasts at most 30 ticks

#include "evaluator.h"

#include <stdlib.h>
#include <string.h>

#include "scenarios.h"
#include "seen.h"

// ---- the monitor -------------------------------------------------------------------------------

enum { P, Q, GOT_P, GOT_Q, N_INPUTS };
enum { WITHIN, ANSWER, ALIVE, SHORT, QUIET, N_REQUIREMENTS };
enum { P_IMPLIES_Q = N_REQUIREMENTS, N_VERDICTS };
enum { TOPIC_P, TOPIC_Q, TOPIC_OTHER, N_TOPICS };

struct inputs
{
  bool values[N_INPUTS];
};

// What happened last, in ticks; NONE: nothing has.
#define NONE INT64_MIN

struct state
{
  int64_t last_p;    // p was true until then
  int64_t last_got;
  int64_t no_q;      // q is false since then
  int64_t before;    // the tick of the evaluation before
  bool was_p;
  bool was_got;
  bool has_failed;   // H (p -> q) is false
  bool is_first[N_REQUIREMENTS];
};

static uint32_t evaluations[N_REQUIREMENTS];
static int64_t last_tick[N_REQUIREMENTS];

static void note(struct state * state, uint32_t g, int64_t tick)
{
  CHECK(state->is_first[g] ? tick == 0 : tick > last_tick[g]);
  CHECK(tick <= FM_LAST_TICK);
  state->is_first[g] = false;
  evaluations[g] += 1;
  last_tick[g] = tick;
}

static void reset_within(void * state)
{
  ((struct state *)state)->last_p = NONE;
  ((struct state *)state)->was_p = false;
  ((struct state *)state)->is_first[WITHIN] = true;
}

// O[0,b] of an input that was `was` until this tick, and is `is` now.
static bool once(int64_t * last, bool * was, bool is, int64_t tick, int64_t b, int64_t * next)
{
  *last = is ? tick : *was ? tick - 1 : *last;
  *was = is;
  const bool holds = *last != NONE && tick - *last <= b;
  *next = holds && !is ? *last + b + 1 : FM_NEVER;
  return holds;
}

static int64_t within_at(void * state, const void * inputs, bool * verdicts, int64_t tick)
{
  struct state * cells = state;
  int64_t next;
  note(cells, WITHIN, tick);
  verdicts[WITHIN] = once(
    &cells->last_p, &cells->was_p, ((const struct inputs *)inputs)->values[P], tick, 100, &next);
  return next;
}

static void reset_answer(void * state)
{
  ((struct state *)state)->has_failed = false;
  ((struct state *)state)->is_first[ANSWER] = true;
}

static int64_t answer_at(void * state, const void * inputs, bool * verdicts, int64_t tick)
{
  struct state * cells = state;
  const struct inputs * in = inputs;
  note(cells, ANSWER, tick);
  verdicts[P_IMPLIES_Q] = !in->values[P] || in->values[Q];
  cells->has_failed = cells->has_failed || !verdicts[P_IMPLIES_Q];
  verdicts[ANSWER] = !cells->has_failed;
  return FM_NEVER;
}

static void reset_alive(void * state)
{
  ((struct state *)state)->last_got = NONE;
  ((struct state *)state)->was_got = false;
  ((struct state *)state)->is_first[ALIVE] = true;
}

static int64_t alive_at(void * state, const void * inputs, bool * verdicts, int64_t tick)
{
  struct state * cells = state;
  int64_t next;
  note(cells, ALIVE, tick);
  verdicts[ALIVE] = once(
    &cells->last_got, &cells->was_got, ((const struct inputs *)inputs)->values[GOT_P], tick, 10,
    &next);
  return next;
}

static void reset_short(void * state)
{
  ((struct state *)state)->is_first[SHORT] = true;
}

static int64_t short_at(void * state, const void * inputs, bool * verdicts, int64_t tick)
{
  (void)inputs;
  note(state, SHORT, tick);
  verdicts[SHORT] = tick < 50;
  return tick < 50 ? 50 : FM_NEVER;
}

static void reset_quiet(void * state)
{
  ((struct state *)state)->no_q = NONE;
  ((struct state *)state)->is_first[QUIET] = true;
}

static int64_t quiet_at(void * state, const void * inputs, bool * verdicts, int64_t tick)
{
  struct state * cells = state;
  note(cells, QUIET, tick);
  if (((const struct inputs *)inputs)->values[Q]) {
    cells->no_q = NONE;
  } else if (cells->no_q == NONE) {
    cells->no_q = tick;
  }
  const int64_t lasts = cells->no_q == NONE ? 0 : tick - cells->no_q;
  verdicts[QUIET] = lasts < 50;
  return cells->no_q == NONE || lasts >= 50 ? FM_NEVER : cells->no_q + (lasts < 20 ? 20 : 50);
}

static const struct fm_input INPUTS[] = {
  {"p", P, FM_BOOL}, {"q", Q, FM_BOOL}, {"got_p", GOT_P, FM_BOOL}, {"got_q", GOT_Q, FM_BOOL}};
static const uint32_t INDICES[] = {0, 1, 2, 3, 4};
static const struct fm_group GROUPS[] = {
  {&INDICES[P], 1, &INDICES[WITHIN], 1, reset_within, NULL, within_at},
  {&INDICES[P], 2, &INDICES[ANSWER], 1, reset_answer, NULL, answer_at},
  {&INDICES[GOT_P], 2, &INDICES[ALIVE], 1, reset_alive, NULL, alive_at},
  {NULL, 0, &INDICES[SHORT], 1, reset_short, NULL, short_at},
  {&INDICES[Q], 1, &INDICES[QUIET], 1, reset_quiet, NULL, quiet_at}};
static const struct fm_requirement REQUIREMENTS[] = {
  {"WITHIN", 0}, {"ANSWER", 1}, {"ALIVE", 2}, {"SHORT", 3}, {"QUIET", 4}};
static const uint32_t OCCURRENCES[] = {WITHIN, P_IMPLIES_Q, ALIVE, SHORT, QUIET};
static const struct fm_monitor MONITOR = {
  FM_ABI, N_INPUTS, 5, N_REQUIREMENTS, sizeof(struct state), sizeof(struct inputs), INPUTS,
  GROUPS, REQUIREMENTS, "timed", "", NULL, OCCURRENCES, N_VERDICTS - N_REQUIREMENTS, NULL};

static const uint32_t FEEDS_P[] = {P, GOT_P};
static const uint32_t FEEDS_Q[] = {Q, GOT_Q};
static const struct fm_topic TOPICS[] = {{FEEDS_P, 2}, {FEEDS_Q, 2}, {NULL, 0}};
static const uint8_t SOURCES[] = {FM_FIELD, FM_FIELD, FM_RECEPTION, FM_RECEPTION};
static const uint8_t ALL_OCCURRENCES[] = {
  FM_OCCURRENCE, FM_OCCURRENCE, FM_OCCURRENCE, FM_OCCURRENCE, FM_OCCURRENCE};

// ---- helpers -----------------------------------------------------------------------------------

enum { MOST_FOUND = 100 };

static void * memory = NULL;
static struct fm_violation found[MOST_FOUND];
static uint32_t n_found;

static struct fm_evaluator_options options_of(void)
{
  const struct fm_evaluator_options options = {
    &MONITOR, TOPICS, N_TOPICS, FM_TIMED, ALL_OCCURRENCES, NULL, NULL, 0, 0, SOURCES, false, NULL,
    NULL, NULL, NULL, NULL};
  return options;
}

static struct fm_evaluator * make(const struct fm_evaluator_options * options)
{
  free(memory);
  memory = malloc((size_t)fm_evaluator_bytes(options));
  n_found = 0;
  memset(evaluations, 0, sizeof evaluations);
  return fm_evaluator_init(memory, options);
}

static struct fm_evaluator * made(void)
{
  const struct fm_evaluator_options options = options_of();
  return make(&options);
}

// Take all that is due by `now`, as a caller does. The first call begins the time.
static void advance(struct fm_evaluator * evaluator, int64_t now)
{
  do {
    n_found += fm_evaluator_advance(evaluator, now, &found[n_found]);
  } while (fm_evaluator_wake(evaluator) <= now && fm_evaluator_wake(evaluator) != FM_NEVER);
}

static void message(struct fm_evaluator * evaluator, uint32_t topic, bool value, int64_t clock)
{
  const int64_t now = fm_evaluator_arrival(evaluator, clock);
  const union fm_value given = {.i = value};
  const union fm_value yes = {.i = 1};
  const bool has_begun = fm_evaluator_deadline(evaluator) != INT64_MIN;
  if (has_begun && fm_evaluator_now(evaluator) != now) {
    advance(evaluator, now - 1);
  }
  for (uint32_t k = 0; k < TOPICS[topic].n_inputs; ++k) {
    fm_evaluator_store(evaluator, TOPICS[topic].inputs[k], k == 0 ? given : yes, now);
  }
  n_found += fm_evaluator_message(evaluator, topic, now, &found[n_found]);
}

struct event
{
  uint32_t topic;  // N_TOPICS: no message, but the time
  bool value;
  int64_t at;
};

static void play(struct fm_evaluator * evaluator, const struct event * events, size_t count)
{
  for (const struct event * each = events; each < events + count; ++each) {
    if (each->topic == N_TOPICS) {
      advance(evaluator, each->at);
    } else {
      message(evaluator, each->topic, each->value, each->at);
    }
  }
}

#define AT(time) {N_TOPICS, false, time}
#define P_AT(value, time) {TOPIC_P, value, time}
#define Q_AT(value, time) {TOPIC_Q, value, time}
#define OTHER_AT(time) {TOPIC_OTHER, false, time}
#define PLAY(evaluator, ...) \
  play( \
    evaluator, (const struct event[]) {__VA_ARGS__}, \
    sizeof((const struct event[]) {__VA_ARGS__}) / sizeof(struct event))

// Whether a requirement was announced at a time, with a tick.
static bool is_found(uint32_t requirement, int64_t stamp, uint64_t tick)
{
  for (uint32_t k = 0; k < n_found; ++k) {
    if (found[k].requirement == requirement && found[k].stamp == stamp) {
      return found[k].step == tick && !found[k].is_recovery;
    }
  }
  return false;
}

static uint32_t count_of(uint32_t requirement)
{
  uint32_t n = 0;
  for (uint32_t k = 0; k < n_found; ++k) {
    n += found[k].requirement == requirement ? 1u : 0u;
  }
  return n;
}

static bool verdict(const struct fm_evaluator * evaluator, uint32_t requirement)
{
  return fm_evaluator_verdicts(evaluator)[requirement];
}

// ---- deadlines ---------------------------------------------------------------------------------

SCENARIO(a_verdict_turns_false_at_its_deadline_and_not_with_the_next_message)
{
  struct fm_evaluator * evaluator = made();
  PLAY(evaluator, AT(1000), P_AT(true, 1010), P_AT(false, 1020));
  CHECK(count_of(WITHIN) == 0 && evaluations[WITHIN] == 2);
  message(evaluator, TOPIC_OTHER, false, 5000);
  CHECK(count_of(WITHIN) == 1 && is_found(WITHIN, 1120, 110) && evaluations[WITHIN] == 3);
}

SCENARIO(a_deadline_is_told_and_taken_at_its_instant_however_late)
{
  struct fm_evaluator * evaluator = made();
  PLAY(evaluator, AT(0), P_AT(true, 7), P_AT(false, 20), AT(60));
  CHECK(fm_evaluator_deadline(evaluator) == 120);
  advance(evaluator, 119);
  CHECK(count_of(WITHIN) == 0);
  advance(evaluator, 1000000);
  CHECK(is_found(WITHIN, 120, 113) && fm_evaluator_deadline(evaluator) == FM_NEVER);
}

SCENARIO(a_message_at_a_deadline_and_the_deadline_are_one_evaluation)
{
  struct fm_evaluator * evaluator = made();
  PLAY(evaluator, AT(0), P_AT(true, 10), P_AT(false, 20), P_AT(true, 120), AT(120));
  CHECK(count_of(WITHIN) == 0 && evaluations[WITHIN] == 3);
  PLAY(evaluator, P_AT(false, 121), P_AT(true, 222));
  CHECK(count_of(WITHIN) == 1 && is_found(WITHIN, 221, 211) && verdict(evaluator, WITHIN));
}

SCENARIO(an_answer_one_nanosecond_late_is_late)
{
  struct fm_evaluator * evaluator = made();
  PLAY(evaluator, AT(0), P_AT(true, 10), P_AT(false, 11), P_AT(true, 112));
  CHECK(count_of(WITHIN) == 1 && is_found(WITHIN, 111, 101) && verdict(evaluator, WITHIN));
}

SCENARIO(a_change_may_make_another_at_a_later_deadline)
{
  struct fm_evaluator * evaluator = made();
  PLAY(evaluator, AT(0), Q_AT(false, 100), AT(100));
  CHECK(fm_evaluator_deadline(evaluator) <= 120);
  advance(evaluator, 1000);
  CHECK(count_of(QUIET) == 1 && is_found(QUIET, 150, 50) && evaluations[QUIET] == 3);
}

SCENARIO(all_groups_that_are_due_at_an_instant_are_evaluated)
{
  struct fm_evaluator * evaluator = made();
  PLAY(evaluator, P_AT(true, 0), Q_AT(false, 0), AT(50));
  // At the begin: all groups at their tick 0. Then two end their first 50 ticks together.
  CHECK(fm_evaluator_deadline(evaluator) == 51);
  advance(evaluator, 1000);
  CHECK(is_found(SHORT, 100, 50) && is_found(QUIET, 100, 50));
  CHECK(found[n_found - 2].requirement == SHORT && found[n_found - 1].requirement == QUIET);
}

SCENARIO(nothing_is_evaluated_while_nothing_can_change)
{
  struct fm_evaluator * evaluator = made();
  PLAY(evaluator, AT(0), P_AT(true, 10), Q_AT(true, 20), AT(1000));
  uint32_t before[N_REQUIREMENTS];
  memcpy(before, evaluations, sizeof before);
  CHECK(fm_evaluator_deadline(evaluator) == FM_NEVER);
  PLAY(evaluator, AT(INT64_C(3600000000000)), OTHER_AT(INT64_C(7200000000000)));
  CHECK(memcmp(before, evaluations, sizeof before) == 0);
}

SCENARIO(a_message_evaluates_the_groups_that_read_its_topic)
{
  struct fm_evaluator * evaluator = made();
  PLAY(evaluator, AT(0), P_AT(true, 10));
  CHECK(evaluations[WITHIN] == 1 && evaluations[ANSWER] == 0 && evaluations[QUIET] == 0);
  message(evaluator, TOPIC_Q, true, 20);
  CHECK(evaluations[WITHIN] == 1 && evaluations[ANSWER] == 1 && evaluations[QUIET] == 1);
  CHECK(last_tick[ANSWER] == 0);
  message(evaluator, TOPIC_P, true, 25);
  CHECK(evaluations[WITHIN] == 2 && evaluations[ANSWER] == 2 && last_tick[ANSWER] == 5);
}

// ---- the begin ---------------------------------------------------------------------------------

SCENARIO(a_group_that_is_ready_when_time_begins_has_its_tick_0_then)
{
  struct fm_evaluator * evaluator = made();
  const union fm_value no = {.i = 0};
  fm_evaluator_initial(evaluator, Q, no);
  advance(evaluator, 500);
  CHECK(evaluations[QUIET] == 1 && evaluations[SHORT] == 1 && evaluations[WITHIN] == 0);
  advance(evaluator, 1000);
  CHECK(is_found(QUIET, 550, 50) && is_found(SHORT, 550, 50));
}

SCENARIO(a_message_before_the_time_begins_is_of_tick_0)
{
  struct fm_evaluator * evaluator = made();
  PLAY(evaluator, P_AT(true, 3), Q_AT(true, 4));
  CHECK(evaluations[WITHIN] == 0 && evaluations[ALIVE] == 0);
  advance(evaluator, 1000);
  CHECK(evaluations[WITHIN] == 1 && evaluations[ALIVE] == 1 && verdict(evaluator, ALIVE));
  advance(evaluator, 2000);
  CHECK(count_of(ALIVE) == 1 && is_found(ALIVE, 1011, 11));
}

SCENARIO(an_initial_value_that_comes_later_begins_the_group_then)
{
  struct fm_evaluator * evaluator = made();
  const union fm_value no = {.i = 0};
  PLAY(evaluator, AT(500), AT(600));
  fm_evaluator_initial(evaluator, Q, no);
  advance(evaluator, 1000);
  CHECK(is_found(QUIET, 650, 50));
}

// ---- two at one time ---------------------------------------------------------------------------

SCENARIO(of_two_messages_at_one_time_the_later_is_a_nanosecond_later)
{
  struct fm_evaluator * evaluator = made();
  PLAY(evaluator, AT(0), P_AT(true, 100), P_AT(false, 100));
  CHECK(last_tick[WITHIN] == 1 && fm_evaluator_now(evaluator) == 101);
  PLAY(evaluator, P_AT(true, 100), P_AT(false, 103));
  CHECK(last_tick[WITHIN] == 3 && fm_evaluator_now(evaluator) == 103);
  advance(evaluator, 1000);
  CHECK(is_found(WITHIN, 203, 103));
}

SCENARIO(a_clock_that_stands_still_while_messages_come_does_not_go_back)
{
  struct fm_evaluator * evaluator = made();
  advance(evaluator, 0);
  for (int k = 0; k < 20; ++k) {
    message(evaluator, TOPIC_P, k % 2 == 0, 100);
    advance(evaluator, 100);
  }
  CHECK(fm_evaluator_time_counts(evaluator).restarts == 0 && last_tick[WITHIN] == 19);
  advance(evaluator, 110);
  CHECK(fm_evaluator_time_counts(evaluator).restarts == 0 && fm_evaluator_now(evaluator) == 119);
  message(evaluator, TOPIC_P, true, 115);
  CHECK(fm_evaluator_now(evaluator) == 120);
  advance(evaluator, 114);
  CHECK(fm_evaluator_time_counts(evaluator).restarts == 1);
}

SCENARIO(a_message_after_a_deadline_at_its_time_is_a_nanosecond_later)
{
  struct fm_evaluator * evaluator = made();
  PLAY(evaluator, AT(0), Q_AT(false, 10), AT(60));
  CHECK(count_of(QUIET) == 1 && last_tick[QUIET] == 50);
  message(evaluator, TOPIC_Q, true, 60);
  CHECK(last_tick[QUIET] == 51 && verdict(evaluator, QUIET));
}

// ---- receptions --------------------------------------------------------------------------------

SCENARIO(a_reception_is_true_for_one_tick)
{
  struct fm_evaluator * evaluator = made();
  PLAY(evaluator, AT(0), Q_AT(true, 90), P_AT(true, 100));
  CHECK(evaluations[ALIVE] == 1 && fm_evaluator_deadline(evaluator) <= 101);
  advance(evaluator, 101);
  CHECK(evaluations[ALIVE] == 2 && last_tick[ALIVE] == 1);
  advance(evaluator, 1000);
  CHECK(count_of(ALIVE) == 1 && is_found(ALIVE, 111, 11) && evaluations[ALIVE] == 3);
}

SCENARIO(receptions_of_two_topics_are_told_apart)
{
  struct fm_evaluator * evaluator = made();
  bool seen;
  PLAY(evaluator, AT(0), P_AT(true, 100), Q_AT(true, 101));
  CHECK(value_in(evaluator, &MONITOR, GOT_P, &seen) && !seen);
  CHECK(value_in(evaluator, &MONITOR, GOT_Q, &seen) && seen);
  CHECK(evaluations[ALIVE] == 1 && !verdict(evaluator, ALIVE));
  message(evaluator, TOPIC_P, true, 102);
  CHECK(verdict(evaluator, ALIVE) && last_tick[ALIVE] == 1);
  PLAY(evaluator, P_AT(true, 103), P_AT(true, 103));
  CHECK(value_in(evaluator, &MONITOR, GOT_P, &seen) && seen && last_tick[ALIVE] == 3);
  advance(evaluator, 1000);
  CHECK(is_found(ALIVE, 115, 14) && count_of(ALIVE) == 2);
}

SCENARIO(a_group_that_an_initial_value_begins_has_no_reception_from_before)
{
  struct fm_evaluator * evaluator = made();
  const union fm_value no = {.i = 0};
  bool seen;
  PLAY(evaluator, AT(0), P_AT(true, 100), AT(200));
  fm_evaluator_initial(evaluator, GOT_Q, no);
  CHECK(value_in(evaluator, &MONITOR, GOT_P, &seen) && !seen);
  advance(evaluator, 1000);
  CHECK(is_found(ALIVE, 200, 0));
}

// ---- time that goes back, and other clocks -----------------------------------------------------

SCENARIO(time_that_goes_back_starts_the_groups_afresh)
{
  struct fm_evaluator * evaluator = made();
  PLAY(evaluator, AT(0), P_AT(true, 100), Q_AT(false, 200));
  CHECK(count_of(ANSWER) == 1 && !verdict(evaluator, ANSWER));
  advance(evaluator, 1000);
  n_found = 0;
  advance(evaluator, 40);
  CHECK(fm_evaluator_time_counts(evaluator).restarts == 1 && fm_evaluator_now(evaluator) == 40);
  CHECK(last_tick[QUIET] == 0 && last_tick[ANSWER] == 0 && last_tick[SHORT] == 0);
  CHECK(count_of(ANSWER) == 1);  // p is still true and q false: an occurrence of the new run
  advance(evaluator, 1000);
  CHECK(is_found(QUIET, 90, 50) && is_found(SHORT, 90, 50));
  CHECK(fm_evaluator_requirement_counts(evaluator, ANSWER).steps == 2);
}

SCENARIO(after_a_shift_all_deadlines_come_later_by_as_much)
{
  struct fm_evaluator * evaluator = made();
  PLAY(evaluator, AT(0), Q_AT(false, 10));
  fm_evaluator_shift(evaluator, INT64_C(1700000000000000000));
  PLAY(evaluator, P_AT(true, INT64_C(1700000000000000010)), AT(INT64_C(1700000000000000100)));
  CHECK(is_found(QUIET, INT64_C(1700000000000000060), 50));
  CHECK(is_found(SHORT, INT64_C(1700000000000000050), 50));
  CHECK(fm_evaluator_time_counts(evaluator).restarts == 0);
}

SCENARIO(a_reset_starts_the_groups_at_once)
{
  struct fm_evaluator * evaluator = made();
  PLAY(evaluator, AT(0), Q_AT(false, 10), AT(40));
  fm_evaluator_reset(evaluator);
  advance(evaluator, 41);
  CHECK(last_tick[QUIET] == 0 && evaluations[WITHIN] == 0);
  advance(evaluator, 1000);
  CHECK(count_of(QUIET) == 1 && is_found(QUIET, 90, 50) && is_found(SHORT, 90, 50));
}

SCENARIO(a_reset_forgets_what_was_due_before_it)
{
  struct fm_evaluator * evaluator = made();
  PLAY(evaluator, AT(0), Q_AT(false, 10));
  n_found += fm_evaluator_advance(evaluator, 100, &found[n_found]);
  CHECK(fm_evaluator_deadline(evaluator) == 50);
  fm_evaluator_reset(evaluator);
  CHECK(fm_evaluator_deadline(evaluator) == 100);
  n_found += fm_evaluator_advance(evaluator, 100, &found[n_found]);
  CHECK(last_tick[QUIET] == 0 && last_tick[SHORT] == 0);
}

SCENARIO(a_restored_instance_is_due_when_it_was)
{
  struct fm_evaluator * evaluator = made();
  PLAY(evaluator, AT(0), Q_AT(false, 10), P_AT(true, 12));
  void * block = malloc((size_t)fm_evaluator_instance_bytes(evaluator));
  fm_evaluator_save(evaluator, block);
  for (int again = 0; again < 2; ++again) {
    n_found = 0;
    memset(last_tick, 0, sizeof last_tick);
    advance(evaluator, 1000);
    CHECK(is_found(QUIET, 60, 50) && is_found(ALIVE, 23, 11) && is_found(SHORT, 50, 50));
    fm_evaluator_restore(evaluator, block);
  }
  free(block);
}

SCENARIO(times_near_the_end_do_not_overflow)
{
  struct fm_evaluator * evaluator = made();
  const int64_t end = INT64_MAX - 30;
  // after FM_LAST_TICK: starts afresh
  PLAY(evaluator, AT(INT64_MIN), Q_AT(false, INT64_MIN + 10), AT(end - 1), Q_AT(false, end));
  CHECK(last_tick[QUIET] == 0);
  advance(evaluator, INT64_MAX - 1);
  CHECK(last_tick[QUIET] == 20 && fm_evaluator_deadline(evaluator) == FM_NEVER);
}

// ---- silence -----------------------------------------------------------------------------------

SCENARIO(a_stale_group_is_violated_until_its_input_speaks)
{
  static const int64_t TIMEOUTS[] = {0, 30, 0, 0};
  static const bool VIOLATES[] = {false, true, false, false};
  struct fm_evaluator_options options = options_of();
  options.timeouts = TIMEOUTS;
  options.violates = VIOLATES;
  options.reports_recoveries = true;
  struct fm_evaluator * evaluator = make(&options);
  PLAY(evaluator, AT(0), P_AT(true, 10), Q_AT(true, 20));
  CHECK(verdict(evaluator, ANSWER));
  advance(evaluator, 200);
  CHECK(count_of(ANSWER) == 1 && is_found(ANSWER, 50, 30) && is_found(QUIET, 50, 30));
  message(evaluator, TOPIC_P, true, 210);
  CHECK(count_of(ANSWER) == 1 && !verdict(evaluator, ANSWER));
  message(evaluator, TOPIC_Q, true, 220);
  CHECK(verdict(evaluator, ANSWER) && count_of(ANSWER) == 2 && found[n_found - 1].is_recovery);
}

// ---- reports -----------------------------------------------------------------------------------

SCENARIO(occurrences_are_announced_each_time_although_the_verdict_stays_false)
{
  struct fm_evaluator_options options = options_of();
  options.reports_recoveries = true;
  struct fm_evaluator * evaluator = make(&options);
  PLAY(evaluator, AT(0), Q_AT(false, 10));
  n_found = 0;
  for (int k = 0; k < 3; ++k) {
    PLAY(evaluator, P_AT(true, 100 + 10 * k), P_AT(true, 102 + 10 * k));
    CHECK(!fm_evaluator_requirement_counts(evaluator, ANSWER).holds);
    message(evaluator, TOPIC_P, false, 105 + 10 * k);
    CHECK(fm_evaluator_requirement_counts(evaluator, ANSWER).holds);
  }
  uint32_t n = 0;
  for (uint32_t k = 0; k < n_found; ++k) {
    if (found[k].requirement == ANSWER) {
      CHECK(found[k].is_recovery == (n % 2 == 1));
      CHECK(found[k].stamp == 100 + 10 * (int64_t)(n / 2) + (n % 2 == 1 ? 5 : 0));
      n += 1;
    }
  }
  CHECK(n == 6 && !verdict(evaluator, ANSWER));
  CHECK(fm_evaluator_requirement_counts(evaluator, ANSWER).announced == 3);
}

SCENARIO(onset_and_every_step_look_at_the_verdict)
{
  static const uint8_t REPORTS[] = {FM_ONSET, FM_ONSET, FM_ONSET, FM_ONSET, FM_EVERY_STEP};
  struct fm_evaluator_options options = options_of();
  options.reports = REPORTS;
  struct fm_evaluator * evaluator = make(&options);
  PLAY(evaluator, AT(0), Q_AT(false, 10));
  for (int k = 0; k < 3; ++k) {
    PLAY(evaluator, P_AT(true, 100 + 10 * k), P_AT(false, 105 + 10 * k));
  }
  message(evaluator, TOPIC_Q, false, 150);
  CHECK(count_of(ANSWER) == 1 && is_found(ANSWER, 100, 0));
  CHECK(count_of(QUIET) == 2 && is_found(QUIET, 60, 50) && is_found(QUIET, 150, 140));
}

// ---- rows --------------------------------------------------------------------------------------

SCENARIO(rows_give_verdicts_at_rows_and_where_one_changes)
{
  enum { ROOM = 4, MOST = 32 };
  const int64_t times[] = {0, 10, 200};
  const bool p[] = {true, false, true};
  const bool q[] = {true, true, false};
  const bool no[] = {false, false, false};
  const void * const columns[] = {p, q, no, no};
  int64_t instants[MOST];
  bool verdicts[MOST][N_REQUIREMENTS];
  struct fm_rows rows = {columns, times, 3, 0, NULL, NULL};
  struct fm_evaluator * evaluator = made();
  uint64_t n = 0;
  uint64_t more = ROOM;
  while (more == ROOM) {
    more = fm_evaluator_rows(evaluator, &rows, 400, ROOM, &instants[n], verdicts[n]);
    n += more;
  }
  const int64_t expected[] = {0, 10, 50, 110, 200, 250};
  CHECK(n == sizeof expected / sizeof expected[0]);
  for (uint64_t k = 0; k < n && k < 6; ++k) {
    CHECK(instants[k] == expected[k]);
    CHECK(verdicts[k][SHORT] == (expected[k] < 50));
    CHECK(verdicts[k][WITHIN] == (expected[k] < 110 || expected[k] >= 200));
    CHECK(verdicts[k][QUIET] == (expected[k] < 250) && !verdicts[k][ALIVE]);
    CHECK(verdicts[k][ANSWER] == (expected[k] < 200));
  }
}

SCENARIO(without_an_end_rows_end_with_the_last)
{
  const int64_t times[] = {5};
  const bool yes[] = {true};
  const void * const columns[] = {yes, yes, yes, yes};
  int64_t instants[4];
  bool verdicts[4][N_REQUIREMENTS];
  struct fm_rows rows = {columns, times, 1, 0, NULL, NULL};
  struct fm_evaluator * evaluator = made();
  CHECK(fm_evaluator_rows(evaluator, &rows, INT64_MIN, 4, instants, verdicts[0]) == 1);
  CHECK(fm_evaluator_rows(evaluator, &rows, 20, 4, instants, verdicts[0]) == 1);
  CHECK(instants[0] == 16 && !verdicts[0][ALIVE]);  // a reception lasts one tick in a row, too
}

// ---- refusals ----------------------------------------------------------------------------------

SCENARIO(options_that_do_not_fit_are_refused)
{
  static const uint8_t WRONG_REPORT[] = {0, 0, FM_UNREPORTED + 1, 0, 0};
  static const uint8_t WRONG_SOURCE[] = {0, 0, FM_AGE, 0};
  static const uint32_t OUTSIDE[] = {0, N_VERDICTS, 2, 3, 4};
  struct fm_evaluator_options options = options_of();
  CHECK(make(&options) != NULL);
  options.policy = FM_EVERY_MESSAGE;  // the groups have no `step`
  CHECK(make(&options) == NULL);
  options = options_of();
  options.reports = WRONG_REPORT;
  CHECK(make(&options) == NULL);
  options = options_of();
  options.sources = WRONG_SOURCE;
  CHECK(make(&options) == NULL);
  struct fm_monitor monitor = MONITOR;
  monitor.occurrences = OUTSIDE;
  options = options_of();
  options.monitor = &monitor;
  CHECK(make(&options) == NULL);
}
