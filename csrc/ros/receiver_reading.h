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

/// receiver_reading.h: the functions of a receiver for in_place.c. The middleware's take_message
/// calls it back, so that these functions run in the thread that takes. They cannot fail.

#ifndef RECEIVER_READING_H_
#define RECEIVER_READING_H_

#include "middleware.h"

struct fm_receiver;

/// The offsets of Fast CDR's private members. Owned by the middleware's struct. O(1).
const struct fm_in_place * fm_receiver_in_place(const struct fm_receiver * receiver);

/// Read the fields of a message that is valid only during this call. The message is copied if it
/// cannot be decoded, some field cannot be used, or messages are kept. O(fields), O(size) with a
/// copy.
void fm_receiver_read(struct fm_receiver * receiver, const uint8_t * message, size_t size);

#endif  // RECEIVER_READING_H_
