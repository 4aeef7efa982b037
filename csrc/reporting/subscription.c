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

/// subscription.c: see subscription.h for the contract.

#include "subscription.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

// In a handover the old subscription is kept until all publishers have discovered the new one.
#define OVERLAP_NS (2 * FM_SECOND)      // until the old subscription is closed, at most
#define ASSURED_NS (FM_SECOND / 2)      // until it is closed if the new one has matched them
#define GRACE_NS FM_SECOND              // after it was closed: a queue may still hold duplicates
#define NAMED_NS (2 * FM_SECOND)        // until a publisher is logged without the name of its node
#define LOSSES_NS (10 * FM_SECOND)      // between two lines about lost messages
#define UNNAMED "_NODE_NAME_UNKNOWN_"   // of the middleware: it discovers the node a moment later

struct publisher
{
  uint8_t gid[FM_GID_BYTES];
  const char * who;   // the full name of its node, or that it is not known
  const char * type;
  bool is_named;
  bool is_ours;  // of the topic's type
  bool is_reliable;
  bool is_durable;
  bool is_logged;
  int64_t since;
};

struct fm_subscription
{
  struct fm_memory names;  // these two
  const char * topic;
  const char * type;
  struct fm_fixed_qos fixed;
  struct fm_request current;
  struct fm_request wanted;
  struct fm_memory noted;         // the next, and what they point to
  struct publisher * publishers;  // those of the last review
  uint32_t n_publishers;
  bool has_new;           // publishers for which the subscription was not checked yet
  bool is_subscribing;    // decided, and not concluded
  int64_t * ends;         // of each replaced subscription, the oldest first: when it is closed
  uint32_t n_replaced;
  int64_t handover_ends;  // 0: no handover
  int64_t retry;          // between two attempts; 0: none failed
  int64_t retry_at;
  uint64_t logged_losses;
  int64_t next_loss_line;
  int64_t absent_since;   // no publisher has been there; 0: one is
  struct fm_text logged_types;
  struct fm_text unmatched;
  struct fm_text other_types;
};

// ---- quality of service ------------------------------------------------------------------------

static bool is_chosen(enum fm_choice choice, bool is_offered)
{
  return choice == FM_STRONGER || (choice == FM_FOLLOW && is_offered);
}

static struct fm_request wanted_request(const struct fm_subscription * state)
{
  const uint32_t n = fm_subscription_publishers(state).n;
  bool are_reliable = n > 0;
  bool are_durable = n > 0;
  for (uint32_t k = 0; k < state->n_publishers; ++k) {
    const struct publisher * publisher = &state->publishers[k];
    are_reliable = are_reliable && (publisher->is_reliable || !publisher->is_ours);
    are_durable = are_durable && (publisher->is_durable || !publisher->is_ours);
  }
  return (struct fm_request) {
    is_chosen(state->fixed.reliability, are_reliable),
    is_chosen(state->fixed.durability, are_durable),
    state->fixed.history == FM_STRONGER,
    state->fixed.depth == 0 ? FM_USUAL_DEPTH : state->fixed.depth};
}

static bool is_same(const struct fm_request * one, const struct fm_request * other)
{
  return one->is_reliable == other->is_reliable && one->is_durable == other->is_durable;
}

static bool is_matched(const struct fm_request * request, const struct publisher * publisher)
{
  return publisher->is_reliable >= request->is_reliable &&
         publisher->is_durable >= request->is_durable;
}

static bool is_missed(const struct fm_request * request, const struct publisher * publisher)
{
  return publisher->is_ours && !is_matched(request, publisher);
}

static const char * described(bool is_reliable, bool is_durable)
{
  if (is_reliable) {
    return is_durable ? "reliable, transient local" : "reliable, volatile";
  }
  return is_durable ? "best effort, transient local" : "best effort, volatile";
}

static const char * described_request(const struct fm_request * request)
{
  return described(request->is_reliable, request->is_durable);
}

// ---- the state ---------------------------------------------------------------------------------

struct fm_subscription * fm_subscription_create(
  const char * topic, const char * type, const struct fm_fixed_qos * fixed)
{
  struct fm_subscription * state = calloc(1, sizeof(*state));
  if (state == NULL) {
    return NULL;
  }
  state->topic = fm_reserve_text(&state->names, topic);
  state->type = fm_reserve_text(&state->names, type);
  state->fixed = *fixed;
  state->current = wanted_request(state);
  if (state->names.is_short) {
    fm_subscription_destroy(state);
    return NULL;
  }
  return state;
}

