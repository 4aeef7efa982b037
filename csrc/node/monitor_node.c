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

/// monitor_node.c: see monitor_node.h for the contract.

#include "monitor_node.h"

#include <inttypes.h>
#include <lifecycle_msgs/msg/transition.h>
#include <rcl/error_handling.h>
#include <rcl/graph.h>
#include <rmw/qos_profiles.h>
#include <rosidl_runtime_c/string_functions.h>
#include <std_srvs/srv/trigger.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <type_description_interfaces/srv/get_type_description.h>

#include "endpoints.h"
#include "rmw_functions.h"
#include "scheduling.h"
#include "session.h"
#include "start_lines.h"
#include "words.h"

#define WAIT_NS (FM_SECOND / 5)  // a longer wait would outlast a signal
#define REPORT_PERIOD_NS FM_SECOND
#define LOOKS 10u                // for a node of the same name, one a second

// ---- transitions -------------------------------------------------------------------------------

// Ask the system for what the parameters want; what it refuses is logged.
static void schedule(const struct fm_node * node, const struct fm_parameters * given)
{
  const int32_t priority = (int32_t)fm_parameter_whole(given, "priority");
  const fm_parameter_value * wanted = &fm_parameter_find(given, "processors")->value;
  struct fm_text text = {NULL, 0, 0};
  if (wanted->type == FM_WHOLE) {
    fm_text_add(&text, "%" PRId64, wanted->integer_value);
  } else {
    fm_text_add(&text, "%s", wanted->string_value.data);
  }
  const char * processors = fm_text_get(&text);
  int32_t error = priority == 0 ? 0 : fm_set_priority(priority);
  if (error != 0) {
    fm_log(node, FM_WARN, FM_WORDS_NO_PRIORITY, (int)priority, strerror(error));
  }
  error = processors[0] == '\0' ? 0 : fm_set_processors(processors);
  if (error != 0) {
    fm_log(node, FM_WARN, FM_WORDS_NO_PROCESSORS, processors, strerror(error));
  }
  error = fm_parameter_is_true(given, "lock_memory") ? fm_lock_memory() : 0;
  if (error != 0) {
    fm_log(node, FM_WARN, FM_WORDS_NO_LOCKED_MEMORY, strerror(error));
  }
  fm_text_free(&text);
}

static bool configure_all(struct fm_monitor_node * monitor)
{
  bool is_good = fm_refuse_names(&monitor->node, monitor->tables);
  for (uint32_t k = 0; is_good && k < monitor->tables->n; ++k) {
    is_good = fm_session_configure(
      &monitor->sessions[k], monitor->tables, k, &monitor->node, &monitor->clock,
      &monitor->parameters);
  }
  return is_good;
}

static void warn(const struct fm_monitor_node * monitor, const struct fm_node_table * table)
{
  for (uint32_t k = 0; k < table->n_warnings; ++k) {
    fm_log(&monitor->node, FM_WARN, "%s", table->warnings[k]);
  }
  if (table->judged_by_gates[0] != '\0') {
    fm_log(&monitor->node, FM_WARN, "%s", table->judged_by_gates);
  }
}

static void release(void * context);

static bool configure(void * context)
{
  struct fm_monitor_node * monitor = context;
  monitor->parameters.is_configured = configure_all(monitor);
  if (!monitor->parameters.is_configured) {
    release(context);
    return false;
  }
  schedule(&monitor->node, &monitor->parameters);
  for (uint32_t k = 0; k < monitor->tables->n; ++k) {
    warn(monitor, monitor->tables->tables[k]);
  }
  return true;
}

static void deactivate(void * context)
{
  struct fm_monitor_node * monitor = context;
  monitor->is_active = false;
  fm_sign_of_life_end(&monitor->sign_of_life);
  for (uint32_t k = 0; k < monitor->tables->n; ++k) {
    fm_health_end(&monitor->healths[k]);
    fm_session_deactivate(&monitor->sessions[k]);
  }
}

