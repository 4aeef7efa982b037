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

/// engine_instances.c: an engine with instances, whose time is told. Random messages: each
/// instance reports what a plain engine reports that is given the messages of its key. Then keys
/// that come and end, and messages that are none.

#define _POSIX_C_SOURCE 200809L

#include "engine.h"
#include "records.h"
#include "snapshot.h"

#include <stdio.h>
#include <stdlib.h>

#include "draws.h"
#include "scenarios.h"

enum { SHARED, PARTS, NAMED, N_TOPICS };      // an input of the bundle; elements; key in the name
enum { E, X, R, Y, P, A, N_INPUTS };         // inputs of the kind, on these topics
enum { N_KEYS = 4, CALLS = 400, RUNS = 150, MOST_FOUND = 4096, LONGEST = 64, WINDOW = 25 };
enum { UNRELATED = 77, UNUSABLE = 55 };       // values of NAMED

// ---- the monitors ------------------------------------------------------------------------------

struct values
{
  int64_t e, x;
  bool r;           // a message with x came
  int64_t y;
  double p, a;      // seconds between two messages with y, and from its stamp
};

struct group_state
{
  uint64_t steps;
  int64_t last;     // tick until which the value was good
  bool was_good;
};

static void reset_0(void * state)
{
  const struct group_state first = {0, -1, false};
  *(struct group_state *)state = first;
}

static void reset_1(void * state) {reset_0((struct group_state *)state + 1);}

static void step_0(void * state, const void * inputs, bool * verdicts)
{
  const struct values * values = inputs;
  struct group_state * group = state;
  verdicts[0] = values->e == 0 || values->x % 3 != 0;
  verdicts[1] = (values->x + (int64_t)group->steps + values->r) % 4 != 0;
  group->steps += 1;
}

static void step_1(void * state, const void * inputs, bool * verdicts)
{
  struct group_state * group = (struct group_state *)state + 1;
  const struct values * values = inputs;
  verdicts[2] = (values->y + (int64_t)group->steps) % 3 != 0 && values->p + values->a < 20e-9;
  group->steps += 1;
}

// Whether the value was good in the last WINDOW ticks.
static int64_t once_good(struct group_state * group, bool is_good, int64_t tick, bool * verdict)
{
  group->last = is_good ? tick : group->was_good ? tick - 1 : group->last;
  group->was_good = is_good;
  *verdict = group->last >= 0 && tick - group->last <= WINDOW;
  return *verdict && !is_good ? group->last + WINDOW + 1 : FM_NEVER;
}

static int64_t step_at_0(void * state, const void * inputs, bool * verdicts, int64_t tick)
{
  const struct values * values = inputs;
  verdicts[1] = (values->x + values->r) % 4 != 0;
  return once_good(state, values->e == 0 || values->x % 3 != 0, tick, &verdicts[0]);
}

static int64_t step_at_1(void * state, const void * inputs, bool * verdicts, int64_t tick)
{
  const struct values * values = inputs;
  const bool is_good = values->y % 3 != 0 && values->p + values->a < 20e-9;
  return once_good((struct group_state *)state + 1, is_good, tick, &verdicts[2]);
}

static const uint32_t NUMBERS[] = {0, 1, 2, 3, 4, 5};
static const struct fm_input inputs[] = {
  {"e", 0, FM_INT64}, {"x", 8, FM_INT64}, {"r", 16, FM_BOOL}, {"y", 24, FM_INT64},
  {"p", 32, FM_FLOAT64}, {"a", 40, FM_FLOAT64}};
static const uint8_t sources[] = {
  FM_FIELD, FM_FIELD, FM_RECEPTION, FM_FIELD, FM_PERIOD, FM_AGE};
static const struct fm_group groups[] = {
  {&NUMBERS[E], 3, &NUMBERS[0], 2, reset_0, step_0, step_at_0},
  {&NUMBERS[Y], 3, &NUMBERS[2], 1, reset_1, step_1, step_at_1}};
