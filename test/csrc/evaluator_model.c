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
/// The evaluator against a model of it: `evaluator_model SEED RUNS` makes RUNS random monitors,
/// drives each with random calls, and compares all that can be seen after each call.
///
/// The model is written from the rules of evaluator.h in the simplest way: it looks at every
/// group and every input each time, and remembers for each pair whether a value is new. It is slow
/// and shares no line with the evaluator. Exit status 0 if both agree.

#include "evaluator.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_INPUTS = 6, MAX_GROUPS = 8, MAX_REQUIREMENTS = 12, MAX_TOPICS = 4, CALLS = 300 };

static uint64_t seed = 1;

// Marsaglia's xorshift: the same numbers on every machine.
static uint32_t random_below(uint32_t limit)
{
  seed ^= seed << 13;
  seed ^= seed >> 7;
  seed ^= seed << 17;
  return (uint32_t)(seed >> 32) % limit;
}

static uint64_t random_bits(void)
{
  const uint64_t high = random_below(UINT32_MAX);
  return random_below(3) == 0 ? random_below(4) : (high << 32 | random_below(UINT32_MAX));
}

// ---- a random monitor --------------------------------------------------------------------------

static struct fm_input inputs[MAX_INPUTS];
static struct fm_group groups[MAX_GROUPS];
static struct fm_requirement requirements[MAX_REQUIREMENTS];
static struct fm_topic topics[MAX_TOPICS];
static struct fm_monitor monitor;
static struct fm_evaluator_options options;
static bool onset[MAX_REQUIREMENTS];
static uint32_t group_inputs[MAX_GROUPS][MAX_INPUTS];
static uint32_t group_requirements[MAX_GROUPS][MAX_REQUIREMENTS];
static uint32_t topic_inputs[MAX_TOPICS][MAX_INPUTS];
static uint32_t topic_of[MAX_INPUTS];

static uint32_t size_of(uint8_t type)
{
  static const uint32_t SIZES[] = {1, 1, 2, 4, 8, 1, 2, 4, 8, 4, 8};
  return SIZES[type];
}

// A verdict from all that a step may depend on: the inputs of the group, and its steps so far.
static bool verdict_of(
  uint32_t g, uint32_t requirement, uint64_t steps, const unsigned char * values)
{
  uint64_t mixed = 1469598103934665603u ^ steps ^ ((uint64_t)requirement << 20);
  for (uint32_t k = 0; k < groups[g].n_inputs; ++k) {
    const struct fm_input * input = &inputs[groups[g].inputs[k]];
    for (uint32_t b = 0; b < size_of(input->type); ++b) {
      mixed = (mixed ^ values[input->offset + b]) * 1099511628211u;
    }
  }
  return (mixed >> 40) % 3 != 0;
}

static void step_of(uint32_t g, void * state, const void * values, bool * verdicts)
{
  uint64_t steps;
  memcpy(&steps, (char *)state + g * sizeof steps, sizeof steps);
  for (uint32_t k = 0; k < groups[g].n_requirements; ++k) {
    verdicts[groups[g].requirements[k]] =
      verdict_of(g, groups[g].requirements[k], steps, values);
  }
  steps += 1;
  memcpy((char *)state + g * sizeof steps, &steps, sizeof steps);
}

#define GROUP(g) \
  static void reset_ ## g(void * state) \
  { \
    memset((char *)state + (g) * sizeof(uint64_t), 0, sizeof(uint64_t)); \
  } \
  static void step_ ## g(void * state, const void * values, bool * verdicts) \
  { \
    step_of((g), state, values, verdicts); \
  }
GROUP(0)
GROUP(1)
GROUP(2)
GROUP(3)
GROUP(4)
GROUP(5)
GROUP(6)
GROUP(7)
static void (* const RESETS[])(void *) = {
  reset_0, reset_1, reset_2, reset_3, reset_4, reset_5, reset_6, reset_7};
static void (* const STEPS[])(void *, const void *, bool *) = {
  step_0, step_1, step_2, step_3, step_4, step_5, step_6, step_7};

static void step_all(void * state, const void * values, bool * verdicts)
{
  for (uint32_t g = 0; g < monitor.n_groups; ++g) {
    step_of(g, state, values, verdicts);
  }
}

