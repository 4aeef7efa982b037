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

/// Keys and lives: a table of keys whose hash collides is compared with a list; then a million
/// instances live one after the other in a pool of 100, while ten times as many keys come. The
/// index of pairs is compared with a table. Prints what is not so.

#include "fret_cdr.h"
#include "scopes_parts.h"

#include <stdlib.h>
#include <string.h>

#include "check.h"

// ---- a table whose hash collides ---------------------------------------------------------------

static uint64_t weak_hash(const uint64_t * seed, const void * bytes, size_t size)
{
  (void)seed;
  return size == 0 ? UINT32_MAX : UINT32_MAX - *(const uint8_t *)bytes % 3u;
}

#define FM_KEY_HASH weak_hash
#define fm_keys_bytes weak_keys_bytes
#define fm_keys_make weak_keys_make
#define fm_keys_find weak_keys_find
#define fm_keys_add weak_keys_add
#define fm_keys_remove weak_keys_remove
#define fm_keys_has weak_keys_has
#define fm_keys_copy weak_keys_copy
uint64_t weak_keys_bytes(uint64_t most);
struct fm_keys weak_keys_make(void * memory, uint32_t most, const uint64_t seed[2]);
uint32_t weak_keys_find(const struct fm_keys * keys, const void * key, size_t size);
uint32_t weak_keys_add(struct fm_keys * keys, const void * key, size_t size);
void weak_keys_remove(struct fm_keys * keys, uint32_t slot);
bool weak_keys_has(const struct fm_keys * keys, uint32_t slot);
size_t weak_keys_copy(const struct fm_keys * keys, uint32_t slot, uint8_t * out);
#include "keys.c"
#undef fm_keys_bytes
#undef fm_keys_make
#undef fm_keys_find
#undef fm_keys_add
#undef fm_keys_remove
#undef fm_keys_has
#undef fm_keys_copy

#include "draws.h"

enum { MOST_WEAK = 24, N_LISTED = 60, N_WEAK_CALLS = 20000 };

static uint8_t listed[N_LISTED][FM_MOST_KEY_BYTES];
static size_t sizes[N_LISTED];
static uint32_t slots[N_LISTED];

// Some keys are the beginning of another one.
static void make_listed(void)
{
  static const size_t SIZES[] = {0, 1, 17, 18, 19, 36, 37, 254, 255, 100};
  for (uint32_t k = 0; k < N_LISTED; ++k) {
    slots[k] = FM_NO_SLOT;
    sizes[k] = SIZES[k % 10];
    for (size_t b = 0; b < sizes[k]; ++b) {
      listed[k][b] = b == 0 ? (uint8_t)(k / 10) : (uint8_t)(b * 7);
    }
  }
}

static bool is_first_of_its_bytes(uint32_t k) {return sizes[k] != 0 || k == 0;}

static void compare_keys(const struct fm_keys * keys, uint32_t n)
{
  for (uint32_t k = 0; k < N_LISTED; ++k) {
    if (is_first_of_its_bytes(k)) {
      uint8_t copy[FM_MOST_KEY_BYTES];
      CHECK(weak_keys_find(keys, listed[k], sizes[k]) == slots[k]);
      CHECK(slots[k] == FM_NO_SLOT || (weak_keys_has(keys, slots[k]) &&
        weak_keys_copy(keys, slots[k], copy) == sizes[k] &&
        memcmp(copy, listed[k], sizes[k]) == 0));
    }
  }
  CHECK(keys->n == n);
}

static void keys_that_collide_are_found(void)
{
  static const uint64_t NO_SEED[2] = {0, 0};
  static const uint8_t TOO_LONG[FM_MOST_KEY_BYTES + 1];
  void * memory = calloc(1, (size_t)weak_keys_bytes(MOST_WEAK));
  struct fm_keys keys = weak_keys_make(memory, MOST_WEAK, NO_SEED);
  uint32_t n = 0;
  make_listed();
  CHECK(weak_keys_add(&keys, TOO_LONG, sizeof TOO_LONG) == FM_NO_SLOT);
  CHECK(weak_keys_find(&keys, TOO_LONG, sizeof TOO_LONG) == FM_NO_SLOT);
  for (uint32_t call = 0; call < N_WEAK_CALLS && failures == 0; ++call) {
    const uint32_t k = random_below(N_LISTED);
    if (!is_first_of_its_bytes(k)) {
      continue;
    }
    if (slots[k] != FM_NO_SLOT) {
      weak_keys_remove(&keys, slots[k]);
      slots[k] = FM_NO_SLOT;
      n -= 1;
    } else {
      slots[k] = weak_keys_add(&keys, listed[k], sizes[k]);
      CHECK((slots[k] == FM_NO_SLOT) == (n == MOST_WEAK));
      n += slots[k] == FM_NO_SLOT ? 0u : 1u;
    }
    compare_keys(&keys, n);
  }
  free(memory);
}

