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

/// mapped_topic.c: see mapped_topic.h for the contract.

#include "mapped_topic.h"

#include <rcl/error_handling.h>
#include <rcl/graph.h>
#include <stdlib.h>
#include <string.h>

#include "offers.h"

// In a handover the old subscription is kept until all publishers have discovered the new one.
#define OVERLAP_S 2.0   // until the old subscription is closed, at most
#define ASSURED_S 0.5   // until it is closed if the new one has matched all publishers
#define GRACE_S 1.0     // after it was closed, during which duplicates are still recognised
#define NAMED_S 2.0     // until a publisher is logged without the name of its node
#define LOSSES_S 10.0   // between two log lines about lost messages
#define UNNAMED "_NODE_NAME_UNKNOWN_"

static int64_t after(double seconds)
{
  return fm_steady_now() + (int64_t)(seconds * 1e9);
}

char * fm_resolved_name(const struct fm_node * node, const char * name)
{
  char * resolved = NULL;
  if (rcl_node_resolve_name(
      &node->node, name, node->allocator, false, false, &resolved) != RCL_RET_OK)
  {
    return NULL;
  }
  char * copy = fm_copy_of(resolved);
  node->allocator.deallocate(resolved, node->allocator.state);
  return copy;
}

// ---- subscriptions -----------------------------------------------------------------------------

static bool subscribe(
  struct fm_mapped_topic * topic, const rmw_qos_profile_t * profile, struct fm_intake * intake)
{
  rcl_subscription_options_t options = rcl_subscription_get_default_options();
  options.qos = *profile;
  intake->profile = *profile;
  intake->receiver = NULL;
  intake->subscription = rcl_get_zero_initialized_subscription();
  if (rcl_subscription_init(
      &intake->subscription, &topic->node->node, topic->about->support(), topic->about->name,
      &options) == RCL_RET_OK)
  {
    return true;
  }
  fm_log(topic->node, FM_ERROR, "cannot subscribe to %s as %s: %s", topic->name,
    topic->about->type, rcl_get_error_string().str);
  rcl_reset_error();
  return false;
}

static bool receive(struct fm_mapped_topic * topic, struct fm_intake * intake)
{
  if (fm_receiver_start(
      &intake->receiver, topic->engine, topic->middleware,
      rcl_subscription_get_rmw_handle(&intake->subscription), topic->index, FM_LISTEN))
  {
    return true;
  }
  fm_log(topic->node, FM_ERROR, "cannot take the messages on %s: the middleware has no callback "
    "for new messages", topic->name);
  return false;
}

static bool end_intake(struct fm_mapped_topic * topic, struct fm_intake * intake)
{
  if (intake->receiver != NULL) {
    fm_receiver_drain(intake->receiver);
  }
  if (!fm_receiver_stop(&intake->receiver)) {
    return false;
  }
  if (intake->subscription.impl != NULL &&
    rcl_subscription_fini(&intake->subscription, &topic->node->node) != RCL_RET_OK)
  {
    rcl_reset_error();
  }
  return true;
}

bool fm_topic_open(
  struct fm_mapped_topic * topic, struct fm_node * node, const struct fm_node_topic * about,
  const struct fm_fixed_qos * fixed, uint32_t index)
{
  const rmw_topic_endpoint_info_array_t none = rmw_get_zero_initialized_topic_endpoint_info_array();
  topic->node = node;
  topic->about = about;
  topic->fixed = *fixed;
  topic->index = index;
  topic->name = fm_resolved_name(node, about->name);
  if (topic->name == NULL) {
    fm_log_failure(node, "cannot subscribe");
    return false;
  }
  const rmw_qos_profile_t profile = fm_wanted_profile(&none, about->type, fixed);
  return subscribe(topic, &profile, &topic->current);
}

bool fm_topic_start(
  struct fm_mapped_topic * topic, struct fm_engine * engine,
  const struct fm_middleware * middleware)
{
  topic->engine = engine;
  topic->middleware = middleware;
  return receive(topic, &topic->current);
}

