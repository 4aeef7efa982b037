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

/// endpoints.h: services, clients and publishers of the node; answers the requests of a service.
///
/// The main thread only.

#ifndef ENDPOINTS_H_
#define ENDPOINTS_H_

#include <rcl/client.h>
#include <rcl/error_handling.h>
#include <rcl/publisher.h>

#include "log.h"
#include "service_call.h"
#include "subscription.h"

/// A service that is offered. `serve` answers the requests that wait.
struct fm_offered
{
  const rcl_service_t * service;
  void (* serve)(const struct fm_node * node, const rcl_service_t * service, void * context);
  void * context;
};

#define FM_ANSWER(serve, package, type, context_type, context) \
  static void serve ## _one( \
    context_type * context, const package ## __srv__ ## type ## _Request * request, \
    package ## __srv__ ## type ## _Response * response)

/// Define the function `serve` of a service: it answers each request by the body that follows,
/// which has `context`, `request` and `response`; that is initialised before, and freed after. The
/// service's headers (functions of requests and responses) are included before.
#define FM_SERVER(serve, package, type, context_type, context) \
  FM_ANSWER(serve, package, type, context_type, context); \
  static void serve(const struct fm_node * node, const rcl_service_t * service, void * given) \
  { \
    package ## __srv__ ## type ## _Request request; \
    package ## __srv__ ## type ## _Response response; \
    rmw_request_id_t id; \
    if (!package ## __srv__ ## type ## _Request__init(&request)) { \
      return; \
    } \
    while (rcl_take_request(service, &id, &request) == RCL_RET_OK) { \
      if (package ## __srv__ ## type ## _Response__init(&response)) { \
        serve ## _one(given, &request, &response); \
        fm_respond(node, service, &id, &response); \
        package ## __srv__ ## type ## _Response__fini(&response); \
      } \
    } \
    rcl_reset_error(); \
    package ## __srv__ ## type ## _Request__fini(&request); \
  } \
  FM_ANSWER(serve, package, type, context_type, context)

/// Make a service; `name` is relative to the node (`~/reset`). Returns false, with the error
/// logged.
bool fm_service_open(
  struct fm_node * node, rcl_service_t * service, const rosidl_service_type_support_t * type,
  const char * name, const rmw_qos_profile_t * profile);

/// Send a response; a failure is logged. The middleware gives up (RCL_RET_TIMEOUT) if it does not
/// find the client within 0.1 s or so, as it is when a client asks as soon as it has begun.
void fm_respond(
  const struct fm_node * node, const rcl_service_t * service, rmw_request_id_t * request,
  void * response);

/// Make a publisher. Returns false, with the error logged, and nothing to close.
bool fm_publisher_open(
  const struct fm_node * node, rcl_publisher_t * publisher,
  const rosidl_message_type_support_t * type, const char * topic,
  const rmw_qos_profile_t * profile);

/// The same for a topic of the bundle: reliable, volatile, with a queue of `depth` messages.
bool fm_advertise(
  const struct fm_node * node, rcl_publisher_t * publisher,
  const rosidl_message_type_support_t * type, const char * topic, uint32_t depth);

/// Make a client, and fill in what calls of the service need. Returns false, with the error
/// logged, and nothing to close.
bool fm_client_open(
  const struct fm_node * node, rcl_client_t * client, const rosidl_service_type_support_t * type,
  const char * name, struct fm_service_client * end);

/// End a service, a publisher or a client; does nothing to a zeroed one. A publisher is zeroed.
void fm_service_close(struct fm_node * node, rcl_service_t * service);
void fm_publisher_close(struct fm_node * node, rcl_publisher_t * publisher);
void fm_client_close(struct fm_node * node, rcl_client_t * client);

/// How many subscriptions a publisher has matched. Any thread.
size_t fm_listeners(const rcl_publisher_t * publisher);

/// Call `use` with the publishers on a topic, by its full name; `offers` are valid during the
/// call. False, without a call: rcl failed, or memory is short. O(publishers).
bool fm_look_for_publishers(
  const struct fm_node * node, const char * topic,
  void (* use)(void * context, const struct fm_offer * offers, uint32_t n), void * context);

#endif  // ENDPOINTS_H_
