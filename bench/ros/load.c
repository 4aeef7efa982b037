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

/// load.c: publishes messages to a subject, and measures the subject's answers.
///
///     load --topics A,B [--type float32|cloud] [--depth N] [--reliability reliable|best_effort]
///          [--bytes N] [--echo TOPIC] [--relayed TOPIC] [--values FILE]
///
/// Messages are published on the topics in turn. With `--echo` it subscribes to a topic of
/// std_msgs/Empty, on which the subject answers each message in order. A latency is the time from
/// just before a publish to just after the take of its answer, so that one clock of one process
/// measures both. With `--relayed` the answers have the type of the messages. It reads commands
/// from standard input, one a line, and answers each with a line:
///
///     match       wait until each topic has had exactly one subscription, with the offered
///                 reliability, for half a second (a monitor may replace a subscription)
///     send N R    publish N messages, R a second (0: without a pause), at fixed times, also when
///                 earlier messages were late; prints the number sent, seconds, answers, and the
///                 median and the 99th percentile of the latency in nanoseconds
///     tell KEY    print the numbers for that key in /diagnostics, once they are stable:
///                 NAME=VALUE for each status that has the key, separated by tabs
///     stream N B  publish the next N messages of `--values` on the first topic, as fast as
///                 possible, and check the number of answers after every B messages; prints the
///                 number of messages sent since the start. FILE has a line for each message: its
///                 value, and whether an answer is expected (0 or 1) in the first pass through the
///                 file, and in each later pass
///     appear      wait for subscriptions; prints the times, on the shared clock, when one
///                 topic and all topics had one
///     step        publish on the first topic, a message a millisecond, until an answer arrives;
///                 prints the time

#include <diagnostic_msgs/msg/diagnostic_array.h>

#include "node.h"

#define PATIENCE (30 * SECOND)
#define MOST_MESSAGES 1000000u
#define MOST_ROWS 100000u

static struct node n;
static struct topics topics;
static rcl_publisher_t publishers[MOST_TOPICS];
static union message message;
static rcl_subscription_t answers;
static rcl_wait_set_t answer_set;
static const char * echo;
static bool is_relayed;  // the answers have the type of the messages
static size_t cloud_bytes = 1000000u;
static int64_t moments[MOST_MESSAGES];  // the time of publishing; after the answer, the latency
static size_t n_sent;
static size_t n_heard;

static void read_values(const char * path);

static bool read_other(const char * const name, char * const value)
{
  if (strcmp(name, "--echo") == 0) {
    echo = value;
  } else if (strcmp(name, "--relayed") == 0) {
    echo = value;
    is_relayed = true;
  } else if (strcmp(name, "--bytes") == 0) {
    cloud_bytes = strtoul(value, NULL, 10);
  } else if (strcmp(name, "--values") == 0) {
    read_values(value);
  } else {
    return false;
  }
  return true;
}

static void refuse(const char * const what)
{
  fprintf(stderr, "%s\n", what);
  exit(1);
}

static void fill_message(void)
{
  if (topics.content == FLOAT32) {
    message.number.data = 4.0f;
    return;
  }
  sensor_msgs__msg__PointCloud2 * const cloud = &message.cloud;
  if (!sensor_msgs__msg__PointCloud2__init(cloud) ||
    !rosidl_runtime_c__String__assign(&cloud->header.frame_id, "base_link") ||
    !rosidl_runtime_c__uint8__Sequence__init(&cloud->data, cloud_bytes))
  {
    refuse("no memory");
  }
  cloud->header.stamp.sec = 1;
  cloud->point_step = 16u;
  cloud->height = 1u;
  cloud->width = (uint32_t)(cloud_bytes / 16u);
  cloud->row_step = (uint32_t)cloud_bytes;
}

static void publish(const size_t topic)
{
  need(rcl_publish(&publishers[topic], &message, NULL), "publish");
}

// -- subscriptions ------------------------------------------------------------------------------