// ---- a million lives ---------------------------------------------------------------------------

enum { MOST = 100, N_LIVES = 1000000, FORGET = 150 };

struct inputs
{
  int64_t x;
};

struct outputs_of_group
{
  int64_t sum_of;
};

static void start(void * state) {memset(state, 0, sizeof(struct outputs_of_group));}

static void step(void * state, const void * inputs, bool * verdicts)
{
  ((struct outputs_of_group *)state)->sum_of = ((const struct inputs *)inputs)->x;
  verdicts[0] = ((const struct inputs *)inputs)->x % 2 == 0;
}

static void keep(void * state) {(void)state;}

static void look(void * state, const void * inputs, bool * verdicts)
{
  (void)state;
  verdicts[0] = ((const struct inputs *)inputs)->x >= 0;
}

static const uint32_t FIRST[] = {0};
static const struct fm_input INPUTS[] = {{"x", 0, FM_INT64}};
static const struct fm_requirement REQUIREMENTS[] = {{"R", 0}};
static const struct fm_group OF_INSTANCES[] = {{FIRST, 1, FIRST, 1, start, step, NULL}};
static const struct fm_group OF_BUNDLE[] = {{FIRST, 1, FIRST, 1, keep, look, NULL}};
static const struct fm_monitor INSTANCES = {
  FM_ABI, 1, 1, 1, sizeof(struct outputs_of_group), sizeof(struct inputs), INPUTS, OF_INSTANCES,
  REQUIREMENTS, "instances", "", NULL, NULL, 0, NULL};
static const struct fm_monitor BUNDLE = {
  FM_ABI, 1, 1, 1, 16, sizeof(struct inputs), INPUTS, OF_BUNDLE, REQUIREMENTS, "bundle", "", NULL,
  NULL, 0, NULL};
static const struct fm_topic WITH_KEY[] = {{FIRST, 1}};
static const struct fm_topic WITHOUT[] = {{NULL, 0}};
static const uint8_t AGGREGATES[] = {FM_AGGREGATE};
static const uint8_t CONCERNS[] = {FM_CONCERNS_KEY};
static const uint32_t NOT_SHARED[] = {UINT32_MAX};
static const struct fm_output OUTPUTS[] = {{0, 0, FM_INT64}};
static const struct fm_outputs ALL_OUTPUTS = {OUTPUTS, 1};
static const struct fm_aggregate SUM[] = {{0, FM_SUM_OF, 0, 0}};

static uint64_t n_began, n_ended, n_beyond;

static void count_events(
  void * context, const struct fm_stepped * stepped, const struct fm_violation * violations)
{
  (void)context;
  (void)violations;
  n_began += stepped->event == FM_SCOPE_BEGAN ? 1u : 0u;
  n_ended += stepped->event == FM_SCOPE_ENDED ? 1u : 0u;
  n_beyond += stepped->event == FM_SCOPE_BEYOND ? 1u : 0u;
}

static void give(struct fm_scopes * scopes, const char * key, int64_t x, int64_t now)
{
  const union fm_value value = {.i = x};
  while (fm_scopes_advance_to(scopes, now) != FM_NEVER) {
  }
  fm_scopes_begin(scopes, 0, now);
  (void)fm_scopes_enter(scopes, 0, key, strlen(key));
  fm_scopes_store_keyed(scopes, 0, value);
  CHECK(fm_scopes_end(scopes) == now);
}

