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

/// scopes.h: a bundle with `for_each`: the scope of the bundle, and an instance for each key.
///
/// A kind is a set of requirements that mention the same variables, with its own compiled monitor.
/// An instance of a kind is an instance of that monitor, so that its verdicts are those of a
/// bundle in which its key is written in place of the variable, from its start to its end. What
/// mentions no variable is the scope of the bundle: an evaluator, as without `for_each`.
///
/// Topics have the same numbers in all scopes; one that feeds nothing of a scope has no inputs
/// there. The scope of the bundle has all inputs that mention no variable. A kind has copies of
/// those that its requirements read, and the inputs with a key. A kind of pairs has copies of the
/// inputs of its halves: what is stored in an instance of a half is stored in all pairs of its
/// key, which step after the kinds before theirs.
///
/// A message takes effect in this order: its instances step, in the order in which their keys are
/// in it; if it is a message for all instances of a kind, the others step, kind by kind, by slot.
/// Kinds that read aggregates do so after the kinds before them, with the values that the
/// aggregates have then. At last the bundle's scope takes the message. What is due at one instant
/// is taken in the same order: kind by kind the instances, then those of them that end; then the
/// bundle. A message at the instant at which an instance would end comes before the end.
///
/// Of a value of an aggregate that is another one, all instances that read it know at once under
/// FM_TIMED and FM_ALL_INPUTS, and under FM_RELEVANT_MESSAGE by the messages that change it; under
/// the others, when they step.
///
/// Time is that of evaluator.h. Under FM_TIMED each scope has an instant of its own at which a
/// message takes effect: `now`, or 1 ns after its last evaluation. That of the bundle, and of an
/// instance that reads aggregates, is never before that of an instance before it that takes the
/// same message.
///
/// The caller owns all memory. Not thread-safe. No function allocates, blocks, or fails except by
/// the stated return value.

#ifndef SCOPES_H_
#define SCOPES_H_

#include "kinds.h"

/// What a sink is told. The violations are those of the step, valid until it returns, as is the
/// key of the slot (fm_scopes_key).
enum fm_scope_event
{
  FM_SCOPE_STEPPED = 0,
  FM_SCOPE_BEGAN = 1,
  FM_SCOPE_ENDED = 2,
  FM_SCOPE_BEYOND = 3  // a key found no room; `slot` is FM_NO_SLOT
};

struct fm_stepped
{
  int64_t instant;
  uint32_t kind;   // FM_BUNDLE: the scope of the bundle
  uint32_t slot;
  uint32_t event;  // enum fm_scope_event
  uint32_t n_violations;
};

/// Called after each step, begin and end, in their order. It must not call the scopes, except to
/// read.
typedef void (* fm_scopes_sink)(
  void * context, const struct fm_stepped * stepped, const struct fm_violation * violations);

struct fm_scopes_options
{
  const struct fm_evaluator_options * bundle;  // its `sources` say which inputs are aggregates
  const struct fm_kind * kinds;
  uint32_t n_kinds;
  uint32_t n_aggregates;
  const struct fm_aggregate * aggregates;
  const uint64_t * seed;   // two words that nobody can guess; NULL: 0
  fm_scopes_sink sink;     // NULL: none
  void * context;
  uint32_t most_stepped;   // how many events fm_scopes_stepped keeps
};

/// The least margin that a requirement of an instance had, which has ended.
struct fm_closest_record
{
  struct fm_closest closest;
  uint32_t kind;
  uint32_t requirement;
  uint32_t key_size;
  uint8_t key[FM_MOST_KEY_BYTES];
};

/// Where scopes write these; the caller owns all of it. `missed` counts those for which there was
/// no room.
struct fm_closest_log
{
  struct fm_closest_record * records;
  uint32_t room;
  uint32_t n;
  uint64_t missed;
};

struct fm_scopes;

/// Bytes of memory that scopes with these options need; 0 if a monitor's ABI is not FM_ABI, or
/// they do not fit in the address space. O(groups + topics of all scopes).
FM_EXPORT uint64_t fm_scopes_bytes(const struct fm_scopes_options * options);

/// Make scopes in `memory`, aligned to 16, fm_scopes_bytes long, all 0 (so that memory that is
/// never used need not be touched). The instances of listed keys exist. Returns NULL if the
/// options of a scope are refused by fm_evaluator_init, an index is out of range, an aggregate
/// does not fit its operand or input, a topic's number differs, or listed keys are more than
/// `most` or not distinct, or a half of pairs does not fit. O(bytes of the tables, and of the
/// listed instances).
FM_EXPORT struct fm_scopes * fm_scopes_init(
  void * memory, const struct fm_scopes_options * options);