void fm_subscription_destroy(struct fm_subscription * state)
{
  if (state == NULL) {
    return;
  }
  fm_memory_free(&state->noted);
  fm_memory_free(&state->names);
  fm_text_free(&state->logged_types);
  fm_text_free(&state->unmatched);
  fm_text_free(&state->other_types);
  free(state->ends);
  free(state);
}

struct fm_request fm_subscription_request(const struct fm_subscription * state)
{
  return state->current;
}

struct fm_publishers fm_subscription_publishers(const struct fm_subscription * state)
{
  uint32_t n = 0;
  for (uint32_t k = 0; k < state->n_publishers; ++k) {
    n += state->publishers[k].is_ours ? 1u : 0u;
  }
  return (struct fm_publishers) {
    n, fm_text_get(&state->unmatched), fm_text_get(&state->other_types)};
}

// ---- decisions ---------------------------------------------------------------------------------

static const struct publisher * find(const struct fm_subscription * state, const uint8_t * gid)
{
  for (uint32_t k = 0; k < state->n_publishers; ++k) {
    if (memcmp(state->publishers[k].gid, gid, FM_GID_BYTES) == 0) {
      return &state->publishers[k];
    }
  }
  return NULL;
}

bool fm_offer_is_unnamed(const struct fm_offer * offer)
{
  return strcmp(offer->node, UNNAMED) == 0;
}

void fm_offer_name(struct fm_text * text, const struct fm_offer * offer)
{
  if (fm_offer_is_unnamed(offer)) {
    fm_text_add(text, "a publisher of no known node");
  } else {
    fm_text_add(text, "%s/%s", strcmp(offer->name_space, "/") == 0 ? "" : offer->name_space,
      offer->node);
  }
}

static void note_publisher(
  const struct fm_subscription * state, const struct fm_offer * offer, int64_t now,
  struct fm_memory * memory, struct publisher * noted)
{
  const struct publisher * before = find(state, offer->gid);
  struct fm_text name = {NULL, 0, 0};
  fm_offer_name(&name, offer);
  *noted = (struct publisher) {
    .who = fm_reserve_text(memory, fm_text_get(&name)),
    .type = fm_reserve_text(memory, offer->type),
    .is_named = !fm_offer_is_unnamed(offer),
    .is_ours = strcmp(offer->type, state->type) == 0,
    .is_reliable = offer->is_reliable, .is_durable = offer->is_durable,
    .is_logged = before != NULL && before->is_logged,
    .since = before != NULL ? before->since : now};
  memcpy(noted->gid, offer->gid, FM_GID_BYTES);
  fm_text_free(&name);
}

// Remember these publishers, in place of those of the last review. Returns false if memory is
// short.
static bool note_publishers(
  struct fm_subscription * state, const struct fm_offer * offers, uint32_t n, int64_t now)
{
  bool has_new = state->has_new;
  struct fm_memory memory = {NULL, false};
  struct publisher * noted = fm_reserve(&memory, n, sizeof(*noted));
  for (uint32_t k = 0; noted != NULL && k < n; ++k) {
    note_publisher(state, &offers[k], now, &memory, &noted[k]);
    has_new = has_new || (noted[k].is_ours && find(state, noted[k].gid) == NULL);
  }
  if (memory.is_short) {
    fm_memory_free(&memory);
    return false;
  }
  fm_memory_free(&state->noted);
  state->noted = memory;
  state->publishers = noted;
  state->n_publishers = n;
  state->has_new = has_new;
  return true;
}

// Those that were replaced end in the order in which they were. A publisher that is kept out by
// what is fixed delays none.
static uint32_t end_replaced(struct fm_subscription * state, uint64_t matched, int64_t now)
{
  uint64_t n_matching = 0;
  uint32_t n = 0;
  for (uint32_t k = 0; k < state->n_publishers; ++k) {
    const struct publisher * publisher = &state->publishers[k];
    n_matching += publisher->is_ours && is_matched(&state->wanted, publisher) ? 1u : 0u;
  }
  const int64_t early = matched >= n_matching ? OVERLAP_NS - ASSURED_NS : 0;
  while (n < state->n_replaced && now >= state->ends[n] - early) {
    n += 1u;
  }
  if (n > 0) {
    state->n_replaced -= n;
    memmove(state->ends, state->ends + n, state->n_replaced * sizeof(*state->ends));
    state->handover_ends = now + GRACE_NS;
  }
  return n;
}

