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

/// evaluator.c: see evaluator.h for the contract.
///
/// One block of memory holds everything: the tables that the monitor and the options determine,
/// the counters, and the instance (instance.h), which is all that steps depend on. Only `lay_out`
/// computes the offsets.
///
/// Each group counts the inputs it waits for, so that no call searches for them: `unset` counts
/// its inputs without a value, `awaited` those that were not received since its last step. A store
/// increments a clock; an input is new for a group if its `received_at` is later than the group's
/// `stepped_at`. This needs no flag for each pair of input and group.
///
/// `wake` is never after the deadline. A message puts off timeouts without looking for the
/// earliest one; that is done when `wake` has come.

#include "evaluator.h"

#include <string.h>

#include "instance.h"

#define NO_TOPIC UINT32_MAX

struct input_cell
{
  uint32_t * readers;    // the groups that read it, ascending
  struct fm_input_counts counts;
  uint64_t silences;
  int64_t last_silence;  // how long the last one lasted, ns
  int64_t timeout;       // ns; 0: none
  uint32_t n_readers;
  uint32_t topic;
  bool violates;
};

struct requirement_cell
{
  uint64_t violations;
  uint64_t announced;
  bool onset;
};

struct topic_cell
{
  uint32_t * groups;  // those that read an input of this topic, or no input at all; ascending
  struct fm_topic_counts counts;
  uint32_t n_groups;
};

struct fm_evaluator
{
  const struct fm_monitor * monitor;
  struct fm_instance instance;
  struct input_cell * inputs;
  struct requirement_cell * requirements;
  struct topic_cell * topics;
  uint64_t * steps_before;  // a group: steps that its instance no longer counts
  struct fm_time_counts counts;
  int64_t period;           // ns; 0: none
  int64_t patience;         // ns; 0: none
  int64_t wake;             // not after the deadline
  bool is_exact;            // wake is the deadline
  uint32_t n_topics;
  enum fm_policy policy;
};

// ---- layout ------------------------------------------------------------------------------------

// Offsets of the parts of the block, in bytes.
struct layout
{
  uint64_t inputs;
  uint64_t requirements;
  uint64_t topics;
  uint64_t steps_before;
  uint64_t readers;
  uint64_t topic_groups;
  uint64_t instance;
  struct fm_block block;
};

static uint64_t count_readings(const struct fm_monitor * monitor)
{
  uint64_t count = 0;
  for (uint32_t g = 0; g < monitor->n_groups; ++g) {
    count += monitor->groups[g].n_inputs;
  }
  return count;
}

static uint32_t count_groups_without_inputs(const struct fm_monitor * monitor)
{
  uint32_t count = 0;
  for (uint32_t g = 0; g < monitor->n_groups; ++g) {
    count += monitor->groups[g].n_inputs == 0 ? 1u : 0u;
  }
  return count;
}

static struct layout lay_out(const struct fm_evaluator_options * options)
{
  const struct fm_monitor * monitor = options->monitor;
  const uint64_t readings = count_readings(monitor);
  const uint64_t without_inputs = count_groups_without_inputs(monitor);
  const uint64_t instance_bytes = fm_instance_bytes(monitor);
  struct layout layout = {0};
  layout.block.fits = instance_bytes > 0;
  (void)fm_block_append(&layout.block, 1, sizeof(struct fm_evaluator));
  layout.inputs = fm_block_append(&layout.block, monitor->n_inputs, sizeof(struct input_cell));
  layout.requirements =
    fm_block_append(&layout.block, monitor->n_requirements, sizeof(struct requirement_cell));
  layout.topics = fm_block_append(&layout.block, options->n_topics, sizeof(struct topic_cell));
  layout.steps_before = fm_block_append(&layout.block, monitor->n_groups, sizeof(uint64_t));
  layout.readers = fm_block_append(&layout.block, readings, sizeof(uint32_t));
  // An input has at most one topic, so each input that a group reads puts the group on at most one
  // topic's list. A group that reads no input is on the lists of all topics.
  layout.topic_groups = fm_block_append(&layout.block, readings, sizeof(uint32_t));
  (void)fm_block_append(&layout.block, without_inputs * options->n_topics, sizeof(uint32_t));
  layout.instance = fm_block_append(&layout.block, instance_bytes, 1);
  return layout;
}

