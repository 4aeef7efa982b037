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

#include "words.h"

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
  struct fm_text value = {NULL, 0, 0};
  add_value(&value, given);
  fm_text_join(text, "\n", FM_WORDS_NOT_WANTED, given->name, fm_text_get(&value), wanted);
  fm_text_free(&value);
}
