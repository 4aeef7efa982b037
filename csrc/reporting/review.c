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

/// review.c: see review.h for the contract.

#include <inttypes.h>
#include <stdlib.h>

#include "review_parts.h"

#define MISSING_S 5         // until requirements that are not evaluated yet are logged
#define NO_TIME_S 5         // until a missing /clock is logged
#define PERIODS_S 60        // between two log lines about late periods
#define FEWEST_LATE 3u      // late periods, and
#define MOST_LATE 0.01      // of all periods, are worth reading
#define FEWEST_JUDGED 300u  // periods; of fewer, three are too many

// ---- memory ------------------------------------------------------------------------------------

static void make_kind(struct fm_review * review, struct fm_kind_snapshot * kind, uint32_t k)
{
  struct fm_memory * memory = &review->memory;
  size_t n = 0;
  for (uint32_t r = 0; r < review->table->n_requirements; ++r) {
    n += review->table->requirements[r].kind == k ? 1u : 0u;
  }
  kind->inputs = fm_reserve(memory, review->table->kinds[k].n_inputs, sizeof(*kind->inputs));
  kind->violated = fm_reserve(memory, n, sizeof(*kind->violated));
  kind->unevaluated = fm_reserve(memory, n, sizeof(*kind->unevaluated));
  kind->nearest = fm_reserve(memory, n, sizeof(*kind->nearest));
}

static void make_snapshot(struct fm_review * review, struct fm_snapshot * snapshot)
{
  const struct fm_report_table * table = review->table;
  struct fm_memory * memory = &review->memory;
  const uint32_t n_inputs = review->reporter->monitor->n_inputs;
  const size_t bytes = fm_condition_bytes(table->n_requirements, n_inputs);
  snapshot->requirements =
    fm_reserve(memory, table->n_requirements, sizeof(*snapshot->requirements));
  snapshot->inputs = fm_reserve(memory, n_inputs, sizeof(*snapshot->inputs));
  snapshot->topics = fm_reserve(memory, table->n_topics, sizeof(*snapshot->topics));
  snapshot->conditions = fm_reserve(memory, 1, bytes);
  if (review->n_conditions > 0) {
    snapshot->changes = fm_reserve(memory, FM_MOST_CONDITIONS, bytes);
  }
  if (table->n_kinds > 0) {
    snapshot->kinds = fm_reserve(memory, table->n_kinds, sizeof(*snapshot->kinds));
  }
  for (uint32_t k = 0; snapshot->kinds != NULL && k < table->n_kinds; ++k) {
    make_kind(review, &snapshot->kinds[k], k);
  }
}

// The names of topics, as lines and statuses show them.
static void make_names(struct fm_review * review)
{
  struct fm_memory * memory = &review->memory;
  const char ** names = fm_reserve(memory, review->table->n_topics, sizeof(*names));
  struct fm_text text = {NULL, 0, 0};
  for (uint32_t k = 0; names != NULL && k < review->table->n_topics; ++k) {
    const char * where = review->table->topics[k].where;
    fm_text_clear(&text);
    fm_text_add(
      &text, "%s%s%s", review->reporter->topics[k], where[0] == '\0' ? "" : " where ", where);
    names[k] = fm_reserve_text(memory, fm_text_get(&text));
  }
  fm_text_free(&text);
  review->names = names;
}

static void make_logs(struct fm_review * review)
{
  const struct fm_report_table * table = review->table;
  struct fm_memory * memory = &review->memory;
  review->inputs = fm_reserve(memory, table->n_inputs, sizeof(*review->inputs));
  review->topics = fm_reserve(memory, table->n_topics, sizeof(*review->topics));
  review->kinds = fm_reserve(memory, table->n_kinds, sizeof(*review->kinds));
  review->flags = fm_reserve(memory, table->n_inputs, sizeof(*review->flags));
  review->conditions = fm_reserve(memory, review->n_conditions, sizeof(*review->conditions));
  review->changes = fm_reserve(memory, review->n_conditions, sizeof(*review->changes));
  review->failed = fm_reserve(memory, table->n_actions, sizeof(*review->failed));
  review->failed_before = fm_reserve(memory, table->n_actions, sizeof(*review->failed_before));
}

