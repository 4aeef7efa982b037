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

/// states.h: what actions and locks follow: for each requirement whether it holds, is violated, or
/// is not known, and how often a violation has begun.
///
/// A requirement is not known before its group's first step since start or reset, and while an
/// input that its group reads is silent, or may be: its timeout was put off. Not thread-safe. No
/// function allocates or fails, except fm_states_init.

#ifndef STATES_H_
#define STATES_H_

#include "evaluator.h"

enum fm_state
{
  FM_UNKNOWN = 0,
  FM_HOLDS = 1,
  FM_VIOLATED = 2
};

struct fm_requirement_state
{
  uint64_t occurrences;  // how often a violation has begun
  uint8_t state;         // enum fm_state
};

struct fm_states
{
  struct fm_requirement_state * requirements;  // owned
  uint64_t changes;      // grows with each change of a state, and each occurrence
};

/// Begin with all unknown. Returns false if memory is short. O(requirements); allocates.
FM_INTERNAL bool fm_states_init(struct fm_states * states, const struct fm_monitor * monitor);
FM_INTERNAL void fm_states_free(struct fm_states * states);

/// A violation of a requirement has begun. O(1).
FM_INTERNAL void fm_states_begin_violation(struct fm_states * states, uint32_t requirement);

/// Bring the states up to date after a step, a timeout or a reset. `are_violated`: for each
/// requirement, whether its last violation has not ended; of a gate's requirement, also one by a
/// message that was withheld. O(requirements + inputs of their groups).
FM_INTERNAL void fm_states_update(
  struct fm_states * states, const struct fm_evaluator * evaluator,
  const struct fm_monitor * monitor, const bool * are_violated);

#endif  // STATES_H_
