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

/// trial_lines.h: the trials of a requirement with a probability, in words. Any thread; O(1).

#ifndef TRIAL_LINES_H_
#define TRIAL_LINES_H_

#include "figures.h"
#include "statuses.h"

/// How many values fm_add_trials adds.
#define FM_TRIAL_VALUES 4u

/// The first of their keys. No input has such a name.
extern const char fm_trials_key[];

/// Add what a test has found to a status; nothing if there is no test.
void fm_add_trials(struct fm_status * status, const struct fm_test_counts * counts);

/// Add it as text: `open: 1 of 40 trials failed, > 0.98 required`.
void fm_add_trials_text(struct fm_text * text, const struct fm_test_counts * counts);

#endif  // TRIAL_LINES_H_
