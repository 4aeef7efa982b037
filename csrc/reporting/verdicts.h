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

/// verdicts.h: which verdicts of a requirement are published, and when: at each change, and once a
/// second.
///
/// The verdict is that of the reports: of a requirement `H p` that of p, as in the tables of
/// `bag`. While it is not known (states.h), nothing is published. Not thread-safe; no function
/// allocates or fails.

#ifndef VERDICTS_H_
#define VERDICTS_H_

#include "states.h"

/// What was published of a requirement. Zeroed: nothing.
struct fm_verdict
{
  uint64_t occurrences;  // of its violations, when its state was looked at last
  int64_t due;           // steady: when it is published again
  uint8_t published;     // enum fm_state; FM_UNKNOWN: nothing yet, or it is not known any more
};

/// Verdicts to publish at one time, at most.
#define FM_MOST_VERDICTS 2u

/// Look at the state of a requirement at `now` (steady). Writes the verdicts to publish to `out`,
/// FM_MOST_VERDICTS of them, in order, and returns how many. A violation that has begun since the
/// last look is published even if it is over. O(1).
uint32_t fm_verdict_look(
  struct fm_verdict * verdict, const struct fm_requirement_state * state, int64_t now, bool * out);

/// When to look again though no state changes; INT64_MAX: it is not known. O(1).
int64_t fm_verdict_due(const struct fm_verdict * verdict);

#endif  // VERDICTS_H_
