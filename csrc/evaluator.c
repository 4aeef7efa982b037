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
/// One block of memory holds everything: a cell for each input, group, requirement and topic, two
/// pools of indices, the verdicts, and the module's inputs and state. Only `lay_out` computes
/// their offsets.
///
/// Each group counts the inputs it waits for, so that no call searches for them: `unset` counts
/// its inputs without a value, `awaited` those that were not received since its last step. A store
/// increments a clock; an input is new for a group if its `received_at` is later than the group's
/// `stepped_at`. This needs no flag for each pair of input and group.

#include "evaluator.h"

#include <string.h>

#define ALIGNMENT 16u
#define NO_TOPIC UINT32_MAX

struct input_cell
{
  void * place;          // in the module's struct of inputs
  uint32_t * readers;    // the groups that read it, ascending
  uint64_t received_at;  // the clock at its last store; 0 before the first
  struct fm_input_counts counts;
  uint32_t n_readers;
  uint32_t topic;
  enum fm_type type;
  bool has_value;
  bool stale;
};

struct group_cell
{
  uint64_t steps;         // since start or reset
  uint64_t steps_before;  // steps before the last reset
  uint64_t stepped_at;    // the clock at its last step or reset
  uint32_t unset;         // inputs without a value
  uint32_t awaited;       // inputs not received since stepped_at
  uint32_t stale;         // stale inputs
  bool knows_stale;       // its verdicts were set to false for them
};

struct requirement_cell
{
  uint64_t violations;
  uint64_t announced;
  bool onset;
  bool previous;  // the verdict of the step before; true before step 0
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
  struct input_cell * inputs;
  struct group_cell * groups;
  struct requirement_cell * requirements;
  struct topic_cell * topics;
  bool * verdicts;
  void * input_values;
  void * state;
  uint64_t clock;  // stores so far
  uint32_t n_topics;
  uint32_t n_waiting;  // groups that read an input without a value
  enum fm_policy policy;
};

// ---- layout ------------------------------------------------------------------------------------

// Offsets of the parts of the block, in bytes.
struct layout
{
  uint64_t inputs;
  uint64_t groups;
  uint64_t requirements;
  uint64_t topics;
  uint64_t readers;
  uint64_t topic_groups;
  uint64_t verdicts;
  uint64_t input_values;
  uint64_t state;
  uint64_t end;
  bool fits;  // in the address space; if not, the offsets are invalid
};

// Append `count` elements of `size` bytes to the layout. Returns their offset.
static uint64_t take(struct layout * layout, uint64_t count, uint64_t size)
{
  const uint64_t begin = layout->end;
  const uint64_t room = (uint64_t)PTRDIFF_MAX - ALIGNMENT - begin;
  if (!layout->fits || count > room / size) {
    layout->fits = false;
    return 0;
  }
  layout->end = (begin + count * size + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
  layout->fits = layout->end <= (uint64_t)PTRDIFF_MAX - ALIGNMENT;
  return begin;
}

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
  struct layout layout = {0};
  layout.fits = true;
  (void)take(&layout, 1, sizeof(struct fm_evaluator));
  layout.inputs = take(&layout, monitor->n_inputs, sizeof(struct input_cell));
  layout.groups = take(&layout, monitor->n_groups, sizeof(struct group_cell));
  layout.requirements = take(&layout, monitor->n_requirements, sizeof(struct requirement_cell));
  layout.topics = take(&layout, options->n_topics, sizeof(struct topic_cell));
  layout.verdicts = take(&layout, monitor->n_requirements, sizeof(bool));
  layout.input_values = take(&layout, monitor->inputs_bytes, 1);
  layout.state = take(&layout, monitor->state_bytes, 1);
  layout.readers = take(&layout, readings, sizeof(uint32_t));
  // An input has at most one topic, so each input that a group reads puts the group on at most one
  // topic's list. A group that reads no input is on the lists of all topics.
  layout.topic_groups = take(&layout, readings, sizeof(uint32_t));
  (void)take(&layout, without_inputs * options->n_topics, sizeof(uint32_t));
  return layout;
}

uint64_t fm_evaluator_bytes(const struct fm_evaluator_options * options)
{
  if (options->monitor == NULL || options->monitor->abi != FM_ABI) {
    return 0;
  }
  const struct layout layout = lay_out(options);
  return layout.fits ? layout.end : 0;
}

// ---- checks ------------------------------------------------------------------------------------

