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

/// records.h: a recording, given to an engine many messages at a time.
///
/// One call costs a lock and a call from Python; the messages in it cost what fm_engine_message
/// costs. Periods and deadlines between two records are taken as they come, however far apart the
/// records are.

#ifndef RECORDS_H_
#define RECORDS_H_

#include "engine.h"

/// Messages of a recording, in the order of their times, one after another in `bytes`. The caller
/// owns all of it; only `next`, `place`, `key_place` and `counts` are written.
struct fm_records
{
  const uint32_t * topics;  // of the engine; an index out of range is passed over
  const int64_t * times;    // ns: when each was received
  const uint64_t * sizes;   // of each, in bytes
  const uint8_t * bytes;
  const uint8_t * keys;      // in the names of their topics, one after another; NULL: none has one
  const uint32_t * key_sizes;  // of each, in bytes
  uint64_t n;
  uint64_t next;            // the one to deliver next; 0 at first
  uint64_t place;           // where it begins in `bytes`; 0 at first
  uint64_t key_place;       // where its key begins in `keys`; 0 at first
  uint64_t * counts;        // a topic: how many were delivered so far
};

/// Things that are taken without a message before one record: then the time is moved at once, and
/// what is over 1000 periods is missed (fm_time_counts). A jump of years in a damaged recording
/// would take days.
#define FM_MOST_BETWEEN_RECORDS 100000000

/// Deliver records, while the time is told: before each, what is due before it is taken. Stops
/// when `most` violations are queued; take them, and call it again. Returns whether all records
/// are delivered. Any thread; for each record O(fields to read, what is due, operations of the
/// groups that step).
FM_EXPORT bool fm_engine_records(
  struct fm_engine * engine, struct fm_records * records, uint32_t most);

/// Take rows of a trace while the time is told, as fm_engine_records does with messages; all that
/// is due before a row is taken before it. The first row begins the time. The engine's inputs have
/// no timeouts, and it has no period. Any thread; for each row O(what is due + inputs +
/// operations).
FM_EXPORT bool fm_engine_rows(struct fm_engine * engine, struct fm_rows * rows, uint32_t most);

/// While the time is told: as fm_engine_advance, but takes all that is due until then, one after
/// another, and stops when `most` violations are queued. Returns whether the time is `now`. O(what
/// is due).
FM_EXPORT bool fm_engine_advance_all(struct fm_engine * engine, int64_t now, uint32_t most);

/// The latest stamp of the messages that wait for their time (engine.h); INT64_MIN if none does.
FM_EXPORT int64_t fm_engine_latest_waiting(struct fm_engine * engine);

#endif  // RECORDS_H_
