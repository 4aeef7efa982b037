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

/// health.c: see health.h for the contract.

#include "health.h"

#include <diagnostic_msgs/msg/diagnostic_array.h>
#include <inttypes.h>
#include <rcl/error_handling.h>
#include <rmw/qos_profiles.h>
#include <stdlib.h>
#include <string.h>

#include "status_messages.h"

enum
{
  OK = FM_STATUS_OK,
  WARN = FM_STATUS_WARN,
  ERROR = FM_STATUS_ERROR,
  MOST_BEHIND = 1000000000  // ns
};

bool fm_health_begin(
  struct fm_health * health, const struct fm_session * session, const struct fm_reports * reports)
{
  const uint32_t n_inputs = session->table->monitor()->n_inputs;
  const rcl_publisher_options_t options = rcl_publisher_get_default_options();  // depth: 10
  memset(health, 0, sizeof(*health));
  health->session = session;
  health->reports = reports;
  health->topics = calloc(session->n_topics + 1u, sizeof(*health->topics));
  health->unusable = calloc(n_inputs + 1u, sizeof(*health->unusable));
  health->is_newly_unusable = calloc(n_inputs + 1u, sizeof(*health->is_newly_unusable));
  health->time = fm_engine_time_counts(session->engine);
  health->reported = fm_steady_now();
  health->publisher = rcl_get_zero_initialized_publisher();
  if (rcl_publisher_init(
      &health->publisher, &session->node->node,
      ROSIDL_GET_MSG_TYPE_SUPPORT(diagnostic_msgs, msg, DiagnosticArray), "/diagnostics",
      &options) != RCL_RET_OK)
  {
    fm_log_failure(session->node, "cannot advertise /diagnostics");
    return false;
  }
  return health->topics != NULL && health->unusable != NULL && health->is_newly_unusable != NULL;
}

void fm_health_end(struct fm_health * health)
{
  if (health->publisher.impl != NULL &&
    rcl_publisher_fini(&health->publisher, &health->session->node->node) != RCL_RET_OK)
  {
    rcl_reset_error();
  }
  free(health->topics);
  free(health->unusable);
  free(health->is_newly_unusable);
  memset(health, 0, sizeof(*health));
}

static struct fm_status * add_status(
  const struct fm_health * health, struct fm_statuses * list, uint8_t level, const char * kind,
  const char * name, const char * message)
{
  struct fm_text text = {NULL, 0, 0};
  const char * node = rcl_node_get_fully_qualified_name(&health->session->node->node);
  fm_text_add(&text, "%s: %s%s", node + 1, kind, name);  // without its slash
  struct fm_status * status = fm_statuses_add(
    list, (enum fm_status_level)level, fm_text_get(&text), message,
    health->session->table->report.component);
  fm_text_free(&text);
  return status;
}

// ---- requirements ------------------------------------------------------------------------------

// The names of a requirement's inputs of which one of three things is so.
struct places
{
  struct fm_text missing;
  struct fm_text silent;
  struct fm_text violating;  // silent, with `stale: violate`
};

static struct places places_of(
  const struct fm_health * health, const struct fm_report_requirement * requirement)
{
  struct places places;
  memset(&places, 0, sizeof(places));
  for (uint32_t k = 0; k < requirement->n_inputs; ++k) {
    const uint32_t input = requirement->inputs[k];
    const char * name = health->session->table->report.inputs[input].name;
    if (!fm_has_value(health->session, input)) {
      fm_text_list(&places.missing, ", ", name);
    }
    if (health->reports->inputs[input].silence.is_silent) {
      fm_text_list(&places.silent, ", ", name);
      if (health->session->table->report.inputs[input].violates) {
        fm_text_list(&places.violating, ", ", name);
      }
    }
  }
  return places;
}

static uint8_t describe_requirement(
  const struct fm_health * health, const struct fm_report_requirement * requirement,
  const struct fm_requirement_counts * counts, struct fm_text * message)
{
  struct places places = places_of(health, requirement);
  const uint8_t violated = requirement->is_warning ? WARN : ERROR;
  uint8_t level = WARN;
  if (places.violating.length > 0 && counts->is_violated) {
    level = violated;
    fm_text_add(message, "violated: no message for %s", fm_text_get(&places.violating));
  } else if (places.missing.length > 0) {
    fm_text_add(message, "no value yet of %s", fm_text_get(&places.missing));
  } else if (counts->steps == 0) {
    fm_text_add(message, "not evaluated yet");
  } else if (!counts->is_violated && places.silent.length > 0) {
    fm_text_add(message, "satisfied, on old values of %s", fm_text_get(&places.silent));
  } else {
    level = counts->is_violated ? violated : OK;
    fm_text_add(message, "%s", counts->is_violated ? "violated" : "satisfied");
  }
  fm_text_free(&places.missing);
  fm_text_free(&places.silent);
  fm_text_free(&places.violating);
  return level;
}

