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

/// due.h: when something is due without a message; deadlines.c takes it then. For the files of the
/// evaluator only.
///
/// `wake` is never after the deadline. A message puts off timeouts without looking for the
/// earliest one; that is done when `wake` has come.

#ifndef DUE_H_
#define DUE_H_

#include "tables.h"

/// Set when an input times out. O(1).
FM_INTERNAL void fm_set_due(struct fm_evaluator * evaluator, uint32_t i, int64_t due);

/// Replace a time at which something is due, of the evaluator's. All are set here, but for those
/// that an instance is made, reset or shifted with (instance.c). O(1).
FM_INTERNAL void fm_replace_due(struct fm_evaluator * evaluator, int64_t * due, int64_t by);

/// Set when a group is to be evaluated. O(1).
FM_INTERNAL void fm_set_group_due(struct fm_evaluator * evaluator, uint32_t g, int64_t due);

/// Set when the next period begins. O(1).
FM_INTERNAL void fm_set_period_due(struct fm_evaluator * evaluator, int64_t due);

/// Under FM_TIMED: let the groups that are ready and have not begun, begin now. O(groups).
FM_INTERNAL void fm_begin_ready_groups(struct fm_evaluator * evaluator);

/// Note that an input has a value. With its first one, its readers wait for one input less.
/// O(groups that read it) then, else O(1).
FM_INTERNAL void fm_note_value(struct fm_evaluator * evaluator, uint32_t i);

/// Look for the deadline anew: times of the instance have changed. O(1).
FM_INTERNAL void fm_forget_deadline(struct fm_evaluator * evaluator);

/// Move the time to `now`; returns false if it begins then. O(1), and O(inputs + groups) if it
/// begins or goes back.
FM_INTERNAL bool fm_reach(struct fm_evaluator * evaluator, int64_t now);

/// Whether fm_reach would let the time go back. O(1).
FM_INTERNAL bool fm_goes_back(const struct fm_evaluator * evaluator, int64_t now);

/// Note that the clock has come to `now`, where nothing is due, without moving the time to it: the
/// next move counts as one from there, which decides whether a timeout is put off. O(1).
FM_INTERNAL void fm_see_time(struct fm_evaluator * evaluator, int64_t now);

/// Leave out the first of more than FM_MOST_PERIODS_BEHIND due periods. O(1).
FM_INTERNAL void fm_miss_periods(struct fm_evaluator * evaluator, int64_t last);

/// Take the first thing that is due by `last`, as fm_evaluator_advance.
FM_INTERNAL uint32_t fm_take_first_due(
  struct fm_evaluator * evaluator, int64_t last, struct fm_violation * out);

/// The nanoseconds from one time to a later one; 0 if it is not later. O(1).
FM_INTERNAL int64_t fm_since(int64_t from, int64_t to);

#endif  // DUE_H_
