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

/// lines.h: lines of the log, in the order in which they are to be logged.
///
/// Whoever words a line adds it to a list; the node logs the list, and clears it. Not thread-safe.
/// When memory is short a line is left out. O(characters).

#ifndef LINES_H_
#define LINES_H_

#include "text.h"

enum fm_level
{
  FM_INFO = 0,
  FM_WARN = 1,
  FM_ERROR = 2
};

struct fm_line
{
  uint32_t level;  // enum fm_level
  char * text;     // UTF-8, ended by a zero
};

/// Zeroed: an empty list. The owner calls fm_lines_free.
struct fm_lines
{
  struct fm_line * lines;
  uint32_t n;
  uint32_t capacity;
};

/// Add a line, in the format of printf.
void fm_lines_add(struct fm_lines * lines, enum fm_level level, const char * format, ...)
FM_PRINTF(3, 4);

/// Whether a line may be logged, at most one in an interval: if so, `*next` is set, which is 0 at
/// first. All are times of one clock. O(1).
bool fm_passes(int64_t * next, int64_t now, int64_t interval);

/// Remove all lines; keep the memory of the list.
FM_EXPORT void fm_lines_clear(struct fm_lines * lines);

/// Remove all lines, and free the memory of the list.
FM_EXPORT void fm_lines_free(struct fm_lines * lines);

#endif  // LINES_H_
