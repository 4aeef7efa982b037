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

/// fret_margins.h: the cells of margins (docs/margins.md).
///
/// A margin is how far a formula is from being otherwise, and which comparison decides that. A
/// cell compares margins by their value alone; of equal ones over time it keeps the latest, which
/// the other parts of a window know, too. Within a step the comparison is a pointer into the
/// state, so that a cell of the present alone copies no more than two words.
///
/// Contract: all functions are static inline, do not allocate or fail, and have no undefined
/// behaviour for distances that are no NaN. The caller owns the state of a cell, initialises it
/// with fm_margins_reset, and calls the cell exactly once in each step; only the cell changes it.
/// What a cell returns is valid until it is called again. O(1), but windows: O(1) amortised, at
/// most O(capacity). Any number of threads, if each has its own state.
///
/// C99.

#ifndef FRET_MARGINS_H_
#define FRET_MARGINS_H_

#include <math.h>
#include <string.h>

#include "fret_cells.h"

/// A margin within a step. `rank` is its value as an integer of the same order, which is compared
/// without a branch; ~rank is that of the negation.
struct fm_margin_now
{
  int64_t rank;
  const struct fm_decider * decider;
};

/// The bits of a number as a rank, or a rank as bits. Neither this nor a choice of margins has a
/// branch, which could not be predicted.
static inline int64_t fm_margin_turned(int64_t bits)
{
  const uint64_t sign = UINT64_C(0) - ((uint64_t)bits >> 63);
  return bits ^ (int64_t)(sign >> 1);
}

static inline int64_t fm_margin_rank(double value)
{
  int64_t bits;
  memcpy(&bits, &value, sizeof(bits));
  return fm_margin_turned(bits);
}

static inline double fm_margin_value(int64_t rank)
{
  const int64_t bits = fm_margin_turned(rank);
  double value;
  memcpy(&value, &bits, sizeof(value));
  return value;
}

static inline struct fm_margin_now fm_margin_not(struct fm_margin_now margin)
{
  margin.rank = ~margin.rank;
  return margin;
}

/// The margin of TRUE or FALSE.
static inline struct fm_margin_now fm_margin_certain(bool holds)
{
  static const struct fm_decider none = {(double)INFINITY, 0, -1};
  const int64_t most = fm_margin_rank((double)INFINITY);
  return (struct fm_margin_now) {holds ? most : ~most, &none};
}

/// Margins of FALSE, with which the cells below start; their queues start as zeros.
static inline void fm_margins_reset(struct fm_margin_kept * margins, size_t n)
{
  const struct fm_margin_now no = fm_margin_certain(false);
  for (size_t i = 0u; i < n; ++i) {
    margins[i] = (struct fm_margin_kept) {no.rank, *no.decider};
  }
}

static inline struct fm_margin_now fm_margin_of(const struct fm_margin_kept * kept)
{
  return (struct fm_margin_now) {kept->rank, &kept->decider};
}

/// Read word by word, as a step has written it: a processor waits long for what it wrote in other
/// pieces, and compilers like to read two words at once.
static inline struct fm_decider fm_decider_read(const struct fm_decider * decider)
{
  const volatile struct fm_decider * const words = decider;
  return (struct fm_decider) {words->distance, words->instant, words->comparison};
}

static inline struct fm_margin_kept fm_margin_copied(struct fm_margin_now margin)
{
  return (struct fm_margin_kept) {margin.rank, fm_decider_read(margin.decider)};
}

/// Keep a margin in place of another one, which it may be.
static inline struct fm_margin_now fm_margin_keep(
  struct fm_margin_kept * kept, struct fm_margin_now margin)
{
  kept->rank = margin.rank;
  if (margin.decider != &kept->decider) {
    kept->decider = fm_decider_read(margin.decider);
  }
  return fm_margin_of(kept);
}

/// As it is read from outside. Not known if it rests on a queue in which something found no room.
static inline struct fm_margin fm_margin_shown(struct fm_margin_now margin, bool is_lost)
{
  const double value = fm_margin_value(margin.rank);
  const struct fm_decider decider = fm_decider_read(margin.decider);
  const struct fm_margin known = {
    value, copysign(decider.distance, value), decider.instant, decider.comparison};
  const struct fm_margin unknown = {(double)NAN, (double)NAN, 0, -1};
  return is_lost ? unknown : known;
}

// ---- comparisons -------------------------------------------------------------------------------