static const struct fm_requirement requirements[] = {{"A", 0}, {"B", 0}, {"C", 1}};
static const struct fm_monitor monitor = {
  FM_ABI, N_INPUTS, 2, 3, 2 * sizeof(struct group_state), sizeof(struct values), inputs, groups,
  requirements, "kind", "", NULL, NULL, 0, NULL};

// The bundle's scope: its requirement is violated where the shared input is 1.
static void reset_bundle(void * state) {(void)state;}

static void step_bundle(void * state, const void * values, bool * verdicts)
{
  (void)state;
  verdicts[0] = *(const int64_t *)values != 1;
}

static int64_t step_at_bundle(void * state, const void * values, bool * verdicts, int64_t tick)
{
  (void)tick;
  step_bundle(state, values, verdicts);
  return FM_NEVER;
}

static const struct fm_group bundle_group = {
  &NUMBERS[0], 1, &NUMBERS[0], 1, reset_bundle, step_bundle, step_at_bundle};
static const struct fm_requirement bundle_requirement = {"BUNDLE", 0};
static const struct fm_monitor bundle_monitor = {
  FM_ABI, 1, 1, 1, 8, 8, inputs, &bundle_group, &bundle_requirement, "bundle", "", NULL, NULL, 0,
  NULL};

static const struct fm_topic kind_topics[] = {
  {&NUMBERS[E], 1}, {&NUMBERS[X], 2}, {&NUMBERS[Y], 3}};
static const struct fm_topic keyed_topics[] = {{NULL, 0}, {&NUMBERS[X], 2}, {&NUMBERS[Y], 3}};
static const struct fm_topic bundle_topics[] = {{&NUMBERS[E], 1}, {NULL, 0}, {NULL, 0}};
static const uint8_t concerns[] = {FM_CONCERNS_ALL, FM_CONCERNS_KEY, FM_CONCERNS_KEY};
static const uint32_t shared[] = {
  0, UINT32_MAX, UINT32_MAX, UINT32_MAX, UINT32_MAX, UINT32_MAX};
static const uint8_t reports[] = {FM_EVERY_STEP, FM_ONSET, FM_OCCURRENCE};

// ---- messages ----------------------------------------------------------------------------------

// A stamp; then a value, or elements: a value, the size of a key, and its bytes.
struct message
{
  uint8_t bytes[8 + LONGEST * (2 + FM_MOST_KEY_BYTES)];
  size_t size;
};

static bool read_stamp(const uint8_t * message, size_t size, int64_t * stamp)
{
  if (size >= sizeof(*stamp)) {
    memcpy(stamp, message, sizeof(*stamp));
  }
  return size >= sizeof(*stamp);
}

static struct fm_field field_of(uint8_t value)
{
  const struct fm_field field = {
    {value}, value == UNUSABLE ? FM_FIELD_EMPTY : FM_FIELD_READ, 0};
  return field;
}

static bool read_value(const uint8_t * message, size_t size, struct fm_field * fields)
{
  if (size > 8) {
    fields[0] = field_of(message[8]);
  }
  return size > 8;
}

// With a measure and an age, whose field is the stamp.
static bool read_all(const uint8_t * message, size_t size, struct fm_field * fields)
{
  fields[1] = field_of(0);
  fields[2] = field_of(0);
  return read_value(message, size, fields) && read_stamp(message, size, &fields[2].value.i);
}

static bool read_nothing(const uint8_t * message, size_t size, struct fm_field * fields)
{
  (void)message;
  (void)fields;
  return size >= 8;
}

static bool read_parts(
  const uint8_t * message, size_t size, const uint8_t * key, size_t key_size, fm_part_sink sink,
  void * context)
{
  (void)key;
  (void)key_size;
  size_t place = 8;
  while (place < size) {
    if (size - place < 2 || size - place - 2 < message[place + 1]) {
      return false;
    }
    const struct fm_field fields[] = {field_of(message[place]), field_of(0)};
    if (sink != NULL) {
      sink(context, 0, message + place + 2, message[place + 1], fields);
    }
    place += 2u + message[place + 1];
  }
  return true;
}

