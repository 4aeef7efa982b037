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
/// Scenarios of the evaluator, on a hand-written monitor.
///
/// The monitor: group 0 reads `flag` and `level`, group 1 reads `level` alone, group 2 nothing.
///   A (group 0): flag            B (group 1): level < 10
///   C (group 0): flag or level < 10              D (group 2): not at its step 1

#include "evaluator.h"
#include "gate.h"

#include <stdlib.h>
#include <string.h>

#include "scenarios.h"

// ---- the monitor -------------------------------------------------------------------------------

enum { FLAG, LEVEL, N_INPUTS };
enum { A, B, C, D, N_REQUIREMENTS };
enum { FLAG_TOPIC, LEVEL_TOPIC, OTHER_TOPIC, N_TOPICS };

struct inputs
{
  bool flag;
  double level;
};

struct state
{
  uint32_t steps[3];
};

static void reset_0(void * state)
{
  ((struct state *)state)->steps[0] = 0;
}

static void reset_1(void * state)
{
  ((struct state *)state)->steps[1] = 0;
}

static void reset_2(void * state)
{
  ((struct state *)state)->steps[2] = 0;
}

static void step_0(void * state, const void * inputs, bool * verdicts)
{
  const struct inputs * in = inputs;
  ((struct state *)state)->steps[0] += 1;
  verdicts[A] = in->flag;
  verdicts[C] = in->flag || in->level < 10.0;
}

static void step_1(void * state, const void * inputs, bool * verdicts)
{
  ((struct state *)state)->steps[1] += 1;
  verdicts[B] = ((const struct inputs *)inputs)->level < 10.0;
}

static void step_2(void * state, const void * inputs, bool * verdicts)
{
  struct state * cells = state;
  (void)inputs;
  verdicts[D] = cells->steps[2] != 1;
  cells->steps[2] += 1;
}

static uint32_t n_common_steps = 0;

static void step_all(void * state, const void * inputs, bool * verdicts)
{
  n_common_steps += 1;
  step_0(state, inputs, verdicts);
  step_1(state, inputs, verdicts);
  step_2(state, inputs, verdicts);
}

static const struct fm_input INPUTS[] = {
  {"flag", (uint32_t)offsetof(struct inputs, flag), FM_BOOL},
  {"level", (uint32_t)offsetof(struct inputs, level), FM_FLOAT64},
};
static const uint32_t BOTH[] = {FLAG, LEVEL};
static const uint32_t LEVEL_ONLY[] = {LEVEL};
static const uint32_t A_AND_C[] = {A, C};
static const uint32_t B_ONLY[] = {B};
static const uint32_t D_ONLY[] = {D};
static const struct fm_group GROUPS[] = {
  {BOTH, 2, A_AND_C, 2, reset_0, step_0, NULL},
  {LEVEL_ONLY, 1, B_ONLY, 1, reset_1, step_1, NULL},
  {NULL, 0, D_ONLY, 1, reset_2, step_2, NULL},
};
static const struct fm_requirement REQUIREMENTS[] = {{"A", 0}, {"B", 1}, {"C", 0}, {"D", 2}};
static const struct fm_monitor MONITOR = {
  FM_ABI, N_INPUTS, 3, N_REQUIREMENTS, sizeof(struct state), sizeof(struct inputs),
  INPUTS, GROUPS, REQUIREMENTS, "scenarios", "", step_all, NULL, 0, NULL
};

static const uint32_t FEEDS_FLAG[] = {FLAG};
static const uint32_t FEEDS_LEVEL[] = {LEVEL};
static const struct fm_topic TOPICS[] = {{FEEDS_FLAG, 1}, {FEEDS_LEVEL, 1}, {NULL, 0}};
static const uint8_t ONSET_OF_A[] = {FM_ONSET, FM_EVERY_STEP, FM_EVERY_STEP, FM_EVERY_STEP};
static const bool BOTH_VIOLATE[] = {true, true};

// ---- helpers -----------------------------------------------------------------------------------

static void * memory = NULL;
static struct fm_violation out[N_REQUIREMENTS];

static struct fm_evaluator_options options_of(enum fm_policy policy)
{
  const struct fm_evaluator_options options = {
    &MONITOR, TOPICS, N_TOPICS, (uint32_t)policy, ONSET_OF_A, NULL, NULL, 0, 0, NULL,
    false, NULL, NULL, NULL, NULL, NULL};
  return options;
}

// Exactly as long as asked for, so that the address sanitizer sees a byte too far.
static struct fm_evaluator * make(const struct fm_evaluator_options * options)
{
  free(memory);
  memory = malloc((size_t)fm_evaluator_bytes(options));
  return fm_evaluator_init(memory, options);
}

static struct fm_evaluator * with_policy(enum fm_policy policy)
{
  const struct fm_evaluator_options options = options_of(policy);
  return make(&options);
}

static void store_flag(struct fm_evaluator * evaluator, bool flag, int64_t now)
{
  const union fm_value value = {.i = flag};
  fm_evaluator_store(evaluator, FLAG, value, now);
}

static void store_level(struct fm_evaluator * evaluator, double level, int64_t now)
{
  const union fm_value value = {.f = level};
  fm_evaluator_store(evaluator, LEVEL, value, now);
}

static uint32_t flag_at(struct fm_evaluator * evaluator, bool flag, int64_t now)
{
  store_flag(evaluator, flag, now);
  return fm_evaluator_message(evaluator, FLAG_TOPIC, now, out);
}

static uint32_t level_at(struct fm_evaluator * evaluator, double level, int64_t now)
{
  store_level(evaluator, level, now);
  return fm_evaluator_message(evaluator, LEVEL_TOPIC, now, out);
}

static uint32_t flag_message(struct fm_evaluator * evaluator, bool flag)
{
  return flag_at(evaluator, flag, 100);
}

static uint32_t level_message(struct fm_evaluator * evaluator, double level)
{
  return level_at(evaluator, level, 200);
}

static uint32_t advance(struct fm_evaluator * evaluator, int64_t now)
{
  return fm_evaluator_advance(evaluator, now, out);
}

static bool stepped(const struct fm_evaluator * evaluator, uint64_t a, uint64_t b, uint64_t c)
{
  return fm_evaluator_steps(evaluator, 0) == a && fm_evaluator_steps(evaluator, 1) == b &&
         fm_evaluator_steps(evaluator, 2) == c;
}

static bool is_violation(uint32_t index, uint32_t requirement, uint64_t step, int64_t stamp)
{
  return out[index].requirement == requirement && out[index].step == step &&
         out[index].stamp == stamp;
}

// ---- when a step happens -----------------------------------------------------------------------

SCENARIO(no_group_steps_before_all_its_inputs_have_a_value)
{
  struct fm_evaluator * evaluator = with_policy(FM_EVERY_MESSAGE);
  CHECK(!fm_evaluator_ready(evaluator, 0) && !fm_evaluator_ready(evaluator, 1));
  CHECK(flag_message(evaluator, false) == 0 && stepped(evaluator, 0, 0, 1));
  CHECK(fm_evaluator_has_value(evaluator, FLAG) && !fm_evaluator_has_value(evaluator, LEVEL));
  CHECK(flag_message(evaluator, false) == 1 && is_violation(0, D, 1, 100));
  CHECK(stepped(evaluator, 0, 0, 2) && !fm_evaluator_ready(evaluator, 0));
  CHECK(level_message(evaluator, 50.0) == 3 && stepped(evaluator, 1, 1, 3));
  CHECK(fm_evaluator_ready(evaluator, 0) && fm_evaluator_ready(evaluator, 1));
}

SCENARIO(groups_start_one_by_one_and_number_their_own_steps)
{
  struct fm_evaluator * evaluator = with_policy(FM_EVERY_MESSAGE);
  CHECK(level_message(evaluator, 50.0) == 1 && is_violation(0, B, 0, 200));
  CHECK(level_message(evaluator, 50.0) == 2 && is_violation(0, B, 1, 200));
  CHECK(flag_message(evaluator, false) == 3 && stepped(evaluator, 1, 3, 3));
  CHECK(is_violation(0, A, 0, 100) && is_violation(1, C, 0, 100) && is_violation(2, B, 2, 100));
}

SCENARIO(every_message_steps_all_ready_groups)
{
  struct fm_evaluator * evaluator = with_policy(FM_EVERY_MESSAGE);
  (void)level_message(evaluator, 1.0);
  (void)flag_message(evaluator, true);
  CHECK(stepped(evaluator, 1, 2, 2));
  CHECK(fm_evaluator_message(evaluator, OTHER_TOPIC, 0, out) == 0 && stepped(evaluator, 2, 3, 3));
}

SCENARIO(relevant_message_steps_the_groups_that_read_the_topic)
{
  struct fm_evaluator * evaluator = with_policy(FM_RELEVANT_MESSAGE);
  (void)level_message(evaluator, 1.0);
  CHECK(stepped(evaluator, 0, 1, 1));
  (void)flag_message(evaluator, true);
  CHECK(stepped(evaluator, 1, 1, 2));
  (void)level_message(evaluator, 1.0);
  CHECK(stepped(evaluator, 2, 2, 3));
  (void)fm_evaluator_message(evaluator, OTHER_TOPIC, 0, out);
  CHECK(stepped(evaluator, 2, 2, 4));
}

SCENARIO(all_inputs_steps_a_group_once_all_were_received_anew)
{
  struct fm_evaluator * evaluator = with_policy(FM_ALL_INPUTS);
  (void)level_message(evaluator, 1.0);
  CHECK(stepped(evaluator, 0, 1, 1));
  (void)level_message(evaluator, 1.0);  // equal or not: it is received anew
  CHECK(stepped(evaluator, 0, 2, 2));
  (void)flag_message(evaluator, true);
  CHECK(stepped(evaluator, 1, 2, 3));
  (void)flag_message(evaluator, true);
  CHECK(stepped(evaluator, 1, 2, 4));
  (void)level_message(evaluator, 1.0);
  CHECK(stepped(evaluator, 2, 3, 5));
}

SCENARIO(all_inputs_counts_values_that_a_group_never_stepped_on)
{
  struct fm_evaluator * evaluator = with_policy(FM_ALL_INPUTS);
  for (int k = 0; k < 4; ++k) {
    (void)level_message(evaluator, 1.0);
  }
  CHECK(fm_evaluator_input_counts(evaluator, LEVEL).overwritten == 3);
  (void)flag_message(evaluator, true);
  (void)level_message(evaluator, 1.0);
  CHECK(fm_evaluator_input_counts(evaluator, LEVEL).overwritten == 3);
  CHECK(fm_evaluator_input_counts(evaluator, LEVEL).received == 5);
  CHECK(fm_evaluator_input_counts(evaluator, FLAG).overwritten == 0);
}

