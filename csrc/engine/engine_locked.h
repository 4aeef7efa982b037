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

/// engine_locked.h: the functions of an engine that its receivers need beyond engine.h. With them
/// a receiver takes, reads and delivers a message under one lock, with no other message in
/// between. O(1) and without failure, except where stated.

#ifndef ENGINE_LOCKED_H_
#define ENGINE_LOCKED_H_

#include "engine.h"

/// Hold and release the engine's mutex. It is not recursive: with it held, only the functions here
/// may be called.
void fm_engine_lock(struct fm_engine * engine);
void fm_engine_unlock(struct fm_engine * engine);

/// The reader of a topic. Constant; any thread, without the lock. `topic` must be in range.
const struct fm_reader * fm_engine_reader(const struct fm_engine * engine, uint32_t topic);

/// A message after reading. `fields`, in the order of the topic's inputs, are valid if it was
/// decoded; `message` and `size` if some field cannot be used, or messages are kept. Owned by the
/// caller.
struct fm_reading
{
  const struct fm_field * fields;
  const uint8_t * message;
  size_t size;
  int64_t stamp;      // of its header, if these count
  bool is_decoded;
  bool is_unrelated;  // decoded, and none of the topic: its `where` does not select it
};

/// Whether fm_reading must have the bytes of a message: it cannot be decoded, messages are kept,
/// some field cannot be used, or the message has links between frames, or parts for instances. Any
/// thread, without the lock. O(fields).
bool fm_engine_needs_bytes(
  const struct fm_engine * engine, uint32_t topic, const struct fm_reading * reading);

/// Read a message of a topic: its fields, and its stamp. `reading` then refers to the fields and
/// the message. Returns whether it can be decoded; if not, the fields are unspecified. Any thread,
/// without the lock. O(fields to read).
bool fm_engine_read(
  const struct fm_engine * engine, uint32_t topic, const uint8_t * message, size_t size,
  struct fm_field * fields, struct fm_reading * reading);

/// As fm_engine_message, for a message that was read already. Call it with the lock held. `topic`
/// must be in range.
uint32_t fm_engine_receive_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_reading * reading,
  const struct fm_origin * origin);

/// Count messages of a topic that the middleware dropped since it could not decode them: they are
/// not lost. Call it with the lock held, before the next message is delivered. `topic` must be in
/// range.
void fm_engine_drop_locked(struct fm_engine * engine, uint32_t topic, uint32_t n);

/// A queue of the middleware, from which the engine takes what callbacks leave there. The receiver
/// owns it; what is below `deliver_locked` is the engine's.
struct fm_queue
{
  void * receiver;
  bool (* take)(void * receiver, int64_t * received);  // and keep it; false: none is queued
  void (* deliver_locked)(void * receiver);            // what was taken
  struct fm_queue * next;
  int64_t received;
  bool has_one;        // it was taken, and not delivered
};

/// Add a queue: callbacks leave its messages until the next fm_engine_catch_up. Remove it: a catch
/// up has ended, and the queue is used no more; a second call does nothing. Without the lock, and
/// not within a callback. O(1), O(queues).
void fm_engine_add_queue(struct fm_engine * engine, struct fm_queue * queue);
void fm_engine_remove_queue(struct fm_engine * engine, struct fm_queue * queue);

/// For a callback that does not take its message: wake the thread in fm_engine_take, which does.
void fm_engine_leave(struct fm_engine * engine);

/// Begin to take messages in a callback. Returns false if they are to be left in their queue:
/// others are taken from the queues now, or something is due, before which older messages of other
/// topics may wait, or callbacks take too much of the middleware's time. Otherwise the lock is
/// held until fm_engine_end_taking, and the steady clock stands still. `is_behind`: messages were
/// left. O(1), O(inputs + groups) once a deadline is over.
bool fm_engine_begin_taking(struct fm_engine * engine);
void fm_engine_end_taking(struct fm_engine * engine, bool is_behind);

/// Deliver what waits in the queues, at most 1000 messages, in the order of reception, each after
/// what was due before it; then take what is due by the time at which all that was received was
/// delivered. If the limit comes first, the next call goes on. Without the lock, and not within a
/// callback. Without queues it takes what is due. O(queues) for each message.
void fm_engine_catch_up(struct fm_engine * engine);

/// Deliver all that was received before the call, and take what is due by then; others do not
/// catch up until the second call. Without the lock, and not within a callback. O(messages in the
/// queues).
void fm_engine_begin_order(struct fm_engine * engine);
void fm_engine_end_order(struct fm_engine * engine);

/// Call a function with the lock held whenever a replacement of the gate's may be due earlier than
/// it was said last; NULL: call none. It must not block, nor call a function of the engine.
void fm_engine_on_due(
  struct fm_engine * engine, void (* on_due)(void * argument), void * argument);

#endif  // ENGINE_LOCKED_H_
