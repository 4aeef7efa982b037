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

/// fret_windows.h: the cells of generated monitors that aggregate numbers over time.
///
/// Contract: as in fret_cells.h. Every function takes O(1) time in the worst case, whatever the
/// length of the window: a sum touches at most the 34 words of its exact value. All state is 0 at
/// the start.
///
/// A cell whose name ends in _at is for groups that step at ticks. Each evaluation lets at most
/// one entry leave the window: the instant at which one leaves is a deadline, and the caller
/// evaluates at each. Its state begins as the queue of fm_since_between_at does, so that
/// fm_overflowed_at applies: queue[0]: the index of the oldest entry; queue[1]: how many;
/// queue[2]: the last tick at which an entry that found no room is missed; queue[3]: how many
/// found none.

#ifndef FRET_WINDOWS_H_
#define FRET_WINDOWS_H_

#include "fret_cells.h"

/// Numbers as words of 64 bits, in which windows store them, and back.
static inline int64_t fm_word_f64(double x)
{
  const union {double number; uint64_t bits;} word = {x};
  return fm_signed(word.bits);
}

static inline double fm_number_f64(int64_t word)
{
  union {uint64_t bits; double number;} x;
  x.bits = (uint64_t)word;
  return x.number;
}

static inline int64_t fm_word_f32(float x) {return fm_word_f64((double)x);}
static inline float fm_number_f32(int64_t word) {return (float)fm_number_f64(word);}
static inline int64_t fm_word_i64(int64_t x) {return x;}
static inline int64_t fm_number_i64(int64_t word) {return word;}
static inline int64_t fm_word_u64(uint64_t x) {return fm_signed(x);}
static inline uint64_t fm_number_u64(int64_t word) {return (uint64_t)word;}

// ---- rings -------------------------------------------------------------------------------------

/// Store a word in the place of the oldest of `length` words. Returns whether one was there, and
/// then writes it to *left. ring[0]: the place; ring[1]: how many are stored; the words: from
/// ring[3].
static inline bool fm_put(int64_t * ring, int64_t length, int64_t word, int64_t * left)
{
  int64_t * const place = &ring[3 + ring[0]];
  const bool is_full = ring[1] == length;
  *left = *place;
  *place = word;
  ring[0] = ring[0] + 1 == length ? 0 : ring[0] + 1;
  ring[1] += is_full ? 0 : 1;
  return is_full;
}

/// The word `past` steps ago, the first one if that is later; past > 0. A ring of `past` words.
static inline int64_t fm_ago(int64_t * ring, int64_t past, int64_t word)
{
  const int64_t first = ring[1] == 0 ? word : ring[3];
  int64_t left;
  return fm_put(ring, past, word, &left) ? left : first;
}

/// The sum of the last `length` words, modulo 2^64. ring[2]: the sum.
static inline int64_t fm_sum(int64_t * ring, int64_t length, int64_t word)
{
  int64_t left;
  const bool has_left = fm_put(ring, length, word, &left);
  ring[2] = fm_signed((uint64_t)ring[2] + (uint64_t)word - (has_left ? (uint64_t)left : 0u));
  return ring[2];
}

/// Store an entry of a queue; if there is no room, drop the oldest one, which is missed until
/// `missed`. Returns whether one was dropped.
static inline bool fm_enter(
  int64_t * queue, int64_t capacity, int64_t first, int64_t second, int64_t missed)
{
  const bool is_full = queue[1] == capacity;
  if (is_full) {
    queue[2] = missed > queue[2] ? missed : queue[2];
    queue[3] += 1;
    fm_drop_oldest(queue, capacity);
  }
  int64_t * const added = fm_interval(queue, capacity, queue[1]);
  added[0] = first;
  added[1] = second;
  queue[1] += 1;
  return is_full;
}

