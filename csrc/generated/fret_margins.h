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
/// the other parts of a window know, too.
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

/// A margin of this step: its rank, and the kept margin whose instant and comparison decide it. So
/// a choice is between two words, and only what is kept is copied.
struct fm_margin_now
{
  int64_t rank;
  const struct fm_margin_kept * by;
};

static inline struct fm_margin_now fm_margin_not(struct fm_margin_now margin)
{
  margin.rank = ~margin.rank;
  return margin;
}

/// The rank of TRUE or FALSE.
static inline int64_t fm_margin_certain_rank(bool holds)
{
  const int64_t most = fm_margin_rank((double)INFINITY);
  return holds ? most : ~most;
}

/// The margin of TRUE or FALSE.
static inline struct fm_margin_now fm_margin_certain(bool holds)
{
  static const struct fm_margin_kept none = {0, 0, -1};
  return (struct fm_margin_now) {fm_margin_certain_rank(holds), &none};
}

static inline struct fm_margin_now fm_margin_of(const struct fm_margin_kept * kept)
{
  return (struct fm_margin_now) {kept->rank, kept};
}

/// Copied word by word: compilers like to move two words at once, for which a processor waits long
/// where it wrote them one by one.
static inline struct fm_margin_kept fm_margin_copy(struct fm_margin_now now)
{
  const volatile struct fm_margin_kept * const by = now.by;
  return (struct fm_margin_kept) {now.rank, by->instant, by->comparison};
}

static inline void fm_margin_keep(struct fm_margin_kept * kept, struct fm_margin_now now)
{
  const volatile struct fm_margin_kept * const by = now.by;
  volatile struct fm_margin_kept * const to = kept;
  to->rank = now.rank;
  to->instant = by->instant;
  to->comparison = by->comparison;
}

/// Margins of FALSE, with which the cells below start; their queues start as zeros.
static inline void fm_margins_reset(struct fm_margin_kept * margins, size_t n)
{
  for (size_t i = 0u; i < n; ++i) {
    fm_margin_keep(&margins[i], fm_margin_certain(false));
  }
}

/// The scale of the comparison that decides; scales: of those of a group, which begin at `first`.
static inline double fm_margin_scale(
  struct fm_margin_now margin, const double * scales, int64_t first)
{
  const int64_t comparison = margin.by->comparison;
  return scales[comparison < first ? 0 : comparison - first];
}

/// Write it as it is read from outside. `scale` is that of the comparison. Not known if it rests
/// on a queue in which something found no room.
static inline void fm_margin_show(
  struct fm_margin * shown, struct fm_margin_now margin, double scale, bool is_lost)
{
  const volatile struct fm_margin_kept * const by = margin.by;
  const double value = fm_margin_value(margin.rank) + 0.0;  // of a negation, -0.0 too
  const struct fm_margin unknown = {(double)NAN, (double)NAN, 0, -1};
  volatile struct fm_margin * const to = shown;
  to->value = value;
  to->distance = value * scale;
  to->instant = by->instant;
  to->comparison = by->comparison;
  if (is_lost) {
    *shown = unknown;
  }
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
  volatile struct fm_margin_kept * const to = kept;
  to->instant = instant;
  to->comparison = comparison;
  return (struct fm_margin_now) {fm_margin_rank(distance / scale), kept};
}

/// At a tick: its instant is the one since which it has its distance.
static inline struct fm_margin_now fm_margin_compared_at(
  struct fm_margin_kept * kept, double distance, double scale, int64_t instant,
  int64_t comparison)
{
  const int64_t rank = fm_margin_rank(distance / scale);
  if (kept->rank != rank || kept->comparison != comparison) {  // -1 before the first, of any rank
    *kept = (struct fm_margin_kept) {rank, instant, comparison};
  }
  return (struct fm_margin_now) {rank, kept};
}

// ---- formulas ----------------------------------------------------------------------------------

