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

/// node_services.c: see node_services.h for the contract.

#include "node_services.h"

#include <lifecycle_msgs/msg/state.h>
#include <lifecycle_msgs/msg/transition.h>
#include <lifecycle_msgs/msg/transition_description.h>
#include <lifecycle_msgs/srv/change_state.h>
#include <lifecycle_msgs/srv/get_available_states.h>
#include <lifecycle_msgs/srv/get_available_transitions.h>
#include <lifecycle_msgs/srv/get_state.h>
#include <rcl/error_handling.h>
#include <rcl_interfaces/msg/parameter.h>
#include <rcl_interfaces/msg/parameter_descriptor.h>
#include <rcl_interfaces/msg/parameter_event.h>
#include <rcl_interfaces/msg/set_parameters_result.h>
#include <rcl_interfaces/srv/describe_parameters.h>
#include <rcl_interfaces/srv/get_parameter_types.h>
#include <rcl_interfaces/srv/get_parameters.h>
#include <rcl_interfaces/srv/list_parameters.h>
#include <rcl_interfaces/srv/set_parameters.h>
#include <rcl_interfaces/srv/set_parameters_atomically.h>
#include <rcl_lifecycle/transition_map.h>
#include <rmw/qos_profiles.h>
#include <rosidl_runtime_c/primitives_sequence_functions.h>
#include <rosidl_runtime_c/string_functions.h>
#include <string.h>

#include "words.h"

static void assign(rosidl_runtime_c__String * string, const char * text)
{
  (void)rosidl_runtime_c__String__assign(string, text);
}

// ---- the life cycle ----------------------------------------------------------------------------

bool fm_lifecycle_begin(
  struct fm_lifecycle * lifecycle, struct fm_node * node,
  const struct fm_transitions * transitions)
{
  rcl_lifecycle_state_machine_options_t options =
    rcl_lifecycle_get_default_state_machine_options();
  options.enable_com_interface = true;
  lifecycle->node = node;
  lifecycle->transitions = *transitions;
  lifecycle->machine = rcl_lifecycle_get_zero_initialized_state_machine();
  if (rcl_lifecycle_state_machine_init(
      &lifecycle->machine, &node->node,
      ROSIDL_GET_MSG_TYPE_SUPPORT(lifecycle_msgs, msg, TransitionEvent),
      ROSIDL_GET_SRV_TYPE_SUPPORT(lifecycle_msgs, srv, ChangeState),
      ROSIDL_GET_SRV_TYPE_SUPPORT(lifecycle_msgs, srv, GetState),
      ROSIDL_GET_SRV_TYPE_SUPPORT(lifecycle_msgs, srv, GetAvailableStates),
      ROSIDL_GET_SRV_TYPE_SUPPORT(lifecycle_msgs, srv, GetAvailableTransitions),
      ROSIDL_GET_SRV_TYPE_SUPPORT(lifecycle_msgs, srv, GetAvailableTransitions), &options) ==
    RCL_RET_OK)
  {
    return true;
  }
  fm_log_failure(node, "cannot offer the services of the life cycle");
  return false;
}

void fm_lifecycle_end(struct fm_lifecycle * lifecycle)
{
  fm_ignore(rcl_lifecycle_state_machine_fini(&lifecycle->machine, &lifecycle->node->node));
}

// The reason of a failure is logged already, unless memory was short. `errors`: before it.
static bool note(const struct fm_lifecycle * lifecycle, uint32_t errors, bool is_done)
{
  const bool is_configured = lifecycle->machine.current_state->id !=
    lifecycle_msgs__msg__State__TRANSITION_STATE_CONFIGURING;
  if (!is_done && fm_log_errors() == errors) {
    fm_log_failure(lifecycle->node,
      is_configured ? "the node cannot be activated" : "the node cannot be configured");
  }
  if (!is_done && lifecycle->logs_failures) {
    fm_log(lifecycle->node, FM_ERROR, FM_WORDS_INACTIVE);
  }
  return is_done;
}

static bool work(struct fm_lifecycle * lifecycle)
{
  const struct fm_transitions * transitions = &lifecycle->transitions;
  const uint32_t errors = fm_log_errors();
  switch (lifecycle->machine.current_state->id) {
    case lifecycle_msgs__msg__State__TRANSITION_STATE_CONFIGURING:
      return note(lifecycle, errors, transitions->configure(transitions->context));
    case lifecycle_msgs__msg__State__TRANSITION_STATE_ACTIVATING:
      return note(lifecycle, errors, transitions->activate(transitions->context));
    case lifecycle_msgs__msg__State__TRANSITION_STATE_DEACTIVATING:
      transitions->deactivate(transitions->context);
      return true;
    default:
      transitions->release(transitions->context);
      return true;
  }
}

