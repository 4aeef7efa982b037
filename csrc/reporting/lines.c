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

/// lines.c: see lines.h for the contract.

#include "lines.h"

#include <stdlib.h>

void fm_lines_add(struct fm_lines * lines, enum fm_level level, const char * format, ...)
{
  struct fm_text text = {NULL, 0, 0};
  va_list arguments;
  va_start(arguments, format);
  fm_text_add_arguments(&text, format, arguments);
  va_end(arguments);
  struct fm_line * moved = text.bytes == NULL ? NULL :
    fm_with_room(lines->lines, lines->n, &lines->capacity, sizeof(*lines->lines));
  if (moved == NULL) {
    fm_text_free(&text);
    return;
  }
  lines->lines = moved;
  lines->lines[lines->n++] = (struct fm_line) {(uint32_t)level, text.bytes};
}

bool fm_passes(int64_t * next, int64_t now, int64_t interval)
{
  if (now < *next) {
    return false;
  }
  *next = now + interval;
  return true;
}

void fm_lines_clear(struct fm_lines * lines)
{
  for (uint32_t k = 0; k < lines->n; ++k) {
    free(lines->lines[k].text);
  }
  lines->n = 0;
}

void fm_lines_free(struct fm_lines * lines)
{
  fm_lines_clear(lines);
  free(lines->lines);
  *lines = (struct fm_lines) {NULL, 0, 0};
}
