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

/// gate_lines.h: lines of the log about a gate at its start.

#ifndef GATE_LINES_H_
#define GATE_LINES_H_

#include "lines.h"
#include "report_table.h"

/// Add what the gate of a bundle does; `source` and `target` are full names. O(requirements).
FM_EXPORT void fm_describe_gate(
  struct fm_lines * lines, const struct fm_report_table * table, const char * source,
  const char * target);

/// Add why fm_gate_init refuses a policy.
FM_EXPORT void fm_add_gate_refusal(
  struct fm_lines * lines, const struct fm_report_gate * gate, const char * policy);

#endif  // GATE_LINES_H_
