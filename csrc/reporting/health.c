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

/// health.c: the statuses on `/diagnostics`.

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "details.h"
#include "figures.h"
#include "review_parts.h"

enum
{
  OK = FM_STATUS_OK,
  WARN = FM_STATUS_WARN,
  ERROR = FM_STATUS_ERROR,
  MOST_BEHIND = 1000000000  // ns
};

// A status that is being made, of a review.
struct report
{
  const struct fm_review * review;
  struct fm_statuses * list;
};

static struct fm_status * add_status(
  const struct report * report, uint8_t level, const char * kind, const char * name,
  const char * message)
{
  struct fm_text text = {NULL, 0, 0};
  fm_text_add(&text, "%s: %s%s", report->review->reporter->node, kind, name);
  struct fm_status * status = fm_statuses_add(
    report->list, (enum fm_status_level)level, fm_text_get(&text), message,
    report->review->table->component);
  fm_text_free(&text);
  return status;
}

static void add_count(struct fm_status * status, const char * key, uint64_t count)
{
  fm_status_value(status, key, "%" PRIu64, count);
}

// ---- requirements ------------------------------------------------------------------------------

// List the silent inputs of a requirement; with `stale: violate` alone, if so.
static void list_silent(
  struct fm_text * names, const struct fm_review * review,
  const struct fm_report_requirement * requirement, bool that_violate)
{
  for (uint32_t k = 0; k < requirement->n_inputs; ++k) {
    const struct fm_report_input * input = &review->table->inputs[requirement->inputs[k]];
    const struct fm_silence * silence = &review->now.inputs[requirement->inputs[k]].silence;
    if (input->is_timed_out && silence->is_silent && (input->violates || !that_violate)) {
      fm_text_join(names, ", ", "%s", input->name);
    }
  }
}

static uint8_t describe_requirement(
  const struct fm_review * review, uint32_t requirement, struct fm_text * message)
{
  const struct fm_report_requirement * about = &review->table->requirements[requirement];
  const struct fm_requirement_counts * counts = &review->now.requirements[requirement];
  struct fm_text silent = {NULL, 0, 0};
  const uint8_t violated = about->is_warning ? WARN : ERROR;
  uint8_t level = WARN;
  list_silent(&silent, review, about, counts->is_violated);
  if (silent.length > 0 && counts->is_violated) {
    level = violated;
    fm_text_add(message, "violated: no message for %s", fm_text_get(&silent));
  } else if (fm_is_withheld_from_start(review->reporter, review->now.conditions, requirement)) {
    level = violated;
    fm_text_add(message, "violated since the first message");
  } else if (fm_add_missing(message, review, about)) {
    level = WARN;
  } else if (counts->steps == 0) {
    fm_text_add(message, "not evaluated yet");
  } else if (silent.length > 0) {
    fm_text_add(message, "satisfied, on old values of %s", fm_text_get(&silent));
  } else {
    level = counts->is_violated ? violated : OK;
    if (counts->test.test != NULL) {
      fm_add_trials_text(message, &counts->test);
    } else {
      fm_text_add(message, "%s", counts->is_violated ? "violated" : "satisfied");
    }
  }
  fm_text_free(&silent);
  return level;
}

static void add_margin(
  const struct fm_review * review, uint32_t requirement, struct fm_status * status)
{
  const struct fm_margin * margin = &review->now.requirements[requirement].margin;
  const uint32_t kind = review->table->requirements[requirement].kind;
  struct fm_text text = {NULL, 0, 0};
  if (!isfinite(margin->value)) {
    return;
  }
  fm_text_add_float(&text, margin->value, false);
  fm_status_text(status, "margin", &text);
  fm_text_add(&text, "%s (", fm_comparison_of(review->table, kind, margin->comparison));
  fm_text_add_float(&text, margin->distance, false);
  fm_text_add(&text, ")");
  fm_status_text(status, "margin by", &text);
  if (kind != FM_BUNDLE) {
    fm_add_nearest(review, requirement, &text);
    fm_status_text(status, "margin of", &text);
  }
  fm_text_free(&text);
}

