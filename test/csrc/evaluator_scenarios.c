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
/// Scenarios of the evaluator, on a hand-written monitor: `evaluator_scenarios NAME` runs one,
/// without a name it lists them. Exit status 0 if all that a scenario says is so.
///
/// The monitor: group 0 reads `flag` and `level`, group 1 reads `level` alone, group 2 nothing.
///   A (group 0): flag            B (group 1): level < 10
///   C (group 0): flag or level < 10              D (group 2): not at its step 1

#include "evaluator.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CHECK(condition) check((condition), #condition, __LINE__)

static int failures = 0;

static void check(bool condition, const char * text, int line)
{
  if (!condition) {
    printf("line %d: not so: %s\n", line, text);
    failures += 1;
  }
}

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
  {BOTH, 2, A_AND_C, 2, reset_0, step_0},
  {LEVEL_ONLY, 1, B_ONLY, 1, reset_1, step_1},
  {NULL, 0, D_ONLY, 1, reset_2, step_2},
};
static const struct fm_requirement REQUIREMENTS[] = {{"A", 0}, {"B", 1}, {"C", 0}, {"D", 2}};
static const struct fm_monitor MONITOR = {
  FM_ABI, N_INPUTS, 3, N_REQUIREMENTS, sizeof(struct state), sizeof(struct inputs),
  INPUTS, GROUPS, REQUIREMENTS, "scenarios", "", step_all
};

static const uint32_t FEEDS_FLAG[] = {FLAG};
static const uint32_t FEEDS_LEVEL[] = {LEVEL};
static const struct fm_topic TOPICS[] = {{FEEDS_FLAG, 1}, {FEEDS_LEVEL, 1}, {NULL, 0}};
static const bool ONSET_OF_A[] = {true, false, false, false};

// ---- helpers -----------------------------------------------------------------------------------

static void * memory = NULL;
static struct fm_violation out[N_REQUIREMENTS];

