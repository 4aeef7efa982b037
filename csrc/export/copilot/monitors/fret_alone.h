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

// How the monitors are compiled as a part of one file: nothing of them is visible outside of it.
// To be included first.

#ifndef FRET_ALONE_H_
#define FRET_ALONE_H_

#if defined(__GNUC__)
#define FM_EXPORT static __attribute__((unused))
#else
#define FM_EXPORT static
#endif
#define FM_INTERNAL static

// Macros around the copying of the inputs, for a critical section: see README.md.
#ifdef FRET_MONITOR_HOOKS
#include FRET_MONITOR_HOOKS
#endif
#ifndef FRET_MONITOR_ENTER
#define FRET_MONITOR_ENTER() ((void)0)
#endif
#ifndef FRET_MONITOR_LEAVE
#define FRET_MONITOR_LEAVE() ((void)0)
#endif

#endif  // FRET_ALONE_H_
