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

/// transform_lines.c: see transform_lines.h for the contract.

#include "transform_lines.h"

#include <inttypes.h>
#include <string.h>

#include "graph_lines.h"

bool fm_add_missing_link(
  struct fm_text * text, const struct fm_reporter * reporter, uint32_t topic)
{
  char from[FM_MOST_FRAME_BYTES + 1u];
  char to[FM_MOST_FRAME_BYTES + 1u];
  if (reporter->table->topics[topic].kind != FM_TRANSFORM ||
    !fm_engine_missing_link(reporter->engine, topic, from, to))
  {
    return false;
  }
  if (strcmp(from, to) == 0) {
    fm_text_add(text, "the samples of %s do not reach the time of the other links", from);
  } else {
    fm_text_add(text, "no link between %s and %s", from, to);
  }
  return true;
}

void fm_add_left_out(
  struct fm_lines * lines, const struct fm_tree_counts * before,
  const struct fm_tree_counts * now)
{
  if (before->loops == 0 && now->loops > 0) {
    fm_lines_add(lines, FM_WARN, "links of /tf left out: %" PRIu64 " would close a loop",
      now->loops);
  }
  if (before->unusable == 0 && now->unusable > 0) {
    fm_lines_add(lines, FM_WARN, "links of /tf left out: %" PRIu64 " cannot be used as transforms",
      now->unusable);
  }
  if (before->old == 0 && now->old > 0) {
    fm_lines_add(lines, FM_WARN, "links of /tf left out: %" PRIu64 " came more than 10 s after a "
      "newer one", now->old);
  }
}

void fm_add_transforms_at_end(struct fm_lines * lines, const struct fm_reporter * reporter)
{
  const struct fm_tree_counts none = {0, 0, 0};
  const struct fm_tree_counts counts = fm_engine_left_out(reporter->engine);
  struct fm_text text = {NULL, 0, 0};
  for (uint32_t t = 0; t < reporter->table->n_topics; ++t) {
    fm_text_clear(&text);
    if (fm_add_missing_link(&text, reporter, t)) {
      fm_lines_add(lines, fm_engine_has_come(reporter->engine, t) ? FM_WARN : FM_ERROR,
        "there is no transform %s at the end: %s", reporter->table->topics[t].name,
        fm_text_get(&text));
    }
    fm_add_fault_at_end(lines, reporter, t);
  }
  fm_text_free(&text);
  fm_add_left_out(lines, &none, &counts);
}
