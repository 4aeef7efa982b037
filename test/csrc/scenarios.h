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

/// scenarios.h: `SCENARIO(name) {...}` defines a scenario. The program runs all of them, or the
/// one that is its argument; with `list` it lists them. Exit status 0 if all that they say is so.

#ifndef SCENARIOS_H_
#define SCENARIOS_H_

#include <string.h>

#include "check.h"

struct scenario
{
  const char * name;
  void (* run)(void);
  struct scenario * next;
};

static struct scenario * first_scenario = NULL;
static struct scenario ** last_link = &first_scenario;

static void add_scenario(struct scenario * scenario)
{
  *last_link = scenario;
  last_link = &scenario->next;
}

#define SCENARIO(name) \
  static void name(void); \
  __attribute__((constructor)) static void add_ ## name(void) \
  { \
    static struct scenario added = {#name, name, NULL}; \
    add_scenario(&added); \
  } \
  static void name(void)

int main(int argc, char ** argv)
{
  const char * const chosen = argc > 1 ? argv[1] : "";
  const bool lists = strcmp(chosen, "list") == 0;
  bool is_known = argc < 2 || lists;
  for (const struct scenario * each = first_scenario; each != NULL; each = each->next) {
    if (lists) {
      puts(each->name);
    } else if (argc < 2 || strcmp(chosen, each->name) == 0) {
      is_known = true;
      each->run();
    }
  }
  return failures == 0 && is_known ? 0 : 1;
}

#endif  // SCENARIOS_H_
