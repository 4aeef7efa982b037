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

/// graph_lines.c: topics whose messages are made, in words: transforms, and what is in the graph.

#include <inttypes.h>
#include <string.h>

#include "review_parts.h"

// ---- transforms --------------------------------------------------------------------------------

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
  const struct {uint64_t before, now; const char * why;} kinds[] = {
    {before->loops, now->loops, "would close a loop"},
    {before->unusable, now->unusable, "cannot be used as transforms"},
    {before->old, now->old, "came more than 10 s after a newer one"}};
  for (size_t k = 0; k < sizeof(kinds) / sizeof(kinds[0]); ++k) {
    if (kinds[k].before == 0 && kinds[k].now > 0) {
      fm_lines_add(lines, FM_WARN, "links of /tf left out: %" PRIu64 " %s", kinds[k].now,
        kinds[k].why);
    }
  }
}

// ---- the graph ---------------------------------------------------------------------------------

bool fm_is_of_graph(const struct fm_reporter * reporter, uint32_t topic)
{
  return reporter->table->topics[topic].kind >= FM_IN_GRAPH;
}

static const char * name_of_type(uint32_t type)
{
  static const char * const names[] = {"nothing", "bool", "int64", "float64", "string"};
  return type < sizeof(names) / sizeof(names[0]) ? names[type] : "array";
}

static const char * name_of_state(int64_t state)
{
  static const char * const names[] =
  {"unknown", "unconfigured", "inactive", "active", "finalized"};
  return state >= 0 && state < 5 ? names[state] : "unknown";
}

static void add_fault(struct fm_text * text, const struct fm_observed * observed)
{
  switch (observed->fault) {
    case FM_NO_NODE:
      fm_text_add(text, "its node is not there");
      break;
    case FM_NO_ANSWER:
      fm_text_add(text, "the node does not answer its %s service",
        observed->wanted == FM_SEEN_INT32 ? "get_state" : "get_parameters");
      break;
    case FM_NOT_SET:
      fm_text_add(text, "the node has no such parameter");
      break;
    default:
      fm_text_add(text, "its type is %s, and not %s", name_of_type(observed->type),
        name_of_type(observed->wanted));
  }
}

void fm_add_seen(
  struct fm_text * text, const struct fm_reporter * reporter, uint32_t topic,
  const struct fm_observed * observed)
{
  const uint32_t kind = reporter->table->topics[topic].kind;
  if (observed->fault != FM_NO_FAULT) {
    add_fault(text, observed);
  } else if (!observed->has_value) {
    fm_text_add(
      text, "%s", observed->was_there ? "its node has not answered yet" : "not seen yet");
  } else if (kind == FM_PARAMETER) {
    fm_text_add(text, "it has a value");
  } else if (observed->value != 0) {
    fm_text_add(text, "%s", kind == FM_LIFECYCLE ? name_of_state(observed->value) : "there");
  } else if (observed->was_there) {
    fm_text_add(text, "not there any more");
  } else {
    fm_text_add(text, "never seen");
  }
}

bool fm_is_seen_wrong(const struct fm_observed * observed)
{
  return observed->fault != FM_NO_FAULT || (observed->has_value && !observed->was_there);
}

static void add_fault_line(
  struct fm_lines * lines, const char * name, const struct fm_observed * observed)
{
  struct fm_text text = {NULL, 0, 0};
  add_fault(&text, observed);
  fm_lines_add(
    lines, observed->fault == FM_OTHER_TYPE ? FM_ERROR : FM_WARN, "%s: %s; its input %s", name,
    fm_text_get(&text), observed->has_value ? "keeps its value" : "has no value yet");
  fm_text_free(&text);
}

void fm_review_graph(struct fm_review * review, uint32_t topic, struct fm_lines * lines)
{
  struct fm_topic_log * const log = &review->topics[topic];
  const struct fm_observed * const now = &review->now.topics[topic].observed;
  if (now->has_value && !now->was_there && fm_is_first(&log->is_absence_logged)) {
    fm_lines_add(lines, FM_WARN, "%s: nothing is there since the start", review->names[topic]);
  }
  if (now->fault != log->fault && now->fault != FM_NO_FAULT) {
    add_fault_line(lines, review->names[topic], now);
  }
  log->fault = now->fault;
}

static void add_fault_at_end(
  struct fm_lines * lines, const struct fm_reporter * reporter, uint32_t topic)
{
  const struct fm_observed observed = fm_engine_observed(reporter->engine, topic);
  if (observed.fault != FM_NO_FAULT) {
    add_fault_line(lines, reporter->table->topics[topic].name, &observed);
  }
}

// ---- at the end of a recording -----------------------------------------------------------------

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
    add_fault_at_end(lines, reporter, t);
  }
  fm_text_free(&text);
  fm_add_left_out(lines, &none, &counts);
}
