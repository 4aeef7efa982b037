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

/// Instances with keys against plain evaluators: `scopes_model SEED RUNS` makes RUNS random pairs
/// of monitors, one for the bundle's scope and one for a kind of instances, and drives them with
/// random messages, keys and times.
///
/// For each instance there is a plain evaluator of the kind's monitor. It is given what the
/// instance's key concerns, as if the key were written in place of the variable: after each call,
/// both agree in verdicts, steps, values and violations. One more plain evaluator follows the
/// shared inputs alone; where an instance begins, its evaluator begins as a copy of that, reset.
/// Each aggregate is compared with one that is computed anew over all instances. Exit status 0 if
/// all agree.

#include "scopes_parts.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "draws.h"
#include "due.h"
#include "steps.h"

enum { MAX_INPUTS = 6, MAX_GROUPS = 4, MAX_REQUIREMENTS = 8, N_TOPICS = 5, N_OUTPUTS = 2 };
enum { N_KEYS = 7, MOST = 4, MAX_WINDOW = 20, CALLS = 300, MAX_FOUND = 4000, N_AGGREGATES = 8 };
enum { BUNDLE, KIND };

static long run_number = 0;

static void expect(bool condition, const char * text, int line)
{
  if (!condition) {
    printf("run %ld, line %d: not so: %s\n", run_number, line, text);
    exit(1);
  }
}

#define EXPECT(condition) expect((condition), #condition, __LINE__)

// ---- two random monitors -----------------------------------------------------------------------

struct group_state
{
  uint64_t steps;
  int64_t last;     // under FM_TIMED: the tick until which the condition held
  int64_t outputs[N_OUTPUTS];
  bool held;
};

struct random_monitor
{
  struct fm_monitor monitor;
  struct fm_evaluator_options options;
  struct fm_input inputs[MAX_INPUTS + N_AGGREGATES];
  struct fm_group groups[MAX_GROUPS];
  struct fm_requirement requirements[MAX_REQUIREMENTS];
  struct fm_topic topics[N_TOPICS];
  uint8_t reports[MAX_REQUIREMENTS];
  int64_t timeouts[MAX_INPUTS + N_AGGREGATES];
  int64_t startups[MAX_INPUTS + N_AGGREGATES];
  bool violates[MAX_INPUTS + N_AGGREGATES];
  uint8_t sources[MAX_INPUTS + N_AGGREGATES];
  uint32_t group_inputs[MAX_GROUPS][MAX_INPUTS + N_AGGREGATES];
  uint32_t group_requirements[MAX_GROUPS][MAX_REQUIREMENTS];
  uint32_t topic_inputs[N_TOPICS][MAX_INPUTS];
  uint32_t topic_of[MAX_INPUTS];
  int64_t windows[MAX_GROUPS];
};

static struct random_monitor monitors[2];

static uint32_t size_of(uint8_t type)
{
  static const uint32_t SIZES[] = {1, 1, 2, 4, 8, 1, 2, 4, 8, 4, 8};
  return SIZES[type];
}

static uint64_t mix_inputs(uint32_t m, uint32_t g, const void * values, uint64_t mixed)
{
  const struct random_monitor * of = &monitors[m];
  for (uint32_t k = 0; k < of->groups[g].n_inputs; ++k) {
    const struct fm_input * input = &of->inputs[of->groups[g].inputs[k]];
    for (uint32_t b = 0; b < size_of(input->type); ++b) {
      mixed = (mixed ^ ((const unsigned char *)values)[input->offset + b]) * 1099511628211u;
    }
  }
  return mixed;
}

static bool verdict_of(uint32_t m, uint32_t g, uint32_t r, uint64_t steps, const void * values)
{
  const uint64_t first = UINT64_C(1469598103934665603) ^ steps ^ ((uint64_t)r << 20);
  return (mix_inputs(m, g, values, first) >> 40) % 3 != 0;
}

// Numbers that are often equal, and some that are not finite.
static double number_of(uint64_t bits)
{
  static const double NUMBERS[] = {0.0, -0.0, 1.0, 1e300, -1e300, 3.5, 1e-300, 0.1};
  return bits % 97 == 0 ? NAN : bits % 89 == 0 ? INFINITY : NUMBERS[bits % 8];
}

static void write_values(
  uint32_t m, uint32_t g, struct group_state * state, uint64_t number, const void * values,
  bool * verdicts)
{
  for (uint32_t k = 0; k < monitors[m].groups[g].n_requirements; ++k) {
    const uint32_t r = monitors[m].groups[g].requirements[k];
    verdicts[r] = verdict_of(m, g, r, number, values);
  }
  const uint64_t mixed = mix_inputs(m, g, values, number + 7) >> 33;
  const double real = number_of(mixed);
  state->outputs[0] = (int64_t)(mixed % 100) - 50;
  memcpy(&state->outputs[1], &real, sizeof real);
}

static void step_of(uint32_t m, uint32_t g, void * states, const void * values, bool * verdicts)
{
  struct group_state * state = (struct group_state *)states + g;
  write_values(m, g, state, state->steps, values, verdicts);
  state->steps += 1;
}