/// The word `past` ticks ago, that of tick 0 if that is later. The entries are the tick from which
/// a word holds, and the word. The oldest entry holds until the tick before the next one's.
static inline int64_t fm_ago_at(
  int64_t * queue, int64_t capacity, int64_t past, int64_t word, int64_t tick, int64_t * next)
{
  if (queue[1] > 1 && fm_interval(queue, capacity, 1)[0] <= tick - past) {
    fm_drop_oldest(queue, capacity);
  }
  if (queue[1] == 0 || fm_interval(queue, capacity, queue[1] - 1)[1] != word) {
    const int64_t second = queue[1] > 1 ? fm_interval(queue, capacity, 1)[0] : tick;
    fm_enter(queue, capacity, tick, word, second + past - 1);
  }
  if (queue[1] > 1) {
    fm_lower(next, true, fm_interval(queue, capacity, 1)[0] + past);
  }
  return fm_interval(queue, capacity, 0)[1];
}

/// The sum of the words at the ticks of the window at which `at` holds, modulo 2^64. The entries
/// are such ticks and words. queue[4 + 2 * capacity]: the sum.
static inline int64_t fm_sum_at(
  int64_t * queue, int64_t capacity, int64_t past, bool at, int64_t word, int64_t tick,
  int64_t * next)
{
  uint64_t sum = (uint64_t)queue[4 + 2 * capacity];
  if (queue[1] > 0 && fm_interval(queue, capacity, 0)[0] < tick - past) {
    sum -= (uint64_t)fm_interval(queue, capacity, 0)[1];
    fm_drop_oldest(queue, capacity);
  }
  if (at) {
    const int64_t * const oldest = fm_interval(queue, capacity, 0);
    const int64_t begin = oldest[0], left = oldest[1];
    sum += (uint64_t)word;
    sum -= fm_enter(queue, capacity, tick, word, begin + past) ? (uint64_t)left : 0u;
  }
  queue[4 + 2 * capacity] = fm_signed(sum);
  if (queue[1] > 0) {
    fm_lower(next, true, fm_interval(queue, capacity, 0)[0] + past + 1);
  }
  fm_lower(next, at, tick + 1);  // `at` may hold for longer than a tick
  return fm_signed(sum);
}

/// The change of x between the last two ticks at which `at` holds, per second; 0 before the
/// second. last[0]: the tick after the last such one, 0 before the first; last[1]: x there, as a
/// word.
static inline double fm_slope_at(
  double * slope, int64_t * last, double x, bool at, int64_t tick, int64_t * next)
{
  if (at) {
    const double seconds = (double)(tick + 1 - last[0]) / 1e9;
    *slope = last[0] == 0 ? 0.0 : (x - fm_number_f64(last[1])) / seconds;
    last[0] = tick + 1;
    last[1] = fm_word_f64(x);
  }
  fm_lower(next, at, tick + 1);  // `at` may hold for longer than a tick
  return *slope;
}

/// The change of x between the last two steps at which `at` holds, per second, with a step
/// every `period` ns; 0 before the second. last[0]: the ns since the last such one, 0 before the
/// first; last[1]: as above.
static inline double fm_slope(double * slope, int64_t * last, double x, bool at, int64_t period)
{
  if (at) {
    const double seconds = (double)last[0] / 1e9;
    *slope = last[0] == 0 ? 0.0 : (x - fm_number_f64(last[1])) / seconds;
    last[0] = 0;
    last[1] = fm_word_f64(x);
  }
  last[0] += (at || last[0] > 0) ? period : 0;
  return *slope;
}

