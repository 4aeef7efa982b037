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

// A program for the C that Copilot generates: steps through random rows, and prints how often
// handlers were called, and a hash of the order and the arguments of all calls. Handlers read and
// write the inputs, which have been copied by then.

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include "keys.h"

bool m, c, r, s;
float x;
int16_t n;

static uint64_t hash = 1469598103934665603u;
static uint64_t calls;
static uint64_t seed = 1;

static uint64_t noise(void)
{
  seed = seed * 6364136223846793005u + 1442695040888963407u;
  return seed >> 33;
}

static void mix(double value)
{
  hash = (hash ^ (uint64_t)(int64_t)(value * 16.0)) * 1099511628211u;
}

static void called(unsigned handler)
{
  ++calls;
  mix(handler);
  mix(m + 2 * c + 4 * r);
  if (calls % 97 == 0) {
    r = !r;
  }
}

#include "handlers.inc"

int main(int n_arguments, char ** arguments)
{
  const long rows = n_arguments > 1 ? atol(arguments[1]) : 1;
  for (long row = 0; row < rows; ++row) {
    // Values stay for some steps, so that bounds are reached.
    switch (noise() % 8) {
      case 0: m = !m; break;
      case 1: c = !c; break;
      case 2: r = !r; break;
      case 3: s = noise() % 4 == 0; break;
      case 4: x = (float)(noise() % 64) / 16.0f; break;
      case 5: n = (int16_t)(noise() % 7); break;
      default: break;
    }
    mix(-1.0);
    step();
  }
  printf("%llu calls, hash %016llx\n", (unsigned long long)calls, (unsigned long long)hash);
  return 0;
}