// Each key comes once, and lives for FORGET ns; then ten keys come at one time for each place.
static void live(struct fm_scopes * scopes)
{
  char key[300];
  int64_t now = 0;
  CHECK(fm_scopes_unknown(scopes, 0, 0) == 1);  // no instance has begun
  for (uint32_t k = 0; k < N_LIVES && failures == 0; ++k) {
    (void)snprintf(key, sizeof key, "%s%u", k % 5 == 0 ? "a key of more than one chunk " : "", k);
    now += 2;
    give(scopes, key, (int64_t)k, now);
    CHECK(k < FORGET || fm_scopes_counts(scopes, 0).alive == FORGET / 2 + 1);
  }
  CHECK(n_beyond == 0 && fm_scopes_unknown(scopes, 0, 0) == 0);
  for (uint32_t k = 0; k < 10 * MOST; ++k) {
    (void)snprintf(key, sizeof key, "flood %u", k);
    give(scopes, key, 1, now + 1);
  }
  CHECK(n_beyond == 10 * MOST - (MOST - FORGET / 2));
  CHECK(fm_scopes_unknown(scopes, 0, 0) == 1);  // a lock stays closed
  fm_scopes_reset(scopes);
  CHECK(fm_scopes_unknown(scopes, 0, 0) == 0);
}

static void a_million_lives_need_no_more_memory(void)
{
  const struct fm_evaluator_options bundle = {
    &BUNDLE, WITHOUT, 1, FM_EVERY_MESSAGE, NULL, NULL, NULL, 0, 0, AGGREGATES, false, NULL,
    NULL, NULL, NULL, NULL};
  const struct fm_evaluator_options instances = {
    &INSTANCES, WITH_KEY, 1, FM_EVERY_MESSAGE, NULL, NULL, NULL, 0, 0, NULL, false, NULL,
    NULL, NULL, NULL, NULL};
  const struct fm_kind kind = {
    &instances, &ALL_OUTPUTS, CONCERNS, NULL, NOT_SHARED, NULL, 0, NULL, NULL, 0, MOST, FORGET};
  const struct fm_scopes_options options = {
    &bundle, &kind, 1, 1, SUM, NULL, count_events, NULL, 0};
  void * memory = calloc(1, (size_t)fm_scopes_bytes(&options));
  struct fm_scopes * scopes = fm_scopes_init(memory, &options);
  CHECK(scopes != NULL);
  live(scopes);
  const struct fm_keys * keys = scopes->kinds[0].pool.keys;
  CHECK(keys->end <= MOST && keys->n == MOST);
  CHECK(keys->chunk_end <= 2 * MOST);  // no key needed more than one further chunk
  CHECK(fm_scopes_counts(scopes, 0).begun == n_began && n_began > N_LIVES);
  CHECK(fm_scopes_counts(scopes, 0).ended == n_ended && n_began - n_ended == MOST);
  while (fm_scopes_advance(scopes, INT64_C(1) << 40) != FM_NEVER) {
  }
  CHECK(fm_scopes_counts(scopes, 0).alive == 0 && fm_scopes_deadline(scopes) == FM_NEVER);
  CHECK(((const struct inputs *)fm_evaluator_inputs(fm_scopes_bundle(scopes)))->x == 0);
  free(memory);
}

// Beyond its block, and what is reserved for long keys, with `forget`.
static void an_instance_takes_at_most_64_bytes_beyond_its_state(void)
{
  static const uint64_t MOSTS[] = {25, 43, 86, 1366, 10000, 43691, 500000};
  const struct fm_evaluator_options options = {
    &INSTANCES, WITH_KEY, 1, FM_TIMED, NULL, NULL, NULL, 0, 0, NULL, false, NULL, NULL, NULL,
    NULL, NULL};
  const uint64_t reserved = (MOST_CHUNKS - 1) * sizeof(struct fm_key_chunk);
  const uint64_t each = fm_instance_bytes(&INSTANCES, fm_measure_words(&options)) + reserved;
  for (size_t n = 0; n < sizeof(MOSTS) / sizeof(MOSTS[0]); ++n) {
    const uint64_t bytes = fm_pool_bytes(&options, MOSTS[n], true, true);
    const uint64_t all = bytes - fm_pool_bytes(&options, 1, true, true);
    CHECK(bytes > 0 && all <= (MOSTS[n] - 1) * (each + 64));
  }
}

// ---- an aggregate that has lost its value ------------------------------------------------------

static const uint32_t BOTH[] = {0, 1};
static const struct fm_input TWO_INPUTS[] = {{"least", 0, FM_INT64}, {"s", 8, FM_INT64}};
static const struct fm_group OF_BOTH[] = {{BOTH, 2, FIRST, 1, keep, look, NULL}};
static const struct fm_monitor LEAST = {
  FM_ABI, 2, 1, 1, 16, 16, TWO_INPUTS, OF_BOTH, REQUIREMENTS, "bundle", "", NULL, NULL, 0, NULL};
