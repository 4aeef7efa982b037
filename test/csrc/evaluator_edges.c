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

/// evaluator_edges.c: counters and times at their limits.
///
/// An evaluator whose counters begin just below a power of two does what one does that begins at
/// 0, and counts on from there. Includes tables.h for the structures. Times near
/// INT64_MIN and INT64_MAX do not overflow; what would come after the last time does not come.
/// Prints the first difference, if there is one.

#include "tables.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

enum {N_INPUTS = 2, N_GROUPS = 2, N_REQUIREMENTS = 2, N_CALLS = 400, N_SEEDS = 32};

struct inputs
{
  int32_t values[N_INPUTS];
};

struct state
{
  int32_t before;  // what the second group read at its last step
};

static void start(void * const state)
{
  ((struct state *)state)->before = 0;
}

static void keep(void * const state)
{
  (void)state;
}

static void step_first(void * const state, const void * const inputs, bool * const verdicts)
{
  (void)state;
  verdicts[0] = ((const struct inputs *)inputs)->values[0] < 1;
}

static void step_second(void * const state, const void * const inputs, bool * const verdicts)
{
  const struct inputs * const in = inputs;
  verdicts[1] = in->values[0] >= in->values[1] || ((struct state *)state)->before != in->values[1];
  ((struct state *)state)->before = in->values[1];
}

static const struct fm_input INPUTS[] = {
  {"a", (uint32_t)offsetof(struct inputs, values), FM_INT32},
  {"b", (uint32_t)(offsetof(struct inputs, values) + sizeof(int32_t)), FM_INT32},
};
static const uint32_t BOTH[] = {0, 1};
static const uint32_t SECOND[] = {1};
static const struct fm_group GROUPS[] = {
  {BOTH, 1, BOTH, 1, keep, step_first, NULL},
  {BOTH, 2, SECOND, 1, start, step_second, NULL},
};
static const struct fm_requirement REQUIREMENTS[] = {{"R0", 0}, {"R1", 1}};
static const struct fm_monitor MONITOR = {
  FM_ABI, N_INPUTS, N_GROUPS, N_REQUIREMENTS, sizeof(struct state), sizeof(struct inputs),
  INPUTS, GROUPS, REQUIREMENTS, "edges", "", NULL, NULL, 0, NULL
};
static const struct fm_topic TOPICS[] = {{BOTH, 1}, {SECOND, 1}};
static const uint8_t REPORTS[] = {FM_ONSET, FM_EVERY_STEP};
static const bool VIOLATES[] = {true, true};

/// The times of an evaluator; both inputs have the same timeout.
struct times
{
  int64_t timeout;
  int64_t period;
  int64_t patience;
};

static struct fm_evaluator * make(const uint32_t policy, const struct times times)
{
  static int64_t timeouts[N_INPUTS];
  const struct fm_evaluator_options options = {
    &MONITOR, TOPICS, 2, policy, REPORTS, timeouts, VIOLATES, times.period, times.patience,
    NULL, false, NULL, NULL, NULL, NULL, NULL};
  timeouts[0] = timeouts[1] = times.timeout;
  void * const memory = malloc((size_t)fm_evaluator_bytes(&options));
  struct fm_evaluator * const evaluator =
    memory == NULL ? NULL : fm_evaluator_init(memory, &options);
  if (evaluator == NULL) {
    printf("no evaluator\n");
    exit(1);
  }
  return evaluator;
}

// ---- counters ----------------------------------------------------------------------------------

