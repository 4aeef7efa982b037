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

/// condition_log.c: lines about locks that are locked or free, a gate that opens or closes, with
/// the reason, and about what is wrong around the gate.

#include <inttypes.h>
#include <string.h>

#include "reasons.h"
#include "review_parts.h"

#define MOST_LINES 10u      // of one lock or gate at a look; the others are counted
#define LOGGED_S 10         // between two lines about one thing that is wrong

static void add_state(
  struct fm_text * text, const struct fm_review * review, uint32_t k, const uint8_t * conditions)
{
  const struct fm_report_table * table = review->reporter->table;
  fm_text_clear(text);
  if (k < table->n_locks) {
    fm_add_lock_state(text, review->reporter, &table->locks[k], conditions);
  } else {
    fm_add_gate_state(text, review->reporter, conditions);
  }
}

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
  const struct fm_report_table * table = review->reporter->table;
  struct fm_text text = {NULL, 0, 0};
  va_list arguments;
  va_start(arguments, format);
  fm_text_add_arguments(&text, format, arguments);
  va_end(arguments);
  fm_lines_add(lines, FM_INFO, "%s '%s' %s", k < table->n_locks ? "lock" : "gate",
    k < table->n_locks ? table->locks[k].name : table->gate->name, fm_text_get(&text));
  fm_text_free(&text);
}

static void set_logged(struct fm_review * review, uint32_t k, const struct fm_text * state)
{
  fm_text_clear(&review->conditions[k]);
  fm_text_add(&review->conditions[k], "%s", fm_text_get(state));
}

static void review_change(
  struct fm_review * review, const uint8_t * conditions, struct fm_text * state,
  struct fm_lines * lines)
{
  for (uint32_t k = 0; k < review->n_conditions; ++k) {
    add_state(state, review, k, conditions);
    if (!is_same_kind(state, &review->conditions[k])) {
      review->changes[k] += 1u;
      set_logged(review, k, state);
      if (review->changes[k] <= MOST_LINES) {
        log_of(review, k, lines, "is %s", fm_text_get(state));
      }
    }
  }
}

static void review_present(
  struct fm_review * review, struct fm_text * state, struct fm_lines * lines)
{
  for (uint32_t k = 0; k < review->n_conditions; ++k) {
    add_state(state, review, k, review->now.conditions);
    if (strcmp(fm_text_get(state), fm_text_get(&review->conditions[k])) != 0) {
      set_logged(review, k, state);
      log_of(review, k, lines, "is %s", fm_text_get(state));
    }
  }
}

// A change is that of the text up to the colon: a change of the reason alone is logged if it lasts
// until the next look.
void fm_review_conditions(struct fm_review * review, struct fm_lines * lines)
{
  const size_t bytes = fm_condition_bytes(
    review->reporter->table->n_requirements, review->reporter->monitor->n_inputs);
  const uint32_t n = review->n_conditions;
  struct fm_text state = {NULL, 0, 0};
  memset(review->changes, 0, n * sizeof(*review->changes));
  for (uint32_t k = 0; n > 0 && k < review->now.n_changes; ++k) {
    review_change(review, review->now.changes + k * bytes, &state, lines);
  }
  for (uint32_t k = 0; k < n; ++k) {
    if (review->changes[k] > MOST_LINES) {
      const uint32_t more = review->changes[k] - MOST_LINES;
      log_of(
        review, k, lines, "has changed %u time%s more since", more, more == 1u ? "" : "s");
      fm_text_clear(&review->conditions[k]);  // the present state is logged
    }
  }
  if (n > 0 && review->now.missed > 0) {
    fm_lines_add(lines, FM_INFO, "%" PRIu64 " more change%s of what locks and gates depend on "
      "came too fast to be logged", review->now.missed,
      review->now.missed == 1u ? "" : "s");
  }
  review_present(review, &state, lines);
  fm_text_free(&state);
}

void fm_review_gate(struct fm_review * review, struct fm_lines * lines)
{
  const struct fm_gate_facts * facts = review->facts.gate;
  const struct fm_report_gate * gate = review->reporter->table->gate;
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
