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

/// pairs.c: see pairs.h for the contract.

#include "pairs.h"

// ---- making ------------------------------------------------------------------------------------

// Append the parts of one variable; with `bytes`, place them there.
static void place(
  struct fm_block * block, const struct fm_half * half, uint64_t most, char * bytes,
  struct fm_pair_lists * lists, const uint64_t * seed)
{
  const uint64_t keys = fm_block_append(block, fm_keys_bytes(half->most), 1);
  const uint64_t first = fm_block_append(block, half->most, sizeof(uint32_t));
  const uint64_t next = fm_block_append(block, most, sizeof(uint32_t));
  const uint64_t before = fm_block_append(block, most, sizeof(uint32_t));
  const uint64_t owner = fm_block_append(block, most, sizeof(uint32_t));
  if (bytes != NULL) {
    lists->keys = fm_keys_make(bytes + keys, half->most, seed);
    lists->first = (uint32_t *)(void *)(bytes + first);
    lists->next = (uint32_t *)(void *)(bytes + next);
    lists->before = (uint32_t *)(void *)(bytes + before);
    lists->owner = (uint32_t *)(void *)(bytes + owner);
    lists->is_listed = half->n_listed > 0;
  }
}

uint64_t fm_pairs_bytes(const struct fm_half * halves, uint64_t most)
{
  struct fm_block block = {0, true};
  for (uint32_t h = 0; h < 2; ++h) {
    block.fits = block.fits && fm_keys_bytes(halves[h].most) > 0;
    place(&block, &halves[h], most, NULL, NULL, NULL);
  }
  return block.fits ? block.bytes : 0;
}

static bool add_listed(struct fm_keys * keys, const struct fm_half * half)
{
  for (uint32_t n = 0; n < half->n_listed; ++n) {
    const struct fm_key * key = &half->listed[n];
    if (key->size == 0 || fm_keys_find(keys, key->bytes, key->size) != FM_NO_SLOT ||
      fm_keys_add(keys, key->bytes, key->size) == FM_NO_SLOT)
    {
      return false;
    }
  }
  return true;
}

bool fm_pairs_make(
  struct fm_pairs * pairs, void * memory, const struct fm_half * halves, uint32_t most,
  const uint64_t seed[2])
{
  struct fm_block block = {0, true};
  bool is_made = true;
  for (uint32_t h = 0; h < 2; ++h) {
    place(&block, &halves[h], most, memory, &pairs->lists[h], seed);
    is_made = is_made && add_listed(&pairs->lists[h].keys, &halves[h]);
  }
  return is_made;
}

// ---- keys --------------------------------------------------------------------------------------

struct fm_key fm_pair_part(const struct fm_key * pair, uint32_t which)
{
  const uint32_t first = pair->bytes[0];
  return which == 0 ? (struct fm_key) {pair->bytes + 1, first} :
         (struct fm_key) {pair->bytes + 1 + first, pair->size - 1u - first};
}

static uint32_t find(const struct fm_pair_lists * lists, const struct fm_key * key)
{
  return fm_keys_find(&lists->keys, key->bytes, key->size);
}

bool fm_pairs_fit(const struct fm_pairs * pairs, const struct fm_key * pair)
{
  bool fits = pair->size > 2 && pair->bytes[0] > 0 && pair->bytes[0] < pair->size - 1u;
  for (uint32_t h = 0; h < 2 && fits; ++h) {
    const struct fm_key key = fm_pair_part(pair, h);
    fits = !pairs->lists[h].is_listed || find(&pairs->lists[h], &key) != FM_NO_SLOT;
  }
  return fits;
}

static void remove_unused(struct fm_pair_lists * lists, uint32_t key)
{
  if (lists->first[key] == 0 && !lists->is_listed) {
    fm_keys_remove(&lists->keys, key);
  }
}

bool fm_pairs_add(struct fm_pairs * pairs, uint32_t slot, const struct fm_key * pair)
{
  uint32_t owners[2] = {FM_NO_SLOT, FM_NO_SLOT};
  for (uint32_t h = 0; h < 2; ++h) {
    struct fm_pair_lists * lists = &pairs->lists[h];
    const struct fm_key key = fm_pair_part(pair, h);
    owners[h] = find(lists, &key);
    owners[h] = owners[h] != FM_NO_SLOT ? owners[h] :
      fm_keys_add(&lists->keys, key.bytes, key.size);
    if (owners[h] == FM_NO_SLOT) {
      if (h == 1) {
        remove_unused(&pairs->lists[0], owners[0]);
      }
      return false;
    }
  }
  for (uint32_t h = 0; h < 2; ++h) {
    struct fm_pair_lists * lists = &pairs->lists[h];
    const uint32_t second = lists->first[owners[h]];
    lists->owner[slot] = owners[h] + 1u;
    lists->before[slot] = 0;
    lists->next[slot] = second;
    lists->first[owners[h]] = slot + 1u;
    if (second > 0) {
      lists->before[second - 1u] = slot + 1u;
    }
  }
  return true;
}

bool fm_pairs_lack_second(const struct fm_pairs * pairs, const struct fm_key * pair)
{
  const struct fm_pair_lists * first = &pairs->lists[0];
  const struct fm_key key = fm_pair_part(pair, 0);
  return first->keys.n < first->keys.most || find(first, &key) != FM_NO_SLOT;
}

void fm_pairs_remove(struct fm_pairs * pairs, uint32_t slot)
{
  for (uint32_t h = 0; h < 2; ++h) {
    struct fm_pair_lists * lists = &pairs->lists[h];
    const uint32_t owner = lists->owner[slot] - 1u;
    const uint32_t next = lists->next[slot], before = lists->before[slot];
    *(before > 0 ? &lists->next[before - 1u] : &lists->first[owner]) = next;
    if (next > 0) {
      lists->before[next - 1u] = before;
    }
    remove_unused(lists, owner);
  }
}

uint32_t fm_pairs_first(
  const struct fm_pairs * pairs, uint32_t which, const struct fm_key * key)
{
  const struct fm_pair_lists * lists = &pairs->lists[which];
  const uint32_t owner = find(lists, key);
  return owner == FM_NO_SLOT || lists->first[owner] == 0 ? FM_NO_SLOT : lists->first[owner] - 1u;
}

uint32_t fm_pairs_next(const struct fm_pairs * pairs, uint32_t which, uint32_t slot)
{
  const uint32_t next = pairs->lists[which].next[slot];
  return next == 0 ? FM_NO_SLOT : next - 1u;
}
