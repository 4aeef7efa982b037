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

/// reasons.h: why a lock is locked, or a gate closed, in words.
///
/// Any thread. Conditions are as in states.h. O(requirements + inputs of their groups).

#ifndef REASONS_H_
#define REASONS_H_

#include "facts.h"

/// Add the state of a lock: "free", or "locked: " with the reason.
FM_INTERNAL void fm_add_lock_state(
  struct fm_text * text, const struct fm_reporter * reporter, const struct fm_report_lock * lock,
  const uint8_t * conditions);

/// Add the state of the gate: "open", or "closed: " with the reason.
FM_INTERNAL void fm_add_gate_state(
  struct fm_text * text, const struct fm_reporter * reporter, const uint8_t * conditions);

/// Add who is where only the gate should be.
FM_INTERNAL void fm_add_others(
  struct fm_text * text, const struct fm_report_gate * gate, const struct fm_gate_facts * facts);

/// Whether a gate has withheld each message so far on which a requirement was judged.
FM_INTERNAL bool fm_is_withheld_from_start(
  const struct fm_reporter * reporter, const uint8_t * conditions, uint32_t requirement);

#endif  // REASONS_H_