/// Whether p held at `least` or more of the last `past` ticks; 0 < least <= past. The entries are
/// the first and last ticks of intervals in which p holds, FM_NEVER while it does.
/// queue[4 + 2 * capacity]: the ticks of those that are over.
static inline bool fm_time_over_at(
  int64_t * queue, int64_t capacity, int64_t past, int64_t least, bool p, int64_t tick,
  int64_t * next)
{
  int64_t * const over = &queue[4 + 2 * capacity];
  int64_t * const newest =
    queue[1] > 0 ? fm_interval(queue, capacity, queue[1] - 1) : NULL;
  const bool held = newest != NULL && newest[1] == FM_NEVER;
  if (held && !p) {
    newest[1] = tick - 1;
    *over += tick - newest[0];
  }
  if (queue[1] > 0 && fm_interval(queue, capacity, 0)[1] <= tick - past) {
    const int64_t * const oldest = fm_interval(queue, capacity, 0);
    *over -= oldest[1] - oldest[0] + 1;
    fm_drop_oldest(queue, capacity);
  }
  if (p && !held) {
    const int64_t * const oldest = fm_interval(queue, capacity, 0);
    const int64_t begin = oldest[0], end = oldest[1];
    *over -= fm_enter(queue, capacity, tick, FM_NEVER, end + past - 1) ? end - begin + 1 : 0;
  }
  if (queue[1] == 0) {
    return false;
  }
  const int64_t * const oldest = fm_interval(queue, capacity, 0);
  const int64_t gone = tick - past + 1 - oldest[0];  // ticks of the oldest that have left
  const int64_t present =
    p ? tick - fm_interval(queue, capacity, queue[1] - 1)[0] + 1 : 0;
  const int64_t count = *over + present - (gone > 0 ? gone : 0);
  const bool is_leaving = gone >= 0;  // another tick of the oldest leaves at the next tick
  fm_lower(next, !is_leaving, oldest[0] + past);
  if (is_leaving && oldest[1] != FM_NEVER) {
    fm_lower(next, true, oldest[1] + past);
  }
  fm_lower(next, p & !is_leaving & (count < least), tick + (least - count));
  fm_lower(next, !p & is_leaving & (count >= least), tick + (count - least) + 1);
  return count >= least;
}

// ---- greatest and least ------------------------------------------------------------------------

/// Numbers as words in the order of the numbers, -0 before 0, and NaN above all others; and back.
/// A least number is the greatest of the words of the negated order: its word is the complement,
/// but for NaN.
#define FM_NAN_KEY INT64_C(0x7ff8000000000000)

static inline int64_t fm_key_f64(double x, bool is_least)
{
  const int64_t word = fm_word_f64(x);
  const int64_t key = word < 0 ? word ^ INT64_MAX : word;
  return x != x ? FM_NAN_KEY : is_least ? ~key : key;
}

static inline double fm_of_key_f64(int64_t key, bool is_least)
{
  const int64_t ordered = is_least && key != FM_NAN_KEY ? ~key : key;
  return fm_number_f64(ordered < 0 ? ordered ^ INT64_MAX : ordered);
}

static inline int64_t fm_key_f32(float x, bool is_least) {return fm_key_f64((double)x, is_least);}

static inline float fm_of_key_f32(int64_t key, bool is_least)
{
  return (float)fm_of_key_f64(key, is_least);
}

static inline int64_t fm_key_i64(int64_t x, bool is_least) {return is_least ? ~x : x;}
static inline int64_t fm_of_key_i64(int64_t key, bool is_least) {return is_least ? ~key : key;}

static inline int64_t fm_key_u64(uint64_t x, bool is_least)
{
  return fm_key_i64(fm_signed(x ^ (UINT64_C(1) << 63)), is_least);
}

static inline uint64_t fm_of_key_u64(int64_t key, bool is_least)
{
  return (uint64_t)fm_of_key_i64(key, is_least) ^ (UINT64_C(1) << 63);
}

static inline int64_t fm_greater(int64_t a, int64_t b) {return a > b ? a : b;}

/// The greatest of a queue of words: DABA Lite, by Tangwongsan, Hirzel and Schneider ("In-order
/// sliding-window aggregation in worst-case constant time", The VLDB Journal 30, 2021). At most
/// three combinations for each word that enters, and for each that leaves. window[]: the places
/// `begin`, `end`, `l`, `r`, `a` and `b` of the article, the greatest word between l and b before
/// the last turn, and that since b. The words, of which older ones are replaced by the greatest of
/// several, are in `length` places from window[8]; at most length - 1 of them are in use.
enum {FM_BEGIN, FM_END, FM_L, FM_R, FM_A, FM_B, FM_MIDDLE, FM_BACK, FM_WINDOW_HEAD};

