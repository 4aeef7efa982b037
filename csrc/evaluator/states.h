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

/// Conditions: what decides whether a lock is locked, or a gate open, and explains it. They are
/// FM_CONDITION_BYTES, then a byte for each requirement, enum fm_state with enum
/// fm_requirement_flag, and one for each input, enum fm_input_flag.
enum fm_condition_byte
{
  FM_GATE_IS_KNOWN = 0,  // as in struct fm_gate_counts; 1 or 0
  FM_GATE_IS_LATCHED = 1,
  FM_CONDITION_BYTES = 2
};

enum fm_requirement_flag
{
  FM_STATE_MASK = 3,
  FM_IS_FALSE = 4,        // what its reports compare, after the last step that stayed
  FM_WAS_ALWAYS_FALSE = 8 // holds, but each message was withheld on which it was judged
};

enum fm_input_flag
{
  FM_HAS_VALUE = 1,
  FM_IS_SILENT = 2
};

/// Changes of the conditions that are kept until they are taken.
#define FM_MOST_CONDITIONS 64

struct fm_states
{
  struct fm_requirement_state * requirements;  // owned
  uint32_t n_requirements;
  uint64_t changes;      // grows with each change of a state, and each occurrence
  uint8_t * conditions;  // owned: FM_MOST_CONDITIONS, then the latest, then room for the next
  size_t condition_bytes;
  uint32_t begin;
  uint32_t n;
  uint64_t missed;       // changes that were not kept, since one was taken
};

/// Begin with all unknown: requirements of the monitor first, then those of instances, if there
/// are any; inputs of the monitor. Returns false if memory is short. O(requirements); allocates.
FM_INTERNAL bool fm_states_init(
  struct fm_states * states, uint32_t n_requirements, uint32_t n_inputs);
FM_INTERNAL void fm_states_free(struct fm_states * states);

/// Note the state of a requirement of instances. O(1).
FM_INTERNAL void fm_states_set(
  struct fm_states * states, uint32_t requirement, enum fm_state state);

/// A violation of a requirement has begun. O(1).
FM_INTERNAL void fm_states_begin_violation(struct fm_states * states, uint32_t requirement);

/// Bring the states of the monitor up to date after a step, a timeout or a reset. `are_violated`:
/// for each requirement, whether its last violation has not ended; of a gate's requirement, also
/// one by a message that was withheld. O(requirements + inputs of their groups).
FM_INTERNAL void fm_states_update(
  struct fm_states * states, const struct fm_evaluator * evaluator,
  const struct fm_monitor * monitor, const bool * are_violated);

/// Look at the conditions, and keep them if they have changed. O(requirements + inputs).
FM_INTERNAL void fm_states_note_conditions(
  struct fm_states * states, const struct fm_evaluator * evaluator,
  const struct fm_monitor * monitor, bool is_known, bool is_latched);

/// The latest conditions that were noted.
FM_INTERNAL const uint8_t * fm_states_conditions(const struct fm_states * states);

/// Take the conditions after the next change that was kept. `missed`: how many came after it that
/// were not kept, which is known with the last one.
/// Returns false if there is none. O(requirements + inputs).
FM_INTERNAL bool fm_states_take_conditions(
  struct fm_states * states, uint8_t * out, uint64_t * missed);

#endif  // STATES_H_