SCENARIO(other_policies_count_nothing_as_overwritten)
{
  struct fm_evaluator * evaluator = with_policy(FM_RELEVANT_MESSAGE);
  for (int k = 0; k < 4; ++k) {
    (void)level_message(evaluator, 1.0);
  }
  CHECK(fm_evaluator_input_counts(evaluator, LEVEL).overwritten == 0);
}

SCENARIO(all_inputs_waits_for_a_value_even_where_there_is_an_initial_one)
{
  struct fm_evaluator * evaluator = with_policy(FM_ALL_INPUTS);
  const union fm_value yes = {.i = 1};
  fm_evaluator_initial(evaluator, FLAG, yes);
  CHECK(level_message(evaluator, 1.0) == 0 && stepped(evaluator, 0, 1, 1));
  CHECK(fm_evaluator_ready(evaluator, 0));
  CHECK(fm_evaluator_input_counts(evaluator, FLAG).received == 0);
  (void)flag_message(evaluator, true);
  CHECK(stepped(evaluator, 1, 1, 2));
}

SCENARIO(with_periodic_a_message_is_no_step)
{
  struct fm_evaluator * evaluator = with_policy(FM_PERIODIC);
  CHECK(level_message(evaluator, 50.0) == 0 && stepped(evaluator, 0, 0, 0));
  CHECK(fm_evaluator_step(evaluator, -7, out) == 1 && is_violation(0, B, 0, -7));
  CHECK(stepped(evaluator, 0, 1, 1));
  (void)flag_message(evaluator, true);
  CHECK(fm_evaluator_step(evaluator, 0, out) == 2 && stepped(evaluator, 1, 2, 2));
  CHECK(fm_evaluator_topic_counts(evaluator, FLAG_TOPIC).messages == 1);
}

SCENARIO(a_row_is_a_step_under_every_policy)
{
  for (int policy = FM_EVERY_MESSAGE; policy <= FM_PERIODIC; ++policy) {
    struct fm_evaluator * evaluator = with_policy((enum fm_policy)policy);
    store_flag(evaluator, true, 0);
    store_level(evaluator, 50.0, 0);
    CHECK(fm_evaluator_step(evaluator, 3, out) == 1 && is_violation(0, B, 0, 3));
    CHECK(fm_evaluator_step(evaluator, 4, out) == 2 && stepped(evaluator, 2, 2, 2));
  }
}

SCENARIO(all_groups_are_stepped_in_one_call_once_all_are_ready)
{
  struct fm_evaluator * evaluator = with_policy(FM_EVERY_MESSAGE);
  n_common_steps = 0;
  (void)level_message(evaluator, 50.0);
  (void)level_message(evaluator, 50.0);
  CHECK(n_common_steps == 0 && stepped(evaluator, 0, 2, 2));
  CHECK(flag_message(evaluator, false) == 3 && n_common_steps == 1 && stepped(evaluator, 1, 3, 3));
  CHECK(is_violation(0, A, 0, 100) && is_violation(1, C, 0, 100) && is_violation(2, B, 2, 100));
  CHECK(fm_evaluator_step(evaluator, 5, out) == 2 && n_common_steps == 2);
}

SCENARIO(other_messages_step_some_groups_by_themselves)
{
  struct fm_evaluator * evaluator = with_policy(FM_RELEVANT_MESSAGE);
  (void)level_message(evaluator, 1.0);
  n_common_steps = 0;
  (void)flag_message(evaluator, true);
  CHECK(n_common_steps == 0 && stepped(evaluator, 1, 1, 2));
}

SCENARIO(groups_are_stepped_one_by_one_without_a_common_step)
{
  struct fm_monitor monitor = MONITOR;
  struct fm_evaluator_options options = options_of(FM_EVERY_MESSAGE);
  monitor.step = NULL;
  options.monitor = &monitor;
  struct fm_evaluator * evaluator = make(&options);
  (void)level_message(evaluator, 1.0);
  (void)flag_message(evaluator, true);
  (void)level_message(evaluator, 50.0);
  CHECK(stepped(evaluator, 2, 3, 3) && is_violation(0, B, 2, 200));
}

SCENARIO(after_a_row_all_inputs_waits_for_all_inputs_anew)
{
  struct fm_evaluator * evaluator = with_policy(FM_ALL_INPUTS);
  (void)flag_message(evaluator, true);
  store_level(evaluator, 1.0, 0);
  (void)fm_evaluator_step(evaluator, 0, out);
  CHECK(stepped(evaluator, 1, 1, 2));
  (void)flag_message(evaluator, true);
  CHECK(stepped(evaluator, 1, 1, 3));
  (void)level_message(evaluator, 1.0);
  CHECK(stepped(evaluator, 2, 2, 4));
  CHECK(fm_evaluator_input_counts(evaluator, FLAG).overwritten == 0);
}

SCENARIO(an_initial_value_makes_a_group_ready)
{
  struct fm_evaluator * evaluator = with_policy(FM_EVERY_MESSAGE);
  const double high = 50.0;
  fm_evaluator_initial_from(evaluator, LEVEL, &high);
  CHECK(fm_evaluator_ready(evaluator, 1) && fm_evaluator_has_value(evaluator, LEVEL));
  CHECK(flag_message(evaluator, false) == 3 && stepped(evaluator, 1, 1, 1));
  CHECK(fm_evaluator_input_counts(evaluator, LEVEL).received == 0);
}

SCENARIO(a_message_that_cannot_be_decoded_is_counted_and_is_no_step)
{
  struct fm_evaluator * evaluator = with_policy(FM_EVERY_MESSAGE);
  (void)level_message(evaluator, 1.0);
  fm_evaluator_undecodable(evaluator, LEVEL_TOPIC);
  CHECK(stepped(evaluator, 0, 1, 1));
  CHECK(fm_evaluator_topic_counts(evaluator, LEVEL_TOPIC).messages == 1);
  CHECK(fm_evaluator_topic_counts(evaluator, LEVEL_TOPIC).undecodable == 1);
  CHECK(fm_evaluator_topic_counts(evaluator, FLAG_TOPIC).undecodable == 0);
}

SCENARIO(a_field_that_cannot_be_used_keeps_its_value_and_the_step_happens)
{
  struct fm_evaluator * evaluator = with_policy(FM_EVERY_MESSAGE);
  (void)level_message(evaluator, 50.0);
  fm_evaluator_unusable(evaluator, LEVEL);
  CHECK(fm_evaluator_message(evaluator, LEVEL_TOPIC, 200, out) == 2 && is_violation(0, B, 1, 200));
  CHECK(fm_evaluator_input_counts(evaluator, LEVEL).unusable == 1);
  CHECK(fm_evaluator_input_counts(evaluator, LEVEL).received == 1);
}

SCENARIO(with_all_inputs_an_unusable_field_is_not_received)
{
  struct fm_evaluator * evaluator = with_policy(FM_ALL_INPUTS);
  (void)level_message(evaluator, 1.0);
  fm_evaluator_unusable(evaluator, LEVEL);
  (void)fm_evaluator_message(evaluator, LEVEL_TOPIC, 200, out);
  CHECK(stepped(evaluator, 0, 1, 2));
}

// ---- what is reported --------------------------------------------------------------------------

SCENARIO(onset_announces_when_the_verdict_turns_false)
{
  struct fm_evaluator * evaluator = with_policy(FM_RELEVANT_MESSAGE);
  (void)level_message(evaluator, 1.0);
  CHECK(flag_message(evaluator, false) == 2 && is_violation(0, A, 0, 100));
  CHECK(is_violation(1, D, 1, 100));
  CHECK(flag_message(evaluator, false) == 0);
  CHECK(flag_message(evaluator, true) == 0);
  CHECK(flag_message(evaluator, false) == 1 && is_violation(0, A, 3, 100));
  CHECK(fm_evaluator_requirement_counts(evaluator, A).violations == 3);
  CHECK(fm_evaluator_requirement_counts(evaluator, A).announced == 2);
}

SCENARIO(without_onset_every_violating_step_is_announced)
{
  struct fm_evaluator * evaluator = with_policy(FM_RELEVANT_MESSAGE);
  (void)level_message(evaluator, 50.0);
  CHECK(level_message(evaluator, 50.0) == 2 && is_violation(0, B, 1, 200));
  CHECK(level_message(evaluator, 50.0) == 1 && is_violation(0, B, 2, 200));
  CHECK(fm_evaluator_requirement_counts(evaluator, B).announced == 3);
}

SCENARIO(without_flags_no_requirement_reports_onsets)
{
  struct fm_evaluator_options options = options_of(FM_RELEVANT_MESSAGE);
  options.reports = NULL;
  struct fm_evaluator * evaluator = make(&options);
  (void)level_message(evaluator, 1.0);
  (void)flag_message(evaluator, false);
  CHECK(flag_message(evaluator, false) == 1 && is_violation(0, A, 1, 100));
}

SCENARIO(violations_are_counted_without_a_place_for_them)
{
  struct fm_evaluator * evaluator = with_policy(FM_EVERY_MESSAGE);
  store_level(evaluator, 50.0, 0);
  CHECK(fm_evaluator_message(evaluator, LEVEL_TOPIC, 0, NULL) == 1);
  CHECK(fm_evaluator_step(evaluator, 0, NULL) == 2);
  CHECK(fm_evaluator_requirement_counts(evaluator, B).announced == 2);
}

SCENARIO(verdicts_are_true_until_the_first_step)
{
  struct fm_evaluator * evaluator = with_policy(FM_EVERY_MESSAGE);
  const bool * verdicts = fm_evaluator_verdicts(evaluator);
  CHECK(verdicts[A] && verdicts[B] && verdicts[C] && verdicts[D]);
  CHECK(fm_evaluator_requirement_counts(evaluator, B).verdict);
  (void)level_message(evaluator, 50.0);
  CHECK(verdicts[A] && !verdicts[B] && verdicts[C] && verdicts[D]);
  CHECK(!fm_evaluator_requirement_counts(evaluator, B).verdict);
}

// ---- reset -------------------------------------------------------------------------------------

