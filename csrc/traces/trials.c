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

/// trials.c: runs many short traces through one step group, and computes successor states.
/// `explain` searches for its examples with it.
///
/// No function allocates or fails; the caller owns all memory. Not thread-safe: one thread at a
/// time uses a `struct fm_trials` and the blocks it points to.

#include <string.h>

#include "fret_monitor.h"

/// A group and the memory it runs on. `watched` are at most 32 requirements of the group. Their
/// verdicts are returned as bits; the first requirement is the lowest bit.
struct fm_trials
{
  const struct fm_group * group;
  void * state;
  bool * verdicts;
  const uint32_t * watched;
  uint32_t n_watched;
};

/// Take `steps` steps with the inputs of one row. 0 steps: reset the group; a new trace begins.
struct fm_run
{
  uint32_t row;
  uint32_t steps;
};

FM_EXPORT uint64_t fm_trials_bytes(void);

FM_EXPORT void fm_trials_init(
  void * memory, const struct fm_group * group, void * state, bool * verdicts,
  const uint32_t * watched, uint32_t n_watched);

FM_EXPORT void fm_trials_run(
  const struct fm_trials * trials, const void * inputs, uint64_t stride,
  const struct fm_run * runs, uint64_t n_runs, uint32_t * bits);

FM_EXPORT void fm_trials_follow(
  const struct fm_trials * trials, const void * inputs, uint64_t stride, uint64_t n_rows,
  uint64_t begin, uint64_t size, const void * from, uint8_t * states, uint32_t * bits);

static uint32_t take_step(const struct fm_trials * const trials, const void * const inputs)
{
  uint32_t bits = 0u;
  trials->group->step(trials->state, inputs, trials->verdicts);
  for (uint32_t bit = 0u; bit < trials->n_watched; ++bit) {
    if (trials->verdicts[trials->watched[bit]]) {
      bits |= (uint32_t)1u << bit;
    }
  }
  return bits;
}

/// Size of the memory that fm_trials_init needs, in bytes. O(1).
uint64_t fm_trials_bytes(void)
{
  return sizeof(struct fm_trials);
}

/// Initialise a `struct fm_trials` in `memory` (aligned to 8). The blocks behind the pointers must
/// outlive it. `state` and `verdicts` are passed to the group's step function. O(1).
void fm_trials_init(
  void * const memory, const struct fm_group * const group, void * const state,
  bool * const verdicts, const uint32_t * const watched, const uint32_t n_watched)
{
  struct fm_trials * const trials = memory;
  trials->group = group;
  trials->state = state;
  trials->verdicts = verdicts;
  trials->watched = watched;
  trials->n_watched = n_watched;
}

/// Take the steps of all runs, and write the verdicts of each step to `bits`, one word for each
/// step. `inputs` are rows, each an inputs struct, `stride` bytes apart. O(steps x operations).
void fm_trials_run(
  const struct fm_trials * const trials, const void * const inputs, const uint64_t stride,
  const struct fm_run * const runs, const uint64_t n_runs, uint32_t * bits)
{
  const uint8_t * const rows = inputs;
  for (uint64_t run = 0u; run < n_runs; ++run) {
    if (runs[run].steps == 0u) {
      trials->group->reset(trials->state);
    }
    for (uint32_t count = 0u; count < runs[run].steps; ++count) {
      *bits++ = take_step(trials, rows + runs[run].row * stride);
    }
  }
}

/// Take one step from the state `from` with each of n_rows rows. Writes the successor states to
/// `states`, one after the other, and the verdicts to `bits`. A state is the `size` bytes at
/// offset `begin` of the state struct: the part that belongs to the group.
/// O(n_rows x (size + operations)).
void fm_trials_follow(
  const struct fm_trials * const trials, const void * const inputs, const uint64_t stride,
  const uint64_t n_rows, const uint64_t begin, const uint64_t size, const void * const from,
  uint8_t * const states, uint32_t * const bits)
{
  const uint8_t * const rows = inputs;
  uint8_t * const state = (uint8_t *)trials->state + begin;
  for (uint64_t row = 0u; row < n_rows; ++row) {
    memcpy(state, from, size);
    bits[row] = take_step(trials, rows + row * stride);
    memcpy(states + row * size, state, size);
  }
}
