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

/// serialized.c: see serialized.h for the contract.

#include "serialized.h"

#include <stdlib.h>

static void * allocate(size_t size, void * state)
{
  (void)state;
  return malloc(size);
}

static void deallocate(void * pointer, void * state)
{
  (void)state;
  free(pointer);
}

static void * reallocate(void * pointer, size_t size, void * state)
{
  (void)state;
  return realloc(pointer, size);
}

static void * zero_allocate(size_t count, size_t size, void * state)
{
  (void)state;
  return calloc(count, size);
}

struct fm_allocator fm_malloc_allocator(void)
{
  return (struct fm_allocator) {allocate, deallocate, reallocate, zero_allocate, NULL};
}

enum fm_take fm_take_result(
  const struct fm_middleware * middleware, int result, bool taken, uint32_t * dropped)
{
  const bool has_error = middleware->has_error();
  if (has_error) {
    middleware->forget_error();
    *dropped += result == 0 ? 1u : 0u;
  }
  if (result == 0 && taken) {
    return FM_TAKEN;
  }
  return result == 0 && has_error ? FM_DROPPED : FM_EMPTY;
}

uint32_t fm_take_serialized(
  const struct fm_middleware * middleware, const void * subscription,
  struct fm_serialized * message, struct fm_padded_info * info)
{
  bool taken = false;
  uint32_t dropped = 0;
  message->allocator = fm_malloc_allocator();
  const int result = middleware->take(subscription, message, &taken, &info->info, NULL);
  return fm_take_result(middleware, result, taken, &dropped);
}

void fm_free_serialized(struct fm_serialized * message)
{
  free(message->buffer);
}
