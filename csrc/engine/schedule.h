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


/// schedule.h: when the actions of a bundle start, publish, and may not start.
///
/// Without threads and clocks: one thread at a time calls it with the states of the requirements
/// and the time (CLOCK_MONOTONIC). Times are in nanoseconds, 0 if the bundle gives none.

#ifndef SCHEDULE_H_
#define SCHEDULE_H_

#include "states.h"

/// What an action does. A lock is none of these (announcer.h).
enum fm_action_kind
{
  FM_ACTION_PUBLISH = 0,
  FM_ACTION_CALL = 1,
  FM_ACTION_TRANSITION = 2
};

enum fm_part_kind
{
  FM_PART_BYTES = 0,
  FM_PART_LENGTH = 1,  // of a text: four bytes
  FM_PART_KEY = 2,
  FM_PART_NUMBER = 3   // a key as a whole number
};

/// A part of a message or request that contains the key of an instance. What follows a key lies
/// where the length of the key wants it.
struct fm_payload_part
{
  uint32_t kind;    // enum fm_part_kind
  uint32_t align;   // of bytes and numbers: the header of four bytes does not count
  uint32_t at;      // of bytes: where they are in the payload
  uint32_t size;    // of bytes, numbers; of a length: of what is no key, with the zero at its end
  uint32_t which;   // of a key or a number: 0: the key, of a pair the first one; 1: the second one
  uint32_t n_keys;  // of a length: the keys in the text, of pairs the first ones
  uint32_t n_second;  // of a length of pairs: the second ones in the text
};

/// An action. Texts are UTF-8, as written in the bundle. One with parts is an action of each
/// instance, with times of its own.
struct fm_action
{
  uint8_t kind;             // enum fm_action_kind
  const char * name;
  const char * target;      // topic, service, or node
  const char * state;       // that a transition leads to; ""
  const uint8_t * payload;  // serialized message or request, with its header of four bytes
  size_t payload_size;
  int64_t stamp_at;         // offset of a stamp in it to be filled in; -1: none
  int64_t period;           // between two messages; 0: one message
  int64_t duration;         // of publishing at a period; 0: until the violation is over
  int64_t timeout;          // of each try of a call
  int64_t after;            // how long the violation lasts before the action starts
  int64_t cooldown;         // least time between two starts
  uint32_t retries;         // after the first try
  const struct fm_payload_part * parts;  // of a message with keys; the payload has their bytes
  uint32_t n_parts;         // 0: the message is the payload
  bool is_of_pairs;         // with parts: it follows requirements of pairs
};

/// The actions that follow a requirement, as indices.
struct fm_follows
{
  const uint32_t * on_violation;
  uint32_t n_on_violation;
  const uint32_t * on_end;
  uint32_t n_on_end;
};

/// What became of an action.
struct fm_action_facts
{
  uint64_t started;
  uint64_t sent;     // messages, or calls that succeeded
  uint64_t failed;
  uint64_t skipped;
};

struct fm_schedule;

/// What schedules are made of. `counts`, one for each action, go on from what they are.
struct fm_schedule_options
{
  const struct fm_action * actions;
  const struct fm_follows * follows;
  struct fm_action_facts * counts;
  uint32_t n_actions;
  uint32_t n_requirements;
};

/// Make a schedule, of the bundle or `of_instance`: of the actions without keys, or of those with
/// them. The options outlive it. NULL if memory is short. O(actions + what follows all
/// requirements).
FM_INTERNAL struct fm_schedule * fm_schedule_create(
  const struct fm_schedule_options * options, bool of_instance);

/// Free it. NULL is allowed. O(1).
FM_INTERNAL void fm_schedule_destroy(struct fm_schedule * schedule);

/// Schedule what follows violations that have begun or ended since the last call, and start what
/// is due. O(what follows all requirements).
FM_INTERNAL void fm_schedule_follow(
  struct fm_schedule * schedule, const struct fm_requirement_state * states, int64_t now);

/// Schedule what follows a violation of an instance that begins or ends now, and start what is due
/// of it. O(what follows the requirement).
FM_INTERNAL void fm_schedule_note(
  struct fm_schedule * schedule, uint32_t requirement, bool begins, int64_t now);

/// The same of all violations that have not ended: they end. O(what follows all requirements).
FM_INTERNAL void fm_schedule_end_all(struct fm_schedule * schedule, int64_t now);

/// Start what is due. O(what follows all requirements).
FM_INTERNAL void fm_schedule_start_due(struct fm_schedule * schedule, int64_t now);

/// Whether a schedule of an instance can be forgotten: nothing is under way, to come, or to follow
/// the end of a violation, and no cooldown lasts. O(what follows all requirements).
FM_INTERNAL bool fm_schedule_is_idle(const struct fm_schedule * schedule, int64_t now);

/// Whether an action is to publish a message now. To be called once for each. O(what follows all
/// requirements).
FM_INTERNAL bool fm_schedule_publishes(
  struct fm_schedule * schedule, uint32_t action, int64_t now);

/// Whether the call of an action is to begin now; `wants`: it is at the next call of `begins`.
/// Until fm_schedule_end_call it is under way, and further starts are skipped. O(1).
FM_INTERNAL bool fm_schedule_begins_call(struct fm_schedule * schedule, uint32_t action);
FM_INTERNAL bool fm_schedule_wants_call(const struct fm_schedule * schedule, uint32_t action);
FM_INTERNAL void fm_schedule_end_call(struct fm_schedule * schedule, uint32_t action);

/// When the next action starts or publishes; FM_NEVER: none does. O(what follows all
/// requirements).
FM_INTERNAL int64_t fm_schedule_due(const struct fm_schedule * schedule);

/// The same, or when a cooldown is over that lasts now.
FM_INTERNAL int64_t fm_schedule_wake(const struct fm_schedule * schedule, int64_t now);

#endif  // SCHEDULE_H_
