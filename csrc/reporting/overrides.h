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

/// overrides.h: the standard parameters for the quality of service of subscriptions.
///
/// Their names are those of rclcpp and rclpy, with the full name of the topic:
/// `qos_overrides./windspeed.subscription.reliability`. They override the bundle. What rcl itself
/// reads (/clock, /parameter_events, /rosout) is left to it, and so is every other parameter.
///
/// `given` are all parameters that were given. Any thread.

#ifndef OVERRIDES_H_
#define OVERRIDES_H_

#include "given.h"
#include "subscription.h"

#define FM_POLICIES 4u

/// A policy as a parameter shows it.
struct fm_shown_policy
{
  const char * name;
  const char * word;  // its value; "": it is the depth
  uint32_t depth;
  const char * note;  // after its description
};

/// Add a line about each override that cannot be one, or is of a publisher on a topic on which
/// violations are announced: `announced` are their full names. Returns whether there is none: when
/// memory is short, a line may be missing. O(given * topics).
FM_EXPORT bool fm_check_overrides(
  struct fm_lines * lines, const struct fm_given * given, uint32_t n,
  const char * const * announced, uint32_t n_announced);

/// Replace policies of a subscription by those that are given for its topic. O(given).
FM_EXPORT void fm_apply_overrides(
  struct fm_fixed_qos * fixed, const struct fm_given * given, uint32_t n, const char * topic);

/// Return the `k`-th policy of a subscription, of FM_POLICIES. O(1).
FM_EXPORT struct fm_shown_policy fm_show_policy(const struct fm_fixed_qos * fixed, uint32_t k);

/// Add a line about each override that no subscription uses. `subscribed`: full names of topics.
/// O(given * topics).
FM_EXPORT void fm_add_unused_overrides(
  struct fm_lines * lines, const struct fm_given * given, uint32_t n,
  const char * const * subscribed, uint32_t n_subscribed);

#endif  // OVERRIDES_H_
