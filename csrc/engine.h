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

/// engine.h: an evaluator that several threads share, fed with serialized messages.
///
/// Whoever takes a message from the middleware passes its bytes to fm_engine_message, which reads
/// the fields, stores the inputs and steps, under one mutex. Violations and details of them go to
/// queues, which other threads empty: a thread that delivers messages never publishes, and never
/// waits for Python.
///
/// All functions may be called from any thread, except fm_engine_create and fm_engine_destroy. They
/// hold the mutex only while they run, and block for nothing but the mutex, except where a time to
/// wait is given. The only function they call with the mutex held is the clock, which must not
/// block. Without a stated complexity a function is O(1).

#ifndef ENGINE_H_
#define ENGINE_H_

#include "evaluator.h"
#include "fret_fields.h"
#include "handover.h"
#include "outbox.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fm_engine;

/// What an engine runs. All of it outlives the engine and stays the caller's; nobody else calls the
/// evaluator as long as the engine lives.
struct fm_engine_options
{
  struct fm_evaluator * evaluator;
  const struct fm_monitor * monitor;
  const struct fm_readers * readers;  // NULL: no topics
  const struct fm_topic * topics;     // as the evaluator has them
  uint32_t n_topics;
};

/// What became of a message.
enum fm_receipt
{
  FM_RECEIVED = 0,
  FM_UNDECODABLE = 1,  // counted; no step
  FM_REPEATED = 2      // received before, by another subscription; not counted, no step
};

/// Make an engine; NULL if the readers are not those of the topics, or memory is short.
/// O(requirements + topics); allocates.
FM_EXPORT struct fm_engine * fm_engine_create(const struct fm_engine_options * options);

/// Free it. No other thread may be in a call on it, or call later: close it and join them before.
FM_EXPORT void fm_engine_destroy(struct fm_engine * engine);

/// Ignore messages from now on. Waiting for violations and details ends, now and later, once their
/// queues are empty.
FM_EXPORT void fm_engine_close(struct fm_engine * engine);
FM_EXPORT bool fm_engine_is_closed(struct fm_engine * engine);

/// Deliver a message: read, store, step, queue the violations. Returns enum fm_receipt.
/// O(fields to read + operations of the groups that step); allocates when a queue grows.
FM_EXPORT uint32_t fm_engine_message(
  struct fm_engine * engine, uint32_t topic, const uint8_t * message, size_t size,
  const struct fm_origin * origin);

/// As fm_evaluator_tick, fm_evaluator_stale and fm_evaluator_reset; the violations are queued.
FM_EXPORT void fm_engine_tick(struct fm_engine * engine, int64_t stamp);
FM_EXPORT void fm_engine_stale(
  struct fm_engine * engine, uint32_t input, uint64_t received, int64_t stamp);
FM_EXPORT bool fm_engine_is_stale(struct fm_engine * engine, uint32_t input);
FM_EXPORT void fm_engine_reset(struct fm_engine * engine);

/// Stamp violations by a clock instead of the messages' times of reception; NULL: no clock.
/// `now` writes nanoseconds and returns 0; where it fails, the time of reception is used. The clock
/// outlives the engine, or the next call of this.
FM_EXPORT void fm_engine_use_clock(
  struct fm_engine * engine, int (* now)(void * clock, int64_t * nanoseconds), void * clock);

/// As fm_arrivals_begin_handover and fm_arrivals_end_handover, of a topic.
FM_EXPORT void fm_engine_begin_handover(
  struct fm_engine * engine, uint32_t topic, bool has_history);
FM_EXPORT void fm_engine_end_handover(struct fm_engine * engine, uint32_t topic);

/// Take up to `room` violations from the queue, oldest first. If there are none, wait for up to
/// `milliseconds`, not at all for 0. Returns their number; 0 after the time, or when the engine is
/// closed and the queue empty. One thread takes at a time, which keeps them in order. O(room).
FM_EXPORT uint32_t fm_engine_take(
  struct fm_engine * engine, struct fm_violation * out, uint32_t room, uint32_t milliseconds);

/// As fm_outbox_want_details.
FM_EXPORT void fm_engine_want_details(
  struct fm_engine * engine, bool are_wanted, uint32_t most_per_s);

/// As fm_outbox_take_detail; waits as fm_engine_take does. One thread takes at a time. A violation
/// does not wait for its detail, nor the reverse.
FM_EXPORT bool fm_engine_take_detail(
  struct fm_engine * engine, struct fm_detail * out, uint32_t milliseconds);

/// Copy the first message of a topic that had a field that could not be used, and forget it, so
/// that the next one is kept. Returns its size, 0 if there is none. If the size is more than
/// `room`, nothing is written and the message stays. O(size).
FM_EXPORT size_t fm_engine_evidence(
  struct fm_engine * engine, uint32_t topic, uint8_t * out, size_t room);

/// As fm_arrivals_lost, of a topic.
FM_EXPORT uint64_t fm_engine_lost(struct fm_engine * engine, uint32_t topic);

/// Violations that were not published: the queue was full (2^20) or had no memory to grow, or a
/// publisher failed and said so with fm_engine_count_unpublished.
FM_EXPORT uint64_t fm_engine_unpublished(struct fm_engine * engine);
FM_EXPORT void fm_engine_count_unpublished(struct fm_engine * engine, uint64_t more);

/// As those of the evaluator.
FM_EXPORT struct fm_requirement_counts fm_engine_requirement_counts(
  struct fm_engine * engine, uint32_t requirement);
FM_EXPORT struct fm_input_counts fm_engine_input_counts(
  struct fm_engine * engine, uint32_t input);
FM_EXPORT struct fm_topic_counts fm_engine_topic_counts(
  struct fm_engine * engine, uint32_t topic);
FM_EXPORT bool fm_engine_value(struct fm_engine * engine, uint32_t input, void * out);

#ifdef __cplusplus
}
#endif

#endif  // ENGINE_H_
