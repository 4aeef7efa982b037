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
/// drives each with random calls, and compares all that can be seen after each call. In the middle
/// it saves the instance, and makes the calls that follow three times: after the save, after the
/// instance was restored, and in a second evaluator to which it was restored.
///
/// The model is written from the rules of evaluator.h in the simplest way: it looks at every
/// group and every input each time, and remembers for each pair whether a value is new. It is slow
/// and shares no line with the evaluator. Exit status 0 if both agree.
///
/// Under FM_TIMED a group has a formula, O[0,w] of a condition on its inputs, whose deadlines the
/// evaluator learns from the group, and the model finds by looking at each tick.

#include "evaluator.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "draws.h"

enum { MAX_INPUTS = 6, MAX_GROUPS = 8, MAX_REQUIREMENTS = 12, MAX_TOPICS = 4 };
enum { MAX_MORE = 4, MAX_WINDOW = 20, MAX_PAST = 32 };
enum { CALLS = 200, CALLS_AGAIN = 40 };

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
static uint8_t reports[MAX_REQUIREMENTS];
static int64_t timeouts[MAX_INPUTS];
static int64_t startups[MAX_INPUTS];
static bool violates[MAX_INPUTS];
static uint8_t sources[MAX_INPUTS];
static uint32_t occurrences[MAX_REQUIREMENTS];
static int64_t windows[MAX_GROUPS];
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

// What a group's step writes: its verdicts, and those that occurrences are falls of.
static void write_verdicts(uint32_t g, uint64_t number, const void * values, bool * verdicts)
{
  for (uint32_t k = 0; k < groups[g].n_requirements; ++k) {
    const uint32_t r = groups[g].requirements[k];
    verdicts[r] = verdict_of(g, r, number, values);
    if (occurrences[r] != r) {
      verdicts[occurrences[r]] = verdict_of(g, occurrences[r], number, values);
    }
  }
}

// The state of a group: its steps; under FM_TIMED the tick until which its condition held.
struct state
{
  uint64_t steps;
  int64_t last;
  bool held;
};

static void step_of(uint32_t g, void * states, const void * values, bool * verdicts)
{
  struct state * state = (struct state *)states + g;
  write_verdicts(g, state->steps, values, verdicts);
  state->steps += 1;
}

static bool condition_of(uint32_t g, const unsigned char * values)
{
  return verdict_of(g, 1000, 0, values);
}

static int64_t step_at_of(
  uint32_t g, void * states, const void * values, bool * verdicts, int64_t tick)
{
  struct state * state = (struct state *)states + g;
  const bool holds = condition_of(g, values);
  state->last = holds ? tick : state->held ? tick - 1 : state->last;
  state->held = holds;
  const bool once = state->last >= 0 && tick - state->last <= windows[g];
  write_verdicts(g, once ? 1u : 0u, values, verdicts);
  return once && !holds ? state->last + windows[g] + 1 : FM_NEVER;
}

#define GROUP(g) \
  static void reset_ ## g(void * state) \
  { \
    const struct state first = {0, -1, false}; \
    ((struct state *)state)[g] = first; \
  } \
  static void step_ ## g(void * state, const void * values, bool * verdicts) \
  { \
    step_of((g), state, values, verdicts); \
  } \
  static int64_t step_at_ ## g( \
    void * state, const void * values, bool * verdicts, int64_t tick) \
  { \
    return step_at_of((g), state, values, verdicts, tick); \
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
static int64_t (* const STEPS_AT[])(void *, const void *, bool *, int64_t) = {
  step_at_0, step_at_1, step_at_2, step_at_3, step_at_4, step_at_5, step_at_6, step_at_7};

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
    sources[i] = FM_FIELD;
    if (random_below(4) == 0) {
      inputs[i].type = FM_BOOL;
      sources[i] = FM_RECEPTION;
    }
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
    groups[g].step_at = STEPS_AT[g];
    windows[g] = (int64_t)random_below(MAX_WINDOW);
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
    reports[r] = (uint8_t)random_below(FM_OCCURRENCE + 1);
    occurrences[r] = r;
  }
  monitor.n_more_verdicts = random_below(MAX_MORE + 1);
  for (uint32_t k = 0; k < monitor.n_more_verdicts && monitor.n_requirements > 0; ++k) {
    const uint32_t r = random_below(monitor.n_requirements);
    occurrences[r] = occurrences[r] == r ? monitor.n_requirements + k : occurrences[r];
  }
  monitor.occurrences = monitor.n_more_verdicts == 0 ? NULL : occurrences;
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

// Short times, so that several things often come at one instant.
static void make_times(void)
{
  for (uint32_t i = 0; i < MAX_INPUTS; ++i) {
    timeouts[i] = random_below(3) == 0 ? 0 : 1 + random_below(random_below(2) == 0 ? 12 : 60);
    startups[i] = random_below(3) == 0 ? 0 : 1 + random_below(60);
    violates[i] = random_below(3) != 0;
  }
  options.timeouts = random_below(8) == 0 ? NULL : timeouts;
  options.startups = random_below(4) == 0 ? NULL : startups;
  options.violates = random_below(8) == 0 ? NULL : violates;
  options.period = random_below(4) == 0 ? 0 : 1 + random_below(random_below(2) == 0 ? 6 : 40);
  options.patience = random_below(2) == 0 ? 0 : 1 + random_below(random_below(2) == 0 ? 4 : 20);
}

