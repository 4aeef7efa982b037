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

#include "due.h"

// ---- reports -----------------------------------------------------------------------------------

static void announce(
  struct fm_findings * report, uint32_t requirement, uint64_t step, bool is_recovery)
{
  if (report->out != NULL) {
    report->out[report->n].step = step;
    report->out[report->n].stamp = report->stamp;
    report->out[report->n].requirement = requirement;
    report->out[report->n].is_recovery = is_recovery;
    report->out[report->n].is_withheld = false;
    report->out[report->n].is_end = false;
  }
  report->n += 1;
}

static void judge(
  struct fm_evaluator * evaluator, uint32_t requirement, uint64_t step,
  struct fm_findings * report)
{
  struct fm_requirement_cell * cell = &evaluator->requirements[requirement];
  if (cell->report == FM_UNREPORTED) {
    return;
  }
  bool * previous = &evaluator->instance.previous[requirement];
  const bool * verdicts = evaluator->instance.verdicts;
  const bool compared = verdicts[cell->report == FM_OCCURRENCE ? cell->occurrence : requirement];
  cell->violations += verdicts[requirement] ? 0u : 1u;
  struct fm_closest * beyond = &evaluator->nearest[requirement].beyond;
  beyond->is_known = beyond->is_known && (compared || !*previous);
  if (!compared && (*previous || cell->report == FM_EVERY_STEP)) {
    cell->announced += 1;
    announce(report, requirement, step, false);
  } else if (compared && !*previous && evaluator->reports_recoveries) {
    announce(report, requirement, step, true);
  }
  *previous = compared;
}

uint64_t fm_number_at(const struct fm_evaluator * evaluator, uint32_t g, int64_t instant)
{
  const struct fm_instance_group * cell = &evaluator->instance.groups[g];
  if (evaluator->policy != FM_TIMED || cell->steps == 0) {
    return cell->steps;
  }
  return (uint64_t)(cell->is_paused ? cell->start : fm_since(cell->start, instant));
}

void fm_judge_group(struct fm_evaluator * evaluator, uint32_t g, struct fm_findings * report)
{
  const struct fm_group * group = &evaluator->monitor->groups[g];
  const uint64_t number = fm_number_at(evaluator, g, report->stamp);
  for (uint32_t k = 0; k < group->n_requirements; ++k) {
    judge(evaluator, group->requirements[k], number, report);
  }
}

void fm_set_verdicts(struct fm_evaluator * evaluator, uint32_t g, bool verdict)
{
  const struct fm_group * group = &evaluator->monitor->groups[g];
  for (uint32_t k = 0; k < group->n_requirements; ++k) {
    const uint32_t r = group->requirements[k];
    if (evaluator->requirements[r].report != FM_UNREPORTED) {
      evaluator->instance.verdicts[r] = verdict;
      evaluator->instance.verdicts[evaluator->requirements[r].occurrence] = verdict;
    }
  }
}

void fm_overrule(struct fm_evaluator * evaluator, uint32_t g)
{
  fm_set_verdicts(evaluator, g, false);
  evaluator->instance.groups[g].knows_stale = true;
}

void fm_end_violation(struct fm_evaluator * evaluator, uint32_t g)
{
  evaluator->instance.groups[g].knows_stale = false;
  if (evaluator->instance.groups[g].unset > 0) {
    fm_set_verdicts(evaluator, g, true);
  }
}

void fm_report_recoveries(
  struct fm_evaluator * evaluator, const struct fm_topic_cell * topic, struct fm_findings * report)
{
  const struct fm_instance * instance = &evaluator->instance;
  for (uint32_t k = 0; instance->time->n_waiting > 0 && k < topic->n_groups; ++k) {
    const uint32_t g = topic->groups[k];
    if (instance->groups[g].unset > 0 && instance->groups[g].stale == 0) {
      fm_judge_group(evaluator, g, report);
    }
  }
}

// ---- margins -----------------------------------------------------------------------------------

