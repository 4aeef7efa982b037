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

/// handover.c: see handover.h for the contract.

#include "handover.h"

#include <stdlib.h>
#include <string.h>

#define N_KEYS 4096u

// Identifies a message among all of its topic.
struct fm_message_key
{
  int64_t sent;
  uint64_t sequence;
  uint8_t gid[FM_GID_BYTES];
};

static const uint8_t unknown[FM_GID_BYTES] = {0};

static const uint8_t * gid_of(const struct fm_origin * origin)
{
  return origin->gid == NULL ? unknown : origin->gid;
}

static bool has_number(const struct fm_origin * origin)
{
  return origin->sequence != 0 && origin->sequence != UINT64_MAX;
}

// The index of a publisher; n_publishers if it is not known.
static uint32_t find(const struct fm_arrivals * arrivals, const uint8_t * gid)
{
  uint32_t place = 0;
  while (place < arrivals->n_publishers &&
    memcmp(arrivals->publishers[place].gid, gid, FM_GID_BYTES) != 0)
  {
    place += 1;
  }
  return place;
}

// Move a publisher to the front, or insert a new one there. If all places are taken, the publisher
// that sent longest ago is removed.
static struct fm_publisher * bring_to_front(struct fm_arrivals * arrivals, const uint8_t * gid)
{
  struct fm_publisher * const front = &arrivals->publishers[0];
  uint32_t place = find(arrivals, gid);
  struct fm_publisher found = {{0}, 0, 0, INT64_MIN, 0, INT64_MIN};
  if (place < arrivals->n_publishers) {
    if (place == 0) {
      return front;
    }
    found = arrivals->publishers[place];
  } else {
    memcpy(found.gid, gid, FM_GID_BYTES);
    if (arrivals->n_publishers == FM_MOST_PUBLISHERS) {
      place -= 1;
    } else {
      arrivals->n_publishers += 1;
    }
  }
  memmove(front + 1, front, place * sizeof(found));
  *front = found;
  return front;
}

// ---- handover ----------------------------------------------------------------------------------

void fm_arrivals_begin_handover(struct fm_arrivals * arrivals, bool has_history)
{
  if (!arrivals->is_handover) {
    arrivals->lost_before = arrivals->lost;
    arrivals->n_keys = 0;
    arrivals->keys = malloc(N_KEYS * sizeof(*arrivals->keys));
  }
  for (uint32_t place = 0; place < arrivals->n_publishers; ++place) {
    struct fm_publisher * publisher = &arrivals->publishers[place];
    publisher->last_before = publisher->last;
    publisher->sent_before = publisher->sent;
  }
  arrivals->has_history = has_history || (arrivals->is_handover && arrivals->has_history);
  arrivals->is_handover = true;
}

void fm_arrivals_end_handover(struct fm_arrivals * arrivals)
{
  free(arrivals->keys);
  arrivals->keys = NULL;
  arrivals->is_handover = false;
}

static bool is_in_ring(const struct fm_arrivals * arrivals, const struct fm_origin * origin)
{
  const uint64_t n = arrivals->n_keys < N_KEYS ? arrivals->n_keys : N_KEYS;
  for (uint64_t k = 1; k <= n; ++k) {
    const struct fm_message_key * key = &arrivals->keys[(arrivals->n_keys - k) % N_KEYS];
    if (key->sent == origin->sent && key->sequence == origin->sequence &&
      memcmp(key->gid, gid_of(origin), FM_GID_BYTES) == 0)
    {
      return true;
    }
  }
  return false;
}

// Whether the old subscription had received this message or a later one when the handover began.
// Compares numbers where there are any, because a publisher's clock may be set back.
static bool is_from_before(const struct fm_publisher * publisher, const struct fm_origin * origin)
{
  return has_number(origin) ? origin->sequence <= publisher->last_before :
         origin->sent <= publisher->sent_before;
}

static bool is_older(const struct fm_publisher * publisher, const struct fm_origin * origin)
{
  return has_number(origin) ? origin->sequence < publisher->last :
         origin->sent < publisher->sent;
}

// Only messages of the new subscription can be history: those still queued in the old one are in
// order, and were not received before.
static bool is_history(const struct fm_arrivals * arrivals, const struct fm_origin * origin)
{
  const uint32_t place = find(arrivals, gid_of(origin));
  if (origin->is_retired || place == arrivals->n_publishers) {
    return false;
  }
  const struct fm_publisher * publisher = &arrivals->publishers[place];
  return is_from_before(publisher, origin) ||
         (arrivals->has_history && is_older(publisher, origin));
}

bool fm_arrivals_is_repeated(
  const struct fm_arrivals * arrivals, const struct fm_origin * origin)
{
  return arrivals->is_handover && (is_history(arrivals, origin) || is_in_ring(arrivals, origin));
}

// ---- losses ------------------------------------------------------------------------------------

static void remember_key(struct fm_arrivals * arrivals, const struct fm_origin * origin)
{
  if (arrivals->keys != NULL) {
    struct fm_message_key * key = &arrivals->keys[arrivals->n_keys % N_KEYS];
    key->sent = origin->sent;
    key->sequence = origin->sequence;
    memcpy(key->gid, gid_of(origin), FM_GID_BYTES);
    arrivals->n_keys += 1;
  }
}

static void note_missing(struct fm_arrivals * arrivals, uint64_t n)
{
  const uint64_t dropped = arrivals->dropped < n ? arrivals->dropped : n;
  arrivals->dropped -= dropped;
  arrivals->lost += n - dropped;
}

static void note_number(
  struct fm_arrivals * arrivals, struct fm_publisher * publisher, const struct fm_origin * origin)
{
  const uint64_t number = origin->sequence;
  if (publisher->first == 0) {
    publisher->first = number;
    publisher->last = number;
  } else if (number > publisher->last) {
    note_missing(arrivals, origin->gid == NULL ? 0 : number - publisher->last - 1);
    publisher->last = number;
  } else if (arrivals->is_handover && publisher->first < number && number < publisher->last) {
    arrivals->lost -= arrivals->lost > 0 ? 1 : 0;  // it came late, and was counted as lost
  }
}

void fm_arrivals_note(struct fm_arrivals * arrivals, const struct fm_origin * origin)
{
  struct fm_publisher * publisher = bring_to_front(arrivals, gid_of(origin));
  publisher->sent = origin->sent > publisher->sent ? origin->sent : publisher->sent;
  remember_key(arrivals, origin);
  if (has_number(origin)) {
    note_number(arrivals, publisher, origin);
  }
}

uint64_t fm_arrivals_lost(const struct fm_arrivals * arrivals)
{
  return arrivals->is_handover ? arrivals->lost_before : arrivals->lost;
}
