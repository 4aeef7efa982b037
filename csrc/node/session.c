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

/// session.c: see session.h for the contract.

#include "session.h"

#include <rcl/error_handling.h>
#include <rmw/qos_profiles.h>
#include <diagnostic_msgs/msg/diagnostic_array.h>
#include <std_msgs/msg/empty.h>
#include <stdlib.h>
#include <string.h>

#include "rmw_functions.h"

#define PATIENCE_NS 500000     // a timeout found later may be put off once (evaluator.h)
#define REVIEWED_AT_ONCE 50u   // topics, 50 us each
#define ALIGNMENT 16u

// ---- what is advertised ------------------------------------------------------------------------

static bool advertise(
  struct fm_session * session, rcl_publisher_t * publisher,
  const rosidl_message_type_support_t * type, const char * topic)
{
  rcl_publisher_options_t options = rcl_publisher_get_default_options();
  options.qos = rmw_qos_profile_default;  // reliable, volatile
  options.qos.depth = session->settings.handler_depth;
  *publisher = rcl_get_zero_initialized_publisher();
  if (rcl_publisher_init(publisher, &session->node->node, type, topic, &options) == RCL_RET_OK) {
    return true;
  }
  fm_log_failure(session->node, "cannot subscribe or advertise");
  return false;
}

static void withdraw(struct fm_session * session, rcl_publisher_t * publisher)
{
  if (publisher->impl != NULL &&
    rcl_publisher_fini(publisher, &session->node->node) != RCL_RET_OK)
  {
    rcl_reset_error();
  }
}

enum kind { MONITORED, ANNOUNCED, OWN };  // topics of inputs; of violations; others of the node

struct used
{
  const char * name;
  const char * type;
  enum kind kind;
  char * full;  // after remapping
};

static const struct used own[] = {
  {"/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", OWN, NULL},
  {"~/alive", "std_msgs/msg/Header", OWN, NULL},
  {"~/transition_event", "lifecycle_msgs/msg/TransitionEvent", OWN, NULL},
  {"/parameter_events", "rcl_interfaces/msg/ParameterEvent", OWN, NULL},
  {"/rosout", "rcl_interfaces/msg/Log", OWN, NULL},
  {"/clock", "rosgraph_msgs/msg/Clock", OWN, NULL}};
enum { N_OWN = sizeof(own) / sizeof(own[0]) };

static struct used topic_of(const struct fm_node_table * table, uint32_t k)
{
  const uint32_t n = table->monitor()->n_requirements;
  if (k < table->report.n_topics) {
    return (struct used) {table->topics[k].name, table->topics[k].type, MONITORED, NULL};
  }
  k -= table->report.n_topics;
  if (k < n) {
    return (struct used) {
      table->handlers[k], "std_msgs/msg/Empty", ANNOUNCED, NULL};
  }
  return k > n ? own[k - n - 1u] : (struct used) {
    FM_DETAILS_TOPIC, "diagnostic_msgs/msg/DiagnosticArray", ANNOUNCED, NULL};
}

// Inputs may be read from a topic of the node itself, with its type.
static bool is_conflict(const struct used * one, const struct used * other)
{
  const bool is_shared = (one->kind == OWN || other->kind == OWN) &&
    one->kind != ANNOUNCED && other->kind != ANNOUNCED;
  return strcmp(one->type, other->type) != 0 ||
         (strcmp(one->name, other->name) != 0 && !is_shared);
}

// Refuse a topic that is one with an earlier one.
static bool refuse_used(
  const struct fm_session * session, const struct used * used, const struct used * topic)
{
  for (const struct used * other = used; other < topic; ++other) {
    if (strcmp(topic->full, other->full) == 0 && is_conflict(other, topic)) {
      fm_log(session->node, FM_ERROR, "'%s' and %s'%s' are both remapped to %s; %s", other->name,
        topic->kind == OWN ? "the node's own " : "", topic->name, topic->full,
        topic->kind == MONITORED ?
        "if they are one topic, give the inputs that they feed one `topic:` in the bundle" :
        "what the node announces needs a topic of its own");
      return true;
    }
  }
  return false;
}

// Refuse two topics that are one after remapping: each message would cause two steps, or have two
// meanings for those who receive it.
static bool refuse_merged(const struct fm_session * session)
{
  const struct fm_node_table * table = session->table;
  const uint32_t n = table->report.n_topics + table->monitor()->n_requirements + 1u + N_OWN;
  struct used * used = calloc(n, sizeof(*used));
  bool is_good = used != NULL;
  for (uint32_t k = 0; is_good && k < n; ++k) {
    used[k] = topic_of(table, k);
    used[k].full = fm_resolved_name(session->node, used[k].name);
    if (used[k].full == NULL) {
      fm_log_failure(session->node, "cannot subscribe or advertise");
      is_good = false;
    } else {
      is_good = !refuse_used(session, used, &used[k]);
    }
  }
  for (uint32_t k = 0; used != NULL && k < n; ++k) {
    free(used[k].full);
  }
  free(used);
  return is_good;
}