static const struct fm_margin * margin_at(const struct fm_evaluator * evaluator, uint64_t place)
{
  return (const struct fm_margin *)(const void *)((const char *)evaluator->instance.state + place);
}

const struct fm_margin * fm_margin_in(const struct fm_evaluator * evaluator, uint32_t requirement)
{
  return margin_at(evaluator, evaluator->margins->margins[requirement]);
}

// Say when the next step of a group is, for what decides its margins.
static void set_instant(struct fm_evaluator * evaluator, uint32_t g, int64_t instant)
{
  if (evaluator->margins != NULL) {
    char * state = evaluator->instance.state;
    *(int64_t *)(void *)(state + evaluator->margins->instants[g]) = instant;
  }
}

static void keep_less(
  struct fm_closest * closest, const struct fm_margin * margin, int64_t instant)
{
  const bool is_less = !closest->is_known || margin->value < closest->margin.value;
  if (is_less && margin->value == margin->value) {  // no NaN
    *closest = (struct fm_closest) {*margin, instant, true};
  }
}

void fm_draw_last(
  const struct fm_margin_lanes * lanes, uint32_t requirement, struct fm_margin margin,
  int64_t instant)
{
  const int64_t part = instant < lanes->begin ? -1 : (instant - lanes->begin) / lanes->width;
  if (part >= 0 && (uint64_t)part < lanes->n) {
    lanes->last[requirement * lanes->n + (uint64_t)part] = margin;
  }
}

static void draw(
  const struct fm_margin_lanes * lanes, uint32_t requirement, const struct fm_margin * margin,
  int64_t instant)
{
  const int64_t part = instant < lanes->begin ? -1 : (instant - lanes->begin) / lanes->width;
  if (part < 0 || (uint64_t)part >= lanes->n) {
    return;
  }
  const uint64_t place = requirement * lanes->n + (uint64_t)part;
  if (!(lanes->least[place].value <= margin->value)) {  // or it is the first one
    lanes->least[place] = *margin;
  }
  lanes->last[place] = *margin;
}

// Note the margins of a group after a step that was judged.
static void note_margins(struct fm_evaluator * evaluator, uint32_t g, int64_t instant)
{
  const struct fm_group * group = &evaluator->monitor->groups[g];
  for (uint32_t k = 0; evaluator->margins != NULL && k < group->n_requirements; ++k) {
    const uint32_t r = group->requirements[k];
    struct fm_nearest * nearest = &evaluator->nearest[r];
    keep_less(&nearest->closest, fm_margin_in(evaluator, r), instant);
    keep_less(&evaluator->requirements[r].recent, fm_margin_in(evaluator, r), instant);
    if (evaluator->lanes != NULL) {
      draw(evaluator->lanes, r, fm_margin_in(evaluator, r), instant);
    }
    if (!evaluator->instance.previous[r]) {
      keep_less(
        &nearest->beyond, margin_at(evaluator, evaluator->margins->occurrences[r]), instant);
    }
  }
}

// ---- steps -------------------------------------------------------------------------------------

void fm_end_receptions(struct fm_evaluator * evaluator, int64_t instant)
{
  const struct fm_instance * instance = &evaluator->instance;
  const union fm_value no = {.i = 0};
  if (instance->time->receptions_end == INT64_MAX || instant < instance->time->receptions_end) {
    return;
  }
  instance->time->receptions_end = INT64_MAX;
  for (uint32_t i = 0; i < evaluator->monitor->n_inputs; ++i) {
    if (evaluator->inputs[i].source == FM_RECEPTION) {
      fm_instance_write(instance, i, no);
    }
  }
}

// ---- trials ------------------------------------------------------------------------------------

const int64_t * fm_test_words(
  const struct fm_evaluator * evaluator, const struct fm_test * test)
{
  const char * state = (const char *)evaluator->instance.state;
  return (const int64_t *)(const void *)(state + test->words);
}

const double * fm_test_parts(
  const struct fm_evaluator * evaluator, const struct fm_test * test)
{
  const char * state = (const char *)evaluator->instance.state;
  return (const double *)(const void *)(state + test->parts);
}

