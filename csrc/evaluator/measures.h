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

/// measures.h: inputs that are measured: the rate and the period of the messages of a topic, and
/// when the last one was received. For the files of the evaluator only.
///
/// A rate has its first value when its window is full: as long after the first message as the
/// window is. From then it changes at each message, and whenever one leaves the window: under
/// FM_TIMED these instants are deadlines; otherwise it is renewed before each step. Messages that
/// find no room are more than `max_rate` allows. They are counted, and what reads the rate is
/// violated until the messages that made room for them would have left.

#ifndef MEASURES_H_
#define MEASURES_H_

#include "tables.h"

/// A message of the topic of a measured input was received at a time, not before that of the call
/// before. Nothing before the time has begun. O(log(room) + groups that read it).
FM_INTERNAL void fm_measure(struct fm_evaluator * evaluator, uint32_t i, int64_t now);

/// Let the rates be those of a time, not before that of the call before.
/// O(rates * log(room) + groups that read them).
FM_INTERNAL void fm_renew_rates(struct fm_evaluator * evaluator, int64_t now);

/// Under FM_TIMED: the next time at which a rate changes without a message. O(rates).
FM_INTERNAL int64_t fm_rates_due(const struct fm_evaluator * evaluator);

/// Begin all measures anew: the time went back. They keep their values until they have new ones.
/// O(inputs + groups that read them).
FM_INTERNAL void fm_forget_messages(struct fm_evaluator * evaluator);

/// Move all times by `by` nanoseconds. O(words).
FM_INTERNAL void fm_shift_measures(struct fm_evaluator * evaluator, int64_t by);

#endif  // MEASURES_H_