static bool advertise_all(struct fm_session * session)
{
  const uint32_t n = session->table->monitor()->n_requirements;
  session->handlers = calloc(n + 1u, sizeof(*session->handlers));
  if (session->handlers == NULL) {
    return false;
  }
  for (; session->n_handlers < n; ++session->n_handlers) {
    if (!advertise(
        session, &session->handlers[session->n_handlers],
        ROSIDL_GET_MSG_TYPE_SUPPORT(std_msgs, msg, Empty),
        session->table->handlers[session->n_handlers]))
    {
      return false;
    }
  }
  return advertise(
    session, &session->details, ROSIDL_GET_MSG_TYPE_SUPPORT(diagnostic_msgs, msg, DiagnosticArray),
    FM_DETAILS_TOPIC);
}

bool fm_session_configure(
  struct fm_session * session, const struct fm_node_table * table, struct fm_node * node,
  struct fm_node_clock * clock, const struct fm_settings * settings)
{
  memset(session, 0, sizeof(*session));
  session->table = table;
  session->node = node;
  session->clock = clock;
  session->settings = *settings;
  session->is_configured = true;
  if (!refuse_merged(session) || !advertise_all(session)) {
    fm_session_release(session);
    return false;
  }
  return true;
}

void fm_session_release(struct fm_session * session)
{
  fm_session_deactivate(session);
  for (uint32_t k = 0; k < session->n_handlers; ++k) {
    withdraw(session, &session->handlers[k]);
  }
  free(session->handlers);
  session->handlers = NULL;
  session->n_handlers = 0;
  withdraw(session, &session->details);
  session->is_configured = false;
}

// ---- the engine --------------------------------------------------------------------------------

static struct fm_evaluator * make_evaluator(struct fm_session * session)
{
  const struct fm_node_table * table = session->table;
  const struct fm_evaluator_options options = {
    .monitor = table->monitor(),
    .topics = table->report.topic_inputs, .n_topics = table->report.n_topics,
    .policy = table->report.policy, .reports = table->reports, .timeouts = table->timeouts,
    .violates = table->violates, .period = table->report.period, .patience = PATIENCE_NS,
    .sources = table->sources, .reports_recoveries = true, .startups = table->startups};
  const uint64_t bytes = fm_evaluator_bytes(&options);
  session->memory = bytes == 0 ? NULL : malloc((size_t)bytes + ALIGNMENT);
  if (session->memory == NULL) {
    return NULL;
  }
  const uintptr_t address = (uintptr_t)session->memory;
  struct fm_evaluator * evaluator = fm_evaluator_init(
    (uint8_t *)session->memory + (-address % ALIGNMENT), &options);
  for (uint32_t k = 0; evaluator != NULL && k < options.monitor->n_inputs; ++k) {
    if (table->report.inputs[k].has_initial) {
      fm_evaluator_initial(evaluator, k, table->report.inputs[k].initial);
    }
  }
  return evaluator;
}

static bool make_engine(struct fm_session * session)
{
  const struct fm_node_table * table = session->table;
  const struct fm_engine_options options = {
    .evaluator = make_evaluator(session), .monitor = table->monitor(),
    .readers = table->readers == NULL ? NULL : table->readers(),
    .topics = table->report.topic_inputs, .n_topics = table->report.n_topics,
    .sources = table->sources,
    .uses_header_stamps = table->report.uses_header_stamps, .reorder = table->report.reorder,
    .takes_recoveries = false};
  session->engine = options.evaluator == NULL ? NULL : fm_engine_create(&options);
  if (session->engine == NULL) {
    fm_log(session->node, FM_ERROR, "the engine cannot be made: memory is short");
  }
  return session->engine != NULL;
}

static bool begin_reporter(struct fm_session * session)
{
  const struct fm_report_table * table = &session->table->report;
  session->topic_names = calloc(table->n_topics + 1u, sizeof(*session->topic_names));
  if (session->topic_names == NULL) {
    return false;
  }
  for (uint32_t k = 0; k < table->n_topics; ++k) {
    session->topic_names[k] = fm_resolved_name(session->node, table->topics[k].name);
    if (session->topic_names[k] == NULL) {
      fm_log_failure(session->node, "cannot subscribe");
      return false;
    }
  }
  session->reporter = (struct fm_reporter) {
    table, session->table->monitor(), session->engine,
    rcl_node_get_fully_qualified_name(&session->node->node) + 1,  // without its slash
    (const char * const *)session->topic_names};
  return true;
}

static void end_reporter(struct fm_session * session)
{
  for (uint32_t k = 0; session->topic_names != NULL && k < session->table->report.n_topics; ++k) {
    free(session->topic_names[k]);
  }
  free(session->topic_names);
  session->topic_names = NULL;
}