static bool read_named(
  const uint8_t * message, size_t size, const uint8_t * key, size_t key_size, fm_part_sink sink,
  void * context)
{
  struct fm_field fields[3];
  const bool is_read = read_all(message, size, fields);
  if (is_read && sink != NULL) {
    sink(context, 0, key, key_size, fields);
  }
  return is_read;
}

static bool select_named(const uint8_t * message, size_t size, bool * is_selected)
{
  *is_selected = size > 8 && message[8] != UNRELATED;
  return size > 8;
}

static const struct fm_reader plain_reader[] = {
  {read_value, 1, read_stamp, NULL, NULL}, {read_value, 2, read_stamp, NULL, NULL},
  {read_all, 3, read_stamp, select_named, NULL}};
static const struct fm_readers plain_readers = {FM_ABI, N_TOPICS, plain_reader};
static const struct fm_reader reader[] = {
  {read_value, 1, read_stamp, NULL, NULL}, {read_nothing, 0, read_stamp, NULL, read_parts},
  {read_nothing, 0, read_stamp, select_named, read_named}};
static const struct fm_readers readers = {FM_ABI, N_TOPICS, reader};

static struct message begin_message(int64_t stamp)
{
  struct message message = {{0}, sizeof(stamp)};
  memcpy(message.bytes, &stamp, sizeof(stamp));
  return message;
}

static struct message with_value(int64_t stamp, uint8_t value)
{
  struct message message = begin_message(stamp);
  message.bytes[message.size++] = value;
  return message;
}

static void add_element(struct message * message, const struct fm_key * key, uint8_t value)
{
  message->bytes[message->size++] = value;
  message->bytes[message->size++] = (uint8_t)key->size;
  if (key->size > 0) {
    memcpy(message->bytes + message->size, key->bytes, key->size);
  }
  message->size += key->size;
}

// ---- engines -----------------------------------------------------------------------------------

static uint8_t long_key[FM_MOST_KEY_BYTES];
static const struct fm_key KEYS[] = {
  {(const uint8_t *)"alpha", 5}, {(const uint8_t *)"\xff\xfe", 2}, {long_key, FM_MOST_KEY_BYTES},
  {(const uint8_t *)"%s", 2}};

struct settings
{
  uint32_t policy;
  int64_t timeout;
  int64_t reorder;    // -1: stamps do not count
  int64_t forget;
  uint32_t n_listed;
  uint32_t most;
};

struct bench
{
  struct fm_engine * engine;
  struct fm_scopes * scopes;
  void * memory;
  struct fm_violation found[MOST_FOUND];
  uint8_t keys[MOST_FOUND * FM_KEY_ROOM];
  uint32_t n;
};

static struct fm_evaluator_options kind_options;
static int64_t timeouts[N_INPUTS];
static const bool violates[N_INPUTS] = {false, true, false, true, false, false};

static struct fm_evaluator_options options_of(
  const struct settings * settings, const struct fm_monitor * of, const struct fm_topic * topics,
  const uint8_t * all_reports)
{
  timeouts[X] = settings->timeout;
  timeouts[Y] = settings->timeout;
  return (struct fm_evaluator_options) {
           of, topics, N_TOPICS, settings->policy, all_reports,
           of == &monitor ? timeouts : NULL, of == &monitor ? violates : NULL,
           settings->policy == FM_PERIODIC ? 10 : 0, 0, of == &monitor ? sources : NULL, true,
           NULL, NULL, NULL, NULL, NULL};
}

static void * zeros(uint64_t bytes)
{
  void * memory = NULL;
  CHECK(bytes > 0 && posix_memalign(&memory, 16, (size_t)bytes) == 0);
  memset(memory, 0, (size_t)bytes);
  return memory;
}