static void log_taking(struct fm_monitor_node * monitor, const char * middleware)
{
  const struct fm_node * node = &monitor->node;
  if (monitor->has_logged_taking) {
    return;
  }
  monitor->has_logged_taking = true;
  if (strcmp(fm_parameter_hot_path(&monitor->parameters), "off") == 0) {
    fm_log(node, FM_INFO, FM_WORDS_WAKES FM_WORDS_HOT_PATH_IS_OFF);
  } else if (fm_taking_of(&monitor->parameters) == FM_WAKE) {
    fm_log(node, FM_INFO, FM_WORDS_WAKES FM_WORDS_UNKNOWN_CALLBACKS, middleware);
  } else {
    const char * why = fm_why_copied();
    fm_log(node, FM_INFO, FM_WORDS_TAKES, middleware,
      why[0] == '\0' ? "" : FM_WORDS_ALL_COPIED, why);
  }
}

static void log_watching(const struct fm_monitor_node * monitor)
{
  const uint32_t n = monitor->tables->n;
  struct fm_watched * watched = calloc(n, sizeof(*watched));
  struct fm_lines lines = {NULL, 0, 0};
  for (uint32_t k = 0; watched != NULL && k < n; ++k) {
    const struct fm_session * session = &monitor->sessions[k];
    watched[k] = (struct fm_watched) {
      &session->reporter, session->table->origin, session->gate_source, session->gate_target,
      session->actions.lock_names, session->actions.names};
  }
  if (watched != NULL) {
    fm_add_watching(&lines, watched, n);
  }
  fm_log_lines(&monitor->node, &lines);
  free(watched);
}

static bool activate_all(struct fm_monitor_node * monitor)
{
  for (uint32_t k = 0; k < monitor->tables->n; ++k) {
    if (!fm_session_activate(&monitor->sessions[k]) ||
      !fm_health_begin(&monitor->healths[k], &monitor->sessions[k]))
    {
      return false;
    }
  }
  return fm_sign_of_life_begin(
    &monitor->sign_of_life, monitor->sessions, monitor->tables->n);
}

static bool activate(void * context)
{
  struct fm_monitor_node * monitor = context;
  if (!activate_all(monitor)) {
    deactivate(context);
    return false;
  }
  monitor->is_active = true;
  monitor->next_review = fm_steady_now();
  monitor->next_report = monitor->next_review + REPORT_PERIOD_NS;
  log_taking(monitor, rmw_get_implementation_identifier());
  log_watching(monitor);
  return true;
}

static void release(void * context)
{
  struct fm_monitor_node * monitor = context;
  monitor->parameters.is_configured = false;
  if (monitor->is_active) {
    deactivate(context);
  }
  for (uint32_t k = 0; monitor->sessions != NULL && k < monitor->tables->n; ++k) {
    if (monitor->sessions[k].table != NULL) {
      fm_session_release(&monitor->sessions[k]);
    }
  }
}

// ---- services ----------------------------------------------------------------------------------

// Returns how many step groups there are, of one instance.
static uint64_t reset_all(struct fm_monitor_node * monitor)
{
  uint64_t n_groups = 0;
  for (uint32_t k = 0; k < monitor->tables->n; ++k) {
    fm_engine_reset(monitor->sessions[k].engine);
    n_groups += monitor->tables->tables[k]->n_groups;
  }
  return n_groups;
}

FM_SERVER(serve_reset, std_srvs, Trigger, struct fm_monitor_node, monitor)
{
  const char * message = FM_WORDS_NO_RESTART;
  struct fm_lines lines = {NULL, 0, 0};
  (void)request;
  response->success = monitor->is_active;
  if (response->success) {
    fm_add_restarted(&lines, reset_all(monitor));
    message = lines.n > 0 ? lines.lines[0].text : "";
  }
  (void)rosidl_runtime_c__String__assign(&response->message, message);
  fm_log_lines(&monitor->node, &lines);
}

