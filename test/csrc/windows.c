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

/// windows.c: the cells of fret_windows.h, for all values and traces of windows up to a size.
///
/// By steps, which words are combined follows from the number of steps alone, so that traces with
/// one word that differs from the others show it for all words. The state of a cell after LATER
/// more steps is that of before with later words; so what holds until then always holds.
///
/// By ticks, all traces of TICKS ticks of two words and of events are followed, each with all
/// choices of further ticks at which the group is evaluated. A cell of too little room is right,
/// or says that it may not be.
///
/// Of exact sums, doubles of every exponent enter and leave.

#include "fret_windows.h"

#include <string.h>

#include "check.h"

#define LONGEST 64
#define MOST_STEPS (70 * LONGEST)

// ---- by steps ----------------------------------------------------------------------------------

struct run
{
  int64_t state[8 + LONGEST + 2];
  int64_t out[MOST_STEPS];
};

typedef int64_t (* step_function)(int64_t * state, int64_t length, int64_t word);

static int64_t greatest(int64_t * state, int64_t length, int64_t word)
{
  return fm_greatest(state, length + 1, word);
}

static const int64_t USUAL = 3, OTHER = 1000;

// Run `steps` steps of a trace with one other word, if `other` is one of them.
static void follow(step_function step, int64_t length, int steps, int other, struct run * run)
{
  memset(run, 0, sizeof(*run));
  for (int t = 0; t < steps; ++t) {
    run->out[t] = step(run->state, length, t == other ? OTHER : USUAL);
  }
}

static int64_t later_of(int64_t a, int64_t b) {return a > b ? a : b;}

static int64_t expected(step_function step, int64_t length, int t, int other)
{
  const bool is_inside = other >= 0 && other <= t && other > t - length;
  if (step == fm_ago) {
    return other == later_of(t - length, 0) ? OTHER : USUAL;
  }
  if (step == fm_sum) {
    const int64_t n = t < length ? t + 1 : length;
    return n * USUAL + (is_inside ? OTHER - USUAL : 0);
  }
  return is_inside ? OTHER : USUAL;
}

// How many steps later the state is the same; 0: not within the steps that are followed.
static int find_later(step_function step, int64_t length, int from, int places)
{
  struct run first, second;
  follow(step, length, from, -1, &first);
  for (int later = 1; from + later < MOST_STEPS; ++later) {
    follow(step, length, from + later, -1, &second);
    if (memcmp(first.state, second.state, (size_t)places * sizeof(int64_t)) == 0) {
      return later;
    }
  }
  return 0;
}

static void check_steps(step_function step, int64_t length, int places)
{
  const int from = 4 * (int)length;
  const int later = find_later(step, length, from, places);
  CHECK(later > 0);
  for (int other = -1; other < from + later; ++other) {
    struct run before, after;
    follow(step, length, from, other < later ? -1 : other - later, &before);
    follow(step, length, from + later, other, &after);
    CHECK(memcmp(before.state, after.state, sizeof(before.state)) == 0);
    for (int t = 0; t < from + later; ++t) {
      CHECK(after.out[t] == expected(step, length, t, other));
    }
  }
}

static void check_all_steps(void)
{
  for (int64_t length = 1; length <= LONGEST; ++length) {
    check_steps(fm_ago, length, 3);
    check_steps(fm_sum, length, 3);
    check_steps(greatest, length, 8);
  }
}

// ---- by ticks ----------------------------------------------------------------------------------

#define TICKS 6
#define MOST_PAST 4

struct trace
{
  unsigned words, events, looks;  // bit t: at tick t
  int64_t past, room;
};

struct cell
{
  int64_t window[16], queue[32];
};

typedef int64_t (* tick_function)(
  struct cell * cell, const struct trace * trace, int64_t tick, int64_t * next);
typedef int64_t (* meaning_function)(const struct trace * trace, int64_t tick);

static bool bit(unsigned bits, int64_t tick) {return ((bits >> tick) & 1u) != 0u;}

static int64_t word_at(const struct trace * trace, int64_t tick)
{
  return bit(trace->words, tick) ? 7 : -2;
}

static int64_t ago_at(
  struct cell * cell, const struct trace * trace, int64_t tick, int64_t * next)
{
  return fm_ago_at(cell->queue, trace->room, trace->past, word_at(trace, tick), tick, next);
}

static int64_t word_ago(const struct trace * trace, int64_t tick)
{
  return word_at(trace, later_of(tick - trace->past, 0));
}

static int64_t sum_at(
  struct cell * cell, const struct trace * trace, int64_t tick, int64_t * next)
{
  return fm_sum_at(cell->queue, trace->room, trace->past, bit(trace->events, tick),
    word_at(trace, tick), tick, next);
}

static int64_t sum_of(const struct trace * trace, int64_t tick)
{
  int64_t sum = 0;
  for (int64_t t = later_of(tick - trace->past, 0); t <= tick; ++t) {
    sum += bit(trace->events, t) ? word_at(trace, t) : 0;
  }
  return sum;
}