static void make_inputs(void)
{
  monitor.n_inputs = random_below(MAX_INPUTS + 1);
  for (uint32_t i = 0; i < monitor.n_inputs; ++i) {
    inputs[i].name = "";
    inputs[i].offset = 8 * i;
    inputs[i].type = (uint8_t)random_below(FM_FLOAT64 + 1);
  }
}

static void make_groups(void)
{
  memset(groups, 0, sizeof groups);
  monitor.n_groups = 1 + random_below(MAX_GROUPS);
  for (uint32_t g = 0; g < monitor.n_groups; ++g) {
    groups[g].inputs = group_inputs[g];
    groups[g].requirements = group_requirements[g];
    groups[g].reset = RESETS[g];
    groups[g].step = STEPS[g];
    for (uint32_t i = 0; i < monitor.n_inputs; ++i) {
      if (random_below(3) == 0) {
        group_inputs[g][groups[g].n_inputs++] = i;
      }
    }
  }
}

static void make_requirements(void)
{
  monitor.n_requirements = random_below(MAX_REQUIREMENTS + 1);
  for (uint32_t r = 0; r < monitor.n_requirements; ++r) {
    const uint32_t g = random_below(monitor.n_groups);
    requirements[r].id = "";
    requirements[r].group = g;
    group_requirements[g][groups[g].n_requirements++] = r;
    onset[r] = random_below(2) == 0;
  }
}

static void make_topics(void)
{
  memset(topics, 0, sizeof topics);
  options.n_topics = random_below(MAX_TOPICS + 1);
  for (uint32_t t = 0; t < options.n_topics; ++t) {
    topics[t].inputs = topic_inputs[t];
  }
  for (uint32_t i = 0; i < monitor.n_inputs; ++i) {
    const uint32_t t = random_below(MAX_TOPICS + 1);
    topic_of[i] = t;
    if (t < options.n_topics) {
      topic_inputs[t][topics[t].n_inputs++] = i;
    }
  }
}

static void make_monitor(void)
{
  make_inputs();
  make_groups();
  make_requirements();
  make_topics();
  monitor.abi = FM_ABI;
  monitor.state_bytes = MAX_GROUPS * sizeof(uint64_t);
  monitor.inputs_bytes = 8 * monitor.n_inputs;
  monitor.inputs = inputs;
  monitor.groups = groups;
  monitor.requirements = requirements;
  monitor.step = random_below(2) == 0 ? step_all : NULL;
  options.monitor = &monitor;
  options.topics = topics;
  options.policy = random_below(FM_PERIODIC + 1);
  options.report_onset = onset;
}

// ---- the model ---------------------------------------------------------------------------------

static struct
{
  unsigned char values[8 * MAX_INPUTS];
  bool has_value[MAX_INPUTS];
  bool is_new[MAX_GROUPS][MAX_INPUTS];
  bool is_stale[MAX_INPUTS];
  bool told[MAX_GROUPS];  // that one of its inputs is stale, since its last silence or a reset
  uint64_t steps[MAX_GROUPS];
  bool verdicts[MAX_REQUIREMENTS];
  struct fm_requirement_counts requirements[MAX_REQUIREMENTS];
  struct fm_input_counts inputs[MAX_INPUTS];
  struct fm_topic_counts topics[MAX_TOPICS];
  struct fm_violation out[MAX_REQUIREMENTS];
  uint32_t n_out;
} model;

static bool reads(uint32_t g, uint32_t input)
{
  for (uint32_t k = 0; k < groups[g].n_inputs; ++k) {
    if (groups[g].inputs[k] == input) {
      return true;
    }
  }
  return false;
}

static bool is_ready(uint32_t g)
{
  for (uint32_t i = 0; i < monitor.n_inputs; ++i) {
    if (reads(g, i) && !model.has_value[i]) {
      return false;
    }
  }
  return true;
}

static bool is_silenced(uint32_t g)
{
  for (uint32_t i = 0; i < monitor.n_inputs; ++i) {
    if (reads(g, i) && model.is_stale[i]) {
      return true;
    }
  }
  return false;
}

static bool is_renewed(uint32_t g)
{
  for (uint32_t i = 0; i < monitor.n_inputs; ++i) {
    if (reads(g, i) && !model.is_new[g][i]) {
      return false;
    }
  }
  return true;
}