static const struct fm_topic ON_SECOND[] = {{NULL, 0}, {BOTH + 1, 1}};
static const struct fm_topic ON_FIRST[] = {{FIRST, 1}, {NULL, 0}};
static const uint8_t LEAST_SOURCES[] = {FM_AGGREGATE, FM_FIELD};
static const uint8_t TWO_CONCERNS[] = {FM_CONCERNS_KEY, FM_CONCERNS_ALL};
static const struct fm_aggregate MIN[] = {{0, FM_MIN_OF, 0, 0}};

static void give_shared(struct fm_scopes * scopes, int64_t now)
{
  const union fm_value value = {.i = 1};
  while (fm_scopes_advance_to(scopes, now) != FM_NEVER) {
  }
  fm_scopes_begin(scopes, 1, now);
  for (uint32_t k = 0; k < 2; ++k) {  // beyond the last: these take the place of no other
    fm_scopes_store_from(scopes, LEAST.n_inputs, &value);
    fm_scopes_store(scopes, LEAST.n_inputs, value);
    fm_scopes_unusable(scopes, LEAST.n_inputs);
  }
  fm_scopes_store(scopes, 1, value);
  (void)fm_scopes_end(scopes);
}

// With FM_ALL_INPUTS, both inputs have come anew; but the least of no instance has no value.
static void a_group_does_not_step_without_the_least_of_all_instances(void)
{
  const struct fm_evaluator_options bundle = {
    &LEAST, ON_SECOND, 2, FM_ALL_INPUTS, NULL, NULL, NULL, 0, 0, LEAST_SOURCES, false, NULL,
    NULL, NULL, NULL, NULL};
  const struct fm_evaluator_options instances = {
    &INSTANCES, ON_FIRST, 2, FM_ALL_INPUTS, NULL, NULL, NULL, 0, 0, NULL, false, NULL, NULL, NULL,
    NULL, NULL};
  const struct fm_kind kind = {
    &instances, &ALL_OUTPUTS, TWO_CONCERNS, NULL, NOT_SHARED, NULL, 0, NULL, NULL, 0, MOST, 10};
  const struct fm_scopes_options options = {&bundle, &kind, 1, 1, MIN, NULL, NULL, NULL, 0};
  void * memory = calloc(1, (size_t)fm_scopes_bytes(&options));
  struct fm_scopes * scopes = fm_scopes_init(memory, &options);
  give(scopes, "a", 5, 1);
  CHECK(fm_evaluator_has_value(fm_scopes_bundle(scopes), 0));
  give_shared(scopes, 20);
  CHECK(!fm_evaluator_has_value(fm_scopes_bundle(scopes), 0));
  CHECK(fm_evaluator_steps(fm_scopes_bundle(scopes), 0) == 0);
  give(scopes, "b", 7, 21);
  CHECK(fm_evaluator_steps(fm_scopes_bundle(scopes), 0) == 1);
  free(memory);
}

// ---- a heap ------------------------------------------------------------------------------------

static uint32_t least_of(const bool * is_in, const int64_t * words, uint32_t n)
{
  uint32_t least = UINT32_MAX;
  for (uint32_t k = 0; k < n; ++k) {
    least = is_in[k] && (least == UINT32_MAX || words[k] < words[least]) ? k : least;
  }
  return least;
}

static void a_heap_has_the_least_first(void)
{
  void * memory = calloc(1, (size_t)fm_heap_bytes(MOST));
  struct fm_heap heap = fm_heap_make(memory, MOST);
  bool is_in[MOST] = {false};
  int64_t words[MOST] = {0};
  for (uint32_t call = 0; call < N_WEAK_CALLS && failures == 0; ++call) {
    const uint32_t k = random_below(MOST);
    const bool is_draining = call / 500 % 2 != 0;
    is_in[k] = !is_draining && random_below(3) != 0;
    words[k] = (int64_t)random_below(1000) - 500;
    if (is_in[k]) {
      fm_heap_set(&heap, k, words[k]);
    } else {
      fm_heap_remove(&heap, k);
    }
    CHECK(fm_heap_first(&heap) == least_of(is_in, words, MOST));
  }
  free(memory);
}

// ---- pairs -------------------------------------------------------------------------------------

enum { N_FIRST = 6, MOST_FIRST = 4, N_SECOND = 4, N_SECOND_LISTED = 3, N_PAIR_CALLS = 20000 };

