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

/// in_place.h: reads messages in the middleware's buffer, without a copy.
///
/// A subscription is made with a type support that differs from the message's own in one function:
/// instead of deserializing a message, Fast DDS calls that with the Fast CDR object that holds the
/// serialized bytes. This relies on private layouts of rmw_fastrtps_cpp and Fast CDR, so that it
/// is used only with known versions (in_place_versions.c). With others, messages are copied.

#ifndef IN_PLACE_H_
#define IN_PLACE_H_

#include "middleware.h"

/// message_type_support_callbacks_t of rosidl_typesupport_fastrtps_cpp.
struct fm_type_callbacks
{
  const char * message_namespace;
  const char * message_name;
  void * cdr_serialize;
  bool (* cdr_deserialize)(void * cdr, void * message);
  void * get_serialized_size;
  void * max_serialized_size;
  void * key_callbacks;
};

/// A type support whose messages are read in place. `support` comes first: a pointer to it is a
/// pointer to the whole. It must not be moved or freed while the middleware may use it.
struct fm_in_place_type
{
  struct fm_type_support support;            // passed to the subscription
  const struct fm_type_support * original;   // of rosidl_typesupport_c
  struct fm_type_support fast;               // a copy of Fast DDS's, with these callbacks:
  struct fm_type_callbacks callbacks;
  void * spare[8];                           // NULL: no callbacks, should the struct be longer
};

/// Find the offsets of Fast CDR's private members, by searching objects that its own constructors
/// make: FastBuffer(char *, size_t) and Cdr(FastBuffer &, Endianness, CdrVersion). Returns false
/// if they are not found. O(1). One thread at a time for one `found`.
FM_EXPORT bool fm_in_place_find(
  void (* make_buffer)(void * self, char * data, size_t size),
  void (* make_cdr)(void * self, void * buffer, int endianness, int version),
  struct fm_in_place * found);

/// Make a type support from a message's own (of rosidl_typesupport_c), which must outlive it.
/// Returns false if the message has none for Fast DDS. O(1). One thread at a time for one `made`.
FM_EXPORT bool fm_in_place_make(
  const struct fm_type_support * original, struct fm_in_place_type * made);

#endif  // IN_PLACE_H_
