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
/// skipping strings is O(strings in the message).

#ifndef FRET_CDR_H_
#define FRET_CDR_H_

#include <string.h>

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
/// string, the UTF-16 units of a wstring. `at` is the place of the first byte in the message, with
/// its encapsulation header; of a wstring 0.
struct fm_cdr_text
{
  const uint8_t * bytes;
  uint32_t length;
  bool big;
  uint64_t at;
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

/// A string; empty if the message is too short.
static inline struct fm_cdr_text fm_cdr_string(struct fm_cdr * c)
{
  struct fm_cdr_text text = {NULL, 0u, c->big, 0u};
  const uint32_t length = fm_cdr_uint32(c);
  text.bytes = fm_cdr_take(c, 1u, length);
  if (text.bytes != NULL && length != 0u) {
    text.length = text.bytes[length - 1u] == 0u ? length - 1u : length;
    text.at = (uint64_t)c->at + 4u - length;
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
  struct fm_cdr_text text = {NULL, fm_cdr_uint32(c), c->big, 0u};
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

/// The index of a string in the `values` of an input, or FM_FIELD_UNNAMED with the place of the
/// string in the message. O(bytes of the names).
static inline struct fm_field fm_field_name(
  const struct fm_cdr_text * text, const struct fm_cdr_name * names, uint32_t n_names)
{
  for (uint32_t i = 0u; i < n_names; ++i) {
    if (fm_cdr_is(text, names[i].bytes, names[i].length)) {
      return fm_field_i(i);
    }
  }
  const struct fm_field field = {{.u = text->at}, FM_FIELD_UNNAMED, text->length};
  return field;
}

/// A number as a key: its digits, after a minus if it is negative.
struct fm_cdr_digits
{
  uint8_t bytes[20];
  uint32_t first;  // index of the first one; they go to the end
};

static inline struct fm_cdr_digits fm_cdr_digits(uint64_t amount, bool is_negative)
{
  struct fm_cdr_digits digits = {{0u}, 20u};
  do {
    digits.first -= 1u;
    digits.bytes[digits.first] = (uint8_t)('0' + amount % 10u);
    amount /= 10u;
  } while (amount > 0u);
  if (is_negative) {
    digits.first -= 1u;
    digits.bytes[digits.first] = (uint8_t)'-';
  }
  return digits;
}

static inline struct fm_cdr_digits fm_cdr_digits_i(int64_t value)
{
  return fm_cdr_digits(value < 0 ? 0u - (uint64_t)value : (uint64_t)value, value < 0);
}

static inline struct fm_cdr_digits fm_cdr_digits_u(uint64_t value)
{
  return fm_cdr_digits(value, false);
}

/// The key of a pair: the size of the first key, its bytes, those of the second. `out` has room
/// for FM_PAIR_ROOM bytes. Returns its size; 0 if one of the keys is empty, more than a key may
/// have if both are too long together (`out` is then unspecified).
#define FM_PAIR_ROOM 511u

static inline size_t fm_pair_key(
  uint8_t * out, const uint8_t * first, size_t first_size, const uint8_t * second,
  size_t second_size)
{
  if (first_size == 0u || second_size == 0u) {
    return 0u;
  }
  if (first_size > 255u || second_size > 255u) {
    return FM_PAIR_ROOM;
  }
  out[0] = (uint8_t)first_size;
  memcpy(out + 1, first, first_size);
  memcpy(out + 1 + first_size, second, second_size);
  return 1u + first_size + second_size;
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

#endif  // FRET_CDR_H_