/// Of left <= right, and of left < right, which is worth the same. With a NaN it is false.
static inline double fm_distance_at_most(double left, double right)
{
  const double distance = right - left;
  return !isnan(distance) ? distance : left == right ? 0.0 : -(double)INFINITY;
}

/// Of left = right. With a NaN it is false.
static inline double fm_distance_equal(double left, double right)
{
  const double distance = fabs(right - left);
  return !isnan(distance) ? -distance : left == right ? 0.0 : -(double)INFINITY;
}

/// Of left != right. With a NaN it is true.
static inline double fm_distance_unequal(double left, double right)
{
  return -fm_distance_equal(left, right);
}

/// The margin of a comparison at a step.
static inline struct fm_margin_now fm_margin_compared(
  struct fm_margin_kept * kept, double distance, double scale, int64_t instant,
  int64_t comparison)
{
  kept->decider = (struct fm_decider) {distance, instant, comparison};
  return (struct fm_margin_now) {fm_margin_rank(distance / scale), &kept->decider};
}

/// At a tick: its instant is the one since which it has its distance.
static inline struct fm_margin_now fm_margin_compared_at(
  struct fm_margin_kept * kept, double distance, double scale, int64_t instant,
  int64_t comparison)
{
  const double before = kept->decider.distance;
  if (kept->decider.comparison != comparison || before < distance || before > distance) {
    kept->decider = (struct fm_decider) {distance, instant, comparison};
  }
  return (struct fm_margin_now) {fm_margin_rank(distance / scale), &kept->decider};
}

// ---- formulas ----------------------------------------------------------------------------------

static inline struct fm_margin_now fm_margin_chosen(
  struct fm_margin_now a, struct fm_margin_now b, bool is_second)
{
  const uint64_t mask = UINT64_C(0) - (uint64_t)is_second;
  const uintptr_t one = (uintptr_t)a.decider;
  const uintptr_t other = (uintptr_t)b.decider;
  return (struct fm_margin_now) {
    a.rank ^ ((a.rank ^ b.rank) & (int64_t)mask),
    (const struct fm_decider *)(one ^ ((one ^ other) & (uintptr_t)mask))};
}

static inline struct fm_margin_now fm_margin_lesser(
  struct fm_margin_now a, struct fm_margin_now b)
{
  return fm_margin_chosen(a, b, b.rank < a.rank);
}

static inline struct fm_margin_now fm_margin_greater(
  struct fm_margin_now a, struct fm_margin_now b)
{
  return fm_margin_chosen(a, b, b.rank > a.rank);
}

/// O p: the greatest so far. By steps and by ticks.
static inline struct fm_margin_now fm_margin_ever(
  struct fm_margin_kept * before, struct fm_margin_now p)
{
  return fm_margin_keep(before, fm_margin_greater(p, fm_margin_of(before)));
}

/// p S q: the greatest q, each with the least p after it. By steps and by ticks.
static inline struct fm_margin_now fm_margin_since(
  struct fm_margin_kept * before, struct fm_margin_now p, struct fm_margin_now q)
{
  *before = fm_margin_copied(
    fm_margin_greater(q, fm_margin_lesser(p, fm_margin_of(before))));
  return fm_margin_of(before);
}

/// The margin `steps` steps ago. ring: steps + 1 margins; queue[0]: the place of the next one.
static inline struct fm_margin_now fm_margin_ago(
  struct fm_margin_kept * ring, int64_t * queue, int64_t steps, struct fm_margin_now now)
{
  ring[queue[0]] = fm_margin_copied(now);
  queue[0] = queue[0] < steps ? queue[0] + 1 : 0;
  return fm_margin_of(&ring[queue[0]]);
}

/// The greatest margin of this step and the `bound` before (van Herk, Gil and Werman). The ring is
/// filled again and again. Before that, each of its margins becomes the greatest of those from it
/// on, so that the places that are not filled yet have what the window still holds of before.
/// ring: bound + 2 margins, the last of which is the greatest of the filled places; queue[0]: how
/// many are filled.
static inline struct fm_margin_now fm_margin_within(
  struct fm_margin_kept * ring, int64_t * queue, int64_t bound, struct fm_margin_now now)
{
  struct fm_margin_kept * const newest = &ring[bound + 1];
  if (queue[0] > bound) {
    struct fm_margin_now greatest = fm_margin_of(&ring[bound]);
    for (int64_t k = bound - 1; k >= 0; --k) {
      greatest = fm_margin_greater(greatest, fm_margin_of(&ring[k]));
      ring[k] = fm_margin_copied(greatest);
    }
    queue[0] = 0;
    newest->rank = INT64_MIN;
  }
  ring[queue[0]] = fm_margin_copied(now);
  *newest = fm_margin_copied(fm_margin_greater(now, fm_margin_of(newest)));
  queue[0] += 1;
  return fm_margin_greater(fm_margin_of(newest), fm_margin_of(&ring[queue[0]]));
}

