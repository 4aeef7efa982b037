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

/// engine.h: an evaluator that several threads share, that reads serialized messages, and that
/// knows the time.
///
/// The thread that takes a message from the middleware passes its bytes to fm_engine_message,
/// which reads the fields, stores the inputs and steps, under one mutex. Violations and their
/// details are queued for other threads, so that a thread that delivers messages never publishes
/// and never waits for Python. The thread that takes the violations also waits for the deadlines:
/// it is the only timed wait.
///
/// The time comes from one of three sources. At first it is told, by fm_engine_advance and the
/// times of reception (a recording). A node follows a steady clock, or the clock of a simulation.
/// It begins with the first fm_engine_advance, or with fm_engine_begin; before, nothing is due.
///
/// All functions may be called from any thread at any time, except fm_engine_create and
/// fm_engine_destroy. They wait for nothing except the mutex, unless they have a parameter
/// `milliseconds`, and release the mutex before they return or wait. The only foreign function
/// that they call with the mutex held is the clock, which must not block. A receiver (ros/) also
/// takes messages from the middleware with it held. Without a stated complexity a function is
/// O(1). What is due, where a function takes it: up to FM_MOST_PERIODS_BEHIND periods and the
/// timeouts of all inputs, at the costs of fm_evaluator_advance. An index out of range is ignored,
/// or gives zeros. An engine that is closed takes no message and nothing that is due.

#ifndef ENGINE_H_
#define ENGINE_H_

#include "blackbox.h"
#include "evaluator.h"
#include "fret_fields.h"
#include "gate.h"
#include "handover.h"
#include "outbox.h"
#include "scopes.h"
#include "states.h"
#include "transforms.h"

/// Version of the functions and structs of this header, those it includes, and those in ros/.
#define FM_ENGINE_ABI 39u

struct fm_engine;

/// What an engine runs. The caller owns all of it, keeps it until the engine is destroyed, and
/// does not call the evaluator in the meantime. With instances, what is not of a kind is of the
/// bundle's scope, and requirements have numbers in this order: those of the bundle's scope, then
/// of each kind those that are reported. It then has no gate. A requirement of instances is
/// violated while one violates it; a violation begins whenever an instance begins to violate it.
struct fm_engine_options
{
  struct fm_evaluator * evaluator;
  const struct fm_monitor * monitor;
  const struct fm_readers * readers;  // NULL: no topics
  const struct fm_topic * topics;     // those of the evaluator
  uint32_t n_topics;
  const uint8_t * sources;            // those of the evaluator
  bool uses_header_stamps;            // under FM_TIMED: see below
  int64_t reorder;                    // ns; 0 or more
  bool takes_recoveries;              // with the violations; if the evaluator reports them
  struct fm_scopes * scopes;          // NULL: no instances; the engine sets its sink
};

// Under FM_TIMED a message takes effect when it was received, by the source's time. With
// `uses_header_stamps` it takes effect at the stamp in its header. Then it waits for `reorder`:
// the evaluator is that much behind the clock, so that messages take effect in the order of their
// stamps, and deadlines come as much later. Up to FM_MOST_WAITING messages wait. A message that
// comes more than `reorder` after its stamp takes effect at the evaluator's time when it comes,
// after all that is due then. When there is no room, the oldest one that waits takes effect at its
// stamp. Both are counted. The clock is then that of the stamps: system time, in place of the
// steady clock. When it is set back, the messages that wait take effect, and the groups start
// afresh.

/// Messages that took effect out of order, or wait for long.
struct fm_order_counts
{
  uint64_t late;       // more than `reorder` after the stamp
  uint64_t overflows;  // too early, for want of room
  uint64_t ahead;      // stamp more than `reorder`, and 0.1 s, after the time of its reception
  int64_t most_ahead;  // ns, the longest of these times; 0 if there is none
};

/// The result of delivering a message.
enum fm_receipt
{
  FM_RECEIVED = 0,
  FM_UNDECODABLE = 1,  // counted; no step
  FM_REPEATED = 2,     // received before, by another subscription; not counted, no step
  FM_UNRELATED = 3     // none of the topic, whose `where` does not select it; not counted, no step
};

/// FM_ENGINE_ABI of this library. A program made with another one must call no other function.
FM_EXPORT uint32_t fm_engine_abi(void);

/// Make an engine; NULL if the readers do not fit the topics, or have no stamps and need them, or
/// memory is short.
/// O(requirements + topics); allocates.
FM_EXPORT struct fm_engine * fm_engine_create(const struct fm_engine_options * options);

