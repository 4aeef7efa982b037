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

/// node_health.h: what the node says of itself once a second: the log of what is new and the state
/// on `/diagnostics` (review.h), and `~/alive` while all threads of the monitor go round.
///
/// The liveliness of the publisher of `~/alive` is asserted by nothing else, so that a subscriber
/// learns of a monitor that hangs as of one that has ended. The main thread only; not for a
/// session that is not active.

#ifndef NODE_HEALTH_H_
#define NODE_HEALTH_H_

#include "review.h"
#include "session.h"
#include "sign_of_life.h"

/// Zeroed before fm_health_begin; fm_health_end frees all of it.
struct fm_health
{
  struct fm_session * session;
  struct fm_review * review;
  struct fm_publishers * topics;
  struct fm_gate_facts gate;  // of the last look, for the review
  struct fm_lines lines;
  struct fm_statuses statuses;
  rcl_publisher_t publisher;
};

/// Advertise `/diagnostics`. Returns false, with the error logged. O(inputs + topics).
bool fm_health_begin(struct fm_health * health, struct fm_session * session);

/// Log what is new, and publish the present state if somebody subscribes; to be called once a
/// second. O(inputs read by all requirements).
void fm_health_review(struct fm_health * health);

void fm_health_end(struct fm_health * health);

// ---- the sign of life --------------------------------------------------------------------------

/// Zeroed before fm_sign_of_life_begin.
struct fm_sign_of_life
{
  const struct fm_session * sessions;
  uint32_t n;
  rcl_publisher_t publisher;
  struct fm_sign state;
  uint64_t * turns;     // of the threads of each session: at the last sign, then now
};

/// Advertise the topic and publish the first sign. Returns false, with the error logged.
bool fm_sign_of_life_begin(
  struct fm_sign_of_life * sign, const struct fm_session * sessions, uint32_t n);

/// Publish the sign, if it is due; to be called once a second.
void fm_sign_of_life_beat(struct fm_sign_of_life * sign);

void fm_sign_of_life_end(struct fm_sign_of_life * sign);

#endif  // NODE_HEALTH_H_