static void add_requirement(const struct report * report, uint32_t requirement)
{
  const struct fm_report_table * table = report->review->table;
  const struct fm_report_requirement * about = &table->requirements[requirement];
  const struct fm_requirement_counts * counts = &report->review->now.requirements[requirement];
  const bool is_timed = table->policy == FM_TIMED;
  const bool has_instances = about->kind != FM_BUNDLE;
  struct fm_text message = {NULL, 0, 0};
  const uint8_t level = has_instances ?
    (uint8_t)fm_describe_instances(report->review, requirement, &message) :
    describe_requirement(report->review, requirement, &message);
  struct fm_status * status = add_status(report, level, "", about->id, fm_text_get(&message));
  if (has_instances) {
    fm_add_instances(report->review, requirement, status);
  }
  add_count(status, is_timed ? "evaluations" : "steps", counts->steps);
  add_count(status, is_timed ? "violating evaluations" : "violations", counts->violations);
  add_count(status, "announced", counts->announced);
  if (about->shows_verdict) {
    fm_status_value(status, "verdict", "%s", counts->verdict ? "true" : "false");
  }
  fm_add_trials(status, &counts->test);
  add_margin(report->review, requirement, status);
  fm_status_value(status, "text", "%s", about->text);
  fm_text_free(&message);
}

// ---- topics ------------------------------------------------------------------------------------

// What is wrong, and the highest level of it.
struct troubles
{
  struct fm_text text;
  uint8_t level;
};

FM_PRINTF(3, 4)
static void add_trouble(struct troubles * troubles, uint8_t level, const char * format, ...)
{
  va_list arguments;
  fm_text_add(&troubles->text, "%s", troubles->text.length > 0 ? "; " : "");
  va_start(arguments, format);
  fm_text_add_arguments(&troubles->text, format, arguments);
  va_end(arguments);
  troubles->level = level > troubles->level ? level : troubles->level;
}

// The status of what has troubles, or is `good`; frees their text.
static struct fm_status * add_judged(
  const struct report * report, struct troubles * troubles, const char * kind, const char * name,
  const char * good)
{
  struct fm_status * status = add_status(
    report, troubles->level, kind, name,
    troubles->text.length > 0 ? fm_text_get(&troubles->text) : good);
  fm_text_free(&troubles->text);
  return status;
}

// Add a list of what is wrong after its `what`, unless it is empty; frees it.
static void add_listed(
  struct troubles * troubles, uint8_t level, const char * what, struct fm_text * list)
{
  if (list->length > 0) {
    add_trouble(troubles, level, "%s%s", what, fm_text_get(list));
  }
  fm_text_free(list);
}

static void add_silence(
  const struct fm_review * review, const struct fm_topic * fed, struct troubles * troubles)
{
  struct fm_text text = {NULL, 0, 0};
  uint8_t level = OK;
  char seconds[32] = "";
  for (uint32_t k = 0; k < fed->n_inputs; ++k) {
    const struct fm_report_input * input = &review->table->inputs[fed->inputs[k]];
    const struct fm_silence * silence = &review->now.inputs[fed->inputs[k]].silence;
    if (input->is_timed_out && silence->is_silent) {
      char lasted[32];
      (void)snprintf(lasted, sizeof(lasted), "%.1f", (double)silence->lasted / 1e9);
      if (strcmp(lasted, seconds) != 0) {
        fm_text_add(&text, "%sfor %s s of ", text.length > 0 ? ", " : "", lasted);
      } else {
        fm_text_add(&text, ", ");
      }
      memcpy(seconds, lasted, sizeof(seconds));
      fm_text_add(&text, "%s", input->name);
      level = input->violates ? ERROR : level == OK ? WARN : level;
    }
  }
  add_listed(troubles, level, "nothing ", &text);
}

static void add_fields(
  const struct fm_review * review, uint32_t topic, struct troubles * troubles)
{
  struct fm_text unusable = {NULL, 0, 0};
  struct fm_text absent = {NULL, 0, 0};
  struct fm_fed fed;
  for (uint32_t k = 0; fm_find_fed(review, topic, k, &fed); ++k) {
    if (fed.new_unusable > 0) {
      fm_text_join(&unusable, ", ", "%s", fed.about->name);
    }
    if (fed.kind == FM_BUNDLE && review->inputs[fed.input].is_absent_logged) {
      fm_text_join(&absent, ", ", "%s", fed.about->name);
    }
  }
  add_listed(troubles, WARN, "fields cannot be used: ", &unusable);
  add_listed(troubles, WARN, "no message has had the names for 10 s: ", &absent);
}

static void add_increase(
  struct troubles * troubles, uint8_t level, uint64_t before, uint64_t now, const char * what)
{
  if (now > before) {
    add_trouble(troubles, level, "%" PRIu64 " %s since the last report", now - before, what);
  }
}