/// Free an engine. No other thread may call a function of it now or later: close the engine and
/// join these threads first. O(topics).
FM_EXPORT void fm_engine_destroy(struct fm_engine * engine);

/// Ignore messages from now on. Calls that wait for a violation or detail return at once when the
/// queue is empty.
FM_EXPORT void fm_engine_close(struct fm_engine * engine);
FM_EXPORT bool fm_engine_is_closed(struct fm_engine * engine);

/// Deliver a message: read, take what is due before it, store, step, queue the violations.
/// Returns enum fm_receipt. O(fields to read + operations of the groups that step + what is due);
/// allocates when a queue grows.
FM_EXPORT uint32_t fm_engine_message(
  struct fm_engine * engine, uint32_t topic, const uint8_t * message, size_t size,
  const struct fm_origin * origin);

/// A transform between two frames, as a topic: its messages are of the type
/// geometry_msgs/msg/TransformStamped, and are made by the engine. The names have up to
/// FM_MOST_FRAME_BYTES bytes, no slash before them, and outlive the engine.
struct fm_transform_topic
{
  const char * from;
  const char * to;
  uint32_t topic;
};

/// Make messages of `n` transforms. The messages of the topics `tf` and `tf_static` (each
/// tf2_msgs/msg/TFMessage) then feed a tree (transforms.h). After one of them, each transform that
/// there is, and that differs from the one before in its stamp or its value, is delivered as a
/// message of its topic, received when the message with the links was; one after another, in the
/// order of `transforms`. A message with links is no step by itself. Call it once, before messages
/// are delivered. Returns false if a topic is out of range, or memory is short: the engine is
/// then of no use. O(n); allocates. A message of `tf` then costs fm_tree_read, and n times
/// fm_tree_look_up.
FM_EXPORT bool fm_engine_follow_transforms(
  struct fm_engine * engine, const struct fm_transform_topic * transforms, uint32_t n, uint32_t tf,
  uint32_t tf_static);

/// Whether the transform of a topic has no value now; as fm_tree_missing, `from` and `to`
/// (FM_MOST_FRAME_BYTES + 1 bytes each) are then the frames between which a link is missing. As
/// fm_tree_look_up.
FM_EXPORT bool fm_engine_missing_link(
  struct fm_engine * engine, uint32_t topic, char * from, char * to);

/// Whether a message of a topic has come. O(1).
FM_EXPORT bool fm_engine_has_come(struct fm_engine * engine, uint32_t topic);

/// As fm_tree_left_out.
FM_EXPORT struct fm_tree_counts fm_engine_left_out(struct fm_engine * engine);

/// The type of what is seen. Up to 9 as in rcl_interfaces/msg/ParameterType; from 5 on arrays.
enum fm_seen_type
{
  FM_SEEN_NOTHING = 0,
  FM_SEEN_BOOL = 1,
  FM_SEEN_INT64 = 2,
  FM_SEEN_FLOAT64 = 3,
  FM_SEEN_TEXT = 4,
  FM_SEEN_BYTES = 5,
  FM_SEEN_TEXTS = 9,
  FM_SEEN_INT32 = 16  // how many in the graph, or the state of a lifecycle node
};

/// What is seen of the graph of ROS, or of a node. A text has `length` bytes, and no zero at its
/// end.
struct fm_seen
{
  uint32_t type;  // enum fm_seen_type
  union fm_value value;
  const char * text;
  uint32_t length;
};

/// Why nothing is known of a node's state or parameter.
enum fm_fault
{
  FM_NO_FAULT = 0,
  FM_NO_NODE = 1,
  FM_NO_ANSWER = 2,   // of its services
  FM_NOT_SET = 3,     // the node has no such parameter
  FM_OTHER_TYPE = 4   // the parameter has one: `type`
};

/// What was seen last of something in the graph of ROS, of a node's state or parameter. In the
/// graph, or of a state, 0: it is not there. A node may have been there without an answer.
struct fm_observed
{
  int64_t value;   // the bits of the number; of a text, a hash
  uint64_t events; // messages about it
  uint32_t wanted; // enum fm_seen_type, of a derived topic; else FM_SEEN_NOTHING
  uint32_t type;   // the same of what came
  uint32_t fault;  // enum fm_fault
  bool has_value;
  bool was_there;  // at some time
};

