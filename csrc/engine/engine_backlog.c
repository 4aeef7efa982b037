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

/// engine_backlog.c: the messages that callbacks leave in the middleware's queues, and what is due
/// with them. See engine_locked.h.
///
/// Lock order: the turn, then the middleware's locks of a subscription, then the engine's mutex.
/// What a turn guards: the list of queues, and the message that was taken of each. While
/// `is_catching_up` is set, callbacks take nothing; it is set in a turn, with the mutex held.

#define _POSIX_C_SOURCE 200809L

#include "engine_parts.h"

#include "instance.h"
#include "thread.h"

#define MOST_AT_ONCE 1000u       // messages; what they violate is published in between
#define BUSY_WINDOW_NS 20000000  // of callbacks; the middleware's own queues hold about as long
#define CALM_WINDOW_NS 1000000000
#define REST_NS 400000000        // then the queues are looked at: a notification may be lost

static bool load(const uint32_t * flag) {return __atomic_load_n(flag, __ATOMIC_SEQ_CST) != 0;}

static void store(uint32_t * flag, bool value)
{
  __atomic_store_n(flag, value ? 1u : 0u, __ATOMIC_SEQ_CST);
}

// ---- turns -------------------------------------------------------------------------------------

// A lock that threads get in the order in which they ask. From a mutex, the thread that catches up
// with a flood would take the next turn, too, long before one that waits is awake.
static void begin_turn(struct fm_engine * engine)
{
  pthread_mutex_lock(&engine->catching);
  const uint64_t turn = engine->turns;
  engine->turns += 1;
  while (engine->turn != turn) {
    pthread_cond_wait(&engine->turn_ended, &engine->catching);
  }
  pthread_mutex_unlock(&engine->catching);
}

static bool begin_turn_if_free(struct fm_engine * engine)
{
  pthread_mutex_lock(&engine->catching);
  const bool is_free = engine->turn == engine->turns;
  engine->turns += is_free ? 1u : 0u;
  pthread_mutex_unlock(&engine->catching);
  return is_free;
}

static void end_turn(struct fm_engine * engine)
{
  pthread_mutex_lock(&engine->catching);
  engine->turn += 1;
  pthread_cond_broadcast(&engine->turn_ended);
  pthread_mutex_unlock(&engine->catching);
}

// ---- queues ------------------------------------------------------------------------------------

void fm_engine_add_queue(struct fm_engine * engine, struct fm_queue * queue)
{
  queue->has_one = false;
  begin_turn(engine);
  fm_engine_lock(engine);
  queue->next = engine->queues;
  engine->queues = queue;
  store(&engine->is_catching_up, true);
  store(&engine->has_left, true);
  fm_engine_unlock(engine);
  end_turn(engine);
}

void fm_engine_remove_queue(struct fm_engine * engine, struct fm_queue * queue)
{
  begin_turn(engine);
  fm_engine_lock(engine);
  if (queue->has_one) {
    queue->has_one = false;
    queue->deliver_locked(queue->receiver);
  }
  for (struct fm_queue ** place = &engine->queues; *place != NULL; place = &(*place)->next) {
    if (*place == queue) {
      *place = queue->next;
      break;
    }
  }
  engine->in_round = engine->in_round && engine->queues != NULL;
  fm_engine_unlock(engine);
  end_turn(engine);
}

// ---- callbacks ---------------------------------------------------------------------------------

// Whether an instant is over at which something is due.
static bool is_due_locked(struct fm_engine * engine)
{
  int64_t now;
  return engine->has_begun && fm_engine_wakes_at_locked(engine) != FM_NEVER &&
         fm_engine_read_now_locked(engine, 0, &now) &&
         fm_engine_wakes_at_locked(engine) < now &&
         fm_engine_next_due_locked(engine) < now;
}

// Whether somebody catches up, who looks at `has_left` afterwards.
static bool is_left_to_others(struct fm_engine * engine)
{
  if (load(&engine->is_catching_up)) {
    store(&engine->has_left, true);
    return load(&engine->is_catching_up);
  }
  return false;
}

static void leave_locked(struct fm_engine * engine)
{
  store(&engine->has_left, true);
  pthread_cond_signal(&engine->violation_queued);
}

void fm_engine_leave(struct fm_engine * engine)
{
  if (!is_left_to_others(engine)) {
    fm_engine_lock(engine);
    leave_locked(engine);
    fm_engine_unlock(engine);
  }
}

static int64_t processor_time(void) {return fm_read_clock(CLOCK_THREAD_CPUTIME_ID);}