static inline int64_t fm_margin_word(int64_t a, int64_t b, bool is_second)
{
  const uint64_t mask = UINT64_C(0) - (uint64_t)is_second;
  return a ^ ((a ^ b) & (int64_t)mask);
}

/// What decides one of two margins, without a branch.
static inline const struct fm_margin_kept * fm_margin_by(
  struct fm_margin_now a, struct fm_margin_now b, bool is_second)
{
  const uintptr_t mask = (uintptr_t)0 - (uintptr_t)is_second;
  return (const struct fm_margin_kept *)(
    (uintptr_t)a.by ^ (((uintptr_t)a.by ^ (uintptr_t)b.by) & mask));
}

static inline struct fm_margin_now fm_margin_lesser(
  struct fm_margin_now a, struct fm_margin_now b)
{
  return (struct fm_margin_now) {
    b.rank < a.rank ? b.rank : a.rank, fm_margin_by(a, b, b.rank < a.rank)};
}

static inline struct fm_margin_now fm_margin_greater(
  struct fm_margin_now a, struct fm_margin_now b)
{
  return (struct fm_margin_now) {
    b.rank > a.rank ? b.rank : a.rank, fm_margin_by(a, b, b.rank > a.rank)};
}

/// O p: the greatest so far. By steps and by ticks.
static inline struct fm_margin_now fm_margin_ever(
  struct fm_margin_kept * before, struct fm_margin_now p)
{
  if (p.rank >= before->rank) {  // seldom
    fm_margin_keep(before, p);
  }
  return fm_margin_of(before);
}

/// p S q: the greatest q, each with the least p after it. By steps and by ticks.
static inline struct fm_margin_now fm_margin_since(
  struct fm_margin_kept * before, struct fm_margin_now p, struct fm_margin_now q)
{
  const struct fm_margin_now found =
    fm_margin_greater(q, fm_margin_lesser(p, fm_margin_of(before)));
  fm_margin_keep(before, found);
  return (struct fm_margin_now) {found.rank, before};
}

/// The margin `steps` steps ago. ring: steps + 1 margins; queue[0]: the place of the next one.
static inline struct fm_margin_now fm_margin_ago(
  struct fm_margin_kept * ring, int64_t * queue, int64_t steps, struct fm_margin_now now)
{
  fm_margin_keep(&ring[queue[0]], now);
  queue[0] = queue[0] < steps ? queue[0] + 1 : 0;
  return fm_margin_of(&ring[queue[0]]);
}

/// The greatest margin of this step and the `bound` before (van Herk, Gil and Werman). The ring is
/// filled again and again, from its end. Before that, each of its places gets that of the greatest
/// of those before it, which are later ones, for what the window still holds of them. ring:
/// bound + 1 margins; queue[0]: how many places are left to fill, queue[1]: the place of the
/// greatest of the others, queue[2]: its rank, queue[3 + k]: the place of the greatest of the last
/// k; for k = 0 that of the newest.
FM_INLINE struct fm_margin_now fm_margin_within(
  struct fm_margin_kept * ring, int64_t * queue, int64_t bound, struct fm_margin_now now)
{
  int64_t left = queue[0];
  int64_t before = queue[2];
  if (left == 0) {
    int64_t place = 0;
    int64_t rank = ring[0].rank;
    for (int64_t k = 1; k <= bound; ++k) {
      queue[3 + k] = place;
      const bool is_greater = ring[k].rank > rank;
      rank = is_greater ? ring[k].rank : rank;
      place = is_greater ? k : place;
    }
    left = bound + 1;
    before = INT64_MIN;
  }
  left -= 1;
  fm_margin_keep(&ring[left], now);
  const bool is_newest = now.rank >= before;
  const int64_t greatest = is_newest ? now.rank : before;
  const int64_t newest = fm_margin_word(queue[1], left, is_newest);
  queue[0] = left;
  queue[1] = newest;
  queue[2] = greatest;
  const int64_t older = queue[3 + left];
  const int64_t rank = ring[older].rank;
  return (struct fm_margin_now) {
    rank > greatest ? rank : greatest, &ring[fm_margin_word(newest, older, rank > greatest)]};
}