/// Deliver a message of a topic that is made of what is seen, if that is another than last time:
/// one of std_msgs: Bool, Int32, Int64, Float64 or String. All that was received before comes
/// first, as with fm_engine_reset. `received` is a system time. `events` is what `events` of
/// fm_engine_observed was when a service was asked (FM_ANY_EVENTS: none was): if there were others
/// since, the answer is outdated, and false is returned. What a parameter is not, or of another
/// type, is a fault. Not within a callback of the middleware. As fm_engine_message.
#define FM_ANY_EVENTS UINT64_MAX
FM_EXPORT bool fm_engine_observe(
  struct fm_engine * engine, uint32_t topic, const struct fm_seen * seen, uint64_t events,
  int64_t received);

/// What was seen last of a topic. O(1).
FM_EXPORT struct fm_observed fm_engine_observed(struct fm_engine * engine, uint32_t topic);

/// Note that the node of a topic is there, whatever is known of its state or parameter. O(1).
FM_EXPORT void fm_engine_note_node(struct fm_engine * engine, uint32_t topic);

/// Note why nothing is known of a topic, until something is. O(1).
FM_EXPORT void fm_engine_note_fault(
  struct fm_engine * engine, uint32_t topic, enum fm_fault fault);

/// A topic whose messages are made of those of another one, `source`: the state of a lifecycle
/// node (lifecycle_msgs/msg/TransitionEvent), or a parameter (rcl_interfaces/msg/ParameterEvent).
/// The texts outlive the engine.
struct fm_derived_topic
{
  uint32_t topic;
  uint32_t source;
  uint32_t type;           // enum fm_seen_type; FM_SEEN_INT32: the state of a node
  const char * node;       // of a parameter: the full name of its node
  const char * parameter;  // its name
};

/// Make messages of `n` topics: after a message of `source` its value is delivered, if it is about
/// the topic, and is another than the one before. Such a message is received when that of the
/// source was, which is no step by itself. Of a lifecycle node there are the states 1 to 4: while
/// it changes its state, it has the one before. Call it once, before messages are delivered.
/// Returns false if a topic is out of range, or memory is short. O(n); allocates. A message of a
/// source then costs O(its size) for each topic that is made of it.
FM_EXPORT bool fm_engine_follow_derived(
  struct fm_engine * engine, const struct fm_derived_topic * topics, uint32_t n);

/// Keep the states of the requirements up to date from now on (states.h), for locks and actions;
/// the evaluator must report recoveries. One of instances holds while it holds in all of them, and
/// is not known while it is not known of one. fm_engine_take then also returns when one has
/// changed. Call it before messages are delivered. O(1); each step then costs O(requirements +
/// inputs of their groups).
FM_EXPORT void fm_engine_follow_states(struct fm_engine * engine);

/// Wait until a state has changed since a call returned `seen` (0 at first), the engine is closed,
/// or the time is over; 0 milliseconds: do not wait. Copy the states to `out`, n_requirements of
/// them. Returns the number of changes so far. O(requirements).
FM_EXPORT uint64_t fm_engine_states(
  struct fm_engine * engine, uint64_t seen, uint32_t milliseconds,
  struct fm_requirement_state * out);

/// Keep from now on when violations of instances begin and end, for actions with keys; after
/// fm_engine_follow_states, before messages are delivered. Returns false if memory is short.
/// O(requirements).
FM_EXPORT bool fm_engine_follow_instances(struct fm_engine * engine);

/// Take the oldest of these, and its key (FM_KEY_ROOM bytes, as fm_outbox_take): a violation that
/// begins, or a recovery, of an instance that has ended, too. If its requirement is
/// n_requirements, the violations of all instances are over: all started afresh, or memory was
/// short, and others are lost. fm_engine_states returns when there is one. Returns whether there
/// was one. One thread at a time. O(1).
FM_EXPORT bool fm_engine_take_instance(
  struct fm_engine * engine, struct fm_violation * out, uint8_t * key);

/// Take the least margin of each requirement since the last call, as fm_evaluator_take_margin:
/// `out` has room for all of them; of instances the least of all (fm_scopes_take_margin).
/// O(requirements), with instances O(requirements x log n).
FM_EXPORT void fm_engine_take_margins(struct fm_engine * engine, double * out);

/// Keep each message that is delivered from now on in a black box, and note there when a
/// violation begins; the evaluator must report recoveries. Call it before messages are delivered.
/// The black box must outlive the engine. O(1).
FM_EXPORT void fm_engine_keep_messages(struct fm_engine * engine, struct fm_blackbox * box);

