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

/// session.h: monitors a bundle, from its subscriptions through the engine to its handlers: the
/// parts of a session, and the session. The parts: the clock, names, the gate, topics, the graph,
/// actions, the black box, and the thread of the details.
///
/// The main thread only, where nothing else is said. While a session runs, these threads use its
/// engine: those of the middleware (receivers), the announcer, that of the details, and that of
/// the verdicts. What an init function is given outlives what it makes. After a failure, the error
/// is logged.

#ifndef SESSION_H_
#define SESSION_H_

#include <rcl/client.h>
#include <rcl/publisher.h>
#include <rcl/service.h>
#include <rcl/subscription.h>
#include <rcl/wait.h>

#include "actions.h"
#include "announcer.h"
#include "gate_target.h"
#include "keyed_topics.h"
#include "log.h"
#include "node_table.h"
#include "parameters.h"
#include "receiver.h"
#include "relay.h"
#include "reporter.h"
#include "service_call.h"
#include "start_lines.h"
#include "subscription.h"

struct fm_session;

// ---- the clock ---------------------------------------------------------------------------------

/// Owned by main.c. `simulated` is read and written atomically; the rest belongs to the main
/// thread.
struct fm_node_clock
{
  struct fm_node * node;
  rcl_subscription_t subscription;  // to /clock
  int64_t simulated;                // ns, the last time on /clock; 0: none yet
  int64_t next_warning;             // of a negative time, by the steady clock
  bool is_simulated;
};

/// Subscribe to /clock, or end the subscription. Returns false, with the error logged.
bool fm_clock_simulate(struct fm_node_clock * clock, bool is_simulated);

/// Take the messages on /clock, without those of a negative time. Returns whether the time is to
/// move, to the last one.
bool fm_clock_take(struct fm_node_clock * clock, int64_t * time);

/// The node's time in nanoseconds; 0 before the first message on /clock. O(1).
int64_t fm_clock_now(const struct fm_node_clock * clock);

/// Write the time of /clock; for fm_engine_follow_clock. Any thread. Returns 0.
int fm_clock_read(void * clock, int64_t * nanoseconds);

// ---- names -------------------------------------------------------------------------------------

/// Resolve the name of a topic, or of a service, as the node does: namespace, remapping. NULL if
/// it is not valid, with the error of rcl, or if memory is short, as of the next three.
const char * fm_resolve(
  const struct fm_node * node, struct fm_memory * memory, const char * name, bool is_service);

/// A name with a key in place of a variable, which is in it.
const char * fm_with_key(
  struct fm_memory * memory, const char * name, const char * variable, const char * key);

/// As fm_resolve, of a topic of the table; one whose messages are made has its own name. A
/// variable stays in the name.
const char * fm_topic_name(
  const struct fm_node * node, struct fm_memory * memory, const struct fm_report_topic * topic);

/// The full name of a node: in the namespace of this one, unless it begins with a slash.
const char * fm_node_name(
  const struct fm_node * node, struct fm_memory * memory, const char * name);

/// Refuse gates in a circle, what else publishes on a topic of a gate, a lock or the node, actions
/// that call the node itself, and two types of one topic or service. Topics of one bundle that are
/// one are left to fm_session_configure. Returns false, with the problems logged.
/// O(names * names).
bool fm_refuse_names(const struct fm_node * node, const struct fm_node_tables * tables);

// ---- a gate on a service -----------------------------------------------------------------------

/// A request that waits for the answer of the server.
struct fm_pending
{
  rmw_request_id_t id;  // of who has asked
  int64_t sequence;     // of the request that was forwarded
  int64_t until;        // steady
};

/// Of a gate on a topic, all of it stays zero.
struct fm_service_gate
{
  struct fm_node * node;
  const struct fm_node_table * table;
  const struct fm_node_clock * clock;
  struct fm_engine * engine;        // NULL: it is not open
  rcl_service_t service;            // that it offers
  rcl_client_t client;              // of the real server
  struct fm_typed_message request;
  struct fm_typed_message answer;   // of the server
  struct fm_typed_message refusal;  // of the bundle
  struct fm_pending * pending;
  size_t n_pending;
  uint64_t unanswered;              // requests that passed, and that no server answered
  int64_t next_line;                // about these
};

/// Wait for requests, and for answers of the server. Returns false if rcl fails.
bool fm_service_gate_wait(const struct fm_service_gate * gate, rcl_wait_set_t * wait_set);

/// Judge the requests that are waiting, and pass on the answers. A request that is withheld, and
/// one for which there is no server, which is not judged, gets the response of the bundle.
void fm_service_gate_serve(struct fm_service_gate * gate);

