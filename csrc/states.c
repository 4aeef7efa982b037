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

#include "tables.h"

bool fm_states_init(struct fm_states * states, const struct fm_monitor * monitor)
{
  states->requirements =
    calloc(monitor->n_requirements + (size_t)1, sizeof(*states->requirements));
  states->changes = 0;
  return states->requirements != NULL;
}

void fm_states_free(struct fm_states * states)
{
  free(states->requirements);
}

void fm_states_begin_violation(struct fm_states * states, uint32_t requirement)
{
  states->requirements[requirement].occurrences += 1;
  states->changes += 1;
}

static bool is_known(
  const struct fm_evaluator * evaluator, const struct fm_monitor * monitor, uint32_t group)
{
  const struct fm_group * read = &monitor->groups[group];
  bool is_silent = false;
  for (uint32_t k = 0; k < read->n_inputs; ++k) {
    is_silent = is_silent || fm_may_be_silent(&evaluator->instance.inputs[read->inputs[k]]);
  }
  return !is_silent && evaluator->instance.groups[group].steps > 0;
}

void fm_states_update(
  struct fm_states * states, const struct fm_evaluator * evaluator,
  const struct fm_monitor * monitor, const bool * are_violated)
{
  for (uint32_t r = 0; r < monitor->n_requirements; ++r) {
    const enum fm_state state =
      are_violated[r] || !evaluator->instance.previous[r] ? FM_VIOLATED :
      is_known(evaluator, monitor, monitor->requirements[r].group) ? FM_HOLDS : FM_UNKNOWN;
    if (states->requirements[r].state != state) {
      states->requirements[r].state = (uint8_t)state;
      states->changes += 1;
    }
  }
}
