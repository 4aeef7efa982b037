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

/// kinds.h: kinds of instances and aggregates over them, as scopes.h is given them.

#ifndef KINDS_H_
#define KINDS_H_

#include "evaluator.h"

#define FM_MOST_KEY_BYTES 255u
#define FM_NO_SLOT UINT32_MAX

/// The scope of the bundle, in place of the index of a kind; its slot is 0.
#define FM_BUNDLE UINT32_MAX

/// Whether a message of a topic is one for the instances of a kind.
enum fm_concern
{
  FM_CONCERNS_NONE = 0,
  FM_CONCERNS_ALL = 1,  // for all: the topic feeds an input without a variable
  FM_CONCERNS_KEY = 2,  // for the instance of its key; may be added to the others
  FM_CONCERNS_VALUE = 4  // an operand of an aggregate that they read reads an input of the topic:
                         // for all under FM_RELEVANT_MESSAGE and FM_ALL_INPUTS
};

struct fm_key
{
  const uint8_t * bytes;
  uint32_t size;
};

/// One of the two variables of a kind of pairs. The key of a pair is made of one of each
/// (fm_pair_key in fret_cdr.h, pairs.h).
struct fm_half
{
  const struct fm_key * listed;  // its keys; n_listed is 0: they are found
  uint32_t n_listed;
  uint32_t most;             // of its keys are in pairs at one time
  uint32_t kind;             // of this variable alone, without a base; FM_BUNDLE: there is none
  const uint32_t * inputs;   // an input: the same in that kind; UINT32_MAX: it is not of it
};

/// A kind of instances. All that it points to outlives the scopes and stays the caller's. A kind
/// that reads aggregates comes after those of their operands. One whose keys are those of a kind
/// before it, its base, has no keys of its own: its instances begin and end with those of the
/// base, and have the values that are stored in them.
///
/// A kind of pairs has two halves. A message for an instance of a half is one for all pairs of its
/// key, and a pair that begins knows the values of the instances of its halves.
struct fm_kind
{
  const struct fm_evaluator_options * options;  // of its monitor; policy and topics as the bundle
  const struct fm_outputs * outputs;            // operands of aggregates; NULL: none
  const uint8_t * concerns;                     // a topic: enum fm_concern
  const struct fm_topic * keyed;  // a topic: the inputs with a key that it feeds
  const uint32_t * shared;  // an input: the same in the bundle's scope; UINT32_MAX: it has a key
  const uint32_t * of_base;  // an input with a key: the same in the base; NULL: there is no base
  uint32_t base;
  const struct fm_half * halves;  // of a kind of pairs: two; NULL: it is of one variable
  const struct fm_key * listed;  // instances from the start
  uint32_t n_listed;
  uint32_t most;                 // instances at one time
  int64_t forget;                // ns after the last message of its key, it ends; 0: never
};

enum fm_operation
{
  FM_COUNT_OF = 0,  // how many: an int64
  FM_ANY_OF = 1,    // a bool
  FM_ALL_OF = 2,    // a bool
  FM_MIN_OF = 3,    // of the type of the output; no value over none
  FM_MAX_OF = 4,
  FM_SUM_OF = 5     // of the type of the output
};

/// An aggregate over the instances of a kind.
struct fm_aggregate
{
  uint32_t kind;       // index of the kind of the instances
  uint32_t operation;  // enum fm_operation
  uint32_t operand;    // FM_COUNT_OF, FM_ANY_OF, FM_ALL_OF: a requirement of the kind, whose
                       // report is FM_UNREPORTED; otherwise one of its outputs
  uint32_t input;      // of the bundle's scope: its value; its source is FM_AGGREGATE
};

/// Counters of the instances of a kind; `alive` are there now.
struct fm_pool_counts
{
  uint64_t alive;
  uint64_t begun;
  uint64_t ended;
  uint64_t open;     // of those that ended, how many had a deadline
  uint64_t beyond;   // parts of messages whose key found no room, or has too many bytes or none
  uint64_t unsized;  // of these, how many whose key has too many bytes or none
  uint64_t second;   // of these, how many pairs of which there was room for the first key alone
};

#endif  // KINDS_H_