/// Let all that counts be so much more than it is.
static void lift(struct fm_evaluator * const evaluator, const uint64_t more)
{
  const struct fm_instance * const instance = &evaluator->instance;
  instance->time->stores += more;
  for (uint32_t i = 0; i < N_INPUTS; ++i) {
    evaluator->inputs[i].counts.received += more;
    evaluator->inputs[i].counts.unusable += more;
    evaluator->inputs[i].counts.overwritten += more;
    evaluator->inputs[i].silences += more;
    evaluator->inputs[i].startups += (uint32_t)more;
    instance->inputs[i].received_at += more;
    evaluator->topics[i].counts.messages += more;
    evaluator->topics[i].counts.undecodable += more;
  }
  for (uint32_t g = 0; g < N_GROUPS; ++g) {
    instance->groups[g].steps += more;
    instance->groups[g].stepped_at += more;
    evaluator->requirements[g].violations += more;
    evaluator->requirements[g].announced += more;
  }
  evaluator->counts.periods += more;
  evaluator->counts.late += more;
  evaluator->counts.missed += more;
  evaluator->counts.restarts += more;
}

/// Make one of the calls that a node makes, chosen by the seed. Return how many it announces.
static uint32_t call(
  struct fm_evaluator * const evaluator, const uint32_t seed, const int64_t now,
  struct fm_violation * const out)
{
  const uint32_t which = seed >> 8u & 1u;
  const union fm_value value = {.i = (int64_t)(seed >> 12u & 3u)};
  if ((seed >> 20u & 15u) == 0u) {
    fm_evaluator_unusable(evaluator, which);
    fm_evaluator_undecodable(evaluator, which);
    return 0;
  }
  if ((seed >> 24u & 7u) == 0u) {  // seldom far later, or back
    const uint32_t way = seed >> 27u;
    const int64_t jump = way == 0u ? 100000 : way == 1u ? -200 : 0;
    return fm_evaluator_advance(evaluator, now + jump, out);
  }
  fm_evaluator_store(evaluator, which, value, now);
  return evaluator->policy == FM_PERIODIC ?
         fm_evaluator_step(evaluator, now, out) :
         fm_evaluator_message(evaluator, which, now, out);
}

static bool are_alike(
  const struct fm_evaluator * const low, const struct fm_evaluator * const high,
  const uint64_t more)
{
  const struct fm_time_counts e = fm_evaluator_time_counts(low);
  const struct fm_time_counts f = fm_evaluator_time_counts(high);
  if (e.periods + more != f.periods || e.late + more != f.late || e.missed + more != f.missed ||
    e.restarts + more != f.restarts)
  {
    return false;
  }
  for (uint32_t i = 0; i < N_INPUTS; ++i) {
    const struct fm_input_counts a = fm_evaluator_input_counts(low, i);
    const struct fm_input_counts b = fm_evaluator_input_counts(high, i);
    const struct fm_topic_counts c = fm_evaluator_topic_counts(low, i);
    const struct fm_topic_counts d = fm_evaluator_topic_counts(high, i);
    if (a.received + more != b.received || a.unusable + more != b.unusable ||
      a.overwritten + more != b.overwritten || c.messages + more != d.messages ||
      c.undecodable + more != d.undecodable ||
      fm_evaluator_silence(low, i).count + more != fm_evaluator_silence(high, i).count)
    {
      return false;
    }
  }
  for (uint32_t r = 0; r < N_REQUIREMENTS; ++r) {
    const struct fm_requirement_counts a = fm_evaluator_requirement_counts(low, r);
    const struct fm_requirement_counts b = fm_evaluator_requirement_counts(high, r);
    if (a.steps + more != b.steps || a.violations + more != b.violations ||
      a.announced + more != b.announced || a.verdict != b.verdict ||
      fm_evaluator_steps(low, r) + more != fm_evaluator_steps(high, r))
    {
      return false;
    }
  }
  return true;
}

static bool announce_alike(
  const struct fm_violation * const low, const struct fm_violation * const high, const uint32_t n,
  const uint64_t more)
{
  for (uint32_t k = 0; k < n; ++k) {
    if (low[k].step + more != high[k].step || low[k].stamp != high[k].stamp ||
      low[k].requirement != high[k].requirement)
    {
      return false;
    }
  }
  return true;
}

