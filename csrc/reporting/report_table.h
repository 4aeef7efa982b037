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

/// report_table.h: what reports must know of a bundle, beside its monitor: names and texts.
///
/// `export --to ros2` generates one; a node in Python fills one from the manifest. Texts are
/// UTF-8. Indices of inputs, topics and requirements are those of the monitor's description.
/// Constant, so that any thread may read it.

#ifndef REPORT_TABLE_H_
#define REPORT_TABLE_H_

#include "evaluator.h"
#include "fret_fields.h"
#include "gate.h"
#include "kinds.h"
#include "schedule.h"

/// A name of a value of an input. A string input is stored as the index of its name.
struct fm_value_name
{
  const char * name;
  union fm_value value;
};

struct fm_report_input
{
  const char * name;
  const char * path;  // the field, as written in the bundle: min(ranges[3:9])
  const struct fm_value_name * values;
  uint32_t n_values;
  bool is_timed_out;  // it has a timeout and a topic
  bool violates;      // what reads it is violated while it is silent
  bool has_initial;
  union fm_value initial;
  double timeout;     // s; 0: none
  double startup;     // s
};

/// What a topic is.
enum fm_topic_kind
{
  FM_TOPIC = 0,      // of ROS, to which the node subscribes
  FM_ANNOUNCED = 1,  // the node publishes violations or margins on it
  FM_OWN = 2,        // the node uses it otherwise
  FM_TRANSFORM = 3,  // the engine makes its messages, as of all later kinds: of links of frames
  FM_IN_GRAPH = 4,   // of the graph of ROS, as of all later kinds, too
  FM_LIFECYCLE = 5,  // the state of a node
  FM_PARAMETER = 6   // of a node
};

struct fm_report_topic
{
  const char * name;  // as written in the bundle; of what is made: a text
  const char * type;  // package/msg/Name
  const char * variable;  // in its name, in braces: it is many topics of ROS; "": none
  const char * where;  // what selects some of its messages, as written; "": all are the topic's
  uint32_t kind;      // enum fm_topic_kind
};

struct fm_report_requirement
{
  const char * id;
  const char * text;      // title, or sentence or formula, in one line
  const char * sentence;  // of the log: title and text
  const char * verdict_topic;  // on which its verdict is published, if that is wanted
  const char * margin_topic;   // and its margin; "": it has none
  uint32_t kind;          // index of a fm_report_kind; FM_BUNDLE: the bundle's scope
  const uint32_t * inputs;  // of that scope
  uint32_t n_inputs;
  const uint32_t * constants;  // that its text names, itself or in definitions
  uint32_t n_constants;
  int64_t horizon;        // its verdict is about so many steps ago; FM_TIMED: ns
  bool is_warning;        // its severity; otherwise error
  bool shows_verdict;     // in /diagnostics: it reports occurrences
};

/// A set of requirements of which there is one for each key of an instance variable, or for each
/// pair of keys of two (kinds.h).
struct fm_report_kind
{
  const char * variable;
  const char * second;            // of pairs; "": there is one variable
  const struct fm_report_input * inputs;  // of its monitor
  const struct fm_topic * keyed;  // a topic: the inputs with a key that it feeds
  const uint32_t * shared;        // an input: the same in the bundle's scope; UINT32_MAX: it has a
                                  // key
  uint32_t n_inputs;
  uint32_t most;                  // instances at one time
  uint32_t first_most;            // keys of `variable` at one time
  uint32_t second_most;
  bool has_base;                  // its instances are those of a kind before it
  const char * const * comparisons;  // as of a table
};

/// A constant of the bundle, with the value that was compiled in, as written.
struct fm_constant
{
  const char * name;
  const char * value;
};

/// A lock: the requirements that lock it.
struct fm_report_lock
{
  const char * name;
  const char * topic;          // as written in the bundle
  int64_t period;              // ns between two messages
  const uint32_t * requirements;
  uint32_t n_requirements;
};

/// The gate that judges the messages of the bundle.
struct fm_report_gate
{
  const char * name;
  uint32_t topic;        // that it judges; n_topics: one that feeds no input
  int64_t open_after;    // ns without a violation, of a latch; 0: until a reset
  bool passes_silent;    // it stays open while an input of another topic is silent
  bool is_service;       // it judges requests
  uint32_t otherwise;    // enum fm_otherwise
  int64_t hold;          // ns; 0: none, as these
  int64_t period;
  bool latches;
};

struct fm_report_table
{
  const char * bundle;     // its name
  const char * component;
  const struct fm_report_gate * gate;  // NULL: none
  const struct fm_report_lock * locks;
  const struct fm_action * actions;    // all but locks
  const struct fm_follows * follows;   // of these, what follows each requirement
  const struct fm_report_input * inputs;
  const struct fm_report_topic * topics;  // of inputs; a handler a requirement; others of the node
  const struct fm_topic * topic_inputs;  // a topic: the inputs that it feeds
  const struct fm_report_requirement * requirements;  // as an engine numbers them
  const struct fm_report_kind * kinds;
  const struct fm_constant * constants;
  const char * const * comparisons;  // that decide margins (fm_margin.comparison), as written
  uint32_t n_inputs;
  uint32_t n_topics;         // of inputs
  uint32_t n_used;           // all of `topics`
  uint32_t n_requirements;
  uint32_t n_kinds;
  uint32_t n_constants;
  uint32_t n_locks;
  uint32_t n_actions;
  bool is_one_of_several;    // the node has other bundles: names of topics need the bundle's
  uint32_t policy;           // enum fm_policy
  int64_t period;            // ns, with FM_PERIODIC
  bool uses_header_stamps;
  int64_t reorder;           // ns
};

#endif  // REPORT_TABLE_H_
