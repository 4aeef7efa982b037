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

/// tables.c: see tables.h. Makes an evaluator. Only `lay_out` computes the offsets.

#include "tables.h"

#include <string.h>

#define NO_TOPIC UINT32_MAX

// ---- layout ------------------------------------------------------------------------------------

// Offsets of the parts of the block, in bytes.
struct layout
{
  uint64_t inputs;
  uint64_t requirements;
  uint64_t nearest;
  uint64_t topics;
  uint64_t rates;
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

static bool is_aggregate(const struct fm_evaluator_options * options, uint32_t i)
{
  return i < options->monitor->n_inputs && options->sources != NULL &&
         options->sources[i] == FM_AGGREGATE;
}

// The groups that topics list because they set aggregates, at most.
static uint64_t count_aggregate_readers(const struct fm_evaluator_options * options)
{
  uint64_t count = 0;
  for (uint32_t t = 0; t < options->n_topics; ++t) {
    for (uint32_t k = 0; k < options->topics[t].n_inputs; ++k) {
      count +=
        is_aggregate(options, options->topics[t].inputs[k]) ? options->monitor->n_groups : 0;
    }
  }
  return count;
}

bool fm_is_measured(enum fm_source source)
{
  return source == FM_RATE || source == FM_PERIOD || source == FM_TIME;
}

static uint32_t room_of(const struct fm_evaluator_options * options, uint32_t i)
{
  return options->rooms == NULL ? 0u : options->rooms[i];
}

static uint64_t measure_words(const struct fm_evaluator_options * options, uint32_t i)
{
  const uint8_t source = options->sources == NULL ? (uint8_t)FM_FIELD : options->sources[i];
  return source == FM_RATE ? (uint64_t)FM_RATE_WORDS + room_of(options, i) :
         source == FM_PERIOD ? 1u : 0u;
}

uint64_t fm_measure_words(const struct fm_evaluator_options * options)
{
  uint64_t count = 0;
  for (uint32_t i = 0; i < options->monitor->n_inputs; ++i) {
    count += measure_words(options, i);
  }
  return count;
}

static struct layout lay_out(const struct fm_evaluator_options * options)
{
  const struct fm_monitor * monitor = options->monitor;
  const uint64_t readings = count_readings(monitor);
  const uint64_t without_inputs = count_groups_without_inputs(monitor);
  const uint64_t instance_bytes = fm_instance_bytes(monitor, fm_measure_words(options));
  struct layout layout = {0};
  layout.block.fits = instance_bytes > 0;
  (void)fm_block_append(&layout.block, 1, sizeof(struct fm_evaluator));
  layout.inputs = fm_block_append(&layout.block, monitor->n_inputs, sizeof(struct fm_input_cell));
  layout.requirements =
    fm_block_append(&layout.block, monitor->n_requirements, sizeof(struct fm_requirement_cell));
  layout.nearest =
    fm_block_append(&layout.block, monitor->n_requirements, sizeof(struct fm_nearest));
  layout.topics = fm_block_append(&layout.block, options->n_topics, sizeof(struct fm_topic_cell));
  layout.rates = fm_block_append(&layout.block, monitor->n_inputs, sizeof(uint32_t));
  layout.steps_before = fm_block_append(&layout.block, monitor->n_groups, sizeof(uint64_t));
  layout.readers = fm_block_append(&layout.block, readings, sizeof(uint32_t));
  // An input has at most one topic, so each input that a group reads puts the group on at most one
  // topic's list; an aggregate has any number. A group that reads no input is on all lists.
  layout.topic_groups = fm_block_append(&layout.block, readings, sizeof(uint32_t));
  (void)fm_block_append(&layout.block, without_inputs * options->n_topics, sizeof(uint32_t));
  (void)fm_block_append(&layout.block, count_aggregate_readers(options), sizeof(uint32_t));
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
  for (uint32_t i = 0; options->startups != NULL && i < options->monitor->n_inputs; ++i) {
    if (options->startups[i] < 0) {
      return false;
    }
  }
  return options->period >= 0 && options->patience >= 0;
}

static bool groups_can_step(const struct fm_evaluator_options * options)
{
  for (uint32_t g = 0; g < options->monitor->n_groups; ++g) {
    const struct fm_group * group = &options->monitor->groups[g];
    if (options->policy == FM_TIMED ? group->step_at == NULL : group->step == NULL) {
      return false;
    }
  }
  return true;
}

static bool reports_are_sound(const struct fm_evaluator_options * options)
{
  const struct fm_monitor * monitor = options->monitor;
  for (uint32_t r = 0; r < monitor->n_requirements; ++r) {
    if ((options->reports != NULL && options->reports[r] > FM_UNREPORTED) ||
      (monitor->occurrences != NULL && monitor->occurrences[r] >= fm_instance_verdicts(monitor)))
    {
      return false;
    }
  }
  return true;
}

static bool fits_source(uint8_t type, uint8_t source)
{
  switch ((enum fm_source)source) {
    case FM_FIELD:
    case FM_AGGREGATE:
      return true;
    case FM_RECEPTION:
      return type == FM_BOOL;
    case FM_AGE:
    case FM_RATE:
    case FM_PERIOD:
      return type == FM_FLOAT64;
    case FM_TIME:
      return type == FM_INT64;
  }
  return false;
}

static bool sources_are_sound(const struct fm_evaluator_options * options)
{
  for (uint32_t i = 0; options->sources != NULL && i < options->monitor->n_inputs; ++i) {
    const uint8_t source = options->sources[i];
    if (!fits_source(options->monitor->inputs[i].type, source) || (source == FM_RATE &&
      (room_of(options, i) == 0 || options->windows == NULL || options->windows[i] <= 0)))
    {
      return false;
    }
  }
  return true;
}

static bool options_are_sound(const struct fm_evaluator_options * options)
{
  const struct fm_monitor * monitor = options->monitor;
  return monitor != NULL && monitor->abi == FM_ABI && options->policy <= FM_TIMED &&
         inputs_are_sound(monitor) && groups_are_sound(monitor) && groups_can_step(options) &&
         reports_are_sound(options) && sources_are_sound(options) && times_are_sound(options) &&
         lay_out(options).block.fits;
}

// ---- making one --------------------------------------------------------------------------------

static void place_parts(
  struct fm_evaluator * evaluator, char * memory, const struct layout * layout)
{
  evaluator->inputs = (struct fm_input_cell *)(void *)(memory + layout->inputs);
  evaluator->requirements = (struct fm_requirement_cell *)(void *)(memory + layout->requirements);
  evaluator->nearest = (struct fm_nearest *)(void *)(memory + layout->nearest);
  evaluator->topics = (struct fm_topic_cell *)(void *)(memory + layout->topics);
  evaluator->rates = (uint32_t *)(void *)(memory + layout->rates);
  evaluator->steps_before = (uint64_t *)(void *)(memory + layout->steps_before);
  evaluator->instance = fm_instance_make(
    evaluator->monitor, evaluator->measure_words, memory + layout->instance);
}

static void make_inputs(
  struct fm_evaluator * evaluator, const struct fm_evaluator_options * options)
{
  for (uint32_t i = 0; i < evaluator->monitor->n_inputs; ++i) {
    struct fm_input_cell * input = &evaluator->inputs[i];
    input->topic = NO_TOPIC;
    input->timeout = options->timeouts == NULL ? 0 : options->timeouts[i];
    input->startup = options->startups == NULL || options->startups[i] == 0 ?
      input->timeout : options->startups[i];
    input->violates = options->violates != NULL && options->violates[i];
    input->source =
      options->sources == NULL ? FM_FIELD : (enum fm_source)options->sources[i];
    evaluator->n_receptions += input->source == FM_RECEPTION ? 1u : 0u;
  }
}

void fm_begin_measure(struct fm_evaluator * evaluator, uint32_t i)
{
  int64_t * words = evaluator->instance.measures + evaluator->inputs[i].place;
  if (evaluator->inputs[i].source == FM_PERIOD) {
    words[FM_LAST] = FM_NEVER;
  } else if (evaluator->inputs[i].source == FM_RATE) {
    words[FM_LAST] = FM_NEVER;
    words[FM_FULL_AT] = FM_NEVER;
    words[FM_LOST_UNTIL] = FM_NEVER;
    words[FM_CHANGES_AT] = FM_NEVER;
    words[FM_N_MESSAGES] = 0;
  }
}

static void make_measures(
  struct fm_evaluator * evaluator, const struct fm_evaluator_options * options)
{
  uint64_t place = 0;
  for (uint32_t i = 0; i < evaluator->monitor->n_inputs; ++i) {
    struct fm_input_cell * input = &evaluator->inputs[i];
    input->place = place;
    input->room = room_of(options, i);
    input->window = options->windows == NULL ? 0 : options->windows[i];
    place += measure_words(options, i);
    evaluator->has_measures = evaluator->has_measures || fm_is_measured(input->source);
    fm_begin_measure(evaluator, i);
    if (input->source == FM_RATE) {
      evaluator->rates[evaluator->n_rates] = i;
      evaluator->n_rates += 1;
    }
  }
}

static void make_requirements(struct fm_evaluator * evaluator, const uint8_t * reports)
{
  const uint32_t * occurrences = evaluator->monitor->occurrences;
  for (uint32_t r = 0; r < evaluator->monitor->n_requirements; ++r) {
    evaluator->requirements[r].report =
      reports == NULL ? FM_EVERY_STEP : (enum fm_report)reports[r];
    evaluator->requirements[r].occurrence = occurrences == NULL ? r : occurrences[r];
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
      struct fm_input_cell * input = &evaluator->inputs[monitor->groups[g].inputs[k]];
      input->readers[input->n_readers] = g;
      input->n_readers += 1;
    }
  }
}

