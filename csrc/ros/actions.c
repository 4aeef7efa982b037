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


/// actions.c: see actions.h for the contract.

#define _POSIX_C_SOURCE 200809L

#include "actions.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "payload.h"
#include "schedules.h"
#include "thread.h"
#include "words.h"

#define MILLISECOND_NS 1000000
#define WAIT_NS 500000000  // closing the engine wakes it at once

// Whose call is under way: that of the bundle, or of an instance. Zeroed: none is.
struct caller
{
  struct fm_schedule * schedule;
  struct fm_instance_schedule * one;
};

struct fm_actions
{
  struct fm_actions_options options;
  struct fm_memory memory;               // of all arrays
  struct fm_schedule * schedule;         // of the bundle
  struct fm_schedules * schedules;       // those of a kind's variables at the first such kind
  struct fm_action_call * calls;         // of each action; zeroed if it publishes
  struct caller * callers;               // of each action
  uint8_t * payload;                     // room for any message
  struct fm_requirement_state * states;
  pthread_mutex_t mutex;                 // guards the next two
  struct fm_action_facts * counts;
  struct fm_lines lines;
  int64_t * next_lines;                  // when a line of an action that publishes may be next
  pthread_t thread;
  uint64_t turns;                        // atomic
  bool has_ended;                        // a call; the next one may begin
  bool is_running;
};

// ---- one action --------------------------------------------------------------------------------

static void count_result(
  struct fm_actions * actions, uint32_t number, bool is_good, bool is_logged, uint32_t tries,
  const char * why)
{
  pthread_mutex_lock(&actions->mutex);
  actions->counts[number].sent += is_good ? 1u : 0u;
  actions->counts[number].failed += is_good ? 0u : 1u;
  if (!is_good && is_logged) {
    fm_add_failure(&actions->lines, &actions->options.table->actions[number], tries, why);
  }
  pthread_mutex_unlock(&actions->mutex);
}

static bool publish_copy(const struct fm_actions * actions, uint32_t number, const uint8_t * key)
{
  const struct fm_action * action = &actions->options.table->actions[number];
  struct fm_serialized message;
  memset(&message, 0, sizeof(message));
  message.buffer = actions->payload;
  message.length = fm_payload_write(action, key, message.buffer);
  message.capacity = message.length;
  fm_engine_write_time(
    actions->options.engine, message.buffer, message.length, action->stamp_at);
  const bool is_good =
    actions->options.publish(actions->options.ends[number].publisher, &message, NULL) == 0;
  if (!is_good) {
    actions->options.services.forget_error();
  }
  return is_good;
}

static void publish(
  struct fm_actions * actions, uint32_t number, const uint8_t * key, int64_t now)
{
  const bool is_good = publish_copy(actions, number, key);
  const bool is_logged = !is_good && now >= actions->next_lines[number];
  actions->next_lines[number] = is_logged ? now + FM_SECOND : actions->next_lines[number];
  count_result(actions, number, is_good, is_logged, 1, FM_WORDS_NOT_PUBLISHED);
}

// Instances have one client of an action: their calls follow each other, as they came to wait.
static bool has_to_wait(
  const struct fm_actions * actions, const struct caller * caller, uint32_t number)
{
  const struct fm_instance_schedule * first =
    caller->one == NULL ? NULL : fm_schedules_waiting(caller->one->schedules, number);
  return actions->callers[number].schedule != NULL || (first != NULL && first != caller->one);
}

static void begin_call(
  struct fm_actions * actions, const struct caller * caller, uint32_t number, int64_t now)
{
  const struct fm_action * action = &actions->options.table->actions[number];
  struct fm_action_call * call = &actions->calls[number];
  const bool wants = fm_schedule_wants_call(caller->schedule, number);
  if (wants && has_to_wait(actions, caller, number)) {
    fm_schedules_wait(caller->one, number);
    return;
  }
  if (caller->one != NULL) {
    fm_schedules_end_wait(caller->one, number);
  }
  if (!wants) {
    return;
  }
  (void)fm_schedule_begins_call(caller->schedule, number);
  if (caller->one == NULL || fm_action_call_read(
      call, actions->payload, fm_payload_write(action, caller->one->key, actions->payload)))
  {
    actions->callers[number] = *caller;
    fm_action_call_begin(call, now);
  } else {
    fm_schedule_end_call(caller->schedule, number);
    count_result(actions, number, false, true, 1, FM_WORDS_NO_REQUEST);
  }
}

