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

/// violation_log.c: see violation_log.h for the contract.

#include "violation_log.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#define INTERVAL_NS INT64_C(1000000000)

// What the log says of a requirement.
struct logged
{
  uint64_t violations;            // so far
  bool is_violated;
  struct fm_detail * violation;   // the latest that was left out since the last line
  struct fm_detail * recovery;    // left out, if it is later than `violation`
  bool has_violation;
  bool has_recovery;
  int64_t until;                  // steady: nothing is logged before; 0: all is logged
};

struct fm_violation_log
{
  const struct fm_reporter * reporter;
  struct logged * logged;
  uint32_t n;
  size_t detail_bytes;
  int64_t next_check;  // steady; 0: nothing new since the last
  struct fm_statuses worded;
};

struct fm_violation_log * fm_violation_log_create(const struct fm_reporter * reporter)
{
  const struct fm_monitor * monitor = reporter->monitor;
  struct fm_violation_log * log = calloc(1, sizeof(*log));
  struct logged * logged = calloc(monitor->n_requirements + 1u, sizeof(*logged));
  if (log == NULL || logged == NULL) {
    free(log);
    free(logged);
    return NULL;
  }
  *log = (struct fm_violation_log) {
    reporter, logged, monitor->n_requirements, fm_detail_bytes(monitor), 0, {NULL, 0, 0}};
  fm_engine_want_details(reporter->engine, true, FM_LOGGED_PER_S);
  return log;
}

void fm_violation_log_destroy(struct fm_violation_log * log)
{
  if (log == NULL) {
    return;
  }
  for (uint32_t k = 0; k < log->n; ++k) {
    free(log->logged[k].violation);
    free(log->logged[k].recovery);
  }
  fm_statuses_free(&log->worded);
  free(log->logged);
  free(log);
}

// ---- lines -------------------------------------------------------------------------------------

static enum fm_level level_of(const struct fm_report_requirement * about)
{
  return about->is_warning ? FM_WARN : FM_ERROR;
}

void fm_add_violated(
  struct fm_lines * lines, const struct fm_report_requirement * about, int64_t stamp,
  const struct fm_status * detail, uint64_t more)
{
  struct fm_text values = {NULL, 0, 0};
  if (detail != NULL) {
    fm_show_detail(&values, detail);
  }
  if (more > 0) {
    fm_text_add(&values, " (%" PRIu64 " more violation%s since the last line)", more,
      more == 1u ? "" : "s");
  }
  fm_lines_add(lines, level_of(about), "%s violated at %.3f: %s%s", about->id,
    (double)stamp / 1e9, about->sentence, fm_text_get(&values));
  fm_text_free(&values);
}

static void add_unseen(
  struct fm_lines * lines, const struct fm_report_requirement * about, uint64_t violations)
{
  struct fm_text times = {NULL, 0, 0};
  fm_text_add(&times, "%" PRIu64 " times", violations);
  fm_lines_add(lines, level_of(about), "%s violated %s more, without details: %s", about->id,
    violations == 1u ? "once" : fm_text_get(&times), about->sentence);
  fm_text_free(&times);
}

void fm_add_satisfied(
  struct fm_lines * lines, const struct fm_report_requirement * about, int64_t stamp,
  const struct fm_status * detail)
{
  struct fm_text at = {NULL, 0, 0};
  struct fm_text values = {NULL, 0, 0};
  if (detail != NULL) {
    fm_text_add(&at, " at %.3f", (double)stamp / 1e9);
    fm_show_detail(&values, detail);
  }
  fm_lines_add(lines, FM_INFO, "%s satisfied again%s: %s%s", about->id, fm_text_get(&at),
    about->sentence, fm_text_get(&values));
  fm_text_free(&at);
  fm_text_free(&values);
}

// The text of a detail; NULL if memory is short. Valid until the next one.
static const struct fm_status * worded(
  struct fm_violation_log * log, const struct fm_detail * detail)
{
  fm_statuses_clear(&log->worded);
  fm_add_detail(&log->worded, log->reporter, detail);
  return log->worded.n > 0 ? log->worded.statuses : NULL;
}