/// Whether a topic has exactly one subscription, with the offered reliability, and the publisher
/// is matched with it.
static bool is_matched(const size_t topic)
{
  size_t matched = 0u;
  size_t fitting = 0u;
  char name[256];
  rcl_allocator_t allocator = rcl_get_default_allocator();
  rcl_topic_endpoint_info_array_t found = rcl_get_zero_initialized_topic_endpoint_info_array();
  need(rcl_publisher_get_subscription_count(&publishers[topic], &matched), "count");
  (void)snprintf(name, sizeof(name), "%s", rcl_publisher_get_topic_name(&publishers[topic]));
  need(
    rcl_get_subscriptions_info_by_topic(&n.node, &allocator, name, false, &found),
    "subscriptions");
  for (size_t i = 0u; i < found.size; ++i) {
    const bool is_best_effort = found.info_array[i].qos_profile.reliability ==
      RMW_QOS_POLICY_RELIABILITY_BEST_EFFORT;
    fitting += is_best_effort == topics.is_best_effort ? 1u : 0u;
  }
  const bool is_one = matched == 1u && fitting == 1u && found.size == 1u;
  need(rcl_topic_endpoint_info_array_fini(&found, &allocator), "end of subscriptions");
  return is_one;
}

static bool are_matched(void)
{
  for (size_t topic = 0u; topic < topics.count; ++topic) {
    if (!is_matched(topic)) {
      return false;
    }
  }
  size_t handlers = 1u;
  if (echo != NULL) {
    need(rcl_subscription_get_publisher_count(&answers, &handlers), "count of handlers");
  }
  return handlers == 1u;
}

static void match(void)
{
  const int64_t begin = now();
  int64_t since = begin;
  while (now() - since < SECOND / 2) {
    sleep_until(now() + SECOND / 50);
    if (!are_matched()) {
      since = now();
    }
    if (now() - begin > PATIENCE) {
      refuse("no subscription, another QoS than offered, or more than one subscription");
    }
  }
  printf("matched\n");
}

/// Wait until `wanted` topics have a subscription; returns that time.
static int64_t wait_for_subscriptions(const size_t wanted, const int64_t begin)
{
  size_t heard = 0u;
  while (heard < wanted) {
    sleep_until(now() + SECOND / 1000);
    heard = 0u;
    for (size_t topic = 0u; topic < topics.count; ++topic) {
      size_t count = 0u;
      need(
        rcl_count_subscribers(
          &n.node, rcl_publisher_get_topic_name(&publishers[topic]), &count), "count");
      heard += count != 0u ? 1u : 0u;
    }
    if (now() - begin > PATIENCE) {
      refuse("no subscription");
    }
  }
  return now();
}

static void appear(void)
{
  const int64_t begin = now();
  const int64_t first = wait_for_subscriptions(1u, begin);
  printf("%" PRId64 " %" PRId64 "\n", first, wait_for_subscriptions(topics.count, begin));
}

// -- messages and their answers -----------------------------------------------------------------

/// Wait for an answer, until `moment` at most, and store the latency of each that has arrived.
static void listen_until(const int64_t moment)
{
  static union message answer;
  rmw_message_info_t info;
  const int64_t left = moment - now();
  need(rcl_wait_set_clear(&answer_set), "clear");
  need(rcl_wait_set_add_subscription(&answer_set, &answers, NULL), "add");
  if (rcl_wait(&answer_set, left > 0 ? left : 0) != RCL_RET_OK) {
    rcl_reset_error();  // a timeout
    return;
  }
  while (rcl_take(&answers, &answer, &info, NULL) == RCL_RET_OK) {
    if (n_heard < n_sent) {
      moments[n_heard] = now() - moments[n_heard];
    }
    ++n_heard;
  }
  rcl_reset_error();
}

static void pause_until(const int64_t moment)
{
  if (echo == NULL) {
    sleep_until(moment);
    return;
  }
  do {
    listen_until(moment);
  } while (now() < moment);
}

static int compare(const void * const one, const void * const other)
{
  const int64_t a = *(const int64_t *)one;
  const int64_t b = *(const int64_t *)other;
  return (a > b) - (a < b);
}

