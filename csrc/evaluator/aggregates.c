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

/// aggregates.c: see aggregates.h for the contract.

#include "aggregates.h"

#include <string.h>

// An instance's flags.
#define COUNTS 1u
#define IS_TRUE 2u

// ---- layout ------------------------------------------------------------------------------------

// Offsets of the parts of the memory, in bytes.
struct layout
{
  uint64_t flags;
  uint64_t exact;
  uint64_t words;
  struct fm_block block;
};

static bool is_extreme(uint32_t operation)
{
  return operation == FM_MIN_OF || operation == FM_MAX_OF;
}

static bool is_exact(const struct fm_aggregate * options, const struct fm_output * output)
{
  return options->operation == FM_SUM_OF && output != NULL && output->type == FM_FLOAT64;
}

static struct layout lay_out(
  const struct fm_aggregate * options, const struct fm_output * output, uint64_t most)
{
  struct layout layout = {0, 0, 0, {0, true}};
  const uint64_t n_exact = is_exact(options, output) ? FM_SUM_LENGTH : 0;
  const uint64_t words_bytes = is_extreme(options->operation) ? fm_heap_bytes(most) :
    options->operation == FM_SUM_OF ? most * sizeof(int64_t) : 0;
  layout.flags = fm_block_append(&layout.block, most, sizeof(uint8_t));
  layout.exact = fm_block_append(&layout.block, n_exact, sizeof(uint64_t));
  layout.words = fm_block_append(&layout.block, words_bytes, 1);
  return layout;
}

uint64_t fm_total_bytes(
  const struct fm_aggregate * options, const struct fm_output * output, uint64_t most)
{
  const struct layout layout = lay_out(options, output, most);
  return layout.block.fits ? layout.block.bytes : 0;
}

struct fm_total fm_total_make(
  const struct fm_aggregate * options, const struct fm_output * output, uint32_t group,
  uint32_t most, void * memory)
{
  const struct layout layout = lay_out(options, output, most);
  char * const bytes = memory;
  struct fm_total total = {0};
  total.options = *options;
  total.group = group;
  total.type = output == NULL ? FM_BOOL : output->type;
  total.offset = output == NULL ? 0 : output->offset;
  total.flags = (uint8_t *)bytes + layout.flags;
  if (is_exact(options, output)) {
    total.exact = (uint64_t *)(void *)(bytes + layout.exact);
  }
  if (is_extreme(options->operation)) {
    total.heap = fm_heap_make(bytes + layout.words, most);
    total.words = total.heap.words;
  } else if (options->operation == FM_SUM_OF) {
    total.words = (int64_t *)(void *)(bytes + layout.words);
  }
  return total;
}

// ---- one instance ------------------------------------------------------------------------------

// The word by which the heap orders a number: the heap has the least first.
static int64_t order_of(const struct fm_total * total, int64_t number)
{
  const bool is_least = total->options.operation == FM_MIN_OF;
  switch (total->type) {
    case FM_FLOAT64:
      return ~fm_key_f64(fm_number_f64(number), is_least);
    case FM_UINT64:
      return ~fm_key_u64(fm_number_u64(number), is_least);
    default:
      return ~fm_key_i64(number, is_least);
  }
}

static int64_t number_of(const struct fm_total * total, int64_t order)
{
  const bool is_least = total->options.operation == FM_MIN_OF;
  switch (total->type) {
    case FM_FLOAT64:
      return fm_word_f64(fm_of_key_f64(~order, is_least));
    case FM_UINT64:
      return fm_word_u64(fm_of_key_u64(~order, is_least));
    default:
      return fm_of_key_i64(~order, is_least);
  }
}

static void add_number(struct fm_total * total, uint32_t slot, int64_t number)
{
  if (is_extreme(total->options.operation)) {
    fm_heap_set(&total->heap, slot, order_of(total, number));
    return;
  }
  total->words[slot] = number;
  if (total->exact != NULL) {
    fm_add_exactly(total->exact, number, false);
  } else {
    total->sum += (uint64_t)number;
  }
}

static void remove_number(struct fm_total * total, uint32_t slot, bool stays)
{
  if (is_extreme(total->options.operation)) {
    if (!stays) {
      fm_heap_remove(&total->heap, slot);
    }
    return;
  }
  if (total->exact != NULL) {
    fm_add_exactly(total->exact, total->words[slot], true);
  } else {
    total->sum -= (uint64_t)total->words[slot];
  }
}

static void leave(struct fm_total * total, uint32_t slot, bool stays)
{
  if ((total->flags[slot] & COUNTS) == 0u) {
    return;
  }
  total->n -= 1;
  total->n_true -= (total->flags[slot] & IS_TRUE) != 0u ? 1u : 0u;
  if (total->type != FM_BOOL) {
    remove_number(total, slot, stays);
  }
  total->flags[slot] = 0;
}

void fm_total_remove(struct fm_total * total, uint32_t slot)
{
  leave(total, slot, false);
  total->is_touched = true;
  total->is_known = false;
}

void fm_total_update(
  struct fm_total * total, const struct fm_instance * instance, uint32_t slot)
{
  const struct fm_instance_group * group = &instance->groups[total->group];
  const bool counts = group->steps > 0;
  total->is_touched = true;
  total->is_known = false;
  leave(total, slot, counts);
  if (!counts) {
    return;
  }
  total->n += 1;
  total->flags[slot] = COUNTS;
  if (total->type != FM_BOOL) {
    int64_t number;
    memcpy(&number, (const char *)instance->state + total->offset, sizeof number);
    add_number(total, slot, number);
  } else if (instance->verdicts[total->options.operand]) {
    total->n_true += 1;
    total->flags[slot] |= IS_TRUE;
  }
}

// ---- the value ---------------------------------------------------------------------------------

static bool extreme_of(const struct fm_total * total, int64_t * number)
{
  const uint32_t first = fm_heap_first(&total->heap);
  if (first == UINT32_MAX) {
    return false;
  }
  *number = number_of(total, total->words[first]);
  return true;
}

static int64_t sum_of(const struct fm_total * total)
{
  return total->exact == NULL ? fm_signed(total->sum) :
         fm_word_f64(fm_exact_quotient(total->exact, 1));
}

static bool value_of(const struct fm_total * total, union fm_value * value)
{
  int64_t number = 0;
  bool has_value = true;
  switch ((enum fm_operation)total->options.operation) {
    case FM_COUNT_OF:
      number = (int64_t)total->n_true;
      break;
    case FM_ANY_OF:
      number = total->n_true > 0 ? 1 : 0;
      break;
    case FM_ALL_OF:
      number = total->n_true == total->n ? 1 : 0;
      break;
    case FM_MIN_OF:
    case FM_MAX_OF:
      has_value = extreme_of(total, &number);
      break;
    case FM_SUM_OF:
      number = sum_of(total);
      break;
  }
  memcpy(value, &number, sizeof number);
  return has_value;
}

bool fm_total_value(struct fm_total * total, union fm_value * value)
{
  if (!total->is_known) {
    total->has_value = value_of(total, &total->value);
    total->is_known = true;
  }
  *value = total->value;
  return total->has_value;
}

bool fm_total_has_changed(struct fm_total * total)
{
  union fm_value value;
  if (!total->is_touched) {
    return false;
  }
  const bool has_value = fm_total_value(total, &value);
  return has_value != total->has_last ||
         (has_value && memcmp(&value, &total->last, sizeof value) != 0);
}
