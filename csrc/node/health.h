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

/// health.h: the state of the monitor on `/diagnostics`: a status for each requirement and topic,
/// for periods or time, and for violations that could not be published.
///
/// The main thread only; not for a session that is not active.

#ifndef HEALTH_H_
#define HEALTH_H_

#include "reports.h"

/// Counters of a topic at the last report.
struct fm_topic_health
{
  uint64_t received;
  uint64_t lost;
  struct fm_order_counts order;
  int64_t behind;  // ns, since the report before
};

/// Zeroed before fm_health_begin; fm_health_end frees all of it.
struct fm_health
{
  const struct fm_session * session;
  const struct fm_reports * reports;
  rcl_publisher_t publisher;
  struct fm_topic_health * topics;
  uint64_t * unusable;               // an input: at the last report
  bool * is_newly_unusable;          // an input
  struct fm_time_counts time;
  uint64_t unpublished;
  int64_t reported;                  // steady
};

/// Advertise `/diagnostics`. Returns false, with the error logged. O(inputs + topics).
bool fm_health_begin(
  struct fm_health * health, const struct fm_session * session, const struct fm_reports * reports);

/// Publish the present state, if somebody subscribes; to be called once a second. O(inputs read by
/// all requirements).
void fm_health_publish(struct fm_health * health);

void fm_health_end(struct fm_health * health);

#endif  // HEALTH_H_
