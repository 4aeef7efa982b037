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

/// blackbox_writer.h: writes the last messages of an engine to a file at each violation.
///
/// A thread looks every `poll` whether a violation has begun, and then copies the messages from
/// the ring of blackbox.h to a file, while messages come. It waits for no other thread. Of one
/// writer, one thread calls all functions but fm_blackbox_writer_facts and
/// fm_blackbox_writer_take, which any one may call.

#ifndef BLACKBOX_WRITER_H_
#define BLACKBOX_WRITER_H_

#include "blackbox_file.h"
#include "engine.h"

struct fm_blackbox_writer;

/// What became of files and messages.
struct fm_blackbox_facts
{
  uint64_t written;     // files
  uint64_t failed;      // files
  uint64_t kept;        // messages, as these
  uint64_t left_out;
  uint64_t early;       // overwritten before their time
};

/// What is to be logged: a file was written, or the first one that could not be.
struct fm_blackbox_event
{
  char * path;          // of a file, or of the folder; the caller frees it
  int error;            // as in errno; 0: the file was written
};

/// Create the folder, write to it once, and take the memory. The options are copied; what they
/// point to outlives the writer. Returns 0, or an error as in errno: ENOMEM if there is not so
/// much memory. O(memory).
FM_EXPORT int fm_blackbox_writer_create(
  struct fm_blackbox_writer ** out, const struct fm_blackbox_options * options);

/// Keep the messages of an engine, which delivers none yet, and start the thread. False if none
/// can be started. Those of several topics with one name are kept once. O(topics^2).
FM_EXPORT bool fm_blackbox_writer_start(
  struct fm_blackbox_writer * writer, struct fm_engine * engine);

/// Write what is pending, and end the thread; a second call does nothing. Before the engine is
/// destroyed.
FM_EXPORT void fm_blackbox_writer_end(struct fm_blackbox_writer * writer);

/// End, and free it; no engine may use it any more.
FM_EXPORT void fm_blackbox_writer_destroy(struct fm_blackbox_writer * writer);

FM_EXPORT struct fm_blackbox_facts fm_blackbox_writer_facts(struct fm_blackbox_writer * writer);

/// Take the oldest event. False if there is none.
FM_INTERNAL bool fm_blackbox_writer_take(
  struct fm_blackbox_writer * writer, struct fm_blackbox_event * out);

#endif  // BLACKBOX_WRITER_H_
