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

/// announcer.h: a thread that publishes the violations of an engine, its locks, and margins.
/// Publishing inside the middleware's callback hung when a process ended.
///
/// A lock is a std_msgs/msg/Bool that is published all the time, by the same thread that takes
/// what is due: if the thread, or the engine that it asks, hangs, nothing is published, and
/// silence means locked. The same if the thread hangs that moves the clock that is followed
/// (fm_engine_hangs): no `false` is published meanwhile.
///
/// The margin of a requirement is a std_msgs/msg/Float64, published when it has changed, at most
/// every FM_MARGIN_PERIOD_MS: the least one since the message before.

#ifndef ANNOUNCER_H_
#define ANNOUNCER_H_

#include "engine.h"
#include "middleware.h"

#define FM_MARGIN_PERIOD_MS 50

struct fm_announcer;

/// A lock: true while one of its requirements is violated or not known (states.h).
struct fm_lock
{
  void * publisher;               // rmw_publisher_t of std_msgs/msg/Bool
  const uint32_t * requirements;  // outlive the announcer
  uint32_t n_requirements;
  int64_t period;                 // ns between two messages; it is also published when it changes
};

/// Start a thread that publishes a std_msgs/msg/Empty for each violation of the engine, in order.
/// No other thread may take violations from the engine. `publishers`: rmw_publisher_t, one for
/// each requirement in the manifest's order; `locks`: `n_locks` of them, for which the engine
/// follows the states; `margins`: rmw_publisher_t, one for each requirement, or NULL: margins are
/// not published. All arrays are copied. If a publisher fails, the
/// violation, state or margin is counted (snapshot.h). The engine, the middleware and the
/// publishers outlive the announcer. False if no thread can be made, or memory is short.
/// O(n_publishers + n_locks); from any thread, before messages are delivered.
///
/// `*announcer` is NULL before, and is set here: a result that is returned would be lost in Python
/// if a signal handler raises an exception right after the call.
FM_EXPORT bool fm_announcer_start(
  struct fm_announcer ** announcer, struct fm_engine * engine,
  const struct fm_middleware * middleware, void * const * publishers, uint32_t n_publishers,
  const struct fm_lock * locks, uint32_t n_locks, void * const * margins);

/// Return how often the thread has looked for violations and deadlines: at least twice a second,
/// unless it hangs. From any thread, before fm_announcer_join. O(1).
FM_EXPORT uint64_t fm_announcer_turns(const struct fm_announcer * announcer);

/// Wait for the thread, which ends when the engine is closed and all violations are published, and
/// free the announcer and set `*announcer` to NULL; does nothing if it is NULL. From any other
/// thread, but not from two at a time.
FM_EXPORT void fm_announcer_join(struct fm_announcer ** announcer);

#endif  // ANNOUNCER_H_