FM_SERVER(
  serve_type, type_description_interfaces, GetTypeDescription, struct fm_monitor_node, monitor)
{
  const rmw_request_id_t unused = {{0}, 0};  // it must not be NULL
  type_description_interfaces__srv__GetTypeDescription_Response__fini(response);  // rcl begins it
  rcl_node_type_description_service_handle_request(
    &monitor->node.node, &unused, request, response);
}

// rcl makes the service, and knows the types.
static bool begin_types(struct fm_monitor_node * monitor)
{
  monitor->types = rcl_get_zero_initialized_service();
  if (!fm_parameter_is_true(&monitor->parameters, "start_type_description_service") ||
    rcl_node_type_description_service_init(&monitor->types, &monitor->node.node) == RCL_RET_OK)
  {
    return true;
  }
  fm_log_failure(&monitor->node, "cannot offer the service ~/get_type_description");
  return false;
}

// Do something with the engines of the active sessions.
static void for_engines(
  struct fm_monitor_node * monitor, void (* act)(struct fm_engine * engine))
{
  for (uint32_t k = 0; k < monitor->tables->n; ++k) {
    if (monitor->sessions[k].is_active) {
      act(monitor->sessions[k].engine);
    }
  }
}

// The engines leave /clock before it ends, and follow it after it has begun: it still has the time
// at which it was left.
static void simulate(struct fm_monitor_node * monitor, bool is_simulated)
{
  const bool was_simulated = monitor->clock.is_simulated;
  if (was_simulated && !is_simulated) {
    for_engines(monitor, fm_engine_follow_steady);
  }
  const bool is_new = fm_clock_simulate(&monitor->clock, is_simulated) && !was_simulated &&
    is_simulated;
  for (uint32_t k = 0; is_new && k < monitor->tables->n; ++k) {
    if (monitor->sessions[k].is_active) {
      fm_engine_follow_clock(
        monitor->sessions[k].engine, fm_clock_read, &monitor->clock, true);
    }
  }
}

static void parameter_changed(void * context, const struct fm_parameter * parameter)
{
  if (strcmp(parameter->name, "use_sim_time") == 0) {
    simulate(context, parameter->value.bool_value);
  }
}

// ---- start -------------------------------------------------------------------------------------

static int fail(const char * what)
{
  fprintf(stderr, "error: %s: %s\n", what,
    rcl_error_is_set() ? rcl_get_error_string().str : FM_NO_MEMORY);
  rcl_reset_error();
  return 1;
}

static int begin_context(struct fm_monitor_node * monitor, int argc, const char * const * argv)
{
  rcl_init_options_t options = rcl_get_zero_initialized_init_options();
  monitor->node.allocator = rcl_get_default_allocator();
  monitor->node.context = rcl_get_zero_initialized_context();
  monitor->node.node = rcl_get_zero_initialized_node();
  if (rcl_init_options_init(&options, monitor->node.allocator) != RCL_RET_OK) {
    return fail("rcl");
  }
  const rcl_ret_t result = rcl_init(argc, argv, &options, &monitor->node.context);
  const rcl_ret_t ended = rcl_init_options_fini(&options);
  return result != RCL_RET_OK || ended != RCL_RET_OK ? fail("ROS cannot be initialized") : 0;
}

static int refuse_unknown_arguments(const struct fm_monitor_node * monitor)
{
  const rcl_arguments_t * arguments = &monitor->node.context.global_arguments;
  if (rcl_arguments_get_count_unparsed_ros(arguments) > 0) {
    fprintf(stderr, "error: unknown ROS arguments; a parameter has -p before it\n");
    return 1;
  }
  if (rcl_arguments_get_count_unparsed(arguments) > 1) {
    fprintf(stderr, "error: unexpected arguments; those of ROS come after --ros-args\n");
    return 1;
  }
  return 0;
}

