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

/// session.c: see session.h for the contract.

#include "session.h"

#include <diagnostic_msgs/msg/diagnostic_array.h>
#include <rmw/rmw.h>
#include <std_msgs/msg/bool.h>
#include <std_msgs/msg/empty.h>
#include <std_msgs/msg/float64.h>
#include <stdio.h>
#include <string.h>

#include "endpoints.h"
#include "rmw_functions.h"
#include "scheduling.h"
#include "shared_names.h"
#include "verdict_thread.h"
#include "words.h"

// ---- what is advertised ------------------------------------------------------------------------

// The full names of the topics that the node uses, first those of the inputs. Returns false, with
// the error logged, if one has none.
static bool resolve_used(struct fm_session * session)
{
  const struct fm_report_table * table = &session->table->report;
  const char ** names = fm_reserve(&session->configured, table->n_used, sizeof(*names));
  bool is_good = names != NULL;
  for (uint32_t k = 0; is_good && k < table->n_used; ++k) {
    names[k] = fm_topic_name(session->node, &session->configured, &table->topics[k]);
    is_good = names[k] != NULL;
  }
  if (!is_good) {
    fm_log_failure(session->node, FM_WORDS_NO_ENDPOINT);
  }
  session->topic_names = names;
  return is_good;
}

static bool refuse_merged(const struct fm_session * session)
{
  struct fm_lines lines = {NULL, 0, 0};
  const bool is_good = !fm_find_merged(
    &lines, &session->table->report, session->topic_names);
  fm_log_lines(session->node, &lines);
  return is_good;
}

static const char * topic_of(const struct fm_report_table * table, uint32_t requirement, int what)
{
  const struct fm_report_requirement * about = &table->requirements[requirement];
  return what == FM_HANDLERS ? table->topics[table->n_topics + requirement].name :
         what == FM_VERDICTS ? about->verdict_topic : about->margin_topic;
}

// Advertise a topic for each requirement; late subscriptions get the last verdict or margin.
// Returns false, with the error logged, if one cannot be made.
static bool advertise_each(
  struct fm_session * session, int what, const rosidl_message_type_support_t * type)
{
  const struct fm_report_table * table = &session->table->report;
  rcl_publisher_t * publishers =
    fm_reserve(&session->configured, table->n_requirements, sizeof(*publishers));
  rmw_qos_profile_t profile = rmw_qos_profile_default;  // reliable, volatile
  profile.depth = (size_t)fm_parameter_whole(session->parameters, "handler_depth");
  if (what != FM_HANDLERS) {
    profile.depth = 1;
    profile.durability = RMW_QOS_POLICY_DURABILITY_TRANSIENT_LOCAL;
  }
  session->publishers[what] = publishers;
  bool is_good = publishers != NULL;
  for (uint32_t k = 0; is_good && k < table->n_requirements; ++k) {
    is_good = fm_publisher_open(
      session->node, &publishers[k], type, topic_of(table, k, what), &profile);
  }
  return is_good;
}

// False, with the error logged, where there are no margins.
static bool advertise_margins(struct fm_session * session)
{
  const struct fm_report_table * table = &session->table->report;
  bool has_all = true;
  for (uint32_t k = 0; k < table->n_requirements; ++k) {
    has_all = has_all && table->requirements[k].margin_topic[0] != '\0';
  }
  if (table->gate != NULL || !has_all) {
    fm_log(session->node, FM_ERROR, "%s",
      table->gate != NULL ? FM_WORDS_NO_MARGINS_OF_GATES : FM_WORDS_NO_MARGINS);
    return false;
  }
  return advertise_each(
    session, FM_MARGINS, ROSIDL_GET_MSG_TYPE_SUPPORT(std_msgs, msg, Float64));
}

static bool advertise_all(struct fm_session * session)
{
  const struct fm_parameters * given = session->parameters;
  return advertise_each(
    session, FM_HANDLERS, ROSIDL_GET_MSG_TYPE_SUPPORT(std_msgs, msg, Empty)) && fm_advertise(
    session->node, &session->details,
    ROSIDL_GET_MSG_TYPE_SUPPORT(diagnostic_msgs, msg, DiagnosticArray), FM_DETAILS_TOPIC,
    (uint32_t)fm_parameter_whole(given, "handler_depth")) &&
         (!fm_parameter_is_true(given, "verdicts") || advertise_each(
           session, FM_VERDICTS, ROSIDL_GET_MSG_TYPE_SUPPORT(std_msgs, msg, Bool))) &&
         fm_node_actions_begin(&session->actions, session->node, session->table) &&
         (!fm_parameter_is_true(given, "margins") || advertise_margins(session));
}

