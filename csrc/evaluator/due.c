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

/// due.c: see due.h for the contract; fm_evaluator_reset: evaluator.h.

#include "due.h"

int64_t fm_since(int64_t from, int64_t to)
{
  return to > from ? fm_between(from, to) : 0;
}

void fm_replace_due(struct fm_evaluator * evaluator, int64_t * due, int64_t by)
{
  evaluator->is_exact = evaluator->is_exact && *due > evaluator->wake;
  *due = by;
  if (by < evaluator->wake) {
    evaluator->wake = by;
  }
}

void fm_set_due(struct fm_evaluator * evaluator, uint32_t i, int64_t due)
{
  fm_replace_due(evaluator, &evaluator->instance.inputs[i].due, due);
}

void fm_set_group_due(struct fm_evaluator * evaluator, uint32_t g, int64_t due)
{
  fm_replace_due(evaluator, &evaluator->instance.groups[g].due, due);
}

void fm_set_period_due(struct fm_evaluator * evaluator, int64_t due)
{
  fm_replace_due(evaluator, &evaluator->instance.time->next_period, due);
}

void fm_note_value(struct fm_evaluator * evaluator, uint32_t i)
{
  const struct fm_instance * instance = &evaluator->instance;
  const struct fm_input_cell * input = &evaluator->inputs[i];
  if (!instance->inputs[i].has_value) {
    instance->inputs[i].has_value = true;
    for (uint32_t k = 0; k < input->n_readers; ++k) {
      struct fm_instance_group * group = &instance->groups[input->readers[k]];
      group->unset -= 1;
      instance->time->n_waiting -= group->unset == 0 ? 1u : 0u;
    }
  }
}

void fm_begin_ready_groups(struct fm_evaluator * evaluator)
{
  const struct fm_instance * instance = &evaluator->instance;
  for (uint32_t g = 0; g < evaluator->monitor->n_groups; ++g) {
    const struct fm_instance_group * cell = &instance->groups[g];
    if (evaluator->policy == FM_TIMED && instance->time->has_begun && cell->unset == 0 &&
      cell->steps == 0 && cell->due == FM_NEVER)
    {
      fm_set_group_due(evaluator, g, instance->time->now);
    }
  }
}

void fm_forget_deadline(struct fm_evaluator * evaluator)
{
  evaluator->wake = INT64_MIN;
  evaluator->is_exact = false;
}

void fm_evaluator_reset(struct fm_evaluator * evaluator)
{
  const struct fm_instance * instance = &evaluator->instance;
  for (uint32_t g = 0; g < evaluator->monitor->n_groups; ++g) {
    evaluator->steps_before[g] += instance->groups[g].steps;
  }
  fm_instance_reset(instance);
  fm_forget_deadline(evaluator);
  fm_begin_ready_groups(evaluator);
  for (uint32_t i = 0; i < evaluator->monitor->n_inputs; ++i) {
    if (instance->inputs[i].is_stale) {
      fm_set_due(evaluator, i, instance->time->now);
    }
  }
}