static bool reads_topic(uint32_t g, uint32_t topic)
{
  for (uint32_t i = 0; i < monitor.n_inputs; ++i) {
    if (reads(g, i) && topic_of[i] == topic) {
      return true;
    }
  }
  return groups[g].n_inputs == 0;
}

// The bytes of an input, made of 64 bits in a way of its own: byte by byte.
static void model_write(uint32_t i, uint64_t bits, bool as_float, double number)
{
  unsigned char * place = &model.values[inputs[i].offset];
  const uint32_t size = size_of(inputs[i].type);
  const uint32_t probe = 1;
  const bool little_endian = *(const unsigned char *)&probe == 1;
  if (as_float) {
    const float single = (float)number;
    memcpy(place, size == 4 ? (const void *)&single : (const void *)&number, size);
    return;
  }
  if (inputs[i].type == FM_BOOL) {
    bits = bits != 0;
  }
  for (uint32_t b = 0; b < size; ++b) {
    place[little_endian ? b : size - 1 - b] = (unsigned char)(bits >> (8 * b) & 0xFFu);
  }
}

// What was false of silence alone, and will not be judged again for want of values, is true.
static void model_hear(uint32_t i)
{
  const bool was_stale = model.is_stale[i];
  model.is_stale[i] = false;
  for (uint32_t g = 0; g < monitor.n_groups; ++g) {
    if (was_stale && reads(g, i) && !is_silenced(g)) {
      model.told[g] = false;
      for (uint32_t r = 0; r < monitor.n_requirements; ++r) {
        if (requirements[r].group == g && !is_ready(g)) {
          model.verdicts[r] = true;
        }
      }
    }
  }
}

static void model_receive(uint32_t i)
{
  bool lost = false;
  model.has_value[i] = true;
  model_hear(i);
  model.inputs[i].received += 1;
  for (uint32_t g = 0; g < monitor.n_groups; ++g) {
    lost = lost || (reads(g, i) && model.is_new[g][i]);
    model.is_new[g][i] = true;
  }
  if (lost && options.policy == FM_ALL_INPUTS) {
    model.inputs[i].overwritten += 1;
  }
}

static void model_judge(uint32_t r, bool now, uint64_t step, int64_t stamp)
{
  const bool before = model.verdicts[r];
  model.verdicts[r] = now;
  model.requirements[r].violations += !now;
  if (!now && (before || !onset[r])) {
    model.requirements[r].announced += 1;
    model.out[model.n_out].requirement = r;
    model.out[model.n_out].step = step;
    model.out[model.n_out].stamp = stamp;
    model.n_out += 1;
  }
}

static void model_step(uint32_t g, int64_t stamp)
{
  for (uint32_t r = 0; r < monitor.n_requirements; ++r) {
    if (requirements[r].group == g) {
      const bool holds = verdict_of(g, r, model.steps[g], model.values);
      model_judge(r, holds && !is_silenced(g), model.steps[g], stamp);
      model.requirements[r].steps += 1;
    }
  }
  model.told[g] = is_silenced(g);
  model.steps[g] += 1;
  memset(model.is_new[g], 0, sizeof model.is_new[g]);
}

static bool is_due(uint32_t g, uint32_t topic)
{
  switch ((enum fm_policy)options.policy) {
    case FM_EVERY_MESSAGE:
      return is_ready(g);
    case FM_RELEVANT_MESSAGE:
      return is_ready(g) && reads_topic(g, topic);
    case FM_ALL_INPUTS:
      return is_renewed(g);
    case FM_PERIODIC:
      return false;
  }
  return false;
}

static void model_message(uint32_t topic, int64_t stamp)
{
  model.n_out = 0;
  if (topic >= options.n_topics) {
    return;
  }
  model.topics[topic].messages += 1;
  for (uint32_t g = 0; g < monitor.n_groups; ++g) {
    if (is_due(g, topic)) {
      model_step(g, stamp);
    }
  }
}

static void model_tick(int64_t stamp)
{
  model.n_out = 0;
  for (uint32_t g = 0; g < monitor.n_groups; ++g) {
    if (is_ready(g)) {
      model_step(g, stamp);
    }
  }
}

