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

/// reports.c: see reports.h for the contract.

#include "reports.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#define MOST_NAMED 5u       // names in one log line
#define ABSENT_S 10         // without a name, until it is logged
#define NO_TIME_S 5         // until a missing /clock is logged
#define PERIODS_S 60.0      // between two log lines about late periods
#define FEWEST_LATE 3u      // late periods, and
#define MOST_LATE 0.01      // of all periods, are worth reading
#define FEWEST_JUDGED 300u  // periods; of fewer, three are too many

bool fm_reports_begin(struct fm_reports * reports, const struct fm_session * session)
{
  memset(reports, 0, sizeof(*reports));
  reports->session = session;
  reports->inputs = calloc(session->table->monitor()->n_inputs + 1u, sizeof(*reports->inputs));
  reports->topics = calloc(session->table->report.n_topics + 1u, sizeof(*reports->topics));
  reports->began = fm_steady_now();
  reports->logged = reports->judged = fm_engine_time_counts(session->engine);
  return reports->inputs != NULL && reports->topics != NULL;
}

void fm_reports_end(struct fm_reports * reports)
{
  free(reports->inputs);
  free(reports->topics);
  memset(reports, 0, sizeof(*reports));
}

bool fm_has_value(const struct fm_session * session, uint32_t input)
{
  uint64_t value;  // as large as any type of an input
  return fm_engine_value(session->engine, input, &value);
}

// Names in one line: the first five, and how many more there are.
struct names
{
  struct fm_text text;
  uint32_t n;
};

static void add_name(struct names * names, const char * separator, const char * name)
{
  names->n += 1u;
  if (names->n <= MOST_NAMED) {
    fm_text_list(&names->text, separator, name);
  }
}

static const char * all_names(struct names * names)
{
  if (names->n > MOST_NAMED) {
    fm_text_add(&names->text, " and %u more", names->n - MOST_NAMED);
  }
  return fm_text_get(&names->text);
}

static void add_quoted(struct names * names, const char * name, const char * note)
{
  struct fm_text quoted = {NULL, 0, 0};
  fm_text_add(&quoted, "'%s'%s", name, note);
  add_name(names, ", ", fm_text_get(&quoted));
  fm_text_free(&quoted);
}

// ---- silences ----------------------------------------------------------------------------------

static bool reads_any(
  const struct fm_report_requirement * requirement, const bool * is_chosen)
{
  for (uint32_t k = 0; k < requirement->n_inputs; ++k) {
    if (is_chosen[requirement->inputs[k]]) {
      return true;
    }
  }
  return false;
}

static void log_begun(
  const struct fm_reports * reports, uint32_t topic, const bool * is_chosen, bool is_again)
{
  const struct fm_node_table * table = reports->session->table;
  const struct fm_topic * fed = &table->report.topic_inputs[topic];
  const struct fm_monitor * monitor = table->monitor();
  struct names inputs = {{NULL, 0, 0}, 0};
  struct names readers = {{NULL, 0, 0}, 0};
  const struct fm_report_input * first = NULL;
  bool violates = false;
  bool has_come = false;
  for (uint32_t k = 0; k < fed->n_inputs; ++k) {
    if (is_chosen[fed->inputs[k]]) {
      violates = first == NULL ? table->report.inputs[fed->inputs[k]].violates : violates;
      first = first == NULL ? &table->report.inputs[fed->inputs[k]] : first;
      has_come = has_come || fm_engine_input_counts(
        reports->session->engine, fed->inputs[k]).received > 0;
      add_quoted(&inputs, table->report.inputs[fed->inputs[k]].name, "");
    }
  }
  for (uint32_t k = 0; first != NULL && k < monitor->n_requirements; ++k) {
    if (reads_any(&table->report.requirements[k], is_chosen)) {
      add_name(&readers, ", ", table->report.requirements[k].id);
    }
  }
  if (first != NULL) {
    const bool is_error = violates && readers.n > 0;
    fm_log(reports->session->node, is_error ? FM_ERROR : FM_WARN,
      "%sno usable value on %s within the %s of %g s for %s%s%s%s", is_again ? "again " : "",
      reports->session->topics[topic].name, has_come ? "timeout" : "startup",
      has_come ? first->timeout : first->startup, all_names(&inputs), is_error ? ": " : "",
      is_error ? all_names(&readers) : "", is_error ? " violated until one comes" : "");
  }
  fm_text_free(&inputs.text);
  fm_text_free(&readers.text);
}

