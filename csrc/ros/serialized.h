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

/// serialized.h: serialized messages that the middleware writes: taking them, and their memory.
///
/// For one subscription or message, one thread at a time.

#ifndef SERIALIZED_H_
#define SERIALIZED_H_

#include "middleware.h"

/// Return an allocator on malloc. A buffer that the middleware makes with it is freed with free.
FM_INTERNAL struct fm_allocator fm_malloc_allocator(void);

enum fm_take
{
  FM_EMPTY = 0,   // no message is waiting, or the middleware failed
  FM_TAKEN = 1,
  FM_DROPPED = 2  // the middleware dropped a message without a CDR header
};

/// Return what a call to take a message did, with its result, and clear the middleware's error.
/// Count in `*dropped` a message that the middleware dropped, also before the one that was taken;
/// of several, it shows only one.
FM_INTERNAL enum fm_take fm_take_result(
  const struct fm_middleware * middleware, int result, bool taken, uint32_t * dropped);

/// Take a message of a subscription. Zero the message before the first call; its buffer is used
/// again by the next. Return enum fm_take.
FM_EXPORT uint32_t fm_take_serialized(
  const struct fm_middleware * middleware, const void * subscription,
  struct fm_serialized * message, struct fm_padded_info * info);

/// Free the buffer of a message.
FM_EXPORT void fm_free_serialized(struct fm_serialized * message);

#endif  // SERIALIZED_H_