static void send(const size_t count, const double rate)
{
  if (echo != NULL) {
    listen_until(now());  // what was answered before is not counted
  }
  const int64_t begin = now();
  n_sent = 0u;
  n_heard = 0u;
  for (size_t i = 0u; i < count; ++i) {
    if (rate > 0.0) {
      pause_until(begin + (int64_t)((double)i / rate * 1e9));
    }
    moments[i] = now();
    ++n_sent;
    publish(i % topics.count);
  }
  const int64_t end = now();
  while (echo != NULL && n_heard < n_sent && now() - end < 2 * SECOND) {
    listen_until(now() + SECOND / 10);
  }
  const size_t timed = n_heard < n_sent ? n_heard : n_sent;
  qsort(moments, timed, sizeof(moments[0]), compare);
  printf(
    "%zu %.9f %zu %" PRId64 " %" PRId64 "\n", n_sent, (double)(end - begin) / 1e9, n_heard,
    timed == 0u ? INT64_C(0) : moments[timed / 2u],
    timed == 0u ? INT64_C(0) : moments[timed * 99u / 100u]);
}

static void step(void)
{
  if (echo != NULL) {
    listen_until(now());  // what was answered before is not counted
  }
  const int64_t begin = now();
  n_sent = 0u;
  n_heard = 0u;
  while (n_heard == 0u) {
    publish(0u);
    listen_until(now() + SECOND / 1000);
    if (now() - begin > PATIENCE) {
      refuse("no answer");
    }
  }
  printf("%" PRId64 "\n", now());
}

// -- a stream with known answers -----------------------------------------------------------------

struct row
{
  float value;
  int is_due[2];  // in the first pass; in later passes
};

static struct row rows[MOST_ROWS];
static size_t n_rows;
static uint64_t n_streamed;
static uint64_t n_due;
static uint64_t n_answered;

static void read_values(const char * const path)
{
  FILE * const file = fopen(path, "r");
  if (file == NULL) {
    refuse("the values cannot be read");
  }
  struct row * row = rows;
  while (n_rows < MOST_ROWS &&
    fscanf(file, "%f %d %d", &row->value, &row->is_due[0], &row->is_due[1]) == 3)
  {
    ++n_rows;
    ++row;
  }
  (void)fclose(file);
}

static void hear_until(const int64_t moment)
{
  n_sent = 0u;  // no latency is measured
  n_heard = 0u;
  listen_until(moment);
  n_answered += n_heard;
}

/// Wait until all expected answers have arrived. An answer too many is found here or in the next
/// call.
static void settle(void)
{
  const int64_t begin = now();
  do {
    hear_until(n_answered < n_due ? now() + SECOND / 10 : 0);
  } while (n_answered < n_due && now() - begin < PATIENCE);
  if (n_answered != n_due) {
    fprintf(
      stderr, "after %" PRIu64 " messages %" PRIu64 " answers in place of %" PRIu64 "\n",
      n_streamed, n_answered, n_due);
    exit(1);
  }
}

static void stream(const size_t count, const size_t batch)
{
  for (size_t i = 0u; i < count; ++i) {
    const struct row * const row = &rows[n_streamed % n_rows];
    n_due += row->is_due[n_streamed < n_rows ? 0 : 1] != 0 ? 1u : 0u;
    message.number.data = row->value;
    publish(0u);
    ++n_streamed;
    if (n_streamed % batch == 0u) {
      settle();
    }
  }
  settle();
  hear_until(now() + SECOND / 10);
  settle();
  printf("%" PRIu64 "\n", n_streamed);
}

// -- counts that the subject publishes -----------------------------------------------------------

/// Write the values of an array for a key; write nothing if another node published the array.
static void read_array(
  const diagnostic_msgs__msg__DiagnosticArray * const array, const char * const key,
  char * const text, const size_t size)
{
  size_t used = 0u;
  text[0] = '\0';
  for (size_t i = 0u; i < array->status.size; ++i) {
    const diagnostic_msgs__msg__DiagnosticStatus * const status = &array->status.data[i];
    for (size_t k = 0u; k < status->values.size && used < size; ++k) {
      if (strcmp(status->values.data[k].key.data, key) == 0) {
        used += (size_t)snprintf(
          text + used, size - used, "%s%s=%s", used == 0u ? "" : "\t", status->name.data,
          status->values.data[k].value.data);
      }
    }
  }
}

