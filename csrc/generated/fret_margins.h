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
/// cell compares margins by their value alone; of equal ones it keeps either.
///
/// Contract: all functions are static inline, do not allocate or fail, and have no undefined
/// behaviour for margins that are no NaN. The caller owns the state of a cell, initialises it as
/// stated with the cell, and calls the cell exactly once in each step; only the cell changes it.
/// O(1), but fm_margin_within: O(1) amortised, at most O(capacity). Any number of threads, if each
/// has its own state.
///
/// C99.

#ifndef FRET_MARGINS_H_
#define FRET_MARGINS_H_

#include <math.h>

#include "fret_cells.h"

/// The margin of TRUE; that of FALSE is its negation.
static inline struct fm_margin fm_margin_of_true(void)
{
  const struct fm_margin margin = {(double)INFINITY, (double)INFINITY, 0, -1};
  return margin;
}

static inline struct fm_margin fm_margin_not(struct fm_margin margin)
{
  margin.value = -margin.value;
  margin.distance = -margin.distance;
  return margin;
}

static inline struct fm_margin fm_margin_certain(bool holds)
{
  return holds ? fm_margin_of_true() : fm_margin_not(fm_margin_of_true());
}

static inline struct fm_margin fm_margin_made(
  double distance, double scale, int64_t instant, int64_t comparison)
{
  const struct fm_margin margin = {distance / scale, distance, instant, comparison};
  return margin;
}

/// left <= right, and left < right, which is worth the same. With a NaN it is false.
static inline struct fm_margin fm_margin_at_most(
  double left, double right, double scale, int64_t instant, int64_t comparison)
{
  const double distance = left == right ? 0.0 : right - left;
  return fm_margin_made(
    isnan(distance) ? -(double)INFINITY : distance, scale, instant, comparison);
}

/// left = right. With a NaN it is false.
static inline struct fm_margin fm_margin_equal(
  double left, double right, double scale, int64_t instant, int64_t comparison)
{
  const double distance = left == right ? 0.0 : fabs(right - left);
  return fm_margin_made(
    isnan(distance) ? -(double)INFINITY : -distance, scale, instant, comparison);
}

/// left != right. With a NaN it is true.
static inline struct fm_margin fm_margin_unequal(
  double left, double right, double scale, int64_t instant, int64_t comparison)
{
  return fm_margin_not(fm_margin_equal(left, right, scale, instant, comparison));
}

static inline struct fm_margin fm_margin_lesser(struct fm_margin a, struct fm_margin b)
{
  return b.value < a.value ? b : a;
}

static inline struct fm_margin fm_margin_greater(struct fm_margin a, struct fm_margin b)
{
  return b.value > a.value ? b : a;
}

static inline bool fm_margin_differs(struct fm_margin a, struct fm_margin b)
{
  return a.value < b.value || a.value > b.value || a.comparison != b.comparison ||
         a.instant != b.instant;
}

/// Margins of FALSE, with which the cells below start; their queues start as zeros.
static inline void fm_margins_reset(struct fm_margin * margins, size_t n)
{
  for (size_t i = 0u; i < n; ++i) {
    margins[i] = fm_margin_certain(false);
  }
}

/// The margin of a comparison at a tick: its instant is the one since which it has its distance.
static inline struct fm_margin fm_margin_lasting(struct fm_margin * kept, struct fm_margin now)
{
  const bool is_same = kept->comparison == now.comparison &&
    !(kept->distance < now.distance || kept->distance > now.distance);
  *kept = is_same ? *kept : now;
  return *kept;
}

/// p S q: the greatest q, each with the least p after it. By steps and by ticks.
static inline struct fm_margin fm_margin_since(
  struct fm_margin * before, struct fm_margin p, struct fm_margin q)
{
  *before = fm_margin_greater(q, fm_margin_lesser(p, *before));
  return *before;
}

/// The margin at the step before, which is replaced.
static inline struct fm_margin fm_margin_before(struct fm_margin * before, struct fm_margin now)
{
  const struct fm_margin found = *before;
  *before = now;
  return found;
}

/// The same at the tick before.
static inline struct fm_margin fm_margin_before_at(
  struct fm_margin * before, struct fm_margin now, int64_t tick, int64_t * next)
{
  const struct fm_margin found = fm_margin_before(before, now);
  fm_lower(next, fm_margin_differs(found, now), tick + 1);
  return found;
}

/// The margin `steps` steps ago. ring: `steps` margins; queue[0]: the place of the oldest.
static inline struct fm_margin fm_margin_ago(
  struct fm_margin * ring, int64_t * queue, int64_t steps, struct fm_margin now)
{
  const struct fm_margin found = ring[queue[0]];
  ring[queue[0]] = now;
  queue[0] = queue[0] + 1 < steps ? queue[0] + 1 : 0;
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
  struct fm_margin * ring, int64_t * queue, int64_t capacity, struct fm_margin now, int64_t tick)
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
static inline struct fm_margin fm_margin_ago_at(
  struct fm_margin * ring, int64_t * queue, int64_t capacity, int64_t past, struct fm_margin now,
  int64_t tick, int64_t * next)
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

// Let a margin take the place of those that it is not less than.
static inline void fm_margin_push(
  struct fm_margin * ring, int64_t * queue, int64_t capacity, struct fm_margin now, int64_t tick)
{
  while (queue[1] > 0 &&
    ring[fm_margin_place(queue, capacity, queue[1] - 1)].value <= now.value)
  {
    queue[1] -= 1;
  }
  fm_margin_enter(ring, queue, capacity, now, tick);
}

/// The greatest margin of this step and the `bound` before. The entries get less from the oldest
/// to the newest; each is the greatest of the steps since the one before it. capacity: bound + 1.
/// queue[2]: the number of the step.
static inline struct fm_margin fm_margin_within(
  struct fm_margin * ring, int64_t * queue, int64_t bound, struct fm_margin now)
{
  const int64_t step = queue[2];
  if (queue[1] > 0 && queue[4 + queue[0]] + bound < step) {
    fm_margin_leave(queue, bound + 1);
  }
  fm_margin_push(ring, queue, bound + 1, now, step);
  queue[2] = step + 1;
  return ring[queue[0]];
}

/// The same by ticks. The tick of an entry is the last one at which it held; the newest holds now.
static inline struct fm_margin fm_margin_within_at(
  struct fm_margin * ring, int64_t * queue, int64_t capacity, int64_t bound, struct fm_margin now,
  int64_t tick, int64_t * next)
{
  if (queue[1] > 0) {
    queue[4 + fm_margin_place(queue, capacity, queue[1] - 1)] = tick - 1;
  }
  while (queue[1] > 0 && queue[4 + queue[0]] + bound < tick) {
    fm_margin_leave(queue, capacity);
  }
  fm_margin_push(ring, queue, capacity, now, FM_NEVER);
  fm_lower(next, queue[1] > 1, queue[4 + queue[0]] + bound + 1);
  return ring[queue[0]];
}

/// A margin that rests on a queue in which something found no room: not known.
static inline void fm_margin_unless_lost(struct fm_margin * margin, bool is_lost)
{
  if (is_lost) {
    margin->value = (double)NAN;
    margin->distance = (double)NAN;
    margin->comparison = -1;
  }
}

#endif  // FRET_MARGINS_H_
