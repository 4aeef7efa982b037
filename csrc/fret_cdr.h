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

/// fret_cdr.h: decodes serialized messages; generated readers call it.
///
/// ROS 2 sends messages as plain CDR (XCDR version 1): a header of four bytes that gives the byte
/// order, then the fields in the order of the definition. A number is aligned to its size, counted
/// from the end of the header. A sequence is its length (uint32) and its elements. A string is its
/// length, which includes the terminating zero, and its bytes. A wstring is its length and its
/// UTF-16 units, four bytes each, without a terminating zero.
///
/// A cursor goes through the bytes once. When the message is too short, the cursor moves to the
/// end, `ok` is false from then on, and all later reads return zero or empty values. Generated
/// code therefore checks `ok` only once, at the end.
/// Contract: all functions are static inline and read only the bytes of the message, at any
/// alignment; no allocation, no undefined behaviour for any bytes; any thread. O(1), except that
/// skipping strings and reducing arrays is O(elements in the message).

#ifndef FRET_CDR_H_
#define FRET_CDR_H_

#include <string.h>

#include "fret_cells.h"
#include "fret_fields.h"

/// A cursor in a message.
struct fm_cdr
{
  const uint8_t * bytes;  // after the encapsulation header
  size_t size;
  size_t at;  // at most size
  bool big;   // big endian
  bool ok;    // no read has gone past the end
};

/// The elements of an array of numbers or bools, in the message.
struct fm_cdr_array
{
  const uint8_t * bytes;
  uint32_t count;
  bool big;
};

/// A string or wstring in the message, without a terminating zero. `length` counts the bytes of a
/// string, the UTF-16 units of a wstring.
struct fm_cdr_text
{
  const uint8_t * bytes;
  uint32_t length;
  bool big;
};

/// One of the strings that an input lists under `values`: UTF-8.
struct fm_cdr_name
{
  const char * bytes;
  uint32_t length;
};

/// As fm_cdr_name, for a wstring: UTF-16.
struct fm_cdr_wide_name
{
  const uint16_t * units;
  uint32_t length;
};

/// Put the cursor at the start of a message; returns false if it is not plain CDR.
static inline bool fm_cdr_open(struct fm_cdr * c, const uint8_t * message, size_t size)
{
  if (size < 4u || message[0] != 0u || message[1] > 1u) {
    return false;
  }
  c->bytes = message + 4;
  c->size = size - 4u;
  c->at = 0u;
  c->big = message[1] == 0u;
  c->ok = true;
  return true;
}

/// Fail: all later reads return zero or empty values.
static inline void fm_cdr_fail(struct fm_cdr * c)
{
  c->at = c->size;
  c->ok = false;
}

/// Take `size` bytes, aligned to `alignment` (a power of 2). Returns them, or NULL if the message
/// is too short.
static inline const uint8_t * fm_cdr_take(struct fm_cdr * c, size_t alignment, uint64_t size)
{
  const size_t padding = (0u - c->at) & (alignment - 1u);
  const size_t left = c->size - c->at;
  if (padding > left || size > left - padding) {
    fm_cdr_fail(c);
    return NULL;
  }
  const uint8_t * const taken = c->bytes + c->at + padding;
  c->at += padding + (size_t)size;
  return taken;
}

/// Skip `size` bytes, aligned to `alignment`.
static inline void fm_cdr_skip(struct fm_cdr * c, size_t alignment, uint64_t size)
{
  (void)fm_cdr_take(c, alignment, size);
}

/// Take `count` elements of `size` bytes each (not 0), the first aligned to `alignment`. Returns
/// NULL if the message is too short, or `count` is 0; then not even padding is skipped.
static inline const uint8_t * fm_cdr_take_many(
  struct fm_cdr * c, size_t alignment, uint64_t size, uint32_t count)
{
  if (count == 0u) {
    return NULL;
  }
  if (count > (uint64_t)(c->size - c->at) / size) {  // size * count could overflow
    fm_cdr_fail(c);
    return NULL;
  }
  return fm_cdr_take(c, alignment, size * count);
}

/// Skip `count` elements, as fm_cdr_take_many.
static inline void fm_cdr_skip_many(
  struct fm_cdr * c, size_t alignment, uint64_t size, uint32_t count)
{
  (void)fm_cdr_take_many(c, alignment, size, count);
}

static inline uint8_t fm_cdr_bits8(const uint8_t * b, bool big)
{
  (void)big;
  return b[0];
}

static inline uint16_t fm_cdr_bits16(const uint8_t * b, bool big)
{
  return big ? (uint16_t)(((unsigned)b[0] << 8) | b[1]) : (uint16_t)(((unsigned)b[1] << 8) | b[0]);
}

