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

/// text.c: see text.h for the contract.

#include "text.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define ALIGNMENT 16u  // of what is reserved

enum { MOST_DIGITS = 17, LONGEST_NUMBER = 64, MOST_NAMED = 5 };

const char * fm_text_get(const struct fm_text * text)
{
  return text->bytes == NULL ? "" : text->bytes;
}

void fm_text_clear(struct fm_text * text)
{
  text->length = 0;
  if (text->bytes != NULL) {
    text->bytes[0] = '\0';
  }
}

void fm_text_free(struct fm_text * text)
{
  free(text->bytes);
  memset(text, 0, sizeof(*text));
}

// Make room for so many characters more, and a zero.
static bool has_room(struct fm_text * text, size_t more)
{
  if (text->length + more < text->capacity) {
    return true;
  }
  const size_t capacity = 2 * text->capacity + more + 64u;
  char * bytes = realloc(text->bytes, capacity);
  if (bytes == NULL) {
    return false;
  }
  text->bytes = bytes;
  text->capacity = capacity;
  return true;
}

void fm_text_add_arguments(struct fm_text * text, const char * format, va_list arguments)
{
  va_list again;
  va_copy(again, arguments);
  const int length = vsnprintf(NULL, 0, format, again);
  va_end(again);
  if (length >= 0 && has_room(text, (size_t)length)) {
    (void)vsnprintf(text->bytes + text->length, (size_t)length + 1u, format, arguments);
    text->length += (size_t)length;
  }
}

void fm_text_add(struct fm_text * text, const char * format, ...)
{
  va_list arguments;
  va_start(arguments, format);
  fm_text_add_arguments(text, format, arguments);
  va_end(arguments);
}

void fm_text_join(struct fm_text * text, const char * separator, const char * format, ...)
{
  va_list arguments;
  va_start(arguments, format);
  fm_text_add(text, "%s", text->length == 0 ? "" : separator);
  fm_text_add_arguments(text, format, arguments);
  va_end(arguments);
}

static int compare_words(const void * one, const void * other)
{
  return strcmp(*(const char * const *)one, *(const char * const *)other);
}

void fm_text_sort(struct fm_text * text, const char ** words, uint32_t n)
{
  fm_text_clear(text);
  qsort(words, n, sizeof(*words), compare_words);
  for (uint32_t k = 0; k < n; ++k) {
    if (k == 0 || strcmp(words[k], words[k - 1u]) != 0) {
      fm_text_join(text, ", ", "%s", words[k]);
    }
  }
}

// ---- bytes -------------------------------------------------------------------------------------

// The length of the character of UTF-8 that such a byte begins; 0: none.
static size_t length_of(uint8_t first)
{
  return first < 0x80u ? 1u : first < 0xc2u ? 0u : first < 0xe0u ? 2u : first < 0xf0u ? 3u :
         first < 0xf5u ? 4u : 0u;
}

// Whether a code point can be shown, and needs so many bytes.
static bool is_shown(uint32_t code, size_t n)
{
  static const uint32_t FEWEST[] = {0, 0x20u, 0xa0u, 0x800u, 0x10000u};
  return code >= FEWEST[n] && code != 0x7fu && (code < 0xd800u || code > 0xdfffu) &&
         code <= 0x10ffffu;
}

// The length of the character at the begin; 0: it cannot be shown.
static size_t shown_length(const uint8_t * bytes, size_t size)
{
  const size_t n = length_of(bytes[0]);
  if (n == 0 || n > size) {
    return 0;
  }
  uint32_t code = n == 1u ? bytes[0] : bytes[0] & (0x7fu >> n);
  for (size_t k = 1; k < n; ++k) {
    if ((bytes[k] & 0xc0u) != 0x80u) {
      return 0;
    }
    code = code << 6 | (bytes[k] & 0x3fu);
  }
  return is_shown(code, n) ? n : 0;
}

void fm_text_add_bytes(struct fm_text * text, const uint8_t * bytes, size_t size)
{
  for (size_t k = 0; k < size; ) {
    const size_t n = shown_length(bytes + k, size - k);
    fm_text_add(text, "%.*s", n == 0 ? 1 : (int)n, n == 0 ? "?" : (const char *)bytes + k);
    k += n == 0 ? 1u : n;
  }
}

// ---- names -------------------------------------------------------------------------------------

void fm_names_add(struct fm_names * names, const char * separator, const char * name)
{
  names->n += 1u;
  if (names->n <= MOST_NAMED) {
    fm_text_join(&names->text, separator, "%s", name);
  }
}

void fm_names_add_quoted(struct fm_names * names, const char * name, const char * note)
{
  struct fm_text quoted = {NULL, 0, 0};
  fm_text_add(&quoted, "'%s'%s", name, note);
  fm_names_add(names, ", ", fm_text_get(&quoted));
  fm_text_free(&quoted);
}

const char * fm_names_get(struct fm_names * names)
{
  if (names->n > MOST_NAMED) {
    fm_text_add(&names->text, " and %u more", names->n - MOST_NAMED);
  }
  return fm_text_get(&names->text);
}

// ---- numbers -----------------------------------------------------------------------------------

static bool rounds_to(const char * decimal, double value, bool is_single)
{
  return is_single ? (double)strtof(decimal, NULL) == value : strtod(decimal, NULL) == value;
}

