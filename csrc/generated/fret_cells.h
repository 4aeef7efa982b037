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

/// fret_cells.h: the state cells and the arithmetic of generated monitors.
///
/// Contract: all functions are static inline, take O(1) time (a power: at most 64 rounds), do not
/// allocate or fail, and have no undefined behaviour for any argument. The caller owns the state
/// of a cell, initialises it as stated with the cell, and calls the cell exactly once in each
/// step; only the cell changes it. Any number of threads, if each has its own state. In comments p
/// and q are the arguments.
///
/// C99; floating point must be IEEE 754 without excess precision.

#ifndef FRET_CELLS_H_
#define FRET_CELLS_H_

#include <float.h>

#include "fret_monitor.h"

#if defined(FLT_EVAL_METHOD) && FLT_EVAL_METHOD != 0
#error "fret_monitor needs float arithmetic without excess precision (i386: -msse2 -mfpmath=sse)"
#endif
#if defined(__FAST_MATH__)
#error "fret_monitor needs IEEE 754 arithmetic, with NaN and infinities (leave out -ffast-math)"
#endif
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF  // gcc: -ffp-contract=off
#endif

/// Bit k of a word, k < 64.
static inline bool fm_bit(uint64_t word, unsigned k) {return ((word >> k) & 1u) != 0u;}

