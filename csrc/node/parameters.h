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

/// parameters.h: the node's parameters: declared, given on the command line or in files, checked.
///
/// `log_level` and `use_sim_time` may be set at any time. Others are read by `configure`, or only
/// at the start. What is compiled into the node cannot be set: constants, the policy.
///
/// The main thread only.

#ifndef PARAMETERS_H_
#define PARAMETERS_H_

#include <rcl_interfaces/msg/parameter_value.h>

#include "given.h"
#include "log.h"
#include "node_table.h"
#include "parameter_table.h"

typedef rcl_interfaces__msg__ParameterValue fm_parameter_value;

struct fm_parameter
{
  char * name;
  char * description;
  enum fm_settable settable;
  fm_parameter_value value;
};

/// The parameters of a node. Zeroed before fm_parameters_begin.
struct fm_parameters
{
  struct fm_node * node;
  const struct fm_node_tables * tables;
  struct fm_parameter * declared;
  size_t n_declared;
  struct fm_parameter * given;  // on the command line, or in files
  size_t n_given;
  struct fm_memory memory;        // of the next four, and of names; whether it was ever short
  const struct fm_given * facts;  // what is given
  const char ** subscribed;       // full names of topics
  uint32_t n_subscribed;
  struct fm_fixed_qos ** fixed;   // a bundle and a topic: the bundle's, or that of `qos_overrides`
  bool is_configured;             // set by the owner: `configure` has read them
};

/// Declare all parameters, with the values that were given. Adds problems to `problems`, one a
/// line, each with what to write instead. Returns whether there is none: when memory is short, a
/// line may be missing.
bool fm_parameters_begin(
  struct fm_parameters * parameters, struct fm_node * node, const struct fm_node_tables * tables,
  struct fm_text * problems);

/// Log parameters that were given, and are ignored; then overrides of the quality of service.
void fm_parameters_warn(const struct fm_parameters * parameters);
void fm_parameters_warn_of_overrides(const struct fm_parameters * parameters);

void fm_parameters_end(struct fm_parameters * parameters);

/// A declared parameter; NULL if there is none.
struct fm_parameter * fm_parameter_find(
  const struct fm_parameters * parameters, const char * name);

/// Whether each node of ROS declares it.
bool fm_parameter_is_of_rcl(const struct fm_parameter * parameter);

/// The value of a declared parameter.
bool fm_parameter_is_true(const struct fm_parameters * parameters, const char * name);
int64_t fm_parameter_whole(const struct fm_parameters * parameters, const char * name);
double fm_parameter_real(const struct fm_parameters * parameters, const char * name);

/// The value of `hot_path`: auto (possibly as an empty text), on or off.
const char * fm_parameter_hot_path(const struct fm_parameters * parameters);

/// Whether a parameter cannot be set to a value now; adds to `reason` why, unless memory is short.
bool fm_parameter_refuse(
  const struct fm_parameters * parameters, const char * name,
  const fm_parameter_value * value, struct fm_text * reason);

/// Exchange a parameter's value for one that is not refused. Sets the level of the log.
void fm_parameter_set(
  struct fm_parameters * parameters, const char * name, fm_parameter_value * value);

#endif  // PARAMETERS_H_