static inline uint32_t fm_cdr_bits32(const uint8_t * b, bool big)
{
  return big ?
         ((uint32_t)b[0] << 24) | ((uint32_t)b[1] << 16) | ((uint32_t)b[2] << 8) | b[3] :
         ((uint32_t)b[3] << 24) | ((uint32_t)b[2] << 16) | ((uint32_t)b[1] << 8) | b[0];
}

static inline uint64_t fm_cdr_bits64(const uint8_t * b, bool big)
{
  const uint64_t first = fm_cdr_bits32(b, big);
  const uint64_t second = fm_cdr_bits32(b + 4, big);
  return big ? (first << 32) | second : (second << 32) | first;
}

/// Numbers: fm_cdr_T reads the next field, fm_cdr_T_at an element of an array (index < count).
#define FM_CDR_NUMBER(name, type, bits) \
  static inline type fm_cdr_ ## name ## _of(const uint8_t * bytes, bool big) \
  { \
    const uint ## bits ## _t raw = fm_cdr_bits ## bits(bytes, big); \
    type value; \
    memcpy(&value, &raw, sizeof(value)); \
    return value; \
  } \
  static inline type fm_cdr_ ## name(struct fm_cdr * c) \
  { \
    const uint8_t * const bytes = fm_cdr_take(c, sizeof(type), sizeof(type)); \
    return bytes == NULL ? (type)0 : fm_cdr_ ## name ## _of(bytes, c->big); \
  } \
  static inline type fm_cdr_ ## name ## _at(const struct fm_cdr_array * array, uint32_t index) \
  { \
    return fm_cdr_ ## name ## _of(array->bytes + (size_t)index * sizeof(type), array->big); \
  }

FM_CDR_NUMBER(int8, int8_t, 8)
FM_CDR_NUMBER(int16, int16_t, 16)
FM_CDR_NUMBER(int32, int32_t, 32)
FM_CDR_NUMBER(int64, int64_t, 64)
FM_CDR_NUMBER(uint8, uint8_t, 8)
FM_CDR_NUMBER(uint16, uint16_t, 16)
FM_CDR_NUMBER(uint32, uint32_t, 32)
FM_CDR_NUMBER(uint64, uint64_t, 64)
FM_CDR_NUMBER(float32, float, 32)
FM_CDR_NUMBER(float64, double, 64)

/// Bools: any byte except 0 is true.
static inline bool fm_cdr_bool(struct fm_cdr * c) {return fm_cdr_uint8(c) != 0u;}

static inline bool fm_cdr_bool_at(const struct fm_cdr_array * array, uint32_t index)
{
  return array->bytes[index] != 0u;
}

/// The length of a sequence. Fails and returns 0 if the message is too short, or the length is
/// above `bound`, the limit of the sequence's type.
static inline uint32_t fm_cdr_count(struct fm_cdr * c, uint32_t bound)
{
  const uint32_t count = fm_cdr_uint32(c);
  if (count > bound) {
    fm_cdr_fail(c);
    return 0u;
  }
  return count;
}

/// An array of `count` numbers of `size` bytes each; empty if the message is too short.
static inline struct fm_cdr_array fm_cdr_array(struct fm_cdr * c, uint32_t size, uint32_t count)
{
  struct fm_cdr_array array = {fm_cdr_take_many(c, size, size, count), count, c->big};
  if (array.bytes == NULL) {
    array.count = 0u;
  }
  return array;
}

/// The elements from `start` to before `stop`; a negative number counts from the end. Returns
/// false if they are not all in the array; `size` is that of an element.
static inline bool fm_cdr_slice(
  struct fm_cdr_array * part, const struct fm_cdr_array * array, uint32_t size, int64_t start,
  int64_t stop)
{
  const int64_t count = (int64_t)array->count;
  const int64_t first = start < 0 ? start + count : start;
  const int64_t end = stop < 0 ? stop + count : stop;
  if (first < 0 || first > end || end > count) {
    return false;
  }
  *part = *array;
  part->count = (uint32_t)(end - first);
  if (array->bytes != NULL) {
    part->bytes += (size_t)first * size;
  }
  return true;
}

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

/// A string; empty if the message is too short.
static inline struct fm_cdr_text fm_cdr_string(struct fm_cdr * c)
{
  struct fm_cdr_text text = {NULL, 0u, c->big};
  const uint32_t length = fm_cdr_uint32(c);
  text.bytes = fm_cdr_take(c, 1u, length);
  if (text.bytes != NULL && length != 0u) {
    text.length = text.bytes[length - 1u] == 0u ? length - 1u : length;
  }
  return text;
}

