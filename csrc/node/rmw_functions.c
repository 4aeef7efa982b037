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

/// rmw_functions.c: see rmw_functions.h for the contract.
///
/// middleware.h declares the structs of rmw under names of its own, so that the libraries of
/// `compile` need no headers of ROS. Here both are known, and their sizes are compared.

#include "rmw_functions.h"

#include <rcutils/error_handling.h>
#include <rmw/get_topic_names_and_types.h>
#include <rmw/names_and_types.h>
#include <rmw/rmw.h>
#include <rmw/types.h>
#include <stdlib.h>

#include "in_place.h"
#include "in_place_versions.h"

typedef char same_message[
  sizeof(struct fm_serialized) == sizeof(rmw_serialized_message_t) ? 1 : -1];
typedef char same_service_info[
  sizeof(struct fm_service_info) == sizeof(rmw_service_info_t) ? 1 : -1];
typedef char fitting_info[
  sizeof(struct fm_padded_info) >= sizeof(rmw_message_info_t) ? 1 : -1];

typedef char same_strings[
  sizeof(struct fm_strings) == sizeof(rcutils_string_array_t) ? 1 : -1];

static int node_names(
  const void * node, struct fm_strings * names, struct fm_strings * namespaces)
{
  return rmw_get_node_names(
    node, (rcutils_string_array_t *)(void *)names, (rcutils_string_array_t *)(void *)namespaces);
}

static int count_publishers(const void * node, const char * topic, size_t * count)
{
  return rmw_count_publishers(node, topic, count);
}

static int count_subscribers(const void * node, const char * topic, size_t * count)
{
  return rmw_count_subscribers(node, topic, count);
}

static int free_strings(struct fm_strings * strings)
{
  return rcutils_string_array_fini((rcutils_string_array_t *)(void *)strings);
}

typedef char same_topics[
  sizeof(struct fm_names_and_types) == sizeof(rmw_names_and_types_t) ? 1 : -1];

static int topic_names(
  const void * node, struct fm_allocator * allocator, bool no_demangle,
  struct fm_names_and_types * found)
{
  return rmw_get_topic_names_and_types(
    node, (rcutils_allocator_t *)(void *)allocator, no_demangle,
    (rmw_names_and_types_t *)(void *)found);
}

static int free_topics(struct fm_names_and_types * found)
{
  return rmw_names_and_types_fini((rmw_names_and_types_t *)(void *)found);
}

const struct fm_graph_functions fm_rmw_graph = {
  node_names, count_publishers, count_subscribers, free_strings, rcutils_reset_error, topic_names,
  free_topics};

static int take(
  const void * subscription, struct fm_serialized * message, bool * taken,
  struct fm_message_info * info, void * allocation)
{
  return rmw_take_serialized_message_with_info(
    subscription, (rmw_serialized_message_t *)(void *)message, taken,
    (rmw_message_info_t *)(void *)info, allocation);
}

static int take_message(
  const void * subscription, void * message, bool * taken, struct fm_message_info * info,
  void * allocation)
{
  return rmw_take_with_info(
    subscription, message, taken, (rmw_message_info_t *)(void *)info, allocation);
}

static int listen(void * subscription, fm_on_message callback, const void * user_data)
{
  return rmw_subscription_set_on_new_message_callback(subscription, callback, user_data);
}

static int is_available(const void * node, const void * client, bool * found)
{
  return rmw_service_server_is_available(node, client, found);
}

static int send_request(const void * client, const void * request, int64_t * sequence)
{
  return rmw_send_request(client, request, sequence);
}

static int take_response(
  const void * client, struct fm_service_info * info, void * response, bool * taken)
{
  return rmw_take_response(client, (rmw_service_info_t *)(void *)info, response, taken);
}

static int deserialize(
  const struct fm_serialized * message, const struct fm_type_support * type, void * out)
{
  return rmw_deserialize(
    (const rmw_serialized_message_t *)(const void *)message,
    (const rosidl_message_type_support_t *)(const void *)type, out);
}

int fm_rmw_publish_serialized(
  const void * publisher, const struct fm_serialized * message, void * allocation)
{
  return rmw_publish_serialized_message(
    publisher, (const rmw_serialized_message_t *)(const void *)message, allocation);
}

const struct fm_service_functions fm_rmw_services = {
  is_available, send_request, take_response, deserialize, rcutils_reset_error};

static int publish(const void * publisher, const void * message, void * allocation)
{
  return rmw_publish(publisher, message, allocation);
}

static int count_matched(const void * publisher, size_t * count)
{
  return rmw_publisher_count_matched_subscriptions(publisher, count);
}

// ---- reading in place --------------------------------------------------------------------------

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
} process = {
  .middleware = {
    take, listen, publish, rcutils_reset_error, rcutils_error_is_set, take_message, {0, 0, 0},
    count_matched}};

static void begin(void)
{
  if (!process.has_begun) {
    process.has_begun = true;
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
