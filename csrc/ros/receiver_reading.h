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

/// receiver_reading.h: the functions of a receiver for in_place.c and announcer.c. Those for
/// in_place.c run in the thread that takes, called back by the middleware's take_message. They
/// cannot fail.

#ifndef RECEIVER_READING_H_
#define RECEIVER_READING_H_

#include "middleware.h"

struct fm_engine;
struct fm_receiver;

/// The offsets of Fast CDR's private members. Owned by the middleware's struct. O(1).
const struct fm_in_place * fm_receiver_in_place(const struct fm_receiver * receiver);

/// Read the fields of a message that is valid only during this call. The message is copied if it
/// cannot be decoded or some field cannot be used. O(fields), O(size) with a copy.
void fm_receiver_read(struct fm_receiver * receiver, const uint8_t * message, size_t size);

/// Take and deliver up to 64 messages of one receiver of the engine that left some in its queue;
/// return at once if there is none. What is still left waits for the next call. For the
/// announcer's thread, without the lock.
void fm_receiver_catch_up(struct fm_engine * engine);

#endif  // RECEIVER_READING_H_
