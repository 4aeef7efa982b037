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
/// Compares the messages that csrc/losses.h counts as lost with those dropped: `losses SEED`.
/// Exit status 0 if the numbers are equal.

#include "handover.h"

#include <stdio.h>
#include <stdlib.h>

#include "draws.h"

static int failures = 0;

static void check(bool condition, const char * text)
{
  if (!condition) {
    printf("not so: %s\n", text);
    failures += 1;
  }
}

static void note(struct fm_arrivals * losses, uint32_t publisher, uint64_t number)
{
  uint8_t gid[FM_GID_BYTES] = {1, 2, 3};
  gid[FM_GID_BYTES - 1] = (uint8_t)publisher;
  const struct fm_origin origin = {0, 0, number, gid, false, NULL, 0};
  fm_arrivals_note(losses, &origin);
}

// The first message of each publisher arrives; some others are dropped, some arrive twice.
static void all_dropped_messages_are_counted(uint32_t n_publishers)
{
  struct fm_arrivals losses = {0};
  uint64_t numbers[FM_MOST_PUBLISHERS] = {0};
  uint64_t dropped[FM_MOST_PUBLISHERS] = {0};  // since the last message that arrived
  uint64_t lost = 0;
  for (int k = 0; k < 20000; ++k) {
    const uint32_t p = random_below(n_publishers);
    numbers[p] += 1;
    if (numbers[p] > 1 && random_below(3) == 0) {
      dropped[p] += 1;
      continue;
    }
    lost += dropped[p];
    dropped[p] = 0;
    note(&losses, p, numbers[p]);
    if (random_below(4) == 0) {
      note(&losses, p, 1 + random_below((uint32_t)numbers[p]));
    }
    check(losses.lost == lost, "as many are lost as were dropped");
  }
  check(lost > 1000, "some were dropped");
}

static void a_publisher_is_known_from_its_first_message(void)
{
  struct fm_arrivals losses = {0};
  note(&losses, 1, 500);
  check(losses.lost == 0, "what was sent before is not lost");
  note(&losses, 1, 502);
  check(losses.lost == 1, "what was sent since is");
  note(&losses, 2, 7);
  note(&losses, 1, 503);
  check(losses.lost == 1, "a new publisher begins anew");
}

static void what_the_middleware_dropped_is_not_lost(void)
{
  struct fm_arrivals losses = {0};
  note(&losses, 1, 5);
  losses.dropped = 3;
  note(&losses, 1, 7);
  check(losses.lost == 0 && losses.dropped == 2, "one number is missing");
  note(&losses, 2, 1);
  note(&losses, 2, 5);
  check(losses.lost == 1 && losses.dropped == 0, "three are missing, two of them dropped");
}

static void without_numbers_nothing_is_lost(void)
{
  struct fm_arrivals losses = {0};
  note(&losses, 1, 5);
  note(&losses, 1, UINT64_MAX);
  note(&losses, 1, 0);
  note(&losses, 1, 6);
  check(losses.lost == 0, "no number is no gap");
}

static void what_comes_late_is_not_lost(void)
{
  struct fm_arrivals losses = {0};
  fm_arrivals_begin_handover(&losses, false);
  note(&losses, 1, 5);
  note(&losses, 1, 4);
  check(losses.lost == 0, "what was sent before the first one was never missed");
  note(&losses, 1, 9);
  check(losses.lost == 3, "three are missing");
  note(&losses, 1, 7);
  note(&losses, 1, 6);
  check(losses.lost == 1, "two of them came late");
  note(&losses, 1, 12);
  check(losses.lost == 3, "and two more are missing");
  check(fm_arrivals_lost(&losses) == 0, "the other subscription may still bring them");
  fm_arrivals_end_handover(&losses);
  check(fm_arrivals_lost(&losses) == 3, "it has not");
}