static void make_engine(
  struct bench * bench, const struct settings * settings, struct fm_evaluator * evaluator,
  const struct fm_monitor * of, const struct fm_readers * reads, const struct fm_topic * topics)
{
  const struct fm_engine_options made = {
    evaluator, of, reads, topics, N_TOPICS, of == &monitor ? sources : NULL,
    settings->reorder >= 0,
    settings->reorder < 0 ? 0 : settings->reorder, true, bench->scopes};
  bench->engine = fm_engine_create(&made);
  CHECK(bench->engine != NULL);
  bench->n = 0;
}

static void make_plain(struct bench * bench, const struct settings * settings)
{
  const struct fm_evaluator_options options =
    options_of(settings, &monitor, kind_topics, reports);
  bench->memory = zeros(fm_evaluator_bytes(&options));
  bench->scopes = NULL;
  make_engine(
    bench, settings, fm_evaluator_init(bench->memory, &options), &monitor, &plain_readers,
    kind_topics);
}

static void make_scoped(struct bench * bench, const struct settings * settings)
{
  kind_options = options_of(settings, &monitor, kind_topics, reports);
  const struct fm_evaluator_options bundle =
    options_of(settings, &bundle_monitor, bundle_topics, NULL);
  const struct fm_kind kind = {
    &kind_options, NULL, concerns, keyed_topics, shared, NULL, 0, NULL, KEYS, settings->n_listed,
    settings->most, settings->forget};
  const struct fm_scopes_options options = {
    &bundle, &kind, 1, 0, NULL, NULL, NULL, NULL, 0};
  bench->memory = zeros(fm_scopes_bytes(&options));
  bench->scopes = fm_scopes_init(bench->memory, &options);
  CHECK(bench->scopes != NULL);
  make_engine(
    bench, settings, fm_scopes_bundle(bench->scopes), &bundle_monitor, &readers, bundle_topics);
}

static void end(struct bench * bench)
{
  fm_engine_destroy(bench->engine);
  free(bench->memory);
}

static uint32_t deliver(
  struct bench * bench, uint32_t topic, const struct message * message, int64_t received,
  const struct fm_key * key)
{
  const struct fm_origin origin = {
    received, 0, 0, NULL, false, key == NULL ? NULL : key->bytes, key == NULL ? 0 : key->size};
  return fm_engine_message(bench->engine, topic, message->bytes, message->size, &origin);
}

static void take(struct bench * bench)
{
  uint32_t n = 1;
  while (n > 0) {
    n = fm_engine_take_keyed(
      bench->engine, bench->found + bench->n, bench->keys + bench->n * FM_KEY_ROOM,
      MOST_FOUND - bench->n, 0);
    bench->n += n;
  }
}

static bool has_key(const struct bench * bench, uint32_t k, const struct fm_key * key)
{
  const uint8_t * kept = bench->keys + k * FM_KEY_ROOM;
  return kept[0] == key->size && memcmp(kept + 1, key->bytes, key->size) == 0;
}

// ---- instances and plain engines ---------------------------------------------------------------

static struct bench scoped, plain[N_KEYS];
static int64_t now;
static uint64_t n_compared;

static void advance_all(int64_t to)
{
  now = to;
  fm_engine_advance(scoped.engine, now);
  for (uint32_t k = 0; k < N_KEYS; ++k) {
    fm_engine_advance(plain[k].engine, now);
  }
}

static void give_shared(int64_t stamp)
{
  const struct message message = with_value(stamp, (uint8_t)random_below(2));
  CHECK(deliver(&scoped, SHARED, &message, now, NULL) == FM_RECEIVED);
  for (uint32_t k = 0; k < N_KEYS; ++k) {
    CHECK(deliver(&plain[k], SHARED, &message, now, NULL) == FM_RECEIVED);
  }
}

