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

/// benchmark.c: measures the time of steps. The inputs are generated before, so that the timed
/// loop only steps.

#define _POSIX_C_SOURCE 199309L

#include <time.h>

#include "fret_monitor.h"

/// The time of groups that step at ticks.
struct fm_benchmark_time
{
  int64_t tick;          // of the last row
  int64_t spacing;       // ticks from row to row
  uint64_t evaluations;  // so far, of all groups
};

FM_EXPORT uint64_t fm_benchmark(
  const struct fm_monitor * monitor, void * state, const void * rows, uint64_t stride,
  uint64_t n_rows, bool * verdicts, struct fm_benchmark_time * time, int64_t * due);

static void take_row(
  const struct fm_monitor * monitor, void * state, const void * inputs, bool * verdicts)
{
  if (monitor->step != NULL) {
    monitor->step(state, inputs, verdicts);
    return;
  }
  for (uint32_t group = 0u; group < monitor->n_groups; ++group) {
    monitor->groups[group].step(state, inputs, verdicts);
  }
}

// What is due before the row is evaluated on the inputs of the row before.
static void take_row_at(
  const struct fm_monitor * monitor, void * state, const void * before, const void * inputs,
  bool * verdicts, struct fm_benchmark_time * time, int64_t * due)
{
  time->tick += time->spacing;
  for (uint32_t g = 0u; g < monitor->n_groups; ++g) {
    const struct fm_group * const group = &monitor->groups[g];
    while (due[g] < time->tick) {
      due[g] = group->step_at(state, before, verdicts, due[g]);
      time->evaluations += 1u;
    }
    due[g] = group->step_at(state, inputs, verdicts, time->tick);
    time->evaluations += 1u;
  }
}

/// Step all groups once for each of n_rows inputs structs, which are `stride` bytes apart. Returns
/// the elapsed time in nanoseconds. With the policy `timed`, `due` has the next deadline of each
/// group, at first FM_NEVER; otherwise `time` and `due` may be NULL. The caller owns all blocks
/// and has reset the state. Cannot fail. Any thread, with its own blocks.
/// O(n_rows x operations).
uint64_t fm_benchmark(
  const struct fm_monitor * monitor, void * state, const void * rows, uint64_t stride,
  uint64_t n_rows, bool * verdicts, struct fm_benchmark_time * time, int64_t * due)
{
  const uint8_t * const first = rows;
  const uint8_t * last = first;
  struct timespec before;
  struct timespec after;
  clock_gettime(CLOCK_MONOTONIC, &before);
  for (uint64_t row = 0u; row < n_rows; ++row) {
    const uint8_t * const inputs = first + row * stride;
    if (due == NULL) {
      take_row(monitor, state, inputs, verdicts);
    } else {
      take_row_at(monitor, state, last, inputs, verdicts, time, due);
      last = inputs;
    }
  }
  clock_gettime(CLOCK_MONOTONIC, &after);
  return (uint64_t)(after.tv_sec - before.tv_sec) * 1000000000u +
         (uint64_t)after.tv_nsec - (uint64_t)before.tv_nsec;
}
