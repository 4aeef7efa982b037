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

/// @NAME@_runner.h: runs the monitors of @BUNDLE_IN_C@ from messages and the time.
///
/// A runner holds everything that changes, in memory that the caller owns; it must not be moved
/// or copied. Times are nanoseconds of one clock of the caller. Not thread-safe. No function
/// allocates or blocks, and none fails except by the stated return value. Complexity is that of
/// the functions of evaluator.h.

#ifndef @UPPER@_RUNNER_H_
#define @UPPER@_RUNNER_H_

#include "@NAME@_size.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Called for each violation, in order, from within the functions below. It must not call them.
typedef void (* @NAME@_announce)(void * context, const struct fm_violation * violation);

/// Called when an input has become silent, and when it has a value again.
typedef void (* @NAME@_silence)(void * context, uint32_t input, bool is_silent);

struct @NAME@_runner
{
  struct fm_evaluator * evaluator;  // in `block`; read counters with the functions of evaluator.h
  @NAME@_announce announce;
  @NAME@_silence silence;
  void * context;
  int64_t arrival;                  // when the present message takes effect
  bool was_silent[@UPPER@_N_INPUTS + 1u];
  struct fm_violation found[@UPPER@_N_REQUIREMENTS];
  unsigned char block[@UPPER@_EVALUATOR_BYTES + FM_ALIGNMENT];
};

/// Begin: inputs have their initial values, and the time begins. Returns false if the files of the
/// export do not match. `silence` may be NULL.
bool @NAME@_runner_start(
  struct @NAME@_runner * runner, int64_t now, @NAME@_announce announce, @NAME@_silence silence,
  void * context);

/// A message: first @NAME@_runner_arrive, then @NAME@_runner_store for each input of its topic,
/// then @NAME@_runner_message.
void @NAME@_runner_arrive(struct @NAME@_runner * runner, int64_t now);
void @NAME@_runner_store(struct @NAME@_runner * runner, uint32_t input, union fm_value value);
void @NAME@_runner_message(struct @NAME@_runner * runner, uint32_t topic);

/// Take what is due by `now`: deadlines and timeouts.
void @NAME@_runner_advance(struct @NAME@_runner * runner, int64_t now);

/// Take a step of all requirements whose inputs have values: a period is over.
void @NAME@_runner_period(struct @NAME@_runner * runner, int64_t now);

/// The time at which @NAME@_runner_advance is to be called though no message comes; it may be too
/// early. FM_NEVER if there is none.
int64_t @NAME@_runner_wake(const struct @NAME@_runner * runner);

/// Begin all requirements anew; the inputs keep their values, and the counters go on.
void @NAME@_runner_reset(struct @NAME@_runner * runner, int64_t now);

/// The counters of a requirement.
struct fm_requirement_counts @NAME@_runner_requirement(
  const struct @NAME@_runner * runner, uint32_t requirement);

/// How many messages of a topic took effect.
uint64_t @NAME@_runner_messages(const struct @NAME@_runner * runner, uint32_t topic);

#ifdef __cplusplus
}
#endif

#endif  // @UPPER@_RUNNER_H_
