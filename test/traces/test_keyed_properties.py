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
Properties of first-order monitors that need one key, beside their definitions on events.

A file that is closed was opened before, and not closed since (FILE of DejaVu). A lock is taken
only while it is free, and released only while it is taken (LOCKS, without its threads).
"""

from pathlib import Path
from random import Random

from bundles import write_bundle
from fret_monitor.start import start
from fret_monitor.traces.simulate import simulate
import pytest

FILE = """
format: 1
for_each: {key: {most: 20}}
inputs:
  begins: {topic: "/{key}/begins", type: std_msgs/msg/Bool}
  ends: {topic: "/{key}/ends", type: std_msgs/msg/Bool}
requirements:
  - {id: ENDS, ptltl: "ends -> Y (!ends S begins)"}
  - {id: BEGINS, ptltl: "begins -> Z !(!ends S begins)"}
  - {id: FEW, ptltl: "count(key: !ends S begins) <= 8"}
"""


@pytest.mark.parametrize('seed', range(3))
def test_events_of_each_key_are_judged_as_their_definition_says(
        seed: int, tmp_path: Path) -> None:
    rng, lines, expected = Random(seed), ['key,begins,ends'], ['step,key,ENDS,BEGINS,FEW']
    is_open: set[str] = set()
    for step in range(400):
        key, begins = f'k{rng.randrange(20)}', rng.random() < 0.5
        lines.append(f'{key},{int(begins)},{int(not begins)}')
        ends_well, begins_well = begins or key in is_open, not begins or key not in is_open
        is_open = is_open | {key} if begins else is_open - {key}
        expected.append(f'{step},{key},{int(ends_well)},{int(begins_well)},'
                        f'{int(len(is_open) <= 8)}')
    trace, out = tmp_path / 'trace.csv', tmp_path / 'out.csv'
    trace.write_text('\n'.join([*lines, '']), encoding='utf-8')
    monitor = start(write_bundle(tmp_path, FILE), takes_instances=True).monitor
    simulate(monitor, trace, out)
    assert out.read_text(encoding='utf-8').splitlines() == expected
    assert len({line.split(',', 2)[2] for line in expected[1:]}) > 4
