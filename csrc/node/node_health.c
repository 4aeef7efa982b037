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

/// node_health.c: see node_health.h for the contract.

#include "node_health.h"

#include <diagnostic_msgs/msg/diagnostic_array.h>
#include <rmw/qos_profiles.h>
#include <rosidl_runtime_c/string_functions.h>
#include <std_msgs/msg/header.h>
#include <stdlib.h>
#include <string.h>

#include "endpoints.h"
#include "reports.h"
#include "rmw_functions.h"

// The black box of the facts is `written`.
static struct fm_facts facts_of(
  const struct fm_session * session, struct fm_blackbox_facts * written)
{
  const bool has_blackbox = session->blackbox.writer != NULL;
  if (has_blackbox) {
    *written = fm_blackbox_writer_facts(session->blackbox.writer);
  }
  return (struct fm_facts) {
    .now = fm_steady_now(), .actions = session->actions.counts,
    .blackbox = has_blackbox ? written : NULL};
}

bool fm_health_begin(struct fm_health * health, struct fm_session * session)
{
  struct fm_blackbox_facts written;
  const struct fm_facts facts = facts_of(session, &written);
  memset(health, 0, sizeof(*health));
  health->session = session;
  health->review = fm_review_create(&session->reporter, &facts);
  health->topics = calloc(session->n_topics + 1u, sizeof(*health->topics));
  return health->review != NULL && health->topics != NULL && fm_publisher_open(
    session->node, &health->publisher,
    ROSIDL_GET_MSG_TYPE_SUPPORT(diagnostic_msgs, msg, DiagnosticArray), "/diagnostics",
    &rmw_qos_profile_default);
}

void fm_health_end(struct fm_health * health)
{
  if (health->session != NULL) {
    fm_publisher_close(health->session->node, &health->publisher);
  }
  fm_review_destroy(health->review);
  free(health->topics);
  fm_statuses_free(&health->statuses);
  memset(health, 0, sizeof(*health));
}

static void look(struct fm_health * health)
{
  const struct fm_session * session = health->session;
  struct fm_blackbox_facts written;
  struct fm_facts facts = facts_of(session, &written);
  facts.topics = health->topics;
  facts.waits_for_clock = session->clock->is_simulated && fm_clock_now(session->clock) <= 0;
  if (session->gate.table != NULL) {
    health->gate = fm_node_gate_facts(&session->gate);
    facts.gate = &health->gate;
  }
  fm_session_publishers(session, health->topics);
  (void)fm_review_look(health->review, &facts);
}

void fm_health_review(struct fm_health * health)
{
  fm_node_actions_look(&health->session->actions);
  fm_service_gate_review(&health->session->gate.service);
  fm_node_blackbox_look(&health->session->blackbox);
  look(health);
  fm_review_log(health->review, &health->lines);
  fm_log_lines(health->session->node, &health->lines);
  if (fm_listeners(&health->publisher) > 0) {
    fm_review_report(health->review, &health->statuses);
    fm_publish_statuses(
      fm_node_middleware(), rcl_publisher_get_rmw_handle(&health->publisher), &health->statuses,
      fm_clock_now(health->session->clock));
    fm_statuses_clear(&health->statuses);
  }
}

// ---- the sign of life --------------------------------------------------------------------------

static void publish(struct fm_sign_of_life * sign)
{
  const struct fm_session * session = sign->sessions;
  const int64_t now = fm_clock_now(session->clock);
  std_msgs__msg__Header header;
  if (!std_msgs__msg__Header__init(&header)) {
    return;
  }
  header.stamp.sec = (int32_t)(now / FM_SECOND);
  header.stamp.nanosec = (uint32_t)(now % FM_SECOND);
  (void)rosidl_runtime_c__String__assign(
    &header.frame_id, rcl_node_get_name(&session->node->node));
  fm_ignore(rcl_publish(&sign->publisher, &header, NULL));
  std_msgs__msg__Header__fini(&header);
}

bool fm_sign_of_life_begin(
  struct fm_sign_of_life * sign, const struct fm_session * sessions, uint32_t n)
{
  rmw_qos_profile_t profile = rmw_qos_profile_default;
  profile.depth = 1;
  profile.liveliness = RMW_QOS_POLICY_LIVELINESS_MANUAL_BY_TOPIC;
  profile.liveliness_lease_duration = (rmw_time_t) {FM_SIGN_LEASE_S, 0};
  memset(sign, 0, sizeof(*sign));
  sign->sessions = sessions;
  sign->n = n;
  sign->state.published = fm_steady_now();
  sign->turns = calloc(2u * (size_t)n * FM_SESSION_THREADS, sizeof(*sign->turns));
  if (sign->turns == NULL || !fm_publisher_open(
      sessions->node, &sign->publisher, ROSIDL_GET_MSG_TYPE_SUPPORT(std_msgs, msg, Header),
      "~/alive", &profile))
  {
    return false;
  }
  publish(sign);
  return true;
}

void fm_sign_of_life_beat(struct fm_sign_of_life * sign)
{
  struct fm_lines lines = {NULL, 0, 0};
  uint64_t * now = sign->turns + (size_t)sign->n * FM_SESSION_THREADS;
  uint32_t n = 0;
  for (uint32_t k = 0; k < sign->n; ++k) {
    n += fm_session_turns(&sign->sessions[k], now + n);
  }
  if (fm_sign_is_due(&sign->state, sign->turns, now, n, fm_steady_now(), &lines)) {
    publish(sign);
  }
  fm_log_lines(sign->sessions->node, &lines);
}

void fm_sign_of_life_end(struct fm_sign_of_life * sign)
{
  if (sign->turns != NULL) {
    fm_publisher_close(sign->sessions->node, &sign->publisher);
  }
  free(sign->turns);
  memset(sign, 0, sizeof(*sign));
}