static int64_t step_at_of(
  uint32_t m, uint32_t g, void * states, const void * values, bool * verdicts, int64_t tick)
{
  struct group_state * state = (struct group_state *)states + g;
  const bool holds = verdict_of(m, g, 1000, 0, values);
  state->last = holds ? tick : state->held ? tick - 1 : state->last;
  state->held = holds;
  const bool once = state->last >= 0 && tick - state->last <= monitors[m].windows[g];
  write_values(m, g, state, once ? 1u : 0u, values, verdicts);
  return once && !holds ? state->last + monitors[m].windows[g] + 1 : FM_NEVER;
}

#define GROUP(m, g) \
  static void reset_ ## m ## g(void * state) \
  { \
    const struct group_state first = {0, -1, {0, 0}, false}; \
    ((struct group_state *)state)[g] = first; \
  } \
  static void step_ ## m ## g(void * state, const void * values, bool * verdicts) \
  { \
    step_of(m, g, state, values, verdicts); \
  } \
  static int64_t step_at_ ## m ## g( \
    void * state, const void * values, bool * verdicts, int64_t tick) \
  { \
    return step_at_of(m, g, state, values, verdicts, tick); \
  }
GROUP(0, 0)
GROUP(0, 1)
GROUP(0, 2)
GROUP(0, 3)
GROUP(1, 0)
GROUP(1, 1)
GROUP(1, 2)
GROUP(1, 3)
static void (* const RESETS[2][MAX_GROUPS])(void *) = {
  {reset_00, reset_01, reset_02, reset_03}, {reset_10, reset_11, reset_12, reset_13}};
static void (* const STEPS[2][MAX_GROUPS])(void *, const void *, bool *) = {
  {step_00, step_01, step_02, step_03}, {step_10, step_11, step_12, step_13}};
static int64_t (* const STEPS_AT[2][MAX_GROUPS])(void *, const void *, bool *, int64_t) = {
  {step_at_00, step_at_01, step_at_02, step_at_03},
  {step_at_10, step_at_11, step_at_12, step_at_13}};

static void make_groups(struct random_monitor * of, uint32_t m)
{
  memset(of->groups, 0, sizeof of->groups);
  of->monitor.n_groups = 1 + random_below(MAX_GROUPS);
  for (uint32_t g = 0; g < of->monitor.n_groups; ++g) {
    of->groups[g].inputs = of->group_inputs[g];
    of->groups[g].requirements = of->group_requirements[g];
    of->groups[g].reset = RESETS[m][g];
    of->groups[g].step = STEPS[m][g];
    of->groups[g].step_at = STEPS_AT[m][g];
    of->windows[g] = (int64_t)random_below(MAX_WINDOW);
    for (uint32_t i = 0; i < of->monitor.n_inputs; ++i) {
      if (random_below(3) == 0) {
        of->group_inputs[g][of->groups[g].n_inputs++] = i;
      }
    }
  }
}

static void make_requirements(struct random_monitor * of)
{
  of->monitor.n_requirements = 1 + random_below(MAX_REQUIREMENTS);
  for (uint32_t r = 0; r < of->monitor.n_requirements; ++r) {
    const uint32_t g = random_below(of->monitor.n_groups);
    of->requirements[r].id = "";
    of->requirements[r].group = g;
    of->group_requirements[g][of->groups[g].n_requirements++] = r;
    of->reports[r] = (uint8_t)random_below(FM_OCCURRENCE + 1);
  }
}

static void finish_monitor(struct random_monitor * of, uint32_t policy)
{
  of->monitor.abi = FM_ABI;
  of->monitor.state_bytes = MAX_GROUPS * sizeof(struct group_state);
  of->monitor.inputs_bytes = 8 * of->monitor.n_inputs;
  of->monitor.inputs = of->inputs;
  of->monitor.groups = of->groups;
  of->monitor.requirements = of->requirements;
  of->options.monitor = &of->monitor;
  of->options.topics = of->topics;
  of->options.n_topics = N_TOPICS;
  of->options.policy = policy;
  of->options.reports = of->reports;
  of->options.timeouts = of->timeouts;
  of->options.startups = of->startups;
  of->options.violates = of->violates;
  of->options.sources = of->sources;
}

// ---- the bundle --------------------------------------------------------------------------------

// Topics 0 and 1 have shared inputs, 2 and 3 inputs with a key, 4 both.
static bool is_shared_topic(uint32_t t) {return t < 2 || t == 4;}
static bool is_keyed_topic(uint32_t t) {return t >= 2;}

static struct fm_kind kind;
static struct fm_scopes_options options;
static struct fm_aggregate aggregates[N_AGGREGATES];
static uint32_t shared[MAX_INPUTS];
static uint8_t concerns[N_TOPICS];
static struct fm_output outputs[N_OUTPUTS];
static struct fm_outputs all_outputs;
static struct fm_key listed[MOST];
static bool has_ties;     // messages of one time

static uint8_t KEYS[N_KEYS][FM_MOST_KEY_BYTES];
static const uint32_t SIZES[N_KEYS] = {1, 2, 5, 18, 19, 255, 0};

static void make_keys(void)
{
  for (uint32_t k = 0; k < N_KEYS; ++k) {
    for (uint32_t b = 0; b < SIZES[k]; ++b) {
      KEYS[k][b] = (uint8_t)(random_below(4) == 0 ? 0xff : random_below(256));
    }
  }
}

