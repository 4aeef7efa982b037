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

/// states.c: see states.h for the contract.

#include "states.h"

#include <stdlib.h>
#include <string.h>

#include "tables.h"

bool fm_states_init(struct fm_states * states, uint32_t n_requirements, uint32_t n_inputs)
{
  states->n_requirements = n_requirements;
  states->requirements = calloc(n_requirements + (size_t)1, sizeof(*states->requirements));
  states->condition_bytes = FM_CONDITION_BYTES + n_requirements + (size_t)n_inputs;
  states->conditions = calloc(FM_MOST_CONDITIONS + (size_t)2, states->condition_bytes);
  return states->requirements != NULL && states->conditions != NULL;
}

void fm_states_free(struct fm_states * states)
{
  free(states->requirements);
  free(states->conditions);
}

void fm_states_begin_violation(struct fm_states * states, uint32_t requirement)
{
  states->requirements[requirement].occurrences += 1;
  states->changes += 1;
}

void fm_states_set(struct fm_states * states, uint32_t requirement, enum fm_state state)
{
  if (states->requirements[requirement].state != state) {
    states->requirements[requirement].state = (uint8_t)state;
    states->changes += 1;
  }
}

void fm_states_update(
  struct fm_states * states, const struct fm_evaluator * evaluator,
  const struct fm_monitor * monitor, const bool * are_violated)
{
  for (uint32_t r = 0; r < monitor->n_requirements; ++r) {
    fm_states_set(
      states, r, are_violated[r] || !evaluator->instance.previous[r] ? FM_VIOLATED :
      fm_is_known(&evaluator->instance, r) ? FM_HOLDS : FM_UNKNOWN);
  }
}

// ---- conditions --------------------------------------------------------------------------------

static uint8_t * place_of(const struct fm_states * states, uint32_t k)
{
  return states->conditions + k * states->condition_bytes;
}

static uint8_t * latest(const struct fm_states * states)
{
  return place_of(states, FM_MOST_CONDITIONS);
}

const uint8_t * fm_states_conditions(const struct fm_states * states) {return latest(states);}

static uint8_t flags_of(
  const struct fm_states * states, const struct fm_evaluator * evaluator, uint32_t r)
{
  if (r >= evaluator->monitor->n_requirements) {
    return states->requirements[r].state;
  }
  const struct fm_requirement_counts counts = fm_evaluator_requirement_counts(evaluator, r);
  const unsigned is_false = counts.holds ? 0u : FM_IS_FALSE;
  const unsigned was_always_false =
    counts.holds && counts.violations > 0 && counts.steps == counts.violations ?
    FM_WAS_ALWAYS_FALSE : 0u;
  return (uint8_t)(states->requirements[r].state | is_false | was_always_false);
}

void fm_states_note_conditions(
  struct fm_states * states, const struct fm_evaluator * evaluator,
  const struct fm_monitor * monitor, bool is_known, bool is_latched)
{
  uint8_t * next = place_of(states, FM_MOST_CONDITIONS + 1u);
  uint8_t * inputs = next + FM_CONDITION_BYTES + states->n_requirements;
  next[FM_GATE_IS_KNOWN] = is_known ? 1u : 0u;
  next[FM_GATE_IS_LATCHED] = is_latched ? 1u : 0u;
  for (uint32_t r = 0; r < states->n_requirements; ++r) {
    next[FM_CONDITION_BYTES + r] = flags_of(states, evaluator, r);
  }
  for (uint32_t i = 0; i < monitor->n_inputs; ++i) {
    const struct fm_instance_input * cell = &evaluator->instance.inputs[i];
    inputs[i] = (uint8_t)(
      (cell->has_value ? FM_HAS_VALUE : 0) | (cell->is_silent ? FM_IS_SILENT : 0));
  }
  if (memcmp(next, latest(states), states->condition_bytes) == 0) {
    return;
  }
  memcpy(latest(states), next, states->condition_bytes);
  if (states->n == FM_MOST_CONDITIONS) {
    states->missed += 1;
    return;
  }
  memcpy(
    place_of(states, (states->begin + states->n) % FM_MOST_CONDITIONS), next,
    states->condition_bytes);
  states->n += 1;
}

bool fm_states_take_conditions(struct fm_states * states, uint8_t * out, uint64_t * missed)
{
  if (states->n == 0) {
    return false;
  }
  memcpy(out, place_of(states, states->begin), states->condition_bytes);
  states->begin = (states->begin + 1) % FM_MOST_CONDITIONS;
  states->n -= 1;
  *missed = states->n == 0 ? states->missed : 0;
  states->missed = states->n == 0 ? 0 : states->missed;
  return true;
}
