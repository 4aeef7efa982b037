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

/// topics.c: the subscriptions to topics of a bundle, also to those with a variable in their
/// names; see session.h for the contract.

#include <rcl/error_handling.h>
#include <rmw/qos_profiles.h>
#include <stdlib.h>
#include <string.h>

#include "endpoints.h"
#include "rmw_functions.h"
#include "session.h"
#include "words.h"

// ---- subscriptions -----------------------------------------------------------------------------

static rmw_qos_profile_t profile_of(struct fm_request request)
{
  rmw_qos_profile_t profile = rmw_qos_profile_default;
  profile.depth = request.depth;
  profile.history = request.keeps_all ?
    RMW_QOS_POLICY_HISTORY_KEEP_ALL : RMW_QOS_POLICY_HISTORY_KEEP_LAST;
  profile.reliability = request.is_reliable ?
    RMW_QOS_POLICY_RELIABILITY_RELIABLE : RMW_QOS_POLICY_RELIABILITY_BEST_EFFORT;
  profile.durability = request.is_durable ?
    RMW_QOS_POLICY_DURABILITY_TRANSIENT_LOCAL : RMW_QOS_POLICY_DURABILITY_VOLATILE;
  return profile;
}

// Returns false with the reason in `problem`, and nothing is left.
static bool subscribe(
  const struct fm_mapped_topic * topic, struct fm_request request,
  struct fm_intake * intake, struct fm_text * problem)
{
  rcl_subscription_options_t options = rcl_subscription_get_default_options();
  options.qos = profile_of(request);
  intake->receiver = NULL;
  intake->is_relayed = false;
  intake->subscription = rcl_get_zero_initialized_subscription();
  if (rcl_subscription_init(
      &intake->subscription, &topic->session->node->node,
      topic->in_place != NULL ? topic->in_place : topic->support(), topic->written,
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
  struct fm_mapped_topic * topic, struct fm_intake * intake, struct fm_request request,
  struct fm_text * problem)
{
  if (topic->gate != NULL ?
    fm_node_gate_take(
      topic->gate, &intake->subscription, request.is_durable, &intake->is_relayed) :
    fm_receiver_start(
      &intake->receiver, topic->session->engine, fm_node_middleware(),
      rcl_subscription_get_rmw_handle(&intake->subscription), topic->index,
      topic->in_place != NULL ? FM_LISTEN_IN_PLACE : topic->session->taking,
      topic->key.size > 0 ? &topic->key : NULL))
  {
    return true;
  }
  fm_text_add(problem, "the middleware has no callback for new messages");
  return false;
}

// Mark the present subscription as one that is being replaced.
static void retire(struct fm_mapped_topic * topic)
{
  struct fm_intake * current = &topic->current;
  if (topic->gate == NULL) {
    fm_receiver_retire(current->receiver);
  } else if (!current->is_relayed && !fm_relay_add(
      topic->gate->relay, rcl_subscription_get_rmw_handle(&current->subscription)))
  {
    return;  // there are too many of them already
  } else {
    current->is_relayed = true;
    fm_relay_retire(
      topic->gate->relay, rcl_subscription_get_rmw_handle(&current->subscription));
  }
}

static bool end_intake(struct fm_mapped_topic * topic, struct fm_intake * intake)
{
  if (intake->receiver != NULL) {
    fm_engine_drain(topic->session->engine);
  }
  if (!fm_receiver_stop(&intake->receiver) || (intake->is_relayed && !fm_relay_remove(
      topic->gate->relay, rcl_subscription_get_rmw_handle(&intake->subscription))))
  {
    return false;
  }
  intake->is_relayed = false;
  if (intake->subscription.impl != NULL) {
    fm_ignore(rcl_subscription_fini(&intake->subscription, &topic->session->node->node));
  }
  return true;
}

static void begin(void * state, const struct fm_offer * offers, uint32_t n_offers)
{
  fm_subscription_begin(state, offers, n_offers, fm_steady_now());
}

bool fm_topic_open(
  struct fm_mapped_topic * topic, struct fm_session * session, const char * name, uint32_t index)
{
  const struct fm_node_table * table = session->table;
  topic->session = session;
  const bool is_more = index == table->report.n_topics;  // a gate's, which feeds no input
  const char * type = is_more ? table->gate->type : table->report.topics[index].type;
  topic->type = type;
  topic->support = is_more ? table->gate->from.support : table->topics[index].support;
  topic->written = is_more ? table->gate->name :
    topic->key.size > 0 ? name : table->report.topics[index].name;
  topic->index = index;
  topic->name = name;
  const bool is_for_callbacks = topic->gate == NULL && session->taking == FM_LISTEN;
  topic->in_place = is_for_callbacks ? fm_in_place_type_of(topic->support()) : NULL;
  if (is_for_callbacks && topic->in_place == NULL && fm_why_copied()[0] == '\0') {
    fm_log(session->node, FM_INFO, FM_WORDS_COPIED FM_WORDS_NO_SUPPORT, name, type);
  }
  struct fm_text problem = {NULL, 0, 0};
  topic->state = fm_subscription_create(topic->name, type, &session->fixed[index]);
  if (topic->state == NULL) {
    fm_text_add(&problem, FM_NO_MEMORY);
  } else if (topic->is_found) {
    (void)fm_look_for_publishers(session->node, name, begin, topic->state);
  }
  const bool is_done = topic->state != NULL &&
    subscribe(topic, fm_subscription_request(topic->state), &topic->current, &problem);
  if (!is_done) {
    fm_log(session->node, FM_ERROR, "cannot subscribe to %s as %s: %s", topic->name, type,
      fm_text_get(&problem));
  }
  fm_text_free(&problem);
  return is_done;
}

bool fm_topic_start(struct fm_mapped_topic * topic)
{
  struct fm_text problem = {NULL, 0, 0};
  const bool is_done =
    receive(topic, &topic->current, fm_subscription_request(topic->state), &problem);
  if (!is_done) {
    fm_log(topic->session->node, FM_ERROR, "cannot take the messages on %s: %s", topic->name,
      fm_text_get(&problem));
  }
  fm_text_free(&problem);
  return is_done;
}

// Messages may come twice while one of the topics that are one of the bundle hands over.
static void begin_handover(struct fm_mapped_topic * topic, bool has_history)
{
  if (topic->n_handovers != NULL && !topic->hands_over) {
    *topic->n_handovers += 1u;
  }
  topic->hands_over = true;
  fm_engine_begin_handover(topic->session->engine, topic->index, has_history);
}

static void end_handover(struct fm_mapped_topic * topic)
{
  if (topic->n_handovers != NULL && topic->hands_over) {
    *topic->n_handovers -= 1u;
  }
  topic->hands_over = false;
  if (topic->n_handovers == NULL || *topic->n_handovers == 0) {
    fm_engine_end_handover(topic->session->engine, topic->index);
  }
}

bool fm_topic_close(struct fm_mapped_topic * topic)
{
  bool is_over = !topic->is_leaked;
  if (topic->hands_over) {
    end_handover(topic);
  }
  for (uint32_t k = 0; k < topic->n_retired; ++k) {
    is_over = end_intake(topic, &topic->retired[k]) && is_over;
  }
  is_over = end_intake(topic, &topic->current) && is_over;
  fm_subscription_destroy(topic->state);
  free(topic->retired);
  memset(topic, 0, sizeof(*topic));
  return is_over;
}

// ---- reviews -----------------------------------------------------------------------------------

static void end_oldest(struct fm_mapped_topic * topic, uint32_t n)
{
  for (uint32_t k = 0; k < n; ++k) {
    topic->is_leaked = !end_intake(topic, &topic->retired[k]) || topic->is_leaked;
  }
  topic->n_retired -= n;
  if (topic->n_retired > 0) {
    memmove(topic->retired, topic->retired + n, topic->n_retired * sizeof(*topic->retired));
  }
}

// Replace the subscription. Returns false with the reason in `problem`: the one before stays.
static bool replace(
  struct fm_mapped_topic * topic, struct fm_request request, struct fm_text * problem)
{
  struct fm_intake new_intake;
  struct fm_intake * retired =
    realloc(topic->retired, (topic->n_retired + 1u) * sizeof(*retired));
  if (retired == NULL) {
    fm_text_add(problem, FM_NO_MEMORY);
    return false;
  }
  topic->retired = retired;
  if (!subscribe(topic, request, &new_intake, problem)) {
    return false;
  }
  begin_handover(topic, request.is_durable);
  retire(topic);
  if (!receive(topic, &new_intake, request, problem)) {
    (void)end_intake(topic, &new_intake);
    return false;
  }
  topic->retired[topic->n_retired++] = topic->current;
  topic->current = new_intake;
  return true;
}

static void follow(void * context, const struct fm_offer * offers, uint32_t n_offers)
{
  struct fm_mapped_topic * topic = context;
  size_t matched = 0;
  struct fm_text problem = {NULL, 0, 0};
  struct fm_lines lines = {NULL, 0, 0};
  fm_ignore(rcl_subscription_get_publisher_count(&topic->current.subscription, &matched));
  const struct fm_decision decision =
    fm_subscription_decide(topic->state, offers, n_offers, matched, fm_steady_now());
  end_oldest(topic, decision.n_ended);
  if (decision.ends_handover) {
    end_handover(topic);
  }
  const bool is_good = !decision.subscribes || replace(topic, decision.request, &problem);
  if (topic->gate != NULL) {
    fm_node_gate_review(topic->gate, topic->type, offers, n_offers);
    (void)fm_node_gate_take(
      topic->gate, &topic->current.subscription, false, &topic->current.is_relayed);
  }
  fm_subscription_conclude(
    topic->state, is_good ? NULL : fm_text_get(&problem),
    fm_engine_lost(topic->session->engine, topic->index), fm_steady_now(), &lines);
  fm_log_lines(topic->session->node, &lines);
  fm_text_free(&problem);
}

void fm_topic_review(struct fm_mapped_topic * topic)
{
  topic->is_unread = !fm_look_for_publishers(topic->session->node, topic->name, follow, topic);
}

bool fm_topic_is_settled(const struct fm_mapped_topic * topic)
{
  return !topic->is_unread &&
         (topic->gate == NULL || fm_gate_target_is_settled(topic->gate->state)) &&
         fm_subscription_is_settled(
    topic->state, fm_engine_lost(topic->session->engine, topic->index));
}

// ---- topics with a variable in their names -----------------------------------------------------

static struct fm_bound_topic * add(struct fm_bound_topics * bound, const char * name)
{
  struct fm_bound_topic ** items =
    fm_with_room(bound->items, bound->n, &bound->capacity, sizeof(*items));
  struct fm_bound_topic * item = items == NULL ? NULL : calloc(1, sizeof(*item));
  bound->items = items == NULL ? bound->items : items;
  if (item == NULL) {
    return NULL;
  }
  item->name = fm_copy_of(name);
  bound->items[bound->n++] = item;
  return item->name == NULL ? NULL : item;
}

// Subscribe to a topic, by its full name.
static bool open_topic(
  struct fm_bound_topics * bound, const char * name, uint32_t topic, struct fm_key key,
  bool is_found)
{
  struct fm_session * session = bound->session;
  struct fm_bound_topic * item = name == NULL ? NULL : add(bound, name);
  if (item == NULL) {
    fm_log(session->node, FM_ERROR, "cannot subscribe to %s as %s: " FM_NO_MEMORY,
      session->topic_names[topic], session->table->report.topics[topic].type);
    return false;
  }
  item->mapped.key = key;
  item->mapped.is_found = is_found;
  item->mapped.n_handovers = &bound->n_handovers[topic];
  return fm_topic_open(&item->mapped, session, item->name, topic);
}

static void remove_at(struct fm_bound_topics * bound, uint32_t k)
{
  struct fm_bound_topic * item = bound->items[k];
  if (item->mapped.state != NULL) {
    bound->is_leaked = !fm_topic_close(&item->mapped) || bound->is_leaked;
  }
  free(item->name);
  free(item);
  bound->n -= 1u;
  memmove(bound->items + k, bound->items + k + 1, (bound->n - k) * sizeof(*bound->items));
}

// ---- listed keys -------------------------------------------------------------------------------

static bool open_listed(struct fm_bound_topics * bound, uint32_t topic)
{
  const struct fm_report_topic * about = &bound->session->table->report.topics[topic];
  const struct fm_node_topic * with = &bound->session->table->topics[topic];
  struct fm_memory memory = {NULL, false};
  bool is_good = true;
  for (uint32_t k = 0; is_good && k < with->n_listed; ++k) {
    const char * const key = (const char *)with->listed[k].bytes;
    const char * const name = fm_with_key(&memory, about->name, about->variable, key);
    is_good = open_topic(
      bound, name == NULL ? NULL : fm_resolve(bound->session->node, &memory, name, false), topic,
      with->listed[k], false);
  }
  fm_memory_free(&memory);
  return is_good;
}

// ---- found keys --------------------------------------------------------------------------------

static bool make_watch(struct fm_bound_topics * bound)
{
  const struct fm_session * session = bound->session;
  const struct fm_node_table * table = session->table;
  struct fm_keyed_pattern * patterns =
    calloc(table->report.n_topics + (size_t)1, sizeof(*patterns));
  uint32_t n = 0;
  for (uint32_t k = 0; patterns != NULL && k < table->report.n_topics; ++k) {
    const struct fm_report_topic * topic = &table->report.topics[k];
    if (topic->variable[0] != '\0' && table->topics[k].n_listed == 0) {
      patterns[n++] = (struct fm_keyed_pattern) {k, session->topic_names[k], topic->type};
    }
  }
  if (n > 0) {
    bound->watch = fm_keyed_topics_create(
      &fm_rmw_graph, rcl_node_get_rmw_handle(&session->node->node), patterns, n);
  }
  const bool is_good = patterns != NULL && (n == 0 || bound->watch != NULL);
  free(patterns);
  if (!is_good) {
    fm_log(session->node, FM_ERROR, "cannot look at the graph of ROS: " FM_NO_MEMORY);
  }
  return is_good;
}

bool fm_bound_begin(struct fm_bound_topics * bound, struct fm_session * session)
{
  const struct fm_report_table * table = &session->table->report;
  if (table->n_kinds == 0) {
    return true;
  }
  *bound = (struct fm_bound_topics) {.session = session, .has_changed = true};
  bound->n_handovers = calloc(table->n_topics + (size_t)1, sizeof(*bound->n_handovers));
  bool is_good = bound->n_handovers != NULL;
  for (uint32_t k = 0; is_good && k < table->n_topics; ++k) {
    is_good = open_listed(bound, k);
  }
  for (uint32_t k = 0; is_good && k < bound->n; ++k) {
    is_good = fm_topic_start(&bound->items[k]->mapped);
  }
  return is_good && make_watch(bound);
}

static void end_abandoned(struct fm_bound_topics * bound)
{
  const int64_t now = fm_steady_now();
  for (uint32_t k = bound->n; k > 0; --k) {
    struct fm_bound_topic * item = bound->items[k - 1u];
    if (item->mapped.is_found && fm_subscription_is_abandoned(item->mapped.state, now)) {
      const uint32_t topic = item->mapped.index;
      char * const name = fm_copy_of(item->name);
      remove_at(bound, k - 1u);
      if (name != NULL) {
        fm_keyed_topics_give_up(bound->watch, topic, name);
      }
      free(name);
    }
  }
}

// What cannot be subscribed to is found again later.
static void subscribe_found(struct fm_bound_topics * bound, int64_t now)
{
  struct fm_keyed_topic found;
  while (fm_keyed_topics_take(bound->watch, now, &found)) {
    const uint32_t n = bound->n;
    const bool is_open =
      open_topic(bound, found.name, found.topic, found.key, true) &&
      fm_topic_start(&bound->items[n]->mapped);
    if (!is_open) {
      fm_keyed_topics_fail(bound->watch, &found, now);
    }
    if (!is_open && bound->n > n) {
      remove_at(bound, n);
    }
  }
}

int64_t fm_bound_review(struct fm_bound_topics * bound)
{
  struct fm_lines lines = {NULL, 0, 0};
  if (bound->watch == NULL) {
    return INT64_MAX;
  }
  const bool has_changed = bound->has_changed;
  bound->has_changed = false;
  end_abandoned(bound);
  const int64_t now = fm_steady_now();
  fm_keyed_topics_review(bound->watch, now, has_changed, &lines);
  fm_log_lines(bound->session->node, &lines);
  subscribe_found(bound, now);
  return fm_keyed_topics_next(bound->watch);
}

bool fm_bound_end(struct fm_bound_topics * bound)
{
  while (bound->n > 0) {
    remove_at(bound, bound->n - 1u);
  }
  const bool is_over = !bound->is_leaked;
  fm_keyed_topics_destroy(bound->watch);
  free(bound->items);
  free(bound->n_handovers);
  memset(bound, 0, sizeof(*bound));
  return is_over;
}
