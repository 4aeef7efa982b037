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

/// input_log.c: lines about inputs and topics: silences, messages that cannot be used, and
/// requirements that wait for their first values.

#include <stdlib.h>
#include <string.h>

#include "details.h"
#include "engine_locked.h"
#include "review_parts.h"

#define ABSENT_S 10   // without a name, until it is logged
#define MOST_SHOWN 60u  // bytes of a string

// ---- silences ----------------------------------------------------------------------------------

static bool reads_any(
  const struct fm_report_table * table, const struct fm_report_requirement * requirement,
  const bool * is_chosen)
{
  bool is_any = false;
  for (uint32_t k = 0; k < requirement->n_inputs; ++k) {
    const uint32_t input = fm_bundle_input(table, requirement, k);
    is_any = is_any || (input != UINT32_MAX && is_chosen[input]);
  }
  return is_any;
}

static void add_readers(
  const struct fm_report_table * table, const bool * is_chosen, struct fm_names * readers)
{
  for (uint32_t k = 0; k < table->n_requirements; ++k) {
    if (reads_any(table, &table->requirements[k], is_chosen)) {
      fm_names_add(readers, ", ", table->requirements[k].id);
    }
  }
}

static void log_begun(
  const struct fm_review * review, uint32_t topic, const struct fm_report_input * first,
  bool is_startup, bool is_again, struct fm_names * inputs, struct fm_lines * lines)
{
  struct fm_names readers = {{NULL, 0, 0}, 0};
  struct fm_text link = {NULL, 0, 0};
  add_readers(review->table, review->flags, &readers);
  const bool is_error = first->violates && readers.n > 0;
  const bool is_broken = fm_add_missing_link(&link, review->reporter, topic);
  fm_lines_add(lines, is_error ? FM_ERROR : FM_WARN,
    "%sno usable value on %s within the %s of %g s for %s%s%s%s%s%s%s", is_again ? "again " : "",
    review->names[topic], is_startup ? "startup" : "timeout",
    is_startup ? first->startup : first->timeout, fm_names_get(inputs),
    is_broken ? " (" : "", fm_text_get(&link), is_broken ? ")" : "",
    is_error ? ": " : "", is_error ? fm_names_get(&readers) : "",
    is_error ? " violated until one comes" : "");
  fm_text_free(&link);
  fm_text_free(&readers.text);
}

// The silences of one topic's inputs. Sets the flags of those that have begun. A silence is again
// one if the input had a value between two since the last look: no line has the end of the first.
static void review_silences(struct fm_review * review, uint32_t topic, struct fm_lines * lines)
{
  const struct fm_topic * fed = &review->table->topic_inputs[topic];
  const struct fm_report_input * first = NULL;  // that has begun
  struct fm_names begun = {{NULL, 0, 0}, 0};
  struct fm_names ended = {{NULL, 0, 0}, 0};
  int64_t lasted = 0;
  bool is_startup = true;
  bool is_again = false;
  for (uint32_t k = 0; k < fed->n_inputs; ++k) {
    const uint32_t input = fed->inputs[k];
    const struct fm_report_input * about = &review->table->inputs[input];
    const struct fm_silence * before = &review->before.inputs[input].silence;
    const struct fm_silence * now = &review->now.inputs[input].silence;
    review->flags[input] = about->is_timed_out && now->count > before->count;
    if (review->flags[input]) {
      first = first == NULL ? about : first;
      is_startup = is_startup &&
        now->count - before->count == (uint32_t)(now->startups - before->startups);
      is_again = is_again || now->count > before->count + !before->is_silent;
      fm_names_add_quoted(&begun, about->name, "");
    }
    if (about->is_timed_out && !now->is_silent && (before->is_silent || review->flags[input])) {
      lasted = now->lasted > lasted ? now->lasted : lasted;
      fm_names_add_quoted(&ended, about->name, "");
    }
  }
  if (first != NULL) {
    log_begun(review, topic, first, is_startup, is_again, &begun, lines);
  }
  if (ended.n > 0) {
    fm_lines_add(lines, FM_INFO, "values on %s again after %.1f s, for %s",
      review->names[topic], (double)lasted / 1e9, fm_names_get(&ended));
  }
  fm_text_free(&begun.text);
  fm_text_free(&ended.text);
}

