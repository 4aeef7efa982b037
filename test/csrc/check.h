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

/// check.h: counts the conditions that do not hold, and prints each with its line.

#ifndef CHECK_H_
#define CHECK_H_

#include <stdbool.h>
#include <stdio.h>

static int failures = 0;

#define CHECK(condition) check((condition), #condition, __LINE__)

static void check(bool condition, const char * text, int line)
{
  if (!condition) {
    printf("line %d: not so: %s\n", line, text);
    failures += 1;
  }
}

#endif  // CHECK_H_
