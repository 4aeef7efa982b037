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


/// action_call.c: see action_call.h for the contract.

#include "action_call.h"

#include <string.h>

#include "words.h"

#define POLL_NS 10000000  // between two looks for a server or a response
#define MOST_STEPS 3u     // transitions from any state to any other

bool fm_action_call_make(
  struct fm_action_call * call, const struct fm_service_functions * functions,
  const struct fm_action * action, const struct fm_action_ends * ends)
{
  call->action = action;
  if (!fm_call_make(&call->calls[0], functions, &ends->services[0])) {
    return false;
  }
  return action->kind == FM_ACTION_TRANSITION ?
         fm_call_make(&call->calls[1], functions, &ends->services[1]) :
         action->n_parts > 0 || fm_action_call_read(call, action->payload, action->payload_size);
}

bool fm_action_call_read(
  struct fm_action_call * call, const uint8_t * payload, size_t size)
{
  return fm_message_read(&call->calls[0].request, call->calls[0].functions, payload, size);
}

void fm_action_call_free(struct fm_action_call * call)
{
  fm_call_free(&call->calls[0]);
  fm_call_free(&call->calls[1]);
}

static void begin_try(struct fm_action_call * call, int64_t now)
{
  call->steps = 0;
  call->began = now;
  call->is_changing = call->is_pausing = false;
  fm_call_begin(&call->calls[0], now + call->action->timeout);
}

void fm_action_call_begin(struct fm_action_call * call, int64_t now)
{
  call->tried = 0;
  call->is_under_way = true;
  begin_try(call, now);
}

// ---- responses ---------------------------------------------------------------------------------

static bool has_success(const struct fm_call * call)
{
  const bool * success = fm_message_field(&call->response, NULL, "success", FM_BOOLEAN_FIELD);
  return success == NULL || *success;
}

// The transition from a state towards another (lifecycle_msgs/msg/Transition); 0: there is none.
static uint8_t transition_from(const char * state, const char * wanted)
{
  enum {CONFIGURE = 1, CLEANUP, ACTIVATE, DEACTIVATE};
  static const struct
  {
    const char * wanted;
    const char * state;
    uint8_t transition;
  } ways[] = {
    {"unconfigured", "inactive", CLEANUP}, {"unconfigured", "active", DEACTIVATE},
    {"inactive", "unconfigured", CONFIGURE}, {"inactive", "active", DEACTIVATE},
    {"active", "unconfigured", CONFIGURE}, {"active", "inactive", ACTIVATE},
    {"finalized", "unconfigured", 5}, {"finalized", "inactive", 6}, {"finalized", "active", 7}};
  for (size_t k = 0; k < sizeof(ways) / sizeof(ways[0]); ++k) {
    if (strcmp(ways[k].wanted, wanted) == 0 && strcmp(ways[k].state, state) == 0) {
      return ways[k].transition;
    }
  }
  return 0;
}

static enum fm_action_result change_state(
  struct fm_action_call * call, int64_t now, struct fm_text * why)
{
  const char * state = fm_message_text(&call->calls[0].response, "current_state", "label");
  if (strcmp(state, call->action->state) == 0) {
    return FM_ACTION_SUCCEEDED;
  }
  uint8_t * id =
    fm_message_field(&call->calls[1].request, "transition", "id", FM_UINT8_FIELD);
  const uint8_t transition = transition_from(state, call->action->state);
  if (transition == 0 || id == NULL || call->steps == MOST_STEPS) {
    if (transition == 0) {
      fm_text_add(why, FM_WORDS_NO_WAY, call->action->target, state, call->action->state);
    } else {
      fm_text_add(why, FM_WORDS_STILL_IN, call->action->target, state);
    }
    return FM_ACTION_FAILED;
  }
  *id = transition;
  call->steps += 1;
  call->is_changing = true;
  fm_call_begin(&call->calls[1], now + call->action->timeout);
  return FM_ACTION_GOES_ON;
}

static enum fm_action_result take_answer(
  struct fm_action_call * call, int64_t now, struct fm_text * why)
{
  const struct fm_call * answered = &call->calls[call->is_changing ? 1 : 0];
  if (call->action->kind == FM_ACTION_TRANSITION && !call->is_changing) {
    return change_state(call, now, why);
  }
  if (!has_success(answered)) {
    if (call->is_changing) {
      fm_text_add(why, FM_WORDS_REFUSED, call->action->target,
        fm_message_text(&call->calls[0].response, "current_state", "label"));
    } else {
      const char * message = fm_message_text(&answered->response, NULL, "message");
      fm_text_add(why, FM_WORDS_NO_SUCCESS, answered->service->name,
        message[0] == '\0' ? "" : ": ", message);
    }
    return FM_ACTION_FAILED;
  }
  if (!call->is_changing) {
    return FM_ACTION_SUCCEEDED;
  }
  call->is_changing = false;
  fm_call_begin(&call->calls[0], now + call->action->timeout);
  return FM_ACTION_GOES_ON;
}

// ---- tries -------------------------------------------------------------------------------------

static enum fm_action_result run_try(
  struct fm_action_call * call, int64_t now, struct fm_text * why)
{
  struct fm_call * one = &call->calls[call->is_changing ? 1 : 0];
  const double timeout = (double)call->action->timeout / 1e9;
  switch (fm_call_look(one, now)) {
    case FM_CALL_WAITS:
      return FM_ACTION_GOES_ON;
    case FM_CALL_ANSWERED:
      return take_answer(call, now, why);
    case FM_CALL_NO_SERVER:
      fm_text_add(why, FM_WORDS_NO_SERVER, one->service->name, timeout);
      return FM_ACTION_FAILED;
    case FM_CALL_REFUSED:
      fm_text_add(why, FM_WORDS_NOT_SENT, one->service->name);
      return FM_ACTION_FAILED;
    case FM_CALL_NO_ANSWER:
    default:
      fm_text_add(why, FM_WORDS_NO_ANSWER, one->service->name, timeout);
      return FM_ACTION_FAILED;
  }
}

enum fm_action_result fm_action_call_run(
  struct fm_action_call * call, int64_t now, struct fm_text * why)
{
  if (!call->is_under_way || (call->is_pausing && now < call->began + call->action->timeout)) {
    return FM_ACTION_GOES_ON;
  }
  if (call->is_pausing) {
    begin_try(call, now);
  }
  enum fm_action_result result = run_try(call, now, why);
  if (result == FM_ACTION_FAILED && call->tried < call->action->retries) {
    fm_text_clear(why);
    call->tried += 1;
    call->is_pausing = true;
    result = FM_ACTION_GOES_ON;
  }
  call->is_under_way = result == FM_ACTION_GOES_ON;
  return result;
}

int64_t fm_action_call_due(const struct fm_action_call * call, int64_t now)
{
  if (!call->is_under_way) {
    return FM_NEVER;
  }
  return call->is_pausing ? call->began + call->action->timeout : now + POLL_NS;
}
