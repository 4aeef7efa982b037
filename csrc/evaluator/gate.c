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

/// gate.c: see gate.h for the contract.

#include "gate.h"

#include <string.h>

#include "due.h"
#include "measures.h"
#include "steps.h"
#include "tables.h"

struct fm_gate
{
  struct fm_gate_options options;
  char * saved;                 // an instance
  bool * is_from;               // an input: one of `from`
  bool * was_withheld;          // a requirement: its violation goes on until a message passes
  struct fm_requirement_cell * cells_before;  // the evaluator's cells of the requirements, and
  uint64_t * steps_before;      // its `steps_before`, before the step of a held message
  struct fm_gate_counts counts;
  int64_t due;                  // of a replacement
  int64_t passed_at;
  int64_t latched_at;
  uint64_t * steps;             // of each group, when it was last looked at
  int64_t tried_at;             // with has_tried
  bool has_passed;
  bool is_replaced;             // what was sent last is a replacement
  bool held_before;             // all requirements, after the last step
  bool was_known;               // when something else was evaluated last
  bool has_tried;               // a step that does not stay
  bool hangs;                   // a thread that takes the other inputs
};

// ---- making ------------------------------------------------------------------------------------

struct gate_layout
{
  uint64_t saved;
  uint64_t is_from;
  uint64_t was_withheld;
  uint64_t cells_before;
  uint64_t steps_before;
  uint64_t steps;
  struct fm_block block;
};

static struct gate_layout lay_out_gate(const struct fm_gate_options * options)
{
  const struct fm_monitor * monitor = options->monitor;
  const uint64_t instance_bytes = fm_evaluator_instance_bytes(options->evaluator);
  struct gate_layout layout = {0};
  layout.block.fits = true;
  (void)fm_block_append(&layout.block, 1, sizeof(struct fm_gate));
  layout.saved = fm_block_append(&layout.block, instance_bytes, 1);
  layout.is_from = fm_block_append(&layout.block, monitor->n_inputs, sizeof(bool));
  layout.was_withheld = fm_block_append(&layout.block, monitor->n_requirements, sizeof(bool));
  layout.cells_before =
    fm_block_append(&layout.block, monitor->n_requirements, sizeof(struct fm_requirement_cell));
  layout.steps_before = fm_block_append(&layout.block, monitor->n_groups, sizeof(uint64_t));
  layout.steps = fm_block_append(&layout.block, monitor->n_groups, sizeof(uint64_t));
  return layout;
}

uint64_t fm_gate_bytes(const struct fm_gate_options * options)
{
  const struct gate_layout layout = lay_out_gate(options);
  return layout.block.fits ? layout.block.bytes : 0;
}

static bool gate_options_are_sound(const struct fm_gate_options * options)
{
  const enum fm_policy policy = options->evaluator->policy;
  return options->from <= options->n_topics && options->otherwise <= FM_SUBSTITUTE &&
         options->hold >= 0 && options->period >= 0 && options->open_after >= 0 &&
         policy != FM_ALL_INPUTS && policy != FM_PERIODIC;
}

static uint32_t n_fields(const struct fm_gate * gate)
{
  const uint32_t from = gate->options.from;
  return from < gate->options.n_topics ? gate->options.topics[from].n_inputs : 0;
}

static uint32_t input_of(const struct fm_gate * gate, uint32_t field)
{
  return gate->options.topics[gate->options.from].inputs[field];
}

static bool sends_at_a_rate(const struct fm_gate * gate)
{
  return gate->options.otherwise == FM_SUBSTITUTE && gate->options.period > 0;
}