static int begin_node(struct fm_monitor_node * monitor)
{
  const rcl_node_options_t options = rcl_node_get_default_options();
  monitor->sessions = calloc(monitor->tables->n, sizeof(*monitor->sessions));
  monitor->healths = calloc(monitor->tables->n, sizeof(*monitor->healths));
  if (monitor->sessions == NULL || monitor->healths == NULL) {
    return fail("the node cannot be made");
  }
  monitor->has_log = fm_log_begin(&monitor->node);
  if (!monitor->has_log) {
    return fail("ROS cannot make its folder of logs: set HOME, or ROS_LOG_DIR to a folder that "
             "can be written");
  }
  if (rcl_node_init(
      &monitor->node.node, monitor->tables->tables[0]->node_name, "", &monitor->node.context,
      &options) != RCL_RET_OK)
  {
    return fail("the node cannot be made");
  }
  fm_log_on_rosout(&monitor->node, true);
  return 0;
}

static int begin_parameters(struct fm_monitor_node * monitor)
{
  struct fm_text problems = {NULL, 0, 0};
  const bool is_good = fm_parameters_begin(
    &monitor->parameters, &monitor->node, monitor->tables, &problems);
  if (!monitor->parameters.memory.is_short) {
    fm_parameters_warn(&monitor->parameters);
  }
  for (const char * line = fm_text_get(&problems); *line != '\0'; ) {
    const size_t length = strcspn(line, "\n");
    fprintf(stderr, "error: %.*s\n", (int)length, line);
    line += length + (line[length] == '\n' ? 1u : 0u);
  }
  if (is_good) {
    fm_parameters_warn_of_overrides(&monitor->parameters);
  } else if (problems.length == 0) {
    fprintf(stderr, "error: " FM_NO_MEMORY "\n");
  }
  fm_text_free(&problems);
  return is_good ? 0 : 1;
}

static bool begin_lifecycle(struct fm_monitor_node * monitor)
{
  const struct fm_transitions transitions = {
    configure, activate, deactivate, release, monitor};
  monitor->has_lifecycle =
    fm_lifecycle_begin(&monitor->lifecycle, &monitor->node, &transitions);
  return monitor->has_lifecycle;
}

static bool begin_services(struct fm_monitor_node * monitor)
{
  fm_lifecycle_services(&monitor->lifecycle, monitor->offered);
  fm_parameter_services_offered(
    &monitor->parameter_services, monitor->offered + FM_LIFECYCLE_SERVICES);
  monitor->offered[FM_OFFERED - 2] =
    (struct fm_offered) {&monitor->reset, serve_reset, monitor};
  monitor->offered[FM_OFFERED - 1] = (struct fm_offered) {&monitor->types, serve_type, monitor};
  monitor->wait_set = rcl_get_zero_initialized_wait_set();
  return fm_parameter_services_begin(
    &monitor->parameter_services, &monitor->node, &monitor->parameters, parameter_changed,
    monitor) && begin_types(monitor) &&
         fm_service_open(
    &monitor->node, &monitor->reset, ROSIDL_GET_SRV_TYPE_SUPPORT(std_srvs, srv, Trigger),
    "~/reset", &rmw_qos_profile_services_default) &&
         rcl_wait_set_init(
    &monitor->wait_set, 1, 1, 0, monitor->tables->n, FM_OFFERED + monitor->tables->n, 0,
    &monitor->node.context, monitor->node.allocator) == RCL_RET_OK;
}

static bool start(struct fm_monitor_node * monitor)
{
  if (!fm_parameter_is_true(&monitor->parameters, "autostart")) {
    fm_log(&monitor->node, FM_INFO, FM_WORDS_WAITING);
    return true;
  }
  monitor->node.is_starting = true;  // before there are other threads
  const bool is_configured = fm_lifecycle_change(
    &monitor->lifecycle, lifecycle_msgs__msg__Transition__TRANSITION_CONFIGURE);
  monitor->node.is_starting = false;
  return is_configured && fm_lifecycle_change(
    &monitor->lifecycle, lifecycle_msgs__msg__Transition__TRANSITION_ACTIVATE);
}

