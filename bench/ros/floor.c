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
///           [--publish TOPIC] [--relay TOPIC] [--take no|callback] [--after SECONDS]
///
/// It waits with a wait set, for at most 200 ms, and takes one message of each topic that is
/// ready. With `--take callback` it takes each message inside the middleware's callback instead.
/// With `--take no` it only sleeps, which measures the middleware alone. With `--publish` it
/// publishes a std_msgs/Empty for each message; with `--take callback` in the main thread, and
/// `--after` that long after the message was taken. With `--relay` it publishes each message as it
/// is, serialized, which is the reference for a gate. On SIGINT or SIGTERM it prints the number of
/// messages taken.

#include <pthread.h>
#include <signal.h>

#include "node.h"

static volatile sig_atomic_t is_over;
static const char * handler;
static bool relays;
static bool takes = true;
static bool takes_in_callback;
static int64_t after;  // ns

// Filled in the callback, emptied by the main thread.
enum {MOST_DUE = 4096};
static struct
{
  pthread_mutex_t mutex;
  pthread_cond_t is_filled;
  uint64_t taken;
  uint64_t answered;
  int64_t due[MOST_DUE];  // when to answer, a ring
} waiting = {.mutex = PTHREAD_MUTEX_INITIALIZER, .is_filled = PTHREAD_COND_INITIALIZER};

static void end(const int number)
{
  (void)number;
  is_over = 1;
}

static bool read_other(const char * const name, char * const value)
{
  if (strcmp(name, "--publish") == 0) {
    handler = value;
  } else if (strcmp(name, "--relay") == 0) {
    handler = value;
    relays = true;
  } else if (strcmp(name, "--take") == 0) {
    takes = strcmp(value, "no") != 0;
    takes_in_callback = strcmp(value, "callback") == 0;
  } else if (strcmp(name, "--after") == 0) {
    after = (int64_t)(strtod(value, NULL) * 1e9);
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

/// Take a message if one is queued, and publish it.
static uint64_t relay(
  const rcl_subscription_t * const subscription, rcl_serialized_message_t * const message,
  const rcl_publisher_t * const publisher)
{
  rmw_message_info_t info;
  const rcl_ret_t result = rcl_take_serialized_message(subscription, message, &info, NULL);
  if (result == RCL_RET_SUBSCRIPTION_TAKE_FAILED) {
    rcl_reset_error();
    return 0u;
  }
  need(result, "take");
  need(rcl_publish_serialized_message(publisher, message, NULL), "publish");
  return 1u;
}

static uint64_t serve(
  struct node * const n, const struct topics * const topics,
  const rcl_subscription_t * const subscriptions, const rcl_publisher_t * const publisher)
{
  union message message;
  rcl_serialized_message_t serialized = rmw_get_zero_initialized_serialized_message();
  uint64_t taken = 0u;
  rcl_wait_set_t set = rcl_get_zero_initialized_wait_set();
  need(
    rcl_wait_set_init(
      &set, topics->count, 0, 0, 0, 0, 0, &n->context, rcl_get_default_allocator()), "wait set");
  memset(&message, 0, sizeof(message));
  serialized.allocator = rcl_get_default_allocator();
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
        taken += relays ? relay(&subscriptions[i], &serialized, publisher) :
          take(&subscriptions[i], &message, publisher);
      }
    }
  }
  need(rcl_wait_set_fini(&set), "end of the wait set");
  if (serialized.buffer != NULL) {
    need(rmw_serialized_message_fini(&serialized), "end of the message");
  }
  return taken;
}

/// Called by the middleware: take `count` messages, and note when to answer them.
static void take_in_callback(const void * const user_data, const size_t count)
{
  static union message message;
  (void)pthread_mutex_lock(&waiting.mutex);
  for (size_t i = 0u; i < count; ++i) {
    if (take(user_data, &message, NULL) != 0u) {
      waiting.due[waiting.taken % MOST_DUE] = now() + after;
      waiting.taken += 1u;
    }
  }
  (void)pthread_cond_signal(&waiting.is_filled);
  (void)pthread_mutex_unlock(&waiting.mutex);
}

/// Wait for a message, for at most 200 ms; returns whether one is to be answered, and when.
static bool wait_for_message(int64_t * const due)
{
  struct timespec end;
  (void)clock_gettime(CLOCK_REALTIME, &end);
  end.tv_nsec += 200000000;
  end.tv_sec += end.tv_nsec / 1000000000;
  end.tv_nsec %= 1000000000;
  (void)pthread_mutex_lock(&waiting.mutex);
  if (waiting.answered == waiting.taken) {
    (void)pthread_cond_timedwait(&waiting.is_filled, &waiting.mutex, &end);
  }
  const bool is_due = waiting.answered < waiting.taken;
  *due = waiting.due[waiting.answered % MOST_DUE];
  waiting.answered += is_due ? 1u : 0u;
  (void)pthread_mutex_unlock(&waiting.mutex);
  return is_due;
}

static uint64_t serve_callbacks(
  const struct topics * const topics, rcl_subscription_t * const subscriptions,
  const rcl_publisher_t * const publisher)
{
  const std_msgs__msg__Empty empty = {0};
  int64_t due;
  for (size_t i = 0u; i < topics->count; ++i) {
    need(
      rcl_subscription_set_on_new_message_callback(
        &subscriptions[i], take_in_callback, &subscriptions[i]), "callback");
  }
  while (!is_over) {
    if (publisher == NULL) {
      sleep_until(now() + SECOND / 5);
    } else if (wait_for_message(&due)) {
      if (after > 0) {
        sleep_until(due);
      }
      need(rcl_publish(publisher, &empty, NULL), "publish");
    }
  }
  for (size_t i = 0u; i < topics->count; ++i) {
    need(
      rcl_subscription_set_on_new_message_callback(&subscriptions[i], NULL, NULL), "no callback");
  }
  return waiting.taken;
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
      &publisher, &n,
      relays ? type_of(topics.content) : ROSIDL_GET_MSG_TYPE_SUPPORT(std_msgs, msg, Empty),
      handler, profile(relays ? topics.depth : 1000u, false));
  }
  for (size_t i = 0u; i < topics.count; ++i) {
    open_subscription(
      &subscriptions[i], &n, type_of(topics.content), topics.names[i],
      profile(topics.depth, topics.is_best_effort));
  }
  if (takes_in_callback) {
    taken = serve_callbacks(&topics, subscriptions, handler != NULL ? &publisher : NULL);
  } else if (takes) {
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