static bool start_announcer(struct fm_session * session)
{
  void ** publishers = calloc(session->n_handlers + 1u, sizeof(*publishers));
  if (publishers == NULL) {
    return false;
  }
  for (uint32_t k = 0; k < session->n_handlers; ++k) {
    publishers[k] = rcl_publisher_get_rmw_handle(&session->handlers[k]);
  }
  const bool is_started = fm_announcer_start(
    &session->announcer, session->engine, &fm_rmw_functions, publishers, session->n_handlers,
    NULL, 0);
  free(publishers);
  return is_started;
}

static bool start_threads(struct fm_session * session)
{
  session->detail_thread = fm_detail_thread_start(
    session->node, &session->reporter, &session->details, session->settings.logs_violations);
  if (session->detail_thread == NULL || !start_announcer(session)) {
    fm_log(session->node, FM_ERROR, "no thread can be started");
    return false;
  }
  return true;
}

static bool subscribe_all(struct fm_session * session)
{
  const struct fm_node_table * table = session->table;
  session->topics = calloc(table->report.n_topics + 1u, sizeof(*session->topics));
  if (session->topics == NULL) {
    return false;
  }
  for (uint32_t k = 0; k < table->report.n_topics; ++k) {
    session->n_topics = k + 1u;
    if (!fm_topic_open(
        &session->topics[k], session->node, &table->topics[k], &session->settings.fixed[k], k))
    {
      return false;
    }
  }
  for (uint32_t k = 0; k < table->report.n_topics; ++k) {
    if (!fm_topic_start(&session->topics[k], session->engine, &fm_rmw_functions)) {
      return false;
    }
  }
  return true;
}

bool fm_session_activate(struct fm_session * session)
{
  if (!make_engine(session) || !begin_reporter(session)) {
    fm_session_deactivate(session);
    return false;
  }
  fm_engine_follow_steady(session->engine);
  if (session->clock->is_simulated) {
    fm_engine_follow_clock(session->engine, fm_clock_read, session->clock, false);
  }
  if (!start_threads(session) || !subscribe_all(session)) {
    fm_session_deactivate(session);
    return false;
  }
  fm_engine_begin(session->engine);  // after the subscriptions: no timeout runs while they are made
  session->is_active = true;
  fm_session_review(session);
  return true;
}

// The publishers outlive the threads that publish, and these the subscriptions.
void fm_session_deactivate(struct fm_session * session)
{
  bool is_over = true;
  session->is_active = false;
  for (uint32_t k = 0; k < session->n_topics; ++k) {
    is_over = fm_topic_close(&session->topics[k]) && is_over;
  }
  free(session->topics);
  session->topics = NULL;
  session->n_topics = session->next_reviewed = 0;
  if (session->engine != NULL) {
    fm_engine_close(session->engine);
  }
  fm_detail_thread_join(session->detail_thread);
  session->detail_thread = NULL;
  fm_announcer_join(&session->announcer);
  if (session->engine != NULL && is_over) {
    fm_engine_destroy(session->engine);
    free(session->memory);
  }
  session->engine = NULL;
  session->memory = NULL;
  end_reporter(session);
}

// ---- while it runs -----------------------------------------------------------------------------

void fm_session_review(struct fm_session * session)
{
  const uint32_t begin = session->next_reviewed;
  for (uint32_t k = begin; k < session->n_topics && k < begin + REVIEWED_AT_ONCE; ++k) {
    fm_topic_review(&session->topics[k]);
  }
  session->next_reviewed = begin + REVIEWED_AT_ONCE;
  if (session->next_reviewed >= session->n_topics) {
    session->next_reviewed = 0;
  }
}

void fm_session_reset(struct fm_session * session)
{
  fm_engine_reset(session->engine);
}

void fm_session_leave_clock(struct fm_session * session)
{
  if (session->is_active && session->clock->is_simulated) {
    fm_engine_follow_steady(session->engine);
  }
}

void fm_session_follow_clock(struct fm_session * session)
{
  if (session->is_active && session->clock->is_simulated) {
    // /clock still has the time at which it was left.
    fm_engine_follow_clock(session->engine, fm_clock_read, session->clock, true);
  }
}

void fm_session_drain(struct fm_session * session)
{
  if (session->is_active) {
    fm_engine_drain(session->engine);
  }
}

void fm_session_wake(struct fm_session * session)
{
  if (session->is_active) {
    fm_engine_wake(session->engine);
  }
}

bool fm_session_turns(const struct fm_session * session, uint64_t * turns)
{
  const uint64_t announcer = fm_announcer_turns(session->announcer);
  const uint64_t details = fm_detail_thread_turns(session->detail_thread);
  if (announcer == turns[0] || details == turns[1]) {
    return false;
  }
  turns[0] = announcer;
  turns[1] = details;
  return true;
}