static void make_topics(struct random_monitor * of)
{
  memset(of->topics, 0, sizeof of->topics);
  for (uint32_t t = 0; t < N_TOPICS; ++t) {
    of->topics[t].inputs = of->topic_inputs[t];
  }
}

static void put_on_topic(struct random_monitor * of, uint32_t input, uint32_t t)
{
  of->topic_of[input] = t;
  of->topic_inputs[t][of->topics[t].n_inputs++] = input;
}

static uint32_t n_shared;    // inputs of the bundle's scope that are no aggregates

static void make_bundle_inputs(bool has_times)
{
  struct random_monitor * of = &monitors[BUNDLE];
  n_shared = 1 + random_below(MAX_INPUTS - 1);
  of->monitor.n_inputs = n_shared;
  make_topics(of);
  for (uint32_t i = 0; i < n_shared; ++i) {
    static const uint32_t TOPICS[] = {0, 1, 4};
    const bool is_reception = random_below(5) == 0;
    of->inputs[i].name = "";
    of->inputs[i].offset = 8 * i;
    of->inputs[i].type = is_reception ? FM_BOOL : (uint8_t)random_below(FM_FLOAT64 + 1);
    of->sources[i] = is_reception ? FM_RECEPTION : FM_FIELD;
    of->timeouts[i] = !has_times || random_below(3) == 0 ? 0 : 1 + random_below(60);
    of->startups[i] = random_below(3) == 0 ? 0 : 1 + random_below(60);
    of->violates[i] = random_below(3) != 0;
    put_on_topic(of, i, TOPICS[random_below(3)]);
  }
}

// The kind has copies of some shared inputs, and inputs of its own.
static void make_kind_inputs(bool has_times)
{
  struct random_monitor * of = &monitors[KIND];
  const struct random_monitor * bundle = &monitors[BUNDLE];
  make_topics(of);
  of->monitor.n_inputs = 1 + random_below(MAX_INPUTS);
  uint32_t next = 0;
  for (uint32_t i = 0; i < of->monitor.n_inputs; ++i) {
    const bool is_reception = random_below(5) == 0;
    of->inputs[i].name = "";
    of->inputs[i].offset = 8 * i;
    next += random_below(2);
    shared[i] = UINT32_MAX;
    if (next < n_shared && random_below(2) == 0) {
      shared[i] = next;
      of->inputs[i].type = bundle->inputs[next].type;
      of->sources[i] = bundle->sources[next];
      of->timeouts[i] = bundle->timeouts[next];
      of->startups[i] = bundle->startups[next];
      of->violates[i] = bundle->violates[next];
      put_on_topic(of, i, bundle->topic_of[next]);
      next += 1;
      continue;
    }
    of->inputs[i].type = is_reception ? FM_BOOL : (uint8_t)random_below(FM_FLOAT64 + 1);
    of->sources[i] = is_reception ? FM_RECEPTION : FM_FIELD;
    of->timeouts[i] = !has_times || random_below(3) == 0 ? 0 : 1 + random_below(60);
    of->startups[i] = random_below(3) == 0 ? 0 : 1 + random_below(60);
    of->violates[i] = random_below(3) != 0;
    put_on_topic(of, i, 2 + random_below(3));
  }
}

static void add_aggregate(uint32_t operation, uint32_t operand, uint8_t type)
{
  struct random_monitor * bundle = &monitors[BUNDLE];
  const uint32_t i = bundle->monitor.n_inputs;
  const struct fm_aggregate added = {0, operation, operand, i};
  bundle->inputs[i].name = "";
  bundle->inputs[i].offset = 8 * i;
  bundle->inputs[i].type = type;
  bundle->sources[i] = FM_AGGREGATE;
  bundle->timeouts[i] = 0;
  bundle->startups[i] = 0;
  bundle->violates[i] = false;
  bundle->monitor.n_inputs += 1;
  aggregates[options.n_aggregates] = added;
  options.n_aggregates += 1;
}

static void make_aggregates(void)
{
  struct random_monitor * of = &monitors[KIND];
  const uint32_t r = random_below(of->monitor.n_requirements);
  options.n_aggregates = 0;
  if (random_below(4) == 0) {
    return;
  }
  of->reports[r] = FM_UNREPORTED;
  add_aggregate(FM_COUNT_OF, r, FM_INT64);
  add_aggregate(FM_ANY_OF, r, FM_BOOL);
  add_aggregate(FM_ALL_OF, r, FM_BOOL);
  add_aggregate(FM_MIN_OF, 0, FM_INT64);
  add_aggregate(FM_MAX_OF, 1, FM_FLOAT64);
  add_aggregate(FM_MIN_OF, 1, FM_FLOAT64);
  add_aggregate(FM_SUM_OF, 0, FM_INT64);
  add_aggregate(FM_SUM_OF, 1, FM_FLOAT64);
}

static void make_outputs(void)
{
  for (uint32_t n = 0; n < N_OUTPUTS; ++n) {
    const uint32_t g = random_below(monitors[KIND].monitor.n_groups);
    outputs[n].group = g;
    outputs[n].offset = g * sizeof(struct group_state) + offsetof(struct group_state, outputs) +
      n * sizeof(int64_t);
    outputs[n].type = n == 0 ? FM_INT64 : FM_FLOAT64;
  }
  all_outputs.outputs = outputs;
  all_outputs.n_outputs = N_OUTPUTS;
}

