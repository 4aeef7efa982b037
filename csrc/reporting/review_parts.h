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

/// review_parts.h: the struct of a review, and the functions that its files share.
///
/// As review.h: one thread at a time, which may allocate; when memory is short, words are left
/// out. Conditions are as in states.h.

#ifndef REVIEW_PARTS_H_
#define REVIEW_PARTS_H_

#include "review.h"

/// What was logged of an input.
struct fm_input_log
{
  int64_t absent_since;      // steady: its name is missing since then; 0: it is not
  uint64_t received_before;  // values before its name was missing
  bool is_absent_logged;     // its name was missing for long
  bool is_unusable_logged;
};

/// What was logged of a topic.
struct fm_topic_log
{
  bool is_undecodable_logged;
  bool is_ahead_logged;
  bool is_order_logged;
  bool is_absence_logged;  // of what is in the graph
  uint32_t fault;          // enum fm_fault: of the last look
};

/// What was logged of a kind of instances.
struct fm_kind_log
{
  bool is_first_logged;   // keys beyond `most` of the first variable
  bool is_second_logged;
  bool is_unsized_logged;
  bool is_unusable_logged;
};

struct fm_time_log
{
  struct fm_time_counts logged;  // when late periods were logged last
  struct fm_time_counts judged;  // a minute ago
  int64_t began;                 // steady: the node has had no time since then
  int64_t next_line;
  int64_t next_minute;
  bool is_clock_logged;
};

/// When lines about the gate may be logged again.
struct fm_gate_log
{
  uint64_t unsent;               // that were logged
  int64_t next_others;
  int64_t next_unsent;
  int64_t next_violating;
};

struct fm_review
{
  const struct fm_reporter * reporter;
  const struct fm_report_table * table;  // these two are the reporter's
  struct fm_memory memory;       // of all that follows
  const char * const * names;    // of topics, as they are shown
  struct fm_snapshot now;
  struct fm_snapshot before;     // that of the look before
  struct fm_facts facts;
  struct fm_blackbox_facts blackbox;
  struct fm_blackbox_facts blackbox_before;
  uint64_t * failed;             // of each action, at this look
  uint64_t * failed_before;
  double seconds;                // between the two looks
  int64_t created;
  struct fm_input_log * inputs;
  struct fm_topic_log * topics;
  struct fm_kind_log * kinds;
  struct fm_text * conditions;   // as they were logged: the locks, then the gate
  uint32_t n_conditions;
  uint32_t * changes;            // of each, in the review
  bool * flags;                  // of the inputs
  struct fm_time_log time;
  struct fm_gate_log gate;
  struct fm_tree_counts links_logged;
  bool is_missing_logged;
  bool is_unpublished_logged;
};

/// Whether periods were missed, or enough of them late, between two counts.
FM_INTERNAL bool fm_are_worth_reading(
  const struct fm_time_counts * before, const struct fm_time_counts * now);

/// Add the lines about locks and the gate; silences; inputs and topics; instances;
/// requirements that wait for messages.
FM_INTERNAL void fm_review_conditions(struct fm_review * review, struct fm_lines * lines);
FM_INTERNAL void fm_review_gate(struct fm_review * review, struct fm_lines * lines);
FM_INTERNAL void fm_review_silences(struct fm_review * review, struct fm_lines * lines);
FM_INTERNAL void fm_review_topics(struct fm_review * review, struct fm_lines * lines);
FM_INTERNAL void fm_review_instances(struct fm_review * review, struct fm_lines * lines);
FM_INTERNAL void fm_review_missing(const struct fm_review * review, struct fm_lines * lines);

// ---- locks and gates ---------------------------------------------------------------------------

/// Add the state of a lock: "free", or "locked: " with the reason; or of the gate, if `lock` is
/// NULL: "open", or "closed: " with the reason. Returns whether it is free or open.
FM_INTERNAL bool fm_add_state(
  struct fm_text * text, const struct fm_reporter * reporter, const struct fm_report_lock * lock,
  const uint8_t * conditions);

