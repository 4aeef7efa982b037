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

/// instance_lines.h: what is reported of requirements of which there is one for each key.
///
/// As review.h: one thread at a time.

#ifndef INSTANCE_LINES_H_
#define INSTANCE_LINES_H_

#include "review_parts.h"

/// The input of the bundle's scope that a requirement reads; UINT32_MAX: one with a key. O(1).
static inline uint32_t fm_bundle_input(
  const struct fm_report_table * table, const struct fm_report_requirement * about, uint32_t k)
{
  return about->kind == FM_BUNDLE ? about->inputs[k] :
         table->kinds[about->kind].shared[about->inputs[k]];
}

/// The inputs with a key of a kind that a topic feeds.
static inline const struct fm_topic * fm_keyed_inputs(
  const struct fm_report_table * table, uint32_t kind, uint32_t topic)
{
  return &table->kinds[kind].keyed[topic];
}

/// Whether a requirement of instances is violated, with the first keys that violate it. Returns
/// the level of its status. O(keys that are named).
FM_INTERNAL enum fm_status_level fm_describe_instances(
  const struct fm_review * review, uint32_t requirement, struct fm_text * message);

/// Add how many instances there are, and what became of the others. O(1).
FM_INTERNAL void fm_add_instances(
  const struct fm_review * review, uint32_t requirement, struct fm_status * status);

/// Add the key of the instance whose margin is the least: robot=alpha. O(requirements).
FM_INTERNAL void fm_add_nearest(
  const struct fm_review * review, uint32_t requirement, struct fm_text * text);

#endif  // INSTANCE_LINES_H_
