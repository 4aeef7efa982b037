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

/// monitor_node.h: the node: its parameters, life cycle, services and timers.
///
/// The main thread only.

#ifndef MONITOR_NODE_H_
#define MONITOR_NODE_H_

#include "node_services.h"
#include "node_health.h"
#include "parameters.h"

enum { FM_OFFERED = FM_LIFECYCLE_SERVICES + FM_PARAMETER_SERVICES + 2 };

/// Zeroed before fm_monitor_node_begin; fm_monitor_node_end frees all of it.
struct fm_monitor_node
{
  struct fm_node node;
  const struct fm_node_tables * tables;
  struct fm_node_clock clock;
  struct fm_parameters parameters;
  struct fm_parameter_services parameter_services;
  struct fm_lifecycle lifecycle;
  struct fm_session * sessions;         // of each table
  struct fm_health * healths;           // these two while the sessions are active
  struct fm_sign_of_life sign_of_life;
  rcl_service_t reset;
  rcl_service_t types;                  // ~/get_type_description; zeroed: it is not offered
  struct fm_offered offered[FM_OFFERED];
  rcl_wait_set_t wait_set;
  int64_t next_review;                  // of the publishers; steady, as the others
  int64_t next_report;
  int64_t next_look;                    // for another node of the same name
  uint32_t looks;                       // that are left
  bool is_active;
  bool has_logged_taking;               // once: as the node on rclpy
  bool has_log;
  bool has_lifecycle;
};

/// Start: `configure` and `activate` too, unless `autostart` is false. Returns the exit status, 0
/// if it runs; else the reasons are on standard error.
int fm_monitor_node_begin(
  struct fm_monitor_node * monitor, const struct fm_node_tables * tables, int argc,
  const char * const * argv);

/// Wait for up to 0.2 s, and serve what is due. Returns false if rcl fails, with the error logged.
bool fm_monitor_node_spin_once(struct fm_monitor_node * monitor);

void fm_monitor_node_end(struct fm_monitor_node * monitor);

#endif  // MONITOR_NODE_H_
