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

"""Bundles of random texts: what `bag` finds is what the reference evaluators say."""

from pathlib import Path
from random import Random

from bag.random_texts import (
    bundle, expected, INPUTS, lowered, random_value, recorded, TICK_NS, TOPICS, Words,
)
from bag.recordings import TYPES
from bag.reference import Message
from fret_monitor import build
from fret_monitor.model.policies import Policy
import pytest
from strategies import EXAMPLES


def messages(rng: Random, policy: Policy) -> list[Message]:
    """Return messages at ticks, several at one; under `timed` these are a nanosecond apart."""
    found: list[Message] = []
    now = 100 * TICK_NS

    def add(topic: str, value: float) -> None:
        kind = TYPES.types[f'std_msgs/msg/{TOPICS[topic]}']
        earliest = found[-1].received + 1 if found and policy is Policy.TIMED else 0
        content = kind(bool(value) if TOPICS[topic] == 'Bool' else value)
        found.append(Message(f'/{topic}', max(now, earliest), content))

    for topic in INPUTS:
        add(topic, rng.randrange(2))
    for _ in range(40):
        for topic in rng.choices(INPUTS, k=rng.choice([0, 1, 1, 2, 3])):
            add(topic, random_value(rng, topic))
        now += rng.choice([TICK_NS, TICK_NS, TICK_NS // 2, TICK_NS // 2 + 1, TICK_NS - 1])
        add('probe', 1)
    now += 30 * TICK_NS
    add('probe', 1)
    return found


@pytest.mark.parametrize('seed', range(max(1, EXAMPLES // 25)))
@pytest.mark.parametrize('policy', Policy)
def test_random_texts_have_the_occurrences_of_the_reference(
        tmp_path: Path, policy: Policy, seed: int) -> None:
    rng = Random(f'{policy.value} {seed}')
    path = tmp_path / 'bundle.yaml'
    path.write_text(bundle(Words(rng, policy), 24), encoding='utf-8')
    stream = messages(rng, policy)
    due = expected(lowered(build.read(path).specification), stream, {})
    assert recorded(path, stream, tmp_path / 'recording') == due
    assert len(due) > 20
