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

/// instance_lines.c: the status and the lines of requirements of instances.

#include "review_parts.h"

#include <inttypes.h>

#include "details.h"
#include "words.h"

bool fm_find_fed(
  const struct fm_review * review, uint32_t topic, uint32_t k, struct fm_fed * fed)
{
  const struct fm_report_table * table = review->table;
  const struct fm_topic * found = &table->topic_inputs[topic];
  uint32_t kind = FM_BUNDLE;
  for (uint32_t next = 0; k >= found->n_inputs; ++next) {
    if (next == table->n_kinds) {
      return false;
    }
    k -= found->n_inputs;
    kind = next;
    found = &table->kinds[kind].keyed[topic];
  }
  const uint32_t input = found->inputs[k];
  const bool is_keyed = kind != FM_BUNDLE;
  const struct fm_input_snapshot * now =
    &(is_keyed ? review->now.kinds[kind].inputs : review->now.inputs)[input];
  const struct fm_input_snapshot * before =
    &(is_keyed ? review->before.kinds[kind].inputs : review->before.inputs)[input];
  *fed = (struct fm_fed) {
    &(is_keyed ? table->kinds[kind].inputs : table->inputs)[input], kind, input,
    now->counts.unusable, now->counts.unusable - before->counts.unusable, now->silence.count,
    now->silence.count - before->silence.count,
    (uint32_t)(now->silence.startups - before->silence.startups)};
  return true;
}

// The place of a requirement among those of its kind.
static uint32_t place_of(const struct fm_report_table * table, uint32_t requirement)
{
  uint32_t first = requirement;
  while (first > 0 &&
    table->requirements[first - 1u].kind == table->requirements[requirement].kind)
  {
    first -= 1u;
  }
  return requirement - first;
}

static void add_keys(
  struct fm_text * text, const struct fm_report_kind * about, const struct fm_named_keys * named)
{
  for (uint32_t k = 0; k < named->n_keys; ++k) {
    fm_text_add(text, "%s", k == 0 ? "" : ", ");
    fm_add_key(text, about, named->keys[k] + 1, named->keys[k][0], false);
  }
  if (named->n > named->n_keys) {
    fm_text_add(text, ", and %" PRIu64 " more", named->n - named->n_keys);
  }
}

bool fm_add_missing(
  struct fm_text * text, const struct fm_review * review,
  const struct fm_report_requirement * about)
{
  const size_t before = text->length;
  for (uint32_t k = 0; k < about->n_inputs; ++k) {
    const uint32_t input = fm_bundle_input(review->table, about, k);
    if (input != UINT32_MAX && !review->now.inputs[input].has_value) {
      fm_text_add(text, "%s%s", text->length > before ? ", " : "no value yet of ",
        review->table->inputs[input].name);
    }
  }
  return text->length > before;
}

static enum fm_status_level describe(
  const struct fm_review * review, uint32_t requirement, struct fm_text * message)
{
  const struct fm_report_requirement * about = &review->table->requirements[requirement];
  const struct fm_kind_snapshot * kind = &review->now.kinds[about->kind];
  const uint32_t place = place_of(review->table, requirement);
  if (kind->violated[place].n > 0) {
    fm_text_add(message, "violated: ");
    add_keys(message, &review->table->kinds[about->kind], &kind->violated[place]);
    return about->is_warning ? FM_STATUS_WARN : FM_STATUS_ERROR;
  } else if (kind->counts.alive == 0) {
    fm_text_add(message, "%s", kind->counts.begun > 0 ? "no instance" : "no instance yet");
    return kind->counts.begun > 0 ? FM_STATUS_OK : FM_STATUS_WARN;
  } else if (fm_add_missing(message, review, about)) {
    return FM_STATUS_WARN;
  } else if (kind->unevaluated[place].n > 0) {
    fm_text_add(message, "not evaluated yet: ");
    add_keys(message, &review->table->kinds[about->kind], &kind->unevaluated[place]);
    return FM_STATUS_WARN;
  }
  const bool is_evaluated = review->now.requirements[requirement].steps > 0;
  fm_text_add(message, "%s", is_evaluated ? "satisfied" : "not evaluated yet");
  return is_evaluated ? FM_STATUS_OK : FM_STATUS_WARN;
}

static void add_beyond(
  struct fm_text * message, uint64_t n, const char * variable, uint32_t most)
{
  if (n > 0) {
    fm_text_add(
      message, ", of them %" PRIu64 " of %s (`most` is %" PRIu32 ")", n, variable, most);
  }
}