// Of a topic whose messages are made: what was seen in the graph, or where the chain is broken.
static void add_made(
  const struct fm_review * review, uint32_t topic, struct troubles * troubles)
{
  const struct fm_observed * observed = &review->now.topics[topic].observed;
  struct fm_text text = {NULL, 0, 0};
  uint8_t level = WARN;
  if (fm_is_of_graph(review->reporter, topic)) {
    fm_add_seen(&text, review->reporter, topic, observed);
    level = observed->fault == FM_OTHER_TYPE ? ERROR : fm_is_seen_wrong(observed) ? WARN : OK;
  } else {
    (void)fm_add_missing_link(&text, review->reporter, topic);
  }
  add_listed(troubles, level, "", &text);
}

static struct troubles troubles_of(const struct fm_review * review, uint32_t topic)
{
  const struct fm_publishers * facts = &review->facts.topics[topic];
  const struct fm_topic * fed = &review->table->topic_inputs[topic];
  const struct fm_topic_snapshot * before = &review->before.topics[topic];
  const struct fm_topic_snapshot * now = &review->now.topics[topic];
  struct troubles found = {{NULL, 0, 0}, OK};
  if (facts->other_types[0] != '\0') {
    add_trouble(&found, ERROR, "a publisher of %s, and not %s", facts->other_types,
      review->table->topics[topic].type);
  }
  if (facts->unmatched[0] != '\0') {
    add_trouble(&found, ERROR, "not received: %s", facts->unmatched);
  }
  add_silence(review, fed, &found);
  add_fields(review, topic, &found);
  add_increase(&found, WARN, before->lost, now->lost, "lost");
  add_increase(&found, WARN, before->order.late, now->order.late, "late");
  add_increase(&found, WARN, before->order.overflows, now->order.overflows, "too early");
  add_increase(&found, WARN, before->order.ahead, now->order.ahead, "ahead of the clock");
  if (now->behind > MOST_BEHIND) {
    add_trouble(&found, WARN, "evaluated up to %.1f s after reception", (double)now->behind / 1e9);
  }
  if (review->table->topics[topic].kind != FM_TOPIC) {
    add_made(review, topic, &found);
  } else if (facts->n == 0 && facts->other_types[0] == '\0') {
    // The other one of /tf and /tf_static may be enough; a transform says what it lacks.
    struct fm_fed unused;
    const bool feeds_any = fm_find_fed(review, topic, 0, &unused);
    add_trouble(&found, feeds_any ? WARN : OK, "no publisher");
  }
  return found;
}

static void add_count_of_input(
  struct fm_status * status, const char * what, const struct fm_report_input * input,
  uint64_t count)
{
  struct fm_text key = {NULL, 0, 0};
  fm_text_add(&key, "%s %s", what, input->name);
  add_count(status, fm_text_get(&key), count);
  fm_text_free(&key);
}

// First what could not be used, where something could not, then the silences.
static void add_counts_of_inputs(
  const struct fm_review * review, uint32_t topic, struct fm_status * status)
{
  struct fm_fed fed;
  for (uint32_t k = 0; fm_find_fed(review, topic, k, &fed); ++k) {
    if (fed.unusable > 0) {
      add_count_of_input(status, "unusable", fed.about, fed.unusable);
    }
  }
  for (uint32_t k = 0; fm_find_fed(review, topic, k, &fed); ++k) {
    if (fed.about->is_timed_out) {
      add_count_of_input(status, "silences", fed.about, fed.silences);
    }
  }
}

static void add_topic(const struct report * report, uint32_t topic)
{
  const struct fm_review * review = report->review;
  const struct fm_report_table * table = review->table;
  const struct fm_topic_snapshot * now = &review->now.topics[topic];
  struct troubles troubles = troubles_of(review, topic);
  struct fm_text name = {NULL, 0, 0};
  fm_text_add(&name, "%s%s%s", review->names[topic],
    table->is_one_of_several ? " for " : "", table->is_one_of_several ? table->bundle : "");
  const bool is_made = table->topics[topic].kind != FM_TOPIC;
  const bool is_seen = fm_is_of_graph(review->reporter, topic);
  struct fm_status * status = add_judged(
    report, &troubles, is_seen ? "graph " : is_made ? "transform " : "topic ", fm_text_get(&name),
    "received");
  if (is_seen && table->topics[topic].kind != FM_PARAMETER) {
    fm_status_value(status, "seen", "%" PRId64, now->observed.value);
  }
  add_count(status, "received", now->counts.messages);
  fm_status_value(status, "rate", "%.1f",
    (double)(now->counts.messages - review->before.topics[topic].counts.messages) /
    review->seconds);
  if (!is_made) {
    add_count(status, "undecodable", now->counts.undecodable);
    add_count(status, "lost", now->lost);
  }
  fm_status_value(status, "behind", "%.3f", (double)now->behind / 1e9);
  if (!is_made) {
    add_count(status, "publishers", review->facts.topics[topic].n);
  }
  if (table->uses_header_stamps) {
    add_count(status, "late", now->order.late);
    add_count(status, "too early", now->order.overflows);
    add_count(status, "ahead", now->order.ahead);
  }
  add_counts_of_inputs(review, topic, status);
  fm_text_free(&name);
}