static uint32_t pair_slots[N_FIRST][N_SECOND];  // FM_NO_SLOT: it is not there

// Keys of 1 to 6 bytes, so that those of one pair, put together, may be those of another.
static struct fm_key part_of_pair(uint32_t k)
{
  static const uint8_t BYTES[] = {'a', 'a', 'a', 'a', 'a', 'a'};
  return (struct fm_key) {BYTES, k + 1};
}

static struct fm_key pair_of(uint32_t first, uint32_t second, uint8_t * out)
{
  const struct fm_key a = part_of_pair(first), b = part_of_pair(second);
  return (struct fm_key) {
    out, (uint32_t)fm_pair_key(out, a.bytes, a.size, b.bytes, b.size)};
}

static bool is_in_a_pair(uint32_t first)
{
  bool is_in = false;
  for (uint32_t s = 0; s < N_SECOND; ++s) {
    is_in = is_in || pair_slots[first][s] != FM_NO_SLOT;
  }
  return is_in;
}

static uint32_t firsts_in_pairs(void)
{
  uint32_t n = 0;
  for (uint32_t f = 0; f < N_FIRST; ++f) {
    n += is_in_a_pair(f) ? 1u : 0u;
  }
  return n;
}

// The pairs of a key are those of its row, or column, of the table, in any order.
static void compare_pairs_of(const struct fm_pairs * pairs, uint32_t which, uint32_t k)
{
  const struct fm_key key = part_of_pair(k);
  bool is_found[MOST_FIRST * N_SECOND] = {false};
  uint32_t n = 0;
  for (uint32_t slot = fm_pairs_first(pairs, which, &key); slot != FM_NO_SLOT;
    slot = fm_pairs_next(pairs, which, slot))
  {
    CHECK(!is_found[slot]);
    is_found[slot] = true;
    n += 1;
  }
  for (uint32_t other = 0; other < (which == 0 ? N_SECOND : N_FIRST); ++other) {
    const uint32_t slot = which == 0 ? pair_slots[k][other] : pair_slots[other][k];
    CHECK(slot == FM_NO_SLOT || is_found[slot]);
    n -= slot == FM_NO_SLOT ? 0u : 1u;
  }
  CHECK(n == 0);
}

static void change_pair(struct fm_pairs * pairs, struct fm_keys * keys, uint32_t f, uint32_t s)
{
  uint8_t bytes[FM_PAIR_ROOM];
  const struct fm_key pair = pair_of(f, s, bytes);
  CHECK(fm_pairs_fit(pairs, &pair) == (s < N_SECOND_LISTED));
  if (pair_slots[f][s] != FM_NO_SLOT) {
    fm_pairs_remove(pairs, pair_slots[f][s]);
    fm_keys_remove(keys, pair_slots[f][s]);
    pair_slots[f][s] = FM_NO_SLOT;
  } else if (s < N_SECOND_LISTED) {
    const uint32_t slot = fm_keys_add(keys, pair.bytes, pair.size);
    const bool has_room = is_in_a_pair(f) || firsts_in_pairs() < MOST_FIRST;
    CHECK(slot != FM_NO_SLOT);
    CHECK(fm_pairs_add(pairs, slot, &pair) == has_room);
    pair_slots[f][s] = has_room ? slot : FM_NO_SLOT;
    if (!has_room) {
      fm_keys_remove(keys, slot);
    }
  }
}

static void pairs_are_found_by_each_of_their_keys(void)
{
  static const uint64_t NO_SEED[2] = {0, 0};
  struct fm_key listed_second[N_SECOND_LISTED];
  for (uint32_t s = 0; s < N_SECOND_LISTED; ++s) {
    listed_second[s] = part_of_pair(s);
  }
  const struct fm_half halves[2] = {
    {NULL, 0, MOST_FIRST, FM_BUNDLE, NULL},
    {listed_second, N_SECOND_LISTED, N_SECOND_LISTED, FM_BUNDLE, NULL}};
  const uint32_t most = MOST_FIRST * N_SECOND;
  void * memory = calloc(1, (size_t)fm_pairs_bytes(halves, most));
  void * own = calloc(1, (size_t)fm_keys_bytes(most));
  struct fm_keys keys = fm_keys_make(own, most, NO_SEED);
  struct fm_pairs pairs;
  CHECK(fm_pairs_make(&pairs, memory, halves, most, NO_SEED));
  memset(pair_slots, 0xff, sizeof(pair_slots));
  for (uint32_t call = 0; call < N_PAIR_CALLS && failures == 0; ++call) {
    change_pair(&pairs, &keys, random_below(N_FIRST), random_below(N_SECOND));
    compare_pairs_of(&pairs, 0, random_below(N_FIRST));
    compare_pairs_of(&pairs, 1, random_below(N_SECOND));
  }
  free(own);
  free(memory);
}