bool fm_topic_close(struct fm_mapped_topic * topic)
{
  bool is_over = true;
  for (uint32_t k = 0; k < topic->n_retired; ++k) {
    is_over = end_intake(topic, &topic->retired[k]) && is_over;
  }
  is_over = end_intake(topic, &topic->current) && is_over;
  fm_text_free(&topic->publishers.unmatched);
  fm_text_free(&topic->publishers.other_types);
  fm_text_free(&topic->logged_types);
  free(topic->known);
  free(topic->name);
  memset(topic, 0, sizeof(*topic));
  return is_over;
}

// ---- handover ----------------------------------------------------------------------------------

static void add_who(struct fm_text * text, const rmw_topic_endpoint_info_t * publisher)
{
  if (strcmp(publisher->node_name, UNNAMED) == 0) {
    fm_text_add(text, "a publisher of no known node");
    return;
  }
  const bool is_root = strcmp(publisher->node_namespace, "/") == 0;
  fm_text_add(text, "%s/%s", is_root ? "" : publisher->node_namespace, publisher->node_name);
}

static bool is_of_type(
  const struct fm_mapped_topic * topic, const rmw_topic_endpoint_info_t * publisher)
{
  return strcmp(publisher->topic_type, topic->about->type) == 0;
}

static bool is_unmatched(
  const struct fm_mapped_topic * topic, const rmw_topic_endpoint_info_t * publisher)
{
  return fm_misfits_reliability(&topic->current.profile, &publisher->qos_profile) ||
         fm_misfits_durability(&topic->current.profile, &publisher->qos_profile);
}

// The new subscription may receive duplicates of what the old one received, and history, which
// must not be delivered after newer messages.
static bool renew(
  struct fm_mapped_topic * topic, const rmw_qos_profile_t * wanted,
  const rmw_topic_endpoint_info_array_t * publishers)
{
  struct fm_intake new_intake;
  struct fm_text reason = {NULL, 0, 0};
  if (topic->n_retired == FM_MOST_RETIRED || !subscribe(topic, wanted, &new_intake)) {
    return false;
  }
  for (size_t k = 0; k < publishers->size && reason.length == 0; ++k) {
    const rmw_topic_endpoint_info_t * publisher = &publishers->info_array[k];
    if (is_of_type(topic, publisher) && is_unmatched(topic, publisher)) {
      fm_text_add(&reason, "to receive from ");
      add_who(&reason, publisher);
    }
  }
  fm_engine_begin_handover(
    topic->engine, topic->index,
    wanted->durability == RMW_QOS_POLICY_DURABILITY_TRANSIENT_LOCAL);
  fm_receiver_retire(topic->current.receiver);
  topic->current.until = after(OVERLAP_S);
  topic->retired[topic->n_retired++] = topic->current;
  topic->current = new_intake;
  (void)receive(topic, &topic->current);
  fm_log(topic->node, FM_INFO, "subscribed anew to %s (%s) %s", topic->name,
    fm_describe_profile(wanted),
    reason.length > 0 ? fm_text_get(&reason) : "as its publishers offer it");
  fm_text_free(&reason);
  return true;
}

static bool is_assured(const struct fm_mapped_topic * topic, int64_t now, int64_t until)
{
  size_t matched = 0;
  if (rcl_subscription_get_publisher_count(&topic->current.subscription, &matched) != RCL_RET_OK) {
    rcl_reset_error();
  }
  return now >= until - (int64_t)((OVERLAP_S - ASSURED_S) * 1e9) &&
         matched >= topic->publishers.matching_type;
}

