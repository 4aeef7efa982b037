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

/// parameter_services.h: the services with which `ros2 param` lists, describes, gets and sets the
/// parameters of the node, and `/parameter_events`. The main thread only.

#ifndef PARAMETER_SERVICES_H_
#define PARAMETER_SERVICES_H_

#include <rcl/wait.h>

#include "parameters.h"

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

/// Answer what waits.
void fm_parameter_services_serve(struct fm_parameter_services * services);

void fm_parameter_services_end(struct fm_parameter_services * services);

#endif  // PARAMETER_SERVICES_H_
