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

/// action_call.h: the calls of an action: of a service, or those that bring a lifecycle node to a
/// state. Each try may fail; a try begins `timeout` after the one before.
///
/// Nothing waits. One thread at a time for one of these.

#ifndef ACTION_CALL_H_
#define ACTION_CALL_H_

#include "service_call.h"
#include "start_lines.h"

/// What an action publishes with, or calls. The node makes and owns it.
struct fm_action_ends
{
  void * publisher;                      // rmw_publisher_t; NULL: it calls
  struct fm_service_client services[2];  // of a transition: get_state, change_state
};

enum fm_action_result
{
  FM_ACTION_GOES_ON = 0,
  FM_ACTION_SUCCEEDED = 1,
  FM_ACTION_FAILED = 2
};

/// Zeroed before fm_action_call_make; fm_action_call_free frees what it holds.
struct fm_action_call
{
  const struct fm_action * action;
  struct fm_call calls[2];
  uint32_t tried;      // tries before this one
  uint32_t steps;      // transitions of this try
  int64_t began;       // this try
  bool is_changing;    // the second call is under way
  bool is_pausing;     // until the next try
  bool is_under_way;
};

/// Make the requests. The arguments outlive it. False if a type cannot be used, or memory is
/// short.
FM_INTERNAL bool fm_action_call_make(
  struct fm_action_call * call, const struct fm_service_functions * functions,
  const struct fm_action * action, const struct fm_action_ends * ends);

/// Read the request of the next tries, which have not begun; not of a transition. False if the
/// middleware cannot. O(size).
FM_INTERNAL bool fm_action_call_read(
  struct fm_action_call * call, const uint8_t * payload, size_t size);

FM_INTERNAL void fm_action_call_free(struct fm_action_call * call);

/// Begin the first try, at a time of CLOCK_MONOTONIC.
FM_INTERNAL void fm_action_call_begin(struct fm_action_call * call, int64_t now);

/// Go on, if it is under way; to be called until it does not go on any more. `why`, empty before,
/// is why the last try failed.
FM_INTERNAL enum fm_action_result fm_action_call_run(
  struct fm_action_call * call, int64_t now, struct fm_text * why);

/// When to call fm_action_call_run next; FM_NEVER: nothing is under way.
FM_INTERNAL int64_t fm_action_call_due(const struct fm_action_call * call, int64_t now);

#endif  // ACTION_CALL_H_