static int64_t greatest_at(
  struct cell * cell, const struct trace * trace, int64_t tick, int64_t * next)
{
  return fm_greatest_at(cell->window, cell->queue, trace->room + 1, trace->past,
    word_at(trace, tick), tick, next);
}

static int64_t greatest_of(const struct trace * trace, int64_t tick)
{
  int64_t most = INT64_MIN;
  for (int64_t t = later_of(tick - trace->past, 0); t <= tick; ++t) {
    most = later_of(most, word_at(trace, t));
  }
  return most;
}

// Of half the window or more.
static int64_t time_at(
  struct cell * cell, const struct trace * trace, int64_t tick, int64_t * next)
{
  return fm_time_over_at(cell->queue, trace->room, trace->past, (trace->past + 1) / 2,
    bit(trace->words, tick), tick, next);
}

static int64_t time_of(const struct trace * trace, int64_t tick)
{
  int64_t count = 0;
  for (int64_t t = later_of(tick - trace->past + 1, 0); t <= tick; ++t) {
    count += bit(trace->words, t) ? 1 : 0;
  }
  return count >= (trace->past + 1) / 2;
}

static bool has_changed(const struct trace * trace, int64_t tick)
{
  return tick == 0 || bit(trace->words, tick) != bit(trace->words, tick - 1) ||
         bit(trace->events, tick) != bit(trace->events, tick - 1);
}

// Returns whether something found no room.
static bool check_trace(
  tick_function step, meaning_function meaning, const struct trace * trace)
{
  struct cell cell;
  int64_t next = 0, out = 0;
  bool is_told = false;
  memset(&cell, 0, sizeof(cell));
  for (int64_t tick = 0; tick < TICKS; ++tick) {
    if (tick == next || has_changed(trace, tick) || bit(trace->looks, tick)) {
      next = FM_NEVER;
      out = step(&cell, trace, tick, &next);
      is_told = fm_overflowed_at(cell.queue, tick, &next);
    }
    CHECK(next > tick && (is_told || out == meaning(trace, tick)));
  }
  return cell.queue[3] > 0;
}

static void check_ticks(tick_function step, meaning_function meaning, bool has_events)
{
  const unsigned all = 1u << TICKS;
  for (int64_t past = 1; past <= MOST_PAST; ++past) {
    unsigned lost = 0;
    for (int64_t room = 1; room <= past + 1; ++room) {
      struct trace trace = {0, 0, 0, past, room};
      for (trace.words = 0; trace.words < all; ++trace.words) {
        for (trace.events = 0; trace.events < (has_events ? all : 1u); ++trace.events) {
          for (trace.looks = 0; trace.looks < all; ++trace.looks) {
            lost = check_trace(step, meaning, &trace) ? (unsigned)room : lost;
          }
        }
      }
    }
    CHECK((int64_t)lost <= past);  // a cell with room for each tick never loses any
    CHECK(lost > 0 || past < MOST_PAST);
  }
}

// ---- exact sums --------------------------------------------------------------------------------

// A double that enters and leaves changes no bit of a sum; without another it is the sum and mean.
static void check_double(const uint64_t * sum, int64_t word)
{
  uint64_t after[FM_SUM_LENGTH];
  const double number = fm_number_f64(word);
  memcpy(after, sum, sizeof(after));
  fm_add_exactly(after, word, false);
  CHECK(sum[FM_COUNT] > 0u || fm_exact_quotient(after, 1u) == number);
  fm_add_exactly(after, word, false);
  CHECK(sum[FM_COUNT] > 0u || fm_exact_mean(after) == number);
  fm_add_exactly(after, word, true);
  fm_add_exactly(after, word, true);
  CHECK(memcmp(after, sum, sizeof(after)) == 0);
}

static void check_all_exponents(const uint64_t * sum)
{
  static const uint64_t fractions[] = {
    0u, 1u, UINT64_C(0x5555555555555), UINT64_C(0xfffffffffffff)};
  for (uint64_t exponent = 0; exponent < 0x7ffu; ++exponent) {
    for (unsigned k = 0; k < 8u; ++k) {
      check_double(sum, fm_signed(
          ((uint64_t)(k & 1u) << 63) | (exponent << 52) | fractions[k >> 1]));
    }
  }
}

// In sums of 0, and of words that are all ones, so that carries and borrows pass through all.
static void check_exact_sums(void)
{
  static const double others[] = {-5e-324, 5e-324, 1e308, -1.5};
  uint64_t sum[FM_SUM_LENGTH] = {0u};
  check_all_exponents(sum);
  for (size_t k = 0; k < sizeof(others) / sizeof(others[0]); ++k) {
    fm_add_exactly(sum, fm_word_f64(others[k]), false);
    check_all_exponents(sum);
  }
}

int main(void)
{
  check_all_steps();
  check_exact_sums();
  check_ticks(ago_at, word_ago, false);
  check_ticks(sum_at, sum_of, true);
  check_ticks(greatest_at, greatest_of, false);
  check_ticks(time_at, time_of, false);
  return failures != 0;
}
