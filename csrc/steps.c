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

/// steps.c: see steps.h for the contract.

#include "steps.h"

static void announce(struct fm_report * report, uint32_t requirement, uint64_t step)
{
  if (report->out != NULL) {
    report->out[report->n].step = step;
    report->out[report->n].stamp = report->stamp;
    report->out[report->n].requirement = requirement;
  }
  report->n += 1;
}

static void judge(
  struct fm_evaluator * evaluator, uint32_t requirement, uint64_t step, struct fm_report * report)
{
  struct fm_requirement_cell * cell = &evaluator->requirements[requirement];
  bool * previous = &evaluator->instance.previous[requirement];
  const bool verdict = evaluator->instance.verdicts[requirement];
  if (!verdict) {
    cell->violations += 1;
    if (*previous || !cell->onset) {
      cell->announced += 1;
      announce(report, requirement, step);
    }
  }
  *previous = verdict;
}

void fm_judge_group(struct fm_evaluator * evaluator, uint32_t g, struct fm_report * report)
{
  const struct fm_group * group = &evaluator->monitor->groups[g];
  for (uint32_t k = 0; k < group->n_requirements; ++k) {
    judge(evaluator, group->requirements[k], evaluator->instance.groups[g].steps, report);
  }
}

void fm_overrule(struct fm_evaluator * evaluator, uint32_t g)
{
  const struct fm_group * group = &evaluator->monitor->groups[g];
  for (uint32_t k = 0; k < group->n_requirements; ++k) {
    evaluator->instance.verdicts[group->requirements[k]] = false;
  }
  evaluator->instance.groups[g].knows_stale = true;
}

// Judge the verdicts of a group's step, and count the step.
static void account(struct fm_evaluator * evaluator, uint32_t g, struct fm_report * report)
{
  struct fm_instance_group * cell = &evaluator->instance.groups[g];
  if (cell->stale > 0) {
    fm_overrule(evaluator, g);
  }
  fm_judge_group(evaluator, g, report);
  cell->steps += 1;
  cell->stepped_at = evaluator->instance.time->stores;
  cell->awaited = evaluator->monitor->groups[g].n_inputs;
}

static void step_group(struct fm_evaluator * evaluator, uint32_t g, struct fm_report * report)
{
  const struct fm_instance * instance = &evaluator->instance;
  evaluator->monitor->groups[g].step(instance->state, instance->values, instance->verdicts);
  account(evaluator, g, report);
}

static void step_all_groups(struct fm_evaluator * evaluator, struct fm_report * report)
{
  const struct fm_instance * instance = &evaluator->instance;
  evaluator->monitor->step(instance->state, instance->values, instance->verdicts);
  for (uint32_t g = 0; g < evaluator->monitor->n_groups; ++g) {
    account(evaluator, g, report);
  }
}

void fm_step_ready_groups(struct fm_evaluator * evaluator, struct fm_report * report)
{
  if (evaluator->instance.time->n_waiting == 0 && evaluator->monitor->step != NULL) {
    step_all_groups(evaluator, report);
    return;
  }
  for (uint32_t g = 0; g < evaluator->monitor->n_groups; ++g) {
    if (evaluator->instance.groups[g].unset == 0) {
      step_group(evaluator, g, report);
    }
  }
}

void fm_step_ready_groups_of(
  struct fm_evaluator * evaluator, const struct fm_topic_cell * topic, struct fm_report * report)
{
  for (uint32_t k = 0; k < topic->n_groups; ++k) {
    if (evaluator->instance.groups[topic->groups[k]].unset == 0) {
      step_group(evaluator, topic->groups[k], report);
    }
  }
}

void fm_step_complete_groups_of(
  struct fm_evaluator * evaluator, const struct fm_topic_cell * topic, struct fm_report * report)
{
  for (uint32_t k = 0; k < topic->n_groups; ++k) {
    if (evaluator->instance.groups[topic->groups[k]].awaited == 0) {
      step_group(evaluator, topic->groups[k], report);
    }
  }
}
