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

/// review.h: what a node logs once a second, and its statuses on `/diagnostics`: both of one
/// instant.
///
/// Each second, one thread at a time: fm_review_look, then fm_review_log, then fm_review_report if
/// somebody subscribes. A line appears once, or at intervals.

#ifndef REVIEW_H_
#define REVIEW_H_

#include "reporter.h"
#include "snapshot.h"

struct fm_review;

/// Begin, for an engine whose monitoring begins. `facts`: when, and what actions and the black box
/// have counted before, which is not new; the other facts are not read. The reporter outlives all
/// calls but the last. NULL if memory is short. O(requirements + inputs + topics).
FM_EXPORT struct fm_review * fm_review_create(
  const struct fm_reporter * reporter, const struct fm_facts * facts);

/// Free it. NULL is allowed.
FM_EXPORT void fm_review_destroy(struct fm_review * review);

/// Look at the engine and the facts, which the other functions then report. What the facts point
/// to stays until the next look. Returns what was seen, valid until the next look but one. Costs
/// as fm_engine_snapshot.
FM_EXPORT const struct fm_snapshot * fm_review_look(
  struct fm_review * review, const struct fm_facts * facts);

/// Add the lines about what is new: silences, what cannot be used, time, locks and gate, and after
/// five seconds the requirements that are not evaluated yet. O(what is new * (requirements +
/// inputs) + topics); reads messages with fields that cannot be used.
FM_EXPORT void fm_review_log(struct fm_review * review, struct fm_lines * lines);

/// Add the statuses: of requirements, topics, the gate, actions, locks, the time, the black box,
/// violations that were not published, and what has failed. What is counted since the last report
/// is counted since the look before. O(inputs read by all requirements).
FM_EXPORT void fm_review_report(const struct fm_review * review, struct fm_statuses * statuses);

/// Add a line for each transform that has no value at the end of a recording: an error if it never
/// had one, otherwise a warning; then those of fm_add_left_out since the begin. O(topics).
FM_EXPORT void fm_add_transforms_at_end(
  struct fm_lines * lines, const struct fm_reporter * reporter);

#endif  // REVIEW_H_
