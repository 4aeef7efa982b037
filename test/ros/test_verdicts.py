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

"""The verdicts that a node publishes with `verdicts:=true`, on both nodes, as `bag` judges."""

from collections.abc import Sequence
from functools import partial
from itertools import groupby
from pathlib import Path
from time import monotonic

from bag.recordings import verdicts_of, write
from bundles import write_bundle
from fret_monitor.bag.check import check_recording, Selection
from fret_monitor.bag.violations import open_violations
import pytest
from ros.exported import monitoring, NODES
from ros.harness import LATCHED, Partner, wait_until
from std_msgs.msg import Bool, Float64

BUNDLE = """
format: 1
inputs:
  x: {topic: x, type: std_msgs/msg/Float64, timeout: 60}
  never: {topic: never, type: std_msgs/msg/Float64}
requirements:
  - {id: LOW-1, ptltl: "x < 0.5"}
  - {id: "010", ptltl: "H (x < 0.8)", report: occurrence}
  - {id: NEVER, ptltl: "never < 0.5", report: onset}
"""
LOW, ALWAYS_LOW = '/copilot/verdict/LOW_1', '/copilot/verdict/prop010'
TOPICS = (LOW, ALWAYS_LOW, '/copilot/verdict/NEVER')
VALUES = (0.1, 0.6, 0.9, 0.7, 0.2, 0.95)


class Verdicts:
    """What comes on the topics of verdicts, with the time at which it came."""

    def __init__(self, partner: Partner) -> None:
        """Subscribe, and wait for the publishers."""
        self.found: dict[str, list[tuple[float, bool]]] = {topic: [] for topic in TOPICS}
        made = [partner.node.create_subscription(
            Bool, topic, partial(self._keep, topic), LATCHED) for topic in TOPICS]
        wait_until(lambda: all(item.get_publisher_count() == 1 for item in made), 'publishers')

    def _keep(self, topic: str, message: Bool) -> None:
        self.found[topic].append((monotonic(), message.data))

    def changes(self) -> dict[str, list[bool]]:
        """Return the verdicts of each topic, each once where it is repeated."""
        return {topic: [verdict for verdict, _ in groupby(item for _, item in kept)]
                for topic, kept in self.found.items() if kept}

    def are(self, values: Sequence[float]) -> bool:
        """Return whether they are those of values of x."""
        return self.changes() == {
            topic: [verdict for verdict, _ in groupby(item < limit for item in values)]
            for topic, limit in ((LOW, 0.5), (ALWAYS_LOW, 0.8))}


@pytest.mark.parametrize('face', NODES)
def test_verdicts_are_those_of_the_recording_and_are_repeated_each_second(
    tmp_path: Path, partner: Partner, face: str,
) -> None:
    bundle = write_bundle(tmp_path, BUNDLE)
    recording = write(tmp_path / 'bag', [('/x', k, value) for k, value in enumerate(VALUES)])
    with open_violations(tmp_path / 'out.mcap', '/') as mcap:
        check_recording(bundle, recording, Selection(may_miss=True), changes=[mcap])
    judged = {topic: [verdict for verdict, _ in groupby(item for _, item in found)]
              for topic, found in verdicts_of(tmp_path / 'out.mcap').items()}
    assert judged == {key: [True, False, True, False] for key in (LOW, ALWAYS_LOW)}
    x = partner.publisher(Float64, 'x')
    with monitoring(face, bundle, '-p', 'verdicts:=true'):
        verdicts = Verdicts(partner)
        partner.wait_for_subscriptions(1, x)
        for k, value in enumerate(VALUES):
            x.publish(Float64(data=value))
            wait_until(partial(verdicts.are, VALUES[:k + 1]), f'verdicts at {k}')
        assert verdicts.changes() == judged
        late = Verdicts(partner)  # it gets the last one, and each second another
        wait_until(lambda: all(len(late.found[topic]) >= 3 for topic in judged), 'repetitions')
        assert late.changes() == {key: [False] for key in judged}
        for topic in judged:
            first, second, third = (time for time, _ in late.found[topic][:3])
            assert third - second > 0.5 and third - first > 0.9


@pytest.mark.parametrize('face', NODES)
def test_without_the_parameter_there_is_no_topic_of_verdicts(
    tmp_path: Path, partner: Partner, face: str,
) -> None:
    with monitoring(face, write_bundle(tmp_path, BUNDLE)):
        def topics() -> set[str]:
            return {name for name, _ in partner.node.get_topic_names_and_types()}
        wait_until(lambda: '/copilot/violations' in topics(), 'the monitor')
        assert [name for name in topics() if 'verdict' in name] == []
