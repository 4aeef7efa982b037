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

/// Parts of the exported node, on rcl: subscriptions that are replaced, and what is reported. The
/// linker wraps the clock, the log, and functions of rcl and the engine, so that the test decides
/// the time, what fails, and what is counted. `node_parts TEST ARGUMENT...` runs one test.

#define _POSIX_C_SOURCE 200809L

#include <pthread.h>
#include <rcl/error_handling.h>
#include <rcl_interfaces/msg/parameter.h>
#include <rcl_interfaces/srv/set_parameters_atomically.h>
#include <rmw/rmw.h>
#include <rosidl_runtime_c/string_functions.h>
#include <sensor_msgs/msg/temperature.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "check.h"
#include "monitor_node.h"
#include "overrides.h"
#include "seen.h"

enum { FIXED, HEAT };  // topics and inputs, in the order of the bundle

// ---- what the test decides ---------------------------------------------------------------------

static int64_t now = 1000 * FM_SECOND;
static bool fails_to_subscribe;
static bool fails_to_listen;
static bool keeps_callback;
static rmw_event_callback_t listener;  // the last callback for new messages
static uint32_t attempts;         // to subscribe
static double subscribing_s;      // how long each takes
static size_t n_matched;          // publishers
static bool is_matched_scripted;
static uint64_t announcer_turns;
static uint64_t detail_turns;
static uint32_t n_requests;       // that wait, whatever the service
static const char * wanted_level;  // NULL, or what the requests set `log_level` to
static bool is_set;               // by the last of them
static bool has_no_memory;        // for texts and lines
static bool fails_to_review;

static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static struct fm_text lines;      // of the log

int64_t __wrap_fm_steady_now(void);
int64_t __wrap_fm_steady_now(void)
{
  return __atomic_load_n(&now, __ATOMIC_RELAXED);
}

static void pass_seconds(double seconds)
{
  __atomic_fetch_add(&now, (int64_t)(seconds * 1e9), __ATOMIC_RELAXED);
}

void __wrap_fm_log(const struct fm_node * node, enum fm_level level, const char * format, ...)
FM_PRINTF(3, 4);
void __wrap_fm_log(const struct fm_node * node, enum fm_level level, const char * format, ...)
{
  static const char * const names[] = {"INFO ", "WARN ", "ERROR "};
  va_list arguments;
  (void)node;
  pthread_mutex_lock(&mutex);
  fm_text_add(&lines, "%s", names[level]);
  va_start(arguments, format);
  fm_text_add_arguments(&lines, format, arguments);
  va_end(arguments);
  fm_text_add(&lines, "\n");
  pthread_mutex_unlock(&mutex);
}

rcl_ret_t __real_rcl_subscription_init(
  rcl_subscription_t * subscription, const rcl_node_t * node,
  const rosidl_message_type_support_t * type, const char * topic,
  const rcl_subscription_options_t * options);
void __wrap_fm_log_lines(const struct fm_node * node, struct fm_lines * decided);
void __wrap_fm_log_lines(const struct fm_node * node, struct fm_lines * decided)
{
  for (uint32_t k = 0; k < decided->n; ++k) {
    __wrap_fm_log(node, (enum fm_level)decided->lines[k].level, "%s", decided->lines[k].text);
  }
  fm_lines_free(decided);
}

rcl_ret_t __wrap_rcl_subscription_init(
  rcl_subscription_t * subscription, const rcl_node_t * node,
  const rosidl_message_type_support_t * type, const char * topic,
  const rcl_subscription_options_t * options);
rcl_ret_t __wrap_rcl_subscription_init(
  rcl_subscription_t * subscription, const rcl_node_t * node,
  const rosidl_message_type_support_t * type, const char * topic,
  const rcl_subscription_options_t * options)
{
  attempts += 1;
  pass_seconds(subscribing_s);
  if (fails_to_subscribe) {
    rcutils_set_error_state("no room", "middleware.c", 1);
    return RCL_RET_ERROR;
  }
  return __real_rcl_subscription_init(subscription, node, type, topic, options);
}

rmw_ret_t __real_rmw_subscription_set_on_new_message_callback(
  rmw_subscription_t * subscription, rmw_event_callback_t callback, const void * user_data);
