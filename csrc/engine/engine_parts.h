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

/// engine_parts.h: the struct of an engine, and the functions that its files share. For
/// engine_*.c, and those that read the struct: records.c and thinning.c. A file calls only those
/// before it: clock < findings < message < scopes < due < backlog < delivery < graph <
/// transforms < gate < engine.
///
/// One mutex guards the whole struct. Functions whose names end in _locked need it held.

#ifndef ENGINE_PARTS_H_
#define ENGINE_PARTS_H_

#include <pthread.h>

#include "engine_locked.h"
#include "reorder.h"
#include "states.h"
#include "transforms.h"

#define FM_CLOSE_NS 10000  // two readings of clocks without a preemption in between
#define FM_SET_NS 1000000  // a change of the system time by more is no error of a measurement
#define FM_HANG_NS 500000000

// Tests sleep between two steps of the handling of time.
#ifndef FM_PAUSE
#define FM_PAUSE()
#endif

/// The source of the time.
enum fm_source_of_time
{
  FM_TOLD,    // by fm_engine_advance, and with each message
  FM_STEADY,  // CLOCK_MONOTONIC; CLOCK_REALTIME if the stamps of headers count
  FM_CLOCK    // `now`
};

/// When a clock that is followed has moved, and to where.
struct fm_clock_mark
{
  int64_t system;
  int64_t clock;
};

#define FM_MOST_MARKS 4096u  // 4 s of a clock of 1 kHz

struct fm_engine_topic
{
  struct fm_arrivals arrivals;
  uint8_t * evidence;
  size_t evidence_size;
  struct fm_order_counts counts;
  int64_t behind;               // ns; see snapshot.h
  struct fm_observed observed;
  uint64_t links;               // messages with links between frames, which are no steps
  bool has_sources;             // an input that is not a field
  bool is_source;               // of derived topics
  uint8_t keeping;              // enum fm_keeping
};

// A transform that is made of the tree: the message that came last, and room for the next.
struct fm_engine_transform
{
  struct fm_transform_topic options;
  struct fm_field * fields;     // of the message
  uint8_t * message;
  uint8_t * next;
  size_t size;
  size_t pose_at;
};