struct fm_test_counts fm_counts_of_test(
  const struct fm_test * test, const int64_t * words, const double * parts)
{
  return (struct fm_test_counts) {
    test, words[FM_TEST_TRIALS], words[FM_TEST_EVENTS], words[FM_TEST_VERDICT],
    words[(int)FM_TEST_UNITS + (int)FM_TEST_LIKELIHOOD], parts[FM_TEST_LIKELIHOOD]};
}

static void log_trial(
  struct fm_trial_log * log, const struct fm_test * test, int64_t outcome, int64_t stamp)
{
  if (log->n == log->room) {
    log->missed += 1;
    return;
  }
  log->records[log->n].stamp = stamp;
  log->records[log->n].requirement = test->requirement;
  log->records[log->n].has_failed = (outcome < 0) != test->counts_successes;
  log->n += 1;
}

// Log the trials that a step of a group has decided.
static void log_trials(struct fm_evaluator * evaluator, uint32_t g, int64_t stamp)
{
  for (uint32_t k = 0; k < evaluator->tests->n_tests; ++k) {
    const struct fm_test * test = &evaluator->tests->tests[k];
    const int64_t outcome = fm_test_words(evaluator, test)[FM_TEST_OUTCOME];
    if (evaluator->monitor->requirements[test->requirement].group == g && outcome != 0) {
      log_trial(evaluator->trials, test, outcome, stamp);
    }
  }
}

// Judge the verdicts of a group's step, and count the step.
static void account(struct fm_evaluator * evaluator, uint32_t g, struct fm_findings * report)
{
  struct fm_instance_group * cell = &evaluator->instance.groups[g];
  if (evaluator->tests != NULL && evaluator->trials != NULL) {
    log_trials(evaluator, g, report->stamp);
  }
  if (cell->stale > 0) {
    fm_overrule(evaluator, g);
  }
  fm_judge_group(evaluator, g, report);
  if (cell->stale == 0) {
    note_margins(evaluator, g, report->stamp);
  }
  if (cell->steps == 0 && evaluator->policy != FM_TIMED) {
    cell->start = report->stamp;
  }
  cell->steps += 1;
  cell->stepped_at = evaluator->instance.time->stores;
  cell->awaited = evaluator->monitor->groups[g].n_inputs;
}

static void step_group(struct fm_evaluator * evaluator, uint32_t g, struct fm_findings * report)
{
  const struct fm_instance * instance = &evaluator->instance;
  set_instant(evaluator, g, report->stamp);
  evaluator->monitor->groups[g].step(instance->state, instance->values, instance->verdicts);
  account(evaluator, g, report);
}

static void step_all_groups(struct fm_evaluator * evaluator, struct fm_findings * report)
{
  const struct fm_instance * instance = &evaluator->instance;
  for (uint32_t g = 0; evaluator->margins != NULL && g < evaluator->monitor->n_groups; ++g) {
    set_instant(evaluator, g, report->stamp);
  }
  evaluator->monitor->step(instance->state, instance->values, instance->verdicts);
  for (uint32_t g = 0; g < evaluator->monitor->n_groups; ++g) {
    account(evaluator, g, report);
  }
}

void fm_step_ready_groups(struct fm_evaluator * evaluator, struct fm_findings * report)
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
  struct fm_evaluator * evaluator, const struct fm_topic_cell * topic, struct fm_findings * report)
{
  for (uint32_t k = 0; k < topic->n_groups; ++k) {
    if (evaluator->instance.groups[topic->groups[k]].unset == 0) {
      step_group(evaluator, topic->groups[k], report);
    }
  }
}

void fm_step_complete_groups_of(
  struct fm_evaluator * evaluator, const struct fm_topic_cell * topic, struct fm_findings * report)
{
  for (uint32_t k = 0; k < topic->n_groups; ++k) {
    const struct fm_instance_group * group = &evaluator->instance.groups[topic->groups[k]];
    if (group->awaited == 0 && group->unset == 0) {  // an aggregate may have lost its value
      step_group(evaluator, topic->groups[k], report);
    }
  }
}