/// Refuse the requests that wait for a server that has gone, or too long; once a second. A server
/// that was killed and started again is there, and has not the request. O(requests).
void fm_service_gate_review(struct fm_service_gate * gate);

// ---- the gate ----------------------------------------------------------------------------------

/// Zeroed before fm_node_gate_guard. Without a gate in the table, all of it stays zero, and all
/// functions do nothing.
struct fm_node_gate
{
  struct fm_node * node;
  const struct fm_node_table * table;
  const char * source;             // their full names
  const char * target;
  struct fm_engine * engine;
  struct fm_gate_target * state;
  rcl_publisher_t publisher;
  rcl_publisher_t next;            // that replaces it; zeroed: none
  struct fm_relay * relay;         // NULL: it relays nothing
  struct fm_service_gate service;
};

/// Let the gate of the table judge for an engine of this evaluator. The names outlive the gate;
/// the memory, of which some is reserved, outlives the engine. Returns false, with the reason
/// logged. O(bytes).
bool fm_node_gate_guard(
  struct fm_node_gate * gate, struct fm_node * node, const struct fm_node_table * table,
  struct fm_engine * engine, struct fm_evaluator * evaluator, struct fm_memory * memory,
  const char * source, const char * target);

/// Advertise the target, or offer the service, and start to judge. Returns false, with the reason
/// logged.
bool fm_node_gate_start(struct fm_node_gate * gate, const struct fm_node_clock * clock);

/// Take the messages of a subscription to the source, with this durability, unless that has to
/// wait: then `*is_taken` stays false, and it is called again at a review. Returns false if the
/// middleware has no callback for new messages.
bool fm_node_gate_take(
  struct fm_node_gate * gate, const rcl_subscription_t * subscription, bool is_durable,
  bool * is_taken);

/// Offer what the publishers of the source offer, and look for others on the target. `about`: of
/// the source; publishers of other types do not count. O(publishers^2).
void fm_node_gate_review(
  struct fm_node_gate * gate, const char * type, const struct fm_offer * offers, uint32_t n);

/// What is around the gate, which is there. Valid until the next review.
struct fm_gate_facts fm_node_gate_facts(const struct fm_node_gate * gate);

/// End the thread, and withdraw the target; its subscriptions were closed before.
void fm_node_gate_stop(struct fm_node_gate * gate);

// ---- topics ------------------------------------------------------------------------------------

/// A subscription and the receiver of its messages.
struct fm_intake
{
  rcl_subscription_t subscription;
  struct fm_receiver * receiver;  // NULL if a gate takes them
  bool is_relayed;                // the gate's relay takes them
};

/// A topic. Zeroed before fm_topic_open but for the first four; fm_topic_close frees all of it.
struct fm_mapped_topic
{
  struct fm_node_gate * gate;        // that takes its messages; NULL: the engine does
  struct fm_key key;                 // of one of many that are one topic of the bundle; size 0: no
  uint32_t * n_handovers;            // of all of these that go on; NULL: it is alone
  bool is_found;                     // in the graph, with its publishers
  struct fm_session * session;
  const rosidl_message_type_support_t * (* support)(void);
  const char * written;              // its name in the bundle
  const char * type;
  const rosidl_message_type_support_t * in_place;  // rmw_functions.h; NULL: it is copied
  const char * name;                 // resolved
  uint32_t index;
  struct fm_subscription * state;
  struct fm_intake current;
  struct fm_intake * retired;        // being replaced, the oldest first
  uint32_t n_retired;
  bool is_due;                       // to be reviewed
  bool is_unread;                    // the middleware did not tell the publishers
  bool hands_over;                   // it is one of `n_handovers`
  bool is_leaked;                    // the middleware may still call back for a closed one
};

/// Subscribe; no message is taken before fm_topic_start. `name`: the resolved one; it outlives the
/// topic, as the session does. Returns false, with the error logged.
bool fm_topic_open(
  struct fm_mapped_topic * topic, struct fm_session * session, const char * name, uint32_t index);

/// Begin to take the messages, for the engine of the session. As fm_topic_open.
bool fm_topic_start(struct fm_mapped_topic * topic);

/// Look for the publishers, and do what is decided. O(publishers^2).
void fm_topic_review(struct fm_mapped_topic * topic);

/// As fm_subscription_is_settled.
bool fm_topic_is_settled(const struct fm_mapped_topic * topic);

/// Take what waits, and unsubscribe. Returns false if the middleware may still call back: the
/// engine must then live as long as the process.
bool fm_topic_close(struct fm_mapped_topic * topic);

// ---- topics with a variable in their names -----------------------------------------------------

struct fm_bound_topic
{
  struct fm_mapped_topic mapped;
  char * name;     // the full one, with the key
};

