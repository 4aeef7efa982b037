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

/// transform_lines.h: what is said of transforms: which link is missing, which were left out.
///
/// One thread at a time. When memory is short, lines are left out.

#ifndef TRANSFORM_LINES_H_
#define TRANSFORM_LINES_H_

#include "reporter.h"

/// Add where the chain of a transform is broken to a text; nothing if it is whole, or the topic is
/// none of a transform. Returns whether it is broken. As fm_engine_missing_link.
FM_INTERNAL bool fm_add_missing_link(
  struct fm_text * text, const struct fm_reporter * reporter, uint32_t topic);

/// Add a line for each kind of links that were left out, of which there were none `before`. O(1).
FM_INTERNAL void fm_add_left_out(
  struct fm_lines * lines, const struct fm_tree_counts * before,
  const struct fm_tree_counts * now);

/// Add a line for each transform that has no value at the end of a recording: an error if it never
/// had one, otherwise a warning; then those of fm_add_left_out since the begin. O(topics).
FM_EXPORT void fm_add_transforms_at_end(
  struct fm_lines * lines, const struct fm_reporter * reporter);

#endif  // TRANSFORM_LINES_H_
