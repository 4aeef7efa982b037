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

/// Compares an evaluator whose counters start just below a power of two with one that starts at 0:
/// apart from that offset they must agree. Includes evaluator.c to access its private structures.
/// Prints the first difference, if there is one.

#include "evaluator.c"  // NOLINT

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
  {BOTH, 1, BOTH, 1, keep, step_first},
  {BOTH, 2, SECOND, 1, start, step_second},
};
static const struct fm_requirement REQUIREMENTS[] = {{"R0", 0}, {"R1", 1}};
static const struct fm_monitor MONITOR = {
  FM_ABI, N_INPUTS, N_GROUPS, N_REQUIREMENTS, sizeof(struct state), sizeof(struct inputs),
  INPUTS, GROUPS, REQUIREMENTS, "edges", "", NULL
};
static const struct fm_topic TOPICS[] = {{BOTH, 1}, {SECOND, 1}};
static const bool ONSET[] = {true, false};

static struct fm_evaluator * make(const uint32_t policy)
{
  const struct fm_evaluator_options options = {&MONITOR, TOPICS, 2, policy, ONSET};
  void * const memory = malloc((size_t)fm_evaluator_bytes(&options));
  struct fm_evaluator * const evaluator =
    memory == NULL ? NULL : fm_evaluator_init(memory, &options);
  if (evaluator == NULL) {
    printf("no evaluator\n");
    exit(1);
  }
  return evaluator;
}

/// Add `more` to the clock and to all counters.
static void lift(struct fm_evaluator * const evaluator, const uint64_t more)
{
  evaluator->clock += more;
  for (uint32_t i = 0; i < N_INPUTS; ++i) {
    evaluator->inputs[i].counts.received += more;
    evaluator->inputs[i].counts.unusable += more;
    evaluator->inputs[i].counts.overwritten += more;
    evaluator->inputs[i].received_at += more;
    evaluator->topics[i].counts.messages += more;
    evaluator->topics[i].counts.undecodable += more;
  }
  for (uint32_t g = 0; g < N_GROUPS; ++g) {
    evaluator->groups[g].steps += more;
    evaluator->groups[g].stepped_at += more;
    evaluator->requirements[g].violations += more;
    evaluator->requirements[g].announced += more;
  }
}

/// Make one of the calls that a node makes, chosen by the seed. Return how many it announces.
static uint32_t call(
  struct fm_evaluator * const evaluator, const uint32_t seed, struct fm_violation * const out)
{
  const uint32_t which = seed >> 8u & 1u;
  const union fm_value value = {.i = (int64_t)(seed >> 12u & 3u)};
  if ((seed >> 20u & 15u) == 0u) {
    fm_evaluator_unusable(evaluator, which);
    fm_evaluator_undecodable(evaluator, which);
    return 0;
  }
  fm_evaluator_store(evaluator, which, value);
  return evaluator->policy == FM_PERIODIC ?
         fm_evaluator_tick(evaluator, (int64_t)seed, out) :
         fm_evaluator_message(evaluator, which, (int64_t)seed, out);
}

static bool are_alike(
  const struct fm_evaluator * const low, const struct fm_evaluator * const high,
  const uint64_t more)
{
  for (uint32_t i = 0; i < N_INPUTS; ++i) {
    const struct fm_input_counts a = fm_evaluator_input_counts(low, i);
    const struct fm_input_counts b = fm_evaluator_input_counts(high, i);
    const struct fm_topic_counts c = fm_evaluator_topic_counts(low, i);
    const struct fm_topic_counts d = fm_evaluator_topic_counts(high, i);
    if (a.received + more != b.received || a.unusable + more != b.unusable ||
      a.overwritten + more != b.overwritten || c.messages + more != d.messages ||
      c.undecodable + more != d.undecodable)
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
  struct fm_evaluator * const low = make(policy);
  struct fm_evaluator * const high = make(policy);
  uint32_t number = 0u;
  struct fm_violation of_low[N_REQUIREMENTS];
  struct fm_violation of_high[N_REQUIREMENTS];
  for (uint32_t i = 0; i < N_INPUTS; ++i) {  // 0 means that nothing was received yet
    fm_evaluator_store(low, i, none);
    fm_evaluator_store(high, i, none);
  }
  lift(high, more);
  for (; number < N_CALLS; ++number) {
    seed = seed * 1664525u + 1013904223u;
    const uint32_t n = call(low, seed, of_low);
    if (call(high, seed, of_high) != n || !announce_alike(of_low, of_high, n, more) ||
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

int main(void)
{
  const uint64_t edges[] = {UINT64_C(1) << 31u, UINT64_C(1) << 32u, UINT64_C(1) << 63u};
  bool holds = true;
  for (size_t k = 0; k < sizeof(edges) / sizeof(edges[0]); ++k) {
    for (uint32_t policy = FM_EVERY_MESSAGE; policy <= FM_PERIODIC; ++policy) {
      holds = holds_at(edges[k], policy) && holds;
    }
  }
  return holds ? 0 : 1;
}
