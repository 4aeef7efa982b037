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

/// trial_lines.c: see trial_lines.h for the contract.

#include "trial_lines.h"

#include <inttypes.h>

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
