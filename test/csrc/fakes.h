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

/// fakes.h: a clock that the test sets, and what the middlewares of the tests have in common.

#ifndef FAKES_H_
#define FAKES_H_

#include "middleware.h"

struct clock
{
  int64_t now;
  bool fails;
};

static inline int read_clock(void * clock, int64_t * nanoseconds)
{
  *nanoseconds = ((struct clock *)clock)->now;
  return ((struct clock *)clock)->fails ? 1 : 0;
}

// The first member of a subscription.
struct listener
{
  fm_on_message callback;
  const void * user_data;
  bool keeps_callback;  // it does not remove its callback
};

static inline int set_listener(
  void * subscription, fm_on_message callback, const void * user_data)
{
  struct listener * self = subscription;
  if (callback == NULL && self->keeps_callback) {
    return 1;
  }
  self->callback = callback;
  self->user_data = user_data;
  return 0;
}

static inline void notify(const struct listener * listener, size_t messages)
{
  listener->callback(listener->user_data, messages);
}

static inline int publish_nothing(const void * publisher, const void * message, void * allocation)
{
  (void)publisher;
  (void)message;
  (void)allocation;
  return 0;
}

static inline void forget_error(void) {}
static inline bool has_error(void) {return false;}

#define FAKE_MIDDLEWARE(take, listen, publish) \
  {take, listen, publish, forget_error, has_error, NULL, {0, 0, 0}, NULL}

#endif  // FAKES_H_
