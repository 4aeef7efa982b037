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


/// node_actions.h: the locks and actions of the bundle on the node: their publishers and clients,
/// and while the session is active the thread that uses them (actions.h). The main thread only.

#ifndef NODE_ACTIONS_H_
#define NODE_ACTIONS_H_

#include "actions.h"
#include "announcer.h"
#include "log.h"
#include "node_table.h"

/// Zeroed before fm_node_actions_begin; fm_node_actions_end frees all of it.
struct fm_node_actions
{
  struct fm_node * node;
  const struct fm_node_table * table;
  rcl_publisher_t * locks;          // of each lock
  rcl_publisher_t * publishers;     // of each action that publishes
  rcl_client_t * clients;           // two for each action
  char ** lock_names;               // full names
  char ** names;
  struct fm_action_ends * ends;
  struct fm_action_facts * counts;  // at the last look
  struct fm_actions * thread;       // NULL: it does not run
};

/// Advertise the topics, and make the clients. Returns false, with the error logged. O(actions).
bool fm_node_actions_begin(
  struct fm_node_actions * actions, struct fm_node * node, const struct fm_node_table * table);

/// Fill `locks`, n_locks of the table, for an announcer.
void fm_node_actions_locks(const struct fm_node_actions * actions, struct fm_lock * locks);

/// Follow an engine (which follows its states), in a thread, if there are actions. Returns false
/// if none can be started.
bool fm_node_actions_start(struct fm_node_actions * actions, struct fm_engine * engine);

/// Wait until no action runs, and log the last lines. The engine is closed before.
void fm_node_actions_stop(struct fm_node_actions * actions);

/// Log all locks and actions, at the start.
void fm_node_actions_describe(const struct fm_node_actions * actions);

/// Update the counts, and log what has failed since the last look.
void fm_node_actions_look(struct fm_node_actions * actions);

void fm_node_actions_end(struct fm_node_actions * actions);

#endif  // NODE_ACTIONS_H_
