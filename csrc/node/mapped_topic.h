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

/// mapped_topic.h: the subscription to a topic of the bundle: made, replaced and closed as
/// subscription.h decides.
///
/// The engine's receiver takes the messages in the middleware's threads. All functions are called
/// by the main thread only.

#ifndef MAPPED_TOPIC_H_
#define MAPPED_TOPIC_H_

#include "log.h"
#include "node_gate.h"
#include "node_table.h"
#include "receiver.h"
#include "subscription.h"

/// A subscription and the receiver of its messages.
struct fm_intake
{
  rcl_subscription_t subscription;
  struct fm_receiver * receiver;  // NULL if a gate takes them
  bool is_relayed;                // the gate's relay takes them
};

/// A topic. Zeroed before fm_topic_open but for the first five; fm_topic_close frees all of it.
struct fm_mapped_topic
{
  struct fm_node_gate * gate;        // that takes its messages; NULL: the engine does
  enum fm_taking taking;             // what callbacks do otherwise: FM_LISTEN, FM_WAKE
  struct fm_key key;                 // of one of many that are one topic of the bundle; size 0: no
  uint32_t * n_handovers;            // of all of these that go on; NULL: it is alone
  bool is_found;                     // in the graph, with its publishers
  struct fm_node * node;
  struct fm_engine * engine;
  const struct fm_middleware * middleware;
  const rosidl_message_type_support_t * (* support)(void);
  const char * written;              // its name in the bundle
  const char * type;
  const rosidl_message_type_support_t * in_place;  // in_place_types.h; NULL: it is copied
  const char * name;                 // resolved
  uint32_t index;
  struct fm_subscription * state;
  struct fm_intake current;
  struct fm_intake * retired;        // being replaced, the oldest first
  uint32_t n_retired;
  bool is_due;                       // to be reviewed
  bool is_unread;                    // the middleware did not tell the publishers
  bool hands_over;                   // it is one of `n_handovers`
  bool is_leaked;                    // the middleware may still call back for a closed one
};

/// Resolve the name of a topic as the node does: namespace, remapping. The caller frees it. NULL
/// if it is not valid; the error of rcl is set.
char * fm_resolved_name(const struct fm_node * node, const char * name);

/// The same, of a service.
char * fm_resolved_service(const struct fm_node * node, const char * name);

/// A name with a key in place of a variable, which is in it. The caller frees it. NULL if memory
/// is short.
char * fm_with_key(const char * name, const char * variable, const char * key);

/// As fm_resolved_name, of a topic of the table; one whose messages are made has its own name. A
/// variable stays in the name.
char * fm_topic_name(const struct fm_node * node, const struct fm_report_topic * topic);

/// Subscribe; no message is taken before fm_topic_start. `name`: the resolved one; it outlives the
/// topic. Returns false, with the error logged.
bool fm_topic_open(
  struct fm_mapped_topic * topic, struct fm_node * node, const struct fm_node_table * table,
  const char * name, const struct fm_fixed_qos * fixed, uint32_t index);

/// Begin to take the messages, for an engine. The engine and the middleware outlive the topic.
bool fm_topic_start(
  struct fm_mapped_topic * topic, struct fm_engine * engine,
  const struct fm_middleware * middleware);

/// Look for the publishers, and do what is decided. O(publishers^2).
void fm_topic_review(struct fm_mapped_topic * topic);

/// As fm_subscription_is_settled.
bool fm_topic_is_settled(const struct fm_mapped_topic * topic);

/// Take what waits, and unsubscribe. Returns false if the middleware may still call back: the
/// engine must then live as long as the process.
bool fm_topic_close(struct fm_mapped_topic * topic);

#endif  // MAPPED_TOPIC_H_