static inline int64_t fm_place_after(int64_t place, int64_t length)
{
  return place + 1 == length ? 0 : place + 1;
}

/// The places, in registers while a word enters or leaves: for a compiler, a word that is written
/// may be one of them.
struct fm_places
{
  int64_t begin, end, l, r, a, b, middle, back;
};

static inline struct fm_places fm_places_of(const int64_t * window)
{
  const struct fm_places at = {
    window[FM_BEGIN], window[FM_END], window[FM_L], window[FM_R], window[FM_A], window[FM_B],
    window[FM_MIDDLE], window[FM_BACK]};
  return at;
}

static inline void fm_keep_places(int64_t * window, struct fm_places at)
{
  window[FM_BEGIN] = at.begin;
  window[FM_END] = at.end;
  window[FM_L] = at.l;
  window[FM_R] = at.r;
  window[FM_A] = at.a;
  window[FM_B] = at.b;
  window[FM_MIDDLE] = at.middle;
  window[FM_BACK] = at.back;
}

static inline struct fm_places fm_window_turn(
  struct fm_places at, int64_t * words, int64_t length)
{
  if (at.l == at.b) {
    at.l = at.begin;
    at.r = at.b;
    at.a = at.end;
    at.b = at.end;
    at.middle = at.back;
    at.back = INT64_MIN;
  }
  if (at.begin == at.b) {
    at.middle = INT64_MIN;
    at.back = INT64_MIN;
    return at;
  }
  if (at.a != at.r) {
    const int64_t rest = at.a == at.b ? INT64_MIN : words[at.a];
    at.a = at.a == 0 ? length - 1 : at.a - 1;
    words[at.a] = fm_greater(words[at.a], rest);
  }
  const int64_t l = at.l;
  at.l = fm_place_after(l, length);
  if (l != at.r) {
    words[l] = fm_greater(words[l], at.middle);
    return at;
  }
  at.r = at.l;
  at.a = at.l;
  at.middle = at.l == at.b ? INT64_MIN : words[at.l];
  return at;
}

static inline struct fm_places fm_window_insert(
  struct fm_places at, int64_t * words, int64_t length, int64_t word)
{
  at.back = at.begin == at.end ? word : fm_greater(at.back, word);
  words[at.end] = word;
  at.end = fm_place_after(at.end, length);
  return fm_window_turn(at, words, length);
}

static inline struct fm_places fm_window_evict(
  struct fm_places at, int64_t * words, int64_t length)
{
  at.begin = fm_place_after(at.begin, length);
  return fm_window_turn(at, words, length);
}

static inline int64_t fm_window_greatest(struct fm_places at, const int64_t * words)
{
  return at.begin == at.b ? at.back : fm_greater(words[at.begin], at.back);
}

/// The greatest of the last length - 1 words.
static inline int64_t fm_greatest(int64_t * window, int64_t length, int64_t word)
{
  int64_t * const words = &window[FM_WINDOW_HEAD];
  struct fm_places at = fm_places_of(window);
  if (fm_place_after(at.end, length) == at.begin) {
    at = fm_window_evict(at, words, length);
  }
  at = fm_window_insert(at, words, length, word);
  fm_keep_places(window, at);
  return fm_window_greatest(at, words);
}

/// The greatest word at the ticks of a window. queue[4 + k]: the tick from which the word at place
/// k holds; queue[0]: the newest word; queue[1] is not used.
static inline int64_t fm_greatest_at(
  int64_t * window, int64_t * queue, int64_t length, int64_t past, int64_t word, int64_t tick,
  int64_t * next)
{
  int64_t * const words = &window[FM_WINDOW_HEAD];
  const int64_t * const since = &queue[4];
  struct fm_places at = fm_places_of(window);
  int64_t second = fm_place_after(at.begin, length);
  const bool is_empty = at.begin == at.end;
  if (!is_empty && second != at.end && since[second] <= tick - past) {
    at = fm_window_evict(at, words, length);
    second = fm_place_after(second, length);
  }
  if (is_empty || queue[0] != word) {
    if (fm_place_after(at.end, length) == at.begin) {
      const int64_t missed = (second != at.end ? since[second] : tick) + past - 1;
      queue[2] = missed > queue[2] ? missed : queue[2];
      queue[3] += 1;
      at = fm_window_evict(at, words, length);
      second = fm_place_after(second, length);
    }
    queue[4 + at.end] = tick;
    queue[0] = word;
    at = fm_window_insert(at, words, length, word);
  }
  fm_keep_places(window, at);
  fm_lower(next, second != at.end, since[second] + past);
  return fm_window_greatest(at, words);
}

