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

/// service_gate.c: see session_parts.h for the contract.

#include "session_parts.h"

#include <rcl/error_handling.h>
#include <rcl/graph.h>
#include <rmw/qos_profiles.h>
#include <rmw/rmw.h>
#include <stdlib.h>
#include <string.h>

#include "endpoints.h"
#include "rmw_functions.h"
#include "words.h"

#define REQUEST_RECEIVED 1u         // service_msgs/msg/ServiceEventInfo
#define LOGGED_NS (10 * FM_SECOND)  // between two lines about requests that no server answers

static const rosidl_service_type_support_t * support_of(const struct fm_service_gate * gate)
{
  return gate->table->gate->service();
}

// ---- answers -----------------------------------------------------------------------------------

static void respond(
  const struct fm_service_gate * gate, rmw_request_id_t * id, const struct fm_typed_message * what)
{
  fm_respond(gate->node, &gate->service, id, what->memory);
}

static void refuse_unanswered(struct fm_service_gate * gate, rmw_request_id_t * id)
{
  gate->unanswered += 1u;
  if (fm_passes(&gate->next_line, fm_steady_now(), LOGGED_NS)) {
    fm_log(gate->node, FM_ERROR, FM_WORDS_UNANSWERED, gate->table->report.gate->name,
      rcl_client_get_service_name(&gate->client));
  }
  respond(gate, id, &gate->refusal);
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

// The event of a request, serialized; the caller ends `bytes`.
static bool serialize_event(struct fm_service_gate * gate, rmw_serialized_message_t * bytes)
{
  const rosidl_service_type_support_t * support = support_of(gate);
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

// A request that cannot be serialized is withheld.
static bool passes(struct fm_service_gate * gate)
{
  rmw_serialized_message_t bytes = rmw_get_zero_initialized_serialized_message();
  const struct fm_origin origin = {.received = fm_system_now()};
  int64_t due;
  bool is_passed = false;
  if (rmw_serialized_message_init(&bytes, 0, &gate->node->allocator) == RMW_RET_OK) {
    is_passed = serialize_event(gate, &bytes) && fm_engine_judge(
      gate->engine, bytes.buffer, bytes.buffer_length, &origin, &due) == FM_PASSED;
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
    respond(gate, id, &gate->refusal);
  } else if (!forward(gate, id)) {
    refuse_unanswered(gate, id);
  }
}

// The answer to a request that was refused meanwhile is dropped.
static void pass_on(struct fm_service_gate * gate, int64_t sequence)
{
  for (size_t k = 0; k < gate->n_pending; ++k) {
    if (gate->pending[k].sequence == sequence) {
      respond(gate, &gate->pending[k].id, &gate->answer);
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
  const struct fm_service_support * support = (const void *)support_of(gate);
  const struct fm_node_gate_table * about = gate->table->gate;
  return fm_message_make(&gate->request, support->request_typesupport) &&
         fm_message_make(&gate->answer, support->response_typesupport) &&
         fm_message_make(&gate->refusal, support->response_typesupport) &&
         fm_message_read(
    &gate->refusal, &fm_rmw_services, about->substitute, about->substitute_size);
}

bool fm_service_gate_open(
  struct fm_service_gate * gate, struct fm_node * node, const struct fm_node_table * table,
  const struct fm_node_clock * clock, struct fm_engine * engine)
{
  *gate = (struct fm_service_gate) {
    .node = node, .table = table, .clock = clock, .engine = engine};
  if (!make_messages(gate)) {
    fm_log(node, FM_ERROR, "the gate cannot be made: memory is short");
    return false;
  }
  struct fm_service_client unused;
  return fm_client_open(
    node, &gate->client, support_of(gate), table->gate->to, &unused) && fm_service_open(
    node, &gate->service, support_of(gate), table->gate->name, &rmw_qos_profile_services_default);
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

bool fm_service_gate_has_other(const struct fm_service_gate * gate)
{
  size_t n = 0;
  fm_ignore(rcl_count_services(
      &gate->node->node, rcl_service_get_service_name(&gate->service), &n));
  return n > 1u;
}

void fm_service_gate_close(struct fm_service_gate * gate)
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
