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

/// Checks the cells of fret_cells.h that step at ticks against the definitions of the operators,
/// at every tick of all short traces: a cell is stepped where an argument changes and where it
/// asked to be, and must have the same result until then. O[a,b] q is checked as p S[a,b] q.

#include "fret_cells.h"

#include <math.h>
#include <stdlib.h>

#include "check.h"

enum { TICKS = 9, MOST = 4, NUMBERS = 4 + 2 * (MOST + 1) };

enum kind { ONCE, ALWAYS, SINCE, ONCE_LATER, SINCE_LATER, BETWEEN };

/// A window: low and high, or high < 0 for none.
struct window
{
  enum kind kind;
  int64_t low, high;
  int64_t head;
};

struct run
{
  struct window window;
  int64_t state[NUMBERS];
  int64_t capacity;
};

static bool has_p(enum kind kind)
{
  return kind == SINCE || kind == SINCE_LATER || kind == BETWEEN;
}

static bool is_before(enum kind kind) {return kind == ONCE_LATER || kind == SINCE_LATER;}

static void start(struct run * run)
{
  const struct window * w = &run->window;
  for (int i = 0; i < NUMBERS; ++i) {
    run->state[i] = 0;
  }
  if (w->kind != BETWEEN) {
    run->state[0] = is_before(w->kind) ? FM_NEVER : w->head - 1;
  }
  run->capacity = w->kind == BETWEEN ? w->high / (w->high - w->low + 2) + 1 : 0;
}

static bool step(struct run * run, bool p, bool q, int64_t tick, int64_t * next)
{
  const struct window * w = &run->window;
  int64_t * const state = run->state;
  switch (w->kind) {
    case ONCE: return fm_once_within_at(state, w->high, q, tick, next);
    case ALWAYS: return fm_always_within_at(state, w->high, q, tick, next);
    case SINCE: return fm_since_within_at(state, w->high, p, q, tick, next);
    case ONCE_LATER: return fm_once_before_at(state, w->low, q, tick, next);
    case SINCE_LATER: return fm_since_before_at(state, w->low, p, q, tick, next);
    case BETWEEN:
    default: return fm_since_between_at(state, run->capacity, w->low, w->high, p, q, tick, next);
  }
}

/// The definition: q at some k with low <= t - k <= high, and p at every tick from k + 1 to t.
static bool holds(const struct window * w, const bool * p, const bool * q, int t)
{
  const bool sought = w->kind != ALWAYS;
  bool found = t < w->head;
  for (int k = t; k >= 0; --k) {
    const bool inside = t - k >= w->low && (is_before(w->kind) || t - k <= w->high);
    found |= inside && q[k] == sought;
    if (has_p(w->kind) && !p[k]) {
      break;
    }
  }
  return found == sought;
}

/// Run one trace: bit t of `ps` and `qs` is p and q at tick t.
static void check_trace(struct run * run, unsigned ps, unsigned qs)
{
  bool p[TICKS], q[TICKS];
  bool out = false;
  int64_t due = 0;
  start(run);
  for (int t = 0; t < TICKS; ++t) {
    p[t] = (ps >> t & 1u) != 0u;
    q[t] = (qs >> t & 1u) != 0u;
    const bool has_changed = t > 0 && (p[t] != p[t - 1] || q[t] != q[t - 1]);
    if (due == t || has_changed) {
      due = FM_NEVER;
      out = step(run, p[t], q[t], t, &due);
      CHECK(due > t);
    }
    if (out != holds(&run->window, p, q, t)) {
      printf("kind %d [%d,%d] head %d, p %x, q %x, tick %d\n", (int)run->window.kind,
        (int)run->window.low, (int)run->window.high, (int)run->window.head, ps, qs, t);
      exit(1);
    }
  }
}

static void check_window(struct window window)
{
  struct run run = {window, {0}, 0};
  for (unsigned ps = 0; ps < (has_p(window.kind) ? 1u << TICKS : 1u); ++ps) {
    for (unsigned qs = 0; qs < 1u << TICKS; ++qs) {
      check_trace(&run, ps, qs);
    }
  }
}

static void check_all_windows(void)
{
  for (int64_t b = 1; b <= MOST; ++b) {
    for (int64_t head = 0; head <= b + 1; ++head) {
      check_window((struct window) {ONCE, 0, b, head});
      check_window((struct window) {ALWAYS, 0, b, head});
    }
    check_window((struct window) {SINCE, 0, b, 0});
    check_window((struct window) {ONCE_LATER, b, -1, 0});
    check_window((struct window) {SINCE_LATER, b, -1, 0});
    for (int64_t a = 1; a <= b; ++a) {
      check_window((struct window) {BETWEEN, a, b, 0});
    }
  }
}

/// With bounds and ticks near the greatest, nothing overflows (the sanitizer would say so).
static void check_limits(void)
{
  const int64_t most = INT64_C(1) << 62;
  for (int kind = ONCE; kind <= BETWEEN; ++kind) {
    struct run run = {{(enum kind)kind, most, most, 0}, {0}, 0};
    start(&run);
    run.capacity = MOST;
    int64_t next = FM_NEVER;
    (void)step(&run, false, true, 0, &next);
    (void)step(&run, true, false, FM_LAST_TICK - 2, &next);
    next = FM_NEVER;
    (void)step(&run, true, true, FM_LAST_TICK - 1, &next);
    CHECK(next > FM_LAST_TICK - 1);
    (void)step(&run, true, false, FM_LAST_TICK, &next);
  }
}

/// A queue that is too short says until when an interval is missed, and is right after that.
static void check_overflow(void)
{
  int64_t queue[4 + 2 * 2] = {0};
  int64_t next = FM_NEVER;
  for (int64_t t = 0; t <= 5; ++t) {  // q at 0, 2 and 4, for a tick each
    next = FM_NEVER;
    (void)fm_since_between_at(queue, 2, 10, 10, true, t % 2 == 0, t, &next);
    CHECK(fm_overflowed_at(queue, t, &next) == (t >= 4));
  }
  CHECK(fm_overflowed_at(queue, 10, &next));
  CHECK(queue[3] == 1);
  next = FM_NEVER;
  CHECK(!fm_overflowed_at(queue, 11, &next));
  CHECK(next == FM_NEVER);
  for (int64_t t = 11; t <= 15; ++t) {
    CHECK(fm_since_between_at(queue, 2, 10, 10, true, false, t, &next) == (t == 12 || t == 14));
  }
}

static void check_numbers(void)
{
  CHECK(fm_same_f64(0.5, 0.5) && !fm_same_f64(0.0, -0.0) && fm_same_f64(NAN, NAN));
  CHECK(fm_same_f32(0.5f, 0.5f) && !fm_same_f32(0.0f, -0.0f) && fm_same_f32(NAN, NAN));
}

int main(void)
{
  check_all_windows();
  check_limits();
  check_overflow();
  check_numbers();
  return failures == 0 ? 0 : 1;
}