static bool has_room(struct fm_subscription * state)
{
  int64_t * ends = realloc(state->ends, (state->n_replaced + 1u) * sizeof(*ends));
  state->ends = ends == NULL ? state->ends : ends;
  return ends != NULL;
}

static void note_absence(struct fm_subscription * state, int64_t now)
{
  if (fm_subscription_publishers(state).n > 0) {
    state->absent_since = 0;
  } else if (state->absent_since == 0) {
    state->absent_since = now;
  }
}

void fm_subscription_begin(
  struct fm_subscription * state, const struct fm_offer * offers, uint32_t n_offers, int64_t now)
{
  if (note_publishers(state, offers, n_offers, now)) {
    state->current = state->wanted = wanted_request(state);
    state->has_new = false;
    note_absence(state, now);
  }
}

bool fm_subscription_is_abandoned(const struct fm_subscription * state, int64_t now)
{
  return state->absent_since != 0 && now - state->absent_since >= FM_LOOK_AGAIN_NS;
}

struct fm_decision fm_subscription_decide(
  struct fm_subscription * state, const struct fm_offer * offers, uint32_t n_offers,
  uint64_t matched, int64_t now)
{
  struct fm_decision decision = {0, false, false, state->current};
  if (!note_publishers(state, offers, n_offers, now)) {
    return decision;
  }
  note_absence(state, now);
  state->wanted = wanted_request(state);
  decision.n_ended = end_replaced(state, matched, now);
  decision.ends_handover = state->n_replaced == 0 && state->handover_ends != 0 &&
    now >= state->handover_ends;
  if (decision.ends_handover) {
    state->handover_ends = 0;
  }
  state->has_new = state->has_new && !is_same(&state->wanted, &state->current);
  decision.subscribes = state->has_new && (state->retry == 0 || now >= state->retry_at) &&
    has_room(state);
  decision.request = state->wanted;
  state->is_subscribing = decision.subscribes;
  return decision;
}

// ---- lines -------------------------------------------------------------------------------------

void fm_add_other_type(
  struct fm_lines * lines, const char * topic, const char * type, const char * pattern,
  const char * wanted)
{
  fm_lines_add(lines, FM_WARN,
    "%s is of type %s, where the bundle says %s of %s: it is not received", topic, type, wanted,
    pattern);
}

static void log_renewed(
  const struct fm_subscription * state, const struct fm_request * before, struct fm_lines * lines)
{
  const char * who = NULL;
  for (uint32_t k = 0; k < state->n_publishers && who == NULL; ++k) {
    who = is_missed(before, &state->publishers[k]) ? state->publishers[k].who : NULL;
  }
  fm_lines_add(lines, FM_INFO, "subscribed anew to %s (%s) %s%s", state->topic,
    described_request(&state->current),
    who == NULL ? "as its publishers offer it" : "to receive from ", who == NULL ? "" : who);
}

static void note_success(struct fm_subscription * state, int64_t now, struct fm_lines * lines)
{
  const struct fm_request before = state->current;
  state->current = state->wanted;
  state->ends[state->n_replaced++] = now + OVERLAP_NS;
  state->retry = 0;
  state->has_new = false;
  log_renewed(state, &before, lines);
}

// Attempts get rarer, and only the first failure is logged. The handover may have begun.
static void note_failure(
  struct fm_subscription * state, const char * problem, int64_t now, struct fm_lines * lines)
{
  if (state->retry == 0) {
    fm_lines_add(lines, FM_ERROR,
      "cannot subscribe anew to %s (%s): %s; the subscription before is kept, and there are "
      "further attempts", state->topic, described_request(&state->wanted), problem);
  }
  state->retry = fm_retry_wait(state->retry);
  state->retry_at = now + state->retry;
  state->handover_ends = now + GRACE_NS;
}

static void note_outcome(
  struct fm_subscription * state, const char * problem, int64_t now, struct fm_lines * lines)
{
  if (state->is_subscribing && problem == NULL) {
    note_success(state, now, lines);
  } else if (state->is_subscribing) {
    note_failure(state, problem, now, lines);
  } else if (state->retry != 0 && is_same(&state->wanted, &state->current)) {
    state->retry = 0;
    fm_lines_add(
      lines, FM_INFO, "no other subscription to %s is needed any more", state->topic);
  }
  state->is_subscribing = false;
}

