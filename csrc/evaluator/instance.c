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

/// instance.c: see instance.h for the contract.

#include "instance.h"

#include <string.h>

// ---- layout ------------------------------------------------------------------------------------

// Offsets of the parts of the block, in bytes. Only `lay_out_instance` computes them.
struct fm_instance_layout
{
  uint64_t time;
  uint64_t inputs;
  uint64_t groups;
  uint64_t verdicts;
  uint64_t previous;
  uint64_t values;
  uint64_t measures;
  uint64_t state;
  struct fm_block block;
};

uint64_t fm_block_append(struct fm_block * block, uint64_t count, uint64_t size)
{
  const uint64_t begin = block->bytes;
  const uint64_t room = (uint64_t)PTRDIFF_MAX - FM_ALIGNMENT - begin;
  if (!block->fits || count > room / size) {
    block->fits = false;
    return 0;
  }
  block->bytes = (begin + count * size + FM_ALIGNMENT - 1) / FM_ALIGNMENT * FM_ALIGNMENT;
  block->fits = block->bytes <= (uint64_t)PTRDIFF_MAX - FM_ALIGNMENT;
  return begin;
}

static struct fm_instance_layout lay_out_instance(
  const struct fm_monitor * monitor, uint64_t measure_words)
{
  struct fm_instance_layout layout = {0};
  layout.block.fits = true;
  layout.time = fm_block_append(&layout.block, 1, sizeof(struct fm_instance_time));
  layout.inputs =
    fm_block_append(&layout.block, monitor->n_inputs, sizeof(struct fm_instance_input));
  layout.groups =
    fm_block_append(&layout.block, monitor->n_groups, sizeof(struct fm_instance_group));
  layout.verdicts =
    fm_block_append(&layout.block, fm_instance_verdicts(monitor), sizeof(bool));
  layout.previous = fm_block_append(&layout.block, monitor->n_requirements, sizeof(bool));
  layout.values = fm_block_append(&layout.block, monitor->inputs_bytes, 1);
  layout.measures = fm_block_append(&layout.block, measure_words, sizeof(int64_t));
  layout.state = fm_block_append(&layout.block, monitor->state_bytes, 1);
  return layout;
}

uint64_t fm_instance_verdicts(const struct fm_monitor * monitor)
{
  return (uint64_t)monitor->n_requirements + monitor->n_more_verdicts;
}

bool fm_may_be_silent(const struct fm_instance_input * input)
{
  return input->is_silent || input->is_put_off;
}

bool fm_is_known(const struct fm_instance * instance, uint32_t requirement)
{
  const uint32_t group = instance->monitor->requirements[requirement].group;
  const struct fm_group * read = &instance->monitor->groups[group];
  bool is_silent = false;
  for (uint32_t k = 0; k < read->n_inputs; ++k) {
    is_silent = is_silent || fm_may_be_silent(&instance->inputs[read->inputs[k]]);
  }
  return !is_silent && instance->groups[group].steps > 0;
}

uint64_t fm_instance_bytes(const struct fm_monitor * monitor, uint64_t measure_words)
{
  const struct fm_instance_layout layout = lay_out_instance(monitor, measure_words);
  return layout.block.fits ? layout.block.bytes : 0;
}

struct fm_instance fm_instance_make(
  const struct fm_monitor * monitor, uint64_t measure_words, void * block)
{
  const struct fm_instance_layout layout = lay_out_instance(monitor, measure_words);
  char * memory = block;
  struct fm_instance instance;
  memset(block, 0, (size_t)layout.block.bytes);
  instance.monitor = monitor;
  instance.time = (struct fm_instance_time *)(void *)(memory + layout.time);
  instance.inputs = (struct fm_instance_input *)(void *)(memory + layout.inputs);
  instance.groups = (struct fm_instance_group *)(void *)(memory + layout.groups);
  instance.verdicts = (bool *)(void *)(memory + layout.verdicts);
  instance.previous = (bool *)(void *)(memory + layout.previous);
  instance.values = memory + layout.values;
  instance.measures = (int64_t *)(void *)(memory + layout.measures);
  instance.state = memory + layout.state;
  for (uint32_t i = 0; i < monitor->n_inputs; ++i) {
    instance.inputs[i].due = INT64_MAX;
  }
  for (uint32_t g = 0; g < monitor->n_groups; ++g) {
    instance.groups[g].unset = monitor->groups[g].n_inputs;
    instance.time->n_waiting += monitor->groups[g].n_inputs > 0 ? 1u : 0u;
  }
  instance.time->next_period = INT64_MAX;
  instance.time->taken = INT64_MIN;
  instance.time->receptions_end = INT64_MAX;
  fm_instance_reset(&instance);
  return instance;
}

void fm_instance_reset(const struct fm_instance * instance)
{
  const struct fm_monitor * monitor = instance->monitor;
  for (uint32_t g = 0; g < monitor->n_groups; ++g) {
    struct fm_instance_group * group = &instance->groups[g];
    monitor->groups[g].reset(instance->state);
    group->steps = 0;
    group->stepped_at = instance->time->stores;
    group->awaited = monitor->groups[g].n_inputs;
    group->knows_stale = false;
    group->is_paused = false;
    group->due = INT64_MAX;
  }
  for (uint32_t r = 0; r < monitor->n_requirements; ++r) {
    instance->previous[r] = true;
  }
  for (uint64_t k = 0; k < fm_instance_verdicts(monitor); ++k) {
    instance->verdicts[k] = true;
  }
}

// ---- values ------------------------------------------------------------------------------------