// ---- evaluations at ticks ----------------------------------------------------------------------

static void restart_group(struct fm_evaluator * evaluator, uint32_t g)
{
  struct fm_instance_group * cell = &evaluator->instance.groups[g];
  evaluator->steps_before[g] += cell->steps;
  cell->steps = 0;
  evaluator->monitor->groups[g].reset(evaluator->instance.state);
}

// Whether an input of the group says that a message came. It becomes false 1 ns later.
static bool reads_reception(const struct fm_evaluator * evaluator, uint32_t g)
{
  const struct fm_group * group = &evaluator->monitor->groups[g];
  for (uint32_t k = 0; evaluator->n_receptions > 0 && k < group->n_inputs; ++k) {
    const uint32_t i = group->inputs[k];
    const char * place =
      (const char *)evaluator->instance.values + evaluator->monitor->inputs[i].offset;
    if (evaluator->inputs[i].source == FM_RECEPTION && *(const bool *)(const void *)place) {
      return true;
    }
  }
  return false;
}

void fm_evaluate_group(
  struct fm_evaluator * evaluator, uint32_t g, int64_t instant, struct fm_findings * report)
{
  const struct fm_instance * instance = &evaluator->instance;
  struct fm_instance_group * cell = &instance->groups[g];
  if (cell->is_paused) {
    cell->start = fm_later(instant, -cell->start);
    cell->is_paused = false;
  }
  if (cell->steps > 0 && fm_between(cell->start, instant) > FM_LAST_TICK) {
    restart_group(evaluator, g);
  }
  if (cell->steps == 0) {
    cell->start = instant;
  }
  set_instant(evaluator, g, instant);
  const int64_t next = evaluator->monitor->groups[g].step_at(
    instance->state, instance->values, instance->verdicts, fm_between(cell->start, instant));
  const int64_t due = next == FM_NEVER ? FM_NEVER : fm_later(cell->start, next);
  const int64_t after = fm_later(instant, 1);
  fm_set_group_due(evaluator, g, reads_reception(evaluator, g) && after < due ? after : due);
  account(evaluator, g, report);
}

// A message or row takes effect at an instant.
static void take_record(struct fm_evaluator * evaluator, int64_t instant)
{
  struct fm_instance_time * time = evaluator->instance.time;
  time->taken = instant;
  time->now = instant > time->now ? instant : time->now;
}

void fm_evaluate_groups_of(
  struct fm_evaluator * evaluator, uint32_t topic, int64_t instant, struct fm_findings * report)
{
  const struct fm_topic_cell * cell = &evaluator->topics[topic];
  take_record(evaluator, instant);
  for (uint32_t k = 0; k < cell->n_groups; ++k) {
    const uint32_t g = cell->groups[k];
    if (evaluator->instance.groups[g].unset == 0 && evaluator->monitor->groups[g].n_inputs > 0) {
      fm_evaluate_group(evaluator, g, instant, report);
    }
  }
}

void fm_evaluate_ready_groups(
  struct fm_evaluator * evaluator, int64_t instant, struct fm_findings * report)
{
  take_record(evaluator, instant);
  for (uint32_t g = 0; g < evaluator->monitor->n_groups; ++g) {
    if (evaluator->instance.groups[g].unset == 0) {
      fm_evaluate_group(evaluator, g, instant, report);
    }
  }
}

void fm_evaluate_due_groups(
  struct fm_evaluator * evaluator, int64_t instant, struct fm_findings * report)
{
  fm_end_receptions(evaluator, instant);
  evaluator->instance.time->taken = instant;
  for (uint32_t g = 0; g < evaluator->monitor->n_groups; ++g) {
    if (evaluator->instance.groups[g].due <= instant) {
      fm_evaluate_group(evaluator, g, instant, report);
    }
  }
}
