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

/// session_names.h: the names of topics and services that the sessions of a node use.

#ifndef SESSION_NAMES_H_
#define SESSION_NAMES_H_

#include "session.h"

/// Refuse gates in a circle, what else publishes on a topic of a gate, a lock or the node, and
/// actions that call the node itself; the sessions are configured. Topics of one bundle are
/// compared by fm_session_configure. Returns false, with the first problem logged.
/// O(names * (gates + locks + handlers)).
bool fm_refuse_shared_names(const struct fm_session * sessions, uint32_t n);

#endif  // SESSION_NAMES_H_
