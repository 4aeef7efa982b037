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

/// verdict_thread.h: a thread that publishes the verdicts of an engine (verdicts.h): no violation
/// waits for them.

#ifndef VERDICT_THREAD_H_
#define VERDICT_THREAD_H_

#include "engine.h"
#include "middleware.h"

struct fm_verdict_thread;

/// Start a thread that publishes a std_msgs/msg/Bool for each requirement: its verdict, when it
/// changes, and once a second. `publishers`: rmw_publisher_t, one for each requirement in the
/// manifest's order, copied; the engine follows the states. What a publisher refuses is left out:
/// the next message comes within a second. The engine, the middleware and the publishers outlive
/// the thread. Sets `*started`, which is NULL before; false if no thread can be made, or memory is
/// short. O(n); from any thread, before messages are delivered. The thread then costs O(n) for
/// each change of a state.
FM_EXPORT bool fm_verdict_thread_start(
  struct fm_verdict_thread ** started, struct fm_engine * engine,
  const struct fm_middleware * middleware, void * const * publishers, uint32_t n);

/// Wait for the thread, which ends when the engine is closed, free it and set `*thread` to NULL;
/// does nothing if it is NULL. From any other thread, but not from two at a time.
FM_EXPORT void fm_verdict_thread_join(struct fm_verdict_thread ** thread);

#endif  // VERDICT_THREAD_H_