static struct fm_evaluator_options options_of(enum fm_policy policy)
{
  const struct fm_evaluator_options options = {
    &MONITOR, TOPICS, N_TOPICS, (uint32_t)policy, ONSET_OF_A};
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

static void store_flag(struct fm_evaluator * evaluator, bool flag)
{
  const union fm_value value = {.i = flag};
  fm_evaluator_store(evaluator, FLAG, value);
}

static void store_level(struct fm_evaluator * evaluator, double level)
{
  const union fm_value value = {.f = level};
  fm_evaluator_store(evaluator, LEVEL, value);
}

static uint32_t flag_message(struct fm_evaluator * evaluator, bool flag)
{
  store_flag(evaluator, flag);
  return fm_evaluator_message(evaluator, FLAG_TOPIC, 100, out);
}

static uint32_t level_message(struct fm_evaluator * evaluator, double level)
{
  store_level(evaluator, level);
  return fm_evaluator_message(evaluator, LEVEL_TOPIC, 200, out);
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

static void no_group_steps_before_all_its_inputs_have_a_value(void)
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

static void groups_start_one_by_one_and_number_their_own_steps(void)
{
  struct fm_evaluator * evaluator = with_policy(FM_EVERY_MESSAGE);
  CHECK(level_message(evaluator, 50.0) == 1 && is_violation(0, B, 0, 200));
  CHECK(level_message(evaluator, 50.0) == 2 && is_violation(0, B, 1, 200));
  CHECK(flag_message(evaluator, false) == 3 && stepped(evaluator, 1, 3, 3));
  CHECK(is_violation(0, A, 0, 100) && is_violation(1, C, 0, 100) && is_violation(2, B, 2, 100));
}

static void every_message_steps_all_ready_groups(void)
{
  struct fm_evaluator * evaluator = with_policy(FM_EVERY_MESSAGE);
  (void)level_message(evaluator, 1.0);
  (void)flag_message(evaluator, true);
  CHECK(stepped(evaluator, 1, 2, 2));
  CHECK(fm_evaluator_message(evaluator, OTHER_TOPIC, 0, out) == 0 && stepped(evaluator, 2, 3, 3));
}

static void relevant_message_steps_the_groups_that_read_the_topic(void)
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

static void all_inputs_steps_a_group_once_all_were_received_anew(void)
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

static void all_inputs_counts_values_that_a_group_never_stepped_on(void)
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

static void other_policies_count_nothing_as_overwritten(void)
{
  struct fm_evaluator * evaluator = with_policy(FM_RELEVANT_MESSAGE);
  for (int k = 0; k < 4; ++k) {
    (void)level_message(evaluator, 1.0);
  }
  CHECK(fm_evaluator_input_counts(evaluator, LEVEL).overwritten == 0);
}

static void all_inputs_waits_for_a_value_even_where_there_is_an_initial_one(void)
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

static void a_period_is_a_step_and_a_message_is_none(void)
{
  struct fm_evaluator * evaluator = with_policy(FM_PERIODIC);
  CHECK(level_message(evaluator, 50.0) == 0 && stepped(evaluator, 0, 0, 0));
  CHECK(fm_evaluator_tick(evaluator, -7, out) == 1 && is_violation(0, B, 0, -7));
  CHECK(stepped(evaluator, 0, 1, 1));
  (void)flag_message(evaluator, true);
  CHECK(fm_evaluator_tick(evaluator, 0, out) == 2 && stepped(evaluator, 1, 2, 2));
  CHECK(fm_evaluator_topic_counts(evaluator, FLAG_TOPIC).messages == 1);
}

static void a_row_is_a_step_under_every_policy(void)
{
  for (int policy = FM_EVERY_MESSAGE; policy <= FM_PERIODIC; ++policy) {
    struct fm_evaluator * evaluator = with_policy((enum fm_policy)policy);
    store_flag(evaluator, true);
    store_level(evaluator, 50.0);
    CHECK(fm_evaluator_tick(evaluator, 3, out) == 1 && is_violation(0, B, 0, 3));
    CHECK(fm_evaluator_tick(evaluator, 4, out) == 2 && stepped(evaluator, 2, 2, 2));
  }
}

static void all_groups_are_stepped_in_one_call_once_all_are_ready(void)
{
  struct fm_evaluator * evaluator = with_policy(FM_EVERY_MESSAGE);
  n_common_steps = 0;
  (void)level_message(evaluator, 50.0);
  (void)level_message(evaluator, 50.0);
  CHECK(n_common_steps == 0 && stepped(evaluator, 0, 2, 2));
  CHECK(flag_message(evaluator, false) == 3 && n_common_steps == 1 && stepped(evaluator, 1, 3, 3));
  CHECK(is_violation(0, A, 0, 100) && is_violation(1, C, 0, 100) && is_violation(2, B, 2, 100));
  CHECK(fm_evaluator_tick(evaluator, 5, out) == 2 && n_common_steps == 2);
}

static void other_messages_step_some_groups_by_themselves(void)
{
  struct fm_evaluator * evaluator = with_policy(FM_RELEVANT_MESSAGE);
  (void)level_message(evaluator, 1.0);
  n_common_steps = 0;
  (void)flag_message(evaluator, true);
  CHECK(n_common_steps == 0 && stepped(evaluator, 1, 1, 2));
}

static void groups_are_stepped_one_by_one_without_a_common_step(void)
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

static void a_tick_starts_the_wait_of_all_inputs_anew(void)
{
  struct fm_evaluator * evaluator = with_policy(FM_ALL_INPUTS);
  (void)flag_message(evaluator, true);
  store_level(evaluator, 1.0);
  (void)fm_evaluator_tick(evaluator, 0, out);
  CHECK(stepped(evaluator, 1, 1, 2));
  (void)flag_message(evaluator, true);
  CHECK(stepped(evaluator, 1, 1, 3));
  (void)level_message(evaluator, 1.0);
  CHECK(stepped(evaluator, 2, 2, 4));
  CHECK(fm_evaluator_input_counts(evaluator, FLAG).overwritten == 0);
}

static void an_initial_value_makes_a_group_ready(void)
{
  struct fm_evaluator * evaluator = with_policy(FM_EVERY_MESSAGE);
  const double high = 50.0;
  fm_evaluator_initial_from(evaluator, LEVEL, &high);
  CHECK(fm_evaluator_ready(evaluator, 1) && fm_evaluator_has_value(evaluator, LEVEL));
  CHECK(flag_message(evaluator, false) == 3 && stepped(evaluator, 1, 1, 1));
  CHECK(fm_evaluator_input_counts(evaluator, LEVEL).received == 0);
}

static void a_message_that_cannot_be_decoded_is_counted_and_is_no_step(void)
{
  struct fm_evaluator * evaluator = with_policy(FM_EVERY_MESSAGE);
  (void)level_message(evaluator, 1.0);
  fm_evaluator_undecodable(evaluator, LEVEL_TOPIC);
  CHECK(stepped(evaluator, 0, 1, 1));
  CHECK(fm_evaluator_topic_counts(evaluator, LEVEL_TOPIC).messages == 1);
  CHECK(fm_evaluator_topic_counts(evaluator, LEVEL_TOPIC).undecodable == 1);
  CHECK(fm_evaluator_topic_counts(evaluator, FLAG_TOPIC).undecodable == 0);
}

static void a_field_that_cannot_be_used_keeps_its_value_and_the_step_happens(void)
{
  struct fm_evaluator * evaluator = with_policy(FM_EVERY_MESSAGE);
  (void)level_message(evaluator, 50.0);
  fm_evaluator_unusable(evaluator, LEVEL);
  CHECK(fm_evaluator_message(evaluator, LEVEL_TOPIC, 200, out) == 2 && is_violation(0, B, 1, 200));
  CHECK(fm_evaluator_input_counts(evaluator, LEVEL).unusable == 1);
  CHECK(fm_evaluator_input_counts(evaluator, LEVEL).received == 1);
}

static void with_all_inputs_an_unusable_field_is_not_received(void)
{
  struct fm_evaluator * evaluator = with_policy(FM_ALL_INPUTS);
  (void)level_message(evaluator, 1.0);
  fm_evaluator_unusable(evaluator, LEVEL);
  (void)fm_evaluator_message(evaluator, LEVEL_TOPIC, 200, out);
  CHECK(stepped(evaluator, 0, 1, 2));
}

// ---- what is reported --------------------------------------------------------------------------

static void onset_is_told_when_the_verdict_turns_false(void)
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

static void every_step_is_told_otherwise(void)
{
  struct fm_evaluator * evaluator = with_policy(FM_RELEVANT_MESSAGE);
  (void)level_message(evaluator, 50.0);
  CHECK(level_message(evaluator, 50.0) == 2 && is_violation(0, B, 1, 200));
  CHECK(level_message(evaluator, 50.0) == 1 && is_violation(0, B, 2, 200));
  CHECK(fm_evaluator_requirement_counts(evaluator, B).announced == 3);
}

static void without_flags_no_requirement_reports_onsets(void)
{
  struct fm_evaluator_options options = options_of(FM_RELEVANT_MESSAGE);
  options.report_onset = NULL;
  struct fm_evaluator * evaluator = make(&options);
  (void)level_message(evaluator, 1.0);
  (void)flag_message(evaluator, false);
  CHECK(flag_message(evaluator, false) == 1 && is_violation(0, A, 1, 100));
}

static void violations_are_counted_without_a_place_for_them(void)
{
  struct fm_evaluator * evaluator = with_policy(FM_EVERY_MESSAGE);
  store_level(evaluator, 50.0);
  CHECK(fm_evaluator_message(evaluator, LEVEL_TOPIC, 0, NULL) == 1);
  CHECK(fm_evaluator_tick(evaluator, 0, NULL) == 2);
  CHECK(fm_evaluator_requirement_counts(evaluator, B).announced == 2);
}

static void verdicts_are_true_until_the_first_step(void)
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

static void reset_starts_all_groups_afresh_and_keeps_values_and_counters(void)
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

static void reset_makes_all_inputs_wait_for_everything_anew(void)
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

// ---- silence -----------------------------------------------------------------------------------

static uint32_t stale(struct fm_evaluator * evaluator, uint32_t input)
{
  const uint64_t received = fm_evaluator_input_counts(evaluator, input).received;
  return fm_evaluator_stale(evaluator, input, received, 300, out);
}

static void what_reads_a_stale_input_is_violated_at_once_and_without_a_step(void)
{
  struct fm_evaluator * evaluator = with_policy(FM_RELEVANT_MESSAGE);
  (void)level_message(evaluator, 1.0);
  (void)flag_message(evaluator, true);
  CHECK(stepped(evaluator, 1, 1, 2));
  CHECK(stale(evaluator, FLAG) == 2 && is_violation(0, A, 1, 300) && is_violation(1, C, 1, 300));
  CHECK(fm_evaluator_is_stale(evaluator, FLAG) && !fm_evaluator_is_stale(evaluator, LEVEL));
  CHECK(stepped(evaluator, 1, 1, 2) && !fm_evaluator_verdicts(evaluator)[C]);
  CHECK(fm_evaluator_verdicts(evaluator)[B] && fm_evaluator_ready(evaluator, 0));
  const struct fm_requirement_counts counts = fm_evaluator_requirement_counts(evaluator, C);
  CHECK(counts.steps == 1 && counts.violations == 1 && counts.announced == 1 && !counts.verdict);
}

static void a_silence_is_told_once_and_by_each_step_that_is_due(void)
{
  struct fm_evaluator * evaluator = with_policy(FM_RELEVANT_MESSAGE);
  (void)level_message(evaluator, 1.0);
  (void)flag_message(evaluator, true);
  CHECK(stale(evaluator, FLAG) == 2 && stale(evaluator, FLAG) == 0);
  CHECK(stale(evaluator, LEVEL) == 1 && is_violation(0, B, 1, 300));  // A and C are told of
  // A reports its onset, and that was the silence.
  CHECK(level_message(evaluator, 1.0) == 1 && is_violation(0, C, 1, 200));
  CHECK(stepped(evaluator, 2, 2, 3) && fm_evaluator_verdicts(evaluator)[B]);
}

static void a_value_ends_a_silence_and_the_past_went_on(void)
{
  struct fm_evaluator * evaluator = with_policy(FM_EVERY_MESSAGE);
  (void)level_message(evaluator, 1.0);
  (void)flag_message(evaluator, true);
  CHECK(stale(evaluator, FLAG) == 2);
  store_flag(evaluator, true);
  CHECK(!fm_evaluator_is_stale(evaluator, FLAG) && !fm_evaluator_verdicts(evaluator)[A]);
  CHECK(fm_evaluator_message(evaluator, FLAG_TOPIC, 100, out) == 0);
  CHECK(fm_evaluator_verdicts(evaluator)[A] && stepped(evaluator, 2, 3, 3));
  CHECK(stale(evaluator, FLAG) == 2 && is_violation(0, A, 2, 300));
}

static void a_value_that_came_meanwhile_is_no_silence(void)
{
  struct fm_evaluator * evaluator = with_policy(FM_EVERY_MESSAGE);
  (void)flag_message(evaluator, true);
  const uint64_t received = fm_evaluator_input_counts(evaluator, FLAG).received;
  (void)flag_message(evaluator, true);
  CHECK(fm_evaluator_stale(evaluator, FLAG, received, 300, out) == 0);
  CHECK(!fm_evaluator_is_stale(evaluator, FLAG));
}

static void an_input_that_never_spoke_is_told_and_forgiven_when_it_does(void)
{
  struct fm_evaluator * evaluator = with_policy(FM_EVERY_MESSAGE);
  CHECK(stale(evaluator, LEVEL) == 3 && is_violation(0, A, 0, 300) && is_violation(2, B, 0, 300));
  CHECK(stepped(evaluator, 0, 0, 0) && !fm_evaluator_verdicts(evaluator)[A]);
  CHECK(level_message(evaluator, 1.0) == 0 && fm_evaluator_verdicts(evaluator)[B]);
  // Nothing can be said of A without a flag; a second silence is news.
  CHECK(fm_evaluator_verdicts(evaluator)[A] && !fm_evaluator_ready(evaluator, 0));
  CHECK(stale(evaluator, LEVEL) == 3 && is_violation(0, A, 0, 300) && is_violation(2, B, 1, 300));
}

static void an_onset_that_is_violated_already_is_not_told_anew_by_a_silence(void)
{
  struct fm_evaluator * evaluator = with_policy(FM_EVERY_MESSAGE);
  (void)level_message(evaluator, 1.0);
  CHECK(flag_message(evaluator, false) == 2);  // A, and D at its step 1
  CHECK(stale(evaluator, FLAG) == 1 && is_violation(0, C, 1, 300));
  CHECK(fm_evaluator_requirement_counts(evaluator, A).violations == 2);
  CHECK(fm_evaluator_requirement_counts(evaluator, A).announced == 1);
}

static void a_stale_input_is_told_anew_after_a_reset(void)
{
  struct fm_evaluator * evaluator = with_policy(FM_PERIODIC);
  store_flag(evaluator, true);
  store_level(evaluator, 1.0);
  CHECK(stale(evaluator, FLAG) == 2);
  fm_evaluator_reset(evaluator);
  CHECK(fm_evaluator_is_stale(evaluator, FLAG) && fm_evaluator_verdicts(evaluator)[A]);
  CHECK(stale(evaluator, FLAG) == 2 && is_violation(0, A, 0, 300) && stale(evaluator, FLAG) == 0);
  fm_evaluator_reset(evaluator);
  CHECK(fm_evaluator_tick(evaluator, 7, out) == 2 && is_violation(0, A, 0, 7));
  CHECK(stale(evaluator, FLAG) == 0);  // a step has told it
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
  FM_ABI, 11, 0, 0, 0, sizeof(struct all_types), TYPED, NULL, NULL, "types", "", NULL};

static struct fm_evaluator * with_types(void)
{
  const struct fm_evaluator_options options = {&TYPES, NULL, 0, FM_EVERY_MESSAGE, NULL};
  return make(&options);
}

static void integers_wrap_to_the_type_of_the_input(void)
{
  struct fm_evaluator * evaluator = with_types();
  const struct all_types * values = fm_evaluator_inputs(evaluator);
  const union fm_value big = {.u = UINT64_C(0xFEDCBA98765432FF)};
  for (uint32_t i = 0; i <= 8; ++i) {
    fm_evaluator_store(evaluator, i, big);
  }
  CHECK(values->b && values->i8 == -1 && values->u8 == 255);
  CHECK(values->i16 == 0x32FF && values->u16 == 0x32FF);
  CHECK(values->i32 == 0x765432FF && values->u32 == UINT32_C(0x765432FF));
  CHECK(values->i64 == -INT64_C(0x0123456789ABCD01));
  CHECK(values->u64 == UINT64_C(0xFEDCBA98765432FF));
}

static void a_bool_is_whether_the_integer_is_not_zero(void)
{
  struct fm_evaluator * evaluator = with_types();
  const struct all_types * values = fm_evaluator_inputs(evaluator);
  const union fm_value high = {.i = INT64_MIN};
  const union fm_value zero = {.i = 0};
  fm_evaluator_store(evaluator, 0, high);
  CHECK(values->b);
  fm_evaluator_store(evaluator, 0, zero);
  CHECK(!values->b);
}

static void a_bool_in_memory_may_be_any_byte(void)
{
  struct fm_evaluator * evaluator = with_types();
  const struct all_types * values = fm_evaluator_inputs(evaluator);
  const unsigned char byte = 0x82;
  fm_evaluator_store_from(evaluator, 0, &byte);
  CHECK(values->b);
  CHECK(memcmp(&values->b, "\1", 1) == 0);
}

static void a_float32_is_rounded_once(void)
{
  struct fm_evaluator * evaluator = with_types();
  const struct all_types * values = fm_evaluator_inputs(evaluator);
  const union fm_value tenth = {.f = 0.1};
  const float expected = 0.1f;
  fm_evaluator_store(evaluator, 9, tenth);
  fm_evaluator_store(evaluator, 10, tenth);
  CHECK(memcmp(&values->f32, &expected, sizeof expected) == 0);
  CHECK(memcmp(&values->f64, &tenth, sizeof tenth) == 0);
}

static void values_are_taken_from_memory_of_their_type_at_any_alignment(void)
{
  struct fm_evaluator * evaluator = with_types();
  const struct all_types * values = fm_evaluator_inputs(evaluator);
  const float third = 1.0f / 3.0f;
  const int16_t negative = -12345;
  char place[9];
  memcpy(place + 1, &third, sizeof third);
  fm_evaluator_store_from(evaluator, 9, place + 1);
  memcpy(place + 1, &negative, sizeof negative);
  fm_evaluator_store_from(evaluator, 2, place + 1);
  CHECK(memcmp(&values->f32, &third, sizeof third) == 0 && values->i16 == -12345);
  CHECK(fm_evaluator_input_counts(evaluator, 9).received == 1);
}

// ---- rows --------------------------------------------------------------------------------------

static void rows_are_stored_and_stepped_in_one_call(void)
{
  struct fm_evaluator * evaluator = with_policy(FM_ALL_INPUTS);
  const uint8_t flags[] = {1, 0, 0};
  const double levels[] = {50.0, 50.0, 1.0};
  const void * const columns[] = {flags, levels};
  bool verdicts[3][N_REQUIREMENTS];
  // B twice, C once, D once, and A at its onset only.
  CHECK(fm_evaluator_rows(evaluator, columns, 3, &verdicts[0][0]) == 5);
  CHECK(verdicts[0][A] && !verdicts[0][B] && verdicts[0][C] && verdicts[0][D]);
  CHECK(!verdicts[1][A] && !verdicts[1][B] && !verdicts[1][C] && !verdicts[1][D]);
  CHECK(!verdicts[2][A] && verdicts[2][B] && verdicts[2][C] && verdicts[2][D]);
  CHECK(stepped(evaluator, 3, 3, 3));
}

static void a_column_that_is_missing_leaves_its_input_alone(void)
{
  struct fm_evaluator * evaluator = with_policy(FM_EVERY_MESSAGE);
  const double levels[] = {50.0, 1.0};
  const void * const columns[] = {NULL, levels};
  CHECK(fm_evaluator_rows(evaluator, columns, 2, NULL) == 2);
  CHECK(stepped(evaluator, 0, 2, 2) && !fm_evaluator_has_value(evaluator, FLAG));
}

// ---- what is refused or ignored ----------------------------------------------------------------

static void indices_out_of_range_are_ignored(void)
{
  struct fm_evaluator * evaluator = with_policy(FM_EVERY_MESSAGE);
  const union fm_value value = {.i = 1};
  const uint32_t wrong[] = {N_REQUIREMENTS, UINT32_MAX};
  for (int k = 0; k < 2; ++k) {
    fm_evaluator_store(evaluator, wrong[k], value);
    fm_evaluator_store_from(evaluator, wrong[k], &value);
    fm_evaluator_initial(evaluator, wrong[k], value);
    fm_evaluator_initial_from(evaluator, wrong[k], &value);
    fm_evaluator_unusable(evaluator, wrong[k]);
    fm_evaluator_undecodable(evaluator, wrong[k]);
    CHECK(fm_evaluator_message(evaluator, wrong[k], 0, out) == 0);
    CHECK(fm_evaluator_stale(evaluator, wrong[k], 0, 0, out) == 0);
    CHECK(!fm_evaluator_is_stale(evaluator, wrong[k]));
    CHECK(!fm_evaluator_ready(evaluator, wrong[k]));
    CHECK(fm_evaluator_steps(evaluator, wrong[k]) == 0);
    CHECK(!fm_evaluator_has_value(evaluator, wrong[k]));
    CHECK(fm_evaluator_requirement_counts(evaluator, wrong[k]).verdict);
    CHECK(fm_evaluator_input_counts(evaluator, wrong[k]).received == 0);
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

static void a_monitor_of_another_abi_is_refused(void)
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

static void groups_with_wrong_indices_are_refused(void)
{
  const uint32_t too_far[] = {FLAG, N_INPUTS};
  const uint32_t twice[] = {A, A};
  const uint32_t of_another_group[] = {A, B};
  const struct fm_group missing_one = {BOTH, 2, A_AND_C, 1, reset_0, step_0};
  const struct fm_group far_input = {too_far, 2, A_AND_C, 2, reset_0, step_0};
  const struct fm_group double_input = {twice, 2, A_AND_C, 2, reset_0, step_0};
  const struct fm_group double_requirement = {BOTH, 2, twice, 2, reset_0, step_0};
  const struct fm_group stranger = {BOTH, 2, of_another_group, 2, reset_0, step_0};
  CHECK(!is_refused_with_group(GROUPS[0]));
  CHECK(is_refused_with_group(missing_one) && is_refused_with_group(far_input));
  CHECK(is_refused_with_group(double_input) && is_refused_with_group(double_requirement));
  CHECK(is_refused_with_group(stranger));
}

static void inputs_outside_their_struct_are_refused(void)
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

static void topics_and_policies_that_are_none_are_refused(void)
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

static void sizes_that_no_memory_holds_are_refused(void)
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

static void two_evaluators_of_one_monitor_know_nothing_of_each_other(void)
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

// ---- main --------------------------------------------------------------------------------------

struct scenario
{
  const char * name;
  void (* run)(void);
};

#define SCENARIO(name) {#name, name}
static const struct scenario SCENARIOS[] = {
  SCENARIO(no_group_steps_before_all_its_inputs_have_a_value),
  SCENARIO(groups_start_one_by_one_and_number_their_own_steps),
  SCENARIO(every_message_steps_all_ready_groups),
  SCENARIO(relevant_message_steps_the_groups_that_read_the_topic),
  SCENARIO(all_inputs_steps_a_group_once_all_were_received_anew),
  SCENARIO(all_inputs_counts_values_that_a_group_never_stepped_on),
  SCENARIO(other_policies_count_nothing_as_overwritten),
  SCENARIO(all_inputs_waits_for_a_value_even_where_there_is_an_initial_one),
  SCENARIO(a_period_is_a_step_and_a_message_is_none),
  SCENARIO(a_row_is_a_step_under_every_policy),
  SCENARIO(all_groups_are_stepped_in_one_call_once_all_are_ready),
  SCENARIO(other_messages_step_some_groups_by_themselves),
  SCENARIO(groups_are_stepped_one_by_one_without_a_common_step),
  SCENARIO(a_tick_starts_the_wait_of_all_inputs_anew),
  SCENARIO(an_initial_value_makes_a_group_ready),
  SCENARIO(a_message_that_cannot_be_decoded_is_counted_and_is_no_step),
  SCENARIO(a_field_that_cannot_be_used_keeps_its_value_and_the_step_happens),
  SCENARIO(with_all_inputs_an_unusable_field_is_not_received),
  SCENARIO(onset_is_told_when_the_verdict_turns_false),
  SCENARIO(every_step_is_told_otherwise),
  SCENARIO(without_flags_no_requirement_reports_onsets),
  SCENARIO(violations_are_counted_without_a_place_for_them),
  SCENARIO(verdicts_are_true_until_the_first_step),
  SCENARIO(reset_starts_all_groups_afresh_and_keeps_values_and_counters),
  SCENARIO(reset_makes_all_inputs_wait_for_everything_anew),
  SCENARIO(what_reads_a_stale_input_is_violated_at_once_and_without_a_step),
  SCENARIO(a_silence_is_told_once_and_by_each_step_that_is_due),
  SCENARIO(a_value_ends_a_silence_and_the_past_went_on),
  SCENARIO(a_value_that_came_meanwhile_is_no_silence),
  SCENARIO(an_input_that_never_spoke_is_told_and_forgiven_when_it_does),
  SCENARIO(an_onset_that_is_violated_already_is_not_told_anew_by_a_silence),
  SCENARIO(a_stale_input_is_told_anew_after_a_reset),
  SCENARIO(integers_wrap_to_the_type_of_the_input),
  SCENARIO(a_bool_is_whether_the_integer_is_not_zero),
  SCENARIO(a_bool_in_memory_may_be_any_byte),
  SCENARIO(a_float32_is_rounded_once),
  SCENARIO(values_are_taken_from_memory_of_their_type_at_any_alignment),
  SCENARIO(rows_are_stored_and_stepped_in_one_call),
  SCENARIO(a_column_that_is_missing_leaves_its_input_alone),
  SCENARIO(indices_out_of_range_are_ignored),
  SCENARIO(a_monitor_of_another_abi_is_refused),
  SCENARIO(groups_with_wrong_indices_are_refused),
  SCENARIO(inputs_outside_their_struct_are_refused),
  SCENARIO(topics_and_policies_that_are_none_are_refused),
  SCENARIO(sizes_that_no_memory_holds_are_refused),
  SCENARIO(two_evaluators_of_one_monitor_know_nothing_of_each_other),
};

int main(int argc, char ** argv)
{
  bool found = false;
  for (size_t k = 0; k < sizeof SCENARIOS / sizeof SCENARIOS[0]; ++k) {
    if (argc < 2) {
      puts(SCENARIOS[k].name);
    } else if (strcmp(argv[1], SCENARIOS[k].name) == 0) {
      found = true;
      SCENARIOS[k].run();
    }
  }
  free(memory);
  return failures == 0 && (found || argc < 2) ? 0 : 1;
}