uint64_t fm_evaluator_bytes(const struct fm_evaluator_options * options)
{
  if (options->monitor == NULL || options->monitor->abi != FM_ABI) {
    return 0;
  }
  const struct layout layout = lay_out(options);
  return layout.block.fits ? layout.block.bytes : 0;
}

// ---- checks ------------------------------------------------------------------------------------

static bool inputs_are_sound(const struct fm_monitor * monitor)
{
  for (uint32_t i = 0; i < monitor->n_inputs; ++i) {
    const struct fm_input * input = &monitor->inputs[i];
    const uint32_t size = fm_instance_value_bytes((enum fm_type)input->type);
    if (size == 0 || (uint64_t)input->offset + size > monitor->inputs_bytes) {
      return false;
    }
  }
  return true;
}

static bool ascend_below(uint32_t limit, const uint32_t * indices, uint32_t n)
{
  for (uint32_t k = 0; k < n; ++k) {
    if (indices[k] >= limit || (k > 0 && indices[k] <= indices[k - 1])) {
      return false;
    }
  }
  return true;
}

static bool holds_its_own(const struct fm_monitor * monitor, uint32_t g)
{
  const struct fm_group * group = &monitor->groups[g];
  for (uint32_t k = 0; k < group->n_requirements; ++k) {
    if (monitor->requirements[group->requirements[k]].group != g) {
      return false;
    }
  }
  return true;
}

// Each requirement must be listed once, by the group it names: a step that judged it twice would
// announce it twice.
static bool groups_are_sound(const struct fm_monitor * monitor)
{
  uint64_t placed = 0;
  for (uint32_t g = 0; g < monitor->n_groups; ++g) {
    const struct fm_group * group = &monitor->groups[g];
    if (!ascend_below(monitor->n_inputs, group->inputs, group->n_inputs) ||
      !ascend_below(monitor->n_requirements, group->requirements, group->n_requirements) ||
      !holds_its_own(monitor, g))
    {
      return false;
    }
    placed += group->n_requirements;
  }
  return placed == monitor->n_requirements;
}

static bool times_are_sound(const struct fm_evaluator_options * options)
{
  for (uint32_t i = 0; options->timeouts != NULL && i < options->monitor->n_inputs; ++i) {
    if (options->timeouts[i] < 0) {
      return false;
    }
  }
  return options->period >= 0 && options->patience >= 0;
}

static bool options_are_sound(const struct fm_evaluator_options * options)
{
  const struct fm_monitor * monitor = options->monitor;
  return monitor != NULL && monitor->abi == FM_ABI && options->policy <= FM_PERIODIC &&
         inputs_are_sound(monitor) && groups_are_sound(monitor) && times_are_sound(options) &&
         lay_out(options).block.fits;
}

// ---- making one --------------------------------------------------------------------------------

static void place_parts(
  struct fm_evaluator * evaluator, char * memory, const struct layout * layout)
{
  evaluator->inputs = (struct input_cell *)(void *)(memory + layout->inputs);
  evaluator->requirements = (struct requirement_cell *)(void *)(memory + layout->requirements);
  evaluator->topics = (struct topic_cell *)(void *)(memory + layout->topics);
  evaluator->steps_before = (uint64_t *)(void *)(memory + layout->steps_before);
  evaluator->instance = fm_instance_make(evaluator->monitor, memory + layout->instance);
}

static void make_inputs(
  struct fm_evaluator * evaluator, const struct fm_evaluator_options * options)
{
  for (uint32_t i = 0; i < evaluator->monitor->n_inputs; ++i) {
    struct input_cell * input = &evaluator->inputs[i];
    input->topic = NO_TOPIC;
    input->timeout = options->timeouts == NULL ? 0 : options->timeouts[i];
    input->violates = options->violates != NULL && options->violates[i];
  }
}

