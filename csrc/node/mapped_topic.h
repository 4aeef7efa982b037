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

/// mapped_topic.h: the subscription to a topic of the bundle: made, replaced where it does not
/// match a publisher, and closed.
///
/// The engine's receiver takes the messages in the middleware's threads. All functions are called
/// by the main thread only.

#ifndef MAPPED_TOPIC_H_
#define MAPPED_TOPIC_H_

#include "log.h"
#include "node_table.h"
#include "receiver.h"

/// A subscription and the receiver of its messages.
struct fm_intake
{
  rcl_subscription_t subscription;
  rmw_qos_profile_t profile;
  struct fm_receiver * receiver;
  int64_t until;  // replaced: closed then, at the latest
};

/// The known publishers of a topic, for /diagnostics.
struct fm_publishers
{
  size_t matching_type;
  struct fm_text unmatched;    // nodes whose quality of service does not match
  struct fm_text other_types;
};

struct fm_known_publisher
{
  uint8_t gid[RMW_GID_STORAGE_SIZE];
  bool is_logged;
};

/// A topic. Zeroed before fm_topic_open; fm_topic_close frees all of it.
struct fm_mapped_topic
{
  struct fm_node * node;
  struct fm_engine * engine;
  const struct fm_middleware * middleware;
  const struct fm_node_topic * about;
  struct fm_fixed_qos fixed;
  char * name;                       // resolved
  uint32_t index;
  struct fm_intake current;
  struct fm_intake * retired;        // being replaced, with room for one more during a handover
  uint32_t n_retired;
  bool is_leaked;                    // the middleware may still call back for a closed one
  int64_t handover_ends;             // 0: no handover
  double retry_s;                    // between two attempts to subscribe anew; 0: none failed
  int64_t retry_at;                  // the next attempt, if one failed
  struct fm_publishers publishers;
  struct fm_known_publisher * known; // those of the last review
  size_t n_known;
  bool has_new;                      // publishers for which the subscription was not checked yet
  struct fm_text logged_types;
  int64_t unnamed_since;             // 0: the nodes of all publishers are known
  uint64_t logged_losses;
  int64_t next_loss_line;
};

/// Resolve the name of a topic as the node does: namespace, remapping. The caller frees it. NULL
/// if it is not valid; the error of rcl is set.
char * fm_resolved_name(const struct fm_node * node, const char * name);

/// Subscribe; no message is taken before fm_topic_start. Returns false, with the error logged.
bool fm_topic_open(
  struct fm_mapped_topic * topic, struct fm_node * node, const struct fm_node_topic * about,
  const struct fm_fixed_qos * fixed, uint32_t index);

/// Begin to take the messages, for an engine. The engine and the middleware outlive the topic.
bool fm_topic_start(
  struct fm_mapped_topic * topic, struct fm_engine * engine,
  const struct fm_middleware * middleware);

/// Look for publishers that came or ended, log those that do not match, replace the subscription
/// if it is due. To be called a few times a second. O(publishers).
void fm_topic_review(struct fm_mapped_topic * topic);

/// Take what waits, and unsubscribe. Returns false if the middleware may still call back: the
/// engine must then live as long as the process.
bool fm_topic_close(struct fm_mapped_topic * topic);

#endif  // MAPPED_TOPIC_H_