static void go_on_with_call(struct fm_actions * actions, uint32_t number, int64_t now)
{
  struct fm_action_call * one = &actions->calls[number];
  struct fm_text why = {NULL, 0, 0};
  const enum fm_action_result result = fm_action_call_run(one, now, &why);
  if (result != FM_ACTION_GOES_ON) {
    const struct caller caller = actions->callers[number];
    fm_schedule_end_call(caller.schedule, number);
    memset(&actions->callers[number], 0, sizeof(caller));
    if (caller.one != NULL) {
      fm_schedules_settle(caller.one, now);
    }
    actions->has_ended = true;
    count_result(
      actions, number, result == FM_ACTION_SUCCEEDED, true, one->tried + 1u, fm_text_get(&why));
  }
  fm_text_free(&why);
}

// Publish, and begin calls, as a schedule of the bundle or an instance wants it.
static void act(struct fm_actions * actions, const struct caller * caller, int64_t now)
{
  const uint8_t * key = caller->one == NULL ? NULL : caller->one->key;
  for (uint32_t k = 0; k < actions->options.table->n_actions; ++k) {
    if (actions->options.ends[k].publisher == NULL) {
      begin_call(actions, caller, k, now);
    } else if (fm_schedule_publishes(caller->schedule, k, now)) {
      publish(actions, k, key, now);
    }
  }
}

// ---- instances ---------------------------------------------------------------------------------

static struct fm_schedules * schedules_of(struct fm_actions * actions, uint32_t requirement)
{
  const struct fm_report_table * table = actions->options.table;
  const struct fm_report_kind * own = &table->kinds[table->requirements[requirement].kind];
  uint32_t kind = 0;
  while (strcmp(table->kinds[kind].variable, own->variable) != 0 ||
    strcmp(table->kinds[kind].second, own->second) != 0)
  {
    kind += 1;
  }
  return &actions->schedules[kind];
}

static bool has_keyed(const struct fm_actions * actions, uint32_t requirement)
{
  const struct fm_report_table * table = actions->options.table;
  const struct fm_follows * follows = &table->follows[requirement];
  bool has = false;
  for (uint32_t k = 0; k < follows->n_on_violation; ++k) {
    has = has || table->actions[follows->on_violation[k]].n_parts > 0;
  }
  for (uint32_t k = 0; k < follows->n_on_end; ++k) {
    has = has || table->actions[follows->on_end[k]].n_parts > 0;
  }
  return has;
}

static void act_for(struct fm_actions * actions, struct fm_instance_schedule * one, int64_t now)
{
  const struct caller caller = {one->schedule, one};
  act(actions, &caller, now);
  fm_schedules_settle(one, now);
}

static void end_all(struct fm_actions * actions, int64_t now)
{
  for (uint32_t kind = 0; kind < actions->options.table->n_kinds; ++kind) {
    struct fm_schedules * schedules = &actions->schedules[kind];
    struct fm_instance_schedule * one = fm_schedules_next(schedules, 0);
    while (one != NULL) {
      const uint32_t next = one->slot + 1;
      pthread_mutex_lock(&actions->mutex);
      fm_schedule_end_all(one->schedule, now);
      pthread_mutex_unlock(&actions->mutex);
      act_for(actions, one, now);
      one = fm_schedules_next(schedules, next);
    }
  }
}

// What follows each begin and end happens before the next one.
static void follow_instances(struct fm_actions * actions, int64_t now)
{
  struct fm_violation event;
  uint8_t key[FM_KEY_ROOM];
  while (fm_engine_take_instance(actions->options.engine, &event, key)) {
    if (event.requirement == actions->options.table->n_requirements) {
      end_all(actions, now);
    } else if (has_keyed(actions, event.requirement)) {
      struct fm_instance_schedule * one =
        fm_schedules_of(schedules_of(actions, event.requirement), key);
      if (one != NULL) {
        pthread_mutex_lock(&actions->mutex);
        fm_schedule_note(one->schedule, event.requirement, !event.is_recovery, now);
        pthread_mutex_unlock(&actions->mutex);
        act_for(actions, one, now);
      }
    }
  }
}

