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

/// blackbox_file.h: a file of the black box that is being written: the messages around violations.
///
/// It has another name until it is complete. One thread at a time may use it.

#ifndef BLACKBOX_FILE_H_
#define BLACKBOX_FILE_H_

#include "blackbox.h"

/// How long a file goes on after the last violation in it, and after the first at most.
#define FM_BLACKBOX_AFTER_NS 2000000000
#define FM_BLACKBOX_LONGEST_NS 60000000000

/// How often a writer looks for violations and messages.
#define FM_BLACKBOX_POLL_NS 100000000

/// A topic of the node, by its full name.
struct fm_blackbox_topic
{
  const char * name;
  const char * type;                // package/msg/Name
  const char * const * definition;  // as of fm_mcap_add_channel
};

/// A requirement: its id, and what names of files have of it.
struct fm_blackbox_requirement
{
  const char * id;
  const char * name;
};

/// All that it points to outlives what is made from it.
struct fm_blackbox_options
{
  const char * folder;
  int64_t lasts;        // ns before a violation that a file has
  uint64_t memory;      // bytes
  uint64_t disk;        // bytes of all files in the folder, at most
  uint64_t files;       // their number, at most
  int64_t after;        // FM_BLACKBOX_AFTER_NS, and FM_BLACKBOX_POLL_NS; shorter for tests
  int64_t poll;
  const char * node;    // its full name
  const char * bundle;
  const struct fm_blackbox_topic * topics;  // of the engine; then that of the message at the end
  uint32_t n_topics;    // without the last one
  const struct fm_blackbox_requirement * requirements;
};

struct fm_blackbox_file;

/// The first topic with the name of topic `k`, `k` itself or one before it: a topic that has
/// several `where` is there several times. O(topics).
FM_INTERNAL uint32_t fm_blackbox_first(
  const struct fm_blackbox_options * options, uint32_t k);

/// Begin a file at violations, with a part of its name, which says when. Other nodes may use the
/// folder, so no file is opened that exists, or that is going to have a name that exists. NULL
/// with `*error` as in errno. O(topics * topics).
FM_INTERNAL struct fm_blackbox_file * fm_blackbox_file_open(
  const struct fm_blackbox_options * options, struct fm_blackbox * box,
  const struct fm_occurrences * found, const char * stamp, int * error);

/// Go on after later violations; false if that would be too long: finish it, and begin another.
FM_INTERNAL bool fm_blackbox_file_join(
  struct fm_blackbox_file * file, const struct fm_occurrences * found);

/// Copy the messages that came since the last call, as far as they belong to the file. At `steady`
/// (CLOCK_MONOTONIC), before the call, the node's time was `now`. O(bytes of the messages).
FM_INTERNAL void fm_blackbox_file_copy(
  struct fm_blackbox_file * file, int64_t steady, int64_t now);

/// Whether nothing is added any more, at a time of CLOCK_MONOTONIC.
FM_INTERNAL bool fm_blackbox_file_is_complete(
  const struct fm_blackbox_file * file, int64_t steady);

/// The bytes of the file, if it were complete.
FM_INTERNAL uint64_t fm_blackbox_file_size(const struct fm_blackbox_file * file);

/// Complete the file, and give it its name. Returns 0, or the first error, as in errno.
FM_INTERNAL int fm_blackbox_file_finish(struct fm_blackbox_file * file);

/// Its path when it is complete.
FM_INTERNAL const char * fm_blackbox_file_path(const struct fm_blackbox_file * file);

/// The first error so far, as in errno; 0: none.
FM_INTERNAL int fm_blackbox_file_error(const struct fm_blackbox_file * file);

/// Free it. If it was not finished, the file is removed.
FM_INTERNAL void fm_blackbox_file_close(struct fm_blackbox_file * file);

#endif  // BLACKBOX_FILE_H_
