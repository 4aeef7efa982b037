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

// Runs the groups of a compiled monitor at the rows of a trace and at the deadlines they return.

#include <stdlib.h>
#include <string.h>

#include "fret_monitor.h"

// What a run needs to know; `columns` has an array of n_rows values for each input.
struct timed_rows
{
  const void * const * columns;
  const int64_t * ticks;
  uint64_t n_rows;
  int64_t end;
  bool only_changes;  // pass over rows that change no input of the group
};

// The evaluations of one group: ticks, and n_verdicts values each. `count` goes on past
// `capacity`.
struct timed_evaluations
{
  uint64_t capacity;
  uint64_t count;
  int64_t * ticks;
  bool * verdicts;
};

static size_t value_bytes(uint8_t type)
{
  static const size_t bytes[] = {sizeof(bool), 1, 2, 4, 8, 1, 2, 4, 8, 4, 8};
  return bytes[type];
}

static bool is_changed(
  const struct fm_monitor * monitor, const struct fm_group * group, const struct timed_rows * rows,
  uint64_t row)
{
  for (uint32_t i = 0; i < group->n_inputs; ++i) {
    const uint32_t input = group->inputs[i];
    const size_t bytes = value_bytes(monitor->inputs[input].type);
    const char * const column = rows->columns[input];
    if (memcmp(column + row * bytes, column + (row - 1) * bytes, bytes) != 0) {
      return true;
    }
  }
  return false;
}

static void store(
  const struct fm_monitor * monitor, const struct timed_rows * rows, uint64_t row, char * inputs)
{
  for (uint32_t i = 0; i < monitor->n_inputs; ++i) {
    const size_t bytes = value_bytes(monitor->inputs[i].type);
    memcpy(
      inputs + monitor->inputs[i].offset, (const char *)rows->columns[i] + row * bytes, bytes);
  }
}

static void record(
  const struct fm_monitor * monitor, struct timed_evaluations * found, int64_t tick,
  const bool * verdicts)
{
  const size_t n = monitor->n_requirements + monitor->n_more_verdicts;
  if (found->count < found->capacity) {
    found->ticks[found->count] = tick;
    memcpy(found->verdicts + found->count * n, verdicts, n * sizeof(bool));
  }
  found->count += 1;
}

// False if a deadline is not after the tick of its evaluation.
static bool run_group(
  const struct fm_monitor * monitor, const struct fm_group * group, const struct timed_rows * rows,
  void * state, char * inputs, bool * verdicts, struct timed_evaluations * found)
{
  int64_t deadline = FM_NEVER;
  uint64_t row = 0;
  group->reset(state);
  found->count = 0;
  for (;;) {
    const bool has_row = row < rows->n_rows;
    const bool is_row = has_row && rows->ticks[row] <= deadline;
    const int64_t tick = is_row ? rows->ticks[row] : deadline;
    if (tick > rows->end) {
      return true;
    }
    if (is_row) {
      const bool is_needed = !rows->only_changes || row == 0 || tick == deadline ||
        is_changed(monitor, group, rows, row);
      store(monitor, rows, row, inputs);
      ++row;
      if (!is_needed) {
        continue;
      }
    }
    deadline = group->step_at(state, inputs, verdicts, tick);
    record(monitor, found, tick, verdicts);
    if (deadline <= tick) {
      return false;
    }
    if (found->count > found->capacity) {
      return true;
    }
  }
}

// Returns the number of verdicts of an evaluation.
__attribute__((visibility("default")))
uint32_t differential_width(const struct fm_monitor * monitor);

uint32_t differential_width(const struct fm_monitor * monitor)
{
  return monitor->n_requirements + monitor->n_more_verdicts;
}

// Returns the group of a requirement.
__attribute__((visibility("default")))
uint32_t differential_group(const struct fm_monitor * monitor, uint32_t requirement);

uint32_t differential_group(const struct fm_monitor * monitor, uint32_t requirement)
{
  return monitor->requirements[requirement].group;
}

// Returns the verdict whose falls are the occurrences of a requirement.
__attribute__((visibility("default")))
uint32_t differential_occurrence(const struct fm_monitor * monitor, uint32_t requirement);

uint32_t differential_occurrence(const struct fm_monitor * monitor, uint32_t requirement)
{
  return monitor->occurrences == NULL ? requirement : monitor->occurrences[requirement];
}

// Runs one group twice in a state that starts as noise, the second time after a reset. Returns
// the index of what is wrong: 0 nothing, 1 no memory, 2 a deadline that is not later.
__attribute__((visibility("default")))
int differential_run_at(
  const struct fm_monitor * monitor, uint32_t group, const struct timed_rows * rows,
  struct timed_evaluations * found);

int differential_run_at(
  const struct fm_monitor * monitor, uint32_t group, const struct timed_rows * rows,
  struct timed_evaluations * found)
{
  // Blocks of the exact size, so that a step that relies on zeros, or on more, shows.
  void * state = malloc(monitor->state_bytes);
  char * inputs = malloc(monitor->inputs_bytes);
  bool * verdicts = malloc(monitor->n_requirements + monitor->n_more_verdicts);
  int wrong = 1;
  if (state != NULL && inputs != NULL && verdicts != NULL) {
    memset(state, 0xa5, monitor->state_bytes);
    memset(inputs, 0, monitor->inputs_bytes);
    memset(verdicts, 0, monitor->n_requirements + monitor->n_more_verdicts);
    wrong = 0;
    for (int run = 0; run < 2 && wrong == 0; ++run) {
      const struct fm_group * const chosen = &monitor->groups[group];
      wrong = run_group(monitor, chosen, rows, state, inputs, verdicts, found) ? 0 : 2;
    }
  }
  free(verdicts);
  free(inputs);
  free(state);
  return wrong;
}
