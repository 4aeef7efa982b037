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

/// fret_monitor.h: the interface between generated monitors and the programs that run them.
///
/// A generated module defines one `struct fm_monitor` and exports one function that returns it.
/// This description is constant. All that changes is in two blocks of memory that the caller owns:
/// the inputs (a struct of the module with one field for each input) and the state (another struct
/// of the module). A generated module does not allocate or block, and keeps nothing outside these
/// blocks. Any number of monitors may run in one process, and one monitor in several threads if
/// each thread has its own blocks.
///
/// C99. Complexity, failure and ownership are stated with each function.

#ifndef FRET_MONITOR_H_
#define FRET_MONITOR_H_

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// For functions that must be inlined.
#ifndef FM_INLINE
#if defined(__GNUC__)
#define FM_INLINE static inline __attribute__((always_inline))
#else
#define FM_INLINE static inline
#endif
#endif

/// For functions that a library exports; everything else is built with hidden visibility.
#ifndef FM_EXPORT
#if defined(__GNUC__)
#define FM_EXPORT __attribute__((visibility("default")))
#else
#define FM_EXPORT
#endif
#endif

/// For functions that the files of one generated module, or those of the evaluator, share. A
/// program that compiles them all as one file may define it as `static`.
#ifndef FM_INTERNAL
#define FM_INTERNAL
#endif

/// Version of the layout of the structs below. A module with another one is refused.
#define FM_ABI 2u

/// A time or tick that does not come.
#define FM_NEVER INT64_MAX

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

/// One input: its type, and its offset in the struct of inputs, in bytes.
struct fm_input
{
  const char * name;
  uint32_t offset;
  uint8_t type;  // enum fm_type
};

/// A value for an input. The member follows from the input's type: i for bool and intN, u for
/// uintN, f for float32 and float64; a float32 is stored as (float)f.
union fm_value
{
  int64_t i;
  uint64_t u;
  double f;
};

/// A step group: requirements that read the same inputs, and therefore start and step together.
struct fm_group
{
  const uint32_t * inputs;  // indices into fm_monitor.inputs, ascending
  uint32_t n_inputs;
  const uint32_t * requirements;  // indices into fm_monitor.requirements, ascending
  uint32_t n_requirements;
  /// Initialise the group's part of the state: the next step is the first time point.
  /// O(state bytes of the group); cannot fail.
  void (* reset)(void * state);
  /// Take one step on the current inputs. Writes the verdict of each of the group's requirements
  /// to verdicts[index of the requirement] (true: satisfied), and what fm_monitor.occurrences
  /// names; writes no other verdict. NULL with the policy `timed`.
  /// O(operations of the group), independent of all bounds; cannot fail.
  void (* step)(void * state, const void * inputs, bool * verdicts);
  /// The step at a tick, with the policy `timed`; otherwise NULL. A tick is a nanosecond since the
  /// group's start, from 0 to FM_LAST_TICK, and later than that of the call before; the first
  /// after a reset is 0. The inputs are those of all ticks from this one to the one before the
  /// next call. Returns the next tick at which a value of the group can change although its inputs
  /// stay as they are, or FM_NEVER: step there, or at an earlier tick at which an input changes.
  /// Nothing is to be done for the ticks in between. Writes and complexity as `step`.
  int64_t (* step_at)(void * state, const void * inputs, bool * verdicts, int64_t tick);
};

/// The last tick that a group can step at, 146 years after its start.
#define FM_LAST_TICK (INT64_MAX / 2 - 2)

/// A requirement: its id in the bundle, and the index of its group.
struct fm_requirement
{
  const char * id;
  uint32_t group;
};

