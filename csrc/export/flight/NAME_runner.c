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

// @NAME@_runner.c: see @NAME@_runner.h. Includes the monitors and the evaluator, so that it is the
// only file to compile, and defines no other external names.

#include "fret_static.h"

@INCLUDES@
#include "due.c"
#include "deadlines.c"
#include "evaluator.c"
#include "instance.c"
#include "measures.c"
#include "steps.c"
#include "tables.c"

#include "@NAME@_runner.h"
#include "@NAME@_options.h"

static void announce_found(struct @NAME@_runner * runner, uint32_t n)
{
  for (uint32_t i = 0u; i < n; ++i) {
    runner->announce(runner->context, &runner->found[i]);
  }
}

static void report_silences(struct @NAME@_runner * runner)
{
  for (uint32_t i = 0u; runner->silence != NULL && i < @UPPER@_N_INPUTS; ++i) {
    const bool is_silent = fm_evaluator_silence(runner->evaluator, i).is_silent;
    if (is_silent != runner->was_silent[i]) {
      runner->was_silent[i] = is_silent;
      runner->silence(runner->context, i, is_silent);
    }
  }
}

static void take_due(struct @NAME@_runner * runner, int64_t now)
{
  int64_t wake;
  do {
    announce_found(runner, fm_evaluator_advance(runner->evaluator, now, runner->found));
    wake = fm_evaluator_wake(runner->evaluator);
  } while (wake <= now && wake != FM_NEVER);
}

bool @NAME@_runner_start(
  struct @NAME@_runner * runner, int64_t now, @NAME@_announce announce_violation,
  @NAME@_silence silence, void * context)
{
  const struct fm_evaluator_options options = @NAME@_options();
  const uintptr_t misaligned = (uintptr_t)runner->block % FM_ALIGNMENT;
  memset(runner, 0, sizeof(*runner));
  runner->announce = announce_violation;
  runner->silence = silence;
  runner->context = context;
  if (fm_evaluator_bytes(&options) > @UPPER@_EVALUATOR_BYTES) {
    return false;
  }
  runner->evaluator =
    fm_evaluator_init(runner->block + (FM_ALIGNMENT - misaligned) % FM_ALIGNMENT, &options);
  if (runner->evaluator == NULL) {
    return false;
  }
  @NAME@_set_initial_values(runner->evaluator);
  take_due(runner, now);
  return true;
}

void @NAME@_runner_arrive(struct @NAME@_runner * runner, int64_t now)
{
  runner->arrival = fm_evaluator_arrival(runner->evaluator, now);
  if (fm_evaluator_now(runner->evaluator) != runner->arrival) {
    take_due(runner, runner->arrival - 1);
  }
}

void @NAME@_runner_store(struct @NAME@_runner * runner, uint32_t input, union fm_value value)
{
  fm_evaluator_store(runner->evaluator, input, value, runner->arrival);
}

void @NAME@_runner_message(struct @NAME@_runner * runner, uint32_t topic)
{
  announce_found(
    runner, fm_evaluator_message(runner->evaluator, topic, runner->arrival, runner->found));
  report_silences(runner);
}

void @NAME@_runner_advance(struct @NAME@_runner * runner, int64_t now)
{
  take_due(runner, now);
  report_silences(runner);
}

void @NAME@_runner_period(struct @NAME@_runner * runner, int64_t now)
{
  take_due(runner, now);
  announce_found(runner, fm_evaluator_step(runner->evaluator, now, runner->found));
  report_silences(runner);
}

int64_t @NAME@_runner_wake(const struct @NAME@_runner * runner)
{
  return fm_evaluator_wake(runner->evaluator);
}

void @NAME@_runner_reset(struct @NAME@_runner * runner, int64_t now)
{
  take_due(runner, now);
  fm_evaluator_reset(runner->evaluator);
  take_due(runner, now);
}

struct fm_requirement_counts @NAME@_runner_requirement(
  const struct @NAME@_runner * runner, uint32_t requirement)
{
  return fm_evaluator_requirement_counts(runner->evaluator, requirement);
}

uint64_t @NAME@_runner_messages(const struct @NAME@_runner * runner, uint32_t topic)
{
  return fm_evaluator_topic_counts(runner->evaluator, topic).messages;
}
