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

/// scheduling.c: see scheduling.h for the contract.

#define _GNU_SOURCE  // cpu_set_t, MCL_ONFAULT

#include "scheduling.h"

#include <errno.h>

#ifdef __linux__

#define LARGE_PAGE ((uintptr_t)1 << 21)

#include <dirent.h>
#include <sched.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/types.h>

// Call a function for each thread of this process. Returns the first error but that of a thread
// which has ended.
static int32_t for_each_thread(int (* change)(pid_t thread, const void * to), const void * to)
{
  DIR * threads = opendir("/proc/self/task");
  int32_t error = threads == NULL ? errno : 0;
  const struct dirent * entry;
  while (threads != NULL && error == 0 && (entry = readdir(threads)) != NULL) {
    const long thread = strtol(entry->d_name, NULL, 10);
    if (thread > 0 && change((pid_t)thread, to) != 0 && errno != ESRCH) {
      error = errno;
    }
  }
  if (threads != NULL) {
    (void)closedir(threads);
  }
  return error;
}

static int change_priority(pid_t thread, const void * parameter)
{
  return sched_setscheduler(thread, SCHED_FIFO, parameter);
}

static int change_processors(pid_t thread, const void * processors)
{
  return sched_setaffinity(thread, sizeof(cpu_set_t), processors);
}

// Read a number below CPU_SETSIZE, and go behind it. Returns -1 if there is none.
static int read_processor(const char ** text)
{
  char * end;
  const bool is_digit = **text >= '0' && **text <= '9';
  const long number = strtol(*text, &end, 10);
  *text = end;
  return is_digit && number < CPU_SETSIZE ? (int)number : -1;
}

// Read a list such as `0,2-3`. Returns false for another text.
static bool read_processors(const char * text, cpu_set_t * found)
{
  CPU_ZERO(found);
  for (;; ++text) {
    const int first = read_processor(&text);
    int last = first;
    if (*text == '-') {
      ++text;
      last = read_processor(&text);
    }
    if (first < 0 || last < first) {
      return false;
    }
    for (int k = first; k <= last; ++k) {
      CPU_SET((size_t)k, found);
    }
    if (*text != ',') {
      return *text == '\0';
    }
  }
}

int32_t fm_set_priority(int32_t priority)
{
  const struct sched_param parameter = {.sched_priority = priority};
  return for_each_thread(change_priority, &parameter);
}

int32_t fm_set_processors(const char * processors)
{
  cpu_set_t found;
  return read_processors(processors, &found) ? for_each_thread(change_processors, &found) : EINVAL;
}

int32_t fm_lock_memory(void)
{
  // Without MCL_ONFAULT, the stacks of all threads would be in memory at their full size.
  return mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) == 0 ? 0 : errno;
}

void fm_use_large_pages(void * memory, uint64_t bytes)
{
  const uintptr_t place = (uintptr_t)memory;
  const uintptr_t skipped = (LARGE_PAGE - place % LARGE_PAGE) % LARGE_PAGE;
  if (bytes > skipped + 2u * LARGE_PAGE) {
    const uint64_t whole = (bytes - skipped) / LARGE_PAGE * LARGE_PAGE;
    (void)madvise((char *)memory + skipped, (size_t)whole, MADV_HUGEPAGE);
  }
}

#else

int32_t fm_set_priority(int32_t priority) {return (void)priority, ENOSYS;}

int32_t fm_set_processors(const char * processors) {return (void)processors, ENOSYS;}

int32_t fm_lock_memory(void) {return ENOSYS;}

void fm_use_large_pages(void * memory, uint64_t bytes) {(void)memory, (void)bytes;}

#endif
