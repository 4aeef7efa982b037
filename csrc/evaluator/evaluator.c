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

/// evaluator.c: see evaluator.h for the contract. Values, messages, rows, and answers; tables.h
/// has the structs, steps.h the steps and their reports, due.h what is due without a message.
///
/// Each group counts the inputs it waits for, so that no call searches for them: `unset` counts
/// its inputs without a value, `awaited` those that were not received since its last step. A store
/// increments a clock; an input is new for a group if its `received_at` is later than the group's
/// `stepped_at`. This needs no flag for each pair of input and group.

#include "evaluator.h"

#include <math.h>
#include <string.h>

#include "due.h"
#include "measures.h"
#include "steps.h"
#include "tables.h"

// ---- the instance ------------------------------------------------------------------------------

static const void * block_of(const struct fm_evaluator * evaluator)
{
  return evaluator->instance.time;
}

uint64_t fm_evaluator_instance_bytes(const struct fm_evaluator * evaluator)
{
  return fm_instance_bytes(evaluator->monitor, evaluator->measure_words);
}

void fm_evaluator_save(const struct fm_evaluator * evaluator, void * out)
{
  memcpy(out, block_of(evaluator), (size_t)fm_evaluator_instance_bytes(evaluator));
}

void fm_evaluator_restore(struct fm_evaluator * evaluator, const void * from)
{
  const struct fm_instance_group * groups = evaluator->instance.groups;
  for (uint32_t g = 0; g < evaluator->monitor->n_groups; ++g) {
    evaluator->steps_before[g] += groups[g].steps;
  }
  memcpy(evaluator->instance.time, from, (size_t)fm_evaluator_instance_bytes(evaluator));
  for (uint32_t g = 0; g < evaluator->monitor->n_groups; ++g) {
    evaluator->steps_before[g] -= groups[g].steps;  // wraps, and so does the sum
  }
  fm_forget_deadline(evaluator);
}

// ---- values ------------------------------------------------------------------------------------

// Mark the input as received for each reader. Counts the value before as overwritten if some
// reader took no step on it.
static void renew(struct fm_evaluator * evaluator, uint32_t i)
{
  const struct fm_instance * instance = &evaluator->instance;
  struct fm_input_cell * input = &evaluator->inputs[i];
  bool missed = false;
  for (uint32_t k = 0; k < input->n_readers; ++k) {
    struct fm_instance_group * group = &instance->groups[input->readers[k]];
    if (instance->inputs[i].received_at > group->stepped_at) {
      missed = true;
    } else {
      group->awaited -= 1;
    }
  }
  input->counts.overwritten += missed ? 1u : 0u;
  instance->time->stores += 1;
  instance->inputs[i].received_at = instance->time->stores;
}

static void end_silence(struct fm_evaluator * evaluator, uint32_t i, int64_t now)
{
  struct fm_input_cell * input = &evaluator->inputs[i];
  struct fm_instance_input * cell = &evaluator->instance.inputs[i];
  const bool was_stale = cell->is_stale;
  input->last_silence = fm_since(cell->stored_at, now);
  cell->is_silent = false;
  cell->is_stale = false;
  for (uint32_t k = 0; was_stale && k < input->n_readers; ++k) {
    struct fm_instance_group * group = &evaluator->instance.groups[input->readers[k]];
    group->stale -= 1;
    if (group->stale == 0) {
      fm_end_violation(evaluator, input->readers[k]);
    }
  }
}

void fm_evaluator_arrive(struct fm_evaluator * evaluator, uint32_t i, int64_t now)
{
  struct fm_instance_input * cell = &evaluator->instance.inputs[i];
  const int64_t timeout = evaluator->inputs[i].timeout;
  cell->has_come = true;
  if (timeout > 0 && evaluator->instance.time->has_begun) {
    if (cell->is_silent) {
      end_silence(evaluator, i, now);
    }
    cell->is_put_off = false;
    cell->stored_at = now;
    fm_set_due(evaluator, i, fm_later(now, timeout));
  }
}

static void note_receipt(struct fm_evaluator * evaluator, uint32_t i, int64_t now)
{
  evaluator->inputs[i].counts.received += 1;
  fm_evaluator_arrive(evaluator, i, now);
  if (evaluator->policy == FM_ALL_INPUTS && evaluator->instance.inputs[i].has_value) {
    renew(evaluator, i);
  }
}