/// Zeroed: none.
struct fm_bound_topics
{
  struct fm_session * session;         // outlives them
  struct fm_bound_topic ** items;
  uint32_t n;
  uint32_t capacity;
  uint32_t * n_handovers;              // a topic of the table
  struct fm_keyed_topics * watch;      // NULL: no keys are found
  bool has_changed;                    // the graph; set by the owner
  bool is_leaked;                      // the middleware may still call back for one
};

/// Take the messages of the topics of listed keys, and begin to look for others. Returns false,
/// with the reason logged; fm_bound_end is to be called even then. O(listed keys).
bool fm_bound_begin(struct fm_bound_topics * bound, struct fm_session * session);

/// Look at the graph if it is time: subscribe to what is found, end what is abandoned. Returns
/// when to call it again, on the steady clock. As fm_keyed_topics_review.
int64_t fm_bound_review(struct fm_bound_topics * bound);

/// Unsubscribe from all. Returns false if the middleware may still call back: the engine must then
/// live as long as the process.
bool fm_bound_end(struct fm_bound_topics * bound);

// ---- the graph ---------------------------------------------------------------------------------

/// Zeroed: there is nothing. The functions make and end what it holds.
struct fm_node_graph
{
  struct fm_node * node;
  struct fm_memory memory;     // of the next four
  struct fm_graph_source * sources;  // with full names
  uint32_t * own;              // subscriptions of this node
  rcl_client_t * clients;      // of states and parameters
  struct fm_service_client * services;
  uint32_t n;
  struct fm_graph * watch;
  bool has_changed;     // the graph, since the last look
};

/// Prepare to look, for an engine, which outlives it. Returns false, with the error logged.
bool fm_node_graph_begin(
  struct fm_node_graph * graph, struct fm_node * node, const struct fm_node_table * table,
  struct fm_engine * engine);

/// Look if it is time; the node's own subscriptions, which `count_own` returns for a topic, are
/// not counted. Returns when to call it next: CLOCK_MONOTONIC, INT64_MAX if there is nothing to
/// look for. As fm_graph_review.
int64_t fm_node_graph_review(
  struct fm_node_graph * graph,
  uint32_t (* count_own)(const struct fm_session * session, const char * topic),
  const struct fm_session * session);

void fm_node_graph_end(struct fm_node_graph * graph);

// ---- actions and locks -------------------------------------------------------------------------

/// Zeroed before fm_node_actions_begin; fm_node_actions_end frees all of it.
struct fm_node_actions
{
  struct fm_node * node;
  const struct fm_node_table * table;
  struct fm_memory memory;          // of the next seven
  rcl_publisher_t * locks;          // of each lock
  rcl_publisher_t * publishers;     // of each action that publishes
  rcl_client_t * clients;           // two for each action
  const char ** lock_names;         // full names
  const char ** names;
  struct fm_action_ends * ends;
  struct fm_action_facts * counts;  // at the last look
  struct fm_actions * thread;       // NULL: it does not run
};

/// Advertise the topics, and make the clients. Returns false, with the error logged. O(actions).
bool fm_node_actions_begin(
  struct fm_node_actions * actions, struct fm_node * node, const struct fm_node_table * table);

/// Fill `locks`, n_locks of the table, for an announcer.
void fm_node_actions_locks(const struct fm_node_actions * actions, struct fm_lock * locks);

/// Follow an engine (which follows its states), in a thread, if there are actions. Returns false
/// if none can be started.
bool fm_node_actions_start(struct fm_node_actions * actions, struct fm_engine * engine);

/// Wait until no action runs, and log the last lines. The engine is closed before.
void fm_node_actions_stop(struct fm_node_actions * actions);

/// Update the counts, and log what has failed since the last look.
void fm_node_actions_look(struct fm_node_actions * actions);

void fm_node_actions_end(struct fm_node_actions * actions);

// ---- the black box -----------------------------------------------------------------------------

/// Zeroed before fm_node_blackbox_begin; fm_node_blackbox_end frees all of it.
struct fm_node_blackbox
{
  struct fm_node * node;
  struct fm_blackbox_writer * writer;  // NULL: there is no black box
  struct fm_blackbox_options options;
  struct fm_memory memory;             // of what the options point to
};

/// Prepare the folder and the memory. `names`: the full names of the topics of the table; they
/// outlive it. Returns false, with the reason logged. O(topics + memory).
bool fm_node_blackbox_begin(
  struct fm_node_blackbox * box, struct fm_node * node, const struct fm_node_table * table,
  const char * const * names, const struct fm_parameters * parameters);