struct fm_gate * fm_gate_init(void * memory, const struct fm_gate_options * options)
{
  if (!gate_options_are_sound(options)) {
    return NULL;
  }
  const struct gate_layout layout = lay_out_gate(options);
  struct fm_gate * gate = memory;
  char * block = memory;
  memset(memory, 0, (size_t)layout.block.bytes);
  gate->options = *options;
  gate->saved = block + layout.saved;
  gate->is_from = (bool *)(void *)(block + layout.is_from);
  gate->was_withheld = (bool *)(void *)(block + layout.was_withheld);
  gate->cells_before = (struct fm_requirement_cell *)(void *)(block + layout.cells_before);
  gate->steps_before = (uint64_t *)(void *)(block + layout.steps_before);
  gate->steps = (uint64_t *)(void *)(block + layout.steps);
  for (uint32_t k = 0; k < n_fields(gate); ++k) {
    gate->is_from[input_of(gate, k)] = true;
  }
  gate->due = sends_at_a_rate(gate) ? INT64_MIN : FM_NEVER;
  gate->held_before = true;
  return gate;
}

// ---- state -------------------------------------------------------------------------------------

static bool is_known(const struct fm_gate * gate)
{
  const struct fm_instance * instance = &gate->options.evaluator->instance;
  if (gate->hangs && !gate->options.passes_silent) {
    return false;
  }
  for (uint32_t i = 0; i < gate->options.monitor->n_inputs; ++i) {
    const struct fm_instance_input * input = &instance->inputs[i];
    if (!gate->is_from[i] &&
      (!input->has_value || (fm_may_be_silent(input) && !gate->options.passes_silent)))
    {
      return false;
    }
  }
  return true;
}

// Verdicts are true before the first step, when nothing is known.
static bool have_stepped(const struct fm_gate * gate)
{
  for (uint32_t g = 0; g < gate->options.monitor->n_groups; ++g) {
    if (gate->options.evaluator->instance.groups[g].steps == 0) {
      return false;
    }
  }
  return true;
}

static bool all_hold(const struct fm_gate * gate)
{
  const struct fm_evaluator * evaluator = gate->options.evaluator;
  for (uint32_t r = 0; r < gate->options.monitor->n_requirements; ++r) {
    if (!evaluator->instance.verdicts[evaluator->requirements[r].occurrence]) {
      return false;
    }
  }
  return true;
}

// Note the steps of the groups since the last call. Returns whether one of them violates.
static bool note_steps(struct fm_gate * gate)
{
  const struct fm_evaluator * evaluator = gate->options.evaluator;
  const struct fm_monitor * monitor = gate->options.monitor;
  bool is_violated = false;
  for (uint32_t r = 0; r < monitor->n_requirements; ++r) {
    const uint32_t g = monitor->requirements[r].group;
    is_violated = is_violated || (evaluator->instance.groups[g].steps != gate->steps[g] &&
      !evaluator->instance.verdicts[evaluator->requirements[r].occurrence]);
  }
  for (uint32_t g = 0; g < monitor->n_groups; ++g) {
    gate->steps[g] = evaluator->instance.groups[g].steps;
  }
  return is_violated;
}

// Whether requirements are violated since nothing arrives on `from`.
static bool is_from_stale(const struct fm_gate * gate)
{
  bool is_stale = false;
  for (uint32_t k = 0; k < n_fields(gate); ++k) {
    is_stale = is_stale || gate->options.evaluator->instance.inputs[input_of(gate, k)].is_stale;
  }
  return is_stale;
}

static bool is_latched(const struct fm_gate * gate, int64_t steady)
{
  const int64_t open_after = gate->options.open_after;
  return gate->counts.is_latched &&
         (open_after == 0 || fm_since(gate->latched_at, steady) < open_after);
}

static void latch(struct fm_gate * gate, int64_t steady)
{
  gate->counts.is_latched = gate->options.latches;
  gate->latched_at = steady;
}

// ---- steps -------------------------------------------------------------------------------------

static bool are_read(const struct fm_gate * gate, const struct fm_field * fields)
{
  bool are_all_read = true;
  for (uint32_t k = 0; k < n_fields(gate); ++k) {
    if (fields[k].outcome != FM_FIELD_READ) {
      fm_evaluator_unusable(gate->options.evaluator, input_of(gate, k));
      are_all_read = false;
    }
  }
  return are_all_read;
}