// Of two elements with one key the first counts. A key that is not listed is none.
static void give_parts(int64_t stamp)
{
  static const struct fm_key stranger = {(const uint8_t *)"stranger", 8};
  struct message message = begin_message(stamp);
  struct message of_key[N_KEYS];
  bool has[N_KEYS] = {false};
  const uint32_t n = random_below(6);
  for (uint32_t e = 0; e < n; ++e) {
    const uint32_t k = random_below(N_KEYS + 1);
    const uint8_t value = random_below(8) == 0 ? UNUSABLE : (uint8_t)random_below(12);
    add_element(&message, k < N_KEYS ? &KEYS[k] : &stranger, value);
    if (k < N_KEYS && !has[k]) {
      has[k] = true;
      of_key[k] = with_value(stamp, value);
    }
  }
  CHECK(deliver(&scoped, PARTS, &message, now, NULL) == FM_RECEIVED);
  for (uint32_t k = 0; k < N_KEYS; ++k) {
    if (has[k]) {
      CHECK(deliver(&plain[k], PARTS, &of_key[k], now, NULL) == FM_RECEIVED);
    }
  }
}

static void give_named(int64_t stamp)
{
  const uint32_t k = random_below(N_KEYS);
  const uint8_t value = random_below(5) == 0 ? UNRELATED : (uint8_t)random_below(12);
  const uint32_t receipt = value == UNRELATED ? FM_UNRELATED : FM_RECEIVED;
  const struct message message = with_value(stamp, value);
  CHECK(deliver(&scoped, NAMED, &message, now, &KEYS[k]) == receipt);
  CHECK(deliver(&plain[k], NAMED, &message, now, NULL) == receipt);
}

// Messages of one time move the plain engines by ns, and what is due until then is taken earlier.
static void settle(void)
{
  advance_all(now + 10);
}

static void reset_all(void)
{
  settle();
  fm_engine_reset(scoped.engine);
  for (uint32_t k = 0; k < N_KEYS; ++k) {
    fm_engine_reset(plain[k].engine);
  }
}

static void give_any(const struct settings * settings)
{
  const int64_t stamp = now - (int64_t)random_below(30);
  switch (random_below(12)) {
    case 0:
      reset_all();
      break;
    case 1:
      settle();
      if (settings->reorder < 0) {
        advance_all(now > 40 ? now - 30 : now);
      }
      break;
    case 2: case 3: case 4:
      give_shared(stamp);
      break;
    case 5: case 6: case 7: case 8:
      give_parts(stamp);
      break;
    default:
      give_named(stamp);
  }
}

static void compare(void)
{
  take(&scoped);
  for (uint32_t k = 0; k < N_KEYS; ++k) {
    uint32_t next = 0;
    take(&plain[k]);
    for (uint32_t n = 0; n < scoped.n; ++n) {
      const struct fm_violation * a = &scoped.found[n];
      const struct fm_violation * b = &plain[k].found[next];
      if (has_key(&scoped, n, &KEYS[k])) {
        CHECK(next < plain[k].n && a->requirement == b->requirement + 1 && a->stamp == b->stamp);
        CHECK(a->step == b->step && a->is_recovery == b->is_recovery && !a->is_end);
        next += 1;
      }
    }
    n_compared += next;
    CHECK(next == plain[k].n);
    plain[k].n = 0;
  }
  scoped.n = 0;
}

static void run_at_random(const struct settings * settings)
{
  make_scoped(&scoped, settings);
  for (uint32_t k = 0; k < N_KEYS; ++k) {
    make_plain(&plain[k], settings);
  }
  now = 0;
  for (uint32_t n = random_below(4); n > 0; --n) {
    give_named(0);  // before the time begins
    give_parts(0);
    give_shared(0);
  }
  advance_all(1);
  for (uint32_t n = 0; n < CALLS && failures == 0; ++n) {
    advance_all(now + (random_below(3) == 0 ? 0 : (int64_t)random_below(20)));
    give_any(settings);
    if (random_below(20) == 0) {
      settle();
      compare();
    }
  }
  advance_all(now + 1000);
  compare();
  CHECK(fm_scopes_counts(scoped.scopes, 0).beyond == 0);
  end(&scoped);
  for (uint32_t k = 0; k < N_KEYS; ++k) {
    end(&plain[k]);
  }
}

