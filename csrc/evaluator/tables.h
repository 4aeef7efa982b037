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

/// tables.h: the parts of an evaluator: what the monitor and the options determine, and counters.
/// For the files of the evaluator only.
///
/// One block of memory holds everything: these tables, and the instance (instance.h), which is all
/// that steps depend on. tables.c lays the block out, checks the options and fills the tables;
/// afterwards only the counters and the instance change.

#ifndef TABLES_H_
#define TABLES_H_

#include "evaluator.h"
#include "instance.h"

struct fm_input_cell
{
  uint32_t * readers;    // the groups that read it, ascending
  struct fm_input_counts counts;
  uint64_t silences;
  int64_t last_silence;  // how long the last one lasted, ns
  int64_t timeout;       // ns; 0: none
  int64_t startup;       // ns; in place of `timeout` until a value was received
  int64_t window;        // of a rate, ns
  uint64_t place;        // of its words in the instance, if it is measured
  uint32_t room;         // of a rate: messages in the window
  uint32_t n_readers;
  uint32_t topic;
  uint32_t startups;     // of the silences, those that `startup` ended in
  enum fm_source source;
  bool violates;
};

/// The words of a rate in the instance, before the times of the messages in its window: a ring. A
/// period has only the first. FM_NEVER: there was none, is none, or comes none.
enum fm_rate_word
{
  FM_LAST,        // when the last message was received
  FM_FULL_AT,     // when the window is full
  FM_LOST_UNTIL,  // when the last message that was left out would have left the window
  FM_CHANGES_AT,  // under FM_TIMED: when the rate changes without a message
  FM_OLDEST,      // the place of the oldest message
  FM_N_MESSAGES,  // in the window
  FM_RATE_WORDS
};

struct fm_requirement_cell
{
  uint64_t violations;
  uint64_t announced;
  uint32_t occurrence;  // the verdict whose falls are occurrences
  enum fm_report report;
  struct fm_closest recent;  // since it was taken, of all instances
};

/// The least margins of a requirement of an instance.
struct fm_nearest
{
  struct fm_closest closest;
  struct fm_closest beyond;  // of the last violation
};

struct fm_topic_cell
{
  uint32_t * groups;  // those that read an input of this topic, or no input at all; ascending
  struct fm_topic_counts counts;
  uint32_t n_groups;
  bool tells_receptions;  // feeds an input whose source is FM_RECEPTION
};

struct fm_evaluator
{
  const struct fm_monitor * monitor;
  const struct fm_tests * tests;  // NULL: none
  struct fm_trial_log * trials;   // NULL: none
  const struct fm_margins * margins;  // NULL: none
  const struct fm_margin_lanes * lanes;  // NULL: none
  struct fm_instance instance;
  struct fm_input_cell * inputs;
  struct fm_requirement_cell * requirements;
  struct fm_nearest * nearest;  // a requirement
  struct fm_topic_cell * topics;
  uint32_t * rates;         // inputs whose source is FM_RATE
  uint64_t * steps_before;  // a group: steps that its instance no longer counts
  struct fm_time_counts counts;
  int64_t period;           // ns; 0: none
  int64_t patience;         // ns; 0: none
  int64_t seen;             // the latest time of fm_see_time; INT64_MIN: none
  int64_t wake;             // not after the deadline
  bool is_exact;            // wake is the deadline
  uint64_t measure_words;   // of the instance
  uint32_t n_rates;
  uint32_t n_topics;
  uint32_t n_receptions;    // inputs whose source is FM_RECEPTION
  enum fm_policy policy;
  bool has_measures;        // an input is measured
  bool reports_recoveries;
};

/// The present margin of a requirement; a NaN if it is not known, or a stale input violates it.
/// O(1).
FM_INTERNAL struct fm_margin fm_margin_now(
  const struct fm_evaluator * evaluator, uint32_t requirement);

/// Take the least margin of a requirement since the last call, at which it was `now`. O(1).
FM_INTERNAL double fm_take_recent(
  struct fm_evaluator * evaluator, uint32_t requirement, double now);

/// Whether the evaluator itself computes the values of an input. O(1).
FM_INTERNAL bool fm_is_measured(enum fm_source source);

/// The words of the instance for what is measured. O(inputs).
FM_INTERNAL uint64_t fm_measure_words(const struct fm_evaluator_options * options);

/// No message of a measured input has come yet. O(1).
FM_INTERNAL void fm_begin_measure(struct fm_evaluator * evaluator, uint32_t i);

#endif  // TABLES_H_