static void log_ended(
  const struct fm_reports * reports, uint32_t topic, const bool * is_chosen)
{
  const struct fm_topic * fed = &reports->session->table->report.topic_inputs[topic];
  struct names inputs = {{NULL, 0, 0}, 0};
  int64_t lasted = 0;
  for (uint32_t k = 0; k < fed->n_inputs; ++k) {
    if (is_chosen[fed->inputs[k]]) {
      const struct fm_silence * silence = &reports->inputs[fed->inputs[k]].silence;
      lasted = silence->lasted > lasted ? silence->lasted : lasted;
      add_quoted(&inputs, reports->session->table->report.inputs[fed->inputs[k]].name, "");
    }
  }
  if (inputs.n > 0) {
    fm_log(reports->session->node, FM_INFO, "values on %s again after %.1f s, for %s",
      reports->session->topics[topic].name, (double)lasted / 1e9, all_names(&inputs));
  }
  fm_text_free(&inputs.text);
}

// Note the silences of a topic's inputs, in flags of all inputs. Returns whether one of the inputs
// had a value between two silences since the last review: no line has the end of the first.
static bool review_silences_of(
  struct fm_reports * reports, uint32_t topic, bool * has_begun, bool * has_ended)
{
  const struct fm_node_table * table = reports->session->table;
  const struct fm_topic * fed = &table->report.topic_inputs[topic];
  bool is_again = false;
  for (uint32_t k = 0; k < fed->n_inputs; ++k) {
    const uint32_t input = fed->inputs[k];
    struct fm_silence * seen = &reports->inputs[input].silence;
    if (table->report.inputs[input].is_timed_out) {
      const struct fm_silence before = *seen;
      *seen = fm_engine_silence(reports->session->engine, input);
      has_begun[input] = seen->count > before.count;
      has_ended[input] = !seen->is_silent && (before.is_silent || has_begun[input]);
      is_again = is_again || seen->count > before.count + !before.is_silent;
    }
  }
  return is_again;
}

static void review_silences(struct fm_reports * reports)
{
  const uint32_t n = reports->session->table->monitor()->n_inputs;
  bool * flags = calloc(2u * n + 1u, sizeof(*flags));
  for (uint32_t k = 0; flags != NULL && k < reports->session->table->report.n_topics; ++k) {
    memset(flags, 0, 2u * n * sizeof(*flags));
    const bool is_again = review_silences_of(reports, k, flags, flags + n);
    log_begun(reports, k, flags, is_again);
    log_ended(reports, k, flags + n);
  }
  free(flags);
}

// ---- fields ------------------------------------------------------------------------------------

static void add_reason(
  struct fm_text * text, const struct fm_report_input * input, const struct fm_field * field)
{
  if (field->outcome == FM_FIELD_OUTSIDE) {
    fm_text_add(text, "%s cannot be read (the array has %u element%s)", input->path,
      field->length, field->length == 1u ? "" : "s");
  } else if (field->outcome == FM_FIELD_EMPTY) {
    fm_text_add(text, "%s has no value (no element is there)", input->path);
  } else {
    fm_text_add(text, "%s is not among its values in the bundle", input->path);
  }
}

static const char * outcome_for(const struct fm_reports * reports, uint32_t input)
{
  return fm_has_value(reports->session, input) ? "keeps its value" : "has no value yet";
}

static void log_field(
  struct fm_reports * reports, uint32_t topic, uint32_t input, const struct fm_field * field)
{
  struct fm_input_report * report = &reports->inputs[input];
  const struct fm_report_input * about = &reports->session->table->report.inputs[input];
  if (field->outcome == FM_FIELD_ABSENT && report->absent_since == 0) {
    report->absent_since = fm_steady_now();
    report->received_before =
      fm_engine_input_counts(reports->session->engine, input).received;
  } else if (field->outcome != FM_FIELD_ABSENT && !report->is_unusable_logged) {
    struct fm_text reason = {NULL, 0, 0};
    report->is_unusable_logged = true;
    add_reason(&reason, about, field);
    fm_log(reports->session->node, FM_WARN, "%s: %s; input '%s' %s",
      reports->session->topics[topic].name, fm_text_get(&reason), about->name,
      outcome_for(reports, input));
    fm_text_free(&reason);
  }
}