void fm_evaluator_store(
  struct fm_evaluator * evaluator, uint32_t input, union fm_value value, int64_t now)
{
  if (input < evaluator->monitor->n_inputs) {
    fm_end_receptions(evaluator, now);
    if (fm_is_measured(evaluator->inputs[input].source)) {
      const bool is_timed = evaluator->policy == FM_TIMED;
      fm_measure(evaluator, input, is_timed ? now : evaluator->instance.time->arrived);
    } else {
      fm_instance_write(&evaluator->instance, input, value);
      fm_note_value(evaluator, input);
    }
    note_receipt(evaluator, input, now);
  }
}

void fm_evaluator_store_from(
  struct fm_evaluator * evaluator, uint32_t input, const void * value, int64_t now)
{
  if (input < evaluator->monitor->n_inputs) {
    fm_end_receptions(evaluator, now);
    fm_instance_write_from(&evaluator->instance, input, value);
    fm_note_value(evaluator, input);
    note_receipt(evaluator, input, now);
  }
}

void fm_evaluator_put(
  struct fm_evaluator * evaluator, uint32_t input, union fm_value value, int64_t now)
{
  fm_end_receptions(evaluator, now);
  if (!fm_is_measured(evaluator->inputs[input].source)) {
    fm_instance_write(&evaluator->instance, input, value);
    fm_note_value(evaluator, input);
  }
}

// A group that is not ready keeps in `start` how many ticks it has taken.
static void pause_group(struct fm_evaluator * evaluator, uint32_t g, int64_t now)
{
  struct fm_instance_group * group = &evaluator->instance.groups[g];
  if (evaluator->policy == FM_TIMED && group->steps > 0 && !group->is_paused) {
    group->start = fm_between(group->start, now);
    group->is_paused = true;
  }
  fm_set_group_due(evaluator, g, FM_NEVER);
}

void fm_evaluator_withdraw(struct fm_evaluator * evaluator, uint32_t i, int64_t now)
{
  const struct fm_instance * instance = &evaluator->instance;
  const struct fm_input_cell * input = &evaluator->inputs[i];
  for (uint32_t k = 0; instance->inputs[i].has_value && k < input->n_readers; ++k) {
    struct fm_instance_group * group = &instance->groups[input->readers[k]];
    instance->time->n_waiting += group->unset == 0 ? 1u : 0u;
    group->unset += 1;
    pause_group(evaluator, input->readers[k], now);
  }
  instance->inputs[i].has_value = false;
}

void fm_evaluator_initial(struct fm_evaluator * evaluator, uint32_t input, union fm_value value)
{
  if (input < evaluator->monitor->n_inputs) {
    fm_end_receptions(evaluator, evaluator->instance.time->now);
    fm_instance_write(&evaluator->instance, input, value);
    fm_note_value(evaluator, input);
    fm_begin_ready_groups(evaluator);
  }
}

void fm_evaluator_initial_from(
  struct fm_evaluator * evaluator, uint32_t input, const void * value)
{
  if (input < evaluator->monitor->n_inputs) {
    fm_end_receptions(evaluator, evaluator->instance.time->now);
    fm_instance_write_from(&evaluator->instance, input, value);
    fm_note_value(evaluator, input);
    fm_begin_ready_groups(evaluator);
  }
}

void fm_evaluator_unusable(struct fm_evaluator * evaluator, uint32_t input)
{
  if (input < evaluator->monitor->n_inputs) {
    evaluator->inputs[input].counts.unusable += 1;
  }
}

void fm_evaluator_undecodable(struct fm_evaluator * evaluator, uint32_t topic)
{
  if (topic < evaluator->n_topics) {
    evaluator->topics[topic].counts.undecodable += 1;
  }
}

// ---- messages ----------------------------------------------------------------------------------

// A reception is true until the steps of its message are taken, or for one tick.
static int64_t end_of_reception(const struct fm_evaluator * evaluator, int64_t now)
{
  if (evaluator->n_receptions == 0) {
    return INT64_MAX;
  }
  return evaluator->policy == FM_TIMED ? fm_later(now, 1) : INT64_MIN;
}

