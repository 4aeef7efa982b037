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

/// reorder.c: see reorder.h for the contract.

#include "reorder.h"

#include <stdlib.h>
#include <string.h>

#define MOST_BYTES (4u << 20)

bool fm_reorder_init(struct fm_reorder * reorder, uint32_t most_fields)
{
  const size_t width = most_fields > 0 ? most_fields : 1u;
  const size_t bytes = sizeof(struct fm_waiting) + width * sizeof(struct fm_field);
  const size_t fit = MOST_BYTES / bytes + 1;
  memset(reorder, 0, sizeof(*reorder));
  reorder->capacity = fit < FM_MOST_WAITING ? (uint32_t)fit : FM_MOST_WAITING;
  reorder->slots = calloc(reorder->capacity, sizeof(*reorder->slots));
  reorder->fields = calloc(reorder->capacity * width, sizeof(*reorder->fields));
  reorder->order = calloc(reorder->capacity, sizeof(*reorder->order));
  if (reorder->slots == NULL || reorder->fields == NULL || reorder->order == NULL) {
    return false;
  }
  for (uint32_t k = 0; k < reorder->capacity; ++k) {
    reorder->slots[k].fields = &reorder->fields[k * width];
    reorder->order[k] = k;
  }
  return true;
}

void fm_reorder_free(struct fm_reorder * reorder)
{
  for (uint32_t k = 0; reorder->slots != NULL && k < reorder->capacity; ++k) {
    free(reorder->slots[k].bytes);
  }
  free(reorder->slots);
  free(reorder->fields);
  free(reorder->order);
}

static bool copy_bytes(struct fm_waiting * waiting)
{
  struct fm_delivery * delivery = &waiting->delivery;
  waiting->bytes = malloc(delivery->size + delivery->key_size + 1u);
  if (waiting->bytes == NULL) {
    return false;
  }
  if (delivery->size > 0) {
    memcpy(waiting->bytes, delivery->message, delivery->size);
  }
  delivery->message = waiting->bytes;
  if (delivery->key != NULL) {
    memcpy(waiting->bytes + delivery->size, delivery->key, delivery->key_size);
    delivery->key = waiting->bytes + delivery->size;
  }
  return true;
}

bool fm_reorder_add(
  struct fm_reorder * reorder, const struct fm_delivery * delivery, int64_t stamp,
  uint32_t n_fields, bool has_parts)
{
  const uint32_t slot = reorder->order[reorder->n];
  struct fm_waiting * waiting = &reorder->slots[slot];
  waiting->delivery = *delivery;
  waiting->delivery.fields = waiting->fields;
  if (has_parts && !copy_bytes(waiting)) {
    return false;
  }
  uint32_t place = reorder->n;
  while (place > 0 && reorder->slots[reorder->order[place - 1]].stamp > stamp) {
    reorder->order[place] = reorder->order[place - 1];
    place -= 1;
  }
  reorder->order[place] = slot;
  reorder->n += 1;
  waiting->stamp = stamp;
  if (n_fields > 0) {
    memcpy(waiting->fields, delivery->fields, n_fields * sizeof(*delivery->fields));
  }
  return true;
}

const struct fm_waiting * fm_reorder_first(const struct fm_reorder * reorder)
{
  return reorder->n == 0 ? NULL : &reorder->slots[reorder->order[0]];
}

void fm_reorder_remove_first(struct fm_reorder * reorder)
{
  const uint32_t slot = reorder->order[0];
  free(reorder->slots[slot].bytes);
  reorder->slots[slot].bytes = NULL;
  reorder->n -= 1;
  memmove(&reorder->order[0], &reorder->order[1], reorder->n * sizeof(*reorder->order));
  reorder->order[reorder->n] = slot;
}