static void model_stale(uint32_t i, uint64_t received, int64_t stamp)
{
  model.n_out = 0;
  if (i >= monitor.n_inputs || received != model.inputs[i].received) {
    return;
  }
  model.is_stale[i] = true;
  for (uint32_t g = 0; g < monitor.n_groups; ++g) {
    for (uint32_t r = 0; r < monitor.n_requirements; ++r) {
      if (reads(g, i) && !model.told[g] && requirements[r].group == g) {
        model_judge(r, false, model.steps[g], stamp);
      }
    }
    model.told[g] = model.told[g] || reads(g, i);
  }
}

static void model_reset(void)
{
  memset(model.told, 0, sizeof model.told);
  memset(model.steps, 0, sizeof model.steps);
  memset(model.is_new, 0, sizeof model.is_new);
  for (uint32_t r = 0; r < MAX_REQUIREMENTS; ++r) {
    model.verdicts[r] = true;
  }
}

// ---- the comparison ----------------------------------------------------------------------------

#define AGREE(what, condition) do {if (!(condition)) {differ(what);}} while (0)

static void differ(const char * what)
{
  printf("the evaluator and the model differ in %s\n", what);
  exit(1);
}

static void compare_violations(const struct fm_violation * out, uint32_t n)
{
  AGREE("the number of violations", n == model.n_out);
  for (uint32_t k = 0; k < n; ++k) {
    AGREE("the requirement of a violation", out[k].requirement == model.out[k].requirement);
    AGREE("the step of a violation", out[k].step == model.out[k].step);
    AGREE("the stamp of a violation", out[k].stamp == model.out[k].stamp);
  }
}

static void compare_requirements(const struct fm_evaluator * evaluator)
{
  for (uint32_t r = 0; r < monitor.n_requirements; ++r) {
    const struct fm_requirement_counts counts = fm_evaluator_requirement_counts(evaluator, r);
    AGREE("a verdict", fm_evaluator_verdicts(evaluator)[r] == model.verdicts[r]);
    AGREE("the verdict of the counts", counts.verdict == model.verdicts[r]);
    AGREE("steps", counts.steps == model.requirements[r].steps);
    AGREE("violations", counts.violations == model.requirements[r].violations);
    AGREE("announced", counts.announced == model.requirements[r].announced);
  }
}

static void compare_inputs(const struct fm_evaluator * evaluator)
{
  const unsigned char * values = fm_evaluator_inputs(evaluator);
  for (uint32_t i = 0; i < monitor.n_inputs; ++i) {
    const struct fm_input_counts counts = fm_evaluator_input_counts(evaluator, i);
    AGREE("being stale", fm_evaluator_is_stale(evaluator, i) == model.is_stale[i]);
    AGREE("having a value", fm_evaluator_has_value(evaluator, i) == model.has_value[i]);
    AGREE("received", counts.received == model.inputs[i].received);
    AGREE("unusable", counts.unusable == model.inputs[i].unusable);
    AGREE("overwritten", counts.overwritten == model.inputs[i].overwritten);
  }
  AGREE("values", memcmp(values, model.values, 8 * monitor.n_inputs) == 0);
}

static void compare_groups_and_topics(const struct fm_evaluator * evaluator)
{
  for (uint32_t g = 0; g < monitor.n_groups; ++g) {
    AGREE("ready", fm_evaluator_ready(evaluator, g) == is_ready(g));
    AGREE("the steps of a group", fm_evaluator_steps(evaluator, g) == model.steps[g]);
  }
  for (uint32_t t = 0; t < options.n_topics; ++t) {
    const struct fm_topic_counts counts = fm_evaluator_topic_counts(evaluator, t);
    AGREE("messages", counts.messages == model.topics[t].messages);
    AGREE("undecodable", counts.undecodable == model.topics[t].undecodable);
  }
}

// ---- random calls ------------------------------------------------------------------------------

static void give_value(struct fm_evaluator * evaluator, uint32_t i, bool initial)
{
  union fm_value value = {.u = random_bits()};
  const bool as_float = inputs[i].type >= FM_FLOAT32;
  if (as_float) {
    value.f = (double)(int64_t)random_bits() / 1024.0;
  }
  model_write(i, value.u, as_float, value.f);
  const bool from_memory = random_below(2) == 0;
  // What lies in memory of the input's type is what the model has just written.
  const void * place = &model.values[inputs[i].offset];
  if (initial) {
    model.has_value[i] = true;
    from_memory ? fm_evaluator_initial_from(evaluator, i, place) :
    fm_evaluator_initial(evaluator, i, value);
  } else {
    model_receive(i);
    from_memory ? fm_evaluator_store_from(evaluator, i, place) :
    fm_evaluator_store(evaluator, i, value);
  }
}