uint32_t fm_evaluator_message(
  struct fm_evaluator * evaluator, uint32_t topic, int64_t now, struct fm_violation * out)
{
  struct fm_findings report = {out, now, 0};
  if (topic >= evaluator->n_topics) {
    return 0;
  }
  struct fm_topic_cell * cell = &evaluator->topics[topic];
  cell->counts.messages += 1;
  fm_end_receptions(evaluator, now);
  fm_report_recoveries(evaluator, cell, &report);
  switch (evaluator->policy) {
    case FM_EVERY_MESSAGE:
      fm_step_ready_groups(evaluator, &report);
      break;
    case FM_RELEVANT_MESSAGE:
      fm_step_ready_groups_of(evaluator, cell, &report);
      break;
    case FM_ALL_INPUTS:
      fm_step_complete_groups_of(evaluator, cell, &report);
      break;
    case FM_TIMED:
      if (!evaluator->instance.time->has_begun) {
        return 0;
      }
      fm_renew_rates(evaluator, now);
      fm_evaluate_groups_of(evaluator, topic, now, &report);
      break;
    case FM_PERIODIC:
      return report.n;
  }
  if (cell->tells_receptions) {
    evaluator->instance.time->receptions_end = end_of_reception(evaluator, now);
  }
  return report.n;
}

uint32_t fm_evaluator_step(
  struct fm_evaluator * evaluator, int64_t now, struct fm_violation * out)
{
  struct fm_findings report = {out, now, 0};
  fm_end_receptions(evaluator, now);
  fm_renew_rates(evaluator, now);
  if (evaluator->policy == FM_TIMED) {
    if (!evaluator->instance.time->has_begun) {
      (void)fm_evaluator_advance(evaluator, now, NULL);
    }
    fm_evaluate_ready_groups(evaluator, now, &report);
  } else {
    fm_step_ready_groups(evaluator, &report);
  }
  evaluator->instance.time->receptions_end = end_of_reception(evaluator, now);
  return report.n;
}

// ---- rows --------------------------------------------------------------------------------------

static bool comes(const struct fm_rows * rows, uint32_t i)
{
  return rows->come == NULL || rows->come[i] == NULL || rows->come[i][rows->next] != 0;
}

uint32_t fm_evaluator_row(
  struct fm_evaluator * evaluator, struct fm_rows * rows, struct fm_violation * out)
{
  const union fm_value none = {.i = 0};
  const size_t row = (size_t)rows->next;
  if (!evaluator->instance.time->has_begun && evaluator->has_measures) {
    (void)fm_evaluator_advance(evaluator, rows->times[row], NULL);
  }
  const int64_t now = fm_evaluator_arrival(evaluator, rows->times[row]);
  for (uint32_t i = 0; i < evaluator->monitor->n_inputs; ++i) {
    const char * column = rows->columns[i];
    if (!comes(rows, i)) {
      continue;
    }
    if (column != NULL) {
      const enum fm_type type = (enum fm_type)evaluator->monitor->inputs[i].type;
      fm_evaluator_store_from(evaluator, i, column + row * fm_instance_value_bytes(type), now);
    } else if (fm_is_measured(evaluator->inputs[i].source)) {
      fm_evaluator_store(evaluator, i, none, now);
    }
  }
  rows->next += 1;
  return fm_evaluator_step(evaluator, now, out);
}

// Write the present margins; returns whether a value differs from what was there.
static bool put_margins(const struct fm_evaluator * evaluator, struct fm_margin * out)
{
  bool differs = false;
  for (uint32_t r = 0; out != NULL && r < evaluator->monitor->n_requirements; ++r) {
    const struct fm_margin margin = fm_evaluator_margin(evaluator, r);
    differs |= memcmp(&out[r].value, &margin.value, sizeof(margin.value)) != 0;
    out[r] = margin;
  }
  return differs;
}

// Take all that is due by an instant.
static void take_instant(struct fm_evaluator * evaluator, int64_t instant)
{
  while (fm_evaluator_deadline(evaluator) <= instant && instant != FM_NEVER) {
    (void)fm_evaluator_advance(evaluator, instant, NULL);
  }
}

