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

/// seen.h: what an engine counts, one thing at a time.

#ifndef SEEN_H_
#define SEEN_H_

#include <string.h>

#include "engine_parts.h"
#include "instance.h"
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

// These do not bring the engine up to date, as a snapshot does.

static inline struct fm_requirement_counts requirement_counts_of(
  struct fm_engine * engine, uint32_t requirement)
{
  fm_engine_lock(engine);
  const struct fm_requirement_counts counts =
    fm_evaluator_requirement_counts(engine->options.evaluator, requirement);
  fm_engine_unlock(engine);
  return counts;
}

static inline struct fm_input_counts input_counts_of(
  struct fm_engine * engine, uint32_t input)
{
  fm_engine_lock(engine);
  const struct fm_input_counts counts =
    fm_evaluator_input_counts(engine->options.evaluator, input);
  fm_engine_unlock(engine);
  return counts;
}

static inline struct fm_topic_counts topic_counts_of(
  struct fm_engine * engine, uint32_t topic)
{
  fm_engine_lock(engine);
  const struct fm_topic_counts counts =
    fm_evaluator_topic_counts(engine->options.evaluator, topic);
  fm_engine_unlock(engine);
  return counts;
}

static inline struct fm_time_counts time_counts_of(struct fm_engine * engine)
{
  fm_engine_lock(engine);
  const struct fm_time_counts counts =
    fm_evaluator_time_counts(engine->options.evaluator);
  fm_engine_unlock(engine);
  return counts;
}

// Copy the value of an input, and return whether it has one.
static inline bool value_in(
  const struct fm_evaluator * evaluator, const struct fm_monitor * monitor, uint32_t input,
  void * out)
{
  if (input < monitor->n_inputs) {
    const struct fm_input * from = &monitor->inputs[input];
    memcpy(
      out, (const char *)fm_evaluator_inputs(evaluator) + from->offset,
      fm_instance_value_bytes((enum fm_type)from->type));
  }
  return fm_evaluator_has_value(evaluator, input);
}

static inline bool value_of(struct fm_engine * engine, uint32_t input, void * out)
{
  fm_engine_lock(engine);
  const bool has_value =
    value_in(engine->options.evaluator, engine->options.monitor, input, out);
  fm_engine_unlock(engine);
  return has_value;
}

#endif  // SEEN_H_