/// Which messages of a topic a black box keeps: those that its `where` selects, unless it is said.
enum fm_keeping
{
  FM_KEEP_SELECTED = 0,
  FM_KEEP_ALL = 1,      // for other topics with this name, too
  FM_KEEP_NONE = 2      // another topic with this name keeps them
};

/// Before messages are delivered. O(1).
FM_EXPORT void fm_engine_keep_of(
  struct fm_engine * engine, uint32_t topic, enum fm_keeping keeping);

/// Let a gate of the evaluator judge the messages of its topic: these are given to
/// fm_engine_judge, and not to fm_engine_message. Whatever else is evaluated, the engine notes
/// with the gate. While the engine hangs (fm_engine_hangs) for half a second, the gate is closed;
/// fm_engine_take also looks for that. Call it before messages are delivered; the gate outlives
/// the engine, and no other code calls it. O(1).
FM_EXPORT void fm_engine_guard(
  struct fm_engine * engine, struct fm_gate * gate, const struct fm_gate_options * options);

/// Judge a message of the gate's topic, after what is due before it; as fm_gate_judge. The
/// violations are queued. `*due` is when a replacement is due, by CLOCK_MONOTONIC; FM_NEVER: none
/// is. A closed engine returns FM_CLOSED and counts nothing. Costs as fm_engine_message and
/// fm_gate_judge.
FM_EXPORT uint32_t fm_engine_judge(
  struct fm_engine * engine, const uint8_t * message, size_t size,
  const struct fm_origin * origin, int64_t * due);

/// A replacement is due: fill in the time at `stamp_at` of its message (an offset in bytes; -1:
/// nowhere), and take its step; as fm_gate_replace. Returns whether to send it. `*due` is when the
/// next one is due. Costs as fm_engine_judge.
FM_EXPORT bool fm_engine_replace(
  struct fm_engine * engine, uint8_t * message, size_t size, int64_t stamp_at, int64_t * due);

/// The present ROS time: that of the clock of fm_engine_follow_clock, 0 if it has none, else
/// system time. O(1).
FM_INTERNAL int64_t fm_engine_ros_time(struct fm_engine * engine);

/// Write the present ROS time into a serialized message, at an offset (-1: nowhere). O(1).
FM_INTERNAL void fm_engine_write_time(
  struct fm_engine * engine, uint8_t * message, size_t size, int64_t stamp_at);

/// When a replacement is due, as of fm_engine_judge.
FM_EXPORT int64_t fm_engine_replacement_due(struct fm_engine * engine);

/// As fm_evaluator_reset, after what is due, and before what the reset makes due; and as
/// fm_gate_reset. O(inputs + state bytes + what is due).
FM_EXPORT void fm_engine_reset(struct fm_engine * engine);

/// While the time is told: move it to `now`, and take what is due by then, each stamped with its
/// instant. Nothing while a clock is followed. O(what is due).
FM_EXPORT void fm_engine_advance(struct fm_engine * engine, int64_t now);

/// Follow a clock that nobody sets (CLOCK_MONOTONIC). Stamps are in system time: a message's time
/// of reception, or the instant of what is due as the system clock counts it now. fm_engine_take
/// takes what is due when a deadline comes during its wait.
FM_EXPORT void fm_engine_follow_steady(struct fm_engine * engine);

/// Follow a clock that may stand still or jump; stamps are its times. `now` writes nanoseconds and
/// returns 0. If it fails or writes 0 or less there is no time: nothing is due, a message has the
/// stamp 0, and its age cannot be used. So it is before the next fm_engine_wake if the clock
/// `is_outdated`. Call fm_engine_wake whenever the clock has moved. What is due at the time at
/// which the clock stands is due when it has moved on: until then a message at that time may come.
/// The clock must live until another is followed, or the engine is destroyed.
///
/// When one of these functions changes the source of the time, what was to come in a second still
/// comes in a second. O(inputs + what is due).
FM_EXPORT void fm_engine_follow_clock(
  struct fm_engine * engine, int (* now)(void * clock, int64_t * nanoseconds), void * clock,
  bool is_outdated);

/// Begin the time of the clock that is followed, once all messages are received. Later calls do
/// nothing. O(inputs).
FM_EXPORT void fm_engine_begin(struct fm_engine * engine);

/// The clock has moved: let fm_engine_take look at it.
FM_EXPORT void fm_engine_wake(struct fm_engine * engine);

