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
  bool is_beyond_logged;
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
  uint32_t n_kinds;
  struct fm_text * conditions;   // as they were logged: the locks, then the gate
  uint32_t n_conditions;
  uint32_t * changes;            // of each, in the review
  bool * flags;                  // twice the inputs
  struct fm_time_log time;
  struct fm_gate_log gate;
  struct fm_tree_counts links_logged;
  bool is_missing_logged;
  bool is_unpublished_logged;
};

/// Whether periods were missed, or enough of them late, between two counts.
FM_INTERNAL bool fm_are_worth_reading(
  const struct fm_time_counts * before, const struct fm_time_counts * now);

/// Add the lines about the time; locks and the gate; silences; inputs and topics; instances;
/// requirements that wait for messages.
FM_INTERNAL void fm_review_time(struct fm_review * review, struct fm_lines * lines);
FM_INTERNAL void fm_review_conditions(struct fm_review * review, struct fm_lines * lines);
FM_INTERNAL void fm_review_gate(struct fm_review * review, struct fm_lines * lines);
FM_INTERNAL void fm_review_silences(struct fm_review * review, struct fm_lines * lines);
FM_INTERNAL void fm_review_topics(struct fm_review * review, struct fm_lines * lines);
FM_INTERNAL void fm_review_instances(struct fm_review * review, struct fm_lines * lines);
FM_INTERNAL void fm_review_missing(const struct fm_review * review, struct fm_lines * lines);

#endif  // REVIEW_PARTS_H_
