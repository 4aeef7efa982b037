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

/// sign_of_life.c: see sign_of_life.h for the contract.

#include "sign_of_life.h"

#include <rcl/error_handling.h>
#include <rmw/qos_profiles.h>
#include <rosidl_runtime_c/string_functions.h>
#include <std_msgs/msg/header.h>
#include <string.h>

#define LEASE_S 3u      // without a sign, until the middleware reports the publisher as not alive
#define LOGGED_S 60.0

static void publish(struct fm_sign_of_life * sign)
{
  const struct fm_session * session = sign->session;
  const int64_t now = fm_clock_now(session->clock);
  std_msgs__msg__Header header;
  if (!std_msgs__msg__Header__init(&header)) {
    return;
  }
  header.stamp.sec = (int32_t)(now / FM_SECOND);
  header.stamp.nanosec = (uint32_t)(now % FM_SECOND);
  (void)rosidl_runtime_c__String__assign(
    &header.frame_id, rcl_node_get_name(&session->node->node));
  if (rcl_publish(&sign->publisher, &header, NULL) != RCL_RET_OK) {
    rcl_reset_error();
  }
  std_msgs__msg__Header__fini(&header);
  sign->published = fm_steady_now();
  sign->suspected = 0;
}

bool fm_sign_of_life_begin(struct fm_sign_of_life * sign, const struct fm_session * session)
{
  rcl_publisher_options_t options = rcl_publisher_get_default_options();
  options.qos = rmw_qos_profile_default;
  options.qos.depth = 1;
  options.qos.liveliness = RMW_QOS_POLICY_LIVELINESS_MANUAL_BY_TOPIC;
  options.qos.liveliness_lease_duration = (rmw_time_t) {LEASE_S, 0};
  memset(sign, 0, sizeof(*sign));
  sign->session = session;
  sign->publisher = rcl_get_zero_initialized_publisher();
  if (rcl_publisher_init(
      &sign->publisher, &session->node->node, ROSIDL_GET_MSG_TYPE_SUPPORT(std_msgs, msg, Header),
      "~/alive", &options) != RCL_RET_OK)
  {
    fm_log_failure(session->node, "cannot advertise ~/alive");
    return false;
  }
  publish(sign);
  return true;
}

// A thread may have had no time to turn, if this is called early after it was late. And if the
// whole process was stopped, this may be called before the threads turn: they get a second then.
static void suspect(struct fm_sign_of_life * sign)
{
  const int64_t now = fm_steady_now();
  if (now - sign->published < FM_SECOND) {
    return;
  }
  if (sign->suspected == 0) {
    sign->suspected = now;
  } else if (now - sign->suspected >= FM_SECOND && fm_passes(&sign->next_line, LOGGED_S)) {
    fm_log(sign->session->node, FM_ERROR,
      "a thread of the monitor hangs: no sign of life on ~/alive");
  }
}

void fm_sign_of_life_beat(struct fm_sign_of_life * sign)
{
  if (fm_session_turns(sign->session, sign->turns)) {
    publish(sign);
  } else {
    suspect(sign);
  }
}

void fm_sign_of_life_end(struct fm_sign_of_life * sign)
{
  if (sign->publisher.impl != NULL &&
    rcl_publisher_fini(&sign->publisher, &sign->session->node->node) != RCL_RET_OK)
  {
    rcl_reset_error();
  }
  memset(sign, 0, sizeof(*sign));
}
