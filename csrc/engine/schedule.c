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


/// schedule.c: see schedule.h for the contract.

#include "schedule.h"

#include <stdlib.h>

// A requirement as it was at the last look, and when what follows it starts: `starts` has a time
// for each action on its violation, then for each on its end.
struct watched
{
  uint64_t occurrences;
  bool is_violated;
  int64_t * starts;
};

struct running
{
  int64_t last_start;
  bool has_started;    // `last_start` is one
  int64_t due;         // of the next message
  int64_t end;         // of publishing for a duration
  bool is_first_due;   // sent even if the violation is over by then
  bool is_begun;       // a call that fm_schedule_begins_call has not returned yet
  bool is_under_way;   // a call
};

struct fm_schedule
{
  struct fm_schedule_options options;
  bool of_instance;
  struct watched * watched;
  struct running * running;
  int64_t * starts;    // of all requirements
};

static uint32_t count_of(const struct fm_follows * follows)
{
  return follows->n_on_violation + follows->n_on_end;
}

static uint32_t action_of(const struct fm_follows * follows, uint32_t place)
{
  return place < follows->n_on_violation ?
         follows->on_violation[place] : follows->on_end[place - follows->n_on_violation];
}

static bool make_watched(struct fm_schedule * schedule)
{
  size_t n = 0;
  for (uint32_t r = 0; r < schedule->options.n_requirements; ++r) {
    n += count_of(&schedule->options.follows[r]);
  }
  schedule->starts = malloc((n + 1u) * sizeof(*schedule->starts));
  schedule->watched =
    calloc(schedule->options.n_requirements + (size_t)1, sizeof(*schedule->watched));
  schedule->running = calloc(schedule->options.n_actions + (size_t)1, sizeof(*schedule->running));
  if (schedule->starts == NULL || schedule->watched == NULL || schedule->running == NULL) {
    return false;
  }
  int64_t * next = schedule->starts;
  for (uint32_t r = 0; r < schedule->options.n_requirements; ++r) {
    schedule->watched[r].starts = next;
    for (uint32_t k = 0; k < count_of(&schedule->options.follows[r]); ++k) {
      *next = FM_NEVER;
      next += 1;
    }
  }
  return true;
}

struct fm_schedule * fm_schedule_create(
  const struct fm_schedule_options * options, bool of_instance)
{
  struct fm_schedule * schedule = calloc(1, sizeof(*schedule));
  if (schedule == NULL) {
    return NULL;
  }
  schedule->options = *options;
  schedule->of_instance = of_instance;
  if (!make_watched(schedule)) {
    fm_schedule_destroy(schedule);
    return NULL;
  }
  for (uint32_t k = 0; k < options->n_actions; ++k) {
    schedule->running[k].due = FM_NEVER;
  }
  return schedule;
}

void fm_schedule_destroy(struct fm_schedule * schedule)
{
  if (schedule != NULL) {
    free(schedule->starts);
    free(schedule->watched);
    free(schedule->running);
    free(schedule);
  }
}

// ---- starts ------------------------------------------------------------------------------------

// An action that is delayed does not follow a violation that is over.
static void schedule_starts(
  const struct fm_schedule * schedule, uint32_t requirement, bool has_begun, bool has_ended,
  int64_t now)
{
  const struct fm_follows * follows = &schedule->options.follows[requirement];
  for (uint32_t k = 0; k < count_of(follows); ++k) {
    const struct fm_action * action = &schedule->options.actions[action_of(follows, k)];
    const bool is_on_violation = k < follows->n_on_violation;
    const bool follows_now =
      is_on_violation ? has_begun && !(action->after > 0 && has_ended) : has_ended;
    schedule->watched[requirement].starts[k] =
      follows_now && (action->n_parts > 0) == schedule->of_instance ? now + action->after :
      FM_NEVER;
  }
}

static void follow(
  const struct fm_schedule * schedule, uint32_t requirement,
  const struct fm_requirement_state * state, int64_t now)
{
  struct watched * watched = &schedule->watched[requirement];
  const bool is_violated = state->state == FM_VIOLATED;
  const bool has_begun = state->occurrences > watched->occurrences;
  const bool has_ended = !is_violated && (watched->is_violated || has_begun);
  if (has_begun || has_ended) {
    schedule_starts(schedule, requirement, has_begun, has_ended, now);
  }
  watched->occurrences = state->occurrences;
  watched->is_violated = is_violated;
}

static bool is_cooling_down(
  const struct fm_action * action, const struct running * running, int64_t now)
{
  return running->has_started && now - running->last_start < action->cooldown;
}

static void start(const struct fm_schedule * schedule, uint32_t number, int64_t now)
{
  const struct fm_action * action = &schedule->options.actions[number];
  struct running * running = &schedule->running[number];
  if (running->is_under_way || is_cooling_down(action, running, now)) {
    schedule->options.counts[number].skipped += 1;
    return;
  }
  schedule->options.counts[number].started += 1;
  running->has_started = true;
  running->last_start = now;
  if (action->kind == FM_ACTION_PUBLISH) {
    running->is_first_due = true;
    running->end = action->duration > 0 ? now + action->duration : FM_NEVER;
    running->due = running->due < now ? running->due : now;
  } else {
    running->is_begun = running->is_under_way = true;
  }
}