/// Return the first call at which the two differ; N_CALLS if there is none.
static uint32_t compare(
  const uint32_t policy, const uint64_t edge, uint32_t seed, uint64_t * const announced)
{
  const uint64_t more = edge - 40u;
  const union fm_value none = {.i = 0};
  const struct times times = {40, 7, 10};
  struct fm_evaluator * const low = make(policy, times);
  struct fm_evaluator * const high = make(policy, times);
  uint32_t number = 0u;
  struct fm_violation of_low[N_REQUIREMENTS];
  struct fm_violation of_high[N_REQUIREMENTS];
  for (uint32_t i = 0; i < N_INPUTS; ++i) {  // 0 means that nothing was received yet
    fm_evaluator_store(low, i, none, 0);
    fm_evaluator_store(high, i, none, 0);
  }
  lift(high, more);
  for (; number < N_CALLS; ++number) {
    seed = seed * 1664525u + 1013904223u;
    const int64_t now = 5 * (int64_t)number;
    const uint32_t n = call(low, seed, now, of_low);
    if (call(high, seed, now, of_high) != n || !announce_alike(of_low, of_high, n, more) ||
      !are_alike(low, high, more))
    {
      break;
    }
    *announced += n;
  }
  free(low);
  free(high);
  return number;
}

static bool holds_at(const uint64_t edge, const uint32_t policy)
{
  uint64_t announced = 0;
  for (uint32_t seed = 1; seed <= N_SEEDS; ++seed) {
    const uint32_t number = compare(policy, edge, seed, &announced);
    if (number != N_CALLS) {
      printf(
        "policy %" PRIu32 ", at %" PRIu64 ", seed %" PRIu32 ": not alike at call %" PRIu32 "\n",
        policy, edge, seed, number);
      return false;
    }
  }
  if (announced < N_SEEDS * N_CALLS / 10u) {
    printf("policy %" PRIu32 ": only %" PRIu64 " announced\n", policy, announced);
    return false;
  }
  return true;
}

// ---- times -------------------------------------------------------------------------------------

#define CHECK(condition) check((condition), #condition, __LINE__)

static bool all_hold = true;

static void check(const bool condition, const char * const text, const int line)
{
  if (!condition) {
    printf("line %d: not so: %s\n", line, text);
    all_hold = false;
  }
}

static struct fm_violation announced[N_REQUIREMENTS];

static uint32_t advance(struct fm_evaluator * const evaluator, const int64_t now)
{
  return fm_evaluator_advance(evaluator, now, announced);
}

static struct fm_evaluator * begun_at(
  const int64_t now, const int64_t timeout, const int64_t period)
{
  const struct times times = {timeout, period, 0};
  struct fm_evaluator * const evaluator = make(FM_PERIODIC, times);
  CHECK(advance(evaluator, now) == 0u);
  return evaluator;
}

static void check_that_what_is_due_after_the_last_time_never_comes(void)
{
  struct fm_evaluator * const evaluator = begun_at(INT64_MAX - 10, 20, 20);
  CHECK(fm_evaluator_deadline(evaluator) == FM_NEVER);
  CHECK(advance(evaluator, INT64_MAX - 1) == 0u && advance(evaluator, INT64_MAX) == 0u);
  CHECK(!fm_evaluator_silence(evaluator, 0).is_silent);
  CHECK(fm_evaluator_time_counts(evaluator).periods == 0u);
  free(evaluator);
}

static void check_what_is_due_at_the_last_times(void)
{
  struct fm_evaluator * const evaluator = begun_at(INT64_MAX - 10, 5, 9);
  CHECK(fm_evaluator_deadline(evaluator) == INT64_MAX - 5);
  CHECK(advance(evaluator, INT64_MAX - 1) == 2u && announced[0].stamp == INT64_MAX - 5);
  CHECK(advance(evaluator, INT64_MAX - 1) == 0u);
  CHECK(fm_evaluator_deadline(evaluator) == INT64_MAX - 1);
  CHECK(advance(evaluator, INT64_MAX - 1) == 0u);
  CHECK(fm_evaluator_time_counts(evaluator).periods == 1u);
  CHECK(fm_evaluator_deadline(evaluator) == FM_NEVER);
  free(evaluator);
}