/// Give an input of a kind its initial value, in all instances, present and to come; before the
/// first message. Inputs of the bundle's scope: fm_evaluator_initial of fm_scopes_bundle, and here
/// for the copies. O(instances).
FM_EXPORT void fm_scopes_initial(
  struct fm_scopes * scopes, uint32_t kind, uint32_t input, union fm_value value);
FM_EXPORT void fm_scopes_initial_from(
  struct fm_scopes * scopes, uint32_t kind, uint32_t input, const void * value);

// ---- messages ----------------------------------------------------------------------------------
// A message: what is due before `now` (fm_scopes_advance_to), fm_scopes_begin, its values, then
// fm_scopes_end.

/// Begin a message of a topic that came `now`.
FM_EXPORT void fm_scopes_begin(struct fm_scopes * scopes, uint32_t topic, int64_t now);

/// Begin a row of a trace (any policy): all ready groups of the scopes that it is for take a step:
/// those entered, the bundle's, and with `is_for_all` all instances.
FM_EXPORT void fm_scopes_begin_row(struct fm_scopes * scopes, bool is_for_all, int64_t now);

/// A value of an input of the bundle's scope, for it and all instances that read it; or one that
/// cannot be used. Each input once a message, before the first fm_scopes_enter. O(1).
FM_EXPORT void fm_scopes_store(struct fm_scopes * scopes, uint32_t input, union fm_value value);
FM_EXPORT void fm_scopes_store_from(
  struct fm_scopes * scopes, uint32_t input, const void * value);
FM_EXPORT void fm_scopes_unusable(struct fm_scopes * scopes, uint32_t input);

/// The message has a part for the instance of a key; the values of that part follow. The instance
/// that was entered before steps now. An instance begins if there is none with the key. Parts of
/// pairs come before those of their halves, which are for all pairs of their key. Returns its
/// slot, or FM_NO_SLOT, and the part is left out: there is no room for the key, it is none of the
/// listed keys, the message had a part for it before, or the kind has a base. O(1) expected,
/// O(pairs of the key) for a half, O(log n) if a deadline comes forward, and the operations of a
/// step.
FM_EXPORT uint32_t fm_scopes_enter(
  struct fm_scopes * scopes, uint32_t kind, const void * key, size_t size);

/// A value of an input of the instance that is entered; or one that cannot be used. Ignored if
/// none is. O(1).
FM_EXPORT void fm_scopes_store_keyed(
  struct fm_scopes * scopes, uint32_t input, union fm_value value);
FM_EXPORT void fm_scopes_store_keyed_from(
  struct fm_scopes * scopes, uint32_t input, const void * value);
FM_EXPORT void fm_scopes_unusable_keyed(struct fm_scopes * scopes, uint32_t input);

/// All values are stored: the last instance that was entered steps, then the others that the
/// message is for, then the bundle's scope. Returns the instant at which it takes effect in the
/// bundle's scope. Under FM_TIMED, while something is due in an instance at this very instant,
/// what reads aggregates takes the message with that: when the time moves past the instant, or
/// before the next message. O(operations of what steps), and O(slots in use) if it is for all
/// instances, or all have to know of the value of an aggregate.
FM_EXPORT int64_t fm_scopes_end(struct fm_scopes * scopes);

/// A message of which something is left to take effect (fm_scopes_end) does so, without what is
/// due. The engine calls it before it forgets the violations of a time that is over; otherwise
/// this happens by itself. Cost as fm_scopes_end.
FM_INTERNAL void fm_scopes_finish_early(struct fm_scopes * scopes);

// ---- time --------------------------------------------------------------------------------------

/// Move the time to `now`, and take what is due at the first instant by then at which something is
/// due. Returns that instant; FM_NEVER: nothing was due. To be called until it returns that. The
/// first call begins the time of all scopes. As fm_evaluator_advance otherwise; with `_to`, what
/// is due at `now` itself is not taken, as for a clock that stands still, or before a message.
/// O(log n + operations) for each scope that something is due in.
FM_EXPORT int64_t fm_scopes_advance(struct fm_scopes * scopes, int64_t now);
FM_EXPORT int64_t fm_scopes_advance_to(struct fm_scopes * scopes, int64_t now);

