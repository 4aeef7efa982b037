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

/// thinning.h: the values of inputs in a recording, thinned for drawing: least and greatest value
/// of each part of a stretch of time, so that no spike is lost. The memory does not depend on the
/// number of messages.

#ifndef THINNING_H_
#define THINNING_H_

#include "records.h"

/// The values that came in a part of a window. Zero at first.
struct fm_bucket
{
  double least;    // of those that are numbers; NaN if none is
  double most;
  double last;     // the latest by its time; of one time, the last to come
  int64_t time;    // of `last`
  uint32_t n;
  uint32_t n_nan;
};

/// A stretch of time of an input, in parts of equal length. The caller owns it, sets the first
/// four members, and sets the others and the buckets to zero at first.
struct fm_window
{
  int64_t begin;               // ns
  int64_t end;                 // ns, inclusive; not before `begin`
  struct fm_bucket * buckets;
  uint32_t n_buckets;          // 1 or more
  bool has_before;             // a value came before `begin`
  bool has_value;              // a value came in the window
  double before;               // the latest before `begin`
  int64_t before_time;         // of `before`
  int64_t first;               // the earliest time of a value in the window
};

/// Windows of all inputs, those of input k from begins[k] to begins[k + 1] - 1.
struct fm_thinning
{
  struct fm_window * windows;
  const uint32_t * begins;  // one more than there are inputs
};

/// Put the values of records into windows, at the times of reception, or at the stamps in the
/// headers if the engine uses these. Of the records only topics, times, sizes, bytes and n are
/// read, and nothing is written. Integers beyond 2^53 are rounded. What cannot be decoded or used
/// is passed over. Nothing steps. Any thread; O(fields to read + windows of the inputs) for each
/// record.
FM_EXPORT void fm_engine_thin(
  struct fm_engine * engine, const struct fm_records * records,
  const struct fm_thinning * thinning);

/// Put n values of an input into its windows, each at its time (ns). Any thread, with no other one
/// at these windows; O(n x windows of the input).
FM_EXPORT void fm_thin_column(
  const struct fm_thinning * thinning, uint32_t input, const int64_t * times,
  const double * values, uint64_t n);

#endif  // THINNING_H_
