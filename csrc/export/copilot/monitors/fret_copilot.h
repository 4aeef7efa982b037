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
// Not thread-safe and not reentrant: one thread calls these functions, and handlers do not.
// O(operations of all requirements); cannot fail.

static bool fm_has_begun;

static void fm_begin(void)
{
  FM_RESET(&fm_state);
  for (uint32_t i = 0u; i < FM_REQUIREMENTS; ++i) {
    fm_held[i] = true;
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
  for (uint32_t i = 0u; i < FM_REQUIREMENTS; ++i) {
    const struct fm_requirement_table * const table = &fm_requirements[i];
    const bool holds = fm_verdicts[table->verdict];
    const bool is_announced = !holds && (table->is_every_step || fm_held[i]);
    fm_held[i] = holds;
    if (is_announced) {
      fm_call_handler(i);
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

static void fm_evaluate(int64_t time)
{
  const int64_t next = FM_EVALUATE(&fm_state, &fm_inputs, fm_verdicts, time - fm_start);
  const bool is_never = next > FM_LAST_TICK || fm_start > INT64_MAX - next;
  fm_due = is_never ? FM_NEVER : fm_start + next;
  fm_taken = time;
  fm_call_handlers();
}

static void fm_restart(int64_t now)
{
  fm_begin();
  fm_start = now;
  fm_taken = now;
  fm_due = FM_NEVER;
}

void FM_STEP_AT(int64_t now)
{
  const bool is_first = !fm_has_begun || now < fm_clock ||
    (uint64_t)now - (uint64_t)fm_start >= (uint64_t)FM_LAST_TICK;
  // Of two calls at one time, the later takes effect a nanosecond later.
  const bool is_again = !is_first && now <= fm_taken;
  if (is_again && fm_taken == INT64_MAX) {
    return;  // no later time exists
  }
  const int64_t time = is_again ? fm_taken + 1 : now;
  if (is_first) {
    fm_restart(now);
  }
  fm_clock = now;
  while (fm_due < time) {
    fm_evaluate(fm_due);
  }
  fm_take_inputs();
  fm_evaluate(time);
}

int64_t FM_DEADLINE(void)
{
  return fm_has_begun ? fm_due : INT64_MIN;
}

#endif
