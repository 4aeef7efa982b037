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

/// scopes_parts.h: the struct of scopes, and the functions that scopes_*.c share. A file calls
/// only those before it: steps < due < making < scopes.c.

#ifndef SCOPES_PARTS_H_
#define SCOPES_PARTS_H_

#include "aggregates.h"
#include "pairs.h"
#include "pool.h"
#include "scopes.h"

struct fm_scope_kind
{
  struct fm_pool pool;
  struct fm_kind options;
  uint32_t * copies;  // an input of the bundle's scope: the same of this kind; UINT32_MAX: none
  uint32_t * parts;   // an input of the base: the same of this kind; UINT32_MAX: none
  struct fm_pairs own_pairs;
  struct fm_pairs * pairs;  // its own, or those of its base; NULL: it is of one variable
  uint32_t * waiting; // slots that have a message, and step after other kinds; NULL: none wait
  uint32_t n_waiting;
  bool reads_aggregates;
  bool keeps_parts;   // of the instance that is entered: it is a base, or a half of pairs
};

// A value of a message for more than one scope.
struct fm_staged
{
  union fm_value value;
  uint32_t input;
  bool is_usable;
};

// The message or row that is being taken.
struct fm_scopes_message
{
  int64_t now;
  int64_t instant;        // at which it takes effect in the bundle's scope
  int64_t entered_at;     // at which it takes effect in the instance that is entered
  int64_t reached;        // the latest at which it has taken effect in an instance
  uint32_t topic;
  uint32_t n_staged;
  uint32_t n_parts;       // of the instance that is entered
  uint32_t kind;          // of the instance that is entered; FM_BUNDLE: none is
  uint32_t slot;
  bool is_row;
  bool is_for_all;        // a row
  bool is_put_off;        // what reads aggregates has not taken it: see fm_scopes_end
};

struct fm_scopes
{
  struct fm_evaluator * bundle;
  struct fm_scope_kind * kinds;
  struct fm_total * totals;
  uint64_t * steps;            // an aggregate: those of its group before the step that is taken
  struct fm_topic * topics;    // of the bundle's scope, with the aggregates that they feed
  struct fm_staged * staged;
  struct fm_staged * parts;    // values of the instance that is entered, for kinds with its key
  struct fm_violation * found;
  struct fm_stepped * stepped;
  fm_scopes_sink sink;
  void * context;
  struct fm_closest_log * closest;  // NULL: none
  struct fm_scopes_message message;
  struct fm_evaluator_options options;  // of the bundle's scope, with these topics
  uint32_t n_kinds;
  uint32_t n_totals;
  uint32_t n_stepped;
  uint32_t most_stepped;
};

FM_INLINE bool fm_scopes_have_same_keys(const struct fm_scopes * scopes, uint32_t a, uint32_t b)
{
  return scopes->kinds[a].pool.keys == scopes->kinds[b].pool.keys;
}

// ---- scopes_steps.c ----------------------------------------------------------------------------

/// Report an event to the sink, and note it.
void fm_scopes_note(
  struct fm_scopes * scopes, enum fm_scope_event event, uint32_t kind, uint32_t slot,
  int64_t instant, uint32_t n);

/// The same, if anybody takes it.
FM_INLINE void fm_scopes_report(
  struct fm_scopes * scopes, enum fm_scope_event event, uint32_t kind, uint32_t slot,
  int64_t instant, uint32_t n)
{
  if (scopes->sink != NULL || scopes->most_stepped > 0) {
    fm_scopes_note(scopes, event, kind, slot, instant, n);
  }
}

/// Enter an instance, at the time of the bundle's scope. Returns its evaluator.
struct fm_evaluator * fm_scopes_enter_slot(
  struct fm_scopes * scopes, uint32_t kind, uint32_t slot);

/// Note the steps of the operands of an instance that is entered; after it was evaluated, count
/// what they have become.
void fm_scopes_before_step(struct fm_scopes * scopes, uint32_t kind);
void fm_scopes_after_step(struct fm_scopes * scopes, uint32_t kind, int64_t instant);

/// Store the aggregates that a kind reads in its instance that is entered, where they are others,
/// at an instant; under FM_TIMED at least 1 ns after its last evaluation. O(aggregates).
void fm_scopes_give_aggregates(struct fm_scopes * scopes, uint32_t kind, int64_t instant);

/// Under FM_TIMED and FM_ALL_INPUTS: whether the instances of a kind have to know of the values of
/// aggregates at once. O(aggregates).
bool fm_scopes_has_news(struct fm_scopes * scopes, uint32_t kind);

/// Take what is due by `last` in the instance that is entered. O(operations) for each.
void fm_scopes_take_due_of(struct fm_scopes * scopes, uint32_t kind, int64_t last);

/// An instance no longer counts in the aggregates.
void fm_scopes_uncount(struct fm_scopes * scopes, uint32_t kind, uint32_t slot);

/// Begin an instance, whose key has the slot, in all kinds with that key, and let it know the
/// shared inputs, and those of the instances of its halves.
void fm_scopes_begin_instance(
  struct fm_scopes * scopes, uint32_t kind, uint32_t slot, int64_t now);

/// Store the aggregates that have changed in the bundle's scope, at an instant, which must be
/// later than its last evaluation under FM_TIMED: the groups that read them are due then.
void fm_scopes_store_aggregates(struct fm_scopes * scopes, int64_t instant);

/// The instant, or 1 ns after the last evaluation of the bundle's scope, if that is later.
int64_t fm_scopes_bundle_instant(const struct fm_scopes * scopes, int64_t instant);

/// Take what is due in the bundle's scope by `last`.
void fm_scopes_take_bundle(struct fm_scopes * scopes, int64_t last);

// ---- scopes_due.c ------------------------------------------------------------------------------

/// Move the time of all scopes to `now`; it may begin then, or go back.
void fm_scopes_reach(struct fm_scopes * scopes, int64_t now);

/// When something is first due in the instances of a kind, or in all scopes, if that is by `last`;
/// else FM_NEVER. `misses`: of too many periods, the first are left out. O(log n) for each bound.
int64_t fm_scopes_first_due_of(
  struct fm_scopes * scopes, uint32_t kind, int64_t last, bool misses);
int64_t fm_scopes_first_due(struct fm_scopes * scopes, int64_t last, bool misses);

/// Let all instances of a kind know the values of the aggregates that they read. O(instances).
void fm_scopes_spread_news(struct fm_scopes * scopes, uint32_t kind, int64_t instant);

/// Take what is due in the instances of a kind at an instant, before which nothing is due, until
/// one of them has to end, whose slot is returned; FM_NO_SLOT: none has to.
uint32_t fm_scopes_take_until_end(struct fm_scopes * scopes, uint32_t kind, int64_t instant);

/// End an instance in all kinds with its key, the first of which has taken what is due. The others
/// take it first.
void fm_scopes_end_instance(
  struct fm_scopes * scopes, uint32_t kind, uint32_t slot, int64_t instant);

#endif  // SCOPES_PARTS_H_
