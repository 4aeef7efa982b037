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

/// start_lines.h: what a node watches, in words; and lines that belong to no bundle.

#ifndef START_LINES_H_
#define START_LINES_H_

#include "reporter.h"

/// A bundle that is watched, and where it is from: its file or folder; "": compiled into the node.
struct fm_watched
{
  const struct fm_reporter * reporter;
  const char * origin;
};

/// Add a line for all bundles, after one for each if there are several. Any thread.
/// O(topics * topics).
FM_EXPORT void fm_add_watching(
  struct fm_lines * lines, const struct fm_watched * watched, uint32_t n);

/// Add the line of a reset of `groups` step groups. Any thread. O(1).
FM_EXPORT void fm_add_restarted(struct fm_lines * lines, uint64_t groups);

#endif  // START_LINES_H_
