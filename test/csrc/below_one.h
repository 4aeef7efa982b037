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

/// below_one.h: an engine of one requirement, x < 1, whose topic has x in a byte.

#ifndef BELOW_ONE_H_
#define BELOW_ONE_H_

#include "engine.h"
#include "engines.h"

static void reset(void * state) {(void)state;}

static void step(void * state, const void * inputs, bool * verdicts)
{
  (void)state;
  verdicts[0] = *(const int32_t *)inputs < 1;
}

static const struct fm_input inputs[] = {{"x", 0, FM_INT32}};
static const uint32_t first[] = {0};
static const struct fm_group groups[] = {{first, 1, first, 1, reset, step, NULL}};
static const struct fm_requirement requirements[] = {{"X", 0}};
static const struct fm_monitor monitor = {
  FM_ABI, 1, 1, 1, 8, 8, inputs, groups, requirements, "m", "", NULL, NULL, 0, NULL};
static const struct fm_topic topic = {first, 1};
static const uint8_t report = FM_OCCURRENCE;

// A message of one byte, or a serialized one.
static bool read_x(const uint8_t * message, size_t size, struct fm_field * out)
{
  out[0].value.i = message[size == 1 ? 0 : 4];
  out[0].outcome = FM_FIELD_READ;
  return size == 1 || size == 8;
}

static const struct fm_reader reader = {.read = read_x, .n_inputs = 1};
static const struct fm_readers readers = {FM_ABI, 1, &reader};

// The caller destroys the engine with `destroy_engine`.
static struct fm_engine * make_engine(const int64_t * timeout)
{
  const struct fm_evaluator_options evaluator = {
    .monitor = &monitor, .topics = &topic, .n_topics = 1, .policy = FM_EVERY_MESSAGE,
    .reports = &report, .timeouts = timeout, .reports_recoveries = true};
  return create_engine(&evaluator, &readers, -1);
}

#endif  // BELOW_ONE_H_
