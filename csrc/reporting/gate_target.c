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

/// gate_target.c: see gate_target.h for the contract.

#include "gate_target.h"

#include <stdlib.h>
#include <string.h>

#define DURABLE_DEPTH 10u         // messages that a late subscriber receives
#define MATCHED_NS (FM_SECOND / 2)  // until a new publisher is used, at most
#define UNNAMED_LOOKS 8u          // at a publisher without the name of its node, until it counts

struct fm_gate_target
{
  char * node;
  uint32_t depth;
  bool is_durable;         // the publisher in use
  bool has_next;
  int64_t next_at;         // when the next one is used at the latest
  uint8_t (* gids)[FM_GID_BYTES];  // of all publishers that the node has made
  uint32_t n_gids;
  uint32_t most_gids;
  uint32_t unnamed_looks;
  struct fm_text others;
};

struct fm_gate_target * fm_gate_target_create(const char * node, uint32_t depth)
{
  struct fm_gate_target * state = calloc(1, sizeof(*state));
  if (state == NULL) {
    return NULL;
  }
  state->depth = depth;
  state->node = fm_copy_of(node);
  if (state->node == NULL) {
    free(state);
    return NULL;
  }
  return state;
}

void fm_gate_target_destroy(struct fm_gate_target * state)
{
  if (state != NULL) {
    fm_text_free(&state->others);
    free(state->gids);
    free(state->node);
    free(state);
  }
}

// ---- the publisher -----------------------------------------------------------------------------

static uint32_t depth_of(const struct fm_gate_target * state, bool is_durable)
{
  const uint32_t usual = is_durable ? DURABLE_DEPTH : FM_USUAL_DEPTH;
  return state->depth == 0 ? usual : state->depth;
}

struct fm_target_decision fm_gate_target_first(const struct fm_gate_target * state)
{
  return (struct fm_target_decision) {
    false, true, state->is_durable, depth_of(state, state->is_durable)};
}

void fm_gate_target_note(struct fm_gate_target * state, const uint8_t * gid)
{
  void * moved = fm_with_room(
    state->gids, state->n_gids, &state->most_gids, sizeof(*state->gids));
  if (moved != NULL) {
    state->gids = moved;
    memcpy(state->gids[state->n_gids++], gid, FM_GID_BYTES);
  }
}

struct fm_target_decision fm_gate_target_follow(
  struct fm_gate_target * state, bool is_durable, int64_t now)
{
  const bool is_wanted = state->has_next ? !state->is_durable : state->is_durable;
  struct fm_target_decision decision =
  {false, false, is_durable, depth_of(state, is_durable)};
  if (is_wanted != is_durable) {
    decision.drops_next = state->has_next;
    decision.advertises = is_durable != state->is_durable;
    state->has_next = decision.advertises;
    state->next_at = now + MATCHED_NS;
  }
  return decision;
}

void fm_gate_target_fail(struct fm_gate_target * state)
{
  state->has_next = false;
}

bool fm_gate_target_review(
  struct fm_gate_target * state, uint64_t matched, uint64_t next_matched, int64_t now)
{
  if (!state->has_next || (next_matched < matched && now < state->next_at)) {
    return false;
  }
  state->has_next = false;
  state->is_durable = !state->is_durable;
  return true;
}

// ---- others ------------------------------------------------------------------------------------

static bool is_made_here(const struct fm_gate_target * state, const struct fm_offer * offer)
{
  for (uint32_t k = 0; k < state->n_gids; ++k) {
    if (memcmp(state->gids[k], offer->gid, FM_GID_BYTES) == 0) {
      return true;
    }
  }
  return false;
}

static bool is_of_this_node(const struct fm_gate_target * state, const struct fm_offer * offer)
{
  struct fm_text name = {NULL, 0, 0};
  fm_offer_name(&name, offer);
  const bool is_own = strcmp(fm_text_get(&name), state->node) == 0;
  fm_text_free(&name);
  return is_own;
}

// The place of the node's own publisher, for a middleware that lists other identities; `n`: none.
static uint32_t place_of_own(
  const struct fm_gate_target * state, const struct fm_offer * offers, uint32_t n)
{
  uint32_t found = n;
  for (uint32_t k = 0; k < n; ++k) {
    if (is_made_here(state, &offers[k])) {
      return n;
    }
    found = found == n && is_of_this_node(state, &offers[k]) ? k : found;
  }
  return found;
}

static const char * name_of(
  const struct fm_gate_target * state, const struct fm_offer * offer, struct fm_memory * memory)
{
  struct fm_text name = {NULL, 0, 0};
  fm_text_add(&name, "%s", is_of_this_node(state, offer) ? "another " : "");
  fm_offer_name(&name, offer);
  const char * copy = fm_reserve_text(memory, fm_text_get(&name));
  fm_text_free(&name);
  return copy;
}

void fm_gate_target_look(
  struct fm_gate_target * state, const struct fm_offer * offers, uint32_t n)
{
  const uint32_t own = place_of_own(state, offers, n);
  struct fm_memory memory = {NULL, false};
  const char ** names = fm_reserve(&memory, n, sizeof(*names));
  bool has_unnamed = false;
  uint32_t n_names = 0;
  for (uint32_t k = 0; names != NULL && k < n; ++k) {
    if (k == own || is_made_here(state, &offers[k])) {
      continue;
    }
    const bool is_unnamed = fm_offer_is_unnamed(&offers[k]);
    has_unnamed = has_unnamed || is_unnamed;
    if (!is_unnamed || state->unnamed_looks >= UNNAMED_LOOKS) {
      names[n_names++] = name_of(state, &offers[k], &memory);
    }
  }
  state->unnamed_looks = has_unnamed ? state->unnamed_looks + 1u : 0;
  if (!memory.is_short) {
    fm_text_sort(&state->others, names, n_names);
  }
  fm_memory_free(&memory);
}

const char * fm_gate_target_others(const struct fm_gate_target * state)
{
  return fm_text_get(&state->others);
}

bool fm_gate_target_is_settled(const struct fm_gate_target * state)
{
  return !state->has_next &&
         (state->unnamed_looks == 0 || state->unnamed_looks > UNNAMED_LOOKS);
}
