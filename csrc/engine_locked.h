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


/// engine_locked.h: what hot_path.c needs of a engine beyond engine.h: to take a message, read it where
/// it lies, and deliver it without letting another one pass in between.

#ifndef ENGINE_LOCKED_H_
#define ENGINE_LOCKED_H_

#include "engine.h"

void fm_engine_lock(struct fm_engine * engine);
void fm_engine_unlock(struct fm_engine * engine);

/// How the messages of a topic are read.
const struct fm_reader * fm_engine_reader(const struct fm_engine * engine, uint32_t topic);

/// A message that was read: the fields, by the topic's inputs, if it is decoded; its bytes, where
/// anything of it cannot be used.
struct fm_reading
{
  const struct fm_field * fields;
  const uint8_t * message;
  size_t size;
  bool is_decoded;
  uint64_t thrown;  // so many the middleware may have thrown away since the last one, at most
};

/// fm_engine_message behind the reading, for whoever holds the lock.
uint32_t fm_engine_deliver_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_reading * reading,
  const struct fm_origin * origin);

/// Count a message of which there is nothing to read, for whoever holds the lock.
void fm_engine_undecodable_locked(struct fm_engine * engine, uint32_t topic);

#endif  // ENGINE_LOCKED_H_