static void add_requirement(
  const struct fm_health * health, struct fm_statuses * list, uint32_t requirement)
{
  const struct fm_report_requirement * about =
    &health->session->table->report.requirements[requirement];
  const struct fm_requirement_counts counts =
    fm_engine_requirement_counts(health->session->engine, requirement);
  const bool is_timed = health->session->table->report.policy == FM_TIMED;
  struct fm_text message = {NULL, 0, 0};
  const uint8_t level = describe_requirement(health, about, &counts, &message);
  struct fm_status * status =
    add_status(health, list, level, "", about->id, fm_text_get(&message));
  fm_status_value(status, is_timed ? "evaluations" : "steps", "%" PRIu64, counts.steps);
  fm_status_value(
    status, is_timed ? "violating evaluations" : "violations", "%" PRIu64, counts.violations);
  fm_status_value(status, "announced", "%" PRIu64, counts.announced);
  if (about->shows_verdict) {
    fm_status_value(status, "verdict", "%s", counts.verdict ? "true" : "false");
  }
  fm_status_value(status, "text", "%s", about->text);
  fm_text_free(&message);
}

// ---- topics ------------------------------------------------------------------------------------

// What is wrong with a topic, and the highest level of it.
struct troubles
{
  struct fm_text text;
  uint8_t level;
};

static void add_trouble(struct troubles * troubles, uint8_t level, const char * format, ...)
FM_PRINTF(3, 4);

static void add_trouble(struct troubles * troubles, uint8_t level, const char * format, ...)
{
  va_list arguments;
  fm_text_add(&troubles->text, "%s", troubles->text.length > 0 ? "; " : "");
  va_start(arguments, format);
  fm_text_add_arguments(&troubles->text, format, arguments);
  va_end(arguments);
  troubles->level = level > troubles->level ? level : troubles->level;
}

static void add_silence(
  const struct fm_health * health, const struct fm_topic * fed, struct troubles * troubles)
{
  struct fm_text text = {NULL, 0, 0};
  uint8_t level = OK;
  char seconds[32] = "";
  for (uint32_t k = 0; k < fed->n_inputs; ++k) {
    const struct fm_silence * silence = &health->reports->inputs[fed->inputs[k]].silence;
    if (silence->is_silent) {
      char lasted[32];
      (void)snprintf(lasted, sizeof(lasted), "%.1f", (double)silence->lasted / 1e9);
      if (level == OK) {
        level = health->session->table->report.inputs[fed->inputs[k]].violates ? ERROR : WARN;
      }
      if (strcmp(lasted, seconds) != 0) {
        fm_text_add(&text, "%sfor %s s of ", text.length > 0 ? ", " : "", lasted);
      } else {
        fm_text_add(&text, ", ");
      }
      memcpy(seconds, lasted, sizeof(seconds));
      fm_text_add(&text, "%s", health->session->table->report.inputs[fed->inputs[k]].name);
    }
  }
  if (level != OK) {
    add_trouble(troubles, level, "nothing %s", fm_text_get(&text));
  }
  fm_text_free(&text);
}

static void add_fields(
  const struct fm_health * health, const struct fm_topic * fed, struct troubles * troubles)
{
  struct fm_text unusable = {NULL, 0, 0};
  struct fm_text absent = {NULL, 0, 0};
  for (uint32_t k = 0; k < fed->n_inputs; ++k) {
    const char * name = health->session->table->report.inputs[fed->inputs[k]].name;
    if (health->is_newly_unusable[fed->inputs[k]]) {
      fm_text_list(&unusable, ", ", name);
    }
    if (health->reports->inputs[fed->inputs[k]].is_absent_logged) {
      fm_text_list(&absent, ", ", name);
    }
  }
  if (unusable.length > 0) {
    add_trouble(troubles, WARN, "fields cannot be used: %s", fm_text_get(&unusable));
  }
  if (absent.length > 0) {
    add_trouble(
      troubles, WARN, "no message has had the names for 10 s: %s", fm_text_get(&absent));
  }
  fm_text_free(&unusable);
  fm_text_free(&absent);
}

