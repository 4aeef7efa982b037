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

/// offers.c: see offers.h for the contract.

#include "offers.h"

#include <rmw/qos_profiles.h>
#include <string.h>

static bool is_reliable(const rmw_qos_profile_t * profile)
{
  return profile->reliability == RMW_QOS_POLICY_RELIABILITY_RELIABLE;
}

static bool is_durable(const rmw_qos_profile_t * profile)
{
  return profile->durability == RMW_QOS_POLICY_DURABILITY_TRANSIENT_LOCAL;
}

static bool all_offer(
  const rmw_topic_endpoint_info_array_t * publishers, const char * type,
  bool (* offers)(const rmw_qos_profile_t * profile))
{
  size_t n = 0;
  for (size_t k = 0; k < publishers->size; ++k) {
    const rmw_topic_endpoint_info_t * publisher = &publishers->info_array[k];
    if (strcmp(publisher->topic_type, type) == 0) {
      n += 1u;
      if (!offers(&publisher->qos_profile)) {
        return false;
      }
    }
  }
  return n > 0;
}

static bool chosen(enum fm_choice choice, bool is_offered)
{
  return choice == FM_STRONGER || (choice == FM_FOLLOW && is_offered);
}

rmw_qos_profile_t fm_wanted_profile(
  const rmw_topic_endpoint_info_array_t * publishers, const char * type,
  const struct fm_fixed_qos * fixed)
{
  rmw_qos_profile_t profile = rmw_qos_profile_default;
  profile.depth = fixed->depth == 0u ? FM_USUAL_DEPTH : fixed->depth;
  profile.history = fixed->history == FM_STRONGER ?
    RMW_QOS_POLICY_HISTORY_KEEP_ALL : RMW_QOS_POLICY_HISTORY_KEEP_LAST;
  profile.reliability = chosen(fixed->reliability, all_offer(publishers, type, is_reliable)) ?
    RMW_QOS_POLICY_RELIABILITY_RELIABLE : RMW_QOS_POLICY_RELIABILITY_BEST_EFFORT;
  profile.durability = chosen(fixed->durability, all_offer(publishers, type, is_durable)) ?
    RMW_QOS_POLICY_DURABILITY_TRANSIENT_LOCAL : RMW_QOS_POLICY_DURABILITY_VOLATILE;
  return profile;
}

bool fm_misfits_reliability(
  const rmw_qos_profile_t * subscription, const rmw_qos_profile_t * offer)
{
  return is_reliable(subscription) && !is_reliable(offer);
}

bool fm_misfits_durability(
  const rmw_qos_profile_t * subscription, const rmw_qos_profile_t * offer)
{
  return is_durable(subscription) && !is_durable(offer);
}

bool fm_matches(const rmw_qos_profile_t * subscription, const rmw_qos_profile_t * offer)
{
  return !fm_misfits_reliability(subscription, offer) &&
         !fm_misfits_durability(subscription, offer);
}

bool fm_same_request(const rmw_qos_profile_t * one, const rmw_qos_profile_t * other)
{
  return one->reliability == other->reliability && one->durability == other->durability;
}

const char * fm_describe_profile(const rmw_qos_profile_t * profile)
{
  if (is_reliable(profile)) {
    return is_durable(profile) ? "reliable, transient local" : "reliable, volatile";
  }
  return is_durable(profile) ? "best effort, transient local" : "best effort, volatile";
}
