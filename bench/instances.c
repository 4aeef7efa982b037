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

/// Messages a second of a bundle with `for_each`, beside the plain bundle of one key. Each message
/// has one number and the key of a random instance, among as many as are alive. The requirement
/// keeps one cell of state: a number was in range within the last 10 s. Prints one line a
/// configuration: the policy, the instances, millions of messages a second with keys and of the
/// plain evaluator (processor time, median of the rounds), the bytes of one instance, and how many
/// of them are outside its block: its key, its place in the table and in the heap, its turn, and
/// when its last message came (with `forget`).

#define _POSIX_C_SOURCE 200809L

#include "scopes_parts.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "draws.h"
#include "scheduling.h"

enum { MESSAGES = 1000000, ROUNDS = 5, KEY_BYTES = 14 };

static const int64_t SPACING = 1000;             // ns between messages
static const int64_t WINDOW = INT64_C(10000000000);

struct inputs
{
  double speed;
};

struct state
{
  int64_t last;   // the tick, or step, at which the number was in range last; -1: never
  int64_t steps;
  bool held;
};

static void start(void * state)
{
  const struct state first = {-1, 0, false};
  *(struct state *)state = first;
}

static void step(void * state, const void * inputs, bool * verdicts)
{
  struct state * cells = state;
  cells->last = ((const struct inputs *)inputs)->speed < 0.9 ? cells->steps : cells->last;
  verdicts[0] = cells->last >= 0 && cells->steps - cells->last <= 10;
  cells->steps += 1;
}

static int64_t step_at(void * state, const void * inputs, bool * verdicts, int64_t tick)
{
  struct state * cells = state;
  const bool holds = ((const struct inputs *)inputs)->speed < 0.9;
  cells->last = holds ? tick : cells->held ? tick - 1 : cells->last;
  cells->held = holds;
  verdicts[0] = cells->last >= 0 && tick - cells->last <= WINDOW;
  return verdicts[0] && !holds ? cells->last + WINDOW + 1 : FM_NEVER;
}

static const uint32_t FIRST[] = {0};
static const struct fm_input INPUTS[] = {{"speed", 0, FM_FLOAT64}};
static const struct fm_requirement REQUIREMENTS[] = {{"R", 0}};
static const struct fm_group GROUPS[] = {{FIRST, 1, FIRST, 1, start, step, NULL}};
static const struct fm_group TIMED_GROUPS[] = {{FIRST, 1, FIRST, 1, start, NULL, step_at}};
static const struct fm_topic TOPICS[] = {{FIRST, 1}};
static const struct fm_topic NO_INPUTS[] = {{NULL, 0}};
static const uint8_t CONCERNS[] = {FM_CONCERNS_KEY};
static const uint32_t NOT_SHARED[] = {UINT32_MAX};
static const uint8_t REPORTS[] = {FM_ONSET};

static struct fm_monitor monitor_of(bool is_timed)
{
  const struct fm_monitor monitor = {
    FM_ABI, 1, 1, 1, sizeof(struct state), sizeof(struct inputs), INPUTS,
    is_timed ? TIMED_GROUPS : GROUPS, REQUIREMENTS, "robot", "", NULL, NULL, 0, NULL};
  return monitor;
}

static double processor_seconds(void)
{
  struct timespec now;
  (void)clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return (double)now.tv_sec + (double)now.tv_nsec / 1e9;
}

// The key in each message, one message after another as they come.
static char (* keys)[KEY_BYTES + 4];

static void write_key(char * out, uint32_t k)
{
  (void)snprintf(out, sizeof keys[0], "robot_%08u", k);
}

static void make_messages(uint32_t n_keys)
{
  for (uint32_t m = 0; m < MESSAGES; ++m) {
    write_key(keys[m], random_below(n_keys));
  }
}

static union fm_value speed_of(uint32_t m)
{
  const union fm_value value = {.f = (double)(m % 64u) / 64.0};
  return value;
}

static int64_t give_keyed(struct fm_scopes * scopes, const char * key, uint32_t m, int64_t now)
{
  while (fm_scopes_wake(scopes) < now && fm_scopes_advance_to(scopes, now) != FM_NEVER) {
  }
  fm_scopes_begin(scopes, 0, now);
  (void)fm_scopes_enter(scopes, 0, key, KEY_BYTES);
  fm_scopes_store_keyed(scopes, 0, speed_of(m));
  return fm_scopes_end(scopes);
}

static void give_plain(struct fm_evaluator * evaluator, uint32_t m, int64_t now)
{
  while (fm_evaluator_wake(evaluator) < now) {
    (void)fm_evaluator_advance(evaluator, now - 1, NULL);
  }
  const int64_t at = fm_evaluator_arrival(evaluator, now);
  fm_evaluator_store(evaluator, 0, speed_of(m), at);
  (void)fm_evaluator_message(evaluator, 0, at, NULL);
}