static void make_requirements(struct fm_evaluator * evaluator, const bool * report_onset)
{
  for (uint32_t r = 0; r < evaluator->monitor->n_requirements; ++r) {
    evaluator->requirements[r].onset = report_onset != NULL && report_onset[r];
  }
}

// Build each input's list of the groups that read it. Groups are visited in order, so that each
// list is ascending.
static void list_readers(struct fm_evaluator * evaluator, uint32_t * pool)
{
  const struct fm_monitor * monitor = evaluator->monitor;
  for (uint32_t g = 0; g < monitor->n_groups; ++g) {
    for (uint32_t k = 0; k < monitor->groups[g].n_inputs; ++k) {
      evaluator->inputs[monitor->groups[g].inputs[k]].n_readers += 1;
    }
  }
  for (uint32_t i = 0; i < monitor->n_inputs; ++i) {
    evaluator->inputs[i].readers = pool;
    pool += evaluator->inputs[i].n_readers;
    evaluator->inputs[i].n_readers = 0;
  }
  for (uint32_t g = 0; g < monitor->n_groups; ++g) {
    for (uint32_t k = 0; k < monitor->groups[g].n_inputs; ++k) {
      struct input_cell * input = &evaluator->inputs[monitor->groups[g].inputs[k]];
      input->readers[input->n_readers] = g;
      input->n_readers += 1;
    }
  }
}

// Assign the inputs to their topics, and reserve each topic's list of groups. Returns false if an
// index is out of range or an input has two topics.
static bool make_topics(
  struct fm_evaluator * evaluator, const struct fm_topic * topics, uint32_t * pool)
{
  const uint32_t without_inputs = count_groups_without_inputs(evaluator->monitor);
  for (uint32_t t = 0; t < evaluator->n_topics; ++t) {
    evaluator->topics[t].groups = pool;
    pool += without_inputs;
    for (uint32_t k = 0; k < topics[t].n_inputs; ++k) {
      const uint32_t i = topics[t].inputs[k];
      if (i >= evaluator->monitor->n_inputs || evaluator->inputs[i].topic != NO_TOPIC) {
        return false;
      }
      evaluator->inputs[i].topic = t;
      pool += evaluator->inputs[i].n_readers;
    }
  }
  return true;
}

static void add_group(struct topic_cell * topic, uint32_t g)
{
  if (topic->n_groups == 0 || topic->groups[topic->n_groups - 1] != g) {
    topic->groups[topic->n_groups] = g;
    topic->n_groups += 1;
  }
}

static void add_group_to_all_topics(struct fm_evaluator * evaluator, uint32_t g)
{
  for (uint32_t t = 0; t < evaluator->n_topics; ++t) {
    add_group(&evaluator->topics[t], g);
  }
}

static void list_groups_of_topics(struct fm_evaluator * evaluator)
{
  for (uint32_t g = 0; g < evaluator->monitor->n_groups; ++g) {
    const struct fm_group * group = &evaluator->monitor->groups[g];
    if (group->n_inputs == 0) {
      add_group_to_all_topics(evaluator, g);
    }
    for (uint32_t k = 0; k < group->n_inputs; ++k) {
      const uint32_t t = evaluator->inputs[group->inputs[k]].topic;
      if (t != NO_TOPIC) {
        add_group(&evaluator->topics[t], g);
      }
    }
  }
}

