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

/// start_lines.c: see start_lines.h for the contract.

#include "start_lines.h"

#include <inttypes.h>
#include <string.h>

#include "key_text.h"

static const char * const POLICIES[] = {
  [FM_EVERY_MESSAGE] = "every_message", [FM_RELEVANT_MESSAGE] = "relevant_message",
  [FM_ALL_INPUTS] = "all_inputs", [FM_PERIODIC] = "periodic", [FM_TIMED] = "timed"};

static void add_count(struct fm_text * text, uint64_t n, const char * noun)
{
  fm_text_add(text, "%" PRIu64 " %s%s", n, noun, n == 1u ? "" : "s");
}

// Whether a bundle before the `k`-th, or a topic before it, has the name.
static bool is_repeated(
  const struct fm_watched * watched, uint32_t k, uint32_t topic, const char * name)
{
  for (uint32_t i = 0; i <= k; ++i) {
    const struct fm_report_table * table = watched[i].reporter->table;
    for (uint32_t t = 0; t < (i == k ? topic : table->n_topics); ++t) {
      if (strcmp(table->topics[t].name, name) == 0) {
        return true;
      }
    }
  }
  return false;
}

static uint64_t count_inputs(const struct fm_report_table * table)
{
  uint64_t n = 0;
  for (uint32_t t = 0; table->n_kinds > 0 && t < table->n_topics; ++t) {
    n += table->topic_inputs[t].n_inputs;
    for (uint32_t kind = 0; kind < table->n_kinds; ++kind) {
      n += table->kinds[kind].keyed[t].n_inputs;
    }
  }
  return table->n_kinds > 0 ? n : table->n_inputs;
}

static void add_contents(struct fm_text * text, const struct fm_watched * watched, uint32_t n)
{
  uint64_t requirements = 0;
  uint64_t inputs = 0;
  uint64_t topics = 0;
  for (uint32_t k = 0; k < n; ++k) {
    const struct fm_report_table * table = watched[k].reporter->table;
    requirements += table->n_requirements;
    inputs += count_inputs(table);
    for (uint32_t t = 0; t < table->n_topics; ++t) {
      topics += table->topics[t].kind != FM_TOPIC ||
        is_repeated(watched, k, t, table->topics[t].name) ? 0u : 1u;
    }
  }
  add_count(text, requirements, "requirement");
  fm_text_add(text, " on ");
  add_count(text, inputs, "input");
  fm_text_add(text, " of ");
  add_count(text, topics, "topic");
}

static void add_state(struct fm_text * text, const struct fm_watched * watched, uint32_t n)
{
  uint64_t bytes = 0;
  for (uint32_t k = 0; k < n; ++k) {
    bytes += watched[k].reporter->monitor->state_bytes;
  }
  add_count(text, bytes, "byte");
  fm_text_add(text, " of state");
}

static void add_terms(struct fm_text * text, const struct fm_watched * watched)
{
  const struct fm_report_table * table = watched->reporter->table;
  fm_text_add(text, "policy %s, ", POLICIES[table->policy]);
  if (table->policy == FM_PERIODIC) {
    fm_text_add(text, "%g s, ", (double)table->period / 1e9);
  } else if (table->uses_header_stamps) {
    fm_text_add(text, "by the stamps of headers, reordered within %g s, ",
      (double)table->reorder / 1e9);
  }
  add_state(text, watched, 1);
  for (uint32_t kind = 0; kind < table->n_kinds; ++kind) {
    if (!table->kinds[kind].has_base) {
      fm_text_add(text, ", for each ");
      fm_add_variables(text, &table->kinds[kind]);
      fm_text_add(text, ", at most %" PRIu32, table->kinds[kind].most);
    }
  }
  if (watched->origin[0] != '\0') {
    fm_text_add(text, " (%s)", watched->origin);
  }
}

void fm_add_watching(struct fm_lines * lines, const struct fm_watched * watched, uint32_t n)
{
  struct fm_text contents = {NULL, 0, 0};
  struct fm_text terms = {NULL, 0, 0};
  for (uint32_t k = 0; n > 1u && k < n; ++k) {
    add_contents(&contents, &watched[k], 1);
    add_terms(&terms, &watched[k]);
    fm_lines_add(lines, FM_INFO, "bundle %s: %s, %s", watched[k].reporter->table->bundle,
      fm_text_get(&contents), fm_text_get(&terms));
    fm_text_clear(&contents);
    fm_text_clear(&terms);
  }
  add_contents(&contents, watched, n);
  if (n == 1u) {
    add_terms(&terms, watched);
    fm_lines_add(lines, FM_INFO, "watching %s, %s", fm_text_get(&contents), fm_text_get(&terms));
  } else {
    add_state(&terms, watched, n);
    fm_lines_add(lines, FM_INFO, "watching %s in %u bundles, %s", fm_text_get(&contents), n,
      fm_text_get(&terms));
  }
  fm_text_free(&contents);
  fm_text_free(&terms);
}

void fm_add_restarted(struct fm_lines * lines, uint64_t groups)
{
  fm_lines_add(lines, FM_INFO, "restarted %" PRIu64 " step group%s; input values kept", groups,
    groups == 1u ? "" : "s");
}