/// Deliver all that was received before the call, and take what is due by then: before the clock
/// that is followed goes back, and before a subscription ends. Not within a callback of the
/// middleware. O(messages in the queues).
FM_EXPORT void fm_engine_drain(struct fm_engine * engine);

/// For the thread that moves the clock that is followed: note that it is alive, also while the
/// clock stands still. O(1).
FM_EXPORT void fm_engine_serve_clock(struct fm_engine * engine);

/// Whether the thread hangs that moves the clock that is followed, so that the states of the
/// requirements are not up to date: fm_engine_serve_clock was not called for longer than
/// `nanoseconds` of CLOCK_MONOTONIC. O(1).
FM_EXPORT bool fm_engine_hangs(struct fm_engine * engine, int64_t nanoseconds);

/// As fm_evaluator_deadline: in the time of the source. O(inputs).
FM_EXPORT int64_t fm_engine_deadline(struct fm_engine * engine);

/// As fm_arrivals_begin_handover and fm_arrivals_end_handover, of a topic.
FM_EXPORT void fm_engine_begin_handover(
  struct fm_engine * engine, uint32_t topic, bool has_history);
FM_EXPORT void fm_engine_end_handover(struct fm_engine * engine, uint32_t topic);

/// Take up to `room` violations from the queue, oldest first. If the queue is empty, waits for up
/// to `milliseconds` (0: does not wait). While a clock is followed, takes what is due first, and
/// when its time comes during the wait. Returns their number; 0 if the time is over, or the
/// engine is closed and the queue empty. One thread at a time, which keeps the violations in
/// order. O(room + inputs + what is due).
FM_EXPORT uint32_t fm_engine_take(
  struct fm_engine * engine, struct fm_violation * out, uint32_t room, uint32_t milliseconds);

/// The same, with the keys of the instances: as fm_outbox_take.
FM_EXPORT uint32_t fm_engine_take_keyed(
  struct fm_engine * engine, struct fm_violation * out, uint8_t * keys, uint32_t room,
  uint32_t milliseconds);

/// The bytes of a detail with all that follows it.
FM_EXPORT size_t fm_engine_detail_bytes(struct fm_engine * engine);

/// Whose values a detail has.
struct fm_detail_scope
{
  const struct fm_monitor * monitor;
  uint32_t kind;         // FM_BUNDLE: the scope of the bundle
  const uint8_t * key;   // of the instance, within the detail; NULL: of the bundle
  uint32_t key_size;
};

/// The scope of a detail that was taken. Any thread; O(kinds).
FM_EXPORT struct fm_detail_scope fm_engine_detail_scope(
  const struct fm_engine * engine, const struct fm_detail * detail);

/// Details of a requirement in a second for subscribers; the others are counted.
#define FM_MOST_DETAILS_PER_S 100u

/// As fm_outbox_want_details.
FM_EXPORT void fm_engine_want_details(
  struct fm_engine * engine, bool are_wanted, uint32_t most_per_s);

/// As fm_outbox_take_detail; waits as fm_engine_take does. One thread at a time. The two queues
/// are independent: a violation does not wait for its detail, nor a detail for its violation.
FM_EXPORT bool fm_engine_take_detail(
  struct fm_engine * engine, struct fm_detail * out, uint32_t milliseconds);

/// Copy the counts of all requirements to `out`. A violation, its detail and its count are of one
/// instant: without a detail in the queue, none is on its way. O(requirements).
FM_EXPORT void fm_engine_detail_counts(
  struct fm_engine * engine, struct fm_detail_counts * out);

/// Take the kept message of a topic: the first one with a field that could not be used. After
/// that, the next such message is kept. Returns its size, 0 if there is none. If the size is more
/// than `room`, nothing is written and the message stays. O(size).
FM_EXPORT size_t fm_engine_evidence(
  struct fm_engine * engine, uint32_t topic, uint8_t * out, size_t room);

/// As fm_arrivals_lost, of a topic.
FM_EXPORT uint64_t fm_engine_lost(struct fm_engine * engine, uint32_t topic);

/// Count violations that were taken and could not be published (snapshot.h).
FM_EXPORT void fm_engine_count_unpublished(struct fm_engine * engine, uint64_t more);

/// The messages of a topic that took effect out of order, or wait for long.
FM_EXPORT struct fm_order_counts fm_engine_order_counts(
  struct fm_engine * engine, uint32_t topic);

#endif  // ENGINE_H_