// A message as the node sends it in: its fields, some of them unusable, then the news.
static void message(struct fm_evaluator * evaluator, struct fm_violation * out)
{
  const uint32_t t = random_below(options.n_topics + 1);
  const int64_t stamp = (int64_t)random_bits();
  for (uint32_t k = 0; t < options.n_topics && k < topics[t].n_inputs; ++k) {
    if (random_below(8) == 0) {
      fm_evaluator_unusable(evaluator, topics[t].inputs[k]);
      model.inputs[topics[t].inputs[k]].unusable += 1;
    } else {
      give_value(evaluator, topics[t].inputs[k], false);
    }
  }
  const uint32_t n = fm_evaluator_message(evaluator, t, stamp, out);
  model_message(t, stamp);
  compare_violations(out, n);
}

static void row(struct fm_evaluator * evaluator, struct fm_violation * out)
{
  const int64_t stamp = (int64_t)random_bits();
  for (uint32_t i = 0; i < monitor.n_inputs; ++i) {
    if (random_below(8) != 0) {
      give_value(evaluator, i, false);
    }
  }
  const uint32_t n = fm_evaluator_tick(evaluator, stamp, out);
  model_tick(stamp);
  compare_violations(out, n);
}

// Sometimes of an input that is none, or of one that has spoken since.
static void silence(struct fm_evaluator * evaluator, struct fm_violation * out)
{
  const uint32_t i = random_below(monitor.n_inputs + 1);
  const uint64_t received =
    fm_evaluator_input_counts(evaluator, i).received - (random_below(8) == 0 ? 1 : 0);
  const int64_t stamp = (int64_t)random_bits();
  const uint32_t n = fm_evaluator_stale(evaluator, i, received, stamp, out);
  model_stale(i, received, stamp);
  compare_violations(out, n);
}

static void other_call(struct fm_evaluator * evaluator)
{
  const uint32_t what = random_below(6);
  if (what == 0) {
    fm_evaluator_reset(evaluator);
    model_reset();
  } else if (what < 3 && options.n_topics > 0) {
    const uint32_t t = random_below(options.n_topics);
    fm_evaluator_undecodable(evaluator, t);
    model.topics[t].undecodable += 1;
  } else if (what == 3 && monitor.n_inputs > 0) {
    give_value(evaluator, random_below(monitor.n_inputs), true);
  }
}

static void run(void)
{
  make_monitor();
  memset(&model, 0, sizeof model);
  model_reset();
  const size_t room = monitor.n_requirements > 0 ? monitor.n_requirements : 1;
  struct fm_violation * out = malloc(room * sizeof *out);
  void * memory = malloc((size_t)fm_evaluator_bytes(&options));
  struct fm_evaluator * evaluator = fm_evaluator_init(memory, &options);
  AGREE("accepting the monitor", evaluator != NULL);
  for (int call = 0; call < CALLS; ++call) {
    const uint32_t what = random_below(12);
    if (what == 0) {
      other_call(evaluator);
    } else if (what == 2) {
      silence(evaluator, out);
    } else if (what == 1 || options.policy == FM_PERIODIC) {
      random_below(2) == 0 ? row(evaluator, out) : message(evaluator, out);
    } else {
      message(evaluator, out);
    }
    compare_requirements(evaluator);
    compare_inputs(evaluator);
    compare_groups_and_topics(evaluator);
  }
  free(memory);
  free(out);
}

int main(int argc, char ** argv)
{
  if (argc != 3) {
    return 2;
  }
  seed = 0x9E3779B97F4A7C15u * (strtoull(argv[1], NULL, 10) + 1);
  const unsigned long runs = strtoul(argv[2], NULL, 10);
  for (unsigned long k = 0; k < runs; ++k) {
    run();
  }
  printf("%lu monitors, %d calls each\n", runs, CALLS);
  return 0;
}
