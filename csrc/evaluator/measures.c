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

/// measures.c: see measures.h for the contract.

#include "measures.h"

#include <string.h>

#include "due.h"
#include "steps.h"

static int64_t * words_of(const struct fm_evaluator * evaluator, uint32_t i)
{
  return evaluator->instance.measures + evaluator->inputs[i].place;
}

// Under FM_TIMED: a group that reads an input is to be evaluated now.
static void call_readers(struct fm_evaluator * evaluator, uint32_t i, int64_t now)
{
  const struct fm_input_cell * input = &evaluator->inputs[i];
  for (uint32_t k = 0; evaluator->policy == FM_TIMED && k < input->n_readers; ++k) {
    if (evaluator->instance.groups[input->readers[k]].unset == 0) {
      fm_set_group_due(evaluator, input->readers[k], now);
    }
  }
}

static void set_number(struct fm_evaluator * evaluator, uint32_t i, double number, int64_t now)
{
  const struct fm_instance * instance = &evaluator->instance;
  const char * place = (const char *)instance->values + evaluator->monitor->inputs[i].offset;
  const union fm_value value = {.f = number};
  double before;
  memcpy(&before, place, sizeof before);
  if (!instance->inputs[i].has_value || before < number || before > number) {
    fm_instance_write(instance, i, value);
    fm_note_value(evaluator, i);
    call_readers(evaluator, i, now);
  }
}

// ---- rates -------------------------------------------------------------------------------------

static int64_t * message_of(int64_t * rate, uint32_t room, int64_t k)
{
  return &rate[FM_RATE_WORDS + (rate[FM_OLDEST] + k) % (int64_t)room];
}

