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

/// lifecycle.c: see lifecycle.h for the contract.

#include "lifecycle.h"

#include <lifecycle_msgs/msg/state.h>
#include <lifecycle_msgs/msg/transition.h>
#include <lifecycle_msgs/msg/transition_description.h>
#include <lifecycle_msgs/srv/change_state.h>
#include <lifecycle_msgs/srv/get_available_states.h>
#include <lifecycle_msgs/srv/get_available_transitions.h>
#include <lifecycle_msgs/srv/get_state.h>
#include <rcl/error_handling.h>
#include <rcl_lifecycle/transition_map.h>
#include <rosidl_runtime_c/string_functions.h>
#include <string.h>

#include "words.h"

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

// The reason of a failure is logged already.
static bool note(const struct fm_lifecycle * lifecycle, bool is_done)
{
  if (!is_done && lifecycle->logs_failures) {
    fm_log(lifecycle->node, FM_ERROR, FM_WORDS_INACTIVE);
  }
  return is_done;
}

static bool work(struct fm_lifecycle * lifecycle)
{
  const struct fm_transitions * transitions = &lifecycle->transitions;
  switch (lifecycle->machine.current_state->id) {
    case lifecycle_msgs__msg__State__TRANSITION_STATE_CONFIGURING:
      return note(lifecycle, transitions->configure(transitions->context));
    case lifecycle_msgs__msg__State__TRANSITION_STATE_ACTIVATING:
      return note(lifecycle, transitions->activate(transitions->context));
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
  (void)rosidl_runtime_c__String__assign(&out->label, state->label);
}

static void write_transitions(
  lifecycle_msgs__srv__GetAvailableTransitions_Response * response,
  const rcl_lifecycle_transition_t * transitions, size_t n)
{
  if (!lifecycle_msgs__msg__TransitionDescription__Sequence__init(
      &response->available_transitions, n))
  {
    return;
  }
  for (size_t k = 0; k < n; ++k) {
    lifecycle_msgs__msg__TransitionDescription * out = &response->available_transitions.data[k];
    out->transition.id = (uint8_t)transitions[k].id;
    (void)rosidl_runtime_c__String__assign(&out->transition.label, transitions[k].label);
    write_state(&out->start_state, transitions[k].start);
    write_state(&out->goal_state, transitions[k].goal);
  }
}

FM_SERVER(serve_change, lifecycle_msgs, ChangeState, struct fm_lifecycle, lifecycle)
{
  uint8_t id = request->transition.id;
  if (request->transition.label.size > 0) {
    const rcl_lifecycle_transition_t * found = rcl_lifecycle_get_transition_by_label(
      lifecycle->machine.current_state, request->transition.label.data);
    if (found == NULL) {
      rcl_reset_error();
      return;
    }
    id = (uint8_t)found->id;
  }
  response->success = fm_lifecycle_change(lifecycle, id);
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
  if (lifecycle_msgs__msg__State__Sequence__init(&response->available_states, map->states_size)) {
    for (unsigned int k = 0; k < map->states_size; ++k) {
      write_state(&response->available_states.data[k], &map->states[k]);
    }
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
