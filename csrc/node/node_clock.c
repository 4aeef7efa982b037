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

/// node_clock.c: see session.h for the contract.

#include "session.h"

#include <rcl/error_handling.h>
#include <rmw/qos_profiles.h>
#include <rosgraph_msgs/msg/clock.h>

#include "words.h"

enum { WARNING_S = 60 };  // between two log lines about negative times on /clock

static bool subscribe(struct fm_node_clock * clock)
{
  rcl_subscription_options_t options = rcl_subscription_get_default_options();
  options.qos = rmw_qos_profile_default;
  options.qos.depth = 1;
  options.qos.reliability = RMW_QOS_POLICY_RELIABILITY_BEST_EFFORT;
  clock->subscription = rcl_get_zero_initialized_subscription();
  if (rcl_subscription_init(
      &clock->subscription, &clock->node->node,
      ROSIDL_GET_MSG_TYPE_SUPPORT(rosgraph_msgs, msg, Clock), "/clock", &options) == RCL_RET_OK)
  {
    return true;
  }
  fm_log_failure(clock->node, "cannot subscribe to /clock");
  return false;
}

bool fm_clock_simulate(struct fm_node_clock * clock, bool is_simulated)
{
  if (clock->is_simulated == is_simulated) {
    return true;
  }
  if (is_simulated && !subscribe(clock)) {
    return false;
  }
  clock->is_simulated = is_simulated;
  if (!is_simulated) {
    fm_ignore(rcl_subscription_fini(&clock->subscription, &clock->node->node));
  }
  return true;
}

static void warn_of_negative(
  struct fm_node_clock * clock, const rosgraph_msgs__msg__Clock * message)
{
  if (fm_passes(&clock->next_warning, fm_steady_now(), WARNING_S * FM_SECOND)) {
    fm_log(clock->node, FM_WARN, FM_WORDS_NEGATIVE_TIME,
      message->clock.sec + message->clock.nanosec / 1e9);
  }
}

bool fm_clock_take(struct fm_node_clock * clock, int64_t * time)
{
  rosgraph_msgs__msg__Clock message;
  const int64_t before = __atomic_load_n(&clock->simulated, __ATOMIC_RELAXED);
  *time = before;
  while (rcl_take(&clock->subscription, &message, NULL, NULL) == RCL_RET_OK) {
    if (message.clock.sec >= 0) {
      *time = message.clock.sec * FM_SECOND + message.clock.nanosec;
    } else {
      warn_of_negative(clock, &message);
    }
  }
  rcl_reset_error();  // no message is left
  return *time != before;
}

int64_t fm_clock_now(const struct fm_node_clock * clock)
{
  return clock->is_simulated ?
         __atomic_load_n(&clock->simulated, __ATOMIC_RELAXED) : fm_system_now();
}

int fm_clock_read(void * clock, int64_t * nanoseconds)
{
  *nanoseconds = __atomic_load_n(&((struct fm_node_clock *)clock)->simulated, __ATOMIC_RELAXED);
  return 0;
}