static void make_monitor(void)
{
  make_inputs();
  make_groups();
  make_requirements();
  make_topics();
  make_times();
  monitor.abi = FM_ABI;
  monitor.state_bytes = MAX_GROUPS * sizeof(struct state);
  monitor.inputs_bytes = 8 * monitor.n_inputs;
  monitor.inputs = inputs;
  monitor.groups = groups;
  monitor.requirements = requirements;
  monitor.step = random_below(2) == 0 ? step_all : NULL;
  options.monitor = &monitor;
  options.topics = topics;
  options.policy = random_below(3) == 0 ? FM_TIMED : random_below(FM_TIMED + 1);
  options.reports = reports;
  options.sources = random_below(8) == 0 ? NULL : sources;
  options.reports_recoveries = random_below(2) == 0;
}

// ---- the model ---------------------------------------------------------------------------------

// What a save copies.
struct instance
{
  unsigned char values[8 * MAX_INPUTS];
  bool has_value[MAX_INPUTS];
  bool has_come[MAX_INPUTS];  // a value that is not its initial one
  bool is_new[MAX_GROUPS][MAX_INPUTS];
  bool is_silent[MAX_INPUTS];
  bool was_put_off[MAX_INPUTS];  // its timeout, by patience, since its last value
  int64_t last_value[MAX_INPUTS];  // when; at first, when the time began
  int64_t due[MAX_INPUTS];  // FM_NEVER where nothing is
  bool is_overruled[MAX_GROUPS];  // its verdicts were set to false since an input became stale
  uint64_t steps[MAX_GROUPS];
  int64_t start[MAX_GROUPS];  // of the tick 0
  int64_t next[MAX_GROUPS];  // its deadline; FM_NEVER
  int64_t times[MAX_GROUPS][MAX_PAST];  // of its last evaluations, the last first
  bool held[MAX_GROUPS][MAX_PAST];  // its condition
  bool verdicts[MAX_REQUIREMENTS + MAX_MORE];
  bool compared[MAX_REQUIREMENTS];  // by its report, at its last step
  bool has_begun;  // the time
  int64_t now;
  int64_t before;  // the last time that was another than `now`
  int64_t next_period;
  int64_t clock;  // the latest time that was told
  int64_t taken;  // under FM_TIMED: the latest record or evaluation
  int64_t received;  // under FM_TIMED: receptions are of this instant
};

// What goes on when an instance is restored.
struct counters
{
  struct fm_requirement_counts requirements[MAX_REQUIREMENTS];
  struct fm_input_counts inputs[MAX_INPUTS];
  struct fm_topic_counts topics[MAX_TOPICS];
  uint64_t silences[MAX_INPUTS];
  uint32_t startups[MAX_INPUTS];
  int64_t lasted[MAX_INPUTS];  // the last silence that ended
  struct fm_time_counts time;
};

static struct instance model;
static struct counters counters;
static struct fm_violation expected[MAX_REQUIREMENTS];
static uint32_t n_expected;

static int64_t timeout_of(uint32_t i)
{
  const bool has_timeout = options.timeouts != NULL && timeouts[i] > 0;
  if (has_timeout && !model.has_come[i] && options.startups != NULL && startups[i] > 0) {
    return startups[i];
  }
  return has_timeout ? timeouts[i] : 0;
}

static bool is_stale(uint32_t i)
{
  return model.is_silent[i] && options.violates != NULL && violates[i];
}

static bool is_timed(void)
{
  return options.policy == FM_TIMED;
}

static bool is_reception(uint32_t i)
{
  return options.sources != NULL && sources[i] == FM_RECEPTION;
}

// No input says any more that a message came.
static void model_end_receptions(void)
{
  for (uint32_t i = 0; i < monitor.n_inputs; ++i) {
    if (is_reception(i)) {
      model.values[inputs[i].offset] = 0;
    }
  }
}

// Something happens at an instant.
static void model_reach(int64_t instant)
{
  if (is_timed() && model.has_begun && instant > model.received) {
    model_end_receptions();
    model.received = instant;
  }
}

static bool has_periods(void)
{
  return options.policy == FM_PERIODIC && options.period > 0;
}

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

