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

/// heap.h: numbers below a limit, by the least of a word each: when instances are due, and which
/// value is the least.
///
/// A binary heap that knows the place of each of its items, so that any one can be moved or taken
/// out. Of equal words the item with the lowest number comes first. The caller owns the memory.
/// Not thread-safe. No function allocates, blocks or fails.

#ifndef HEAP_H_
#define HEAP_H_

#include "instance.h"

struct fm_heap
{
  uint32_t * items;   // the heap
  uint32_t * places;  // an item: its place in the heap + 1; 0: it is not in it
  int64_t * words;    // an item: its word
  uint32_t n;
};

/// The bytes of a heap of items below `most`. O(1).
FM_INTERNAL uint64_t fm_heap_bytes(uint64_t most);

/// Make an empty heap in fm_heap_bytes bytes that are 0, aligned to FM_ALIGNMENT. O(1).
FM_INTERNAL struct fm_heap fm_heap_make(void * memory, uint32_t most);

/// Give an item its word; it comes into the heap if it is not in it. O(log n), and O(1) if the
/// word is the one it has.
FM_INTERNAL void fm_heap_set(struct fm_heap * heap, uint32_t item, int64_t word);

/// Take an item out, if it is in the heap. O(log n).
FM_INTERNAL void fm_heap_remove(struct fm_heap * heap, uint32_t item);

/// The item with the least word; UINT32_MAX if the heap is empty. O(1).
FM_INTERNAL uint32_t fm_heap_first(const struct fm_heap * heap);

#endif  // HEAP_H_
