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

// The functions that a program calls, as Copilot's C has them: copy the inputs, evaluate all
// requirements, call the handlers of those that are violated. To be included last, in the file
// with the tables of a bundle (fm_state, fm_inputs, fm_verdicts, fm_held, fm_requirements,
// fm_copy_inputs, fm_call_handler and the macros FM_...).
//
// Locals begin with fm_ too: an input, which is a global variable, can be called `now`.
//
// Not thread-safe and not reentrant: one thread calls these functions, and handlers do not.
// O(operations of all requirements); cannot fail.

static bool fm_has_begun;

static void fm_begin(void)
{
  FM_RESET(&fm_state);
  for (uint32_t fm_i = 0u; fm_i < FM_REQUIREMENTS; ++fm_i) {
    fm_held[fm_i] = true;
  }
  fm_has_begun = true;
}

static void fm_take_inputs(void)
{
  FRET_MONITOR_ENTER();
  fm_copy_inputs();
  FRET_MONITOR_LEAVE();
}

// The state is that of the next step by now: a handler may do everything but call step.
static void fm_call_handlers(void)
{
  for (uint32_t fm_i = 0u; fm_i < FM_REQUIREMENTS; ++fm_i) {
    const struct fm_requirement_table * const fm_table = &fm_requirements[fm_i];
    const bool fm_holds = fm_verdicts[fm_table->verdict];
    const bool fm_is_announced = !fm_holds && (fm_table->is_every_step || fm_held[fm_i]);
    fm_held[fm_i] = fm_holds;
    if (fm_is_announced) {
      fm_call_handler(fm_i);
    }
  }
}

#ifndef FM_STEP_AT

void FM_STEP(void)
{
  if (!fm_has_begun) {
    fm_begin();
  }
  fm_take_inputs();
  FM_EVALUATE(&fm_state, &fm_inputs, fm_verdicts);
  fm_call_handlers();
}

#else

static int64_t fm_start;  // the time of tick 0
static int64_t fm_clock;  // the time of the last call
static int64_t fm_taken;  // the time of the last evaluation
static int64_t fm_due;    // the time of the next one, if no input changes

static void fm_evaluate(int64_t fm_time)
{
  const int64_t fm_next = FM_EVALUATE(&fm_state, &fm_inputs, fm_verdicts, fm_time - fm_start);
  const bool fm_is_never = fm_next > FM_LAST_TICK || fm_start > INT64_MAX - fm_next;
  fm_due = fm_is_never ? FM_NEVER : fm_start + fm_next;
  fm_taken = fm_time;
  fm_call_handlers();
}

static void fm_restart(int64_t fm_now)
{
  fm_begin();
  fm_start = fm_now;
  fm_taken = fm_now;
  fm_due = FM_NEVER;
}

void FM_STEP_AT(int64_t fm_now)
{
  const bool fm_is_first = !fm_has_begun || fm_now < fm_clock ||
    (uint64_t)fm_now - (uint64_t)fm_start >= (uint64_t)FM_LAST_TICK;
  // Of two calls at one time, the later takes effect a nanosecond later.
  const bool fm_is_again = !fm_is_first && fm_now <= fm_taken;
  if (fm_is_again && fm_taken == INT64_MAX) {
    return;  // no later time exists
  }
  const int64_t fm_time = fm_is_again ? fm_taken + 1 : fm_now;
  if (fm_is_first) {
    fm_restart(fm_now);
  }
  fm_clock = fm_now;
  while (fm_due < fm_time) {
    fm_evaluate(fm_due);
  }
  fm_take_inputs();
  fm_evaluate(fm_time);
}

int64_t FM_DEADLINE(void)
{
  return fm_has_begun ? fm_due : INT64_MIN;
}

#endif