// ---- what acts ---------------------------------------------------------------------------------

static void add_gate(const struct report * report)
{
  const struct fm_review * review = report->review;
  const struct fm_report_gate * gate = review->table->gate;
  const struct fm_gate_facts * facts = review->facts.gate;
  const struct fm_gate_counts * counts = &review->now.gate;
  struct fm_text message = {NULL, 0, 0};
  if (gate == NULL || facts == NULL) {
    return;
  }
  uint8_t level =
    fm_add_state(&message, review->reporter, NULL, review->now.conditions) ? OK : WARN;
  if (facts->others[0] != '\0') {
    level = ERROR;
    fm_text_clear(&message);
    fm_add_others(&message, gate, facts);
  }
  struct fm_status * status =
    add_status(report, level, "gate ", gate->name, fm_text_get(&message));
  add_count(status, "passed", counts->passed);
  add_count(
    status, "withheld", counts->violates + counts->closed + counts->latched + counts->unreadable);
  add_count(status, "withheld, violating", counts->violates);
  add_count(status, "withheld, closed", counts->closed);
  add_count(status, "withheld, latched", counts->latched);
  add_count(status, "withheld, unreadable", counts->unreadable);
  add_count(status, "replaced", counts->replaced);
  add_count(status, "replaced, violating", counts->violating);
  add_count(status, gate->is_service ? "not answered" : "not published", facts->unsent);
  fm_text_free(&message);
}

static void add_action(const struct report * report, uint32_t action)
{
  const struct fm_review * review = report->review;
  const struct fm_action_facts * counts = &review->facts.actions[action];
  struct troubles troubles = {{NULL, 0, 0}, OK};
  add_increase(
    &troubles, ERROR, review->failed_before[action], review->failed[action], "failed");
  struct fm_status * status = add_judged(
    report, &troubles, "action ", review->table->actions[action].name, "ready");
  add_count(status, "started", counts->started);
  add_count(status, "sent", counts->sent);
  add_count(status, "failed", counts->failed);
  add_count(status, "skipped", counts->skipped);
}

static void add_lock(const struct report * report, const struct fm_report_lock * lock)
{
  struct fm_text state = {NULL, 0, 0};
  const bool is_free =
    fm_add_state(&state, report->review->reporter, lock, report->review->now.conditions);
  (void)add_status(report, is_free ? OK : WARN, "lock ", lock->name, fm_text_get(&state));
  fm_text_free(&state);
}

static void add_blackbox(const struct report * report)
{
  const struct fm_blackbox_facts * before = &report->review->blackbox_before;
  const struct fm_blackbox_facts * now = &report->review->blackbox;
  struct troubles troubles = {{NULL, 0, 0}, OK};
  if (now->failed > before->failed) {
    add_trouble(&troubles, WARN, "cannot write");
  }
  if (now->left_out > before->left_out) {
    add_trouble(&troubles, WARN, "messages are larger than `blackbox_bytes`");
  }
  if (now->early > before->early) {
    add_trouble(&troubles, WARN, "`blackbox_bytes` is too little for `blackbox_seconds`");
  }
  struct fm_status * status = add_judged(
    report, &troubles, "black box of ", report->review->table->bundle,
    "keeps the last messages");
  add_count(status, "written", now->written);
  add_count(status, "not written", now->failed);
  add_count(status, "kept", now->kept);
  add_count(status, "left out", now->left_out);
  add_count(status, "overwritten early", now->early);
}

// ---- time, violations, failures ----------------------------------------------------------------

