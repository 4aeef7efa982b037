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

/// graph_lines.c: see graph_lines.h for the contract.

#include "graph_lines.h"

bool fm_is_of_graph(const struct fm_reporter * reporter, uint32_t topic)
{
  return reporter->table->topics[topic].kind == FM_IN_GRAPH;
}

void fm_add_seen(struct fm_text * text, const struct fm_observed * observed)
{
  if (!observed->has_value) {
    fm_text_add(text, "not seen yet");
  } else if (observed->value != 0) {
    fm_text_add(text, "there");
  } else if (observed->was_there) {
    fm_text_add(text, "not there any more");
  } else {
    fm_text_add(text, "never seen");
  }
}

void fm_review_graph(struct fm_review * review, uint32_t topic, struct fm_lines * lines)
{
  const struct fm_observed * const now = &review->now.topics[topic].observed;
  if (now->has_value && !now->was_there && !review->topics[topic].is_absence_logged) {
    review->topics[topic].is_absence_logged = true;
    fm_lines_add(lines, FM_WARN, "%s: nothing is there since the start",
      review->reporter->topics[topic]);
  }
}
