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

/// thread.c: see thread.h for the contract.

#define _POSIX_C_SOURCE 200809L

#include "thread.h"

#include <signal.h>

#define SECOND_NS 1000000000

int64_t fm_read_clock(clockid_t clock)
{
  struct timespec now;
  clock_gettime(clock, &now);
  return (int64_t)now.tv_sec * SECOND_NS + (int64_t)now.tv_nsec;
}

int64_t fm_steady_time(void) {return fm_read_clock(CLOCK_MONOTONIC);}

bool fm_make_condition(pthread_cond_t * condition)
{
  pthread_condattr_t attributes;
  if (pthread_condattr_init(&attributes) != 0) {
    return false;
  }
  const bool is_made = pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC) == 0 &&
    pthread_cond_init(condition, &attributes) == 0;
  pthread_condattr_destroy(&attributes);
  return is_made;
}

void fm_wait_until(pthread_cond_t * condition, pthread_mutex_t * mutex, int64_t until)
{
  const int64_t positive = until < 0 ? 0 : until;
  struct timespec end;
  end.tv_sec = (time_t)(positive / SECOND_NS);
  end.tv_nsec = (long)(positive % SECOND_NS);
  (void)pthread_cond_timedwait(condition, mutex, &end);
}

bool fm_start_thread(pthread_t * thread, void * (* run)(void * argument), void * argument)
{
  sigset_t all;
  sigset_t before;
  sigfillset(&all);
  if (pthread_sigmask(SIG_SETMASK, &all, &before) != 0) {
    return false;
  }
  const bool is_started = pthread_create(thread, NULL, run, argument) == 0;
  pthread_sigmask(SIG_SETMASK, &before, NULL);
  return is_started;
}
