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

/// sign_of_life.h: `~/alive`, once a second while all threads of the monitor go round.
///
/// The liveliness of the publisher is asserted by nothing else, so that a subscriber learns of a
/// monitor that hangs as of one that has ended. The main thread only.

#ifndef SIGN_OF_LIFE_H_
#define SIGN_OF_LIFE_H_

#include "session.h"

/// Zeroed before fm_sign_of_life_begin.
struct fm_sign_of_life
{
  const struct fm_session * sessions;
  uint32_t n;
  rcl_publisher_t publisher;
  uint64_t * turns;     // of the threads of each session: at the last sign, then now
  int64_t published;    // steady
  int64_t suspected;    // steady: when a thread was first found not to have turned; 0: none is
  int64_t next_line;
};

/// Advertise the topic and publish the first sign. Returns false, with the error logged.
bool fm_sign_of_life_begin(
  struct fm_sign_of_life * sign, const struct fm_session * sessions, uint32_t n);

/// Publish the sign, if all threads of all sessions have looked for work since the last one; to be
/// called once a second.
void fm_sign_of_life_beat(struct fm_sign_of_life * sign);

void fm_sign_of_life_end(struct fm_sign_of_life * sign);

#endif  // SIGN_OF_LIFE_H_