static bool is_stale_group(uint32_t g)
{
  for (uint32_t i = 0; i < monitor.n_inputs; ++i) {
    if (reads(g, i) && is_stale(i)) {
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

// A group that is not ready takes no step that could set its verdicts to true again.
static void model_end_silence(uint32_t i, int64_t now)
{
  const bool was_stale = is_stale(i);
  if (model.is_silent[i]) {
    counters.lasted[i] = now > model.last_value[i] ? now - model.last_value[i] : 0;
  }
  model.is_silent[i] = false;
  for (uint32_t g = 0; g < monitor.n_groups; ++g) {
    if (was_stale && reads(g, i) && !is_stale_group(g)) {
      model.is_overruled[g] = false;
      for (uint32_t r = 0; r < monitor.n_requirements; ++r) {
        if (requirements[r].group == g && !is_ready(g)) {
          model.verdicts[r] = true;
          model.verdicts[occurrences[r]] = true;
        }
      }
    }
  }
}

// The timeout of an input runs from `now`.
static void model_begin_timeout(uint32_t i, int64_t now)
{
  model.last_value[i] = now;
  model.was_put_off[i] = false;
  model.due[i] = model.has_begun && timeout_of(i) > 0 ? now + timeout_of(i) : FM_NEVER;
}

static void model_receive(uint32_t i, int64_t now)
{
  bool lost = false;
  model.has_value[i] = true;
  model.has_come[i] = true;
  model_end_silence(i, now);
  model_begin_timeout(i, now);
  counters.inputs[i].received += 1;
  for (uint32_t g = 0; g < monitor.n_groups; ++g) {
    lost = lost || (reads(g, i) && model.is_new[g][i]);
    model.is_new[g][i] = true;
  }
  if (lost && options.policy == FM_ALL_INPUTS) {
    counters.inputs[i].overwritten += 1;
  }
}

static void model_judge(uint32_t r, uint64_t step, int64_t stamp)
{
  const bool before = model.compared[r];
  const bool now = model.verdicts[reports[r] == FM_OCCURRENCE ? occurrences[r] : r];
  const bool is_violation = !now && (before || reports[r] == FM_EVERY_STEP);
  model.compared[r] = now;
  counters.requirements[r].violations += !model.verdicts[r];
  counters.requirements[r].announced += is_violation;
  if (is_violation || (now && !before && options.reports_recoveries)) {
    expected[n_expected].requirement = r;
    expected[n_expected].step = step;
    expected[n_expected].stamp = stamp;
    expected[n_expected].is_recovery = now;
    n_expected += 1;
  }
}

// Set the verdicts of a requirement to what its formula says, or false.
static void model_decide(uint32_t g, uint32_t r, uint64_t number, bool is_overruled)
{
  model.verdicts[r] = verdict_of(g, r, number, model.values) && !is_overruled;
  if (occurrences[r] != r) {
    model.verdicts[occurrences[r]] =
      verdict_of(g, occurrences[r], number, model.values) && !is_overruled;
  }
}

// The number of a step, and what a violation has as its number.
static void model_evaluate(uint32_t g, uint64_t number, uint64_t shown, int64_t stamp)
{
  for (uint32_t r = 0; r < monitor.n_requirements; ++r) {
    if (requirements[r].group == g) {
      model_decide(g, r, number, is_stale_group(g));
      model_judge(r, shown, stamp);
      counters.requirements[r].steps += 1;
    }
  }
  model.is_overruled[g] = is_stale_group(g);
  model.steps[g] += 1;
  memset(model.is_new[g], 0, sizeof model.is_new[g]);
}

static void model_step(uint32_t g, int64_t stamp)
{
  model_evaluate(g, model.steps[g], model.steps[g], stamp);
}

// Whether the condition of a group held at an instant not before its last evaluation, or at most
// its window before. At instants between two evaluations it is what it was at the first.
static bool model_once(uint32_t g, int64_t instant)
{
  int64_t end = instant;
  for (uint32_t k = 0; k < MAX_PAST && k < model.steps[g]; ++k) {
    if (model.held[g][k] && end >= instant - windows[g]) {
      return true;
    }
    end = model.times[g][k] - 1;
  }
  return false;
}

// The first instant after an evaluation at which the group's formula changes, tick by tick.
static int64_t model_next(uint32_t g, int64_t instant)
{
  for (uint32_t k = 0; k < groups[g].n_inputs; ++k) {
    const uint32_t i = groups[g].inputs[k];
    if (is_reception(i) && model.values[inputs[i].offset] != 0) {
      return instant + 1;
    }
  }
  for (int64_t later = instant + 1; later <= instant + MAX_WINDOW + 1; ++later) {
    if (model_once(g, later) != model_once(g, instant)) {
      return later;
    }
  }
  return FM_NEVER;
}

static void model_step_at(uint32_t g, int64_t instant)
{
  if (model.steps[g] == 0) {
    model.start[g] = instant;
  }
  memmove(&model.times[g][1], &model.times[g][0], (MAX_PAST - 1) * sizeof model.times[g][0]);
  memmove(&model.held[g][1], &model.held[g][0], (MAX_PAST - 1) * sizeof model.held[g][0]);
  model.times[g][0] = instant;
  model.held[g][0] = condition_of(g, model.values);
  const uint64_t steps = model.steps[g];
  model.steps[g] += 1;  // for model_once
  const bool once = model_once(g, instant);
  model.next[g] = model_next(g, instant);
  model.steps[g] = steps;
  model_evaluate(g, once ? 1u : 0u, (uint64_t)(instant - model.start[g]), instant);
}

// A record takes effect.
static void model_take_record(int64_t now)
{
  model_reach(now);
  model.taken = now;
  model.now = now > model.now ? now : model.now;
  model.received = now;
}

static bool steps_with(uint32_t g, uint32_t topic)
{
  switch ((enum fm_policy)options.policy) {
    case FM_EVERY_MESSAGE:
      return is_ready(g);
    case FM_RELEVANT_MESSAGE:
      return is_ready(g) && reads_topic(g, topic);
    case FM_ALL_INPUTS:
      return is_renewed(g);
    case FM_PERIODIC:
    case FM_TIMED:
      return false;
  }
  return false;
}

// A group that cannot step is no longer violated once its inputs are not stale.
static void model_recover(uint32_t topic, int64_t now)
{
  for (uint32_t g = 0; g < monitor.n_groups; ++g) {
    for (uint32_t r = 0; r < monitor.n_requirements; ++r) {
      if (requirements[r].group == g && reads_topic(g, topic) && !is_ready(g) &&
        !is_stale_group(g))
      {
        model_judge(r, model.steps[g], now);
      }
    }
  }
}

static void model_message(uint32_t topic, int64_t now)
{
  n_expected = 0;
  if (topic >= options.n_topics) {
    return;
  }
  counters.topics[topic].messages += 1;
  model_recover(topic, now);
  if (is_timed() && model.has_begun) {
    model_take_record(now);
  }
  for (uint32_t g = 0; g < monitor.n_groups; ++g) {
    if (is_timed() && model.has_begun && groups[g].n_inputs > 0 && is_ready(g) &&
      reads_topic(g, topic))
    {
      model_step_at(g, now);
    } else if (steps_with(g, topic)) {
      model_step(g, now);
    }
  }
  if (!is_timed() && options.policy != FM_PERIODIC) {
    model_end_receptions();
  }
}

static void model_begin(int64_t now);

static void model_step_all(int64_t stamp)
{
  n_expected = 0;
  if (is_timed() && !model.has_begun) {
    model_begin(stamp);
  }
  if (is_timed()) {
    model_take_record(stamp);
  }
  for (uint32_t g = 0; g < monitor.n_groups; ++g) {
    if (is_ready(g) && is_timed()) {
      model_step_at(g, stamp);
    } else if (is_ready(g)) {
      model_step(g, stamp);
    }
  }
  if (!is_timed()) {
    model_end_receptions();
  }
}

// Under FM_TIMED: what is ready and has not begun begins now.
static void model_begin_groups(void)
{
  for (uint32_t g = 0; g < monitor.n_groups; ++g) {
    if (is_timed() && model.has_begun && is_ready(g) && model.steps[g] == 0 &&
      model.next[g] == FM_NEVER)
    {
      model.next[g] = model.now;
    }
  }
}

static void model_reset(void)
{
  memset(model.is_overruled, 0, sizeof model.is_overruled);
  memset(model.steps, 0, sizeof model.steps);
  memset(model.is_new, 0, sizeof model.is_new);
  for (uint32_t r = 0; r < MAX_REQUIREMENTS + MAX_MORE; ++r) {
    model.verdicts[r] = true;
  }
  for (uint32_t r = 0; r < MAX_REQUIREMENTS; ++r) {
    model.compared[r] = true;
  }
  for (uint32_t g = 0; g < MAX_GROUPS; ++g) {
    model.next[g] = FM_NEVER;
  }
  model_begin_groups();
  for (uint32_t i = 0; i < monitor.n_inputs; ++i) {
    model.due[i] = is_stale(i) ? model.now : model.due[i];
  }
}

// ---- the model of the time ---------------------------------------------------------------------

static int64_t model_deadline(void)
{
  int64_t first = has_periods() ? model.next_period : FM_NEVER;
  for (uint32_t i = 0; i < monitor.n_inputs; ++i) {
    first = model.due[i] < first ? model.due[i] : first;
  }
  for (uint32_t g = 0; g < monitor.n_groups; ++g) {
    first = model.next[g] < first ? model.next[g] : first;
  }
  return model.has_begun ? first : INT64_MIN;
}

static void model_begin(int64_t now)
{
  model.has_begun = true;
  model.now = now;
  model.before = now;
  model.next_period = now + options.period;
  model.clock = now;
  model.taken = INT64_MIN;
  model.received = now;
  model_begin_groups();
  for (uint32_t i = 0; i < monitor.n_inputs; ++i) {
    model_begin_timeout(i, now);
  }
}

static void model_shift(int64_t by)
{
  if (!model.has_begun) {
    return;
  }
  model.now += by;
  model.before += by;
  model.next_period += by;
  model.clock += by;
  model.taken += model.taken == INT64_MIN ? 0 : by;
  model.received += model.received == INT64_MIN ? 0 : by;
  for (uint32_t g = 0; g < monitor.n_groups; ++g) {
    model.start[g] += by;
    model.next[g] += model.next[g] == FM_NEVER ? 0 : by;
    for (uint32_t k = 0; k < MAX_PAST; ++k) {
      model.times[g][k] += by;
    }
  }
  for (uint32_t i = 0; i < monitor.n_inputs; ++i) {
    model.last_value[i] += by;
    model.due[i] += model.due[i] == FM_NEVER ? 0 : by;
  }
}

static void model_violate_readers(uint32_t i, int64_t stamp)
{
  for (uint32_t g = 0; g < monitor.n_groups; ++g) {
    for (uint32_t r = 0; r < monitor.n_requirements; ++r) {
      if (reads(g, i) && !model.is_overruled[g] && requirements[r].group == g) {
        const bool has_begun = is_timed() && model.steps[g] > 0;
        const int64_t tick = stamp > model.start[g] ? stamp - model.start[g] : 0;
        model.verdicts[r] = false;
        model.verdicts[occurrences[r]] = false;
        model_judge(r, has_begun ? (uint64_t)tick : model.steps[g], stamp);
      }
    }
    model.is_overruled[g] = model.is_overruled[g] || reads(g, i);
  }
}

// Whether a timeout that is found so late is put off.
static bool model_waits(uint32_t i, int64_t late)
{
  return options.patience > 0 && late > options.patience && !model.was_put_off[i] &&
         2 * (model.now - model.before) > timeout_of(i);
}

static void model_put_off(uint32_t i, int64_t late)
{
  int64_t by = late;
  by = by < 10 * options.patience ? 10 * options.patience : by;
  by = by > timeout_of(i) ? timeout_of(i) : by;
  model.was_put_off[i] = true;
  model.due[i] = model.now + by;
}

// After a reset an input is due that is silent already: no new silence, and not put off.
static void model_timeout(uint32_t i)
{
  int64_t instant = model.due[i];
  const int64_t late = model.now - instant;
  if (!model.is_silent[i]) {
    if (model_waits(i, late)) {
      model_put_off(i, late);
      return;
    }
    instant = model.last_value[i] + timeout_of(i);
    model.is_silent[i] = true;
    counters.silences[i] += 1;
    counters.startups[i] += model.has_come[i] ? 0u : 1u;
  }
  model.due[i] = FM_NEVER;
  if (is_stale(i)) {
    model_violate_readers(i, instant);
  }
}

static void model_miss_periods(void)
{
  while (has_periods() &&
    (model.now - model.next_period) / options.period >= FM_MOST_PERIODS_BEHIND)
  {
    model.next_period += options.period;
    counters.time.missed += 1;
  }
}

static void model_period(void)
{
  const int64_t instant = model.next_period;
  model.next_period += options.period;
  counters.time.periods += 1;
  counters.time.late += 2 * (model.now - instant) > options.period;
  model_step_all(instant);
}

static void model_groups_due(int64_t instant)
{
  model_reach(instant);
  model.taken = instant;
  for (uint32_t g = 0; g < monitor.n_groups; ++g) {
    if (model.next[g] == instant) {
      model_step_at(g, instant);
    }
  }
}

static void model_advance(int64_t now)
{
  n_expected = 0;
  if (!model.has_begun) {
    model_begin(now);
    return;
  }
  if (now < model.now && (!is_timed() || now < model.clock)) {
    counters.time.restarts += 1;
    model_shift(now - model.now);
    if (is_timed()) {
      model.clock = now;
      model.taken = INT64_MIN;
      model.received = INT64_MIN;
      model_reset();
    }
  }
  if (now > model.now) {
    model.before = model.now;
    model.now = now;
    model.clock = now > model.clock ? now : model.clock;
  }
  now = model.now;
  model_miss_periods();
  for (uint32_t i = 0; i < monitor.n_inputs && model_deadline() <= now; ++i) {
    if (model.due[i] == model_deadline()) {
      model_timeout(i);
      return;
    }
  }
  if (model_deadline() <= now && is_timed()) {
    model_groups_due(model_deadline());
  } else if (model_deadline() <= now) {
    model_period();
  }
}

static int64_t model_arrival(int64_t now)
{
  if (!is_timed() || !model.has_begun || now < model.clock) {
    return now;
  }
  model.clock = now;
  return now > model.taken ? now : model.taken + 1;
}

// ---- the comparison ----------------------------------------------------------------------------

#define AGREE(what, condition) do {if (!(condition)) {differ(what);}} while (0)

static void differ(const char * what)
{
  printf("the evaluator and the model differ in %s\n", what);
  exit(1);
}

// All that the calls so far have shown, in one number.
static uint64_t trail;

static void show(uint64_t seen)
{
  trail = (trail ^ seen) * 1099511628211u;
}

// `out` NULL: only their number.
static void compare_violations(const struct fm_violation * out, uint32_t n)
{
  AGREE("the number of violations", n == n_expected);
  show(n);
  for (uint32_t k = 0; out != NULL && k < n; ++k) {
    AGREE("the requirement of a violation", out[k].requirement == expected[k].requirement);
    AGREE("the step of a violation", out[k].step == expected[k].step);
    AGREE("the stamp of a violation", out[k].stamp == expected[k].stamp);
    AGREE("a recovery", out[k].is_recovery == expected[k].is_recovery);
    show(out[k].requirement);
    show(out[k].step);
    show((uint64_t)out[k].stamp);
  }
}

// Sometimes the deadline is not asked for: the evaluator may not depend on it.
static void compare_deadline(struct fm_evaluator * evaluator)
{
  AGREE("the wake", fm_evaluator_wake(evaluator) <= model_deadline());
  if (random_below(2) == 0) {
    const int64_t deadline = fm_evaluator_deadline(evaluator);
    AGREE("the deadline", deadline == model_deadline());
    AGREE("the wake after the deadline", fm_evaluator_wake(evaluator) == deadline);
    show((uint64_t)deadline);
  }
}

static void compare_time(const struct fm_evaluator * evaluator)
{
  const struct fm_time_counts counts = fm_evaluator_time_counts(evaluator);
  AGREE("the time", fm_evaluator_now(evaluator) == model.now);
  AGREE("periods", counts.periods == counters.time.periods);
  AGREE("late periods", counts.late == counters.time.late);
  AGREE("missed periods", counts.missed == counters.time.missed);
  AGREE("restarts", counts.restarts == counters.time.restarts);
}

static void compare_silences(const struct fm_evaluator * evaluator)
{
  for (uint32_t i = 0; i < monitor.n_inputs; ++i) {
    const struct fm_silence silence = fm_evaluator_silence(evaluator, i);
    const int64_t lasted =
      model.is_silent[i] ? model.now - model.last_value[i] : counters.lasted[i];
    AGREE("being silent", silence.is_silent == model.is_silent[i]);
    AGREE("the number of silences", silence.count == counters.silences[i]);
    AGREE("silences before the first value", silence.startups == counters.startups[i]);
    AGREE("how long a silence lasted", silence.lasted == lasted);
  }
}

static void compare_requirements(const struct fm_evaluator * evaluator)
{
  for (uint32_t r = 0; r < monitor.n_requirements; ++r) {
    const struct fm_requirement_counts counts = fm_evaluator_requirement_counts(evaluator, r);
    show(counts.verdict);
    AGREE("a verdict", fm_evaluator_verdicts(evaluator)[r] == model.verdicts[r]);
    AGREE("the verdict of the counts", counts.verdict == model.verdicts[r]);
    AGREE("steps", counts.steps == counters.requirements[r].steps);
    AGREE("violations", counts.violations == counters.requirements[r].violations);
    AGREE("announced", counts.announced == counters.requirements[r].announced);
  }
}

static void compare_inputs(const struct fm_evaluator * evaluator)
{
  const unsigned char * values = fm_evaluator_inputs(evaluator);
  for (uint32_t i = 0; i < monitor.n_inputs; ++i) {
    const struct fm_input_counts counts = fm_evaluator_input_counts(evaluator, i);
    AGREE("being stale", fm_evaluator_is_stale(evaluator, i) == is_stale(i));
    AGREE("having a value", fm_evaluator_has_value(evaluator, i) == model.has_value[i]);
    AGREE("received", counts.received == counters.inputs[i].received);
    AGREE("unusable", counts.unusable == counters.inputs[i].unusable);
    AGREE("overwritten", counts.overwritten == counters.inputs[i].overwritten);
  }
  for (uint32_t i = 0; i < monitor.n_inputs; ++i) {
    // What says that a message came may become false later than it is over.
    AGREE("values", is_reception(i) || memcmp(values + 8 * i, model.values + 8 * i, 8) == 0);
  }
}

static void compare_groups_and_topics(const struct fm_evaluator * evaluator)
{
  for (uint32_t g = 0; g < monitor.n_groups; ++g) {
    AGREE("ready", fm_evaluator_ready(evaluator, g) == is_ready(g));
    AGREE("the steps of a group", fm_evaluator_steps(evaluator, g) == model.steps[g]);
  }
  for (uint32_t t = 0; t < options.n_topics; ++t) {
    const struct fm_topic_counts counts = fm_evaluator_topic_counts(evaluator, t);
    AGREE("messages", counts.messages == counters.topics[t].messages);
    AGREE("undecodable", counts.undecodable == counters.topics[t].undecodable);
  }
}

static void compare(struct fm_evaluator * evaluator)
{
  compare_requirements(evaluator);
  compare_inputs(evaluator);
  compare_groups_and_topics(evaluator);
  compare_silences(evaluator);
  compare_time(evaluator);
  compare_deadline(evaluator);
}

// ---- random values -----------------------------------------------------------------------------

// The model has the value, too.
static union fm_value random_value(uint32_t i)
{
  union fm_value value = {.u = random_bits()};
  const bool as_float = inputs[i].type >= FM_FLOAT32;
  if (as_float) {
    value.f = (double)(int64_t)random_bits() / 1024.0;
  }
  model_write(i, value.u, as_float, value.f);
  return value;
}

// ---- random times ------------------------------------------------------------------------------

static int64_t last_time;  // of the calls, for the next

static int64_t begin_of_time(void)
{
  static const int64_t BEGINS[] = {0, -50, 1, INT64_C(1700000000000000000), -(INT64_C(1) << 50)};
  return BEGINS[random_below(5)];
}

// So late that as many periods are due as are taken after the fact, or some more.
static int64_t far_late(void)
{
  const int64_t behind = FM_MOST_PERIODS_BEHIND - 2 + (int64_t)random_below(4) +
    (random_below(4) == 0 ? 1000 : 0);
  return model.next_period + options.period * behind + random_below((uint32_t)options.period);
}

// Often at what is due or beside it, sometimes late, and sometimes the time goes back.
static int64_t random_time(void)
{
  const int64_t deadline = model_deadline();
  const bool is_due = deadline != FM_NEVER && deadline != INT64_MIN;
  const uint32_t what = random_below(20);
  if (is_due && what < 8) {
    last_time = deadline - 1 + (what < 5 ? 1 : what < 6 ? 0 : 2);
  } else if (is_due && what == 8) {
    last_time = deadline + random_below(100);
  } else if (what == 9 && random_below(4) == 0) {
    last_time -= random_below(random_below(2) == 0 ? 5 : 300);
  } else if (what == 10 && model.has_begun && has_periods() && random_below(100) == 0) {
    last_time = far_late();
  } else if (what > 11) {
    last_time += random_below(what > 17 ? 60 : 6);
  }
  return last_time;
}

// ---- random calls ------------------------------------------------------------------------------

static struct fm_violation out[MAX_REQUIREMENTS];

static struct fm_violation * place_or_null(void)
{
  return random_below(16) == 0 ? NULL : out;
}

static void advance(struct fm_evaluator * evaluator, int64_t now)
{
  struct fm_violation * place = place_or_null();
  const uint32_t n = fm_evaluator_advance(evaluator, now, place);
  model_advance(now);
  compare_violations(place, n);
  compare_deadline(evaluator);
}

// As a caller does that looks at the deadline, or one that looks at the wake alone: it may be
// early, but not again and again.
static bool looks_at_wake;

static void advance_all(struct fm_evaluator * evaluator, int64_t now)
{
  uint32_t n_early = 0;
  while (looks_at_wake ? fm_evaluator_wake(evaluator) <= now : model_deadline() <= now) {
    n_early += model_deadline() > now;
    AGREE("waking", n_early <= MAX_INPUTS);
    advance(evaluator, now);
  }
}

static void advance_before(struct fm_evaluator * evaluator, int64_t now)
{
  if (is_timed() && model.has_begun && model.now != now) {
    advance(evaluator, now - 1);
  }
  if (is_timed() ? model.has_begun && model.now != now : !model.has_begun || model.now != now) {
    advance_all(evaluator, now - 1);
  }
}

static void give_initial(struct fm_evaluator * evaluator, uint32_t i)
{
  model_reach(model.now);
  union fm_value value = random_value(i);
  if (is_reception(i)) {  // no message came
    value.i = 0;
    model.values[inputs[i].offset] = 0;
  }
  model.has_value[i] = true;
  model_begin_groups();
  // What lies in memory of the input's type is what the model has just written.
  random_below(2) == 0 ?
  fm_evaluator_initial_from(evaluator, i, &model.values[inputs[i].offset]) :
  fm_evaluator_initial(evaluator, i, value);
}

static void give_value(struct fm_evaluator * evaluator, uint32_t i, int64_t now)
{
  model_reach(now);
  const union fm_value value = random_value(i);
  model_receive(i, now);
  random_below(2) == 0 ?
  fm_evaluator_store_from(evaluator, i, &model.values[inputs[i].offset], now) :
  fm_evaluator_store(evaluator, i, value, now);
}

static int64_t arrive(struct fm_evaluator * evaluator, int64_t now)
{
  const int64_t arrival = fm_evaluator_arrival(evaluator, now);
  AGREE("the arrival", arrival == model_arrival(now));
  return arrival;
}

// A message in the order that evaluator.h prescribes: what is due before it, its fields, some of
// them unusable, then the message.
static void message(struct fm_evaluator * evaluator)
{
  const uint32_t t = random_below(options.n_topics + 1);
  if (is_timed() && t == options.n_topics) {
    return;  // of no topic nothing arrives
  }
  const int64_t now = arrive(evaluator, random_time());
  struct fm_violation * place = place_or_null();
  advance_before(evaluator, now);
  for (uint32_t k = 0; t < options.n_topics && k < topics[t].n_inputs; ++k) {
    if (random_below(8) == 0) {
      fm_evaluator_unusable(evaluator, topics[t].inputs[k]);
      counters.inputs[topics[t].inputs[k]].unusable += 1;
    } else {
      give_value(evaluator, topics[t].inputs[k], now);
    }
  }
  const uint32_t n = fm_evaluator_message(evaluator, t, now, place);
  model_message(t, now);
  compare_violations(place, n);
}

static void row(struct fm_evaluator * evaluator)
{
  const int64_t now = arrive(evaluator, random_time());
  struct fm_violation * place = place_or_null();
  advance_before(evaluator, now);
  for (uint32_t i = 0; i < monitor.n_inputs; ++i) {
    if (random_below(8) != 0) {
      give_value(evaluator, i, now);
    }
  }
  const uint32_t n = fm_evaluator_step(evaluator, now, place);
  model_step_all(now);
  compare_violations(place, n);
}

// Sometimes not all that is due is taken before the next call.
static void let_time_pass(struct fm_evaluator * evaluator)
{
  const int64_t now = random_time();
  advance(evaluator, now);
  if (is_timed() || random_below(4) != 0) {
    advance_all(evaluator, is_timed() ? model.now : now);
  }
}

static void shift(struct fm_evaluator * evaluator)
{
  const int64_t by = (int64_t)random_below(200) - 100 +
    ((int64_t)random_below(3) - 1) * (INT64_C(1) << 40) * (random_below(2) == 0 ? 1 : 0);
  last_time += by;
  fm_evaluator_shift(evaluator, by);
  model_shift(by);
}

static void undecodable(struct fm_evaluator * evaluator)
{
  const uint32_t t = random_below(options.n_topics + 1);
  fm_evaluator_undecodable(evaluator, t);
  if (t < options.n_topics) {
    counters.topics[t].undecodable += 1;
  }
}

static void other_call(struct fm_evaluator * evaluator)
{
  const uint32_t what = random_below(5);
  if (what < 2) {
    fm_evaluator_reset(evaluator);
    model_reset();
  } else if (what == 2) {
    shift(evaluator);
  } else if (what == 3) {
    undecodable(evaluator);
  } else if (monitor.n_inputs > 0) {
    give_initial(evaluator, random_below(monitor.n_inputs));
  }
}

static void random_calls(struct fm_evaluator * evaluator, int calls)
{
  for (int call = 0; call < calls; ++call) {
    const uint32_t what = random_below(12);
    if (what == 0) {
      other_call(evaluator);
    } else if (what < 5) {
      let_time_pass(evaluator);
    } else if (what == 5 || (options.policy == FM_PERIODIC && what < 8)) {
      row(evaluator);
    } else {
      message(evaluator);
    }
    compare(evaluator);
  }
}

// ---- save and restore --------------------------------------------------------------------------

struct saved
{
  struct instance model;
  int64_t last_time;
  uint64_t seed;
  char * memory;
  char * block;  // in it
};

static struct fm_evaluator * make_evaluator(void)
{
  void * memory = malloc((size_t)fm_evaluator_bytes(&options));
  struct fm_evaluator * evaluator = fm_evaluator_init(memory, &options);
  AGREE("accepting the monitor", evaluator != NULL);
  memset(&model, 0, sizeof model);
  memset(&counters, 0, sizeof counters);
  model.received = INT64_MIN;
  model_reset();
  for (uint32_t i = 0; i < MAX_INPUTS; ++i) {
    model.due[i] = FM_NEVER;
  }
  last_time = begin_of_time();
  return evaluator;
}

// The block ends where its memory ends, so that the address sanitizer sees a byte too far.
static struct saved save(const struct fm_evaluator * evaluator)
{
  struct saved saved = {model, last_time, seed, NULL, NULL};
  const size_t misaligned = random_below(8);
  saved.memory = malloc(misaligned + (size_t)fm_evaluator_instance_bytes(evaluator));
  saved.block = saved.memory + misaligned;
  saved.seed = seed;
  fm_evaluator_save(evaluator, saved.block);
  return saved;
}

static void restore(struct fm_evaluator * evaluator, const struct saved * saved)
{
  fm_evaluator_restore(evaluator, saved->block);
  model = saved->model;
  last_time = saved->last_time;
  seed = saved->seed;
  compare(evaluator);
  seed = saved->seed;
}

static uint64_t trail_of(struct fm_evaluator * evaluator)
{
  trail = 0;
  looks_at_wake = false;
  random_calls(evaluator, CALLS_AGAIN);
  return trail;
}

static void call_again(struct fm_evaluator * evaluator)
{
  const struct saved saved = save(evaluator);
  const uint64_t first = trail_of(evaluator);
  restore(evaluator, &saved);
  AGREE("the calls after a restore", trail_of(evaluator) == first);
  const struct instance after = model;
  const struct counters of_first = counters;
  const int64_t last_of_first = last_time;
  struct fm_evaluator * second = make_evaluator();
  random_calls(second, CALLS_AGAIN);
  restore(second, &saved);
  AGREE("the calls of a second evaluator", trail_of(second) == first);
  free(second);
  free(saved.memory);
  model = after;
  counters = of_first;
  last_time = last_of_first;
}

static void run(void)
{
  make_monitor();
  looks_at_wake = random_below(2) == 0;
  struct fm_evaluator * evaluator = make_evaluator();
  random_calls(evaluator, (int)random_below(CALLS));
  call_again(evaluator);
  random_calls(evaluator, CALLS / 2);
  free(evaluator);
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
  printf("%lu monitors\n", runs);
  return 0;
}