struct fm_engine
{
  pthread_mutex_t mutex;
  pthread_cond_t violation_queued;
  pthread_cond_t detail_queued;
  struct fm_engine_options options;
  struct fm_field * fields;     // of the message being read
  struct fm_field * prepared;   // of the message being read, with receptions and ages
  struct fm_violation * found;  // violations of the steps of one message
  struct fm_engine_topic * topics;
  uint32_t * numbers;           // a kind: that of its first requirement; last, n_requirements
  uint32_t n_kinds;
  uint32_t n_requirements;      // of all scopes
  const struct fm_delivery * delivery;  // whose parts are being taken by instances
  int64_t later;                // ns from the evaluator's time of a violation to its stamp, while
                                // a message takes effect; FM_NEVER: as with a deadline
  struct fm_reorder waiting;    // under FM_TIMED: messages of later stamps
  struct fm_outbox outbox;
  struct fm_blackbox * blackbox;  // NULL: no message is kept
  struct fm_outbox instances;     // violations of instances that begin or end, for actions
  bool follows_instances;         // they are kept
  bool * are_violated;            // requirements whose last violation has not ended
  uint64_t * n_violated;          // a requirement of instances: how many violate it
  uint64_t n_restarts;            // of the evaluator's time, when `are_violated` was last cleared
  struct fm_states states;
  pthread_cond_t state_changed;
  uint64_t noted_changes;         // of the states, when those who follow them were last woken
  uint64_t taken_changes;         // the same, when fm_engine_take last returned
  bool has_states;                // they are kept up to date
  int (* now)(void * clock, int64_t * nanoseconds);
  void * clock;
  enum fm_source_of_time source;
  struct fm_tree * tree;          // of coordinate frames; NULL: no input is a transform
  struct fm_engine_transform * transforms;
  uint32_t n_transforms;
  uint32_t tf;                    // the topics with the links
  uint32_t tf_static;
  uint64_t tree_restarts;         // of the evaluator's time, when the tree was last emptied
  struct fm_derived_topic * derived;
  uint32_t n_derived;
  uint8_t * made;                 // a message of what was seen
  size_t made_room;
  struct fm_field * made_fields;  // its fields
  struct fm_gate * gate;          // NULL: none
  uint32_t gated;                 // its topic; n_topics: one that feeds no input
  void (* on_due)(void * argument);  // NULL: nobody waits for replacements
  void * on_due_argument;
  int64_t system_ahead;  // of the steady clock, ns
  int64_t ahead_noted;   // the same when it was last looked whether the system time was set back
  int64_t ahead_before;  // the same before the system time was set last
  int64_t ahead_read;    // by CLOCK_MONOTONIC: when `system_ahead` was found to hold
  int64_t set_after;     // by CLOCK_MONOTONIC: the system time was set then, or later
  int64_t wakes_at;      // a thread in fm_engine_take waits until then; INT64_MIN: none does
  int64_t clock_served;  // by CLOCK_MONOTONIC: the thread that moves the clock was alive
  int64_t released;      // waiting messages were released until then
  bool is_outdated;      // the clock, until fm_engine_wake
  bool has_begun;        // the time
  bool is_new_source;    // its time was not read yet
  bool is_closed;
  pthread_mutex_t catching;     // guards the turns of those who catch up; see engine_backlog.c
  pthread_cond_t turn_ended;
  uint64_t turns;               // that were asked for
  uint64_t turn;                // that has begun; others wait for theirs
  struct fm_queue * queues;     // changed in a turn, with `mutex` locked
  uint32_t is_catching_up;      // atomic: callbacks take nothing
  uint32_t has_left;            // atomic: callbacks have left messages
  int64_t received_by;          // by system time: what the round of a catch up delivers
  int64_t ahead_of_round;       // as `system_ahead`: by which `received_by` is meant
  int64_t caught_up;            // by CLOCK_MONOTONIC: the last one ended
  int64_t began;                // by CLOCK_MONOTONIC: a callback that takes now; 0: none
  int64_t began_use;            // by the clock of its thread's processor time, if that is measured
  int64_t busy;                 // ns in callbacks since `busy_since`
  int64_t use;                  // of these, processor time
  int64_t busy_since;
  int64_t catching_use;         // processor time in catch ups since `catching_since`
  int64_t catching_since;
  struct fm_clock_mark marks[FM_MOST_MARKS];  // the last, as a ring
  uint64_t n_marks;
  bool in_round;                // of a catch up
  int64_t round;                // its time
  bool has_round;               // there is one
  bool has_announcer;           // a thread calls fm_engine_take
  bool is_overloaded;           // callbacks leave all messages
  bool measures_use;            // of callbacks, until the next look whether they are too busy
};

// ---- engine_clock.c ----------------------------------------------------------------------------

/// Whether the stamps of headers count: the source then follows the system time.
bool fm_engine_uses_headers(const struct fm_engine * engine);

/// Read the time of the source; `told`: the time if it is told. Returns false if there is none.
/// With stamps of headers, messages take effect, and deadlines come, `reorder` later.
bool fm_engine_read_source_locked(struct fm_engine * engine, int64_t told, int64_t * now);

/// What the clock that is followed said at a system time; until when stamps take effect then.
int64_t fm_engine_clock_at_locked(const struct fm_engine * engine, int64_t received);
int64_t fm_engine_stamps_at_locked(const struct fm_engine * engine, int64_t received);

/// As fm_engine_hangs.
bool fm_engine_hangs_locked(const struct fm_engine * engine, int64_t nanoseconds);

/// Until when messages were received that belong to the round: system time.
int64_t fm_engine_round_received_by_locked(struct fm_engine * engine);

/// The evaluator's time; with instances, also while the bundle's scope is ahead of it.
int64_t fm_engine_time_locked(const struct fm_engine * engine);

/// When a message was received, by the source's time: between the evaluator's and `now`.
int64_t fm_engine_instant_locked(struct fm_engine * engine, int64_t received, int64_t now);

/// Note how long a message that is evaluated now has waited since a system time.
void fm_engine_note_behind_locked(
  struct fm_engine * engine, struct fm_engine_topic * topic, int64_t received);

/// How much the system time is ahead of the steady clock.
int64_t fm_engine_system_ahead_locked(struct fm_engine * engine);

/// How much later stamps are than the evaluator's times.
int64_t fm_engine_stamps_ahead_locked(struct fm_engine * engine);

// ---- engine_findings.c -------------------------------------------------------------------------

