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

/// reporter.h: what all of csrc/reporting gets: a reporter, and facts of the node as arguments.
///
/// It answers with lines and statuses (lines.h), and knows no type of ROS. A reporter is constant
/// while the engine runs; any thread may read it. Texts are UTF-8. All that the structs point to
/// stays the caller's. Times are CLOCK_MONOTONIC in nanoseconds.

#ifndef REPORTER_H_
#define REPORTER_H_

#include "blackbox_writer.h"
#include "engine.h"
#include "report_table.h"
#include "subscription.h"

struct fm_reporter
{
  const struct fm_report_table * table;
  const struct fm_monitor * monitor;
  struct fm_engine * engine;
  const char * node;            // its full name, without the first slash
  const char * const * topics;  // their names as the node resolved them
};

// ---- facts -------------------------------------------------------------------------------------

/// What is around a gate.
struct fm_gate_facts
{
  const char * others;  // who is where only the gate should be; "": nobody; of a service, not
                        // shown
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

#endif  // REPORTER_H_
