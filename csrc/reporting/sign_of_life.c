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

/// sign_of_life.c: see sign_of_life.h for the contract.

#include "sign_of_life.h"

#include <string.h>

#define LOGGED_NS (60 * FM_SECOND)

// A thread may have had no time to turn, if this is called early after it was late. And if the
// whole process was stopped, this may be called before the threads turn: they get a second then.
static void suspect(struct fm_sign * sign, int64_t now, struct fm_lines * lines)
{
  if (now - sign->published < FM_SECOND) {
    return;
  }
  if (sign->suspected == 0) {
    sign->suspected = now;
  } else if (now - sign->suspected >= FM_SECOND && fm_passes(&sign->next_line, now, LOGGED_NS)) {
    fm_lines_add(
      lines, FM_ERROR, "a thread of the monitor hangs: no sign of life on ~/alive");
  }
}

bool fm_sign_is_due(
  struct fm_sign * sign, uint64_t * before, const uint64_t * turns, uint32_t n, int64_t now,
  struct fm_lines * lines)
{
  for (uint32_t k = 0; k < n; ++k) {
    if (turns[k] == before[k]) {
      suspect(sign, now, lines);
      return false;
    }
  }
  memcpy(before, turns, n * sizeof(*turns));
  sign->published = now;
  sign->suspected = 0;
  return true;
}