/// A compiled bundle. Constant; valid while its library is loaded.
struct fm_monitor
{
  uint32_t abi;  // FM_ABI
  uint32_t n_inputs;
  uint32_t n_groups;
  uint32_t n_requirements;
  uint64_t state_bytes;   // sizeof the state struct; align it as max_align_t, or to 16 bytes
  uint64_t inputs_bytes;  // sizeof the struct of inputs
  const struct fm_input * inputs;
  const struct fm_group * groups;
  const struct fm_requirement * requirements;
  const char * name;
  const char * source_hash;  // SHA-256 of the generated C, as in the manifest, or ""
  /// Step all groups: the same result as their step functions, called in order, in less time.
  /// NULL if there is no such function, and with the policy `timed`. O(operations of all groups);
  /// cannot fail.
  void (* step)(void * state, const void * inputs, bool * verdicts);
  /// For each requirement the index of a verdict whose change to false is an occurrence: its own,
  /// or for `H p` one of n_more_verdicts after n_requirements, which holds p. NULL: all their own.
  const uint32_t * occurrences;
  uint32_t n_more_verdicts;
  /// How many changes since the last reset found no room in a queue, because a `max_rate` is too
  /// low. NULL if no queue can overflow. O(queues); cannot fail.
  uint64_t (* overflows)(const void * state);
};

/// A number that a group writes to the state at each step: an operand of an aggregate.
struct fm_output
{
  uint64_t offset;  // in the state, aligned
  uint32_t group;
  uint8_t type;     // FM_INT64, FM_UINT64 or FM_FLOAT64
};

/// The outputs of a monitor. Constant; valid while its library is loaded.
struct fm_outputs
{
  const struct fm_output * outputs;
  uint32_t n_outputs;
};

/// The words of a test: outcomes, events among them (outcomes of -1), the verdict (1: shown, -1:
/// refuted, 0: neither), the outcome of this step, and the powers of 2^64 of its three parts: the
/// evidence against the requirement, that in its favour, and the likelihood of the outcomes, each
/// predicted from those before it.
enum fm_test_word
{
  FM_TEST_TRIALS = 0,
  FM_TEST_EVENTS = 1,
  FM_TEST_VERDICT = 2,
  FM_TEST_OUTCOME = 3,
  FM_TEST_UNITS = 4,
  FM_TEST_WORDS = 7
};

enum fm_test_part
{
  FM_TEST_AGAINST = 0,
  FM_TEST_IN_FAVOUR = 1,
  FM_TEST_LIKELIHOOD = 2,
  FM_TEST_PARTS = 3
};

/// The test of a requirement with a probability, whose words and parts (fret_trials.h) are in the
/// state at these offsets. What it counts as events are failures of trials, or successes. The
/// numbers are those that it is called with; the texts are for people.
struct fm_test
{
  uint32_t requirement;  // index
  bool counts_successes;
  uint64_t words;
  uint64_t parts;
  double allowed;
  double rest;
  double limit;
  const char * relation;
  const char * bound;
  const char * confidence;
};

/// The tests of a monitor, by requirement. Constant; valid while its library is loaded.
struct fm_tests
{
  const struct fm_test * tests;
  uint32_t n_tests;
};

/// How far a requirement is from the other verdict: positive or 0 if it is satisfied. `value` is
/// the distance that the deciding comparison had, divided by its scale; infinite where none
/// decides, a NaN where it is not known, since a queue had no room.
struct fm_margin
{
  double value;
  double distance;
  int64_t instant;     // of the step at which it had it; under `timed` since which it had it
  int64_t comparison;  // index of all comparisons of the monitor; meaningless if it is infinite
};

/// A margin in the state, as the cells of fret_margins.h keep it, with what decides it.
struct fm_margin_kept
{
  int64_t rank;        // ranks have the order of values
  int64_t instant;     // as in fm_margin
  int64_t comparison;  // -1: none
};

/// The margins of a monitor. Constant; valid while its library is loaded.
struct fm_margins
{
  const uint64_t * margins;      // a requirement: where its struct fm_margin is in the state
  const uint64_t * occurrences;  // and that of what its occurrences compare, which may be another
  const uint64_t * instants;     // a group: where the state has the instant of the next step,
                                 // int64_t
};

#endif  // FRET_MONITOR_H_
