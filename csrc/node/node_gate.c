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

/// node_gate.c: see session_parts.h for the contract.

#include "session_parts.h"

#include <rcl/error_handling.h>
#include <rmw/rmw.h>
#include <stdlib.h>
#include <string.h>

#include "endpoints.h"
#include "rmw_functions.h"
#include "start_lines.h"

// ---- the engine --------------------------------------------------------------------------------

static struct fm_gate_options options_of(
  const struct fm_node_table * table, struct fm_evaluator * evaluator)
{
  const struct fm_report_gate * about = table->report.gate;
  return (struct fm_gate_options) {
    .evaluator = evaluator, .monitor = table->scope.monitor(),
    .topics = table->report.topic_inputs,
    .n_topics = table->report.n_topics, .from = about->topic, .otherwise = about->otherwise,
    .hold = about->hold, .period = about->period, .passes_silent = about->passes_silent,
    .latches = about->latches, .open_after = about->open_after};
}

static bool log_refusal(const struct fm_node * node, const struct fm_report_gate * gate)
{
  struct fm_lines lines = {NULL, 0, 0};
  fm_add_gate_refusal(&lines, gate, "of the bundle");
  fm_log_lines(node, &lines);
  fm_lines_free(&lines);
  return false;
}

bool fm_node_gate_guard(
  struct fm_node_gate * gate, struct fm_node * node, const struct fm_node_table * table,
  struct fm_engine * engine, struct fm_evaluator * evaluator, struct fm_memory * memory,
  const char * source, const char * target)
{
  memset(gate, 0, sizeof(*gate));
  if (table->gate == NULL) {
    return true;
  }
  const struct fm_gate_options options = options_of(table, evaluator);
  const uint64_t bytes = fm_gate_bytes(&options);
  void * room = bytes == 0 ? NULL : fm_reserve(memory, (size_t)bytes, 1);
  *gate = (struct fm_node_gate) {
    .node = node, .table = table, .source = source, .target = target, .engine = engine};
  if (room == NULL) {
    fm_log(node, FM_ERROR, "the gate cannot be made: memory is short");
    return false;
  }
  struct fm_gate * made = fm_gate_init(room, &options);
  if (made == NULL) {
    return log_refusal(node, table->report.gate);
  }
  fm_engine_guard(engine, made, &options);
  return true;
}

// ---- the publisher -----------------------------------------------------------------------------

static bool advertise(
  struct fm_node_gate * gate, rcl_publisher_t * publisher, struct fm_target_decision wanted)
{
  rmw_qos_profile_t profile = rmw_qos_profile_default;  // reliable
  rmw_gid_t gid;
  profile.depth = wanted.depth;
  profile.durability = wanted.is_durable ?
    RMW_QOS_POLICY_DURABILITY_TRANSIENT_LOCAL : RMW_QOS_POLICY_DURABILITY_VOLATILE;
  if (!fm_publisher_open(
      gate->node, publisher, gate->table->gate->from.support(), gate->table->gate->to, &profile))
  {
    return false;
  }
  if (rmw_get_gid_for_publisher(rcl_publisher_get_rmw_handle(publisher), &gid) == RMW_RET_OK) {
    fm_gate_target_note(gate->state, gid.data);
  } else {
    rcl_reset_error();
  }
  return true;
}

// Publish with a durability, once fm_node_gate_review finds the new publisher matched.
static void follow(struct fm_node_gate * gate, bool is_durable)
{
  const struct fm_target_decision decision =
    fm_gate_target_follow(gate->state, is_durable, fm_steady_now());
  if (decision.drops_next) {
    fm_publisher_close(gate->node, &gate->next);
  }
  if (decision.advertises && !advertise(gate, &gate->next, decision)) {
    fm_gate_target_fail(gate->state);
  }
}

static void use_next_if_due(struct fm_node_gate * gate)
{
  if (gate->next.impl != NULL && fm_gate_target_review(
      gate->state, fm_listeners(&gate->publisher), fm_listeners(&gate->next), fm_steady_now()))
  {
    rcl_publisher_t before = gate->publisher;
    fm_relay_publish_with(gate->relay, rcl_publisher_get_rmw_handle(&gate->next));
    gate->publisher = gate->next;
    gate->next = rcl_get_zero_initialized_publisher();
    fm_publisher_close(gate->node, &before);
  }
}

// ---- the relay ---------------------------------------------------------------------------------

