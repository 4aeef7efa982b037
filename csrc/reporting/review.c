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
#include <string.h>

#include "review_parts.h"

#define MISSING_S 5  // until requirements that are not evaluated yet are logged

// ---- memory ------------------------------------------------------------------------------------

static bool make_kind(
  struct fm_kind_snapshot * kind, const struct fm_report_table * table, uint32_t k)
{
  size_t n = 1;
  for (uint32_t r = 0; r < table->n_requirements; ++r) {
    n += table->requirements[r].kind == k ? 1u : 0u;
  }
  kind->inputs = calloc(table->kinds[k].n_inputs + (size_t)1, sizeof(*kind->inputs));
  kind->violated = calloc(n, sizeof(*kind->violated));
  kind->unevaluated = calloc(n, sizeof(*kind->unevaluated));
  kind->nearest = calloc(n, sizeof(*kind->nearest));
  return kind->inputs != NULL && kind->violated != NULL && kind->unevaluated != NULL &&
         kind->nearest != NULL;
}

static bool make_kinds(struct fm_snapshot * snapshot, const struct fm_report_table * table)
{
  bool is_good = true;
  if (table->n_kinds == 0) {
    return true;
  }
  snapshot->kinds = calloc(table->n_kinds, sizeof(*snapshot->kinds));
  for (uint32_t k = 0; snapshot->kinds != NULL && k < table->n_kinds; ++k) {
    is_good = make_kind(&snapshot->kinds[k], table, k) && is_good;
  }
  return snapshot->kinds != NULL && is_good;
}

static bool make_snapshot(
  struct fm_snapshot * snapshot, const struct fm_reporter * reporter, bool has_changes)
{
  const struct fm_monitor * monitor = reporter->monitor;
  const uint32_t n_requirements = reporter->table->n_requirements;
  const size_t bytes = fm_condition_bytes(n_requirements, monitor->n_inputs);
  snapshot->requirements = calloc(n_requirements + (size_t)1, sizeof(*snapshot->requirements));
  snapshot->inputs = calloc(monitor->n_inputs + (size_t)1, sizeof(*snapshot->inputs));
  snapshot->topics =
    calloc(reporter->table->n_topics + (size_t)1, sizeof(*snapshot->topics));
  snapshot->conditions = calloc(1, bytes);
  snapshot->changes = has_changes ? calloc(FM_MOST_CONDITIONS, bytes) : NULL;
  return snapshot->requirements != NULL && snapshot->inputs != NULL && snapshot->topics != NULL &&
         snapshot->conditions != NULL && (snapshot->changes != NULL || !has_changes) &&
         make_kinds(snapshot, reporter->table);
}

static void free_snapshot(struct fm_snapshot * snapshot, uint32_t n_kinds)
{
  for (uint32_t k = 0; snapshot->kinds != NULL && k < n_kinds; ++k) {
    free(snapshot->kinds[k].inputs);
    free(snapshot->kinds[k].violated);
    free(snapshot->kinds[k].unevaluated);
    free(snapshot->kinds[k].nearest);
  }
  free(snapshot->kinds);
  free(snapshot->requirements);
  free(snapshot->inputs);
  free(snapshot->topics);
  free(snapshot->conditions);
  free(snapshot->changes);
}

static bool make_logs(struct fm_review * review, const struct fm_report_table * table)
{
  const size_t n_actions = table->n_actions + (size_t)1;
  const size_t n = review->n_conditions + (size_t)1;
  review->inputs = calloc(table->n_inputs + (size_t)1, sizeof(*review->inputs));
  review->topics = calloc(table->n_topics + (size_t)1, sizeof(*review->topics));
  review->kinds = calloc(table->n_kinds + (size_t)1, sizeof(*review->kinds));
  review->flags = calloc(2 * (size_t)table->n_inputs + 1, sizeof(*review->flags));
  review->conditions = calloc(n, sizeof(*review->conditions));
  review->changes = calloc(n, sizeof(*review->changes));
  review->failed = calloc(n_actions, sizeof(*review->failed));
  review->failed_before = calloc(n_actions, sizeof(*review->failed_before));
  return review->inputs != NULL && review->topics != NULL && review->kinds != NULL &&
         review->flags != NULL &&
         review->conditions != NULL && review->changes != NULL && review->failed != NULL &&
         review->failed_before != NULL;
}

static void note_counts(struct fm_review * review, const struct fm_facts * facts)
{
  const struct fm_blackbox_facts none = {0, 0, 0, 0, 0};
  review->blackbox = facts->blackbox == NULL ? none : *facts->blackbox;
  for (uint32_t k = 0; facts->actions != NULL && k < review->reporter->table->n_actions; ++k) {
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
  review->n_kinds = reporter->table->n_kinds;
  review->n_conditions = reporter->table->n_locks + (reporter->table->gate != NULL ? 1u : 0u);
  review->facts.now = review->created = review->time.began = facts->now;
  const bool has_changes = review->n_conditions > 0;
  if (!make_snapshot(&review->now, reporter, has_changes) ||
    !make_snapshot(&review->before, reporter, has_changes) ||
    !make_logs(review, reporter->table))
  {
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
  free_snapshot(&review->now, review->n_kinds);
  free_snapshot(&review->before, review->n_kinds);
  free(review->kinds);
  free(review->inputs);
  free(review->topics);
  free(review->flags);
  free(review->conditions);
  free(review->changes);
  free(review->failed);
  free(review->failed_before);
  free(review);
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
  fm_review_time(review, lines);
  fm_review_silences(review, lines);
  fm_review_gate(review, lines);
  fm_review_conditions(review, lines);
  fm_review_topics(review, lines);
  fm_review_instances(review, lines);
  fm_add_left_out(lines, &review->links_logged, &review->now.links);
  review->links_logged = review->now.links;
  if (review->now.unpublished > 0 && !review->is_unpublished_logged) {
    review->is_unpublished_logged = true;
    fm_lines_add(lines, FM_ERROR,
      "violations could not be published: %" PRIu64 " so far; /diagnostics counts them",
      review->now.unpublished);
  }
  if (!review->is_missing_logged && review->facts.now - review->created >= MISSING_S * FM_SECOND) {
    review->is_missing_logged = true;
    fm_review_missing(review, lines);
  }
}
