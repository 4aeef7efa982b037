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


/// in_place_types.c: see in_place_types.h for the contract.

#define _POSIX_C_SOURCE 200809L

#include "in_place_types.h"

#include <dlfcn.h>
#include <rmw/rmw.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "in_place.h"
#include "in_place_versions.h"
#include "rmw_functions.h"

#define FAST_DDS "rmw_fastrtps_cpp"
#define FAST_CDR "libfastcdr.so.2"
// FastBuffer(char *, size_t) and Cdr(FastBuffer &, Endianness, CdrVersion) of Fast CDR
#define MAKE_BUFFER "_ZN8eprosima7fastcdr10FastBufferC1EPcm"
#define MAKE_CDR "_ZN8eprosima7fastcdr3CdrC1ERNS0_10FastBufferENS1_10EndiannessENS0_10CdrVersionE"

enum { MAPS_BYTES = 1 << 20, WHY_BYTES = 256 };

struct type
{
  struct fm_in_place_type made;  // first: a pointer to it is one to its type support
  struct type * next;
};

static struct
{
  struct fm_middleware middleware;
  struct type * types;
  char why[WHY_BYTES];
  bool has_begun;
} process;

static bool are_versions_known(void)
{
  char * maps = calloc(1, MAPS_BYTES + 1);
  FILE * file = maps == NULL ? NULL : fopen("/proc/self/maps", "r");
  const size_t n = file == NULL ? 0 : fread(maps, 1, MAPS_BYTES, file);
  if (file != NULL) {
    (void)fclose(file);
  }
  const bool is_known = n > 0 && fm_in_place_is_known(maps, process.why, WHY_BYTES);
  free(maps);
  return is_known;
}

// A function of a library. POSIX lets a pointer to an object be copied to one to a function.
static bool find(void * library, const char * name, void * function)
{
  void * found = library == NULL ? NULL : dlsym(library, name);
  memcpy(function, &found, sizeof(found));
  return found != NULL;
}

static bool find_members(void)
{
  void (* make_buffer)(void *, char *, size_t);
  void (* make_cdr)(void *, void *, int, int);
  void * library = dlopen(FAST_CDR, RTLD_LAZY);  // it is loaded; never closed
  (void)snprintf(process.why, WHY_BYTES, "objects of Fast CDR are not as expected");
  return find(library, MAKE_BUFFER, (void *)&make_buffer) &&
         find(library, MAKE_CDR, (void *)&make_cdr) &&
         fm_in_place_find(make_buffer, make_cdr, &process.middleware.in_place);
}

static void begin(void)
{
  if (process.has_begun) {
    return;
  }
  process.has_begun = true;
  process.middleware = fm_rmw_functions;
  (void)snprintf(process.why, WHY_BYTES, "%s is not " FAST_DDS,
    rmw_get_implementation_identifier());
  if (strcmp(rmw_get_implementation_identifier(), FAST_DDS) == 0 && are_versions_known() &&
    find_members())
  {
    process.why[0] = '\0';
  }
}

const struct fm_middleware * fm_node_middleware(void)
{
  begin();
  return &process.middleware;
}

const char * fm_why_copied(void)
{
  begin();
  return process.why;
}

const rosidl_message_type_support_t * fm_in_place_type_of(
  const rosidl_message_type_support_t * original)
{
  const struct fm_type_support * wanted = (const void *)original;
  if (fm_why_copied()[0] != '\0') {
    return NULL;
  }
  for (const struct type * type = process.types; type != NULL; type = type->next) {
    if (type->made.original == wanted) {
      return (const void *)&type->made.support;
    }
  }
  struct type * type = calloc(1, sizeof(*type));
  if (type == NULL || !fm_in_place_make(wanted, &type->made)) {
    free(type);
    return NULL;
  }
  type->next = process.types;
  process.types = type;
  return (const void *)&type->made.support;
}
