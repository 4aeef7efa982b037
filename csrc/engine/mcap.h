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

/// mcap.h: writes MCAP files, which rosbag2, `rosbags` and Foxglove read (https://mcap.dev/spec).
///
/// Messages lie in uncompressed chunks with checksums and an index; no library is needed. A writer
/// belongs to one thread at a time. It writes to an open file from its place on, and neither
/// closes nor seeks it. After an error, of writing or for want of memory, nothing more is written.

#ifndef MCAP_H_
#define MCAP_H_

#include "fret_monitor.h"

struct fm_mcap;

/// A text about the whole file.
struct fm_mcap_text
{
  const char * name;
  const char * value;
};

/// Begin a file, at a descriptor. NULL if memory is short; other errors: fm_mcap_error. O(1).
FM_EXPORT struct fm_mcap * fm_mcap_create(int file);

/// Free a writer; the file is complete only after fm_mcap_end. O(channels).
FM_EXPORT void fm_mcap_destroy(struct fm_mcap * mcap);

/// Add a topic, and return its number: 0, 1 and so on. `definition` is that of the message and of
/// all within it (`ros2msg`), in pieces, ended by NULL; no piece: it is not known. All texts are
/// copied. O(channels + characters).
FM_EXPORT uint16_t fm_mcap_add_channel(
  struct fm_mcap * mcap, const char * topic, const char * type,
  const char * const * definition);

/// Add a serialized message of a channel. Times are nanoseconds, 0 or more; `sent` is by the
/// publisher's clock, 0: not known. O(size), or O(n log n) when the n messages of a chunk are
/// written, in the order of their times.
FM_EXPORT void fm_mcap_add_message(
  struct fm_mcap * mcap, uint16_t channel, int64_t time, int64_t sent, const uint8_t * data,
  size_t size);

/// Add `n` texts about the whole file. Ends a chunk.
FM_EXPORT void fm_mcap_add_metadata(
  struct fm_mcap * mcap, const char * name, const struct fm_mcap_text * texts, uint32_t n);

/// Write what waits, and the index. Nothing can be added any more.
FM_EXPORT void fm_mcap_end(struct fm_mcap * mcap);

/// The bytes of the file; before its end, about those it has if it ends now, or more. O(1).
FM_EXPORT uint64_t fm_mcap_size(const struct fm_mcap * mcap);

/// The first error, as in errno; 0: none. O(1).
FM_EXPORT int fm_mcap_error(const struct fm_mcap * mcap);

#endif  // MCAP_H_
