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

/// keys.c: see keys.h for the contract. Open addressing with linear probing: an entry that is
/// removed is filled by a later one that may lie there, so that no tombstones are left.

#include "keys.h"

#include <string.h>

#define FM_MOST_KEYS (UINT64_C(1) << 28)
#define MOST_CHUNKS ((FM_MOST_KEY_BYTES + FM_SHORT_KEY_BYTES - 1u) / FM_SHORT_KEY_BYTES)

// ---- the hash ----------------------------------------------------------------------------------

// Tests replace it by one that collides.
#ifndef FM_KEY_HASH
#define FM_KEY_HASH siphash

FM_INLINE uint64_t rotate(uint64_t word, unsigned by) {return word << by | word >> (64u - by);}

FM_INLINE void mix(uint64_t * v)
{
  v[0] += v[1];
  v[2] += v[3];
  v[1] = rotate(v[1], 13) ^ v[0];
  v[3] = rotate(v[3], 16) ^ v[2];
  v[0] = rotate(v[0], 32);
  v[2] += v[1];
  v[0] += v[3];
  v[1] = rotate(v[1], 17) ^ v[2];
  v[3] = rotate(v[3], 21) ^ v[0];
  v[2] = rotate(v[2], 32);
}

// Compilers make one load of it.
static uint64_t whole_word(const uint8_t * bytes)
{
  return (uint64_t)bytes[0] | (uint64_t)bytes[1] << 8 | (uint64_t)bytes[2] << 16 |
         (uint64_t)bytes[3] << 24 | (uint64_t)bytes[4] << 32 | (uint64_t)bytes[5] << 40 |
         (uint64_t)bytes[6] << 48 | (uint64_t)bytes[7] << 56;
}

// The last bytes of a key, after its whole words.
static uint64_t rest_of(const uint8_t * bytes, size_t size)
{
  const size_t n = size % 8;
  uint64_t word = 0;
  if (size >= 8) {
    return n == 0 ? 0 : whole_word(bytes + size - 8) >> (64 - 8 * n);
  }
  for (size_t i = 0; i < n; ++i) {
    word |= (uint64_t)bytes[i] << (8u * i);
  }
  return word;
}

static uint64_t siphash(const uint64_t * seed, const uint8_t * bytes, size_t size)
{
  uint64_t v[4] = {
    seed[0] ^ UINT64_C(0x736f6d6570736575), seed[1] ^ UINT64_C(0x646f72616e646f6d),
    seed[0] ^ UINT64_C(0x6c7967656e657261), seed[1] ^ UINT64_C(0x7465646279746573)};
  size_t place = 0;
  for (; size - place >= 8; place += 8) {
    const uint64_t word = whole_word(bytes + place);
    v[3] ^= word;
    mix(v);
    v[0] ^= word;
  }
  const uint64_t last = rest_of(bytes, size) | (uint64_t)size << 56;
  v[3] ^= last;
  mix(v);
  v[0] ^= last;
  v[2] ^= 0xffu;
  mix(v);
  mix(v);
  mix(v);
  return v[0] ^ v[1] ^ v[2] ^ v[3];
}

#endif  // FM_KEY_HASH

static uint32_t hash_of(const struct fm_keys * keys, const void * key, size_t size)
{
  return (uint32_t)FM_KEY_HASH(keys->seed, key, size);
}

// ---- layout ------------------------------------------------------------------------------------

// At most three fifths are in use, and one at least is not.
static uint64_t entries_for(uint64_t most)
{
  return most + 2 * most / 3 + 1;
}

uint64_t fm_keys_bytes(uint64_t most)
{
  struct fm_block block = {0, true};
  if (most == 0 || most > FM_MOST_KEYS) {
    return 0;
  }
  (void)fm_block_append(&block, entries_for(most), sizeof(struct fm_key_entry));
  (void)fm_block_append(&block, most * MOST_CHUNKS, sizeof(struct fm_key_chunk));
  return block.fits ? block.bytes : 0;
}

struct fm_keys fm_keys_make(void * memory, uint32_t most, const uint64_t seed[2])
{
  struct fm_block block = {0, true};
  struct fm_keys keys = {0};
  char * const bytes = memory;
  const uint64_t n = entries_for(most);
  keys.entries = (struct fm_key_entry *)(void *)
    (bytes + fm_block_append(&block, n, sizeof(struct fm_key_entry)));
  keys.chunks = (struct fm_key_chunk *)(void *)
    (bytes + fm_block_append(&block, (uint64_t)most * MOST_CHUNKS, sizeof(struct fm_key_chunk)));
  keys.n_entries = (uint32_t)n;
  keys.most = most;
  keys.seed[0] = seed[0];
  keys.seed[1] = seed[1];
  keys.free_slots = FM_NO_SLOT;
  keys.free_chunks = FM_NO_SLOT;
  keys.chunk_end = most;
  return keys;
}

// ---- chunks ------------------------------------------------------------------------------------

static size_t part_of(size_t size) {return size < FM_SHORT_KEY_BYTES ? size : FM_SHORT_KEY_BYTES;}

static bool is_key(const struct fm_keys * keys, uint32_t slot, const uint8_t * key, size_t size)
{
  const struct fm_key_chunk * chunk = &keys->chunks[slot];
  if (chunk->size != size + 1) {
    return false;
  }
  while (memcmp(chunk->bytes, key, part_of(size)) == 0) {
    if (size <= FM_SHORT_KEY_BYTES) {
      return true;
    }
    key += FM_SHORT_KEY_BYTES;
    size -= FM_SHORT_KEY_BYTES;
    chunk = &keys->chunks[chunk->next];
  }
  return false;
}

