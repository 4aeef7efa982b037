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

/// deadlines.c: see due.h, and fm_evaluator_advance in evaluator.h.

#include "due.h"

#include "measures.h"
#include "steps.h"

// How long an input may have no value until it is silent; 0: for ever.
static int64_t limit_of(const struct fm_evaluator * evaluator, uint32_t i)
{
  const struct fm_input_cell * input = &evaluator->inputs[i];
  const bool has_come = evaluator->instance.inputs[i].has_come;
  return input->timeout == 0 || has_come ? input->timeout : input->startup;
}

static void begin_time(struct fm_evaluator * evaluator, int64_t now)
{
  const struct fm_instance * instance = &evaluator->instance;
  instance->time->has_begun = true;
  instance->time->now = now;
  instance->time->before = now;
  instance->time->clock = now;
  instance->time->arrived = now;
  for (uint32_t i = 0; i < evaluator->monitor->n_inputs; ++i) {
    const int64_t limit = limit_of(evaluator, i);
    instance->inputs[i].stored_at = now;
    fm_set_due(evaluator, i, limit > 0 ? fm_later(now, limit) : FM_NEVER);
  }
  if (evaluator->period > 0) {
    fm_set_period_due(evaluator, fm_later(now, evaluator->period));
  }
  fm_begin_ready_groups(evaluator);
  if (evaluator->policy == FM_TIMED) {
    instance->time->receptions_end = fm_later(now, 1);
  }
  evaluator->is_exact = false;
}

int64_t fm_evaluator_deadline(struct fm_evaluator * evaluator)
{
  const struct fm_instance * instance = &evaluator->instance;
  if (!evaluator->is_exact && instance->time->has_begun) {
    evaluator->wake = instance->time->next_period;
    for (uint32_t i = 0; i < evaluator->monitor->n_inputs; ++i) {
      if (instance->inputs[i].due < evaluator->wake) {
        evaluator->wake = instance->inputs[i].due;
      }
    }
    for (uint32_t g = 0; g < evaluator->monitor->n_groups; ++g) {
      if (instance->groups[g].due < evaluator->wake) {
        evaluator->wake = instance->groups[g].due;
      }
    }
    const int64_t rates_due = fm_rates_due(evaluator);
    evaluator->wake = rates_due < evaluator->wake ? rates_due : evaluator->wake;
    evaluator->is_exact = true;
  }
  return instance->time->has_begun ? evaluator->wake : INT64_MIN;
}

int64_t fm_evaluator_wake(const struct fm_evaluator * evaluator)
{
  return evaluator->wake;
}

bool fm_evaluator_has_begun(const struct fm_evaluator * evaluator)
{
  return evaluator->instance.time->has_begun;
}

int64_t fm_evaluator_now(const struct fm_evaluator * evaluator)
{
  return evaluator->instance.time->now;
}

int64_t fm_evaluator_arrival(struct fm_evaluator * evaluator, int64_t now)
{
  struct fm_instance_time * time = evaluator->instance.time;
  if (!time->has_begun || (evaluator->policy == FM_TIMED && now < time->clock)) {
    return now;
  }
  if (evaluator->policy != FM_TIMED) {
    time->arrived = now > time->arrived ? now : time->arrived;
    fm_renew_rates(evaluator, time->arrived);
    return now;
  }
  time->clock = now;
  return now > time->taken ? now : fm_later(time->taken, 1);
}

void fm_evaluator_shift(struct fm_evaluator * evaluator, int64_t by)
{
  if (evaluator->instance.time->has_begun) {
    fm_instance_shift(&evaluator->instance, by);
    fm_shift_measures(evaluator, by);
    evaluator->seen = fm_later(evaluator->seen, by);
    fm_forget_deadline(evaluator);
  }
}

static void violate_readers(
  struct fm_evaluator * evaluator, uint32_t i, struct fm_findings * report)
{
  const struct fm_input_cell * input = &evaluator->inputs[i];
  const struct fm_instance * instance = &evaluator->instance;
  const bool is_news = !instance->inputs[i].is_stale;
  instance->inputs[i].is_stale = true;
  for (uint32_t k = 0; k < input->n_readers; ++k) {
    struct fm_instance_group * group = &instance->groups[input->readers[k]];
    group->stale += is_news ? 1u : 0u;
    if (!group->knows_stale) {
      fm_overrule(evaluator, input->readers[k]);
      fm_judge_group(evaluator, input->readers[k], report);
    }
  }
}

// Whether messages of an input may be waiting whose timeout is found at `now`.
static bool is_doubtful(const struct fm_evaluator * evaluator, uint32_t i, int64_t now)
{
  return evaluator->patience > 0 &&
         fm_since(evaluator->instance.inputs[i].due, now) > evaluator->patience &&
         fm_since(evaluator->instance.time->before, now) > limit_of(evaluator, i) / 2;
}

