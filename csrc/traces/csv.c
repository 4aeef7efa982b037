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

/// csv.c: see csv.h for the contract.

#include "csv.h"

#include <float.h>
#include <locale.h>
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

enum {MOST_CELL_BYTES = 64, DIGITS_OF_SECONDS = 9, MOST_EXACT_POWER = 22, MOST_EXACT_POWER_F = 10};

#define LATEST_NS ((uint64_t)1 << 62)
#define SECOND_NS 1000000000u
#define MOST_DIGITS 19  // of which every number fits in 64 bits

// A part of the text.
struct cell
{
  const char * at;
  const char * end;
};

// A number as it is written: mantissa x 10^exponent.
struct decimal
{
  uint64_t mantissa;
  int32_t exponent;
  bool is_exact;     // the mantissa holds all digits
  bool is_negative;
};

static bool is_digit(char c) {return c >= '0' && c <= '9';}

static bool is_blank(char c) {return c == ' ' || c == '\t';}

// Whether a cell is a word, whose letters are given in lower case.
static bool is_word(const struct cell * cell, const char * word)
{
  const char * at = cell->at;
  for (; at < cell->end && *word != '\0'; ++at, ++word) {
    if ((*at >= 'A' && *at <= 'Z' ? *at - 'A' + 'a' : *at) != *word) {
      return false;
    }
  }
  return at == cell->end && *word == '\0';
}

// Take a sign from the front of a cell; return whether it is a minus.
static bool take_sign(struct cell * cell)
{
  const bool has_sign = cell->at < cell->end && (*cell->at == '+' || *cell->at == '-');
  const bool is_negative = has_sign && *cell->at == '-';
  cell->at += has_sign ? 1 : 0;
  return is_negative;
}

// Take digits from the front of a cell, and add them to a number; return how many there were.
static int32_t take_digits(struct cell * cell, struct decimal * number)
{
  int32_t count = 0;
  for (; cell->at < cell->end && is_digit(*cell->at); ++cell->at, ++count) {
    const uint64_t digit = (uint64_t)(*cell->at - '0');
    if (number->mantissa > (UINT64_MAX - digit) / 10u) {
      number->is_exact = false;
    } else {
      number->mantissa = number->mantissa * 10u + digit;
    }
  }
  return count;
}

static bool take_whole(struct cell cell, struct decimal * number)
{
  *number = (struct decimal){0u, 0, true, take_sign(&cell)};
  return take_digits(&cell, number) > 0 && cell.at == cell.end && number->is_exact;
}

static bool read_signed(const struct cell * cell, int64_t least, int64_t * value)
{
  struct decimal number;
  if (!take_whole(*cell, &number)) {
    return false;
  }
  const uint64_t most = (uint64_t)-(least + 1) + (number.is_negative ? 1u : 0u);
  if (number.mantissa > most) {
    return false;
  }
  *value = number.is_negative && number.mantissa > 0u ?
    -(int64_t)(number.mantissa - 1u) - 1 : (int64_t)number.mantissa;
  return true;
}

static bool read_unsigned(const struct cell * cell, uint64_t most, uint64_t * value)
{
  struct decimal number;
  if (!take_whole(*cell, &number) || number.mantissa > (number.is_negative ? 0u : most)) {
    return false;
  }
  *value = number.mantissa;
  return true;
}

static bool read_bool(const struct cell * cell, uint8_t * value)
{
  *value = is_word(cell, "1") || is_word(cell, "true");
  return *value == 1u || is_word(cell, "0") || is_word(cell, "false");
}

// Take a decimal number that fills a cell.
static bool take_decimal(struct cell cell, struct decimal * number)
{
  *number = (struct decimal){0u, 0, true, take_sign(&cell)};
  int32_t count = take_digits(&cell, number);
  if (cell.at < cell.end && *cell.at == '.') {
    cell.at += 1;
    const int32_t places = take_digits(&cell, number);
    number->exponent = -places;
    count += places;
  }
  if (count > 0 && cell.at < cell.end && (*cell.at == 'e' || *cell.at == 'E')) {
    cell.at += 1;
    struct decimal power = {0u, 0, true, take_sign(&cell)};
    if (take_digits(&cell, &power) == 0) {
      return false;
    }
    const bool is_small = power.is_exact && power.mantissa < 1000u;
    number->is_exact = number->is_exact && is_small;
    number->exponent += is_small ? (power.is_negative ? -1 : 1) * (int32_t)power.mantissa : 0;
  }
  return count > 0 && cell.at == cell.end;
}

