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

"""Publishers of every QoS on one topic, early and late: each message is one step."""

from pathlib import Path
from time import sleep

from bundles import NEGATIVE, write_bundle
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from ros.harness import BEST_EFFORT, LATCHED, Partner, RELIABLE, started, wait_until
from std_msgs.msg import Int32
from strategies import HOT_PATHS

LATCHED_BEST_EFFORT = QoSProfile(
    depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.TRANSIENT_LOCAL)
KINDS = {'reliable': RELIABLE, 'best effort': BEST_EFFORT, 'latched': LATCHED,
         'latched best effort': LATCHED_BEST_EFFORT}


@pytest.mark.parametrize('hot_path', HOT_PATHS)
@pytest.mark.parametrize('first', KINDS)
def test_late_publishers_of_every_qos_are_received_beside_one_that_never_stops(
    partner: Partner, tmp_path: Path, first: str, hot_path: str,
) -> None:
    bundle = write_bundle(tmp_path, NEGATIVE)
    with started('monitor', '-p', f'spec:={bundle}', '-p', f'hot_path:={hot_path}'):
        partner.listen('R')
        steady = partner.publisher(Int32, 'n', KINDS[first])
        partner.wait_for_listener(steady)
        sent = 0

        def go_on(pauses: int) -> None:
            nonlocal sent
            for _ in range(pauses):
                steady.publish(Int32(data=sent))
                sent += 1
                sleep(0.01)

        for kind in KINDS:
            publisher = partner.publisher(Int32, 'n', KINDS[kind])

            def is_heard() -> bool:
                go_on(1)
                return publisher.get_subscription_count() > 0  # noqa: B023  called at once

            wait_until(is_heard, f'a listener to the {kind} one')
            go_on(30)  # discovery is not symmetric: the reader matches a moment after the writer
            for number in range(20):
                publisher.publish(Int32(data=number))
                sent += 1
                go_on(1)
            partner.expect({'R': sent})