// ---- what is logged when -----------------------------------------------------------------------

// Log a number of violations in one line, then their end, as far as there are any.
static void write_lines(
  struct fm_violation_log * log, uint32_t requirement, uint64_t violations, bool is_over,
  int64_t now, struct fm_lines * lines)
{
  const struct fm_report_requirement * about = &log->reporter->table->requirements[requirement];
  struct logged * logged = &log->logged[requirement];
  if (violations > 0 && logged->has_violation) {
    fm_add_violated(lines, about, logged->violation->violation.stamp,
      worded(log, logged->violation), violations - 1u);
  } else if (violations > 0) {
    add_unseen(lines, about, violations);
  }
  if (is_over && logged->has_recovery) {
    fm_add_satisfied(lines, about, logged->recovery->violation.stamp,
      worded(log, logged->recovery));
  } else if (is_over) {
    fm_add_satisfied(lines, about, 0, NULL);
  }
  logged->is_violated = !is_over;
  logged->until = now + INTERVAL_NS;
  logged->has_violation = logged->has_recovery = false;
}

// Log the violations that were left out, with their number, and then their end.
static void settle(
  struct fm_violation_log * log, uint32_t requirement, int64_t now, struct fm_lines * lines)
{
  struct logged * logged = &log->logged[requirement];
  const struct fm_requirement_counts counts =
    fm_engine_requirement_counts(log->reporter->engine, requirement);
  uint64_t more = counts.announced > logged->violations ?
    counts.announced - logged->violations : 0;
  const bool was_violated = logged->is_violated || more > 0;
  logged->violations = counts.announced;
  const bool has_details = logged->has_violation || logged->has_recovery;
  const bool is_violated = has_details ? !logged->has_recovery : was_violated && counts.is_violated;
  if (more == 0 && is_violated && !logged->is_violated) {
    more = 1;  // the counters were ahead of its detail
  }
  const bool is_over = was_violated && !is_violated;
  if (more > 0 || is_over) {
    write_lines(log, requirement, more, is_over, now, lines);
  } else {
    logged->has_violation = logged->has_recovery = false;
    logged->until = 0;
  }
}

static bool copy_detail(
  struct fm_violation_log * log, struct fm_detail ** copy, const struct fm_detail * detail)
{
  if (*copy == NULL) {
    *copy = malloc(log->detail_bytes);
  }
  if (*copy != NULL) {
    memcpy(*copy, detail, log->detail_bytes);
  }
  return *copy != NULL;
}

void fm_violation_log_add(
  struct fm_violation_log * log, const struct fm_detail * detail, int64_t now,
  struct fm_lines * lines)
{
  const bool is_recovery = detail->violation.is_recovery;
  struct logged * logged = &log->logged[detail->violation.requirement];
  if (log->next_check == 0) {
    log->next_check = now + INTERVAL_NS;
  }
  if (is_recovery) {
    logged->has_recovery = copy_detail(log, &logged->recovery, detail);
  } else {
    logged->has_violation = copy_detail(log, &logged->violation, detail);
    logged->has_recovery = false;
  }
  if (logged->until == 0) {
    logged->violations += is_recovery ? 0u : 1u;
    write_lines(
      log, detail->violation.requirement, is_recovery ? 0u : 1u, is_recovery, now, lines);
  }
}

void fm_violation_log_review(
  struct fm_violation_log * log, int64_t now, struct fm_lines * lines)
{
  for (uint32_t k = 0; k < log->n; ++k) {
    if (log->logged[k].until != 0 && now >= log->logged[k].until) {
      settle(log, k, now, lines);
    }
  }
  if (log->next_check == 0 || now < log->next_check) {
    return;
  }
  log->next_check = 0;
  for (uint32_t k = 0; k < log->n; ++k) {
    if (log->logged[k].until == 0) {  // the queue was full, or its details were suppressed
      settle(log, k, now, lines);
    }
  }
}

void fm_violation_log_end(struct fm_violation_log * log, struct fm_lines * lines)
{
  fm_violation_log_review(log, INT64_MAX - INTERVAL_NS, lines);
}