static void read_evidence(
  struct fm_reports * reports, uint32_t topic, const uint8_t * message, size_t size)
{
  const struct fm_topic * fed = &reports->session->table->report.topic_inputs[topic];
  struct fm_field * fields = calloc(fed->n_inputs + 1u, sizeof(*fields));
  if (fields != NULL &&
    reports->session->table->readers()->topics[topic].read(message, size, fields))
  {
    for (uint32_t k = 0; k < fed->n_inputs; ++k) {
      if (fields[k].outcome != FM_FIELD_READ) {
        log_field(reports, topic, fed->inputs[k], &fields[k]);
      }
    }
  }
  free(fields);
}

static void review_evidence(struct fm_reports * reports, uint32_t topic)
{
  uint8_t none;
  const size_t size = fm_engine_evidence(reports->session->engine, topic, &none, 0);
  uint8_t * message = size == 0 ? NULL : malloc(size);
  // The message may be another one by now, but it is no larger.
  const size_t taken = message == NULL ? 0 :
    fm_engine_evidence(reports->session->engine, topic, message, size);
  if (taken > 0 && taken <= size) {
    read_evidence(reports, topic, message, taken);
  }
  free(message);
}

static void review_names(struct fm_reports * reports, uint32_t topic)
{
  const struct fm_topic * fed = &reports->session->table->report.topic_inputs[topic];
  for (uint32_t k = 0; k < fed->n_inputs; ++k) {
    struct fm_input_report * report = &reports->inputs[fed->inputs[k]];
    if (report->absent_since == 0) {
      continue;
    }
    const uint64_t received =
      fm_engine_input_counts(reports->session->engine, fed->inputs[k]).received;
    if (received > report->received_before) {
      report->absent_since = 0;
      report->is_absent_logged = false;
    } else if (!report->is_absent_logged &&
      fm_steady_now() - report->absent_since >= ABSENT_S * FM_SECOND)
    {
      const struct fm_report_input * about =
        &reports->session->table->report.inputs[fed->inputs[k]];
      report->is_absent_logged = true;
      fm_log(reports->session->node, FM_WARN,
        "%s: no message has had %s for %d s; input '%s' %s",
        reports->session->topics[topic].name, about->path, ABSENT_S, about->name,
        outcome_for(reports, fed->inputs[k]));
    }
  }
}

static void review_topic(struct fm_reports * reports, uint32_t topic)
{
  const struct fm_session * session = reports->session;
  struct fm_topic_report * report = &reports->topics[topic];
  const char * name = session->topics[topic].name;
  const struct fm_order_counts order = fm_engine_order_counts(session->engine, topic);
  if (!report->is_undecodable_logged &&
    fm_engine_topic_counts(session->engine, topic).undecodable > 0)
  {
    report->is_undecodable_logged = true;
    fm_log(session->node, FM_ERROR, "a message on %s cannot be decoded as %s; such messages are "
      "counted and are no step", name, session->table->topics[topic].type);
  }
  if (order.ahead > 0 && !report->is_ahead_logged) {
    report->is_ahead_logged = true;
    fm_log(session->node, FM_WARN, "stamps of messages on %s are %.1f s ahead of this node's "
      "clock: the messages take effect that much later; synchronize the clocks; /diagnostics "
      "counts such messages", name, (double)order.most_ahead / 1e9);
  }
  if (order.late > 0 && !report->is_order_logged) {
    fm_log(session->node, FM_WARN, "messages on %s come later than %g s (`reorder`) after their "
      "stamps: they take effect when they come; raise `reorder`", name,
      (double)session->table->report.reorder / 1e9);
  } else if (order.overflows > 0 && !report->is_order_logged) {
    fm_log(session->node, FM_WARN, "messages on %s take effect too early: too many wait for "
      "earlier stamps", name);
  }
  report->is_order_logged = report->is_order_logged || order.late > 0 || order.overflows > 0;
  review_evidence(reports, topic);
}

// ---- time --------------------------------------------------------------------------------------

bool fm_are_worth_reading(const struct fm_time_counts * before, const struct fm_time_counts * now)
{
  const uint64_t late = now->late - before->late;
  return now->missed > before->missed || (late >= FEWEST_LATE &&
         (double)late > MOST_LATE * (double)(now->periods - before->periods));
}