static void losses_from_before_a_handover_are_counted_during_it(void)
{
  struct fm_arrivals losses = {0};
  note(&losses, 1, 5);
  note(&losses, 1, 8);
  fm_arrivals_begin_handover(&losses, false);
  check(fm_arrivals_lost(&losses) == 2, "as many as before the handover");
  note(&losses, 1, 10);
  fm_arrivals_begin_handover(&losses, false);  // of a third subscription
  check(fm_arrivals_lost(&losses) == 2, "still as many as before the first one");
  fm_arrivals_end_handover(&losses);
  check(fm_arrivals_lost(&losses) == 3, "and one more after it");
}

// Repetitions are not recognised if there is no memory for them, or too many come.
static void a_repetition_in_a_handover_does_not_reduce_the_losses(void)
{
  struct fm_arrivals losses = {0};
  fm_arrivals_begin_handover(&losses, false);
  for (uint64_t number = 5; number < 8; ++number) {
    note(&losses, 1, number);
  }
  note(&losses, 1, 6);
  check(losses.lost == 0, "nothing was lost");
  note(&losses, 1, 9);
  note(&losses, 1, 5);
  check(losses.lost == 1, "the first one was not missing");
  note(&losses, 1, 9);
  check(losses.lost == 1, "nor was the last one");
  note(&losses, 1, 8);
  check(losses.lost == 0, "this one was, and came late");
  fm_arrivals_end_handover(&losses);
}

// More publishers than are tracked cost precision, but the count is never too high.
static bool is_repeated(const struct fm_arrivals * arrivals, uint64_t number, bool is_retired)
{
  const uint8_t gid[FM_GID_BYTES] = {1, 2, 3, [FM_GID_BYTES - 1] = 1};
  const struct fm_origin origin = {0, 0, number, gid, is_retired, NULL, 0};
  return fm_arrivals_is_repeated(arrivals, &origin);
}

static void memory_for_repetitions_is_held_during_a_handover_alone(void)
{
  struct fm_arrivals arrivals = {0};
  note(&arrivals, 1, 7);
  check(arrivals.keys == NULL && !is_repeated(&arrivals, 7, false), "none before");
  fm_arrivals_begin_handover(&arrivals, false);
  check(is_repeated(&arrivals, 7, false), "what the old one received before is known");
  check(!is_repeated(&arrivals, 8, false), "what comes next is new");
  note(&arrivals, 1, 8);
  check(is_repeated(&arrivals, 8, true), "what the new one received is known");
  fm_arrivals_end_handover(&arrivals);
  check(arrivals.keys == NULL && !is_repeated(&arrivals, 8, false), "none after");
}

static void more_publishers_than_are_told_apart_lose_nothing(void)
{
  struct fm_arrivals losses = {0};
  for (uint64_t number = 1; number < 100; ++number) {
    for (uint32_t p = 0; p < 3 * FM_MOST_PUBLISHERS; ++p) {
      note(&losses, p, number);
    }
  }
  check(losses.lost == 0, "nothing was dropped");
  note(&losses, 3 * FM_MOST_PUBLISHERS - 1, 102);
  check(losses.lost == 2, "those that spoke last are known");
}

int main(int argc, char ** argv)
{
  if (argc != 2) {
    return 2;
  }
  seed = 0x9E3779B97F4A7C15u * (strtoull(argv[1], NULL, 10) + 1);
  all_dropped_messages_are_counted(1);
  all_dropped_messages_are_counted(FM_MOST_PUBLISHERS);
  a_publisher_is_known_from_its_first_message();
  what_the_middleware_dropped_is_not_lost();
  without_numbers_nothing_is_lost();
  what_comes_late_is_not_lost();
  losses_from_before_a_handover_are_counted_during_it();
  a_repetition_in_a_handover_does_not_reduce_the_losses();
  memory_for_repetitions_is_held_during_a_handover_alone();
  more_publishers_than_are_told_apart_lose_nothing();
  return failures == 0 ? 0 : 1;
}
