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

/// seen.c: see seen.h for the contract.

#include "seen.h"

#include <string.h>

#include "fret_cdr.h"

#define MOST_STATE 4u  // of the primary states of lifecycle_msgs/msg/State: FINALIZED
#define BOUND UINT32_MAX

// ---- the state of a node -----------------------------------------------------------------------

static uint8_t read_numbered(struct fm_cdr * c)
{
  const uint8_t id = fm_cdr_uint8(c);
  fm_cdr_skip_strings(c, 1u);
  return id;
}

enum fm_found fm_read_state(const uint8_t * message, size_t size, struct fm_seen * seen)
{
  struct fm_cdr c;
  if (!fm_cdr_open(&c, message, size)) {
    return FM_FOUND_UNREADABLE;
  }
  fm_cdr_skip(&c, sizeof(uint64_t), sizeof(uint64_t));  // the time
  (void)read_numbered(&c);  // the transition
  (void)read_numbered(&c);  // the state before it
  const uint8_t state = read_numbered(&c);
  if (!c.ok) {
    return FM_FOUND_UNREADABLE;
  }
  *seen = (struct fm_seen) {FM_SEEN_INT32, {.i = state}, NULL, 0};
  return state >= 1u && state <= MOST_STATE ? FM_FOUND : FM_FOUND_NOTHING;
}

// ---- a parameter -------------------------------------------------------------------------------

static void skip_numbers(struct fm_cdr * c, uint32_t size)
{
  const uint32_t count = fm_cdr_count(c, BOUND);
  fm_cdr_skip_many(c, size, size, count);
}

// A rcl_interfaces/msg/ParameterValue, which has a field for each type.
static struct fm_seen read_value(struct fm_cdr * c)
{
  struct fm_seen seen = {fm_cdr_uint8(c), {.i = 0}, NULL, 0};
  const bool truth = fm_cdr_bool(c);
  const int64_t whole = fm_cdr_int64(c);
  const double number = fm_cdr_float64(c);
  const struct fm_cdr_text text = fm_cdr_string(c);
  skip_numbers(c, 1u);
  skip_numbers(c, 1u);
  skip_numbers(c, sizeof(int64_t));
  skip_numbers(c, sizeof(double));
  fm_cdr_skip_strings(c, fm_cdr_count(c, BOUND));
  if (seen.type == FM_SEEN_BOOL) {
    seen.value.i = truth;
  } else if (seen.type == FM_SEEN_INT64) {
    seen.value.i = whole;
  } else if (seen.type == FM_SEEN_FLOAT64) {
    seen.value.f = number;
  } else if (seen.type == FM_SEEN_TEXT) {
    seen.text = (const char *)text.bytes;
    seen.length = text.length;
  }
  return seen;
}

static bool is_named(const struct fm_cdr_text * text, const char * name)
{
  return fm_cdr_is(text, name, (uint32_t)strlen(name));
}

// Read a sequence of parameters. Returns whether the one with a name is among them.
static bool find_parameter(
  struct fm_cdr * c, const char * name, bool are_deleted, struct fm_seen * seen)
{
  const uint32_t count = fm_cdr_count(c, BOUND);
  bool is_found = false;
  for (uint32_t k = 0; k < count && c->ok; ++k) {
    const struct fm_cdr_text found = fm_cdr_string(c);
    const struct fm_seen value = read_value(c);
    if (c->ok && is_named(&found, name)) {
      *seen = are_deleted ? (struct fm_seen) {FM_SEEN_NOTHING, {.i = 0}, NULL, 0} : value;
      is_found = true;
    }
  }
  return is_found;
}

enum fm_found fm_read_parameter(
  const uint8_t * message, size_t size, const char * node, const char * name,
  struct fm_seen * seen)
{
  struct fm_cdr c;
  if (!fm_cdr_open(&c, message, size)) {
    return FM_FOUND_UNREADABLE;
  }
  fm_cdr_skip(&c, sizeof(int32_t), 2u * sizeof(int32_t));  // the time
  const struct fm_cdr_text of_node = fm_cdr_string(&c);
  if (!c.ok) {
    return FM_FOUND_UNREADABLE;
  }
  if (!is_named(&of_node, node)) {
    return FM_FOUND_NOTHING;
  }
  bool is_found = false;
  for (int k = 0; k < 3; ++k) {  // new, changed, deleted
    is_found = find_parameter(&c, name, k == 2, seen) || is_found;
  }
  return !c.ok ? FM_FOUND_UNREADABLE : is_found ? FM_FOUND : FM_FOUND_NOTHING;
}

// ---- messages of it ----------------------------------------------------------------------------

uint8_t * fm_write_header(uint8_t * out)
{
  const uint16_t one = 1u;
  memset(out, 0, 4u);
  memcpy(out + 1, &one, 1u);  // the first byte of a one: the byte order
  return out + 4;
}

uint8_t * fm_write_string(uint8_t * out, const char * text, uint32_t length)
{
  const uint32_t with_zero = length + 1u;
  memcpy(out, &with_zero, sizeof(with_zero));
  if (length > 0) {
    memcpy(out + sizeof(with_zero), text, length);
  }
  out[sizeof(with_zero) + length] = 0;
  return out + sizeof(with_zero) + with_zero;
}

size_t fm_write_seen(const struct fm_seen * seen, uint8_t * out)
{
  const uint8_t truth = seen->value.i != 0;
  const int32_t number = (int32_t)seen->value.i;
  uint8_t * const value = fm_write_header(out);
  switch (seen->type) {
    case FM_SEEN_BOOL:
      memcpy(value, &truth, sizeof(truth));
      return 4u + sizeof(truth);
    case FM_SEEN_INT32:
      memcpy(value, &number, sizeof(number));
      return 4u + sizeof(number);
    case FM_SEEN_TEXT:
      return (size_t)(fm_write_string(value, seen->text, seen->length) - out);
    default:
      memcpy(value, &seen->value, sizeof(seen->value));
      return 4u + sizeof(seen->value);
  }
}

int64_t fm_seen_bits(const struct fm_seen * seen)
{
  uint64_t hash = UINT64_C(14695981039346656037);  // FNV-1a
  if (seen->type != FM_SEEN_TEXT) {
    return seen->value.i;
  }
  for (uint32_t k = 0; k < seen->length; ++k) {
    hash = (hash ^ (uint8_t)seen->text[k]) * UINT64_C(1099511628211);
  }
  return (int64_t)hash;
}
