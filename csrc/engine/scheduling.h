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

/// scheduling.h: what the system is asked for, so that a monitor answers in time on a busy
/// machine.
///
/// For the whole process: the middleware's threads take the messages, and others announce. Each
/// function returns 0 or an error number of the system; after an error some threads may have
/// changed. Linux only; elsewhere ENOSYS. Any thread, not two at a time.

#ifndef SCHEDULING_H_
#define SCHEDULING_H_

#include "fret_monitor.h"

/// Run all threads under SCHED_FIFO with a priority from 1 to 99; threads that they start, too.
/// O(threads).
FM_EXPORT int32_t fm_set_priority(int32_t priority);

/// Run all threads on some processors alone, as `0,2-3`; threads that they start, too. EINVAL for
/// another text, or if there are none of these processors. O(threads).
FM_EXPORT int32_t fm_set_processors(const char * processors);

/// Keep in memory all that is in memory, or will be: what was touched once never waits for a disk.
/// O(memory).
FM_EXPORT int32_t fm_lock_memory(void);

/// Ask for pages of 2 MB for memory that nothing was written to yet: with many instances, a
/// message waits most for the addresses of their pages. Does nothing for less than some pages, or
/// where there are none. O(1), cannot fail.
FM_EXPORT void fm_use_large_pages(void * memory, uint64_t bytes);

#endif  // SCHEDULING_H_
