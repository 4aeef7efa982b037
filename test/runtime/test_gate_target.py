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

"""What a gate publishes on: the durability of its publisher, its replacement, other publishers."""

from collections.abc import Sequence
from typing import Any

from fret_monitor.native import evaluator_library, load_evaluator
from fret_monitor.runtime.gate_target import GateTarget
from fret_monitor.runtime.subscription import Offer
import pytest

SECOND = 10**9
UNNAMED = '_NODE_NAME_UNKNOWN_'
OWN = b'g' * 16


@pytest.fixture
def target() -> GateTarget:
    made = GateTarget(load_evaluator(evaluator_library()), '/robot/gate', 0)
    made.note(OWN)
    return made


def members(decision: Any) -> tuple[bool, bool, bool, int]:
    return (decision.drops_next, decision.advertises, decision.is_durable, decision.depth)


def offer(node: str, gid: bytes = OWN, namespace: str = '/robot') -> Offer:
    return Offer(gid, node, namespace, 'std_msgs/msg/Bool', True, False)


def test_the_publisher_follows_the_durability_of_the_source(target: GateTarget) -> None:
    assert members(target.first) == (False, True, False, 100)
    assert members(target.follow(is_durable=False, now=0)) == (False, False, False, 100)
    assert members(target.follow(is_durable=True, now=0)) == (False, True, True, 10)
    assert [target.is_settled] == [False]
    assert members(target.follow(is_durable=True, now=1)) == (False, False, True, 10)
    assert not target.review(2, 1, SECOND // 2 - 1)
    assert target.review(2, 2, SECOND // 2 - 1)  # it has matched as many
    assert target.is_settled
    assert not target.review(2, 2, SECOND)
    assert members(target.follow(is_durable=False, now=SECOND)) == (False, True, False, 100)
    assert not target.review(2, 1, SECOND + SECOND // 2 - 1)
    assert target.review(2, 1, SECOND + SECOND // 2)  # it has not, and the time is over
    assert target.follow(is_durable=True, now=0).advertises


def test_a_publisher_that_is_not_used_yet_is_dropped_when_it_is_not_wanted_any_more(
        target: GateTarget) -> None:
    assert target.follow(is_durable=True, now=0).advertises
    assert members(target.follow(is_durable=False, now=1)) == (True, False, False, 100)
    assert target.is_settled
    assert target.follow(is_durable=True, now=2).advertises
    target.fail()
    assert target.is_settled and not target.review(0, 0, SECOND)
    assert target.follow(is_durable=True, now=3).advertises


def test_a_depth_of_the_bundle_stays() -> None:
    target = GateTarget(load_evaluator(evaluator_library()), '/gate', 3)
    assert target.first.depth == target.follow(is_durable=True, now=0).depth == 3


@pytest.mark.parametrize(('found', 'others'), [
    ([], ''),
    ([offer('gate')], ''),
    ([offer('gate'), offer('gate', b'h' * 16)], 'another /robot/gate'),
    ([offer('b', b'b' * 16), offer('gate'), offer('a', b'a' * 16), offer('b', b'c' * 16)],
     '/robot/a, /robot/b'),
    ([offer('gate', b'h' * 16), offer('x', b'x' * 16, '/')], '/x'),  # it lists other ids
])
def test_others_on_the_target_are_named(
        target: GateTarget, found: Sequence[Offer], others: str) -> None:
    target.look(found)
    assert target.others == others
    assert target.is_settled


def test_a_publisher_whose_node_is_not_known_is_named_after_some_looks(
        target: GateTarget) -> None:
    found = [offer('gate'), offer(UNNAMED, b'u' * 16)]
    for _ in range(8):
        target.look(found)
        assert [target.others, target.is_settled] == ['', False]
    target.look(found)
    assert [target.others, target.is_settled] == ['a publisher of no known node', True]
    target.look([offer('gate'), offer('late', b'u' * 16)])
    assert [target.others, target.is_settled] == ['/robot/late', True]