/// A violation of a requirement begins, after one that has ended; of instances, one begins it.
void fm_engine_begin_violation_locked(struct fm_engine * engine, uint32_t requirement);

/// Keep what locks and the gate depend on, if it has changed. O(requirements + inputs).
void fm_engine_note_conditions_locked(struct fm_engine * engine);

/// Queue violations of a scope, with stamps in place of times of the evaluator.
void fm_engine_queue_of_locked(
  struct fm_engine * engine, const struct fm_violation * found, uint32_t n,
  const struct fm_outbox_scope * scope);

/// Queue the violations of engine->found; `later` is added to their stamps.
void fm_engine_queue_locked(struct fm_engine * engine, uint32_t n, int64_t later);

/// For an evaluator that has started afresh: no violation goes on.
void fm_engine_forget_violations_locked(struct fm_engine * engine);

/// Keep that a violation of an instance begins or ends, if that is followed; that those of all
/// instances are over.
void fm_engine_note_instance_locked(
  struct fm_engine * engine, uint32_t requirement, bool begins,
  const struct fm_outbox_scope * scope);
void fm_engine_end_instances_locked(struct fm_engine * engine);

/// Wake those who follow the states of the requirements, if one has changed.
void fm_engine_update_states_locked(struct fm_engine * engine);

/// Do both, and note the step with the gate.
void fm_engine_announce_locked(struct fm_engine * engine, uint32_t n, int64_t later);

/// Note a step and its `n` findings with the gate, if there is one: a replacement may be due.
/// Returns how many of the findings are left: fm_gate_note.
uint32_t fm_engine_note_gate_locked(struct fm_engine * engine, uint32_t n);

/// Close the gate while a thread hangs without which the values of its inputs grow old.
void fm_engine_look_for_hang_locked(struct fm_engine * engine);

// ---- engine_message.c --------------------------------------------------------------------------

/// Whether the messages of a topic have links between frames.
bool fm_engine_has_links(const struct fm_engine * engine, uint32_t topic);

/// Whether messages of other topics are made of those of a topic.
bool fm_engine_is_source(const struct fm_engine * engine, uint32_t topic);

/// Keep a message as evidence that a field of its topic cannot be used, if none is kept.
void fm_engine_keep_evidence_locked(
  struct fm_engine * engine, uint32_t topic, const uint8_t * message, size_t size);

/// The fields of inputs, with those that are no fields, of a message that was received at a ROS
/// time; they are valid until the next call.
const struct fm_field * fm_engine_prepare_inputs_locked(
  struct fm_engine * engine, const struct fm_topic * fed, const uint8_t * sources,
  const struct fm_field * fields, int64_t received);

/// Store the fields of a message in the inputs of the evaluator.
void fm_engine_store_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_field * fields, int64_t now);

/// The fields of a message that was received at a ROS time, with the inputs that are no fields;
/// they are valid until the next message.
const struct fm_field * fm_engine_prepare_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_field * fields, int64_t received);

/// Keep a message for the black box, and as evidence if a field cannot be used. A stamp of 0:
/// there is no time.
void fm_engine_keep_message_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_reading * reading, int64_t stamp,
  const struct fm_origin * origin);

// ---- engine_scopes.c ---------------------------------------------------------------------------

/// Number the requirements of all scopes, and take what the instances report. Returns false if
/// memory is short, or the scopes do not fit the topics.
bool fm_engine_number_scopes(struct fm_engine * engine);

/// With instances: let a message take effect `now`; `later` is added to the stamps of its
/// violations. Returns when it takes effect in the bundle's scope.
int64_t fm_engine_step_scopes_locked(
  struct fm_engine * engine, const struct fm_delivery * delivery, int64_t now, int64_t later);

/// With instances: take what is due by `now`, or before it if the clock `stands` at `now`.
void fm_engine_advance_scopes_locked(struct fm_engine * engine, int64_t now, bool stands);

/// As fm_evaluator_wake, fm_evaluator_deadline, fm_evaluator_shift and fm_evaluator_reset, of all
/// scopes.
int64_t fm_engine_wakes_at_locked(const struct fm_engine * engine);
int64_t fm_engine_next_due_locked(struct fm_engine * engine);
void fm_engine_shift_locked(struct fm_engine * engine, int64_t by);
void fm_engine_reset_locked(struct fm_engine * engine);

// ---- engine_due.c ------------------------------------------------------------------------------

