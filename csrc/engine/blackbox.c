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

/// blackbox.c: see blackbox.h for the contract.

#define _POSIX_C_SOURCE 200809L

#include "blackbox.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

struct fm_blackbox
{
  pthread_mutex_t mutex;
  uint8_t * bytes;
  uint64_t capacity;
  uint64_t begin;  // places: they grow, and lie in the ring modulo its capacity
  uint64_t end;
  int64_t lasts;
  struct fm_occurrences occurrences;
  struct fm_blackbox_counts counts;
};

struct fm_blackbox * fm_blackbox_create(uint64_t capacity, int64_t lasts)
{
  struct fm_blackbox * box = calloc(1, sizeof(*box));
  if (box == NULL) {
    return NULL;
  }
  box->bytes = capacity > 0 && capacity <= SIZE_MAX ? malloc((size_t)capacity) : NULL;
  box->capacity = capacity;
  box->lasts = lasts;
  if (box->bytes == NULL || pthread_mutex_init(&box->mutex, NULL) != 0) {
    free(box->bytes);
    free(box);
    return NULL;
  }
  // Not 0: a compiler may make calloc of that, which writes nothing.
  memset(box->bytes, 0xff, (size_t)capacity);
  return box;
}

void fm_blackbox_destroy(struct fm_blackbox * box)
{
  pthread_mutex_destroy(&box->mutex);
  free(box->bytes);
  free(box);
}

// ---- the ring ----------------------------------------------------------------------------------

// The number of bytes from a place to the end of the memory, at most `size`.
static size_t before_wrap(const struct fm_blackbox * box, uint64_t place, uint64_t size)
{
  const uint64_t rest = box->capacity - place % box->capacity;
  return (size_t)(rest < size ? rest : size);
}

static void write_at(struct fm_blackbox * box, uint64_t place, const void * from, size_t size)
{
  const size_t first = before_wrap(box, place, size);
  memcpy(box->bytes + place % box->capacity, from, first);
  memcpy(box->bytes, (const uint8_t *)from + first, size - first);
}

static void read_at(const struct fm_blackbox * box, uint64_t place, void * out, size_t size)
{
  const size_t first = before_wrap(box, place, size);
  memcpy(out, box->bytes + place % box->capacity, first);
  memcpy((uint8_t *)out + first, box->bytes, size - first);
}

static void make_room_locked(struct fm_blackbox * box, uint64_t size, int64_t now)
{
  while (box->capacity - (box->end - box->begin) < size) {
    struct fm_kept oldest;
    read_at(box, box->begin, &oldest, sizeof(oldest));
    box->begin += sizeof(oldest) + oldest.size;
    box->counts.early += now - oldest.steady < box->lasts ? 1u : 0u;
  }
}

void fm_blackbox_keep(
  struct fm_blackbox * box, const struct fm_kept * kept, const uint8_t * message)
{
  struct fm_kept plain = *kept;
  plain.key_size = 0;
  fm_blackbox_keep_keyed(box, &plain, message, NULL);
}

void fm_blackbox_keep_keyed(
  struct fm_blackbox * box, const struct fm_kept * kept, const uint8_t * message,
  const uint8_t * key)
{
  struct fm_kept whole = *kept;
  whole.size += kept->key_size;
  pthread_mutex_lock(&box->mutex);
  const bool fits = box->capacity >= sizeof(whole) && message != NULL && kept->size > 0 &&
    whole.size <= box->capacity - sizeof(whole);
  if (fits) {
    const uint64_t key_at = box->end + sizeof(whole);
    make_room_locked(box, sizeof(whole) + whole.size, kept->steady);
    write_at(box, box->end, &whole, sizeof(whole));
    if (kept->key_size > 0) {
      write_at(box, key_at, key, kept->key_size);
    }
    write_at(box, key_at + kept->key_size, message, (size_t)kept->size);
    box->end += sizeof(whole) + whole.size;
    box->counts.kept += 1;
  } else {
    box->counts.left_out += 1;
  }
  pthread_mutex_unlock(&box->mutex);
}

uint64_t fm_blackbox_copy(
  struct fm_blackbox * box, uint64_t from, uint8_t * out, uint64_t room, uint64_t * begin)
{
  uint64_t n = 0;
  pthread_mutex_lock(&box->mutex);
  *begin = box->begin;
  if (from >= box->begin && from < box->end) {
    n = box->end - from < room ? box->end - from : room;
    read_at(box, from, out, (size_t)n);
  }
  pthread_mutex_unlock(&box->mutex);
  return n;
}

// ---- occurrences -------------------------------------------------------------------------------

void fm_blackbox_note(struct fm_blackbox * box, uint32_t requirement, int64_t steady)
{
  pthread_mutex_lock(&box->mutex);
  if (box->occurrences.n == 0) {
    box->occurrences.first = steady;
    box->occurrences.requirement = requirement;
  }
  box->occurrences.n += 1;
  box->occurrences.last = steady;
  pthread_mutex_unlock(&box->mutex);
}

struct fm_occurrences fm_blackbox_take_occurrences(struct fm_blackbox * box)
{
  pthread_mutex_lock(&box->mutex);
  const struct fm_occurrences taken = box->occurrences;
  box->occurrences = (struct fm_occurrences) {0, 0, 0, 0};
  pthread_mutex_unlock(&box->mutex);
  return taken;
}

struct fm_blackbox_counts fm_blackbox_count(struct fm_blackbox * box)
{
  pthread_mutex_lock(&box->mutex);
  const struct fm_blackbox_counts counts = box->counts;
  pthread_mutex_unlock(&box->mutex);
  return counts;
}