bool fm_engine_begin_taking(struct fm_engine * engine)
{
  if (is_left_to_others(engine)) {
    return false;
  }
  fm_engine_lock(engine);
  engine->began = fm_steady_time();
  const bool is_left = load(&engine->is_catching_up) ||
    (engine->has_announcer && (engine->is_overloaded || is_due_locked(engine)));
  if (is_left) {
    engine->began = 0;
    leave_locked(engine);
    fm_engine_unlock(engine);
    return false;
  }
  engine->began_use = engine->measures_use ? processor_time() : 0;
  return true;
}

static void end_window_locked(struct fm_engine * engine, int64_t now)
{
  const int64_t window = fm_between(engine->busy_since, now);
  const int64_t stood = engine->busy - engine->use;  // callbacks that had no processor
  const bool seems_busy = engine->busy > window / 2;
  if (engine->measures_use && seems_busy && engine->use > (window - stood) / 2) {
    engine->is_overloaded = true;
    engine->catching_use = 0;
    engine->catching_since = now;
  }
  engine->measures_use = seems_busy;
  engine->busy = 0;
  engine->use = 0;
  engine->busy_since = now;
}

// Whether callbacks take more than half of the time of the threads in which the middleware
// receives: messages of all topics then wait, or are lost, before they have a time of reception.
// On a busy machine a callback may take long without doing much. So, where it seems so, the next
// window decides, in which processor time is measured, too; that costs more than a message.
static void note_busy_locked(struct fm_engine * engine)
{
  const int64_t now = fm_steady_time();
  engine->busy += fm_between(engine->began, now);
  engine->use += engine->measures_use ? processor_time() - engine->began_use : 0;
  if (fm_between(engine->busy_since, now) >= BUSY_WINDOW_NS) {
    end_window_locked(engine, now);
  }
}

void fm_engine_end_taking(struct fm_engine * engine, bool is_behind)
{
  if (is_behind) {
    leave_locked(engine);
  }
  note_busy_locked(engine);
  engine->began = 0;
  fm_engine_unlock(engine);
}

// ---- catching up -------------------------------------------------------------------------------

// The system time was set back since the round began: what is received since is not of it.
static void follow_set_back_locked(struct fm_engine * engine)
{
  const int64_t ahead = fm_engine_system_ahead_locked(engine);
  const int64_t step = fm_between(engine->ahead_of_round, ahead);
  if (step < 0) {
    engine->received_by = fm_later(engine->received_by, step);
    engine->ahead_of_round = ahead;
  }
}

// A round delivers all that was received before it began, in the order of reception, and ends with
// what is due by its time. One that stops at its limit goes on in the next call.
static void begin_round(struct fm_engine * engine)
{
  fm_engine_lock(engine);
  if (engine->in_round) {
    follow_set_back_locked(engine);
  } else {
    engine->in_round = true;
    store(&engine->is_catching_up, true);
    store(&engine->has_left, false);
    engine->has_round = !engine->is_closed && engine->source != FM_TOLD &&
      fm_engine_read_now_locked(engine, 0, &engine->round);
    engine->received_by = fm_engine_round_received_by_locked(engine);
    engine->ahead_of_round = fm_engine_system_ahead_locked(engine);
    const int64_t now = fm_read_clock(CLOCK_REALTIME);
    for (struct fm_queue * queue = engine->queues; queue != NULL; queue = queue->next) {
      if (queue->received > engine->received_by && queue->received > now) {
        queue->received = engine->received_by;  // held, and the system time was set back since
      }
    }
  }
  fm_engine_unlock(engine);
}

// Whether a message that was taken belongs to the round. One that was received later is held for
// the next round.
static bool is_of_round(const struct fm_engine * engine, const struct fm_queue * queue)
{
  return queue->has_one && queue->received <= engine->received_by;
}

static void take_next(const struct fm_engine * engine, struct fm_queue * queue)
{
  queue->has_one = queue->take(queue->receiver, &queue->received);
  if (queue->has_one && queue->received > engine->received_by &&
    queue->received > fm_read_clock(CLOCK_REALTIME))
  {
    queue->received = engine->received_by;  // the system time was set back since
  }
}

// Of messages of one instant, that of the queue that was added first: the bundle's first topic.
static struct fm_queue * earliest(const struct fm_engine * engine)
{
  struct fm_queue * found = NULL;
  for (struct fm_queue * queue = engine->queues; queue != NULL; queue = queue->next) {
    if (is_of_round(engine, queue) && (found == NULL || queue->received <= found->received)) {
      found = queue;
    }
  }
  return found;
}