static void add_increase(
  struct troubles * troubles, uint64_t before, uint64_t now, const char * what)
{
  if (now > before) {
    add_trouble(troubles, WARN, "%" PRIu64 " %s since the last report", now - before, what);
  }
}

static struct troubles troubles_of(
  const struct fm_health * health, uint32_t topic, const struct fm_topic_health * now)
{
  const struct fm_mapped_topic * mapped = &health->session->topics[topic];
  const struct fm_publishers publishers = fm_subscription_publishers(mapped->state);
  const struct fm_topic * fed = &health->session->table->report.topic_inputs[topic];
  const struct fm_topic_health * before = &health->topics[topic];
  struct troubles found = {{NULL, 0, 0}, OK};
  if (publishers.other_types[0] != '\0') {
    add_trouble(&found, ERROR, "a publisher of %s, and not %s", publishers.other_types,
      mapped->about->type);
  }
  if (publishers.unmatched[0] != '\0') {
    add_trouble(&found, ERROR, "not received: %s", publishers.unmatched);
  }
  add_silence(health, fed, &found);
  add_fields(health, fed, &found);
  add_increase(&found, before->lost, now->lost, "lost");
  add_increase(&found, before->order.late, now->order.late, "late");
  add_increase(&found, before->order.overflows, now->order.overflows, "too early");
  add_increase(&found, before->order.ahead, now->order.ahead, "ahead of the clock");
  if (now->behind > MOST_BEHIND) {
    add_trouble(&found, WARN, "evaluated up to %.1f s after reception", (double)now->behind / 1e9);
  }
  if (publishers.n == 0 && publishers.other_types[0] == '\0') {
    add_trouble(&found, WARN, "no publisher");
  }
  return found;
}

static void add_counts_of_inputs(
  const struct fm_health * health, const struct fm_topic * fed, struct fm_status * status)
{
  const struct fm_node_table * table = health->session->table;
  struct fm_text key = {NULL, 0, 0};
  for (uint32_t k = 0; k < fed->n_inputs; ++k) {
    if (health->unusable[fed->inputs[k]] > 0) {
      fm_text_clear(&key);
      fm_text_add(&key, "unusable %s", table->report.inputs[fed->inputs[k]].name);
      fm_status_value(status, fm_text_get(&key), "%" PRIu64, health->unusable[fed->inputs[k]]);
    }
  }
  for (uint32_t k = 0; k < fed->n_inputs; ++k) {
    if (table->report.inputs[fed->inputs[k]].is_timed_out) {
      fm_text_clear(&key);
      fm_text_add(&key, "silences %s", table->report.inputs[fed->inputs[k]].name);
      fm_status_value(status, fm_text_get(&key), "%" PRIu64,
        health->reports->inputs[fed->inputs[k]].silence.count);
    }
  }
  fm_text_free(&key);
}

static void add_topic(
  struct fm_health * health, struct fm_statuses * list, uint32_t topic, double seconds)
{
  const struct fm_session * session = health->session;
  const struct fm_topic * fed = &session->table->report.topic_inputs[topic];
  const struct fm_mapped_topic * mapped = &session->topics[topic];
  const struct fm_topic_counts counts = fm_engine_topic_counts(session->engine, topic);
  const struct fm_topic_health now = {
    counts.messages, fm_engine_lost(session->engine, topic),
    fm_engine_order_counts(session->engine, topic),
    fm_engine_take_behind(session->engine, topic)};
  struct troubles troubles = troubles_of(health, topic, &now);
  struct fm_status * status = list == NULL ? NULL : add_status(
    health, list, troubles.level, "topic ", mapped->name,
    troubles.text.length > 0 ? fm_text_get(&troubles.text) : "received");
  fm_status_value(status, "received", "%" PRIu64, now.received);
  fm_status_value(status, "rate", "%.1f",
    (double)(now.received - health->topics[topic].received) / seconds);
  fm_status_value(status, "undecodable", "%" PRIu64, counts.undecodable);
  fm_status_value(status, "lost", "%" PRIu64, now.lost);
  fm_status_value(status, "behind", "%.3f", (double)now.behind / 1e9);
  fm_status_value(status, "publishers", "%u",
    fm_subscription_publishers(mapped->state).n);
  if (session->table->report.uses_header_stamps) {
    fm_status_value(status, "late", "%" PRIu64, now.order.late);
    fm_status_value(status, "too early", "%" PRIu64, now.order.overflows);
    fm_status_value(status, "ahead", "%" PRIu64, now.order.ahead);
  }
  add_counts_of_inputs(health, fed, status);
  health->topics[topic] = now;
  fm_text_free(&troubles.text);
}

