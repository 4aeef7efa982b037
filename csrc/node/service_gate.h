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

/// service_gate.h: a gate on a service: offers it, judges each request as a message of the
/// service's events (`SERVICE/_service_event`, of which inputs read `request[0]`), and forwards
/// those that pass to the real server. The main thread only.

#ifndef SERVICE_GATE_H_
#define SERVICE_GATE_H_

#include <rcl/client.h>
#include <rcl/service.h>
#include <rcl/wait.h>

#include "node_clock.h"
#include "node_table.h"
#include "service_call.h"

/// A request that waits for the answer of the server.
struct fm_pending
{
  rmw_request_id_t id;  // of who has asked
  int64_t sequence;     // of the request that was forwarded
  int64_t until;        // steady
};

/// Zeroed before fm_service_gate_open; fm_service_gate_close frees all of it.
struct fm_service_gate
{
  struct fm_node * node;
  const struct fm_node_table * table;
  const struct fm_node_clock * clock;
  struct fm_engine * engine;        // NULL: it is not open
  rcl_service_t service;            // that it offers
  rcl_client_t client;              // of the real server
  struct fm_typed_message request;
  struct fm_typed_message answer;   // of the server
  struct fm_typed_message refusal;  // of the bundle
  struct fm_pending * pending;
  size_t n_pending;
  uint64_t unanswered;              // requests that passed, and that no server answered
  int64_t next_line;                // about these
};

/// Offer the service of the gate in the table. Returns false, with the reason logged.
bool fm_service_gate_open(
  struct fm_service_gate * gate, struct fm_node * node, const struct fm_node_table * table,
  const struct fm_node_clock * clock, struct fm_engine * engine);

/// Wait for requests, and for answers of the server. Returns false if rcl fails.
bool fm_service_gate_wait(const struct fm_service_gate * gate, rcl_wait_set_t * wait_set);

/// Judge the requests that are waiting, and pass on the answers. A request that is withheld, and
/// one for which there is no server, which is not judged, gets the response of the bundle.
void fm_service_gate_serve(struct fm_service_gate * gate);

/// Refuse the requests that wait for a server that has gone, or too long; once a second. A server
/// that was killed and started again is there, and has not the request. O(requests).
void fm_service_gate_review(struct fm_service_gate * gate);

/// Whether another node offers the service, too.
bool fm_service_gate_has_other(const struct fm_service_gate * gate);

/// Refuse what waits, and withdraw the service.
void fm_service_gate_close(struct fm_service_gate * gate);

#endif  // SERVICE_GATE_H_
