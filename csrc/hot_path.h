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


/// hot_path.h: from the middleware to a engine and back, without Python.
///
/// A receiver takes the messages of one subscription inside the middleware's new-message callback
/// and delivers them. An announcer is one thread that publishes what a engine queues: publishing
/// inside the callback hung at the end of a process.
///
/// What is called of the middleware (rmw, ROS 2 Jazzy) is found by name in what the process has
/// loaded, and declared here, so that neither a build nor a robot needs its headers. A test
/// compares the structs with the headers where there are some.

#ifndef HOT_PATH_H_
#define HOT_PATH_H_

#include "engine.h"

#ifdef __cplusplus
extern "C" {
#endif

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

/// rmw_message_info_t.
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

typedef void (* fm_on_message)(const void * user_data, size_t count);

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

/// A type support whose messages are read in place, and those it stands for. `support` comes first:
/// a pointer to it is one to all. Made by fm_in_place_make; neither moves nor ends as long as the
/// middleware may use it.
struct fm_in_place_type
{
  struct fm_type_support support;            // what a subscription is made with
  const struct fm_type_support * original;   // of rosidl_typesupport_c
  struct fm_type_support fast;               // that of Fast DDS, but for its callbacks
  struct fm_type_callbacks callbacks;
};

/// Where an object of Fast CDR (eprosima::fastcdr::Cdr) keeps the message it reads, in bytes.
struct fm_in_place
{
  size_t buffer_of_cdr;   // a pointer to its FastBuffer
  size_t data_of_buffer;  // in that one, a pointer to the bytes of the message
  size_t size_of_buffer;  // and their number
};

/// What is called of the middleware; 0 is success.
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
};

/// Find out where Fast CDR keeps what it reads, from objects that its own constructors make:
/// FastBuffer(char *, size_t) and Cdr(FastBuffer &, Endianness, CdrVersion). Returns false if they
/// are not as expected.
FM_EXPORT bool fm_in_place_find(
  void (* make_buffer)(void * self, char * data, size_t size),
  void (* make_cdr)(void * self, void * buffer, int endianness, int version),
  struct fm_in_place * found);

/// Make a type support of a message's own (of rosidl_typesupport_c): all of it the same, but that
/// Fast DDS will call fm_in_place_read. Returns false if the message has none for Fast DDS.
FM_EXPORT bool fm_in_place_make(
  const struct fm_type_support * original, struct fm_in_place_type * made);

/// The `cdr_deserialize` of a subscription that is read in place: instead of making a message of
/// the bytes, it reads the fields out of them, where the middleware has them. Such a subscription
/// was made with a type support that differs from the message's own in this function alone.
FM_EXPORT bool fm_in_place_read(void * cdr, void * receiver);

struct fm_receiver;

/// Start to deliver the messages of a subscription (an rmw_subscription_t that nobody else takes
/// from) as those of a topic; those that it holds already come first. The engine and the middleware
/// outlive the receiver; the subscription may be destroyed after fm_receiver_stop. `is_in_place`: it
/// was made with fm_in_place_read. NULL if the middleware has no such callback, or memory is
/// short. Not to be called from a callback.
FM_EXPORT struct fm_receiver * fm_receiver_start(
  struct fm_engine * engine, const struct fm_middleware * middleware, void * subscription,
  uint32_t topic, bool is_in_place);

/// Take what is there, at most 1000 messages. What comes meanwhile waits for its end.
FM_EXPORT void fm_receiver_drain(struct fm_receiver * receiver);

/// To be called now and then: have the next callback take what none has told of, or drain, if there
/// was none since the last look; but seldom once a topic is silent. A middleware that tells of every
/// message needs it never; but one message overlooked would delay all that follow.
FM_EXPORT void fm_receiver_poll(struct fm_receiver * receiver);

/// A new subscription is there: what comes by this one may come by that one too (fm_engine_begin_handover).
FM_EXPORT void fm_receiver_retire(struct fm_receiver * receiver);

/// End it; waits for a callback under way. Nothing is delivered after it. Frees the receiver.
FM_EXPORT void fm_receiver_stop(struct fm_receiver * receiver);

struct fm_announcer;

/// Start a thread that publishes a std_msgs/msg/Empty for each violation of the engine, in order:
/// by `publishers` (rmw_publisher_t, one a requirement, in the manifest's order; copied). NULL if
/// no thread can be made, or memory is short. What cannot be published is counted (fm_engine_unpublished).
/// The engine and publishers outlive the announcer.
FM_EXPORT struct fm_announcer * fm_announcer_start(
  struct fm_engine * engine, const struct fm_middleware * middleware, void * const * publishers,
  uint32_t n_publishers);

/// Wait for the thread, which ends once the engine is closed and all is published. Frees it.
FM_EXPORT void fm_announcer_join(struct fm_announcer * announcer);

#ifdef __cplusplus
}
#endif

#endif  // HOT_PATH_H_
