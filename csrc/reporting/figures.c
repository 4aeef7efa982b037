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

/// figures.c: see figures.h for the contract.

#include "figures.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "fret_trials.h"

#define LOG_OF_UNIT 44.3614195558364998  // the natural logarithm of 2^64
#define MOST_HALVINGS 200

// How much less probable the outcomes are with a probability of events than as they were
// predicted, as a logarithm; `n` times log 0 is 0 for n = 0.
static double log_evidence(const struct fm_test_counts * counts, double probability)
{
  const double events = (double)counts->events;
  const double others = (double)(counts->trials - counts->events);
  const double predicted = (double)counts->units * LOG_OF_UNIT + log(counts->likelihood);
  return predicted - (counts->events > 0 ? events * log(probability) : 0.0) -
         (counts->trials > counts->events ? others * log1p(-probability) : 0.0);
}

// The end of the interval between `inside`, which is in it, and `outside`.
static double find_end(const struct fm_test_counts * counts, double inside, double outside)
{
  const double most = log(counts->test->limit);
  for (int k = 0; k < MOST_HALVINGS; ++k) {
    const double middle = inside + (outside - inside) / 2.0;
    if (middle == inside || middle == outside) {
      break;
    }
    if (log_evidence(counts, middle) < most) {
      inside = middle;
    } else {
      outside = middle;
    }
  }
  return outside;
}

struct fm_test_figures fm_figures_of(const struct fm_test_counts * counts)
{
  struct fm_test_figures found = {counts->trials, counts->events, 0.0, 0.0, 1.0};
  if (counts->test == NULL || counts->trials == 0) {
    return found;
  }
  const double share = (double)counts->events / (double)counts->trials;
  const double low = counts->events == 0 ? 0.0 : find_end(counts, share, 0.0);
  const double high = counts->events == counts->trials ? 1.0 : find_end(counts, share, 1.0);
  const bool counts_successes = counts->test->counts_successes;
  found.failures = counts_successes ? counts->trials - counts->events : counts->events;
  found.estimate = (double)(counts->trials - found.failures) / (double)counts->trials;
  found.low = counts_successes ? low : 1.0 - high;
  found.high = counts_successes ? high : 1.0 - low;
  return found;
}

static bool take(
  const struct fm_test * test, int64_t * words, double * parts, bool has_failed)
{
  return fm_tested(
    words, parts, test->allowed, test->rest, test->limit,
    has_failed != test->counts_successes ? -1 : 1);
}

void fm_figures_add(
  const struct fm_test * test, int64_t * words, double * parts, bool has_failed, uint64_t times)
{
  for (uint64_t k = 0; k < times; ++k) {
    (void)take(test, words, parts, has_failed);
  }
}

int64_t fm_figures_more(
  const struct fm_test * test, const int64_t * words, const double * parts, bool has_failed,
  int64_t most)
{
  int64_t words_then[FM_TEST_WORDS];
  double parts_then[FM_TEST_PARTS];
  memcpy(words_then, words, sizeof(words_then));
  memcpy(parts_then, parts, sizeof(parts_then));
  int64_t more = 0;
  while (words_then[FM_TEST_VERDICT] == 0) {
    if (more == most) {
      return -1;
    }
    (void)take(test, words_then, parts_then, has_failed);
    more += 1;
  }
  return more;
}

// ---- in words ----------------------------------------------------------------------------------

const char fm_trials_key[] = "decided trials";

void fm_add_trials(struct fm_status * status, const struct fm_test_counts * counts)
{
  if (counts->test == NULL) {
    return;
  }
  const struct fm_test_figures found = fm_figures_of(counts);
  fm_status_value(status, fm_trials_key, "%" PRId64, found.trials);
  fm_status_value(status, "failed trials", "%" PRId64, found.failures);
  if (found.trials > 0) {
    fm_status_value(status, "estimated probability", "%.6g", found.estimate);
  } else {
    fm_status_value(status, "estimated probability", "%s", "");
  }
  fm_status_value(
    status, "interval of the probability", "%.6g to %.6g, confidence %s", found.low, found.high,
    counts->test->confidence);
}

void fm_add_trials_text(struct fm_text * text, const struct fm_test_counts * counts)
{
  const struct fm_test_figures found = fm_figures_of(counts);
  fm_text_add(
    text, "%s: %" PRId64 " of %" PRId64 " trials failed, probability %s %s required",
    counts->verdict > 0 ? "assured" : counts->verdict < 0 ? "refuted" : "open", found.failures,
    found.trials, counts->test->relation, counts->test->bound);
}