// ---- time and violations -----------------------------------------------------------------------

static void add_time(struct fm_health * health, struct fm_statuses * list)
{
  const struct fm_time_counts now = fm_engine_time_counts(health->session->engine);
  const struct fm_node_table * table = health->session->table;
  const bool went_back = now.restarts > health->time.restarts;
  const bool is_full = now.overflows > health->time.overflows;
  if (list != NULL && table->report.policy == FM_TIMED) {
    struct fm_status * status = add_status(
      health, list, went_back || is_full ? WARN : OK, "time of ", table->report.bundle,
      went_back ? "went back since the last report" :
      is_full ? "more changes than max_rate allows" : "passes");
    fm_status_value(status, "restarts", "%" PRIu64, now.restarts);
    fm_status_value(status, "overflows", "%" PRIu64, now.overflows);
  }
  if (list != NULL && table->report.policy == FM_PERIODIC) {
    const bool is_bad = fm_are_worth_reading(&health->time, &now);
    struct fm_text message = {NULL, 0, 0};
    fm_text_add(&message, "%" PRIu64 " missed, %" PRIu64 " late since the last report",
      now.missed - health->time.missed, now.late - health->time.late);
    struct fm_status * status = add_status(
      health, list, is_bad ? WARN : OK, "periods of ", table->report.bundle,
      is_bad ? fm_text_get(&message) : "in time");
    fm_status_value(status, "period", "%g", (double)table->report.period / 1e9);
    fm_status_value(status, "taken", "%" PRIu64, now.periods);
    fm_status_value(status, "late", "%" PRIu64, now.late);
    fm_status_value(status, "missed", "%" PRIu64, now.missed);
    fm_status_value(status, "restarts", "%" PRIu64, now.restarts);
    fm_text_free(&message);
  }
  health->time = now;
}

static void add_unpublished(struct fm_health * health, struct fm_statuses * list)
{
  const uint64_t now = fm_engine_unpublished(health->session->engine);
  const uint64_t more = now - health->unpublished;
  struct fm_text message = {NULL, 0, 0};
  if (list != NULL && now > 0) {
    fm_text_add(&message, "%" PRIu64 " not published since the last report", more);
    struct fm_status * status = add_status(
      health, list, more > 0 ? ERROR : WARN, "violations of ",
      health->session->table->report.bundle,
      more > 0 ? fm_text_get(&message) : "some were not published");
    fm_status_value(status, "not published", "%" PRIu64, now);
  }
  health->unpublished = now;
  fm_text_free(&message);
}

// ---- the report --------------------------------------------------------------------------------

static void note_unusable(struct fm_health * health)
{
  for (uint32_t k = 0; k < health->session->table->monitor()->n_inputs; ++k) {
    const uint64_t now = fm_engine_input_counts(health->session->engine, k).unusable;
    health->is_newly_unusable[k] = now > health->unusable[k];
    health->unusable[k] = now;
  }
}

static double seconds_since_report(struct fm_health * health)
{
  const int64_t now = fm_steady_now();
  const double seconds = (double)(now - health->reported) / 1e9;
  health->reported = now;
  return seconds < 1e-3 ? 1e-3 : seconds;
}

void fm_health_publish(struct fm_health * health)
{
  const uint32_t n = health->session->table->monitor()->n_requirements;
  const double seconds = seconds_since_report(health);
  size_t listeners = 0;
  struct fm_statuses made = {NULL, 0, 0};
  if (rcl_publisher_get_subscription_count(&health->publisher, &listeners) != RCL_RET_OK) {
    rcl_reset_error();
  }
  // The counters since the last report are noted even if nobody listens.
  struct fm_statuses * list = listeners > 0 ? &made : NULL;
  note_unusable(health);
  for (uint32_t k = 0; list != NULL && k < n; ++k) {
    add_requirement(health, list, k);
  }
  for (uint32_t k = 0; k < health->session->n_topics; ++k) {
    add_topic(health, list, k, seconds);
  }
  add_time(health, list);
  add_unpublished(health, list);
  if (list != NULL) {
    fm_publish_statuses(&health->publisher, list, fm_clock_now(health->session->clock));
  }
  fm_statuses_free(&made);
}
