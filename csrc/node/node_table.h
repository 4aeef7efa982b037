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

/// node_table.h: what the node of an exported bundle is made from, beside its monitor.
///
/// `export --to ros2` generates a constant for each bundle, and their list `fm_node_tables`; all
/// other C of the node is the same for every bundle. Texts are UTF-8. Indices of inputs, topics
/// and requirements are those of the monitor's description. Constant, so that any thread may read
/// it.

#ifndef NODE_TABLE_H_
#define NODE_TABLE_H_

#include <rosidl_runtime_c/message_type_support_struct.h>
#include <rosidl_runtime_c/service_type_support_struct.h>

#include "blackbox_file.h"
#include "graph.h"
#include "report_table.h"
#include "scopes.h"
#include "shared_names.h"
#include "subscription.h"

#define FM_DETAILS_TOPIC "copilot/violations"
#define FM_PATIENCE_NS 500000  // a timeout found later may be put off once (evaluator.h)

/// The function that returns the type support of a message type, for the table: it is declared
/// here, so that the table includes no header of a message.
#define FM_TYPE_SUPPORT(package, folder, name) \
  ROSIDL_TYPESUPPORT_INTERFACE__MESSAGE_SYMBOL_NAME(rosidl_typesupport_c, package, folder, name)
#define FM_DECLARE_TYPE_SUPPORT(package, folder, name) \
  const rosidl_message_type_support_t * FM_TYPE_SUPPORT(package, folder, name)(void)

/// As these, of a service.
#define FM_SERVICE_SUPPORT(package, folder, name) \
  ROSIDL_TYPESUPPORT_INTERFACE__SERVICE_SYMBOL_NAME(rosidl_typesupport_c, package, folder, name)
#define FM_DECLARE_SERVICE_SUPPORT(package, folder, name) \
  const rosidl_service_type_support_t * FM_SERVICE_SUPPORT(package, folder, name)(void)

/// The type of the messages of an action, or of its service; NULL: none.
struct fm_action_type
{
  const rosidl_message_type_support_t * (* message)(void);
  const rosidl_service_type_support_t * (* service)(void);
};

struct fm_node_topic
{
  const rosidl_message_type_support_t * (* support)(void);  // NULL: the node does not subscribe
  struct fm_fixed_qos qos;
  const char * const * definition;  // of the message and of all within it, in pieces; then NULL
  const struct fm_key * listed;     // keys of the variable in its name
  uint32_t n_listed;                // 0: they are found, or there is no variable
};

/// What a gate needs beside its report. Of one on a service, `from` is zeroed.
struct fm_node_gate_table
{
  const char * name;              // of the source, as written; fm_report_gate has its index
  const char * type;
  struct fm_node_topic from;
  const char * to;                // as written in the bundle
  const uint8_t * substitute;     // serialized; the response of a gate on a service
  size_t substitute_size;
  int64_t stamp_at;               // as in fm_relay_options
  const rosidl_service_type_support_t * (* service)(void);  // NULL: it is on a topic
  int64_t timeout;                // ns, for which a request waits for its answer
};

/// Names of topics and services as written, which the node resolves and compares.
struct fm_used_names
{
  const struct fm_use * uses;
  uint32_t n_uses;
  const struct fm_typed_use * types;
  uint32_t n_types;
};

struct fm_node_table
{
  struct fm_report_table report;
  struct fm_used_names names;
  const char * bundle;     // its name; report.bundle is what statuses show
  const char * node_name;  // unless it is remapped
  const char * origin;     // where the bundle is from, if this node stands for `monitor`; else ""
  const char * const * warnings;  // about the bundle
  uint32_t n_warnings;
  const char * judged_by_gates;  // of the log: requirements that are left to gates; may be ""
  const struct fm_monitor * (* monitor)(void);  // of the bundle's scope
  /// Fill in the options of evaluators (of the bundle's scope, then of each kind) and the kinds.
  void (* describe)(struct fm_evaluator_options * options, struct fm_kind * kinds);
  uint64_t n_groups;       // step groups of all these, of one instance
  const struct fm_aggregate * aggregates;
  uint32_t n_aggregates;
  const struct fm_readers * (* readers)(void);  // NULL: no topics
  const struct fm_node_topic * topics;
  const char * const * end_definition;  // as of a topic, of std_msgs/msg/Header
  const struct fm_transform_topic * transforms;
  uint32_t n_transforms;
  uint32_t tf;         // the topics with the links between their frames
  uint32_t tf_static;
  const struct fm_graph_source * in_graph;  // names as written, to be resolved by the node
  uint32_t n_in_graph;
  const struct fm_derived_topic * derived;  // names of nodes as written
  uint32_t n_derived;
  const struct fm_node_gate_table * gate;  // NULL: the bundle has none, or leaves it to others
  const struct fm_blackbox_requirement * in_blackbox;  // requirements
  const struct fm_action_type * action_types;  // of each action, without locks
};

/// The bundles of a node, at least one, or its gates; and the names that every node uses.
struct fm_node_tables
{
  const struct fm_node_table * const * tables;
  uint32_t n;
  struct fm_used_names own;
};

extern const struct fm_node_tables fm_node_tables;

#endif  // NODE_TABLE_H_
