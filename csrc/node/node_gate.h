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

/// node_gate.h: the gate of the bundle on the node. On a topic: its relay (relay.h), and its
/// publisher, which follows what gate_target.h decides. On a service: service_gate.h. The main
/// thread only.

#ifndef NODE_GATE_H_
#define NODE_GATE_H_

#include <rcl/publisher.h>
#include <rcl/subscription.h>

#include "facts.h"
#include "gate_target.h"
#include "log.h"
#include "node_table.h"
#include "relay.h"
#include "service_gate.h"

/// Zeroed before fm_node_gate_guard. Without a gate in the table, all of it stays zero, and all
/// functions do nothing.
struct fm_node_gate
{
  struct fm_node * node;
  const struct fm_node_table * table;
  const char * source;             // their full names
  const char * target;
  struct fm_engine * engine;
  void * memory;                   // of the gate
  struct fm_gate_target * state;
  rcl_publisher_t publisher;
  rcl_publisher_t next;            // that replaces it; zeroed: none
  struct fm_relay * relay;         // NULL: it relays nothing
  struct fm_service_gate service;
};

/// Let the gate of the table judge for an engine of this evaluator; the names outlive the gate.
/// Returns false, with the reason logged. O(bytes).
bool fm_node_gate_guard(
  struct fm_node_gate * gate, struct fm_node * node, const struct fm_node_table * table,
  struct fm_engine * engine, struct fm_evaluator * evaluator, const char * source,
  const char * target);

/// Advertise the target, or offer the service, and start to judge. Returns false, with the reason
/// logged.
bool fm_node_gate_start(struct fm_node_gate * gate, const struct fm_node_clock * clock);

/// Whether it judges.
bool fm_node_gate_is_running(const struct fm_node_gate * gate);

/// Take the messages of a subscription to the source, with this durability, unless that has to
/// wait: then `*is_taken` stays false, and it is called again at a review. Returns false if the
/// middleware has no callback for new messages.
bool fm_node_gate_take(
  struct fm_node_gate * gate, const rcl_subscription_t * subscription, bool is_durable,
  bool * is_taken);

/// Offer what the publishers of the source offer, and look for others on the target. `about`: of
/// the source; publishers of other types do not count. O(publishers^2).
void fm_node_gate_review(
  struct fm_node_gate * gate, const char * type, const struct fm_offer * offers, uint32_t n);

bool fm_node_gate_is_settled(const struct fm_node_gate * gate);

/// What is around the gate, which is there. Valid until the next review.
struct fm_gate_facts fm_node_gate_facts(const struct fm_node_gate * gate);

/// Log what the gate does, at the start.
void fm_node_gate_describe(const struct fm_node_gate * gate);

/// End the thread, and withdraw the target; its subscriptions were closed before.
void fm_node_gate_stop(struct fm_node_gate * gate);

/// Free the memory, after the engine was destroyed.
void fm_node_gate_end(struct fm_node_gate * gate);

#endif  // NODE_GATE_H_