struct fm_evaluator * fm_evaluator_init(
  void * memory, const struct fm_evaluator_options * options)
{
  if (!options_are_sound(options)) {
    return NULL;
  }
  const struct layout layout = lay_out(options);
  struct fm_evaluator * evaluator = memory;
  char * block = memory;
  uint32_t * readers = (uint32_t *)(void *)(block + layout.readers);
  uint32_t * topic_groups = (uint32_t *)(void *)(block + layout.topic_groups);
  memset(memory, 0, (size_t)layout.block.bytes);
  evaluator->monitor = options->monitor;
  evaluator->n_topics = options->n_topics;
  evaluator->policy = (enum fm_policy)options->policy;
  evaluator->period = evaluator->policy == FM_PERIODIC ? options->period : 0;
  evaluator->patience = options->patience;
  evaluator->wake = INT64_MIN;
  place_parts(evaluator, block, &layout);
  make_inputs(evaluator, options);
  make_requirements(evaluator, options->report_onset);
  list_readers(evaluator, readers);
  if (!make_topics(evaluator, options->topics, topic_groups)) {
    return NULL;
  }
  list_groups_of_topics(evaluator);
  return evaluator;
}

// ---- the instance ------------------------------------------------------------------------------

void fm_evaluator_reset(struct fm_evaluator * evaluator)
{
  const struct fm_instance * instance = &evaluator->instance;
  for (uint32_t g = 0; g < evaluator->monitor->n_groups; ++g) {
    evaluator->steps_before[g] += instance->groups[g].steps;
  }
  fm_instance_reset(instance);
  for (uint32_t i = 0; i < evaluator->monitor->n_inputs; ++i) {
    if (instance->inputs[i].is_stale) {
      instance->inputs[i].due = instance->time->now;
      evaluator->wake = INT64_MIN;
      evaluator->is_exact = false;
    }
  }
}

static const void * block_of(const struct fm_evaluator * evaluator)
{
  return evaluator->instance.time;
}

uint64_t fm_evaluator_instance_bytes(const struct fm_evaluator * evaluator)
{
  return fm_instance_bytes(evaluator->monitor);
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
  evaluator->wake = INT64_MIN;
  evaluator->is_exact = false;
}

// ---- values ------------------------------------------------------------------------------------

// Note that an input has a value. With its first one, its readers wait for one input less.
static void note_value(struct fm_evaluator * evaluator, uint32_t i)
{
  const struct fm_instance * instance = &evaluator->instance;
  const struct input_cell * input = &evaluator->inputs[i];
  if (!instance->inputs[i].has_value) {
    instance->inputs[i].has_value = true;
    for (uint32_t k = 0; k < input->n_readers; ++k) {
      struct fm_instance_group * group = &instance->groups[input->readers[k]];
      group->unset -= 1;
      instance->time->n_waiting -= group->unset == 0 ? 1u : 0u;
    }
  }
}

