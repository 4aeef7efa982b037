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

/// receiver.h: takes the messages of a subscription for an engine, without Python.
///
/// A receiver takes and delivers the messages inside the middleware's new-message callback, at
/// most 1000 in one; what is left is taken by the thread in fm_engine_take. Where the callback
/// must not take, it only wakes that thread.

#ifndef RECEIVER_H_
#define RECEIVER_H_

#include "engine.h"
#include "middleware.h"

struct fm_receiver;

/// How a receiver takes messages.
enum fm_taking
{
  FM_LISTEN = 0,           // in the new-message callback
  FM_LISTEN_IN_PLACE = 1,  // so, and the subscription has a type support of fm_in_place_make
  FM_WAKE = 2              // in the thread in fm_engine_take, which the callback wakes
};

/// How to take the messages of a middleware (rmw_get_implementation_identifier): FM_LISTEN where
/// its callbacks are known to allow it, otherwise FM_WAKE. O(1).
FM_EXPORT uint32_t fm_receiver_taking(const char * middleware);

/// Start to take the messages of a subscription (an rmw_subscription_t from which no other code
/// takes) as those of a topic. Messages that are already queued are delivered first, at most 1000
/// before this returns. The engine, the middleware and the
/// subscription outlive the receiver. `taking`: enum fm_taking. False if the middleware has no
/// new-message callback, or memory is short. `*receiver` as of fm_announcer_start. `key`: of a
/// topic with an instance variable in its name, all of whose messages are those of a key, which is
/// copied; it has up to FM_MOST_KEY_BYTES bytes. NULL: no variable.
///
/// The functions of this header may be called from any thread, but not from within the
/// middleware's callback. For one receiver, only fm_receiver_retire may run at the same time as
/// another of them. Each message that is delivered costs what fm_engine_message does.
FM_EXPORT bool fm_receiver_start(
  struct fm_receiver ** receiver, struct fm_engine * engine,
  const struct fm_middleware * middleware, void * subscription, uint32_t topic, uint32_t taking,
  const struct fm_key * key);

/// A new subscription replaces this one: see fm_origin.is_retired. O(1).
FM_EXPORT void fm_receiver_retire(struct fm_receiver * receiver);

/// Stop; waits for a running callback to return. No message is delivered afterwards. Returns true
/// if the receiver was freed and `*receiver` set to NULL, or was NULL before. Returns false if the
/// middleware could not remove its callback: the receiver, the engine, the middleware and the
/// subscription must then live as long as the process.
FM_EXPORT bool fm_receiver_stop(struct fm_receiver ** receiver);

#endif  // RECEIVER_H_
