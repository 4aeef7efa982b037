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

/// The log of violations when memory is short for a while. The linker wraps calloc.

#include <stdlib.h>
#include <string.h>

#include "check.h"
#include "violation_log.h"

#include "below_one.h"  // the last: it has names that headers use as parameters

static bool is_short = false;

void * __real_calloc(size_t n, size_t bytes);
void * __wrap_calloc(size_t n, size_t bytes);
void * __wrap_calloc(size_t n, size_t bytes)
{
  return is_short ? NULL : __real_calloc(n, bytes);
}

static const struct fm_report_input x = {.name = "x", .path = "data"};
static const struct fm_report_requirement about = {
  .id = "X", .text = "x < 1", .sentence = "x < 1", .kind = FM_BUNDLE, .inputs = first,
  .n_inputs = 1};
static const struct fm_report_table table = {
  .requirements = &about, .n_requirements = 1, .inputs = &x, .n_inputs = 1, .component = ""};

static void deliver(struct fm_engine * engine, struct fm_violation_log * log, uint8_t value)
{
  static int64_t now = 0;
  const uint8_t gid[FM_GID_BYTES] = {1};
  struct fm_lines lines = {NULL, 0, 0};
  struct fm_detail * detail = malloc(fm_engine_detail_bytes(engine));
  now += FM_SECOND;
  const struct fm_origin origin = {now, 0, 0, gid, false, NULL, 0};
  CHECK(fm_engine_message(engine, 0, &value, 1, &origin) == FM_RECEIVED);
  CHECK(fm_engine_take_detail(engine, detail, 0));
  fm_violation_log_add(log, detail, now, &lines);
  fm_lines_free(&lines);
  free(detail);
}

// The only line of a review.
static bool is_logged(struct fm_violation_log * log, int64_t now, const char * text)
{
  struct fm_lines lines = {NULL, 0, 0};
  fm_violation_log_review(log, now, &lines);
  const bool is_so = lines.n == 1 && strstr(lines.lines[0].text, text) != NULL;
  fm_lines_free(&lines);
  return is_so;
}

int main(void)
{
  struct fm_engine * engine = make_engine(NULL);
  const char * topics[] = {"/x"};
  const struct fm_reporter reporter = {&table, &monitor, engine, "node", topics};
  struct fm_violation_log * log = fm_violation_log_create(&reporter);
  fm_engine_want_details(engine, true, 100);
  is_short = true;
  deliver(engine, log, 1);
  is_short = false;
  deliver(engine, log, 0);
  deliver(engine, log, 1);
  CHECK(is_logged(log, 100 * FM_SECOND, "X violated at 3.000: x < 1 [step 2: x = 1]"));
  fm_violation_log_destroy(log);
  destroy_engine(engine);
  return failures == 0 ? 0 : 1;
}