/// Counters. The state is one unsigned integer. The cells do not branch, because sensor values
/// make branches hard to predict.
///
/// The state of the first three is an age: the number of steps, at the next step, since an event.
/// An age above `bound` means that the event lies outside the window, or never happened. An age
/// saturates once its highest bit is set, so that `bound` must be below that bit's value.
/// once_within    O[0,bound] p. Event: p. Starts at bound + 1; if it starts at bound - m instead,
///                it is true up to step m (counted from 0) even without p.
/// always_within  H[0,bound] p. Event: !p. Starts at bound + 1; if it starts at bound - m instead,
///                it is false up to step m even without !p.
/// since_within   p S[0,bound] q. Event: q, with p at every later step. Starts at bound + 1.
///
/// The state of the last two is 1 + the number of steps since an event, at most bound + 1, which
/// the type must be able to hold; 0 means that there was none. Starts at 0.
/// once_before    O[bound,inf) p. Event: the first p.
/// since_before   p S[bound,inf) q. Event: the oldest q with p at every later step.
#define FM_COUNTER_CELLS(suffix, type) \
  static inline type fm_ones_if_ ## suffix(bool p) \
  { \
    return (type)(0u - (unsigned)p); \
  } \
  static inline type fm_older_ ## suffix(type age) \
  { \
    return (type)(age + 1u - (age >> (8u * sizeof(type) - 1u))); \
  } \
  static inline bool fm_once_within_ ## suffix(type * next, type bound, bool p) \
  { \
    const type age = (type)(*next & fm_ones_if_ ## suffix(!p)); \
    *next = fm_older_ ## suffix(age); \
    return age <= bound; \
  } \
  static inline bool fm_always_within_ ## suffix(type * next, type bound, bool p) \
  { \
    const type age = (type)(*next & fm_ones_if_ ## suffix(p)); \
    *next = fm_older_ ## suffix(age); \
    return age > bound; \
  } \
  static inline bool fm_since_within_ ## suffix(type * next, type bound, bool p, bool q) \
  { \
    const type kept = (type)(*next | fm_ones_if_ ## suffix(!p)); \
    const type age = (type)(kept & fm_ones_if_ ## suffix(!q)); \
    *next = fm_older_ ## suffix(age); \
    return age <= bound; \
  } \
  static inline bool fm_once_before_ ## suffix(type * counter, type bound, bool p) \
  { \
    const type before = *counter; \
    *counter = (type)(before + (((before != 0u) | p) & (before <= bound))); \
    return *counter > bound; \
  } \
  static inline bool fm_since_before_ ## suffix(type * counter, type bound, bool p, bool q) \
  { \
    const type before = (type)(*counter & fm_ones_if_ ## suffix(p)); \
    *counter = (type)(before + (((before != 0u) | q) & (before <= bound))); \
    return *counter > bound; \
  }

FM_COUNTER_CELLS(u8, uint8_t)
FM_COUNTER_CELLS(u16, uint16_t)
FM_COUNTER_CELLS(u32, uint32_t)

/// Shift registers: return p of `steps` steps ago, 1 < steps <= bits of the type. The state is one
/// unsigned integer. Its lowest `steps` bits start as the values to return in the first `steps`
/// steps, the highest of them first.
#define FM_LINE_CELL(suffix, type) \
  static inline bool fm_delay_ ## suffix(type * line, unsigned steps, bool p) \
  { \
    const bool out = fm_bit(*line, steps - 1u); \
    *line = (type)(((uint64_t)*line << 1) | (uint64_t)p); \
    return out; \
  }

FM_LINE_CELL(u8, uint8_t)
FM_LINE_CELL(u16, uint16_t)
FM_LINE_CELL(u32, uint32_t)
FM_LINE_CELL(u64, uint64_t)

/// A ring of bits: returns the bit at `position` and replaces it by p. The state is an array of
/// (length + 7) / 8 bytes, all 0 or all 255 at the start; position < length.
static inline bool fm_delay_ring(uint8_t * ring, uint32_t position, bool p)
{
  uint8_t * const byte = &ring[position >> 3];
  const unsigned k = position & 7u;
  const bool out = fm_bit(*byte, k);
  *byte = (uint8_t)((*byte & ~(1u << k)) | ((unsigned)p << k));
  return out;
}

/// The position for the next step; rings of the same length share it. Starts at 0.
static inline uint32_t fm_next_position(uint32_t position, uint32_t length)
{
  return position + 1u == length ? 0u : position + 1u;
}

/// The signed number that 64 bits of two's complement represent. A cast of a number above
/// INT64_MAX would be implementation-defined.
static inline int64_t fm_signed(uint64_t bits)
{
  return bits <= (uint64_t)INT64_MAX ? (int64_t)bits : -(int64_t)(~bits) - 1;
}

/// How often p held in a window: the state is a count, `in` is p now, and `out` is p at the step
/// that leaves the window. Starts at 0.
static inline int64_t fm_tally(int64_t * count, bool in, bool out)
{
  *count = fm_signed((uint64_t)*count + (uint64_t)in - (uint64_t)out);
  return *count;
}

/// Cells of groups that step at ticks (fm_group.step_at). Between two steps the arguments of a
/// cell stay as they were at the first of them. `tick` is that of this step; each cell lowers
/// `*next` to the next tick at which its result can change although its arguments stay. No tick is
/// above FM_LAST_TICK, and no bound above 2^62.
static inline int64_t fm_choice(bool condition, int64_t yes, int64_t no)
{
  const uint64_t ones_if = 0u - (uint64_t)condition;  // no branch, as for the counters
  return fm_signed((uint64_t)no ^ (((uint64_t)yes ^ (uint64_t)no) & ones_if));
}

static inline void fm_lower(int64_t * next, bool is_due, int64_t tick)
{
  *next = fm_choice(is_due & (tick < *next), tick, *next);
}

/// The state of these is the last tick at which the result is true (always_within: false) if the
/// arguments change at the next tick: FM_NEVER while the event lasts (once_within: p;
/// always_within: !p; since_within: q). Starts at head - 1, for the results of the first `head`
/// ticks; since_within at -1.
static inline bool fm_once_within_at(
  int64_t * last, int64_t bound, bool p, int64_t tick, int64_t * next)
{
  const int64_t kept = fm_choice(*last == FM_NEVER, tick - 1 + bound, *last);
  *last = fm_choice(p, FM_NEVER, kept);
  const bool out = p | (kept >= tick);
  fm_lower(next, out & !p, kept + 1);
  return out;
}

static inline bool fm_always_within_at(
  int64_t * last, int64_t bound, bool p, int64_t tick, int64_t * next)
{
  return !fm_once_within_at(last, bound, !p, tick, next);
}

static inline bool fm_since_within_at(
  int64_t * last, int64_t bound, bool p, bool q, int64_t tick, int64_t * next)
{
  const int64_t before = fm_choice(*last == FM_NEVER, tick - 1 + bound, *last);
  const int64_t kept = fm_choice(p, before, -1);
  *last = fm_choice(q, FM_NEVER, kept);
  const bool out = q | (kept >= tick);
  fm_lower(next, out & !q, kept + 1);
  return out;
}

/// The state of the last two is the first tick at which the result is true. Starts at FM_NEVER.
/// While q holds and p does not, every tick is the oldest q: FM_NEVER - 1.
static inline bool fm_since_before_at(
  int64_t * first, int64_t bound, bool p, bool q, int64_t tick, int64_t * next)
{
  const int64_t kept = fm_choice(*first == FM_NEVER - 1, tick - 1 + bound, *first);
  const int64_t begun = fm_choice((kept == FM_NEVER) & q, tick + bound, kept);
  *first = fm_choice(p, begun, FM_NEVER - (int64_t)q);
  const bool out = p & (begun <= tick);
  fm_lower(next, p & (begun > tick), begun);
  return out;
}

static inline bool fm_once_before_at(
  int64_t * first, int64_t bound, bool p, int64_t tick, int64_t * next)
{
  return fm_since_before_at(first, bound, true, p, tick, next);
}

/// p S[low,high] q, 0 < low <= high: a queue of the intervals of ticks at which it is true if p
/// lasts. queue[0]: the index of the oldest; queue[1]: how many; queue[2]: the last tick at which
/// an interval that did not fit is missed; queue[3]: how many did not fit. Then the first and last
/// tick of each, for `capacity` intervals. The newest ends at FM_NEVER while q lasts; it begins at
/// FM_NEVER - 1 while p does not hold, so that every tick is the oldest q. All 0 at the start.
/// With a capacity of high / (high - low + 2) + 1 everything fits.
static inline int64_t * fm_interval(int64_t * queue, int64_t capacity, int64_t number)
{
  const int64_t place = queue[0] + number;
  return &queue[4 + 2 * (place < capacity ? place : place - capacity)];
}

static inline void fm_drop_oldest(int64_t * queue, int64_t capacity)
{
  queue[0] = queue[0] + 1 < capacity ? queue[0] + 1 : 0;
  queue[1] -= 1;
}

static inline void fm_add_interval(
  int64_t * queue, int64_t capacity, int64_t begin)
{
  if (queue[1] == capacity) {
    queue[2] = fm_interval(queue, capacity, 0)[1];
    queue[3] += 1;
    fm_drop_oldest(queue, capacity);
  }
  int64_t * const added = fm_interval(queue, capacity, queue[1]);
  added[0] = begin;
  added[1] = FM_NEVER;
  queue[1] += 1;
}

static inline bool fm_since_between_at(
  int64_t * queue, int64_t capacity, int64_t low, int64_t high, bool p, bool q, int64_t tick,
  int64_t * next)
{
  if (queue[1] > 0) {
    int64_t * const newest = fm_interval(queue, capacity, queue[1] - 1);
    newest[0] = newest[0] == FM_NEVER - 1 ? tick - 1 + low : newest[0];
    newest[1] = newest[1] == FM_NEVER && !q ? tick - 1 + high : newest[1];
    const int64_t * const oldest = fm_interval(queue, capacity, 0);
    if (oldest[1] < tick) {
      fm_drop_oldest(queue, capacity);
    }
  }
  queue[1] = p ? queue[1] : 0;
  if (q) {
    int64_t * const newest =
      queue[1] > 0 ? fm_interval(queue, capacity, queue[1] - 1) : NULL;
    if (newest != NULL && newest[1] >= tick + low - 1) {
      newest[1] = FM_NEVER;  // lasts, or the next result follows without a gap
    } else {
      fm_add_interval(queue, capacity, p ? tick + low : FM_NEVER - 1);
    }
  }
  if (queue[1] == 0) {
    return false;
  }
  const int64_t * const oldest = fm_interval(queue, capacity, 0);
  const bool out = oldest[0] <= tick;
  if (out && oldest[1] != FM_NEVER) {
    fm_lower(next, true, oldest[1] + 1);
  }
  fm_lower(next, !out && oldest[0] != FM_NEVER - 1, oldest[0]);
  return out;
}

/// Whether the queue may lack an interval at this tick.
static inline bool fm_overflowed_at(const int64_t * queue, int64_t tick, int64_t * next)
{
  fm_lower(next, tick <= queue[2] && queue[2] > 0, queue[2] + 1);
  return queue[2] > 0 && tick <= queue[2];
}

/// Whether two numbers are the same bits, so that no operation tells them apart.
static inline bool fm_same_f32(float a, float b)
{
  const union {float number; uint32_t bits;} x = {a}, y = {b};
  return x.bits == y.bits;
}

static inline bool fm_same_f64(double a, double b)
{
  const union {double number; uint64_t bits;} x = {a}, y = {b};
  return x.bits == y.bits;
}

/// Integers wrap at 64 bits; x / 0 and x mod 0 are 0; division truncates, mod has the sign of the
/// dividend; INT64_MIN / -1 wraps to INT64_MIN.
static inline int64_t fm_add_i64(int64_t a, int64_t b)
{
  return fm_signed((uint64_t)a + (uint64_t)b);
}

static inline int64_t fm_sub_i64(int64_t a, int64_t b)
{
  return fm_signed((uint64_t)a - (uint64_t)b);
}

static inline int64_t fm_mul_i64(int64_t a, int64_t b)
{
  return fm_signed((uint64_t)a * (uint64_t)b);
}

static inline int64_t fm_neg_i64(int64_t a) {return fm_signed(0u - (uint64_t)a);}

static inline int64_t fm_abs_i64(int64_t a) {return a >= 0 ? a : fm_neg_i64(a);}

static inline int64_t fm_div_i64(int64_t a, int64_t b)
{
  if (b == 0) {
    return 0;
  }
  return b == -1 ? fm_neg_i64(a) : a / b;
}

static inline int64_t fm_mod_i64(int64_t a, int64_t b)
{
  return (b == 0 || b == -1) ? 0 : a % b;
}

static inline uint64_t fm_add_u64(uint64_t a, uint64_t b) {return a + b;}
static inline uint64_t fm_sub_u64(uint64_t a, uint64_t b) {return a - b;}
static inline uint64_t fm_mul_u64(uint64_t a, uint64_t b) {return a * b;}
static inline uint64_t fm_neg_u64(uint64_t a) {return 0u - a;}
static inline uint64_t fm_abs_u64(uint64_t a) {return a;}
static inline uint64_t fm_div_u64(uint64_t a, uint64_t b) {return b == 0u ? 0u : a / b;}
static inline uint64_t fm_mod_u64(uint64_t a, uint64_t b) {return b == 0u ? 0u : a % b;}

/// As in math.h, which takes a compiler longer to read than a small module: only a module that
/// needs more of it includes it. In C++ its declarations have more to them.
#ifdef __cplusplus
#include <math.h>
#else
float fmodf(float a, float b);
double fmod(double a, double b);
#endif

static inline float fm_mod_f32(float a, float b) {return fmodf(a, b);}
static inline double fm_mod_f64(double a, double b) {return fmod(a, b);}
static inline float fm_abs_f32(float a) {return a >= 0.0f ? a : -a;}
static inline double fm_abs_f64(double a) {return a >= 0.0 ? a : -a;}
static inline float fm_mul_f32(float a, float b) {return a * b;}
static inline double fm_mul_f64(double a, double b) {return a * b;}

/// min and max give the second operand where one is NaN, as FRET's Lustre does; a power is
/// repeated multiplication by squaring (x^0 is 1).
#define FM_NUMBER_FUNCTIONS(suffix, type) \
  static inline type fm_min_ ## suffix(type a, type b) {return a <= b ? a : b;} \
  static inline type fm_max_ ## suffix(type a, type b) {return a >= b ? a : b;} \
  static inline type fm_power_ ## suffix(type base, uint64_t exponent) \
  { \
    type result = (type)1; \
    for (unsigned round = 0u; round < 64u && exponent != 0u; ++round) { \
      if ((exponent & 1u) != 0u) { \
        result = fm_mul_ ## suffix(result, base); \
      } \
      exponent >>= 1; \
      base = fm_mul_ ## suffix(base, base); \
    } \
    return result; \
  }

FM_NUMBER_FUNCTIONS(i64, int64_t)
FM_NUMBER_FUNCTIONS(u64, uint64_t)
FM_NUMBER_FUNCTIONS(f32, float)
FM_NUMBER_FUNCTIONS(f64, double)

/// Compare a signed number a and an unsigned number b by value.
static inline bool fm_less_iu(int64_t a, uint64_t b) {return a < 0 || (uint64_t)a < b;}
static inline bool fm_less_ui(uint64_t b, int64_t a) {return a > 0 && b < (uint64_t)a;}
static inline bool fm_equal_iu(int64_t a, uint64_t b) {return a >= 0 && (uint64_t)a == b;}

#endif  // FRET_CELLS_H_
