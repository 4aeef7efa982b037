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


/// payload.h: messages and requests of actions, with the keys of instances in them.

#ifndef PAYLOAD_H_
#define PAYLOAD_H_

#include "schedule.h"

/// The most bytes that the message of an action may have. O(parts).
FM_EXPORT size_t fm_payload_most(const struct fm_action * action);

/// Write the serialized message of an action for a key (its size, then its bytes; NULL: it has
/// none) to fm_payload_most bytes. Returns how many bytes it has. O(its bytes).
FM_EXPORT size_t fm_payload_write(
  const struct fm_action * action, const uint8_t * key, uint8_t * out);

#endif  // PAYLOAD_H_