static void make_kind(void)
{
  kind.options = &monitors[KIND].options;
  kind.outputs = &all_outputs;
  kind.concerns = concerns;
  kind.shared = shared;
  kind.most = MOST;
  kind.forget = random_below(2) == 0 ? 0 : 1 + random_below(80);
  kind.n_listed = kind.forget == 0 && random_below(2) == 0 ? random_below(MOST + 1) : 0;
  kind.listed = listed;
  for (uint32_t n = 0; n < kind.n_listed; ++n) {
    listed[n].bytes = KEYS[n];
    listed[n].size = SIZES[n];
  }
  for (uint32_t t = 0; t < N_TOPICS; ++t) {
    concerns[t] = (uint8_t)(
      (is_shared_topic(t) ? FM_CONCERNS_ALL : 0) | (is_keyed_topic(t) ? FM_CONCERNS_KEY : 0));
  }
}

static void make_bundle(void)
{
  const uint32_t policy = random_below(3) == 0 ? FM_TIMED : random_below(FM_TIMED + 1);
  const int64_t period = policy == FM_PERIODIC ? 1 + random_below(30) : 0;
  const bool has_times = random_below(2) == 0;
  // With them the bundle's scope may be 1 ns ahead, and where an instance begins it has from there
  // since when a shared input is silent.
  has_ties = policy != FM_TIMED || !has_times;
  make_keys();
  make_bundle_inputs(has_times);
  make_kind_inputs(has_times);
  make_groups(&monitors[KIND], KIND);
  make_requirements(&monitors[KIND]);
  make_outputs();
  make_aggregates();
  make_groups(&monitors[BUNDLE], BUNDLE);
  make_requirements(&monitors[BUNDLE]);
  make_kind();
  for (uint32_t m = 0; m < 2; ++m) {
    finish_monitor(&monitors[m], policy);
    monitors[m].options.period = period;
    monitors[m].options.reports_recoveries = m == 0 || random_below(2) == 0;
    // An evaluator that is to end is told less of the time than the scopes.
    monitors[m].options.patience = kind.forget > 0 || random_below(2) == 0 ? 0 : 10;
  }
  monitors[BUNDLE].options.patience = monitors[KIND].options.patience;
}

// ---- the plain evaluators ----------------------------------------------------------------------

struct found
{
  struct fm_violation violations[MAX_FOUND];
  uint32_t n;
};

struct plain
{
  struct fm_evaluator * evaluator;
  void * memory;
  struct found expected;
  struct found found;
  int64_t last;      // message of its key
  bool is_alive;
};

static struct fm_scopes * scopes;
static struct plain plains[N_KEYS];
static struct plain follower;   // of the shared inputs alone
static int64_t now;

static void add_violations(struct found * to, const struct fm_violation * from, uint32_t n)
{
  EXPECT(to->n + n <= MAX_FOUND);
  if (n > 0) {
    memcpy(to->violations + to->n, from, n * sizeof(*from));
  }
  to->n += n;
}

static void make_plain(struct plain * plain)
{
  const struct fm_evaluator_options * of = &monitors[KIND].options;
  plain->memory = malloc((size_t)fm_evaluator_bytes(of));
  EXPECT(plain->memory != NULL);
  plain->evaluator = fm_evaluator_init(plain->memory, of);
  EXPECT(plain->evaluator != NULL);
  plain->expected.n = 0;
  plain->found.n = 0;
}

static void end_plain(struct plain * plain)
{
  free(plain->memory);
  plain->memory = NULL;
  plain->is_alive = false;
}

// An evaluator that is ahead of the clock notes its time only when a message comes.
static bool reach_plain(const struct plain * plain, int64_t time)
{
  const bool had_begun = fm_reach(plain->evaluator, time);
  (void)fm_evaluator_arrival(plain->evaluator, time);
  return had_begun;
}

static void take_due(struct plain * plain, int64_t last)
{
  struct fm_violation out[MAX_REQUIREMENTS];
  const uint32_t n = fm_take_first_due(plain->evaluator, last, out);
  add_violations(&plain->expected, out, n);
}

static void take_one(struct plain * plain, int64_t time, bool stands)
{
  // As fm_evaluator_advance, but for what is due at an instant to which messages of one time have
  // moved this evaluator alone: that is taken later, with the same stamp.
  if (reach_plain(plain, time)) {
    take_due(plain, stands ? time - 1 : time);
  }
}

// The startup of an input with a key begins with the instance; none of the follower times out.
static void begin_keyed(struct fm_evaluator * evaluator, int64_t time, bool times_out)
{
  for (uint32_t i = 0; i < evaluator->monitor->n_inputs; ++i) {
    const struct fm_input_cell * input = &evaluator->inputs[i];
    const int64_t limit = input->timeout > 0 ? input->startup : 0;
    if (shared[i] == UINT32_MAX) {
      evaluator->instance.inputs[i].stored_at = time;
      evaluator->instance.inputs[i].due =
        limit > 0 && times_out ? fm_later(time, limit) : FM_NEVER;
    }
  }
  fm_forget_deadline(evaluator);
}

