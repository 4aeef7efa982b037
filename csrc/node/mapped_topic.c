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
#define RETRY_S 1.0     // after a subscription that failed, until the next attempt; it doubles
#define RETRY_MOST_S 60.0
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

// Returns false with the reason in `problem`, and nothing is left.
static bool subscribe(
  struct fm_mapped_topic * topic, const rmw_qos_profile_t * profile, struct fm_intake * intake,
  struct fm_text * problem)
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
  fm_text_add(problem, "%s", rcl_get_error_string().str);
  rcl_reset_error();
  return false;
}

// As subscribe.
static bool receive(
  struct fm_mapped_topic * topic, struct fm_intake * intake, struct fm_text * problem)
{
  if (fm_receiver_start(
      &intake->receiver, topic->engine, topic->middleware,
      rcl_subscription_get_rmw_handle(&intake->subscription), topic->index,
      fm_receiver_taking(rmw_get_implementation_identifier())))
  {
    return true;
  }
  fm_text_add(problem, "the middleware has no callback for new messages");
  return false;
}

static bool end_intake(struct fm_mapped_topic * topic, struct fm_intake * intake)
{
  if (intake->receiver != NULL) {
    fm_engine_drain(topic->engine);
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
  struct fm_text problem = {NULL, 0, 0};
  const bool is_done = subscribe(topic, &profile, &topic->current, &problem);
  if (!is_done) {
    fm_log(node, FM_ERROR, "cannot subscribe to %s as %s: %s", topic->name, about->type,
      fm_text_get(&problem));
  }
  fm_text_free(&problem);
  return is_done;
}

bool fm_topic_start(
  struct fm_mapped_topic * topic, struct fm_engine * engine,
  const struct fm_middleware * middleware)
{
  topic->engine = engine;
  topic->middleware = middleware;
  struct fm_text problem = {NULL, 0, 0};
  const bool is_done = receive(topic, &topic->current, &problem);
  if (!is_done) {
    fm_log(
      topic->node, FM_ERROR, "cannot take the messages on %s: %s", topic->name,
      fm_text_get(&problem));
  }
  fm_text_free(&problem);
  return is_done;
}

bool fm_topic_close(struct fm_mapped_topic * topic)
{
  bool is_over = !topic->is_leaked;
  for (uint32_t k = 0; k < topic->n_retired; ++k) {
    is_over = end_intake(topic, &topic->retired[k]) && is_over;
  }
  is_over = end_intake(topic, &topic->current) && is_over;
  fm_text_free(&topic->publishers.unmatched);
  fm_text_free(&topic->publishers.other_types);
  fm_text_free(&topic->logged_types);
  free(topic->retired);
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
  return !fm_matches(&topic->current.profile, &publisher->qos_profile);
}

static bool make_room(struct fm_mapped_topic * topic, struct fm_text * problem)
{
  struct fm_intake * retired =
    realloc(topic->retired, (topic->n_retired + 1u) * sizeof(*retired));
  if (retired == NULL) {
    fm_text_add(problem, "memory is short");
    return false;
  }
  topic->retired = retired;
  return true;
}

// Replace the subscription. Returns false with the reason in `problem`: the one before stays.
// The new subscription may receive duplicates of what the old one received, and history, which
// must not be delivered after newer messages.
static bool replace(
  struct fm_mapped_topic * topic, const rmw_qos_profile_t * wanted, struct fm_text * problem)
{
  struct fm_intake new_intake;
  if (!make_room(topic, problem) || !subscribe(topic, wanted, &new_intake, problem)) {
    return false;
  }
  fm_engine_begin_handover(
    topic->engine, topic->index,
    wanted->durability == RMW_QOS_POLICY_DURABILITY_TRANSIENT_LOCAL);
  fm_receiver_retire(topic->current.receiver);
  if (!receive(topic, &new_intake, problem)) {
    (void)end_intake(topic, &new_intake);
    topic->handover_ends = after(GRACE_S);
    return false;
  }
  topic->current.until = after(OVERLAP_S);
  topic->retired[topic->n_retired++] = topic->current;
  topic->current = new_intake;
  return true;
}

static void log_renewed(
  const struct fm_mapped_topic * topic, const rmw_qos_profile_t * before,
  const rmw_topic_endpoint_info_array_t * publishers)
{
  struct fm_text reason = {NULL, 0, 0};
  for (size_t k = 0; k < publishers->size && reason.length == 0; ++k) {
    const rmw_topic_endpoint_info_t * publisher = &publishers->info_array[k];
    if (is_of_type(topic, publisher) && !fm_matches(before, &publisher->qos_profile)) {
      fm_text_add(&reason, "to receive from ");
      add_who(&reason, publisher);
    }
  }
  fm_log(topic->node, FM_INFO, "subscribed anew to %s (%s) %s", topic->name,
    fm_describe_profile(&topic->current.profile),
    reason.length > 0 ? fm_text_get(&reason) : "as its publishers offer it");
  fm_text_free(&reason);
}

// Attempts get rarer, and only the first failure is logged.
static void note_failure(
  struct fm_mapped_topic * topic, const rmw_qos_profile_t * wanted, const struct fm_text * problem)
{
  const double doubled = 2.0 * topic->retry_s;
  if (topic->retry_s == 0.0) {
    fm_log(topic->node, FM_ERROR,
      "cannot subscribe anew to %s (%s): %s; the subscription before is kept, and there are "
      "further attempts", topic->name, fm_describe_profile(wanted), fm_text_get(problem));
  }
  topic->retry_s = doubled == 0.0 ? RETRY_S : doubled < RETRY_MOST_S ? doubled : RETRY_MOST_S;
  topic->retry_at = after(topic->retry_s);
}

static void renew(
  struct fm_mapped_topic * topic, const rmw_qos_profile_t * wanted,
  const rmw_topic_endpoint_info_array_t * publishers)
{
  const rmw_qos_profile_t before = topic->current.profile;
  struct fm_text problem = {NULL, 0, 0};
  if (replace(topic, wanted, &problem)) {
    topic->retry_s = 0.0;
    topic->has_new = false;
    log_renewed(topic, &before, publishers);
  } else {
    note_failure(topic, wanted, &problem);
  }
  fm_text_free(&problem);
}

// Replace the subscription if publishers have come that ask for another one.
static void renew_if_due(
  struct fm_mapped_topic * topic, const rmw_topic_endpoint_info_array_t * publishers)
{
  const rmw_qos_profile_t wanted =
    fm_wanted_profile(publishers, topic->about->type, &topic->fixed);
  const bool is_current = fm_same_request(&wanted, &topic->current.profile);
  if (is_current && topic->retry_s > 0.0) {
    topic->retry_s = 0.0;
    fm_log(topic->node, FM_INFO, "no other subscription to %s is needed any more", topic->name);
  }
  topic->has_new = topic->has_new && !is_current;
  if (topic->has_new && (topic->retry_s == 0.0 || fm_steady_now() >= topic->retry_at)) {
    renew(topic, &wanted, publishers);
  }
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
    } else {
      topic->is_leaked = !end_intake(topic, old) || topic->is_leaked;
      topic->handover_ends = after(GRACE_S);
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
    "%s does not match the subscription to %s: it offers %s; the subscription requests %s, by "
    "`qos` or `qos_overrides`%s%s%s", fm_text_get(&who), topic->name,
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

// Add a word to a sorted list, unless it is there.
static void add_sorted(struct fm_text * list, const char * word)
{
  struct fm_text sorted = {NULL, 0, 0};
  const char * rest = fm_text_get(list);
  bool is_added = false;
  while (*rest != '\0') {
    const size_t length = strcspn(rest, ",");
    const int first = strncmp(word, rest, length);
    const int order = first == 0 && word[length] != '\0' ? 1 : first;
    if (order < 0 && !is_added) {
      fm_text_list(&sorted, ", ", word);
    }
    is_added = is_added || order <= 0;
    fm_text_add(&sorted, "%s%.*s", sorted.length > 0 ? ", " : "", (int)length, rest);
    rest += length;
    rest += strspn(rest, ", ");
  }
  if (!is_added) {
    fm_text_list(&sorted, ", ", word);
  }
  fm_text_free(list);
  *list = sorted;
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
      add_sorted(&topic->publishers.other_types, publisher->topic_type);
      if (may_be_logged(topic, publisher)) {
        log_type(topic, publisher);
      }
      continue;
    }
    topic->publishers.matching_type += 1u;
    if (is_unmatched(topic, publisher)) {
      fm_text_clear(&who);
      add_who(&who, publisher);
      add_sorted(&topic->publishers.unmatched, fm_text_get(&who));
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
  if (rcl_get_publishers_info_by_topic(
      &topic->node->node, &topic->node->allocator, topic->name, false, &publishers) != RCL_RET_OK)
  {
    rcl_reset_error();
    return;
  }
  topic->has_new = note_known(topic, &publishers) || topic->has_new;
  renew_if_due(topic, &publishers);
  note_status(topic, &publishers);
  log_lost(topic);
  if (rmw_topic_endpoint_info_array_fini(&publishers, &topic->node->allocator) != RMW_RET_OK) {
    rcl_reset_error();
  }
}