static void note_counts(struct fm_review * review, const struct fm_facts * facts)
{
  const struct fm_blackbox_facts none = {0, 0, 0, 0, 0};
  review->blackbox = facts->blackbox == NULL ? none : *facts->blackbox;
  for (uint32_t k = 0; facts->actions != NULL && k < review->table->n_actions; ++k) {
    review->failed[k] = facts->actions[k].failed;
  }
}

struct fm_review * fm_review_create(
  const struct fm_reporter * reporter, const struct fm_facts * facts)
{
  struct fm_review * review = calloc(1, sizeof(*review));
  if (review == NULL) {
    return NULL;
  }
  review->reporter = reporter;
  review->table = reporter->table;
  review->n_conditions = review->table->n_locks + (review->table->gate != NULL ? 1u : 0u);
  review->facts.now = review->created = review->time.began = facts->now;
  make_snapshot(review, &review->now);
  make_snapshot(review, &review->before);
  make_logs(review);
  make_names(review);
  if (review->memory.is_short) {
    fm_review_destroy(review);
    return NULL;
  }
  note_counts(review, facts);
  return review;
}

// Reads nothing of the reporter: Python frees the two in any order.
void fm_review_destroy(struct fm_review * review)
{
  if (review == NULL) {
    return;
  }
  for (uint32_t k = 0; review->conditions != NULL && k < review->n_conditions; ++k) {
    fm_text_free(&review->conditions[k]);
  }
  fm_memory_free(&review->memory);
  free(review);
}

// ---- time --------------------------------------------------------------------------------------

bool fm_are_worth_reading(const struct fm_time_counts * before, const struct fm_time_counts * now)
{
  const uint64_t late = now->late - before->late;
  return now->missed > before->missed || (late >= FEWEST_LATE &&
         (double)late > MOST_LATE * (double)(now->periods - before->periods));
}

// What ends although no message comes.
static void add_waits(const struct fm_review * review, struct fm_text * text,
  const char * separator, const char * ending, bool has_deadlines)
{
  bool has_timeouts = false;
  for (uint32_t k = 0; k < review->table->n_inputs; ++k) {
    has_timeouts = has_timeouts || review->table->inputs[k].timeout > 0.0;
  }
  const char * const waits[] = {
    review->table->policy == FM_PERIODIC ? "period" : NULL,
    review->table->policy == FM_TIMED && has_deadlines ? "deadline" : NULL,
    has_timeouts ? "timeout" : NULL};
  for (size_t k = 0; k < sizeof(waits) / sizeof(waits[0]); ++k) {
    if (waits[k] != NULL) {
      fm_text_join(text, separator, "%s%s", waits[k], ending);
    }
  }
}

static void review_clock(struct fm_review * review, struct fm_lines * lines)
{
  struct fm_time_log * log = &review->time;
  struct fm_text waits = {NULL, 0, 0};
  if (!review->facts.waits_for_clock) {
    log->began = review->facts.now;
  } else if (review->facts.now > log->began + NO_TIME_S * FM_SECOND &&
    fm_is_first(&log->is_clock_logged))
  {
    add_waits(review, &waits, " and no ", "", true);
    fm_lines_add(lines, FM_WARN, "use_sim_time is set and nothing was received on /clock%s%s%s",
      waits.length > 0 ? ": no " : "", fm_text_get(&waits), waits.length > 0 ? " passes" : "");
  }
  fm_text_free(&waits);
}