// Take a step on what was stored. Under FM_TIMED this includes the groups that do not read `from`
// and are due at this instant, since no later message can take effect at it.
static uint32_t step(struct fm_gate * gate, int64_t stamp, struct fm_violation * out)
{
  struct fm_evaluator * evaluator = gate->options.evaluator;
  const uint32_t n = fm_evaluator_message(evaluator, gate->options.from, stamp, out);
  struct fm_findings report = {out, stamp, n};
  if (fm_evaluator_is_timed(evaluator) && evaluator->instance.time->has_begun &&
    fm_evaluator_deadline(evaluator) <= stamp)
  {
    fm_renew_rates(evaluator, stamp);
    fm_evaluate_due_groups(evaluator, stamp, &report);
  }
  return report.n;
}

static uint32_t step_on_message(
  struct fm_gate * gate, const struct fm_field * fields, int64_t now, int64_t stamp,
  struct fm_violation * out)
{
  for (uint32_t k = 0; k < n_fields(gate); ++k) {
    fm_evaluator_store(gate->options.evaluator, input_of(gate, k), fields[k].value, now);
  }
  return step(gate, stamp, out);
}

// A replacement was not received.
static uint32_t step_on_replacement(
  struct fm_gate * gate, const struct fm_field * fields, int64_t now, int64_t stamp,
  struct fm_violation * out)
{
  struct fm_evaluator * evaluator = gate->options.evaluator;
  const uint32_t from = gate->options.from;
  for (uint32_t k = 0; k < n_fields(gate); ++k) {
    if (fields[k].outcome == FM_FIELD_READ) {
      fm_evaluator_put(evaluator, input_of(gate, k), fields[k].value, now);
    }
  }
  const uint32_t n = step(gate, stamp, out);
  if (from < gate->options.n_topics) {
    evaluator->topics[from].counts.messages -= 1;
  }
  return n;
}

// If this is left to the thread that waits for the deadline, each withheld message wakes it.
static void find_deadline(struct fm_gate * gate)
{
  (void)fm_evaluator_deadline(gate->options.evaluator);
}

// What a message that is withheld has ended is not over.
static uint32_t keep_violations(
  struct fm_gate * gate, struct fm_violation * found, uint32_t n)
{
  uint32_t n_kept = 0;
  for (uint32_t k = 0; k < n; ++k) {
    if (!found[k].is_recovery) {
      gate->was_withheld[found[k].requirement] = true;
      found[n_kept] = found[k];
      found[n_kept].is_withheld = true;
      n_kept += 1;
    }
  }
  return n_kept;
}

static bool reads_from(const struct fm_gate * gate, uint32_t requirement)
{
  const struct fm_monitor * monitor = gate->options.monitor;
  const struct fm_group * group = &monitor->groups[monitor->requirements[requirement].group];
  bool reads = false;
  for (uint32_t k = 0; k < group->n_inputs; ++k) {
    reads = reads || gate->is_from[group->inputs[k]];
  }
  return reads;
}

// A recovery ends the violation by messages that were withheld, too. But while what was sent last
// is a replacement, a violation of what reads `from` goes on until a message passes: the next
// message may be no better than the one that was replaced.
static uint32_t put_off_recoveries(
  struct fm_gate * gate, struct fm_violation * found, uint32_t n)
{
  uint32_t n_kept = 0;
  for (uint32_t k = 0; k < n; ++k) {
    const uint32_t r = found[k].requirement;
    const bool is_put_off = found[k].is_recovery && gate->is_replaced && reads_from(gate, r);
    gate->was_withheld[r] = found[k].is_recovery ? is_put_off : gate->was_withheld[r];
    found[n_kept] = found[k];
    n_kept += is_put_off ? 0u : 1u;
  }
  return n_kept;
}

// The recoveries from messages that were withheld: the instance does not know of these violations.
static uint32_t add_recoveries(
  struct fm_gate * gate, int64_t stamp, struct fm_violation * found, uint32_t n)
{
  const struct fm_evaluator * evaluator = gate->options.evaluator;
  n = put_off_recoveries(gate, found, n);
  for (uint32_t r = 0; r < gate->options.monitor->n_requirements; ++r) {
    if (gate->was_withheld[r] && evaluator->reports_recoveries) {
      const uint32_t group = gate->options.monitor->requirements[r].group;
      const struct fm_instance_group * cell = &evaluator->instance.groups[group];
      const uint64_t number = evaluator->policy == FM_TIMED ?
        (uint64_t)fm_since(cell->start, stamp) : cell->steps - 1;
      found[n] = (struct fm_violation) {number, stamp, r, true, false, false};
      n += 1;
    }
    gate->was_withheld[r] = false;
  }
  return n;
}