// Those that wait for a call come before others.
static void go_on_with_waiting(struct fm_actions * actions, uint32_t number, int64_t now)
{
  for (uint32_t kind = 0; kind < actions->options.table->n_kinds; ++kind) {
    struct fm_instance_schedule * one;
    while (actions->callers[number].schedule == NULL &&
      (one = fm_schedules_waiting(&actions->schedules[kind], number)) != NULL)
    {
      act_for(actions, one, now);
    }
  }
}

static void act_for_instances(struct fm_actions * actions, int64_t now)
{
  for (uint32_t kind = 0; kind < actions->options.table->n_kinds; ++kind) {
    struct fm_instance_schedule * one;
    while ((one = fm_schedules_first(&actions->schedules[kind], now)) != NULL) {
      pthread_mutex_lock(&actions->mutex);
      fm_schedule_start_due(one->schedule, now);
      pthread_mutex_unlock(&actions->mutex);
      act_for(actions, one, now);
    }
  }
}

static int64_t due_of_instances(const struct fm_actions * actions)
{
  int64_t due = FM_NEVER;
  for (uint32_t kind = 0; kind < actions->options.table->n_kinds; ++kind) {
    const int64_t other = fm_schedules_due(&actions->schedules[kind]);
    due = other < due ? other : due;
  }
  return due;
}

// ---- the thread --------------------------------------------------------------------------------

static uint32_t time_left(const struct fm_actions * actions)
{
  if (actions->has_ended) {
    return 0;
  }
  const int64_t now = fm_steady_time();
  const int64_t of_instances = due_of_instances(actions);
  int64_t due = fm_schedule_due(actions->schedule);
  due = of_instances < due ? of_instances : due;
  due = due < now + WAIT_NS ? due : now + WAIT_NS;
  for (uint32_t k = 0; k < actions->options.table->n_actions; ++k) {
    const int64_t other = fm_action_call_due(&actions->calls[k], now);
    due = other < due ? other : due;
  }
  return due <= now ? 0 : (uint32_t)((due - now + MILLISECOND_NS - 1) / MILLISECOND_NS);
}

static void follow(struct fm_actions * actions, int64_t now)
{
  pthread_mutex_lock(&actions->mutex);  // it counts
  fm_schedule_follow(actions->schedule, actions->states, now);
  pthread_mutex_unlock(&actions->mutex);
}

static void * run(void * argument)
{
  struct fm_actions * actions = argument;
  const struct fm_actions_options * options = &actions->options;
  const struct caller of_bundle = {actions->schedule, NULL};
  uint64_t seen = 0;
  while (!fm_engine_is_closed(options->engine)) {
    __atomic_fetch_add(&actions->turns, 1u, __ATOMIC_RELAXED);
    seen = fm_engine_states(options->engine, seen, time_left(actions), actions->states);
    const int64_t now = fm_steady_time();
    actions->has_ended = false;
    follow(actions, now);
    act(actions, &of_bundle, now);
    for (uint32_t k = 0; k < options->table->n_actions; ++k) {
      go_on_with_waiting(actions, k, now);
    }
    follow_instances(actions, now);
    act_for_instances(actions, now);
    for (uint32_t k = 0; k < options->table->n_actions; ++k) {
      go_on_with_call(actions, k, now);
    }
  }
  return NULL;
}

// ---- its life ----------------------------------------------------------------------------------

static void free_actions(struct fm_actions * actions)
{
  for (uint32_t k = 0; actions->calls != NULL && k < actions->options.table->n_actions; ++k) {
    fm_action_call_free(&actions->calls[k]);
  }
  fm_schedule_destroy(actions->schedule);
  for (uint32_t k = 0; actions->schedules != NULL && k < actions->options.table->n_kinds; ++k) {
    fm_schedules_free(&actions->schedules[k]);
  }
  pthread_mutex_destroy(&actions->mutex);
  fm_lines_free(&actions->lines);
  fm_memory_free(&actions->memory);
  free(actions);
}

