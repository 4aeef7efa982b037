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


/// hot_path.h: from the middleware to a watch and back, without Python.
///
/// A source takes the messages of one subscription inside the middleware's new-message callback
/// and delivers them. An announcer is one thread that publishes what a watch queues: publishing
/// inside the callback hung at the end of a process.
///
/// What is called of the middleware (rmw, ROS 2 Jazzy) is found by name in what the process has
/// loaded, and declared here, so that neither a build nor a robot needs its headers. A test
/// compares the structs with the headers where there are some.

#ifndef HOT_PATH_H_
#define HOT_PATH_H_

#include "watch.h"

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
  /// rcutils_reset_error
  void (* forget_error)(void);
};

struct fm_source;

/// Start to deliver the messages of a subscription (an rmw_subscription_t that nobody else takes
/// from) as those of a topic; those that it holds already come first. The watch and the middleware
/// outlive the source; the subscription may be destroyed after fm_source_stop. NULL if the
/// middleware has no such callback, or memory is short. Not to be called from a callback.
FM_EXPORT struct fm_source * fm_source_start(
  struct fm_watch * watch, const struct fm_middleware * middleware, void * subscription,
  uint32_t topic);

/// Take what is there and no callback told of, at most 1000 messages. A middleware that tells of
/// every message needs it never; but one message overlooked would delay all that follow.
FM_EXPORT void fm_source_drain(struct fm_source * source);

/// A new subscription is there: what comes by this one may come by that one too (fm_watch_overlap).
FM_EXPORT void fm_source_retire(struct fm_source * source);

/// Messages that were sent and never came (losses.h), until it was retired.
FM_EXPORT uint64_t fm_source_lost(const struct fm_source * source);

/// End it; waits for a callback under way. Nothing is delivered after it. Frees the source.
FM_EXPORT void fm_source_stop(struct fm_source * source);

struct fm_announcer;

/// Start a thread that publishes a std_msgs/msg/Empty for each violation of the watch, in order:
/// by `publishers` (rmw_publisher_t, one a requirement, in the manifest's order; copied). NULL if
/// no thread can be made, or memory is short. The watch and publishers outlive the announcer.
FM_EXPORT struct fm_announcer * fm_announcer_start(
  struct fm_watch * watch, const struct fm_middleware * middleware, void * const * publishers,
  uint32_t n_publishers);

/// Violations that could not be published.
FM_EXPORT uint64_t fm_announcer_failures(const struct fm_announcer * announcer);

/// Wait for the thread, which ends once the watch is closed and all is published. Frees it.
FM_EXPORT void fm_announcer_join(struct fm_announcer * announcer);

#ifdef __cplusplus
}
#endif

#endif  // HOT_PATH_H_
