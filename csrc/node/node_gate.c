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

/// node_gate.c: the gate of a bundle, on a topic or a service; see session.h for the
/// contract.

#include <rcl/error_handling.h>
#include <rcl/graph.h>
#include <rmw/qos_profiles.h>
#include <rmw/rmw.h>
#include <stdlib.h>
#include <string.h>

#include "endpoints.h"
#include "rmw_functions.h"
#include "session.h"
#include "start_lines.h"
#include "words.h"

static bool refuse_without_memory(const struct fm_node * node)
{
  fm_log(node, FM_ERROR, "the gate cannot be made: " FM_NO_MEMORY);
  return false;
}

// ---- a gate on a service: answers --------------------------------------------------------------

#define REQUEST_RECEIVED 1u         // service_msgs/msg/ServiceEventInfo
#define LOGGED_NS (10 * FM_SECOND)  // between two lines about requests that no server answers

static void refuse_unanswered(struct fm_service_gate * gate, rmw_request_id_t * id)
{
  gate->unanswered += 1u;
  if (fm_passes(&gate->next_line, fm_steady_now(), LOGGED_NS)) {
    fm_log(gate->node, FM_ERROR, FM_WORDS_UNANSWERED, gate->table->report.gate->name,
      rcl_client_get_service_name(&gate->client));
  }
  fm_respond(gate->node, &gate->service, id, gate->refusal.memory);
}

// Refuse the requests whose time has ended at `now`.
static void refuse_pending(struct fm_service_gate * gate, int64_t now)
{
  size_t kept = 0;
  for (size_t k = 0; k < gate->n_pending; ++k) {
    if (now >= gate->pending[k].until) {
      refuse_unanswered(gate, &gate->pending[k].id);
    } else {
      gate->pending[kept++] = gate->pending[k];
    }
  }
  gate->n_pending = kept;
}

static bool has_server(const struct fm_service_gate * gate)
{
  bool is_available = false;
  fm_ignore(rcl_service_server_is_available(&gate->node->node, &gate->client, &is_available));
  return is_available;
}

// ---- requests ----------------------------------------------------------------------------------

static void log_refused(struct fm_service_gate * gate, const char * what)
{
  if (fm_passes(&gate->next_line, fm_steady_now(), LOGGED_NS)) {
    fm_log(gate->node, FM_ERROR, "gate '%s': a request cannot be %s; it is refused",
      gate->table->report.gate->name, what);
  }
}

// The event of a request, serialized; the caller ends `bytes`.
static bool serialize_event(struct fm_service_gate * gate, rmw_serialized_message_t * bytes)
{
  const rosidl_service_type_support_t * support = gate->table->gate->service();
  const int64_t now = fm_clock_now(gate->clock);
  const rosidl_service_introspection_info_t info = {
    .event_type = REQUEST_RECEIVED, .stamp_sec = (int32_t)(now / FM_SECOND),
    .stamp_nanosec = (uint32_t)(now % FM_SECOND)};
  void * event = support->event_message_create_handle_function(
    &info, &gate->node->allocator, gate->request.memory, NULL);
  const bool is_done =
    event != NULL && rmw_serialize(event, support->event_typesupport, bytes) == RMW_RET_OK;
  if (event != NULL) {
    (void)support->event_message_destroy_handle_function(event, &gate->node->allocator);
  }
  return is_done;
}

// A request that cannot be serialized is withheld, with a line.
static bool passes(struct fm_service_gate * gate)
{
  rmw_serialized_message_t bytes = rmw_get_zero_initialized_serialized_message();
  const struct fm_origin origin = {.received = fm_system_now()};
  int64_t due;
  const bool is_serialized =
    rmw_serialized_message_init(&bytes, 0, &gate->node->allocator) == RMW_RET_OK &&
    serialize_event(gate, &bytes);
  const bool is_passed = is_serialized && fm_engine_judge(
    gate->engine, bytes.buffer, bytes.buffer_length, &origin, &due) == FM_PASSED;
  if (!is_serialized) {
    log_refused(gate, "serialized");
  }
  if (bytes.buffer != NULL) {
    fm_ignore(rmw_serialized_message_fini(&bytes));
  }
  return is_passed;
}

// Returns false if it cannot be sent.
static bool forward(struct fm_service_gate * gate, const rmw_request_id_t * id)
{
  struct fm_pending * pending =
    realloc(gate->pending, (gate->n_pending + 1u) * sizeof(*pending));
  if (pending == NULL) {
    log_refused(gate, "kept");
    return false;
  }
  gate->pending = pending;
  pending += gate->n_pending;
  *pending = (struct fm_pending) {*id, 0, fm_steady_now() + gate->table->gate->timeout};
  if (rcl_send_request(&gate->client, gate->request.memory, &pending->sequence) != RCL_RET_OK) {
    rcl_reset_error();
    return false;
  }
  gate->n_pending += 1u;
  return true;
}

static void serve_request(struct fm_service_gate * gate, rmw_request_id_t * id)
{
  if (!has_server(gate)) {  // not judged: a request that passes is a step
    refuse_unanswered(gate, id);
  } else if (!passes(gate)) {
    fm_respond(gate->node, &gate->service, id, gate->refusal.memory);
  } else if (!forward(gate, id)) {
    refuse_unanswered(gate, id);
  }
}

// The answer to a request that was refused meanwhile is dropped.
static void pass_on(struct fm_service_gate * gate, int64_t sequence)
{
  for (size_t k = 0; k < gate->n_pending; ++k) {
    if (gate->pending[k].sequence == sequence) {
      fm_respond(gate->node, &gate->service, &gate->pending[k].id, gate->answer.memory);
      gate->pending[k] = gate->pending[--gate->n_pending];
      return;
    }
  }
}

