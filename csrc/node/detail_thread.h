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

/// detail_thread.h: a thread that publishes details on `copilot/violations` while somebody
/// subscribes, and logs violations. No verdict and no message on a handler waits for it.

#ifndef DETAIL_THREAD_H_
#define DETAIL_THREAD_H_

#include "log.h"
#include "reporter.h"

struct fm_detail_thread;

/// Start the thread; NULL if none can be made, or memory is short. No other thread may take
/// details. What it is given outlives it, except that the publisher is only used until the end.
struct fm_detail_thread * fm_detail_thread_start(
  const struct fm_node * node, const struct fm_reporter * reporter,
  const rcl_publisher_t * publisher, bool logs_violations);

/// Return how often it has looked for work: several times a second, unless it hangs. O(1).
uint64_t fm_detail_thread_turns(const struct fm_detail_thread * thread);

/// Wait until the thread has emptied its queue, and free it. The engine is closed before. NULL is
/// allowed.
void fm_detail_thread_join(struct fm_detail_thread * thread);

#endif  // DETAIL_THREAD_H_