static void advance_plain(struct plain * plain, int64_t time, bool stands)
{
  const int64_t last = stands ? time - 1 : time;
  if (plain == &follower && !fm_evaluator_has_begun(plain->evaluator)) {
    take_one(plain, time, stands);
    begin_keyed(plain->evaluator, time, false);
  }
  do {
    take_one(plain, time, stands);
  } while (fm_evaluator_wake(plain->evaluator) <= last);
}

static void begin_plain(struct plain * plain)
{
  make_plain(plain);
  plain->is_alive = true;
  plain->last = now;
  char * copy = malloc((size_t)fm_evaluator_instance_bytes(follower.evaluator));
  EXPECT(copy != NULL);
  fm_evaluator_save(follower.evaluator, copy);
  fm_evaluator_restore(plain->evaluator, copy);
  free(copy);
  fm_end_receptions(plain->evaluator, INT64_MAX - 1);
  plain->evaluator->instance.time->taken = INT64_MIN;
  if (fm_evaluator_has_begun(plain->evaluator)) {
    plain->evaluator->instance.time->now = now;
    begin_keyed(plain->evaluator, now, true);
  }
  fm_evaluator_reset(plain->evaluator);
}

// ---- calls -------------------------------------------------------------------------------------

static uint32_t key_of_slot(uint32_t slot)
{
  uint8_t key[FM_MOST_KEY_BYTES];
  const size_t size = fm_scopes_key(scopes, 0, slot, key);
  for (uint32_t k = 0; k < N_KEYS; ++k) {
    if (SIZES[k] == size && memcmp(KEYS[k], key, size) == 0) {
      return k;
    }
  }
  EXPECT(false);
  return 0;
}

static bool looks;        // the sink reads another instance

static void sink(
  void * context, const struct fm_stepped * stepped, const struct fm_violation * violations)
{
  (void)context;
  if (stepped->kind == FM_BUNDLE || stepped->event == FM_SCOPE_BEYOND) {
    return;
  }
  struct plain * plain = &plains[key_of_slot(stepped->slot)];
  if (stepped->event == FM_SCOPE_STEPPED) {
    add_violations(&plain->found, violations, stepped->n_violations);
  }
  if (looks) {
    EXPECT(fm_scopes_look(scopes, 0, fm_scopes_next(scopes, 0, 0)) != NULL);
  }
}

static void compare_found(const struct plain * plain)
{
  EXPECT(plain->found.n == plain->expected.n);
  for (uint32_t n = 0; n < plain->found.n; ++n) {
    const struct fm_violation * a = &plain->found.violations[n];
    const struct fm_violation * b = &plain->expected.violations[n];
    EXPECT(a->requirement == b->requirement && a->is_recovery == b->is_recovery);
    EXPECT(a->step == b->step);
    EXPECT(a->stamp == b->stamp);
  }
}

static void compare_instance(struct plain * plain, uint32_t slot)
{
  const struct fm_monitor * monitor = &monitors[KIND].monitor;
  const struct fm_evaluator * instance = fm_scopes_look(scopes, 0, slot);
  const struct fm_evaluator * own = plain->evaluator;
  EXPECT(instance != NULL);
  for (uint32_t r = 0; r < monitor->n_requirements; ++r) {
    EXPECT(fm_evaluator_verdicts(instance)[r] == fm_evaluator_verdicts(own)[r]);
    EXPECT(instance->instance.previous[r] == own->instance.previous[r]);
  }
  for (uint32_t g = 0; g < monitor->n_groups; ++g) {
    EXPECT(fm_evaluator_ready(instance, g) == fm_evaluator_ready(own, g));
    EXPECT(fm_evaluator_steps(instance, g) == fm_evaluator_steps(own, g));
    EXPECT(fm_evaluator_steps(own, g) == 0 ||
      fm_evaluator_start(instance, g) == fm_evaluator_start(own, g));
    EXPECT(instance->instance.groups[g].stale == own->instance.groups[g].stale);
    EXPECT(instance->instance.groups[g].due == own->instance.groups[g].due);
  }
  for (uint32_t i = 0; i < monitor->n_inputs; ++i) {
    const char * a = (const char *)fm_evaluator_inputs(instance) + monitor->inputs[i].offset;
    const char * b = (const char *)fm_evaluator_inputs(own) + monitor->inputs[i].offset;
    EXPECT(fm_evaluator_has_value(instance, i) == fm_evaluator_has_value(own, i));
    EXPECT(fm_evaluator_is_stale(instance, i) == fm_evaluator_is_stale(own, i));
    EXPECT(fm_evaluator_silence(instance, i).is_silent == fm_evaluator_silence(own, i).is_silent);
    EXPECT(instance->instance.inputs[i].due == own->instance.inputs[i].due);
    // A reception that is over is taken back by the next call, if one is made.
    EXPECT(monitors[KIND].sources[i] == FM_RECEPTION ||
      memcmp(a, b, size_of(monitor->inputs[i].type)) == 0);
  }
  compare_found(plain);
}

static uint64_t count_violated(uint32_t r)
{
  uint64_t n = 0;
  for (uint32_t k = 0; k < N_KEYS; ++k) {
    n += plains[k].is_alive && !plains[k].evaluator->instance.previous[r] ? 1u : 0u;
  }
  return n;
}

// ---- aggregates, computed anew -----------------------------------------------------------------