static enum fm_judgement judge_step(const struct fm_gate * gate, int64_t steady)
{
  if (!is_known(gate) || !have_stepped(gate)) {
    return FM_CLOSED;
  }
  if (!all_hold(gate)) {
    return FM_VIOLATES;
  }
  return is_latched(gate, steady) ? FM_LATCHED : FM_PASSED;
}

// ---- replacements ------------------------------------------------------------------------------

static void withhold(struct fm_gate * gate, int64_t steady)
{
  switch ((enum fm_otherwise)gate->options.otherwise) {
    case FM_DROP:
      break;
    case FM_HOLD:
      if (gate->has_passed && fm_since(gate->passed_at, steady) <= gate->options.hold) {
        gate->due = steady;
      }
      break;
    case FM_SUBSTITUTE:
      if (gate->due == FM_NEVER) {
        gate->due = steady;
      }
      break;
  }
}

// When the next one is due after one was sent; of instants that were missed, none is made up for.
static int64_t next_due(const struct fm_gate * gate, int64_t steady)
{
  if (!sends_at_a_rate(gate)) {
    return FM_NEVER;
  }
  const int64_t next = fm_later(gate->due, gate->options.period);
  return next > steady ? next : fm_later(steady, gate->options.period);
}

int64_t fm_gate_due(const struct fm_gate * gate) {return gate->due;}

static void copy_counts(
  const struct fm_monitor * monitor, struct fm_requirement_cell * cells, uint64_t * steps,
  const struct fm_requirement_cell * from_cells, const uint64_t * from_steps)
{
  memcpy(cells, from_cells, monitor->n_requirements * sizeof(*cells));
  memcpy(steps, from_steps, monitor->n_groups * sizeof(*steps));
}

// A held message that is not sent never happened: its step and its violations do not count.
static void save_with_counts(struct fm_gate * gate)
{
  const struct fm_evaluator * evaluator = gate->options.evaluator;
  fm_evaluator_save(evaluator, gate->saved);
  copy_counts(
    gate->options.monitor, gate->cells_before, gate->steps_before, evaluator->requirements,
    evaluator->steps_before);
}

static void restore_with_counts(struct fm_gate * gate)
{
  struct fm_evaluator * evaluator = gate->options.evaluator;
  fm_evaluator_restore(evaluator, gate->saved);
  copy_counts(
    gate->options.monitor, evaluator->requirements, evaluator->steps_before, gate->cells_before,
    gate->steps_before);
  find_deadline(gate);
}

bool fm_gate_replace(
  struct fm_gate * gate, const struct fm_field * fields, int64_t now, int64_t stamp,
  int64_t steady, struct fm_violation * out, uint32_t * n_out)
{
  const bool may_refuse = gate->options.otherwise == FM_HOLD;
  if (may_refuse) {
    save_with_counts(gate);
  }
  *n_out = step_on_replacement(gate, fields, now, stamp, out);
  gate->due = next_due(gate, steady);
  const bool holds = all_hold(gate);
  if (may_refuse && (!holds || !is_known(gate) || !have_stepped(gate))) {
    restore_with_counts(gate);
    *n_out = 0;
    return false;
  }
  gate->is_replaced = true;
  *n_out = put_off_recoveries(gate, out, *n_out);
  gate->counts.replaced += 1;
  gate->counts.violating += holds || is_from_stale(gate) ? 0u : 1u;
  gate->held_before = holds;
  (void)note_steps(gate);
  return true;
}

// ---- messages ----------------------------------------------------------------------------------