// Returns whether all messages of the round were delivered. `left`: how many may be, at most.
static bool deliver_round(struct fm_engine * engine, uint32_t * left)
{
  struct fm_queue * first = NULL;
  for (struct fm_queue * queue = engine->queues; queue != NULL; queue = queue->next) {
    if (!queue->has_one) {
      take_next(engine, queue);
    }
  }
  while (*left > 0 && (first = earliest(engine)) != NULL) {
    *left -= 1;
    fm_engine_lock(engine);
    first->deliver_locked(first->receiver);
    fm_engine_unlock(engine);
    take_next(engine, first);
  }
  return earliest(engine) == NULL;
}

static bool holds_messages(struct fm_engine * engine)
{
  bool holds = false;
  for (struct fm_queue * queue = engine->queues; queue != NULL; queue = queue->next) {
    holds = holds || queue->has_one;
  }
  return holds;
}

// Take what is due by the round's time. Returns whether callbacks take the messages again.
static bool end_round(struct fm_engine * engine)
{
  const bool holds = holds_messages(engine);
  fm_engine_lock(engine);
  if (engine->has_begun && engine->has_round && engine->source != FM_TOLD && !engine->is_closed) {
    fm_engine_take_due_by_locked(engine, engine->round);
  }
  engine->in_round = false;
  engine->caught_up = fm_steady_time();
  if (!holds) {
    store(&engine->is_catching_up, false);
  }
  const bool is_over = !holds && !load(&engine->has_left);
  fm_engine_unlock(engine);
  return is_over;
}

static void note_calm(struct fm_engine * engine, int64_t use, bool is_over)
{
  fm_engine_lock(engine);
  const int64_t now = fm_steady_time();
  engine->catching_use += use;
  if (is_over && fm_between(engine->catching_since, now) >= CALM_WINDOW_NS) {
    engine->is_overloaded = engine->is_overloaded &&
      engine->catching_use > fm_between(engine->catching_since, now) / 4;
    engine->catching_use = 0;
    engine->catching_since = now;
  }
  fm_engine_unlock(engine);
}

// Go on for so many rounds and messages, or until nothing is left.
static void take_rounds(struct fm_engine * engine, uint32_t rounds, uint32_t messages)
{
  const int64_t began = processor_time();
  bool is_over = false;
  while (!is_over && rounds > 0 && messages > 0) {
    uint32_t most = messages < MOST_AT_ONCE ? messages : MOST_AT_ONCE;
    messages -= most;
    begin_round(engine);
    if (deliver_round(engine, &most)) {
      is_over = end_round(engine);
      rounds -= 1;
    }
    messages += most;
  }
  note_calm(engine, processor_time() - began, is_over);
  if (!is_over) {
    fm_engine_lock(engine);
    leave_locked(engine);
    fm_engine_unlock(engine);
  }
}

static void catch_up(struct fm_engine * engine)
{
  if (engine->queues != NULL) {
    take_rounds(engine, UINT32_MAX, MOST_AT_ONCE);
  } else {
    fm_engine_lock(engine);
    fm_engine_take_due_now_locked(engine);
    fm_engine_unlock(engine);
  }
}

void fm_engine_catch_up(struct fm_engine * engine)
{
  begin_turn(engine);
  catch_up(engine);
  end_turn(engine);
}

void fm_engine_catch_up_if_free(struct fm_engine * engine)
{
  if (begin_turn_if_free(engine)) {
    catch_up(engine);
    end_turn(engine);
  }
}

void fm_engine_begin_order(struct fm_engine * engine)
{
  begin_turn(engine);
  if (engine->in_round) {
    take_rounds(engine, 1, UINT32_MAX);  // it began before what was received last
  }
  if (engine->queues != NULL) {
    take_rounds(engine, 1, UINT32_MAX);
  }
}

void fm_engine_end_order(struct fm_engine * engine)
{
  end_turn(engine);
}

void fm_engine_drain(struct fm_engine * engine)
{
  fm_engine_begin_order(engine);
  fm_engine_end_order(engine);
  fm_engine_catch_up(engine);  // what callbacks have left meanwhile
}

// Whether a message waits that takes effect by its stamp.
static bool has_waited_locked(struct fm_engine * engine)
{
  const struct fm_waiting * first = fm_reorder_first(&engine->waiting);
  int64_t now;
  return first != NULL && fm_engine_read_now_locked(engine, 0, &now) && first->stamp <= now;
}

bool fm_engine_catch_up_if_due_locked(struct fm_engine * engine)
{
  if (engine->queues == NULL) {
    fm_engine_take_due_now_locked(engine);
  } else if (load(&engine->has_left) || is_due_locked(engine) || has_waited_locked(engine) ||
    fm_between(engine->caught_up, fm_steady_time()) >= REST_NS)
  {
    fm_engine_unlock(engine);
    fm_engine_catch_up(engine);
    fm_engine_lock(engine);
  }
  return load(&engine->has_left);
}
