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
/// the other parts of a window know, too. Margins are passed by value, so that those of a step
/// alone stay in registers.
///
/// Contract: all functions are static inline, do not allocate or fail, and have no undefined
/// behaviour for distances that are no NaN. The caller owns the state of a cell, initialises it
/// with fm_margins_reset, and calls the cell exactly once in each step; only the cell changes it.
/// O(1), but windows: O(1) amortised, at most O(capacity). Any number of threads, if each has its
/// own state.
///
/// C99.

#ifndef FRET_MARGINS_H_
#define FRET_MARGINS_H_

#include <math.h>
#include <string.h>

#include "fret_cells.h"

/// The bits of a number as a rank, or a rank as bits. Ranks have the order of the numbers, and are
/// compared without a branch; ~rank is that of the negation. Neither this nor a choice of margins
/// has a branch, which could not be predicted.
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

static inline struct fm_margin_kept fm_margin_not(struct fm_margin_kept margin)
{
  margin.rank = ~margin.rank;
  return margin;
}

/// Read word by word, as a step has written it: a processor waits long for what it wrote in other
/// pieces, and compilers like to read two words at once.
static inline struct fm_margin_kept fm_margin_read(const struct fm_margin_kept * kept)
{
  const volatile struct fm_margin_kept * const words = kept;
  return (struct fm_margin_kept) {words->rank, words->instant, words->comparison};
}

/// The margin of TRUE or FALSE.
static inline struct fm_margin_kept fm_margin_certain(bool holds)
{
  const int64_t most = fm_margin_rank((double)INFINITY);
  return (struct fm_margin_kept) {holds ? most : ~most, 0, -1};
}

/// Margins of FALSE, with which the cells below start; their queues start as zeros.
static inline void fm_margins_reset(struct fm_margin_kept * margins, size_t n)
{
  for (size_t i = 0u; i < n; ++i) {
    margins[i] = fm_margin_certain(false);
  }
}

/// The scale of the comparison that decides; scales: of those of a group, which begin at `first`.
static inline double fm_margin_scale(
  struct fm_margin_kept margin, const double * scales, int64_t first)
{
  return scales[margin.comparison < first ? 0 : margin.comparison - first];
}

