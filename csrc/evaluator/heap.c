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

/// heap.c: see heap.h for the contract.

#include "heap.h"

uint64_t fm_heap_bytes(uint64_t most)
{
  struct fm_block block = {0, true};
  (void)fm_block_append(&block, most, sizeof(uint32_t));
  (void)fm_block_append(&block, most, sizeof(uint32_t));
  (void)fm_block_append(&block, most, sizeof(int64_t));
  return block.fits ? block.bytes : 0;
}

struct fm_heap fm_heap_make(void * memory, uint32_t most)
{
  struct fm_block block = {0, true};
  char * const bytes = memory;
  struct fm_heap heap = {NULL, NULL, NULL, 0};
  heap.items = (uint32_t *)(void *)(bytes + fm_block_append(&block, most, sizeof(uint32_t)));
  heap.places = (uint32_t *)(void *)(bytes + fm_block_append(&block, most, sizeof(uint32_t)));
  heap.words = (int64_t *)(void *)(bytes + fm_block_append(&block, most, sizeof(int64_t)));
  return heap;
}

static bool is_before(const struct fm_heap * heap, uint32_t a, uint32_t b)
{
  return heap->words[a] != heap->words[b] ? heap->words[a] < heap->words[b] : a < b;
}

static void put(struct fm_heap * heap, uint32_t place, uint32_t item)
{
  heap->items[place] = item;
  heap->places[item] = place + 1;
}

static void move_up(struct fm_heap * heap, uint32_t place)
{
  const uint32_t item = heap->items[place];
  while (place > 0 && is_before(heap, item, heap->items[(place - 1) / 2])) {
    put(heap, place, heap->items[(place - 1) / 2]);
    place = (place - 1) / 2;
  }
  put(heap, place, item);
}

static void move_down(struct fm_heap * heap, uint32_t place)
{
  const uint32_t item = heap->items[place];
  uint32_t child = 2 * place + 1;
  while (child < heap->n) {
    if (child + 1 < heap->n && is_before(heap, heap->items[child + 1], heap->items[child])) {
      child += 1;
    }
    if (!is_before(heap, heap->items[child], item)) {
      break;
    }
    put(heap, place, heap->items[child]);
    place = child;
    child = 2 * place + 1;
  }
  put(heap, place, item);
}

void fm_heap_set(struct fm_heap * heap, uint32_t item, int64_t word)
{
  const bool is_in = heap->places[item] != 0;
  if (is_in && heap->words[item] == word) {
    return;
  }
  if (!is_in) {
    put(heap, heap->n, item);
    heap->n += 1;
  }
  heap->words[item] = word;
  move_up(heap, heap->places[item] - 1);
  move_down(heap, heap->places[item] - 1);
}

void fm_heap_remove(struct fm_heap * heap, uint32_t item)
{
  if (heap->n == 0 || heap->places[item] == 0) {
    return;
  }
  const uint32_t place = heap->places[item] - 1;
  heap->places[item] = 0;
  heap->n -= 1;
  if (place < heap->n) {
    const uint32_t last = heap->items[heap->n];
    put(heap, place, last);
    move_up(heap, place);
    move_down(heap, heap->places[last] - 1);
  }
}

uint32_t fm_heap_first(const struct fm_heap * heap)
{
  return heap->n == 0 ? UINT32_MAX : heap->items[0];
}
