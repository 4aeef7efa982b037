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

/// floor.c: the yardstick. What an engineer would write by hand, with counters, for the formulas
/// of bench/run.py: same inputs, same verdicts (bench/run.py compares them), same timing loop.
///
/// No step branches, so that no input is slow. Counters have 64 bits and need not saturate: that
/// takes an operation off the way from one step to the next, which is what a step waits for.

#include <string.h>

#include "fret_monitor.h"

// -- the running example ------------------------------------------------------------------------
// H (O[10,10] (trigger & !r) -> O[0,9] (FTP | r)), trigger = rising edge of persisted(10,
// overload)

struct running_inputs
{
  float current_consumption;
  float wind_speed;
};

struct running
{
  uint64_t run;     // steps in a row with overload
  uint64_t age;     // what the steps since a response, or the start, will be at the next step
  uint16_t missed;  // bit k: k + 1 steps ago the condition became true without the response
  bool held;
};

static void running_start(struct running * s)
{
  memset(s, 0, sizeof(*s));
  s->held = true;
}

static inline bool running_step(struct running * s, const struct running_inputs * in)
{
  const bool response = in->current_consumption <= 15.0f;
  const bool overload = (in->current_consumption > 15.0f) & (in->wind_speed > 8.0f);
  s->run = (s->run + 1u) & (0u - (uint64_t)overload);
  const bool became_true = s->run == 11u;
  const bool due = ((s->missed >> 9) & 1u) != 0u;
  s->missed = (uint16_t)((s->missed << 1) | (unsigned)(became_true & (!response)));
  const uint64_t age = s->age & ((uint64_t)response - 1u);
  s->age = age + 1u;
  s->held = s->held & ((!due) | (age < 10u));
  return s->held;
}

// -- one operator over 1001 steps ----------------------------------------------------------------

struct pair_inputs
{
  bool p;
  bool q;
};

struct counter
{
  uint64_t age;  // at the next step, of what the operator looks for
};

static inline bool historically_step(struct counter * s, const struct pair_inputs * in)
{
  const uint64_t age = s->age & (0u - (uint64_t)in->p);
  s->age = age + 1u;
  return age > 1000u;
}

static inline bool once_step(struct counter * s, const struct pair_inputs * in)
{
  const uint64_t age = s->age & ((uint64_t)in->p - 1u);
  s->age = age + 1u;
  return age <= 1000u;
}

static inline bool since_step(struct counter * s, const struct pair_inputs * in)
{
  // Without p the top bit is set, and stays: no age comes there by counting.
  const uint64_t kept = s->age | ((uint64_t)(!in->p) << 63);
  const uint64_t age = kept & ((uint64_t)in->q - 1u);
  s->age = age + 1u;
  return age <= 1000u;
}

// -- descriptions, so that the same loop times both ----------------------------------------------

#define COPIES 100u

static void running_reset(void * state) {running_start(state);}

static void running_group(void * state, const void * inputs, bool * verdicts)
{
  verdicts[0] = running_step(state, inputs);
}

static void copies_reset(void * state)
{
  struct running * const copies = state;
  for (size_t i = 0u; i < COPIES; ++i) {
    running_start(&copies[i]);
  }
}

static void copies_group(void * state, const void * inputs, bool * verdicts)
{
  struct running * const copies = state;
  const struct running_inputs * const in = inputs;
  for (size_t i = 0u; i < COPIES; ++i) {
    verdicts[i] = running_step(&copies[i], &in[i]);
  }
}

static void counter_reset(void * state) {((struct counter *)state)->age = 1001u;}

static void historically_group(void * state, const void * inputs, bool * verdicts)
{
  verdicts[0] = historically_step(state, inputs);
}

static void once_group(void * state, const void * inputs, bool * verdicts)
{
  verdicts[0] = once_step(state, inputs);
}

static void since_group(void * state, const void * inputs, bool * verdicts)
{
  verdicts[0] = since_step(state, inputs);
}

#define DESCRIBE(name, state_type, inputs_type, copies, reset_function, step_function) \
  FM_EXPORT const struct fm_monitor * floor_ ## name(void); \
  const struct fm_monitor * floor_ ## name(void) \
  { \
    static const struct fm_group groups[] = { \
      {NULL, 0u, NULL, 0u, reset_function, step_function, NULL}, \
    }; \
    static const struct fm_monitor monitor = { \
      FM_ABI, 0u, 1u, 0u, copies * sizeof(state_type), copies * sizeof(inputs_type), \
      NULL, groups, NULL, #name, "", step_function, NULL, 0u, NULL \
    }; \
    return &monitor; \
  }

DESCRIBE(running_example, struct running, struct running_inputs, 1u, running_reset, running_group)
DESCRIBE(copies, struct running, struct running_inputs, COPIES, copies_reset, copies_group)
DESCRIBE(historically, struct counter, struct pair_inputs, 1u, counter_reset, historically_group)
DESCRIBE(once, struct counter, struct pair_inputs, 1u, counter_reset, once_group)
DESCRIBE(since, struct counter, struct pair_inputs, 1u, counter_reset, since_group)