uint64_t fm_evaluator_rows(
  struct fm_evaluator * evaluator, struct fm_rows * rows, int64_t until, uint64_t room,
  int64_t * times, bool * verdicts)
{
  const bool * present = evaluator->instance.verdicts;
  const size_t bytes = evaluator->monitor->n_requirements * sizeof(bool);
  uint64_t n = 0;
  if (rows->next < rows->n && !evaluator->instance.time->has_begun) {
    (void)fm_evaluator_advance(evaluator, rows->times[rows->next], NULL);
  }
  while (n < room) {
    const bool has_row = rows->next < rows->n;
    const int64_t end = has_row ? rows->times[rows->next] : fm_later(until, 1);
    const int64_t due = fm_evaluator_deadline(evaluator);
    const bool is_due = due < end && due != FM_NEVER;
    bool * out = verdicts + n * evaluator->monitor->n_requirements;
    struct fm_margin * margins =
      rows->margins == NULL ? NULL : rows->margins + n * evaluator->monitor->n_requirements;
    if (!is_due && !has_row) {
      break;
    }
    memcpy(out, present, bytes);
    (void)put_margins(evaluator, margins);
    times[n] = is_due ? due : end;
    if (!is_due) {
      (void)fm_evaluator_row(evaluator, rows, NULL);
    }
    take_instant(evaluator, times[n]);
    const bool is_other = put_margins(evaluator, margins) || memcmp(out, present, bytes) != 0;
    n += !is_due || is_other ? 1u : 0u;
    memcpy(out, present, bytes);
  }
  return n;
}

// ---- answers -----------------------------------------------------------------------------------

bool fm_evaluator_ready(const struct fm_evaluator * evaluator, uint32_t group)
{
  return group < evaluator->monitor->n_groups && evaluator->instance.groups[group].unset == 0;
}

bool fm_evaluator_measures(const struct fm_evaluator * evaluator)
{
  return evaluator->has_measures;
}

bool fm_evaluator_is_timed(const struct fm_evaluator * evaluator)
{
  return evaluator->policy == FM_TIMED;
}

uint64_t fm_evaluator_steps(const struct fm_evaluator * evaluator, uint32_t group)
{
  return group < evaluator->monitor->n_groups ? evaluator->instance.groups[group].steps : 0;
}

int64_t fm_evaluator_start(const struct fm_evaluator * evaluator, uint32_t group)
{
  return group < evaluator->monitor->n_groups ? evaluator->instance.groups[group].start : 0;
}

const bool * fm_evaluator_verdicts(const struct fm_evaluator * evaluator)
{
  return evaluator->instance.verdicts;
}

const void * fm_evaluator_inputs(const struct fm_evaluator * evaluator)
{
  return evaluator->instance.values;
}

bool fm_evaluator_has_value(const struct fm_evaluator * evaluator, uint32_t input)
{
  return input < evaluator->monitor->n_inputs && evaluator->instance.inputs[input].has_value;
}

bool fm_evaluator_is_stale(const struct fm_evaluator * evaluator, uint32_t input)
{
  return input < evaluator->monitor->n_inputs && evaluator->instance.inputs[input].is_stale;
}

void fm_evaluator_log_trials(struct fm_evaluator * evaluator, struct fm_trial_log * log)
{
  evaluator->trials = log;
}

static struct fm_test_counts test_counts(
  const struct fm_evaluator * evaluator, uint32_t requirement)
{
  for (uint32_t k = 0; evaluator->tests != NULL && k < evaluator->tests->n_tests; ++k) {
    const struct fm_test * test = &evaluator->tests->tests[k];
    if (test->requirement == requirement) {
      return fm_counts_of_test(
        test, fm_test_words(evaluator, test), fm_test_parts(evaluator, test));
    }
  }
  return (struct fm_test_counts) {NULL, 0, 0, 0, 0, 1.0};
}

struct fm_margin fm_evaluator_margin(
  const struct fm_evaluator * evaluator, uint32_t requirement)
{
  const struct fm_margin unknown = {(double)NAN, (double)NAN, 0, -1};
  if (evaluator->margins == NULL || requirement >= evaluator->monitor->n_requirements) {
    return unknown;
  }
  const uint32_t group = evaluator->monitor->requirements[requirement].group;
  return evaluator->instance.groups[group].steps == 0 ? unknown :
         *fm_margin_in(evaluator, requirement);
}

void fm_evaluator_forget_closest(struct fm_evaluator * evaluator)
{
  for (uint32_t r = 0; r < evaluator->monitor->n_requirements; ++r) {
    evaluator->nearest[r].closest.is_known = false;
  }
}

