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

// Runs a compiled monitor over columns of values.

#include <stdlib.h>
#include <string.h>

#include "fret_monitor.h"

static size_t value_bytes(uint8_t type)
{
  static const size_t bytes[] = {sizeof(bool), 1, 2, 4, 8, 1, 2, 4, 8, 4, 8};
  return bytes[type];
}

static void start(const struct fm_monitor * monitor, void * state)
{
  for (uint32_t g = 0; g < monitor->n_groups; ++g) {
    monitor->groups[g].reset(state);
  }
}

static void store(
  const struct fm_monitor * monitor, const void * const * columns, uint64_t t, char * inputs)
{
  for (uint32_t i = 0; i < monitor->n_inputs; ++i) {
    const size_t bytes = value_bytes(monitor->inputs[i].type);
    memcpy(inputs + monitor->inputs[i].offset, (const char *)columns[i] + t * bytes, bytes);
  }
}

// One column of `steps` values an input; before the steps marked in `afresh` all groups are reset.
// Writes n_requirements verdicts a step. False if there is no memory.
__attribute__((visibility("default")))
bool differential_run(
  const struct fm_monitor * monitor, const void * const * columns, uint64_t steps,
  const bool * afresh, bool * verdicts);

bool differential_run(
  const struct fm_monitor * monitor, const void * const * columns, uint64_t steps,
  const bool * afresh, bool * verdicts)
{
  // Blocks of the exact size, filled with noise: a step that relies on zeros, or on more, shows.
  void * state = malloc(monitor->state_bytes);
  char * inputs = malloc(monitor->inputs_bytes);
  const bool is_ready = state != NULL && inputs != NULL;
  if (is_ready) {
    memset(state, 0xa5, monitor->state_bytes);
    memset(inputs, 0, monitor->inputs_bytes);
    start(monitor, state);
    for (uint64_t t = 0; t < steps; ++t) {
      if (afresh[t]) {
        start(monitor, state);
      }
      store(monitor, columns, t, inputs);
      for (uint32_t g = 0; g < monitor->n_groups; ++g) {
        monitor->groups[g].step(state, inputs, verdicts + t * monitor->n_requirements);
      }
    }
  }
  free(inputs);
  free(state);
  return is_ready;
}