SCENARIO(reset_starts_all_groups_afresh_and_keeps_values_and_counters)
{
  struct fm_evaluator * evaluator = with_policy(FM_EVERY_MESSAGE);
  (void)level_message(evaluator, 50.0);
  (void)flag_message(evaluator, false);
  fm_evaluator_reset(evaluator);
  CHECK(stepped(evaluator, 0, 0, 0) && fm_evaluator_ready(evaluator, 0));
  CHECK(fm_evaluator_verdicts(evaluator)[B] && fm_evaluator_verdicts(evaluator)[A]);
  CHECK(((const struct inputs *)fm_evaluator_inputs(evaluator))->level >= 50.0);
  CHECK(fm_evaluator_message(evaluator, OTHER_TOPIC, 9, out) == 3);
  CHECK(is_violation(0, A, 0, 9) && is_violation(1, C, 0, 9) && is_violation(2, B, 0, 9));
  CHECK(fm_evaluator_requirement_counts(evaluator, B).steps == 3);
  CHECK(fm_evaluator_requirement_counts(evaluator, B).violations == 3);
  CHECK(fm_evaluator_input_counts(evaluator, LEVEL).received == 1);
}

SCENARIO(reset_makes_all_inputs_wait_for_everything_anew)
{
  struct fm_evaluator * evaluator = with_policy(FM_ALL_INPUTS);
  (void)level_message(evaluator, 1.0);
  fm_evaluator_reset(evaluator);
  (void)flag_message(evaluator, true);
  CHECK(stepped(evaluator, 0, 0, 1));
  (void)level_message(evaluator, 1.0);
  CHECK(stepped(evaluator, 1, 1, 2));
  CHECK(fm_evaluator_input_counts(evaluator, LEVEL).overwritten == 0);
}

// ---- timeouts ----------------------------------------------------------------------------------

static const int64_t FLAG_50[] = {50, 0};
static const int64_t BOTH_50[] = {50, 50};

static struct fm_evaluator_options timed(enum fm_policy policy, const int64_t * timeouts)
{
  struct fm_evaluator_options options = options_of(policy);
  options.timeouts = timeouts;
  options.violates = BOTH_VIOLATE;
  return options;
}

static struct fm_evaluator * begun_at_1000(const struct fm_evaluator_options * options)
{
  struct fm_evaluator * evaluator = make(options);
  CHECK(advance(evaluator, 1000) == 0);
  return evaluator;
}

static struct fm_evaluator * with_timeouts(enum fm_policy policy, const int64_t * timeouts)
{
  const struct fm_evaluator_options options = timed(policy, timeouts);
  return begun_at_1000(&options);
}

static struct fm_silence silence_of_flag(const struct fm_evaluator * evaluator)
{
  return fm_evaluator_silence(evaluator, FLAG);
}

SCENARIO(time_begins_with_the_first_advance)
{
  const struct fm_evaluator_options options = timed(FM_PERIODIC, BOTH_50);
  struct fm_evaluator * evaluator = make(&options);
  CHECK(fm_evaluator_deadline(evaluator) == INT64_MIN && fm_evaluator_now(evaluator) == 0);
  CHECK(fm_evaluator_wake(evaluator) == INT64_MIN);
  store_flag(evaluator, true, 980);
  CHECK(fm_evaluator_deadline(evaluator) == INT64_MIN);
  CHECK(advance(evaluator, 1000) == 0 && fm_evaluator_now(evaluator) == 1000);
  CHECK(fm_evaluator_deadline(evaluator) == 1050);
}

SCENARIO(without_timeouts_and_periods_nothing_is_due)
{
  struct fm_evaluator * evaluator = with_policy(FM_PERIODIC);
  CHECK(advance(evaluator, 1000) == 0 && fm_evaluator_deadline(evaluator) == FM_NEVER);
  store_flag(evaluator, true, 1010);
  CHECK(advance(evaluator, 100000) == 0 && fm_evaluator_deadline(evaluator) == FM_NEVER);
  CHECK(fm_evaluator_now(evaluator) == 100000 && stepped(evaluator, 0, 0, 0));
}

SCENARIO(an_input_that_never_came_is_silent_a_timeout_after_the_time_began)
{
  const int64_t level_50[] = {0, 50};
  struct fm_evaluator * evaluator = with_timeouts(FM_EVERY_MESSAGE, level_50);
  CHECK(advance(evaluator, 1050) == 3 && is_violation(0, A, 0, 1050));
  CHECK(is_violation(1, C, 0, 1050) && is_violation(2, B, 0, 1050));
  CHECK(stepped(evaluator, 0, 0, 0) && !fm_evaluator_verdicts(evaluator)[A]);
}

SCENARIO(a_group_that_is_not_ready_is_satisfied_again_when_its_silence_ends)
{
  const int64_t level_50[] = {0, 50};
  struct fm_evaluator * evaluator = with_timeouts(FM_EVERY_MESSAGE, level_50);
  CHECK(advance(evaluator, 1050) == 3);
  CHECK(level_at(evaluator, 1.0, 1060) == 0 && fm_evaluator_verdicts(evaluator)[B]);
  CHECK(fm_evaluator_verdicts(evaluator)[A] && !fm_evaluator_ready(evaluator, 0));
  CHECK(advance(evaluator, 1110) == 3 && is_violation(0, A, 0, 1110));
  CHECK(is_violation(2, B, 1, 1110));
}

static struct fm_evaluator_options with_startups(
  const int64_t * timeouts, const int64_t * startups)
{
  struct fm_evaluator_options options = timed(FM_PERIODIC, timeouts);
  options.startups = startups;
  return options;
}

SCENARIO(before_its_first_value_an_input_may_be_silent_for_its_startup)
{
  const int64_t long_flag[] = {300, 0};
  const int64_t short_flag[] = {20, 0};
  struct fm_evaluator_options options = with_startups(BOTH_50, long_flag);
  struct fm_evaluator * evaluator = begun_at_1000(&options);
  CHECK(advance(evaluator, 1050) == 3 && fm_evaluator_is_stale(evaluator, LEVEL));
  CHECK(!silence_of_flag(evaluator).is_silent && fm_evaluator_deadline(evaluator) == 1300);
  CHECK(advance(evaluator, 1400) == 0 && silence_of_flag(evaluator).is_silent);
  store_flag(evaluator, true, 1410);
  CHECK(silence_of_flag(evaluator).lasted == 410 && fm_evaluator_deadline(evaluator) == 1460);

  options = with_startups(FLAG_50, short_flag);
  evaluator = begun_at_1000(&options);
  CHECK(advance(evaluator, 1100) == 2 && is_violation(0, A, 0, 1020));
  store_flag(evaluator, true, 1110);
  CHECK(advance(evaluator, 1130) == 0 && fm_evaluator_deadline(evaluator) == 1160);
}

SCENARIO(a_startup_ends_with_a_value_and_not_with_an_initial_one_or_a_reset)
{
  const int64_t long_flag[] = {300, 0};
  const struct fm_evaluator_options options = with_startups(FLAG_50, long_flag);
  struct fm_evaluator * evaluator = make(&options);
  store_flag(evaluator, true, 990);
  CHECK(advance(evaluator, 1000) == 0 && fm_evaluator_deadline(evaluator) == 1050);
  evaluator = begun_at_1000(&options);
  fm_evaluator_initial(evaluator, FLAG, (union fm_value){.i = 1});
  fm_evaluator_unusable(evaluator, FLAG);
  fm_evaluator_reset(evaluator);
  CHECK(advance(evaluator, 1100) == 0 && fm_evaluator_deadline(evaluator) == 1300);
  fm_evaluator_shift(evaluator, 40);
  CHECK(fm_evaluator_deadline(evaluator) == 1340);
  CHECK(advance(evaluator, 1340) == 2 && is_violation(0, A, 0, 1340));
}

SCENARIO(without_a_timeout_a_startup_has_no_effect)
{
  const int64_t flag_300[] = {300, 0};
  const struct fm_evaluator_options options = with_startups(NULL, flag_300);
  CHECK(fm_evaluator_deadline(begun_at_1000(&options)) == FM_NEVER);
}

SCENARIO(a_startup_that_is_found_late_is_put_off_by_its_own_length_at_most)
{
  const int64_t flag_300[] = {300, 0};
  struct fm_evaluator_options options = with_startups(FLAG_50, flag_300);
  options.patience = 2;
  struct fm_evaluator * evaluator = begun_at_1000(&options);
  CHECK(advance(evaluator, 1151) == 0 && advance(evaluator, 1301) == 2);  // half of it at once
  evaluator = begun_at_1000(&options);
  CHECK(advance(evaluator, 1900) == 0 && fm_evaluator_deadline(evaluator) == 2200);
  CHECK(advance(evaluator, 2201) == 2 && is_violation(0, A, 0, 1300));
}

SCENARIO(a_timeout_comes_exactly_at_its_instant)
{
  struct fm_evaluator * evaluator = with_timeouts(FM_PERIODIC, FLAG_50);
  store_flag(evaluator, true, 1020);
  CHECK(fm_evaluator_deadline(evaluator) == 1070);
  CHECK(advance(evaluator, 1069) == 0 && !silence_of_flag(evaluator).is_silent);
  CHECK(advance(evaluator, 1070) == 2 && is_violation(0, A, 0, 1070));
  CHECK(is_violation(1, C, 0, 1070) && silence_of_flag(evaluator).is_silent);
  CHECK(fm_evaluator_deadline(evaluator) == FM_NEVER && advance(evaluator, 2000) == 0);
}

SCENARIO(a_timeout_is_stamped_with_its_instant_however_late)
{
  struct fm_evaluator * evaluator = with_timeouts(FM_PERIODIC, FLAG_50);
  CHECK(advance(evaluator, 1000000) == 2 && is_violation(0, A, 0, 1050));
  CHECK(is_violation(1, C, 0, 1050) && fm_evaluator_now(evaluator) == 1000000);
}

SCENARIO(a_message_at_the_instant_of_a_timeout_comes_before_it)
{
  struct fm_evaluator * evaluator = with_timeouts(FM_PERIODIC, FLAG_50);
  CHECK(advance(evaluator, 1049) == 0 && flag_at(evaluator, true, 1050) == 0);
  CHECK(advance(evaluator, 1050) == 0 && silence_of_flag(evaluator).count == 0);
  CHECK(fm_evaluator_deadline(evaluator) == 1100);
}

SCENARIO(a_message_after_the_instant_of_a_timeout_comes_after_it)
{
  struct fm_evaluator * evaluator = with_timeouts(FM_PERIODIC, FLAG_50);
  CHECK(advance(evaluator, 1050) == 2 && flag_at(evaluator, true, 1051) == 0);
  CHECK(!fm_evaluator_is_stale(evaluator, FLAG) && fm_evaluator_deadline(evaluator) == 1101);
  CHECK(silence_of_flag(evaluator).count == 1 && silence_of_flag(evaluator).lasted == 51);
}