/// Keep the messages of an engine, which delivers none yet. Returns false if no thread can be
/// started.
bool fm_node_blackbox_start(struct fm_node_blackbox * box, struct fm_engine * engine);

/// Log what was written since the last call.
void fm_node_blackbox_look(struct fm_node_blackbox * box);

/// Write what is pending, and log it. Before the engine is destroyed.
void fm_node_blackbox_stop(struct fm_node_blackbox * box);

void fm_node_blackbox_end(struct fm_node_blackbox * box);

// ---- details -----------------------------------------------------------------------------------

struct fm_detail_thread;

/// Start the thread; NULL if none can be made, or memory is short. No other thread may take
/// details. What it is given outlives it, except that the publisher is only used until the end.
struct fm_detail_thread * fm_detail_thread_start(
  const struct fm_node * node, const struct fm_reporter * reporter,
  const rcl_publisher_t * publisher, bool logs_violations);

/// Return how often it has looked for work: several times a second, unless it hangs. O(1).
uint64_t fm_detail_thread_turns(const struct fm_detail_thread * thread);

/// Wait until the thread has emptied its queue, and free it. The engine is closed before. NULL is
/// allowed.
void fm_detail_thread_join(struct fm_detail_thread * thread);

// ---- the session -------------------------------------------------------------------------------

/// What is advertised for each requirement.
enum { FM_HANDLERS, FM_VERDICTS, FM_MARGINS, FM_OF_EACH };

/// Zeroed: no session. The functions below make and end what it holds.
struct fm_session
{
  const struct fm_node_table * table;
  struct fm_node * node;
  struct fm_node_clock * clock;
  const struct fm_parameters * parameters;
  const struct fm_fixed_qos * fixed;  // a topic: the bundle's, or of `qos_overrides`
  enum fm_taking taking;              // what callbacks do: FM_LISTEN, FM_WAKE
  struct fm_memory configured;        // freed by fm_session_release
  struct fm_memory active;            // freed by fm_session_deactivate
  rcl_publisher_t * publishers[FM_OF_EACH];  // each a requirement; NULL: they are not published
  rcl_publisher_t details;
  struct fm_node_actions actions;
  struct fm_node_blackbox blackbox;
  struct fm_node_gate gate;
  const char * gate_source;           // full names; NULL: no gate
  const char * gate_target;
  struct fm_engine * engine;
  struct fm_reporter reporter;
  const char ** topic_names;          // as resolved
  struct fm_announcer * announcer;
  struct fm_verdict_thread * verdict_thread;
  struct fm_detail_thread * detail_thread;
  struct fm_node_graph graph;
  struct fm_mapped_topic * topics;
  uint32_t n_topics;                  // that were opened
  struct fm_bound_topics bound;       // with a variable in their names
  uint32_t next_looked_at;            // of the topics
  bool has_due;                       // topics to be looked at
  int64_t next_look;                  // at publishers; steady, as these two
  int64_t next_question;              // whether topics are settled
  int64_t next_round;                 // at which all are looked at
  bool is_active;
};

/// Advertise the handlers and `copilot/violations`, for the `place`-th table, as the parameters
/// say, which do not change until the release. Returns false, with the reason logged, and nothing
/// is left. O(requirements).
bool fm_session_configure(
  struct fm_session * session, const struct fm_node_tables * tables, uint32_t place,
  struct fm_node * node, struct fm_node_clock * clock, const struct fm_parameters * parameters);

/// What callbacks do where no gate takes the messages, as the parameters say.
enum fm_taking fm_taking_of(const struct fm_parameters * parameters);

/// Start monitoring, without a past and without values. Returns false, with the reason logged, and
/// nothing is left running.
bool fm_session_activate(struct fm_session * session);

/// Stop monitoring; nothing is stepped or published afterwards. The handlers stay.
void fm_session_deactivate(struct fm_session * session);

/// Stop, and withdraw the handlers.
void fm_session_release(struct fm_session * session);

/// Note that the graph has changed. Returns when to call fm_session_review. O(topics).
int64_t fm_session_note_change(struct fm_session * session);

/// Look for the publishers of topics for which that is due (subscription.h), some at a time.
/// Returns when to call it again, on the steady clock. O(topics).
int64_t fm_session_review(struct fm_session * session);

/// Write the publishers of each topic: of all that are one topic of the table, and what is wrong
/// with the first of which something is. O(topics).
void fm_session_publishers(const struct fm_session * session, struct fm_publishers * topics);

/// Threads of a session that are counted by fm_session_turns, at most.
enum { FM_SESSION_THREADS = 4 };

/// Write a counter of each thread that the session has to `turns`, and return how many.
uint32_t fm_session_turns(const struct fm_session * session, uint64_t * turns);

#endif  // SESSION_H_