static void check_the_longest_timeout(void)
{
  struct fm_evaluator * const late = begun_at(1, INT64_MAX, 0);
  struct fm_evaluator * const early = begun_at(-1, INT64_MAX, 0);
  CHECK(fm_evaluator_deadline(late) == FM_NEVER);
  CHECK(fm_evaluator_deadline(early) == INT64_MAX - 1);
  free(late);
  free(early);
}

static void check_that_a_silence_lasts_at_most_the_greatest_number(void)
{
  const union fm_value none = {.i = 0};
  struct fm_evaluator * const evaluator = begun_at(INT64_MIN, 5, 0);
  CHECK(fm_evaluator_deadline(evaluator) == INT64_MIN + 5);
  CHECK(advance(evaluator, INT64_MAX - 1) == 2u && announced[0].stamp == INT64_MIN + 5);
  CHECK(fm_evaluator_silence(evaluator, 0).lasted == INT64_MAX);
  fm_evaluator_store(evaluator, 0, none, INT64_MAX - 1);
  CHECK(fm_evaluator_silence(evaluator, 0).lasted == INT64_MAX);
  CHECK(advance(evaluator, INT64_MAX - 1) == 1u && announced[0].stamp == INT64_MIN + 5);
  fm_evaluator_store(evaluator, 1, none, INT64_MIN);  // the time went back, unnoticed
  CHECK(fm_evaluator_silence(evaluator, 1).lasted == 0);
  free(evaluator);
}

static void check_that_a_long_patience_puts_off_by_no_more_than_the_timeout(void)
{
  const int64_t timeout = INT64_MAX / 2;
  const struct times times = {timeout, 0, INT64_MAX / 9};
  struct fm_evaluator * const evaluator = make(FM_PERIODIC, times);
  CHECK(advance(evaluator, INT64_MIN) == 0u && advance(evaluator, 0) == 0u);
  CHECK(advance(evaluator, 0) == 0u && fm_evaluator_deadline(evaluator) == timeout);
  CHECK(!fm_evaluator_silence(evaluator, 0).is_silent);
  CHECK(advance(evaluator, timeout) == 2u && announced[0].stamp == INT64_MIN + timeout);
  free(evaluator);
}

static void check_that_all_periods_there_are_can_be_missed(void)
{
  struct fm_evaluator * const evaluator = begun_at(INT64_MIN, 0, 1);
  CHECK(advance(evaluator, INT64_MAX - 1) == 0u);
  CHECK(
    fm_evaluator_time_counts(evaluator).missed == UINT64_MAX - 1u - FM_MOST_PERIODS_BEHIND);
  CHECK(fm_evaluator_deadline(evaluator) == INT64_MAX - FM_MOST_PERIODS_BEHIND + 1);
  free(evaluator);
}

static void check_the_longest_period(void)
{
  struct fm_evaluator * const evaluator = begun_at(INT64_MIN, 0, INT64_MAX);
  CHECK(fm_evaluator_deadline(evaluator) == -1 && advance(evaluator, INT64_MAX - 1) == 0u);
  CHECK(fm_evaluator_time_counts(evaluator).late == 1u);
  CHECK(fm_evaluator_deadline(evaluator) == INT64_MAX - 1);
  CHECK(advance(evaluator, INT64_MAX - 1) == 0u);
  CHECK(fm_evaluator_time_counts(evaluator).late == 1u);
  CHECK(fm_evaluator_time_counts(evaluator).periods == 2u);
  CHECK(fm_evaluator_deadline(evaluator) == FM_NEVER);
  free(evaluator);
}

static void check_long_ways_back(void)
{
  struct fm_evaluator * const evaluator = begun_at(INT64_MAX - 100, 10, 0);
  CHECK(advance(evaluator, 0) == 0u && fm_evaluator_deadline(evaluator) == 10);
  CHECK(advance(evaluator, -INT64_MAX) == 0u);
  CHECK(fm_evaluator_deadline(evaluator) == 10 - INT64_MAX);
  CHECK(fm_evaluator_time_counts(evaluator).restarts == 2u);
  free(evaluator);
}