SCENARIO(the_wake_may_be_early_but_not_twice)
{
  struct fm_evaluator * evaluator = with_timeouts(FM_PERIODIC, FLAG_50);
  CHECK(fm_evaluator_deadline(evaluator) == 1050 && fm_evaluator_wake(evaluator) == 1050);
  store_flag(evaluator, true, 1040);
  CHECK(fm_evaluator_wake(evaluator) <= 1090);
  CHECK(advance(evaluator, 1050) == 0 && fm_evaluator_wake(evaluator) == 1090);
  CHECK(fm_evaluator_deadline(evaluator) == 1090);
}

SCENARIO(timeouts_of_one_instant_come_one_by_one_in_the_order_of_the_inputs)
{
  struct fm_evaluator * evaluator = with_timeouts(FM_PERIODIC, BOTH_50);
  CHECK(advance(evaluator, 1050) == 2 && is_violation(0, A, 0, 1050));
  CHECK(!fm_evaluator_is_stale(evaluator, LEVEL) && fm_evaluator_deadline(evaluator) == 1050);
  // C reads the level as well, but is violated already.
  CHECK(advance(evaluator, 1050) == 1 && is_violation(0, B, 0, 1050));
  CHECK(fm_evaluator_deadline(evaluator) == FM_NEVER);
}

SCENARIO(what_is_due_first_comes_first_however_late)
{
  const int64_t level_first[] = {50, 30};
  struct fm_evaluator * evaluator = with_timeouts(FM_PERIODIC, level_first);
  CHECK(advance(evaluator, 2000) == 3 && is_violation(0, A, 0, 1030));
  CHECK(is_violation(1, C, 0, 1030) && is_violation(2, B, 0, 1030));
  CHECK(!fm_evaluator_is_stale(evaluator, FLAG) && fm_evaluator_deadline(evaluator) == 1050);
  CHECK(advance(evaluator, 2000) == 0 && fm_evaluator_is_stale(evaluator, FLAG));
}

SCENARIO(an_initial_value_neither_puts_a_timeout_off_nor_ends_a_silence)
{
  const union fm_value yes = {.i = 1};
  struct fm_evaluator * evaluator = with_timeouts(FM_PERIODIC, FLAG_50);
  fm_evaluator_initial(evaluator, FLAG, yes);
  CHECK(fm_evaluator_deadline(evaluator) == 1050 && advance(evaluator, 1050) == 2);
  fm_evaluator_initial(evaluator, FLAG, yes);
  CHECK(fm_evaluator_is_stale(evaluator, FLAG) && silence_of_flag(evaluator).is_silent);
  CHECK(fm_evaluator_deadline(evaluator) == FM_NEVER);
}

SCENARIO(a_field_that_cannot_be_used_neither_puts_a_timeout_off_nor_ends_a_silence)
{
  struct fm_evaluator * evaluator = with_timeouts(FM_PERIODIC, FLAG_50);
  CHECK(advance(evaluator, 1040) == 0);
  fm_evaluator_unusable(evaluator, FLAG);
  (void)fm_evaluator_message(evaluator, FLAG_TOPIC, 1040, out);
  CHECK(fm_evaluator_deadline(evaluator) == 1050 && advance(evaluator, 1050) == 2);
  fm_evaluator_unusable(evaluator, FLAG);
  CHECK(silence_of_flag(evaluator).is_silent);
}

SCENARIO(rows_put_timeouts_off_from_their_times)
{
  const uint8_t flags[] = {1};
  const void * const columns[] = {flags, NULL};
  const int64_t times[] = {1030};
  struct fm_rows rows = {columns, times, 1, 0, NULL, NULL};
  struct fm_evaluator * evaluator = with_timeouts(FM_PERIODIC, FLAG_50);
  CHECK(advance(evaluator, 1010) == 0);
  (void)fm_evaluator_row(evaluator, &rows, NULL);
  CHECK(fm_evaluator_deadline(evaluator) == 1080 && rows.next == 1);
}

// ---- silence -----------------------------------------------------------------------------------

SCENARIO(what_reads_a_stale_input_is_violated_at_once_and_without_a_step)
{
  struct fm_evaluator * evaluator = with_timeouts(FM_RELEVANT_MESSAGE, FLAG_50);
  (void)level_at(evaluator, 1.0, 1001);
  (void)flag_at(evaluator, true, 1010);
  CHECK(stepped(evaluator, 1, 1, 2));
  CHECK(advance(evaluator, 1060) == 2);
  CHECK(is_violation(0, A, 1, 1060) && is_violation(1, C, 1, 1060));
  CHECK(fm_evaluator_is_stale(evaluator, FLAG) && !fm_evaluator_is_stale(evaluator, LEVEL));
  CHECK(stepped(evaluator, 1, 1, 2) && !fm_evaluator_verdicts(evaluator)[C]);
  CHECK(fm_evaluator_verdicts(evaluator)[B] && fm_evaluator_ready(evaluator, 0));
  const struct fm_requirement_counts counts = fm_evaluator_requirement_counts(evaluator, C);
  CHECK(counts.steps == 1 && counts.violations == 1 && counts.announced == 1 && !counts.verdict);
}

SCENARIO(a_silence_violates_once_and_then_at_each_step)
{
  struct fm_evaluator * evaluator = with_timeouts(FM_RELEVANT_MESSAGE, BOTH_50);
  (void)level_at(evaluator, 1.0, 1001);
  (void)flag_at(evaluator, true, 1001);
  CHECK(advance(evaluator, 1051) == 2 && advance(evaluator, 1051) == 1);
  // A reports its onset, which was the timeout; B has its input again.
  CHECK(level_at(evaluator, 1.0, 1052) == 1 && is_violation(0, C, 1, 1052));
  CHECK(stepped(evaluator, 2, 2, 3) && fm_evaluator_verdicts(evaluator)[B]);
}

SCENARIO(a_value_ends_a_silence_and_the_next_step_is_judged_as_ever)
{
  struct fm_evaluator * evaluator = with_timeouts(FM_EVERY_MESSAGE, FLAG_50);
  (void)level_at(evaluator, 1.0, 1001);
  (void)flag_at(evaluator, true, 1001);
  CHECK(advance(evaluator, 1051) == 2);
  store_flag(evaluator, true, 1052);
  CHECK(!fm_evaluator_is_stale(evaluator, FLAG) && !fm_evaluator_verdicts(evaluator)[A]);
  CHECK(fm_evaluator_message(evaluator, FLAG_TOPIC, 1052, out) == 0);
  CHECK(fm_evaluator_verdicts(evaluator)[A] && stepped(evaluator, 2, 3, 3));
  CHECK(advance(evaluator, 1102) == 2 && is_violation(0, A, 2, 1102));
}

SCENARIO(an_onset_that_is_violated_already_is_not_announced_by_a_silence)
{
  struct fm_evaluator * evaluator = with_timeouts(FM_EVERY_MESSAGE, FLAG_50);
  (void)level_at(evaluator, 1.0, 1001);
  CHECK(flag_at(evaluator, false, 1001) == 2);  // A, and D at its step 1
  CHECK(advance(evaluator, 1051) == 1 && is_violation(0, C, 1, 1051));
  CHECK(fm_evaluator_requirement_counts(evaluator, A).violations == 2);
  CHECK(fm_evaluator_requirement_counts(evaluator, A).announced == 1);
}

SCENARIO(violations_of_a_timeout_are_counted_without_a_place_for_them)
{
  struct fm_evaluator * evaluator = with_timeouts(FM_PERIODIC, FLAG_50);
  CHECK(fm_evaluator_advance(evaluator, 1050, NULL) == 2);
  CHECK(fm_evaluator_requirement_counts(evaluator, C).announced == 1);
}

SCENARIO(a_silence_without_violates_is_counted_and_violates_nothing)
{
  struct fm_evaluator_options options = timed(FM_PERIODIC, FLAG_50);
  options.violates = NULL;
  struct fm_evaluator * evaluator = begun_at_1000(&options);
  CHECK(advance(evaluator, 1050) == 0 && fm_evaluator_deadline(evaluator) == FM_NEVER);
  CHECK(silence_of_flag(evaluator).is_silent && silence_of_flag(evaluator).count == 1);
  CHECK(!fm_evaluator_is_stale(evaluator, FLAG) && fm_evaluator_verdicts(evaluator)[A]);
  CHECK(fm_evaluator_requirement_counts(evaluator, A).violations == 0);
}

SCENARIO(each_input_has_its_own_violates)
{
  const bool level_alone[] = {false, true};
  struct fm_evaluator_options options = timed(FM_PERIODIC, BOTH_50);
  options.violates = level_alone;
  struct fm_evaluator * evaluator = begun_at_1000(&options);
  CHECK(advance(evaluator, 1050) == 0 && silence_of_flag(evaluator).is_silent);
  CHECK(advance(evaluator, 1050) == 3 && is_violation(0, A, 0, 1050));
}

SCENARIO(a_silence_lasts_from_the_value_before_it_until_the_value_after_it)
{
  struct fm_evaluator * evaluator = with_timeouts(FM_PERIODIC, FLAG_50);
  store_flag(evaluator, true, 1020);
  CHECK(silence_of_flag(evaluator).lasted == 0 && advance(evaluator, 1075) == 2);
  CHECK(silence_of_flag(evaluator).lasted == 55);
  CHECK(advance(evaluator, 1100) == 0 && silence_of_flag(evaluator).lasted == 80);
  store_flag(evaluator, true, 1110);
  CHECK(!silence_of_flag(evaluator).is_silent && silence_of_flag(evaluator).lasted == 90);
  store_flag(evaluator, true, 1115);
  CHECK(silence_of_flag(evaluator).lasted == 90 && silence_of_flag(evaluator).count == 1);
}

SCENARIO(a_reset_makes_a_stale_input_due_at_once)
{
  struct fm_evaluator * evaluator = with_timeouts(FM_PERIODIC, FLAG_50);
  CHECK(advance(evaluator, 1050) == 2 && advance(evaluator, 1100) == 0);
  fm_evaluator_reset(evaluator);
  CHECK(fm_evaluator_is_stale(evaluator, FLAG) && fm_evaluator_verdicts(evaluator)[A]);
  CHECK(fm_evaluator_deadline(evaluator) == 1100);
  CHECK(advance(evaluator, 1200) == 2 && is_violation(0, A, 0, 1100));
  CHECK(advance(evaluator, 1200) == 0 && fm_evaluator_deadline(evaluator) == FM_NEVER);
  CHECK(silence_of_flag(evaluator).count == 1 && silence_of_flag(evaluator).lasted == 200);
}

