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

/// node_clock.h: the node's time: system time, or `/clock` while `use_sim_time` is set.

#ifndef NODE_CLOCK_H_
#define NODE_CLOCK_H_

#include "log.h"

/// Owned by main.c. `simulated` is read and written atomically; the rest belongs to the main
/// thread.
struct fm_node_clock
{
  struct fm_node * node;
  rcl_subscription_t subscription;  // to /clock
  int64_t simulated;                // ns, the last time on /clock; 0: none yet
  int64_t next_warning;             // of a negative time, by the steady clock
  bool is_simulated;
};

/// Subscribe to /clock, or end the subscription. Returns false, with the error logged.
bool fm_clock_simulate(struct fm_node_clock * clock, bool is_simulated);

/// Take the messages on /clock, without those of a negative time. Returns whether the time moves,
/// to the last one.
bool fm_clock_take(struct fm_node_clock * clock, int64_t * time);

/// Move the time of /clock. O(1).
void fm_clock_move(struct fm_node_clock * clock, int64_t time);

/// The node's time in nanoseconds; 0 before the first message on /clock. O(1).
int64_t fm_clock_now(const struct fm_node_clock * clock);

/// Write the time of /clock; for fm_engine_follow_clock. Any thread. Returns 0.
int fm_clock_read(void * clock, int64_t * nanoseconds);

#endif  // NODE_CLOCK_H_