// Make a decimal such as 1.25e+03 larger in its last digit. False if a digit more were needed.
static bool increment(char * decimal)
{
  char * place = strchr(decimal, 'e');
  while (place-- > decimal) {
    if (*place == '9') {
      *place = '0';
    } else if (*place >= '0' && *place < '9') {
      *place = (char)(*place + 1);
      return true;
    }
  }
  return false;
}

// Write the shortest decimal that rounds to a positive value, as d.ddde+XX. Below a power of two,
// floats are closer together than above it: the nearest decimal may round to the float below it,
// and the next decimal to the power.
static void write_shortest(char * out, double value, bool is_single)
{
  int exponent;
  const bool is_power = frexp(value, &exponent) == 0.5;
  for (int digits = 1; digits <= MOST_DIGITS; ++digits) {
    (void)snprintf(out, LONGEST_NUMBER, "%.*e", digits - 1, value);
    if (rounds_to(out, value, is_single) ||
      (is_power && increment(out) && rounds_to(out, value, is_single)))
    {
      return;
    }
  }
  (void)snprintf(out, LONGEST_NUMBER, "%.*e", MOST_DIGITS - 1, value);
}

// Write a decimal d.ddde+XX as Python does: with an exponent below 1e-4 and from 1e16 on.
static void add_spelled(struct fm_text * text, const char * decimal)
{
  const char * mark = strchr(decimal, 'e');
  const int exponent = atoi(mark + 1);
  char digits[LONGEST_NUMBER];
  int n = 0;
  for (const char * place = decimal; place < mark; ++place) {
    if (*place != '.') {
      digits[n++] = *place;
    }
  }
  digits[n] = '\0';
  if (exponent < -4 || exponent >= 16) {
    fm_text_add(text, "%c%s%se%c%02d", digits[0], n > 1 ? "." : "", digits + 1,
      exponent < 0 ? '-' : '+', abs(exponent));
  } else if (exponent < 0) {
    fm_text_add(text, "0.%.*d%s", -exponent - 1, 0, digits);
  } else if (n <= exponent + 1) {
    fm_text_add(text, "%s", digits);
    for (int k = n; k < exponent + 1; ++k) {
      fm_text_add(text, "0");
    }
    fm_text_add(text, ".0");
  } else {
    fm_text_add(text, "%.*s.%s", exponent + 1, digits, digits + exponent + 1);
  }
}

void fm_text_add_float(struct fm_text * text, double value, bool is_single)
{
  char decimal[LONGEST_NUMBER];
  if (isnan(value)) {
    fm_text_add(text, "nan");
    return;
  }
  fm_text_add(text, "%s", signbit(value) ? "-" : "");
  value = fabs(value);
  if (isinf(value) || value == 0.0) {
    fm_text_add(text, "%s", value == 0.0 ? "0.0" : "inf");
    return;
  }
  write_shortest(decimal, value, is_single);
  add_spelled(text, decimal);
}

void fm_text_add_seconds(struct fm_text * text, int64_t nanoseconds)
{
  const uint64_t size = nanoseconds < 0 ? -(uint64_t)nanoseconds : (uint64_t)nanoseconds;
  fm_text_add(text, "%s%" PRIu64 ".%09" PRIu64, nanoseconds < 0 ? "-" : "",
    size / UINT64_C(1000000000), size % UINT64_C(1000000000));
}

void fm_text_add_short_seconds(struct fm_text * text, int64_t nanoseconds)
{
  fm_text_add_seconds(text, nanoseconds);
  while (text->length > 0 && text->bytes[text->length - 1u] == '0') {
    text->length -= 1u;
  }
  if (text->length > 0 && text->bytes[text->length - 1u] == '.') {
    text->length -= 1u;
  }
  if (text->bytes != NULL) {
    text->bytes[text->length] = '\0';
  }
}

void * fm_with_room(void * array, uint32_t n, uint32_t * capacity, size_t bytes)
{
  if (n < *capacity) {
    return array;
  }
  const uint32_t wanted = 2u * *capacity + 8u;
  void * moved = realloc(array, wanted * bytes);
  if (moved != NULL) {
    *capacity = wanted;
  }
  return moved;
}

char * fm_copy_of(const char * text)
{
  char * copy = malloc(strlen(text) + 1u);
  return copy == NULL ? NULL : strcpy(copy, text);
}

// ---- memory that is freed together -------------------------------------------------------------

struct fm_reserved
{
  struct fm_reserved * before;
};

void * fm_reserve(struct fm_memory * memory, size_t n, size_t bytes)
{
  const size_t size = (n > 0 ? n : 1u) * bytes;
  struct fm_reserved * made =
    memory->is_short ? NULL : calloc(1, sizeof(*made) + ALIGNMENT + size);
  if (made == NULL) {
    memory->is_short = true;
    return NULL;
  }
  made->before = memory->last;
  memory->last = made;
  return (uint8_t *)(made + 1) + (-(uintptr_t)(made + 1) % ALIGNMENT);
}

const char * fm_reserve_text(struct fm_memory * memory, const char * text)
{
  char * copy = fm_reserve(memory, strlen(text) + 1u, 1);
  return copy == NULL ? NULL : strcpy(copy, text);
}

void fm_memory_free(struct fm_memory * memory)
{
  while (memory->last != NULL) {
    struct fm_reserved * made = memory->last;
    memory->last = made->before;
    free(made);
  }
  memory->is_short = false;
}
