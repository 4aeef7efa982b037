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

/// condition_log.c: locks and gates in words: what they are and why, each change, and what is
/// wrong around a gate.

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "review_parts.h"

static uint8_t flags_of_requirement(const uint8_t * conditions, uint32_t requirement)
{
  return conditions[FM_CONDITION_BYTES + requirement];
}

static uint8_t flags_of_input(
  const struct fm_reporter * reporter, const uint8_t * conditions, uint32_t input)
{
  return conditions[FM_CONDITION_BYTES + reporter->table->n_requirements + input];
}

bool fm_is_withheld_from_start(
  const struct fm_reporter * reporter, const uint8_t * conditions, uint32_t requirement)
{
  return reporter->table->gate != NULL &&
         (flags_of_requirement(conditions, requirement) & FM_WAS_ALWAYS_FALSE) != 0;
}

// Add a reason: what is so of the names that were found.
static void add_reason(struct fm_text * why, const char * what, struct fm_text * names)
{
  if (names->length > 0) {
    fm_text_join(why, "; ", "%s%s", what, fm_text_get(names));
  }
  fm_text_clear(names);
}

// Add the inputs among the chosen that have no value, and if `with_silent` those that are silent.
// Returns whether there are any.
static bool add_missing(
  struct fm_text * why, const struct fm_reporter * reporter, const uint8_t * conditions,
  const bool * is_chosen, bool with_silent)
{
  const size_t before = why->length;
  struct fm_text names = {NULL, 0, 0};
  for (int silent = 0; silent <= (with_silent ? 1 : 0); ++silent) {
    for (uint32_t i = 0; i < reporter->monitor->n_inputs; ++i) {
      const unsigned flags = flags_of_input(reporter, conditions, i);
      if (is_chosen[i] && (silent != 0 ? flags == (FM_HAS_VALUE | FM_IS_SILENT) :
        (flags & FM_HAS_VALUE) == 0))
      {
        fm_text_join(&names, ", ", "%s", reporter->table->inputs[i].name);
      }
    }
    add_reason(why, silent != 0 ? "no message for " : "no value yet of ", &names);
  }
  fm_text_free(&names);
  return why->length > before;
}

// ---- locks -------------------------------------------------------------------------------------

// The inputs of the bundle's scope on which a requirement depends: those of its group. One of
// instances shows none: each has values of its own.
static const struct fm_group * group_of(const struct fm_reporter * reporter, uint32_t requirement)
{
  static const struct fm_group none;
  return requirement >= reporter->monitor->n_requirements ? &none :
         &reporter->monitor->groups[reporter->monitor->requirements[requirement].group];
}

static bool is_explained(
  const struct fm_reporter * reporter, const uint8_t * conditions, uint32_t requirement)
{
  const struct fm_group * group = group_of(reporter, requirement);
  for (uint32_t k = 0; k < group->n_inputs; ++k) {
    const unsigned flags = flags_of_input(reporter, conditions, group->inputs[k]);
    if ((flags & FM_HAS_VALUE) == 0 || (flags & FM_IS_SILENT) != 0) {
      return true;
    }
  }
  return false;
}

static void add_why_locked(
  struct fm_text * why, const struct fm_reporter * reporter, const struct fm_report_lock * lock,
  const uint8_t * conditions, bool * is_read)
{
  struct fm_text violated = {NULL, 0, 0};
  struct fm_text unexplained = {NULL, 0, 0};
  for (uint32_t k = 0; k < lock->n_requirements; ++k) {
    const uint32_t r = lock->requirements[k];
    const unsigned state = flags_of_requirement(conditions, r) & FM_STATE_MASK;
    if (state == FM_HOLDS) {
      continue;
    }
    for (uint32_t i = 0; i < group_of(reporter, r)->n_inputs; ++i) {
      is_read[group_of(reporter, r)->inputs[i]] = true;
    }
    if (state == FM_VIOLATED) {
      fm_text_join(&violated, ", ", "%s", reporter->table->requirements[r].id);
    } else if (!is_explained(reporter, conditions, r)) {
      fm_text_join(&unexplained, ", ", "%s", reporter->table->requirements[r].id);
    }
  }
  add_reason(why, "violated: ", &violated);
  (void)add_missing(why, reporter, conditions, is_read, true);
  add_reason(
    why, "not evaluated since the start, ~/reset or a pause of this node: ", &unexplained);
  fm_text_free(&violated);
  fm_text_free(&unexplained);
}

