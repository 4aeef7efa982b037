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

// Changes messages at random, reads them with generated readers and stores the values in an
// evaluator: `messages FILE SECONDS SEED`. In the file each message follows the number of its
// topic and its length (uint32, native byte order). For sanitizers: each message ends where its
// memory ends. Inputs are numbered by topic.

#define _POSIX_C_SOURCE 199309L

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "evaluator.h"
#include "fret_fields.h"

#define MOST 4096u
#define LONGEST 5000u

const struct fm_readers * readers_readers(void);
const struct fm_monitor * readers_monitor(void);

struct message
{
  uint32_t topic;
  uint32_t size;
  uint8_t * bytes;
};

static struct message messages[MOST];
static uint32_t n_messages;
static uint64_t state;

// xorshift64 (Marsaglia 2003).
static uint64_t next_bits(void)
{
  state ^= state << 13;
  state ^= state >> 7;
  state ^= state << 17;
  return state;
}

static uint32_t below(uint32_t limit)
{
  return limit == 0u ? 0u : (uint32_t)(next_bits() % limit);
}

static void * allocate(size_t size)
{
  void * const memory = calloc(1u, size == 0u ? 1u : size);
  if (memory == NULL) {
    abort();
  }
  return memory;
}

static bool read_seeds(const char * name)
{
  FILE * const file = fopen(name, "rb");
  uint32_t head[2];
  if (file == NULL) {
    return false;
  }
  while (n_messages < MOST && fread(head, sizeof(head), 1u, file) == 1u) {
    struct message * const message = &messages[n_messages];
    message->topic = head[0];
    message->size = head[1];
    message->bytes = allocate(head[1]);
    if (fread(message->bytes, 1u, head[1], file) != head[1]) {
      return false;
    }
    n_messages += 1u;
  }
  (void)fclose(file);
  return n_messages > 0u;
}

// A length that is too large for any message, or close to the right one.
static uint32_t strange(uint32_t size)
{
  static const uint32_t lengths[] = {
    UINT32_MAX, UINT32_MAX - 7u, 0x80000000u, 0x7fffffffu, 0x40000000u, 0x20000001u, 0x10000000u,
    0u, 1u, 3u, 4u};
  return below(4u) == 0u ? size - below(size + 9u) + 4u
         : lengths[below(sizeof(lengths) / sizeof(lengths[0]))];
}

static uint32_t change(uint8_t * bytes, uint32_t size)
{
  const uint32_t place = below(size);
  uint32_t length = strange(size);
  switch (below(6u)) {
    case 0u:
      return place;
    case 1u:
      bytes[place] = (uint8_t)(bytes[place] ^ (1u << below(8u)));
      return size;
    case 2u:
    case 3u:
      if (below(2u) == 0u) {
        length = (length >> 24) | ((length >> 8) & 0xff00u) | ((length & 0xff00u) << 8) |
          (length << 24);
      }
      if (place / 4u * 4u + 4u <= size) {
        memcpy(bytes + place / 4u * 4u, &length, 4u);
      }
      return size;
    case 4u:
      bytes[below(4u) % size] = (uint8_t)below(4u);  // the encapsulation
      return size;
    default:
      for (uint32_t i = place; i < size && i < place + 16u; ++i) {
        bytes[i] = (uint8_t)next_bits();
      }
      return size;
  }
}

static void feed(
  struct fm_evaluator * evaluator, const struct fm_readers * readers, const uint32_t * first,
  uint32_t topic, const uint8_t * bytes, size_t size, struct fm_violation * out)
{
  const struct fm_reader * const reader = &readers->topics[topic];
  struct fm_field * const fields = allocate(sizeof(*fields) * reader->n_inputs);
  if (!reader->read(bytes, size, fields)) {
    fm_evaluator_undecodable(evaluator, topic);
  } else {
    for (uint32_t i = 0u; i < reader->n_inputs; ++i) {
      if (fields[i].outcome > FM_FIELD_ABSENT) {
        abort();
      }
      if (fields[i].outcome == FM_FIELD_READ) {
        fm_evaluator_store(evaluator, first[topic] + i, fields[i].value, 0);
      } else {
        fm_evaluator_unusable(evaluator, first[topic] + i);
      }
    }
    (void)fm_evaluator_message(evaluator, topic, (int64_t)next_bits(), out);
  }
  free(fields);
}

static struct fm_evaluator * make_evaluator(const struct fm_readers * readers, uint32_t * first)
{
  const struct fm_monitor * const monitor = readers_monitor();
  struct fm_topic * const topics = allocate(sizeof(*topics) * readers->n_topics);
  uint32_t * const inputs = allocate(sizeof(*inputs) * monitor->n_inputs);
  uint32_t next = 0u;
  for (uint32_t t = 0u; t < readers->n_topics; ++t) {
    first[t] = next;
    topics[t].inputs = inputs + next;
    topics[t].n_inputs = readers->topics[t].n_inputs;
    for (uint32_t i = 0u; i < topics[t].n_inputs; ++i) {
      inputs[next] = next;
      ++next;
    }
  }
  const struct fm_evaluator_options options = {
    .monitor = monitor, .topics = topics, .n_topics = readers->n_topics,
    .policy = below(FM_PERIODIC + 1u)};
  struct fm_evaluator * const evaluator =
    fm_evaluator_init(allocate(fm_evaluator_bytes(&options)), &options);
  if (evaluator == NULL) {
    abort();
  }
  return evaluator;
}

static double seconds_since(const struct timespec * begin)
{
  struct timespec now;
  (void)clock_gettime(CLOCK_MONOTONIC, &now);
  return (double)(now.tv_sec - begin->tv_sec) + 1e-9 * (double)(now.tv_nsec - begin->tv_nsec);
}

int main(int argc, char ** argv)
{
  struct timespec begin;
  unsigned long runs = 0u;
  (void)clock_gettime(CLOCK_MONOTONIC, &begin);
  if (argc != 4 || !read_seeds(argv[1])) {
    return 2;
  }
  state = strtoull(argv[3], NULL, 10) * 2u + 1u;
  const struct fm_readers * const readers = readers_readers();
  uint32_t * const first = allocate(sizeof(*first) * readers->n_topics);
  struct fm_evaluator * const evaluator = make_evaluator(readers, first);
  struct fm_violation * const out = allocate(sizeof(*out) * readers_monitor()->n_requirements);
  while (runs % 256u != 0u || seconds_since(&begin) < atof(argv[2])) {
    const struct message * const seed = &messages[below(n_messages)];
    uint8_t copy[LONGEST];
    uint32_t size = seed->size < LONGEST ? seed->size : LONGEST;
    memcpy(copy, seed->bytes, size);
    for (uint32_t times = below(4u); times > 0u && size > 0u; --times) {
      size = change(copy, size);
    }
    // A separate allocation that ends with the message. Sometimes read as another topic.
    const uint32_t shift = below(9u);
    uint8_t * const memory = malloc(shift + size);
    if (memory == NULL && shift + size != 0u) {
      abort();
    }
    if (size != 0u) {
      memcpy(memory + shift, copy, size);
    }
    const uint32_t topic = below(8u) == 0u ? below(readers->n_topics) : seed->topic;
    feed(evaluator, readers, first, topic, memory + shift, size, out);
    free(memory);
    ++runs;
  }
  printf("Done %lu runs\n", runs);
  return 0;
}