void fm_review_silences(struct fm_review * review, struct fm_lines * lines)
{
  memset(review->flags, 0, review->table->n_inputs * sizeof(*review->flags));
  for (uint32_t t = 0; t < review->table->n_topics; ++t) {
    const struct fm_topic * fed = &review->table->topic_inputs[t];
    review_silences(review, t, lines);
    for (uint32_t k = 0; k < fed->n_inputs; ++k) {
      review->flags[fed->inputs[k]] = false;
    }
  }
}

// ---- fields ------------------------------------------------------------------------------------

// Add the beginning of a string in a message, in quotes; all but plain characters as \xNN.
static void add_shown(struct fm_text * text, const uint8_t * bytes, uint32_t length)
{
  fm_text_add(text, "'");
  for (uint32_t k = 0; k < length && k < MOST_SHOWN; ++k) {
    if (bytes[k] < ' ' || bytes[k] > '~' || bytes[k] == '\'' || bytes[k] == '\\') {
      fm_text_add(text, "\\x%02x", (unsigned)bytes[k]);
    } else {
      fm_text_add(text, "%c", (int)bytes[k]);
    }
  }
  fm_text_add(text, "%s", length > MOST_SHOWN ? "'..." : "'");
}

static void add_reason(
  struct fm_text * text, const struct fm_report_input * input, const struct fm_field * field,
  const uint8_t * message, size_t size)
{
  const uint64_t at = field->value.u;
  if (field->outcome == FM_FIELD_OUTSIDE) {
    fm_text_add(text, "%s cannot be read (the array has %u element%s)", input->path,
      field->length, field->length == 1u ? "" : "s");
  } else if (field->outcome == FM_FIELD_EMPTY) {
    fm_text_add(text, "%s has no value (no element is there)", input->path);
  } else if (at == 0 || at + field->length > size) {
    fm_text_add(text, "%s is not among its values in the bundle", input->path);
  } else {
    fm_text_add(text, "%s is ", input->path);
    add_shown(text, message + at, field->length);
    fm_text_add(text, ", which is not among its values in the bundle");
  }
}

static const char * outcome_for(const struct fm_review * review, uint32_t input)
{
  return review->now.inputs[input].has_value ? "keeps its value" : "has no value yet";
}

static void note_absent(struct fm_input_log * log, const struct fm_review * review, uint32_t input)
{
  if (log->absent_since == 0) {
    log->absent_since = review->facts.now;
    log->received_before = review->now.inputs[input].counts.received;
  }
}

// A message with fields that cannot be used, and where the lines about them go.
struct evidence
{
  struct fm_review * review;
  struct fm_lines * lines;
  const uint8_t * message;
  size_t size;
  uint32_t topic;
};

static void log_unusable(
  const struct evidence * found, const struct fm_report_input * about,
  const struct fm_field * field, const char * of, const char * outcome)
{
  struct fm_text reason = {NULL, 0, 0};
  add_reason(&reason, about, field, found->message, found->size);
  fm_lines_add(found->lines, FM_WARN, "%s: %s; input '%s'%s %s",
    found->review->names[found->topic], fm_text_get(&reason), about->name, of, outcome);
  fm_text_free(&reason);
}

// Log why a field of an instance cannot be used, once of each kind.
static void log_part(
  void * context, uint32_t kind, const uint8_t * key, size_t key_size,
  const struct fm_field * fields)
{
  const struct evidence * found = context;
  const struct fm_report_kind * about = &found->review->table->kinds[kind];
  const struct fm_topic * fed = &about->keyed[found->topic];
  struct fm_text name = {NULL, 0, 0};
  fm_text_add(&name, " of ");
  fm_add_variables(&name, about);
  fm_text_add(&name, " ");
  fm_add_key(&name, about, key, key_size, false);
  for (uint32_t k = 0; k < fed->n_inputs; ++k) {
    if (fields[k].outcome != FM_FIELD_READ &&
      fm_is_first(&found->review->kinds[kind].is_unusable_logged))
    {
      log_unusable(found, &about->inputs[fed->inputs[k]], &fields[k], fm_text_get(&name),
        "keeps its value, if it has one");
    }
  }
  fm_text_free(&name);
}

