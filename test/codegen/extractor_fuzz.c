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

/// Read a corpus with generated extractors: `fuzz FILE`. The file holds messages one after the
/// other, each after the number of its topic and its length (uint32, native byte order). Prints
/// how many could be decoded, how many there were, and a digest of the values read.

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fret_fields.h"

const struct fm_readers * readers_readers(void);

static uint64_t digest = 14695981039346656037u;

static void add(const void * data, size_t size)
{
  for (size_t i = 0u; i < size; ++i) {
    digest = (digest ^ ((const uint8_t *)data)[i]) * 1099511628211u;
  }
}

static void add_fields(const struct fm_field * fields, uint32_t count)
{
  for (uint32_t i = 0u; i < count; ++i) {
    const double value = fields[i].value.f;
    add(&fields[i].outcome, sizeof(fields[i].outcome));
    add(&fields[i].length, sizeof(fields[i].length));
    if (value == value) {  // the bits of a NaN are the machine's choice
      add(&fields[i].value, sizeof(fields[i].value));
    }
  }
}

static void take(
  void * context, uint32_t kind, const uint8_t * key, size_t key_size,
  const struct fm_field * fields)
{
  (void)context;
  add(&kind, sizeof(kind));
  add(key, key_size);
  add_fields(fields, 1u);
}

static void read_others(const struct fm_reader * reader, const uint8_t * message, size_t size)
{
  bool is_read = false;
  bool is_selected = false;
  if (reader->selects != NULL) {
    is_read = reader->selects(message, size, &is_selected);
    add(&is_read, sizeof(is_read));
    add(&is_selected, sizeof(is_selected));
  }
  if (reader->parts != NULL) {
    is_read = reader->parts(message, size, NULL, 0u, NULL, NULL);
    add(&is_read, sizeof(is_read));
    (void)reader->parts(message, size, NULL, 0u, take, NULL);
  }
}

/// Read a message that ends at the end of its allocation, `shift` bytes after an aligned address.
static bool read_at(
  const struct fm_reader * reader, const uint8_t * message, size_t size, size_t shift)
{
  uint8_t * const memory = malloc(shift + size);
  struct fm_field * const fields = malloc(sizeof(*fields) * (reader->n_inputs + 1u));
  if ((memory == NULL && shift + size != 0u) || fields == NULL) {
    abort();
  }
  if (size != 0u) {
    memcpy(memory + shift, message, size);
  }
  const bool is_read = reader->read(memory + shift, size, fields);
  add(&is_read, sizeof(is_read));
  if (is_read) {
    add_fields(fields, reader->n_inputs);
  }
  read_others(reader, memory + shift, size);
  free(fields);
  free(memory);
  return is_read;
}

int main(int argc, char ** argv)
{
  FILE * const file = argc == 2 ? fopen(argv[1], "rb") : NULL;
  if (file == NULL) {
    return 2;
  }
  const struct fm_readers * const readers = readers_readers();
  uint32_t head[2];
  uint32_t decoded = 0u;
  uint32_t total = 0u;
  while (fread(head, sizeof(head), 1u, file) == 1u) {
    uint8_t * const message = malloc((size_t)head[1] + 1u);
    if (message == NULL || fread(message, 1u, head[1], file) != head[1]) {
      return 2;
    }
    decoded += read_at(&readers->topics[head[0]], message, head[1], total % 9u);
    ++total;
    free(message);
  }
  (void)fclose(file);
  printf("%lu %lu %llx\n", (unsigned long)decoded, (unsigned long)total,
    (unsigned long long)digest);
  return 0;
}
