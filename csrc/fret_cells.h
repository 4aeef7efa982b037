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

/// fret_cells.h: the state cells and the arithmetic that generated monitors stand on.
///
/// Contract for all of it: static inline, O(1) time (a power: at most 64 rounds), no loop without
/// a fixed bound, no allocation, no failure, no undefined behaviour for any argument. A cell's
/// state is owned by the caller, changed by nobody else, and starts as each cell says; a cell is
/// called exactly once a step. In comments t is the current step and p, q are the arguments.
///
/// C99; the numbers need IEEE 754 and no excess precision.

#ifndef FRET_CELLS_H_
#define FRET_CELLS_H_

#include <float.h>
#include <math.h>

#include "fret_monitor.h"

#if defined(FLT_EVAL_METHOD) && FLT_EVAL_METHOD != 0
#error "fret_monitor needs float arithmetic without excess precision (on i386: -msse2 -mfpmath=sse)"
#endif
#if defined(__FAST_MATH__)
#error "fret_monitor needs IEEE 754 arithmetic, with NaN and infinities (leave out -ffast-math)"
#endif
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF  // gcc: -ffp-contract=off
#endif

/// Bit k of a word, k < 64.
static inline bool fm_bit(uint64_t word, unsigned k) {return ((word >> k) & 1u) != 0u;}

/// Counters. The state is one unsigned integer. No cell branches: what a robot measures is hard to
/// predict.
///
/// The first three keep what the age of something will be at the next step; any number above
/// bound is never. Ages stop where the highest bit is set: bound is less than that. The last two
/// need an integer that can hold bound + 1.
/// once_within    O[0,bound] p: the age is the steps since the last p; starts at bound + 1, and
///                true until step m without any p from bound - m.
/// always_within  H[0,bound] p: the age is the steps since the last !p; starts likewise.
/// since_within   p S[0,bound] q: the age is the steps since the last q that p has held after;
///                starts at bound + 1.
/// once_before    O[bound,inf) p: 1 + the steps since the first p, up to bound + 1; 0 is never,
///                and the start.
/// since_before   p S[bound,inf) q: 1 + the steps since the oldest q that p has held after; 0 is
///                none, and the start.
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

/// Shift registers: p of `steps` steps ago, 1 < steps <= the bits of the type. The state is one
/// unsigned integer whose lowest `steps` bits start as what is to be seen before there is a p.
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

/// A ring of bits: returns the bit at `position` and puts p there. The state is an array of
/// (length + 7) / 8 bytes, all 0 or all 255 at the start; position < length.
static inline bool fm_delay_ring(uint8_t * ring, uint32_t position, bool p)
{
  uint8_t * const byte = &ring[position >> 3];
  const unsigned k = position & 7u;
  const bool out = fm_bit(*byte, k);
  *byte = (uint8_t)((*byte & ~(1u << k)) | ((unsigned)p << k));
  return out;
}

/// The position after this one, for all rings of a length; 0 at the start.
static inline uint32_t fm_next_position(uint32_t position, uint32_t length)
{
  return position + 1u == length ? 0u : position + 1u;
}

/// Two's complement of 64 bits as a signed number, without relying on the compiler's choice.
static inline int64_t fm_signed(uint64_t bits)
{
  return bits <= (uint64_t)INT64_MAX ? (int64_t)bits : -(int64_t)(~bits) - 1;
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

/// Comparison by value of a signed number a and an unsigned number b.
static inline bool fm_less_iu(int64_t a, uint64_t b) {return a < 0 || (uint64_t)a < b;}
static inline bool fm_less_ui(uint64_t b, int64_t a) {return a > 0 && b < (uint64_t)a;}
static inline bool fm_equal_iu(int64_t a, uint64_t b) {return a >= 0 && (uint64_t)a == b;}

#endif  // FRET_CELLS_H_