static void count(struct fm_gate_counts * counts, enum fm_judgement judgement)
{
  switch (judgement) {
    case FM_PASSED:
      counts->passed += 1;
      break;
    case FM_VIOLATES:
      counts->violates += 1;
      break;
    case FM_CLOSED:
      counts->closed += 1;
      break;
    case FM_LATCHED:
      counts->latched += 1;
      break;
    case FM_UNREADABLE:
      counts->unreadable += 1;
      break;
    case FM_DUPLICATE:
      break;
  }
}

static enum fm_judgement try_step(
  struct fm_gate * gate, const struct fm_field * fields, int64_t now, int64_t stamp,
  int64_t steady, struct fm_violation * out, uint32_t * n_out)
{
  fm_evaluator_save(gate->options.evaluator, gate->saved);
  uint32_t n = step_on_message(gate, fields, now, stamp, out);
  const enum fm_judgement judgement = judge_step(gate, steady);
  if (judgement == FM_PASSED) {
    gate->is_replaced = false;
    n = add_recoveries(gate, stamp, out, n);
    gate->counts.is_latched = false;
    gate->has_passed = true;
    gate->passed_at = steady;
    gate->held_before = true;
    (void)note_steps(gate);
    gate->due = FM_NEVER;
  } else {
    n = keep_violations(gate, out, n);
    gate->has_tried = true;
    gate->tried_at = now;
  }
  *n_out = n;
  return judgement;
}

uint32_t fm_gate_judge(
  struct fm_gate * gate, const struct fm_field * fields, int64_t now, int64_t stamp,
  int64_t steady, struct fm_violation * out, uint32_t * n_out)
{
  enum fm_judgement judgement = FM_UNREADABLE;
  *n_out = 0;
  if (fields == NULL) {
    fm_evaluator_undecodable(gate->options.evaluator, gate->options.from);
  } else if (are_read(gate, fields)) {
    judgement = try_step(gate, fields, now, stamp, steady, out, n_out);
  }
  count(&gate->counts, judgement);
  if (judgement == FM_VIOLATES || (judgement == FM_CLOSED && !all_hold(gate))) {
    latch(gate, steady);
  }
  if (judgement != FM_PASSED) {
    withhold(gate, steady);
  }
  return judgement;
}

void fm_gate_finish(struct fm_gate * gate)
{
  if (gate->has_tried) {
    gate->has_tried = false;
    fm_evaluator_restore(gate->options.evaluator, gate->saved);
    for (uint32_t k = 0; k < n_fields(gate); ++k) {
      fm_evaluator_arrive(gate->options.evaluator, input_of(gate, k), gate->tried_at);
    }
    find_deadline(gate);
  }
}

bool fm_gate_note(
  struct fm_gate * gate, struct fm_violation * found, uint32_t * n, int64_t steady)
{
  const bool holds = all_hold(gate);
  const bool begins = !holds && gate->held_before;
  const bool is_unknown = !is_known(gate);
  const bool closes = is_unknown && gate->was_known;
  *n = put_off_recoveries(gate, found, *n);
  gate->held_before = holds;
  gate->was_known = !is_unknown;
  if (note_steps(gate) || begins) {
    latch(gate, steady);
  }
  if (gate->options.otherwise != FM_SUBSTITUTE || gate->due != FM_NEVER) {
    return false;
  }
  if (begins || closes || (sends_at_a_rate(gate) && (!holds || is_unknown))) {
    gate->due = steady;
  }
  return gate->due != FM_NEVER;
}

void fm_gate_note_hang(struct fm_gate * gate, bool hangs)
{
  gate->hangs = hangs;
}

void fm_gate_forget_violations(struct fm_gate * gate)
{
  gate->held_before = true;
  memset(gate->was_withheld, 0, gate->options.monitor->n_requirements);
}

void fm_gate_reset(struct fm_gate * gate)
{
  gate->counts.is_latched = false;
  fm_gate_forget_violations(gate);
}

struct fm_gate_counts fm_gate_counts(const struct fm_gate * gate, int64_t steady)
{
  struct fm_gate_counts counts = gate->counts;
  counts.is_known = is_known(gate);
  counts.is_latched = is_latched(gate, steady);
  counts.holds = all_hold(gate);
  return counts;
}
