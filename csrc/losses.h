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

/// losses.h: how many messages of a topic were sent and never came.
///
/// Each publisher numbers what it sends. A number that was left out is a message that is lost: its
/// queue or ours overflowed, or the network dropped it, where nobody asked for it again.
/// What a publisher sent before its first message came is not counted.
///
/// The caller owns the memory, zeroed at the start, and sees to it that one thread at a time calls.

#ifndef LOSSES_H_
#define LOSSES_H_

#include <string.h>

#include "fret_monitor.h"

#define FM_GID_BYTES 16u
/// Publishers that are told apart; of more, those that spoke last are: where all of more speak in turn,
/// nothing is found to be lost.
#define FM_PUBLISHERS 64u
/// Messages within which one without a number is to be found in a gap.
#define FM_PATIENCE 64u

struct fm_publisher
{
  uint8_t gid[FM_GID_BYTES];
  uint64_t first;  // the number that came first
  uint64_t last;   // the highest that came, 0 where there is no publisher
};

/// What is known of the publishers of a topic; the one that spoke last is the first.
struct fm_losses
{
  struct fm_publisher publishers[FM_PUBLISHERS];
  uint64_t lost;
  uint64_t unnumbered;  // that came without a number, and are still to be found in a gap
  uint32_t patience;    // messages for which they are looked for
};

/// A message has come whose number nobody knows: the gap that it leaves is no loss. Whose it was is
/// not known either, so that the next gap of any publisher is taken for it, if it comes soon. O(1).
FM_INLINE void fm_losses_unnumbered(struct fm_losses * losses)
{
  losses->unnumbered += 1;
  losses->patience = FM_PATIENCE;
}

FM_INLINE void fm_losses_gap(struct fm_losses * losses, uint64_t gap)
{
  const uint64_t known = gap < losses->unnumbered ? gap : losses->unnumbered;
  losses->unnumbered -= known;
  losses->lost += gap - known;
}

/// A message has come. Numbers are from 1; 0 and the highest mean that there are none. A number
/// that is not above the last one of its publisher is a repetition, and counts for nothing.
/// O(1) for the publisher that spoke last, O(FM_PUBLISHERS) otherwise; cannot fail.
FM_INLINE void fm_losses_note(
  struct fm_losses * losses, const uint8_t gid[FM_GID_BYTES], uint64_t number)
{
  struct fm_publisher found = {{0}, number, number};
  uint32_t place = 0;
  if (number == 0 || number == UINT64_MAX) {
    return;
  }
  losses->patience -= losses->patience > 0 ? 1u : 0u;
  losses->unnumbered = losses->patience > 0 ? losses->unnumbered : 0u;
  while (place < FM_PUBLISHERS - 1 && losses->publishers[place].last > 0 &&
    memcmp(losses->publishers[place].gid, gid, FM_GID_BYTES) != 0)
  {
    place += 1;
  }
  struct fm_publisher * const at = &losses->publishers[place];
  memcpy(found.gid, gid, FM_GID_BYTES);
  if (at->last > 0 && memcmp(at->gid, gid, FM_GID_BYTES) == 0) {
    fm_losses_gap(losses, number > at->last ? number - at->last - 1 : 0);
    found.first = at->first;
    found.last = number > at->last ? number : at->last;
  }
  memmove(&losses->publishers[1], losses->publishers, place * sizeof(found));
  losses->publishers[0] = found;
}

/// As fm_losses_note, of a message that is known to come for the first time: one that is not above
/// the last one of its publisher comes late, and was taken for lost before.
FM_INLINE void fm_losses_note_new(
  struct fm_losses * losses, const uint8_t gid[FM_GID_BYTES], uint64_t number)
{
  const uint64_t before = losses->lost;
  fm_losses_note(losses, gid, number);
  const struct fm_publisher * const found = &losses->publishers[0];
  const bool is_late = found->first < number && number < found->last;
  losses->lost = is_late && before > 0 ? before - 1 : losses->lost;
}

#endif  // LOSSES_H_
