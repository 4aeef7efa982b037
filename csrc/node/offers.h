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

/// offers.h: the quality of service of a subscription that receives from every publisher.
///
/// A subscription matches a publisher only if it requests no more than the publisher offers. So it
/// requests the most that all known publishers offer, and the least while there is none. What the
/// bundle or a `qos_overrides` fixes stays. Functions cannot fail.

#ifndef OFFERS_H_
#define OFFERS_H_

#include <rmw/topic_endpoint_info_array.h>
#include <rmw/types.h>

#include "node_table.h"

#define FM_USUAL_DEPTH 100u  // messages: 0.1 s of a topic at 1 kHz

/// The profile of a subscription that matches all publishers of `type` among these. O(publishers).
rmw_qos_profile_t fm_wanted_profile(
  const rmw_topic_endpoint_info_array_t * publishers, const char * type,
  const struct fm_fixed_qos * fixed);

/// Whether a subscription requests more than a publisher offers, of either policy.
bool fm_misfits_reliability(
  const rmw_qos_profile_t * subscription, const rmw_qos_profile_t * offer);
bool fm_misfits_durability(
  const rmw_qos_profile_t * subscription, const rmw_qos_profile_t * offer);

/// Whether a subscription requests no more than a publisher offers.
bool fm_matches(const rmw_qos_profile_t * subscription, const rmw_qos_profile_t * offer);

/// Whether two subscriptions request the same reliability and durability.
bool fm_same_request(const rmw_qos_profile_t * one, const rmw_qos_profile_t * other);

/// Reliability and durability as text.
const char * fm_describe_profile(const rmw_qos_profile_t * profile);

#endif  // OFFERS_H_
