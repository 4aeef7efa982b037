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

/// fret_reductions.h: values computed from several fields of a message: reductions of arrays,
/// sectors of scans, angles of quaternions. Generated readers include it where they need it.
/// Contract: as fret_cdr.h; O(elements reduced).

#ifndef FRET_REDUCTIONS_H_
#define FRET_REDUCTIONS_H_

#include <math.h>

#include "fret_cdr.h"
#include "fret_cells.h"

/// The most parts of an array that fm_cdr_sector returns.
#define FM_CDR_PARTS 3u

/// The elements of a scan in a sector: from the angle `first` through `width`, at most a turn.
/// Element i is at the angle `least` + i * `increment`, modulo a turn. As both are rounded, the
/// sector is larger at each end by a hundredth of the increment. Returns the number of parts, in
/// the order of their elements; 0 if no element is in the sector, or if the angles are not those
/// of a scan: numbers, an increment of at most a turn and not 0, at most two turns in all, and a
/// first angle at most two turns from 0. `size` is that of an element. O(1).
static inline uint32_t fm_cdr_sector(
  struct fm_cdr_array * parts, const struct fm_cdr_array * array, uint32_t size, double least,
  double increment, double first, double width)
{
  const double turn = 6.283185307179586;
  const double per_turn = turn / fabs(increment);  // elements
  const double last = (double)array->count - 1.0;
  if (!(fabs(least) <= 2.0 * turn && per_turn >= 1.0 && per_turn <= UINT32_MAX) ||
    last < 0.0 || last > 2.0 * per_turn)
  {
    return 0u;
  }
  // From here angles are places in the array; the sector recurs each turn.
  const double one = (first - least) / increment;
  const double other = (first + width - least) / increment;
  const double low = fmin(one, other) - 0.01;
  const double high = fmax(one, other) + 0.01;
  uint32_t n_parts = 0u;
  uint32_t next = 0u;  // the element after those in the parts so far
  for (double turns = ceil(-high / per_turn); low + turns * per_turn <= last; turns += 1.0) {
    const double begin = fmax(ceil(low + turns * per_turn), (double)next);
    const double end = fmin(floor(high + turns * per_turn), last);
    if (begin > end) {
      continue;
    }
    if (n_parts == 0u || begin > (double)next) {
      if (n_parts == FM_CDR_PARTS) {
        break;
      }
      parts[n_parts] = *array;
      parts[n_parts].bytes += (size_t)begin * size;
      parts[n_parts].count = 0u;
      next = (uint32_t)begin;
      n_parts += 1u;
    }
    parts[n_parts - 1u].count += (uint32_t)end + 1u - next;
    next = (uint32_t)end + 1u;
  }
  return n_parts;
}

/// A sum of signed integers, which wraps at 64 bits.
static inline struct fm_field fm_field_sum_i(uint64_t total)
{
  return fm_field_i(fm_signed(total));
}

/// Reductions of `n_parts` parts of an array, from the first element to the last. Only a single
/// part may be empty. `member` of fm_value holds an element, `sum` is the type of the sum, and
/// `result` makes a field of the sum. min, max and mean of no elements are FM_FIELD_EMPTY. min and
/// max skip elements for which `is_nan` is true, unless it is for all. O(elements).
#define FM_CDR_REDUCTIONS(name, type, member, sum, result, is_nan) \
  static inline struct fm_field fm_field_min_ ## name( \
    const struct fm_cdr_array * parts, uint32_t n_parts) \
  { \
    if (parts[0].count == 0u) { \
      return fm_field_empty(); \
    } \
    type least = fm_cdr_ ## name ## _at(&parts[0], 0u); \
    for (uint32_t p = 0u; p < n_parts; ++p) { \
      for (uint32_t i = 0u; i < parts[p].count; ++i) { \
        const type element = fm_cdr_ ## name ## _at(&parts[p], i); \
        least = element < least || is_nan(least) ? element : least; \
      } \
    } \
    return fm_field_ ## member(least); \
  } \
  static inline struct fm_field fm_field_max_ ## name( \
    const struct fm_cdr_array * parts, uint32_t n_parts) \
  { \
    if (parts[0].count == 0u) { \
      return fm_field_empty(); \
    } \
    type most = fm_cdr_ ## name ## _at(&parts[0], 0u); \
    for (uint32_t p = 0u; p < n_parts; ++p) { \
      for (uint32_t i = 0u; i < parts[p].count; ++i) { \
        const type element = fm_cdr_ ## name ## _at(&parts[p], i); \
        most = element > most || is_nan(most) ? element : most; \
      } \
    } \
    return fm_field_ ## member(most); \
  } \
  static inline struct fm_field fm_field_sum_ ## name( \
    const struct fm_cdr_array * parts, uint32_t n_parts) \
  { \
    sum total = (sum)0; \
    for (uint32_t p = 0u; p < n_parts; ++p) { \
      for (uint32_t i = 0u; i < parts[p].count; ++i) { \
        total += (sum)fm_cdr_ ## name ## _at(&parts[p], i); \
      } \
    } \
    return result(total); \
  } \
  static inline struct fm_field fm_field_mean_ ## name( \
    const struct fm_cdr_array * parts, uint32_t n_parts) \
  { \
    double total = 0.0; \
    double count = 0.0; \
    for (uint32_t p = 0u; p < n_parts; ++p) { \
      for (uint32_t i = 0u; i < parts[p].count; ++i) { \
        total += (double)fm_cdr_ ## name ## _at(&parts[p], i); \
      } \
      count += (double)parts[p].count; \
    } \
    return count > 0.0 ? fm_field_f(total / count) : fm_field_empty(); \
  } \
  static inline struct fm_field fm_field_norm_ ## name( \
    const struct fm_cdr_array * parts, uint32_t n_parts) \
  { \
    double total = 0.0; \
    for (uint32_t p = 0u; p < n_parts; ++p) { \
      for (uint32_t i = 0u; i < parts[p].count; ++i) { \
        const double element = (double)fm_cdr_ ## name ## _at(&parts[p], i); \
        total += element * element; \
      } \
    } \
    return fm_field_f(sqrt(total)); \
  }

