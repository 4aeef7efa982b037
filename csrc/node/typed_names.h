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

/// typed_names.h: one type for each topic and service of a node, after remapping.

#ifndef TYPED_NAMES_H_
#define TYPED_NAMES_H_

#include "log.h"
#include "node_table.h"

/// Refuse topics and services that inputs, gates, locks, actions and the node itself use with
/// different types. Returns false, with the problems logged. O(names * names).
bool fm_refuse_two_types(const struct fm_node * node, const struct fm_node_tables * tables);

#endif  // TYPED_NAMES_H_