rmw_ret_t __wrap_rmw_subscription_set_on_new_message_callback(
  rmw_subscription_t * subscription, rmw_event_callback_t callback, const void * user_data);
rmw_ret_t __wrap_rmw_subscription_set_on_new_message_callback(
  rmw_subscription_t * subscription, rmw_event_callback_t callback, const void * user_data)
{
  listener = callback == NULL ? listener : callback;
  return (callback == NULL ? keeps_callback : fails_to_listen) ? RMW_RET_ERROR :
         __real_rmw_subscription_set_on_new_message_callback(subscription, callback, user_data);
}

rcl_ret_t __real_rcl_subscription_get_publisher_count(
  const rcl_subscription_t * subscription, size_t * n);
rcl_ret_t __wrap_rcl_subscription_get_publisher_count(
  const rcl_subscription_t * subscription, size_t * n);
rcl_ret_t __wrap_rcl_subscription_get_publisher_count(
  const rcl_subscription_t * subscription, size_t * n)
{
  const rcl_ret_t result = __real_rcl_subscription_get_publisher_count(subscription, n);
  *n = is_matched_scripted ? n_matched : *n;
  return result;
}

uint64_t __wrap_fm_announcer_turns(const struct fm_announcer * announcer);
uint64_t __wrap_fm_announcer_turns(const struct fm_announcer * announcer)
{
  (void)announcer;
  return announcer_turns;
}

uint64_t __wrap_fm_detail_thread_turns(const struct fm_detail_thread * thread);
uint64_t __wrap_fm_detail_thread_turns(const struct fm_detail_thread * thread)
{
  (void)thread;
  return detail_turns;
}

rcl_ret_t __wrap_rcl_take_request(
  const rcl_service_t * service, rmw_request_id_t * id, void * request);
rcl_ret_t __wrap_rcl_take_request(
  const rcl_service_t * service, rmw_request_id_t * id, void * request)
{
  rcl_interfaces__srv__SetParametersAtomically_Request * set = request;
  (void)service;
  memset(id, 0, sizeof(*id));
  if (n_requests == 0) {
    return RCL_RET_SERVICE_TAKE_FAILED;
  }
  n_requests -= 1u;
  if (wanted_level != NULL) {
    CHECK(rcl_interfaces__msg__Parameter__Sequence__init(&set->parameters, 1));
    rcl_interfaces__msg__Parameter * parameter = set->parameters.data;
    CHECK(rosidl_runtime_c__String__assign(&parameter->name, "log_level"));
    CHECK(rosidl_runtime_c__String__assign(&parameter->value.string_value, wanted_level));
    parameter->value.type = FM_WORD;
  }
  return RCL_RET_OK;
}

rcl_ret_t __wrap_rcl_send_response(
  const rcl_service_t * service, rmw_request_id_t * id, void * response);
rcl_ret_t __wrap_rcl_send_response(
  const rcl_service_t * service, rmw_request_id_t * id, void * response)
{
  (void)service;
  (void)id;
  if (wanted_level != NULL) {
    const rcl_interfaces__srv__SetParametersAtomically_Response * set = response;
    is_set = set->result.successful;
    CHECK(is_set == (set->result.reason.size == 0));
    return RCL_RET_OK;
  }
  rcutils_set_error_state("client will not receive response", "middleware.c", 1);
  return RCL_RET_TIMEOUT;
}

void __wrap_fm_log_failure(const struct fm_node * owner, const char * what);
void __wrap_fm_log_failure(const struct fm_node * owner, const char * what)
{
  __wrap_fm_log(owner, FM_ERROR, "%s: %s", what, rcl_error_is_set() ? "rcl" : FM_NO_MEMORY);
  rcl_reset_error();
}

struct fm_review * __real_fm_review_create(
  const struct fm_reporter * reporter, const struct fm_facts * facts);
struct fm_review * __wrap_fm_review_create(
  const struct fm_reporter * reporter, const struct fm_facts * facts);
struct fm_review * __wrap_fm_review_create(
  const struct fm_reporter * reporter, const struct fm_facts * facts)
{
  return fails_to_review ? NULL : __real_fm_review_create(reporter, facts);
}

