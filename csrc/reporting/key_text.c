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

/// key_text.c: see key_text.h for the contract.

#include "key_text.h"

#include "pairs.h"

static bool is_of_pairs(const struct fm_report_kind * about)
{
  return about->second[0] != '\0';
}

void fm_add_variables(struct fm_text * text, const struct fm_report_kind * about)
{
  fm_text_add(text, "%s%s%s", about->variable, is_of_pairs(about) ? " and " : "", about->second);
}

static void add_part(
  struct fm_text * text, const struct fm_report_kind * about, const struct fm_key * key,
  uint32_t which)
{
  const struct fm_key part = is_of_pairs(about) ? fm_pair_part(key, which) : *key;
  fm_text_add_bytes(text, part.bytes, part.size);
}

void fm_add_key(
  struct fm_text * text, const struct fm_report_kind * about, const uint8_t * key, size_t size)
{
  const struct fm_key whole = {key, (uint32_t)size};
  if (size == 0) {
    return;
  }
  add_part(text, about, &whole, 0);
  if (is_of_pairs(about)) {
    fm_text_add(text, "/");
    add_part(text, about, &whole, 1);
  }
}

void fm_add_named_key(
  struct fm_text * text, const struct fm_report_kind * about, const uint8_t * key, size_t size)
{
  const struct fm_key whole = {key, (uint32_t)size};
  fm_text_add(text, "%s=", about->variable);
  add_part(text, about, &whole, 0);
  if (is_of_pairs(about)) {
    fm_text_add(text, ",%s=", about->second);
    add_part(text, about, &whole, 1);
  }
}
