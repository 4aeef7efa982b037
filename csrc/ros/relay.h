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


/// relay.h: a thread that takes the messages of a gate's topic, lets the engine judge each, and
/// publishes those that pass, and their replacements.
///
/// A message is published as the very bytes that were taken. Nothing is queued here: messages wait
/// in the middleware's queue of the subscription, so that none is judged long before it is sent.
/// The middleware's callback only wakes the thread. Replacements are published at their instants.

#ifndef RELAY_H_
#define RELAY_H_

#include "engine.h"
#include "middleware.h"

/// Subscriptions of a relay: one, or more during a handover.
#define FM_MOST_SOURCES 8

struct fm_relay;

/// What a relay does. The caller owns all of it; the substitute is copied, and the others outlive
/// the relay.
struct fm_relay_options
{
  struct fm_engine * engine;  // with a gate
  const struct fm_middleware * middleware;
  /// rmw_publish_serialized_message; returns 0 on success.
  int (* publish)(
    const void * publisher, const struct fm_serialized * message, void * allocation);
  void * publisher;           // rmw_publisher_t
  const uint8_t * substitute; // a message with its encapsulation header; NULL: none
  size_t substitute_size;
  bool holds;                 // the last message that passed is the replacement
  int64_t stamp_at;           // of a replacement, as of fm_engine_replace
};

/// Start the thread; `*relay` as of fm_announcer_start. False if no thread can be made, or memory
/// is short. The functions of this header may be called as those of receiver.h.
FM_EXPORT bool fm_relay_start(struct fm_relay ** relay, const struct fm_relay_options * options);

/// Take the messages of a subscription (an rmw_subscription_t from which no other code takes),
/// from now on, those in its queue first. False if the middleware has no new-message callback,
/// there are FM_MOST_SOURCES already, or memory is short.
FM_EXPORT bool fm_relay_add(struct fm_relay * relay, void * subscription);

/// As fm_receiver_retire.
FM_EXPORT void fm_relay_retire(struct fm_relay * relay, const void * subscription);

/// Take what is in the queue of a subscription, at most 1000 messages, then no more; waits for
/// that. Afterwards it may be destroyed, unless this returns false: the middleware could not
/// remove its callback. The subscription must then live as long as the process, as the relay's
/// memory does.
FM_EXPORT bool fm_relay_remove(struct fm_relay * relay, const void * subscription);

/// Publish with another publisher from now on. When this returns, the one before is not in use.
FM_EXPORT void fm_relay_publish_with(struct fm_relay * relay, void * publisher);

/// How often the thread has looked for messages: at least twice a second, unless it hangs.
FM_EXPORT uint64_t fm_relay_turns(struct fm_relay * relay);

/// How many messages were to be sent, and the middleware did not take them.
FM_EXPORT uint64_t fm_relay_unpublished(struct fm_relay * relay);

/// End the thread, and wait for it; a message that is being published is published first, and no
/// other. Does nothing if it has ended.
FM_EXPORT void fm_relay_end(struct fm_relay * relay);

/// fm_relay_end, free the relay and set `*relay` to NULL; does nothing if it is NULL. All
/// subscriptions were removed before. If a callback could not be removed, the memory that it uses
/// is not freed.
FM_EXPORT void fm_relay_join(struct fm_relay ** relay);

#endif  // RELAY_H_
