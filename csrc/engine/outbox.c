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

/// outbox.c: see outbox.h for the contract.

#define _POSIX_C_SOURCE 200809L

#include "outbox.h"

#include <stdlib.h>
#include <string.h>

#include "instance.h"
#include "thread.h"

#define SECOND_NS 1000000000
#define FIRST_CAPACITY 64u
#define MOST_VIOLATIONS (1u << 20)
#define MOST_DETAILS 1024u
#define DETAIL_MEMORY_BYTES (4u << 20)

// The details of a requirement: those of a second, and counters.
struct fm_quota
{
  int64_t second;
  uint32_t used;
  uint32_t queued;      // that were not taken yet
  uint64_t suppressed;
  uint64_t violations;  // with and without details
};

bool fm_outbox_init(struct fm_outbox * outbox, const struct fm_outbox_size * size)
{
  memset(outbox, 0, sizeof(*outbox));
  outbox->size = *size;
  outbox->violations = calloc(FIRST_CAPACITY, sizeof(*outbox->violations));
  outbox->quotas = calloc((size_t)size->n_requirements + 1, sizeof(*outbox->quotas));
  outbox->capacity = FIRST_CAPACITY;
  return outbox->violations != NULL && outbox->quotas != NULL;
}

void fm_outbox_free(struct fm_outbox * outbox)
{
  free(outbox->violations);
  free(outbox->keys);
  free(outbox->quotas);
  free(outbox->details);
}

// ---- violations --------------------------------------------------------------------------------

static uint32_t place_of(const struct fm_outbox * outbox, uint32_t k)
{
  return (outbox->begin + k) & (outbox->capacity - 1u);
}

static bool grow(struct fm_outbox * outbox)
{
  const uint32_t capacity = 2u * outbox->capacity;
  struct fm_violation * violations =
    capacity > MOST_VIOLATIONS ? NULL : malloc(capacity * sizeof(*violations));
  if (violations == NULL) {
    return false;
  }
  for (uint32_t k = 0; k < outbox->n_violations; ++k) {
    violations[k] = outbox->violations[place_of(outbox, k)];
  }
  free(outbox->violations);
  outbox->violations = violations;
  outbox->begin = 0;
  outbox->capacity = capacity;
  return true;
}

// Room for one more key: those that were taken are overwritten, or it doubles.
static bool make_room_for_key(struct fm_outbox * outbox)
{
  if (outbox->keys_end + FM_KEY_ROOM <= outbox->keys_room) {
    return true;
  }
  if (outbox->keys_begin > outbox->keys_room / 2) {
    outbox->keys_end -= outbox->keys_begin;
    memmove(outbox->keys, outbox->keys + outbox->keys_begin, outbox->keys_end);
    outbox->keys_begin = 0;
    return true;
  }
  const size_t room = outbox->keys_room == 0 ? 16u * FM_KEY_ROOM : 2u * outbox->keys_room;
  uint8_t * keys = realloc(outbox->keys, room);
  if (keys == NULL) {
    return false;
  }
  outbox->keys = keys;
  outbox->keys_room = room;
  return true;
}

static size_t write_key(uint8_t * out, const struct fm_key * key)
{
  out[0] = (uint8_t)key->size;
  if (key->size > 0) {
    memcpy(out + 1, key->bytes, key->size);
  }
  return key->size + (size_t)1;
}

static void add_violation(
  struct fm_outbox * outbox, const struct fm_violation * violation, const struct fm_key * key)
{
  if ((outbox->n_violations == outbox->capacity && !grow(outbox)) ||
    (outbox->size.has_keys && !make_room_for_key(outbox)))
  {
    outbox->unpublished += 1;
    return;
  }
  outbox->violations[place_of(outbox, outbox->n_violations)] = *violation;
  outbox->n_violations += 1;
  if (outbox->size.has_keys) {
    outbox->keys_end += write_key(outbox->keys + outbox->keys_end, key);
  }
}

static void take_key(struct fm_outbox * outbox, uint8_t * out)
{
  const uint8_t * kept = outbox->keys + outbox->keys_begin;
  if (out != NULL) {
    memcpy(out, kept, kept[0] + (size_t)1);
  }
  outbox->keys_begin += kept[0] + (size_t)1;
}

uint32_t fm_outbox_take(
  struct fm_outbox * outbox, struct fm_violation * out, uint8_t * keys, uint32_t room)
{
  const uint32_t n = outbox->n_violations < room ? outbox->n_violations : room;
  for (uint32_t k = 0; k < n; ++k) {
    out[k] = outbox->violations[place_of(outbox, k)];
    if (outbox->size.has_keys) {
      take_key(outbox, keys == NULL ? NULL : keys + k * FM_KEY_ROOM);
    } else if (keys != NULL) {
      keys[k * FM_KEY_ROOM] = 0;
    }
  }
  outbox->begin = place_of(outbox, n);
  outbox->n_violations -= n;
  if (outbox->n_violations == 0) {
    outbox->keys_begin = 0;
    outbox->keys_end = 0;
  }
  return n;
}

// ---- details -----------------------------------------------------------------------------------