// ---- exact sums --------------------------------------------------------------------------------

/// The exact sum of the doubles in a window, as an integer in units of 2^-1074, so that each sum
/// and mean is rounded once, and nothing of a value stays when it leaves. sum[0..33]: the words of
/// the integer, in two's complement, the lowest first. Bit k of sum[34]: word k is not 0; of
/// sum[35]: word k is all ones. sum[36], [37], [38]: how many are NaN, infinite, and minus
/// infinite; sum[39]: how many there are, at most 2^32 - 1. (Neal, "Fast exact summation using
/// small and large superaccumulators", arXiv 1505.05571, has the idea in another layout.)
enum {
  FM_SUM_WORDS = 34, FM_NOT_ZERO = 34, FM_ALL_ONES = 35, FM_NANS = 36, FM_INFINITE = 37,
  FM_MINUS_INFINITE = 38, FM_COUNT = 39, FM_SUM_LENGTH = 40
};

static inline void fm_set_word(uint64_t * sum, unsigned k, uint64_t word)
{
  const uint64_t bit = UINT64_C(1) << k;
  sum[k] = word;
  sum[FM_NOT_ZERO] = (sum[FM_NOT_ZERO] & ~bit) | (word != 0u ? bit : 0u);
  sum[FM_ALL_ONES] = (sum[FM_ALL_ONES] & ~bit) | (word == UINT64_MAX ? bit : 0u);
}

static inline void fm_add_words(uint64_t * sum, unsigned k, uint64_t low, uint64_t high)
{
  const uint64_t first = sum[k] + low;
  const uint64_t carry = (uint64_t)(first < low);
  const uint64_t second = sum[k + 1u] + high;
  const uint64_t both = second + carry;
  fm_set_word(sum, k, first);
  fm_set_word(sum, k + 1u, both);
  bool carries = (second < high) | (both < carry);
  for (unsigned i = k + 2u; i < 34u && carries; ++i) {
    fm_set_word(sum, i, sum[i] + 1u);
    carries = sum[i] == 0u;
  }
}

static inline void fm_subtract_words(uint64_t * sum, unsigned k, uint64_t low, uint64_t high)
{
  const uint64_t borrow = (uint64_t)(sum[k] < low);
  const uint64_t second = sum[k + 1u] - high;
  bool borrows = (sum[k + 1u] < high) | (second < borrow);
  fm_set_word(sum, k, sum[k] - low);
  fm_set_word(sum, k + 1u, second - borrow);
  for (unsigned i = k + 2u; i < 34u && borrows; ++i) {
    borrows = sum[i] == 0u;
    fm_set_word(sum, i, sum[i] - 1u);
  }
}

/// Let a double, as a word, enter the sum; with `leaves`, let it leave.
static inline void fm_add_exactly(uint64_t * sum, int64_t word, bool leaves)
{
  const uint64_t bits = (uint64_t)word;
  const unsigned exponent = (unsigned)(bits >> 52) & 0x7ffu;
  const uint64_t fraction = bits & ((UINT64_C(1) << 52) - 1u);
  const bool is_negative = (bits >> 63) != 0u;
  const uint64_t one = leaves ? UINT64_MAX : 1u;
  sum[FM_COUNT] += one;
  if (exponent == 0x7ffu) {
    sum[fraction != 0u ? FM_NANS : is_negative ? FM_MINUS_INFINITE : FM_INFINITE] += one;
    return;
  }
  const uint64_t digits = exponent != 0u ? fraction | (UINT64_C(1) << 52) : fraction;
  const unsigned place = exponent != 0u ? exponent - 1u : 0u;
  const unsigned shift = place & 63u;
  const uint64_t high = (digits >> 1) >> (63u - shift);
  if (is_negative != leaves) {
    fm_subtract_words(sum, place >> 6, digits << shift, high);
  } else {
    fm_add_words(sum, place >> 6, digits << shift, high);
  }
}

