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

/// Closes the engine just after the last violation, at a chosen place in the announcer's loop:
/// before or after one of the functions that the loop calls. The linker wraps these functions.

#define _POSIX_C_SOURCE 200809L

#include "announcer.h"
#include "seen.h"
#include "engines.h"

#include <stdio.h>
#include <string.h>
#include <time.h>

#include "fakes.h"

bool __real_fm_engine_is_closed(struct fm_engine * engine);
uint32_t __real_fm_engine_take(
  struct fm_engine * engine, struct fm_violation * out, uint32_t room, uint32_t milliseconds);
bool __wrap_fm_engine_is_closed(struct fm_engine * engine);
uint32_t __wrap_fm_engine_take(
  struct fm_engine * engine, struct fm_violation * out, uint32_t room, uint32_t milliseconds);

static const char * chosen;
static int published = 0;

static void close_at(struct fm_engine * engine, const char * place)
{
  if (strcmp(chosen, place) == 0) {
    chosen = "";
    fm_engine_advance(engine, 2);  // the first period; the time began with 1
    fm_engine_close(engine);
  }
}

bool __wrap_fm_engine_is_closed(struct fm_engine * engine)
{
  close_at(engine, "before_is_closed");
  const bool is_closed = __real_fm_engine_is_closed(engine);
  close_at(engine, "after_is_closed");
  return is_closed;
}

uint32_t __wrap_fm_engine_take(
  struct fm_engine * engine, struct fm_violation * out, uint32_t room, uint32_t milliseconds)
{
  close_at(engine, "before_take");
  const uint32_t n = __real_fm_engine_take(engine, out, room, milliseconds);
  close_at(engine, "after_take");
  return n;
}

static int publish(const void * publisher, const void * message, void * allocation)
{
  (void)publisher;
  (void)message;
  (void)allocation;
  nanosleep(&(struct timespec) {0, 20000000}, NULL);  // who does not join it is there before
  published += 1;
  return 0;
}

static const struct fm_middleware middleware = FAKE_MIDDLEWARE(NULL, NULL, publish);

// ---- a monitor that is violated at each step ---------------------------------------------------

static void reset(void * state) {(void)state;}

static void step(void * state, const void * inputs, bool * verdicts)
{
  (void)state;
  (void)inputs;
  verdicts[0] = false;
}

static const uint32_t requirement_indices[] = {0};
static const struct fm_group groups[] = {{NULL, 0, requirement_indices, 1, reset, step, NULL}};
static const struct fm_requirement requirements[] = {{"A", 0}};
static const struct fm_monitor monitor = {
  FM_ABI, 0, 1, 1, 8, 8, NULL, groups, requirements, "m", "", NULL, NULL, 0, NULL};

int main(int argc, char ** argv)
{
  chosen = argc > 1 ? argv[1] : "";
  const struct fm_evaluator_options evaluator = {
    .monitor = &monitor, .policy = FM_PERIODIC, .period = 1};
  struct fm_engine * engine = create_engine(&evaluator, NULL, -1);
  fm_engine_advance(engine, 1);
  int publisher = 0;
  void * publishers[] = {&publisher};
  struct fm_announcer * announcer = NULL;
  const bool is_started =
    fm_announcer_start(&announcer, engine, &middleware, publishers, 1, NULL, 0, NULL);
  fm_announcer_join(&announcer);
  fm_announcer_join(&announcer);  // does nothing
  const uint64_t unpublished = unpublished_of(engine);
  destroy_engine(engine);
  if (!is_started || announcer != NULL || published != 1 || unpublished != 0) {
    printf("published %d, not published %lu\n", published, (unsigned long)unpublished);
    return 1;
  }
  return 0;
}
