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

/// aggregates.h: values over all instances of a pool, kept up to date.
///
/// An operand is a value of a group: a verdict, or an output of the generated code (struct
/// fm_output). An instance counts while its group is ready and has stepped since start or reset. A
/// change of one instance costs O(1) (count, any, all, sum) or O(log n) (min, max), whatever the
/// number of instances. A sum of integers wraps; one of floats is exact and rounded once, so that
/// it depends on the present values alone. The order of floats is that of maxOver: -0 before 0,
/// and NaN counts as the greatest for max and as the least for min.
///
/// The caller owns all memory. Not thread-safe. No function allocates or blocks.

#ifndef AGGREGATES_H_
#define AGGREGATES_H_

#include "fret_windows.h"
#include "heap.h"
#include "kinds.h"

/// One aggregate and what it has from each instance.
struct fm_total
{
  struct fm_aggregate options;
  uint32_t group;       // of the operand
  uint8_t type;         // of the output, enum fm_type; FM_BOOL of a verdict
  uint64_t offset;      // of the output in the state
  uint64_t n;           // instances that count
  uint64_t n_true;
  uint64_t sum;         // of integers
  uint64_t * exact;     // of floats: FM_SUM_LENGTH words; NULL: none
  uint8_t * flags;      // an instance: whether it counts, and a verdict
  int64_t * words;      // an instance: its number; NULL: none
  struct fm_heap heap;  // of FM_MIN_OF and FM_MAX_OF
  union fm_value value;  // if `is_known`
  union fm_value last;   // the value that was stored in the bundle's scope last
  bool has_value;
  bool is_known;
  bool has_last;
  bool is_touched;      // the group of an instance has stepped, or an instance ended, since then
};

/// The bytes of an aggregate over at most `most` instances; 0 if they do not fit. O(1).
FM_INTERNAL uint64_t fm_total_bytes(
  const struct fm_aggregate * options, const struct fm_output * output, uint64_t most);

/// Make an aggregate over no instance in fm_total_bytes bytes that are 0, aligned to FM_ALIGNMENT.
/// `output`: of the operand; NULL: it is a verdict. `group`: of the operand. O(1).
FM_INTERNAL struct fm_total fm_total_make(
  const struct fm_aggregate * options, const struct fm_output * output, uint32_t group,
  uint32_t most, void * memory);

/// The group of the operand has stepped in an instance, or the instance has become unready.
FM_INTERNAL void fm_total_update(
  struct fm_total * total, const struct fm_instance * instance, uint32_t slot);

/// An instance no longer counts.
FM_INTERNAL void fm_total_remove(struct fm_total * total, uint32_t slot);

/// The value. Returns false if there is none: `min` and `max` over no instance. O(1), and for a
/// sum of floats O(words of an exact sum) after each change.
FM_INTERNAL bool fm_total_value(struct fm_total * total, union fm_value * value);

/// Whether the value is another one than the bundle's scope has. As fm_total_value.
FM_INTERNAL bool fm_total_has_changed(struct fm_total * total);

#endif  // AGGREGATES_H_