bool fm_lifecycle_change(struct fm_lifecycle * lifecycle, uint8_t transition)
{
  if (rcl_lifecycle_trigger_transition_by_id(&lifecycle->machine, transition, true) !=
    RCL_RET_OK)
  {
    rcl_reset_error();
    return false;
  }
  const bool is_done = work(lifecycle);
  fm_ignore(rcl_lifecycle_trigger_transition_by_label(
      &lifecycle->machine, is_done ? rcl_lifecycle_transition_success_label :
      rcl_lifecycle_transition_failure_label, true));
  return is_done;
}

// ---- services ----------------------------------------------------------------------------------

static void write_state(lifecycle_msgs__msg__State * out, const rcl_lifecycle_state_t * state)
{
  out->id = state->id;
  assign(&out->label, state->label);
}

static void write_transitions(
  lifecycle_msgs__srv__GetAvailableTransitions_Response * response,
  const rcl_lifecycle_transition_t * transitions, size_t n)
{
  (void)lifecycle_msgs__msg__TransitionDescription__Sequence__init(
    &response->available_transitions, n);
  for (size_t k = 0; k < response->available_transitions.size; ++k) {
    lifecycle_msgs__msg__TransitionDescription * out = &response->available_transitions.data[k];
    out->transition.id = (uint8_t)transitions[k].id;
    assign(&out->transition.label, transitions[k].label);
    write_state(&out->start_state, transitions[k].start);
    write_state(&out->goal_state, transitions[k].goal);
  }
}

FM_SERVER(serve_change, lifecycle_msgs, ChangeState, struct fm_lifecycle, lifecycle)
{
  const bool is_named = request->transition.label.size > 0;
  const rcl_lifecycle_transition_t * found = !is_named ? NULL :
    rcl_lifecycle_get_transition_by_label(
    lifecycle->machine.current_state, request->transition.label.data);
  if (is_named && found == NULL) {
    rcl_reset_error();
  }
  response->success = (!is_named || found != NULL) && fm_lifecycle_change(
    lifecycle, is_named ? (uint8_t)found->id : request->transition.id);
}

FM_SERVER(serve_state, lifecycle_msgs, GetState, struct fm_lifecycle, lifecycle)
{
  (void)request;
  write_state(&response->current_state, lifecycle->machine.current_state);
}

FM_SERVER(serve_states, lifecycle_msgs, GetAvailableStates, struct fm_lifecycle, lifecycle)
{
  const rcl_lifecycle_transition_map_t * map = &lifecycle->machine.transition_map;
  (void)request;
  (void)lifecycle_msgs__msg__State__Sequence__init(&response->available_states, map->states_size);
  for (size_t k = 0; k < response->available_states.size; ++k) {
    write_state(&response->available_states.data[k], &map->states[k]);
  }
}

FM_SERVER(
  serve_transitions, lifecycle_msgs, GetAvailableTransitions, struct fm_lifecycle, lifecycle)
{
  const rcl_lifecycle_state_t * state = lifecycle->machine.current_state;
  (void)request;
  write_transitions(response, state->valid_transitions, state->valid_transition_size);
}

FM_SERVER(serve_graph, lifecycle_msgs, GetAvailableTransitions, struct fm_lifecycle, lifecycle)
{
  const rcl_lifecycle_transition_map_t * map = &lifecycle->machine.transition_map;
  (void)request;
  write_transitions(response, map->transitions, map->transitions_size);
}

void fm_lifecycle_services(
  struct fm_lifecycle * lifecycle, struct fm_offered services[FM_LIFECYCLE_SERVICES])
{
  const rcl_lifecycle_com_interface_t * offered = &lifecycle->machine.com_interface;
  const struct fm_offered all[FM_LIFECYCLE_SERVICES] = {
    {&offered->srv_change_state, serve_change, lifecycle},
    {&offered->srv_get_state, serve_state, lifecycle},
    {&offered->srv_get_available_states, serve_states, lifecycle},
    {&offered->srv_get_available_transitions, serve_transitions, lifecycle},
    {&offered->srv_get_transition_graph, serve_graph, lifecycle}};
  memcpy(services, all, sizeof(all));
}

// ---- parameters --------------------------------------------------------------------------------

static const struct fm_parameter * find(
  const struct fm_parameter_services * services, const rosidl_runtime_c__String * name)
{
  return fm_parameter_find(services->parameters, name->data);
}

// How many names there are; 0 if one of them is unknown.
static size_t count_known(
  const struct fm_parameter_services * services, const rosidl_runtime_c__String__Sequence * names)
{
  size_t n = 0;
  while (n < names->size && find(services, &names->data[n]) != NULL) {
    ++n;
  }
  return n == names->size ? n : 0;
}

