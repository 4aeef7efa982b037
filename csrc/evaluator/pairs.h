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

/// pairs.h: an index of the pairs of a kind of two variables, by each of its two keys.
///
/// A pair is an instance; its slot is that of its key in the pool. For each variable there is a
/// table of the keys that are in a pair, or listed, and a list of the pairs of each. A listed
/// variable has no other keys. Not thread-safe. No function allocates or blocks.

#ifndef PAIRS_H_
#define PAIRS_H_

#include "keys.h"

/// A list of pairs for each key of one variable. Numbers of slots are + 1; 0: none.
struct fm_pair_lists
{
  struct fm_keys keys;
  uint32_t * first;    // a key: its first pair
  uint32_t * next;     // a pair: the next one of its key
  uint32_t * before;   // a pair: the one before it
  uint32_t * owner;    // a pair: its key
  bool is_listed;
};

struct fm_pairs
{
  struct fm_pair_lists lists[2];
};

/// The first or the second key of a pair (`which`: 0 or 1). O(1).
FM_INTERNAL struct fm_key fm_pair_part(const struct fm_key * pair, uint32_t which);

/// The bytes of an index of at most `most` pairs; 0 if they do not fit. O(1).
FM_INTERNAL uint64_t fm_pairs_bytes(const struct fm_half * halves, uint64_t most);

/// Make an index without pairs in fm_pairs_bytes bytes that are 0, aligned to FM_ALIGNMENT.
/// Returns false if listed keys are more than `most`, not distinct, or empty. O(listed keys).
FM_INTERNAL bool fm_pairs_make(
  struct fm_pairs * pairs, void * memory, const struct fm_half * halves, uint32_t most,
  const uint64_t seed[2]);

/// Whether a key is one of two keys, which are among those that are listed, where they are.
/// O(bytes) expected.
FM_INTERNAL bool fm_pairs_fit(const struct fm_pairs * pairs, const struct fm_key * pair);

/// Add a pair, whose key has the slot, and fits. Returns false, and adds nothing, if there is no
/// room for one of its keys. O(bytes) expected.
FM_INTERNAL bool fm_pairs_add(
  struct fm_pairs * pairs, uint32_t slot, const struct fm_key * pair);

/// Whether there is room for the first key of a pair that was not added for lack of room: there is
/// none for the second. O(bytes) expected.
FM_INTERNAL bool fm_pairs_lack_second(const struct fm_pairs * pairs, const struct fm_key * pair);

/// Remove a pair, which was added. O(bytes) expected.
FM_INTERNAL void fm_pairs_remove(struct fm_pairs * pairs, uint32_t slot);

/// The first pair of a key of the first or the second variable; the next one of the same key.
/// FM_NO_SLOT: there is none. O(bytes) expected; O(1).
FM_INTERNAL uint32_t fm_pairs_first(
  const struct fm_pairs * pairs, uint32_t which, const struct fm_key * key);
FM_INTERNAL uint32_t fm_pairs_next(
  const struct fm_pairs * pairs, uint32_t which, uint32_t slot);

#endif  // PAIRS_H_