// There is one: as many are reserved as `most` keys can need.
static uint32_t take_chunk(struct fm_keys * keys)
{
  const uint32_t chunk = keys->free_chunks;
  if (chunk == FM_NO_SLOT) {
    keys->chunk_end += 1;
    return keys->chunk_end - 1;
  }
  keys->free_chunks = keys->chunks[chunk].next;
  return chunk;
}

static uint32_t take_slot(struct fm_keys * keys)
{
  const uint32_t slot = keys->free_slots;
  if (slot == FM_NO_SLOT) {
    keys->end += 1;
    return keys->end - 1;
  }
  keys->free_slots = keys->chunks[slot].next;
  return slot;
}

static void write_key(struct fm_keys * keys, uint32_t slot, const uint8_t * key, size_t size)
{
  struct fm_key_chunk * chunk = &keys->chunks[slot];
  chunk->size = (uint16_t)(size + 1);
  memcpy(chunk->bytes, key, part_of(size));
  while (size > FM_SHORT_KEY_BYTES) {
    key += FM_SHORT_KEY_BYTES;
    size -= FM_SHORT_KEY_BYTES;
    chunk->next = take_chunk(keys);
    chunk = &keys->chunks[chunk->next];
    memcpy(chunk->bytes, key, part_of(size));
  }
}

static void free_key(struct fm_keys * keys, uint32_t slot)
{
  struct fm_key_chunk * const first = &keys->chunks[slot];
  size_t size = first->size - 1u;
  uint32_t chunk = first->next;
  for (; size > FM_SHORT_KEY_BYTES; size -= FM_SHORT_KEY_BYTES) {
    const uint32_t next = keys->chunks[chunk].next;
    keys->chunks[chunk].next = keys->free_chunks;
    keys->free_chunks = chunk;
    chunk = next;
  }
  first->size = 0;
  first->next = keys->free_slots;
  keys->free_slots = slot;
}

// ---- the table ---------------------------------------------------------------------------------

FM_INLINE uint32_t home_of(const struct fm_keys * keys, uint32_t hash)
{
  return (uint32_t)((uint64_t)hash * keys->n_entries >> 32);
}

FM_INLINE uint32_t after(const struct fm_keys * keys, uint32_t place)
{
  return place + 1 == keys->n_entries ? 0 : place + 1;
}

// How many entries after `from` a place is.
static uint32_t distance(const struct fm_keys * keys, uint32_t from, uint32_t place)
{
  return place >= from ? place - from : place + (keys->n_entries - from);
}

uint32_t fm_keys_find(const struct fm_keys * keys, const void * key, size_t size)
{
  if (size > FM_MOST_KEY_BYTES) {
    return FM_NO_SLOT;
  }
  const uint32_t hash = hash_of(keys, key, size);
  for (uint32_t place = home_of(keys, hash);; place = after(keys, place)) {
    const struct fm_key_entry * entry = &keys->entries[place];
    if (entry->slot == 0) {
      return FM_NO_SLOT;
    }
    if (entry->hash == hash && is_key(keys, entry->slot - 1, key, size)) {
      return entry->slot - 1;
    }
  }
}

uint32_t fm_keys_add(struct fm_keys * keys, const void * key, size_t size)
{
  if (size > FM_MOST_KEY_BYTES || keys->n == keys->most) {
    return FM_NO_SLOT;
  }
  const uint32_t slot = take_slot(keys);
  const uint32_t hash = hash_of(keys, key, size);
  uint32_t place = home_of(keys, hash);
  while (keys->entries[place].slot != 0) {
    place = after(keys, place);
  }
  write_key(keys, slot, key, size);
  keys->entries[place].hash = hash;
  keys->entries[place].slot = slot + 1;
  keys->n += 1;
  return slot;
}

// The entries from `place` to the next gap move up, unless one would come before its own place.
static void close_gap(struct fm_keys * keys, uint32_t place)
{
  uint32_t gap = place;
  for (uint32_t k = after(keys, gap); keys->entries[k].slot != 0; k = after(keys, k)) {
    const uint32_t own = home_of(keys, keys->entries[k].hash);
    if (distance(keys, own, k) >= distance(keys, gap, k)) {
      keys->entries[gap] = keys->entries[k];
      gap = k;
    }
  }
  keys->entries[gap].slot = 0;
}

void fm_keys_remove(struct fm_keys * keys, uint32_t slot)
{
  uint8_t key[FM_MOST_KEY_BYTES];
  const size_t size = fm_keys_copy(keys, slot, key);
  uint32_t place = home_of(keys, hash_of(keys, key, size));
  while (keys->entries[place].slot != slot + 1) {
    place = after(keys, place);
  }
  close_gap(keys, place);
  free_key(keys, slot);
  keys->n -= 1;
}

bool fm_keys_has(const struct fm_keys * keys, uint32_t slot)
{
  return slot < keys->end && keys->chunks[slot].size != 0;
}

size_t fm_keys_copy(const struct fm_keys * keys, uint32_t slot, uint8_t * out)
{
  const struct fm_key_chunk * chunk = &keys->chunks[slot];
  const size_t size = chunk->size - 1u;
  size_t place = 0;
  for (; size - place > FM_SHORT_KEY_BYTES; place += FM_SHORT_KEY_BYTES) {
    memcpy(out + place, chunk->bytes, FM_SHORT_KEY_BYTES);
    chunk = &keys->chunks[chunk->next];
  }
  memcpy(out + place, chunk->bytes, size - place);
  return size;
}