void * __real_realloc(void * bytes, size_t size);
void * __wrap_realloc(void * bytes, size_t size);
void * __wrap_realloc(void * bytes, size_t size)
{
  return has_no_memory ? NULL : __real_realloc(bytes, size);
}

static struct fm_monitor_node node;

// ---- helpers -----------------------------------------------------------------------------------

// Compare the lines of the log since the last call.
static void expect_lines_at(int line, const char * wanted)
{
  pthread_mutex_lock(&mutex);
  if (strcmp(fm_text_get(&lines), wanted) != 0) {
    printf("line %d: logged:\n%swanted:\n%s", line, fm_text_get(&lines), wanted);
    failures += 1;
  }
  fm_text_clear(&lines);
  pthread_mutex_unlock(&mutex);
}

#define EXPECT_LINES(wanted) expect_lines_at(__LINE__, wanted)

static const rosidl_message_type_support_t * temperature(void)
{
  return ROSIDL_GET_MSG_TYPE_SUPPORT(sensor_msgs, msg, Temperature);
}

static rcl_publisher_t advertise(const rcl_node_t * owner, const char * topic, bool is_reliable)
{
  rcl_publisher_t publisher = rcl_get_zero_initialized_publisher();
  rcl_publisher_options_t options = rcl_publisher_get_default_options();
  options.qos.reliability = is_reliable ?
    RMW_QOS_POLICY_RELIABILITY_RELIABLE : RMW_QOS_POLICY_RELIABILITY_BEST_EFFORT;
  CHECK(rcl_publisher_init(&publisher, owner, temperature(), topic, &options) == RCL_RET_OK);
  return publisher;
}

static void withdraw(rcl_publisher_t * publisher)
{
  CHECK(rcl_publisher_fini(publisher, &node.node.node) == RCL_RET_OK);
}

static void review(void)
{
  fm_topic_review(&node.sessions[0].topics[HEAT]);
}

// Review four times a second, as the node does.
static void review_for(uint32_t seconds)
{
  for (uint32_t k = 0; k < 4u * seconds; ++k) {
    pass_seconds(0.25);
    review();
  }
}

static uint64_t received(void)
{
  return topic_counts_of(node.sessions[0].engine, HEAT).messages;
}

// Publish until a message is received.
static bool is_received(const rcl_publisher_t * publisher)
{
  const struct timespec pause = {0, 10000000};
  const uint64_t before = received();
  sensor_msgs__msg__Temperature message;
  (void)sensor_msgs__msg__Temperature__init(&message);
  for (int k = 0; k < 1000 && received() == before; ++k) {
    CHECK(rcl_publish(publisher, &message, NULL) == RCL_RET_OK);
    (void)nanosleep(&pause, NULL);
  }
  sensor_msgs__msg__Temperature__fini(&message);
  return received() > before;
}

// ---- subscriptions -----------------------------------------------------------------------------

static void a_subscription_that_cannot_be_replaced_goes_on_until_it_is(void)
{
  rcl_publisher_t reliable = advertise(&node.node.node, "heat", true);
  fails_to_subscribe = true;
  attempts = 0;
  review();
  EXPECT_LINES(
    "ERROR cannot subscribe anew to /heat (reliable, volatile): no room, at middleware.c:1; the "
    "subscription before is kept, and there are further attempts\n");
  review_for(4);
  CHECK(attempts == 3 && is_received(&reliable));  // after 1 and 2 s
  fails_to_subscribe = false;
  review_for(4);
  EXPECT_LINES(
    "INFO subscribed anew to /heat (reliable, volatile) as its publishers offer it\n");
  review_for(70);
  CHECK(attempts == 4 && is_received(&reliable));
  withdraw(&reliable);
}

