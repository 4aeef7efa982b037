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

/// text.h: texts that grow, numbers as the node in Python writes them, and memory that is freed
/// together.
///
/// Not thread-safe. When memory is short a text is cut off; nothing fails. Amortised O(characters
/// added).

#ifndef TEXT_H_
#define TEXT_H_

#include <stdarg.h>

#include "fret_monitor.h"

#if defined(__GNUC__)
#define FM_PRINTF(place, first) __attribute__((format(printf, place, first)))
#else
#define FM_PRINTF(place, first)
#endif

/// In nanoseconds.
#define FM_SECOND INT64_C(1000000000)

/// Zeroed: an empty text. The owner calls fm_text_free.
struct fm_text
{
  char * bytes;
  size_t length;
  size_t capacity;
};

/// The text, ended by a zero; valid until it is changed.
const char * fm_text_get(const struct fm_text * text);

void fm_text_clear(struct fm_text * text);
void fm_text_free(struct fm_text * text);

/// Add text, in the format of printf.
void fm_text_add(struct fm_text * text, const char * format, ...) FM_PRINTF(2, 3);
void fm_text_add_arguments(struct fm_text * text, const char * format, va_list arguments);

/// Add a text in the format of printf, after `separator` unless the text is empty.
void fm_text_join(struct fm_text * text, const char * separator, const char * format, ...)
FM_PRINTF(3, 4);

/// Replace the text by `n` words, sorted, each once, with commas; sorts `words`. O(n log n).
void fm_text_sort(struct fm_text * text, const char ** words, uint32_t n);

/// Add bytes that somebody sent: each byte outside characters of UTF-8 that can be shown is
/// a '?'.
void fm_text_add_bytes(struct fm_text * text, const uint8_t * bytes, size_t size);

/// Names in one line: the first five, and how many more there are. Zeroed: none. The owner frees
/// `text`.
struct fm_names
{
  struct fm_text text;
  uint32_t n;
};

/// Add a name; or one in quotes, with a note after it.
void fm_names_add(struct fm_names * names, const char * separator, const char * name);
void fm_names_add_quoted(struct fm_names * names, const char * name, const char * note);

/// The names. To be called once.
const char * fm_names_get(struct fm_names * names);

/// Add the shortest decimal that rounds to the same float64, or float32 if `is_single`, spelled as
/// Python does.
void fm_text_add_float(struct fm_text * text, double value, bool is_single);

/// Add a time in seconds, exactly: with nine decimals, or without zeros at its end.
void fm_text_add_seconds(struct fm_text * text, int64_t nanoseconds);
void fm_text_add_short_seconds(struct fm_text * text, int64_t nanoseconds);

/// Return an array of `n` elements with room for one more, to be kept in place of it; NULL if
/// memory is short, and it stays as it was. `bytes`: of an element. Amortised O(1).
void * fm_with_room(void * array, uint32_t n, uint32_t * capacity, size_t bytes);

/// Return a copy that the caller frees; NULL if memory is short.
char * fm_copy_of(const char * text);

/// Memory that is freed together. Zeroed: none. The owner calls fm_memory_free.
struct fm_memory
{
  struct fm_reserved * last;
  bool is_short;  // some could not be reserved: NULL was returned, as it is from then on
};

/// Return `n` zeroed elements, or one if there are none, aligned for the engine. `bytes`: of an
/// element. What is never used is not touched, if it is large.
void * fm_reserve(struct fm_memory * memory, size_t n, size_t bytes);

/// Return a copy of a text; NULL if memory is short.
const char * fm_reserve_text(struct fm_memory * memory, const char * text);

void fm_memory_free(struct fm_memory * memory);

#endif  // TEXT_H_
