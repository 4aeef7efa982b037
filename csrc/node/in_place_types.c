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

#include "in_place_types.h"

#include <rmw/rmw.h>
#include <stdlib.h>

#include "in_place.h"
#include "in_place_versions.h"
#include "rmw_functions.h"

enum { WHY_BYTES = 256 };

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

static void begin(void)
{
  if (!process.has_begun) {
    process.has_begun = true;
    process.middleware = fm_rmw_functions;
    (void)fm_in_place_prepare(
      rmw_get_implementation_identifier(), &process.middleware.in_place, process.why, WHY_BYTES);
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