static void start_due(const struct fm_schedule * schedule, uint32_t requirement, int64_t now)
{
  const struct fm_follows * follows = &schedule->options.follows[requirement];
  for (uint32_t k = 0; k < count_of(follows); ++k) {
    int64_t * when = &schedule->watched[requirement].starts[k];
    if (*when <= now) {
      *when = FM_NEVER;
      start(schedule, action_of(follows, k), now);
    }
  }
}

void fm_schedule_start_due(struct fm_schedule * schedule, int64_t now)
{
  for (uint32_t r = 0; r < schedule->options.n_requirements; ++r) {
    start_due(schedule, r, now);
  }
}

void fm_schedule_follow(
  struct fm_schedule * schedule, const struct fm_requirement_state * states, int64_t now)
{
  for (uint32_t r = 0; r < schedule->options.n_requirements; ++r) {
    follow(schedule, r, &states[r], now);
  }
  fm_schedule_start_due(schedule, now);
}

void fm_schedule_note(
  struct fm_schedule * schedule, uint32_t requirement, bool begins, int64_t now)
{
  schedule_starts(schedule, requirement, begins, !begins, now);
  schedule->watched[requirement].is_violated = begins;
  start_due(schedule, requirement, now);
}

void fm_schedule_end_all(struct fm_schedule * schedule, int64_t now)
{
  for (uint32_t r = 0; r < schedule->options.n_requirements; ++r) {
    if (schedule->watched[r].is_violated) {
      fm_schedule_note(schedule, r, false, now);
    }
  }
}

// ---- while they run ----------------------------------------------------------------------------

// Whether a requirement is violated that the action follows.
static bool is_violated(const struct fm_schedule * schedule, uint32_t action)
{
  for (uint32_t r = 0; r < schedule->options.n_requirements; ++r) {
    const struct fm_follows * follows = &schedule->options.follows[r];
    for (uint32_t k = 0; schedule->watched[r].is_violated && k < follows->n_on_violation; ++k) {
      if (follows->on_violation[k] == action) {
        return true;
      }
    }
  }
  return false;
}

bool fm_schedule_publishes(struct fm_schedule * schedule, uint32_t number, int64_t now)
{
  const struct fm_action * action = &schedule->options.actions[number];
  struct running * running = &schedule->running[number];
  if (running->due > now) {
    return false;
  }
  const bool is_over =
    now >= running->end || (action->duration == 0 && !is_violated(schedule, number));
  if (action->period > 0 && is_over && !running->is_first_due) {
    running->due = FM_NEVER;
    return false;
  }
  const int64_t next = running->due + action->period;
  running->is_first_due = false;
  running->due = action->period == 0 ? FM_NEVER : next > now ? next : now;
  return true;
}

bool fm_schedule_begins_call(struct fm_schedule * schedule, uint32_t action)
{
  const bool begins = schedule->running[action].is_begun;
  schedule->running[action].is_begun = false;
  return begins;
}

bool fm_schedule_wants_call(const struct fm_schedule * schedule, uint32_t action)
{
  return schedule->running[action].is_begun;
}

void fm_schedule_end_call(struct fm_schedule * schedule, uint32_t action)
{
  schedule->running[action].is_under_way = false;
}

int64_t fm_schedule_due(const struct fm_schedule * schedule)
{
  int64_t due = FM_NEVER;
  for (uint32_t k = 0; k < schedule->options.n_actions; ++k) {
    due = schedule->running[k].due < due ? schedule->running[k].due : due;
  }
  for (uint32_t r = 0; r < schedule->options.n_requirements; ++r) {
    for (uint32_t k = 0; k < count_of(&schedule->options.follows[r]); ++k) {
      due = schedule->watched[r].starts[k] < due ? schedule->watched[r].starts[k] : due;
    }
  }
  return due;
}

int64_t fm_schedule_wake(const struct fm_schedule * schedule, int64_t now)
{
  int64_t wake = fm_schedule_due(schedule);
  for (uint32_t k = 0; k < schedule->options.n_actions; ++k) {
    const struct fm_action * action = &schedule->options.actions[k];
    const int64_t end = schedule->running[k].last_start + action->cooldown;
    wake = is_cooling_down(action, &schedule->running[k], now) && end < wake ? end : wake;
  }
  return wake;
}

bool fm_schedule_is_idle(const struct fm_schedule * schedule, int64_t now)
{
  bool is_idle = fm_schedule_due(schedule) == FM_NEVER;
  for (uint32_t k = 0; k < schedule->options.n_actions; ++k) {
    const struct running * running = &schedule->running[k];
    is_idle = is_idle && !running->is_under_way &&
      !is_cooling_down(&schedule->options.actions[k], running, now);
  }
  for (uint32_t r = 0; r < schedule->options.n_requirements; ++r) {
    is_idle = is_idle &&
      !(schedule->watched[r].is_violated && schedule->options.follows[r].n_on_end > 0);
  }
  return is_idle;
}
