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
