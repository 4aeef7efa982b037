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

/// thread.h: threads, the clocks, and conditions with their timed waits. For the engine and those
/// that work with it.

#ifndef THREAD_H_
#define THREAD_H_

#include <pthread.h>
#include <time.h>

#include "fret_monitor.h"

/// A clock, in nanoseconds; CLOCK_MONOTONIC. O(1).
FM_INTERNAL int64_t fm_read_clock(clockid_t clock);
FM_INTERNAL int64_t fm_steady_time(void);

/// Make a condition whose timed waits are by CLOCK_MONOTONIC. False if the system refuses.
FM_INTERNAL bool fm_make_condition(pthread_cond_t * condition);

/// Wait for a signal of such a condition, or until a time of CLOCK_MONOTONIC.
FM_INTERNAL void fm_wait_until(
  pthread_cond_t * condition, pthread_mutex_t * mutex, int64_t until);

/// Start a thread with all signals blocked, so that the main thread handles them. False if the
/// system refuses.
FM_INTERNAL bool fm_start_thread(
  pthread_t * thread, void * (* run)(void * argument), void * argument);

#endif  // THREAD_H_
