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

/// blackbox_lines.h: lines of the log about the black box.

#ifndef BLACKBOX_LINES_H_
#define BLACKBOX_LINES_H_

#include "blackbox_writer.h"
#include "lines.h"

/// Add the lines about files that were written since the last call, and about the first one that
/// could not be. O(files).
FM_EXPORT void fm_add_blackbox_lines(
  struct fm_lines * lines, struct fm_blackbox_writer * writer);

/// Add why there is no black box, after an error of fm_blackbox_writer_create.
FM_EXPORT void fm_add_blackbox_refusal(
  struct fm_lines * lines, const struct fm_blackbox_options * options, int error);

#endif  // BLACKBOX_LINES_H_
