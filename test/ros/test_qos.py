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

from fret_monitor.native import evaluator_library, load_evaluator
from fret_monitor.ros.intake.feed import offer_of
from fret_monitor.ros.settings.qos import profile_of
from fret_monitor.runtime.subscription import Request, SubscriptionState
import pytest
from rclpy.qos import (
    DurabilityPolicy, HistoryPolicy, qos_check_compatible, QoSCompatibility, QoSProfile,
    ReliabilityPolicy,
)
from rclpy.topic_endpoint_info import TopicEndpointInfo

OFFERS = [QoSProfile(depth=1, reliability=reliability, durability=durability)
          for reliability, durability in product(
              (ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT),
              (DurabilityPolicy.VOLATILE, DurabilityPolicy.TRANSIENT_LOCAL))]


@pytest.mark.parametrize(('offer', 'request_'), list(product(OFFERS, OFFERS)))
def test_publishers_are_received_that_the_middleware_calls_compatible(
    offer: QoSProfile, request_: QoSProfile,
) -> None:
    state = SubscriptionState(load_evaluator(evaluator_library()), '/x', 'a', {
        'reliability': request_.reliability.name.lower(),
        'durability': request_.durability.name.lower()})
    state.decide([offer_of(TopicEndpointInfo(
        node_name='n', node_namespace='/', topic_type='a', endpoint_gid=[0] * 16,
        qos_profile=offer))], 0, 1)
    state.conclude(None, 0, 1)
    compatibility, _ = qos_check_compatible(offer, profile_of(state.request))
    assert (not state.publishers.unmatched) is (compatibility != QoSCompatibility.ERROR)


def test_a_request_is_a_profile_of_the_middleware() -> None:
    weak, strong = Request(False, False, False, 3), Request(True, True, True, 4)
    assert profile_of(weak) == QoSProfile(
        depth=3, history=HistoryPolicy.KEEP_LAST, reliability=ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.VOLATILE)
    assert profile_of(strong) == QoSProfile(
        depth=4, history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL)
