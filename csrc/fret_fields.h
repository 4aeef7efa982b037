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


/// fret_fields.h: from a serialized message to the values of the inputs that its topic feeds.
///
/// `compile` generates one reader a topic, out of the message definition. Contract for all of
/// them: they only read `size` bytes at `message`, at any alignment; no allocation, no state, no
/// failure other than by the stated return value; no undefined behaviour for any bytes. Time: O(1)
/// up to the last field that is needed, but for what lies before it and has a length of its own:
/// arrays of strings or of messages before it, and arrays that are reduced, are walked over once.

#ifndef FRET_FIELDS_H_
#define FRET_FIELDS_H_

#include "fret_monitor.h"

/// What became of a field.
enum fm_outcome
{
  FM_FIELD_READ = 0,     // `value` holds it
  FM_FIELD_OUTSIDE = 1,  // the index is outside its array, which has `length` elements
  FM_FIELD_UNNAMED = 2,  // the string is none of the input's `values`; it has `length` bytes
                         // (a wstring: UTF-16 units)
  FM_FIELD_EMPTY = 3     // an empty array has no minimum, maximum or mean
};

/// A field as read.
struct fm_field
{
  union fm_value value;  // the member that the input's type asks for
  uint32_t outcome;      // enum fm_outcome
  uint32_t length;
};

/// How the messages of a topic are read.
struct fm_reader
{
  /// Read the topic's inputs, in the order of the manifest, into `fields` (n_inputs of them).
  /// The message is CDR with its encapsulation header, as the middleware hands it out, of either
  /// byte order. Returns false if it cannot be decoded as far as the last field that is needed: it
  /// is too short, or of another encoding; `fields` means nothing then.
  bool (* read)(const uint8_t * message, size_t size, struct fm_field * fields);
  uint32_t n_inputs;
};

/// The readers of a bundle, a topic each, in the order of the manifest. A library exports the
/// function that returns this, named in the manifest, if the bundle has topics.
struct fm_readers
{
  uint32_t abi;  // FM_ABI
  uint32_t n_topics;
  const struct fm_reader * topics;
};

#endif  // FRET_FIELDS_H_