/// As it is read from outside. `scale` is that of the comparison. Not known if it rests on a queue
/// in which something found no room.
static inline struct fm_margin fm_margin_shown(
  struct fm_margin_kept margin, double scale, bool is_lost)
{
  const double value = fm_margin_value(margin.rank);
  const struct fm_margin known = {
    value, value * scale, margin.instant, margin.comparison};
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
static inline struct fm_margin_kept fm_margin_compared(
  double distance, double scale, int64_t instant, int64_t comparison)
{
  return (struct fm_margin_kept) {fm_margin_rank(distance / scale), instant, comparison};
}

/// At a tick: its instant is the one since which it has its distance.
static inline struct fm_margin_kept fm_margin_compared_at(
  struct fm_margin_kept * before, double distance, double scale, int64_t instant,
  int64_t comparison)
{
  const int64_t rank = fm_margin_rank(distance / scale);
  if (before->rank != rank || before->comparison != comparison) {
    *before = (struct fm_margin_kept) {rank, instant, comparison};
  }
  return *before;
}

// ---- formulas ----------------------------------------------------------------------------------

static inline int64_t fm_margin_word(int64_t a, int64_t b, bool is_second)
{
  const uint64_t mask = UINT64_C(0) - (uint64_t)is_second;
  return a ^ ((a ^ b) & (int64_t)mask);
}

static inline struct fm_margin_kept fm_margin_chosen(
  struct fm_margin_kept a, struct fm_margin_kept b, bool is_second)
{
  return (struct fm_margin_kept) {
    fm_margin_word(a.rank, b.rank, is_second), fm_margin_word(a.instant, b.instant, is_second),
    fm_margin_word(a.comparison, b.comparison, is_second)};
}

static inline struct fm_margin_kept fm_margin_lesser(
  struct fm_margin_kept a, struct fm_margin_kept b)
{
  return fm_margin_chosen(a, b, b.rank < a.rank);
}

static inline struct fm_margin_kept fm_margin_greater(
  struct fm_margin_kept a, struct fm_margin_kept b)
{
  return fm_margin_chosen(a, b, b.rank > a.rank);
}

/// O p: the greatest so far. By steps and by ticks.
static inline struct fm_margin_kept fm_margin_ever(
  struct fm_margin_kept * before, struct fm_margin_kept p)
{
  if (p.rank >= before->rank) {  // seldom
    *before = p;
  }
  return fm_margin_read(before);
}

/// p S q: the greatest q, each with the least p after it. By steps and by ticks.
static inline struct fm_margin_kept fm_margin_since(
  struct fm_margin_kept * before, struct fm_margin_kept p, struct fm_margin_kept q)
{
  *before = fm_margin_greater(q, fm_margin_lesser(p, fm_margin_read(before)));
  return fm_margin_read(before);
}

/// The margin `steps` steps ago. ring: steps + 1 margins; queue[0]: the place of the next one.
static inline struct fm_margin_kept fm_margin_ago(
  struct fm_margin_kept * ring, int64_t * queue, int64_t steps, struct fm_margin_kept now)
{
  ring[queue[0]] = now;
  queue[0] = queue[0] < steps ? queue[0] + 1 : 0;
  return fm_margin_read(&ring[queue[0]]);
}

/// The greatest margin of this step and the `bound` before (van Herk, Gil and Werman). The ring is
/// filled again and again. Before that, each of its places gets the place of the greatest of those
/// from it on, for what the window still holds of before. ring: bound + 1 margins; queue[0]: how
/// many are filled, queue[1]: the place of the greatest of these, queue[2 + k]: that of the
/// greatest of before, from k on.
static inline struct fm_margin_kept fm_margin_within(
  struct fm_margin_kept * ring, int64_t * queue, int64_t bound, struct fm_margin_kept now)
{
  int64_t filled = queue[0];
  int64_t newest = queue[1];
  if (filled > bound) {
    int64_t greatest = bound;
    int64_t rank = ring[bound].rank;
    for (int64_t k = bound; k > 0; --k) {
      const bool is_greater = ring[k].rank > rank;
      rank = is_greater ? ring[k].rank : rank;
      greatest = is_greater ? k : greatest;
      queue[2 + k] = greatest;
    }
    filled = 0;
    newest = 0;
  }
  ring[filled] = now;
  const int64_t rank = ring[newest].rank;
  const bool is_newest = now.rank >= rank;
  const int64_t greatest = fm_margin_word(rank, now.rank, is_newest);
  newest = fm_margin_word(newest, filled, is_newest);
  filled += 1;
  queue[0] = filled;
  queue[1] = newest;
  const int64_t before = filled > bound ? newest : queue[2 + filled];
  return fm_margin_read(
    &ring[fm_margin_word(newest, before, ring[before].rank > greatest)]);
}

// ---- at ticks ----------------------------------------------------------------------------------

static inline bool fm_margin_differs(struct fm_margin_kept a, struct fm_margin_kept b)
{
  return a.rank != b.rank || a.comparison != b.comparison ||
         a.instant != b.instant;
}

/// The margin at the tick before, which is replaced. ring: 2 margins; queue[0]: the place of the
/// next one.
static inline struct fm_margin_kept fm_margin_before_at(
  struct fm_margin_kept * ring, int64_t * queue, struct fm_margin_kept now, int64_t tick,
  int64_t * next)
{
  const struct fm_margin_kept found = fm_margin_ago(ring, queue, 1, now);
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
  struct fm_margin_kept * ring, int64_t * queue, int64_t capacity, struct fm_margin_kept now,
  int64_t tick)
{
  if (queue[1] == capacity) {
    queue[3] += 1;
    fm_margin_leave(queue, capacity);
  }
  const int64_t place = fm_margin_place(queue, capacity, queue[1]);
  ring[place] = now;
  queue[4 + place] = tick;
  queue[1] += 1;
}

/// The margin `past` ticks ago. The entries are margins, and the ticks from which they hold.
static inline struct fm_margin_kept fm_margin_ago_at(
  struct fm_margin_kept * ring, int64_t * queue, int64_t capacity, int64_t past,
  struct fm_margin_kept now, int64_t tick, int64_t * next)
{
  const int64_t newest = fm_margin_place(queue, capacity, queue[1] - (queue[1] > 0));
  while (queue[1] > 1 && queue[4 + fm_margin_place(queue, capacity, 1)] <= tick - past) {
    fm_margin_leave(queue, capacity);
  }
  if (queue[1] == 0 || fm_margin_differs(ring[newest], now)) {
    fm_margin_enter(ring, queue, capacity, now, tick);
  }
  const int64_t oldest = queue[4 + queue[0]];
  const bool is_there = oldest <= tick - past;
  fm_lower(next, !is_there, oldest + past);
  if (queue[1] > 1) {
    fm_lower(next, is_there, queue[4 + fm_margin_place(queue, capacity, 1)] + past);
  }
  return is_there ? ring[queue[0]] : fm_margin_certain(false);
}

/// The greatest margin of this tick and the `bound` before. The entries get less from the oldest
/// to the newest; each is the greatest of the ticks since the one before it. The tick of an entry
/// is the last one at which it held; the newest holds now.
static inline struct fm_margin_kept fm_margin_within_at(
  struct fm_margin_kept * ring, int64_t * queue, int64_t capacity, int64_t bound,
  struct fm_margin_kept now, int64_t tick, int64_t * next)
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
  if (queue[1] > 1) {  // the tick of the newest is no number to add to
    fm_lower(next, true, queue[4 + queue[0]] + bound + 1);
  }
  return ring[queue[0]];
}

#endif  // FRET_MARGINS_H_