static bool read_not_finite(struct cell cell, double * value)
{
  const bool is_negative = take_sign(&cell);
  if (is_word(&cell, "nan")) {
    *value = copysign((double)NAN, is_negative ? -1.0 : 1.0);
    return true;
  }
  *value = is_negative ? -(double)INFINITY : (double)INFINITY;
  return is_word(&cell, "inf");
}

static void copy(const struct cell * cell, char * text)
{
  const size_t n = (size_t)(cell->end - cell->at);
  memcpy(text, cell->at, n);
  text[n] = '\0';
}

// A mantissa and a power of ten that are both exact are rounded once, by one operation (Clinger,
// 'How to read floating point numbers accurately', 1990), if that keeps no further bits.
static bool is_one_operation(
  const struct decimal * number, uint64_t most, int32_t most_power)
{
#if defined(FLT_EVAL_METHOD) && FLT_EVAL_METHOD == 0
  return number->is_exact && number->mantissa <= most && number->exponent <= most_power &&
         number->exponent >= -most_power;
#else
  (void)number;
  (void)most;
  (void)most_power;
  return false;
#endif
}

static bool read_double(const struct cell * cell, double * value)
{
  static const double powers[MOST_EXACT_POWER + 1] = {
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
  struct decimal number;
  if (!take_decimal(*cell, &number)) {
    return read_not_finite(*cell, value);
  }
  if (is_one_operation(&number, (uint64_t)1 << DBL_MANT_DIG, MOST_EXACT_POWER)) {
    const double found = number.exponent < 0 ?
      (double)number.mantissa / powers[-number.exponent] :
      (double)number.mantissa * powers[number.exponent];
    *value = number.is_negative ? -found : found;
  } else {
    char text[MOST_CELL_BYTES];
    copy(cell, text);
    *value = strtod(text, NULL);
  }
  return true;
}

// As read_double: a float64 that is rounded once more may be another float32.
static bool read_float(const struct cell * cell, float * value)
{
  static const float powers[MOST_EXACT_POWER_F + 1] = {
    1e0f, 1e1f, 1e2f, 1e3f, 1e4f, 1e5f, 1e6f, 1e7f, 1e8f, 1e9f, 1e10f};
  struct decimal number;
  if (!take_decimal(*cell, &number)) {
    double found;
    const bool is_read = read_not_finite(*cell, &found);
    *value = (float)found;
    return is_read;
  }
  if (is_one_operation(&number, (uint64_t)1 << FLT_MANT_DIG, MOST_EXACT_POWER_F)) {
    const float found = number.exponent < 0 ?
      (float)number.mantissa / powers[-number.exponent] :
      (float)number.mantissa * powers[number.exponent];
    *value = number.is_negative ? -found : found;
  } else {
    char text[MOST_CELL_BYTES];
    copy(cell, text);
    *value = strtof(text, NULL);
  }
  return true;
}

// Read seconds with at most nine digits behind the point, as nanoseconds.
static bool read_time(struct cell cell, int64_t * value)
{
  struct decimal number = {0u, 0, true, take_sign(&cell)};
  if (take_digits(&cell, &number) == 0) {
    return false;
  }
  int32_t places = 0;
  if (cell.at < cell.end && *cell.at == '.') {
    cell.at += 1;
    places = take_digits(&cell, &number);
  }
  if (cell.at != cell.end || places > DIGITS_OF_SECONDS || !number.is_exact) {
    return false;
  }
  for (; places < DIGITS_OF_SECONDS; ++places) {
    if (number.mantissa > LATEST_NS) {
      return false;
    }
    number.mantissa = number.mantissa > LATEST_NS / 10u ? LATEST_NS + 1u : number.mantissa * 10u;
  }
  *value = number.is_negative ? -(int64_t)number.mantissa : (int64_t)number.mantissa;
  return number.mantissa <= LATEST_NS;
}

static uint32_t bytes_of(uint8_t type)
{
  switch (type) {
    case FM_BOOL: case FM_INT8: case FM_UINT8: return 1u;
    case FM_INT16: case FM_UINT16: return 2u;
    case FM_INT32: case FM_UINT32: case FM_FLOAT32: return 4u;
    default: return 8u;
  }
}

static bool read_name(
  const struct fm_csv_column * column, const struct cell * cell, char * value)
{
  const size_t n = (size_t)(cell->end - cell->at);
  for (uint32_t k = 0; k < column->n_names; ++k) {
    if (column->names[k].n == n && memcmp(column->names[k].text, cell->at, n) == 0) {
      const size_t bytes = bytes_of(column->type);
      memcpy(value, (const char *)column->named + k * bytes, bytes);
      return true;
    }
  }
  return false;
}

static bool read_integer(uint8_t type, const struct cell * cell, char * value)
{
  const uint32_t bytes = bytes_of(type);
  const uint32_t spare = 64u - 8u * bytes;
  int64_t i;
  uint64_t u;
  if (type >= FM_UINT8) {
    if (!read_unsigned(cell, UINT64_MAX >> spare, &u)) {
      return false;
    }
  } else {
    if (!read_signed(cell, -(int64_t)(UINT64_MAX >> (spare + 1u)) - 1, &i)) {
      return false;
    }
    u = (uint64_t)i;
  }
  const uint8_t u8 = (uint8_t)u;
  const uint16_t u16 = (uint16_t)u;
  const uint32_t u32 = (uint32_t)u;
  memcpy(value, bytes == 1u ? (const void *)&u8 : bytes == 2u ? (const void *)&u16 :
    bytes == 4u ? (const void *)&u32 : (const void *)&u, bytes);
  return true;
}

// Read a cell without the white space around it. The value lies at any alignment.
static bool read_cell(
  const struct fm_csv_column * column, const struct cell * cell, char * value)
{
  if (cell->end - cell->at >= MOST_CELL_BYTES) {
    return false;
  }
  if (read_name(column, cell, value)) {
    return true;
  }
  if (!column->has_numbers) {
    return false;
  }
  union {uint8_t b; float f; double d; int64_t t;} found;
  bool is_read;
  if (column->is_time) {
    is_read = read_time(*cell, &found.t);
  } else if (column->type == FM_BOOL) {
    is_read = read_bool(cell, &found.b);
  } else if (column->type == FM_FLOAT32) {
    is_read = read_float(cell, &found.f);
  } else if (column->type == FM_FLOAT64) {
    is_read = read_double(cell, &found.d);
  } else {
    return read_integer(column->type, cell, value);
  }
  if (is_read) {
    memcpy(value, &found, bytes_of(column->type));
  }
  return is_read;
}

// Find the end of the cell in quotes whose first byte is `at`; NULL if it is not plain. One that
// is not read may have quotes in it.
static const char * quoted_end(const char * at, const char * end, bool is_read)
{
  while (at < end && *at != '\r' && *at != '\n') {
    if (*at != '"') {
      at += 1;
    } else if (end - at > 1 && at[1] == '"') {
      if (is_read) {
        return NULL;
      }
      at += 2;
    } else {
      return at;
    }
  }
  return NULL;
}

// Find the next cell, which begins at `*at`, and move `*at` behind it. Returns whether it is
// plain.
static bool next_cell(const char ** at, const char * end, bool is_read, struct cell * cell)
{
  if (*at < end && **at == '"') {
    cell->at = *at + 1;
    cell->end = quoted_end(cell->at, end, is_read);
    if (cell->end == NULL) {
      return false;
    }
    *at = cell->end + 1;
    return *at < end && (**at == ',' || **at == '\r' || **at == '\n');
  }
  cell->at = *at;
  while (*at < end && **at != ',' && **at != '\r' && **at != '\n') {
    *at += 1;
  }
  cell->end = *at;
  return *at < end;
}

static void trim(struct cell * cell)
{
  while (cell->at < cell->end && is_blank(*cell->at)) {
    cell->at += 1;
  }
  while (cell->at < cell->end && is_blank(cell->end[-1])) {
    cell->end -= 1;
  }
}

static bool is_visible(char c) {return c > ' ' && c <= '~';}

static bool is_named(const struct fm_csv_column * column, const struct fm_key * key)
{
  bool is_found = column->n_names == 0;
  for (uint32_t k = 0; k < column->n_names && !is_found; ++k) {
    is_found = column->names[k].n == key->size &&
      memcmp(column->names[k].text, key->bytes, key->size) == 0;
  }
  return is_found;
}

// A key without white space around it, of which there are kinds that are not known here.
static bool read_key(const struct fm_csv_column * column, const struct cell * cell, uint64_t k)
{
  const size_t n = (size_t)(cell->end - cell->at);
  const struct fm_key key = {(const uint8_t *)cell->at, (uint32_t)n};
  ((struct fm_key *)column->values)[k] = key;
  return n == 0 || (n <= FM_MOST_KEY_BYTES && is_visible(cell->at[0]) &&
         is_visible(cell->end[-1]) && is_named(column, &key));
}

static bool take_cell(const struct fm_csv_column * column, const struct cell * cell, uint64_t k)
{
  if (column->is_key) {
    return read_key(column, cell, k);
  }
  if (column->is_there != NULL) {
    column->is_there[k] = cell->at < cell->end;
    if (!column->is_there[k]) {
      return true;
    }
  }
  return read_cell(column, cell, (char *)column->values + k * bytes_of(column->type));
}

static bool has_keys(const struct fm_csv * csv, uint64_t k)
{
  bool has = true;
  for (uint32_t c = 0; c < csv->n_columns; ++c) {
    const struct fm_csv_column * const column = &csv->columns[c];
    const bool needs_key = column->needs_key && column->is_there[k];
    for (uint32_t n = 0; needs_key && n < 2; ++n) {
      has = has && ((const struct fm_key *)csv->columns[column->keys[n]].values)[k].size > 0;
    }
  }
  return has;
}

// Read row k, which begins at `*at`; move `*at` behind it if that is possible.
static bool read_row(const struct fm_csv * csv, uint64_t k, const char ** at)
{
  const char * const end = csv->text + csv->n;
  const char * now = *at;
  if (now < end && (*now == '\n' || *now == '\r')) {
    return false;
  }
  for (uint32_t c = 0; c < csv->n_columns; ++c) {
    const struct fm_csv_column * const column = &csv->columns[c];
    struct cell cell;
    if (!next_cell(&now, end, column->values != NULL, &cell) ||
      (*now == ',') != (c + 1u < csv->n_columns))
    {
      return false;
    }
    if (column->values != NULL) {
      trim(&cell);
      if (!take_cell(column, &cell, k)) {
        return false;
      }
    }
    now += *now == ',' ? 1 : 0;
  }
  now += *now == '\r' ? 1 : 0;
  if (now == end || *now != '\n' || !has_keys(csv, k)) {
    return false;
  }
  *at = now + 1;
  return true;
}

static const struct fm_csv_column * time_column(const struct fm_csv * csv)
{
  for (uint32_t c = 0; c < csv->n_columns; ++c) {
    if (csv->columns[c].is_time) {
      return &csv->columns[c];
    }
  }
  return NULL;
}

uint64_t fm_csv_rows(struct fm_csv * csv, uint64_t most)
{
  const struct fm_csv_column * const timed = time_column(csv);
  const char * at = csv->text + csv->place;
  int64_t last = csv->after;
  uint64_t k = 0;
  if (strcmp(localeconv()->decimal_point, ".") != 0) {
    return 0u;
  }
  for (; k < most; ++k) {
    if (!read_row(csv, k, &at)) {
      break;
    }
    if (timed != NULL) {
      int64_t now;
      memcpy(&now, (const char *)timed->values + k * sizeof(now), sizeof(now));
      if (now <= last || now > csv->latest) {
        break;
      }
      last = now;
    }
    csv->place = (uint64_t)(at - csv->text);
  }
  return k;
}

static char * write_number(uint64_t number, uint32_t least_digits, char * text)
{
  char digits[MOST_DIGITS + 1];
  uint32_t n = 0;
  for (; number > 0u || n < least_digits; number /= 10u) {
    digits[n++] = (char)('0' + number % 10u);
  }
  while (n > 0u) {
    *text++ = digits[--n];
  }
  return text;
}

static char * write_label(int64_t label, bool is_time, char * text)
{
  const uint64_t size = label < 0 ? (uint64_t)-(label + 1) + 1u : (uint64_t)label;
  if (label < 0) {
    *text++ = '-';
  }
  if (!is_time) {
    return write_number(size, 1u, text);
  }
  text = write_number(size / SECOND_NS, 1u, text);
  if (size % SECOND_NS != 0u) {
    *text++ = '.';
    text = write_number(size % SECOND_NS, DIGITS_OF_SECONDS, text);
    while (text[-1] == '0') {
      --text;
    }
  }
  return text;
}

uint64_t fm_csv_verdicts(
  const int64_t * labels, bool are_times, const bool * verdicts, uint32_t width, uint64_t n,
  char * text)
{
  char * at = text;
  for (uint64_t k = 0; k < n; ++k) {
    at = write_label(labels[k], are_times, at);
    for (uint32_t w = 0; w < width; ++w) {
      *at++ = ',';
      *at++ = verdicts[k * width + w] ? '1' : '0';
    }
    *at++ = '\n';
  }
  return (uint64_t)(at - text);
}
