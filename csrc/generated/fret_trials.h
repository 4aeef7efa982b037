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

/// fret_trials.h: the cells of generated monitors that follow trials and test their probability.
///
/// Contract: as in fret_cells.h. Every function takes O(1) time. All state is 0 at the start, but
/// the parts of a test, which are 1.
///
/// No function of the C library is called: the evidence is a product, kept as a number from 1 to
/// 2^64 (a part) and a power of 2^64 (a word). Each outcome rounds it a few times, so that after n
/// outcomes it is right to n * 1e-15 of itself, and it is the same on every machine whose doubles
/// are those of IEEE 754 and whose compiler does not contract or reorder operations.

#ifndef FRET_TRIALS_H_
#define FRET_TRIALS_H_

#include "fret_cells.h"

/// The outcome of a trial of some age: 1 if it succeeds, -1 if it fails, 0 if it goes on.
static inline int64_t fm_trial_decision(
  int64_t age, int64_t due, bool good, bool bad, bool kept, bool ends, bool good_at_end)
{
  if (ends && age > 0) {
    return good_at_end ? 1 : -1;
  }
  if (age >= due) {
    return kept ? 1 : -1;
  }
  return bad ? -1 : good ? 1 : 0;
}

/// The outcome of the trial that is decided at this step, 0 if none is. A trial begins where
/// `begins` is true while none is open. *open: one more than the steps since it began; 0: none.
/// `due` is FM_NEVER if no time limits it.
static inline int64_t fm_trial(
  int64_t * open, int64_t due, bool begins, bool good, bool bad, bool kept, bool ends,
  bool good_at_end)
{
  if (*open == 0 && !begins) {
    return 0;
  }
  const int64_t outcome = fm_trial_decision(*open, due, good, bad, kept, ends, good_at_end);
  *open = outcome == 0 ? *open + 1 : 0;
  return outcome;
}

/// As fm_trial, in a group that steps at ticks. *open: one more than the tick at which the trial
/// began; 0: none. An outcome lasts one tick.
static inline int64_t fm_trial_at(
  int64_t * open, int64_t due, bool begins, bool good, bool bad, bool kept, bool ends,
  bool good_at_end, int64_t tick, int64_t * next)
{
  if (*open == 0 && !begins) {
    return 0;
  }
  const int64_t begun = *open == 0 ? tick : *open - 1;
  const int64_t outcome =
    fm_trial_decision(tick - begun, due, good, bad, kept, ends, good_at_end);
  *open = outcome == 0 ? begun + 1 : 0;
  fm_lower(next, outcome != 0, tick + 1);
  fm_lower(next, outcome == 0 && due != FM_NEVER, begun + due);
  return outcome;
}

/// Multiply a part of a test by a factor from 2^-64 to 2^64.
static inline void fm_test_multiply(
  int64_t * words, double * parts, enum fm_test_part part, double factor)
{
  const double unit = 18446744073709551616.0;  // 2^64: to divide by it is exact
  double product = parts[part] * factor;
  if (product >= unit) {
    product /= unit;
    words[FM_TEST_UNITS + (int)part] += 1;
  } else if (product < 1.0) {
    product *= unit;
    words[FM_TEST_UNITS + (int)part] -= 1;
  }
  parts[part] = product;
}

/// Whether a part of a test has reached a limit from 1 to 2^64.
static inline bool fm_test_reaches(
  const int64_t * words, const double * parts, enum fm_test_part part, double limit)
{
  const int64_t units = words[FM_TEST_UNITS + (int)part];
  return units > 0 || (units == 0 && parts[part] >= limit);
}

static inline double fm_test_least(double x, double y) {return x < y ? x : y;}
static inline double fm_test_greatest(double x, double y) {return x > y ? x : y;}

static inline void fm_test_count_event(int64_t * words, double * parts, double allowed)
{
  const double n = (double)words[FM_TEST_TRIALS];
  const double events = (double)words[FM_TEST_EVENTS];
  const double expected = n * allowed + 1.0;
  const double above = fm_test_least(2.0, (1.0 + 1.0 / allowed) / 2.0);
  fm_test_multiply(
    words, parts, FM_TEST_AGAINST, fm_test_greatest(1.0, (events + above) / expected));
  fm_test_multiply(words, parts, FM_TEST_IN_FAVOUR, fm_test_least(1.0, (events + 0.5) / expected));
  fm_test_multiply(words, parts, FM_TEST_LIKELIHOOD, (events + 0.5) / (n + 1.0));
  words[FM_TEST_EVENTS] += 1;
}

static inline void fm_test_count_other(
  int64_t * words, double * parts, double allowed, double rest)
{
  const double n = (double)words[FM_TEST_TRIALS];
  const double others = (double)(words[FM_TEST_TRIALS] - words[FM_TEST_EVENTS]);
  const double weight = 1.0 / allowed;
  const double expected = (n + weight) * rest;
  const double below = fm_test_greatest(weight - 2.0, rest / allowed / 2.0);
  fm_test_multiply(
    words, parts, FM_TEST_AGAINST, fm_test_least(1.0, (others + below) / expected));
  fm_test_multiply(
    words, parts, FM_TEST_IN_FAVOUR, fm_test_greatest(1.0, (others + (weight - 0.5)) / expected));
  fm_test_multiply(words, parts, FM_TEST_LIKELIHOOD, (others + 0.5) / (n + 1.0));
}

/// Take an outcome of a trial, 0 if there is none. Returns whether the test has not refuted that
/// events, outcomes of -1, have at most the probability `allowed`; `rest` is one minus that. The
/// verdict is final once a part reaches `limit`. The probability of each outcome is predicted from
/// those before it by as many as 1 / allowed outcomes more, of which 2 p, but at most (1 + p) / 2,
/// are events (against), or p / 2 (in favour), and never on the other side of p.
static inline bool fm_tested(
  int64_t * words, double * parts, double allowed, double rest, double limit, int64_t outcome)
{
  words[FM_TEST_OUTCOME] = outcome;
  if (outcome == 0) {
    return words[FM_TEST_VERDICT] >= 0;
  }
  if (outcome < 0) {
    fm_test_count_event(words, parts, allowed);
  } else {
    fm_test_count_other(words, parts, allowed, rest);
  }
  words[FM_TEST_TRIALS] += 1;
  if (words[FM_TEST_VERDICT] == 0) {
    words[FM_TEST_VERDICT] = fm_test_reaches(words, parts, FM_TEST_AGAINST, limit) ? -1 :
      fm_test_reaches(words, parts, FM_TEST_IN_FAVOUR, limit) ? 1 : 0;
  }
  return words[FM_TEST_VERDICT] >= 0;
}

#endif  // FRET_TRIALS_H_
