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

/// receiver.h: from the middleware to an engine, without Python.
///
/// A receiver takes the messages of one subscription inside the middleware's new-message callback
/// and delivers them.

#ifndef RECEIVER_H_
#define RECEIVER_H_

#include "engine.h"
#include "middleware.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fm_receiver;

/// Start to deliver the messages of a subscription (an rmw_subscription_t that nobody else takes
/// from) as those of a topic; what it holds already comes first, 1000 messages at most before this
/// returns. The engine, the middleware and the subscription outlive the receiver. `is_in_place`:
/// the subscription was made with a type support of fm_in_place_make. NULL if the middleware has no
/// such callback, or memory is short.
///
/// These functions may be called from any thread except the middleware's callback; no two of them
/// at once for one receiver, except fm_receiver_retire.
FM_EXPORT struct fm_receiver * fm_receiver_start(
  struct fm_engine * engine, const struct fm_middleware * middleware, void * subscription,
  uint32_t topic, bool is_in_place);

/// Take what is there, at most 1000 messages. Callbacks that come meanwhile leave their messages to
/// it, so that their order is kept.
FM_EXPORT void fm_receiver_drain(struct fm_receiver * receiver);

/// Poll, some times a second. Drains where the last callback or drain stopped at its limit.
/// Recovers messages whose notification was lost: the next callback looks for more than it was
/// notified of, and every 16th call without a callback drains.
FM_EXPORT void fm_receiver_poll(struct fm_receiver * receiver);

/// A new subscription replaces this one: see fm_origin.is_retired. O(1).
FM_EXPORT void fm_receiver_retire(struct fm_receiver * receiver);

/// Stop; waits for a callback under way. Nothing is delivered after it. Returns true: the receiver
/// is freed. Returns false if the middleware refuses to forget its callback: the receiver, and with
/// it the engine, the middleware and the subscription, must then stay for as long as the process.
FM_EXPORT bool fm_receiver_stop(struct fm_receiver * receiver);

#ifdef __cplusplus
}
#endif

#endif  // RECEIVER_H_