int fm_monitor_node_begin(
  struct fm_monitor_node * monitor, const struct fm_node_tables * tables, int argc,
  const char * const * argv)
{
  monitor->tables = tables;
  monitor->clock.node = &monitor->node;
  int status = begin_context(monitor, argc, argv);
  status = status == 0 ? refuse_unknown_arguments(monitor) : status;
  status = status == 0 ? begin_node(monitor) : status;
  status = status == 0 ? begin_parameters(monitor) : status;
  if (status != 0) {
    return status;
  }
  simulate(monitor, fm_parameter_is_true(&monitor->parameters, "use_sim_time"));
  monitor->looks = LOOKS;
  monitor->next_look = fm_steady_now() + FM_SECOND;
  // Subscriptions first: until they exist, messages are missed.
  status = begin_lifecycle(monitor) && start(monitor) && begin_services(monitor) ? 0 : 1;
  monitor->lifecycle.logs_failures = true;
  return status;
}

void fm_monitor_node_end(struct fm_monitor_node * monitor)
{
  if (monitor->node.node.impl != NULL) {
    release(monitor);
    (void)fm_clock_simulate(&monitor->clock, false);
    fm_service_close(&monitor->node, &monitor->reset);
    fm_service_close(&monitor->node, &monitor->types);
    fm_parameter_services_end(&monitor->parameter_services);
    if (monitor->has_lifecycle) {
      fm_lifecycle_end(&monitor->lifecycle);
    }
    fm_parameters_end(&monitor->parameters);
    fm_ignore(rcl_wait_set_fini(&monitor->wait_set));
    fm_log_on_rosout(&monitor->node, false);
    fm_ignore(rcl_node_fini(&monitor->node.node));
  }
  if (monitor->node.context.impl != NULL) {
    fm_ignore(rcl_shutdown(&monitor->node.context));
    fm_ignore(rcl_context_fini(&monitor->node.context));
  }
  if (monitor->has_log) {
    fm_log_end();
  }
  free(monitor->sessions);
  free(monitor->healths);
}

// ---- the executor ------------------------------------------------------------------------------

static bool fill_wait_set(struct fm_monitor_node * monitor)
{
  bool is_good = rcl_wait_set_clear(&monitor->wait_set) == RCL_RET_OK;
  for (int k = 0; k < FM_OFFERED; ++k) {
    const rcl_service_t * service = monitor->offered[k].service;
    is_good = is_good && (service->impl == NULL ||
      rcl_wait_set_add_service(&monitor->wait_set, service, NULL) == RCL_RET_OK);
  }
  is_good = is_good && rcl_wait_set_add_guard_condition(
    &monitor->wait_set, rcl_node_get_graph_guard_condition(&monitor->node.node), NULL) ==
    RCL_RET_OK;
  for (uint32_t k = 0; k < monitor->tables->n; ++k) {
    is_good = is_good &&
      fm_service_gate_wait(&monitor->sessions[k].gate.service, &monitor->wait_set);
  }
  return is_good && (!monitor->clock.is_simulated || rcl_wait_set_add_subscription(
           &monitor->wait_set, &monitor->clock.subscription, NULL) == RCL_RET_OK);
}

// What was received before the clock goes back counts by its time of before.
static void serve_clock(struct fm_monitor_node * monitor)
{
  int64_t time;
  if (monitor->clock.is_simulated && fm_clock_take(&monitor->clock, &time)) {
    if (time < fm_clock_now(&monitor->clock)) {
      for_engines(monitor, fm_engine_drain);
    }
    __atomic_store_n(&monitor->clock.simulated, time, __ATOMIC_RELAXED);
    for_engines(monitor, fm_engine_wake);
  }
}

// Do something with each session, and return the earliest time of all.
static int64_t earliest(
  struct fm_monitor_node * monitor, int64_t (* act)(struct fm_session * session))
{
  int64_t first = FM_NEVER;
  for (uint32_t k = 0; k < monitor->tables->n; ++k) {
    const int64_t next = act(&monitor->sessions[k]);
    first = next < first ? next : first;
  }
  return first;
}