static void a_subscription_without_a_callback_does_not_replace_the_one_before(void)
{
  rcl_publisher_t reliable = advertise(&node.node.node, "heat", true);
  struct fm_mapped_topic * topic = &node.sessions[0].topics[HEAT];
  fails_to_listen = true;
  review();
  EXPECT_LINES(
    "ERROR cannot subscribe anew to /heat (reliable, volatile): the middleware has no callback "
    "for new messages; the subscription before is kept, and there are further attempts\n");
  CHECK(topic->n_retired == 0 && topic->current.receiver != NULL);
  CHECK(is_received(&reliable));
  fails_to_listen = false;
  review_for(1);
  CHECK(topic->n_retired == 1);
  EXPECT_LINES(
    "INFO subscribed anew to /heat (reliable, volatile) as its publishers offer it\n");
  review_for(5);
  CHECK(topic->n_retired == 0 && is_received(&reliable));
  withdraw(&reliable);
}

static void the_old_subscription_stays_until_all_publishers_have_found_the_new_one(void)
{
  rcl_publisher_t first = advertise(&node.node.node, "heat", true);
  rcl_publisher_t second = advertise(&node.node.node, "heat", true);
  struct fm_mapped_topic * topic = &node.sessions[0].topics[HEAT];
  is_matched_scripted = true;
  n_matched = 2;
  review();
  CHECK(topic->n_retired == 1);
  pass_seconds(0.45);
  review();
  CHECK(topic->n_retired == 1);  // too early, even if all have found it
  n_matched = 1;
  pass_seconds(0.1);
  review();
  CHECK(topic->n_retired == 1);  // one has not
  n_matched = 2;
  review();
  CHECK(topic->n_retired == 0);
  withdraw(&first);
  withdraw(&second);
}

static void any_number_of_subscriptions_can_be_replaced_at_once(void)
{
  struct fm_mapped_topic * topic = &node.sessions[0].topics[HEAT];
  is_matched_scripted = true;
  for (uint32_t k = 1; k <= 10; ++k) {
    rcl_publisher_t publisher = advertise(&node.node.node, "heat", k % 2u == 1u);
    review();
    CHECK(topic->n_retired == k);
    withdraw(&publisher);
  }
  rcl_publisher_t publisher = advertise(&node.node.node, "heat", true);
  CHECK(is_received(&publisher));
  review_for(3);
  CHECK(topic->n_retired == 0 && is_received(&publisher));
  withdraw(&publisher);
}

// The callback, and what it uses, outlive the subscription and the session.
static void a_callback_that_cannot_be_removed_ends_no_monitoring(void)
{
  rcl_publisher_t publisher = advertise(&node.node.node, "heat", true);
  struct fm_mapped_topic * topic = &node.sessions[0].topics[HEAT];
  review();
  CHECK(topic->n_retired == 1);
  keeps_callback = true;
  review_for(5);
  CHECK(topic->n_retired == 0 && topic->is_leaked);
  keeps_callback = false;
  CHECK(is_received(&publisher));
  static const uint8_t transitions[] = {4, 2, 1, 3};  // deactivate, clean up, configure, activate
  for (size_t k = 0; k < sizeof(transitions); ++k) {
    CHECK(fm_lifecycle_change(&node.lifecycle, transitions[k]));
  }
  CHECK(is_received(&publisher));
  withdraw(&publisher);
}

// In the callback, or in the thread that it wakes.
static void a_parameter_decides_where_messages_are_taken(void)
{
  static const uint8_t transitions[] = {4, 2, 1, 3};
  const rmw_event_callback_t taking = listener;
  rcl_publisher_t publisher = advertise(&node.node.node, "heat", true);
  fm_parameter_value off;
  memset(&off, 0, sizeof(off));
  CHECK(rcl_interfaces__msg__ParameterValue__init(&off));
  off.type = FM_TRUTH;  // as YAML reads `off`
  CHECK(node.sessions[0].topics[HEAT].in_place != NULL);
  fm_parameter_set(&node.parameters, "hot_path", &off);
  for (size_t k = 0; k < sizeof(transitions); ++k) {
    CHECK(fm_lifecycle_change(&node.lifecycle, transitions[k]));
  }
  CHECK(node.sessions[0].topics[HEAT].in_place == NULL && listener != taking);
  CHECK(is_received(&publisher));
  rcl_interfaces__msg__ParameterValue__fini(&off);
  withdraw(&publisher);
}

