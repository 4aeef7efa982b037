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

/// trace.c: a library for LD_PRELOAD that notes when a process hands a message over.
///
/// It stands before the functions of rmw and of the C library that a node calls at each step, and
/// writes its events to the file FM_TRACE.PID at the end of the process: lines of the time
/// (CLOCK_MONOTONIC, ns), the thread and the kind. Python looks up functions of rmw by dlsym,
/// which therefore finds these too.

#define _GNU_SOURCE

#include <dlfcn.h>
#include <inttypes.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#define MOST_EVENTS 4000000u

struct event
{
  int64_t time;
  const char * kind;
  int thread;
};

static struct event events[MOST_EVENTS];
static unsigned n_events;  // atomic

static void note(const char * const kind)
{
  static __thread int thread;
  struct timespec time;
  const unsigned k = __atomic_fetch_add(&n_events, 1u, __ATOMIC_RELAXED);
  (void)clock_gettime(CLOCK_MONOTONIC, &time);
  thread = thread == 0 ? (int)syscall(SYS_gettid) : thread;
  if (k < MOST_EVENTS) {
    events[k] = (struct event) {
      (int64_t)time.tv_sec * 1000000000 + time.tv_nsec, kind, thread};
  }
}

__attribute__((destructor)) static void write_events(void)
{
  char name[4096];
  const char * const place = getenv("FM_TRACE");
  (void)snprintf(name, sizeof(name), "%s.%d", place, (int)getpid());
  FILE * const file = place == NULL || n_events == 0u ? NULL : fopen(name, "w");
  for (unsigned k = 0; file != NULL && k < n_events && k < MOST_EVENTS; ++k) {
    (void)fprintf(
      file, "%" PRId64 " %d %s\n", events[k].time, events[k].thread, events[k].kind);
  }
  if (file != NULL) {
    (void)fclose(file);
  }
}

// The version is that of the oldest x86-64 and arm64 ABI of glibc.
#ifdef __x86_64__
#define ABI "GLIBC_2.2.5"
#else
#define ABI "GLIBC_2.17"
#endif

typedef void * (* finder)(void *, const char *);

static finder find(void)
{
  static finder found;
  const char * const versions[] = {"GLIBC_2.34", ABI};
  for (size_t k = 0u; k < 2u && found == NULL; ++k) {
    *(void **)&found = dlvsym(RTLD_NEXT, "dlsym", versions[k]);
  }
  return found;
}

static void * real(const char * const name)
{
  void * const found = find()(RTLD_NEXT, name);
  return found != NULL ? found : find()(dlopen("librmw_fastrtps_cpp.so", RTLD_LAZY), name);
}

// Define a function that notes an event before and after the real one.
#define NOTED(name, parameters, arguments, before, after) \
  int name parameters \
  { \
    static int (* function) parameters; \
    if (function == NULL) { \
      *(void **)&function = real(#name); \
    } \
    note(before); \
    const int result = function arguments; \
    note(after); \
    return result; \
  }

// As NOTED, of a function that takes a message, or finds none.
#define TAKES(name, parameters, arguments) \
  int name parameters \
  { \
    static int (* function) parameters; \
    if (function == NULL) { \
      *(void **)&function = real(#name); \
    } \
    const int result = function arguments; \
    if (result == 0 && *taken) { \
      note("taken"); \
    } \
    return result; \
  }

NOTED(
  rmw_publish, (const void * publisher, const void * message, void * allocation),
  (publisher, message, allocation), "publish", "published")
NOTED(
  rmw_publish_serialized_message,
  (const void * publisher, const void * message, void * allocation),
  (publisher, message, allocation), "publish", "published")
NOTED(pthread_cond_signal, (pthread_cond_t * condition), (condition), "signal", "signalled")
NOTED(
  pthread_cond_timedwait,
  (pthread_cond_t * condition, pthread_mutex_t * mutex, const struct timespec * until),
  (condition, mutex, until), "wait", "woken")
NOTED(
  clock_nanosleep,
  (clockid_t clock, int flags, const struct timespec * time, struct timespec * left),
  (clock, flags, time, left), "wait", "woken")
NOTED(
  rmw_wait, (void * a, void * b, void * c, void * d, void * e, void * set, const void * timeout),
  (a, b, c, d, e, set, timeout), "wait", "woken")
TAKES(
  rmw_take, (const void * subscription, void * message, bool * taken, void * allocation),
  (subscription, message, taken, allocation))
TAKES(
  rmw_take_with_info,
  (const void * subscription, void * message, bool * taken, void * info, void * allocation),
  (subscription, message, taken, info, allocation))
TAKES(
  rmw_take_serialized_message_with_info,
  (const void * subscription, void * message, bool * taken, void * info, void * allocation),
  (subscription, message, taken, info, allocation))

void * dlsym(void * library, const char * name)
{
  static const struct {const char * name; void * function;} known[] = {
    {"rmw_publish", (void *)rmw_publish},
    {"rmw_publish_serialized_message", (void *)rmw_publish_serialized_message},
    {"rmw_take_with_info", (void *)rmw_take_with_info},
    {"rmw_take_serialized_message_with_info", (void *)rmw_take_serialized_message_with_info}};
  for (size_t k = 0u; k < sizeof(known) / sizeof(known[0]); ++k) {
    if (strcmp(name, known[k].name) == 0) {
      return known[k].function;
    }
  }
  return find()(library, name);
}