static void note_change(struct fm_monitor_node * monitor)
{
  if (monitor->wait_set.guard_conditions[0] != NULL) {
    monitor->next_review = earliest(monitor, fm_session_note_change);
  }
}

// The places of services in the wait set are those in `offered`: only the last may be missing.
static void serve_all(struct fm_monitor_node * monitor)
{
  note_change(monitor);
  serve_clock(monitor);
  for (int k = 0; k < FM_OFFERED; ++k) {
    const struct fm_offered * offered = &monitor->offered[k];
    if (offered->service->impl != NULL && monitor->wait_set.services[k] != NULL) {
      offered->serve(&monitor->node, offered->service, offered->context);
    }
  }
  for (uint32_t k = 0; k < monitor->tables->n; ++k) {
    if (monitor->sessions[k].gate.service.engine != NULL) {
      fm_service_gate_serve(&monitor->sessions[k].gate.service);
    }
  }
}

// ---- timers ------------------------------------------------------------------------------------

static void run_timers_of_sessions(struct fm_monitor_node * monitor, int64_t now)
{
  if (now >= monitor->next_review) {
    monitor->next_review = earliest(monitor, fm_session_review);
  }
  if (fm_is_due(&monitor->next_report, now, REPORT_PERIOD_NS)) {
    for (uint32_t k = 0; k < monitor->tables->n; ++k) {
      fm_health_review(&monitor->healths[k]);
    }
    fm_sign_of_life_beat(&monitor->sign_of_life);
  }
}

// Whether there are two nodes of this name or more.
static bool has_namesake(struct fm_monitor_node * monitor)
{
  const rcl_node_t * node = &monitor->node.node;
  rcutils_string_array_t names = rcutils_get_zero_initialized_string_array();
  rcutils_string_array_t namespaces = rcutils_get_zero_initialized_string_array();
  size_t n = 0;
  fm_ignore(rcl_get_node_names(node, monitor->node.allocator, &names, &namespaces));
  for (size_t k = 0; k < names.size; ++k) {
    n += strcmp(names.data[k], rcl_node_get_name(node)) == 0 &&
      strcmp(namespaces.data[k], rcl_node_get_namespace(node)) == 0 ? 1u : 0u;
  }
  fm_ignore(rcutils_string_array_fini(&names));
  fm_ignore(rcutils_string_array_fini(&namespaces));
  return n > 1u;
}

static void look_for_namesake(struct fm_monitor_node * monitor)
{
  monitor->looks -= 1u;
  if (has_namesake(monitor)) {
    monitor->looks = 0;
    fm_log(&monitor->node, FM_WARN, FM_WORDS_NAMESAKE,
      rcl_node_get_fully_qualified_name(&monitor->node.node));
  }
}

static void run_timers(struct fm_monitor_node * monitor)
{
  const int64_t now = fm_steady_now();
  if (monitor->is_active) {
    run_timers_of_sessions(monitor, now);
  }
  if (monitor->looks > 0 && fm_is_due(&monitor->next_look, now, FM_SECOND)) {
    look_for_namesake(monitor);
  }
}

static int64_t time_to_wait(const struct fm_monitor_node * monitor)
{
  const int64_t next = monitor->next_review < monitor->next_report ?
    monitor->next_review : monitor->next_report;
  const int64_t left = next - fm_steady_now();
  return !monitor->is_active || left > WAIT_NS ? WAIT_NS : left < 0 ? 0 : left;
}

bool fm_monitor_node_spin_once(struct fm_monitor_node * monitor)
{
  const rcl_ret_t result = fill_wait_set(monitor) ?
    rcl_wait(&monitor->wait_set, time_to_wait(monitor)) : RCL_RET_ERROR;
  if (result != RCL_RET_OK && result != RCL_RET_TIMEOUT) {
    fm_log_failure(&monitor->node, "the node cannot wait");
    return false;
  }
  if (result == RCL_RET_OK) {
    serve_all(monitor);
  }
  for_engines(monitor, fm_engine_serve_clock);
  run_timers(monitor);
  return true;
}
