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

/// time_log.c: lines about the time: it went back, /clock is missing, periods are late.

#include <inttypes.h>

#include "review_parts.h"

#define NO_TIME_S 5         // until a missing /clock is logged
#define PERIODS_S 60        // between two log lines about late periods
#define FEWEST_LATE 3u      // late periods, and
#define MOST_LATE 0.01      // of all periods, are worth reading
#define FEWEST_JUDGED 300u  // periods; of fewer, three are too many

bool fm_are_worth_reading(const struct fm_time_counts * before, const struct fm_time_counts * now)
{
  const uint64_t late = now->late - before->late;
  return now->missed > before->missed || (late >= FEWEST_LATE &&
         (double)late > MOST_LATE * (double)(now->periods - before->periods));
}

// What ends although no message comes.
static void add_waits(const struct fm_review * review, struct fm_text * text,
  const char * separator, const char * ending, bool has_deadlines)
{
  struct fm_text word = {NULL, 0, 0};
  bool has_timeouts = false;
  for (uint32_t k = 0; k < review->table->n_inputs; ++k) {
    has_timeouts = has_timeouts || review->table->inputs[k].timeout > 0.0;
  }
  const char * const waits[] = {
    review->table->policy == FM_PERIODIC ? "period" : NULL,
    review->table->policy == FM_TIMED && has_deadlines ? "deadline" : NULL,
    has_timeouts ? "timeout" : NULL};
  for (size_t k = 0; k < sizeof(waits) / sizeof(waits[0]); ++k) {
    if (waits[k] != NULL) {
      fm_text_clear(&word);
      fm_text_add(&word, "%s%s", waits[k], ending);
      fm_text_list(text, separator, fm_text_get(&word));
    }
  }
  fm_text_free(&word);
}

static void review_clock(struct fm_review * review, struct fm_lines * lines)
{
  struct fm_time_log * log = &review->time;
  struct fm_text waits = {NULL, 0, 0};
  if (!review->facts.waits_for_clock) {
    log->began = review->facts.now;
  } else if (review->facts.now > log->began + NO_TIME_S * FM_SECOND &&
    fm_is_first(&log->is_clock_logged))
  {
    add_waits(review, &waits, " and no ", "", true);
    fm_lines_add(lines, FM_WARN, "use_sim_time is set and nothing was received on /clock%s%s%s",
      waits.length > 0 ? ": no " : "", fm_text_get(&waits), waits.length > 0 ? " passes" : "");
  }
  fm_text_free(&waits);
}

static void log_restart(const struct fm_review * review, struct fm_lines * lines)
{
  struct fm_text waits = {NULL, 0, 0};
  add_waits(review, &waits, " and ", "s", false);
  fm_lines_add(lines, FM_WARN, "time went back, to %.3f s: %s%s%s",
    (double)(review->now.time.restarted_at + review->table->reorder) / 1e9,
    fm_text_get(&waits), waits.length > 0 ? " continue from there; " : "",
    review->table->policy == FM_TIMED ? "values are kept, and the requirements start afresh" :
    "values and past of the requirements are kept");
  fm_text_free(&waits);
}

static void review_periods(struct fm_review * review, struct fm_lines * lines)
{
  struct fm_time_log * log = &review->time;
  const struct fm_time_counts * counts = &review->now.time;
  if (fm_are_worth_reading(&log->judged, counts)) {
    if (fm_passes(&log->next_line, review->facts.now, PERIODS_S * FM_SECOND)) {
      fm_lines_add(lines, FM_WARN,
        "periods of %g s since the last such message: %" PRIu64 " missed (no step), %" PRIu64
        " late by more than half a period", (double)review->table->period / 1e9,
        counts->missed - log->logged.missed, counts->late - log->logged.late);
      log->logged = log->judged = *counts;
    }
  } else if (counts->periods - log->judged.periods > FEWEST_JUDGED &&
    fm_passes(&log->next_minute, review->facts.now, PERIODS_S * FM_SECOND))
  {
    log->judged = *counts;  // else a long good run would hide many late ones after it
  }
}

void fm_review_time(struct fm_review * review, struct fm_lines * lines)
{
  const struct fm_time_counts * counts = &review->now.time;
  review_clock(review, lines);
  if (counts->restarts > review->before.time.restarts) {
    log_restart(review, lines);
  }
  if (counts->overflows > review->before.time.overflows &&
    fm_passes(&review->time.next_line, review->facts.now, PERIODS_S * FM_SECOND))
  {
    fm_lines_add(lines, FM_WARN,
      "%" PRIu64 " changes found no room in a window: inputs change, or messages come, more often "
      "than their max_rate; what reads the window is violated until the lost changes have left it",
      counts->overflows);
  }
  if (review->table->policy == FM_PERIODIC) {
    review_periods(review, lines);
  }
}