SCENARIO(after_a_reset_a_step_violates_what_is_stale_and_its_timeout_not_again)
{
  struct fm_evaluator * evaluator = with_timeouts(FM_PERIODIC, FLAG_50);
  store_flag(evaluator, true, 1000);
  store_level(evaluator, 1.0, 1000);
  CHECK(advance(evaluator, 1050) == 2);
  fm_evaluator_reset(evaluator);
  CHECK(fm_evaluator_step(evaluator, 1060, out) == 2 && is_violation(0, A, 0, 1060));
  CHECK(advance(evaluator, 1070) == 0 && fm_evaluator_deadline(evaluator) == FM_NEVER);
}

SCENARIO(a_reset_leaves_other_timeouts_alone)
{
  struct fm_evaluator_options options = timed(FM_PERIODIC, BOTH_50);
  options.violates = NULL;
  struct fm_evaluator * evaluator = begun_at_1000(&options);
  store_level(evaluator, 1.0, 1040);
  CHECK(advance(evaluator, 1050) == 0 && silence_of_flag(evaluator).is_silent);
  fm_evaluator_reset(evaluator);
  CHECK(fm_evaluator_deadline(evaluator) == 1090);
}

// ---- patience ----------------------------------------------------------------------------------

static struct fm_evaluator * with_patience(int64_t patience, const int64_t * timeouts)
{
  struct fm_evaluator_options options = timed(FM_PERIODIC, timeouts);
  options.patience = patience;
  return begun_at_1000(&options);
}

SCENARIO(a_timeout_found_late_after_a_stop_is_put_off_once_by_as_much)
{
  struct fm_evaluator * evaluator = with_patience(2, FLAG_50);
  CHECK(advance(evaluator, 1080) == 0 && !silence_of_flag(evaluator).is_silent);
  CHECK(fm_evaluator_deadline(evaluator) == 1110 && advance(evaluator, 1109) == 0);
  CHECK(advance(evaluator, 1200) == 2 && silence_of_flag(evaluator).is_silent);
  CHECK(silence_of_flag(evaluator).count == 1 && silence_of_flag(evaluator).lasted == 200);
}

SCENARIO(a_timeout_that_was_put_off_is_stamped_with_its_end_however_late)
{
  for (int64_t late = 0; late < 4000; late += 1000) {
    struct fm_evaluator * evaluator = with_patience(2, FLAG_50);
    store_flag(evaluator, true, 1020);
    CHECK(advance(evaluator, 1100) == 0 && fm_evaluator_deadline(evaluator) == 1130);
    CHECK(advance(evaluator, 1130 + late) == 2);
    CHECK(is_violation(0, A, 0, 1070) && is_violation(1, C, 0, 1070));
  }
}

SCENARIO(a_timeout_is_put_off_by_ten_times_the_patience_at_least)
{
  struct fm_evaluator * evaluator = with_patience(2, FLAG_50);
  CHECK(advance(evaluator, 1053) == 0 && fm_evaluator_deadline(evaluator) == 1073);
  CHECK(advance(evaluator, 1072) == 0 && !silence_of_flag(evaluator).is_silent);
  CHECK(advance(evaluator, 1073) == 2 && is_violation(0, A, 0, 1050));
}

SCENARIO(a_timeout_is_put_off_by_its_own_length_at_most)
{
  struct fm_evaluator * evaluator = with_patience(2, FLAG_50);
  CHECK(advance(evaluator, 9000) == 0 && fm_evaluator_deadline(evaluator) == 9050);
  evaluator = with_patience(10, FLAG_50);
  CHECK(advance(evaluator, 1061) == 0 && fm_evaluator_deadline(evaluator) == 1111);
}

SCENARIO(a_timeout_found_within_the_patience_is_not_put_off)
{
  struct fm_evaluator * evaluator = with_patience(2, FLAG_50);
  CHECK(advance(evaluator, 1052) == 2 && is_violation(0, A, 0, 1050));
}

SCENARIO(without_patience_a_stop_puts_nothing_off)
{
  struct fm_evaluator * evaluator = with_patience(0, FLAG_50);
  CHECK(advance(evaluator, 9000) == 2 && is_violation(0, A, 0, 1050));
}

// As by a simulated clock: what is found late has not been waiting.
SCENARIO(a_coarse_clock_puts_nothing_off)
{
  for (int64_t tick = 1; tick <= 25; ++tick) {
    struct fm_evaluator * evaluator = with_patience(2, FLAG_50);
    int64_t now = 1000;
    while (now + tick < 1050) {
      now += tick;
      CHECK(advance(evaluator, now) == 0);
    }
    CHECK(advance(evaluator, now + tick) == 2 && is_violation(0, A, 0, 1050));
  }
}

SCENARIO(time_that_moves_by_more_than_half_of_a_timeout_at_once_puts_it_off)
{
  struct fm_evaluator * evaluator = with_patience(2, FLAG_50);
  CHECK(advance(evaluator, 1028) == 0);
  CHECK(advance(evaluator, 1053) == 2 && is_violation(0, A, 0, 1050));
  evaluator = with_patience(2, FLAG_50);
  CHECK(advance(evaluator, 1027) == 0 && advance(evaluator, 1053) == 0);
  CHECK(!silence_of_flag(evaluator).is_silent && fm_evaluator_deadline(evaluator) == 1073);
}

SCENARIO(a_stop_puts_off_all_that_is_found_after_it)
{
  struct fm_evaluator * evaluator = with_patience(2, BOTH_50);
  CHECK(advance(evaluator, 1080) == 0 && fm_evaluator_deadline(evaluator) == 1050);
  CHECK(advance(evaluator, 1080) == 0 && fm_evaluator_deadline(evaluator) == 1110);
}

SCENARIO(what_is_due_before_a_timeout_that_was_put_off_comes_first)
{
  struct fm_evaluator_options options = timed(FM_PERIODIC, FLAG_50);
  options.patience = 2;
  options.period = 100;
  struct fm_evaluator * evaluator = begun_at_1000(&options);
  store_level(evaluator, 50.0, 1000);
  CHECK(advance(evaluator, 1080) == 0 && fm_evaluator_deadline(evaluator) == 1100);
  CHECK(advance(evaluator, 1120) == 1 && is_violation(0, B, 0, 1100));
  CHECK(advance(evaluator, 1120) == 2 && is_violation(0, A, 0, 1050));
}

SCENARIO(a_changed_clock_is_no_stop)
{
  struct fm_evaluator * evaluator = with_patience(2, FLAG_50);
  CHECK(advance(evaluator, 1040) == 0);
  fm_evaluator_shift(evaluator, 5000);
  CHECK(advance(evaluator, 6055) == 2 && is_violation(0, A, 0, 6050));
  evaluator = with_patience(2, FLAG_50);
  CHECK(advance(evaluator, 1040) == 0 && advance(evaluator, 40) == 0);
  CHECK(advance(evaluator, 55) == 2 && is_violation(0, A, 0, 50));
}

SCENARIO(a_stop_remains_one_when_the_clock_is_changed)
{
  struct fm_evaluator * evaluator = with_patience(2, BOTH_50);
  CHECK(advance(evaluator, 1080) == 0);
  fm_evaluator_shift(evaluator, 5000);
  CHECK(advance(evaluator, 6080) == 0 && fm_evaluator_deadline(evaluator) == 6110);
  CHECK(advance(evaluator, 6110) == 2 && is_violation(0, A, 0, 6050));
  evaluator = with_patience(2, BOTH_50);
  CHECK(advance(evaluator, 1080) == 0);
  CHECK(advance(evaluator, 80) == 0 && fm_evaluator_deadline(evaluator) == 110);
  CHECK(advance(evaluator, 110) == 2 && is_violation(0, A, 0, 50));
}

SCENARIO(after_a_value_a_timeout_may_be_put_off_again)
{
  struct fm_evaluator * evaluator = with_patience(2, FLAG_50);
  CHECK(advance(evaluator, 1061) == 0 && fm_evaluator_deadline(evaluator) == 1081);
  store_flag(evaluator, true, 1065);
  CHECK(fm_evaluator_deadline(evaluator) == 1115 && advance(evaluator, 1145) == 0);
  CHECK(fm_evaluator_deadline(evaluator) == 1175 && advance(evaluator, 1175) == 2);
  CHECK(is_violation(0, A, 0, 1115));
}

SCENARIO(what_a_reset_made_due_is_not_put_off)
{
  struct fm_evaluator * evaluator = with_patience(2, FLAG_50);
  CHECK(advance(evaluator, 1051) == 2);
  fm_evaluator_reset(evaluator);
  CHECK(advance(evaluator, 5000) == 2 && is_violation(0, A, 0, 1051));
  evaluator = with_patience(2, FLAG_50);
  CHECK(advance(evaluator, 1080) == 0 && advance(evaluator, 1110) == 2);
  fm_evaluator_reset(evaluator);
  CHECK(advance(evaluator, 5000) == 2 && is_violation(0, A, 0, 1110));
}

SCENARIO(a_period_found_late_is_not_put_off)
{
  struct fm_evaluator_options options = options_of(FM_PERIODIC);
  options.period = 100;
  options.patience = 10;
  struct fm_evaluator * evaluator = begun_at_1000(&options);
  CHECK(advance(evaluator, 1190) == 0 && stepped(evaluator, 0, 0, 1));
}

// ---- the time goes back, or its clock is changed -----------------------------------------------

SCENARIO(what_is_due_in_a_while_is_due_in_that_while_after_time_went_back)
{
  struct fm_evaluator * evaluator = with_timeouts(FM_PERIODIC, FLAG_50);
  CHECK(advance(evaluator, 1020) == 0 && advance(evaluator, 20) == 0);
  CHECK(fm_evaluator_now(evaluator) == 20 && fm_evaluator_deadline(evaluator) == 50);
  CHECK(fm_evaluator_time_counts(evaluator).restarts == 1);
  CHECK(advance(evaluator, 50) == 2 && is_violation(0, A, 0, 50));
}

SCENARIO(time_that_goes_back_keeps_values_steps_and_silences)
{
  struct fm_evaluator * evaluator = with_timeouts(FM_EVERY_MESSAGE, FLAG_50);
  (void)level_at(evaluator, 50.0, 1000);
  CHECK(advance(evaluator, 1100) == 2 && advance(evaluator, 0) == 0);
  CHECK(fm_evaluator_has_value(evaluator, LEVEL) && stepped(evaluator, 0, 1, 1));
  CHECK(!fm_evaluator_verdicts(evaluator)[A] && !fm_evaluator_verdicts(evaluator)[B]);
  CHECK(silence_of_flag(evaluator).is_silent && silence_of_flag(evaluator).lasted == 100);
  CHECK(silence_of_flag(evaluator).count == 1);
}