static void let_go(struct fm_mapped_topic * topic)
{
  const int64_t now = fm_steady_now();
  uint32_t kept = 0;
  for (uint32_t k = 0; k < topic->n_retired; ++k) {
    struct fm_intake * old = &topic->retired[k];
    if (now < old->until && !is_assured(topic, now, old->until)) {
      topic->retired[kept++] = *old;
    } else if (end_intake(topic, old)) {
      topic->handover_ends = after(GRACE_S);
    } else {
      old->until = INT64_MAX;  // the middleware may still call back: keep it
      topic->retired[kept++] = *old;
    }
  }
  topic->n_retired = kept;
  // The queue of the new subscription may still hold duplicates.
  if (kept == 0 && topic->handover_ends != 0 && now >= topic->handover_ends) {
    topic->handover_ends = 0;
    fm_engine_end_handover(topic->engine, topic->index);
  }
}

// ---- publishers --------------------------------------------------------------------------------

static struct fm_known_publisher * find_known(
  const struct fm_mapped_topic * topic, const uint8_t * gid)
{
  for (size_t k = 0; k < topic->n_known; ++k) {
    if (memcmp(topic->known[k].gid, gid, RMW_GID_STORAGE_SIZE) == 0) {
      return &topic->known[k];
    }
  }
  return NULL;
}

// Remember these publishers. Returns whether one of the topic's type is new.
static bool note_known(
  struct fm_mapped_topic * topic, const rmw_topic_endpoint_info_array_t * publishers)
{
  bool has_new = false;
  struct fm_known_publisher * known = calloc(publishers->size + 1u, sizeof(*known));
  if (known == NULL) {
    return false;
  }
  for (size_t k = 0; k < publishers->size; ++k) {
    const rmw_topic_endpoint_info_t * publisher = &publishers->info_array[k];
    const struct fm_known_publisher * before = find_known(topic, publisher->endpoint_gid);
    memcpy(known[k].gid, publisher->endpoint_gid, RMW_GID_STORAGE_SIZE);
    known[k].is_logged = before != NULL && before->is_logged;
    has_new = has_new || (before == NULL && is_of_type(topic, publisher));
  }
  free(topic->known);
  topic->known = known;
  topic->n_known = publishers->size;
  return has_new;
}

static void log_type(struct fm_mapped_topic * topic, const rmw_topic_endpoint_info_t * publisher)
{
  struct fm_text key = {NULL, 0, 0};
  fm_text_add(&key, "|%s|", publisher->topic_type);
  if (strstr(fm_text_get(&topic->logged_types), fm_text_get(&key)) == NULL) {
    fm_text_add(&topic->logged_types, "%s", fm_text_get(&key));
    fm_text_clear(&key);
    add_who(&key, publisher);
    fm_log(topic->node, FM_ERROR,
      "%s publishes %s on %s, where the bundle says %s: its messages are not received",
      fm_text_get(&key), publisher->topic_type, topic->name, topic->about->type);
  }
  fm_text_free(&key);
}

static void log_unmatched(
  struct fm_mapped_topic * topic, const rmw_topic_endpoint_info_t * publisher)
{
  struct fm_known_publisher * known = find_known(topic, publisher->endpoint_gid);
  struct fm_text who = {NULL, 0, 0};
  struct fm_text remedy = {NULL, 0, 0};
  if (known == NULL || known->is_logged) {
    return;
  }
  known->is_logged = true;
  add_who(&who, publisher);
  if (topic->fixed.reliability != FM_FOLLOW &&
    fm_misfits_reliability(&topic->current.profile, &publisher->qos_profile))
  {
    fm_text_list(&remedy, " and ", "`reliability`");
  }
  if (topic->fixed.durability != FM_FOLLOW &&
    fm_misfits_durability(&topic->current.profile, &publisher->qos_profile))
  {
    fm_text_list(&remedy, " and ", "`durability`");
  }
  fm_log(topic->node, FM_ERROR,
    "%s does not match the subscription to %s: it offers %s, and what is requested, by `qos` or "
    "`qos_overrides`, is %s%s%s%s", fm_text_get(&who), topic->name,
    fm_describe_profile(&publisher->qos_profile), fm_describe_profile(&topic->current.profile),
    remedy.length > 0 ? ": leave " : "", fm_text_get(&remedy),
    remedy.length > 0 ? " out there" : "");
  fm_text_free(&who);
  fm_text_free(&remedy);
}