/// How many bits before the highest one of a word that is not 0.
static inline unsigned fm_leading_zeros(uint64_t word)
{
#if defined(__GNUC__)
  return (unsigned)__builtin_clzll(word);
#else
  unsigned zeros = 0u;
  for (unsigned i = 0u; i < 6u; ++i) {
    const unsigned step = 32u >> i;
    const bool is_high = (word >> (64u - step)) == 0u;
    zeros += is_high ? step : 0u;
    word <<= is_high ? step : 0u;
  }
  return zeros;
#endif
}

/// The double nearest to (top + less than one if has_rest) * 2^(place - 1074), ties to even. The
/// highest bit of `top` is 1.
static inline double fm_nearest(uint64_t top, bool has_rest, int place, bool is_negative)
{
  const int shift = place < -11 ? -place : 11;
  if (shift > 64) {
    return is_negative ? -0.0 : 0.0;
  }
  const unsigned below = (unsigned)shift - 1u;
  const uint64_t half = (top >> below) & 1u;
  const bool has_more = has_rest | ((top & ((UINT64_C(1) << below) - 1u)) != 0u);
  const uint64_t digits = (top >> below) >> 1;
  const uint64_t rounded = digits + (half & ((uint64_t)has_more | (digits & 1u)));
  const uint64_t infinite = UINT64_C(0x7ff) << 52;
  const uint64_t exact = ((uint64_t)(place + shift) << 52) + rounded;
  const uint64_t bits = place + shift > 2045 || exact > infinite ? infinite : exact;
  return fm_number_f64(fm_signed(bits | ((uint64_t)is_negative << 63)));
}

/// The 128 bits from the highest one of the sum's absolute value, its words in `top` and `low`,
/// whether anything is below, and the place of the lowest bit of `top`.
struct fm_digits
{
  uint64_t top, low;
  bool has_rest;
  int place;
};

static inline uint64_t fm_sum_word(const uint64_t * sum, int k, bool is_negative)
{
  const uint64_t word = k < 0 || k >= (int)FM_SUM_WORDS ? 0u : sum[k];
  if (!is_negative) {
    return word;
  }
  // Of -x = ~x + 1; the 1 arrives at word k if all words below are 0.
  const bool arrives = k <= 0 || (sum[FM_NOT_ZERO] & ((UINT64_C(1) << k) - 1u)) == 0u;
  return k < 0 ? 0u : k >= (int)FM_SUM_WORDS ? 0u : ~word + (uint64_t)arrives;
}

/// The sum must not be 0.
static inline struct fm_digits fm_highest_digits(const uint64_t * sum, bool is_negative)
{
  const uint64_t all = (UINT64_C(1) << FM_SUM_WORDS) - 1u;
  const uint64_t used = is_negative ? all & ~sum[FM_ALL_ONES] : sum[FM_NOT_ZERO];
  int k = used == 0u ? 0 : 63 - (int)fm_leading_zeros(used);
  uint64_t first = fm_sum_word(sum, k, is_negative);
  if (first == 0u) {  // -x is one word longer than ~x
    k += 1;
    first = 1u;
  }
  const unsigned zeros = fm_leading_zeros(first);
  const uint64_t second = fm_sum_word(sum, k - 1, is_negative);
  const uint64_t third = fm_sum_word(sum, k - 2, is_negative);
  const uint64_t rest = third << zeros;
  const uint64_t below = k > 2 ? sum[FM_NOT_ZERO] & ((UINT64_C(1) << (k - 2)) - 1u) : 0u;
  const struct fm_digits digits = {
    (first << zeros) | ((second >> 1) >> (63u - zeros)),
    (second << zeros) | ((third >> 1) >> (63u - zeros)),
    (rest | below) != 0u,
    64 * k - (int)zeros
  };
  return digits;
}