SCENARIO(what_is_overdue_is_taken_as_time_goes_back)
{
  struct fm_evaluator * evaluator = with_timeouts(FM_PERIODIC, BOTH_50);
  CHECK(advance(evaluator, 1060) == 2 && advance(evaluator, 60) == 1);
  CHECK(is_violation(0, B, 0, 50));
}

SCENARIO(time_that_stands_still_does_not_go_back)
{
  struct fm_evaluator * evaluator = with_timeouts(FM_PERIODIC, FLAG_50);
  CHECK(advance(evaluator, 1000) == 0 && fm_evaluator_deadline(evaluator) == 1050);
  CHECK(fm_evaluator_time_counts(evaluator).restarts == 0);
}

SCENARIO(after_a_shift_all_comes_later_by_as_much)
{
  struct fm_evaluator_options options = timed(FM_PERIODIC, FLAG_50);
  options.period = 100;
  struct fm_evaluator * evaluator = begun_at_1000(&options);
  fm_evaluator_shift(evaluator, 5000);
  CHECK(fm_evaluator_now(evaluator) == 6000 && fm_evaluator_deadline(evaluator) == 6050);
  CHECK(advance(evaluator, 6050) == 2 && is_violation(0, A, 0, 6050));
  CHECK(fm_evaluator_deadline(evaluator) == 6100 && silence_of_flag(evaluator).lasted == 50);
  fm_evaluator_shift(evaluator, -6000);
  CHECK(fm_evaluator_deadline(evaluator) == 100 && silence_of_flag(evaluator).lasted == 50);
  CHECK(fm_evaluator_time_counts(evaluator).restarts == 0);
}

SCENARIO(a_shift_before_the_time_has_begun_does_nothing)
{
  const struct fm_evaluator_options options = timed(FM_PERIODIC, FLAG_50);
  struct fm_evaluator * evaluator = make(&options);
  fm_evaluator_shift(evaluator, 5000);
  CHECK(fm_evaluator_deadline(evaluator) == INT64_MIN && fm_evaluator_now(evaluator) == 0);
  CHECK(advance(evaluator, 1000) == 0 && fm_evaluator_deadline(evaluator) == 1050);
}

// ---- periods -----------------------------------------------------------------------------------

static struct fm_evaluator * with_period(int64_t period)
{
  struct fm_evaluator_options options = timed(FM_PERIODIC, FLAG_50);
  options.timeouts = NULL;
  options.period = period;
  return begun_at_1000(&options);
}

SCENARIO(each_period_is_a_step_at_its_end)
{
  struct fm_evaluator * evaluator = with_period(100);
  store_level(evaluator, 50.0, 1000);
  CHECK(fm_evaluator_deadline(evaluator) == 1100 && advance(evaluator, 1099) == 0);
  CHECK(advance(evaluator, 1100) == 1 && is_violation(0, B, 0, 1100));
  CHECK(stepped(evaluator, 0, 1, 1) && fm_evaluator_deadline(evaluator) == 1200);
  CHECK(advance(evaluator, 1100) == 0 && stepped(evaluator, 0, 1, 1));
  CHECK(fm_evaluator_time_counts(evaluator).periods == 1);
}

SCENARIO(a_message_at_the_end_of_a_period_is_part_of_it)
{
  struct fm_evaluator * evaluator = with_period(100);
  store_level(evaluator, 1.0, 1000);
  CHECK(advance(evaluator, 1099) == 0 && level_at(evaluator, 50.0, 1100) == 0);
  CHECK(advance(evaluator, 1100) == 1 && is_violation(0, B, 0, 1100));
}

SCENARIO(late_periods_are_taken_one_by_one_and_stamped_with_their_instants)
{
  struct fm_evaluator * evaluator = with_period(100);
  store_level(evaluator, 50.0, 1000);
  CHECK(advance(evaluator, 1350) == 1 && is_violation(0, B, 0, 1100));
  CHECK(advance(evaluator, 1350) == 2 && is_violation(0, B, 1, 1200));
  CHECK(is_violation(1, D, 1, 1200));
  CHECK(advance(evaluator, 1350) == 1 && is_violation(0, B, 2, 1300));
  CHECK(advance(evaluator, 1350) == 0 && fm_evaluator_deadline(evaluator) == 1400);
}

SCENARIO(a_period_is_late_by_more_than_half_a_period)
{
  struct fm_evaluator * evaluator = with_period(100);
  (void)advance(evaluator, 1150);
  CHECK(fm_evaluator_time_counts(evaluator).late == 0);
  (void)advance(evaluator, 1251);
  CHECK(fm_evaluator_time_counts(evaluator).late == 1);
  CHECK(fm_evaluator_time_counts(evaluator).periods == 2);
  CHECK(fm_evaluator_time_counts(evaluator).missed == 0);
}

SCENARIO(of_too_many_due_periods_the_first_are_missed)
{
  struct fm_evaluator * evaluator = with_period(10);
  const int64_t now = 1000 + 10 * (FM_MOST_PERIODS_BEHIND + INT64_C(5));
  store_level(evaluator, 50.0, 1000);
  CHECK(advance(evaluator, now) == 1 && is_violation(0, B, 0, 1060));
  CHECK(fm_evaluator_time_counts(evaluator).missed == 5);
  while (fm_evaluator_deadline(evaluator) <= now) {
    (void)advance(evaluator, now);
  }
  CHECK(fm_evaluator_time_counts(evaluator).missed == 5 && out[0].stamp == now);
  CHECK(fm_evaluator_time_counts(evaluator).periods == FM_MOST_PERIODS_BEHIND);
  CHECK(fm_evaluator_deadline(evaluator) == now + 10);
}

SCENARIO(as_many_due_periods_as_may_be_are_all_taken)
{
  struct fm_evaluator * evaluator = with_period(10);
  store_level(evaluator, 50.0, 1000);
  CHECK(advance(evaluator, 1009 + INT64_C(10) * FM_MOST_PERIODS_BEHIND) == 1);
  CHECK(is_violation(0, B, 0, 1010) && fm_evaluator_time_counts(evaluator).missed == 0);
}

SCENARIO(a_timeout_between_missed_periods_comes_before_those_that_are_taken)
{
  struct fm_evaluator_options options = timed(FM_PERIODIC, FLAG_50);
  options.period = 10;
  struct fm_evaluator * evaluator = begun_at_1000(&options);
  const int64_t now = 1000 + 10 * (FM_MOST_PERIODS_BEHIND + INT64_C(50));
  store_level(evaluator, 50.0, 1000);
  CHECK(advance(evaluator, now) == 2 && is_violation(0, A, 0, 1050));
  CHECK(fm_evaluator_deadline(evaluator) == 1510);
  CHECK(advance(evaluator, now) == 1 && is_violation(0, B, 0, 1510));
  CHECK(fm_evaluator_time_counts(evaluator).missed == 50);
}

SCENARIO(of_one_instant_a_timeout_comes_before_the_period)
{
  struct fm_evaluator_options options = timed(FM_PERIODIC, FLAG_50);
  options.period = 50;
  struct fm_evaluator * evaluator = begun_at_1000(&options);
  store_flag(evaluator, true, 1000);
  store_level(evaluator, 1.0, 1000);
  CHECK(advance(evaluator, 1050) == 2 && is_violation(0, A, 0, 1050));
  CHECK(stepped(evaluator, 0, 0, 0) && fm_evaluator_deadline(evaluator) == 1050);
  CHECK(advance(evaluator, 1050) == 1 && is_violation(0, C, 0, 1050));
  CHECK(stepped(evaluator, 1, 1, 1) && fm_evaluator_deadline(evaluator) == 1100);
}

SCENARIO(other_policies_have_no_periods)
{
  for (int policy = FM_EVERY_MESSAGE; policy < FM_PERIODIC; ++policy) {
    struct fm_evaluator_options options = options_of((enum fm_policy)policy);
    options.period = 100;
    struct fm_evaluator * evaluator = begun_at_1000(&options);
    CHECK(fm_evaluator_deadline(evaluator) == FM_NEVER && advance(evaluator, 5000) == 0);
    CHECK(stepped(evaluator, 0, 0, 0) && fm_evaluator_time_counts(evaluator).periods == 0);
  }
}

SCENARIO(periods_go_on_through_a_reset)
{
  struct fm_evaluator * evaluator = with_period(100);
  (void)advance(evaluator, 1130);
  fm_evaluator_reset(evaluator);
  CHECK(fm_evaluator_deadline(evaluator) == 1200 && stepped(evaluator, 0, 0, 0));
  CHECK(advance(evaluator, 1200) == 0 && stepped(evaluator, 0, 0, 1));
  CHECK(fm_evaluator_time_counts(evaluator).periods == 2);
}

SCENARIO(periods_keep_their_phase_when_time_goes_back)
{
  struct fm_evaluator * evaluator = with_period(100);
  (void)advance(evaluator, 1130);
  (void)advance(evaluator, 30);
  CHECK(fm_evaluator_deadline(evaluator) == 100 && stepped(evaluator, 0, 0, 1));
  CHECK(fm_evaluator_time_counts(evaluator).missed == 0);
}

// ---- save and restore --------------------------------------------------------------------------

static void * saved_from(const struct fm_evaluator * evaluator)
{
  void * block = malloc((size_t)fm_evaluator_instance_bytes(evaluator));
  fm_evaluator_save(evaluator, block);
  return block;
}

SCENARIO(a_restored_instance_goes_on_from_where_it_was_saved)
{
  struct fm_evaluator * evaluator = with_timeouts(FM_EVERY_MESSAGE, FLAG_50);
  (void)level_at(evaluator, 50.0, 1001);
  (void)flag_at(evaluator, true, 1010);
  void * block = saved_from(evaluator);
  for (int time = 0; time < 2; ++time) {
    CHECK(stepped(evaluator, 1, 2, 2) && fm_evaluator_verdicts(evaluator)[A]);
    CHECK(fm_evaluator_now(evaluator) == 1000 && fm_evaluator_deadline(evaluator) == 1060);
    CHECK(level_at(evaluator, 1.0, 1020) == 0 && stepped(evaluator, 2, 3, 3));
    CHECK(advance(evaluator, 1060) == 2 && is_violation(0, A, 2, 1060));
    fm_evaluator_restore(evaluator, block);
    CHECK(((const struct inputs *)fm_evaluator_inputs(evaluator))->level >= 50.0);
    CHECK(!fm_evaluator_is_stale(evaluator, FLAG) && !fm_evaluator_verdicts(evaluator)[B]);
  }
  free(block);
}