static void take_timeout(
  struct fm_evaluator * evaluator, uint32_t i, int64_t now, struct fm_findings * report)
{
  struct fm_input_cell * input = &evaluator->inputs[i];
  struct fm_instance_input * cell = &evaluator->instance.inputs[i];
  const int64_t limit = limit_of(evaluator, i);
  if (!cell->is_silent && !cell->is_put_off && is_doubtful(evaluator, i, now)) {
    const int64_t late = fm_since(cell->due, now);
    const int64_t least = evaluator->patience > INT64_MAX / 10 ?
      INT64_MAX : 10 * evaluator->patience;
    const int64_t longer = late > least ? late : least;
    cell->is_put_off = true;
    fm_set_due(evaluator, i, fm_later(now, longer < limit ? longer : limit));
    return;
  }
  if (!cell->is_silent) {
    report->stamp = fm_later(cell->stored_at, limit);
  }
  input->silences += cell->is_silent ? 0u : 1u;
  input->startups += cell->is_silent || cell->has_come ? 0u : 1u;
  cell->is_silent = true;
  fm_set_due(evaluator, i, FM_NEVER);
  if (input->violates) {
    violate_readers(evaluator, i, report);
  }
}

void fm_miss_periods(struct fm_evaluator * evaluator, int64_t last)
{
  struct fm_instance_time * time = evaluator->instance.time;
  if (time->next_period <= last && time->next_period != FM_NEVER) {
    const uint64_t period = (uint64_t)evaluator->period;
    const uint64_t due = ((uint64_t)last - (uint64_t)time->next_period) / period + 1;
    if (due > FM_MOST_PERIODS_BEHIND) {
      const uint64_t missed = due - FM_MOST_PERIODS_BEHIND;
      evaluator->counts.missed += missed;
      fm_set_period_due(
        evaluator, (int64_t)((uint64_t)time->next_period + missed * period));
    }
  }
}

static void take_period(struct fm_evaluator * evaluator, int64_t now, struct fm_findings * report)
{
  struct fm_instance_time * time = evaluator->instance.time;
  evaluator->counts.periods += 1;
  evaluator->counts.late += fm_since(time->next_period, now) > evaluator->period / 2 ? 1u : 0u;
  fm_set_period_due(evaluator, fm_later(time->next_period, evaluator->period));
  fm_end_receptions(evaluator, now);
  fm_renew_rates(evaluator, report->stamp);
  fm_step_ready_groups(evaluator, report);
  time->receptions_end = evaluator->n_receptions > 0 ? INT64_MIN : INT64_MAX;
}

// The input that is due at an instant, n_inputs if none is.
static uint32_t find_due(const struct fm_evaluator * evaluator, int64_t instant)
{
  uint32_t i = 0;
  while (i < evaluator->monitor->n_inputs && evaluator->instance.inputs[i].due != instant) {
    i += 1;
  }
  return i;
}

static void restart_time(struct fm_evaluator * evaluator, int64_t now)
{
  struct fm_instance_time * time = evaluator->instance.time;
  evaluator->counts.restarts += 1;
  evaluator->counts.restarted_at = now;
  fm_evaluator_shift(evaluator, -fm_since(now, time->now));
  fm_forget_messages(evaluator);
  time->clock = now;
  if (evaluator->policy == FM_TIMED) {
    time->taken = INT64_MIN;
    time->receptions_end = INT64_MIN;
    fm_evaluator_reset(evaluator);
  }
}

// Under FM_TIMED the time may be ahead of the clock: messages that came at one time.
bool fm_goes_back(const struct fm_evaluator * evaluator, int64_t now)
{
  const struct fm_instance_time * time = evaluator->instance.time;
  return time->has_begun && now < time->now && now < time->clock;
}

static void move_time(struct fm_evaluator * evaluator, int64_t now)
{
  struct fm_instance_time * time = evaluator->instance.time;
  if (fm_goes_back(evaluator, now)) {
    restart_time(evaluator, now);
  }
  if (now > time->now) {
    const int64_t seen = evaluator->seen;
    time->before = seen > time->now && seen < now ? seen : time->now;
    time->now = now;
    time->clock = now > time->clock ? now : time->clock;
  }
}

void fm_see_time(struct fm_evaluator * evaluator, int64_t now)
{
  evaluator->seen = now;
}

uint32_t fm_take_first_due(
  struct fm_evaluator * evaluator, int64_t last, struct fm_violation * out)
{
  const int64_t now = evaluator->instance.time->now;
  if (evaluator->wake > last) {
    return 0;
  }
  fm_miss_periods(evaluator, last);
  const int64_t deadline = fm_evaluator_deadline(evaluator);
  struct fm_findings report = {out, deadline, 0};
  if (deadline <= last && deadline != FM_NEVER) {
    const uint32_t input = find_due(evaluator, deadline);
    if (input < evaluator->monitor->n_inputs) {
      take_timeout(evaluator, input, now, &report);
    } else if (evaluator->policy == FM_TIMED) {
      fm_renew_rates(evaluator, deadline);
      fm_evaluate_due_groups(evaluator, deadline, &report);
    } else {
      take_period(evaluator, now, &report);
    }
  }
  return report.n;
}

bool fm_reach(struct fm_evaluator * evaluator, int64_t now)
{
  const bool has_begun = evaluator->instance.time->has_begun;
  if (has_begun) {
    move_time(evaluator, now);
  } else {
    begin_time(evaluator, now);
  }
  return has_begun;
}

uint32_t fm_evaluator_advance(
  struct fm_evaluator * evaluator, int64_t now, struct fm_violation * out)
{
  return fm_reach(evaluator, now) ?
         fm_take_first_due(evaluator, evaluator->instance.time->now, out) : 0;
}

uint32_t fm_evaluator_advance_to(
  struct fm_evaluator * evaluator, int64_t now, struct fm_violation * out)
{
  return fm_reach(evaluator, now) ? fm_take_first_due(evaluator, fm_later(now, -1), out) : 0;
}
