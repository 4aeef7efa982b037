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

/// serve.h: answers the requests of a service.

#ifndef SERVE_H_
#define SERVE_H_

#include "log.h"

/// Define a function `name` that takes the waiting requests of a service and answers each with
/// `answer(context, &request, &response)`; a response is initialised before, and freed after. The
/// service's headers (functions of requests and responses) are included before.
#define FM_DEFINE_SERVER(name, package, type, context_type, answer) \
  static void name(const rcl_service_t * service, context_type * context) \
  { \
    package ## __srv__ ## type ## _Request request; \
    package ## __srv__ ## type ## _Response response; \
    rmw_request_id_t id; \
    if (!package ## __srv__ ## type ## _Request__init(&request)) { \
      return; \
    } \
    while (rcl_take_request(service, &id, &request) == RCL_RET_OK) { \
      if (package ## __srv__ ## type ## _Response__init(&response)) { \
        answer(context, &request, &response); \
        if (rcl_send_response(service, &id, &response) != RCL_RET_OK) { \
          rcl_reset_error(); \
        } \
        package ## __srv__ ## type ## _Response__fini(&response); \
      } \
    } \
    rcl_reset_error(); \
    package ## __srv__ ## type ## _Request__fini(&request); \
  }

/// Make a service; `name` is relative to the node (`~/reset`). Returns false, with the error
/// logged.
bool fm_service_open(
  struct fm_node * node, rcl_service_t * service, const rosidl_service_type_support_t * type,
  const char * name, const rmw_qos_profile_t * profile);

/// End a service; does nothing to a zeroed one.
void fm_service_close(struct fm_node * node, rcl_service_t * service);

#endif  // SERVE_H_
