# Copyright 2026 The fret_monitor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
The quality of service of a subscription that matches every publisher (docs/ros.md).

A subscription matches a publisher only if it requests no more than the publisher offers. So it
requests the most that all discovered publishers offer, and the least while there is none. Policies
that the bundle fixes under `qos` stay as they are.
"""

from collections.abc import Iterable, Mapping

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

# Messages are queued only while others are processed. 100 messages are 0.1 s of a topic at 1 kHz.
# With images of 1 MB a full queue takes 100 MB, which `qos: {depth: 1}` avoids.
DEFAULT_DEPTH = 100

LARGEST_DEPTH = 2**31 - 1
DEFAULT_HANDLER_DEPTH = 1000
"""Violations that a slow listener of one handler may be behind before it loses some."""

RELIABILITY = {
    'reliable': ReliabilityPolicy.RELIABLE,
    'best_effort': ReliabilityPolicy.BEST_EFFORT,
}
DURABILITY = {
    'transient_local': DurabilityPolicy.TRANSIENT_LOCAL,
    'volatile': DurabilityPolicy.VOLATILE,
}
HISTORY = {
    'keep_last': HistoryPolicy.KEEP_LAST,
    'keep_all': HistoryPolicy.KEEP_ALL,
}


def violation_profile(depth: int) -> QoSProfile:
    """Return the profile that publishers of violations offer."""
    return QoSProfile(depth=depth, reliability=ReliabilityPolicy.RELIABLE,
                      durability=DurabilityPolicy.VOLATILE)


def violation_request(depth: int) -> dict[str, str | int]:
    """Return what the logger requests for violations, as `fixed` of `wanted_profile`."""
    return {'reliability': 'reliable', 'durability': 'volatile', 'depth': depth}


def wanted_profile(offers: Iterable[QoSProfile], fixed: Mapping[str, str | int]) -> QoSProfile:
    """
    Return the profile of a subscription that matches all of `offers`.

    `fixed` has the policies that the bundle fixes: `reliability` (reliable, best_effort),
    `durability` (volatile, transient_local), `history` (keep_last, keep_all), `depth`.
    """
    offered = tuple(offers)
    reliable = bool(offered) and all(
        offer.reliability is ReliabilityPolicy.RELIABLE for offer in offered)
    durable = bool(offered) and all(
        offer.durability is DurabilityPolicy.TRANSIENT_LOCAL for offer in offered)
    return QoSProfile(
        depth=int(fixed.get('depth', DEFAULT_DEPTH)),
        history=HISTORY[str(fixed.get('history', 'keep_last'))],
        reliability=RELIABILITY[
            str(fixed.get('reliability', 'reliable' if reliable else 'best_effort'))],
        durability=DURABILITY[
            str(fixed.get('durability', 'transient_local' if durable else 'volatile'))],
    )


def misfits(subscription: QoSProfile, offer: QoSProfile) -> list[str]:
    """Return the policies in which a subscription requests more than a publisher offers."""
    found = []
    if (subscription.reliability is ReliabilityPolicy.RELIABLE
            and offer.reliability is not ReliabilityPolicy.RELIABLE):
        found.append('reliability')
    if (subscription.durability is DurabilityPolicy.TRANSIENT_LOCAL
            and offer.durability is not DurabilityPolicy.TRANSIENT_LOCAL):
        found.append('durability')
    return found


def matches(subscription: QoSProfile, offer: QoSProfile) -> bool:
    """Return whether a subscription matches a publisher with this offer."""
    return not misfits(subscription, offer)


def same_request(one: QoSProfile, other: QoSProfile) -> bool:
    """Return whether two subscriptions request the same reliability and durability."""
    return one.reliability is other.reliability and one.durability is other.durability


def describe(profile: QoSProfile) -> str:
    """Return reliability and durability as text."""
    reliability = 'reliable' if profile.reliability is ReliabilityPolicy.RELIABLE \
        else 'best effort'
    durability = 'transient local' if profile.durability is DurabilityPolicy.TRANSIENT_LOCAL \
        else 'volatile'
    return f'{reliability}, {durability}'
