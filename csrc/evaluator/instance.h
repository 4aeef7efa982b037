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

/// instance.h: all of a monitor that changes with its messages, in one block of memory.
///
/// The values of the inputs, the state of the generated code, what is ready and awaited, the
/// verdicts, and the times at which something is due. The block holds no address, so that a copy
/// of its bytes is a copy of the instance. Counters are not part of it.
///
/// evaluator.c decides what all this means. Not thread-safe. No function allocates or blocks;
/// none fails, except by the stated return value.

#ifndef INSTANCE_H_
#define INSTANCE_H_

#include "fret_monitor.h"

/// The alignment of the block, and of the values and the state in it, in bytes.
#define FM_ALIGNMENT 16u

/// A block of memory that is being laid out. Begins as {0, true}.
struct fm_block
{
  uint64_t bytes;  // so far
  bool fits;       // in the address space; if not, `bytes` and the offsets are invalid
};

/// Append `count` elements of `size` bytes, aligned to FM_ALIGNMENT. Returns their offset. O(1).
FM_INTERNAL uint64_t fm_block_append(struct fm_block * block, uint64_t count, uint64_t size);

struct fm_instance_input
{
  uint64_t received_at;  // the clock of stores at its last one; 0 before the first
  int64_t stored_at;     // the time of its last store, or the time at which time began
  int64_t due;           // when it times out
  bool has_value;
  bool has_come;         // a value was received, not only its initial one
  bool is_silent;
  bool is_stale;         // silent, and what reads it is violated
  bool is_put_off;       // its timeout was put off in this silence
};

/// Whether an input is silent, or may be: its timeout was put off. O(1).
FM_INTERNAL bool fm_may_be_silent(const struct fm_instance_input * input);

struct fm_instance_group
{
  uint64_t steps;        // since start or reset
  uint64_t stepped_at;   // the clock of stores at its last step or reset
  uint32_t unset;        // inputs without a value
  uint32_t awaited;      // inputs not received since stepped_at
  uint32_t stale;        // stale inputs
  bool knows_stale;      // its verdicts were set to false for them
  bool is_paused;        // under FM_TIMED: an input has lost its value; `start` is its next tick
  int64_t start;         // the time of its first step; under FM_TIMED of its tick 0
  int64_t due;           // under FM_TIMED: when it is to be evaluated next; INT64_MAX: never
};

struct fm_instance_time
{
  int64_t now;
  int64_t before;        // the time from which it moved to `now`
  int64_t next_period;
  int64_t clock;         // the latest time that was told; under FM_TIMED `now` may be ahead of it
  int64_t arrived;       // not under FM_TIMED: when the latest message was received
  int64_t taken;         // under FM_TIMED: the latest instant of a record or evaluation
  uint64_t stores;       // values stored so far
  uint32_t n_waiting;    // groups that read an input without a value
  int64_t receptions_end;  // inputs that say that a message came are false from then; INT64_MIN:
                           // from the next call on; INT64_MAX: none is true
  bool has_begun;
};

/// Where the parts of an instance lie: pointers into its block.
struct fm_instance
{
  const struct fm_monitor * monitor;
  struct fm_instance_time * time;
  struct fm_instance_input * inputs;
  struct fm_instance_group * groups;
  bool * verdicts;       // of the last step, as fm_monitor says; true before
  bool * previous;       // a requirement: what its report compares; true before step 0
  void * values;         // the struct of inputs
  int64_t * measures;    // words of measures.c
  void * state;
};

/// The bytes of the block, with so many words of measures; 0 if it does not fit in the address
/// space. O(1).
FM_INTERNAL uint64_t fm_instance_bytes(const struct fm_monitor * monitor, uint64_t measure_words);

/// Make an instance in a block of fm_instance_bytes bytes, aligned to FM_ALIGNMENT. No input has a
/// value, every group is at its start, and time has not begun. The monitor's indices are in range.
/// The words of measures are 0. O(bytes).
FM_INTERNAL struct fm_instance fm_instance_make(
  const struct fm_monitor * monitor, uint64_t measure_words, void * block);

/// The number of verdicts that the groups write. O(1).
FM_INTERNAL uint64_t fm_instance_verdicts(const struct fm_monitor * monitor);

/// Whether a requirement is known: its group has stepped since start or reset, and reads no input
/// that is silent, or may be. O(inputs of its group).
FM_INTERNAL bool fm_is_known(const struct fm_instance * instance, uint32_t requirement);

/// Put all groups at their start, with all verdicts true and nothing due; values and other times
/// stay.
/// O(groups + requirements + state bytes).
FM_INTERNAL void fm_instance_reset(const struct fm_instance * instance);

/// Bytes of a stored value; 0 for an unknown type. O(1).
FM_INTERNAL uint32_t fm_instance_value_bytes(enum fm_type type);

/// The value in an object of a type (bool: a byte, true if it is not 0) at any alignment; 0 for an
/// unknown type. O(1).
FM_INTERNAL union fm_value fm_instance_value(enum fm_type type, const void * place);

/// Write the value of an input. Integers wrap to the input's type; a bool is i != 0. The second
/// function takes an object of the input's type (bool: a byte) at any alignment. O(1).
FM_INTERNAL void fm_instance_write(
  const struct fm_instance * instance, uint32_t input, union fm_value value);
FM_INTERNAL void fm_instance_write_from(
  const struct fm_instance * instance, uint32_t input, const void * value);

/// Move all times by `by` nanoseconds; one that would leave the range stays at its end.
/// O(inputs + groups).
FM_INTERNAL void fm_instance_shift(const struct fm_instance * instance, int64_t by);

/// The sum, or the nearest time in range. O(1).
FM_INTERNAL int64_t fm_later(int64_t time, int64_t by);

/// The time, or the nearest between two others; `last` if they are in the wrong order. O(1).
FM_INTERNAL int64_t fm_within(int64_t time, int64_t first, int64_t last);

/// The nanoseconds from one time to another, or the nearest number in range. O(1).
FM_INTERNAL int64_t fm_between(int64_t from, int64_t to);

#endif  // INSTANCE_H_