#define FM_CDR_NEVER(x) false

FM_CDR_REDUCTIONS(int8, int8_t, i, uint64_t, fm_field_sum_i, FM_CDR_NEVER)
FM_CDR_REDUCTIONS(int16, int16_t, i, uint64_t, fm_field_sum_i, FM_CDR_NEVER)
FM_CDR_REDUCTIONS(int32, int32_t, i, uint64_t, fm_field_sum_i, FM_CDR_NEVER)
FM_CDR_REDUCTIONS(int64, int64_t, i, uint64_t, fm_field_sum_i, FM_CDR_NEVER)
FM_CDR_REDUCTIONS(uint8, uint8_t, u, uint64_t, fm_field_u, FM_CDR_NEVER)
FM_CDR_REDUCTIONS(uint16, uint16_t, u, uint64_t, fm_field_u, FM_CDR_NEVER)
FM_CDR_REDUCTIONS(uint32, uint32_t, u, uint64_t, fm_field_u, FM_CDR_NEVER)
FM_CDR_REDUCTIONS(uint64, uint64_t, u, uint64_t, fm_field_u, FM_CDR_NEVER)
FM_CDR_REDUCTIONS(float32, float, f, double, fm_field_f, isnan)
FM_CDR_REDUCTIONS(float64, double, f, double, fm_field_f, isnan)

static inline struct fm_field fm_field_any_bool(
  const struct fm_cdr_array * parts, uint32_t n_parts)
{
  bool any = false;
  for (uint32_t p = 0u; p < n_parts; ++p) {
    for (uint32_t i = 0u; i < parts[p].count; ++i) {
      any |= fm_cdr_bool_at(&parts[p], i);
    }
  }
  return fm_field_i(any);
}

static inline struct fm_field fm_field_all_bool(
  const struct fm_cdr_array * parts, uint32_t n_parts)
{
  bool all = true;
  for (uint32_t p = 0u; p < n_parts; ++p) {
    for (uint32_t i = 0u; i < parts[p].count; ++i) {
      all &= fm_cdr_bool_at(&parts[p], i);
    }
  }
  return fm_field_i(all);
}

static inline struct fm_field fm_field_len(const struct fm_cdr_array * parts, uint32_t n_parts)
{
  uint64_t count = 0u;
  for (uint32_t p = 0u; p < n_parts; ++p) {
    count += parts[p].count;
  }
  return fm_field_u(count);
}

/// The angles of a quaternion in radians: turns about z (yaw), then the new y (pitch), then the
/// new x (roll). Of any length except 0, of which the angles are NaN. Near a pitch of +-90 degrees
/// only the sum or difference of yaw and roll is known: roll is 0 there.
static inline double fm_cdr_sine_of_pitch(double x, double y, double z, double w)
{
  const double sine = 2.0 * (w * y - x * z) / (x * x + y * y + z * z + w * w);
  return sine > 1.0 ? 1.0 : sine < -1.0 ? -1.0 : sine;
}

static inline struct fm_field fm_field_yaw(double x, double y, double z, double w)
{
  const double sine = fm_cdr_sine_of_pitch(x, y, z, w);
  if (isnan(sine)) {
    return fm_field_f(sine);
  }
  if (fabs(sine) > 0.99999) {
    return fm_field_f(atan2(2.0 * (w * z - x * y), w * w - x * x + y * y - z * z));
  }
  return fm_field_f(atan2(2.0 * (x * y + w * z), w * w + x * x - y * y - z * z));
}

static inline struct fm_field fm_field_pitch(double x, double y, double z, double w)
{
  return fm_field_f(asin(fm_cdr_sine_of_pitch(x, y, z, w)));
}

static inline struct fm_field fm_field_roll(double x, double y, double z, double w)
{
  const double sine = fm_cdr_sine_of_pitch(x, y, z, w);
  if (isnan(sine)) {
    return fm_field_f(sine);
  }
  if (fabs(sine) > 0.99999) {
    return fm_field_f(0.0);
  }
  return fm_field_f(atan2(2.0 * (y * z + w * x), w * w - x * x - y * y + z * z));
}

#endif  // FRET_REDUCTIONS_H_