// Mark the input as received for each reader. Counts the value before as overwritten if some
// reader took no step on it.
static void renew(struct fm_evaluator * evaluator, uint32_t i)
{
  const struct fm_instance * instance = &evaluator->instance;
  struct input_cell * input = &evaluator->inputs[i];
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

// Called when the last stale input of a group was stored. A group that is not ready cannot step,
// so that its verdicts are set to true here.
static void end_violation(struct fm_evaluator * evaluator, uint32_t g)
{
  const struct fm_group * group = &evaluator->monitor->groups[g];
  const struct fm_instance * instance = &evaluator->instance;
  instance->groups[g].knows_stale = false;
  for (uint32_t k = 0; instance->groups[g].unset > 0 && k < group->n_requirements; ++k) {
    instance->previous[group->requirements[k]] = true;
    instance->verdicts[group->requirements[k]] = true;
  }
}

// The nanoseconds from one time to a later one; 0 if it is not later.
static int64_t since(int64_t from, int64_t to)
{
  return to > from ? fm_between(from, to) : 0;
}

static void end_silence(struct fm_evaluator * evaluator, uint32_t i, int64_t now)
{
  struct input_cell * input = &evaluator->inputs[i];
  struct fm_instance_input * cell = &evaluator->instance.inputs[i];
  const bool was_stale = cell->is_stale;
  input->last_silence = since(cell->stored_at, now);
  cell->is_silent = false;
  cell->is_stale = false;
  for (uint32_t k = 0; was_stale && k < input->n_readers; ++k) {
    struct fm_instance_group * group = &evaluator->instance.groups[input->readers[k]];
    group->stale -= 1;
    if (group->stale == 0) {
      end_violation(evaluator, input->readers[k]);
    }
  }
}

static void set_due(struct fm_evaluator * evaluator, uint32_t i, int64_t due)
{
  struct fm_instance_input * cell = &evaluator->instance.inputs[i];
  evaluator->is_exact = evaluator->is_exact && cell->due > evaluator->wake;
  cell->due = due;
  if (due < evaluator->wake) {
    evaluator->wake = due;
  }
}

static void note_receipt(struct fm_evaluator * evaluator, uint32_t i, int64_t now)
{
  struct input_cell * input = &evaluator->inputs[i];
  struct fm_instance_input * cell = &evaluator->instance.inputs[i];
  note_value(evaluator, i);
  input->counts.received += 1;
  if (input->timeout > 0 && evaluator->instance.time->has_begun) {
    if (cell->is_silent) {
      end_silence(evaluator, i, now);
    }
    cell->is_put_off = false;
    cell->stored_at = now;
    set_due(evaluator, i, fm_later(now, input->timeout));
  }
  if (evaluator->policy == FM_ALL_INPUTS) {
    renew(evaluator, i);
  }
}

void fm_evaluator_store(
  struct fm_evaluator * evaluator, uint32_t input, union fm_value value, int64_t now)
{
  if (input < evaluator->monitor->n_inputs) {
    fm_instance_write(&evaluator->instance, input, value);
    note_receipt(evaluator, input, now);
  }
}

void fm_evaluator_store_from(
  struct fm_evaluator * evaluator, uint32_t input, const void * value, int64_t now)
{
  if (input < evaluator->monitor->n_inputs) {
    fm_instance_write_from(&evaluator->instance, input, value);
    note_receipt(evaluator, input, now);
  }
}

void fm_evaluator_initial(struct fm_evaluator * evaluator, uint32_t input, union fm_value value)
{
  if (input < evaluator->monitor->n_inputs) {
    fm_instance_write(&evaluator->instance, input, value);
    note_value(evaluator, input);
  }
}

void fm_evaluator_initial_from(
  struct fm_evaluator * evaluator, uint32_t input, const void * value)
{
  if (input < evaluator->monitor->n_inputs) {
    fm_instance_write_from(&evaluator->instance, input, value);
    note_value(evaluator, input);
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

// ---- steps -------------------------------------------------------------------------------------

// Collects announced violations. With `out` NULL they are only counted.
struct report
{
  struct fm_violation * out;
  int64_t stamp;
  uint32_t n;
};

static void announce(struct report * report, uint32_t requirement, uint64_t step)
{
  if (report->out != NULL) {
    report->out[report->n].step = step;
    report->out[report->n].stamp = report->stamp;
    report->out[report->n].requirement = requirement;
  }
  report->n += 1;
}

static void judge(
  struct fm_evaluator * evaluator, uint32_t requirement, uint64_t step, struct report * report)
{
  struct requirement_cell * cell = &evaluator->requirements[requirement];
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

static void judge_group(struct fm_evaluator * evaluator, uint32_t g, struct report * report)
{
  const struct fm_group * group = &evaluator->monitor->groups[g];
  for (uint32_t k = 0; k < group->n_requirements; ++k) {
    judge(evaluator, group->requirements[k], evaluator->instance.groups[g].steps, report);
  }
}

// Set the verdicts of a stale group to false: its formulas were evaluated on old values.
static void overrule(struct fm_evaluator * evaluator, uint32_t g)
{
  const struct fm_group * group = &evaluator->monitor->groups[g];
  for (uint32_t k = 0; k < group->n_requirements; ++k) {
    evaluator->instance.verdicts[group->requirements[k]] = false;
  }
  evaluator->instance.groups[g].knows_stale = true;
}

// Judge the verdicts of a group's step, and count the step.
static void account(struct fm_evaluator * evaluator, uint32_t g, struct report * report)
{
  struct fm_instance_group * cell = &evaluator->instance.groups[g];
  if (cell->stale > 0) {
    overrule(evaluator, g);
  }
  judge_group(evaluator, g, report);
  cell->steps += 1;
  cell->stepped_at = evaluator->instance.time->stores;
  cell->awaited = evaluator->monitor->groups[g].n_inputs;
}

static void step_group(struct fm_evaluator * evaluator, uint32_t g, struct report * report)
{
  const struct fm_instance * instance = &evaluator->instance;
  evaluator->monitor->groups[g].step(instance->state, instance->values, instance->verdicts);
  account(evaluator, g, report);
}

static void step_all_groups(struct fm_evaluator * evaluator, struct report * report)
{
  const struct fm_instance * instance = &evaluator->instance;
  evaluator->monitor->step(instance->state, instance->values, instance->verdicts);
  for (uint32_t g = 0; g < evaluator->monitor->n_groups; ++g) {
    account(evaluator, g, report);
  }
}

static void step_ready_groups(struct fm_evaluator * evaluator, struct report * report)
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

static void step_ready_groups_of(
  struct fm_evaluator * evaluator, const struct topic_cell * topic, struct report * report)
{
  for (uint32_t k = 0; k < topic->n_groups; ++k) {
    if (evaluator->instance.groups[topic->groups[k]].unset == 0) {
      step_group(evaluator, topic->groups[k], report);
    }
  }
}

static void step_complete_groups_of(
  struct fm_evaluator * evaluator, const struct topic_cell * topic, struct report * report)
{
  for (uint32_t k = 0; k < topic->n_groups; ++k) {
    if (evaluator->instance.groups[topic->groups[k]].awaited == 0) {
      step_group(evaluator, topic->groups[k], report);
    }
  }
}

uint32_t fm_evaluator_message(
  struct fm_evaluator * evaluator, uint32_t topic, int64_t now, struct fm_violation * out)
{
  struct report report = {out, now, 0};
  if (topic >= evaluator->n_topics) {
    return 0;
  }
  struct topic_cell * cell = &evaluator->topics[topic];
  cell->counts.messages += 1;
  switch (evaluator->policy) {
    case FM_EVERY_MESSAGE:
      step_ready_groups(evaluator, &report);
      break;
    case FM_RELEVANT_MESSAGE:
      step_ready_groups_of(evaluator, cell, &report);
      break;
    case FM_ALL_INPUTS:
      step_complete_groups_of(evaluator, cell, &report);
      break;
    case FM_PERIODIC:
      break;
  }
  return report.n;
}

uint32_t fm_evaluator_step(
  struct fm_evaluator * evaluator, int64_t now, struct fm_violation * out)
{
  struct report report = {out, now, 0};
  step_ready_groups(evaluator, &report);
  return report.n;
}

static void store_row(
  struct fm_evaluator * evaluator, const void * const * columns, uint64_t row)
{
  for (uint32_t i = 0; i < evaluator->monitor->n_inputs; ++i) {
    if (columns[i] != NULL) {
      const enum fm_type type = (enum fm_type)evaluator->monitor->inputs[i].type;
      const char * column = columns[i];
      fm_evaluator_store_from(
        evaluator, i, column + (size_t)row * fm_instance_value_bytes(type),
        evaluator->instance.time->now);
    }
  }
}

uint64_t fm_evaluator_rows(
  struct fm_evaluator * evaluator, const void * const * columns, uint64_t n_rows,
  bool * verdicts)
{
  const uint32_t n_requirements = evaluator->monitor->n_requirements;
  uint64_t announced = 0;
  for (uint64_t row = 0; row < n_rows; ++row) {
    store_row(evaluator, columns, row);
    announced += fm_evaluator_step(evaluator, evaluator->instance.time->now, NULL);
    if (verdicts != NULL && n_requirements > 0) {
      memcpy(verdicts, evaluator->instance.verdicts, n_requirements * sizeof(bool));
      verdicts += n_requirements;
    }
  }
  return announced;
}

// ---- time --------------------------------------------------------------------------------------

static void begin_time(struct fm_evaluator * evaluator, int64_t now)
{
  const struct fm_instance * instance = &evaluator->instance;
  instance->time->has_begun = true;
  instance->time->now = now;
  instance->time->before = now;
  for (uint32_t i = 0; i < evaluator->monitor->n_inputs; ++i) {
    const int64_t timeout = evaluator->inputs[i].timeout;
    instance->inputs[i].stored_at = now;
    instance->inputs[i].due = timeout > 0 ? fm_later(now, timeout) : FM_NEVER;
  }
  if (evaluator->period > 0) {
    instance->time->next_period = fm_later(now, evaluator->period);
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
    evaluator->is_exact = true;
  }
  return instance->time->has_begun ? evaluator->wake : INT64_MIN;
}

int64_t fm_evaluator_wake(const struct fm_evaluator * evaluator)
{
  return evaluator->wake;
}

int64_t fm_evaluator_now(const struct fm_evaluator * evaluator)
{
  return evaluator->instance.time->now;
}

void fm_evaluator_shift(struct fm_evaluator * evaluator, int64_t by)
{
  if (evaluator->instance.time->has_begun) {
    fm_instance_shift(&evaluator->instance, by);
    evaluator->wake = INT64_MIN;
    evaluator->is_exact = false;
  }
}

static void violate_readers(
  struct fm_evaluator * evaluator, uint32_t i, struct report * report)
{
  const struct input_cell * input = &evaluator->inputs[i];
  const struct fm_instance * instance = &evaluator->instance;
  const bool is_news = !instance->inputs[i].is_stale;
  instance->inputs[i].is_stale = true;
  for (uint32_t k = 0; k < input->n_readers; ++k) {
    struct fm_instance_group * group = &instance->groups[input->readers[k]];
    group->stale += is_news ? 1u : 0u;
    if (!group->knows_stale) {
      overrule(evaluator, input->readers[k]);
      judge_group(evaluator, input->readers[k], report);
    }
  }
}

// Whether messages of an input may be waiting whose timeout is found at `now`.
static bool is_doubtful(const struct fm_evaluator * evaluator, uint32_t i, int64_t now)
{
  return evaluator->patience > 0 &&
         since(evaluator->instance.inputs[i].due, now) > evaluator->patience &&
         since(evaluator->instance.time->before, now) > evaluator->inputs[i].timeout / 2;
}

static void take_timeout(
  struct fm_evaluator * evaluator, uint32_t i, int64_t now, struct report * report)
{
  struct input_cell * input = &evaluator->inputs[i];
  struct fm_instance_input * cell = &evaluator->instance.inputs[i];
  if (!cell->is_silent && !cell->is_put_off && is_doubtful(evaluator, i, now)) {
    const int64_t late = since(cell->due, now);
    const int64_t least = evaluator->patience > INT64_MAX / 10 ?
      INT64_MAX : 10 * evaluator->patience;
    const int64_t longer = late > least ? late : least;
    cell->is_put_off = true;
    set_due(evaluator, i, fm_later(now, longer < input->timeout ? longer : input->timeout));
    return;
  }
  if (!cell->is_silent) {
    report->stamp = fm_later(cell->stored_at, input->timeout);
  }
  input->silences += cell->is_silent ? 0u : 1u;
  cell->is_silent = true;
  set_due(evaluator, i, FM_NEVER);
  if (input->violates) {
    violate_readers(evaluator, i, report);
  }
}

// Leave out the first of more than FM_MOST_PERIODS_BEHIND due periods.
static void miss_periods(struct fm_evaluator * evaluator)
{
  struct fm_instance_time * time = evaluator->instance.time;
  if (time->next_period <= time->now && time->next_period != FM_NEVER) {
    const uint64_t period = (uint64_t)evaluator->period;
    const uint64_t due = ((uint64_t)time->now - (uint64_t)time->next_period) / period + 1;
    if (due > FM_MOST_PERIODS_BEHIND) {
      const uint64_t missed = due - FM_MOST_PERIODS_BEHIND;
      evaluator->counts.missed += missed;
      time->next_period = (int64_t)((uint64_t)time->next_period + missed * period);
      evaluator->is_exact = false;
    }
  }
}

static void take_period(struct fm_evaluator * evaluator, int64_t now, struct report * report)
{
  struct fm_instance_time * time = evaluator->instance.time;
  evaluator->counts.periods += 1;
  evaluator->counts.late += since(time->next_period, now) > evaluator->period / 2 ? 1u : 0u;
  time->next_period = fm_later(time->next_period, evaluator->period);
  evaluator->is_exact = false;
  step_ready_groups(evaluator, report);
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

uint32_t fm_evaluator_advance(
  struct fm_evaluator * evaluator, int64_t now, struct fm_violation * out)
{
  struct fm_instance_time * time = evaluator->instance.time;
  if (!time->has_begun) {
    begin_time(evaluator, now);
    return 0;
  }
  if (now < time->now) {
    evaluator->counts.restarts += 1;
    fm_evaluator_shift(evaluator, -since(now, time->now));
  }
  if (now != time->now) {
    time->before = time->now;
    time->now = now;
  }
  if (evaluator->wake > now) {
    return 0;
  }
  miss_periods(evaluator);
  const int64_t deadline = fm_evaluator_deadline(evaluator);
  struct report report = {out, deadline, 0};
  if (deadline <= now && deadline != FM_NEVER) {
    const uint32_t input = find_due(evaluator, deadline);
    if (input < evaluator->monitor->n_inputs) {
      take_timeout(evaluator, input, now, &report);
    } else {
      take_period(evaluator, now, &report);
    }
  }
  return report.n;
}

// ---- answers -----------------------------------------------------------------------------------

bool fm_evaluator_ready(const struct fm_evaluator * evaluator, uint32_t group)
{
  return group < evaluator->monitor->n_groups && evaluator->instance.groups[group].unset == 0;
}

uint64_t fm_evaluator_steps(const struct fm_evaluator * evaluator, uint32_t group)
{
  return group < evaluator->monitor->n_groups ? evaluator->instance.groups[group].steps : 0;
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

bool fm_evaluator_value(const struct fm_evaluator * evaluator, uint32_t input, void * out)
{
  if (input < evaluator->monitor->n_inputs) {
    const struct fm_input * from = &evaluator->monitor->inputs[input];
    memcpy(
      out, (const char *)evaluator->instance.values + from->offset,
      fm_instance_value_bytes((enum fm_type)from->type));
  }
  return fm_evaluator_has_value(evaluator, input);
}

bool fm_evaluator_is_stale(const struct fm_evaluator * evaluator, uint32_t input)
{
  return input < evaluator->monitor->n_inputs && evaluator->instance.inputs[input].is_stale;
}

struct fm_requirement_counts fm_evaluator_requirement_counts(
  const struct fm_evaluator * evaluator, uint32_t requirement)
{
  struct fm_requirement_counts counts = {0, 0, 0, true};
  if (requirement < evaluator->monitor->n_requirements) {
    const struct requirement_cell * cell = &evaluator->requirements[requirement];
    const uint32_t group = evaluator->monitor->requirements[requirement].group;
    counts.steps = evaluator->steps_before[group] + evaluator->instance.groups[group].steps;
    counts.violations = cell->violations;
    counts.announced = cell->announced;
    counts.verdict = evaluator->instance.verdicts[requirement];
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
  struct fm_silence silence = {0, 0, false};
  if (input < evaluator->monitor->n_inputs) {
    const struct fm_instance_input * cell = &evaluator->instance.inputs[input];
    silence.count = evaluator->inputs[input].silences;
    silence.is_silent = cell->is_silent;
    silence.lasted = !cell->is_silent ? evaluator->inputs[input].last_silence :
      since(cell->stored_at, evaluator->instance.time->now);
  }
  return silence;
}

struct fm_time_counts fm_evaluator_time_counts(const struct fm_evaluator * evaluator)
{
  return evaluator->counts;
}
