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

/// overrides.c: see overrides.h for the contract.

#include "overrides.h"

#include <string.h>
#include <strings.h>

#include "spelling.h"
#include "words.h"

#define AVAILABLE "best_available"

// A policy; its words are in the order of `enum fm_choice`.
struct policy
{
  const char * name;
  const char * words[3];
  const char * wanted;
};

static const struct policy POLICIES[FM_POLICIES] = {
  {"reliability", {AVAILABLE, "best_effort", "reliable"},
    "one of reliable, best_effort, " AVAILABLE},
  {"durability", {AVAILABLE, "volatile", "transient_local"},
    "one of transient_local, volatile, " AVAILABLE},
  {"history", {"keep_last", "keep_last", "keep_all"}, "one of keep_last, keep_all"},
  {"depth", {"", "", ""}, FM_WORDS_COUNT}};
enum { DEPTH = FM_POLICIES - 1u };

enum kind { OTHER, MALFORMED, OF_ID, OF_SUBSCRIPTION, OF_PUBLISHER };

// An override, by its name: `topic` ends at a dot.
struct override
{
  enum kind kind;
  const char * topic;
  size_t length;
  const char * policy;
};

// ---- names -------------------------------------------------------------------------------------

static bool is_word(const char * text, size_t length, const char * word)
{
  return strlen(word) == length && memcmp(text, word, length) == 0;
}

static bool begins_with(const char * text, const char * prefix)
{
  return strncmp(text, prefix, strlen(prefix)) == 0;
}

static bool is_among(const char * text, size_t length, const char * const * words, uint32_t n)
{
  uint32_t k = 0;
  while (k < n && !is_word(text, length, words[k])) {
    k += 1u;
  }
  return k < n;
}

static enum kind kind_of(const struct override * item, const char * endpoint, size_t length)
{
  static const char * const OF_RCL[] = {"/clock", "/parameter_events", "/rosout"};
  if (is_among(item->topic, item->length, OF_RCL, 3)) {
    return OTHER;
  }
  if (item->topic[0] != '/' || item->policy == NULL || strchr(item->policy, '.') != NULL) {
    return MALFORMED;
  }
  return is_word(endpoint, length, "subscription") ? OF_SUBSCRIPTION :
         begins_with(endpoint, "subscription_") ? OF_ID :
         is_word(endpoint, length, "publisher") || begins_with(endpoint, "publisher_") ?
         OF_PUBLISHER : MALFORMED;
}

static struct override read_name(const char * name)
{
  struct override item = {OTHER, name, 0, NULL};
  if (begins_with(name, FM_WORDS_OVERRIDES)) {
    item.topic = name + strlen(FM_WORDS_OVERRIDES);
    item.length = strcspn(item.topic, ".");
    const char * endpoint = item.topic + item.length + (item.topic[item.length] != '\0' ? 1 : 0);
    const size_t length = strcspn(endpoint, ".");
    item.policy = endpoint[length] == '\0' ? NULL : endpoint + length + 1;
    item.kind = kind_of(&item, endpoint, length);
  }
  return item;
}

// ---- values ------------------------------------------------------------------------------------

static uint32_t policy_of(const struct override * item)
{
  uint32_t k = 0;
  while (k < FM_POLICIES && strcmp(item->policy, POLICIES[k].name) != 0) {
    k += 1u;
  }
  return k;
}

static enum fm_choice * choice_of(struct fm_fixed_qos * fixed, uint32_t policy)
{
  return policy == 0 ? &fixed->reliability : policy == 1u ? &fixed->durability : &fixed->history;
}

// Apply a value. Returns false if it is none of the policy.
static bool apply(struct fm_fixed_qos * fixed, uint32_t policy, const struct fm_given * given)
{
  if (policy == DEPTH && given->type == FM_WHOLE && given->whole > 0 && given->whole <= INT32_MAX)
  {
    fixed->depth = (uint32_t)given->whole;
    return true;
  }
  for (uint32_t k = 0; policy < DEPTH && given->type == FM_WORD && k < 3u; ++k) {
    if (strcasecmp(given->word, POLICIES[policy].words[k]) == 0) {
      *choice_of(fixed, policy) = (enum fm_choice)k;
      return true;
    }
  }
  return false;
}