static void add_time(const struct report * report)
{
  const struct fm_time_counts * before = &report->review->before.time;
  const struct fm_time_counts * now = &report->review->now.time;
  const bool went_back = now->restarts > before->restarts;
  const bool is_full = now->overflows > before->overflows;
  struct fm_status * status = add_status(
    report, went_back || is_full ? WARN : OK, "time of ", report->review->table->bundle,
    went_back ? "went back since the last report" :
    is_full ? "more changes than max_rate allows" : "passes");
  add_count(status, "restarts", now->restarts);
  add_count(status, "overflows", now->overflows);
}

static void add_links(const struct report * report)
{
  const struct fm_tree_counts * before = &report->review->before.links;
  const struct fm_tree_counts * now = &report->review->now.links;
  struct troubles troubles = {{NULL, 0, 0}, OK};
  add_increase(&troubles, WARN, before->loops, now->loops, "would close a loop");
  add_increase(&troubles, WARN, before->unusable, now->unusable, "cannot be used");
  add_increase(&troubles, WARN, before->old, now->old, "too old");
  struct fm_status * status = add_judged(
    report, &troubles, "links of ", report->review->table->bundle, "taken");
  add_count(status, "loops", now->loops);
  add_count(status, "unusable", now->unusable);
  add_count(status, "old", now->old);
}

static void add_periods(const struct report * report)
{
  const struct fm_time_counts * before = &report->review->before.time;
  const struct fm_time_counts * now = &report->review->now.time;
  const struct fm_report_table * table = report->review->table;
  struct troubles troubles = {{NULL, 0, 0}, OK};
  if (fm_are_worth_reading(before, now)) {
    add_trouble(
      &troubles, WARN, "%" PRIu64 " missed, %" PRIu64 " late since the last report",
      now->missed - before->missed, now->late - before->late);
  }
  struct fm_status * status =
    add_judged(report, &troubles, "periods of ", table->bundle, "in time");
  fm_status_value(status, "period", "%g", (double)table->period / 1e9);
  add_count(status, "taken", now->periods);
  add_count(status, "late", now->late);
  add_count(status, "missed", now->missed);
  add_count(status, "restarts", now->restarts);
}

static void add_unpublished(const struct report * report)
{
  const uint64_t now = report->review->now.unpublished;
  struct troubles troubles = {{NULL, 0, 0}, WARN};
  add_increase(&troubles, ERROR, report->review->before.unpublished, now, "not published");
  add_count(add_judged(report, &troubles, "violations of ", report->review->table->bundle,
    "some were not published"), "not published", now);
}

static void add_failures(const struct report * report)
{
  const struct fm_facts * facts = &report->review->facts;
  struct fm_text message = {NULL, 0, 0};
  fm_text_add(&message, "failed: ");
  for (uint32_t k = 0; k < facts->n_failures; ++k) {
    fm_text_add(&message, "%s%s", k == 0 ? "" : ", ", facts->failures[k].name);
  }
  struct fm_status * status = add_status(report, ERROR, "threads", "", fm_text_get(&message));
  for (uint32_t k = 0; k < facts->n_failures; ++k) {
    fm_status_value(status, facts->failures[k].name, "%s", facts->failures[k].error);
  }
  fm_text_free(&message);
}

void fm_review_report(const struct fm_review * review, struct fm_statuses * statuses)
{
  const struct fm_report_table * table = review->table;
  const struct report report = {review, statuses};
  bool has_transforms = false;
  for (uint32_t k = 0; k < table->n_requirements; ++k) {
    add_requirement(&report, k);
  }
  for (uint32_t k = 0; k < table->n_topics; ++k) {
    add_topic(&report, k);
    has_transforms = has_transforms || table->topics[k].kind == FM_TRANSFORM;
  }
  if (has_transforms) {
    add_links(&report);
  }
  add_gate(&report);
  for (uint32_t k = 0; review->facts.actions != NULL && k < table->n_actions; ++k) {
    add_action(&report, k);
  }
  for (uint32_t k = 0; k < table->n_locks; ++k) {
    add_lock(&report, &table->locks[k]);
  }
  if (table->policy == FM_TIMED) {
    add_time(&report);
  } else if (table->policy == FM_PERIODIC) {
    add_periods(&report);
  }
  if (review->facts.blackbox != NULL) {
    add_blackbox(&report);
  }
  if (review->now.unpublished > 0) {
    add_unpublished(&report);
  }
  if (review->facts.n_failures > 0) {
    add_failures(&report);
  }
}
