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

/// verdicts.c: see verdicts.h for the contract.

#include "verdicts.h"

#define PERIOD_NS 1000000000

static uint32_t add(struct fm_verdict * verdict, uint8_t state, int64_t now, bool * out)
{
  verdict->published = state;
  verdict->due = now + PERIOD_NS;
  *out = state == FM_HOLDS;
  return 1;
}

uint32_t fm_verdict_look(
  struct fm_verdict * verdict, const struct fm_requirement_state * state, int64_t now, bool * out)
{
  uint32_t n = 0;
  const bool has_begun = state->occurrences != verdict->occurrences;
  verdict->occurrences = state->occurrences;
  if (has_begun && verdict->published != FM_VIOLATED) {
    n += add(verdict, FM_VIOLATED, now, &out[n]);
  }
  if (state->state == FM_UNKNOWN) {
    verdict->published = FM_UNKNOWN;
  } else if (state->state != verdict->published || (n == 0 && verdict->due <= now)) {
    n += add(verdict, state->state, now, &out[n]);
  }
  return n;
}

int64_t fm_verdict_due(const struct fm_verdict * verdict)
{
  return verdict->published == FM_UNKNOWN ? INT64_MAX : verdict->due;
}
