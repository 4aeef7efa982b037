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

/// start_lines.c: see start_lines.h for the contract.

#include "start_lines.h"

#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "details.h"

// ---- what is watched ---------------------------------------------------------------------------

static const char * const POLICIES[] = {
  [FM_EVERY_MESSAGE] = "every_message", [FM_RELEVANT_MESSAGE] = "relevant_message",
  [FM_ALL_INPUTS] = "all_inputs", [FM_PERIODIC] = "periodic", [FM_TIMED] = "timed"};

static void add_count(struct fm_text * text, uint64_t n, const char * noun)
{
  fm_text_add(text, "%" PRIu64 " %s%s", n, noun, n == 1u ? "" : "s");
}

// Whether a bundle before the `k`-th, or a topic before it, has the name.
static bool is_repeated(
  const struct fm_watched * watched, uint32_t k, uint32_t topic, const char * name)
{
  for (uint32_t i = 0; i <= k; ++i) {
    const struct fm_report_table * table = watched[i].reporter->table;
    for (uint32_t t = 0; t < (i == k ? topic : table->n_topics); ++t) {
      if (strcmp(table->topics[t].name, name) == 0) {
        return true;
      }
    }
  }
  return false;
}

static uint64_t count_inputs(const struct fm_report_table * table)
{
  uint64_t n = 0;
  for (uint32_t t = 0; table->n_kinds > 0 && t < table->n_topics; ++t) {
    n += table->topic_inputs[t].n_inputs;
    for (uint32_t kind = 0; kind < table->n_kinds; ++kind) {
      n += table->kinds[kind].keyed[t].n_inputs;
    }
  }
  return table->n_kinds > 0 ? n : table->n_inputs;
}

static void add_contents(struct fm_text * text, const struct fm_watched * watched, uint32_t n)
{
  uint64_t requirements = 0;
  uint64_t inputs = 0;
  uint64_t topics = 0;
  for (uint32_t k = 0; k < n; ++k) {
    const struct fm_report_table * table = watched[k].reporter->table;
    requirements += table->n_requirements;
    inputs += count_inputs(table);
    for (uint32_t t = 0; t < table->n_topics; ++t) {
      topics += table->topics[t].kind != FM_TOPIC ||
        is_repeated(watched, k, t, table->topics[t].name) ? 0u : 1u;
    }
  }
  add_count(text, requirements, "requirement");
  fm_text_add(text, " on ");
  add_count(text, inputs, "input");
  fm_text_add(text, " of ");
  add_count(text, topics, "topic");
}

static void add_state(struct fm_text * text, const struct fm_watched * watched, uint32_t n)
{
  uint64_t bytes = 0;
  for (uint32_t k = 0; k < n; ++k) {
    bytes += watched[k].reporter->monitor->state_bytes;
  }
  add_count(text, bytes, "byte");
  fm_text_add(text, " of state");
}

static void add_terms(struct fm_text * text, const struct fm_watched * watched)
{
  const struct fm_report_table * table = watched->reporter->table;
  fm_text_add(text, "policy %s, ", POLICIES[table->policy]);
  if (table->policy == FM_PERIODIC) {
    fm_text_add(text, "%g s, ", (double)table->period / 1e9);
  } else if (table->uses_header_stamps) {
    fm_text_add(text, "by the stamps of headers, reordered within %g s, ",
      (double)table->reorder / 1e9);
  }
  add_state(text, watched, 1);
  for (uint32_t kind = 0; kind < table->n_kinds; ++kind) {
    if (!table->kinds[kind].has_base) {
      fm_text_add(text, ", for each ");
      fm_add_variables(text, &table->kinds[kind]);
      fm_text_add(text, ", at most %" PRIu32, table->kinds[kind].most);
    }
  }
  if (watched->origin[0] != '\0') {
    fm_text_add(text, " (%s)", watched->origin);
  }
}

// ---- gates, locks and actions ------------------------------------------------------------------

static void add_otherwise(struct fm_text * text, const struct fm_report_gate * gate)
{
  if (gate->is_service) {
    fm_text_add(text, "the request is refused");
  } else if (gate->otherwise == FM_HOLD) {
    fm_text_add(
      text, "the last message that passed is sent again, for %g s", (double)gate->hold / 1e9);
  } else if (gate->otherwise == FM_SUBSTITUTE && gate->period > 0) {
    fm_text_add(text, "the substitute is sent, at %g Hz", 1e9 / (double)gate->period);
  } else if (gate->otherwise == FM_SUBSTITUTE) {
    fm_text_add(text, "the substitute is sent, once for each message");
  } else {
    fm_text_add(text, "nothing is sent");
  }
}

static void add_latch(struct fm_text * text, const struct fm_report_gate * gate)
{
  if (gate->latches && gate->open_after > 0) {
    fm_text_add(
      text, "; after a violation closed until %g s without a violation",
      (double)gate->open_after / 1e9);
  } else if (gate->latches) {
    fm_text_add(text, "; after a violation closed until ~/reset");
  }
}

