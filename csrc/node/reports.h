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

/// reports.h: log lines about what is wrong: silent inputs, messages that cannot be used, a clock
/// that stands still, requirements that wait for their first values.
///
/// Each line appears once, or at intervals. The main thread only; not for a session that is not
/// active.

#ifndef REPORTS_H_
#define REPORTS_H_

#include "session.h"

/// What was seen of an input at the last review.
struct fm_input_report
{
  struct fm_silence silence;
  int64_t absent_since;     // steady: its name is missing since then; 0: it is not
  uint64_t received_before; // values before its name was missing
  bool is_absent_logged;    // its name was missing for long
  bool is_unusable_logged;
};

/// What was logged of a topic.
struct fm_topic_report
{
  bool is_undecodable_logged;
  bool is_ahead_logged;
  bool is_order_logged;
};

/// Zeroed before fm_reports_begin; fm_reports_end frees all of it.
struct fm_reports
{
  const struct fm_session * session;
  struct fm_input_report * inputs;
  struct fm_topic_report * topics;
  struct fm_time_counts logged;   // when late periods were logged last
  struct fm_time_counts judged;   // a minute ago
  uint64_t restarts;
  uint64_t overflows;
  int64_t began;                  // steady: the node has had no time since then
  int64_t next_time_line;
  int64_t next_minute;
  bool is_clock_logged;
  bool is_unpublished_logged;
};

/// Begin, for a session that has just begun. Returns false if memory is short. O(inputs).
bool fm_reports_begin(struct fm_reports * reports, const struct fm_session * session);

/// Log what is new; to be called once a second. O(inputs + topics).
void fm_reports_review(struct fm_reports * reports);

/// Log which requirements wait for which topics, if any does.
void fm_reports_missing(const struct fm_reports * reports);

void fm_reports_end(struct fm_reports * reports);

/// Whether periods were missed, or enough of them late, between two counts.
bool fm_are_worth_reading(const struct fm_time_counts * before, const struct fm_time_counts * now);

/// Whether an input has a value.
bool fm_has_value(const struct fm_session * session, uint32_t input);

#endif  // REPORTS_H_
