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

/// graph_lines.h: what is said of what a bundle names in the graph of ROS.

#ifndef GRAPH_LINES_H_
#define GRAPH_LINES_H_

#include "review_parts.h"

/// Whether the messages of a topic are made of the graph, or of what a node in it is.
FM_INTERNAL bool fm_is_of_graph(const struct fm_reporter * reporter, uint32_t topic);

/// Add what was seen last of such a topic to a text. Allocates.
FM_INTERNAL void fm_add_seen(
  struct fm_text * text, const struct fm_reporter * reporter, uint32_t topic,
  const struct fm_observed * observed);

/// Whether something is wrong with it.
FM_INTERNAL bool fm_is_seen_wrong(const struct fm_observed * observed);

/// Add a line, once, if it was not there when its `startup` was over, and when another fault
/// comes. O(1).
FM_INTERNAL void fm_review_graph(
  struct fm_review * review, uint32_t topic, struct fm_lines * lines);

/// Add a line on a fault of a topic at the end of a recording. As fm_engine_observed.
FM_INTERNAL void fm_add_fault_at_end(
  struct fm_lines * lines, const struct fm_reporter * reporter, uint32_t topic);

#endif  // GRAPH_LINES_H_
