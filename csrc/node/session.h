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

/// session.h: monitors the bundle: from its subscriptions through the engine to its handlers.
///
/// All functions are called by the main thread. While a session runs, these threads use its
/// engine: those of the middleware (receivers), the announcer, that of the details, and that of
/// the verdicts.

#ifndef SESSION_H_
#define SESSION_H_

#include "session_parts.h"

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
  rcl_publisher_t * handlers;         // a requirement
  rcl_publisher_t * verdicts;         // a requirement; NULL: they are not published
  rcl_publisher_t * margins;          // a requirement; NULL: they are not published
  rcl_publisher_t details;
  struct fm_node_actions actions;
  struct fm_node_blackbox blackbox;
  struct fm_node_gate gate;
  const char * gate_source;           // full names; NULL: no gate
  const char * gate_target;
  struct fm_engine * engine;
  struct fm_reporter reporter;
  const char ** topic_names;          // as resolved
  const char ** shown_names;          // as reports name them, of the topics of inputs
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
  bool is_configured;
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

/// Serve what a gate on a service has received.
void fm_session_serve_requests(struct fm_session * session);

/// Threads of a session that are counted by fm_session_turns.
enum { FM_SESSION_THREADS = 4 };

/// Write the counters of the threads to `now` (FM_SESSION_THREADS). Returns whether each thread
/// has looked for work since those in `before`.
bool fm_session_turns(
  const struct fm_session * session, const uint64_t * before, uint64_t * now);

#endif  // SESSION_H_
