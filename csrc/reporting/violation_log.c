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

// An instance that is in a line of the last second.
struct recent
{
  uint8_t key[FM_KEY_ROOM];  // its size, then the bytes
  int64_t until;             // steady: no other line of it before
  bool is_recovery;
};

// What is known of a requirement, and what the log says.
struct logged
{
  uint64_t violations;           // so far
  uint64_t violations_in_lines;
  bool is_violated;
  bool is_violated_by_lines;
  struct fm_detail * violation;  // the last with a detail
  struct fm_detail * recovery;   // the last
  int64_t until;                 // steady: no line before; 0: there was none just now
  struct recent * recent;        // FM_LOGGED_PER_S, of instances; NULL: none was violated yet
  bool has_end;                  // of an instance, in `recovery`, that no line has
};

struct fm_violation_log
{
  const struct fm_reporter * reporter;
  struct fm_memory memory;  // of `logged`, what it points to, and `counts`
  struct logged * logged;
  struct fm_detail_counts * counts;
  size_t detail_bytes;
  struct fm_statuses worded;
};

struct fm_violation_log * fm_violation_log_create(const struct fm_reporter * reporter)
{
  const uint32_t n = reporter->table->n_requirements;
  struct fm_violation_log * log = calloc(1, sizeof(*log));
  if (log == NULL) {
    return NULL;
  }
  log->reporter = reporter;
  log->detail_bytes = fm_engine_detail_bytes(reporter->engine);
  log->logged = fm_reserve(&log->memory, n, sizeof(*log->logged));
  log->counts = fm_reserve(&log->memory, n, sizeof(*log->counts));
  if (log->memory.is_short) {
    fm_violation_log_destroy(log);
    return NULL;
  }
  return log;
}

void fm_violation_log_destroy(struct fm_violation_log * log)
{
  if (log == NULL) {
    return;
  }
  fm_statuses_free(&log->worded);
  fm_memory_free(&log->memory);
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
  const char * name = detail != NULL ? detail->name : about->id;  // of an instance, with its key
  struct fm_text values = {NULL, 0, 0};
  if (detail != NULL) {
    fm_show_detail(&values, detail);
  }
  if (more > 0) {
    // Of an instance the line names the requirement, since others may have violated it.
    const bool is_of_instance = strcmp(name, about->id) != 0;
    fm_text_add(&values, " (%" PRIu64 " more violation%s%s%s since the last line)", more,
      more == 1u ? "" : "s", is_of_instance ? " of " : "", is_of_instance ? about->id : "");
  }
  fm_lines_add(lines, level_of(about), "%s violated at %.3f: %s%s", name,
    (double)stamp / 1e9, about->sentence, fm_text_get(&values));
  fm_text_free(&values);
}

static void add_unseen(
  struct fm_lines * lines, const struct fm_report_requirement * about, uint64_t violations)
{
  if (violations == 1u) {
    fm_lines_add(lines, level_of(about), "%s violated once more, without details: %s", about->id,
      about->sentence);
  } else {
    fm_lines_add(lines, level_of(about), "%s violated %" PRIu64 " times more, without details: %s",
      about->id, violations, about->sentence);
  }
}