// How many of the messages in the window came until a time. O(log(room)).
static int64_t count_until(int64_t * rate, uint32_t room, int64_t time)
{
  int64_t low = 0;
  int64_t high = rate[FM_N_MESSAGES];
  while (low < high) {
    const int64_t middle = low + (high - low) / 2;
    if (*message_of(rate, room, middle) <= time) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  return low;
}

static void drop_messages(int64_t * rate, uint32_t room, int64_t n)
{
  rate[FM_OLDEST] = (rate[FM_OLDEST] + n) % (int64_t)room;
  rate[FM_N_MESSAGES] -= n;
}

// Whether what reads a rate is violated since messages were left out.
static void set_lost(struct fm_evaluator * evaluator, uint32_t i, bool is_lost)
{
  const struct fm_input_cell * input = &evaluator->inputs[i];
  for (uint32_t k = 0; k < input->n_readers; ++k) {
    struct fm_instance_group * group = &evaluator->instance.groups[input->readers[k]];
    group->stale += is_lost ? 1u : UINT32_MAX;
    if (group->stale == 0) {
      fm_end_violation(evaluator, input->readers[k]);
    }
  }
}

static int64_t next_change(int64_t * rate, const struct fm_input_cell * input, int64_t now)
{
  const int64_t change = now < rate[FM_FULL_AT] ? rate[FM_FULL_AT] :
    rate[FM_N_MESSAGES] == 0 ? FM_NEVER :
    fm_later(*message_of(rate, input->room, 0), input->window);
  return change < rate[FM_LOST_UNTIL] ? change : rate[FM_LOST_UNTIL];
}

static void renew_rate(struct fm_evaluator * evaluator, uint32_t i, int64_t now)
{
  const struct fm_input_cell * input = &evaluator->inputs[i];
  int64_t * rate = words_of(evaluator, i);
  if (rate[FM_LAST] == FM_NEVER) {
    return;
  }
  drop_messages(
    rate, input->room, count_until(rate, input->room, fm_later(now, -input->window)));
  if (rate[FM_LOST_UNTIL] <= now) {
    rate[FM_LOST_UNTIL] = FM_NEVER;
    set_lost(evaluator, i, false);
    call_readers(evaluator, i, now);
  }
  if (now >= rate[FM_FULL_AT]) {
    set_number(
      evaluator, i, (double)rate[FM_N_MESSAGES] * 1e9 / (double)input->window, now);
  }
  if (evaluator->policy == FM_TIMED) {
    fm_replace_due(evaluator, &rate[FM_CHANGES_AT], next_change(rate, input, now));
  }
}

// Make room for a message.
static void leave_out(struct fm_evaluator * evaluator, uint32_t i)
{
  const struct fm_input_cell * input = &evaluator->inputs[i];
  int64_t * rate = words_of(evaluator, i);
  if (rate[FM_LOST_UNTIL] == FM_NEVER) {
    set_lost(evaluator, i, true);
  }
  rate[FM_LOST_UNTIL] = fm_later(*message_of(rate, input->room, 0), input->window);
  evaluator->counts.overflows += 1;
  drop_messages(rate, input->room, 1);
}

static void count_message(struct fm_evaluator * evaluator, uint32_t i, int64_t now)
{
  const struct fm_input_cell * input = &evaluator->inputs[i];
  int64_t * rate = words_of(evaluator, i);
  renew_rate(evaluator, i, now);
  if (rate[FM_N_MESSAGES] == (int64_t)input->room) {
    leave_out(evaluator, i);
  }
  if (rate[FM_LAST] == FM_NEVER) {
    rate[FM_FULL_AT] = fm_later(now, input->window);
  }
  rate[FM_LAST] = now;
  *message_of(rate, input->room, rate[FM_N_MESSAGES]) = now;
  rate[FM_N_MESSAGES] += 1;
  renew_rate(evaluator, i, now);
}

void fm_renew_rates(struct fm_evaluator * evaluator, int64_t now)
{
  for (uint32_t k = 0; k < evaluator->n_rates; ++k) {
    renew_rate(evaluator, evaluator->rates[k], now);
  }
}

int64_t fm_rates_due(const struct fm_evaluator * evaluator)
{
  int64_t due = FM_NEVER;
  for (uint32_t k = 0; k < evaluator->n_rates; ++k) {
    const int64_t * rate = words_of(evaluator, evaluator->rates[k]);
    due = rate[FM_CHANGES_AT] < due ? rate[FM_CHANGES_AT] : due;
  }
  return due;
}

// ---- all measures ------------------------------------------------------------------------------

static void measure_period(struct fm_evaluator * evaluator, uint32_t i, int64_t now)
{
  int64_t * last = &words_of(evaluator, i)[FM_LAST];
  if (*last != FM_NEVER) {
    set_number(evaluator, i, (double)fm_between(*last, now) / 1e9, now);
  }
  *last = now;
}

void fm_measure(struct fm_evaluator * evaluator, uint32_t i, int64_t now)
{
  const union fm_value time = {.i = now};
  if (!evaluator->instance.time->has_begun) {
    return;
  }
  switch (evaluator->inputs[i].source) {
    case FM_RATE:
      count_message(evaluator, i, now);
      break;
    case FM_PERIOD:
      measure_period(evaluator, i, now);
      break;
    case FM_TIME:
      fm_instance_write(&evaluator->instance, i, time);
      fm_note_value(evaluator, i);
      break;
    case FM_FIELD:
    case FM_RECEPTION:
    case FM_AGE:
    case FM_AGGREGATE:
      break;
  }
}

void fm_forget_messages(struct fm_evaluator * evaluator)
{
  for (uint32_t i = 0; i < evaluator->monitor->n_inputs; ++i) {
    if (evaluator->inputs[i].source == FM_RATE &&
      words_of(evaluator, i)[FM_LOST_UNTIL] != FM_NEVER)
    {
      set_lost(evaluator, i, false);
    }
    fm_begin_measure(evaluator, i);
  }
  fm_forget_deadline(evaluator);
}

static void shift_word(int64_t * word, int64_t by)
{
  *word = *word == FM_NEVER ? FM_NEVER : fm_later(*word, by);
}

void fm_shift_measures(struct fm_evaluator * evaluator, int64_t by)
{
  for (uint32_t i = 0; i < evaluator->monitor->n_inputs; ++i) {
    const enum fm_source source = evaluator->inputs[i].source;
    int64_t * words = words_of(evaluator, i);
    if (source == FM_PERIOD) {
      shift_word(&words[FM_LAST], by);
    }
    for (int64_t k = 0; source == FM_RATE && k < FM_OLDEST + words[FM_N_MESSAGES]; ++k) {
      const uint32_t room = evaluator->inputs[i].room;
      shift_word(k < FM_OLDEST ? &words[k] : message_of(words, room, k - FM_OLDEST), by);
    }
  }
}