SCENARIO(the_counters_go_on_through_a_restore)
{
  struct fm_evaluator * evaluator = with_timeouts(FM_EVERY_MESSAGE, FLAG_50);
  void * block = saved_from(evaluator);
  (void)level_at(evaluator, 50.0, 1001);
  CHECK(advance(evaluator, 1050) == 2);
  fm_evaluator_restore(evaluator, block);
  CHECK(fm_evaluator_requirement_counts(evaluator, B).steps == 1);
  CHECK(fm_evaluator_requirement_counts(evaluator, B).violations == 1);
  CHECK(fm_evaluator_requirement_counts(evaluator, B).verdict);
  CHECK(fm_evaluator_input_counts(evaluator, LEVEL).received == 1);
  CHECK(fm_evaluator_topic_counts(evaluator, LEVEL_TOPIC).messages == 1);
  CHECK(silence_of_flag(evaluator).count == 1 && !silence_of_flag(evaluator).is_silent);
  CHECK(!fm_evaluator_has_value(evaluator, LEVEL) && stepped(evaluator, 0, 0, 0));
  (void)level_at(evaluator, 50.0, 1001);
  CHECK(fm_evaluator_requirement_counts(evaluator, B).steps == 2);
  CHECK(fm_evaluator_time_counts(evaluator).restarts == 0);
  free(block);
}

SCENARIO(a_restored_instance_is_due_when_it_was)
{
  struct fm_evaluator * evaluator = with_timeouts(FM_PERIODIC, FLAG_50);
  void * block = saved_from(evaluator);
  store_flag(evaluator, true, 5000);
  CHECK(fm_evaluator_deadline(evaluator) == 5050);
  fm_evaluator_restore(evaluator, block);
  CHECK(fm_evaluator_wake(evaluator) <= 1050);
  CHECK(advance(evaluator, 1050) == 2 && is_violation(0, A, 0, 1050));
  free(block);
}

SCENARIO(an_instance_from_before_the_time_began_begins_it_anew)
{
  const struct fm_evaluator_options options = timed(FM_PERIODIC, FLAG_50);
  struct fm_evaluator * evaluator = make(&options);
  void * block = saved_from(evaluator);
  CHECK(advance(evaluator, 5000) == 0 && fm_evaluator_deadline(evaluator) == 5050);
  fm_evaluator_restore(evaluator, block);
  CHECK(fm_evaluator_deadline(evaluator) == INT64_MIN && fm_evaluator_now(evaluator) == 0);
  CHECK(advance(evaluator, 1000) == 0 && fm_evaluator_deadline(evaluator) == 1050);
  CHECK(fm_evaluator_time_counts(evaluator).restarts == 0);
  free(block);
}

SCENARIO(an_instance_may_be_restored_to_another_evaluator_when_its_own_is_gone)
{
  const struct fm_evaluator_options options = timed(FM_EVERY_MESSAGE, FLAG_50);
  struct fm_evaluator * evaluator = begun_at_1000(&options);
  (void)level_at(evaluator, 50.0, 1001);
  (void)flag_at(evaluator, true, 1010);
  void * block = saved_from(evaluator);
  evaluator = make(&options);
  fm_evaluator_restore(evaluator, block);
  memset(block, 0xA5, (size_t)fm_evaluator_instance_bytes(evaluator));
  free(block);
  CHECK(stepped(evaluator, 1, 2, 2) && !fm_evaluator_verdicts(evaluator)[B]);
  CHECK(fm_evaluator_requirement_counts(evaluator, B).violations == 0);
  CHECK(advance(evaluator, 1060) == 2 && is_violation(0, A, 1, 1060));
  CHECK(level_at(evaluator, 50.0, 1070) == 2 && is_violation(1, B, 2, 1070));
}

SCENARIO(a_saved_instance_holds_no_address)
{
  const struct fm_evaluator_options options = timed(FM_EVERY_MESSAGE, FLAG_50);
  void * blocks[2];
  void * other_memory = NULL;
  struct fm_evaluator * evaluator = NULL;
  for (int k = 0; k < 2; ++k) {
    other_memory = memory;
    memory = NULL;  // both evaluators at once, so that they have two places
    evaluator = begun_at_1000(&options);
    (void)level_at(evaluator, 50.0, 1001);
    (void)flag_at(evaluator, true, 1010);
    blocks[k] = saved_from(evaluator);
    CHECK(k == 0 || memory != other_memory);
  }
  CHECK(memcmp(blocks[0], blocks[1], (size_t)fm_evaluator_instance_bytes(evaluator)) == 0);
  free(blocks[0]);
  free(blocks[1]);
  free(other_memory);
}

// ---- a gate ------------------------------------------------------------------------------------

// A substitute violates unless an input of the gate's own topic is stale: one of another topic is
// no excuse.
SCENARIO(a_substitute_that_violates_counts_while_another_topic_is_stale)
{
  const struct fm_topic topics[] = {{&BOTH[FLAG], 1}, {&BOTH[LEVEL], 1}};
  const int64_t level_50[] = {0, 50};
  struct fm_evaluator_options options = timed(FM_EVERY_MESSAGE, level_50);
  options.topics = topics;
  options.n_topics = 2;
  struct fm_evaluator * evaluator = make(&options);
  const struct fm_gate_options rules = {
    .evaluator = evaluator, .monitor = &MONITOR, .topics = topics, .n_topics = 2,
    .from = FLAG_TOPIC, .otherwise = FM_SUBSTITUTE};
  void * block = malloc((size_t)fm_gate_bytes(&rules));
  struct fm_gate * gate = fm_gate_init(block, &rules);
  struct fm_field field = {{.i = 1}, FM_FIELD_READ, 0};
  uint32_t n;
  (void)advance(evaluator, 0);
  (void)level_at(evaluator, 5.0, 10);
  (void)level_at(evaluator, 5.0, 11);  // D is violated at the second step
  CHECK(fm_gate_judge(gate, &field, 20, 20, 20, out, &n) == FM_PASSED);
  fm_gate_finish(gate);
  (void)advance(evaluator, 100);
  field.value.i = 0;
  CHECK(fm_gate_replace(gate, &field, 110, 110, 110, out, &n));
  CHECK(fm_gate_counts(gate, 110).violating == 1);
  free(block);
}

SCENARIO(a_held_message_that_violates_never_happened)
{
  struct fm_evaluator * evaluator = with_policy(FM_EVERY_MESSAGE);
  const struct fm_gate_options rules = {
    .evaluator = evaluator, .monitor = &MONITOR, .topics = TOPICS, .n_topics = N_TOPICS,
    .from = FLAG_TOPIC, .otherwise = FM_HOLD, .hold = 1000};
  void * block = malloc((size_t)fm_gate_bytes(&rules));
  struct fm_gate * gate = fm_gate_init(block, &rules);
  const struct fm_field no = {{.i = 0}, FM_FIELD_READ, 0};
  uint32_t n;
  (void)advance(evaluator, 0);
  (void)level_at(evaluator, 5.0, 10);
  CHECK(!fm_gate_replace(gate, &no, 20, 20, 20, out, &n) && n == 0);
  CHECK(stepped(evaluator, 0, 1, 1) && fm_gate_counts(gate, 20).replaced == 0);
  free(block);
}

// ---- values ------------------------------------------------------------------------------------

struct all_types
{
  bool b;
  int8_t i8;
  int16_t i16;
  int32_t i32;
  int64_t i64;
  uint8_t u8;
  uint16_t u16;
  uint32_t u32;
  uint64_t u64;
  float f32;
  double f64;
};

#define INPUT(field, type) {#field, (uint32_t)offsetof(struct all_types, field), (type)}
static const struct fm_input TYPED[] = {
  INPUT(b, FM_BOOL), INPUT(i8, FM_INT8), INPUT(i16, FM_INT16), INPUT(i32, FM_INT32),
  INPUT(i64, FM_INT64), INPUT(u8, FM_UINT8), INPUT(u16, FM_UINT16), INPUT(u32, FM_UINT32),
  INPUT(u64, FM_UINT64), INPUT(f32, FM_FLOAT32), INPUT(f64, FM_FLOAT64)};
static const struct fm_monitor TYPES = {
  FM_ABI, 11, 0, 0, 0, sizeof(struct all_types), TYPED, NULL, NULL, "types", "", NULL, NULL, 0,
  NULL};

static struct fm_evaluator * with_types(void)
{
  const struct fm_evaluator_options options = {
    &TYPES, NULL, 0, FM_EVERY_MESSAGE, NULL, NULL, NULL, 0, 0, NULL, false, NULL, NULL, NULL,
    NULL, NULL};
  return make(&options);
}

SCENARIO(integers_wrap_to_the_type_of_the_input)
{
  struct fm_evaluator * evaluator = with_types();
  const struct all_types * values = fm_evaluator_inputs(evaluator);
  const union fm_value big = {.u = UINT64_C(0xFEDCBA98765432FF)};
  for (uint32_t i = 0; i <= 8; ++i) {
    fm_evaluator_store(evaluator, i, big, 0);
  }
  CHECK(values->b && values->i8 == -1 && values->u8 == 255);
  CHECK(values->i16 == 0x32FF && values->u16 == 0x32FF);
  CHECK(values->i32 == 0x765432FF && values->u32 == UINT32_C(0x765432FF));
  CHECK(values->i64 == -INT64_C(0x0123456789ABCD01));
  CHECK(values->u64 == UINT64_C(0xFEDCBA98765432FF));
}

SCENARIO(a_bool_is_whether_the_integer_is_not_zero)
{
  struct fm_evaluator * evaluator = with_types();
  const struct all_types * values = fm_evaluator_inputs(evaluator);
  const union fm_value high = {.i = INT64_MIN};
  const union fm_value zero = {.i = 0};
  fm_evaluator_store(evaluator, 0, high, 0);
  CHECK(values->b);
  fm_evaluator_store(evaluator, 0, zero, 0);
  CHECK(!values->b);
}

SCENARIO(a_bool_in_memory_may_be_any_byte)
{
  struct fm_evaluator * evaluator = with_types();
  const struct all_types * values = fm_evaluator_inputs(evaluator);
  const unsigned char byte = 0x82;
  fm_evaluator_store_from(evaluator, 0, &byte, 0);
  CHECK(values->b);
  CHECK(memcmp(&values->b, "\1", 1) == 0);
}

SCENARIO(a_float32_is_rounded_once)
{
  struct fm_evaluator * evaluator = with_types();
  const struct all_types * values = fm_evaluator_inputs(evaluator);
  const union fm_value tenth = {.f = 0.1};
  const float expected = 0.1f;
  fm_evaluator_store(evaluator, 9, tenth, 0);
  fm_evaluator_store(evaluator, 10, tenth, 0);
  CHECK(memcmp(&values->f32, &expected, sizeof expected) == 0);
  CHECK(memcmp(&values->f64, &tenth, sizeof tenth) == 0);
}

