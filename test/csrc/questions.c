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

/// Questions to a node that was killed: asked again, at once when another of its name comes.

#define _POSIX_C_SOURCE 200809L

#include "graph.h"

#include <stddef.h>
#include <string.h>
#include <time.h>

#include "check.h"
#include "engines.h"
#include "fakes.h"
#include "seen.h"

#define SECOND INT64_C(1000000000)

// ---- looks at the graph take no processor time, so that the next one may follow soon -----------

int __real_clock_gettime(clockid_t clock, struct timespec * out);
int __wrap_clock_gettime(clockid_t clock, struct timespec * out);

int __wrap_clock_gettime(clockid_t clock, struct timespec * out)
{
  const int result = __real_clock_gettime(clock, out);
  if (clock == CLOCK_THREAD_CPUTIME_ID) {
    memset(out, 0, sizeof(*out));
  }
  return result;
}

// ---- types: an empty request, and a response with the message current_state --------------------

struct state
{
  uint8_t id;
};

static void make_message(void * message, int initialization)
{
  (void)message;
  (void)initialization;
}

static void free_message(void * message) {(void)message;}

static const struct fm_type_support * itself(
  const struct fm_type_support * support, const char * identifier)
{
  (void)identifier;
  return support;
}

#define TYPE(members) {.func = itself, .data = (const void *)&(members)}

static const struct fm_message_member state_members[] = {
  {.name = "id", .type_id = FM_UINT8_FIELD, .offset = offsetof(struct state, id)}};
static const struct fm_message_members state_type = {
  .member_count = 1, .size = sizeof(struct state), .members = state_members,
  .init = make_message, .fini = free_message};
static const struct fm_type_support state_support = TYPE(state_type);
static const struct fm_message_member response_members[] = {
  {.name = "current_state", .type_id = FM_MESSAGE_FIELD, .members = &state_support}};
static const struct fm_message_members response_type = {
  .member_count = 1, .size = sizeof(struct state), .members = response_members,
  .init = make_message, .fini = free_message};
static const struct fm_message_members request_type = {
  .size = 1, .init = make_message, .fini = free_message};
static const struct fm_type_support request_support = TYPE(request_type);
static const struct fm_type_support response_support = TYPE(response_type);
static const struct fm_service_support service = {
  .request_typesupport = &request_support, .response_typesupport = &response_support};

// ---- a server that answers one request, and a graph with nodes of one name ---------------------

static int64_t sent;      // requests
static int64_t answered;  // the request that is answered next; 0: none
static size_t nodes;

static int is_available(const void * node, const void * client, bool * is_there)
{
  (void)node;
  (void)client;
  *is_there = true;
  return 0;
}

static int send_request(const void * client, const void * request, int64_t * sequence)
{
  (void)client;
  (void)request;
  *sequence = ++sent;
  return 0;
}

static int take(const void * client, struct fm_service_info * info, void * response, bool * taken)
{
  (void)client;
  *taken = answered != 0;
  info->sequence_number = answered;
  ((struct state *)response)->id = 3;
  answered = 0;
  return 0;
}

static const struct fm_service_functions services = {
  is_available, send_request, take, NULL, forget_error};

static int node_names(const void * node, struct fm_strings * names, struct fm_strings * namespaces)
{
  static char name[] = "arm";
  static char name_space[] = "/";
  static char * all_names[] = {name, name, name};
  static char * all_namespaces[] = {name_space, name_space, name_space};
  (void)node;
  names->data = all_names;
  namespaces->data = all_namespaces;
  names->size = namespaces->size = nodes;
  return 0;
}

static int free_strings(struct fm_strings * strings)
{
  (void)strings;
  return 0;
}

static const struct fm_graph_functions functions = {
  node_names, NULL, NULL, free_strings, forget_error, NULL, NULL};

// ---- an engine with one topic ------------------------------------------------------------------