// As maxOver and minOver order numbers: -0 before 0; NaN wins.
static bool is_better(double a, double b, bool is_least)
{
  if (isnan(a) || isnan(b)) {
    return isnan(a) && !isnan(b);
  }
  const bool less = a < b || (a == b && signbit(a) && !signbit(b));
  const bool more = a > b || (a == b && !signbit(a) && signbit(b));
  return is_least ? less : more;
}

struct anew
{
  uint64_t n, n_true, sum;
  int64_t least;
  double real_least, real_most;
  double reals[MOST];
};

static void add_operand(
  struct anew * to, const struct fm_aggregate * aggregate, const struct fm_instance * instance)
{
  const bool is_verdict = aggregate->operation <= FM_ALL_OF;
  const uint32_t g = is_verdict ? monitors[KIND].requirements[aggregate->operand].group :
    outputs[aggregate->operand].group;
  if (instance->groups[g].steps == 0 || instance->groups[g].unset > 0) {
    return;
  }
  int64_t number = 0;
  double real = 0.0;
  if (is_verdict) {
    to->n_true += instance->verdicts[aggregate->operand] ? 1u : 0u;
  } else {
    const char * place = (const char *)instance->state + outputs[aggregate->operand].offset;
    memcpy(&number, place, sizeof number);
    memcpy(&real, place, sizeof real);
    to->sum += (uint64_t)number;
    to->least = to->n == 0 || number < to->least ? number : to->least;
    to->real_least =
      to->n == 0 || is_better(real, to->real_least, true) ? real : to->real_least;
    to->real_most = to->n == 0 || is_better(real, to->real_most, false) ? real : to->real_most;
  }
  to->reals[to->n] = real;
  to->n += 1;
}

// In a sum to which nothing but the present numbers was ever added.
static double sum_anew(const struct anew * of)
{
  uint64_t exact[FM_SUM_LENGTH] = {0};
  for (uint64_t n = 0; n < of->n; ++n) {
    fm_add_exactly(exact, fm_word_f64(of->reals[n]), false);
  }
  return fm_exact_quotient(exact, 1);
}

static bool is_same_real(double a, double b)
{
  return (isnan(a) && isnan(b)) || memcmp(&a, &b, sizeof a) == 0;
}

static void compare_aggregate(const struct fm_aggregate * aggregate)
{
  const struct fm_evaluator * bundle = fm_scopes_look(scopes, FM_BUNDLE, 0);
  const char * place = (const char *)fm_evaluator_inputs(bundle) +
    monitors[BUNDLE].inputs[aggregate->input].offset;
  struct anew anew = {0};
  for (uint32_t slot = fm_scopes_next(scopes, 0, 0); slot != FM_NO_SLOT;
    slot = fm_scopes_next(scopes, 0, slot + 1))
  {
    add_operand(&anew, aggregate, &fm_scopes_look(scopes, 0, slot)->instance);
  }
  int64_t number;
  double real;
  memcpy(&number, place, sizeof number);
  memcpy(&real, place, sizeof real);
  const bool has_value = fm_evaluator_has_value(bundle, aggregate->input);
  const bool is_real =
    aggregate->operation > FM_ALL_OF && outputs[aggregate->operand].type == FM_FLOAT64;
  switch ((enum fm_operation)aggregate->operation) {
    case FM_COUNT_OF:
      EXPECT(has_value && number == (int64_t)anew.n_true);
      break;
    case FM_ANY_OF:
      EXPECT(has_value && *(const bool *)(const void *)place == (anew.n_true > 0));
      break;
    case FM_ALL_OF:
      EXPECT(has_value && *(const bool *)(const void *)place == (anew.n_true == anew.n));
      break;
    case FM_MIN_OF:
      EXPECT(has_value == (anew.n > 0));
      EXPECT(anew.n == 0 ||
        (is_real ? is_same_real(real, anew.real_least) : number == anew.least));
      break;
    case FM_MAX_OF:
      EXPECT(has_value == (anew.n > 0));
      EXPECT(anew.n == 0 || is_same_real(real, anew.real_most));
      break;
    case FM_SUM_OF:
      EXPECT(has_value);
      EXPECT(is_real ? is_same_real(real, sum_anew(&anew)) : number == (int64_t)anew.sum);
      break;
  }
}

static void compare_all(void)
{
  uint64_t alive = 0;
  for (uint32_t k = 0; k < N_KEYS; ++k) {
    const uint32_t slot = fm_keys_find(scopes->kinds[0].pool.keys, KEYS[k], SIZES[k]);
    EXPECT((slot != FM_NO_SLOT) == plains[k].is_alive);
    if (plains[k].is_alive) {
      compare_instance(&plains[k], slot);
      alive += 1;
    }
    plains[k].expected.n = 0;
    plains[k].found.n = 0;
  }
  follower.expected.n = 0;
  const struct fm_pool_counts counts = fm_scopes_counts(scopes, 0);
  EXPECT(counts.alive == alive && counts.begun - counts.ended == alive);
  for (uint32_t r = 0; r < monitors[KIND].monitor.n_requirements; ++r) {
    EXPECT(fm_scopes_violated(scopes, 0, r) == count_violated(r));
  }
  // While an instant is open, the bundle's scope has the values of before.
  for (uint32_t a = 0; !scopes->message.is_put_off && a < options.n_aggregates; ++a) {
    compare_aggregate(&aggregates[a]);
  }
}