SCENARIO(values_are_taken_from_memory_of_their_type_at_any_alignment)
{
  struct fm_evaluator * evaluator = with_types();
  const struct all_types * values = fm_evaluator_inputs(evaluator);
  const float third = 1.0f / 3.0f;
  const int16_t negative = -12345;
  char place[9];
  memcpy(place + 1, &third, sizeof third);
  fm_evaluator_store_from(evaluator, 9, place + 1, 0);
  memcpy(place + 1, &negative, sizeof negative);
  fm_evaluator_store_from(evaluator, 2, place + 1, 0);
  CHECK(memcmp(&values->f32, &third, sizeof third) == 0 && values->i16 == -12345);
  CHECK(fm_evaluator_input_counts(evaluator, 9).received == 1);
}

// ---- rows --------------------------------------------------------------------------------------

SCENARIO(rows_are_stored_and_stepped_in_one_call)
{
  struct fm_evaluator * evaluator = with_policy(FM_ALL_INPUTS);
  const uint8_t flags[] = {1, 0, 0};
  const double levels[] = {50.0, 50.0, 1.0};
  const void * const columns[] = {flags, levels};
  const int64_t times[] = {0, 1, 2};
  int64_t instants[4];
  bool verdicts[4][N_REQUIREMENTS];
  struct fm_rows rows = {columns, times, 3, 0, NULL, NULL};
  CHECK(fm_evaluator_rows(evaluator, &rows, INT64_MIN, 4, instants, verdicts[0]) == 3);
  CHECK(instants[0] == 0 && instants[1] == 1 && instants[2] == 2);
  CHECK(verdicts[0][A] && !verdicts[0][B] && verdicts[0][C] && verdicts[0][D]);
  CHECK(!verdicts[1][A] && !verdicts[1][B] && !verdicts[1][C] && !verdicts[1][D]);
  CHECK(!verdicts[2][A] && verdicts[2][B] && verdicts[2][C] && verdicts[2][D]);
  CHECK(stepped(evaluator, 3, 3, 3));
}

SCENARIO(a_column_that_is_missing_leaves_its_input_alone)
{
  struct fm_evaluator * evaluator = with_policy(FM_EVERY_MESSAGE);
  const double levels[] = {50.0, 1.0};
  const void * const columns[] = {NULL, levels};
  const int64_t times[] = {0, 1};
  struct fm_rows rows = {columns, times, 2, 0, NULL, NULL};
  CHECK(fm_evaluator_row(evaluator, &rows, out) == 1);
  CHECK(fm_evaluator_row(evaluator, &rows, out) == 1);
  CHECK(stepped(evaluator, 0, 2, 2) && !fm_evaluator_has_value(evaluator, FLAG));
}

// ---- what is refused or ignored ----------------------------------------------------------------

SCENARIO(indices_out_of_range_are_ignored)
{
  struct fm_evaluator * evaluator = with_policy(FM_EVERY_MESSAGE);
  const union fm_value value = {.i = 1};
  const uint32_t wrong[] = {N_REQUIREMENTS, UINT32_MAX};
  for (int k = 0; k < 2; ++k) {
    fm_evaluator_store(evaluator, wrong[k], value, 0);
    fm_evaluator_store_from(evaluator, wrong[k], &value, 0);
    fm_evaluator_initial(evaluator, wrong[k], value);
    fm_evaluator_initial_from(evaluator, wrong[k], &value);
    fm_evaluator_unusable(evaluator, wrong[k]);
    fm_evaluator_undecodable(evaluator, wrong[k]);
    CHECK(fm_evaluator_message(evaluator, wrong[k], 0, out) == 0);
    CHECK(!fm_evaluator_is_stale(evaluator, wrong[k]));
    CHECK(!fm_evaluator_ready(evaluator, wrong[k]));
    CHECK(fm_evaluator_steps(evaluator, wrong[k]) == 0);
    CHECK(fm_evaluator_start(evaluator, wrong[k]) == 0);
    CHECK(!fm_evaluator_has_value(evaluator, wrong[k]));
    CHECK(fm_evaluator_requirement_counts(evaluator, wrong[k]).verdict);
    CHECK(fm_evaluator_input_counts(evaluator, wrong[k]).received == 0);
    CHECK(fm_evaluator_silence(evaluator, wrong[k]).count == 0);
    CHECK(!fm_evaluator_silence(evaluator, wrong[k]).is_silent);
    CHECK(fm_evaluator_topic_counts(evaluator, wrong[k]).messages == 0);
  }
  CHECK(stepped(evaluator, 0, 0, 0));
}

static bool is_refused(const struct fm_monitor * monitor)
{
  struct fm_evaluator_options options = options_of(FM_EVERY_MESSAGE);
  options.monitor = monitor;
  return make(&options) == NULL;
}

static bool is_refused_with_group(struct fm_group group)
{
  struct fm_monitor monitor = MONITOR;
  const struct fm_group groups[] = {group, GROUPS[1], GROUPS[2]};
  monitor.groups = groups;
  return is_refused(&monitor);
}

SCENARIO(a_monitor_of_another_abi_is_refused)
{
  struct fm_monitor monitor = MONITOR;
  struct fm_evaluator_options options = options_of(FM_EVERY_MESSAGE);
  monitor.abi += 1;
  options.monitor = &monitor;
  CHECK(fm_evaluator_bytes(&options) == 0);
  CHECK(is_refused(&monitor));
  options.monitor = NULL;
  CHECK(fm_evaluator_bytes(&options) == 0);
  CHECK(is_refused(NULL));
}

SCENARIO(groups_with_wrong_indices_are_refused)
{
  const uint32_t too_far[] = {FLAG, N_INPUTS};
  const uint32_t twice[] = {A, A};
  const uint32_t of_another_group[] = {A, B};
  const struct fm_group missing_one = {BOTH, 2, A_AND_C, 1, reset_0, step_0, NULL};
  const struct fm_group far_input = {too_far, 2, A_AND_C, 2, reset_0, step_0, NULL};
  const struct fm_group double_input = {twice, 2, A_AND_C, 2, reset_0, step_0, NULL};
  const struct fm_group double_requirement = {BOTH, 2, twice, 2, reset_0, step_0, NULL};
  const struct fm_group stranger = {BOTH, 2, of_another_group, 2, reset_0, step_0, NULL};
  CHECK(!is_refused_with_group(GROUPS[0]));
  CHECK(is_refused_with_group(missing_one) && is_refused_with_group(far_input));
  CHECK(is_refused_with_group(double_input) && is_refused_with_group(double_requirement));
  CHECK(is_refused_with_group(stranger));
}

SCENARIO(inputs_outside_their_struct_are_refused)
{
  struct fm_monitor monitor = MONITOR;
  struct fm_input inputs[] = {INPUTS[0], INPUTS[1]};
  monitor.inputs = inputs;
  CHECK(!is_refused(&monitor));
  inputs[LEVEL].offset = (uint32_t)sizeof(struct inputs) - 7;
  CHECK(is_refused(&monitor));
  inputs[LEVEL].offset = UINT32_MAX;
  CHECK(is_refused(&monitor));
  inputs[LEVEL] = INPUTS[LEVEL];
  inputs[LEVEL].type = 11;
  CHECK(is_refused(&monitor));
}

SCENARIO(topics_and_policies_that_are_none_are_refused)
{
  struct fm_evaluator_options options = options_of(FM_EVERY_MESSAGE);
  const uint32_t too_far[] = {N_INPUTS + 1000000};
  const struct fm_topic far_topic[] = {{too_far, 1}};
  const struct fm_topic twice[] = {{FEEDS_FLAG, 1}, {FEEDS_FLAG, 1}};
  CHECK(make(&options) != NULL);
  options.policy = FM_PERIODIC + 1;
  CHECK(make(&options) == NULL);
  options.policy = FM_EVERY_MESSAGE;
  options.topics = far_topic;
  options.n_topics = 1;
  CHECK(make(&options) == NULL);
  options.topics = twice;
  options.n_topics = 2;
  CHECK(make(&options) == NULL);
}

SCENARIO(negative_times_are_refused)
{
  struct fm_evaluator_options options = options_of(FM_PERIODIC);
  static const int64_t negative[2][2] = {{0, -1}, {-1, 0}};
  for (int k = 0; k < 2; ++k) {
    options.timeouts = negative[k];
    CHECK(make(&options) == NULL);
    options.timeouts = NULL;
    options.startups = negative[k];
    CHECK(make(&options) == NULL);
    options.startups = NULL;
  }
  options.period = -1;
  CHECK(make(&options) == NULL);
  options.period = 0;
  options.patience = INT64_MIN;
  CHECK(make(&options) == NULL);
  options.patience = 0;
  CHECK(make(&options) != NULL);
}

SCENARIO(sizes_that_no_memory_holds_are_refused)
{
  const uint64_t sizes[] = {UINT64_MAX, UINT64_MAX - 15, UINT64_MAX / 2, UINT64_MAX / 2 - 200};
  struct fm_monitor monitor = MONITOR;
  struct fm_evaluator_options options = options_of(FM_EVERY_MESSAGE);
  options.monitor = &monitor;
  for (int k = 0; k < 4; ++k) {
    monitor.state_bytes = sizes[k];
    CHECK(fm_evaluator_bytes(&options) == 0);
    CHECK(fm_evaluator_init(memory, &options) == NULL);
  }
  for (uint64_t size = (uint64_t)PTRDIFF_MAX - 4000; size < (uint64_t)PTRDIFF_MAX; ++size) {
    monitor.state_bytes = size;
    const uint64_t bytes = fm_evaluator_bytes(&options);
    CHECK(bytes == 0 || (bytes > size && bytes < (uint64_t)PTRDIFF_MAX));
  }
  monitor.state_bytes = 16;
  monitor.inputs_bytes = UINT64_MAX - 1000;
  CHECK(fm_evaluator_bytes(&options) == 0);
}

SCENARIO(two_evaluators_of_one_monitor_know_nothing_of_each_other)
{
  const struct fm_evaluator_options options = options_of(FM_EVERY_MESSAGE);
  void * other_memory = malloc((size_t)fm_evaluator_bytes(&options));
  struct fm_evaluator * other = fm_evaluator_init(other_memory, &options);
  struct fm_evaluator * evaluator = with_policy(FM_EVERY_MESSAGE);
  (void)level_message(evaluator, 50.0);
  CHECK(stepped(evaluator, 0, 1, 1) && stepped(other, 0, 0, 0));
  CHECK(fm_evaluator_verdicts(other)[B] && !fm_evaluator_has_value(other, LEVEL));
  free(other_memory);
}
