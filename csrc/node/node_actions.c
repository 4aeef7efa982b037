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

/// node_actions.c: see session.h for the contract.

#include "session.h"

#include <lifecycle_msgs/srv/change_state.h>
#include <lifecycle_msgs/srv/get_state.h>
#include <std_msgs/msg/bool.h>
#include <string.h>

#include "endpoints.h"
#include "rmw_functions.h"

#define DEPTH 10u  // messages that wait to be sent

// ---- publishers and clients --------------------------------------------------------------------

static bool make_locks(struct fm_node_actions * actions)
{
  const struct fm_report_table * table = &actions->table->report;
  for (uint32_t k = 0; k < table->n_locks; ++k) {
    if (!fm_advertise(
        actions->node, &actions->locks[k], ROSIDL_GET_MSG_TYPE_SUPPORT(std_msgs, msg, Bool),
        table->locks[k].topic, DEPTH))
    {
      return false;
    }
    actions->lock_names[k] = rcl_publisher_get_topic_name(&actions->locks[k]);
  }
  return true;
}

static bool make_client(
  struct fm_node_actions * actions, uint32_t action, uint32_t place,
  const rosidl_service_type_support_t * type, const char * name)
{
  return fm_client_open(
    actions->node, &actions->clients[2u * action + place], type, name,
    &actions->ends[action].services[place]);
}

static bool make_transition(struct fm_node_actions * actions, uint32_t k)
{
  const struct fm_action * action = &actions->table->report.actions[k];
  struct fm_text get = {NULL, 0, 0};
  struct fm_text change = {NULL, 0, 0};
  fm_text_add(&get, "%s/get_state", action->target);
  fm_text_add(&change, "%s/change_state", action->target);
  actions->names[k] = action->target;
  const bool is_good = make_client(
    actions, k, 0, ROSIDL_GET_SRV_TYPE_SUPPORT(lifecycle_msgs, srv, GetState),
    fm_text_get(&get)) && make_client(
    actions, k, 1, ROSIDL_GET_SRV_TYPE_SUPPORT(lifecycle_msgs, srv, ChangeState),
    fm_text_get(&change));
  fm_text_free(&get);
  fm_text_free(&change);
  return is_good;
}

static bool make_call(struct fm_node_actions * actions, uint32_t k)
{
  const struct fm_action * action = &actions->table->report.actions[k];
  const bool is_made =
    make_client(actions, k, 0, actions->table->action_types[k].service(), action->target);
  actions->names[k] = actions->ends[k].services[0].name;
  return is_made;
}

static bool make_publisher(struct fm_node_actions * actions, uint32_t k)
{
  rcl_publisher_t * publisher = &actions->publishers[k];
  const bool is_made = fm_advertise(
    actions->node, publisher, actions->table->action_types[k].message(),
    actions->table->report.actions[k].target, DEPTH);
  if (is_made) {
    actions->names[k] = rcl_publisher_get_topic_name(publisher);
    actions->ends[k].publisher = rcl_publisher_get_rmw_handle(publisher);
  }
  return is_made;
}

static bool make_actions(struct fm_node_actions * actions)
{
  static bool (* const make[])(struct fm_node_actions *, uint32_t) = {
    [FM_ACTION_PUBLISH] = make_publisher, [FM_ACTION_CALL] = make_call,
    [FM_ACTION_TRANSITION] = make_transition};
  for (uint32_t k = 0; k < actions->table->report.n_actions; ++k) {
    if (!make[actions->table->report.actions[k].kind](actions, k)) {
      return false;
    }
  }
  return true;
}

bool fm_node_actions_begin(
  struct fm_node_actions * actions, struct fm_node * node, const struct fm_node_table * table)
{
  const uint32_t n_locks = table->report.n_locks;
  const uint32_t n = table->report.n_actions;
  struct fm_memory * memory = &actions->memory;
  *actions = (struct fm_node_actions) {.node = node, .table = table};
  actions->locks = fm_reserve(memory, n_locks, sizeof(*actions->locks));
  actions->lock_names = fm_reserve(memory, n_locks, sizeof(*actions->lock_names));
  actions->publishers = fm_reserve(memory, n, sizeof(*actions->publishers));
  actions->clients = fm_reserve(memory, 2 * (size_t)n, sizeof(*actions->clients));
  actions->names = fm_reserve(memory, n, sizeof(*actions->names));
  actions->ends = fm_reserve(memory, n, sizeof(*actions->ends));
  actions->counts = fm_reserve(memory, n, sizeof(*actions->counts));
  return !memory->is_short && make_locks(actions) && make_actions(actions);
}

void fm_node_actions_end(struct fm_node_actions * actions)
{
  const bool is_made = actions->counts != NULL;  // the last array: all are there
  for (uint32_t k = 0; is_made && k < actions->table->report.n_locks; ++k) {
    fm_publisher_close(actions->node, &actions->locks[k]);
  }
  for (uint32_t k = 0; is_made && k < actions->table->report.n_actions; ++k) {
    fm_publisher_close(actions->node, &actions->publishers[k]);
    fm_client_close(actions->node, &actions->clients[2u * k]);
    fm_client_close(actions->node, &actions->clients[2u * k + 1u]);
  }
  fm_memory_free(&actions->memory);
  memset(actions, 0, sizeof(*actions));
}

// ---- while the session is active ---------------------------------------------------------------

void fm_node_actions_locks(const struct fm_node_actions * actions, struct fm_lock * locks)
{
  for (uint32_t k = 0; k < actions->table->report.n_locks; ++k) {
    const struct fm_report_lock * lock = &actions->table->report.locks[k];
    locks[k] = (struct fm_lock) {
      rcl_publisher_get_rmw_handle(&actions->locks[k]), lock->requirements, lock->n_requirements,
      lock->period};
  }
}

bool fm_node_actions_start(struct fm_node_actions * actions, struct fm_engine * engine)
{
  const struct fm_actions_options options = {
    .engine = engine, .table = &actions->table->report, .ends = actions->ends,
    .services = fm_rmw_services, .publish = fm_rmw_publish_serialized,
    .before = actions->counts};
  return options.table->n_actions == 0 || fm_actions_start(&actions->thread, &options);
}

void fm_node_actions_look(struct fm_node_actions * actions)
{
  struct fm_lines lines = {NULL, 0, 0};
  if (actions->thread != NULL) {
    fm_actions_look(actions->thread, actions->counts, &lines);
    fm_log_lines(actions->node, &lines);
  }
}

void fm_node_actions_stop(struct fm_node_actions * actions)
{
  if (actions->thread != NULL) {
    fm_actions_end(actions->thread);
    fm_node_actions_look(actions);
    fm_actions_join(&actions->thread);
  }
}
