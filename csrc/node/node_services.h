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

/// node_services.h: the services of every managed node: of its life cycle, and of its parameters.
///
/// The main thread only.

#ifndef NODE_SERVICES_H_
#define NODE_SERVICES_H_

#include <rcl_lifecycle/rcl_lifecycle.h>

#include "endpoints.h"
#include "parameters.h"

// ---- the life cycle ----------------------------------------------------------------------------

enum { FM_LIFECYCLE_SERVICES = 5 };

/// The work of the transitions; `release` is that of `cleanup` and `shutdown`.
struct fm_transitions
{
  bool (* configure)(void * context);
  bool (* activate)(void * context);
  void (* deactivate)(void * context);
  void (* release)(void * context);
  void * context;
};

struct fm_lifecycle
{
  struct fm_node * node;
  struct fm_transitions transitions;
  rcl_lifecycle_state_machine_t machine;
  bool logs_failures;  // of transitions: set by the owner once the node has started
};

/// Begin unconfigured, and offer the services. Returns false, with the error logged.
bool fm_lifecycle_begin(
  struct fm_lifecycle * lifecycle, struct fm_node * node,
  const struct fm_transitions * transitions);

/// Take a transition (lifecycle_msgs/msg/Transition). Returns whether it succeeded; false, and
/// nothing has changed, if the state does not have it.
bool fm_lifecycle_change(struct fm_lifecycle * lifecycle, uint8_t transition);

/// Write the services.
void fm_lifecycle_services(
  struct fm_lifecycle * lifecycle, struct fm_offered services[FM_LIFECYCLE_SERVICES]);

void fm_lifecycle_end(struct fm_lifecycle * lifecycle);

// ---- parameters --------------------------------------------------------------------------------

enum { FM_PARAMETER_SERVICES = 6 };

/// Zeroed before fm_parameter_services_begin.
struct fm_parameter_services
{
  struct fm_node * node;
  struct fm_parameters * parameters;
  /// Called after a parameter was set.
  void (* changed)(void * context, const struct fm_parameter * parameter);
  void * context;
  rcl_service_t services[FM_PARAMETER_SERVICES];
  rcl_publisher_t events;
};

/// Offer the services. Returns false, with the error logged. What it is given outlives it.
bool fm_parameter_services_begin(
  struct fm_parameter_services * services, struct fm_node * node,
  struct fm_parameters * parameters,
  void (* changed)(void * context, const struct fm_parameter * parameter), void * context);

/// Write the services.
void fm_parameter_services_offered(
  struct fm_parameter_services * services, struct fm_offered offered[FM_PARAMETER_SERVICES]);

void fm_parameter_services_end(struct fm_parameter_services * services);

#endif  // NODE_SERVICES_H_
