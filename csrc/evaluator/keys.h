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

/// keys.h: the keys of instances: bytes to slots, and back.
///
/// A table takes its memory once, for `most` keys. A key is 0 to 255 bytes of any content. Its
/// slot is a number below `most` that stays until the key is removed; slots do not depend on the
/// hash. The hash is SipHash-1-3 (Aumasson and Bernstein, 2012) with a seed, so that whoever
/// chooses the keys cannot make them collide. Keys that collide are found, in more time.
///
/// A key of at most FM_SHORT_KEY_BYTES bytes needs one chunk of memory, a longer one further
/// chunks, which are reserved for the worst case and only touched when needed. Not thread-safe. No
/// function allocates or blocks.

#ifndef KEYS_H_
#define KEYS_H_

#include "instance.h"
#include "kinds.h"

#define FM_SHORT_KEY_BYTES 18u

/// A part of a key. The first one of a slot has the number of the slot.
struct fm_key_chunk
{
  uint32_t next;  // of the key, or of those that are free; FM_NO_SLOT: none
  uint16_t size;  // of the first one: the bytes of the key + 1; 0: the slot is free
  uint8_t bytes[FM_SHORT_KEY_BYTES];
};

struct fm_key_entry
{
  uint32_t hash;
  uint32_t slot;  // + 1; 0: none
};

/// A table of keys. The caller owns the memory; only these functions change it.
struct fm_keys
{
  struct fm_key_entry * entries;
  struct fm_key_chunk * chunks;
  uint64_t seed[2];
  uint32_t n_entries;
  uint32_t most;
  uint32_t n;
  uint32_t end;         // slots that were ever in use are below
  uint32_t free_slots;  // a list
  uint32_t chunk_end;   // chunks after the first ones that were ever in use are below
  uint32_t free_chunks; // a list
};

/// The bytes of a table of at most 2^28 keys; 0 if there would be more. O(1).
FM_INTERNAL uint64_t fm_keys_bytes(uint64_t most);

/// Make a table in fm_keys_bytes bytes that are 0, aligned to FM_ALIGNMENT. O(1).
FM_INTERNAL struct fm_keys fm_keys_make(void * memory, uint32_t most, const uint64_t seed[2]);

/// The slot of a key, or FM_NO_SLOT. O(bytes of the key) expected.
FM_INTERNAL uint32_t fm_keys_find(const struct fm_keys * keys, const void * key, size_t size);

/// Give a key that is not in the table a slot. Returns FM_NO_SLOT if it has more than
/// FM_MOST_KEY_BYTES bytes, or `most` keys are there. O(bytes of the key) expected.
FM_INTERNAL uint32_t fm_keys_add(struct fm_keys * keys, const void * key, size_t size);

/// Remove the key of a slot, which has one. O(bytes of the key) expected.
FM_INTERNAL void fm_keys_remove(struct fm_keys * keys, uint32_t slot);

/// Whether a slot has a key. O(1).
FM_INTERNAL bool fm_keys_has(const struct fm_keys * keys, uint32_t slot);

/// Copy the key of a slot, which has one, to FM_MOST_KEY_BYTES bytes; returns its bytes.
FM_INTERNAL size_t fm_keys_copy(const struct fm_keys * keys, uint32_t slot, uint8_t * out);

#endif  // KEYS_H_
