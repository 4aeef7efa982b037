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

/// endpoints.c: see endpoints.h for the contract.

#include "endpoints.h"

#include <rcl/error_handling.h>
#include <rcl/graph.h>
#include <rcl/service.h>
#include <rmw/qos_profiles.h>
#include <stdlib.h>
#include <string.h>

#include "words.h"

bool fm_service_open(
  struct fm_node * node, rcl_service_t * service, const rosidl_service_type_support_t * type,
  const char * name, const rmw_qos_profile_t * profile)
{
  rcl_service_options_t options = rcl_service_get_default_options();
  options.qos = *profile;
  *service = rcl_get_zero_initialized_service();
  if (rcl_service_init(service, &node->node, type, name, &options) == RCL_RET_OK) {
    return true;
  }
  fm_log(node, FM_ERROR, "cannot offer the service %s: %s", name, rcl_get_error_string().str);
  rcl_reset_error();
  return false;
}

void fm_service_close(struct fm_node * node, rcl_service_t * service)
{
  if (service->impl != NULL) {
    fm_ignore(rcl_service_fini(service, &node->node));
  }
}

void fm_respond(
  const struct fm_node * node, const rcl_service_t * service, rmw_request_id_t * request,
  void * response)
{
  if (rcl_send_response(service, request, response) != RCL_RET_OK) {
    fm_log(node, FM_WARN, FM_WORDS_RESPONSE_NOT_SENT,
      rcl_service_get_service_name(service), rcl_get_error_string().str);
    rcl_reset_error();
  }
}

bool fm_publisher_open(
  const struct fm_node * node, rcl_publisher_t * publisher,
  const rosidl_message_type_support_t * type, const char * topic,
  const rmw_qos_profile_t * profile)
{
  rcl_publisher_options_t options = rcl_publisher_get_default_options();
  options.qos = *profile;
  *publisher = rcl_get_zero_initialized_publisher();
  const bool is_made =
    rcl_publisher_init(publisher, &node->node, type, topic, &options) == RCL_RET_OK;
  if (!is_made) {
    fm_log_failure(node, FM_WORDS_NO_ENDPOINT);
  }
  return is_made;
}

bool fm_advertise(
  const struct fm_node * node, rcl_publisher_t * publisher,
  const rosidl_message_type_support_t * type, const char * topic, uint32_t depth)
{
  rmw_qos_profile_t profile = rmw_qos_profile_default;  // reliable, volatile
  profile.depth = depth;
  return fm_publisher_open(node, publisher, type, topic, &profile);
}

void fm_publisher_close(struct fm_node * node, rcl_publisher_t * publisher)
{
  if (publisher->impl != NULL) {
    fm_ignore(rcl_publisher_fini(publisher, &node->node));
  }
  *publisher = rcl_get_zero_initialized_publisher();
}

size_t fm_listeners(const rcl_publisher_t * publisher)
{
  size_t n = 0;
  fm_ignore(rcl_publisher_get_subscription_count(publisher, &n));
  return n;
}

bool fm_client_open(
  const struct fm_node * node, rcl_client_t * client, const rosidl_service_type_support_t * type,
  const char * name, struct fm_service_client * end)
{
  const rcl_client_options_t options = rcl_client_get_default_options();
  *client = rcl_get_zero_initialized_client();
  if (rcl_client_init(client, &node->node, type, name, &options) != RCL_RET_OK) {
    fm_log_failure(node, FM_WORDS_NO_ENDPOINT);
    return false;
  }
  *end = (struct fm_service_client) {
    rcl_node_get_rmw_handle(&node->node), rcl_client_get_rmw_handle(client), (const void *)type,
    rcl_client_get_service_name(client)};
  return true;
}

void fm_client_close(struct fm_node * node, rcl_client_t * client)
{
  if (client->impl != NULL) {
    fm_ignore(rcl_client_fini(client, &node->node));
  }
}

static struct fm_offer offer_of(const rmw_topic_endpoint_info_t * publisher)
{
  const rmw_qos_profile_t * profile = &publisher->qos_profile;
  struct fm_offer offer = {
    .node = publisher->node_name, .name_space = publisher->node_namespace,
    .type = publisher->topic_type,
    .is_reliable = profile->reliability == RMW_QOS_POLICY_RELIABILITY_RELIABLE,
    .is_durable = profile->durability == RMW_QOS_POLICY_DURABILITY_TRANSIENT_LOCAL};
  memcpy(offer.gid, publisher->endpoint_gid, FM_GID_BYTES);
  return offer;
}

bool fm_look_for_publishers(
  const struct fm_node * node, const char * topic,
  void (* use)(void * context, const struct fm_offer * offers, uint32_t n), void * context)
{
  rmw_topic_endpoint_info_array_t found = rmw_get_zero_initialized_topic_endpoint_info_array();
  rcl_allocator_t allocator = node->allocator;
  if (rcl_get_publishers_info_by_topic(&node->node, &allocator, topic, false, &found) !=
    RCL_RET_OK)
  {
    rcl_reset_error();
    return false;
  }
  struct fm_offer * offers = calloc(found.size + 1u, sizeof(*offers));
  if (offers != NULL) {
    for (size_t k = 0; k < found.size; ++k) {
      offers[k] = offer_of(&found.info_array[k]);
    }
    use(context, offers, (uint32_t)found.size);
  }
  const bool is_read = offers != NULL;
  free(offers);
  fm_ignore(rmw_topic_endpoint_info_array_fini(&found, &allocator));
  return is_read;
}