void fm_service_gate_serve(struct fm_service_gate * gate)
{
  rmw_request_id_t id;
  while (rcl_take_response(&gate->client, &id, gate->answer.memory) == RCL_RET_OK) {
    pass_on(gate, id.sequence_number);
  }
  rcl_reset_error();
  while (rcl_take_request(&gate->service, &id, gate->request.memory) == RCL_RET_OK) {
    serve_request(gate, &id);
  }
  rcl_reset_error();
}

// ---- begin and end -----------------------------------------------------------------------------

static bool make_messages(struct fm_service_gate * gate)
{
  const struct fm_node_gate_table * about = gate->table->gate;
  const struct fm_service_support * support = (const void *)about->service();
  return fm_message_make(&gate->request, support->request_typesupport) &&
         fm_message_make(&gate->answer, support->response_typesupport) &&
         fm_message_make(&gate->refusal, support->response_typesupport) &&
         fm_message_read(
    &gate->refusal, &fm_rmw_services, about->substitute, about->substitute_size);
}

static bool open_service(
  struct fm_service_gate * gate, struct fm_node * node, const struct fm_node_table * table,
  const struct fm_node_clock * clock, struct fm_engine * engine)
{
  *gate = (struct fm_service_gate) {
    .node = node, .table = table, .clock = clock, .engine = engine};
  if (!make_messages(gate)) {
    return refuse_without_memory(node);
  }
  struct fm_service_client unused;
  return fm_client_open(
    node, &gate->client, table->gate->service(), table->gate->to, &unused) && fm_service_open(
    node, &gate->service, table->gate->service(), table->gate->name,
    &rmw_qos_profile_services_default);
}

bool fm_service_gate_wait(const struct fm_service_gate * gate, rcl_wait_set_t * wait_set)
{
  return gate->engine == NULL ||
         (rcl_wait_set_add_service(wait_set, &gate->service, NULL) == RCL_RET_OK &&
         rcl_wait_set_add_client(wait_set, &gate->client, NULL) == RCL_RET_OK);
}

void fm_service_gate_review(struct fm_service_gate * gate)
{
  if (gate->n_pending > 0) {
    refuse_pending(gate, has_server(gate) ? fm_steady_now() : FM_NEVER);
  }
}

static bool has_other_service(const struct fm_service_gate * gate)
{
  size_t n = 0;
  fm_ignore(rcl_count_services(
      &gate->node->node, rcl_service_get_service_name(&gate->service), &n));
  return n > 1u;
}

static void close_service(struct fm_service_gate * gate)
{
  if (gate->node != NULL) {
    refuse_pending(gate, FM_NEVER);
    fm_service_close(gate->node, &gate->service);
    fm_client_close(gate->node, &gate->client);
  }
  fm_message_free(&gate->request);
  fm_message_free(&gate->answer);
  fm_message_free(&gate->refusal);
  free(gate->pending);
  memset(gate, 0, sizeof(*gate));
}

// ---- a gate on a topic -------------------------------------------------------------------------

static struct fm_gate_options options_of(
  const struct fm_node_table * table, struct fm_evaluator * evaluator)
{
  const struct fm_report_gate * about = table->report.gate;
  return (struct fm_gate_options) {
    .evaluator = evaluator, .monitor = table->monitor(),
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
    return refuse_without_memory(node);
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
    .engine = gate->engine, .middleware = fm_node_middleware(),
    .publish = fm_rmw_publish_serialized,
    .publisher = rcl_publisher_get_rmw_handle(&gate->publisher),
    .substitute = otherwise == FM_SUBSTITUTE ? about->substitute : NULL,
    .substitute_size = about->substitute_size, .holds = otherwise == FM_HOLD,
    .stamp_at = about->stamp_at};
  if (!fm_relay_start(&gate->relay, &options)) {
    fm_log(gate->node, FM_ERROR, FM_WORDS_NO_THREAD);
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
    return open_service(&gate->service, gate->node, gate->table, clock, gate->engine);
  }
  const char * node = rcl_node_get_fully_qualified_name(&gate->node->node);
  gate->state = fm_gate_target_create(node, gate->table->gate->from.qos.depth);
  gate->publisher = rcl_get_zero_initialized_publisher();
  gate->next = rcl_get_zero_initialized_publisher();
  if (gate->state == NULL) {
    return refuse_without_memory(gate->node);
  }
  return advertise(gate, &gate->publisher, fm_gate_target_first(gate->state)) &&
         start_relay(gate);
}

void fm_node_gate_stop(struct fm_node_gate * gate)
{
  close_service(&gate->service);
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
  if (!*is_taken && gate->next.impl == NULL) {
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
  (void)fm_look_for_publishers(gate->node, gate->target, look, gate);
  for (uint32_t k = 0; k < n; ++k) {
    const bool is_ours = strcmp(offers[k].type, type) == 0;
    is_any = is_any || is_ours;
    is_durable = is_durable || (is_ours && offers[k].is_durable);
  }
  if (is_any) {
    follow(gate, is_durable);
  }
}

struct fm_gate_facts fm_node_gate_facts(const struct fm_node_gate * gate)
{
  if (is_on_service(gate)) {
    return (struct fm_gate_facts) {
      has_other_service(&gate->service) ? gate->source : "", gate->source,
      gate->service.unanswered};
  }
  return (struct fm_gate_facts) {
    fm_gate_target_others(gate->state), gate->target, fm_relay_unpublished(gate->relay)};
}