// Assign the inputs to their topics, and reserve each topic's list of groups. Returns false if an
// index is out of range or an input, but for an aggregate, has two topics.
static bool make_topics(
  struct fm_evaluator * evaluator, const struct fm_topic * topics, uint32_t * pool)
{
  const uint32_t without_inputs = count_groups_without_inputs(evaluator->monitor);
  for (uint32_t t = 0; t < evaluator->n_topics; ++t) {
    evaluator->topics[t].groups = pool;
    pool += without_inputs;
    for (uint32_t k = 0; k < topics[t].n_inputs; ++k) {
      const uint32_t i = topics[t].inputs[k];
      if (i >= evaluator->monitor->n_inputs || (evaluator->inputs[i].topic != NO_TOPIC &&
        evaluator->inputs[i].source != FM_AGGREGATE))
      {
        return false;
      }
      evaluator->inputs[i].topic = t;
      evaluator->topics[t].tells_receptions =
        evaluator->topics[t].tells_receptions || evaluator->inputs[i].source == FM_RECEPTION;
      pool += evaluator->inputs[i].n_readers;
    }
  }
  return true;
}

static void add_group(struct fm_topic_cell * topic, uint32_t g)
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

static void add_group_to_topics_of(
  struct fm_evaluator * evaluator, const struct fm_topic * topics, uint32_t aggregate, uint32_t g)
{
  for (uint32_t t = 0; t < evaluator->n_topics; ++t) {
    for (uint32_t k = 0; k < topics[t].n_inputs; ++k) {
      if (topics[t].inputs[k] == aggregate) {
        add_group(&evaluator->topics[t], g);
      }
    }
  }
}