// Resolve the names of the gate.
static bool name_gate(struct fm_session * session)
{
  const struct fm_node_gate_table * gate = session->table->gate;
  if (gate == NULL) {
    return true;
  }
  const bool is_service = gate->service != NULL;
  session->gate_source =
    fm_resolve(session->node, &session->configured, gate->name, is_service);
  session->gate_target = fm_resolve(session->node, &session->configured, gate->to, is_service);
  if (session->gate_source == NULL || session->gate_target == NULL) {
    fm_log_failure(session->node, FM_WORDS_NO_ENDPOINT);
    return false;
  }
  return true;
}

enum fm_taking fm_taking_of(const struct fm_parameters * parameters)
{
  const char * word = fm_parameter_hot_path(parameters);
  return strcmp(word, "off") == 0 ? FM_WAKE : strcmp(word, "on") == 0 ? FM_LISTEN :
         (enum fm_taking)fm_receiver_taking(rmw_get_implementation_identifier());
}

bool fm_session_configure(
  struct fm_session * session, const struct fm_node_tables * tables, uint32_t place,
  struct fm_node * node, struct fm_node_clock * clock, const struct fm_parameters * parameters)
{
  *session = (struct fm_session) {
    .table = tables->tables[place], .node = node, .clock = clock, .parameters = parameters,
    .fixed = parameters->fixed[place], .taking = fm_taking_of(parameters)};
  if (!resolve_used(session) || !fm_node_blackbox_begin(
      &session->blackbox, node, session->table, session->topic_names, parameters) ||
    !name_gate(session) || !refuse_merged(session) || !advertise_all(session))
  {
    fm_session_release(session);
    return false;
  }
  return true;
}

void fm_session_release(struct fm_session * session)
{
  fm_session_deactivate(session);
  for (int k = 0; k < FM_OF_EACH; ++k) {
    rcl_publisher_t * of_each = session->publishers[k];
    for (uint32_t r = 0; of_each != NULL && r < session->table->report.n_requirements; ++r) {
      fm_publisher_close(session->node, &of_each[r]);
    }
  }
  fm_publisher_close(session->node, &session->details);
  fm_node_actions_end(&session->actions);
  fm_node_blackbox_end(&session->blackbox);
  fm_memory_free(&session->configured);
  memset(session, 0, sizeof(*session));
}

// ---- the engine --------------------------------------------------------------------------------

static void set_initial(
  const struct fm_node_table * table, struct fm_evaluator * evaluator, struct fm_scopes * scopes)
{
  for (uint32_t k = 0; k < table->monitor()->n_inputs; ++k) {
    if (table->report.inputs[k].has_initial) {
      fm_evaluator_initial(evaluator, k, table->report.inputs[k].initial);
    }
  }
  for (uint32_t kind = 0; kind < table->report.n_kinds; ++kind) {
    const struct fm_report_kind * about = &table->report.kinds[kind];
    for (uint32_t k = 0; k < about->n_inputs; ++k) {
      if (about->inputs[k].has_initial) {
        fm_scopes_initial(scopes, kind, k, about->inputs[k].initial);
      }
    }
  }
}

// Two words that nobody can guess, so that nobody can choose keys that collide.
static void make_seed(uint64_t seed[2])
{
  FILE * file = fopen("/dev/urandom", "rb");
  if (file == NULL || fread(seed, sizeof(*seed), 2, file) != 2u) {
    seed[0] = (uint64_t)fm_steady_now();
    seed[1] = (uint64_t)(uintptr_t)seed;
  }
  if (file != NULL) {
    (void)fclose(file);
  }
}

static struct fm_scopes * make_scopes(
  struct fm_session * session, const struct fm_evaluator_options * options,
  const struct fm_kind * kinds)
{
  const struct fm_node_table * table = session->table;
  uint64_t seed[2];
  make_seed(seed);
  const struct fm_scopes_options all = {
    .bundle = options, .kinds = kinds, .n_kinds = table->report.n_kinds,
    .n_aggregates = table->n_aggregates, .aggregates = table->aggregates, .seed = seed};
  const uint64_t bytes = fm_scopes_bytes(&all);
  void * memory = bytes == 0 ? NULL : fm_reserve(&session->active, (size_t)bytes, 1);
  if (memory != NULL) {
    fm_use_large_pages(memory, bytes);
  }
  return memory == NULL ? NULL : fm_scopes_init(memory, &all);
}