static void log_type(
  struct fm_subscription * state, const struct publisher * publisher, struct fm_lines * lines)
{
  struct fm_text key = {NULL, 0, 0};
  fm_text_add(&key, "|%s|", publisher->type);
  if (strstr(fm_text_get(&state->logged_types), fm_text_get(&key)) == NULL) {
    fm_text_add(&state->logged_types, "%s", fm_text_get(&key));
    fm_lines_add(lines, FM_ERROR,
      "%s publishes %s on %s, where the bundle says %s: its messages are not received",
      publisher->who, publisher->type, state->topic, state->type);
  }
  fm_text_free(&key);
}

// What does not match what is wanted is kept out by what is fixed.
static void log_unmatched(
  const struct fm_subscription * state, const struct publisher * publisher,
  struct fm_lines * lines)
{
  const bool is_unreliable = state->wanted.is_reliable && !publisher->is_reliable;
  const bool is_volatile = state->wanted.is_durable && !publisher->is_durable;
  fm_lines_add(lines, FM_ERROR,
    "%s does not match the subscription to %s: it offers %s; the subscription requests %s, by "
    "`qos` or `qos_overrides`: leave %s%s%s out there", publisher->who, state->topic,
    described(publisher->is_reliable, publisher->is_durable), described_request(&state->wanted),
    is_unreliable ? "`reliability`" : "", is_unreliable && is_volatile ? " and " : "",
    is_volatile ? "`durability`" : "");
}

// Whether a publisher is not received, and not logged yet.
static bool is_unlogged(const struct fm_subscription * state, const struct publisher * publisher)
{
  return !publisher->is_logged &&
         (!publisher->is_ours || is_missed(&state->wanted, publisher));
}

static void log_publishers(struct fm_subscription * state, int64_t now, struct fm_lines * lines)
{
  for (uint32_t k = 0; k < state->n_publishers; ++k) {
    struct publisher * publisher = &state->publishers[k];
    if (!is_unlogged(state, publisher) ||
      (!publisher->is_named && now < publisher->since + NAMED_NS))
    {
      continue;
    }
    publisher->is_logged = true;
    if (publisher->is_ours) {
      log_unmatched(state, publisher, lines);
    } else {
      log_type(state, publisher, lines);
    }
  }
}

static void log_losses(
  struct fm_subscription * state, uint64_t lost, int64_t now, struct fm_lines * lines)
{
  const uint64_t more = lost - state->logged_losses;
  if (lost > state->logged_losses && fm_passes(&state->next_loss_line, now, LOSSES_NS)) {
    state->logged_losses = lost;
    fm_lines_add(lines, FM_WARN,
      "%" PRIu64 " message%s lost on %s since the last such message: a queue overflowed "
      "(`qos: {depth: ...}`), or the network dropped them", more, more == 1 ? " was" : "s were",
      state->topic);
  }
}

// ---- conclusions -------------------------------------------------------------------------------

static void note_mismatches(struct fm_subscription * state)
{
  const char ** words = calloc(2u * state->n_publishers + 1u, sizeof(*words));
  if (words == NULL) {
    return;
  }
  const char ** types = words + state->n_publishers;
  uint32_t n_words = 0;
  uint32_t n_types = 0;
  for (uint32_t k = 0; k < state->n_publishers; ++k) {
    const struct publisher * publisher = &state->publishers[k];
    if (!publisher->is_ours) {
      types[n_types++] = publisher->type;
    } else if (is_missed(&state->current, publisher)) {
      words[n_words++] = publisher->who;
    }
  }
  fm_text_sort(&state->unmatched, words, n_words);
  fm_text_sort(&state->other_types, types, n_types);
  free(words);
}

void fm_subscription_conclude(
  struct fm_subscription * state, const char * problem, uint64_t lost, int64_t now,
  struct fm_lines * lines)
{
  note_outcome(state, problem, now, lines);
  note_mismatches(state);
  log_publishers(state, now, lines);
  log_losses(state, lost, now, lines);
}

bool fm_subscription_is_settled(const struct fm_subscription * state, uint64_t lost)
{
  bool is_settled = state->n_replaced == 0 && state->handover_ends == 0 && state->retry == 0 &&
    !state->has_new && lost == state->logged_losses;
  for (uint32_t k = 0; k < state->n_publishers; ++k) {
    is_settled = is_settled && !is_unlogged(state, &state->publishers[k]);
  }
  return is_settled;
}