static int compare(const void * a, const void * b)
{
  const double x = *(const double *)a, y = *(const double *)b;
  return x < y ? -1 : x > y ? 1 : 0;
}

// Messages a second: of the scopes, or of a plain evaluator.
static double rate(struct fm_scopes * scopes, struct fm_evaluator * plain, int64_t * now)
{
  const double begin = processor_seconds();
  for (uint32_t m = 0; m < MESSAGES; ++m) {
    *now += SPACING;
    if (scopes != NULL) {
      (void)give_keyed(scopes, keys[m], m, *now);
    } else {
      give_plain(plain, m, *now);
    }
  }
  return MESSAGES / (processor_seconds() - begin);
}

static int measure(bool is_timed, uint32_t n_keys)
{
  const struct fm_monitor monitor = monitor_of(is_timed);
  const uint32_t policy = is_timed ? FM_TIMED : FM_RELEVANT_MESSAGE;
  const struct fm_monitor empty = {
    FM_ABI, 0, 0, 0, 16, 0, NULL, NULL, NULL, "bundle", "", NULL, NULL, 0, NULL};
  const struct fm_evaluator_options bundle = {
    .monitor = &empty, .topics = NO_INPUTS, .n_topics = 1, .policy = policy};
  const struct fm_evaluator_options instance = {
    .monitor = &monitor, .topics = TOPICS, .n_topics = 1, .policy = policy, .reports = REPORTS};
  struct fm_kind kind = {0};
  kind.options = &instance;
  kind.concerns = CONCERNS;
  kind.keyed = TOPICS;
  kind.shared = NOT_SHARED;
  kind.most = n_keys;
  const struct fm_scopes_options options = {
    &bundle, &kind, 1, 0, NULL, NULL, NULL, NULL, 0};
  void * memory = calloc(1, (size_t)fm_scopes_bytes(&options));
  if (memory != NULL) {
    fm_use_large_pages(memory, fm_scopes_bytes(&options));
  }
  void * plain_memory = calloc(1, (size_t)fm_evaluator_bytes(&instance));
  struct fm_scopes * scopes = memory == NULL ? NULL : fm_scopes_init(memory, &options);
  struct fm_evaluator * plain =
    plain_memory == NULL ? NULL : fm_evaluator_init(plain_memory, &instance);
  double keyed_rates[ROUNDS], plain_rates[ROUNDS];
  int64_t keyed_now = 0, plain_now = 0;
  if (scopes == NULL || plain == NULL) {
    return 1;
  }
  make_messages(n_keys);
  (void)fm_scopes_advance(scopes, 0);
  (void)fm_evaluator_advance(plain, 0, NULL);
  for (uint32_t k = 0; k < n_keys; ++k) {
    char key[sizeof keys[0]];
    write_key(key, k);
    keyed_now += SPACING;
    (void)give_keyed(scopes, key, 0, keyed_now);
  }
  for (int round = 0; round < ROUNDS; ++round) {
    keyed_rates[round] = rate(scopes, NULL, &keyed_now);
    plain_rates[round] = rate(NULL, plain, &plain_now);
  }
  qsort(keyed_rates, ROUNDS, sizeof keyed_rates[0], compare);
  qsort(plain_rates, ROUNDS, sizeof plain_rates[0], compare);
  const struct fm_keys * table = scopes->kinds[0].pool.keys;
  const uint64_t bytes = fm_instance_bytes(&monitor, 0) + sizeof(struct fm_key_chunk) +
    table->n_entries * sizeof(struct fm_key_entry) / n_keys + fm_heap_bytes(n_keys) / n_keys +
    sizeof(uint16_t) + sizeof(int64_t);
  printf(
    "%s\t%u\t%.1f\t%.1f\t%llu\t%llu\n", is_timed ? "timed" : "relevant_message", n_keys,
    keyed_rates[ROUNDS / 2] / 1e6, plain_rates[ROUNDS / 2] / 1e6, (unsigned long long)bytes,
    (unsigned long long)(bytes - fm_instance_bytes(&monitor, 0)));
  free(memory);
  free(plain_memory);
  return 0;
}

int main(void)
{
  static const uint32_t N_KEYS[] = {25, 10000, 500000};
  int status = 0;
  keys = calloc(MESSAGES, sizeof *keys);
  for (uint32_t k = 0; k < 6 && keys != NULL; ++k) {
    status |= measure(k >= 3, N_KEYS[k % 3]);
  }
  free(keys);
  return status;
}