static void list_groups_of_topics(
  struct fm_evaluator * evaluator, const struct fm_topic * topics)
{
  for (uint32_t g = 0; g < evaluator->monitor->n_groups; ++g) {
    const struct fm_group * group = &evaluator->monitor->groups[g];
    if (group->n_inputs == 0) {
      add_group_to_all_topics(evaluator, g);
    }
    for (uint32_t k = 0; k < group->n_inputs; ++k) {
      const struct fm_input_cell * input = &evaluator->inputs[group->inputs[k]];
      const uint32_t t = input->topic;
      if (t != NO_TOPIC && input->source == FM_AGGREGATE) {
        add_group_to_topics_of(evaluator, topics, group->inputs[k], g);
      } else if (t != NO_TOPIC) {
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
  evaluator->tests = options->tests;
  evaluator->margins = options->margins;
  evaluator->n_topics = options->n_topics;
  evaluator->policy = (enum fm_policy)options->policy;
  evaluator->period = evaluator->policy == FM_PERIODIC ? options->period : 0;
  evaluator->patience = options->patience;
  evaluator->seen = INT64_MIN;
  evaluator->reports_recoveries = options->reports_recoveries;
  evaluator->wake = INT64_MIN;
  evaluator->measure_words = fm_measure_words(options);
  place_parts(evaluator, block, &layout);
  make_inputs(evaluator, options);
  make_measures(evaluator, options);
  make_requirements(evaluator, options->reports);
  list_readers(evaluator, readers);
  if (!make_topics(evaluator, options->topics, topic_groups)) {
    return NULL;
  }
  list_groups_of_topics(evaluator, options->topics);
  return evaluator;
}
