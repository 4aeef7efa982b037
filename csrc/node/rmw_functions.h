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

/// rmw_functions.h: the middleware's functions, and the type supports with which it lets C read
/// messages in its buffers, without a copy (in_place.h).
///
/// Type supports are for the whole process, since the middleware keeps pointers to them: they are
/// never freed. The main thread only.

#ifndef RMW_FUNCTIONS_H_
#define RMW_FUNCTIONS_H_

#include <rosidl_runtime_c/message_type_support_struct.h>

#include "graph.h"
#include "service_call.h"

/// The functions of rmw.
extern const struct fm_service_functions fm_rmw_services;
extern const struct fm_graph_functions fm_rmw_graph;

/// rmw_publish_serialized_message.
int fm_rmw_publish_serialized(
  const void * publisher, const struct fm_serialized * message, void * allocation);

/// The same, with what reading in place needs if that is possible. A receiver that cannot be
/// stopped may use them as long as the process.
const struct fm_middleware * fm_node_middleware(void);

/// Why messages are copied before they are read; "": they are read in place.
const char * fm_why_copied(void);

/// The type support to subscribe with, to read messages in place; NULL: they are to be copied.
/// O(types).
const rosidl_message_type_support_t * fm_in_place_type_of(
  const rosidl_message_type_support_t * original);

#endif  // RMW_FUNCTIONS_H_