// Size of a stored value in bytes; 0 for an unknown type.
static uint32_t size_of(enum fm_type type)
{
  switch (type) {
    case FM_BOOL:
      return (uint32_t)sizeof(bool);
    case FM_INT8:
    case FM_UINT8:
      return 1;
    case FM_INT16:
    case FM_UINT16:
      return 2;
    case FM_INT32:
    case FM_UINT32:
    case FM_FLOAT32:
      return 4;
    case FM_INT64:
    case FM_UINT64:
    case FM_FLOAT64:
      return 8;
  }
  return 0;
}

static bool inputs_are_sound(const struct fm_monitor * monitor)
{
  for (uint32_t i = 0; i < monitor->n_inputs; ++i) {
    const struct fm_input * input = &monitor->inputs[i];
    const uint32_t size = size_of((enum fm_type)input->type);
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

static bool options_are_sound(const struct fm_evaluator_options * options)
{
  const struct fm_monitor * monitor = options->monitor;
  return monitor != NULL && monitor->abi == FM_ABI && options->policy <= FM_PERIODIC &&
         inputs_are_sound(monitor) && groups_are_sound(monitor) && lay_out(options).fits;
}

// ---- making one --------------------------------------------------------------------------------

static void place_parts(
  struct fm_evaluator * evaluator, char * memory, const struct layout * layout)
{
  evaluator->inputs = (struct input_cell *)(void *)(memory + layout->inputs);
  evaluator->groups = (struct group_cell *)(void *)(memory + layout->groups);
  evaluator->requirements = (struct requirement_cell *)(void *)(memory + layout->requirements);
  evaluator->topics = (struct topic_cell *)(void *)(memory + layout->topics);
  evaluator->verdicts = (bool *)(void *)(memory + layout->verdicts);
  evaluator->input_values = memory + layout->input_values;
  evaluator->state = memory + layout->state;
}

static void make_inputs(struct fm_evaluator * evaluator)
{
  const struct fm_monitor * monitor = evaluator->monitor;
  for (uint32_t i = 0; i < monitor->n_inputs; ++i) {
    struct input_cell * input = &evaluator->inputs[i];
    input->place = (char *)evaluator->input_values + monitor->inputs[i].offset;
    input->type = (enum fm_type)monitor->inputs[i].type;
    input->topic = NO_TOPIC;
  }
}

static void make_requirements(struct fm_evaluator * evaluator, const bool * report_onset)
{
  for (uint32_t r = 0; r < evaluator->monitor->n_requirements; ++r) {
    evaluator->requirements[r].onset = report_onset != NULL && report_onset[r];
  }
}

static void count_readers(struct fm_evaluator * evaluator)
{
  const struct fm_monitor * monitor = evaluator->monitor;
  for (uint32_t g = 0; g < monitor->n_groups; ++g) {
    evaluator->groups[g].unset = monitor->groups[g].n_inputs;
    evaluator->n_waiting += monitor->groups[g].n_inputs > 0 ? 1u : 0u;
    for (uint32_t k = 0; k < monitor->groups[g].n_inputs; ++k) {
      evaluator->inputs[monitor->groups[g].inputs[k]].n_readers += 1;
    }
  }
}

// Build each input's list of the groups that read it. Groups are visited in order, so that each
// list is ascending.
static void list_readers(struct fm_evaluator * evaluator, uint32_t * pool)
{
  const struct fm_monitor * monitor = evaluator->monitor;
  count_readers(evaluator);
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
  memset(memory, 0, (size_t)layout.end);
  evaluator->monitor = options->monitor;
  evaluator->n_topics = options->n_topics;
  evaluator->policy = (enum fm_policy)options->policy;
  place_parts(evaluator, block, &layout);
  make_inputs(evaluator);
  make_requirements(evaluator, options->report_onset);
  list_readers(evaluator, readers);
  if (!make_topics(evaluator, options->topics, topic_groups)) {
    return NULL;
  }
  list_groups_of_topics(evaluator);
  fm_evaluator_reset(evaluator);
  return evaluator;
}

// ---- values ------------------------------------------------------------------------------------

// Signed integers are stored as unsigned ones of the same size: conversion to unsigned wraps by
// definition, and intN_t is two's complement. memcpy, because the type of the module's struct is
// not known here.
static void write_value(void * place, enum fm_type type, union fm_value value)
{
  const bool truth = value.i != 0;
  const uint8_t low8 = (uint8_t)value.u;
  const uint16_t low16 = (uint16_t)value.u;
  const uint32_t low32 = (uint32_t)value.u;
  switch (type) {
    case FM_BOOL:
      memcpy(place, &truth, sizeof truth);
      break;
    case FM_INT8:
    case FM_UINT8:
      memcpy(place, &low8, sizeof low8);
      break;
    case FM_INT16:
    case FM_UINT16:
      memcpy(place, &low16, sizeof low16);
      break;
    case FM_INT32:
    case FM_UINT32:
      memcpy(place, &low32, sizeof low32);
      break;
    case FM_FLOAT32: {
        const float single = (float)value.f;
        memcpy(place, &single, sizeof single);
        break;
      }
    case FM_INT64:
    case FM_UINT64:
    case FM_FLOAT64:
      memcpy(place, &value, sizeof value);
      break;
  }
}

// As write_value, from an object of the input's type. A bool is read as a byte and normalised: to
// read a bool whose byte is neither 0 nor 1 is undefined behaviour.
static void copy_value(void * place, enum fm_type type, const void * from)
{
  if (type == FM_BOOL) {
    const bool truth = *(const unsigned char *)from != 0;
    memcpy(place, &truth, sizeof truth);
  } else {
    memcpy(place, from, size_of(type));
  }
}

// Note that an input has a value. With its first one, its readers wait for one input less.
static void note_value(struct fm_evaluator * evaluator, struct input_cell * input)
{
  if (!input->has_value) {
    input->has_value = true;
    for (uint32_t k = 0; k < input->n_readers; ++k) {
      struct group_cell * group = &evaluator->groups[input->readers[k]];
      group->unset -= 1;
      evaluator->n_waiting -= group->unset == 0 ? 1u : 0u;
    }
  }
}

// Mark the input as received for each reader. Counts the value before as overwritten if some
// reader took no step on it.
static void renew(struct fm_evaluator * evaluator, struct input_cell * input)
{
  bool missed = false;
  for (uint32_t k = 0; k < input->n_readers; ++k) {
    struct group_cell * group = &evaluator->groups[input->readers[k]];
    if (input->received_at > group->stepped_at) {
      missed = true;
    } else {
      group->awaited -= 1;
    }
  }
  input->counts.overwritten += missed ? 1u : 0u;
  evaluator->clock += 1;
  input->received_at = evaluator->clock;
}

// Called when the last stale input of a group was stored. A group that is not ready cannot step,
// so that its verdicts are set to true here.
static void end_timeout(struct fm_evaluator * evaluator, uint32_t g)
{
  const struct fm_group * group = &evaluator->monitor->groups[g];
  evaluator->groups[g].knows_stale = false;
  for (uint32_t k = 0; evaluator->groups[g].unset > 0 && k < group->n_requirements; ++k) {
    evaluator->requirements[group->requirements[k]].previous = true;
    evaluator->verdicts[group->requirements[k]] = true;
  }
}

static void end_staleness(struct fm_evaluator * evaluator, struct input_cell * input)
{
  input->stale = false;
  for (uint32_t k = 0; k < input->n_readers; ++k) {
    struct group_cell * group = &evaluator->groups[input->readers[k]];
    group->stale -= 1;
    if (group->stale == 0) {
      end_timeout(evaluator, input->readers[k]);
    }
  }
}

static void note_receipt(struct fm_evaluator * evaluator, struct input_cell * input)
{
  note_value(evaluator, input);
  if (input->stale) {
    end_staleness(evaluator, input);
  }
  input->counts.received += 1;
  if (evaluator->policy == FM_ALL_INPUTS) {
    renew(evaluator, input);
  }
}

void fm_evaluator_store(struct fm_evaluator * evaluator, uint32_t input, union fm_value value)
{
  if (input < evaluator->monitor->n_inputs) {
    struct input_cell * cell = &evaluator->inputs[input];
    write_value(cell->place, cell->type, value);
    note_receipt(evaluator, cell);
  }
}

void fm_evaluator_store_from(
  struct fm_evaluator * evaluator, uint32_t input, const void * value)
{
  if (input < evaluator->monitor->n_inputs) {
    struct input_cell * cell = &evaluator->inputs[input];
    copy_value(cell->place, cell->type, value);
    note_receipt(evaluator, cell);
  }
}

void fm_evaluator_initial(struct fm_evaluator * evaluator, uint32_t input, union fm_value value)
{
  if (input < evaluator->monitor->n_inputs) {
    struct input_cell * cell = &evaluator->inputs[input];
    write_value(cell->place, cell->type, value);
    note_value(evaluator, cell);
  }
}

void fm_evaluator_initial_from(
  struct fm_evaluator * evaluator, uint32_t input, const void * value)
{
  if (input < evaluator->monitor->n_inputs) {
    struct input_cell * cell = &evaluator->inputs[input];
    copy_value(cell->place, cell->type, value);
    note_value(evaluator, cell);
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
  const bool verdict = evaluator->verdicts[requirement];
  if (!verdict) {
    cell->violations += 1;
    if (cell->previous || !cell->onset) {
      cell->announced += 1;
      announce(report, requirement, step);
    }
  }
  cell->previous = verdict;
}

static void judge_group(struct fm_evaluator * evaluator, uint32_t g, struct report * report)
{
  const struct fm_group * group = &evaluator->monitor->groups[g];
  for (uint32_t k = 0; k < group->n_requirements; ++k) {
    judge(evaluator, group->requirements[k], evaluator->groups[g].steps, report);
  }
}

// Set the verdicts of a stale group to false: its formulas were evaluated on old values.
static void overrule(struct fm_evaluator * evaluator, uint32_t g)
{
  const struct fm_group * group = &evaluator->monitor->groups[g];
  for (uint32_t k = 0; k < group->n_requirements; ++k) {
    evaluator->verdicts[group->requirements[k]] = false;
  }
  evaluator->groups[g].knows_stale = true;
}

// Judge the verdicts of a group's step, and count the step.
static void account(struct fm_evaluator * evaluator, uint32_t g, struct report * report)
{
  const struct fm_group * group = &evaluator->monitor->groups[g];
  struct group_cell * cell = &evaluator->groups[g];
  if (cell->stale > 0) {
    overrule(evaluator, g);
  }
  judge_group(evaluator, g, report);
  cell->steps += 1;
  cell->stepped_at = evaluator->clock;
  cell->awaited = group->n_inputs;
}

static void step_group(struct fm_evaluator * evaluator, uint32_t g, struct report * report)
{
  evaluator->monitor->groups[g].step(
    evaluator->state, evaluator->input_values, evaluator->verdicts);
  account(evaluator, g, report);
}

static void step_all_groups(struct fm_evaluator * evaluator, struct report * report)
{
  evaluator->monitor->step(evaluator->state, evaluator->input_values, evaluator->verdicts);
  for (uint32_t g = 0; g < evaluator->monitor->n_groups; ++g) {
    account(evaluator, g, report);
  }
}

static void step_ready_groups(struct fm_evaluator * evaluator, struct report * report)
{
  if (evaluator->n_waiting == 0 && evaluator->monitor->step != NULL) {
    step_all_groups(evaluator, report);
    return;
  }
  for (uint32_t g = 0; g < evaluator->monitor->n_groups; ++g) {
    if (evaluator->groups[g].unset == 0) {
      step_group(evaluator, g, report);
    }
  }
}

static void step_ready_groups_of(
  struct fm_evaluator * evaluator, const struct topic_cell * topic, struct report * report)
{
  for (uint32_t k = 0; k < topic->n_groups; ++k) {
    if (evaluator->groups[topic->groups[k]].unset == 0) {
      step_group(evaluator, topic->groups[k], report);
    }
  }
}

static void step_complete_groups_of(
  struct fm_evaluator * evaluator, const struct topic_cell * topic, struct report * report)
{
  for (uint32_t k = 0; k < topic->n_groups; ++k) {
    if (evaluator->groups[topic->groups[k]].awaited == 0) {
      step_group(evaluator, topic->groups[k], report);
    }
  }
}

uint32_t fm_evaluator_message(
  struct fm_evaluator * evaluator, uint32_t topic, int64_t stamp, struct fm_violation * out)
{
  struct report report = {out, stamp, 0};
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

static void mark_stale(struct fm_evaluator * evaluator, struct input_cell * input)
{
  if (!input->stale) {
    input->stale = true;
    for (uint32_t k = 0; k < input->n_readers; ++k) {
      evaluator->groups[input->readers[k]].stale += 1;
    }
  }
}

uint32_t fm_evaluator_stale(
  struct fm_evaluator * evaluator, uint32_t input, uint64_t received, int64_t stamp,
  struct fm_violation * out)
{
  struct report report = {out, stamp, 0};
  if (input >= evaluator->monitor->n_inputs ||
    evaluator->inputs[input].counts.received != received)
  {
    return 0;
  }
  struct input_cell * cell = &evaluator->inputs[input];
  mark_stale(evaluator, cell);
  for (uint32_t k = 0; k < cell->n_readers; ++k) {
    if (!evaluator->groups[cell->readers[k]].knows_stale) {
      overrule(evaluator, cell->readers[k]);
      judge_group(evaluator, cell->readers[k], &report);
    }
  }
  return report.n;
}

uint32_t fm_evaluator_tick(
  struct fm_evaluator * evaluator, int64_t stamp, struct fm_violation * out)
{
  struct report report = {out, stamp, 0};
  step_ready_groups(evaluator, &report);
  return report.n;
}

static void store_row(
  struct fm_evaluator * evaluator, const void * const * columns, uint64_t row)
{
  for (uint32_t i = 0; i < evaluator->monitor->n_inputs; ++i) {
    if (columns[i] != NULL) {
      const char * column = columns[i];
      fm_evaluator_store_from(
        evaluator, i, column + (size_t)row * size_of(evaluator->inputs[i].type));
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
    announced += fm_evaluator_tick(evaluator, 0, NULL);
    if (verdicts != NULL && n_requirements > 0) {
      memcpy(verdicts, evaluator->verdicts, n_requirements * sizeof(bool));
      verdicts += n_requirements;
    }
  }
  return announced;
}

static void reset_group(struct fm_evaluator * evaluator, uint32_t g)
{
  struct group_cell * cell = &evaluator->groups[g];
  evaluator->monitor->groups[g].reset(evaluator->state);
  cell->steps_before += cell->steps;
  cell->steps = 0;
  cell->stepped_at = evaluator->clock;
  cell->awaited = evaluator->monitor->groups[g].n_inputs;
  cell->knows_stale = false;
}

void fm_evaluator_reset(struct fm_evaluator * evaluator)
{
  for (uint32_t g = 0; g < evaluator->monitor->n_groups; ++g) {
    reset_group(evaluator, g);
  }
  for (uint32_t r = 0; r < evaluator->monitor->n_requirements; ++r) {
    evaluator->requirements[r].previous = true;
    evaluator->verdicts[r] = true;
  }
}

// ---- answers -----------------------------------------------------------------------------------

bool fm_evaluator_ready(const struct fm_evaluator * evaluator, uint32_t group)
{
  return group < evaluator->monitor->n_groups && evaluator->groups[group].unset == 0;
}

uint64_t fm_evaluator_steps(const struct fm_evaluator * evaluator, uint32_t group)
{
  return group < evaluator->monitor->n_groups ? evaluator->groups[group].steps : 0;
}

const bool * fm_evaluator_verdicts(const struct fm_evaluator * evaluator)
{
  return evaluator->verdicts;
}

const void * fm_evaluator_inputs(const struct fm_evaluator * evaluator)
{
  return evaluator->input_values;
}

bool fm_evaluator_has_value(const struct fm_evaluator * evaluator, uint32_t input)
{
  return input < evaluator->monitor->n_inputs && evaluator->inputs[input].has_value;
}

bool fm_evaluator_value(const struct fm_evaluator * evaluator, uint32_t input, void * out)
{
  if (input < evaluator->monitor->n_inputs) {
    memcpy(out, evaluator->inputs[input].place, size_of(evaluator->inputs[input].type));
  }
  return fm_evaluator_has_value(evaluator, input);
}

bool fm_evaluator_is_stale(const struct fm_evaluator * evaluator, uint32_t input)
{
  return input < evaluator->monitor->n_inputs && evaluator->inputs[input].stale;
}

struct fm_requirement_counts fm_evaluator_requirement_counts(
  const struct fm_evaluator * evaluator, uint32_t requirement)
{
  struct fm_requirement_counts counts = {0, 0, 0, true};
  if (requirement < evaluator->monitor->n_requirements) {
    const struct requirement_cell * cell = &evaluator->requirements[requirement];
    const struct group_cell * group =
      &evaluator->groups[evaluator->monitor->requirements[requirement].group];
    counts.steps = group->steps_before + group->steps;
    counts.violations = cell->violations;
    counts.announced = cell->announced;
    counts.verdict = evaluator->verdicts[requirement];
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
