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

/// given.c: see given.h for the contract.

#include "given.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

static void add_value(struct fm_text * text, const struct fm_given * given)
{
  switch (given->type) {
    case FM_UNSET: fm_text_add(text, "not set"); break;
    case FM_TRUTH: fm_text_add(text, "%s", given->is_true ? "true" : "false"); break;
    case FM_WHOLE: fm_text_add(text, "%" PRId64, given->whole); break;
    case FM_REAL: fm_text_add_float(text, given->real, false); break;
    case FM_WORD: fm_text_add(text, "'%s'", given->word); break;
    default: fm_text_add(text, "a list"); break;
  }
}

void fm_text_refuse(
  struct fm_text * text, const struct fm_given * given, const char * wanted)
{
  fm_text_join(text, "\n", "parameter '%s' is ", given->name);
  add_value(text, given);
  fm_text_add(text, ", and has to be %s", wanted);
}

void fm_refuse_value(
  struct fm_lines * lines, const struct fm_given * given, const char * wanted)
{
  struct fm_text text = {NULL, 0, 0};
  fm_text_refuse(&text, given, wanted);
  fm_lines_add(lines, FM_ERROR, "%s", fm_text_get(&text));
  fm_text_free(&text);
}

// How many characters have to be inserted, removed or replaced; `row` has one element more than
// `other` has characters.
static size_t distance(const char * one, const char * other, size_t * row)
{
  const size_t length = strlen(other);
  for (size_t k = 0; k <= length; ++k) {
    row[k] = k;
  }
  for (size_t n = 1; one[n - 1u] != '\0'; ++n) {
    size_t diagonal = row[0];
    row[0] = n;
    for (size_t k = 1; k <= length; ++k) {
      const size_t replaced = diagonal + (one[n - 1u] == other[k - 1u] ? 0u : 1u);
      const size_t changed = 1u + (row[k] < row[k - 1u] ? row[k] : row[k - 1u]);
      diagonal = row[k];
      row[k] = replaced < changed ? replaced : changed;
    }
  }
  return row[length];
}

void fm_text_hint(
  struct fm_text * text, const char * word, const char * const * words, uint32_t n)
{
  size_t * row = calloc(strlen(word) + 1u, sizeof(*row));
  size_t least = strlen(word) / 3u + 1u;
  const char * nearest = NULL;
  for (uint32_t k = 0; row != NULL && k < n; ++k) {
    const size_t found = distance(words[k], word, row);
    nearest = found < least ? words[k] : nearest;
    least = found < least ? found : least;
  }
  if (nearest != NULL) {
    fm_text_add(text, "; did you mean '%s'?", nearest);
  }
  free(row);
}