static void tell(const char * const key)
{
  static char text[1 << 16];
  static char last[1 << 16];
  rcl_subscription_t health;
  rcl_wait_set_t set = rcl_get_zero_initialized_wait_set();
  diagnostic_msgs__msg__DiagnosticArray array;
  rmw_message_info_t info;
  const int64_t begin = now();
  last[0] = '\0';
  open_subscription(
    &health, &n, ROSIDL_GET_MSG_TYPE_SUPPORT(diagnostic_msgs, msg, DiagnosticArray),
    "/diagnostics", profile(10u, false));
  need(
    rcl_wait_set_init(&set, 1, 0, 0, 0, 0, 0, &n.context, rcl_get_default_allocator()),
    "wait set");
  if (!diagnostic_msgs__msg__DiagnosticArray__init(&array)) {
    refuse("no memory");
  }
  for (;; ) {
    need(rcl_wait_set_clear(&set), "clear");
    need(rcl_wait_set_add_subscription(&set, &health, NULL), "add");
    text[0] = '\0';
    if (rcl_wait(&set, SECOND) == RCL_RET_OK &&
      rcl_take(&health, &array, &info, NULL) == RCL_RET_OK)
    {
      read_array(&array, key, text, sizeof(text));
    }
    rcl_reset_error();
    if (text[0] != '\0' && strcmp(text, last) == 0) {
      break;
    }
    if (text[0] != '\0') {
      memcpy(last, text, sizeof(text));
    }
    if (now() - begin > PATIENCE) {
      refuse("no diagnostics");
    }
  }
  need(rcl_wait_set_fini(&set), "end of the wait set");
  need(rcl_subscription_fini(&health, &n.node), "end of the diagnostics");
  diagnostic_msgs__msg__DiagnosticArray__fini(&array);
  printf("%s\n", text);
}

// -- commands -----------------------------------------------------------------------------------

static void obey(const char * const line)
{
  size_t count = 0u;
  size_t batch = 0u;
  double rate = 0.0;
  char key[80];
  if (strcmp(line, "match\n") == 0) {
    match();
  } else if (sscanf(line, "tell %79s", key) == 1) {
    tell(key);
  } else if (strcmp(line, "appear\n") == 0) {
    appear();
  } else if (strcmp(line, "step\n") == 0 && echo != NULL) {
    step();
  } else if (
    sscanf(line, "stream %zu %zu", &count, &batch) == 2 && batch != 0u && n_rows != 0u &&
    echo != NULL)
  {
    stream(count, batch);
  } else if (sscanf(line, "send %zu %lf", &count, &rate) == 2 && count <= MOST_MESSAGES) {
    send(count, rate);
  } else {
    refuse("no such command");
  }
  (void)fflush(stdout);
}

int main(const int argc, char ** const argv)
{
  char line[80];
  read_options(&topics, argc, argv, read_other);
  open_node(&n, "load");
  fill_message();
  for (size_t topic = 0u; topic < topics.count; ++topic) {
    open_publisher(
      &publishers[topic], &n, type_of(topics.content), topics.names[topic],
      profile(topics.depth, topics.is_best_effort));
  }
  if (echo != NULL) {
    open_subscription(
      &answers, &n,
      is_relayed ? type_of(topics.content) : ROSIDL_GET_MSG_TYPE_SUPPORT(std_msgs, msg, Empty),
      echo, profile(is_relayed ? topics.depth : 1000u, false));
    answer_set = rcl_get_zero_initialized_wait_set();
    need(
      rcl_wait_set_init(
        &answer_set, 1, 0, 0, 0, 0, 0, &n.context, rcl_get_default_allocator()), "wait set");
  }
  printf("ready\n");
  (void)fflush(stdout);
  while (fgets(line, (int)sizeof(line), stdin) != NULL) {
    obey(line);
  }
  for (size_t topic = 0u; topic < topics.count; ++topic) {
    need(rcl_publisher_fini(&publishers[topic], &n.node), "end of a publisher");
  }
  if (echo != NULL) {
    need(rcl_wait_set_fini(&answer_set), "end of the wait set");
    need(rcl_subscription_fini(&answers, &n.node), "end of the answers");
  }
  close_node(&n);
  return 0;
}
