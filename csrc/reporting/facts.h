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

/// facts.h: what the node knows and the engine does not, for the review (review.h).
///
/// Texts are UTF-8. All that the structs point to stays the caller's.

#ifndef FACTS_H_
#define FACTS_H_

#include "blackbox_writer.h"
#include "reporter.h"
#include "subscription.h"

/// What is around a gate.
struct fm_gate_facts
{
  const char * others;  // who is where only the gate should be; "": nobody
  const char * place;   // the full name of the topic or service that is meant
  uint64_t unsent;      // messages that could not be published, requests that were not answered
};

/// A thread or timer of the node that failed.
struct fm_failure
{
  const char * name;
  const char * error;
};

struct fm_facts
{
  int64_t now;           // CLOCK_MONOTONIC, ns
  bool waits_for_clock;  // /clock is followed, and nothing was received on it
  const struct fm_publishers * topics;  // those that were discovered
  const struct fm_action_facts * actions;
  const struct fm_gate_facts * gate;          // NULL: none
  const struct fm_blackbox_facts * blackbox;  // NULL: none
  const struct fm_failure * failures;
  uint32_t n_failures;
};

#endif  // FACTS_H_