// ---- the gate ----------------------------------------------------------------------------------

static void add_requirements(
  struct fm_text * why, const struct fm_reporter * reporter, const uint8_t * conditions,
  unsigned flag, const char * what)
{
  struct fm_text names = {NULL, 0, 0};
  for (uint32_t r = 0; r < reporter->monitor->n_requirements; ++r) {
    if ((flags_of_requirement(conditions, r) & flag) != 0) {
      fm_text_join(&names, ", ", "%s", reporter->table->requirements[r].id);
    }
  }
  add_reason(why, what, &names);
  fm_text_free(&names);
}

static void add_why_closed(
  struct fm_text * why, const struct fm_reporter * reporter, const uint8_t * conditions,
  bool * is_other)
{
  const struct fm_report_table * table = reporter->table;
  memset(is_other, 1, reporter->monitor->n_inputs);
  for (uint32_t k = 0; table->gate->topic < table->n_topics &&
    k < table->topic_inputs[table->gate->topic].n_inputs; ++k)
  {
    is_other[table->topic_inputs[table->gate->topic].inputs[k]] = false;
  }
  const bool is_missing =
    add_missing(why, reporter, conditions, is_other, !table->gate->passes_silent);
  if (conditions[FM_GATE_IS_KNOWN] == 0 && !is_missing) {
    fm_text_join(
      why, "; ", "this node stood still: whether an input is silent is not known yet");
  }
  if (conditions[FM_GATE_IS_LATCHED] != 0 && table->gate->open_after > 0) {
    fm_text_join(why, "; ", "latched by a violation, until %g s without a violation",
      (double)table->gate->open_after / 1e9);
  } else if (conditions[FM_GATE_IS_LATCHED] != 0) {
    fm_text_join(why, "; ", "latched by a violation, until ~/reset");
  }
  add_requirements(why, reporter, conditions, FM_IS_FALSE, "violated: ");
  add_requirements(
    why, reporter, conditions, FM_WAS_ALWAYS_FALSE, "violated since the first message: ");
}

bool fm_add_state(
  struct fm_text * text, const struct fm_reporter * reporter, const struct fm_report_lock * lock,
  const uint8_t * conditions)
{
  struct fm_text why = {NULL, 0, 0};
  bool * is_chosen = calloc(reporter->monitor->n_inputs + (size_t)1, sizeof(*is_chosen));
  if (is_chosen != NULL) {
    if (lock != NULL) {
      add_why_locked(&why, reporter, lock, conditions, is_chosen);
    } else {
      add_why_closed(&why, reporter, conditions, is_chosen);
    }
  }
  free(is_chosen);
  const bool is_good = why.length == 0;
  if (is_good) {
    fm_text_add(text, lock != NULL ? "free" : "open");
  } else {
    fm_text_add(text, lock != NULL ? "locked: %s" : "closed: %s", fm_text_get(&why));
  }
  fm_text_free(&why);
  return is_good;
}

void fm_add_others(
  struct fm_text * text, const struct fm_report_gate * gate, const struct fm_gate_facts * facts)
{
  if (gate->is_service) {
    fm_text_add(text, "%s has another server", facts->place);
  } else {
    fm_text_add(text, "%s publishes on %s too", facts->others, facts->place);
  }
}

// ---- the log -----------------------------------------------------------------------------------

#define MOST_LINES 10u      // of one lock or gate at a look; the others are counted
#define LOGGED_S 10         // between two lines about one thing that is wrong

static bool is_same_kind(const struct fm_text * one, const struct fm_text * other)
{
  const char * text = fm_text_get(one);
  const size_t length = strcspn(text, ":");
  return strncmp(text, fm_text_get(other), length) == 0 &&
         strcspn(fm_text_get(other), ":") == length;
}

