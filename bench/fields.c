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

// Times generated readers in turn: `fields FILE`. The file has for each topic the length of a
// message (uint32, native byte order) and the message. Prints a line of nanoseconds a round.

#define _POSIX_C_SOURCE 199309L

#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "fret_fields.h"

#define TOPICS 16u
#define ROUNDS 31
#define CALLS 20000

const struct fm_readers * SYMBOL(void);

static double now(void)
{
  struct timespec time;
  (void)clock_gettime(CLOCK_MONOTONIC, &time);
  return 1e9 * (double)time.tv_sec + (double)time.tv_nsec;
}

int main(int argc, char ** argv)
{
  static uint8_t messages[TOPICS][65536];
  static uint32_t sizes[TOPICS];
  const struct fm_readers * const readers = SYMBOL();
  FILE * const file = argc == 2 ? fopen(argv[1], "rb") : NULL;
  for (uint32_t t = 0u; t < readers->n_topics; ++t) {
    if (file == NULL || t >= TOPICS || fread(&sizes[t], 4u, 1u, file) != 1u ||
      sizes[t] > sizeof(messages[t]) || fread(messages[t], sizes[t], 1u, file) != 1u)
    {
      return 2;
    }
  }
  for (int round = 0; round < ROUNDS; ++round) {
    for (uint32_t t = 0u; t < readers->n_topics; ++t) {
      struct fm_field field;
      const double begin = now();
      for (int call = 0; call < CALLS; ++call) {
        if (!readers->topics[t].read(messages[t], sizes[t], &field) ||
          field.outcome != FM_FIELD_READ)
        {
          return 1;
        }
      }
      printf("%.2f ", (now() - begin) / CALLS);
    }
    printf("\n");
  }
  return 0;
}
