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

/// node.h: shared functions of the programs of bench/ros: a node on rcl, topics, a clock. On an
/// error they print the reason on standard error and exit with status 1, without freeing memory.

#ifndef NODE_H_
#define NODE_H_

#include <inttypes.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <rcl/error_handling.h>
#include <rcl/graph.h>
#include <rcl/rcl.h>
#include <rosidl_runtime_c/primitives_sequence_functions.h>
#include <rosidl_runtime_c/string_functions.h>
#include <sensor_msgs/msg/point_cloud2.h>
#include <std_msgs/msg/empty.h>
#include <std_msgs/msg/float32.h>

#define MOST_TOPICS 512
#define SECOND INT64_C(1000000000)

/// The content of a topic: a number of four bytes, or a point cloud of a megabyte.
enum content {FLOAT32, POINT_CLOUD};

struct topics
{
  const char * names[MOST_TOPICS];
  size_t count;
  enum content content;
  size_t depth;
  bool is_best_effort;
};

struct node
{
  rcl_context_t context;
  rcl_node_t node;
};

/// Room for a message of any kind.
union message
{
  std_msgs__msg__Empty empty;
  std_msgs__msg__Float32 number;
  sensor_msgs__msg__PointCloud2 cloud;
};

static inline void fail(const char * const what)
{
  fprintf(stderr, "%s: %s\n", what, rcl_get_error_string().str);
  exit(1);
}

static inline void need(const rcl_ret_t result, const char * const what)
{
  if (result != RCL_RET_OK) {
    fail(what);
  }
}

/// The time in nanoseconds, of a clock that all processes of the machine share.
static inline int64_t now(void)
{
  struct timespec time;
  (void)clock_gettime(CLOCK_MONOTONIC, &time);
  return (int64_t)time.tv_sec * SECOND + time.tv_nsec;
}

static inline void sleep_until(const int64_t moment)
{
  const struct timespec time = {(time_t)(moment / SECOND), (long)(moment % SECOND)};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &time, NULL) != 0) {}
}

static inline void open_node(struct node * const n, const char * const name)
{
  rcl_init_options_t options = rcl_get_zero_initialized_init_options();
  need(rcl_init_options_init(&options, rcl_get_default_allocator()), "options");
  n->context = rcl_get_zero_initialized_context();
  need(rcl_init(0, NULL, &options, &n->context), "rcl_init");
  n->node = rcl_get_zero_initialized_node();
  rcl_node_options_t node_options = rcl_node_get_default_options();
  node_options.enable_rosout = false;
  need(rcl_node_init(&n->node, name, "", &n->context, &node_options), "node");
}

static inline void close_node(struct node * const n)
{
  need(rcl_node_fini(&n->node), "end of the node");
  need(rcl_shutdown(&n->context), "shutdown");
  need(rcl_context_fini(&n->context), "end of the context");
}

static inline rmw_qos_profile_t profile(const size_t depth, const bool is_best_effort)
{
  rmw_qos_profile_t qos = rmw_qos_profile_default;  // reliable, volatile, keeps the last
  qos.depth = depth;
  if (is_best_effort) {
    qos.reliability = RMW_QOS_POLICY_RELIABILITY_BEST_EFFORT;
  }
  return qos;
}

static inline const rosidl_message_type_support_t * type_of(const enum content content)
{
  return content == FLOAT32 ?
         ROSIDL_GET_MSG_TYPE_SUPPORT(std_msgs, msg, Float32) :
         ROSIDL_GET_MSG_TYPE_SUPPORT(sensor_msgs, msg, PointCloud2);
}

static inline void open_subscription(
  rcl_subscription_t * const subscription, const struct node * const n,
  const rosidl_message_type_support_t * const type, const char * const topic,
  const rmw_qos_profile_t qos)
{
  rcl_subscription_options_t options = rcl_subscription_get_default_options();
  options.qos = qos;
  *subscription = rcl_get_zero_initialized_subscription();
  need(rcl_subscription_init(subscription, &n->node, type, topic, &options), topic);
}

static inline void open_publisher(
  rcl_publisher_t * const publisher, const struct node * const n,
  const rosidl_message_type_support_t * const type, const char * const topic,
  const rmw_qos_profile_t qos)
{
  rcl_publisher_options_t options = rcl_publisher_get_default_options();
  options.qos = qos;
  *publisher = rcl_get_zero_initialized_publisher();
  need(rcl_publisher_init(publisher, &n->node, type, topic, &options), topic);
}

/// Split `list` at its commas, in place.
static inline void read_topics(struct topics * const topics, char * const list)
{
  for (char * name = strtok(list, ","); name != NULL; name = strtok(NULL, ",")) {
    if (topics->count == MOST_TOPICS) {
      fprintf(stderr, "more than %d topics\n", MOST_TOPICS);
      exit(1);
    }
    topics->names[topics->count++] = name;
  }
}

/// Read `--topics A,B --type float32|cloud --depth N --reliability reliable|best_effort`, and pass
/// all other options to `other`, which returns false for an unknown option.
static inline void read_options(
  struct topics * const topics, const int argc, char ** const argv,
  bool (* const other)(const char * name, char * value))
{
  *topics = (struct topics){.content = FLOAT32, .depth = 100u};
  for (int place = 1; place + 1 < argc; place += 2) {
    const char * const name = argv[place];
    char * const value = argv[place + 1];
    if (strcmp(name, "--topics") == 0) {
      read_topics(topics, value);
    } else if (strcmp(name, "--type") == 0) {
      topics->content = strcmp(value, "cloud") == 0 ? POINT_CLOUD : FLOAT32;
    } else if (strcmp(name, "--depth") == 0) {
      topics->depth = strtoul(value, NULL, 10);
    } else if (strcmp(name, "--reliability") == 0) {
      topics->is_best_effort = strcmp(value, "best_effort") == 0;
    } else if (!other(name, value)) {
      fprintf(stderr, "no option %s\n", name);
      exit(1);
    }
  }
  if (topics->count == 0u) {
    fprintf(stderr, "no --topics\n");
    exit(1);
  }
}

#endif  // NODE_H_
