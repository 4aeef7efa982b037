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


/// service_call.c: see service_call.h for the contract.

#include "service_call.h"

#include <stdlib.h>
#include <string.h>

#include "serialized.h"

// ---- messages ----------------------------------------------------------------------------------

// rosidl_runtime_c__X__Sequence, and rosidl_runtime_c__String.
struct sequence
{
  void * data;
  size_t size;
  size_t capacity;
};

static const struct fm_message_members * members_of(const struct fm_type_support * support)
{
  const struct fm_type_support * found =
    support->func(support, "rosidl_typesupport_introspection_c");
  return found == NULL ? NULL : (const void *)found->data;
}

bool fm_message_make(
  struct fm_typed_message * message, const struct fm_type_support * support)
{
  message->support = support;
  message->members = members_of(support);
  message->memory = message->members == NULL ? NULL : calloc(1, message->members->size + 1u);
  if (message->memory != NULL) {
    message->members->init(message->memory, 0);  // ROSIDL_RUNTIME_C_MSG_INIT_ALL
  }
  return message->memory != NULL;
}

void fm_message_free(struct fm_typed_message * message)
{
  if (message->memory != NULL) {
    message->members->fini(message->memory);
    free(message->memory);
  }
  memset(message, 0, sizeof(*message));
}

bool fm_message_read(
  struct fm_typed_message * message, const struct fm_service_functions * functions,
  const uint8_t * payload, size_t size)
{
  struct fm_serialized bytes = {malloc(size + 1u), size, size, fm_malloc_allocator()};
  if (bytes.buffer == NULL) {
    return false;
  }
  memcpy(bytes.buffer, payload, size);
  const bool is_read = functions->deserialize(&bytes, message->support, message->memory) == 0;
  if (!is_read) {
    functions->forget_error();
  }
  free(bytes.buffer);
  return is_read;
}

static const struct fm_message_member * find_member(
  const struct fm_message_members * members, const char * name, enum fm_field_kind kind,
  bool is_array)
{
  for (uint32_t k = 0; members != NULL && k < members->member_count; ++k) {
    const struct fm_message_member * member = &members->members[k];
    if (strcmp(member->name, name) == 0 && member->type_id == kind &&
      member->is_array == is_array)
    {
      return member;
    }
  }
  return NULL;
}

void * fm_message_field(
  const struct fm_typed_message * message, const char * outer, const char * name,
  enum fm_field_kind kind)
{
  const struct fm_message_members * members = message->members;
  uint8_t * memory = message->memory;
  if (outer != NULL) {
    const struct fm_message_member * inner =
      find_member(members, outer, FM_MESSAGE_FIELD, false);
    if (inner == NULL) {
      return NULL;
    }
    memory += inner->offset;
    members = members_of(inner->members);
  }
  const struct fm_message_member * member = find_member(members, name, kind, false);
  return member == NULL ? NULL : memory + member->offset;
}

struct fm_typed_message fm_message_first(
  const struct fm_typed_message * message, const char * name)
{
  struct fm_typed_message first = {NULL, NULL, NULL};
  const struct fm_message_member * member =
    find_member(message->members, name, FM_MESSAGE_FIELD, true);
  if (member == NULL || member->array_size != 0) {
    return first;
  }
  const struct sequence * found =
    (const void *)((const uint8_t *)message->memory + member->offset);
  if (found->size > 0) {
    first.support = member->members;
    first.members = members_of(member->members);
    first.memory = found->data;
  }
  return first;
}

const char * fm_message_text(
  const struct fm_typed_message * message, const char * outer, const char * name)
{
  const struct sequence * text = fm_message_field(message, outer, name, FM_STRING_FIELD);
  return text == NULL || text->data == NULL ? "" : text->data;
}

// ---- the call ----------------------------------------------------------------------------------

bool fm_call_make(
  struct fm_call * call, const struct fm_service_functions * functions,
  const struct fm_service_client * service)
{
  call->functions = functions;
  call->service = service;
  const bool is_made = fm_message_make(&call->request, service->support->request_typesupport) &&
    fm_message_make(&call->response, service->support->response_typesupport);
  if (!is_made) {
    functions->forget_error();
  }
  return is_made;
}

void fm_call_free(struct fm_call * call)
{
  fm_message_free(&call->request);
  fm_message_free(&call->response);
}

void fm_call_begin(struct fm_call * call, int64_t until)
{
  call->until = until;
  call->is_sent = false;
}

static bool has_server(const struct fm_call * call)
{
  bool is_available = false;
  if (call->functions->is_available(
      call->service->node, call->service->client, &is_available) != 0)
  {
    call->functions->forget_error();
  }
  return is_available;
}

// Responses to earlier requests, which came too late, are dropped.
static bool take(struct fm_call * call)
{
  bool taken = true;
  while (taken) {
    struct fm_service_info info;
    memset(&info, 0, sizeof(info));
    taken = false;
    if (call->functions->take(call->service->client, &info, call->response.memory, &taken) != 0) {
      call->functions->forget_error();
    }
    if (taken && info.sequence_number >= call->sequence) {
      return true;
    }
  }
  return false;
}

void fm_call_repeat(struct fm_call * call)
{
  int64_t sequence = 0;
  if (call->is_sent &&
    call->functions->send(call->service->client, call->request.memory, &sequence) != 0)
  {
    call->functions->forget_error();
  }
}

enum fm_call_state fm_call_look(struct fm_call * call, int64_t now)
{
  if (!call->is_sent) {
    if (!has_server(call)) {
      return now >= call->until ? FM_CALL_NO_SERVER : FM_CALL_WAITS;
    }
    if (call->functions->send(
        call->service->client, call->request.memory, &call->sequence) != 0)
    {
      call->functions->forget_error();
      return FM_CALL_REFUSED;
    }
    call->is_sent = true;
  }
  return take(call) ? FM_CALL_ANSWERED : now >= call->until ? FM_CALL_NO_ANSWER : FM_CALL_WAITS;
}
