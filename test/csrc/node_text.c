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

/// Prints what text.c makes of each line of the input, which is a kind and 64 bits: floats (f, d),
/// bytes (b) and times (t).

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "text.h"

int main(void)
{
  char kind;
  uint64_t bits;
  struct fm_text text = {NULL, 0, 0};
  while (scanf(" %c %" SCNu64, &kind, &bits) == 2) {
    const uint32_t low = (uint32_t)bits;
    float single;
    double value;
    memcpy(&single, &low, sizeof(single));
    memcpy(&value, &bits, sizeof(value));
    fm_text_clear(&text);
    if (kind == 'f') {
      fm_text_add_float(&text, (double)single, true);
    } else if (kind == 'd') {
      fm_text_add_float(&text, value, false);
    } else if (kind == 'b') {
      fm_text_add_bytes(&text, (const uint8_t *)&bits, sizeof(bits));
    } else {
      fm_text_add_short_seconds(&text, (int64_t)bits);
    }
    puts(fm_text_get(&text));
  }
  fm_text_free(&text);
  return 0;
}