SCENARIO(an_instance_reports_what_a_plain_engine_does_with_the_messages_of_its_key)
{
  for (uint32_t n = 0; n < RUNS && failures == 0; ++n) {
    const uint32_t policy = n % 2 == 0 ? FM_TIMED : random_below(FM_TIMED);
    const struct settings settings = {
      policy, random_below(2) == 0 ? 0 : 15 + random_below(40),
      policy == FM_TIMED && random_below(2) == 0 ? (int64_t)random_below(20) : -1, 0, N_KEYS,
      N_KEYS};
    run_at_random(&settings);
  }
  CHECK(n_compared > 10000);
}

// ---- keys that come and end --------------------------------------------------------------------

static const struct settings FOUND = {FM_EVERY_MESSAGE, 0, -1, 100, 0, 2};

static struct fm_pool_counts counts_of(const struct bench * bench)
{
  return fm_scopes_counts(bench->scopes, 0);
}

static void give_element(
  struct bench * bench, const struct fm_key * key, uint8_t value, int64_t at)
{
  struct message message = begin_message(0);
  add_element(&message, key, value);
  CHECK(deliver(bench, PARTS, &message, at, NULL) == FM_RECEIVED);
}

static void begin_found(const struct settings * settings)
{
  make_scoped(&scoped, settings);
  fm_engine_advance(scoped.engine, 1);
  const struct message message = with_value(0, 1);
  CHECK(deliver(&scoped, SHARED, &message, 1, NULL) == FM_RECEIVED);
  take(&scoped);
  CHECK(scoped.n == 1 && scoped.found[0].requirement == 0 && scoped.keys[0] == 0);
  scoped.n = 0;
}

SCENARIO(an_instance_ends_after_its_last_message_and_its_violations_with_it)
{
  begin_found(&FOUND);
  give_element(&scoped, &KEYS[0], 3, 10);  // violates A
  give_element(&scoped, &KEYS[0], 3, 110);  // at the instant of the end: before it
  CHECK(counts_of(&scoped).ended == 0);
  fm_engine_advance(scoped.engine, 209);
  CHECK(counts_of(&scoped).alive == 1 && fm_engine_deadline(scoped.engine) == 210);
  fm_engine_advance(scoped.engine, 210);
  CHECK(counts_of(&scoped).alive == 0 && counts_of(&scoped).ended == 1);
  take(&scoped);
  CHECK(scoped.n == 7);  // A and the bundle's twice, B and its recovery, and the end of A
  for (uint32_t n = 0; n < scoped.n; ++n) {
    CHECK(scoped.found[n].requirement == 0 || has_key(&scoped, n, &KEYS[0]));
  }
  const struct fm_violation * ended = &scoped.found[scoped.n - 1];
  CHECK(ended->requirement == 1 && ended->is_recovery && ended->is_end && ended->stamp == 210);
  struct fm_detail_counts counts[4];
  fm_engine_detail_counts(scoped.engine, counts);
  CHECK(counts[0].is_violated && !counts[1].is_violated && counts[1].violations == 2);
  end(&scoped);
}

SCENARIO(a_violation_that_ends_with_its_instance_has_the_tick_of_the_end)
{
  const struct settings timed = {FM_TIMED, 0, -1, 100, 0, 2};
  begin_found(&timed);
  give_element(&scoped, &KEYS[0], 3, 10);  // violates A
  fm_engine_advance(scoped.engine, 110);
  take(&scoped);
  const struct fm_violation * ended = &scoped.found[scoped.n - 1];
  CHECK(ended->is_end && ended->stamp == 110 && ended->step == 100);
  end(&scoped);
}

SCENARIO(a_violation_of_a_requirement_goes_on_while_an_instance_violates_it)
{
  struct fm_detail_counts counts[4];
  begin_found(&FOUND);
  give_element(&scoped, &KEYS[0], 3, 10);
  give_element(&scoped, &KEYS[1], 3, 20);
  give_element(&scoped, &KEYS[0], 5, 30);
  fm_engine_detail_counts(scoped.engine, counts);
  CHECK(counts[1].is_violated);
  give_element(&scoped, &KEYS[1], 5, 40);
  fm_engine_detail_counts(scoped.engine, counts);
  CHECK(!counts[1].is_violated && counts[1].violations == 2);
  end(&scoped);
}

