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
/// Any thread; O(inputs of the requirement).

#ifndef DETAILS_H_
#define DETAILS_H_

#include "reporter.h"

/// Bytes of a detail, with its values and flags (outbox.h).
size_t fm_detail_bytes(const struct fm_monitor * monitor);

/// Add the value of an input in a detail, as it is written in a bundle; a named value by its name.
void fm_add_input(
  struct fm_text * text, const struct fm_reporter * reporter, const struct fm_detail * detail,
  uint32_t input);

/// Add the names of the stale inputs that the requirement reads.
void fm_add_silent(
  struct fm_text * text, const struct fm_reporter * reporter, const struct fm_detail * detail);

/// Add the status that describes a violation, or its end, to a list.
FM_EXPORT void fm_add_detail(
  struct fm_statuses * list, const struct fm_reporter * reporter,
  const struct fm_detail * detail);

#endif  // DETAILS_H_
