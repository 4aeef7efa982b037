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


/// fret_fields.h: reads the inputs of a topic from its serialized messages.
///
/// `compile` generates one reader for each topic from the message definition. Contract: a reader
/// reads only `size` bytes at `message`, at any alignment; it does not allocate, keeps no state,
/// fails only by the stated return value, and has no undefined behaviour for any bytes. Any
/// thread. O(fields up to the last one needed), O(elements reduced) for each array, and
/// O(elements) for each array of strings or messages that is searched, or before the last field
/// needed.

#ifndef FRET_FIELDS_H_
#define FRET_FIELDS_H_

#include "fret_monitor.h"

/// The result of reading a field.
enum fm_outcome
{
  FM_FIELD_READ = 0,     // `value` holds the field; for an age, .i holds the stamp in ns instead
  FM_FIELD_OUTSIDE = 1,  // the index is outside its array, which has `length` elements
  FM_FIELD_UNNAMED = 2,  // the string is not one of the input's `values`; it has `length` bytes,
                         // the first of them at .u in the message (a wstring: UTF-16 units; 0)
  FM_FIELD_EMPTY = 3,    // the minimum, maximum or mean of an empty array, or anything of a sector
                         // without elements
  FM_FIELD_ABSENT = 4    // the name is not in its array, which has `length` elements
};

/// A field of a message.
struct fm_field
{
  union fm_value value;  // the member for the input's type
  uint32_t outcome;      // enum fm_outcome
  uint32_t length;
};

/// Takes a part of a message: the values of the instance of a key, of a kind of instances.
/// `fields` are those of the kind's inputs on the topic, in the order of the manifest. All is
/// valid until it returns.
typedef void (* fm_part_sink)(
  void * context, uint32_t kind, const uint8_t * key, size_t key_size,
  const struct fm_field * fields);

/// The reader of a topic.
struct fm_reader
{
  /// Read the topic's inputs, in the order of the manifest, into `fields`, which has room for
  /// n_inputs. The message is CDR of either byte order, with its encapsulation header, as the
  /// middleware delivers it. Returns false if it is too short for the last field needed, or has
  /// another encoding; the content of `fields` is then unspecified.
  bool (* read)(const uint8_t * message, size_t size, struct fm_field * fields);
  uint32_t n_inputs;
  /// Read the stamp in the message's header, in nanoseconds: with `stamp: header`, otherwise NULL.
  /// Fails as `read`.
  bool (* stamp)(const uint8_t * message, size_t size, int64_t * stamp);
  /// Find out whether a message is one of the topic: with `where`, otherwise NULL. Fails as
  /// `read`.
  bool (* selects)(const uint8_t * message, size_t size, bool * is_selected);
  /// Hand over the parts of a message that are of instances, in the order of its elements; NULL if
  /// none is. `key` is the one in the topic's name; NULL: none. Fails as `read`, perhaps after
  /// some parts: call it without a sink first, to find out whether it can be read. O(fields up to
  /// the last one needed, and elements).
  bool (* parts)(
    const uint8_t * message, size_t size, const uint8_t * key, size_t key_size,
    fm_part_sink sink, void * context);
};

/// The readers of a bundle, one for each topic, in the order of the manifest. If the bundle has
/// topics, its library exports a function that returns this; the manifest gives its name.
struct fm_readers
{
  uint32_t abi;  // FM_ABI
  uint32_t n_topics;
  const struct fm_reader * topics;
};

#endif  // FRET_FIELDS_H_