static void read_evidence(struct evidence * found)
{
  struct fm_review * review = found->review;
  const struct fm_topic * fed = &review->table->topic_inputs[found->topic];
  const struct fm_reader * reader = fm_engine_reader(review->reporter->engine, found->topic);
  struct fm_field * fields = calloc(fed->n_inputs + (size_t)1, sizeof(*fields));
  const bool is_read = fields != NULL && reader->read(found->message, found->size, fields);
  for (uint32_t k = 0; is_read && k < fed->n_inputs; ++k) {
    const uint32_t input = fed->inputs[k];
    if (fields[k].outcome == FM_FIELD_ABSENT) {
      note_absent(&review->inputs[input], review, input);
    } else if (fields[k].outcome != FM_FIELD_READ &&
      fm_is_first(&review->inputs[input].is_unusable_logged))
    {
      log_unusable(
        found, &review->table->inputs[input], &fields[k], "", outcome_for(review, input));
    }
  }
  free(fields);
  if (reader->parts != NULL) {
    (void)reader->parts(found->message, found->size, NULL, 0, log_part, found);
  }
}

// A message with a field that cannot be used, if one has come since the last look.
static void review_evidence(struct fm_review * review, uint32_t topic, struct fm_lines * lines)
{
  uint8_t none;
  struct fm_engine * engine = review->reporter->engine;
  const size_t size = fm_engine_evidence(engine, topic, &none, 0);
  uint8_t * message = size == 0 ? NULL : malloc(size);
  // The message may be another one by now, but it is no larger.
  const size_t taken = message == NULL ? 0 : fm_engine_evidence(engine, topic, message, size);
  if (taken > 0 && taken <= size) {
    read_evidence(&(struct evidence) {review, lines, message, taken, topic});
  }
  free(message);
}

static void review_name(
  struct fm_review * review, uint32_t topic, uint32_t input, struct fm_lines * lines)
{
  struct fm_input_log * log = &review->inputs[input];
  if (log->absent_since == 0) {
    return;
  }
  if (review->now.inputs[input].counts.received > log->received_before) {
    log->absent_since = 0;
    log->is_absent_logged = false;
  } else if (review->facts.now - log->absent_since >= ABSENT_S * FM_SECOND &&
    fm_is_first(&log->is_absent_logged))
  {
    const struct fm_report_input * about = &review->table->inputs[input];
    fm_lines_add(lines, FM_WARN, "%s: no message has had %s for %d s; input '%s' %s",
      review->names[topic], about->path, ABSENT_S, about->name,
      outcome_for(review, input));
  }
}

// ---- topics ------------------------------------------------------------------------------------

static void review_order(struct fm_review * review, uint32_t topic, struct fm_lines * lines)
{
  struct fm_topic_log * log = &review->topics[topic];
  const char * name = review->names[topic];
  const struct fm_order_counts * order = &review->now.topics[topic].order;
  if (order->ahead > 0 && fm_is_first(&log->is_ahead_logged)) {
    fm_lines_add(lines, FM_WARN, "stamps of messages on %s are %.1f s ahead of this node's "
      "clock: the messages take effect that much later; synchronize the clocks; /diagnostics "
      "counts such messages", name, (double)order->most_ahead / 1e9);
  }
  if (log->is_order_logged) {
    return;
  }
  log->is_order_logged = order->late > 0 || order->overflows > 0;
  if (order->late > 0) {
    fm_lines_add(lines, FM_WARN, "messages on %s come later than %g s (`reorder`) after their "
      "stamps: they take effect when they come; raise `reorder`", name,
      (double)review->table->reorder / 1e9);
  } else if (order->overflows > 0) {
    fm_lines_add(lines, FM_WARN, "messages on %s take effect too early: too many wait for earlier "
      "stamps", name);
  }
}

void fm_review_topics(struct fm_review * review, struct fm_lines * lines)
{
  struct fm_fed fed;
  for (uint32_t t = 0; t < review->table->n_topics; ++t) {
    bool has_unusable = false;
    for (uint32_t k = 0; fm_find_fed(review, t, k, &fed); ++k) {
      has_unusable = has_unusable || fed.new_unusable > 0;
      if (fed.kind == FM_BUNDLE) {
        review_name(review, t, fed.input, lines);
      }
    }
    if (review->now.topics[t].counts.undecodable > 0 &&
      fm_is_first(&review->topics[t].is_undecodable_logged))
    {
      fm_lines_add(lines, FM_ERROR, "a message on %s cannot be decoded as %s; such messages are "
        "counted and are no step", review->names[t], review->table->topics[t].type);
    }
    review_order(review, t, lines);
    fm_review_graph(review, t, lines);
    if (has_unusable) {
      review_evidence(review, t, lines);
    }
  }
}

// ---- what is missing ---------------------------------------------------------------------------