// Time moves for the plain evaluators; those whose time is over end.
static void advance_plains(int64_t time, bool stands)
{
  const int64_t last = stands ? time - 1 : time;
  for (uint32_t k = 0; k < N_KEYS; ++k) {
    struct plain * plain = &plains[k];
    const int64_t end = plain->last + kind.forget;
    if (plain->is_alive && !fm_evaluator_has_begun(plain->evaluator)) {
      plain->last = time;
    }
    if (plain->is_alive && kind.forget > 0 && fm_evaluator_has_begun(plain->evaluator) &&
      end <= last)
    {
      (void)reach_plain(plain, time);
      while (fm_evaluator_wake(plain->evaluator) <= end) {
        take_due(plain, end);
      }
      compare_found(plain);
      end_plain(plain);
    } else if (plain->is_alive) {
      advance_plain(plain, time, stands);
    }
  }
  advance_plain(&follower, time, stands);
}

static void advance_all(int64_t time, bool stands)
{
  while ((stands ? fm_scopes_advance_to(scopes, time) : fm_scopes_advance(scopes, time)) !=
    FM_NEVER)
  {
  }
  advance_plains(time, stands);
}

static union fm_value random_value(uint8_t type)
{
  union fm_value value = {.i = (int64_t)random_below(4) - 1};
  if (type == FM_FLOAT32 || type == FM_FLOAT64) {
    value.f = (double)random_below(4) - 1.5;
  } else if (type == FM_BOOL) {
    value.i = random_below(2);
  }
  return value;
}

static union fm_value shared_values[MAX_INPUTS];
static bool has_shared[MAX_INPUTS];   // stored by this message

static void store_shared(struct plain * plain, int64_t at)
{
  for (uint32_t i = 0; i < monitors[KIND].monitor.n_inputs; ++i) {
    if (shared[i] != UINT32_MAX && has_shared[shared[i]]) {
      fm_evaluator_store(plain->evaluator, i, shared_values[shared[i]], at);
    }
  }
}

static int64_t arrive_plain(struct plain * plain)
{
  const int64_t at = fm_evaluator_arrival(plain->evaluator, now);
  while (at != now && fm_evaluator_wake(plain->evaluator) < at) {
    take_due(plain, at - 1);
  }
  return at;
}

static void step_plain(struct plain * plain, uint32_t topic, bool is_row, int64_t at)
{
  struct fm_violation out[MAX_REQUIREMENTS];
  const uint32_t n = is_row ? fm_evaluator_step(plain->evaluator, at, out) :
    fm_evaluator_message(plain->evaluator, topic, at, out);
  add_violations(&plain->expected, out, n);
}

// An element of a message: values of its key's inputs. Of two with one key the first counts.
static void give_element(uint32_t topic, bool is_row, uint32_t k, bool is_first)
{
  struct random_monitor * of = &monitors[KIND];
  struct plain * plain = &plains[k];
  const bool is_new = !plain->is_alive;
  const bool is_full = fm_scopes_counts(scopes, 0).alive == MOST || SIZES[k] == 0;
  const bool is_beyond = is_new && is_full && kind.n_listed == 0;
  const bool is_left_out = is_beyond || !is_first || (is_new && kind.n_listed > 0);
  const uint64_t beyond = fm_scopes_counts(scopes, 0).beyond;
  if (is_new && !is_left_out) {
    begin_plain(plain);
  }
  const uint32_t slot = fm_scopes_enter(scopes, 0, KEYS[k], SIZES[k]);
  EXPECT((slot == FM_NO_SLOT) == is_left_out);
  EXPECT(fm_scopes_counts(scopes, 0).beyond == beyond + (is_beyond ? 1u : 0u));
  const int64_t at = slot == FM_NO_SLOT ? now : arrive_plain(plain);
  if (slot != FM_NO_SLOT) {
    plain->last = now;
    store_shared(plain, at);
  }
  for (uint32_t i = 0; i < of->monitor.n_inputs; ++i) {
    if (shared[i] == UINT32_MAX && (is_row || of->topic_of[i] == topic)) {
      const union fm_value value = random_value(of->inputs[i].type);
      fm_scopes_store_keyed(scopes, i, value);
      if (slot != FM_NO_SLOT) {
        fm_evaluator_store(plain->evaluator, i, value, at);
      }
    }
  }
  if (slot != FM_NO_SLOT) {
    step_plain(plain, topic, is_row, at);
  }
}

// A topic that feeds nothing of the instances is none of theirs, but for FM_EVERY_MESSAGE.
static bool is_message_for_all(uint32_t topic)
{
  bool steps = monitors[KIND].options.policy == FM_EVERY_MESSAGE ||
    monitors[KIND].topics[topic].n_inputs > 0;
  for (uint32_t g = 0; g < monitors[KIND].monitor.n_groups; ++g) {
    steps = steps || monitors[KIND].groups[g].n_inputs == 0;
  }
  return is_shared_topic(topic) && steps;
}

