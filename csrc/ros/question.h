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

/// question.h: asks a node for its state, or for a parameter, and gives the engine the answer.
///
/// If a message about the state or the parameter came while an answer was on its way, the answer
/// may be outdated: it is dropped, and the question is asked again. The question is asked when the
/// node appears, again a second later, since messages sent until the subscription matched are
/// missed, and then every FM_QUESTION_AGAIN_NS. Without an answer it is asked again each second,
/// and when the graph changes: the server of a node that was killed stays in the graph for a
/// while, and that of the next one may not be discovered yet.
/// Nothing waits. One thread at a time.

#ifndef QUESTION_H_
#define QUESTION_H_

#include "engine.h"
#include "service_call.h"

#define FM_QUESTION_POLL_NS 20000000     // between two looks for an answer
#define FM_QUESTION_PATIENCE_NS 5000000000
#define FM_QUESTION_SECOND_NS 1000000000
#define FM_QUESTION_AGAIN_NS 10000000000

/// Zeroed before fm_question_make; fm_question_free frees what it holds.
struct fm_question
{
  struct fm_call call;
  uint32_t topic;         // of the engine
  bool is_of_state;       // not of a parameter
  bool is_wanted;         // the node is there
  bool is_asked;
  uint32_t n_answers;     // since the node has come
  uint64_t events;        // of the topic, when it was asked
  int64_t next;           // when it is asked; when again, while it is
};

/// Make a question: lifecycle_msgs/srv/GetState, or with a parameter's name
/// rcl_interfaces/srv/GetParameters. The arguments outlive it. False if memory is short, or the
/// middleware refuses. O(size).
FM_INTERNAL bool fm_question_make(
  struct fm_question * question, const struct fm_service_functions * functions,
  const struct fm_service_client * client, uint32_t topic, const char * parameter);
FM_INTERNAL void fm_question_free(struct fm_question * question);

/// The node has come, or another with its name has. O(1).
FM_INTERNAL void fm_question_begin(struct fm_question * question, int64_t now);

/// Something else in the graph has changed: without an answer it is asked again. O(1).
FM_INTERNAL void fm_question_repeat(struct fm_question * question, int64_t now);

/// The node has gone. O(1).
FM_INTERNAL void fm_question_end(struct fm_question * question);

/// Ask if it is time, and look for the answer. Returns when to call it next (CLOCK_MONOTONIC);
/// INT64_MAX: not before fm_question_begin. As fm_call_look and fm_engine_observe.
FM_INTERNAL int64_t fm_question_look(
  struct fm_question * question, struct fm_engine * engine, int64_t now, int64_t received);

#endif  // QUESTION_H_
