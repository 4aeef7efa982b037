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

#include <string.h>

#include "fret_monitor.h"

// -- the running example ------------------------------------------------------------------------
// H (O[10,10] (trigger & !r) -> O[0,9] (FTP | r)), trigger = rising edge of persisted(10, overload)

struct running_inputs
{
  float current_consumption;
  float wind_speed;
};

struct running
{
  uint16_t missed;  // bit k: k + 1 steps ago the condition became true without the response
  uint8_t run;      // steps in a row with overload, up to 11
  uint8_t left;     // for how many steps a response, or the start, still counts
  bool persisted;
  bool held;
};

static void running_start(struct running * s)
{
  memset(s, 0, sizeof(*s));
  s->left = 11u;
  s->held = true;
}

static inline bool running_step(struct running * s, const struct running_inputs * in)
{
  const bool response = in->current_consumption <= 15.0f;
  const bool overload = (in->current_consumption > 15.0f) & (in->wind_speed > 8.0f);
  s->run = overload ? (uint8_t)(s->run + (s->run < 11u)) : 0u;
  const bool persisted = s->run == 11u;
  const bool trigger = persisted & (!s->persisted);
  s->persisted = persisted;
  const bool due = ((s->missed >> 9) & 1u) != 0u;
  s->missed = (uint16_t)((s->missed << 1) | (unsigned)(trigger & (!response)));
  s->left = response ? 10u : (uint8_t)(s->left - (s->left > 0u));
  s->held = s->held & ((!due) | (s->left > 0u));
  return s->held;
}

// -- one operator over 1001 steps -----------------------------------------------------------------

struct pair_inputs
{
  bool p;
  bool q;
};

struct counter
{
  uint16_t left;
};

static inline bool historically_step(struct counter * s, const struct pair_inputs * in)
{
  s->left = in->p ? (uint16_t)(s->left - (s->left > 0u)) : 1001u;
  return s->left == 0u;
}

static inline bool once_step(struct counter * s, const struct pair_inputs * in)
{
  s->left = in->p ? 1001u : (uint16_t)(s->left - (s->left > 0u));
  return s->left > 0u;
}

static inline bool since_step(struct counter * s, const struct pair_inputs * in)
{
  const uint16_t kept = in->p ? (uint16_t)(s->left - (s->left > 0u)) : (uint16_t)0u;
  s->left = in->q ? 1001u : kept;
  return s->left > 0u;
}

// -- descriptions, so that the same loop times both -------------------------------------------------

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

static void counter_reset(void * state) {memset(state, 0, sizeof(struct counter));}

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
      {NULL, 0u, NULL, 0u, reset_function, step_function}, \
    }; \
    static const struct fm_monitor monitor = { \
      FM_ABI, 0u, 1u, 0u, copies * sizeof(state_type), copies * sizeof(inputs_type), \
      NULL, groups, NULL, #name, "", step_function \
    }; \
    return &monitor; \
  }

DESCRIBE(running_example, struct running, struct running_inputs, 1u, running_reset, running_group)
DESCRIBE(copies, struct running, struct running_inputs, COPIES, copies_reset, copies_group)
DESCRIBE(historically, struct counter, struct pair_inputs, 1u, counter_reset, historically_group)
DESCRIBE(once, struct counter, struct pair_inputs, 1u, counter_reset, once_group)
DESCRIBE(since, struct counter, struct pair_inputs, 1u, counter_reset, since_group)