static struct fm_evaluator * make_evaluator(
  struct fm_session * session, const struct fm_evaluator_options * options)
{
  const uint64_t bytes = fm_evaluator_bytes(options);
  void * memory = bytes == 0 ? NULL : fm_reserve(&session->active, (size_t)bytes, 1);
  return memory == NULL ? NULL : fm_evaluator_init(memory, options);
}

// The names of nodes are resolved.
static bool follow_derived(struct fm_session * session)
{
  const uint32_t n = session->table->n_derived;
  struct fm_derived_topic * topics = fm_reserve(&session->active, n, sizeof(*topics));
  for (uint32_t k = 0; topics != NULL && k < n; ++k) {
    topics[k] = session->table->derived[k];
    topics[k].node = fm_node_name(session->node, &session->active, topics[k].node);
  }
  return !session->active.is_short && fm_engine_follow_derived(session->engine, topics, n);
}

static bool make_engine(struct fm_session * session)
{
  const struct fm_node_table * table = session->table;
  const uint32_t n = table->report.n_kinds;
  struct fm_evaluator_options * of_evaluators =
    fm_reserve(&session->active, n + 1u, sizeof(*of_evaluators));
  struct fm_kind * kinds = fm_reserve(&session->active, n, sizeof(*kinds));
  struct fm_scopes * scopes = NULL;
  struct fm_evaluator * evaluator = NULL;
  if (!session->active.is_short) {
    table->describe(of_evaluators, kinds);
    scopes = n > 0 ? make_scopes(session, of_evaluators, kinds) : NULL;
    evaluator = n == 0 ? make_evaluator(session, of_evaluators) :
      scopes == NULL ? NULL : fm_scopes_bundle(scopes);
  }
  if (evaluator != NULL) {
    set_initial(table, evaluator, scopes);
  }
  const struct fm_engine_options options = {
    .evaluator = evaluator, .scopes = scopes, .monitor = table->monitor(),
    .readers = table->readers == NULL ? NULL : table->readers(),
    .topics = table->report.topic_inputs, .n_topics = table->report.n_topics,
    .sources = evaluator == NULL ? NULL : of_evaluators[0].sources,
    .uses_header_stamps = table->report.uses_header_stamps, .reorder = table->report.reorder,
    .takes_recoveries = false};
  session->engine = options.evaluator == NULL ? NULL : fm_engine_create(&options);
  if (session->engine == NULL || (table->n_transforms > 0 && !fm_engine_follow_transforms(
      session->engine, table->transforms, table->n_transforms, table->tf, table->tf_static)))
  {
    fm_log(session->node, FM_ERROR, "the engine cannot be made: " FM_NO_MEMORY);
    return false;
  }
  return follow_derived(session) && fm_node_gate_guard(
    &session->gate, session->node, table, session->engine, evaluator, &session->active,
    session->gate_source, session->gate_target);
}

// The middleware's handles of publishers, as long as the session is active; NULL if there are
// none, or memory is short.
static void ** handles_of(struct fm_session * session, int what)
{
  const rcl_publisher_t * publishers = session->publishers[what];
  const uint32_t n = session->table->report.n_requirements;
  void ** handles = publishers == NULL ? NULL : fm_reserve(&session->active, n, sizeof(*handles));
  for (uint32_t k = 0; handles != NULL && k < n; ++k) {
    handles[k] = rcl_publisher_get_rmw_handle(&publishers[k]);
  }
  return handles;
}

static bool start_announcer(struct fm_session * session)
{
  const struct fm_report_table * table = &session->table->report;
  void ** publishers = handles_of(session, FM_HANDLERS);
  void ** margins = handles_of(session, FM_MARGINS);
  struct fm_lock * locks = fm_reserve(&session->active, table->n_locks, sizeof(*locks));
  if (session->active.is_short) {
    return false;
  }
  fm_node_actions_locks(&session->actions, locks);
  return fm_announcer_start(
    &session->announcer, session->engine, fm_node_middleware(), publishers,
    table->n_requirements, locks, table->n_locks, margins);
}

static bool start_verdicts(struct fm_session * session)
{
  void ** publishers = handles_of(session, FM_VERDICTS);
  return session->publishers[FM_VERDICTS] == NULL || (publishers != NULL &&
         fm_verdict_thread_start(
           &session->verdict_thread, session->engine, fm_node_middleware(), publishers,
           session->table->report.n_requirements));
}

