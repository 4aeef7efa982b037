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


/// engine.h: an evaluator that several threads share, fed with messages as they are on the wire.
///
/// Whoever takes a message from the middleware hands its bytes to fm_engine_message: fields are
/// read, inputs stored, steps taken, under one mutex. What is to be announced goes to a queue, and
/// details of it to another; threads of their own empty these, so that whoever delivers a message
/// never publishes, and never waits for Python.
///
/// All functions may be called from any thread, but for create and destroy. None of them holds the
/// mutex while it calls what it was given, but for the clock, which must not block.

#ifndef ENGINE_H_
#define ENGINE_H_

#include "evaluator.h"
#include "fret_fields.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fm_engine;

/// What to engine with. All of it outlives the engine and stays the caller's; nobody else calls the
/// evaluator as long as the engine lives.
struct fm_engine_options
{
  struct fm_evaluator * evaluator;
  const struct fm_monitor * monitor;
  const struct fm_readers * readers;  // NULL: no topics
  const struct fm_topic * topics;     // as the evaluator has them
  uint32_t n_topics;
};

/// Where a message is from.
struct fm_origin
{
  int64_t received;    // ns; the stamp of what it violates, if there is no clock
  int64_t sent;        // ns, by its sender's clock
  uint64_t sequence;   // the sender's number of it
  const uint8_t * gid; // of the sender, 16 bytes; NULL: not known
  bool is_retired;     // it came by a subscription that is about to be replaced
};

/// What became of a message.
enum fm_receipt
{
  FM_RECEIVED = 0,
  FM_UNDECODABLE = 1,  // counted; no step
  FM_REPEATED = 2      // it has come before, by another subscription; not counted, no step
};

/// One violation in detail, followed in memory by the values of the inputs (the module's struct),
/// and by a byte for each input: 1 where it has a value, and 2 more where it is stale.
struct fm_detail
{
  struct fm_violation violation;
  uint64_t suppressed;  // details of this requirement that were left out so far
};

/// Make a engine; NULL if the readers are not those of the topics, or memory is short.
/// O(requirements + topics); allocates, as fm_engine_message does where a queue grows.
FM_EXPORT struct fm_engine * fm_engine_create(const struct fm_engine_options * options);

/// Free it. Nobody else may be in a call on it; close it and join its readers before.
FM_EXPORT void fm_engine_destroy(struct fm_engine * engine);

/// Wake all who wait for violations or details, now and from now on, once the queues are empty.
/// Messages that come later are ignored.
FM_EXPORT void fm_engine_close(struct fm_engine * engine);
FM_EXPORT bool fm_engine_is_closed(struct fm_engine * engine);

/// Deliver a message: read, store, step, queue what is to be announced. Returns enum fm_receipt.
/// O(fields to read + operations of the groups that step).
FM_EXPORT uint32_t fm_engine_message(
  struct fm_engine * engine, uint32_t topic, const uint8_t * message, size_t size,
  const struct fm_origin * origin);

/// fm_evaluator_tick, fm_evaluator_stale and fm_evaluator_reset; what the first two announce is
/// queued.
FM_EXPORT void fm_engine_tick(struct fm_engine * engine, int64_t stamp);
FM_EXPORT void fm_engine_stale(
  struct fm_engine * engine, uint32_t input, uint64_t received, int64_t stamp);
FM_EXPORT bool fm_engine_is_stale(struct fm_engine * engine, uint32_t input);
FM_EXPORT void fm_engine_reset(struct fm_engine * engine);

/// Stamp violations by a clock, and no longer by the messages' times of reception; NULL: no clock.
/// `now` returns 0 and writes nanoseconds.
FM_EXPORT void fm_engine_use_clock(
  struct fm_engine * engine, int (* now)(void * clock, int64_t * nanoseconds), void * clock);

/// From now on a topic may bring messages twice, by an old subscription and by a new one:
/// recognise them. With `has_history`, what only the new one brings and was sent before what was
/// heard last of the same sender is history, and left out too. Until fm_engine_end_handover.
FM_EXPORT void fm_engine_begin_handover(struct fm_engine * engine, uint32_t topic, bool has_history);
FM_EXPORT void fm_engine_end_handover(struct fm_engine * engine, uint32_t topic);

/// Take up to `room` violations from the queue, in order; wait up to `milliseconds` if there are
/// none. Returns their number; 0 after the time, or once it is closed and the queue empty. A
/// violation whose detail is kept comes after that was published, or 0.1 s later at most.
FM_EXPORT uint32_t fm_engine_take(
  struct fm_engine * engine, struct fm_violation * out, uint32_t room, uint32_t milliseconds);

/// Whether anybody wants details; they are kept only then, at most `most` a second of a
/// requirement, and at most 1024 in all; the others are counted.
FM_EXPORT void fm_engine_want_details(struct fm_engine * engine, bool is_wanted, uint32_t most);

/// Take the next detail: fm_detail, behind it the inputs (monitor->inputs_bytes), behind them the
/// flags (monitor->n_inputs). Waits as fm_engine_take. Returns whether there was one. To ask for
/// the next one is to say that this one was published.
FM_EXPORT bool fm_engine_take_detail(
  struct fm_engine * engine, struct fm_detail * out, uint32_t milliseconds);

/// Copy the first message of a topic that had a field that could not be used, and forget it, so
/// that the next one is kept. Returns its size, 0 if there is none, or
/// more than `room` if it does not fit: then nothing is written, and it is still there.
FM_EXPORT size_t fm_engine_evidence(
  struct fm_engine * engine, uint32_t topic, uint8_t * out, size_t room);

/// Messages of a topic that were sent and never came, by the numbers of senders whose gid is known;
/// what is lost between fm_engine_begin_handover and fm_engine_end_handover is counted from there on.
FM_EXPORT uint64_t fm_engine_lost(struct fm_engine * engine, uint32_t topic);

/// Violations that nobody was told of: the queue had no memory to grow, or was full (2^20), or who
/// took them said that they could not be published.
FM_EXPORT uint64_t fm_engine_unpublished(struct fm_engine * engine);
FM_EXPORT void fm_engine_count_unpublished(struct fm_engine * engine, uint64_t more);

/// As those of the evaluator.
FM_EXPORT struct fm_requirement_counts fm_engine_requirement_counts(
  struct fm_engine * engine, uint32_t requirement);
FM_EXPORT struct fm_input_counts fm_engine_input_counts(struct fm_engine * engine, uint32_t input);
FM_EXPORT struct fm_topic_counts fm_engine_topic_counts(struct fm_engine * engine, uint32_t topic);

/// Copy the value of an input to an object of its type. Returns whether it has one.
FM_EXPORT bool fm_engine_value(struct fm_engine * engine, uint32_t input, void * out);

#ifdef __cplusplus
}
#endif

#endif  // ENGINE_H_