static void describe_gate(struct fm_lines * lines, const struct fm_watched * watched)
{
  const struct fm_report_table * table = watched->reporter->table;
  struct fm_text ids = {NULL, 0, 0};
  struct fm_text rest = {NULL, 0, 0};
  for (uint32_t k = 0; k < table->n_requirements; ++k) {
    fm_text_join(&ids, ", ", "%s", table->requirements[k].id);
  }
  add_otherwise(&rest, table->gate);
  add_latch(&rest, table->gate);
  fm_text_add(&rest, "%s", table->gate->passes_silent ?
    "; OPEN WHILE AN INPUT IS STALE (stale: open)" : "");
  fm_lines_add(lines, FM_INFO, "gate '%s': %s -> %s, keeps %s; otherwise %s", table->gate->name,
    watched->source, watched->target, fm_text_get(&ids), fm_text_get(&rest));
  fm_text_free(&ids);
  fm_text_free(&rest);
}

static void add_effect(
  struct fm_text * text, const struct fm_action * action, const char * full_name)
{
  static const char * const verbs[] = {"publishes on", "calls", "brings"};
  const bool is_transition = action->kind == FM_ACTION_TRANSITION;
  fm_text_join(text, "; ", "action '%s' %s %s%s%s", action->name, verbs[action->kind], full_name,
    is_transition ? " to " : "", is_transition ? action->state : "");
}

static void describe_actions(struct fm_lines * lines, const struct fm_watched * watched)
{
  const struct fm_report_table * table = watched->reporter->table;
  struct fm_text text = {NULL, 0, 0};
  for (uint32_t k = 0; k < table->n_locks; ++k) {
    fm_text_join(&text, "; ", "lock '%s' on %s, %g Hz", table->locks[k].name, watched->locks[k],
      1e9 / (double)table->locks[k].period);
  }
  for (uint32_t k = 0; k < table->n_actions; ++k) {
    add_effect(&text, &table->actions[k], watched->actions[k]);
  }
  if (text.length > 0) {
    fm_lines_add(lines, FM_INFO, "%s", fm_text_get(&text));
  }
  fm_text_free(&text);
}

void fm_add_watching(struct fm_lines * lines, const struct fm_watched * watched, uint32_t n)
{
  struct fm_text contents = {NULL, 0, 0};
  struct fm_text terms = {NULL, 0, 0};
  for (uint32_t k = 0; k < n; ++k) {
    describe_actions(lines, &watched[k]);
  }
  for (uint32_t k = 0; n > 1u && k < n; ++k) {
    add_contents(&contents, &watched[k], 1);
    add_terms(&terms, &watched[k]);
    fm_lines_add(lines, FM_INFO, "bundle %s: %s, %s", watched[k].reporter->table->bundle,
      fm_text_get(&contents), fm_text_get(&terms));
    fm_text_clear(&contents);
    fm_text_clear(&terms);
  }
  add_contents(&contents, watched, n);
  if (n == 1u) {
    add_terms(&terms, watched);
    fm_lines_add(lines, FM_INFO, "watching %s, %s", fm_text_get(&contents), fm_text_get(&terms));
  } else {
    add_state(&terms, watched, n);
    fm_lines_add(lines, FM_INFO, "watching %s in %u bundles, %s", fm_text_get(&contents), n,
      fm_text_get(&terms));
  }
  for (uint32_t k = 0; k < n; ++k) {
    if (watched[k].reporter->table->gate != NULL) {
      describe_gate(lines, &watched[k]);
    }
  }
  fm_text_free(&contents);
  fm_text_free(&terms);
}

void fm_add_restarted(struct fm_lines * lines, uint64_t groups)
{
  fm_lines_add(lines, FM_INFO, "restarted %" PRIu64 " step group%s; input values kept", groups,
    groups == 1u ? "" : "s");
}

void fm_add_gate_refusal(
  struct fm_lines * lines, const struct fm_report_gate * gate, const char * policy)
{
  fm_lines_add(lines, FM_ERROR, "the gate '%s' needs a step for each message: it cannot run with "
    "the policy %s", gate->name, policy);
}

void fm_add_failure(
  struct fm_lines * lines, const struct fm_action * action, uint32_t tries, const char * why)
{
  if (tries > 1) {
    fm_lines_add(lines, FM_ERROR, "the action '%s' failed %" PRIu32 " times: %s", action->name,
      tries, why);
  } else {
    fm_lines_add(lines, FM_ERROR, "the action '%s' failed: %s", action->name, why);
  }
}

// ---- the black box -----------------------------------------------------------------------------

void fm_add_blackbox_lines(struct fm_lines * lines, struct fm_blackbox_writer * writer)
{
  struct fm_blackbox_event event;
  while (fm_blackbox_writer_take(writer, &event)) {
    if (event.error == 0) {
      fm_lines_add(lines, FM_INFO, "the last messages are in %s", event.path);
    } else {
      fm_lines_add(
        lines, FM_ERROR, "the black box cannot write to %s: %s; /diagnostics counts the files "
        "that are missing", event.path, strerror(event.error));
    }
    free(event.path);
  }
}

void fm_add_blackbox_refusal(
  struct fm_lines * lines, const struct fm_blackbox_options * options, int error)
{
  if (error == ENOMEM) {
    fm_lines_add(lines, FM_ERROR, "parameter 'blackbox_bytes': no %" PRIu64 " bytes of memory",
      options->memory);
  } else {
    fm_lines_add(lines, FM_ERROR, "parameter 'blackbox': cannot write to the folder '%s': %s",
      options->folder, strerror(error));
  }
}
