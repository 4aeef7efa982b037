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

/// reporter.h: whose findings are reported, and under which names.
///
/// All of csrc/reporting gets one of these, and facts of the node as arguments: the present time
/// (CLOCK_MONOTONIC, in nanoseconds), its publishers. It answers with lines (lines.h) and statuses
/// (statuses.h), and knows no type of ROS. Constant while the engine runs; any thread may read it.

#ifndef REPORTER_H_
#define REPORTER_H_

#include "engine.h"
#include "lines.h"
#include "report_table.h"
#include "statuses.h"

struct fm_reporter
{
  const struct fm_report_table * table;
  const struct fm_monitor * monitor;
  struct fm_engine * engine;
  const char * node;            // its full name, without the first slash
  const char * const * topics;  // their names as the node resolved them
};

#endif  // REPORTER_H_