// Set the flags of a requirement's inputs of the bundle's scope that have no value, or of which no
// message came. Returns whether there are any.
static bool note_lacking(
  const struct fm_review * review, const struct fm_report_requirement * about, bool of_messages,
  bool * is_awaited)
{
  bool is_any = false;
  for (uint32_t k = 0; k < about->n_inputs; ++k) {
    const uint32_t input = fm_bundle_input(review->table, about, k);
    if (input != UINT32_MAX && (of_messages ? review->now.inputs[input].counts.received == 0 :
      !review->now.inputs[input].has_value))
    {
      is_any = is_awaited[input] = true;
    }
  }
  return is_any;
}

// Set the flags of the inputs for which a requirement waits: those without a value, or if all have
// an initial value and there was no step, those of which no message came. One of instances waits
// while none was evaluated. Returns whether it waits.
static bool note_awaited(const struct fm_review * review, uint32_t requirement, bool * is_awaited)
{
  const struct fm_report_requirement * about = &review->table->requirements[requirement];
  const bool is_evaluated = review->now.requirements[requirement].steps > 0;
  if (about->kind != FM_BUNDLE) {
    if (!is_evaluated) {
      (void)note_lacking(review, about, false, is_awaited);
    }
    return !is_evaluated;
  }
  return !fm_is_withheld_from_start(review->reporter, review->now.conditions, requirement) &&
         (note_lacking(review, about, false, is_awaited) ||
         (!is_evaluated && note_lacking(review, about, true, is_awaited)));
}

static void add_awaited(
  const struct fm_review * review, uint32_t topic, const bool * is_awaited,
  struct fm_names * reasons)
{
  const struct fm_publishers * facts = &review->facts.topics[topic];
  const bool has_come = review->now.topics[topic].counts.messages > 0;
  struct fm_names inputs = {{NULL, 0, 0}, 0};
  struct fm_text around = {NULL, 0, 0};
  struct fm_text reason = {NULL, 0, 0};
  struct fm_fed fed;
  for (uint32_t k = 0; fm_find_fed(review, topic, k, &fed); ++k) {
    if (fed.kind != FM_BUNDLE ? !has_come : is_awaited[fed.input]) {
      const bool is_initial = fed.kind == FM_BUNDLE && review->now.inputs[fed.input].has_value;
      fm_names_add_quoted(
        &inputs, fed.about->name, is_initial ? " (it has its initial value)" : "");
    }
  }
  if (inputs.n > 0) {
    if (fm_is_of_graph(review->reporter, topic)) {
      fm_add_seen(&around, review->reporter, topic, &review->now.topics[topic].observed);
    } else if (!fm_add_missing_link(&around, review->reporter, topic)) {
      const bool has_others = facts->other_types[0] != '\0';
      fm_text_add(&around, "%u publisher%s%s%s", facts->n, facts->n == 1u ? "" : "s",
        has_others ? " of " : "", has_others ? review->table->topics[topic].type : "");
    }
    fm_text_add(&reason, "nothing %sreceived on %s (%s) for %s",
      has_come ? "usable " : "", review->names[topic], fm_text_get(&around),
      fm_names_get(&inputs));
    fm_names_add(reasons, "; ", fm_text_get(&reason));
  }
  fm_text_free(&inputs.text);
  fm_text_free(&around);
  fm_text_free(&reason);
}

void fm_review_missing(const struct fm_review * review, struct fm_lines * lines)
{
  bool * is_awaited = review->flags;
  struct fm_names waiting = {{NULL, 0, 0}, 0};
  struct fm_names reasons = {{NULL, 0, 0}, 0};
  memset(is_awaited, 0, review->table->n_inputs * sizeof(*is_awaited));
  for (uint32_t k = 0; k < review->table->n_requirements; ++k) {
    if (note_awaited(review, k, is_awaited)) {
      fm_names_add(&waiting, ", ", review->table->requirements[k].id);
    }
  }
  for (uint32_t k = 0; waiting.n > 0 && k < review->table->n_topics; ++k) {
    add_awaited(review, k, is_awaited, &reasons);
  }
  if (waiting.n > 0) {
    fm_lines_add(lines, FM_WARN, "%s %s not evaluated yet: %s", fm_names_get(&waiting),
      waiting.n == 1u ? "is" : "are", fm_names_get(&reasons));
  }
  fm_text_free(&waiting.text);
  fm_text_free(&reasons.text);
}
