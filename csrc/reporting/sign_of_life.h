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

/// sign_of_life.h: when a node gives its sign of life, `~/alive`: once a second while all of its
/// threads look for work. Not thread-safe; only the line that is added may allocate.

#ifndef SIGN_OF_LIFE_H_
#define SIGN_OF_LIFE_H_

#include "lines.h"

/// Seconds without a sign, until the middleware reports the publisher as not alive.
#define FM_SIGN_LEASE_S 3

/// Steady times; `published` is that of the first sign at first, the others are 0.
struct fm_sign
{
  int64_t published;
  int64_t suspected;  // when a thread was first found not to have turned; 0: all have
  int64_t next_line;
};

/// Whether to publish the sign at `now`: if each of `n` counters of threads has changed since the
/// last sign, when they were as in `before`, which is then updated. Adds a line if a thread hangs.
/// To be called once a second. O(n).
FM_EXPORT bool fm_sign_is_due(
  struct fm_sign * sign, uint64_t * before, const uint64_t * turns, uint32_t n, int64_t now,
  struct fm_lines * lines);

#endif  // SIGN_OF_LIFE_H_