/// Whether a string has these bytes.
static inline bool fm_cdr_is(const struct fm_cdr_text * text, const char * bytes, uint32_t length)
{
  return text->length == length && (length == 0u || memcmp(text->bytes, bytes, length) == 0);
}

/// A wstring; empty if the message is too short.
static inline struct fm_cdr_text fm_cdr_wstring(struct fm_cdr * c)
{
  struct fm_cdr_text text = {NULL, fm_cdr_uint32(c), c->big};
  text.bytes = fm_cdr_take_many(c, 4u, 4u, text.length);
  if (text.bytes == NULL) {
    text.length = 0u;
  }
  return text;
}

/// Skip `count` strings; stops where the message is too short. O(strings in the message).
static inline void fm_cdr_skip_strings(struct fm_cdr * c, uint32_t count)
{
  for (uint32_t i = 0u; i < count && c->ok; ++i) {
    const uint32_t length = fm_cdr_uint32(c);
    fm_cdr_skip(c, 1u, length);
  }
}

static inline void fm_cdr_skip_wstrings(struct fm_cdr * c, uint32_t count)
{
  for (uint32_t i = 0u; i < count && c->ok; ++i) {
    const uint32_t length = fm_cdr_uint32(c);
    fm_cdr_skip_many(c, 4u, 4u, length);
  }
}

/// Make an fm_field: from a bool or intN, a uintN, a float, an index outside its array of `length`
/// elements, or an empty array.
static inline struct fm_field fm_field_i(int64_t value)
{
  const struct fm_field field = {{.i = value}, FM_FIELD_READ, 0u};
  return field;
}

static inline struct fm_field fm_field_u(uint64_t value)
{
  const struct fm_field field = {{.u = value}, FM_FIELD_READ, 0u};
  return field;
}

static inline struct fm_field fm_field_f(double value)
{
  const struct fm_field field = {{.f = value}, FM_FIELD_READ, 0u};
  return field;
}

static inline struct fm_field fm_field_outside(uint32_t length)
{
  const struct fm_field field = {{.u = 0u}, FM_FIELD_OUTSIDE, length};
  return field;
}

/// The element of a name is missing in an array of `length` elements: the name has no index
/// (UINT32_MAX), or one outside the array.
static inline struct fm_field fm_field_absent(uint32_t index, uint32_t length)
{
  const struct fm_field field = {
    {.u = 0u}, index == UINT32_MAX ? FM_FIELD_ABSENT : FM_FIELD_OUTSIDE, length};
  return field;
}

static inline struct fm_field fm_field_empty(void)
{
  const struct fm_field field = {{.u = 0u}, FM_FIELD_EMPTY, 0u};
  return field;
}

/// The index of a string in the `values` of an input, or FM_FIELD_UNNAMED. O(bytes of the names).
static inline struct fm_field fm_field_name(
  const struct fm_cdr_text * text, const struct fm_cdr_name * names, uint32_t n_names)
{
  for (uint32_t i = 0u; i < n_names; ++i) {
    if (fm_cdr_is(text, names[i].bytes, names[i].length)) {
      return fm_field_i(i);
    }
  }
  const struct fm_field field = {{.u = 0u}, FM_FIELD_UNNAMED, text->length};
  return field;
}

static inline bool fm_cdr_is_wide(
  const struct fm_cdr_text * text, const struct fm_cdr_wide_name * name)
{
  if (name->length != text->length) {
    return false;
  }
  for (uint32_t i = 0u; i < text->length; ++i) {
    const uint32_t unit = fm_cdr_bits32(text->bytes + 4u * (size_t)i, text->big);
    if ((uint16_t)unit != name->units[i]) {  // other nodes ignore the upper 16 bits too
      return false;
    }
  }
  return true;
}

static inline struct fm_field fm_field_wide_name(
  const struct fm_cdr_text * text, const struct fm_cdr_wide_name * names, uint32_t n_names)
{
  for (uint32_t i = 0u; i < n_names; ++i) {
    if (fm_cdr_is_wide(text, &names[i])) {
      return fm_field_i(i);
    }
  }
  const struct fm_field field = {{.u = 0u}, FM_FIELD_UNNAMED, text->length};
  return field;
}

/// A time or duration in nanoseconds.
static inline int64_t fm_cdr_nanoseconds(int32_t sec, uint32_t nanosec)
{
  return (int64_t)sec * 1000000000 + (int64_t)nanosec;
}

/// A time or duration in seconds.
static inline double fm_cdr_seconds(int32_t sec, uint32_t nanosec)
{
  return (double)sec + (double)nanosec * 1e-9;
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

#endif  // FRET_CDR_H_