static void publishers_are_reported_each_and_in_order(void)
{
  static const char * const namespaces[] = {"/b", "/a", ""};
  rcl_node_t nodes[3];
  rcl_publisher_t publishers[3];
  const rcl_node_options_t options = rcl_node_get_default_options();
  for (int k = 0; k < 3; ++k) {
    nodes[k] = rcl_get_zero_initialized_node();
    CHECK(rcl_node_init(
        &nodes[k], "cam", namespaces[k], &node.node.context, &options) == RCL_RET_OK);
    publishers[k] = advertise(&nodes[k], "/fixed", false);
  }
  fm_topic_review(&node.sessions[0].topics[FIXED]);
  CHECK(strcmp(fm_subscription_publishers(node.sessions[0].topics[FIXED].state).unmatched,
    "/a/cam, /b/cam, /cam") == 0);
  for (int k = 0; k < 3; ++k) {
    CHECK(rcl_publisher_fini(&publishers[k], &nodes[k]) == RCL_RET_OK);
    CHECK(rcl_node_fini(&nodes[k]) == RCL_RET_OK);
  }
}

// ---- reports -----------------------------------------------------------------------------------

static size_t depth_of(uint32_t topic)
{
  const struct fm_mapped_topic * found = &node.sessions[0].topics[topic];
  return rcl_subscription_get_options(&found->current.subscription)->qos.depth;
}

static void queues_are_as_long_as_the_bundle_says(void)
{
  CHECK(depth_of(FIXED) == 7);
  CHECK(depth_of(HEAT) == FM_USUAL_DEPTH);
}

static void reports_come_at_whole_seconds_after_the_start_however_long_it_takes(void)
{
  subscribing_s = 0.3;
  CHECK(fm_lifecycle_change(&node.lifecycle, 4) && fm_lifecycle_change(&node.lifecycle, 3));
  const int64_t start = now;
  CHECK(node.next_report == start + FM_SECOND);
  const struct {double at; int64_t next;} steps[] = {
    {0.999, 1}, {1.0, 2}, {2.25, 3}, {3.0, 4}, {7.5, 8}, {7.9, 8}, {8.01, 9}};
  for (size_t k = 0; k < sizeof(steps) / sizeof(steps[0]); ++k) {
    now = start + (int64_t)(steps[k].at * 1e9);
    CHECK(fm_monitor_node_spin_once(&node));
    CHECK(node.next_report == start + steps[k].next * FM_SECOND);
  }
}

static void a_missing_clock_is_logged_once(void)
{
  pass_seconds(6.0);
  fm_health_review(&node.healths[0]);
  CHECK(strstr(fm_text_get(&lines), "nothing received on /heat (0 publishers)") != NULL);
  fm_text_clear(&lines);
  CHECK(fm_clock_simulate(&node.clock, true));
  fm_health_review(&node.healths[0]);
  EXPECT_LINES("");
  for (int k = 0; k < 3; ++k) {
    pass_seconds(6.0);
    fm_health_review(&node.healths[0]);
    EXPECT_LINES(k > 0 ? "" : "WARN use_sim_time is set and nothing was received on /clock: no "
      "timeout passes\n");
  }
  CHECK(fm_clock_simulate(&node.clock, false));
}

static void a_thread_that_hangs_ends_the_signs_of_life(void)
{
  static const char * const hangs =
    "ERROR a thread of the monitor hangs: no sign of life on ~/alive\n";
  for (int thread = 0; thread < 2; ++thread) {
    announcer_turns += 10;
    detail_turns += 20;
    fm_sign_of_life_beat(&node.sign_of_life);
    for (int k = 0; k < 8; ++k) {
      pass_seconds(0.5);
      announcer_turns += thread == 0 ? 0u : 1u;
      detail_turns += thread == 0 ? 1u : 0u;
      fm_sign_of_life_beat(&node.sign_of_life);
      EXPECT_LINES(k == 3 ? hangs : "");
    }
    node.sign_of_life.state.next_line = 0;  // it follows the real clock
  }
}

static void a_response_that_cannot_be_sent_is_logged(void)
{
  const struct fm_offered * describes = &node.offered[FM_LIFECYCLE_SERVICES];
  n_requests = 2;
  describes->serve(&node.node, describes->service, describes->context);
  EXPECT_LINES(
    "WARN the response of /fret_monitor/describe_parameters is not sent: client will not receive "
    "response, at middleware.c:1\n"
    "WARN the response of /fret_monitor/describe_parameters is not sent: client will not receive "
    "response, at middleware.c:1\n");
  CHECK(!rcl_error_is_set());
}

