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

// Feeds a compiled monitor (MONITOR, its exported function) any values whatever for some thousand
// steps, with resets, and prints a digest of the verdicts. Groups that step at ticks do so at
// their deadlines and before. Made to be run under sanitizers.

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fret_monitor.h"

extern const struct fm_monitor * MONITOR(void);

static uint64_t seed = UINT64_C(0x9e3779b97f4a7c15);

// xorshift64 (Marsaglia 2003).
static uint64_t next_bits(void)
{
  seed ^= seed << 13;
  seed ^= seed >> 7;
  seed ^= seed << 17;
  return seed;
}

// Random bits, or values at the ends, whose bytes are all 0, all 1, or 1 but for the top bit.
static uint64_t next_value(void)
{
  switch (next_bits() % 8) {
    case 0: return 0;
    case 1: return UINT64_MAX;
    case 2: return UINT64_C(0x7fffffffffffffff);
    case 3: return UINT64_C(0x8000000000000000);
    case 4: return UINT64_C(0x7ff000007f800000);  // infinities
    case 5: return next_bits() % 4;
    default: return next_bits();
  }
}

static void fill(const struct fm_input * input, char * inputs)
{
  static const size_t bytes[] = {sizeof(bool), 1, 2, 4, 8, 1, 2, 4, 8, 4, 8};
  const uint64_t value = next_value();
  const bool truth = value % 2 == 1;
  const void * from = input->type == FM_BOOL ? (const void *)&truth : (const void *)&value;
  memcpy(inputs + input->offset, from, bytes[input->type]);
}

static void reset_all(const struct fm_monitor * monitor, void * state)
{
  for (uint32_t g = 0; g < monitor->n_groups; ++g) {
    monitor->groups[g].reset(state);
  }
}

// Under the policy timed: the tick of the next step, and the first deadline of a group.
static int64_t tick = 0;
static int64_t deadline = FM_NEVER;

// A nanosecond later, or up to years.
static void pass_time(void)
{
  const uint64_t shift = 2u + next_bits() % 62u;
  const int64_t gap = 1 + (int64_t)(next_bits() >> shift);
  const int64_t later = gap < deadline - tick ? tick + gap : deadline;
  tick = next_bits() % 4 == 0 && deadline != FM_NEVER ? deadline : later;
}

static void step_at(
  const struct fm_monitor * monitor, void * state, const void * inputs, bool * verdicts)
{
  if (tick > FM_LAST_TICK) {
    reset_all(monitor, state);
    tick = 0;
  }
  deadline = FM_NEVER;
  for (uint32_t g = 0; g < monitor->n_groups; ++g) {
    const int64_t due = monitor->groups[g].step_at(state, inputs, verdicts, tick);
    deadline = due < deadline ? due : deadline;
  }
  pass_time();
}

static uint64_t take_step(
  const struct fm_monitor * monitor, void * state, const void * inputs, bool * verdicts)
{
  uint64_t digest = 0;
  if (monitor->groups[0].step_at != NULL) {
    step_at(monitor, state, inputs, verdicts);
  } else {
    for (uint32_t g = 0; g < monitor->n_groups; ++g) {
      monitor->groups[g].step(state, inputs, verdicts);
    }
  }
  for (uint32_t r = 0; r < monitor->n_requirements; ++r) {
    digest = digest * 31u + (verdicts[r] ? 1u : 0u);
  }
  return digest;
}

int main(void)
{
  const struct fm_monitor * monitor = MONITOR();
  void * state = malloc(monitor->state_bytes);
  char * inputs = malloc(monitor->inputs_bytes);
  bool * verdicts = malloc((monitor->n_requirements + monitor->n_more_verdicts) * sizeof(bool));
  uint64_t digest = 0;
  if (state == NULL || inputs == NULL || verdicts == NULL) {
    return 1;
  }
  memset(inputs, 0, monitor->inputs_bytes);
  reset_all(monitor, state);
  for (int t = 0; t < 4000; ++t) {
    for (uint32_t i = 0; i < monitor->n_inputs; ++i) {
      // Inputs that stay as they are let bounded operators see long stretches.
      if (next_bits() % 16 == 0 || t == 0) {
        fill(&monitor->inputs[i], inputs);
      }
    }
    if (next_bits() % 1500 == 0) {
      reset_all(monitor, state);
      tick = 0;
    }
    digest = digest * 37u + take_step(monitor, state, inputs, verdicts);
  }
  printf("%016llx\n", (unsigned long long)digest);
  free(verdicts);
  free(inputs);
  free(state);
  return 0;
}