/// Read the time of the source for a message that was received at a system time. Returns false if
/// there is none. With stamps of headers, it is the time until which messages take effect.
bool fm_engine_read_for_message_locked(
  struct fm_engine * engine, int64_t received, int64_t * now);

/// The same at any time, also within a round.
bool fm_engine_read_now_locked(struct fm_engine * engine, int64_t received, int64_t * now);

/// Take what is due before a message that takes effect `now`.
void fm_engine_take_due_before_locked(struct fm_engine * engine, int64_t now);

/// Take what a message at an instant has made due a nanosecond later, such as the end of its
/// reception, if that has passed by the steady clock. Otherwise each message would wake the thread
/// that waits. Not within a round: a message of that nanosecond may wait in another queue.
void fm_engine_take_due_after_locked(struct fm_engine * engine, int64_t instant, int64_t now);

/// Let the waiting messages take effect whose time has come, and take what is due by `now`.
void fm_engine_take_due_by_locked(struct fm_engine * engine, int64_t now);

/// The next instant at which something happens though no message comes; INT64_MIN before the time
/// has begun.
int64_t fm_engine_deadline_locked(struct fm_engine * engine);

/// Take what is due by the clock that is followed, unless a catch up is to do so.
void fm_engine_take_due_now_locked(struct fm_engine * engine);

/// Start afresh if the time has gone back since waiting messages were released.
void fm_engine_note_restart_locked(struct fm_engine * engine, int64_t now);

/// Let a message take effect at an instant, after what is due before it.
int64_t fm_engine_put_locked(
  struct fm_engine * engine, const struct fm_delivery * delivery, int64_t instant);

/// Let the first message that waits take effect at its stamp, or the evaluator's time if that is
/// later, but not after `now`.
void fm_engine_put_waiting_locked(struct fm_engine * engine, int64_t now);

/// Let the waiting messages take effect whose time has come, in the order of their stamps.
void fm_engine_release_locked(struct fm_engine * engine, int64_t now);

/// Let all messages take effect that wait for those of earlier stamps.
void fm_engine_release_all_locked(struct fm_engine * engine);

/// Remember that the clock that is followed has moved.
bool fm_engine_mark_clock_locked(struct fm_engine * engine);

/// End a wait in fm_engine_take if something is due before its end.
void fm_engine_end_wait_if_earlier_locked(struct fm_engine * engine);

// ---- engine_backlog.c --------------------------------------------------------------------------

/// As fm_engine_catch_up, unless another thread does so: whoever only asks does not wait for it.
void fm_engine_catch_up_if_free(struct fm_engine * engine);

/// As fm_engine_catch_up, if something is due or was left, or that was long ago. The lock is
/// released meanwhile. Returns whether messages are left.
bool fm_engine_catch_up_if_due_locked(struct fm_engine * engine);

// ---- engine_delivery.c -------------------------------------------------------------------------

/// Count a message that was received. Returns whether it counts: not if it is repeated, or cannot
/// be decoded, or the engine is closed; `receipt` is that of fm_engine_message.
bool fm_engine_accept_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_reading * reading,
  const struct fm_origin * origin, uint32_t * receipt);

/// Let a message take effect that was accepted.
void fm_engine_deliver_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_reading * reading,
  const struct fm_origin * origin);

// ---- engine_graph.c ----------------------------------------------------------------------------

void fm_engine_free_derived(struct fm_engine * engine);

/// Make the messages of the topics that are derived from a topic. Returns false, and counts the
/// message, if it cannot be decoded.
bool fm_engine_take_derived_locked(
  struct fm_engine * engine, uint32_t topic, const struct fm_reading * reading,
  const struct fm_origin * origin);

// ---- engine_transforms.c -----------------------------------------------------------------------

void fm_engine_free_transforms(struct fm_engine * engine);

/// As fm_engine_message. `topic` must be in range.
uint32_t fm_engine_message_locked(
  struct fm_engine * engine, uint32_t topic, const uint8_t * message, size_t size,
  const struct fm_origin * origin);

// ---- records.c ---------------------------------------------------------------------------------

/// Take what is due before `now`, at most at `left` instants, one after another, until there are
/// `most` violations. Returns whether all was taken. Nothing is due before the time has begun.
bool fm_engine_take_all_due_locked(
  struct fm_engine * engine, int64_t now, uint32_t most, uint64_t * left);

#endif  // ENGINE_PARTS_H_