// ---- at ticks ----------------------------------------------------------------------------------

static inline bool fm_margin_differs(struct fm_margin_kept a, struct fm_margin_kept b)
{
  return a.rank != b.rank || a.comparison != b.comparison ||
         a.instant != b.instant;
}

/// The margin at the tick before, which is replaced. ring: 2 margins; queue[0]: the place of the
/// next one.
static inline struct fm_margin_now fm_margin_before_at(
  struct fm_margin_kept * ring, int64_t * queue, struct fm_margin_now now, int64_t tick,
  int64_t * next)
{
  const struct fm_margin_now found = fm_margin_ago(ring, queue, 1, now);
  fm_lower(next, fm_margin_differs(fm_margin_copy(found), fm_margin_copy(now)), tick + 1);
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

/// The margin `past` ticks ago. The entries are margins, and the ticks from which they hold.
static inline struct fm_margin_now fm_margin_ago_at(
  struct fm_margin_kept * ring, int64_t * queue, int64_t capacity, int64_t past,
  struct fm_margin_now now, int64_t tick, int64_t * next)
{
  const int64_t newest = fm_margin_place(queue, capacity, queue[1] - (queue[1] > 0));
  while (queue[1] > 1 && queue[4 + fm_margin_place(queue, capacity, 1)] <= tick - past) {
    fm_margin_leave(queue, capacity);
  }
  if (queue[1] == 0 || fm_margin_differs(ring[newest], fm_margin_copy(now))) {
    if (queue[1] == capacity) {
      queue[3] += 1;
      fm_margin_leave(queue, capacity);
    }
    const int64_t place = fm_margin_place(queue, capacity, queue[1]);
    fm_margin_keep(&ring[place], now);
    queue[4 + place] = tick;
    queue[1] += 1;
  }
  const int64_t oldest = queue[4 + queue[0]];
  const bool is_there = oldest <= tick - past;
  fm_lower(next, !is_there, oldest + past);
  if (queue[1] > 1) {
    fm_lower(next, is_there, queue[4 + fm_margin_place(queue, capacity, 1)] + past);
  }
  return is_there ? fm_margin_of(&ring[queue[0]]) : fm_margin_certain(false);
}

/// Words of the queue of a window at ticks. After them are the last ticks of the entries, one for
/// each place, and the places of those entries that are ahead.
enum
{
  FM_QUEUE_AHEAD = 0,   // how many are ahead
  FM_QUEUE_NEWEST = 1,  // the place of the newest entry, and its rank
  FM_QUEUE_NEWEST_RANK = 2,
  FM_QUEUE_LOST = 3,    // how many found no room
  FM_QUEUE_TURNED = 4,  // the place of the last entry before those behind
  FM_QUEUE_BEHIND = 5,  // of the greatest behind: its rank, its place, the tick at which it leaves
  FM_QUEUE_FIRST = 8,   // of the greatest ahead; it leaves at 0: none is ahead
  FM_QUEUE_HEAD = 11
};

/// Note the oldest of the entries ahead, which is the greatest of them.
static inline void fm_margin_note_first(
  const struct fm_margin_kept * ring, int64_t * queue, int64_t capacity, int64_t bound)
{
  const int64_t * const ticks = &queue[FM_QUEUE_HEAD];
  const int64_t n = queue[FM_QUEUE_AHEAD];
  const int64_t place = n > 0 ? ticks[capacity + n - 1] : -1;
  queue[FM_QUEUE_FIRST] = n > 0 ? ring[place].rank : INT64_MIN;
  queue[FM_QUEUE_FIRST + 1] = place;
  queue[FM_QUEUE_FIRST + 2] = n > 0 ? ticks[place] + bound + 1 : 0;
}

/// Let those entries ahead leave that ended before the window. If none is left, those behind are
/// ahead.
static inline void fm_margin_leave_at(
  const struct fm_margin_kept * ring, int64_t * queue, int64_t capacity, int64_t bound,
  int64_t tick)
{
  int64_t * const ticks = &queue[FM_QUEUE_HEAD];
  int64_t * const ahead = &ticks[capacity];
  int64_t n = queue[FM_QUEUE_AHEAD];
  while (n > 0 && ticks[ahead[n - 1]] + bound < tick) {
    n -= 1;
  }
  if (n == 0) {
    int64_t greatest = INT64_MIN;
    int64_t place = queue[FM_QUEUE_NEWEST];
    while (place != queue[FM_QUEUE_TURNED] && ticks[place] + bound >= tick) {
      const int64_t rank = ring[place].rank;
      const bool is_greater = rank > greatest;
      greatest = is_greater ? rank : greatest;
      ahead[n] = place;
      n += is_greater;
      place = (place > 0 ? place : capacity) - 1;
    }
    queue[FM_QUEUE_TURNED] = queue[FM_QUEUE_NEWEST];
    queue[FM_QUEUE_NEWEST_RANK] = INT64_MAX;
    queue[FM_QUEUE_BEHIND] = INT64_MIN;
  }
  queue[FM_QUEUE_AHEAD] = n;
  fm_margin_note_first(ring, queue, capacity, bound);
}

/// The greatest margin of this tick and the `bound` before (two stacks). Entries are margins that
/// followed each other; the newest holds now, and is replaced by one that is not less. The older
/// ones are ahead: of these such are known as are greater than all later ones ahead; the first is
/// the greatest. Of those behind, the greatest is known. When the last one ahead has left, those
/// behind are ahead.
FM_INLINE struct fm_margin_now fm_margin_within_at(
  struct fm_margin_kept * ring, int64_t * queue, int64_t capacity, int64_t bound,
  struct fm_margin_now now, int64_t tick, int64_t * next)
{
  int64_t newest = queue[FM_QUEUE_NEWEST];
  queue[FM_QUEUE_HEAD + newest] = tick - 1;
  if (queue[FM_QUEUE_FIRST + 2] <= tick) {
    fm_margin_leave_at(ring, queue, capacity, bound, tick);
  }
  newest += now.rank < queue[FM_QUEUE_NEWEST_RANK];
  newest = newest < capacity ? newest : 0;
  if (newest == queue[FM_QUEUE_FIRST + 1]) {
    queue[FM_QUEUE_LOST] += 1;
    queue[FM_QUEUE_AHEAD] -= 1;
    fm_margin_note_first(ring, queue, capacity, bound);
  }
  queue[FM_QUEUE_NEWEST] = newest;
  queue[FM_QUEUE_NEWEST_RANK] = now.rank;
  fm_margin_keep(&ring[newest], now);
  const int64_t before = queue[FM_QUEUE_BEHIND];
  const int64_t leaves = queue[FM_QUEUE_BEHIND + 2];
  const bool is_newest = now.rank >= before;
  const int64_t greatest = is_newest ? now.rank : before;
  queue[FM_QUEUE_BEHIND] = greatest;
  queue[FM_QUEUE_BEHIND + 1] = fm_margin_word(queue[FM_QUEUE_BEHIND + 1], newest, is_newest);
  queue[FM_QUEUE_BEHIND + 2] =
    (leaves < tick + bound ? leaves : tick + bound) | (-(int64_t)is_newest & FM_NEVER);
  const int64_t first = queue[FM_QUEUE_FIRST];
  const int64_t * const found = &queue[FM_QUEUE_BEHIND + 3 * (first > greatest)];
  *next = found[2] < *next ? found[2] : *next;
  return (struct fm_margin_now) {first > greatest ? first : greatest, &ring[found[1]]};
}

#endif  // FRET_MARGINS_H_
