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

/// question.c: see question.h for the contract.

#include "question.h"

#include <stdlib.h>
#include <string.h>

#include "seen.h"

// A serialized rcl_interfaces/srv/GetParameters_Request with one name.
static bool fill_in(struct fm_call * call, const char * name)
{
  const uint32_t one = 1u;
  uint8_t * const bytes = malloc(sizeof(one) + FM_SEEN_OVERHEAD + strlen(name));
  if (bytes == NULL) {
    return false;
  }
  uint8_t * const count = fm_write_header(bytes);
  memcpy(count, &one, sizeof(one));
  const uint8_t * end = fm_write_string(count + sizeof(one), name, (uint32_t)strlen(name));
  const bool is_read =
    fm_message_read(&call->request, call->functions, bytes, (size_t)(end - bytes));
  free(bytes);
  return is_read;
}

bool fm_question_make(
  struct fm_question * question, const struct fm_service_functions * functions,
  const struct fm_service_client * client, uint32_t topic, const char * parameter)
{
  question->topic = topic;
  question->is_of_state = parameter == NULL;
  return fm_call_make(&question->call, functions, client) &&
         (parameter == NULL || fill_in(&question->call, parameter));
}

void fm_question_free(struct fm_question * question)
{
  fm_call_free(&question->call);
}

void fm_question_begin(struct fm_question * question, int64_t now)
{
  question->is_wanted = true;
  question->is_asked = false;
  question->n_answers = 0;
  question->next = now;
}

void fm_question_repeat(struct fm_question * question, int64_t now)
{
  if (question->is_asked) {
    question->next = now;
  }
}

void fm_question_end(struct fm_question * question)
{
  question->is_wanted = question->is_asked = false;
}

// ---- answers -----------------------------------------------------------------------------------

static bool read_state(const struct fm_typed_message * response, struct fm_seen * seen)
{
  const uint8_t * id = fm_message_field(response, "current_state", "id", FM_UINT8_FIELD);
  *seen = (struct fm_seen) {FM_SEEN_INT32, {.i = id == NULL ? 0 : *id}, NULL, 0};
  return id != NULL && *id >= 1u && *id <= 4u;
}

// A node answers with no value at all if it does not declare the parameter.
static bool read_parameter(const struct fm_typed_message * response, struct fm_seen * seen)
{
  const struct fm_typed_message value = fm_message_first(response, "values");
  const uint8_t * type = fm_message_field(&value, NULL, "type", FM_UINT8_FIELD);
  const bool * truth = fm_message_field(&value, NULL, "bool_value", FM_BOOLEAN_FIELD);
  const int64_t * whole = fm_message_field(&value, NULL, "integer_value", FM_INT64_FIELD);
  const double * number = fm_message_field(&value, NULL, "double_value", FM_DOUBLE_FIELD);
  *seen = (struct fm_seen) {FM_SEEN_NOTHING, {.i = 0}, NULL, 0};
  if (type == NULL || truth == NULL || whole == NULL || number == NULL) {
    return true;
  }
  seen->type = *type;
  if (*type == FM_SEEN_BOOL) {
    seen->value.i = *truth;
  } else if (*type == FM_SEEN_INT64) {
    seen->value.i = *whole;
  } else if (*type == FM_SEEN_FLOAT64) {
    seen->value.f = *number;
  } else if (*type == FM_SEEN_TEXT) {
    seen->text = fm_message_text(&value, NULL, "string_value");
    seen->length = (uint32_t)strlen(seen->text);
  }
  return true;
}

// While a node changes its state there is no answer: it is asked again.
static void take_answer(
  struct fm_question * question, struct fm_engine * engine, int64_t now, int64_t received)
{
  struct fm_seen seen;
  const bool is_value = question->is_of_state ? read_state(&question->call.response, &seen) :
    read_parameter(&question->call.response, &seen);
  question->is_asked = false;
  if (!is_value ||
    !fm_engine_observe(engine, question->topic, &seen, question->events, received))
  {
    question->next = now + FM_QUESTION_POLL_NS;
    return;
  }
  question->n_answers += question->n_answers < 2u;
  question->next =
    now + (question->n_answers < 2u ? FM_QUESTION_SECOND_NS : FM_QUESTION_AGAIN_NS);
}

static void ask(struct fm_question * question, int64_t now)
{
  if (question->is_asked) {
    fm_call_repeat(&question->call);
  } else {
    fm_call_begin(&question->call, now + FM_QUESTION_PATIENCE_NS);
  }
  question->is_asked = true;
  question->next = now + FM_QUESTION_SECOND_NS;
}

int64_t fm_question_look(
  struct fm_question * question, struct fm_engine * engine, int64_t now, int64_t received)
{
  if (!question->is_wanted) {
    return INT64_MAX;
  }
  if (now >= question->next) {
    ask(question, now);
  }
  if (!question->is_asked) {
    return question->next;
  }
  if (!question->call.is_sent) {
    question->events = fm_engine_observed(engine, question->topic).events;
  }
  const enum fm_call_state state = fm_call_look(&question->call, now);
  if (state == FM_CALL_ANSWERED) {
    take_answer(question, engine, now, received);
  } else if (state != FM_CALL_WAITS) {
    fm_engine_note_fault(engine, question->topic, FM_NO_ANSWER);
    question->is_asked = false;
    question->next =
      now + (state == FM_CALL_NO_ANSWER ? FM_QUESTION_POLL_NS : FM_QUESTION_SECOND_NS);
  }
  return question->is_asked ? now + FM_QUESTION_POLL_NS : question->next;
}
