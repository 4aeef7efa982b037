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

"""A gate whose process is stopped: what waits for it meanwhile is judged in order of reception."""

from pathlib import Path
import signal

from bundles import write_bundle
import pytest
from ros.harness import Partner
from ros.test_gates_side_by_side import both_gates, Feeder, PLAIN
from strategies import thorough

MANY = 25
BEFORE = 90  # less than the depth of the queue


@thorough
@pytest.mark.parametrize('hot_path', ['on', 'off'])
def test_commands_behind_a_lower_limit_are_judged_by_it_after_a_stop(
    partner: Partner, tmp_path: Path, hot_path: str,
) -> None:
    path = write_bundle(tmp_path, PLAIN.text)
    with both_gates(path, more=('-p', f'hot_path:={hot_path}')) as gates:
        feeder = Feeder(partner, gates, is_simulated=False)
        feeder.near(False)
        feeder.judge(2.0)
        before = [gate.sent[:] for gate in gates]
        for gate in gates:
            gate.process.process.send_signal(signal.SIGSTOP)
        for _ in range(BEFORE):  # reading them takes longer than judging the first command
            feeder.publish_near(False)
        feeder.publish_near(True)
        commands = [value for _ in range(MANY) for value in (1.5, 0.5)]
        feeder.publish(*commands)
        for gate in gates:
            gate.process.process.send_signal(signal.SIGCONT)
        feeder.judge(0.75)
        feeder.near(False)
        feeder.judge(1.25)
        for gate, first in zip(gates, before):
            assert gate.sent == [*first, *[0.5] * MANY, 0.75, 1.25], gate.name
            assert gate.counts('gate drive')['withheld, violating'] == str(MANY)