static size_t most_bytes(const struct fm_report_table * table)
{
  size_t most = 0;
  for (uint32_t k = 0; k < table->n_actions; ++k) {
    const size_t bytes = fm_payload_most(&table->actions[k]);
    most = bytes > most ? bytes : most;
  }
  return most;
}

static bool make_memory(struct fm_actions * actions)
{
  const struct fm_report_table * table = actions->options.table;
  struct fm_memory * memory = &actions->memory;
  const size_t n = table->n_actions;
  actions->calls = fm_reserve(memory, n, sizeof(*actions->calls));
  actions->callers = fm_reserve(memory, n, sizeof(*actions->callers));
  actions->payload = fm_reserve(memory, most_bytes(table), 1);
  actions->states = fm_reserve(memory, table->n_requirements, sizeof(*actions->states));
  actions->counts = fm_reserve(memory, n, sizeof(*actions->counts));
  actions->next_lines = fm_reserve(memory, n, sizeof(*actions->next_lines));
  actions->schedules = fm_reserve(memory, table->n_kinds, sizeof(*actions->schedules));
  if (memory->is_short) {
    return false;
  }
  if (actions->options.before != NULL) {
    memcpy(
      actions->counts, actions->options.before, table->n_actions * sizeof(*actions->counts));
  }
  const struct fm_schedule_options options = {
    table->actions, table->follows, actions->counts, table->n_actions, table->n_requirements};
  for (uint32_t k = 0; k < table->n_kinds; ++k) {
    actions->schedules[k].options = options;
  }
  actions->schedule = fm_schedule_create(&options, false);
  return actions->schedule != NULL;
}

static bool make_calls(struct fm_actions * actions)
{
  const struct fm_actions_options * options = &actions->options;
  for (uint32_t k = 0; k < options->table->n_actions; ++k) {
    if (options->ends[k].publisher == NULL && !fm_action_call_make(
        &actions->calls[k], &options->services, &options->table->actions[k], &options->ends[k]))
    {
      return false;
    }
  }
  return true;
}

bool fm_actions_prepare(struct fm_engine * engine, const struct fm_report_table * table)
{
  bool has_keys = false;
  for (uint32_t k = 0; k < table->n_actions; ++k) {
    has_keys = has_keys || table->actions[k].n_parts > 0;
  }
  fm_engine_follow_states(engine);
  return !has_keys || fm_engine_follow_instances(engine);
}

bool fm_actions_start(struct fm_actions ** started, const struct fm_actions_options * options)
{
  struct fm_actions * actions = calloc(1, sizeof(*actions));
  if (actions == NULL || pthread_mutex_init(&actions->mutex, NULL) != 0) {
    free(actions);
    return false;
  }
  actions->options = *options;
  if (!make_memory(actions) || !make_calls(actions) ||
    !fm_start_thread(&actions->thread, run, actions))
  {
    free_actions(actions);
    return false;
  }
  actions->is_running = true;
  *started = actions;
  return true;
}

uint64_t fm_actions_turns(const struct fm_actions * actions)
{
  return __atomic_load_n(&actions->turns, __ATOMIC_RELAXED);
}

void fm_actions_look(
  struct fm_actions * actions, struct fm_action_facts * counts, struct fm_lines * lines)
{
  pthread_mutex_lock(&actions->mutex);
  memcpy(counts, actions->counts, actions->options.table->n_actions * sizeof(*counts));
  for (uint32_t k = 0; k < actions->lines.n; ++k) {
    fm_lines_add(lines, (enum fm_level)actions->lines.lines[k].level, "%s",
      actions->lines.lines[k].text);
  }
  fm_lines_clear(&actions->lines);
  pthread_mutex_unlock(&actions->mutex);
}

void fm_actions_end(struct fm_actions * actions)
{
  if (actions->is_running) {
    pthread_join(actions->thread, NULL);
    actions->is_running = false;
  }
}

void fm_actions_join(struct fm_actions ** actions)
{
  if (*actions != NULL) {
    fm_actions_end(*actions);
    free_actions(*actions);
    *actions = NULL;
  }
}
