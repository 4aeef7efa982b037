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


/// payload.c: see payload.h for the contract.

#include "payload.h"

#include <string.h>

#include "outbox.h"
#include "pairs.h"

#define HEADER_BYTES 4u
#define MOST_PADDING 7u

size_t fm_payload_most(const struct fm_action * action)
{
  return action->payload_size + action->n_parts * (size_t)(FM_KEY_ROOM + MOST_PADDING);
}

static size_t align(uint8_t * out, size_t at, uint32_t to)
{
  const size_t padding = (to - (at - HEADER_BYTES) % to) % to;
  memset(out + at, 0, padding);
  return at + padding;
}

static size_t write_bytes(uint8_t * out, size_t at, const uint8_t * bytes, size_t size)
{
  memcpy(out + at, bytes, size);
  return at + size;
}

// The encoding is little endian.
static size_t write_length(uint8_t * out, size_t at, size_t length)
{
  const uint8_t bytes[] = {
    (uint8_t)length, (uint8_t)(length >> 8), (uint8_t)(length >> 16), (uint8_t)(length >> 24)};
  return write_bytes(out, align(out, at, sizeof(bytes)), bytes, sizeof(bytes));
}

static struct fm_key key_of(const struct fm_action * action, const uint8_t * key, uint32_t which)
{
  const struct fm_key whole = {key + 1, key[0]};
  return action->is_of_pairs ? fm_pair_part(&whole, which) : whole;
}

// The decimal number of a key, which was checked: an integer of up to 64 bits.
static size_t write_number(uint8_t * out, size_t at, const struct fm_key * key, uint32_t size)
{
  const bool is_negative = key->size > 0 && key->bytes[0] == '-';
  uint64_t number = 0;
  for (uint32_t k = is_negative ? 1 : 0; k < key->size; ++k) {
    number = 10u * number + (uint64_t)(key->bytes[k] - '0');
  }
  number = is_negative ? 0u - number : number;
  for (uint32_t k = 0; k < size; ++k) {
    out[at + k] = (uint8_t)(number >> (8u * k));
  }
  return at + size;
}

static size_t write_part(
  const struct fm_action * action, const struct fm_payload_part * part, const uint8_t * key,
  uint8_t * out, size_t at)
{
  const struct fm_key own = key_of(action, key, part->which);
  switch (part->kind) {
    case FM_PART_LENGTH:
      return write_length(
        out, at, part->size + part->n_keys * (size_t)key_of(action, key, 0).size +
        part->n_second * (size_t)key_of(action, key, 1).size);
    case FM_PART_KEY:
      return write_bytes(out, at, own.bytes, own.size);
    case FM_PART_NUMBER:
      return write_number(out, align(out, at, part->align), &own, part->size);
    case FM_PART_BYTES:
    default:
      return write_bytes(
        out, align(out, at, part->align), action->payload + part->at, part->size);
  }
}

size_t fm_payload_write(
  const struct fm_action * action, const uint8_t * key, uint8_t * out)
{
  if (action->n_parts == 0 || key == NULL) {
    return write_bytes(out, 0, action->payload, action->payload_size);
  }
  size_t at = write_bytes(out, 0, action->payload, HEADER_BYTES);
  for (uint32_t k = 0; k < action->n_parts; ++k) {
    at = write_part(action, &action->parts[k], key, out, at);
  }
  return at;
}
