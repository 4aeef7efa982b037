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

from itertools import product

from fret_monitor.ros.settings.qos import DEFAULT_DEPTH, matches, wanted_profile
import pytest
from rclpy.qos import (
    DurabilityPolicy, HistoryPolicy, qos_check_compatible, QoSCompatibility, QoSProfile,
    ReliabilityPolicy,
)

RELIABILITY = (ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT)
DURABILITY = (DurabilityPolicy.VOLATILE, DurabilityPolicy.TRANSIENT_LOCAL)
OFFERS = [QoSProfile(depth=1, reliability=reliability, durability=durability)
          for reliability, durability in product(RELIABILITY, DURABILITY)]


def kinds(profile: QoSProfile) -> tuple[ReliabilityPolicy, DurabilityPolicy]:
    return profile.reliability, profile.durability


def test_without_a_publisher_the_subscription_requests_the_least() -> None:
    assert kinds(wanted_profile((), {})) == (
        ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE)


@pytest.mark.parametrize('offers', list(product(OFFERS, OFFERS)))
def test_every_publisher_is_received_with_the_best_qos_it_offers(
    offers: tuple[QoSProfile, QoSProfile],
) -> None:
    wanted = wanted_profile(offers, {})
    assert all(matches(wanted, offer) for offer in offers)
    for better in OFFERS:
        if all(matches(better, offer) for offer in offers):
            # The enumerations are ordered: reliable is 1, best effort 2; transient local is 1.
            assert wanted.reliability.value <= better.reliability.value
            assert wanted.durability.value <= better.durability.value


@pytest.mark.parametrize(('offer', 'request_'), list(product(OFFERS, OFFERS)))
def test_compatible_profiles_are_those_that_the_middleware_calls_compatible(
    offer: QoSProfile, request_: QoSProfile,
) -> None:
    compatibility, _ = qos_check_compatible(offer, request_)
    assert matches(request_, offer) is (compatibility != QoSCompatibility.ERROR)


def test_publishers_do_not_change_what_the_bundle_sets() -> None:
    fixed: dict[str, str | int] = {
        'reliability': 'best_effort', 'durability': 'volatile', 'depth': 3,
        'history': 'keep_all'}
    wanted = wanted_profile([OFFERS[1]], fixed)
    assert kinds(wanted) == (ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE)
    assert wanted.history is HistoryPolicy.KEEP_ALL
    assert wanted_profile([], {'depth': 3}).depth == 3
    assert wanted_profile([], {}).depth == DEFAULT_DEPTH
    assert kinds(wanted_profile([], {'reliability': 'reliable'}))[0] is ReliabilityPolicy.RELIABLE
