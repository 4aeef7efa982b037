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

/// middleware.h: the functions and structs of the middleware (rmw, ROS 2 Jazzy) that are used.
///
/// The functions are looked up by name in the libraries that the process has loaded, and the
/// structs are declared here, so that neither a build nor a robot needs the headers of ROS. A test
/// compares the structs with the headers, if these are installed.

#ifndef MIDDLEWARE_H_
#define MIDDLEWARE_H_

#include "fret_monitor.h"

/// rcutils_allocator_t.
struct fm_allocator
{
  void * (* allocate)(size_t size, void * state);
  void (* deallocate)(void * pointer, void * state);
  void * (* reallocate)(void * pointer, size_t size, void * state);
  void * (* zero_allocate)(size_t count, size_t size, void * state);
  void * state;
};

/// rmw_serialized_message_t.
struct fm_serialized
{
  uint8_t * buffer;
  size_t length;
  size_t capacity;
  struct fm_allocator allocator;
};

/// rmw_message_info_t. Passed only as part of an fm_padded_info.
struct fm_message_info
{
  int64_t source_timestamp;
  int64_t received_timestamp;
  uint64_t publication_sequence_number;
  uint64_t reception_sequence_number;
  const char * implementation;  // of the gid
  uint8_t gid[16];
  bool from_intra_process;
};

struct fm_type_callbacks;

/// rosidl_message_type_support_t.
struct fm_type_support
{
  const char * typesupport_identifier;
  const struct fm_type_callbacks * data;
  const struct fm_type_support * (* func)(
    const struct fm_type_support * handle, const char * identifier);
  void * get_type_hash_func;
  void * get_type_description_func;
  void * get_type_description_sources_func;
};

/// rmw_gid_t.
struct fm_gid
{
  const char * implementation;
  uint8_t data[16];
};

/// Room for rmw_message_info_t, even if the middleware's struct is longer.
struct fm_padded_info
{
  struct fm_message_info info;
  uint64_t spare[16];
};

typedef void (* fm_on_message)(const void * user_data, size_t count);

/// Offsets, in bytes, of private members of eprosima::fastcdr::Cdr and FastBuffer.
struct fm_in_place
{
  size_t buffer_of_cdr;   // in a Cdr: the pointer to its FastBuffer
  size_t data_of_buffer;  // in a FastBuffer: the pointer to the bytes of the message
  size_t size_of_buffer;  // in a FastBuffer: their number
};

/// The middleware's functions. Those that return an int return 0 on success.
struct fm_middleware
{
  /// rmw_take_serialized_message_with_info
  int (* take)(
    const void * subscription, struct fm_serialized * message, bool * taken,
    struct fm_message_info * info, void * allocation);
  /// rmw_subscription_set_on_new_message_callback
  int (* listen)(void * subscription, fm_on_message callback, const void * user_data);
  /// rmw_publish
  int (* publish)(const void * publisher, const void * message, void * allocation);
  /// rcutils_reset_error, rcutils_error_is_set
  void (* forget_error)(void);
  bool (* has_error)(void);
  /// rmw_take_with_info; NULL: no subscription is read in place
  int (* take_message)(
    const void * subscription, void * message, bool * taken, struct fm_message_info * info,
    void * allocation);
  struct fm_in_place in_place;
  /// rmw_publisher_count_matched_subscriptions
  int (* count_matched)(const void * publisher, size_t * count);
};

#endif  // MIDDLEWARE_H_
