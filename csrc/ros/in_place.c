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

/// in_place.c: see in_place.h for the contract.

#include "in_place.h"

#include <string.h>

#include "receiver_reading.h"

static const char fast_identifier[] = "rosidl_typesupport_fastrtps_c";

static const void * pointer_at(const void * object, size_t offset)
{
  const void * found;
  memcpy(&found, (const uint8_t *)object + offset, sizeof(found));
  return found;
}

// Called by Fast DDS to deserialize a message, with what the receiver passed to take_message.
static bool read_in_place(void * cdr, void * receiver)
{
  const struct fm_in_place * place = fm_receiver_in_place(receiver);
  const void * buffer = pointer_at(cdr, place->buffer_of_cdr);
  const uint8_t * message = pointer_at(buffer, place->data_of_buffer);
  size_t size;
  memcpy(&size, (const uint8_t *)buffer + place->size_of_buffer, sizeof(size));
  fm_receiver_read(receiver, message, size);
  return true;
}

static const struct fm_type_support * support_for(
  const struct fm_type_support * handle, const char * identifier)
{
  const struct fm_in_place_type * type = (const struct fm_in_place_type *)(const void *)handle;
  if (strcmp(identifier, fast_identifier) == 0) {
    return &type->fast;
  }
  if (strcmp(identifier, handle->typesupport_identifier) == 0) {
    return handle;
  }
  return type->original->func(type->original, identifier);
}

bool fm_in_place_make(const struct fm_type_support * original, struct fm_in_place_type * made)
{
  const struct fm_type_support * fast = original->func(original, fast_identifier);
  if (fast == NULL || strcmp(fast->typesupport_identifier, fast_identifier) != 0) {
    return false;
  }
  memset(made, 0, sizeof(*made));
  made->original = original;
  made->support = *original;
  made->support.func = support_for;
  made->fast = *fast;
  made->callbacks = *fast->data;
  made->callbacks.cdr_deserialize = read_in_place;
  made->fast.data = &made->callbacks;
  return true;
}

static bool find_word(const uint64_t * words, size_t n, uint64_t wanted, size_t * offset)
{
  for (size_t k = 0; k < n; ++k) {
    if (words[k] == wanted) {
      *offset = k * sizeof(*words);
      return true;
    }
  }
  return false;
}

bool fm_in_place_find(
  void (* make_buffer)(void * self, char * data, size_t size),
  void (* make_cdr)(void * self, void * buffer, int endianness, int version),
  struct fm_in_place * found)
{
  enum { BUFFER_WORDS = 8, CDR_WORDS = 64 };  // searched; the objects may be larger
  uint64_t buffer[64] = {0};
  uint64_t cdr[256] = {0};
  char data[40] = {0};
  if (sizeof(void *) != sizeof(uint64_t) || sizeof(size_t) != sizeof(uint64_t)) {
    return false;
  }
  make_buffer(buffer, data, sizeof(data));
  make_cdr(cdr, buffer, 1, 0);
  return find_word(buffer, BUFFER_WORDS, (uint64_t)(uintptr_t)data, &found->data_of_buffer) &&
         find_word(buffer, BUFFER_WORDS, sizeof(data), &found->size_of_buffer) &&
         find_word(cdr, CDR_WORDS, (uint64_t)(uintptr_t)buffer, &found->buffer_of_cdr);
}