static const struct fm_monitor monitor = {
  FM_ABI, 0, 0, 0, 8, 8, NULL, NULL, NULL, "m", "", NULL, NULL, 0, NULL};
static const struct fm_topic topics[] = {{NULL, 0}};

static bool read_message(const uint8_t * message, size_t size, struct fm_field * fields)
{
  (void)message;
  (void)fields;
  return size > 0;
}

static const struct fm_reader reader[] = {{.read = read_message, .n_inputs = 0}};
static const struct fm_readers readers = {FM_ABI, 1, reader};

static void test_questions(struct fm_engine * engine, struct fm_graph * graph)
{
  const uint32_t own = 0;
  nodes = 1;
  (void)fm_graph_review(graph, 0, true, &own);
  CHECK(sent == 1);

  // Killed, and the next one is there with a server of its own: the first question is abandoned.
  nodes = 2;
  (void)fm_graph_review(graph, SECOND / 2, true, &own);
  CHECK(sent == 2);
  answered = 1;
  (void)fm_graph_review(graph, SECOND / 2, false, &own);
  CHECK(!fm_engine_observed(engine, 0).has_value);

  // Its server was not known yet: asked again when the graph changes, and after a second.
  (void)fm_graph_review(graph, SECOND, true, &own);
  CHECK(sent == 3);
  (void)fm_graph_review(graph, 2 * SECOND - 1, false, &own);
  CHECK(sent == 3);
  (void)fm_graph_review(graph, 2 * SECOND, false, &own);
  CHECK(sent == 4 && fm_engine_observed(engine, 0).fault == FM_NO_FAULT);

  // A slow node's answer to any question about it counts, and is the only one.
  answered = 3;
  (void)fm_graph_review(graph, 2 * SECOND + 1, false, &own);
  CHECK(fm_engine_observed(engine, 0).has_value);
  (void)fm_graph_review(graph, 3 * SECOND, false, &own);
  CHECK(sent == 4);

  // Without any answer it is a fault after 5 s, and asked on.
  for (int64_t k = 16; k <= 46; ++k) {
    (void)fm_graph_review(graph, k * SECOND / 5, false, &own);
  }
  CHECK(sent == 11 && fm_engine_observed(engine, 0).fault == FM_NO_ANSWER);
}

// A node that comes and goes without an answer was there: its state is 0 then.
static void test_gone(struct fm_engine * engine, struct fm_graph * graph)
{
  const uint32_t own = 0;
  CHECK(!fm_engine_observed(engine, 0).was_there);
  nodes = 1;
  (void)fm_graph_review(graph, 0, true, &own);
  CHECK(fm_engine_observed(engine, 0).was_there && !fm_engine_observed(engine, 0).has_value);
  nodes = 0;
  (void)fm_graph_review(graph, SECOND / 2, true, &own);
  const struct fm_observed gone = fm_engine_observed(engine, 0);
  CHECK(gone.was_there && gone.has_value && gone.value == 0 && gone.fault == FM_NO_FAULT);
}

static void with_graph(void (* test)(struct fm_engine * engine, struct fm_graph * graph))
{
  static const struct fm_graph_source source = {0, FM_GRAPH_LIFECYCLE, "/arm", SECOND, ""};
  static const struct fm_service_client client = {NULL, NULL, &service, "/arm/get_state"};
  const struct fm_evaluator_options evaluator = {
    .monitor = &monitor, .topics = topics, .n_topics = 1, .policy = FM_EVERY_MESSAGE};
  struct fm_engine * engine = create_engine(&evaluator, &readers, -1);
  struct fm_graph * graph =
    fm_graph_create(engine, &functions, &services, NULL, &source, &client, 1, 0);
  test(engine, graph);
  fm_graph_destroy(graph);
  destroy_engine(engine);
}

int main(void)
{
  with_graph(test_questions);
  with_graph(test_gone);
  return failures != 0;
}
