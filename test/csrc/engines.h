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

/// engines.h: an engine whose evaluator has memory of its own, freed with the engine.

#ifndef ENGINES_H_
#define ENGINES_H_

#include <stdlib.h>

#include "engine_parts.h"

// With stamps of headers unless `reorder` is negative.
static inline struct fm_engine * create_engine(
  const struct fm_evaluator_options * of, const struct fm_readers * readers, int64_t reorder)
{
  void * memory = malloc((size_t)fm_evaluator_bytes(of));
  const struct fm_engine_options options = {
    .evaluator = fm_evaluator_init(memory, of), .monitor = of->monitor, .readers = readers,
    .topics = of->topics, .n_topics = of->n_topics, .sources = of->sources,
    .uses_header_stamps = reorder >= 0, .reorder = reorder < 0 ? 0 : reorder};
  struct fm_engine * engine = fm_engine_create(&options);
  if (engine == NULL) {
    abort();
  }
  return engine;
}

static inline void destroy_engine(struct fm_engine * engine)
{
  void * memory = engine->options.evaluator;
  fm_engine_destroy(engine);
  free(memory);
}

#endif  // ENGINES_H_