static void check_long_shifts(void)
{
  struct fm_evaluator * const later = begun_at(0, 10, 20);
  struct fm_evaluator * const earlier = begun_at(0, 10, 20);
  fm_evaluator_shift(later, INT64_MAX);
  CHECK(fm_evaluator_deadline(later) == FM_NEVER);
  fm_evaluator_shift(earlier, INT64_MIN);
  CHECK(fm_evaluator_now(earlier) == INT64_MIN);
  CHECK(fm_evaluator_deadline(earlier) == INT64_MIN + 10);
  free(later);
  free(earlier);
}

static const int64_t LIMITS[] = {
  INT64_MIN, INT64_MIN + 1, INT64_MIN + 50, -1, 0, 1, 50, INT64_MAX - 50, INT64_MAX - 1, INT64_MAX
};

static int64_t limit(const uint32_t seed)
{
  return LIMITS[seed % (sizeof(LIMITS) / sizeof(LIMITS[0]))];
}

static int64_t length(const uint32_t seed)
{
  return LIMITS[4u + seed % 6u];
}

static void call_at_a_limit(struct fm_evaluator * const evaluator, const uint32_t seed)
{
  const union fm_value value = {.i = (int64_t)(seed >> 12u & 3u)};
  const int64_t time = limit(seed >> 20u);
  switch (seed >> 8u & 7u) {
    case 0u:
      fm_evaluator_shift(evaluator, time);
      break;
    case 1u:
      fm_evaluator_reset(evaluator);
      break;
    case 2u:
      fm_evaluator_store(evaluator, seed >> 16u & 1u, value, time);
      (void)fm_evaluator_message(evaluator, seed >> 16u & 1u, time, announced);
      break;
    default:
      (void)advance(evaluator, time);
  }
}

/// The undefined behaviour sanitizer sees what overflows.
static void check_random_calls_at_the_limits(uint32_t seed)
{
  const struct times times = {length(seed), length(seed / 6u), length(seed / 36u)};
  struct fm_evaluator * const evaluator = make(seed % 2u == 0u ? FM_PERIODIC : 0u, times);
  for (uint32_t number = 0; number < N_CALLS; ++number) {
    seed = seed * 1664525u + 1013904223u;
    call_at_a_limit(evaluator, seed);
    const int64_t wake = fm_evaluator_wake(evaluator);
    const struct fm_time_counts counts = fm_evaluator_time_counts(evaluator);
    CHECK(wake <= fm_evaluator_deadline(evaluator) && counts.late <= counts.periods);
    CHECK(fm_evaluator_silence(evaluator, 0).lasted >= 0);
  }
  free(evaluator);
}

static void check_times(void)
{
  check_that_what_is_due_after_the_last_time_never_comes();
  check_what_is_due_at_the_last_times();
  check_the_longest_timeout();
  check_that_a_silence_lasts_at_most_the_greatest_number();
  check_that_a_long_patience_puts_off_by_no_more_than_the_timeout();
  check_that_all_periods_there_are_can_be_missed();
  check_the_longest_period();
  check_long_ways_back();
  check_long_shifts();
  for (uint32_t seed = 0; seed < 216u; ++seed) {
    check_random_calls_at_the_limits(seed);
  }
}

int main(void)
{
  const uint64_t edges[] = {UINT64_C(1) << 31u, UINT64_C(1) << 32u, UINT64_C(1) << 63u};
  bool holds = true;
  for (size_t k = 0; k < sizeof(edges) / sizeof(edges[0]); ++k) {
    for (uint32_t policy = FM_EVERY_MESSAGE; policy <= FM_PERIODIC; ++policy) {
      holds = holds_at(edges[k], policy) && holds;
    }
  }
  check_times();
  return holds && all_hold ? 0 : 1;
}