static bool start_relay(struct fm_node_gate * gate)
{
  const struct fm_node_gate_table * about = gate->table->gate;
  const uint32_t otherwise = gate->table->report.gate->otherwise;
  const struct fm_relay_options options = {
    .engine = gate->engine, .middleware = &fm_rmw_functions,
    .publish = fm_rmw_publish_serialized,
    .publisher = rcl_publisher_get_rmw_handle(&gate->publisher),
    .substitute = otherwise == FM_SUBSTITUTE ? about->substitute : NULL,
    .substitute_size = about->substitute_size, .holds = otherwise == FM_HOLD,
    .stamp_at = about->stamp_at};
  if (!fm_relay_start(&gate->relay, &options)) {
    fm_log(gate->node, FM_ERROR, "no thread can be started");
    return false;
  }
  return true;
}

static bool is_on_service(const struct fm_node_gate * gate)
{
  return gate->table->report.gate->is_service;
}

bool fm_node_gate_start(struct fm_node_gate * gate, const struct fm_node_clock * clock)
{
  if (gate->table == NULL) {
    return true;
  }
  if (is_on_service(gate)) {
    return fm_service_gate_open(&gate->service, gate->node, gate->table, clock, gate->engine);
  }
  const char * node = rcl_node_get_fully_qualified_name(&gate->node->node);
  gate->state = fm_gate_target_create(node, gate->table->gate->from.qos.depth);
  gate->publisher = rcl_get_zero_initialized_publisher();
  gate->next = rcl_get_zero_initialized_publisher();
  return gate->state != NULL &&
         advertise(gate, &gate->publisher, fm_gate_target_first(gate->state)) &&
         start_relay(gate);
}

bool fm_node_gate_is_running(const struct fm_node_gate * gate)
{
  return gate->relay != NULL || gate->service.engine != NULL;
}

void fm_node_gate_stop(struct fm_node_gate * gate)
{
  fm_service_gate_close(&gate->service);
  if (gate->table != NULL && !is_on_service(gate)) {
    fm_relay_join(&gate->relay);
    fm_publisher_close(gate->node, &gate->next);
    fm_publisher_close(gate->node, &gate->publisher);
    fm_gate_target_destroy(gate->state);
    gate->state = NULL;
  }
}

bool fm_node_gate_take(
  struct fm_node_gate * gate, const rcl_subscription_t * subscription, bool is_durable,
  bool * is_taken)
{
  if (is_durable) {
    follow(gate, true);
  }
  if (!*is_taken && !fm_gate_target_is_changing(gate->state)) {
    *is_taken = fm_relay_add(gate->relay, rcl_subscription_get_rmw_handle(subscription));
    return *is_taken;
  }
  return true;
}

// ---- reviews -----------------------------------------------------------------------------------

static void look(void * context, const struct fm_offer * offers, uint32_t n)
{
  struct fm_node_gate * gate = context;
  fm_gate_target_look(gate->state, offers, n);
}

void fm_node_gate_review(
  struct fm_node_gate * gate, const char * type, const struct fm_offer * offers, uint32_t n)
{
  bool is_any = false;
  bool is_durable = false;
  use_next_if_due(gate);
  fm_ignore(fm_look_for_publishers(gate->node, gate->target, look, gate));
  for (uint32_t k = 0; k < n; ++k) {
    const bool is_ours = strcmp(offers[k].type, type) == 0;
    is_any = is_any || is_ours;
    is_durable = is_durable || (is_ours && offers[k].is_durable);
  }
  if (is_any) {
    follow(gate, is_durable);
  }
}

bool fm_node_gate_is_settled(const struct fm_node_gate * gate)
{
  return fm_gate_target_is_settled(gate->state);
}

struct fm_gate_facts fm_node_gate_facts(const struct fm_node_gate * gate)
{
  if (is_on_service(gate)) {
    return (struct fm_gate_facts) {
      fm_service_gate_has_other(&gate->service) ? "another server" : "", gate->source,
      gate->service.unanswered};
  }
  return (struct fm_gate_facts) {
    fm_gate_target_others(gate->state), gate->target, fm_relay_unpublished(gate->relay)};
}

void fm_node_gate_describe(const struct fm_node_gate * gate)
{
  struct fm_lines lines = {NULL, 0, 0};
  if (gate->table != NULL) {
    fm_describe_gate(&lines, &gate->table->report, gate->source, gate->target);
    fm_log_lines(gate->node, &lines);
    fm_lines_free(&lines);
  }
}