// Those of B are left out.
static void expect_instance(uint32_t requirement, bool begins, const struct fm_key * key)
{
  struct fm_violation event;
  uint8_t kept[FM_KEY_ROOM];
  do {
    CHECK(fm_engine_take_instance(scoped.engine, &event, kept));
  } while (event.requirement == 2 && failures == 0);
  CHECK(event.requirement == requirement && event.is_recovery == !begins);
  CHECK(kept[0] == key->size && (key->size == 0 ||
    memcmp(kept + 1, key->bytes, key->size) == 0));
}

SCENARIO(who_follows_instances_takes_each_violation_that_begins_and_ends_with_its_key)
{
  static const struct fm_key all = {NULL, 0};
  begin_found(&FOUND);
  fm_engine_follow_states(scoped.engine);
  CHECK(fm_engine_follow_instances(scoped.engine));
  give_element(&scoped, &KEYS[0], 3, 10);
  give_element(&scoped, &KEYS[2], 6, 20);
  give_element(&scoped, &KEYS[0], 6, 25);  // goes on
  give_element(&scoped, &KEYS[0], 5, 30);
  expect_instance(1, true, &KEYS[0]);
  expect_instance(1, true, &KEYS[2]);
  expect_instance(1, false, &KEYS[0]);
  fm_engine_advance(scoped.engine, 125);   // the instance of the third key ends
  expect_instance(1, false, &KEYS[2]);
  give_element(&scoped, &KEYS[1], 3, 126);
  fm_engine_reset(scoped.engine);
  expect_instance(1, true, &KEYS[1]);
  expect_instance(4, false, &all);
  end(&scoped);
}

SCENARIO(a_flood_of_keys_is_counted_and_leaves_those_there_are)
{
  static const struct fm_key none = {(const uint8_t *)"", 0};
  begin_found(&FOUND);
  for (uint8_t n = 0; n < 20; ++n) {
    const uint8_t byte[2] = {n, 0xff};
    const struct fm_key key = {byte, 2};
    give_element(&scoped, &key, 3, 10 + n);
  }
  give_element(&scoped, &none, 3, 40);
  CHECK(counts_of(&scoped).alive == 2 && counts_of(&scoped).beyond == 19);
  take(&scoped);
  CHECK(fm_engine_deadline(scoped.engine) == 110);
  fm_engine_advance(scoped.engine, 111);
  CHECK(counts_of(&scoped).alive == 0);
  give_element(&scoped, &KEYS[2], 3, 120);
  CHECK(counts_of(&scoped).begun == 3 && counts_of(&scoped).beyond == 19);
  end(&scoped);
}

SCENARIO(a_snapshot_counts_the_instances_that_violate_and_names_the_first)
{
  static const struct settings many = {FM_EVERY_MESSAGE, 0, -1, 100, 0, 12};
  static struct fm_named_keys violated[3], unevaluated[3], nearest[3];
  struct fm_input_snapshot keyed[N_INPUTS];
  struct fm_kind_snapshot kind = {
    .inputs = keyed, .violated = violated, .unevaluated = unevaluated, .nearest = nearest};
  struct fm_requirement_counts counts[4];
  struct fm_input_snapshot fed[1];
  struct fm_topic_snapshot topics[N_TOPICS];
  uint8_t conditions[64];
  struct fm_snapshot snapshot = {
    .requirements = counts, .inputs = fed, .topics = topics, .kinds = &kind,
    .conditions = conditions};
  begin_found(&many);
  for (uint8_t n = 0; n < 12; ++n) {
    const struct fm_key key = {&n, 1};
    give_element(&scoped, &key, 3, 10);
  }
  fm_engine_snapshot(scoped.engine, &snapshot);
  CHECK(violated[0].n == 12 && violated[0].n_keys == FM_MOST_NAMED_KEYS);
  CHECK(violated[0].keys[9][0] == 1 && violated[0].keys[9][1] == 9);
  end(&scoped);
}

