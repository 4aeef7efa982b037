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

/// floor.c: the reference for a node that subscribes: a minimal subscriber in C on rcl.
///
///     floor --topics A,B [--type float32|cloud] [--depth N] [--reliability reliable|best_effort]
///           [--publish TOPIC] [--take no]
///
/// It waits with a wait set, for at most 200 ms, and takes one message of each topic that is
/// ready. With `--publish` it publishes a std_msgs/Empty for each message. With `--take no` it
/// only sleeps, which measures the middleware alone. On SIGINT or SIGTERM it prints the number of
/// messages taken.

#include <signal.h>

#include "node.h"

static volatile sig_atomic_t is_over;
static const char * handler;
static bool takes = true;

static void end(const int number)
{
  (void)number;
  is_over = 1;
}

static bool read_other(const char * const name, char * const value)
{
  if (strcmp(name, "--publish") == 0) {
    handler = value;
  } else if (strcmp(name, "--take") == 0) {
    takes = strcmp(value, "no") != 0;
  } else {
    return false;
  }
  return true;
}

/// Take a message if one is queued, and publish an answer unless `publisher` is NULL. Returns the
/// number of messages taken.
static uint64_t take(
  const rcl_subscription_t * const subscription, union message * const message,
  const rcl_publisher_t * const publisher)
{
  const std_msgs__msg__Empty empty = {0};
  rmw_message_info_t info;
  const rcl_ret_t result = rcl_take(subscription, message, &info, NULL);
  if (result == RCL_RET_SUBSCRIPTION_TAKE_FAILED) {
    rcl_reset_error();
    return 0u;
  }
  need(result, "take");
  if (publisher != NULL) {
    need(rcl_publish(publisher, &empty, NULL), "publish");
  }
  return 1u;
}

static uint64_t serve(
  struct node * const n, const struct topics * const topics,
  const rcl_subscription_t * const subscriptions, const rcl_publisher_t * const publisher)
{
  union message message;
  uint64_t taken = 0u;
  rcl_wait_set_t set = rcl_get_zero_initialized_wait_set();
  need(
    rcl_wait_set_init(
      &set, topics->count, 0, 0, 0, 0, 0, &n->context, rcl_get_default_allocator()), "wait set");
  memset(&message, 0, sizeof(message));
  while (!is_over) {
    need(rcl_wait_set_clear(&set), "clear");
    for (size_t i = 0u; i < topics->count; ++i) {
      need(rcl_wait_set_add_subscription(&set, &subscriptions[i], NULL), "add");
    }
    if (rcl_wait(&set, 200000000) != RCL_RET_OK) {
      rcl_reset_error();  // a timeout
      continue;
    }
    for (size_t i = 0u; i < topics->count; ++i) {
      if (set.subscriptions[i] != NULL) {
        taken += take(&subscriptions[i], &message, publisher);
      }
    }
  }
  need(rcl_wait_set_fini(&set), "end of the wait set");
  return taken;
}

int main(const int argc, char ** const argv)
{
  static struct node n;
  static struct topics topics;
  static rcl_subscription_t subscriptions[MOST_TOPICS];
  static rcl_publisher_t publisher;
  struct sigaction action;
  uint64_t taken = 0u;
  memset(&action, 0, sizeof(action));
  action.sa_handler = end;
  (void)sigaction(SIGINT, &action, NULL);
  (void)sigaction(SIGTERM, &action, NULL);
  read_options(&topics, argc, argv, read_other);
  open_node(&n, "subject");
  if (handler != NULL) {
    open_publisher(
      &publisher, &n, ROSIDL_GET_MSG_TYPE_SUPPORT(std_msgs, msg, Empty), handler,
      profile(1000u, false));
  }
  for (size_t i = 0u; i < topics.count; ++i) {
    open_subscription(
      &subscriptions[i], &n, type_of(topics.content), topics.names[i],
      profile(topics.depth, topics.is_best_effort));
  }
  if (takes) {
    taken = serve(&n, &topics, subscriptions, handler != NULL ? &publisher : NULL);
  } else {
    while (!is_over) {
      sleep_until(now() + SECOND / 5);
    }
  }
  printf("%" PRIu64 "\n", taken);
  for (size_t i = 0u; i < topics.count; ++i) {
    need(rcl_subscription_fini(&subscriptions[i], &n.node), "end of a subscription");
  }
  if (handler != NULL) {
    need(rcl_publisher_fini(&publisher, &n.node), "end of the publisher");
  }
  close_node(&n);
  return 0;
}
