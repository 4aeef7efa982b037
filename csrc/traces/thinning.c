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

/// thinning.c: see thinning.h for the contract.

#include "thinning.h"

#include <math.h>

#include "engine_parts.h"
#include "instance.h"
#include "tables.h"

static double as_double(union fm_value value, uint8_t type)
{
  if (type == FM_FLOAT32) {
    return (double)(float)value.f;
  }
  if (type == FM_FLOAT64) {
    return value.f;
  }
  return type >= FM_UINT8 ? (double)value.u : (double)value.i;
}

static void add_to_bucket(struct fm_bucket * bucket, int64_t time, double value)
{
  if (bucket->n == bucket->n_nan) {
    bucket->least = value;
    bucket->most = value;
  }
  if (isnan(value)) {
    bucket->n_nan += 1;
  } else if (value < bucket->least) {
    bucket->least = value;
  } else if (value > bucket->most) {
    bucket->most = value;
  }
  if (bucket->n == 0u || time >= bucket->time) {  // stamps may come out of order
    bucket->last = value;
    bucket->time = time;
  }
  bucket->n += 1;
}

static void add_to_window(struct fm_window * window, int64_t time, double value)
{
  if (time < window->begin) {
    if (!window->has_before || time >= window->before_time) {
      window->before = value;
      window->before_time = time;
      window->has_before = true;
    }
  } else if (time <= window->end) {
    if (!window->has_value || time < window->first) {
      window->has_value = true;
      window->first = time;
    }
    const double since = (double)((uint64_t)time - (uint64_t)window->begin);
    const double length = (double)((uint64_t)window->end - (uint64_t)window->begin) + 1.0;
    const uint32_t place = (uint32_t)(since / length * window->n_buckets);
    add_to_bucket(
      &window->buckets[place < window->n_buckets ? place : window->n_buckets - 1u], time, value);
  }
}

static void add_to_windows(
  const struct fm_thinning * thinning, uint32_t input, int64_t time, double value)
{
  for (uint32_t w = thinning->begins[input]; w < thinning->begins[input + 1]; ++w) {
    add_to_window(&thinning->windows[w], time, value);
  }
}

static void thin_locked(
  struct fm_engine * engine, uint32_t topic, const uint8_t * message, size_t size, int64_t time,
  const struct fm_thinning * thinning)
{
  const struct fm_engine_options * options = &engine->options;
  struct fm_reading reading;
  if (!fm_engine_read(engine, topic, message, size, engine->fields, &reading) ||
    reading.is_unrelated)
  {
    return;
  }
  const struct fm_field * fields =
    fm_engine_prepare_locked(engine, topic, engine->fields, time);
  const int64_t at = options->uses_header_stamps ? reading.stamp : time;
  for (uint32_t k = 0; k < options->topics[topic].n_inputs; ++k) {
    const uint32_t input = options->topics[topic].inputs[k];
    const bool is_measured =
      options->sources != NULL && fm_is_measured((enum fm_source)options->sources[input]);
    if (fields[k].outcome == FM_FIELD_READ && !is_measured) {
      const double value = as_double(fields[k].value, options->monitor->inputs[input].type);
      add_to_windows(thinning, input, at, value);
    }
  }
}

void fm_engine_thin(
  struct fm_engine * engine, const struct fm_records * records,
  const struct fm_thinning * thinning)
{
  fm_engine_lock(engine);
  const uint8_t * message = records->bytes;
  for (uint64_t k = 0; k < records->n; ++k) {
    const size_t size = (size_t)records->sizes[k];
    if (records->topics[k] < engine->options.n_topics) {
      thin_locked(engine, records->topics[k], message, size, records->times[k], thinning);
    }
    message += size;
  }
  fm_engine_unlock(engine);
}

void fm_thin_column(
  const struct fm_thinning * thinning, uint32_t input, const int64_t * times,
  const double * values, uint64_t n)
{
  for (uint64_t k = 0; k < n; ++k) {
    add_to_windows(thinning, input, times[k], values[k]);
  }
}
