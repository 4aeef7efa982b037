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

/// violation_log.h: the log of violations: at most one line a second of each requirement.
///
/// The end of a violation is logged after the line of the violation. What is logged comes from the
/// details that the engine queues; it may have suppressed some, or the queue may have been full.
/// Details have the numbers of violations, and the engine counts them: each violation is in one
/// line, and the end of each, also by a reset.
///
/// Of a requirement of instances, each instance has lines of its own, up to FM_LOGGED_PER_S in a
/// second: a line names one, and counts the others since the last.
///
/// One thread at a time.

#ifndef VIOLATION_LOG_H_
#define VIOLATION_LOG_H_

#include "details.h"

/// Details of a requirement in a second while nobody subscribes to them.
#define FM_LOGGED_PER_S 10u

#define FM_AT_END (INT64_MAX - FM_SECOND)  // later than any time

/// Add the line of a violation, at its severity. `about`: id, sentence and severity are read.
/// `stamp` is in nanoseconds. `detail` is a status of details.h, whose name is that of the
/// instance; NULL: not known. The line stands for `more` other violations, too. Any thread.
/// O(characters).
FM_EXPORT void fm_add_violated(
  struct fm_lines * lines, const struct fm_report_requirement * about, int64_t stamp,
  const struct fm_status * detail, uint64_t more);

/// Add the line of the end of a violation; without a detail its time is not known either.
FM_EXPORT void fm_add_satisfied(
  struct fm_lines * lines, const struct fm_report_requirement * about, int64_t stamp,
  const struct fm_status * detail);

struct fm_violation_log;

/// Make a log of an engine's violations; NULL if memory is short. The reporter outlives it.
/// O(requirements).
FM_EXPORT struct fm_violation_log * fm_violation_log_create(const struct fm_reporter * reporter);

/// Free it. NULL is allowed.
FM_EXPORT void fm_violation_log_destroy(struct fm_violation_log * log);

/// Log a violation or its end, or leave it to the review if there was a line just now. `now` is
/// CLOCK_MONOTONIC in nanoseconds. The detail is copied. Each detail that was taken is added
/// before the next review. O(inputs).
FM_EXPORT void fm_violation_log_add(
  struct fm_violation_log * log, const struct fm_detail * detail, int64_t now,
  struct fm_lines * lines);

/// Log what was left out, where a second has passed since the last line; to be called several
/// times a second, and at the end with FM_AT_END as `now`: it logs all of it. O(requirements).
FM_EXPORT void fm_violation_log_review(
  struct fm_violation_log * log, int64_t now, struct fm_lines * lines);

#endif  // VIOLATION_LOG_H_
