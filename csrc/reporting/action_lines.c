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


/// action_lines.c: see action_lines.h for the contract.

#include "action_lines.h"

#include <inttypes.h>

static void add_effect(
  struct fm_text * text, const struct fm_action * action, const char * full_name)
{
  static const char * const verbs[] = {"publishes on", "calls", "brings"};
  const bool is_transition = action->kind == FM_ACTION_TRANSITION;
  fm_text_add(text, "action '%s' %s %s%s%s", action->name, verbs[action->kind], full_name,
    is_transition ? " to " : "", is_transition ? action->state : "");
}

void fm_describe_actions(
  struct fm_lines * lines, const struct fm_report_table * table, const char * const * locks,
  const char * const * actions)
{
  struct fm_text text = {NULL, 0, 0};
  for (uint32_t k = 0; k < table->n_locks; ++k) {
    fm_text_add(&text, "%s", k > 0 ? "; " : "");
    fm_text_add(&text, "lock '%s' on %s, %g Hz", table->locks[k].name, locks[k],
      1e9 / (double)table->locks[k].period);
  }
  for (uint32_t k = 0; k < table->n_actions; ++k) {
    fm_text_add(&text, "%s", text.length > 0 ? "; " : "");
    add_effect(&text, &table->actions[k], actions[k]);
  }
  if (text.length > 0) {
    fm_lines_add(lines, FM_INFO, "%s", fm_text_get(&text));
  }
  fm_text_free(&text);
}

void fm_add_failure(
  struct fm_lines * lines, const struct fm_action * action, uint32_t tries, const char * why)
{
  if (tries > 1) {
    fm_lines_add(lines, FM_ERROR, "the action '%s' failed %" PRIu32 " times: %s", action->name,
      tries, why);
  } else {
    fm_lines_add(lines, FM_ERROR, "the action '%s' failed: %s", action->name, why);
  }
}