// What ends although no message comes.
static void add_waits(const struct fm_reports * reports, struct fm_text * text,
  const char * separator, const char * ending, bool has_deadlines)
{
  const struct fm_node_table * table = reports->session->table;
  struct fm_text word = {NULL, 0, 0};
  bool has_timeouts = false;
  for (uint32_t k = 0; k < table->monitor()->n_inputs; ++k) {
    has_timeouts = has_timeouts || table->report.inputs[k].timeout > 0.0;
  }
  const char * const waits[] = {
    table->report.policy == FM_PERIODIC ? "period" : NULL,
    table->report.policy == FM_TIMED && has_deadlines ? "deadline" : NULL,
    has_timeouts ? "timeout" : NULL};
  for (size_t k = 0; k < sizeof(waits) / sizeof(waits[0]); ++k) {
    if (waits[k] != NULL) {
      fm_text_clear(&word);
      fm_text_add(&word, "%s%s", waits[k], ending);
      fm_text_list(text, separator, fm_text_get(&word));
    }
  }
  fm_text_free(&word);
}

static void review_clock(struct fm_reports * reports)
{
  const struct fm_node_clock * clock = reports->session->clock;
  struct fm_text waits = {NULL, 0, 0};
  if (!clock->is_simulated || fm_clock_now(clock) > 0) {
    reports->began = fm_steady_now();
  } else if (!reports->is_clock_logged &&
    fm_steady_now() > reports->began + NO_TIME_S * FM_SECOND)
  {
    reports->is_clock_logged = true;
    add_waits(reports, &waits, " and no ", "", true);
    fm_log(reports->session->node, FM_WARN,
      "use_sim_time is set and nothing was received on /clock%s%s%s", waits.length > 0 ?
      ": no " : "", fm_text_get(&waits), waits.length > 0 ? " passes" : "");
  }
  fm_text_free(&waits);
}

static void log_restart(struct fm_reports * reports, const struct fm_time_counts * counts)
{
  struct fm_text waits = {NULL, 0, 0};
  const bool is_timed = reports->session->table->report.policy == FM_TIMED;
  add_waits(reports, &waits, " and ", "s", false);
  fm_log(reports->session->node, FM_WARN, "time went back, to %.3f s: %s%s%s",
    (double)(counts->restarted_at + reports->session->table->report.reorder) / 1e9,
    fm_text_get(&waits),
    waits.length > 0 ? " continue from there; " : "",
    is_timed ? "values are kept, and the requirements start afresh" :
    "values and past of the requirements are kept");
  fm_text_free(&waits);
}

static void review_periods(struct fm_reports * reports, const struct fm_time_counts * counts)
{
  if (fm_are_worth_reading(&reports->judged, counts)) {
    if (fm_passes(&reports->next_time_line, PERIODS_S)) {
      fm_log(reports->session->node, FM_WARN,
        "periods of %g s since the last such message: %" PRIu64 " missed (no step), %" PRIu64
        " late by more than half a period", (double)reports->session->table->report.period / 1e9,
        counts->missed - reports->logged.missed, counts->late - reports->logged.late);
      reports->logged = reports->judged = *counts;
    }
  } else if (counts->periods - reports->judged.periods > FEWEST_JUDGED &&
    fm_passes(&reports->next_minute, PERIODS_S))
  {
    reports->judged = *counts;  // else a long good run would hide many late ones after it
  }
}

static void review_time(struct fm_reports * reports)
{
  const struct fm_time_counts counts = fm_engine_time_counts(reports->session->engine);
  review_clock(reports);
  if (counts.restarts > reports->restarts) {
    reports->restarts = counts.restarts;
    log_restart(reports, &counts);
  }
  if (counts.overflows > reports->overflows && fm_passes(&reports->next_time_line, PERIODS_S)) {
    fm_log(reports->session->node, FM_WARN,
      "%" PRIu64 " changes found no room in the queue of a window [a,a]: inputs change more often "
      "than their max_rate; what looks back at them is violated until the lost changes have left "
      "the window", counts.overflows);
  }
  reports->overflows = counts.overflows;
  if (reports->session->table->report.policy == FM_PERIODIC) {
    review_periods(reports, &counts);
  }
}

