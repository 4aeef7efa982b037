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

/// seen.h: what an engine counts, one thing at a time, from a snapshot.

#ifndef SEEN_H_
#define SEEN_H_

#include "snapshot.h"

enum { MOST_SEEN = 64 };  // requirements, inputs, topics

struct seen
{
  struct fm_requirement_counts requirements[MOST_SEEN];
  struct fm_input_snapshot inputs[MOST_SEEN];
  struct fm_topic_snapshot topics[MOST_SEEN];
  uint8_t conditions[FM_CONDITION_BYTES + 2 * MOST_SEEN];
  struct fm_snapshot all;
};

static inline void see(struct fm_engine * engine, struct seen * seen)
{
  seen->all = (struct fm_snapshot) {
    .requirements = seen->requirements, .inputs = seen->inputs, .topics = seen->topics,
    .conditions = seen->conditions};
  fm_engine_snapshot(engine, &seen->all);
}

static inline struct fm_silence silence_of(struct fm_engine * engine, uint32_t input)
{
  struct seen seen;
  see(engine, &seen);
  return seen.inputs[input].silence;
}

static inline struct fm_gate_counts gate_counts_of(struct fm_engine * engine)
{
  struct seen seen;
  see(engine, &seen);
  return seen.all.gate;
}

static inline uint64_t unpublished_of(struct fm_engine * engine)
{
  struct seen seen;
  see(engine, &seen);
  return seen.all.unpublished;
}

#endif  // SEEN_H_