static bool is_within_limit(const struct fm_outbox * outbox, struct fm_quota * quota)
{
  const int64_t second = fm_steady_time() / SECOND_NS;
  if (second != quota->second) {
    quota->second = second;
    quota->used = 0;
  }
  return quota->used < outbox->most_details_per_s && outbox->n_details < outbox->detail_slots;
}

static void write_flags(uint8_t * flags, const struct fm_outbox_scope * scope)
{
  for (uint32_t i = 0; i < scope->monitor->n_inputs; ++i) {
    const unsigned has_value = fm_evaluator_has_value(scope->evaluator, i) ? 1u : 0u;
    const unsigned is_stale = fm_evaluator_is_stale(scope->evaluator, i) ? 2u : 0u;
    flags[i] = (uint8_t)(has_value | is_stale);
  }
}

// How far a violation went beyond, with its instant as a stamp.
static struct fm_closest beyond_of(const struct fm_outbox_scope * scope, uint32_t requirement)
{
  struct fm_closest beyond = fm_evaluator_beyond(scope->evaluator, requirement);
  beyond.margin.instant = fm_later(beyond.margin.instant, scope->later);
  return beyond;
}

static void add_detail(
  struct fm_outbox * outbox, const struct fm_violation * violation,
  const struct fm_outbox_scope * scope)
{
  struct fm_quota * quota = &outbox->quotas[violation->requirement];
  if (!is_within_limit(outbox, quota)) {
    quota->suppressed += violation->is_recovery ? 0u : 1u;
    return;
  }
  const uint32_t own = violation->requirement - scope->first;
  const struct fm_detail detail = {
    *violation, quota->suppressed, quota->violations,
    fm_evaluator_requirement_counts(scope->evaluator, own).test,
    beyond_of(scope, own)};
  const size_t inputs_bytes = (size_t)scope->monitor->inputs_bytes;
  const uint32_t place = (outbox->detail_begin + outbox->n_details) % outbox->detail_slots;
  uint8_t * slot = outbox->details + place * outbox->detail_slot_bytes;
  memcpy(slot, &detail, sizeof(detail));
  memcpy(slot + sizeof(detail), fm_evaluator_inputs(scope->evaluator), inputs_bytes);
  write_flags(slot + sizeof(detail) + inputs_bytes, scope);
  if (outbox->size.has_keys) {
    (void)write_key(
      slot + sizeof(detail) + inputs_bytes + scope->monitor->n_inputs, &scope->key);
  }
  quota->used += 1;
  quota->queued += 1;
  outbox->n_details += 1;
}

void fm_outbox_add(
  struct fm_outbox * outbox, const struct fm_violation * violation,
  const struct fm_outbox_scope * scope)
{
  outbox->quotas[violation->requirement].violations += violation->is_recovery ? 0u : 1u;
  if (!violation->is_recovery || outbox->keeps_recoveries) {
    add_violation(outbox, violation, &scope->key);
  }
  if (outbox->wants_details) {
    add_detail(outbox, violation, scope);
  }
}

size_t fm_outbox_detail_bytes(const struct fm_outbox * outbox)
{
  return sizeof(struct fm_detail) + (size_t)outbox->size.inputs_bytes +
         (outbox->size.has_keys ? FM_KEY_ROOM : 0u);
}

static bool make_details(struct fm_outbox * outbox)
{
  outbox->detail_slot_bytes = (fm_outbox_detail_bytes(outbox) + 15u) & ~(size_t)15u;
  const size_t slots = DETAIL_MEMORY_BYTES / outbox->detail_slot_bytes + 1u;
  outbox->detail_slots = slots > MOST_DETAILS ? MOST_DETAILS : (uint32_t)slots;
  outbox->details = malloc(outbox->detail_slots * outbox->detail_slot_bytes);
  return outbox->details != NULL;
}

static void drop_details(struct fm_outbox * outbox)
{
  for (uint32_t r = 0; outbox->n_details > 0 && r < outbox->size.n_requirements; ++r) {
    outbox->quotas[r].queued = 0;
  }
  outbox->n_details = 0;
}

void fm_outbox_want_details(
  struct fm_outbox * outbox, bool are_wanted, uint32_t most_per_s)
{
  outbox->most_details_per_s = most_per_s;
  outbox->wants_details = are_wanted && (outbox->details != NULL || make_details(outbox));
  if (!outbox->wants_details) {
    drop_details(outbox);  // a later listener must not receive old details
  }
}

bool fm_outbox_take_detail(struct fm_outbox * outbox, struct fm_detail * out)
{
  if (outbox->n_details == 0) {
    return false;
  }
  memcpy(
    out, outbox->details + outbox->detail_begin * outbox->detail_slot_bytes,
    fm_outbox_detail_bytes(outbox));
  outbox->detail_begin = (outbox->detail_begin + 1u) % outbox->detail_slots;
  outbox->n_details -= 1;
  outbox->quotas[out->violation.requirement].queued -= 1;
  return true;
}

struct fm_detail_counts fm_outbox_counts(const struct fm_outbox * outbox, uint32_t requirement)
{
  const struct fm_quota * quota = &outbox->quotas[requirement];
  return (struct fm_detail_counts) {quota->violations, quota->queued, false};
}
