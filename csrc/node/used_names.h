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

/// used_names.h: the topics and services that the bundles of a node use, after remapping.

#ifndef USED_NAMES_H_
#define USED_NAMES_H_

#include "log.h"
#include "node_table.h"

/// Refuse gates in a circle, what else publishes on a topic of a gate, a lock or the node, actions
/// that call the node itself, and two types of one topic or service. Topics of one bundle that are
/// one are left to fm_session_configure. Returns false, with the problems logged.
/// O(names * names).
bool fm_refuse_names(const struct fm_node * node, const struct fm_node_tables * tables);

#endif  // USED_NAMES_H_
