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


/// Actions: when they start and publish, and a thread whose publisher fails.

#define _POSIX_C_SOURCE 200809L

#include "actions.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "below_one.h"
#include "check.h"
#include "fakes.h"
#include "schedules.h"

#define SECOND INT64_C(1000000000)

enum { RATE, LATE, END, CALL, ACTIONS };

static const uint8_t payload[] = {0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
static const uint32_t on_violation[] = {RATE, LATE, CALL};
static const uint32_t on_end[] = {END};
static const struct fm_follows follows[] = {{on_violation, 3, on_end, 1}};
static const struct fm_action actions[] = {
  {.kind = FM_ACTION_PUBLISH, .name = "rate", .payload = payload, .payload_size = sizeof(payload),
    .stamp_at = 4, .period = SECOND / 10},
  {.kind = FM_ACTION_PUBLISH, .name = "late", .stamp_at = -1, .after = SECOND},
  {.kind = FM_ACTION_PUBLISH, .name = "end", .stamp_at = -1, .after = 2 * SECOND},
  {.kind = FM_ACTION_CALL, .name = "call", .stamp_at = -1, .cooldown = 5 * SECOND}};

static void look(
  struct fm_schedule * schedule, uint64_t occurrences, enum fm_state state, int64_t now)
{
  const struct fm_requirement_state found = {occurrences, (uint8_t)state};
  fm_schedule_follow(schedule, &found, now);
}

static void test_schedule(void)
{
  struct fm_action_facts counts[ACTIONS];
  memset(counts, 0, sizeof(counts));
  counts[RATE].started = 7;  // of before
  const struct fm_schedule_options options = {actions, follows, counts, ACTIONS, 1};
  struct fm_schedule * schedule = fm_schedule_create(&options, false);
  CHECK(fm_schedule_due(schedule) == FM_NEVER);
  look(schedule, 1, FM_VIOLATED, 10 * SECOND);
  CHECK(counts[RATE].started == 8 && counts[CALL].started == 1);
  CHECK(fm_schedule_due(schedule) == 10 * SECOND);
  CHECK(fm_schedule_publishes(schedule, RATE, 10 * SECOND));
  CHECK(!fm_schedule_publishes(schedule, RATE, 10 * SECOND));
  CHECK(fm_schedule_due(schedule) == 10 * SECOND + SECOND / 10);
  CHECK(fm_schedule_publishes(schedule, RATE, 10 * SECOND + SECOND / 10));
  CHECK(fm_schedule_begins_call(schedule, CALL));
  CHECK(!fm_schedule_begins_call(schedule, CALL));

  // It is over before the delay: the delayed action does not start, and the messages end.
  look(schedule, 1, FM_HOLDS, 10 * SECOND + SECOND / 2);
  CHECK(!fm_schedule_publishes(schedule, RATE, 10 * SECOND + SECOND / 2));
  look(schedule, 1, FM_HOLDS, 12 * SECOND);
  CHECK(counts[LATE].started == 0 && counts[END].started == 0);
  CHECK(fm_schedule_due(schedule) == 12 * SECOND + SECOND / 2);
  look(schedule, 1, FM_HOLDS, 12 * SECOND + SECOND / 2);
  CHECK(counts[END].started == 1 && fm_schedule_publishes(schedule, END, 13 * SECOND));

  // A violation that began and ended between two looks: one message, and what follows its end. A
  // start that is skipped since a call runs begins no cooldown.
  look(schedule, 2, FM_HOLDS, 14 * SECOND);
  CHECK(fm_schedule_publishes(schedule, RATE, 14 * SECOND));
  CHECK(!fm_schedule_publishes(schedule, RATE, 15 * SECOND));
  CHECK(counts[CALL].skipped == 1);
  fm_schedule_end_call(schedule, CALL);
  look(schedule, 3, FM_HOLDS, 15 * SECOND);
  CHECK(counts[CALL].started == 2 && fm_schedule_begins_call(schedule, CALL));
  fm_schedule_end_call(schedule, CALL);
  look(schedule, 4, FM_HOLDS, 20 * SECOND - 1);
  CHECK(counts[CALL].skipped == 2 && counts[LATE].started == 0);
  look(schedule, 5, FM_HOLDS, 20 * SECOND);
  CHECK(counts[CALL].started == 3);
  fm_schedule_destroy(schedule);
}

// ---- instances ---------------------------------------------------------------------------------

static const struct fm_payload_part key_part = {.kind = FM_PART_KEY};
static const struct fm_action keyed[] = {
  {.kind = FM_ACTION_PUBLISH, .name = "rate", .stamp_at = -1, .period = SECOND,
    .parts = &key_part, .n_parts = 1},
  {.kind = FM_ACTION_PUBLISH, .name = "late", .stamp_at = -1, .after = SECOND,
    .parts = &key_part, .n_parts = 1},
  {.kind = FM_ACTION_PUBLISH, .name = "end", .stamp_at = -1},
  {.kind = FM_ACTION_CALL, .name = "call", .stamp_at = -1, .cooldown = 5 * SECOND,
    .parts = &key_part, .n_parts = 1}};

static void test_instances(void)
{
  struct fm_action_facts counts[ACTIONS];
  memset(counts, 0, sizeof(counts));
  struct fm_schedules schedules = {.options = {keyed, follows, counts, ACTIONS, 1}};
  const uint8_t alpha[] = {5, 'a', 'l', 'p', 'h', 'a'};
  const uint8_t beta[] = {1, 'a'};
  struct fm_instance_schedule * of_alpha = fm_schedules_of(&schedules, alpha);
  struct fm_instance_schedule * of_beta = fm_schedules_of(&schedules, beta);
  CHECK(fm_schedules_of(&schedules, alpha) == of_alpha && of_alpha != of_beta);
  fm_schedules_settle(of_alpha, 0);
  fm_schedules_settle(of_beta, 0);
  CHECK(schedules.keys.n == 0 && fm_schedules_due(&schedules) == FM_NEVER);

  of_alpha = fm_schedules_of(&schedules, alpha);
  of_beta = fm_schedules_of(&schedules, beta);
  struct fm_schedule * one = of_alpha->schedule;
  struct fm_schedule * other = of_beta->schedule;
  fm_schedule_note(one, 0, true, 10 * SECOND);
  fm_schedule_note(other, 0, true, 10 * SECOND + 5);
  CHECK(counts[RATE].started == 2 && counts[CALL].started == 2 && counts[END].started == 0);
  CHECK(fm_schedule_publishes(one, RATE, 10 * SECOND));
  CHECK(fm_schedule_publishes(other, RATE, 10 * SECOND + 5));
  fm_schedules_settle(of_alpha, 10 * SECOND + 5);
  fm_schedules_settle(of_beta, 10 * SECOND + 5);
  CHECK(fm_schedules_due(&schedules) == 11 * SECOND);
  CHECK(fm_schedules_first(&schedules, 11 * SECOND - 1) == NULL);
  CHECK(fm_schedules_first(&schedules, 11 * SECOND) == of_alpha);
  CHECK(fm_schedule_wants_call(one, CALL));
  CHECK(fm_schedule_begins_call(one, CALL) && fm_schedule_begins_call(other, CALL));
  CHECK(!fm_schedule_wants_call(one, CALL));
  fm_schedule_end_call(one, CALL);
  fm_schedule_end_call(other, CALL);

  // The end of one is none of the other: its delay and its messages go on.
  fm_schedule_note(one, 0, false, 10 * SECOND + 6);
  fm_schedule_start_due(one, 12 * SECOND);
  fm_schedule_start_due(other, 12 * SECOND);
  CHECK(counts[LATE].started == 1 && fm_schedule_publishes(other, LATE, 12 * SECOND));
  CHECK(!fm_schedule_publishes(one, RATE, 12 * SECOND));
  CHECK(fm_schedule_publishes(other, RATE, 12 * SECOND));
  fm_schedules_settle(of_alpha, 12 * SECOND);  // the cooldown lasts
  CHECK(fm_schedules_of(&schedules, alpha) == of_alpha);
  fm_schedule_note(one, 0, true, 13 * SECOND);
  CHECK(counts[CALL].skipped == 1 && counts[RATE].started == 3);
  fm_schedule_end_all(other, 13 * SECOND);
  CHECK(!fm_schedule_publishes(other, RATE, 15 * SECOND));
  fm_schedules_settle(of_beta, 16 * SECOND);
  CHECK(schedules.keys.n == 1 && fm_schedules_next(&schedules, 0) == of_alpha);
  CHECK(fm_schedules_next(&schedules, of_alpha->slot + 1) == NULL);
  fm_schedules_free(&schedules);
  CHECK(schedules.keys.n == 0 && fm_schedules_next(&schedules, 0) == NULL);

  // One of the bundle leaves actions with keys out.
  struct fm_schedule * schedule = fm_schedule_create(&schedules.options, false);
  look(schedule, 1, FM_VIOLATED, 10 * SECOND);
  look(schedule, 1, FM_HOLDS, 11 * SECOND);
  CHECK(counts[RATE].started == 3 && counts[END].started == 1);
  fm_schedule_destroy(schedule);
}

// That of key n is due at a time of its own, and waits for a call in turn; those of even keys end.
static void test_many_instances(void)
{
  enum { MANY = 1000 };
  struct fm_action_facts counts[ACTIONS];
  memset(counts, 0, sizeof(counts));
  struct fm_schedules schedules = {.options = {keyed, follows, counts, ACTIONS, 1}};
  uint8_t key[FM_KEY_ROOM];
  for (uint32_t n = 0; n < MANY; ++n) {
    const int64_t now = 10 * SECOND + (int64_t)(n * 7 % MANY);
    key[0] = (uint8_t)snprintf((char *)key + 1, sizeof(key) - 1, "robot %u", n);
    struct fm_instance_schedule * one = fm_schedules_of(&schedules, key);
    fm_schedule_note(one->schedule, 0, true, now);
    CHECK(fm_schedule_publishes(one->schedule, RATE, now));
    fm_schedules_wait(one, CALL);
    fm_schedules_settle(one, now);
    fm_schedules_wait(fm_schedules_next(&schedules, 0), CALL);  // the turn of the first one stays
  }
  for (uint32_t n = 0; n < MANY; ++n) {
    key[0] = (uint8_t)snprintf((char *)key + 1, sizeof(key) - 1, "robot %u", n);
    struct fm_instance_schedule * one = fm_schedules_waiting(&schedules, CALL);
    CHECK(one == fm_schedules_of(&schedules, key) && memcmp(one->key, key, key[0] + 1u) == 0);
    fm_schedules_end_wait(one, CALL);
  }
  CHECK(fm_schedules_waiting(&schedules, CALL) == NULL && schedules.keys.n == MANY);
  for (int64_t k = 0; k < MANY; ++k) {
    const int64_t now = 11 * SECOND + k;
    struct fm_instance_schedule * one = fm_schedules_first(&schedules, now);
    CHECK(one != NULL && fm_schedules_first(&schedules, now - 1) == NULL);
    CHECK(fm_schedule_publishes(one->schedule, RATE, now));
    if (k % 2 == 0) {
      fm_schedule_begins_call(one->schedule, CALL);
      fm_schedule_end_call(one->schedule, CALL);
      fm_schedule_note(one->schedule, 0, false, now);
      fm_schedule_publishes(one->schedule, RATE, 20 * SECOND);
      fm_schedules_settle(one, 20 * SECOND);
    } else {
      fm_schedule_start_due(one->schedule, now);
      (void)fm_schedule_publishes(one->schedule, LATE, now);
      fm_schedules_settle(one, now);
    }
  }
  CHECK(schedules.keys.n == MANY / 2 && fm_schedules_due(&schedules) == 12 * SECOND + 1);
  fm_schedules_free(&schedules);
}

// ---- the thread --------------------------------------------------------------------------------

static bool has_stamp = true;
static struct clock simulated = {77 * SECOND + 5, false};

static int fail(const void * publisher, const struct fm_serialized * message, void * allocation)
{
  (void)publisher;
  (void)allocation;
  has_stamp = has_stamp && message->buffer[4] == 77 && message->buffer[8] == 5;
  return 1;
}

static void test_thread(void)
{
  struct fm_engine * engine = make_engine(NULL);
  fm_engine_follow_states(engine);
  fm_engine_follow_clock(engine, read_clock, &simulated, false);
  fm_engine_begin(engine);
  const struct fm_follows one = {on_violation, 1, NULL, 0};
  struct fm_report_table table;
  memset(&table, 0, sizeof(table));
  table.actions = actions;
  table.follows = &one;
  table.n_actions = table.n_requirements = 1;
  int publisher = 0;
  const struct fm_action_ends ends = {.publisher = &publisher};
  const struct fm_action_facts before = {3, 2, 1, 0};
  const struct fm_actions_options settings = {
    .engine = engine, .table = &table, .ends = &ends, .services = {.forget_error = forget_error},
    .publish = fail, .before = &before};
  struct fm_actions * thread = NULL;
  CHECK(fm_actions_start(&thread, &settings));
  const uint8_t gid[FM_GID_BYTES] = {1};
  const struct fm_origin origin = {0, 0, 1, gid, false, NULL, 0};
  const uint8_t bad = 1;
  CHECK(fm_engine_message(engine, 0, &bad, 1, &origin) == FM_RECEIVED);
  struct fm_action_facts counts = before;
  struct fm_lines lines = {NULL, 0, 0};
  for (int k = 0; k < 10000 && counts.failed < 5; ++k) {
    const struct timespec pause = {0, 1000000};
    nanosleep(&pause, NULL);
    fm_actions_look(thread, &counts, &lines);
  }
  CHECK(counts.started == 4 && counts.failed >= 5 && counts.sent == 2);
  CHECK(lines.n == 1);  // at most one a second
  CHECK(lines.n == 0 || strcmp(lines.lines[0].text,
    "the action 'rate' failed: the middleware does not publish its message") == 0);
  CHECK(fm_actions_turns(thread) > 1);
  fm_engine_close(engine);
  fm_actions_end(thread);
  fm_actions_join(&thread);
  fm_actions_join(&thread);
  CHECK(thread == NULL && has_stamp);
  fm_lines_free(&lines);
  destroy_engine(engine);
}

int main(void)
{
  test_schedule();
  test_instances();
  test_many_instances();
  test_thread();
  return failures == 0 ? 0 : 1;
}
