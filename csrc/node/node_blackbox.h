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

/// node_blackbox.h: the black box of the node: what its writer (blackbox_writer.h) must know.
///
/// The main thread only.

#ifndef NODE_BLACKBOX_H_
#define NODE_BLACKBOX_H_

#include "blackbox_lines.h"
#include "log.h"
#include "node_table.h"

/// What the parameters give.
struct fm_blackbox_settings
{
  const char * folder;  // empty: there is no black box
  double seconds;
  uint64_t memory;
  uint64_t files;
  uint64_t disk;
};

/// Zeroed before fm_node_blackbox_begin; fm_node_blackbox_end frees all of it.
struct fm_node_blackbox
{
  struct fm_node * node;
  struct fm_blackbox_writer * writer;  // NULL: there is no black box
  struct fm_blackbox_options options;
  struct fm_blackbox_topic * topics;
  struct fm_blackbox_requirement * requirements;
  char * folder;                       // its whole path
  char * end_topic;                    // the full name of that with the end of the recording
};

/// Prepare the folder and the memory. `names`: the full names of the topics of the table; they
/// outlive it. Returns false, with the reason logged. O(topics + memory).
bool fm_node_blackbox_begin(
  struct fm_node_blackbox * box, struct fm_node * node, const struct fm_node_table * table,
  char * const * names, const struct fm_blackbox_settings * settings);

/// Keep the messages of an engine, which delivers none yet. Returns false if no thread can be
/// started.
bool fm_node_blackbox_start(struct fm_node_blackbox * box, struct fm_engine * engine);

/// Log what was written since the last call.
void fm_node_blackbox_look(struct fm_node_blackbox * box);

/// Write what is pending, and log it. Before the engine is destroyed.
void fm_node_blackbox_stop(struct fm_node_blackbox * box);

void fm_node_blackbox_end(struct fm_node_blackbox * box);

#endif  // NODE_BLACKBOX_H_