static void a_text_that_was_freed_is_empty(void)
{
  struct fm_text text = {NULL, 0, 0};
  fm_text_add(&text, "one");
  fm_text_free(&text);
  CHECK(strcmp(fm_text_get(&text), "") == 0);
  fm_text_add(&text, "two");
  CHECK(strcmp(fm_text_get(&text), "two") == 0);
  fm_text_free(&text);
}

static const char * level(void)
{
  return fm_parameter_find(&node.parameters, "log_level")->value.string_value.data;
}

static bool sets_level(const char * wanted)
{
  const struct fm_offered * sets =
    &node.offered[FM_LIFECYCLE_SERVICES + FM_PARAMETER_SERVICES - 1];
  n_requests = 1;
  wanted_level = wanted;
  sets->serve(&node.node, sets->service, sets->context);
  wanted_level = NULL;
  return is_set;
}

static void what_is_wrong_is_refused_without_memory_for_its_words(void)
{
  const struct fm_given given = {
    .name = "qos_overrides./x.subscription.depth", .type = FM_WHOLE, .whole = 0};
  struct fm_lines found = {NULL, 0, 0};
  has_no_memory = true;
  CHECK(!fm_check_overrides(&found, &given, 1, NULL, 0) && found.n == 0);
  CHECK(!sets_level("loud") && strcmp(level(), "") == 0);
  has_no_memory = false;
  CHECK(!sets_level("loud") && sets_level("error") && strcmp(level(), "error") == 0);
}

static void a_transition_that_fails_without_memory_is_logged(void)
{
  CHECK(fm_lifecycle_change(&node.lifecycle, 4));
  fails_to_review = true;
  fm_text_clear(&lines);
  CHECK(!fm_lifecycle_change(&node.lifecycle, 3));
  EXPECT_LINES(
    "ERROR the node cannot be activated: memory is short\n"
    "ERROR nothing is monitored until the node is active again\n");
  fails_to_review = false;
  CHECK(fm_lifecycle_change(&node.lifecycle, 3));
}

int main(int argc, char ** argv)
{
  static const struct {const char * name; void (* run)(void);} tests[] = {
    {"retries", a_subscription_that_cannot_be_replaced_goes_on_until_it_is},
    {"callback", a_subscription_without_a_callback_does_not_replace_the_one_before},
    {"overlap", the_old_subscription_stays_until_all_publishers_have_found_the_new_one},
    {"many", any_number_of_subscriptions_can_be_replaced_at_once},
    {"leak", a_callback_that_cannot_be_removed_ends_no_monitoring},
    {"place", a_parameter_decides_where_messages_are_taken},
    {"order", publishers_are_reported_each_and_in_order},
    {"depth", queues_are_as_long_as_the_bundle_says},
    {"seconds", reports_come_at_whole_seconds_after_the_start_however_long_it_takes},
    {"clock", a_missing_clock_is_logged_once},
    {"life", a_thread_that_hangs_ends_the_signs_of_life},
    {"response", a_response_that_cannot_be_sent_is_logged},
    {"memory", what_is_wrong_is_refused_without_memory_for_its_words},
    {"silent", a_transition_that_fails_without_memory_is_logged},
    {"text", a_text_that_was_freed_is_empty},
  };
  const int status = fm_monitor_node_begin(
    &node, &fm_node_tables, argc - 1, (const char * const *)argv + 1);
  CHECK(status == 0 && node.sessions[0].is_active);
  bool is_found = false;
  for (size_t k = 0; status == 0 && k < sizeof(tests) / sizeof(tests[0]); ++k) {
    if (strcmp(argv[1], tests[k].name) == 0) {
      fm_text_clear(&lines);
      tests[k].run();
      is_found = true;
    }
  }
  CHECK(is_found);
  fm_monitor_node_end(&node);
  fm_text_free(&lines);
  return failures == 0 ? 0 : 1;
}
