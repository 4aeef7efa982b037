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

// Steps a compiled monitor (MONITOR, its exported function) over hostile and over lasting inputs,
// on a thread whose stack was painted; prints the bytes of stack that the steps took more than
// calling an empty function. `counted_step` is what valgrind counts.

#define _GNU_SOURCE

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fret_monitor.h"

#define STACK_BYTES ((size_t)1 << 20)
#define PAINT 0xa5

extern const struct fm_monitor * MONITOR(void);

typedef void (* step_function)(void * state, const void * inputs, bool * verdicts);

struct run
{
  const struct fm_monitor * monitor;
  step_function step;  // NULL: the groups step at ticks
  int steps;
  void * state;
  char * inputs;
  bool * verdicts;
  int64_t tick;
  int64_t next;
  bool is_empty;  // call functions that do nothing
};

static uint64_t seed;

// xorshift64 (Marsaglia 2003).
static uint64_t next_bits(void)
{
  seed ^= seed << 13;
  seed ^= seed >> 7;
  seed ^= seed << 17;
  return seed;
}

// Random bits, small numbers, and the ends of ranges, where branches go the other way.
static uint64_t next_value(uint8_t type)
{
  static const double doubles[] = {
    0.0, -0.0, 1.0, -1.0, 0.1, 3.0, 1e308, -1e308, 5e-324, 1.5e-323, 2.2e-308, 1e16};
  const double chosen = doubles[next_bits() % (sizeof(doubles) / sizeof(doubles[0]))];
  const float single = (float)chosen;
  uint64_t bits = 0;
  switch (next_bits() % 8) {
    case 0: return 0;
    case 1: return UINT64_MAX;
    case 2: return UINT64_C(0x7fffffffffffffff);
    case 3: return UINT64_C(0x8000000000000000);
    case 4:
    case 5:
      if (type == FM_FLOAT64) {
        memcpy(&bits, &chosen, sizeof(chosen));
      } else if (type == FM_FLOAT32) {
        memcpy(&bits, &single, sizeof(single));
      } else {
        bits = next_bits() % 4;
      }
      return bits;
    default: return next_bits();
  }
}

static void fill(const struct fm_input * input, char * inputs)
{
  static const size_t bytes[] = {sizeof(bool), 1, 2, 4, 8, 1, 2, 4, 8, 4, 8};
  const uint64_t value = next_value(input->type);
  const bool truth = value % 2 == 1;
  const void * from = input->type == FM_BOOL ? (const void *)&truth : (const void *)&value;
  memcpy(inputs + input->offset, from, bytes[input->type]);
}

static int64_t empty_at(void * state, const void * inputs, bool * verdicts, int64_t tick)
{
  (void)state;
  (void)inputs;
  (void)verdicts;
  return tick + 1;
}

__attribute__((noinline)) void counted_step(struct run * run)
{
  if (run->step != NULL) {
    run->step(run->state, run->inputs, run->verdicts);
    return;
  }
  for (uint32_t g = 0; g < run->monitor->n_groups; ++g) {
    run->next = (run->is_empty ? empty_at : run->monitor->groups[g].step_at)(
      run->state, run->inputs, run->verdicts, run->tick);
  }
}

static void empty_step(void * state, const void * inputs, bool * verdicts)
{
  (void)state;
  (void)inputs;
  (void)verdicts;
}

static void * take_steps(void * argument)
{
  struct run * const run = argument;
  seed = UINT64_C(0x9e3779b97f4a7c15);
  for (uint32_t g = 0; g < run->monitor->n_groups; ++g) {
    run->monitor->groups[g].reset(run->state);
  }
  for (int t = 0; t < run->steps; ++t) {
    for (uint32_t i = 0; i < run->monitor->n_inputs; ++i) {
      // All anew in the first half, seldom in the second.
      if (t < run->steps / 2 || next_bits() % 16 == 0) {
        fill(&run->monitor->inputs[i], run->inputs);
      }
    }
    counted_step(run);
    // To the next deadline, or to a message before it.
    const int64_t later = run->tick + 1 + (int64_t)(next_bits() % 400);
    run->tick = run->step == NULL && run->next < later ? run->next : later;
  }
  return NULL;
}

static size_t stack_of(struct run * run)
{
  unsigned char * const stack = aligned_alloc(4096, STACK_BYTES);
  pthread_attr_t attributes;
  pthread_t thread;
  size_t untouched = 0;
  if (stack == NULL) {
    exit(1);
  }
  memset(stack, PAINT, STACK_BYTES);
  if (pthread_attr_init(&attributes) != 0 ||
    pthread_attr_setstack(&attributes, stack, STACK_BYTES) != 0 ||
    pthread_create(&thread, &attributes, take_steps, run) != 0 ||
    pthread_join(thread, NULL) != 0)
  {
    exit(1);
  }
  while (untouched < STACK_BYTES && stack[untouched] == PAINT) {
    ++untouched;
  }
  free(stack);
  return STACK_BYTES - untouched;
}

int main(int argc, char ** argv)
{
  const struct fm_monitor * const monitor = MONITOR();
  struct run run = {monitor, monitor->step, argc > 1 ? atoi(argv[1]) : 200, NULL, NULL, NULL, 0, 0,
    false};
  run.state = aligned_alloc(64, (monitor->state_bytes + 63u) / 64u * 64u);
  run.inputs = calloc(1, monitor->inputs_bytes);
  run.verdicts = malloc(
    (monitor->n_requirements + monitor->n_more_verdicts) * sizeof(bool));
  if (run.state == NULL || run.inputs == NULL || run.verdicts == NULL) {
    return 1;
  }
  if (argc > 2) {
    take_steps(&run);  // for valgrind: the steps alone, on the stack there is
  } else {
    const size_t used = stack_of(&run);
    run.step = run.step == NULL ? NULL : empty_step;
    run.is_empty = true;
    run.tick = 0;
    printf("%zu\n", used - stack_of(&run));
  }
  free(run.verdicts);
  free(run.inputs);
  free(run.state);
  return 0;
}