void fm_add_satisfied(
  struct fm_lines * lines, const struct fm_report_requirement * about, int64_t stamp,
  const struct fm_status * detail)
{
  struct fm_text values = {NULL, 0, 0};
  if (detail == NULL) {
    fm_lines_add(lines, FM_INFO, "%s satisfied again: %s", about->id, about->sentence);
    return;
  }
  fm_show_detail(&values, detail);
  fm_lines_add(lines, FM_INFO, "%s satisfied again at %.3f: %s%s", detail->name,
    (double)stamp / 1e9, about->sentence, fm_text_get(&values));
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

static void log_violations(
  struct fm_violation_log * log, uint32_t requirement, uint64_t n, struct fm_lines * lines)
{
  const struct fm_report_requirement * about = &log->reporter->table->requirements[requirement];
  const struct logged * logged = &log->logged[requirement];
  const struct fm_detail * last = logged->violation;
  if (last != NULL && last->number > logged->violations_in_lines) {
    fm_add_violated(lines, about, last->violation.stamp, worded(log, last), n - 1u);
  } else {
    add_unseen(lines, about, n);
  }
}

static void log_end(
  struct fm_violation_log * log, uint32_t requirement, struct fm_lines * lines)
{
  const struct fm_report_requirement * about = &log->reporter->table->requirements[requirement];
  const struct logged * logged = &log->logged[requirement];
  const struct fm_detail * last = logged->recovery;
  if (last != NULL && (logged->has_end || last->number == logged->violations)) {
    fm_add_satisfied(lines, about, last->violation.stamp, worded(log, last));
  } else {
    fm_add_satisfied(lines, about, 0, NULL);
  }
}

// Log the violations that no line has, and then their end, as far as there are any.
static void settle(
  struct fm_violation_log * log, uint32_t requirement, int64_t now, struct fm_lines * lines)
{
  struct logged * logged = &log->logged[requirement];
  const uint64_t more = logged->violations - logged->violations_in_lines;
  const bool is_over = logged->has_end ||
    (!logged->is_violated && (more > 0 || logged->is_violated_by_lines));
  if (more > 0) {
    log_violations(log, requirement, more, lines);
  }
  if (is_over) {
    log_end(log, requirement, lines);
    logged->has_end = false;
  }
  logged->until = more > 0 || is_over ? now + INTERVAL_NS : 0;
  logged->violations_in_lines = logged->violations;
  logged->is_violated_by_lines = logged->is_violated;
}

// Reserve, even if memory was short before.
static void * try_to_reserve(struct fm_violation_log * log, size_t n, size_t bytes)
{
  log->memory.is_short = false;
  return fm_reserve(&log->memory, n, bytes);
}

static void copy_detail(
  struct fm_violation_log * log, struct fm_detail ** copy, const struct fm_detail * detail)
{
  if (*copy == NULL) {
    *copy = try_to_reserve(log, 1, log->detail_bytes);
  }
  if (*copy != NULL) {
    memcpy(*copy, detail, log->detail_bytes);
  }
}

// Whether this of the instance is in no line of the last second, and there is room for one more.
static bool is_news(
  struct fm_violation_log * log, struct logged * logged, const struct fm_detail_scope * scope,
  bool is_recovery, int64_t now)
{
  struct recent * room = NULL;
  if (logged->recent == NULL) {
    logged->recent = try_to_reserve(log, FM_LOGGED_PER_S, sizeof(*logged->recent));
  }
  for (uint32_t k = 0; logged->recent != NULL && k < FM_LOGGED_PER_S; ++k) {
    struct recent * recent = &logged->recent[k];
    if (recent->until <= now) {
      room = recent;
    } else if (recent->is_recovery == is_recovery && recent->key[0] == scope->key_size &&
      memcmp(recent->key + 1, scope->key, scope->key_size) == 0)
    {
      return false;
    }
  }
  if (room != NULL) {
    room->key[0] = (uint8_t)scope->key_size;
    memcpy(room->key + 1, scope->key, scope->key_size);
    room->until = now + INTERVAL_NS;
    room->is_recovery = is_recovery;
  }
  return room != NULL;
}

void fm_violation_log_add(
  struct fm_violation_log * log, const struct fm_detail * detail, int64_t now,
  struct fm_lines * lines)
{
  struct logged * logged = &log->logged[detail->violation.requirement];
  const struct fm_detail_scope scope = fm_engine_detail_scope(log->reporter->engine, detail);
  const bool is_of_instance = scope.key != NULL;
  const bool is_new = is_of_instance &&
    is_news(log, logged, &scope, detail->violation.is_recovery, now);
  logged->is_violated = !detail->violation.is_recovery;
  logged->violations = detail->number;
  copy_detail(log, logged->is_violated ? &logged->violation : &logged->recovery, detail);
  logged->has_end = logged->has_end || (is_of_instance && detail->violation.is_recovery);
  if (logged->until == 0 || is_new) {
    settle(log, detail->violation.requirement, now, lines);
  }
}

void fm_violation_log_review(
  struct fm_violation_log * log, int64_t now, struct fm_lines * lines)
{
  fm_engine_detail_counts(log->reporter->engine, log->counts);
  for (uint32_t k = 0; k < log->reporter->table->n_requirements; ++k) {
    if (log->counts[k].queued == 0) {  // else the details on their way say more
      log->logged[k].violations = log->counts[k].violations;
      log->logged[k].is_violated = log->counts[k].is_violated;
    }
    if (now >= log->logged[k].until) {
      settle(log, k, now, lines);
    }
  }
}