// ---- at ticks ----------------------------------------------------------------------------------

static inline bool fm_margin_differs(struct fm_margin_now a, struct fm_margin_now b)
{
  return a.rank != b.rank || a.decider->comparison != b.decider->comparison ||
         a.decider->instant != b.decider->instant;
}

/// The margin at the tick before, which is replaced. ring: 2 margins; queue[0]: the place of the
/// next one.
static inline struct fm_margin_now fm_margin_before_at(
  struct fm_margin_kept * ring, int64_t * queue, struct fm_margin_now now, int64_t tick,
  int64_t * next)
{
  const struct fm_margin_now found = fm_margin_ago(ring, queue, 1, now);
  fm_lower(next, fm_margin_differs(found, now), tick + 1);
  return found;
}

/// Queues of margins with ticks. queue[0]: the place of the oldest, queue[1]: their number,
/// queue[3]: how many found no room, queue[4 + place]: their ticks.
static inline int64_t fm_margin_place(const int64_t * queue, int64_t capacity, int64_t k)
{
  const int64_t place = queue[0] + k;
  return place < capacity ? place : place - capacity;
}

static inline void fm_margin_leave(int64_t * queue, int64_t capacity)
{
  queue[0] = fm_margin_place(queue, capacity, 1);
  queue[1] -= 1;
}

static inline void fm_margin_enter(
  struct fm_margin_kept * ring, int64_t * queue, int64_t capacity, struct fm_margin_now now,
  int64_t tick)
{
  if (queue[1] == capacity) {
    queue[3] += 1;
    fm_margin_leave(queue, capacity);
  }
  const int64_t place = fm_margin_place(queue, capacity, queue[1]);
  ring[place] = fm_margin_copied(now);
  queue[4 + place] = tick;
  queue[1] += 1;
}

/// The margin `past` ticks ago. The entries are margins, and the ticks from which they hold.
static inline struct fm_margin_now fm_margin_ago_at(
  struct fm_margin_kept * ring, int64_t * queue, int64_t capacity, int64_t past,
  struct fm_margin_now now, int64_t tick, int64_t * next)
{
  const int64_t newest = fm_margin_place(queue, capacity, queue[1] - (queue[1] > 0));
  while (queue[1] > 1 && queue[4 + fm_margin_place(queue, capacity, 1)] <= tick - past) {
    fm_margin_leave(queue, capacity);
  }
  if (queue[1] == 0 || fm_margin_differs(fm_margin_of(&ring[newest]), now)) {
    fm_margin_enter(ring, queue, capacity, now, tick);
  }
  const int64_t oldest = queue[4 + queue[0]];
  const bool is_there = oldest <= tick - past;
  fm_lower(next, !is_there, oldest + past);
  if (queue[1] > 1) {
    fm_lower(next, is_there, queue[4 + fm_margin_place(queue, capacity, 1)] + past);
  }
  return is_there ? fm_margin_of(&ring[queue[0]]) : fm_margin_certain(false);
}

/// The greatest margin of this tick and the `bound` before. The entries get less from the oldest
/// to the newest; each is the greatest of the ticks since the one before it. The tick of an entry
/// is the last one at which it held; the newest holds now.
static inline struct fm_margin_now fm_margin_within_at(
  struct fm_margin_kept * ring, int64_t * queue, int64_t capacity, int64_t bound,
  struct fm_margin_now now, int64_t tick, int64_t * next)
{
  if (queue[1] > 0) {
    queue[4 + fm_margin_place(queue, capacity, queue[1] - 1)] = tick - 1;
  }
  while (queue[1] > 0 && queue[4 + queue[0]] + bound < tick) {
    fm_margin_leave(queue, capacity);
  }
  while (queue[1] > 0 &&
    ring[fm_margin_place(queue, capacity, queue[1] - 1)].rank <= now.rank)
  {
    queue[1] -= 1;
  }
  fm_margin_enter(ring, queue, capacity, now, FM_NEVER);
  fm_lower(next, queue[1] > 1, queue[4 + queue[0]] + bound + 1);
  return fm_margin_of(&ring[queue[0]]);
}

#endif  // FRET_MARGINS_H_