uint32_t fm_instance_value_bytes(enum fm_type type)
{
  switch (type) {
    case FM_BOOL:
      return (uint32_t)sizeof(bool);
    case FM_INT8:
    case FM_UINT8:
      return 1;
    case FM_INT16:
    case FM_UINT16:
      return 2;
    case FM_INT32:
    case FM_UINT32:
    case FM_FLOAT32:
      return 4;
    case FM_INT64:
    case FM_UINT64:
    case FM_FLOAT64:
      return 8;
  }
  return 0;
}

#define READ(c_type, member) \
  do { \
    c_type found; \
    memcpy(&found, place, sizeof found); \
    value.member = found; \
  } while (0)

// A bool is read as a byte and normalised: to read a bool whose byte is neither 0 nor 1 is
// undefined behaviour.
union fm_value fm_instance_value(enum fm_type type, const void * place)
{
  union fm_value value = {.i = 0};
  switch (type) {
    case FM_BOOL: READ(uint8_t, u); value.u = value.u != 0; break;
    case FM_INT8: READ(int8_t, i); break;
    case FM_INT16: READ(int16_t, i); break;
    case FM_INT32: READ(int32_t, i); break;
    case FM_INT64: READ(int64_t, i); break;
    case FM_UINT8: READ(uint8_t, u); break;
    case FM_UINT16: READ(uint16_t, u); break;
    case FM_UINT32: READ(uint32_t, u); break;
    case FM_UINT64: READ(uint64_t, u); break;
    case FM_FLOAT32: READ(float, f); break;
    case FM_FLOAT64: READ(double, f); break;
  }
  return value;
}

static void * place_of(const struct fm_instance * instance, uint32_t input)
{
  return (char *)instance->values + instance->monitor->inputs[input].offset;
}

static enum fm_type type_of(const struct fm_instance * instance, uint32_t input)
{
  return (enum fm_type)instance->monitor->inputs[input].type;
}

// Signed integers are stored as unsigned ones of the same size: conversion to unsigned wraps by
// definition, and intN_t is two's complement. memcpy, because the type of the module's struct is
// not known here.
void fm_instance_write(
  const struct fm_instance * instance, uint32_t input, union fm_value value)
{
  void * place = place_of(instance, input);
  const bool truth = value.i != 0;
  const uint8_t low8 = (uint8_t)value.u;
  const uint16_t low16 = (uint16_t)value.u;
  const uint32_t low32 = (uint32_t)value.u;
  switch (type_of(instance, input)) {
    case FM_BOOL:
      memcpy(place, &truth, sizeof truth);
      break;
    case FM_INT8:
    case FM_UINT8:
      memcpy(place, &low8, sizeof low8);
      break;
    case FM_INT16:
    case FM_UINT16:
      memcpy(place, &low16, sizeof low16);
      break;
    case FM_INT32:
    case FM_UINT32:
      memcpy(place, &low32, sizeof low32);
      break;
    case FM_FLOAT32: {
        const float single = (float)value.f;
        memcpy(place, &single, sizeof single);
        break;
      }
    case FM_INT64:
    case FM_UINT64:
    case FM_FLOAT64:
      memcpy(place, &value, sizeof value);
      break;
  }
}

// As in fm_instance_value, a bool is read as a byte.
void fm_instance_write_from(
  const struct fm_instance * instance, uint32_t input, const void * value)
{
  const enum fm_type type = type_of(instance, input);
  if (type == FM_BOOL) {
    const bool truth = *(const unsigned char *)value != 0;
    memcpy(place_of(instance, input), &truth, sizeof truth);
  } else {
    memcpy(place_of(instance, input), value, fm_instance_value_bytes(type));
  }
}

// ---- times -------------------------------------------------------------------------------------

int64_t fm_later(int64_t time, int64_t by)
{
  if (by > 0 && time > INT64_MAX - by) {
    return INT64_MAX;
  }
  if (by < 0 && time < INT64_MIN - by) {
    return INT64_MIN;
  }
  return time + by;
}

int64_t fm_within(int64_t time, int64_t first, int64_t last)
{
  const int64_t later = time < first ? first : time;
  return later < last ? later : last;
}

int64_t fm_between(int64_t from, int64_t to)
{
  if (from < 0 && to > INT64_MAX + from) {
    return INT64_MAX;
  }
  if (from > 0 && to < INT64_MIN + from) {
    return INT64_MIN;
  }
  return to - from;
}

static int64_t moved(int64_t due, int64_t by)
{
  return due == INT64_MAX ? INT64_MAX : fm_later(due, by);
}

void fm_instance_shift(const struct fm_instance * instance, int64_t by)
{
  struct fm_instance_time * time = instance->time;
  time->now = fm_later(time->now, by);
  time->before = fm_later(time->before, by);
  time->next_period = moved(time->next_period, by);
  time->clock = fm_later(time->clock, by);
  time->arrived = fm_later(time->arrived, by);
  time->taken = fm_later(time->taken, by);
  if (time->receptions_end != INT64_MIN) {
    time->receptions_end = moved(time->receptions_end, by);
  }
  for (uint32_t i = 0; i < instance->monitor->n_inputs; ++i) {
    instance->inputs[i].stored_at = fm_later(instance->inputs[i].stored_at, by);
    instance->inputs[i].due = moved(instance->inputs[i].due, by);
  }
  for (uint32_t g = 0; g < instance->monitor->n_groups; ++g) {
    if (!instance->groups[g].is_paused) {
      instance->groups[g].start = fm_later(instance->groups[g].start, by);
    }
    instance->groups[g].due = moved(instance->groups[g].due, by);
  }
}