// ---- reading: as rclpy, an unknown name gives an empty answer ----------------------------------

FM_SERVER(
  serve_describe, rcl_interfaces, DescribeParameters, struct fm_parameter_services, services)
{
  (void)rcl_interfaces__msg__ParameterDescriptor__Sequence__init(
    &response->descriptors, count_known(services, &request->names));
  for (size_t k = 0; k < response->descriptors.size; ++k) {
    const struct fm_parameter * found = find(services, &request->names.data[k]);
    rcl_interfaces__msg__ParameterDescriptor * descriptor = &response->descriptors.data[k];
    assign(&descriptor->name, found->name);
    assign(&descriptor->description, found->description);
    descriptor->type = found->value.type;
    descriptor->read_only = found->settable == FM_AT_START;
    descriptor->dynamic_typing = !fm_parameter_is_of_rcl(found);  // as rclpy: others are checked
  }
}

FM_SERVER(serve_get, rcl_interfaces, GetParameters, struct fm_parameter_services, services)
{
  (void)rcl_interfaces__msg__ParameterValue__Sequence__init(
    &response->values, count_known(services, &request->names));
  for (size_t k = 0; k < response->values.size; ++k) {
    (void)rcl_interfaces__msg__ParameterValue__copy(
      &find(services, &request->names.data[k])->value, &response->values.data[k]);
  }
}

FM_SERVER(serve_types, rcl_interfaces, GetParameterTypes, struct fm_parameter_services, services)
{
  (void)rosidl_runtime_c__uint8__Sequence__init(
    &response->types, count_known(services, &request->names));
  for (size_t k = 0; k < response->types.size; ++k) {
    response->types.data[k] = find(services, &request->names.data[k])->value.type;
  }
}

static bool is_deep_enough(const char * name, uint64_t depth)
{
  uint64_t dots = 0;
  while ((name = strchr(name, '.')) != NULL) {
    ++name;
    ++dots;
  }
  return depth == rcl_interfaces__srv__ListParameters_Request__DEPTH_RECURSIVE || dots < depth;
}

static bool is_listed(
  const rcl_interfaces__srv__ListParameters_Request * request, const char * name)
{
  if (request->prefixes.size == 0) {
    return is_deep_enough(name, request->depth);
  }
  for (size_t k = 0; k < request->prefixes.size; ++k) {
    const char * prefix = request->prefixes.data[k].data;
    const size_t length = strlen(prefix);
    if (strcmp(name, prefix) == 0 || (strncmp(name, prefix, length) == 0 && name[length] == '.' &&
      is_deep_enough(name + length + 1u, request->depth)))
    {
      return true;
    }
  }
  return false;
}

static void add_prefix(rosidl_runtime_c__String__Sequence * prefixes, const char * name)
{
  const char * dot = strrchr(name, '.');
  if (dot == NULL) {
    return;
  }
  const size_t length = (size_t)(dot - name);
  for (size_t k = 0; k < prefixes->size; ++k) {
    if (prefixes->data[k].size == length && strncmp(prefixes->data[k].data, name, length) == 0) {
      return;
    }
  }
  (void)rosidl_runtime_c__String__assignn(&prefixes->data[prefixes->size++], name, length);
}

FM_SERVER(serve_list, rcl_interfaces, ListParameters, struct fm_parameter_services, services)
{
  const struct fm_parameters * parameters = services->parameters;
  rosidl_runtime_c__String__Sequence * names = &response->result.names;
  rosidl_runtime_c__String__Sequence * prefixes = &response->result.prefixes;
  if (!rosidl_runtime_c__String__Sequence__init(names, parameters->n_declared) ||
    !rosidl_runtime_c__String__Sequence__init(prefixes, parameters->n_declared))
  {
    return;
  }
  names->size = prefixes->size = 0;  // `capacity` are there, and are freed
  for (size_t k = 0; k < parameters->n_declared; ++k) {
    if (is_listed(request, parameters->declared[k].name)) {
      assign(&names->data[names->size++], parameters->declared[k].name);
      add_prefix(prefixes, parameters->declared[k].name);
    }
  }
}

// ---- setting -----------------------------------------------------------------------------------

static void publish_changes(
  const struct fm_parameter_services * services,
  const rcl_interfaces__msg__Parameter__Sequence * changed)
{
  rcl_interfaces__msg__ParameterEvent event;
  const int64_t now = fm_system_now();
  if (!rcl_interfaces__msg__ParameterEvent__init(&event)) {
    return;
  }
  event.stamp.sec = (int32_t)(now / FM_SECOND);
  event.stamp.nanosec = (uint32_t)(now % FM_SECOND);
  assign(&event.node, rcl_node_get_fully_qualified_name(&services->node->node));
  if (rcl_interfaces__msg__Parameter__Sequence__copy(changed, &event.changed_parameters)) {
    fm_ignore(rcl_publish(&services->events, &event, NULL));
  }
  rcl_interfaces__msg__ParameterEvent__fini(&event);
}