// Returns whether it can be used; adds a line if not.
static bool check(
  struct fm_lines * lines, const struct fm_given * given, const struct override * item)
{
  static const char * const TIMED[] = {
    "deadline", "lifespan", "liveliness", "liveliness_lease_duration"};
  struct fm_fixed_qos unused;
  const uint32_t policy = policy_of(item);
  if (is_among(item->policy, strlen(item->policy), TIMED, 4)) {
    fm_lines_add(lines, FM_ERROR,
      "parameter '%s' cannot be given: it would keep out publishers that do not offer it; use the "
      "`timeout` of the input in the bundle", given->name);
  } else if (policy == FM_POLICIES) {
    fm_lines_add(lines, FM_ERROR,
      "parameter '%s' is none: there are reliability, durability, history, depth", given->name);
  } else if (apply(&unused, policy, given)) {
    return true;
  } else {
    struct fm_text text = {NULL, 0, 0};
    fm_text_refuse(&text, given, POLICIES[policy].wanted);
    fm_lines_add(lines, FM_ERROR, "%s", fm_text_get(&text));
    fm_text_free(&text);
  }
  return false;
}

// ---- all that are given ------------------------------------------------------------------------

bool fm_check_overrides(
  struct fm_lines * lines, const struct fm_given * given, uint32_t n,
  const char * const * announced, uint32_t n_announced)
{
  bool is_good = true;
  for (uint32_t k = 0; k < n; ++k) {
    const struct override item = read_name(given[k].name);
    bool is_refused = true;
    if (item.kind == MALFORMED) {
      fm_lines_add(lines, FM_ERROR,
        "parameter '%s' is none; write '" FM_WORDS_OVERRIDES "/TOPIC.subscription.POLICY', with "
        "the topic's full name", given[k].name);
    } else if (item.kind == OF_ID) {
      fm_lines_add(lines, FM_ERROR,
        "parameter '%s' is none: subscriptions here have no id, write '.subscription.'",
        given[k].name);
    } else if (item.kind == OF_SUBSCRIPTION) {
      is_refused = !check(lines, &given[k], &item);
    } else if (item.kind == OF_PUBLISHER &&
      is_among(item.topic, item.length, announced, n_announced))
    {
      fm_lines_add(lines, FM_ERROR,
        "parameter '%s' cannot be given: violations are announced reliable and volatile; their "
        "depth is -p handler_depth:=NUMBER", given[k].name);
    } else {
      is_refused = false;
    }
    is_good = is_good && !is_refused;
  }
  return is_good;
}

void fm_apply_overrides(
  struct fm_fixed_qos * fixed, const struct fm_given * given, uint32_t n, const char * topic)
{
  for (uint32_t k = 0; k < n; ++k) {
    const struct override item = read_name(given[k].name);
    if (item.kind == OF_SUBSCRIPTION && is_word(item.topic, item.length, topic)) {
      (void)apply(fixed, policy_of(&item), &given[k]);
    }
  }
}

struct fm_shown_policy fm_show_policy(const struct fm_fixed_qos * fixed, uint32_t k)
{
  const struct policy * policy = &POLICIES[k];
  struct fm_fixed_qos copy = *fixed;
  return (struct fm_shown_policy) {
    policy->name, policy->words[k == DEPTH ? 0 : *choice_of(&copy, k)],
    fixed->depth == 0 ? FM_USUAL_DEPTH : fixed->depth,
    strcmp(policy->words[0], AVAILABLE) == 0 ? "; " AVAILABLE ": as its publishers offer" :
    ""};
}

void fm_add_unused_overrides(
  struct fm_lines * lines, const struct fm_given * given, uint32_t n,
  const char * const * subscribed, uint32_t n_subscribed)
{
  for (uint32_t k = 0; k < n; ++k) {
    const struct override item = read_name(given[k].name);
    if (item.kind == OF_PUBLISHER) {
      fm_lines_add(
        lines, FM_WARN, FM_WORDS_IGNORED, given[k].name, "only subscriptions can be changed");
    } else if (item.kind == OF_SUBSCRIPTION &&
      !is_among(item.topic, item.length, subscribed, n_subscribed))
    {
      struct fm_text topic = {NULL, 0, 0};
      struct fm_text hint = {NULL, 0, 0};
      struct fm_text why = {NULL, 0, 0};
      fm_text_add(&topic, "%.*s", (int)item.length, item.topic);
      const bool has_hint =
        fm_text_add_hint(&hint, fm_text_get(&topic), subscribed, n_subscribed);
      fm_text_add(&why, "the topic %s is not subscribed to%s%s", fm_text_get(&topic),
        has_hint ? "; " : "", fm_text_get(&hint));
      fm_lines_add(lines, FM_WARN, FM_WORDS_IGNORED, given[k].name, fm_text_get(&why));
      fm_text_free(&topic);
      fm_text_free(&hint);
      fm_text_free(&why);
    }
  }
}