void fm_evaluator_draw_margins(
  struct fm_evaluator * evaluator, const struct fm_margin_lanes * lanes)
{
  evaluator->lanes = lanes;
}

static const struct fm_closest no_closest = {{(double)NAN, (double)NAN, 0, -1}, 0, false};

struct fm_closest fm_evaluator_closest(
  const struct fm_evaluator * evaluator, uint32_t requirement)
{
  return requirement < evaluator->monitor->n_requirements ?
         evaluator->nearest[requirement].closest : no_closest;
}

struct fm_closest fm_evaluator_beyond(
  const struct fm_evaluator * evaluator, uint32_t requirement)
{
  return requirement < evaluator->monitor->n_requirements ?
         evaluator->nearest[requirement].beyond : no_closest;
}

struct fm_margin fm_margin_now(const struct fm_evaluator * evaluator, uint32_t requirement)
{
  const uint32_t group = evaluator->monitor->requirements[requirement].group;
  return evaluator->instance.groups[group].stale > 0 ? no_closest.margin :
         fm_evaluator_margin(evaluator, requirement);
}

double fm_take_recent(struct fm_evaluator * evaluator, uint32_t requirement, double now)
{
  struct fm_closest * recent = &evaluator->requirements[requirement].recent;
  const double found = recent->is_known ? recent->margin.value : now;
  *recent = (struct fm_closest) {{now, now, 0, -1}, 0, now == now};
  return found;
}

double fm_evaluator_take_margin(struct fm_evaluator * evaluator, uint32_t requirement)
{
  return requirement >= evaluator->monitor->n_requirements ? no_closest.margin.value :
         fm_take_recent(evaluator, requirement, fm_margin_now(evaluator, requirement).value);
}

struct fm_requirement_counts fm_evaluator_requirement_counts(
  const struct fm_evaluator * evaluator, uint32_t requirement)
{
  struct fm_requirement_counts counts =
  {0, 0, 0, true, true, false, {NULL, 0, 0, 0, 0, 1.0}, no_closest.margin};
  if (requirement < evaluator->monitor->n_requirements) {
    const struct fm_requirement_cell * cell = &evaluator->requirements[requirement];
    const uint32_t group = evaluator->monitor->requirements[requirement].group;
    counts.steps = evaluator->steps_before[group] + evaluator->instance.groups[group].steps;
    counts.violations = cell->violations;
    counts.announced = cell->announced;
    counts.verdict = evaluator->instance.verdicts[requirement];
    counts.holds = evaluator->instance.previous[requirement];
    counts.is_violated = !counts.holds;
    counts.test = test_counts(evaluator, requirement);
    counts.margin = fm_margin_now(evaluator, requirement);
  }
  return counts;
}

struct fm_input_counts fm_evaluator_input_counts(
  const struct fm_evaluator * evaluator, uint32_t input)
{
  const struct fm_input_counts none = {0, 0, 0};
  return input < evaluator->monitor->n_inputs ? evaluator->inputs[input].counts : none;
}

struct fm_topic_counts fm_evaluator_topic_counts(
  const struct fm_evaluator * evaluator, uint32_t topic)
{
  const struct fm_topic_counts none = {0, 0};
  return topic < evaluator->n_topics ? evaluator->topics[topic].counts : none;
}

struct fm_silence fm_evaluator_silence(const struct fm_evaluator * evaluator, uint32_t input)
{
  struct fm_silence silence = {0, 0, 0, false};
  if (input < evaluator->monitor->n_inputs) {
    const struct fm_instance_input * cell = &evaluator->instance.inputs[input];
    silence.count = evaluator->inputs[input].silences;
    silence.startups = evaluator->inputs[input].startups;
    silence.is_silent = cell->is_silent;
    silence.lasted = !cell->is_silent ? evaluator->inputs[input].last_silence :
      fm_since(cell->stored_at, evaluator->instance.time->now);
  }
  return silence;
}

struct fm_time_counts fm_evaluator_time_counts(const struct fm_evaluator * evaluator)
{
  const struct fm_monitor * monitor = evaluator->monitor;
  struct fm_time_counts counts = evaluator->counts;
  counts.overflows +=
    monitor->overflows == NULL ? 0 : monitor->overflows(evaluator->instance.state);
  return counts;
}