// The middleware discovers a publisher first, and its node a moment later: wait for the name.
static bool may_be_logged(
  struct fm_mapped_topic * topic, const rmw_topic_endpoint_info_t * publisher)
{
  if (strcmp(publisher->node_name, UNNAMED) != 0) {
    return true;
  }
  if (topic->unnamed_since == 0) {
    topic->unnamed_since = fm_steady_now();
  }
  return fm_steady_now() >= topic->unnamed_since + (int64_t)(NAMED_S * 1e9);
}

static void add_once(struct fm_text * list, const char * word)
{
  const char * place = strstr(fm_text_get(list), word);
  const size_t length = strlen(word);
  if (place == NULL || (place[length] != '\0' && place[length] != ',')) {
    fm_text_list(list, ", ", word);
  }
}

static void note_status(
  struct fm_mapped_topic * topic, const rmw_topic_endpoint_info_array_t * publishers)
{
  struct fm_text who = {NULL, 0, 0};
  bool has_unnamed = false;
  topic->publishers.matching_type = 0;
  fm_text_clear(&topic->publishers.unmatched);
  fm_text_clear(&topic->publishers.other_types);
  for (size_t k = 0; k < publishers->size; ++k) {
    const rmw_topic_endpoint_info_t * publisher = &publishers->info_array[k];
    has_unnamed = has_unnamed || strcmp(publisher->node_name, UNNAMED) == 0;
    if (!is_of_type(topic, publisher)) {
      add_once(&topic->publishers.other_types, publisher->topic_type);
      if (may_be_logged(topic, publisher)) {
        log_type(topic, publisher);
      }
      continue;
    }
    topic->publishers.matching_type += 1u;
    if (is_unmatched(topic, publisher)) {
      fm_text_clear(&who);
      add_who(&who, publisher);
      add_once(&topic->publishers.unmatched, fm_text_get(&who));
      if (may_be_logged(topic, publisher)) {
        log_unmatched(topic, publisher);
      }
    }
  }
  if (!has_unnamed) {
    topic->unnamed_since = 0;
  }
  fm_text_free(&who);
}

static void log_lost(struct fm_mapped_topic * topic)
{
  const uint64_t all = fm_engine_lost(topic->engine, topic->index);
  const uint64_t lost = all - topic->logged_losses;
  if (all > topic->logged_losses && fm_passes(&topic->next_loss_line, LOSSES_S)) {
    topic->logged_losses = all;
    fm_log(topic->node, FM_WARN,
      "%llu message%s lost on %s since the last such message: a queue overflowed "
      "(`qos: {depth: ...}`), or the network dropped them", (unsigned long long)lost,
      lost == 1u ? " was" : "s were", topic->name);
  }
}

void fm_topic_review(struct fm_mapped_topic * topic)
{
  rmw_topic_endpoint_info_array_t publishers = rmw_get_zero_initialized_topic_endpoint_info_array();
  let_go(topic);
  if (topic->current.receiver != NULL) {
    fm_receiver_poll(topic->current.receiver);
  }
  if (rcl_get_publishers_info_by_topic(
      &topic->node->node, &topic->node->allocator, topic->name, false, &publishers) != RCL_RET_OK)
  {
    rcl_reset_error();
    return;
  }
  const rmw_qos_profile_t wanted =
    fm_wanted_profile(&publishers, topic->about->type, &topic->fixed);
  topic->has_new = note_known(topic, &publishers) || topic->has_new;
  if (topic->has_new) {
    topic->has_new = !fm_same_request(&wanted, &topic->current.profile) &&
      !renew(topic, &wanted, &publishers);
  }
  note_status(topic, &publishers);
  log_lost(topic);
  if (rmw_topic_endpoint_info_array_fini(&publishers, &topic->node->allocator) != RMW_RET_OK) {
    rcl_reset_error();
  }
}
