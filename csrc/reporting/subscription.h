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

/// subscription.h: the decisions of a subscription: which quality of service, when it is replaced.
///
/// A subscription matches a publisher only if it requests no more than the publisher offers. So it
/// requests the most that all known publishers offer, and the least while there is none. What the
/// bundle or a `qos_overrides` fixes stays. When publishers come that ask for another request, the
/// subscription is replaced. In this handover the old one is kept until all publishers have
/// discovered the new one, and messages are expected twice.
///
/// The node subscribes and closes. It looks for the publishers of a topic, calls
/// fm_subscription_decide, does what was decided, and calls fm_subscription_conclude: for all
/// topics when the graph has changed, and every FM_LOOK_AGAIN_NS without; for a topic that is not
/// settled, which it asks for once a second, until it is.
///
/// One thread at a time. Times are CLOCK_MONOTONIC in nanoseconds. When memory is short, nothing
/// is decided in this round.

#ifndef SUBSCRIPTION_H_
#define SUBSCRIPTION_H_

#include "handover.h"
#include "lines.h"

/// Messages in the queue of a subscription: 0.1 s of a topic at 1 kHz. With images of 1 MB a full
/// queue takes 100 MB, which `qos: {depth: 1}` avoids.
#define FM_USUAL_DEPTH 100u

/// How often the node looks for publishers, and for those of how many topics. A look takes up to
/// 50 us, so that a graph that keeps changing takes at most 1 % of a processor. The first look is
/// a while after the change: the middleware learns of a publisher before it learns of its node.
#define FM_LOOK_DELAY_NS 100000000
#define FM_LOOK_PERIOD_NS 250000000
#define FM_LOOKS_AT_ONCE 50u
#define FM_LOOK_AGAIN_NS 10000000000

/// After a failure to subscribe, until the next attempt; each further one doubles it, up to the
/// most.
#define FM_RETRY_NS 1000000000
#define FM_RETRY_MOST_NS 60000000000

/// How long to wait after a failure; `before`: after the last one, 0 at the first. O(1).
static inline int64_t fm_retry_wait(int64_t before)
{
  const int64_t doubled = before == 0 ? FM_RETRY_NS : 2 * before;
  return doubled < FM_RETRY_MOST_NS ? doubled : FM_RETRY_MOST_NS;
}

/// What is fixed of a policy.
enum fm_choice
{
  FM_FOLLOW = 0,  // as the publishers offer; of `history`: keep last
  FM_WEAKER = 1,  // best effort, volatile, keep last
  FM_STRONGER = 2 // reliable, transient local, keep all
};

/// What the bundle or a `qos_overrides` fixes.
struct fm_fixed_qos
{
  enum fm_choice reliability;
  enum fm_choice durability;
  enum fm_choice history;
  uint32_t depth;  // messages; 0: the default
};

/// The quality of service of a subscription.
struct fm_request
{
  bool is_reliable;  // otherwise best effort
  bool is_durable;   // transient local; otherwise volatile
  bool keeps_all;    // otherwise the last `depth` messages
  uint32_t depth;
};

/// A publisher on the topic, as the node has discovered it.
struct fm_offer
{
  uint8_t gid[FM_GID_BYTES];
  const char * node;        // its name; the middleware may not know it yet
  const char * name_space;  // of the node
  const char * type;        // package/msg/Name
  bool is_reliable;
  bool is_durable;
};

/// What the node has to do, in this order.
struct fm_decision
{
  uint32_t n_ended;     // close so many of the replaced subscriptions: the oldest ones
  bool ends_handover;   // expect no message twice from now on
  bool subscribes;      // subscribe with `request` instead; the subscription before is replaced
  struct fm_request request;
};

/// The known publishers of a topic, for reports. Valid until the next review.
struct fm_publishers
{
  uint32_t n;                // of the topic's type
  const char * unmatched;    // nodes whose publishers are not received: sorted, with commas
  const char * other_types;  // of the other publishers: sorted, with commas
};

struct fm_subscription;

/// Add the full name of a publisher's node, or that it is not known, which
/// fm_offer_is_unnamed says: the middleware discovers the node a moment later.
FM_INTERNAL void fm_offer_name(struct fm_text * text, const struct fm_offer * offer);
FM_INTERNAL bool fm_offer_is_unnamed(const struct fm_offer * offer);

/// Make the state of a topic's subscription, which requests the least at first. `topic` is the
/// full name, `type` package/msg/Name; both are copied. NULL if memory is short.
FM_EXPORT struct fm_subscription * fm_subscription_create(
  const char * topic, const char * type, const struct fm_fixed_qos * fixed);

/// Free it. NULL is allowed.
FM_EXPORT void fm_subscription_destroy(struct fm_subscription * state);

/// Before subscribing to a topic that was found in the graph: request what its publishers offer at
/// once, so that no handover follows. O(publishers^2).
FM_EXPORT void fm_subscription_begin(
  struct fm_subscription * state, const struct fm_offer * offers, uint32_t n_offers, int64_t now);

/// Whether there has been no publisher of the type for FM_LOOK_AGAIN_NS. O(1).
FM_EXPORT bool fm_subscription_is_abandoned(const struct fm_subscription * state, int64_t now);

/// Return the quality of service of the present subscription.
FM_EXPORT struct fm_request fm_subscription_request(const struct fm_subscription * state);

/// Decide what to do. `matched`: the publishers that the present subscription has matched.
/// O(publishers^2).
FM_EXPORT struct fm_decision fm_subscription_decide(
  struct fm_subscription * state, const struct fm_offer * offers, uint32_t n_offers,
  uint64_t matched, int64_t now);

/// Note that what was decided is done; log it, and the publishers that are not received.
/// `problem`: why the present subscription could not be replaced, or NULL. `lost`: the messages
/// that the topic has lost. O(publishers log publishers).
FM_EXPORT void fm_subscription_conclude(
  struct fm_subscription * state, const char * problem, uint64_t lost, int64_t now,
  struct fm_lines * lines);

/// Whether the next look can wait until the graph changes: nothing is due by its time, and no loss
/// is to be logged. `lost` as in fm_subscription_conclude. O(publishers).
FM_EXPORT bool fm_subscription_is_settled(
  const struct fm_subscription * state, uint64_t lost);

/// Add the line about a topic whose name fits `pattern`, a name with an instance variable, and
/// that is of another type than `wanted`.
FM_INTERNAL void fm_add_other_type(
  struct fm_lines * lines, const char * topic, const char * type, const char * pattern,
  const char * wanted);

/// Return the publishers of the last review.
FM_EXPORT struct fm_publishers fm_subscription_publishers(const struct fm_subscription * state);

#endif  // SUBSCRIPTION_H_
