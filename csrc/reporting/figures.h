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

/// figures.h: what a test of a probability has found so far, in numbers for people.
///
/// The verdict is that of fret_trials.h alone. The figures use log of the C library, and are for
/// reading: bounds of the interval are right to 1e-9. Any thread; no function allocates or fails.

#ifndef FIGURES_H_
#define FIGURES_H_

#include "evaluator.h"
#include "lines.h"

/// Probabilities are of success. With the confidence of the test, the interval holds the true one
/// at all moments together, whenever it is looked at: it is the set of those under which the
/// likelihood of the outcomes, each predicted from those before it, is less than `limit` times as
/// great as it was (Howard et al., arXiv 1810.08240, with Robbins' mixture for coins).
struct fm_test_figures
{
  int64_t trials;
  int64_t failures;
  double estimate;  // 0 without a trial
  double low;
  double high;
};

/// O(1): at most 200 halvings for each bound.
FM_EXPORT struct fm_test_figures fm_figures_of(const struct fm_test_counts * counts);

/// A test outside of an evaluator, for outcomes of several recordings: take one so many times. The
/// caller owns both arrays: FM_TEST_WORDS zeros, and FM_TEST_PARTS ones at the start;
/// fm_test_counts says what they hold. O(times).
FM_EXPORT void fm_figures_add(
  const struct fm_test * test, int64_t * words, double * parts, bool has_failed, uint64_t times);

/// How many more trials decide it, if all of them succeed (or fail, as `has_failed`): until it is
/// shown or refuted. -1 if more than `most`, or if they never do. O(most).
FM_EXPORT int64_t fm_figures_more(
  const struct fm_test * test, const int64_t * words, const double * parts, bool has_failed,
  int64_t most);

// ---- in words ----------------------------------------------------------------------------------

/// How many values fm_add_trials adds.
#define FM_TRIAL_VALUES 4u

/// The first of their keys. No input has such a name.
extern const char fm_trials_key[];

/// Add what a test has found to a status; nothing if there is no test.
void fm_add_trials(struct fm_status * status, const struct fm_test_counts * counts);

/// Add it as text: `open: 1 of 40 trials failed, > 0.98 required`.
void fm_add_trials_text(struct fm_text * text, const struct fm_test_counts * counts);

#endif  // FIGURES_H_