static void give_part(
  struct fm_scopes * scopes, uint32_t kind, const char * first, const char * second, int64_t x)
{
  const union fm_value value = {.i = x};
  uint8_t bytes[FM_PAIR_ROOM];
  fm_scopes_begin(scopes, 0, 0);
  if (second == NULL) {
    (void)fm_scopes_enter(scopes, kind, first, strlen(first));
  } else {
    const size_t size = fm_pair_key(
      bytes, (const uint8_t *)first, strlen(first), (const uint8_t *)second, strlen(second));
    (void)fm_scopes_enter(scopes, kind, bytes, size);
  }
  fm_scopes_store_keyed(scopes, 0, value);
  (void)fm_scopes_end(scopes);
}

static int64_t value_of_pair(struct fm_scopes * scopes, uint32_t slot)
{
  return ((const struct inputs *)fm_evaluator_inputs(fm_scopes_look(scopes, 0, slot)))->x;
}

// Two firsts at most are in pairs, and one has room for its own inputs.
static void of_what_finds_no_room_nothing_is_known(void)
{
  const struct fm_evaluator_options bundle = {
    &BUNDLE, WITHOUT, 1, FM_EVERY_MESSAGE, NULL, NULL, NULL, 0, 0, NULL, false, NULL,
    NULL, NULL, NULL, NULL};
  const struct fm_evaluator_options instances = {
    &INSTANCES, WITH_KEY, 1, FM_EVERY_MESSAGE, NULL, NULL, NULL, 0, 0, NULL, false, NULL,
    NULL, NULL, NULL, NULL};
  const struct fm_half halves[2] = {
    {NULL, 0, 2, 1, FIRST}, {NULL, 0, 2, FM_BUNDLE, NOT_SHARED}};
  const struct fm_kind kinds[2] = {
    {&instances, NULL, CONCERNS, NULL, NOT_SHARED, NULL, 0, halves, NULL, 0, 4, 0},
    {&instances, NULL, CONCERNS, NULL, NOT_SHARED, NULL, 0, NULL, NULL, 0, 1, 0}};
  const struct fm_scopes_options options = {&bundle, kinds, 2, 0, NULL, NULL, NULL, NULL, 0};
  void * memory = calloc(1, (size_t)fm_scopes_bytes(&options));
  struct fm_scopes * scopes = fm_scopes_init(memory, &options);
  CHECK(scopes != NULL);
  fm_scopes_count_unknown(scopes);
  give_part(scopes, 0, "a", "s", 1);
  give_part(scopes, 0, "b", "s", 2);
  give_part(scopes, 1, "a", NULL, 7);
  CHECK(value_of_pair(scopes, 0) == 7 && value_of_pair(scopes, 1) == 2);
  CHECK(fm_scopes_unknown(scopes, 0, 0) == 0);
  give_part(scopes, 1, "b", NULL, 8);
  CHECK(value_of_pair(scopes, 1) == 2);
  CHECK(fm_scopes_unknown(scopes, 0, 0) == 1 && fm_scopes_counts(scopes, 1).beyond == 1);
  fm_scopes_reset(scopes);
  give_part(scopes, 0, "a", "s", 1);
  give_part(scopes, 0, "b", "s", 2);
  CHECK(fm_scopes_unknown(scopes, 0, 0) == 0);
  give_part(scopes, 0, "c", "s", 3);
  CHECK(fm_scopes_unknown(scopes, 0, 0) == 1 && fm_scopes_counts(scopes, 0).beyond == 1);
  free(memory);
}

int main(void)
{
  pairs_are_found_by_each_of_their_keys();
  of_what_finds_no_room_nothing_is_known();
  keys_that_collide_are_found();
  a_heap_has_the_least_first();
  a_group_does_not_step_without_the_least_of_all_instances();
  a_million_lives_need_no_more_memory();
  an_instance_takes_at_most_64_bytes_beyond_its_state();
  return failures == 0 ? 0 : 1;
}
