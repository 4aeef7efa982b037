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

/// shared_names.h: names that only one part of a node may use, after remapping.
///
/// Any thread. Lines have the level FM_ERROR.

#ifndef SHARED_NAMES_H_
#define SHARED_NAMES_H_

#include "lines.h"
#include "report_table.h"

/// What publishes on a topic, offers a service, or calls one.
struct fm_use
{
  const char * kind;    // "gate", "lock" or "action"; "": the node itself
  const char * owner;   // the name of that
  const char * bundle;
  const char * verb;    // "publish on", "offer" or "call"; the node itself: no action may call it
  const char * name;    // the full name of the topic or service
  bool is_alone;        // it must be the only one
  const char * from;    // of a gate, the full names of its ends; otherwise NULL
  const char * to;
};

/// A topic or service that something uses, with its type.
struct fm_typed_use
{
  const char * name;  // the full name
  const char * type;  // package/msg/Name
  uint32_t owner;     // which bundle or gate uses it, from 1; 0: the node itself
  bool is_service;
  bool is_input;      // an input reads it
};

/// Add a line about each use of a name with another type than that of the name's first use: the
/// middleware refuses it. `owners`: the names of the bundles or gates; `kind` is what they are.
/// Left to fm_find_merged are two inputs of one bundle, an input and the node itself, and two
/// names of the node. Returns whether there are any. O(n * n).
FM_EXPORT bool fm_find_two_types(
  struct fm_lines * lines, const struct fm_typed_use * uses, uint32_t n,
  const char * const * owners, const char * kind);

/// Add the line about the first problem: a shortest circle of gates, in which a message would go
/// round for ever; two uses of one name, one of which must be alone; an action that calls the node
/// itself. Returns whether there is any. O(n * uses that must be alone + gates^3).
FM_EXPORT bool fm_find_shared(struct fm_lines * lines, const struct fm_use * uses, uint32_t n);

/// Add the line about the first topic of the table that is one with an earlier one: each message
/// would cause two steps, or have two meanings for those who receive it. Inputs may be read from a
/// topic of the node itself, with its type. `names`: the full names of all of `table->topics`.
/// Returns whether there is any. O(n_used * n_used).
FM_EXPORT bool fm_find_merged(
  struct fm_lines * lines, const struct fm_report_table * table, const char * const * names);

#endif  // SHARED_NAMES_H_