/// The sum over a divisor, 0 < divisor < 2^32, rounded once to nearest, ties to even. 0 is
/// positive.
static inline double fm_exact_quotient(const uint64_t * sum, uint64_t divisor)
{
  if ((sum[FM_NANS] | sum[FM_INFINITE] | sum[FM_MINUS_INFINITE]) != 0u) {
    const double infinite = fm_number_f64(INT64_C(0x7ff0000000000000));
    const bool is_one = sum[FM_NANS] == 0u &&
      (sum[FM_INFINITE] == 0u || sum[FM_MINUS_INFINITE] == 0u);
    return !is_one ? fm_number_f64(FM_NAN_KEY) : sum[FM_INFINITE] != 0u ? infinite : -infinite;
  }
  if (sum[FM_NOT_ZERO] == 0u) {
    return 0.0;
  }
  const bool is_negative = (sum[FM_SUM_WORDS - 1] >> 63) != 0u;
  struct fm_digits digits = fm_highest_digits(sum, is_negative);
  if (divisor > 1u) {
    const uint64_t words[4] = {
      digits.top >> 32, digits.top & UINT32_MAX, digits.low >> 32, digits.low & UINT32_MAX};
    uint64_t quotients[4];
    uint64_t rest = 0u;
    for (unsigned i = 0u; i < 4u; ++i) {
      const uint64_t part = (rest << 32) | words[i];
      quotients[i] = part / divisor;
      rest = part % divisor;
    }
    const uint64_t top = (quotients[0] << 32) | quotients[1];
    const uint64_t low = (quotients[2] << 32) | quotients[3];
    const unsigned zeros = fm_leading_zeros(top);  // at most 32
    digits.top = (top << zeros) | ((low >> 1) >> (63u - zeros));
    digits.low = low << zeros;
    digits.has_rest = digits.has_rest | (rest != 0u);
    digits.place -= (int)zeros;
  }
  return fm_nearest(
    digits.top, digits.has_rest | (digits.low != 0u), digits.place, is_negative);
}

/// The mean of what is in the sum; NaN of nothing.
static inline double fm_exact_mean(const uint64_t * sum)
{
  return sum[FM_COUNT] == 0u ? fm_number_f64(FM_NAN_KEY) : fm_exact_quotient(sum, sum[FM_COUNT]);
}

/// Keep the sum of the last `length` doubles, as words.
static inline void fm_exact_sum(
  uint64_t * sum, int64_t * ring, int64_t length, int64_t word)
{
  int64_t left;
  if (fm_put(ring, length, word, &left)) {
    fm_add_exactly(sum, left, true);
  }
  fm_add_exactly(sum, word, false);
}

/// Keep the sum of the doubles at the ticks of the window at which `at` holds, as fm_sum_at.
static inline void fm_exact_sum_at(
  uint64_t * sum, int64_t * queue, int64_t capacity, int64_t past, bool at, int64_t word,
  int64_t tick, int64_t * next)
{
  if (queue[1] > 0 && fm_interval(queue, capacity, 0)[0] < tick - past) {
    fm_add_exactly(sum, fm_interval(queue, capacity, 0)[1], true);
    fm_drop_oldest(queue, capacity);
  }
  if (at) {
    const int64_t * const oldest = fm_interval(queue, capacity, 0);
    const int64_t begin = oldest[0], left = oldest[1];
    fm_add_exactly(sum, word, false);
    if (fm_enter(queue, capacity, tick, word, begin + past)) {
      fm_add_exactly(sum, left, true);
    }
  }
  if (queue[1] > 0) {
    fm_lower(next, true, fm_interval(queue, capacity, 0)[0] + past + 1);
  }
  fm_lower(next, at, tick + 1);  // `at` may hold for longer than a tick
}

#endif  // FRET_WINDOWS_H_