static bool start_threads(struct fm_session * session)
{
  session->detail_thread = fm_detail_thread_start(
    session->node, &session->reporter, &session->details,
    fm_parameter_is_true(session->parameters, "log_violations"));
  if ((session->table->report.n_actions > 0 &&
    !fm_actions_prepare(session->engine, &session->table->report)) ||
    !fm_node_blackbox_start(&session->blackbox, session->engine) ||
    session->detail_thread == NULL || !start_announcer(session) || !start_verdicts(session) ||
    !fm_node_actions_start(&session->actions, session->engine))
  {
    fm_log(session->node, FM_ERROR, FM_WORDS_NO_THREAD);
    return false;
  }
  return fm_node_gate_start(&session->gate, session->clock);
}

// A gate may judge a topic that feeds no input: it comes after the others.
static bool open_topic(struct fm_session * session, uint32_t k)
{
  const struct fm_node_table * table = session->table;
  const bool is_judged = table->gate != NULL && k == table->report.gate->topic;
  const bool is_last = k == table->report.n_topics;
  if (is_judged && table->report.gate->is_service) {
    return true;  // the gate receives the requests
  }
  if (!is_last &&
    (table->topics[k].support == NULL || table->report.topics[k].variable[0] != '\0'))
  {
    return true;  // its messages are made, or it is many topics
  }
  session->topics[k].gate = is_judged ? &session->gate : NULL;
  return fm_topic_open(&session->topics[k], session,
           is_last ? session->gate_source : session->topic_names[k], k);
}

static bool subscribe_all(struct fm_session * session)
{
  const struct fm_node_table * table = session->table;
  const bool has_more = table->gate != NULL && !table->report.gate->is_service &&
    table->report.gate->topic == table->report.n_topics;
  const uint32_t n = table->report.n_topics + (has_more ? 1u : 0u);
  session->topics = fm_reserve(&session->active, n, sizeof(*session->topics));
  if (session->topics == NULL) {
    return false;
  }
  for (uint32_t k = 0; k < n; ++k) {
    session->n_topics = k + 1u;
    if (!open_topic(session, k)) {
      return false;
    }
  }
  for (uint32_t k = 0; k < n; ++k) {
    if (session->topics[k].state != NULL && !fm_topic_start(&session->topics[k])) {
      return false;
    }
  }
  return true;
}

bool fm_session_activate(struct fm_session * session)
{
  if (!make_engine(session)) {
    fm_session_deactivate(session);
    return false;
  }
  session->reporter = (struct fm_reporter) {
    &session->table->report, session->table->monitor(), session->engine,
    rcl_node_get_fully_qualified_name(&session->node->node) + 1,  // without its slash
    session->topic_names};
  fm_engine_follow_steady(session->engine);
  if (session->clock->is_simulated) {
    fm_engine_follow_clock(session->engine, fm_clock_read, session->clock, false);
  }
  if (!start_threads(session) || !subscribe_all(session) ||
    !fm_bound_begin(&session->bound, session) || !fm_node_graph_begin(
      &session->graph, session->node, session->table, session->engine))
  {
    fm_session_deactivate(session);
    return false;
  }
  fm_engine_begin(session->engine);  // after the subscriptions: until then, no timeout runs
  session->is_active = true;
  session->next_look = session->next_question = session->next_round = 0;
  (void)fm_session_review(session);
  return true;
}

// The publishers outlive the threads that publish, and these the subscriptions.
void fm_session_deactivate(struct fm_session * session)
{
  bool is_over = true;
  session->is_active = false;
  fm_node_graph_end(&session->graph);
  for (uint32_t k = 0; k < session->n_topics; ++k) {
    is_over = fm_topic_close(&session->topics[k]) && is_over;
  }
  is_over = fm_bound_end(&session->bound) && is_over;
  session->n_topics = 0;
  fm_node_gate_stop(&session->gate);
  if (session->engine != NULL) {
    fm_engine_close(session->engine);
  }
  fm_detail_thread_join(session->detail_thread);
  session->detail_thread = NULL;
  fm_node_actions_stop(&session->actions);
  fm_announcer_join(&session->announcer);
  fm_verdict_thread_join(&session->verdict_thread);
  fm_node_blackbox_stop(&session->blackbox);
  if (is_over) {
    if (session->engine != NULL) {
      fm_engine_destroy(session->engine);
    }
    fm_memory_free(&session->active);
  }
  session->topics = NULL;
  session->engine = NULL;
  session->active = (struct fm_memory) {NULL, false};
}

// ---- while it runs -----------------------------------------------------------------------------

static uint32_t count_topics(const struct fm_session * session)
{
  return session->n_topics + session->bound.n;
}

