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


/// service_call.h: a call of a service through rmw: sends a request, and looks for the response.
///
/// Nothing waits. One thread at a time for one call. Messages are C structs that the fields of a
/// type (rosidl_typesupport_introspection_c) describe, so that any type of service works.

#ifndef SERVICE_CALL_H_
#define SERVICE_CALL_H_

#include "middleware.h"

/// rosidl_service_type_support_t, as far as it is read.
struct fm_service_support
{
  const char * typesupport_identifier;
  const void * data;
  const struct fm_service_support * (* func)(
    const struct fm_service_support * handle, const char * identifier);
  const struct fm_type_support * request_typesupport;
  const struct fm_type_support * response_typesupport;
};

/// rmw_service_info_t.
struct fm_service_info
{
  int64_t source_timestamp;
  int64_t received_timestamp;
  uint8_t writer_guid[16];
  int64_t sequence_number;
};

/// rosidl_typesupport_introspection_c__MessageMember, up to its functions.
struct fm_message_member
{
  const char * name;
  uint8_t type_id;
  size_t string_upper_bound;
  const struct fm_type_support * members;
  bool is_key;
  bool is_array;
  size_t array_size;
  bool is_upper_bound;
  uint32_t offset;
  const void * default_value;
  void (* functions[6])(void);
};

/// rosidl_typesupport_introspection_c__MessageMembers.
struct fm_message_members
{
  const char * message_namespace;
  const char * message_name;
  uint32_t member_count;
  size_t size;
  bool has_any_key_member;
  const struct fm_message_member * members;
  void (* init)(void * message, int initialization);
  void (* fini)(void * message);
};

/// Functions of rmw; they return 0 on success.
struct fm_service_functions
{
  /// rmw_service_server_is_available
  int (* is_available)(const void * node, const void * client, bool * is_available);
  /// rmw_send_request
  int (* send)(const void * client, const void * request, int64_t * sequence);
  /// rmw_take_response
  int (* take)(
    const void * client, struct fm_service_info * info, void * response, bool * taken);
  /// rmw_deserialize
  int (* deserialize)(
    const struct fm_serialized * message, const struct fm_type_support * type, void * out);
  /// rcutils_reset_error
  void (* forget_error)(void);
};

/// A client that the node has made. The caller owns all of it.
struct fm_service_client
{
  void * node;                                // rmw_node_t
  void * client;                              // rmw_client_t
  const struct fm_service_support * support;  // of rosidl_typesupport_c
  const char * name;                          // the full name of the service
};

enum fm_call_state
{
  FM_CALL_WAITS = 0,      // for a server, or for the response
  FM_CALL_ANSWERED = 1,
  FM_CALL_NO_SERVER = 2,  // in time
  FM_CALL_NO_ANSWER = 3,  // in time
  FM_CALL_REFUSED = 4     // by the middleware
};

/// The types of fields that are read and written.
enum fm_field_kind
{
  FM_DOUBLE_FIELD = 2,
  FM_BOOLEAN_FIELD = 6,   // rosidl_typesupport_introspection_c__ROS_TYPE_BOOLEAN, and so on
  FM_UINT8_FIELD = 8,
  FM_INT64_FIELD = 15,
  FM_STRING_FIELD = 16,
  FM_MESSAGE_FIELD = 18
};

/// A message and its type. `memory` is owned.
struct fm_typed_message
{
  const struct fm_type_support * support;
  const struct fm_message_members * members;
  void * memory;
};

/// Zeroed before fm_call_make; fm_call_free frees what it holds.
struct fm_call
{
  const struct fm_service_functions * functions;
  const struct fm_service_client * service;
  struct fm_typed_message request;
  struct fm_typed_message response;
  int64_t sequence;  // of the first request; repeated ones have greater ones
  int64_t until;
  bool is_sent;
};

/// Make an empty message of a type. False if the type has no fields to be found, or memory is
/// short. O(size of the message).
FM_INTERNAL bool fm_message_make(
  struct fm_typed_message * message, const struct fm_type_support * support);

/// Free a message, and zero it.
FM_INTERNAL void fm_message_free(struct fm_typed_message * message);

/// Read a message from its serialized form. False if the middleware cannot. O(size).
FM_INTERNAL bool fm_message_read(
  struct fm_typed_message * message, const struct fm_service_functions * functions,
  const uint8_t * payload, size_t size);

/// Make an empty request and response. The arguments outlive the call. False if the types have no
/// fields to be found, or memory is short. O(size of the messages).
FM_INTERNAL bool fm_call_make(
  struct fm_call * call, const struct fm_service_functions * functions,
  const struct fm_service_client * service);
FM_INTERNAL void fm_call_free(struct fm_call * call);

/// Begin a call; it ends at a time of CLOCK_MONOTONIC, or before. O(1).
FM_INTERNAL void fm_call_begin(struct fm_call * call, int64_t until);

/// Send the request once more, if it has been sent: to a server that has come meanwhile, too. The
/// first response to any of them is the answer. O(1).
FM_INTERNAL void fm_call_repeat(struct fm_call * call);

/// Send the request once there is a server, and look for the response; to be called until it does
/// not wait any more. O(responses that wait).
FM_INTERNAL enum fm_call_state fm_call_look(struct fm_call * call, int64_t now);

/// A field of a message, or of the message in its field `outer` if that is not NULL. NULL if there
/// is none of this kind. O(fields).
FM_INTERNAL void * fm_message_field(
  const struct fm_typed_message * message, const char * outer, const char * name,
  enum fm_field_kind kind);

/// The first message of a field that is a sequence of messages: part of `message`, not to be
/// freed. Its fields are NULL if there is none. O(fields).
FM_INTERNAL struct fm_typed_message fm_message_first(
  const struct fm_typed_message * message, const char * name);

/// The text of such a string field; "" if there is none.
FM_INTERNAL const char * fm_message_text(
  const struct fm_typed_message * message, const char * outer, const char * name);

#endif  // SERVICE_CALL_H_
