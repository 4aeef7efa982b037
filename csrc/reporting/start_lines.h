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

/// start_lines.h: lines at the start, and of what acts: gates, locks, actions, the black box.
///
/// Times are in nanoseconds, names of topics, services and nodes are full. Any thread.

#ifndef START_LINES_H_
#define START_LINES_H_

#include "blackbox_writer.h"
#include "reporter.h"

/// A bundle that is watched. Names are full names, of as many locks and actions as its table has.
struct fm_watched
{
  const struct fm_reporter * reporter;
  const char * origin;   // its file or folder; "": it is compiled into the node
  const char * source;   // of its gate, as the next
  const char * target;
  const char * const * locks;    // of their topics
  const char * const * actions;  // of their topics, services or nodes
};

/// Add what is logged at the start: the locks and actions of each bundle, a line for all bundles,
/// after one for each if there are several, and what gates do. Any thread. O(topics * topics).
FM_EXPORT void fm_add_watching(
  struct fm_lines * lines, const struct fm_watched * watched, uint32_t n);

/// Add the line of a reset of `groups` step groups. Any thread. O(1).
FM_EXPORT void fm_add_restarted(struct fm_lines * lines, uint64_t groups);

/// Add why fm_gate_init refuses a policy.
FM_EXPORT void fm_add_gate_refusal(
  struct fm_lines * lines, const struct fm_report_gate * gate, const char * policy);

/// Add the line that an action has failed, and why; after `tries` of them, if more than one.
FM_INTERNAL void fm_add_failure(
  struct fm_lines * lines, const struct fm_action * action, uint32_t tries, const char * why);

/// Add the lines about files that were written since the last call, and about the first one that
/// could not be. O(files).
FM_EXPORT void fm_add_blackbox_lines(
  struct fm_lines * lines, struct fm_blackbox_writer * writer);

/// Add why there is no black box, after an error of fm_blackbox_writer_create.
FM_EXPORT void fm_add_blackbox_refusal(
  struct fm_lines * lines, const struct fm_blackbox_options * options, int error);

#endif  // START_LINES_H_