static void begin_message(uint32_t topic, bool is_row, bool is_for_all)
{
  if (is_row) {
    fm_scopes_begin_row(scopes, is_for_all, now);
  } else {
    fm_scopes_begin(scopes, topic, now);
  }
  memset(has_shared, 0, sizeof has_shared);
  for (uint32_t b = 0; b < n_shared; ++b) {
    if (is_row ? is_for_all && random_below(2) == 0 : monitors[BUNDLE].topic_of[b] == topic) {
      has_shared[b] = true;
      shared_values[b] = random_value(monitors[BUNDLE].inputs[b].type);
      fm_scopes_store(scopes, b, shared_values[b]);
    }
  }
}

static void give_message(uint32_t topic, bool is_row)
{
  const bool is_for_all = is_row ? random_below(2) == 0 : is_message_for_all(topic);
  const uint32_t n = !is_row && !is_keyed_topic(topic) ? 0 : random_below(is_row ? 2 : 4);
  bool is_given[N_KEYS] = {false};
  advance_all(now, true);
  begin_message(topic, is_row, is_for_all);
  for (uint32_t e = 0; e < n; ++e) {
    const uint32_t k = random_below(N_KEYS);
    give_element(topic, is_row, k, !is_given[k]);
    is_given[k] = true;
  }
  for (uint32_t k = 0; k < N_KEYS; ++k) {
    if (is_for_all && plains[k].is_alive && !is_given[k]) {
      const int64_t at = arrive_plain(&plains[k]);
      store_shared(&plains[k], at);
      step_plain(&plains[k], topic, is_row, at);
    }
  }
  if (is_for_all) {
    const int64_t at = arrive_plain(&follower);
    store_shared(&follower, at);
    step_plain(&follower, topic, is_row, at);
  }
  EXPECT(fm_scopes_end(scopes) >= now);
  if (is_row && monitors[KIND].options.policy == FM_TIMED) {  // instances are at that instant
    advance_plains(now, false);
  }
}

static void reset_all(void)
{
  fm_scopes_reset(scopes);
  for (uint32_t k = 0; k < N_KEYS; ++k) {
    if (plains[k].is_alive) {
      fm_evaluator_reset(plains[k].evaluator);
    }
  }
  fm_evaluator_reset(follower.evaluator);
}

static void shift_all(int64_t by)
{
  fm_scopes_shift(scopes, by);
  for (uint32_t k = 0; k < N_KEYS; ++k) {
    if (plains[k].is_alive) {
      fm_evaluator_shift(plains[k].evaluator, by);
      plains[k].last += by;
    }
  }
  fm_evaluator_shift(follower.evaluator, by);
  now += by;
}

// The time of the plain evaluators goes back with that of the bundle's scope.
static void go_back(void)
{
  const int64_t by = -(int64_t)random_below(40) - 1;
  const int64_t before = fm_evaluator_now(fm_scopes_bundle(scopes));
  const bool goes = fm_goes_back(scopes->bundle, now + by);
  now += by;
  for (uint32_t k = 0; goes && k < N_KEYS; ++k) {
    plains[k].last -= before - now;
    if (plains[k].is_alive) {
      (void)reach_plain(&plains[k], now);
    }
  }
  advance_all(now, random_below(2) == 0);
}

static void call(bool has_begun, bool are_rows)
{
  const uint32_t choice = random_below(20);
  now += random_below(3) == 0 ? 0 : random_below(12);
  if ((are_rows || !has_ties) && has_begun) {
    now += 1;
  }
  if (choice < 3 && has_begun) {
    advance_all(now, random_below(2) == 0);
  } else if (choice == 3 && has_begun && random_below(3) == 0) {
    reset_all();
  } else if (choice == 4 && has_begun && random_below(3) == 0) {
    shift_all((int64_t)random_below(200) - 100);
  } else if (choice == 5 && has_begun && !are_rows && random_below(3) == 0) {
    go_back();
  } else {
    give_message(random_below(N_TOPICS), are_rows);
  }
}

static void run(void)
{
  make_bundle();
  looks = random_below(2) == 0;
  options.bundle = &monitors[BUNDLE].options;
  options.kinds = &kind;
  options.n_kinds = 1;
  options.aggregates = aggregates;
  options.sink = sink;
  const uint64_t bytes = fm_scopes_bytes(&options);
  EXPECT(bytes > 0);
  void * memory = calloc(1, (size_t)bytes);
  EXPECT(memory != NULL);
  scopes = fm_scopes_init(memory, &options);
  EXPECT(scopes != NULL);
  make_plain(&follower);
  for (uint32_t n = 0; n < kind.n_listed; ++n) {
    make_plain(&plains[n]);
    plains[n].is_alive = true;
  }
  now = 1000;
  const bool are_rows = random_below(3) == 0;
  for (uint32_t n = 0; n < CALLS; ++n) {
    call(n > 0, are_rows);
    compare_all();
  }
  for (uint32_t k = 0; k < N_KEYS; ++k) {
    end_plain(&plains[k]);
  }
  end_plain(&follower);
  free(memory);
}

int main(int argc, char ** argv)
{
  const long n_runs = argc > 2 ? atol(argv[2]) : 1;
  seed = (argc > 1 ? (uint64_t)atol(argv[1]) : 0) * 2654435761u + 88172645463325252u;
  for (run_number = 0; run_number < n_runs; ++run_number) {
    run();
  }
  return 0;
}
