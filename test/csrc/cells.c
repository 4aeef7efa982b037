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

/// Checks fret_cells.h against its documentation: `cells NAME` runs one check, `cells all` all of
/// them; without a name they are listed. `cells start (KIND BITS BOUND HEAD START)...` checks
/// counters with given start values. Prints the first failure; the exit status is 0 without one.
///
/// Counters are compared with the definitions of the operators over whole traces or, where that
/// takes too long, with a model that keeps absolute times. Arithmetic is compared with 128-bit
/// integers.

#include "fret_cells.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CHECK(condition, ...) \
  do { \
    if (!(condition)) { \
      printf("line %d: not so: %s: ", __LINE__, #condition); \
      printf(__VA_ARGS__); \
      puts(""); \
      exit(1); \
    } \
  } while (0)

#define LENGTH(array) (sizeof(array) / sizeof((array)[0]))

typedef long long show;
__extension__ typedef __int128 wide;
__extension__ typedef unsigned __int128 unsigned_wide;

static uint64_t random_bits(void)
{
  static uint64_t state = 0x9e3779b97f4a7c15u;
  state ^= state << 13;
  state ^= state >> 7;
  state ^= state << 17;
  return state * 0x2545f4914f6cdd1du;
}

static uint64_t random_below(uint64_t limit) {return (random_bits() >> 11) % limit;}

// ---- counters: the cells, all under one signature ----------------------------------------------

enum kind { ONCE_WITHIN, ALWAYS_WITHIN, SINCE_WITHIN, ONCE_BEFORE, SINCE_BEFORE };

struct cell
{
  const char * name;
  enum kind kind;
  unsigned bits;
  bool (* step)(uint64_t * state, uint64_t bound, bool p, bool q);
};

#define UNARY(name, suffix, type) \
  static bool name ## _ ## suffix(uint64_t * state, uint64_t bound, bool p, bool q) \
  { \
    type cell = (type)*state; \
    const bool verdict = fm_ ## name ## _ ## suffix(&cell, (type)bound, p); \
    (void)q; \
    *state = cell; \
    return verdict; \
  }
#define BINARY(name, suffix, type) \
  static bool name ## _ ## suffix(uint64_t * state, uint64_t bound, bool p, bool q) \
  { \
    type cell = (type)*state; \
    const bool verdict = fm_ ## name ## _ ## suffix(&cell, (type)bound, p, q); \
    *state = cell; \
    return verdict; \
  }
#define COUNTERS(suffix, type) \
  UNARY(once_within, suffix, type) \
  UNARY(always_within, suffix, type) \
  BINARY(since_within, suffix, type) \
  UNARY(once_before, suffix, type) \
  BINARY(since_before, suffix, type)

COUNTERS(u8, uint8_t)
COUNTERS(u16, uint16_t)
COUNTERS(u32, uint32_t)

#define ENTRIES(suffix, bits) \
  {"once_within_" #suffix, ONCE_WITHIN, bits, once_within_ ## suffix}, \
  {"always_within_" #suffix, ALWAYS_WITHIN, bits, always_within_ ## suffix}, \
  {"since_within_" #suffix, SINCE_WITHIN, bits, since_within_ ## suffix}, \
  {"once_before_" #suffix, ONCE_BEFORE, bits, once_before_ ## suffix}, \
  {"since_before_" #suffix, SINCE_BEFORE, bits, since_before_ ## suffix}

static const struct cell CELLS[] = {ENTRIES(u8, 8u), ENTRIES(u16, 16u), ENTRIES(u32, 32u)};

static uint64_t greatest(const struct cell * cell) {return UINT64_MAX >> (64u - cell->bits);}

static bool is_within(const struct cell * cell)
{
  return cell->kind == ONCE_WITHIN || cell->kind == ALWAYS_WITHIN || cell->kind == SINCE_WITHIN;
}

/// The largest age: the highest bit.
static uint64_t oldest(const struct cell * cell) {return (greatest(cell) >> 1) + 1u;}

/// Whether a cell can have a bound: less than the largest age, or its type holds bound + 1.
static bool fits(const struct cell * cell, uint64_t bound)
{
  return bound < (is_within(cell) ? oldest(cell) : greatest(cell));
}

/// The state at the start, as the header says: nothing has happened.
static uint64_t never(const struct cell * cell, uint64_t bound)
{
  return is_within(cell) ? bound + 1u : 0u;
}

/// The start state of a cell that takes its event (for `always` a failure) as seen in the first
/// `head` steps.
static uint64_t started(uint64_t bound, uint64_t head) {return bound + 1u - head;}

/// The state after that many more quiet steps: no event, and p of a since holds.
static uint64_t after_quiet(const struct cell * cell, uint64_t state, uint64_t bound, uint64_t n)
{
  const uint64_t end = is_within(cell) ? oldest(cell) : bound + 1u;
  const bool stays = state >= end || (!is_within(cell) && state == 0u);
  return stays ? state : state + n > end ? end : state + n;
}

// ---- counters: the operators by their definitions ----------------------------------------------

enum { LONGEST = 1024 };

static bool P[LONGEST];
static bool Q[LONGEST];

/// Some k <= t with low <= t - k <= high, r at k and, if `after`, p at every step after k.
static bool some(int t, int low, int high, const bool * r, bool value, bool after)
{
  for (int k = t; k >= 0 && t - k <= high; --k) {
    if (t - k >= low && r[k] == value) {
      return true;
    }
    if (after && !P[k]) {
      return false;
    }
  }
  return false;
}

static bool by_definition(enum kind kind, int t, int bound)
{
  switch (kind) {
    case ONCE_WITHIN:
      return some(t, 0, bound, P, true, false);
    case ALWAYS_WITHIN:
      return !some(t, 0, bound, P, false, false);
    case SINCE_WITHIN:
      return some(t, 0, bound, Q, true, true);
    case ONCE_BEFORE:
      return some(t, bound, t, P, true, false);
    case SINCE_BEFORE:
    default:
      return some(t, bound, t, Q, true, true);
  }
}

/// p differs from `usual`, and q is true, once in `gap` steps on average.
static void fill(int length, bool usual, uint64_t gap)
{
  for (int t = 0; t < length; ++t) {
    P[t] = (random_below(gap) == 0u) != usual;
    Q[t] = random_below(gap) == 0u;
  }
}

static const int BOUNDS[] = {
  0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25,
  30, 31, 32, 33, 47, 62, 63, 64, 65, 99, 100, 126, 127, 128, 129, 199, 252, 253, 254, 255, 256,
  257, 300
};

static void follow_definition(const struct cell * cell, int bound)
{
  const int length = 2 * bound + 60;
  uint64_t state = never(cell, (uint64_t)bound);
  for (int t = 0; t < length; ++t) {
    const bool verdict = cell->step(&state, (uint64_t)bound, P[t], Q[t]);
    CHECK(verdict == by_definition(cell->kind, t, bound), "%s, bound %d, step %d", cell->name,
      bound, t);
    CHECK(state <= greatest(cell), "%s, bound %d", cell->name, bound);
  }
}

static void counters_follow_the_definition_of_their_operator(void)
{
  for (size_t b = 0; b < LENGTH(BOUNDS); ++b) {
    const int bound = BOUNDS[b];
    const uint64_t gaps[] = {2u, 5u, (uint64_t)bound + 2u, 3u * (uint64_t)bound + 7u};
    for (size_t mode = 0; mode < 2u * LENGTH(gaps); ++mode) {
      fill(2 * bound + 60, mode % 2u == 0u, gaps[mode / 2u]);
      for (size_t c = 0; c < LENGTH(CELLS); ++c) {
        if (fits(&CELLS[c], (uint64_t)bound)) {
          follow_definition(&CELLS[c], bound);
        }
      }
    }
  }
}

static void follow_short_trace(unsigned trace, int bound)
{
  for (int t = 0; t < 6; ++t) {
    P[t] = fm_bit(trace, (unsigned)t);
    Q[t] = fm_bit(trace, (unsigned)t + 6u);
  }
  for (size_t c = 0; c < LENGTH(CELLS); ++c) {
    uint64_t state = never(&CELLS[c], (uint64_t)bound);
    for (int t = 0; t < 6; ++t) {
      const bool verdict = CELLS[c].step(&state, (uint64_t)bound, P[t], Q[t]);
      CHECK(verdict == by_definition(CELLS[c].kind, t, bound), "%s, bound %d, trace %x, step %d",
        CELLS[c].name, bound, trace, t);
    }
  }
}

static void counters_follow_the_definition_on_all_traces_of_six_steps(void)
{
  for (unsigned trace = 0u; trace < 1u << 12; ++trace) {
    for (int bound = 0; bound < 7; ++bound) {
      follow_short_trace(trace, bound);
    }
  }
}

// ---- counters: a model with absolute times, for bounds that no trace reaches step by step ------

struct model
{
  uint64_t now;    // the next step
  uint64_t event;  // the step of the last event, if there was one
  bool happened;
};

static bool model_step(struct model * m, enum kind kind, uint64_t bound, bool p, bool q)
{
  const uint64_t t = m->now++;
  const bool is_since = kind == SINCE_WITHIN || kind == SINCE_BEFORE;
  const bool event = is_since ? q : p != (kind == ALWAYS_WITHIN);
  const bool keeps_oldest = kind == ONCE_BEFORE || kind == SINCE_BEFORE;
  if (is_since && !p) {
    m->happened = false;
  }
  if (event && !(keeps_oldest && m->happened)) {
    m->happened = true;
    m->event = t;
  }
  const bool is_met = keeps_oldest ? t - m->event >= bound : t - m->event <= bound;
  return (m->happened && is_met) != (kind == ALWAYS_WITHIN);
}

static bool quiet_p(const struct cell * cell)
{
  return cell->kind != ONCE_WITHIN && cell->kind != ONCE_BEFORE;
}

static void many_quiet_steps_are_what_the_checks_take_them_for(void)
{
  static const uint64_t bounds[] = {
    0u, 1u, 7u, 127u, 128u, 254u, 255u, 32767u, 32768u, 65534u, 65535u, INT32_MAX};
  for (size_t k = 0; k < LENGTH(CELLS) * LENGTH(bounds); ++k) {
    const struct cell * const cell = &CELLS[k % LENGTH(CELLS)];
    const uint64_t bound = bounds[k / LENGTH(CELLS)];
    uint64_t state = never(cell, bound);
    if (!fits(cell, bound)) {
      continue;
    }
    (void)cell->step(&state, bound, cell->kind != ALWAYS_WITHIN, true);
    const uint64_t start = state;
    for (uint64_t n = 1u; n < 67000u; ++n) {
      (void)cell->step(&state, bound, quiet_p(cell), false);
      CHECK(state == after_quiet(cell, start, bound, n), "%s, bound %lld, %lld quiet steps",
        cell->name, (show)bound, (show)n);
    }
  }
}

static void wait_quietly(const struct cell * cell, uint64_t bound, uint64_t n, uint64_t * state,
  struct model * model)
{
  *state = after_quiet(cell, *state, bound, n);
  model->now += n;
}

static void steps_beside_model(const struct cell * cell, uint64_t bound, int n, uint64_t * state,
  struct model * model, uint64_t quietness)
{
  for (int k = 0; k < n; ++k) {
    const bool p = (random_below(quietness) == 0u) != quiet_p(cell);
    const bool q = random_below(quietness) == 0u;
    const uint64_t t = model->now;
    const bool expected = model_step(model, cell->kind, bound, p, q);
    CHECK(cell->step(state, bound, p, q) == expected, "%s, bound %lld, step %lld", cell->name,
      (show)bound, (show)t);
  }
}

static void follow_model(const struct cell * cell, uint64_t bound)
{
  static const uint64_t nearly[] = {0u, 1u, 2u, 3u, 5u, 9u, 20u};
  struct model model = {0u, 0u, false};
  uint64_t state = never(cell, bound);
  for (int round = 0; round < 60; ++round) {
    const uint64_t less = nearly[random_below(LENGTH(nearly))];
    steps_beside_model(cell, bound, (int)random_below(20u), &state, &model, 1u + random_below(9u));
    wait_quietly(cell, bound, bound > less ? bound - less : bound, &state, &model);
    steps_beside_model(cell, bound, 12, &state, &model, 1000u);
    if (random_below(3u) == 0u) {
      wait_quietly(cell, bound, 3u * bound + 5u, &state, &model);
    }
  }
}

static void counters_are_right_at_the_borders_of_their_types(void)
{
  static const uint64_t bounds[] = {
    1u, 2u, 30u, 126u, 127u, 128u, 252u, 253u, 254u, 255u, 256u, 32767u, 32768u, 65532u, 65533u,
    65534u, 65535u, 65536u, 16777216u, 2147483646u, 2147483647u, 2147483648u, 4294967293u,
    4294967294u
  };
  for (size_t k = 0; k < 20u * LENGTH(CELLS) * LENGTH(bounds); ++k) {
    const struct cell * const cell = &CELLS[k % LENGTH(CELLS)];
    const uint64_t bound = bounds[k / LENGTH(CELLS) % LENGTH(bounds)];
    if (fits(cell, bound)) {
      follow_model(cell, bound);
    }
  }
}

/// Step by step: these are the smallest bounds at which a 16-bit counter could overflow.
static void counters_of_16_bits_are_right_step_by_step_at_their_border(void)
{
  static const uint64_t bounds[] = {32766u, 32767u, 32768u, 65533u, 65534u, 65535u};
  for (size_t k = 0; k < LENGTH(CELLS) * LENGTH(bounds); ++k) {
    const struct cell * const cell = &CELLS[k % LENGTH(CELLS)];
    const uint64_t bound = bounds[k / LENGTH(CELLS)];
    struct model model = {0u, 0u, false};
    uint64_t state = never(cell, bound);
    if (fits(cell, bound)) {
      steps_beside_model(cell, bound, 40, &state, &model, 4u);
      steps_beside_model(cell, bound, 400000, &state, &model, 50000u);
    }
  }
}

/// From any state, an event at this step gives the right verdict; sanitizers check the rest.
static void counters_recover_from_an_invalid_state(void)
{
  for (int round = 0; round < 20000; ++round) {
    const struct cell * const cell = &CELLS[random_below(LENGTH(CELLS))];
    const uint64_t edge = random_below(2u) * greatest(cell);
    const uint64_t bound = random_bits() % (random_below(2u) ? oldest(cell) : 20u);
    uint64_t state = (edge + random_below(5u) - 2u) & greatest(cell);
    struct model model = {0u, 0u, false};
    (void)cell->step(&state, bound, quiet_p(cell), false);
    if (is_within(cell)) {
      const bool p = cell->kind != ALWAYS_WITHIN;
      const bool verdict = cell->step(&state, bound, p, true);
      CHECK(verdict == model_step(&model, cell->kind, bound, p, true), "%s", cell->name);
      steps_beside_model(cell, bound, 30, &state, &model, 50u);
    }
  }
}

// ---- counters that start as if after an event --------------------------------------------------

static void follow_start(const struct cell * cell, uint64_t bound, uint64_t head, uint64_t start)
{
  const bool seen = cell->kind == ONCE_WITHIN;
  const uint64_t skipped = head > 400u ? head - 3u : 0u;
  uint64_t state = after_quiet(cell, start, bound, skipped);
  for (uint64_t t = skipped; t < head + 3u; ++t) {
    const bool verdict = cell->step(&state, bound, !seen, false);
    CHECK(verdict == (t < head ? seen : !seen), "%s, bound %lld, head %lld, start %lld, step %lld",
      cell->name, (show)bound, (show)head, (show)start, (show)t);
  }
}

/// A p in the first `head` steps counts as at any other step.
static void follow_start_with_p(const struct cell * cell, int bound, int head, uint64_t start)
{
  const bool seen = cell->kind == ONCE_WITHIN;
  uint64_t state = start;
  fill(head + bound + 20, !seen, (uint64_t)bound + 2u);
  for (int t = 0; t < head + bound + 20; ++t) {
    const bool verdict = cell->step(&state, (uint64_t)bound, P[t], false);
    const bool expected = t < head ? seen : by_definition(cell->kind, t, bound);
    CHECK(verdict == expected, "%s, bound %d, head %d, step %d", cell->name, bound, head, t);
  }
}

static void follow_starts(const struct cell * cell, int bound)
{
  for (int head = 0; head <= bound + 1; ++head) {
    const uint64_t start = started((uint64_t)bound, (uint64_t)head);
    follow_start(cell, (uint64_t)bound, (uint64_t)head, start);
    follow_start_with_p(cell, bound, head, start);
  }
}

static void counters_can_start_as_if_something_had_been(void)
{
  static const int bounds[] = {0, 1, 2, 3, 4, 5, 9, 10, 31, 64, 126, 127, 128, 254, 255, 256};
  for (size_t k = 0; k < LENGTH(CELLS) * LENGTH(bounds); ++k) {
    const struct cell * const cell = &CELLS[k % LENGTH(CELLS)];
    const int bound = bounds[k / LENGTH(CELLS)];
    if (cell->kind <= ALWAYS_WITHIN && fits(cell, (uint64_t)bound)) {
      follow_starts(cell, bound);
    }
  }
}

static const struct cell * find_cell(const char * kind, uint64_t bits)
{
  const enum kind wanted = strcmp(kind, "once") == 0 ? ONCE_WITHIN : ALWAYS_WITHIN;
  for (size_t c = 0; c < LENGTH(CELLS); ++c) {
    if (CELLS[c].kind == wanted && CELLS[c].bits == bits) {
      return &CELLS[c];
    }
  }
  return NULL;
}

static void follow_given_starts(int count, char ** words)
{
  CHECK(count > 0 && count % 5 == 0, "%d words", count);
  for (int k = 0; k < count; k += 5) {
    const struct cell * const cell = find_cell(words[k], strtoull(words[k + 1], NULL, 10));
    const uint64_t bound = strtoull(words[k + 2], NULL, 10);
    const uint64_t head = strtoull(words[k + 3], NULL, 10);
    CHECK(cell != NULL && fits(cell, bound), "%s of %s bits", words[k], words[k + 1]);
    follow_start(cell, bound, head, strtoull(words[k + 4], NULL, 10));
  }
}

// ---- delays ------------------------------------------------------------------------------------

static void bits_of_a_word_are_its_bits(void)
{
  for (int round = 0; round < 200; ++round) {
    uint64_t word = random_bits();
    const uint64_t whole = word;
    for (unsigned k = 0u; k < 64u; ++k) {
      CHECK(fm_bit(whole, k) == (word % 2u == 1u), "%llx, bit %u", (unsigned long long)whole, k);
      word /= 2u;
    }
  }
}

/// The register's bits above the delay are arbitrary.
#define FOLLOW_LINE(suffix, type, bits) \
  static void follow_line_ ## suffix(unsigned steps, bool initial) \
  { \
    const uint64_t lowest = UINT64_MAX >> (64u - steps); \
    const uint64_t garbage = random_bits() & ~lowest; \
    type line = (type)((initial ? lowest : 0u) | garbage); \
    fill(300, true, 2u); \
    for (unsigned t = 0u; t < 300u; ++t) { \
      const bool expected = t < steps ? initial : P[t - steps]; \
      CHECK(fm_delay_ ## suffix(&line, steps, P[t]) == expected, #suffix ", %u steps, step %u", \
        steps, t); \
    } \
  } \
  static void follow_lines_ ## suffix(void) \
  { \
    for (unsigned steps = 2u; steps <= bits; ++steps) { \
      follow_line_ ## suffix(steps, false); \
      follow_line_ ## suffix(steps, true); \
    } \
  }

FOLLOW_LINE(u8, uint8_t, 8u)
FOLLOW_LINE(u16, uint16_t, 16u)
FOLLOW_LINE(u32, uint32_t, 32u)
FOLLOW_LINE(u64, uint64_t, 64u)

static void lines_give_what_was_put_in_so_many_steps_ago(void)
{
  follow_lines_u8();
  follow_lines_u16();
  follow_lines_u32();
  follow_lines_u64();
}

/// Two rings of one length share the position. Each has exactly the bytes that it may access.
static void follow_rings(uint32_t length, bool initial)
{
  const size_t bytes = (length + 7u) / 8u;
  uint8_t * const p_ring = malloc(bytes);
  uint8_t * const q_ring = malloc(bytes);
  uint32_t position = 0u;
  CHECK(p_ring != NULL && q_ring != NULL, "no memory");
  memset(p_ring, initial ? 255 : 0, bytes);
  memset(q_ring, initial ? 0 : 255, bytes);
  fill(LONGEST, true, 2u);
  for (uint32_t t = 0u; t < LONGEST; ++t) {
    const bool p = t < length ? initial : P[t - length];
    const bool q = t < length ? !initial : Q[t - length];
    CHECK(position == t % length, "length %lld, step %lld", (show)length, (show)t);
    CHECK(fm_delay_ring(p_ring, position, P[t]) == p, "length %lld", (show)length);
    CHECK(fm_delay_ring(q_ring, position, Q[t]) == q, "length %lld", (show)length);
    position = fm_next_position(position, length);
  }
  free(p_ring);
  free(q_ring);
}

static void rings_give_what_was_put_in_so_many_steps_ago(void)
{
  for (uint32_t length = 1u; length <= 300u; ++length) {
    follow_rings(length, false);
    follow_rings(length, true);
  }
}

static void positions_go_round(void)
{
  static const uint32_t lengths[] = {1u, 2u, 65u, 255u, 256u, 257u, 65535u, 65536u, 65537u,
    INT32_MAX, UINT32_MAX};
  for (size_t k = 0; k < LENGTH(lengths); ++k) {
    const uint32_t length = lengths[k];
    CHECK(fm_next_position(length - 1u, length) == 0u, "length %lld", (show)length);
    CHECK(length < 2u || fm_next_position(0u, length) == 1u, "length %lld", (show)length);
    CHECK(length < 2u || fm_next_position(length - 2u, length) == length - 1u, "length %lld",
      (show)length);
  }
}

// ---- whole numbers -----------------------------------------------------------------------------

enum { N_BORDERS = 34, N_INTEGERS = N_BORDERS + 40 };

static const uint64_t BORDERS[N_BORDERS] = {
  0u, 1u, 2u, 3u, 7u, 10u, 63u, 64u, 65u, 127u, 128u, 255u, 256u, 46341u, 65535u, 65536u,
  2147483646u, 2147483647u, 2147483648u, 2147483649u, 3037000499u, 3037000500u, 4294967295u,
  4294967296u, 4294967297u, 9007199254740991u, 9007199254740992u, 9007199254740993u,
  4611686018427387904u, 9223372036854775806u, 9223372036854775807u, 9223372036854775808u,
  9223372036854775809u, 18446744073709551615u
};

static uint64_t UNSIGNED[2u * N_INTEGERS];
static int64_t SIGNED[2u * N_INTEGERS];

/// x modulo 2^64.
static int64_t wrapped(wide x)
{
  const wide modulus = (wide)1 << 64;
  const wide rest = ((x % modulus) + modulus) % modulus;
  return (int64_t)(rest > INT64_MAX ? rest - modulus : rest);
}

static void fill_integers(void)
{
  for (size_t k = 0; k < N_INTEGERS; ++k) {
    const uint64_t bits = k < N_BORDERS ? BORDERS[k] : random_bits() >> random_below(64u);
    UNSIGNED[2u * k] = bits;
    UNSIGNED[2u * k + 1u] = ~bits;
    SIGNED[2u * k] = wrapped((wide)bits);
    SIGNED[2u * k + 1u] = wrapped(-(wide)bits);
  }
}

#define FOR_PAIRS(type, numbers, a, b) \
  for (size_t i = 0; i < LENGTH(numbers); ++i) \
  for (size_t j = 0; j < LENGTH(numbers); ++j) \
  for (type a = numbers[i], b = numbers[j], *once = &a; once != NULL; once = NULL)

static void bits_are_read_as_a_signed_number(void)
{
  for (size_t k = 0; k < LENGTH(UNSIGNED); ++k) {
    int64_t copied;
    memcpy(&copied, &UNSIGNED[k], sizeof(copied));
    CHECK(fm_signed(UNSIGNED[k]) == copied, "%llx", (unsigned long long)UNSIGNED[k]);
    CHECK(copied == wrapped((wide)UNSIGNED[k]), "%lld", (show)copied);
  }
}

static void signed_numbers_wrap(void)
{
  FOR_PAIRS(int64_t, SIGNED, a, b) {
    CHECK(fm_add_i64(a, b) == wrapped((wide)a + b), "%lld + %lld", (show)a, (show)b);
    CHECK(fm_sub_i64(a, b) == wrapped((wide)a - b), "%lld - %lld", (show)a, (show)b);
    CHECK(fm_mul_i64(a, b) == wrapped((wide)a * b), "%lld * %lld", (show)a, (show)b);
    CHECK(fm_neg_i64(a) == wrapped(-(wide)a), "%lld", (show)a);
    CHECK(fm_abs_i64(a) == wrapped(a < 0 ? -(wide)a : a), "%lld", (show)a);
  }
  CHECK(fm_abs_i64(INT64_MIN) == INT64_MIN && fm_neg_i64(INT64_MIN) == INT64_MIN, "least");
}

static void signed_division_truncates_and_is_0_by_0(void)
{
  FOR_PAIRS(int64_t, SIGNED, a, b) {
    const wide quotient = b == 0 ? 0 : (wide)a / b;
    const wide rest = b == 0 ? 0 : (wide)a - quotient * b;
    CHECK(fm_div_i64(a, b) == wrapped(quotient), "%lld / %lld", (show)a, (show)b);
    CHECK(fm_mod_i64(a, b) == rest, "%lld mod %lld", (show)a, (show)b);
    CHECK(rest == 0 || (rest < 0) == (a < 0), "%lld mod %lld", (show)a, (show)b);
  }
  CHECK(fm_div_i64(INT64_MIN, -1) == INT64_MIN && fm_mod_i64(INT64_MIN, -1) == 0, "least by -1");
  CHECK(fm_div_i64(-7, 2) == -3 && fm_mod_i64(-7, 2) == -1, "-7 by 2");
  CHECK(fm_div_i64(7, -2) == -3 && fm_mod_i64(7, -2) == 1, "7 by -2");
  CHECK(fm_div_i64(5, 0) == 0 && fm_mod_i64(5, 0) == 0, "5 by 0");
}

static void unsigned_numbers_wrap_and_divide(void)
{
  FOR_PAIRS(uint64_t, UNSIGNED, a, b) {
    const unsigned_wide modulus = (unsigned_wide)1 << 64;
    CHECK(fm_add_u64(a, b) == ((unsigned_wide)a + b) % modulus, "%llx + %llx", (show)a, (show)b);
    CHECK(fm_sub_u64(a, b) == (modulus + a - b) % modulus, "%llx - %llx", (show)a, (show)b);
    CHECK(fm_mul_u64(a, b) == (unsigned_wide)a * b % modulus, "%llx * %llx", (show)a, (show)b);
    CHECK(fm_neg_u64(a) == (modulus - a) % modulus, "%llx", (show)a);
    CHECK(fm_abs_u64(a) == a, "%llx", (show)a);
    const uint64_t quotient = fm_div_u64(a, b);
    const uint64_t rest = fm_mod_u64(a, b);
    CHECK(b != 0u || (quotient == 0u && rest == 0u), "%llx by 0", (show)a);
    CHECK(b == 0u || (rest < b && (unsigned_wide)quotient * b + rest == a), "%llx by %llx",
      (show)a, (show)b);
  }
}

static void numbers_compare_by_value_whatever_their_signs(void)
{
  for (size_t i = 0; i < LENGTH(SIGNED); ++i) {
    for (size_t j = 0; j < LENGTH(UNSIGNED); ++j) {
      const int64_t a = SIGNED[i];
      const uint64_t b = UNSIGNED[j];
      CHECK(fm_less_iu(a, b) == ((wide)a < (wide)b), "%lld < %llx", (show)a, (show)b);
      CHECK(fm_less_ui(b, a) == ((wide)b < (wide)a), "%llx < %lld", (show)b, (show)a);
      CHECK(fm_equal_iu(a, b) == ((wide)a == (wide)b), "%lld = %llx", (show)a, (show)b);
    }
  }
  CHECK(fm_less_iu(-1, 0u) && !fm_equal_iu(-1, UINT64_MAX), "-1 is less than any");
}

static void least_and_greatest_of_whole_numbers(void)
{
  FOR_PAIRS(int64_t, SIGNED, a, b) {
    CHECK(fm_min_i64(a, b) == (b < a ? b : a), "%lld, %lld", (show)a, (show)b);
    CHECK(fm_max_i64(a, b) == (b > a ? b : a), "%lld, %lld", (show)a, (show)b);
  }
  FOR_PAIRS(uint64_t, UNSIGNED, a, b) {
    CHECK(fm_min_u64(a, b) == (b < a ? b : a), "%llx, %llx", (show)a, (show)b);
    CHECK(fm_max_u64(a, b) == (b > a ? b : a), "%llx, %llx", (show)a, (show)b);
  }
}

static void powers_are_products(void)
{
  for (size_t k = 0; k < LENGTH(SIGNED); ++k) {
    const int64_t a = SIGNED[k];
    const uint64_t b = UNSIGNED[k];
    wide product = 1;
    unsigned_wide unsigned_product = 1u;
    for (uint64_t exponent = 0u; exponent < 200u; ++exponent) {
      CHECK(fm_power_i64(a, exponent) == (int64_t)product, "%lld ^ %lld", (show)a, (show)exponent);
      CHECK(fm_power_u64(b, exponent) == (uint64_t)unsigned_product, "%llx ^ %lld", (show)b,
        (show)exponent);
      product = wrapped(product * a);
      unsigned_product = (uint64_t)(unsigned_product * b);
    }
  }
}

/// Modulo 2^64, an odd number to the power 2^62 is 1 and an even one to the power 64 is 0.
static void powers_have_any_exponent(void)
{
  static const uint64_t exponents[] = {64u, 65u, INT32_MAX, (uint64_t)1 << 31, (uint64_t)1 << 62,
    ((uint64_t)1 << 62) + 5u, INT64_MAX, (uint64_t)1 << 63, UINT64_MAX};
  for (size_t k = 0; k < LENGTH(UNSIGNED) * LENGTH(exponents); ++k) {
    const uint64_t a = UNSIGNED[k % LENGTH(UNSIGNED)];
    const uint64_t n = exponents[k / LENGTH(UNSIGNED)];
    uint64_t expected = 0u;
    if (a % 2u == 1u) {
      const uint64_t rest = n % ((uint64_t)1 << 62);
      // a^rest as the product of a^(rest - 3) and a^3; a^-3 is a^(2^62 - 3)
      const uint64_t less = rest >= 3u ? rest - 3u : rest + ((uint64_t)1 << 62) - 3u;
      expected = fm_power_u64(a, less) * a * a * a;
    }
    CHECK(fm_power_u64(a, n) == expected, "%llx ^ %llx", (show)a, (show)n);
    CHECK(fm_power_i64(fm_signed(a), n) == fm_signed(expected), "%llx ^ %llx", (show)a, (show)n);
  }
}

// ---- floats ------------------------------------------------------------------------------------

static bool same_f32(float a, float b) {return memcmp(&a, &b, sizeof(a)) == 0;}
static bool same_f64(double a, double b) {return memcmp(&a, &b, sizeof(a)) == 0;}

static float random_f32(void)
{
  const uint32_t bits = (uint32_t)random_bits();
  float value;
  memcpy(&value, &bits, sizeof(value));
  return value;
}

static double random_f64(void)
{
  const uint64_t bits = random_bits();
  double value;
  memcpy(&value, &bits, sizeof(value));
  return value;
}

/// Specials first, then random bits; `is_ordered` where neither is NaN.
#define FLOAT_CHECKS(suffix, type, least, greatest) \
  static type pick_ ## suffix(uint64_t k) \
  { \
    static const type specials[] = { \
      (type)0.0, (type)-0.0, (type)1.0, (type)-1.0, (type)INFINITY, (type)-INFINITY, (type)NAN, \
      (type)-NAN, least, -least, least / (type)2.0, greatest, -greatest, (type)0.1, (type)3.5 \
    }; \
    return k < LENGTH(specials) ? specials[k] : random_ ## suffix(); \
  } \
  static void check_extremes_ ## suffix(type a, type b) \
  { \
    const bool is_ordered = !isnan(a) && !isnan(b); \
    const type least_one = fm_min_ ## suffix(a, b); \
    const type greatest_one = fm_max_ ## suffix(a, b); \
    const bool second_is_less = is_ordered && b < a; \
    const bool second_is_more = is_ordered && b > a; \
    CHECK(same_ ## suffix(least_one, is_ordered && !second_is_less ? a : b), "%g, %g", (double)a, \
      (double)b); \
    CHECK(same_ ## suffix(greatest_one, is_ordered && !second_is_more ? a : b), "%g, %g", \
      (double)a, (double)b); \
  } \
  static void check_abs_ ## suffix(type a) \
  { \
    const type size = fm_abs_ ## suffix(a); \
    CHECK(isnan(a) ? isnan(size) : !(size < (type)0.0), "%g", (double)a); \
    CHECK(isnan(a) || size == a || size == -a, "%g", (double)a); \
    CHECK(a < (type)0.0 || isnan(a) || same_ ## suffix(size, a), "%g keeps its sign", (double)a); \
  } \
  static void check_power_ ## suffix(type base, unsigned exponent) \
  { \
    type squared[5] = {base}; \
    type product = (type)1.0; \
    for (size_t k = 1; k < 5u; ++k) { \
      squared[k] = squared[k - 1u] * squared[k - 1u]; \
    } \
    for (size_t k = 0; k < 5u; ++k) { \
      if (fm_bit(exponent, (unsigned)k)) { \
        product = product * squared[k]; \
      } \
    } \
    const type power = fm_power_ ## suffix(base, exponent); \
    CHECK(isnan(product) ? isnan(power) : same_ ## suffix(power, product), "%g ^ %u", \
      (double)base, exponent); \
  } \
  static void check_exact_power_ ## suffix(int base, unsigned exponent) \
  { \
    long long product = 1; \
    for (unsigned k = 0u; k < exponent; ++k) { \
      product *= base; \
    } \
    CHECK(same_ ## suffix(fm_power_ ## suffix((type)base, exponent), (type)product), "%d ^ %u", \
      base, exponent); \
  } \
  static void check_mod_ ## suffix(int a, int b) \
  { \
    const type rest = fm_mod_ ## suffix((type)a / (type)8.0, (type)b / (type)8.0); \
    CHECK(rest * (type)8.0 == (type)(a % b), "%d mod %d eighths", a, b); \
    CHECK((signbit(rest) != 0) == (a < 0), "%d mod %d eighths", a, b); \
  } \
  static void follow_floats_ ## suffix(void) \
  { \
    for (uint64_t k = 0u; k < 900u; ++k) { \
      const type a = pick_ ## suffix(k % 30u); \
      check_extremes_ ## suffix(a, pick_ ## suffix(k / 30u)); \
      check_extremes_ ## suffix(a, a); \
      check_abs_ ## suffix(a); \
      check_power_ ## suffix(a, (unsigned)(k / 30u)); \
      check_power_ ## suffix((type)(7000u + random_below(999u)) / (type)7e3, (unsigned)k % 32u); \
      check_exact_power_ ## suffix((int)(k % 9u) - 4, (unsigned)(k / 9u % 12u)); \
      check_mod_ ## suffix((int)(k / 30u) * 7 - 100, (int)(k % 30u) * 2 - 31); \
    } \
  }

FLOAT_CHECKS(f32, float, FLT_MIN, FLT_MAX)
FLOAT_CHECKS(f64, double, DBL_MIN, DBL_MAX)

static void functions_of_floats_have_the_words_of_the_manual(void)
{
  follow_floats_f32();
  follow_floats_f64();
}

static void min_and_max_give_the_second_where_one_is_nan(void)
{
  CHECK(fm_min_f64((double)NAN, 2.0) == 2.0 && fm_max_f64((double)NAN, 2.0) == 2.0, "NaN first");
  CHECK(isnan(fm_min_f64(2.0, (double)NAN)) && isnan(fm_max_f64(2.0, (double)NAN)), "NaN second");
  CHECK(fm_min_f32(NAN, 2.0f) == 2.0f && fm_max_f32(NAN, 2.0f) == 2.0f, "NaN first");
  CHECK(isnan(fm_min_f32(2.0f, NAN)) && isnan(fm_max_f32(2.0f, NAN)), "NaN second");
  CHECK(same_f64(fm_min_f64(-0.0, 0.0), -0.0) && same_f64(fm_min_f64(0.0, -0.0), 0.0), "zeros");
  CHECK(same_f64(fm_max_f64(-0.0, 0.0), -0.0) && same_f64(fm_max_f64(0.0, -0.0), 0.0), "zeros");
  CHECK(same_f64(fm_abs_f64(-0.0), -0.0) && same_f32(fm_abs_f32(-0.0f), -0.0f), "zeros");
}

static void mod_of_special_floats_is_that_of_c(void)
{
  const double inf = (double)INFINITY;
  CHECK(isnan(fm_mod_f64(1.0, 0.0)) && isnan(fm_mod_f32(1.0f, 0.0f)), "by zero");
  CHECK(isnan(fm_mod_f64(inf, 2.0)) && isnan(fm_mod_f32(INFINITY, 2.0f)), "of infinity");
  CHECK(isnan(fm_mod_f64((double)NAN, 2.0)) && isnan(fm_mod_f64(2.0, (double)NAN)), "of NaN");
  CHECK(fm_mod_f64(2.5, inf) == 2.5 && fm_mod_f32(-2.5f, INFINITY) == -2.5f, "by infinity");
  CHECK(same_f64(fm_mod_f64(-0.0, 2.0), -0.0), "of -0");
  CHECK(same_f32(fm_mod_f32(-4.0f, 2.0f), -0.0f), "-4 mod 2");
}

/// A product of two float32 is exact in float64, so it must be rounded only once.
static void a_float32_product_is_rounded_once(void)
{
  for (int round = 0; round < 20000; ++round) {
    const float a = random_f32();
    const float b = random_f32();
    const float product = fm_mul_f32(a, b);
    const double exact = (double)a * (double)b;
    CHECK(isnan(exact) ? isnan(product) : product == (float)exact, "%g * %g", (double)a,
      (double)b);
  }
}

static void powers_of_special_floats(void)
{
  CHECK(fm_power_f64((double)NAN, 0u) == 1.0 && fm_power_f32(INFINITY, 0u) == 1.0f, "to 0");
  CHECK(same_f64(fm_power_f64(-0.0, 3u), -0.0) && same_f64(fm_power_f64(-0.0, 2u), 0.0), "zeros");
  CHECK(fm_power_f64(2.0, 1023u) == ldexp(1.0, 1023), "2^1023");
  CHECK(isinf(fm_power_f64(2.0, 1024u)) && isinf(fm_power_f32(2.0f, 128u)), "overflow");
  CHECK(fm_power_f64(-1.0, UINT64_MAX) == -1.0 && fm_power_f32(-1.0f, INT32_MAX) == -1.0f, "odd");
  CHECK(fm_power_f64(0.5, UINT64_MAX) == 0.0, "underflow");
}

// ---- the checks --------------------------------------------------------------------------------

struct named_check
{
  const char * name;
  void (* run)(void);
};

#define NAMED(name) {#name, name}
static const struct named_check CHECKS[] = {
  NAMED(counters_follow_the_definition_of_their_operator),
  NAMED(counters_follow_the_definition_on_all_traces_of_six_steps),
  NAMED(many_quiet_steps_are_what_the_checks_take_them_for),
  NAMED(counters_are_right_at_the_borders_of_their_types),
  NAMED(counters_of_16_bits_are_right_step_by_step_at_their_border),
  NAMED(counters_recover_from_an_invalid_state),
  NAMED(counters_can_start_as_if_something_had_been),
  NAMED(bits_of_a_word_are_its_bits),
  NAMED(lines_give_what_was_put_in_so_many_steps_ago),
  NAMED(rings_give_what_was_put_in_so_many_steps_ago),
  NAMED(positions_go_round),
  NAMED(bits_are_read_as_a_signed_number),
  NAMED(signed_numbers_wrap),
  NAMED(signed_division_truncates_and_is_0_by_0),
  NAMED(unsigned_numbers_wrap_and_divide),
  NAMED(numbers_compare_by_value_whatever_their_signs),
  NAMED(least_and_greatest_of_whole_numbers),
  NAMED(powers_are_products),
  NAMED(powers_have_any_exponent),
  NAMED(functions_of_floats_have_the_words_of_the_manual),
  NAMED(min_and_max_give_the_second_where_one_is_nan),
  NAMED(mod_of_special_floats_is_that_of_c),
  NAMED(a_float32_product_is_rounded_once),
  NAMED(powers_of_special_floats),
};

static bool run_named(const char * name)
{
  const bool all = strcmp(name, "all") == 0;
  bool found = false;
  for (size_t k = 0; k < LENGTH(CHECKS); ++k) {
    if (all || strcmp(name, CHECKS[k].name) == 0) {
      found = true;
      CHECKS[k].run();
    }
  }
  return found;
}

int main(int argc, char ** argv)
{
  fill_integers();
  if (argc > 1 && strcmp(argv[1], "start") == 0) {
    follow_given_starts(argc - 2, argv + 2);
    return 0;
  }
  if (argc > 1) {
    return run_named(argv[1]) ? 0 : 1;
  }
  for (size_t k = 0; k < LENGTH(CHECKS); ++k) {
    puts(CHECKS[k].name);
  }
  return 0;
}