/// Add who is where only the gate should be.
FM_INTERNAL void fm_add_others(
  struct fm_text * text, const struct fm_report_gate * gate, const struct fm_gate_facts * facts);

/// Whether a gate has withheld each message so far on which a requirement was judged.
FM_INTERNAL bool fm_is_withheld_from_start(
  const struct fm_reporter * reporter, const uint8_t * conditions, uint32_t requirement);

// ---- topics whose messages are made ------------------------------------------------------------

/// Whether the messages of a topic are made of the graph, or of what a node in it is.
FM_INTERNAL bool fm_is_of_graph(const struct fm_reporter * reporter, uint32_t topic);

/// Add what was seen last of such a topic to a text. Allocates.
FM_INTERNAL void fm_add_seen(
  struct fm_text * text, const struct fm_reporter * reporter, uint32_t topic,
  const struct fm_observed * observed);

/// Whether something is wrong with it.
FM_INTERNAL bool fm_is_seen_wrong(const struct fm_observed * observed);

/// Add a line, once, if it was not there when its `startup` was over, and when another fault
/// comes. O(1).
FM_INTERNAL void fm_review_graph(
  struct fm_review * review, uint32_t topic, struct fm_lines * lines);

/// Add where the chain of a transform is broken to a text; nothing if it is whole, or the topic is
/// none of a transform. Returns whether it is broken. As fm_engine_missing_link.
FM_INTERNAL bool fm_add_missing_link(
  struct fm_text * text, const struct fm_reporter * reporter, uint32_t topic);

/// Add a line for each kind of links that were left out, of which there were none `before`. O(1).
FM_INTERNAL void fm_add_left_out(
  struct fm_lines * lines, const struct fm_tree_counts * before,
  const struct fm_tree_counts * now);

// ---- instances ---------------------------------------------------------------------------------

/// The input of the bundle's scope that a requirement reads; UINT32_MAX: one with a key. O(1).
static inline uint32_t fm_bundle_input(
  const struct fm_report_table * table, const struct fm_report_requirement * about, uint32_t k)
{
  return about->kind == FM_BUNDLE ? about->inputs[k] :
         table->kinds[about->kind].shared[about->inputs[k]];
}

/// An input that a topic feeds, and what was counted of it.
struct fm_fed
{
  const struct fm_report_input * about;
  uint32_t kind;          // FM_BUNDLE: it is one of the bundle's scope
  uint32_t input;         // its index there
  uint64_t unusable;
  uint64_t new_unusable;  // since the look before, as the next but one
  uint64_t silences;
  uint64_t new_silences;
  uint64_t new_startups;  // of these
};

/// Find the `k`-th input of a topic: first come those of the bundle's scope, then those with keys.
/// Returns false if there are fewer. O(kinds).
FM_INTERNAL bool fm_find_fed(
  const struct fm_review * review, uint32_t topic, uint32_t k, struct fm_fed * fed);

/// Add the inputs of the bundle's scope that a requirement reads and that have no value yet.
/// Returns whether there are any. O(inputs of the requirement).
FM_INTERNAL bool fm_add_missing(
  struct fm_text * text, const struct fm_review * review,
  const struct fm_report_requirement * about);

/// Whether a requirement of instances is violated, with the first keys that violate it. Returns
/// the level of its status. O(keys that are named).
FM_INTERNAL enum fm_status_level fm_describe_instances(
  const struct fm_review * review, uint32_t requirement, struct fm_text * message);

/// Add how many instances there are, and what became of the others. O(1).
FM_INTERNAL void fm_add_instances(
  const struct fm_review * review, uint32_t requirement, struct fm_status * status);

/// Add the key of the instance whose margin is the least: robot=alpha. O(requirements).
FM_INTERNAL void fm_add_nearest(
  const struct fm_review * review, uint32_t requirement, struct fm_text * text);

#endif  // REVIEW_PARTS_H_
