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

/// fret_monitor.h: what generated monitors and those who drive them agree on.
///
/// A generated module defines one `struct fm_monitor` and exports one function that returns it.
/// The description is constant; all that changes lies in two blocks of memory that the caller
/// owns: the inputs (a struct of the module, one field an input) and the state (likewise).
/// Nothing here or in a generated module allocates, blocks, or keeps anything outside them, so
/// that any number of monitors run in one process, and one monitor in several threads where each
/// has blocks of its own.
///
/// C99. Complexity, failure and ownership are stated with each entry.

#ifndef FRET_MONITOR_H_
#define FRET_MONITOR_H_

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// For functions that are to be part of their callers.
#ifndef FM_INLINE
#if defined(__GNUC__)
#define FM_INLINE static inline __attribute__((always_inline))
#else
#define FM_INLINE static inline
#endif
#endif

/// What a library shows to others; all else is built with hidden visibility.
#ifndef FM_EXPORT
#if defined(__GNUC__)
#define FM_EXPORT __attribute__((visibility("default")))
#else
#define FM_EXPORT
#endif
#endif

/// The layout of the structs below. A driver refuses a module of another number.
#define FM_ABI 1u

/// How an input is stored in the struct of inputs.
enum fm_type
{
  FM_BOOL = 0,
  FM_INT8 = 1,
  FM_INT16 = 2,
  FM_INT32 = 3,
  FM_INT64 = 4,
  FM_UINT8 = 5,
  FM_UINT16 = 6,
  FM_UINT32 = 7,
  FM_UINT64 = 8,
  FM_FLOAT32 = 9,
  FM_FLOAT64 = 10
};

/// One input: its type and its place in the struct of inputs, in bytes from the start.
struct fm_input
{
  const char * name;
  uint32_t offset;
  uint8_t type;  // enum fm_type
};

/// A value on its way in: the member that the input's type asks for
/// (i: bool and intN, u: uintN, f: float32 and float64; a float32 is stored as (float)f).
union fm_value
{
  int64_t i;
  uint64_t u;
  double f;
};

/// A step group: requirements that read the same inputs, and start and step together.
struct fm_group
{
  const uint32_t * inputs;  // indices into fm_monitor.inputs, ascending
  uint32_t n_inputs;
  const uint32_t * requirements;  // indices into fm_monitor.requirements, ascending
  uint32_t n_requirements;
  /// Put the group's part of the state at its start: the next step is the first time point.
  /// O(state bytes of the group); cannot fail.
  void (* reset)(void * state);
  /// Take one step on the current inputs. Writes the verdict of each of the group's requirements
  /// to verdicts[index of the requirement] (true: satisfied) and leaves the others alone.
  /// O(operations of the group), independent of all bounds; cannot fail.
  void (* step)(void * state, const void * inputs, bool * verdicts);
};

/// A requirement: its id as the bundle has it.
struct fm_requirement
{
  const char * id;
  uint32_t group;
};

/// A compiled bundle. Constant, and valid as long as the library is loaded.
struct fm_monitor
{
  uint32_t abi;  // FM_ABI
  uint32_t n_inputs;
  uint32_t n_groups;
  uint32_t n_requirements;
  uint64_t state_bytes;   // sizeof the state struct; align as max_align_t or 16
  uint64_t inputs_bytes;  // sizeof the struct of inputs
  const struct fm_input * inputs;
  const struct fm_group * groups;
  const struct fm_requirement * requirements;
  const char * name;
  const char * source_hash;  // SHA-256 of the generated C, as in the manifest, or ""
  /// Step all groups, as their own functions would one after the other, in less time.
  /// NULL: there is no such function. Complexity and failure as there.
  void (* step)(void * state, const void * inputs, bool * verdicts);
};

#endif  // FRET_MONITOR_H_