static struct fm_mapped_topic * topic_at(const struct fm_session * session, uint32_t k)
{
  return k < session->n_topics ? &session->topics[k] :
         &session->bound.items[k - session->n_topics]->mapped;
}

static void note_all(struct fm_session * session)
{
  for (uint32_t k = 0; k < count_topics(session); ++k) {
    topic_at(session, k)->is_due = topic_at(session, k)->state != NULL;
  }
}

int64_t fm_session_note_change(struct fm_session * session)
{
  const int64_t first = fm_steady_now() + FM_LOOK_DELAY_NS;
  if (!session->has_due && session->next_look < first) {
    session->next_look = first;
  }
  session->has_due = true;
  note_all(session);
  session->graph.has_changed = true;
  session->bound.has_changed = true;
  return session->graph.watch == NULL && session->bound.watch == NULL ? session->next_look :
         fm_steady_now();
}

static void note_unsettled(struct fm_session * session, int64_t now)
{
  for (uint32_t k = 0; k < count_topics(session); ++k) {
    struct fm_mapped_topic * topic = topic_at(session, k);
    topic->is_due = topic->is_due || (topic->state != NULL && !fm_topic_is_settled(topic));
  }
  if (now >= session->next_round) {
    session->next_round = now + FM_LOOK_AGAIN_NS;
    note_all(session);
  }
}

// Returns whether any is left.
static bool look_at_due(struct fm_session * session)
{
  bool is_any_left = false;
  const uint32_t n_topics = count_topics(session);
  uint32_t n = 0;
  for (uint32_t k = 0; k < n_topics; ++k) {
    struct fm_mapped_topic * topic =
      topic_at(session, (session->next_looked_at + k) % n_topics);
    if (topic->is_due && n < FM_LOOKS_AT_ONCE) {
      n += 1u;
      fm_topic_review(topic);
      topic->is_due = !fm_topic_is_settled(topic);
    }
    is_any_left = is_any_left || topic->is_due;
  }
  session->next_looked_at += n;
  return is_any_left;
}

// How many subscriptions this node has on a topic.
static uint32_t count_subscriptions(const struct fm_session * session, const char * name)
{
  uint32_t n = 0;
  for (uint32_t k = 0; k < count_topics(session); ++k) {
    const struct fm_mapped_topic * topic = topic_at(session, k);
    if (topic->state != NULL && strcmp(topic->name, name) == 0) {
      n += 1u + topic->n_retired;
    }
  }
  return n;
}

// The requests of a gate on a service come from this node.
void fm_session_publishers(const struct fm_session * session, struct fm_publishers * topics)
{
  const struct fm_report_gate * gate = session->table->report.gate;
  for (uint32_t k = 0; k < session->n_topics; ++k) {
    const bool is_asked = gate != NULL && gate->is_service && gate->topic == k;
    topics[k] = (struct fm_publishers) {is_asked ? 1u : 0u, "", ""};
  }
  for (uint32_t k = 0; k < count_topics(session); ++k) {
    const struct fm_mapped_topic * mapped = topic_at(session, k);
    if (mapped->state != NULL) {
      const struct fm_publishers one = fm_subscription_publishers(mapped->state);
      struct fm_publishers * all = &topics[mapped->index];
      all->n += one.n;
      all->unmatched = all->unmatched[0] == '\0' ? one.unmatched : all->unmatched;
      all->other_types = all->other_types[0] == '\0' ? one.other_types : all->other_types;
    }
  }
}

int64_t fm_session_review(struct fm_session * session)
{
  const int64_t graph = fm_node_graph_review(&session->graph, count_subscriptions, session);
  const int64_t found = fm_bound_review(&session->bound);
  const int64_t now = fm_steady_now();
  if (now >= session->next_question) {
    session->next_question = now + FM_SECOND;
    note_unsettled(session, now);
  }
  if (now >= session->next_look) {
    session->next_look = now + FM_LOOK_PERIOD_NS;
    session->has_due = look_at_due(session);
  }
  const int64_t next = session->has_due ? session->next_look : session->next_question;
  const int64_t looks = graph < found ? graph : found;
  return looks < next ? looks : next;
}

uint32_t fm_session_turns(const struct fm_session * session, uint64_t * turns)
{
  uint32_t n = 0;
  turns[n++] = fm_announcer_turns(session->announcer);
  turns[n++] = fm_detail_thread_turns(session->detail_thread);
  if (session->actions.thread != NULL) {
    turns[n++] = fm_actions_turns(session->actions.thread);
  }
  if (session->gate.relay != NULL) {
    turns[n++] = fm_relay_turns(session->gate.relay);
  }
  return n;
}
