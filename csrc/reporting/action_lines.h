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


/// action_lines.h: actions and locks in words: at the start, and when one fails.
///
/// Times are in nanoseconds. Any thread. O(characters).

#ifndef ACTION_LINES_H_
#define ACTION_LINES_H_

#include "lines.h"
#include "report_table.h"

/// Add all locks and actions, as the log shows them at the start; nothing if there are none.
/// `locks` and `actions` are full names: of their topics, services or nodes.
FM_EXPORT void fm_describe_actions(
  struct fm_lines * lines, const struct fm_report_table * table, const char * const * locks,
  const char * const * actions);

/// Add the line that an action has failed, and why; after `tries` of them, if more than one.
FM_INTERNAL void fm_add_failure(
  struct fm_lines * lines, const struct fm_action * action, uint32_t tries, const char * why);

#endif  // ACTION_LINES_H_