/// As fm_evaluator_deadline and fm_evaluator_wake, of all scopes. O(kinds); the deadline O(log n)
/// for each instance whose deadline was put off.
FM_EXPORT int64_t fm_scopes_deadline(struct fm_scopes * scopes);
FM_EXPORT int64_t fm_scopes_wake(const struct fm_scopes * scopes);

/// As fm_evaluator_shift and fm_evaluator_reset, of all scopes. O(instances).
FM_EXPORT void fm_scopes_shift(struct fm_scopes * scopes, int64_t by);
FM_EXPORT void fm_scopes_reset(struct fm_scopes * scopes);

// ---- answers -----------------------------------------------------------------------------------

/// The events since the last fm_scopes_clear, at most `most_stepped`; further ones are left out.
/// Returns their number. They stay until it is called.
FM_EXPORT const struct fm_stepped * fm_scopes_stepped(
  const struct fm_scopes * scopes, uint32_t * n);
FM_EXPORT void fm_scopes_clear(struct fm_scopes * scopes);

/// An evaluator for reading: the bundle's scope (FM_BUNDLE), an instance that is alive, or with
/// FM_NO_SLOT a kind, for its counters, which are those of all its instances with each of them.
/// Valid until the next call. NULL: there is none. O(log n).
FM_EXPORT const struct fm_evaluator * fm_scopes_look(
  struct fm_scopes * scopes, uint32_t kind, uint32_t slot);

/// Take the least margin of a requirement of any instance of a kind since the last call, the
/// present ones included; a NaN if none is known, and for an index out of range. O(log n).
FM_EXPORT double fm_scopes_take_margin(
  struct fm_scopes * scopes, uint32_t kind, uint32_t requirement);

/// The instance of a kind whose present margin of a requirement is the least; FM_NO_SLOT: none is
/// known. O(log n).
FM_INTERNAL uint32_t fm_scopes_nearest(
  struct fm_scopes * scopes, uint32_t kind, uint32_t requirement);

/// Write the least margins of instances that end to a log, which outlives this use; NULL: to none.
FM_EXPORT void fm_scopes_log_closest(struct fm_scopes * scopes, struct fm_closest_log * log);

/// The evaluator of the bundle's scope.
FM_EXPORT struct fm_evaluator * fm_scopes_bundle(struct fm_scopes * scopes);

/// The time: the latest that was told, also where the bundle's scope is ahead of it; 0 before.
FM_INTERNAL int64_t fm_scopes_now(const struct fm_scopes * scopes);

/// The options of a kind; NULL: there is none.
FM_INTERNAL const struct fm_kind * fm_scopes_kind(const struct fm_scopes * scopes, uint32_t kind);

/// Call a sink from now on, in place of that of the options.
FM_INTERNAL void fm_scopes_listen(
  struct fm_scopes * scopes, fm_scopes_sink sink, void * context);

/// Copy the key of a slot to FM_MOST_KEY_BYTES bytes; returns its bytes, 0 if the slot is free.
FM_EXPORT size_t fm_scopes_key(
  const struct fm_scopes * scopes, uint32_t kind, uint32_t slot, uint8_t * out);

/// The first slot from `slot` on that has an instance; FM_NO_SLOT: none.
FM_EXPORT uint32_t fm_scopes_next(const struct fm_scopes * scopes, uint32_t kind, uint32_t slot);

FM_EXPORT struct fm_pool_counts fm_scopes_counts(const struct fm_scopes * scopes, uint32_t kind);

/// As fm_evaluator_time_counts of the bundle's scope; the overflows are those of all scopes, also
/// of instances that have ended. O(kinds + queues).
FM_EXPORT struct fm_time_counts fm_scopes_time_counts(const struct fm_scopes * scopes);

/// How many instances violate a requirement of a kind now. O(1).
FM_EXPORT uint64_t fm_scopes_violated(
  const struct fm_scopes * scopes, uint32_t kind, uint32_t requirement);

/// Count from now on the instances of which requirements are not known (states.h), before the
/// first message. O(instances + requirements); entering an instance then costs O(inputs), too.
FM_INTERNAL void fm_scopes_count_unknown(struct fm_scopes * scopes);

/// Of how many instances a requirement of a kind is not known now. Those for which there was no
/// room since start or reset are one more, and so are those before the first one has begun, since
/// nothing is known of them. O(inputs).
FM_INTERNAL uint64_t fm_scopes_unknown(
  const struct fm_scopes * scopes, uint32_t kind, uint32_t requirement);

#endif  // SCOPES_H_