SCENARIO(a_message_of_which_one_part_cannot_be_read_has_no_effect)
{
  begin_found(&FOUND);
  struct message message = begin_message(0);
  add_element(&message, &KEYS[0], 3);
  add_element(&message, &KEYS[1], 3);
  message.size -= 1;
  CHECK(deliver(&scoped, PARTS, &message, 10, NULL) == FM_UNDECODABLE);
  CHECK(counts_of(&scoped).begun == 0);
  CHECK(fm_evaluator_topic_counts(fm_scopes_bundle(scoped.scopes), PARTS).undecodable == 1);
  end(&scoped);
}

SCENARIO(records_have_the_keys_of_their_topics)
{
  const struct message first = with_value(0, 3);
  const struct message second = with_value(0, UNRELATED);
  const uint32_t topics[] = {NAMED, NAMED, NAMED};
  const int64_t times[] = {10, 20, 30};
  const uint64_t sizes[] = {9, 9, 9};
  const uint32_t key_sizes[] = {5, 2, 5};
  uint64_t counts[N_TOPICS] = {0};
  uint8_t bytes[27];
  memcpy(bytes, first.bytes, 9);
  memcpy(bytes + 9, second.bytes, 9);
  memcpy(bytes + 18, first.bytes, 9);
  struct fm_records records = {
    topics, times, sizes, bytes, (const uint8_t *)"alpha%salpha", key_sizes, 3, 0, 0, 0, counts};
  begin_found(&FOUND);
  CHECK(fm_engine_records(scoped.engine, &records, 1000));
  take(&scoped);
  CHECK(scoped.n == 3 && counts[NAMED] == 3 && counts_of(&scoped).begun == 1);
  CHECK(scoped.found[0].requirement == 0 && scoped.found[0].stamp == 10);
  CHECK(has_key(&scoped, 1, &KEYS[0]) && scoped.found[1].requirement == 3);
  CHECK(scoped.found[1].stamp == 30 && scoped.keys[2 * FM_KEY_ROOM] == 0);
  end(&scoped);
}

SCENARIO(a_detail_has_the_values_and_the_key_of_its_instance)
{
  begin_found(&FOUND);
  fm_engine_want_details(scoped.engine, true, 10);
  struct fm_detail * detail = malloc(fm_engine_detail_bytes(scoped.engine));
  give_element(&scoped, &KEYS[0], 3, 10);
  give_element(&scoped, &KEYS[1], 6, 10);
  CHECK(fm_engine_take_detail(scoped.engine, detail, 0));
  CHECK(detail->violation.requirement == 1);
  CHECK(fm_engine_take_detail(scoped.engine, detail, 0));
  CHECK(detail->violation.requirement == 2);
  CHECK(fm_engine_take_detail(scoped.engine, detail, 0));
  CHECK(detail->violation.requirement == 0);  // the bundle's, with each message
  CHECK(fm_engine_take_detail(scoped.engine, detail, 0));
  const uint8_t * values = (const uint8_t *)(detail + 1);
  const uint8_t * flags = values + sizeof(struct values);
  CHECK(((const struct values *)(const void *)values)->x == 6 && flags[X] == 1 && flags[Y] == 0);
  CHECK(flags[N_INPUTS] == KEYS[1].size);
  CHECK(memcmp(flags + N_INPUTS + 1, KEYS[1].bytes, KEYS[1].size) == 0);
  free(detail);
  end(&scoped);
}

SCENARIO(scopes_that_do_not_fit_the_topics_are_refused)
{
  make_scoped(&scoped, &FOUND);
  const struct fm_engine_options made = {
    fm_scopes_bundle(scoped.scopes), &bundle_monitor, &readers, bundle_topics, N_TOPICS, NULL,
    false, 0, true, scoped.scopes};
  struct fm_kind * kind = (struct fm_kind *)(uintptr_t)fm_scopes_kind(scoped.scopes, 0);
  kind->keyed = NULL;
  CHECK(fm_engine_create(&made) == NULL);
  end(&scoped);
}