static void log_restart(const struct fm_review * review, struct fm_lines * lines)
{
  struct fm_text waits = {NULL, 0, 0};
  add_waits(review, &waits, " and ", "s", false);
  fm_lines_add(lines, FM_WARN, "time went back, to %.3f s: %s%s%s",
    (double)(review->now.time.restarted_at + review->table->reorder) / 1e9,
    fm_text_get(&waits), waits.length > 0 ? " continue from there; " : "",
    review->table->policy == FM_TIMED ? "values are kept, and the requirements start afresh" :
    "values and past of the requirements are kept");
  fm_text_free(&waits);
}

static void review_periods(struct fm_review * review, struct fm_lines * lines)
{
  struct fm_time_log * log = &review->time;
  const struct fm_time_counts * counts = &review->now.time;
  if (fm_are_worth_reading(&log->judged, counts)) {
    if (fm_passes(&log->next_line, review->facts.now, PERIODS_S * FM_SECOND)) {
      fm_lines_add(lines, FM_WARN,
        "periods of %g s since the last such message: %" PRIu64 " missed (no step), %" PRIu64
        " late by more than half a period", (double)review->table->period / 1e9,
        counts->missed - log->logged.missed, counts->late - log->logged.late);
      log->logged = log->judged = *counts;
    }
  } else if (counts->periods - log->judged.periods > FEWEST_JUDGED &&
    fm_passes(&log->next_minute, review->facts.now, PERIODS_S * FM_SECOND))
  {
    log->judged = *counts;  // else a long good run would hide many late ones after it
  }
}

static void review_time(struct fm_review * review, struct fm_lines * lines)
{
  const struct fm_time_counts * counts = &review->now.time;
  review_clock(review, lines);
  if (counts->restarts > review->before.time.restarts) {
    log_restart(review, lines);
  }
  if (counts->overflows > review->before.time.overflows &&
    fm_passes(&review->time.next_line, review->facts.now, PERIODS_S * FM_SECOND))
  {
    fm_lines_add(lines, FM_WARN,
      "%" PRIu64 " changes found no room in a window: inputs change, or messages come, more often "
      "than their max_rate; what reads the window is violated until the lost changes have left it",
      counts->overflows);
  }
  if (review->table->policy == FM_PERIODIC) {
    review_periods(review, lines);
  }
}

// ---- once a second -----------------------------------------------------------------------------

static void note_facts(struct fm_review * review, const struct fm_facts * facts)
{
  const int64_t since = facts->now - review->facts.now;
  uint64_t * failed = review->failed_before;
  review->seconds = since < FM_SECOND / 1000 ? 1e-3 : (double)since / 1e9;
  review->blackbox_before = review->blackbox;
  review->failed_before = review->failed;
  review->failed = failed;
  note_counts(review, facts);
  review->facts = *facts;
}

const struct fm_snapshot * fm_review_look(
  struct fm_review * review, const struct fm_facts * facts)
{
  const struct fm_snapshot before = review->before;
  review->before = review->now;
  review->now = before;
  fm_engine_snapshot(review->reporter->engine, &review->now);
  note_facts(review, facts);
  return &review->now;
}

void fm_review_log(struct fm_review * review, struct fm_lines * lines)
{
  review_time(review, lines);
  fm_review_silences(review, lines);
  fm_review_gate(review, lines);
  fm_review_conditions(review, lines);
  fm_review_topics(review, lines);
  fm_review_instances(review, lines);
  fm_add_left_out(lines, &review->links_logged, &review->now.links);
  review->links_logged = review->now.links;
  if (review->now.unpublished > 0 && fm_is_first(&review->is_unpublished_logged)) {
    fm_lines_add(lines, FM_ERROR,
      "violations could not be published: %" PRIu64 " so far; /diagnostics counts them",
      review->now.unpublished);
  }
  if (review->facts.now - review->created >= MISSING_S * FM_SECOND &&
    fm_is_first(&review->is_missing_logged))
  {
    fm_review_missing(review, lines);
  }
}