enum fm_status_level fm_describe_instances(
  const struct fm_review * review, uint32_t requirement, struct fm_text * message)
{
  const uint32_t kind = review->table->requirements[requirement].kind;
  const struct fm_pool_counts * now = &review->now.kinds[kind].counts;
  const struct fm_pool_counts * before = &review->before.kinds[kind].counts;
  const struct fm_report_kind * about = &review->table->kinds[kind];
  const uint64_t more = now->beyond - before->beyond;
  const uint64_t unsized = now->unsized - before->unsized;
  const uint64_t second = now->second - before->second;
  const enum fm_status_level level = describe(review, requirement, message);
  if (more > 0) {
    fm_text_add(message, "; %" PRIu64 " beyond `most` since the last report", more);
  }
  if (about->second[0] != '\0') {
    add_beyond(message, more - unsized - second, about->variable, about->first_most);
    add_beyond(message, second, about->second, about->second_most);
  }
  if (unsized > 0) {
    fm_text_add(message, ", of them %" PRIu64 " for their size: " FM_WORDS_KEY_SIZE, unsized);
  }
  return more > 0 ? FM_STATUS_ERROR : level;
}

void fm_add_instances(
  const struct fm_review * review, uint32_t requirement, struct fm_status * status)
{
  const struct fm_kind_snapshot * kind =
    &review->now.kinds[review->table->requirements[requirement].kind];
  const uint64_t violated = kind->violated[place_of(review->table, requirement)].n;
  fm_status_value(status, "instances", "%" PRIu64, kind->counts.alive);
  fm_status_value(status, "violated", "%" PRIu64, violated);
  fm_status_value(status, "began", "%" PRIu64, kind->counts.begun);
  fm_status_value(status, "ended", "%" PRIu64, kind->counts.ended);
  fm_status_value(status, "ended open", "%" PRIu64, kind->counts.open);
  fm_status_value(status, "beyond most", "%" PRIu64, kind->counts.beyond);
}

void fm_add_nearest(
  const struct fm_review * review, uint32_t requirement, struct fm_text * text)
{
  const uint32_t kind = review->table->requirements[requirement].kind;
  const struct fm_named_keys * named =
    &review->now.kinds[kind].nearest[place_of(review->table, requirement)];
  fm_add_key(text, &review->table->kinds[kind], named->keys[0] + 1, named->keys[0][0], true);
}

// ---- lines -------------------------------------------------------------------------------------

static void log_beyond(
  const struct fm_report_kind * about, const char * variables, bool is_second,
  struct fm_lines * lines)
{
  const bool is_of_pairs = about->second[0] != '\0';
  fm_lines_add(lines, FM_ERROR,
    "there is no room for another %s%s%s (`most` is %" PRIu32 "): its messages are not evaluated; "
    "/diagnostics counts them", is_second ? about->second : about->variable,
    is_of_pairs ? " in pairs of " : "", is_of_pairs ? variables : "",
    is_second ? about->second_most : about->first_most);
}

static void log_left_out(struct fm_review * review, uint32_t kind, struct fm_lines * lines)
{
  const struct fm_report_kind * about = &review->table->kinds[kind];
  const struct fm_pool_counts * counts = &review->now.kinds[kind].counts;
  struct fm_kind_log * log = &review->kinds[kind];
  struct fm_text variables = {NULL, 0, 0};
  fm_add_variables(&variables, about);
  if (counts->beyond > counts->unsized + counts->second && fm_is_first(&log->is_first_logged)) {
    log_beyond(about, fm_text_get(&variables), false, lines);
  }
  if (counts->second > 0 && fm_is_first(&log->is_second_logged)) {
    log_beyond(about, fm_text_get(&variables), true, lines);
  }
  if (counts->unsized > 0 && fm_is_first(&log->is_unsized_logged)) {
    fm_lines_add(lines, FM_ERROR,
      "messages with a key of %s are not evaluated: " FM_WORDS_KEY_SIZE "; /diagnostics counts "
      "them", fm_text_get(&variables));
  }
  fm_text_free(&variables);
}

static void log_silent(
  const struct fm_review * review, uint32_t topic, const struct fm_report_input * about,
  bool is_startup, uint64_t n, struct fm_lines * lines)
{
  if (n > 0) {
    fm_lines_add(lines, about->violates ? FM_ERROR : FM_WARN,
      "no usable value on %s within the %s of %g s for '%s', of %" PRIu64 " instance%s",
      review->names[topic], is_startup ? "startup" : "timeout",
      is_startup ? about->startup : about->timeout, about->name, n, n == 1u ? "" : "s");
  }
}

static void log_silences(
  const struct fm_review * review, uint32_t topic, struct fm_lines * lines)
{
  struct fm_fed fed;
  for (uint32_t k = 0; fm_find_fed(review, topic, k, &fed); ++k) {
    if (fed.kind != FM_BUNDLE && fed.about->is_timed_out) {
      const uint64_t n = fed.new_silences - fed.new_startups;
      log_silent(review, topic, fed.about, true, fed.new_startups, lines);
      log_silent(review, topic, fed.about, false, n, lines);
    }
  }
}

void fm_review_instances(struct fm_review * review, struct fm_lines * lines)
{
  for (uint32_t k = 0; k < review->table->n_kinds; ++k) {
    if (!review->table->kinds[k].has_base) {
      log_left_out(review, k, lines);
    }
  }
  for (uint32_t t = 0; t < review->table->n_topics; ++t) {
    log_silences(review, t, lines);
  }
}
