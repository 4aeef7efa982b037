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

/// gate_lines.c: see gate_lines.h for the contract.

#include "gate_lines.h"

static void add_otherwise(struct fm_text * text, const struct fm_report_gate * gate)
{
  if (gate->is_service) {
    fm_text_add(text, "the request is refused");
  } else if (gate->otherwise == FM_HOLD) {
    fm_text_add(
      text, "the last message that passed is sent again, for %g s", (double)gate->hold / 1e9);
  } else if (gate->otherwise == FM_SUBSTITUTE && gate->period > 0) {
    fm_text_add(text, "the substitute is sent, at %g Hz", 1e9 / (double)gate->period);
  } else if (gate->otherwise == FM_SUBSTITUTE) {
    fm_text_add(text, "the substitute is sent, once for each message");
  } else {
    fm_text_add(text, "nothing is sent");
  }
}

static void add_latch(struct fm_text * text, const struct fm_report_gate * gate)
{
  if (gate->latches && gate->open_after > 0) {
    fm_text_add(
      text, "; after a violation closed until %g s without a violation",
      (double)gate->open_after / 1e9);
  } else if (gate->latches) {
    fm_text_add(text, "; after a violation closed until ~/reset");
  }
}

void fm_describe_gate(
  struct fm_lines * lines, const struct fm_report_table * table, const char * source,
  const char * target)
{
  struct fm_text ids = {NULL, 0, 0};
  struct fm_text rest = {NULL, 0, 0};
  for (uint32_t k = 0; k < table->n_requirements; ++k) {
    fm_text_list(&ids, ", ", table->requirements[k].id);
  }
  add_otherwise(&rest, table->gate);
  add_latch(&rest, table->gate);
  fm_text_add(&rest, "%s", table->gate->passes_silent ?
    "; OPEN WHILE AN INPUT IS STALE (stale: open)" : "");
  fm_lines_add(lines, FM_INFO, "gate '%s': %s -> %s, keeps %s; otherwise %s", table->gate->name,
    source, target, fm_text_get(&ids), fm_text_get(&rest));
  fm_text_free(&ids);
  fm_text_free(&rest);
}

void fm_add_gate_refusal(
  struct fm_lines * lines, const struct fm_report_gate * gate, const char * policy)
{
  fm_lines_add(lines, FM_ERROR, "the gate '%s' needs a step for each message: it cannot run with "
    "the policy %s", gate->name, policy);
}
