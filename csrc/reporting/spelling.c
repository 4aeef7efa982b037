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

/// spelling.c: see spelling.h for the contract.

#include "spelling.h"

#include <string.h>

// ---- for FRET ----------------------------------------------------------------------------------

static const char special[] = ".%$#&@!?-*=^ +;:,/\\|~<>(){}[]'\"`";
enum { UNQUOTED = 3 };  // of these, a name with others is quoted
static const char codes[] =  // three letters for each
  "DOTPRCDOLHSHAMPATSBNGQUSHYPASTEQUCRTSPCPLSSEMCLNCMA"
  "FSLBSLVBRTLDLANRANLPRRPRLCBRCBLSQRSQSQTDQTBQT";

void fm_text_add_spelled(struct fm_text * text, const char * name)
{
  name += strspn(name, "\"");
  size_t length = strlen(name);
  while (length > 0 && name[length - 1u] == '"') {
    --length;
  }
  const bool is_quoted = strcspn(name, special + UNQUOTED) < length;
  fm_text_add(text, "%s", is_quoted ? "_DQT_" : "");
  for (size_t k = 0; k < length; ++k) {
    const char * found = strchr(special, name[k]);
    if (found == NULL) {
      fm_text_add(text, "%c", name[k]);
    } else {
      fm_text_add(text, "_%.3s_", codes + 3 * (found - special));
    }
  }
  fm_text_add(text, "%s", is_quoted ? "_DQT_" : "");
}

bool fm_is_same_name(const char * one, const char * other)
{
  struct fm_text texts[2] = {{NULL, 0, 0}, {NULL, 0, 0}};
  fm_text_add_spelled(&texts[0], one);
  fm_text_add_spelled(&texts[1], other);
  const bool is_same = strcmp(fm_text_get(&texts[0]), fm_text_get(&texts[1])) == 0;
  fm_text_free(&texts[0]);
  fm_text_free(&texts[1]);
  return is_same;
}

// ---- alike -------------------------------------------------------------------------------------

// How many characters match: the longest common part, and likewise before and after it.
static size_t count_matching(const char * one, size_t n_one, const char * other, size_t n_other)
{
  size_t most = 0;
  size_t begin = 0;
  size_t other_begin = 0;
  for (size_t k = 0; k < n_one; ++k) {
    for (size_t j = 0; j < n_other; ++j) {
      size_t n = 0;
      while (k + n < n_one && j + n < n_other && one[k + n] == other[j + n]) {
        ++n;
      }
      if (n > most) {
        most = n;
        begin = k;
        other_begin = j;
      }
    }
  }
  const size_t end = begin + most;
  const size_t other_end = other_begin + most;
  return most == 0 ? 0 : most + count_matching(one, begin, other, other_begin) +
         count_matching(one + end, n_one - end, other + other_end, n_other - other_end);
}

// The share of characters that match, of a million; 0 if they are too few.
static size_t similarity(const char * one, const char * other)
{
  const size_t all = strlen(one) + strlen(other);
  const size_t matching = 2u * count_matching(one, strlen(one), other, strlen(other));
  return 10u * matching < 6u * all ? 0 : 1000000u * matching / (all == 0 ? 1u : all);
}

// Whether one of two names is more similar to a name, or follows the other in the alphabet.
static bool is_before(const char * one, const char * other, const char * name)
{
  const size_t found = similarity(one, name);
  const size_t others = similarity(other, name);
  return found > others || (found == others && strcmp(one, other) > 0);
}

bool fm_text_add_hint(
  struct fm_text * text, const char * name, const char * const * names, uint32_t n)
{
  const char * last = NULL;
  for (int shown = 0; shown < 3; ++shown) {
    const char * next = NULL;
    for (uint32_t k = 0; k < n; ++k) {
      if (similarity(names[k], name) > 0 && (last == NULL || is_before(last, names[k], name)) &&
        (next == NULL || is_before(names[k], next, name)))
      {
        next = names[k];
      }
    }
    if (next == NULL) {
      break;
    }
    fm_text_add(text, "%s'%s'", shown == 0 ? "did you mean " : " or ", next);
    last = next;
  }
  fm_text_add(text, "%s", last == NULL ? "" : "?");
  return last != NULL;
}
