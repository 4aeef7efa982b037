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

/// details.h: the details of a violation as text: for `copilot/violations`, and for the log.
///
/// Any thread; O(inputs and constants of the requirement).

#ifndef DETAILS_H_
#define DETAILS_H_

#include "reporter.h"

// ---- variables and keys of instances, as people read them --------------------------------------

/// Add the variable of a kind, or both: robot; robot and track.
FM_INTERNAL void fm_add_variables(struct fm_text * text, const struct fm_report_kind * about);

/// Add a key: alpha; of a pair, alpha/3; with its variables if `is_named`: robot=alpha;
/// robot=alpha,track=3. Nothing if its size is 0.
FM_INTERNAL void fm_add_key(
  struct fm_text * text, const struct fm_report_kind * about, const uint8_t * key, size_t size,
  bool is_named);

/// A comparison of margins, as written, of the bundle's scope (FM_BUNDLE) or of a kind.
static inline const char * fm_comparison_of(
  const struct fm_report_table * table, uint32_t kind, int64_t number)
{
  return (kind == FM_BUNDLE ? table->comparisons : table->kinds[kind].comparisons)[number];
}

// ---- details -----------------------------------------------------------------------------------

/// Values that all details begin with; the last of them names the silent inputs.
#define FM_OF_ALL_DETAILS 4

/// What is read of a detail that was received, beside its text.
struct fm_received_detail
{
  int64_t stamp;        // of the violation
  uint64_t suppressed;  // details of the requirement that were not published so far
  bool is_recovery;     // the violation is over
};

/// Add the status that describes a violation, or its end, to a list.
FM_EXPORT void fm_add_detail(
  struct fm_statuses * list, const struct fm_reporter * reporter,
  const struct fm_detail * detail);

/// Read a status that fm_add_detail made. False if it has another form: any node may publish some.
FM_EXPORT bool fm_read_detail(
  const struct fm_status * status, struct fm_received_detail * found);

/// Add what a line of the log shows of such a status: [step N: name = value, ...].
void fm_show_detail(struct fm_text * text, const struct fm_status * detail);

#endif  // DETAILS_H_
