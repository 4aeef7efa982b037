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


/// actions.h: a thread that starts the actions of a bundle while an engine runs: it publishes
/// their messages, and calls services. It waits for changes; while a call is under way it looks
/// for the response a hundred times a second. No verdict and no announcement waits for it.

#ifndef ACTIONS_H_
#define ACTIONS_H_

#include "action_call.h"
#include "engine.h"

struct fm_actions;

/// What the thread works with. The caller owns all of it; it outlives the thread.
struct fm_actions_options
{
  struct fm_engine * engine;                // fm_actions_prepare was called
  const struct fm_report_table * table;     // actions, and what follows each requirement
  const struct fm_action_ends * ends;       // of each action
  struct fm_service_functions services;
  /// rmw_publish_serialized_message; returns 0 on success.
  int (* publish)(
    const void * publisher, const struct fm_serialized * message, void * allocation);
  const struct fm_action_facts * before;    // counts to go on from; NULL: zeros
};

/// Let an engine keep what actions follow; before messages are delivered. False if memory is
/// short. O(actions + requirements).
FM_EXPORT bool fm_actions_prepare(
  struct fm_engine * engine, const struct fm_report_table * table);

/// Start the thread; `*actions` as of fm_announcer_start. False if no thread can be made, a type
/// of a service cannot be used, or memory is short. O(actions + what follows all requirements).
FM_EXPORT bool fm_actions_start(
  struct fm_actions ** actions, const struct fm_actions_options * options);

/// How often the thread has looked for work: at least twice a second, unless it hangs. O(1).
FM_EXPORT uint64_t fm_actions_turns(const struct fm_actions * actions);

/// Copy the counts of all actions, and add the lines about failures since the last call. From any
/// thread, before fm_actions_join. O(actions + lines).
FM_EXPORT void fm_actions_look(
  struct fm_actions * actions, struct fm_action_facts * counts, struct fm_lines * lines);

/// Wait for the thread, which ends when the engine is closed; calls that are under way are not
/// waited for, and not counted. From any other thread, but not from two at a time.
FM_EXPORT void fm_actions_end(struct fm_actions * actions);

/// fm_actions_end, free the memory and set `*actions` to NULL; does nothing if it is NULL.
FM_EXPORT void fm_actions_join(struct fm_actions ** actions);

#endif  // ACTIONS_H_
