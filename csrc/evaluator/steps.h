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

/// steps.h: the steps of groups, and the violations that they report. For the files of the
/// evaluator and engine_scopes.c. Complexity as the functions of evaluator.h that use them; none
/// fails.

#ifndef STEPS_H_
#define STEPS_H_

#include "tables.h"

/// Collects announced violations. With `out` NULL they are only counted.
struct fm_findings
{
  struct fm_violation * out;
  int64_t stamp;
  uint32_t n;
};

/// Step the groups that are ready: all; those that read a topic; those of a topic whose inputs
/// were all received anew.
FM_INTERNAL void fm_step_ready_groups(
  struct fm_evaluator * evaluator, struct fm_findings * report);
FM_INTERNAL void fm_step_ready_groups_of(
  struct fm_evaluator * evaluator, const struct fm_topic_cell * topic,
  struct fm_findings * report);
FM_INTERNAL void fm_step_complete_groups_of(
  struct fm_evaluator * evaluator, const struct fm_topic_cell * topic,
  struct fm_findings * report);

/// Under FM_TIMED: evaluate groups at an instant: one; the ready ones that read a topic; all ready
/// ones; all that are due by then.
FM_INTERNAL void fm_evaluate_group(
  struct fm_evaluator * evaluator, uint32_t g, int64_t instant, struct fm_findings * report);
FM_INTERNAL void fm_evaluate_groups_of(
  struct fm_evaluator * evaluator, uint32_t topic, int64_t instant, struct fm_findings * report);
FM_INTERNAL void fm_evaluate_ready_groups(
  struct fm_evaluator * evaluator, int64_t instant, struct fm_findings * report);
FM_INTERNAL void fm_evaluate_due_groups(
  struct fm_evaluator * evaluator, int64_t instant, struct fm_findings * report);

/// The margin of a requirement in the state. The evaluator has margins. O(1).
FM_INTERNAL const struct fm_margin * fm_margin_in(
  const struct fm_evaluator * evaluator, uint32_t requirement);

/// Draw a margin as the last one of the part that an instant is in. O(1).
FM_INTERNAL void fm_draw_last(
  const struct fm_margin_lanes * lanes, uint32_t requirement, struct fm_margin margin,
  int64_t instant);

/// Let the inputs become false that said that a message came, if that is over by an instant.
FM_INTERNAL void fm_end_receptions(struct fm_evaluator * evaluator, int64_t instant);

/// The words and the parts of a test (fret_trials.h) in the state of the evaluator's instance.
/// O(1).
FM_INTERNAL const int64_t * fm_test_words(
  const struct fm_evaluator * evaluator, const struct fm_test * test);
FM_INTERNAL const double * fm_test_parts(
  const struct fm_evaluator * evaluator, const struct fm_test * test);

/// The number that a violation of a group has at an instant (`step` of fm_violation). O(1).
FM_INTERNAL uint64_t fm_number_at(
  const struct fm_evaluator * evaluator, uint32_t g, int64_t instant);

/// Count and report the verdicts of a group.
FM_INTERNAL void fm_judge_group(
  struct fm_evaluator * evaluator, uint32_t g, struct fm_findings * report);

/// Set the verdicts of a group, and what its reports compare.
FM_INTERNAL void fm_set_verdicts(struct fm_evaluator * evaluator, uint32_t g, bool verdict);

/// Let a group be no longer violated: its last stale input has a value again. One that is not
/// ready cannot step, and counts as satisfied; fm_report_recoveries reports that.
FM_INTERNAL void fm_end_violation(struct fm_evaluator * evaluator, uint32_t g);

/// Set the verdicts of a stale group to false: its formulas were evaluated on old values.
FM_INTERNAL void fm_overrule(struct fm_evaluator * evaluator, uint32_t g);

/// Report that the groups of a topic are no longer violated that are neither stale nor ready: they
/// cannot step.
FM_INTERNAL void fm_report_recoveries(
  struct fm_evaluator * evaluator, const struct fm_topic_cell * topic,
  struct fm_findings * report);

#endif  // STEPS_H_