void fm_reports_review(struct fm_reports * reports)
{
  const struct fm_session * session = reports->session;
  review_time(reports);
  review_silences(reports);
  for (uint32_t k = 0; k < session->n_topics; ++k) {
    review_names(reports, k);
    review_topic(reports, k);
  }
  const uint64_t unpublished = fm_engine_unpublished(session->engine);
  if (unpublished > 0 && !reports->is_unpublished_logged) {
    reports->is_unpublished_logged = true;
    fm_log(session->node, FM_ERROR,
      "violations could not be published: %" PRIu64 " so far; /diagnostics counts them",
      unpublished);
  }
}

// ---- what is missing ---------------------------------------------------------------------------

// Set the flags of the inputs for which a requirement waits: those without a value, or if all have
// an initial value and there was no step, those of which no message came. Returns whether it waits.
static bool note_awaited(
  const struct fm_session * session, uint32_t requirement, bool * is_awaited)
{
  const struct fm_report_requirement * about = &session->table->report.requirements[requirement];
  bool waits = false;
  for (uint32_t k = 0; k < about->n_inputs; ++k) {
    if (!fm_has_value(session, about->inputs[k])) {
      waits = is_awaited[about->inputs[k]] = true;
    }
  }
  if (waits || fm_engine_requirement_counts(session->engine, requirement).steps > 0) {
    return waits;
  }
  for (uint32_t k = 0; k < about->n_inputs; ++k) {
    if (fm_engine_input_counts(session->engine, about->inputs[k]).received == 0) {
      waits = is_awaited[about->inputs[k]] = true;
    }
  }
  return waits;
}

static void add_reason_of_topic(
  const struct fm_session * session, uint32_t topic, const bool * is_awaited,
  struct names * reasons)
{
  const struct fm_topic * fed = &session->table->report.topic_inputs[topic];
  const struct fm_mapped_topic * mapped = &session->topics[topic];
  const struct fm_publishers publishers = fm_subscription_publishers(mapped->state);
  struct names inputs = {{NULL, 0, 0}, 0};
  struct fm_text reason = {NULL, 0, 0};
  for (uint32_t k = 0; k < fed->n_inputs; ++k) {
    if (is_awaited[fed->inputs[k]]) {
      add_quoted(&inputs, session->table->report.inputs[fed->inputs[k]].name,
        fm_has_value(session, fed->inputs[k]) ? " (it has its initial value)" : "");
    }
  }
  if (inputs.n > 0) {
    const bool has_others = publishers.other_types[0] != '\0';
    fm_text_add(&reason, "nothing %sreceived on %s (%u publisher%s%s%s) for %s",
      fm_engine_topic_counts(session->engine, topic).messages > 0 ? "usable " : "", mapped->name,
      publishers.n, publishers.n == 1u ? "" : "s",
      has_others ? " of " : "", has_others ? session->table->topics[topic].type : "",
      all_names(&inputs));
    add_name(reasons, "; ", fm_text_get(&reason));
  }
  fm_text_free(&inputs.text);
  fm_text_free(&reason);
}

void fm_reports_missing(const struct fm_reports * reports)
{
  const struct fm_session * session = reports->session;
  const struct fm_monitor * monitor = session->table->monitor();
  bool * is_awaited = calloc(monitor->n_inputs + 1u, sizeof(*is_awaited));
  struct names waiting = {{NULL, 0, 0}, 0};
  struct names reasons = {{NULL, 0, 0}, 0};
  for (uint32_t k = 0; is_awaited != NULL && k < monitor->n_requirements; ++k) {
    if (note_awaited(session, k, is_awaited)) {
      add_name(&waiting, ", ", session->table->report.requirements[k].id);
    }
  }
  for (uint32_t k = 0; waiting.n > 0 && k < session->n_topics; ++k) {
    add_reason_of_topic(session, k, is_awaited, &reasons);
  }
  if (waiting.n > 0) {
    const bool is_one = waiting.n == 1u;
    fm_log(session->node, FM_WARN, "%s %s not evaluated yet: %s", all_names(&waiting),
      is_one ? "is" : "are", all_names(&reasons));
  }
  fm_text_free(&waiting.text);
  fm_text_free(&reasons.text);
  free(is_awaited);
}