// Set all, or none if one of them is refused.
static void set_all(
  struct fm_parameter_services * services,
  const rcl_interfaces__msg__Parameter__Sequence * wanted,
  rcl_interfaces__msg__SetParametersResult * result)
{
  rcl_interfaces__msg__Parameter__Sequence moved = {NULL, 0, 0};
  struct fm_text reason = {NULL, 0, 0};
  struct fm_text one = {NULL, 0, 0};
  result->successful = rcl_interfaces__msg__Parameter__Sequence__copy(wanted, &moved);
  for (size_t k = 0; k < wanted->size; ++k) {
    fm_text_clear(&one);
    if (fm_parameter_refuse(
        services->parameters, wanted->data[k].name.data, &wanted->data[k].value, &one))
    {
      fm_text_join(&reason, "; ", "%s", fm_text_get(&one));
      result->successful = false;
    }
  }
  fm_text_free(&one);
  for (size_t k = 0; result->successful && k < wanted->size; ++k) {
    fm_parameter_set(services->parameters, wanted->data[k].name.data, &moved.data[k].value);
    services->changed(
      services->context, fm_parameter_find(services->parameters, wanted->data[k].name.data));
  }
  rcl_interfaces__msg__Parameter__Sequence__fini(&moved);
  if (result->successful && wanted->size > 0) {
    publish_changes(services, wanted);
  }
  assign(&result->reason, !result->successful && reason.length == 0 ? FM_NO_MEMORY :
    fm_text_get(&reason));
  fm_text_free(&reason);
}

FM_SERVER(serve_set, rcl_interfaces, SetParameters, struct fm_parameter_services, services)
{
  (void)rcl_interfaces__msg__SetParametersResult__Sequence__init(
    &response->results, request->parameters.size);
  for (size_t k = 0; k < response->results.size; ++k) {
    const rcl_interfaces__msg__Parameter__Sequence one = {&request->parameters.data[k], 1, 1};
    set_all(services, &one, &response->results.data[k]);
  }
}

FM_SERVER(
  serve_set_atomically, rcl_interfaces, SetParametersAtomically, struct fm_parameter_services,
  services)
{
  set_all(services, &request->parameters, &response->result);
}

// ---- services ----------------------------------------------------------------------------------

#define SUPPORT(type) FM_SERVICE_SUPPORT(rcl_interfaces, srv, type)

static const struct
{
  const rosidl_service_type_support_t * (* type)(void);
  const char * name;
  void (* serve)(const struct fm_node * node, const rcl_service_t * service, void * context);
} kinds[FM_PARAMETER_SERVICES] = {
  {SUPPORT(DescribeParameters), "~/describe_parameters", serve_describe},
  {SUPPORT(GetParameters), "~/get_parameters", serve_get},
  {SUPPORT(GetParameterTypes), "~/get_parameter_types", serve_types},
  {SUPPORT(ListParameters), "~/list_parameters", serve_list},
  {SUPPORT(SetParameters), "~/set_parameters", serve_set},
  {SUPPORT(SetParametersAtomically), "~/set_parameters_atomically", serve_set_atomically}};

bool fm_parameter_services_begin(
  struct fm_parameter_services * services, struct fm_node * node,
  struct fm_parameters * parameters,
  void (* changed)(void * context, const struct fm_parameter * parameter), void * context)
{
  services->node = node;
  services->parameters = parameters;
  services->changed = changed;
  services->context = context;
  for (int k = 0; k < FM_PARAMETER_SERVICES; ++k) {
    if (!fm_service_open(
        node, &services->services[k], kinds[k].type(), kinds[k].name,
        &rmw_qos_profile_parameters))
    {
      return false;
    }
  }
  return fm_publisher_open(
    node, &services->events, ROSIDL_GET_MSG_TYPE_SUPPORT(rcl_interfaces, msg, ParameterEvent),
    "/parameter_events", &rmw_qos_profile_parameter_events);
}

void fm_parameter_services_offered(
  struct fm_parameter_services * services, struct fm_offered offered[FM_PARAMETER_SERVICES])
{
  for (int k = 0; k < FM_PARAMETER_SERVICES; ++k) {
    offered[k] = (struct fm_offered) {&services->services[k], kinds[k].serve, services};
  }
}

void fm_parameter_services_end(struct fm_parameter_services * services)
{
  for (int k = 0; k < FM_PARAMETER_SERVICES; ++k) {
    fm_service_close(services->node, &services->services[k]);
  }
  fm_publisher_close(services->node, &services->events);
}