FM_PRINTF(4, 5)
static void log_of(
  const struct fm_review * review, uint32_t k, struct fm_lines * lines, const char * format, ...)
{
  const struct fm_report_table * table = review->table;
  struct fm_text text = {NULL, 0, 0};
  va_list arguments;
  va_start(arguments, format);
  fm_text_add_arguments(&text, format, arguments);
  va_end(arguments);
  fm_lines_add(lines, FM_INFO, "%s '%s' %s", k < table->n_locks ? "lock" : "gate",
    k < table->n_locks ? table->locks[k].name : table->gate->name, fm_text_get(&text));
  fm_text_free(&text);
}

// Log the states that differ from those that were logged: up to the colon, or also in the reason.
static void review_states(
  struct fm_review * review, const uint8_t * conditions, bool with_reason, struct fm_text * state,
  struct fm_lines * lines)
{
  for (uint32_t k = 0; k < review->n_conditions; ++k) {
    struct fm_text * logged = &review->conditions[k];
    fm_text_clear(state);
    (void)fm_add_state(state, review->reporter,
      k < review->table->n_locks ? &review->table->locks[k] : NULL, conditions);
    if (with_reason ? strcmp(fm_text_get(state), fm_text_get(logged)) == 0 :
      is_same_kind(state, logged))
    {
      continue;
    }
    fm_text_clear(logged);
    fm_text_add(logged, "%s", fm_text_get(state));
    review->changes[k] += 1u;
    if (review->changes[k] <= MOST_LINES) {
      log_of(review, k, lines, "is %s", fm_text_get(state));
    }
  }
}

// A change is that of the text up to the colon: a change of the reason alone is logged if it lasts
// until the next look.
void fm_review_conditions(struct fm_review * review, struct fm_lines * lines)
{
  const size_t bytes = fm_condition_bytes(
    review->table->n_requirements, review->reporter->monitor->n_inputs);
  const uint32_t n = review->n_conditions;
  struct fm_text state = {NULL, 0, 0};
  memset(review->changes, 0, n * sizeof(*review->changes));
  for (uint32_t k = 0; n > 0 && k < review->now.n_changes; ++k) {
    review_states(review, review->now.changes + k * bytes, false, &state, lines);
  }
  for (uint32_t k = 0; k < n; ++k) {
    if (review->changes[k] > MOST_LINES) {
      const uint32_t more = review->changes[k] - MOST_LINES;
      log_of(review, k, lines, "has changed %u time%s more since", more, more == 1u ? "" : "s");
      fm_text_clear(&review->conditions[k]);  // the present state is logged
    }
  }
  if (n > 0 && review->now.missed > 0) {
    fm_lines_add(lines, FM_INFO, "%" PRIu64 " more change%s of what locks and gates depend on "
      "came too fast to be logged", review->now.missed,
      review->now.missed == 1u ? "" : "s");
  }
  memset(review->changes, 0, n * sizeof(*review->changes));
  review_states(review, review->now.conditions, true, &state, lines);
  fm_text_free(&state);
}

void fm_review_gate(struct fm_review * review, struct fm_lines * lines)
{
  const struct fm_gate_facts * facts = review->facts.gate;
  const struct fm_report_gate * gate = review->table->gate;
  const int64_t now = review->facts.now;
  struct fm_gate_log * log = &review->gate;
  if (gate == NULL || facts == NULL) {
    return;
  }
  if (facts->others[0] != '\0' && fm_passes(&log->next_others, now, LOGGED_S * FM_SECOND)) {
    struct fm_text others = {NULL, 0, 0};
    fm_add_others(&others, gate, facts);
    fm_lines_add(lines, FM_ERROR, "gate '%s': %s: what does not pass the gate is not judged",
      gate->name, fm_text_get(&others));
    fm_text_free(&others);
  }
  if (!gate->is_service && facts->unsent > log->unsent &&
    fm_passes(&log->next_unsent, now, LOGGED_S * FM_SECOND))
  {
    log->unsent = facts->unsent;
    fm_lines_add(lines, FM_ERROR, "gate '%s': %" PRIu64 " messages could not be published",
      gate->name, facts->unsent);
  }
  if (review->now.gate.violating > review->before.gate.violating &&
    fm_passes(&log->next_violating, now, LOGGED_S * FM_SECOND))
  {
    fm_lines_add(lines, FM_WARN, "gate '%s': a requirement is violated after the substitute, too: "
      "the substitute itself violates it, or nothing on this topic satisfies it now",
      gate->name);
  }
}
